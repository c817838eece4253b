"""Slices of a trajectory: bounds of samples, and steps between two times."""

from __future__ import annotations

from math import comb

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import ArgumentError

Array = NDArray[np.float64]


def slice_bounds(wanted: slice, count: int, what: str) -> tuple[int, int]:
    """Return start and stop of a slice of consecutive samples.

    Raises
    ------
    ArgumentError
        For a slice that is empty or has a step.
    """
    start, stop, step = wanted.indices(count)
    if step != 1:
        raise ArgumentError(
            f"{what} is sliced with a step of 1, received {step}; slice its columns instead"
        )
    if stop <= start:
        raise ArgumentError(f"samples {start} to {stop} contain none of the {count} samples")
    return start, stop


def cut_steps(
    steps: Array, series: Array | None, begin: float, end: float
) -> tuple[Array, Array | None]:
    """Return the steps between two times with their series, cut at both."""
    first = max(int(np.searchsorted(steps[:, 0], begin, side="right")) - 1, 0)
    stop = max(int(np.searchsorted(steps[:, 0], end, side="left")), first + 1)
    steps = steps[first:stop].copy()
    series = None if series is None else series[first:stop]
    if len(steps):
        ahead = begin - steps[0, 0]
        if ahead > 0.0:
            steps[0, :2] += ahead, -ahead
            if series is not None:
                series = np.concatenate([expanded_about(series[0], ahead)[None], series[1:]])
        # the last step may extend beyond the end, and may also be the first
        steps[-1, 1] = max(min(steps[-1, 1], end - steps[-1, 0]), 0.0)
    return steps, series


def expanded_about(coefficients: Array, ahead: float) -> Array:
    """Re-expand a series about a later time, shape (columns, order + 1).

    Examples
    --------
    >>> expanded_about(np.array([[1.0, 2.0, 3.0]]), 2.0)
    array([[17., 14.,  3.]])
    """
    order = coefficients.shape[1] - 1
    shift = np.array(
        [
            [comb(k, j) * ahead ** (k - j) if k >= j else 0.0 for j in range(order + 1)]
            for k in range(order + 1)
        ]
    )
    return coefficients @ shift
