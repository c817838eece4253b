"""Intervals of the parameter over which equilibria are stable, and how many at once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fastslow.results.branch.slicing import runs_of
from fastslow.results.point_types import POINT_TYPES

if TYPE_CHECKING:
    from fastslow.results.branch.branch import Branch

Array = NDArray[np.float64]


def stable_rows(branch: Branch) -> list[tuple[int, int]]:
    """First and last row of every stable stretch, the special points at its ends included."""
    ends = set()
    for point, row in zip(branch.special, branch.special_rows, strict=True):
        known = POINT_TYPES[point.code]
        if known.changes_stability:
            ends |= {row, row + 1} if known.two_rows else {row}
    return [
        (start - (start - 1 in ends), stop - 1 + (stop in ends))
        for start, stop in runs_of(branch.stable)
    ]


def stable_intervals(branch: Branch) -> Array:
    """See `Branch.stable_intervals`."""
    spans = [branch.parameter[first : last + 1] for first, last in stable_rows(branch)]
    return np.array([(s.min(), s.max()) for s in spans], dtype=float).reshape(-1, 2)


def multistable(branches: Sequence[Branch], at_least: int) -> Array:
    """Intervals with so many stable equilibria; see `Diagram.bistable`."""
    sheets = [
        sorted((branch.parameter[first], branch.parameter[last]))
        for branch in branches
        if branch.admissible
        for run in stable_rows(branch)
        for first, last in _unturned(branch, *run)
    ]
    if not sheets:
        return np.empty((0, 2))
    low, high = np.array(sheets, dtype=float).T
    values = np.concatenate([high, low])
    change = np.repeat([-1, 1], len(low))
    # at one value the sheets that end do so before others begin: a touch is no overlap
    order = np.lexsort((change, values))
    values, count = values[order], np.cumsum(change[order])
    tiny = 1e-12 * float(np.ptp(values))
    intervals: list[list[float]] = []
    for start, stop in runs_of(count >= at_least):
        begin, end = float(values[start]), float(values[stop])
        if intervals and begin - intervals[-1][1] <= tiny:
            intervals[-1][1] = end
        elif end - begin > tiny:
            intervals.append([begin, end])
    return np.array(intervals).reshape(-1, 2)


def _unturned(branch: Branch, first: int, last: int) -> list[tuple[int, int]]:
    """The parts of a run of rows along which the parameter does not turn."""
    pieces = branch.monotone_runs
    begin, end = np.maximum(pieces.first, first), np.minimum(pieces.last, last)
    real = end > begin
    return list(zip(begin[real].tolist(), end[real].tolist(), strict=True))
