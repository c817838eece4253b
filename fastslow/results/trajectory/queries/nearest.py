"""The state of a trajectory nearest to given values."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product

import numpy as np
from numpy.typing import NDArray

from fastslow.results.angles import copies, periods_of
from fastslow.results.branch.nearest import along_line
from fastslow.results.trajectory.steps.dense import DenseOutput
from fastslow.results.trajectory.steps.step_polynomials import StepPolynomials
from fastslow.results.trajectory.steps.step_roots import find_zeros

Array = NDArray[np.float64]

#: Number of nearest steps, by linear interpolation, that are refined on their series.
REFINED_STEPS = 24


def nearest_on_line(times: Array, table: Array, target: Array) -> tuple[float, Array]:
    """Return the nearest time by linear interpolation, and the squared distances of all steps.

    Parameters
    ----------
    times : ndarray, shape (N,)
    table : ndarray, shape (N, k)
        Columns in units of their ranges, like the target.
    target : ndarray, shape (k,)
    """
    if len(times) == 1:
        return float(times[0]), np.zeros(0)
    distance, part = along_line(table, target)
    row = int(np.argmin(distance))
    return float((1 - part[row]) * times[row] + part[row] * times[row + 1]), distance


def units_of(table: Array) -> Array:
    """Return the range of every column, 1 for a constant one."""
    reach = np.ptp(table, axis=0)
    return np.where(reach > 0, reach, 1.0)


def nearest_target(table: Array, target: Array, scale: Array, periods: Array) -> Array:
    """Return the copy of a target, by whole periods, that is nearest to a table."""
    if not periods.any() or not len(table):
        return target
    low, high = table.min(axis=0), table.max(axis=0)
    ways = [copies(*entry) for entry in zip(target.tolist(), low, high, periods, strict=True)]
    found = [np.array(way) for way in product(*ways)]
    distances = [
        nearest_on_line(np.arange(len(table), dtype=float), table / scale, t / scale)[1]
        for t in found
    ]
    return found[int(np.argmin([d.min(initial=np.inf) for d in distances]))]


def nearest_time(
    values: Mapping[str, float],
    times: Array,
    columns: Mapping[str, Array],
    periods: Mapping[str, float],
    dense: DenseOutput | None,
) -> float:
    """Return the time of the nearest state; see `Trajectory.nearest`.

    Parameters
    ----------
    values : mapping
    times : ndarray, shape (N,)
    columns : mapping
        The columns of the values at these times.
    periods : mapping
    dense : DenseOutput, optional
        By which the result is refined.
    """
    table = np.column_stack([columns[name] for name in values])
    lengths = periods_of(tuple(values), periods)
    scale = np.where(lengths > 0, lengths, units_of(table))
    target = nearest_target(table, np.array([float(v) for v in values.values()]), scale, lengths)
    time, distance = nearest_on_line(times, table / scale, target / scale)
    if dense is None or not len(distance):
        return time
    close = np.argpartition(distance, min(4 * REFINED_STEPS, len(distance)) - 1)[
        : 4 * REFINED_STEPS
    ]
    close = close[np.argsort(distance[close], kind="stable")]
    steps = np.searchsorted(dense.step_starts, times[close], side="right") - 1
    # the nearest steps by linear interpolation, in that order, each once
    _, order = np.unique(steps, return_index=True)
    return _along_series(dense, steps[np.sort(order)[:REFINED_STEPS]], list(values), target, scale)


def _along_series(
    dense: DenseOutput, steps: NDArray[np.intp], names: list[str], target: Array, scale: Array
) -> float:
    """Return the time of least distance on given steps."""
    some = dense.of_steps(steps)
    total = StepPolynomials(np.zeros((len(steps), 1)), np.zeros(len(steps)))
    for name, value, unit in zip(names, target, scale, strict=True):
        apart = some.polynomials(name).minus(float(value))
        apart = StepPolynomials(apart.coefficients / unit, apart.size / unit)
        total += apart * apart
    power = np.arange(1, total.coefficients.shape[1])
    slope = total.coefficients[:, 1:] * power
    best = (np.inf, dense.span[0])
    for k, (start, length) in enumerate(some.steps[:, :2]):
        one = StepPolynomials(slope[k : k + 1], np.abs(slope[k : k + 1]).sum(axis=1))
        inside = [zero.middle for zero in find_zeros(one)]
        parts = np.array([0.0, 1.0, *inside])
        found = np.polynomial.polynomial.polyval(parts, total.coefficients[k])
        least = int(np.argmin(found))
        best = min(best, (float(found[least]), float(start + parts[least] * length)))
    return min(max(best[1], dense.span[0]), dense.span[1])
