"""Evaluation of the dense output of a run, from the series of every step."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastslow.errors import ArgumentError

if TYPE_CHECKING:
    from fastslow.results.trajectory.trajectory import Trajectory

#: Tolerated error of a plotted polyline, as a fraction of the range of each column.
FLATNESS = 2e-4

#: Maximal number of line segments for a step, and minimal number for an implicit step,
#: which may extend over much of a slow period.
MOST_POINTS, LEAST_POINTS = 48, 16


def columns_at(
    run: Trajectory, times: ArrayLike, wanted: Sequence[int] | slice = slice(None)
) -> NDArray[np.float64]:
    """Return columns at any times, by default all columns; see `Trajectory.dense_columns`."""
    where = np.asarray(times, dtype=float)
    if run.series is None:
        raise ArgumentError(
            "this run has no dense output; simulate with dense=True, or with samples="
        )
    low, high = run.span
    if where.size and not (where.min() >= low and where.max() <= high):
        worst = float(where[~((where >= low) & (where <= high))].flat[0])
        raise ArgumentError(f"time {worst:g} is outside the run, which is [{low:g}, {high:g}]")
    if not len(run.steps):
        raise ArgumentError(f"the run made no step: {run.outcome}")
    flat, starts = where.reshape(-1), run.step_starts
    series = run.series[:, wanted]
    if len(flat) > len(starts) and bool((flat[1:] >= flat[:-1]).all()):
        # fewer steps than times: search for the steps among the times
        first = np.searchsorted(flat, starts)
        first[0] = 0
        counts = np.diff(first, append=len(flat))
        values = _spread(series.transpose(2, 1, 0), counts, flat - np.repeat(starts, counts))
    else:
        row = np.searchsorted(starts, flat, side="right") - 1
        values = _at(series, row, flat - starts[row])
    return values.reshape(len(values), *where.shape)


def evaluate(
    run: Trajectory, row: NDArray[np.intp], offset: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return all columns at offsets into given steps, shape (n + n_forcing, N)."""
    assert run.series is not None
    return _at(run.series, row, offset)


def _at(
    series: NDArray[np.float64], row: NDArray[np.intp], offset: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return columns at offsets into given steps, shape (columns, N)."""
    if len(row) and row.min() == row.max():
        taken = series[row[0]].T[:, :, None]
        return _horner(np.repeat(taken[-1], len(row), axis=1), taken[-2::-1], offset)
    # coefficients of each power contiguous in memory
    if len(row) < len(series):
        taken = np.ascontiguousarray(series[row].transpose(2, 1, 0))
        return _horner(taken[-1], taken[-2::-1], offset)
    powers = np.ascontiguousarray(series.transpose(2, 1, 0))
    value = powers[-1].take(row, axis=1)
    below = np.empty_like(value)
    lower = (power.take(row, axis=1, out=below, mode="clip") for power in powers[-2::-1])
    return _horner(value, lower, offset)


def _spread(
    powers: NDArray[np.float64], counts: NDArray[np.intp], offset: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return columns at given numbers of offsets into each step, shape (columns, N).

    The coefficients have the shape (order + 1, columns, n_steps).
    """
    lower = (power.repeat(counts, axis=1) for power in powers[-2::-1])
    return _horner(powers[-1].repeat(counts, axis=1), lower, offset)


def _horner(
    value: NDArray[np.float64],
    lower: Iterable[NDArray[np.float64]],
    offset: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Evaluate polynomials in the offset by Horner's scheme; overwrites ``value``."""
    for power in lower:
        value *= offset
        value += power
    return value


def refined_table(run: Trajectory) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return times and columns, dense enough that a polyline looks smooth."""
    if run.series is None or not len(run.steps):
        return run.end[:1], run.end[1:, None]
    powers = np.ascontiguousarray(run.series.transpose(2, 1, 0))
    length = run.steps[:, 1]
    least = np.where(run.steps[:, 3] >= 2, LEAST_POINTS, 1)
    lines = np.clip(_line_segments(powers, length), least, MOST_POINTS).astype(int)
    counts = lines.copy()
    counts[-1] += 1
    number = np.arange(int(counts.sum())) - np.repeat(np.cumsum(lines) - lines, counts)
    offset = number * np.repeat(length / lines, counts)
    offset[-1] = length[-1]
    times = np.repeat(run.step_starts, counts) + offset
    times[-1] = run.span[1]
    return times, _spread(powers, counts, offset)


def _line_segments(powers: NDArray[np.float64], length: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the number of line segments for each step, from bounds of its second derivatives."""
    bend = np.zeros(powers.shape[1:])
    for k in range(len(powers) - 1, 1, -1):
        bend *= length
        bend += k * (k - 1) * np.abs(powers[k])
    bend *= length**2
    reach = np.ptp(powers[0], axis=1)
    reach = np.where(reach > 0, reach, bend.max(axis=1) + np.finfo(float).tiny)
    count = np.sqrt((bend / (8 * FLATNESS * reach[:, None])).max(axis=0))
    return np.nan_to_num(np.ceil(count), nan=1.0)
