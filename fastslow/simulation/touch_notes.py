"""Notes on motions that touch a discontinuity, a wall or a condition to rounding.

Whether the motion crosses it there is decided by rounding: it is taken to remain on its side.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from fastslow.results.stored.arithmetic import UnknownOperationError, value_of
from fastslow.results.stored.operations import SWITCH_VALUES
from fastslow.simulation.prepared_runs import Prepared, RunArrays

Array = NDArray[np.float64]

#: Value of a function below which it is zero, in roundings of its largest term: a step ends at a
#: touch, whose place is known to the root of the rounding, its height to the rounding.
TOUCH_ROUNDING = 64.0 * float(np.finfo(float).eps)


def notes_on_touches(prepared: Prepared, found: RunArrays, parameters: Array) -> list[str]:
    """Return a sentence for each function that a run touches to rounding, with the first time.

    Interfaces across which the rates are continuous, functions of clocks and tables, and walls and
    conditions in runs without dense output are not examined.
    """
    if not prepared.touchable:
        return []
    first: dict[str, float] = {}
    for time, name in (*_interfaces(prepared, found), *_conditions(prepared, found, parameters)):
        first.setdefault(name, prepared.direction * time)
    return [
        f"At t = {time:.6g} the motion touches {name} to rounding, and is taken not to cross it: "
        "decided by rounding."
        for name, time in first.items()
    ]


def _interfaces(prepared: Prepared, found: RunArrays) -> Iterator[tuple[float, str]]:
    """Yield times and names of discontinuities that are touched, from the list of crossings."""
    table, compiled = found.crossings, prepared.compiled
    names = prepared.shared["interfaces"]
    for row in np.flatnonzero((table[:, 2] == 0) & (table[:, 3] == table[:, 4])).tolist():
        number = int(table[row, 1])
        if not compiled.continuous[number]:
            yield float(table[row, 0]), f"the discontinuity {names[number]}"


def _conditions(
    prepared: Prepared, found: RunArrays, parameters: Array
) -> Iterator[tuple[float, str]]:
    """Yield times and names of walls, thresholds and conditions touched at the end of a step."""
    compiled, series = prepared.compiled, found.series
    names = [f"the wall of {name}" for name in compiled.resets[: compiled.n_walls]]
    names += [f"the threshold of {name}" for name in compiled.switches]
    names += ["the condition of an event"] * len(compiled.triggers)
    if not names or series is None or prepared.series or len(series) < 2:
        return
    n, times = compiled.n_states, np.append(found.steps[:, 0], found.place[0])
    columns = np.vstack([series[:, :, 0], found.place[1 : 1 + series.shape[1]]]).T
    values = {f"p{k}": value for k, value in enumerate(parameters[: len(compiled.parameters)])}
    values |= {f"y{k}": columns[k] for k in range(n)}
    values |= {f"w{k}": columns[n + k] for k in range(compiled.n_forcing)}
    values["t"] = prepared.direction * times
    own = compiled.n_forcing - len(compiled.switches)
    states = [columns[n + own + k] for k in range(len(compiled.switches))]
    for k, state in enumerate((*states, *[np.zeros(len(times))] * len(compiled.triggers))):
        place = compiled.switch_place + SWITCH_VALUES * k
        values |= {f"p{place}": state, f"p{place + 1}": 1.0 - state}
    inside = ~np.isin(times, found.resets[:, 0])
    gradients = prepared.model.operations.gradients[-len(names) :]
    for name, (terms, _) in zip(names, gradients, strict=True):
        try:
            parts = [np.broadcast_to(value_of(term, values), times.shape) for term in terms]
        except UnknownOperationError:
            continue
        height, size = np.sum(parts, axis=0), np.abs(parts).max(axis=0)
        # of a single term the size is that beside the touch
        size[1:-1] = np.max([size[:-2], size[1:-1], size[2:]], axis=0)
        zero = np.abs(height) <= TOUCH_ROUNDING * size
        clear = np.where(zero, 0.0, np.sign(height))
        touched = zero[1:-1] & inside[1:-1] & (clear[:-2] * clear[2:] > 0)
        yield from ((float(times[1 + k]), name) for k in np.flatnonzero(touched).tolist())
