"""Values of runs that were computed here, by compiled loops: `results` needs NumPy alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastslow.kernels.loops import load_loop
from fastslow.simulation.loops import STEP_BENDS, STEP_VALUES, VALUES_BY_STEPS

Array = NDArray[np.float64]


def values_at(series: Array, starts: Array, times: Array) -> Array:
    """Columns at times inside a run, shape (columns, N)."""
    values = np.empty((series.shape[1], len(times)))
    load_loop(STEP_VALUES)(series, starts, -np.inf, np.inf, times, values)
    return values


def values_by_steps(series: Array, counts: NDArray[np.intp], offsets: Array) -> Array:
    """Columns at given numbers of offsets into each step, shape (columns, N)."""
    values = np.empty((series.shape[1], len(offsets)))
    load_loop(VALUES_BY_STEPS)(series, counts, offsets, values)
    return values


def bends_of_steps(series: Array, lengths: Array) -> Array:
    """Bounds of second derivatives, times the squared length, shape (columns, n_steps)."""
    bends = np.empty((series.shape[1], len(series)))
    load_loop(STEP_BENDS)(series, np.ascontiguousarray(lengths), bends)
    return bends
