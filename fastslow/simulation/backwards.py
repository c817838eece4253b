"""Runs backwards in time: integrated in the time τ = −t, returned in the order of t."""

from __future__ import annotations

import ctypes
import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import ModelError
from fastslow.kernels.taylor.series import CompiledSeries
from fastslow.results.stored.arithmetic import value_of
from fastslow.results.stored.operations import Operations
from fastslow.results.stored.reversal import in_reversed_time
from fastslow.results.trajectory.steps.step_polynomials import (
    StepPolynomials,
    interpolated,
    nodes_for,
    values_at,
)
from fastslow.results.trajectory.steps.step_roots import find_roots
from fastslow.simulation.arguments import Simulated
from fastslow.simulation.instants import fill_instants
from fastslow.simulation.stepper.event_phases import NEAR_TANGENTIAL

Array = NDArray[np.float64]

_SIGNATURE = ctypes.CFUNCTYPE(None, ctypes.c_int64, *[ctypes.c_void_p] * 3)


@dataclass(frozen=True)
class Reversed:
    """A model in the time τ = −t, to be compiled."""

    model: Simulated

    def __post_init__(self) -> None:
        resets, switches = tuple(self.model.resets), tuple(self.model.switches)
        if resets or switches:
            what, them = ("reset", resets) if resets else ("switch", switches)
            raise ModelError(
                f"a run backwards in time cannot undo the {what} {them[0]} of this model: several "
                "states have the same one after it; expected t=(start, end) with start < end"
            )

    @property
    def operations(self) -> Operations:
        """The operations in reversed time."""
        return in_reversed_time(self.model.operations)

    @property
    def parameters(self) -> dict[str, float]:
        """Parameter values."""
        return dict(self.model.parameters)


def first_branching(
    compiled: CompiledSeries,
    operations: Operations,
    parameters: Array,
    steps: Array,
    series: Array,
    crossings: Array,
) -> float | None:
    """Return the first time τ from which a backward run is not unique, None without one.

    Sliding ends at a tangency of the vector field of one side, while that of the other side
    points to the interface. Where a run backwards touches the interface at such a point, or
    passes it at a distance within `NEAR_TANGENTIAL`, it may also have come from sliding.

    Parameters
    ----------
    compiled : CompiledSeries
    operations : Operations
    parameters : ndarray
        The parameter array.
    steps, series, crossings : ndarray
        Of the run; all in reversed time.
    """
    sliding = (compiled.signs == 0).any(axis=0) & ~compiled.continuous
    touched = [
        (float(row[0]), int(row[1]), int(row[3]), row[6:])
        for row in crossings[crossings[:, 5] > 0]
        if sliding[int(row[1])]
    ]
    for j in np.flatnonzero(sliding).tolist():
        touched += _near_misses(compiled, operations, parameters, steps, series, j)
    touched.sort(key=lambda one: one[0])
    found = (one[0] for one in touched if _sliding_ends(compiled, parameters, *one))
    return next(found, None)


def _near_misses(
    compiled: CompiledSeries,
    operations: Operations,
    parameters: Array,
    steps: Array,
    series: Array,
    j: int,
) -> list[tuple[float, int, int, Array]]:
    """Times at which a run passes near an interface, the interface, modes and states."""
    sides = compiled.signs[steps[:, 2].astype(int), j]
    rows = np.flatnonzero(sides != 0)
    terms, own = operations.gradients[j][0], range(len(compiled.parameters))
    names = set(re.findall(r"\bp\d+\b", " ".join(terms)))
    if not len(rows) or not names <= {f"p{k}" for k in own}:
        return []
    nodes = nodes_for(series.shape[2] - 1)
    offsets = steps[rows, 1, None] * nodes
    columns = values_at(series[rows], offsets)
    n = compiled.n_states
    given = {f"p{k}": parameters[k] for k in own} | {"t": steps[rows, 0, None] + offsets}
    given |= {f"y{i}": columns[i] for i in range(n)}
    given |= {f"w{i}": columns[n + i] for i in range(compiled.n_forcing)}
    values = [np.broadcast_to(value_of(text, given), offsets.shape) for text in terms]
    size = np.abs(values).sum(axis=0).max(axis=1)
    near = sides[rows, None] * np.sum(values, axis=0)
    close = near.min(axis=1) < 0.1 * size
    rows, heights, size = rows[close], interpolated(near[close]), size[close]
    found = []
    for row, height, scale in zip(rows, heights, size, strict=True):
        slope = np.polynomial.polynomial.polyder(height)[None, :]
        for part, direction in _roots(slope):
            distance = float(np.polynomial.polynomial.polyval(part, height))
            if direction > 0 and 0.0 <= distance < NEAR_TANGENTIAL * scale:
                offset = part * steps[row, 1]
                state = values_at(series[[row]], np.array([offset]))[:n, 0]
                found.append((float(steps[row, 0] + offset), j, int(steps[row, 2]), state))
    return found


def _roots(slope: Array) -> list[tuple[float, int]]:
    roots = find_roots(StepPolynomials.of(slope))
    return list(zip(roots.part.tolist(), roots.direction.tolist(), strict=True))


def _sliding_ends(
    compiled: CompiledSeries, parameters: Array, time: float, j: int, mode: int, state: Array
) -> bool:
    """Check whether the other side of an interface points to it, forwards in time."""
    call, signs = _SIGNATURE(compiled.address), compiled.signs
    n, columns = compiled.n_states, compiled.order + 1
    first = n + compiled.n_forcing + compiled.n_interfaces
    values = parameters[None, :].copy()
    fill_instants(compiled, values, np.array([time]))
    inputs = np.zeros(1 + n + compiled.n_forcing)
    inputs[0], inputs[1 : 1 + n] = time, state
    rows = np.zeros(compiled.n_rows * columns)
    others = np.delete(np.arange(signs.shape[1]), j)
    alike = (signs[:, others] == signs[mode, others]).all(axis=1) & (signs[:, j] == 0)
    for slide in np.flatnonzero(alike).tolist():
        call(slide, inputs.ctypes.data, values.ctypes.data, rows.ctypes.data)
        # drifts on the sides h > 0 and h < 0, in reversed time
        above, below = rows[first * columns], rows[(first + 1) * columns]
        if below < 0 if signs[mode, j] > 0 else above > 0:
            return True
    return False


def steps_in_order(steps: Array, series: Array | None, end: float) -> tuple[Array, Array | None]:
    """Return steps and their series in the order of time, from those in reversed time.

    Parameters
    ----------
    steps : ndarray, shape (n_steps, 4)
    series : ndarray, shape (n_steps, columns, order + 1), optional
    end : float
        Last reversed time.
    """
    turned = steps[::-1].copy()
    turned[:, 0] = 0.0 - np.append(steps[1:, 0], end)[::-1] if len(steps) else 0.0
    if series is None:
        return turned, None
    length = steps[:, 1, None]
    shifted = series.copy()
    count = series.shape[2]
    for i in range(count):
        for k in range(count - 2, i - 1, -1):
            shifted[:, :, k] += length * shifted[:, :, k + 1]
    shifted[:, :, 1::2] *= -1.0
    return turned, np.ascontiguousarray(shifted[::-1])


def crossings_in_order(crossings: Array) -> Array:
    """Return crossings in the order of time, from those in reversed time."""
    turned = crossings[::-1].copy()
    turned[:, 0] = 0.0 - turned[:, 0]
    turned[:, 2] = 0.0 - turned[:, 2]
    turned[:, [3, 4]] = turned[:, [4, 3]]
    return turned
