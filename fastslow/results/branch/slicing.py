"""Slices of a branch, with their special points."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import real_number, refusal
from fastslow.errors import ArgumentError, unknown_name
from fastslow.results.base.outcome import Outcome
from fastslow.results.point_types import POINT_TYPES
from fastslow.results.points import SpecialPoints

if TYPE_CHECKING:
    from fastslow.results.branch.branch import Branch


def rows_of(branch: Branch, wanted: slice) -> Branch:
    """Return the branch of some consecutive rows; see `Branch.__getitem__`."""
    start, stop, step = wanted.indices(len(branch))
    if step != 1:
        raise ArgumentError(
            f"a branch is sliced with a step of 1, received {step}; slice its columns instead"
        )
    if stop <= start:
        raise ArgumentError(
            f"rows {start} to {stop} contain none of the {len(branch)} points of the branch"
        )
    if stop - start == len(branch):
        return branch
    kept = [
        (point, row)
        for point, row in zip(branch.special, branch.special_rows, strict=True)
        if start <= row < stop or (POINT_TYPES[point.code].two_rows and row + 1 == start)
    ]
    first, last = branch.outcomes
    known = branch.known_stability
    return replace(
        branch,
        state=branch.state[start:stop],
        values=branch.values[start:stop],
        tangent=branch.tangent[start:stop],
        eigenvalues=branch.eigenvalues[start:stop],
        region=branch.region[start:stop],
        known_stability=None if known is None else known[start:stop],
        special=SpecialPoints(point for point, _ in kept),
        special_rows=tuple(max(row - start, 0) for _, row in kept),
        outcomes=(
            first if start == 0 else _cut(start, len(branch)),
            last if stop == len(branch) else _cut(stop - 1, len(branch)),
        ),
        closed=False,
    )


def _cut(row: int, count: int) -> Outcome:
    return Outcome("cut", f"cut at row {row} of a branch of {count} rows.", True)


def parts_of(
    branch: Branch,
    stable: bool | None,
    region: str | None,
    code: str | None,
    between: tuple[float, float] | None,
) -> tuple[Branch, ...]:
    """Return the slices of a branch that satisfy all conditions; see `Branch.select`."""
    if code is not None and code not in POINT_TYPES:
        raise unknown_name("special point code", code, POINT_TYPES)
    wanted = np.ones(len(branch), dtype=bool)
    if stable is not None:
        wanted &= branch.stable == stable
    if region is not None:
        wanted &= branch.region == region
    if between is not None:
        low, high = limits_of(between)
        wanted &= (branch.values >= low) & (branch.values <= high)
    parts = (rows_of(branch, slice(start, stop)) for start, stop in runs_of(wanted))
    return tuple(part for part in parts if code is None or part.special(code))


def runs_of(wanted: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return start and stop of every run of True.

    Examples
    --------
    >>> runs_of(np.array([True, False, True, True]))
    [(0, 1), (2, 4)]
    """
    edges = np.flatnonzero(np.diff(wanted.astype(np.int8), prepend=0, append=0))
    return [(int(start), int(stop)) for start, stop in edges.reshape(-1, 2)]


def limits_of(between: tuple[float, float]) -> tuple[float, float]:
    """Validate an interval: two numbers in increasing order.

    Raises
    ------
    ArgumentError
        For any other value.
    """
    sequence = isinstance(between, tuple | list) or getattr(between, "ndim", 0) == 1
    ends = [real_number(end) for end in between] if sequence else []
    low, high = ends if len(ends) == 2 else (None, None)
    if low is None or high is None or not low <= high:
        raise refusal("between", between, "two numbers, the lower one first")
    return low, high
