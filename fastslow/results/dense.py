"""Values of a run between its steps, from the series of every step."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastslow.errors import ArgumentError

if TYPE_CHECKING:
    from fastslow.results.trajectories import Trajectory

#: A plotted curve may leave the solution by this part of the range of each column.
FLATNESS = 2e-4

#: Most points that one step is divided into for plotting, and least ones for an implicit
#: step, which may go a good part of a slow period.
MOST_POINTS, LEAST_POINTS = 48, 16


def columns_at(run: Trajectory, times: ArrayLike) -> NDArray[np.float64]:
    """All columns at any times; see `Trajectory.dense_columns`."""
    where = np.asarray(times, dtype=float)
    if run.series is None:
        raise ArgumentError(
            "this run kept no dense output; simulate with dense=True, or ask for samples="
        )
    low, high = run.span
    outside = ~((where >= low) & (where <= high))
    if outside.any():
        worst = float(where[outside].flat[0])
        raise ArgumentError(f"time {worst:g} is outside the run, which is [{low:g}, {high:g}]")
    if not len(run.steps):
        raise ArgumentError(f"the run made no step: {run.outcome}")
    flat = where.reshape(-1)
    row = np.searchsorted(run.step_starts, flat, side="right") - 1
    values = evaluate(run, row, flat - run.step_starts[row])
    return values.reshape(len(run.columns), *where.shape)


def evaluate(
    run: Trajectory, row: NDArray[np.intp], offset: NDArray[np.float64]
) -> NDArray[np.float64]:
    """All columns at offsets into given steps, shape (n + n_forcing, N)."""
    assert run.series is not None
    if len(row) and row.min() == row.max():
        taken = run.series[row[0]].T[:, :, None]
        value = np.repeat(taken[-1], len(row), axis=1)
        for power in taken[-2::-1]:
            value *= offset
            value += power
        return value
    if len(row) < len(run.series):
        # the coefficients of one power side by side
        taken = np.ascontiguousarray(run.series[row].transpose(2, 1, 0))
        value = taken[-1]
        for power in taken[-2::-1]:
            value *= offset
            value += power
        return value
    # many times: coefficients of one power side by side, each step's as often as it is needed
    powers = run.series.transpose(2, 1, 0)
    ordered = bool((row[1:] >= row[:-1]).all())
    counts = np.bincount(row, minlength=len(run.series)) if ordered else np.empty(0, dtype=int)

    def spread(power: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.repeat(power, counts, axis=1) if ordered else np.take(power, row, axis=1)

    value = spread(powers[-1])
    for power in powers[-2::-1]:
        value *= offset
        value += spread(power)
    return value


def refined_table(run: Trajectory) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Every step divided finely enough that straight lines look smooth."""
    if run.series is None or not len(run.steps):
        return run.end[:1], run.end[1:, None]
    length = run.steps[:, 1]
    order = run.series.shape[2] - 1
    k = np.arange(2, order + 1)
    power = length[:, None] ** k
    bend = np.abs(run.series[:, :, 2:] * (k * (k - 1) * power)[:, None, :]).sum(axis=2)
    reach = np.ptp(run.series[:, :, 0], axis=0)
    reach = np.where(reach > 0, reach, np.abs(bend).max(axis=0) + np.finfo(float).tiny)
    pieces = np.sqrt((bend / (8 * FLATNESS * reach)).max(axis=1))
    least = np.where(run.steps[:, 3] >= 2, LEAST_POINTS, 1)
    pieces = np.clip(np.nan_to_num(np.ceil(pieces), nan=1.0), least, MOST_POINTS).astype(int)
    row = np.repeat(np.arange(len(length)), pieces)
    first = np.repeat(np.cumsum(pieces) - pieces, pieces)
    offset = (np.arange(len(row)) - first) * (length / pieces)[row]
    row, offset = np.append(row, len(length) - 1), np.append(offset, length[-1])
    times = run.steps[row, 0] + offset
    times[-1] = run.span[1]
    return times, evaluate(run, row, offset)
