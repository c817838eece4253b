"""Notes on rates of a run whose terms cancel to rounding errors."""

from __future__ import annotations

import ctypes

import numpy as np
from numpy.typing import NDArray

from fastslow.kernels.taylor.modes import RATES
from fastslow.simulation.prepared_runs import Prepared, RunArrays

Array = NDArray[np.float64]

#: Modulus of a number of the equations, a parameter or a state from which on terms may cancel that
#: are so much larger than the rates.
LARGE_NUMBER = 1e5

#: Steps examined, evenly spaced along a run, and changes of all numbers at each.
EXAMINED_STEPS, TRIALS = 6, 4

#: Size of these changes, in units of the last place.
LAST_PLACES = 3.0

#: Error of a state within a step by rounding of its rate, in units of the tolerance, that is noted.
NOTED_ERROR = 30.0

_SIGNATURE = ctypes.CFUNCTYPE(None, ctypes.c_int64, *[ctypes.c_void_p] * 3)


def notes_on_cancelled_terms(prepared: Prepared, found: RunArrays, parameters: Array) -> list[str]:
    """Return a note if rounding of the rates exceeds the tolerance of a run.

    Numbers are changed by some units of their last place. Of a smooth rate the second difference
    is then far below the rounding of its value, however much the rate depends on the numbers, so
    that it measures the rounding of its terms. What it moves a state by within a step is compared
    with the tolerance, along steps of the series, which are no longer than the state relaxes.
    Rates from tables are not examined, nor models without large numbers, in which terms cancel
    only if powers or exponentials are large.
    """
    compiled = prepared.compiled
    n, series = compiled.n_states, found.series
    if series is None or not len(series) or prepared.series or compiled.tables:
        return []
    ends = max(*map(abs, series[0, :n, 0].tolist()), *map(abs, found.place[1 : 1 + n].tolist()))
    if max(prepared.largest_number, ends) < LARGE_NUMBER:
        return []
    sizes = np.abs(series[:, :n, 0]).max(axis=0)
    usual = np.flatnonzero(found.steps[:, 3] == 0)
    chosen = usual[np.linspace(0, len(usual) - 1, EXAMINED_STEPS).astype(int)] if len(usual) else []
    worst, note = NOTED_ERROR, ""
    allowed = prepared.resolved.rtol * sizes
    random = np.random.default_rng(0)
    for row in dict.fromkeys(np.asarray(chosen).tolist()):
        time, length, mode, _ = found.steps[row].tolist()
        state = series[row, :n, 0]
        noise = _rounding(prepared, int(mode), time, state, parameters, random)
        with np.errstate(all="ignore"):
            error = np.nan_to_num(noise * length / allowed, nan=0.0, posinf=0.0)
        k = int(np.argmax(error))
        if error[k] > worst:
            worst = float(error[k])
            note = (
                f"Rounding decides this run: at t = {prepared.direction * time:.6g} terms cancel "
                f"that are far larger than the rate of {prepared.names[k]}, which is known to "
                f"{noise[k]:.1g} only: rewrite them, or scale the model."
            )
    return [note] if note else []


def _rounding(
    prepared: Prepared,
    mode: int,
    time: float,
    state: Array,
    parameters: Array,
    random: np.random.Generator,
) -> Array:
    """The rounding of each rate at a state: its largest second difference."""
    compiled, n = prepared.compiled, len(state)
    call, columns = _SIGNATURE(compiled.address), compiled.order + 1
    number = RATES * (len(compiled.modes) + compiled.n_interfaces) + mode
    inputs, values = np.zeros(1 + n + compiled.n_forcing), parameters.copy()
    rows, known = np.zeros(compiled.n_rows * columns), len(compiled.parameters)

    def rates(change: Array) -> Array:
        inputs[0], inputs[1 : 1 + n] = time, state * (1.0 + change[:n])
        values[:known] = parameters[:known] * (1.0 + change[n:])
        call(number, inputs.ctypes.data, values.ctypes.data, rows.ctypes.data)
        return rows[1 : n * columns : columns].copy()

    step = LAST_PLACES * float(np.finfo(float).eps)
    middle, largest = rates(np.zeros(n + known)), np.zeros(n)
    for _ in range(TRIALS):
        change = step * random.choice([-1.0, 1.0], n + known)
        # nothing is known beside an overflow
        with np.errstate(over="ignore", invalid="ignore"):
            second = np.abs(rates(change) - 2.0 * middle + rates(-change))
        largest = np.maximum(largest, np.where(np.isfinite(second), second, 0.0))
    return 0.5 * largest
