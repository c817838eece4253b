"""Intervals of the parameter with stable equilibria, and with several of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fastslow.results.base.intervals import runs_of
from fastslow.results.branch.table import BranchTable

Array = NDArray[np.float64]


def stable_rows(table: BranchTable) -> list[tuple[int, int]]:
    """Return first and last row of every stable slice, including special points at its ends."""
    ends = set()
    for point, row in zip(table.special, table.special_rows, strict=True):
        if point.kind.changes_stability:
            ends |= {row, row + 1} if point.kind.two_rows else {row}
    return [
        (start - (start - 1 in ends), stop - 1 + (stop in ends))
        for start, stop in runs_of(table.stable)
    ]


def stable_intervals(table: BranchTable) -> Array:
    """Compute the stable intervals of a branch; see `Branch.stable_intervals`."""
    spans = [table.values[first : last + 1] for first, last in stable_rows(table)]
    return np.array([(s.min(), s.max()) for s in spans], dtype=float).reshape(-1, 2)


def multistable(tables: Sequence[BranchTable], min_count: int) -> Array:
    """Return intervals with several stable equilibria; see `Diagram.bistable`."""
    ends = [
        sorted((table.values[first], table.values[last]))
        for table in tables
        for run in stable_rows(table)
        for first, last in _monotone(table, *run)
    ]
    if not ends:
        return np.empty((0, 2))
    low, high = np.array(ends, dtype=float).T
    values = np.concatenate([high, low])
    change = np.repeat([-1, 1], len(low))
    # at one value ends are counted before beginnings: intervals that touch do not overlap
    order = np.lexsort((change, values))
    values, count = values[order], np.cumsum(change[order])
    tiny = 1e-12 * float(np.ptp(values))
    intervals: list[list[float]] = []
    for start, stop in runs_of(count >= min_count):
        begin, end = float(values[start]), float(values[stop])
        if intervals and begin - intervals[-1][1] <= tiny:
            intervals[-1][1] = end
        elif end - begin > tiny:
            intervals.append([begin, end])
    return np.array(intervals).reshape(-1, 2)


def _monotone(table: BranchTable, first: int, last: int) -> list[tuple[int, int]]:
    """Split a range of rows into ranges with monotone parameter."""
    runs = table.monotone_runs
    begin, end = np.maximum(runs.first, first), np.minimum(runs.last, last)
    real = end > begin
    return list(zip(begin[real].tolist(), end[real].tolist(), strict=True))
