"""Bands of equilibrium sets over a range of the parameter, between changes of the sets."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from fastslow.diagrams.field import FrozenField
from fastslow.diagrams.solve.equilibrium_sets import ZERO_FUNCTION, Family, aligned, middle_of
from fastslow.diagrams.solve.families import families_of
from fastslow.results.branch.equilibrium_sets import EquilibriumBand, EquilibriumSet
from fastslow.results.branch.windows import StateWindow

Array = NDArray[np.float64]

#: A set continued over values of the parameter.
Run = list[tuple[float, EquilibriumSet]]

#: A value of the parameter and the sets there.
Row = tuple[float, list[EquilibriumSet]]

#: Function that returns the sets at a value of the parameter.
SetsAt = Callable[[float], list[EquilibriumSet]]

#: Number of parameter values at which a band is computed, in addition to its ends.
BAND_VALUES = 129

#: The same for sets of dimension above one, each of whose ranges is a linear program.
FEWER = 33

#: Additional rows of a band near its ends.
ROUND = 8

#: Largest number of changes that are located one within the other.
CHANGES = 4

#: Width of a range of the parameter, relative to its values, over which changes of the sets are
#: one change: bounds and attraction have errors of a few `ZERO_FUNCTION`.
ONE_CHANGE = 10.0 * ZERO_FUNCTION


def bands_of(
    field: FrozenField, lower: float, upper: float, window: StateWindow
) -> tuple[EquilibriumBand, ...]:
    """Compute the bands of equilibrium sets over a range of the parameter.

    A band ends where its set leaves the window. Sets of several dimensions that require a search
    are omitted, since their continuation would take too long. So are bands between regular values
    that are no wider than the rounding error of their ends, `ONE_CHANGE`.
    """
    return tuple(
        band
        for family in families_of(field)
        if followed(family)
        for band in _bands(family, lower, upper, window)
    )


def followed(family: Family) -> bool:
    """Return whether the sets of a family are computed over a range of the parameter."""
    return family.exact or family.dimension < 2


def _bands(
    family: Family, lower: float, upper: float, window: StateWindow
) -> list[EquilibriumBand]:
    def sets_at(value: float) -> list[EquilibriumSet]:
        return [one for one in family.sets(value) if window.intersects(one.lower, one.upper)]

    def after(run: Run, one: EquilibriumSet, *, moving: bool = False) -> EquilibriumSet | None:
        """Return the translate of a set that continues a run, None if there is none."""
        last = run[-1][1]
        copy = aligned(one, middle_of(last), family.field.periods)
        return copy if _meet(last, copy, moving) else None

    count = BAND_VALUES if family.dimension < 2 else FEWER
    grid = [float(value) for value in np.linspace(lower, upper, count)]
    rows = [(value, sets_at(value)) for value in grid]
    table = rows[:1]
    for last, now in pairwise(rows):
        if _attractions(last[1]) != _attractions(now[1]):
            table += _change(sets_at, last, now)
        table.append(now)
    done: list[Run] = []
    growing: list[Run] = []
    for value, sets in table:
        following: list[Run] = []
        meets = [
            [family.dimension > 0 and after(run, one) is not None for one in sets]
            for run in growing
        ]
        alone = [run for run, row in zip(growing, meets, strict=True) if not any(row)]
        others = [one for j, one in enumerate(sets) if not any(row[j] for row in meets)]
        pairs = _pairs(alone, others, partial(after, moving=True))
        for j, one in enumerate(sets):
            before = [i for i, row in enumerate(meets) if row[j]]
            if id(one) in pairs:
                run, copy = pairs[id(one)]
                following.append([*run, (value, copy)])
            elif len(before) == 1 and sum(meets[before[0]]) == 1:
                run = growing[before[0]]
                following.append([*run, (value, after(run, one) or one)])
            else:
                following.append([(value, one)])
        kept = {id(run[-2][1]) for run in following if len(run) > 1}
        done += [run for run in growing if id(run[-1][1]) not in kept]
        growing = following
    # a range of a few regular values is resolved however short it is
    least = min(ONE_CHANGE * max(abs(lower), abs(upper)), grid[1] - grid[0])
    runs = [run for run in (*done, *growing) if len(run) > 1]
    return [_band(family, run) for run in runs if run[-1][0] - run[0][0] >= least]


def _pairs(
    runs: Sequence[Run],
    points: Sequence[EquilibriumSet],
    after: Callable[[Run, EquilibriumSet], EquilibriumSet | None],
) -> dict[int, tuple[Run, EquilibriumSet]]:
    """Return the run that each of several points continues, and the translate of the point.

    The sum of all distances is the least: two points that meet at a fold continue both runs.
    """
    from scipy.optimize import linear_sum_assignment

    copies = [[after(run, one) for one in points] for run in runs]
    distances = [
        [
            np.inf if copy is None else np.abs(middle_of(copy) - middle_of(run[-1][1])).sum()
            for copy in row
        ]
        for run, row in zip(runs, copies, strict=True)
    ]
    costs = np.reshape(distances, (len(runs), len(points)))
    possible = np.isfinite(costs)
    # more than the sum of all others
    costs = np.where(possible, costs, 1.0 + 2.0 * costs[possible].sum())
    found = {}
    for i, j in zip(*linear_sum_assignment(costs), strict=True):
        if (copy := copies[i][j]) is not None:
            found[id(points[j])] = runs[i], copy
    return found


def _meet(one: EquilibriumSet, other: EquilibriumSet, moving: bool) -> bool:
    """Return whether two sets at neighbouring values overlap, with the same attraction.

    Sets that move need not overlap in states in which they have no width.
    """
    near = ZERO_FUNCTION * np.nan_to_num(np.abs(one.lower) + np.abs(one.upper), posinf=0.0)
    over = (one.lower <= other.upper + near) & (other.lower <= one.upper + near)
    if moving:
        over |= (one.lower == one.upper) & (other.lower == other.upper)
    alike = _kind(one) == _kind(other) and len(one.corners) == len(other.corners)
    return alike and bool(over.all())


def _attractions(sets: list[EquilibriumSet]) -> list[bool | None]:
    """Return which sets attract, in their order: it changes where a set begins, ends or turns."""
    return [_kind(one) for one in sets]


def _kind(one: EquilibriumSet) -> bool | None:
    """Return whether a set attracts, or for a continuum in a region whether it is stable."""
    return one.attracting if one.interfaces else one.stable


def _change(sets_at: SetsAt, before: Row, after: Row, changes: int = CHANGES) -> list[Row]:
    """Locate values at which the sets change, with additional nearby values."""
    last, beyond = _bracket(sets_at, before, after)
    left = [before, *_towards(sets_at, before[0], last[0]), last]
    right = [beyond, *_towards(sets_at, after[0], beyond[0])[::-1], after]
    rows = []
    for side in (left, right):
        for one, other in pairwise(side):
            rows.append(one)
            # sets may begin and end, or two of them meet, within a short interval
            if changes > 1 and _attractions(one[1]) != _attractions(other[1]):
                rows += _change(sets_at, one, other, changes - 1)
        rows.append(side[-1])
    return rows[1:-1]


def _towards(sets_at: SetsAt, start: float, end: float) -> list[Row]:
    """Return rows from one value to another at decreasing distances, as an edge may fold there."""
    parts = [(k / ROUND) ** 2 for k in range(ROUND - 1, 0, -1)]
    values = dict.fromkeys(end - part * (end - start) for part in parts)
    return [(value, sets_at(value)) for value in values if value not in (start, end)]


def _bracket(sets_at: SetsAt, before: Row, after: Row) -> tuple[Row, Row]:
    """Bisect a change of the sets to neighbouring values."""
    for _ in range(60):
        middle = 0.5 * (before[0] + after[0])
        if not before[0] < middle < after[0]:
            break
        now = middle, sets_at(middle)
        if _attractions(now[1]) == _attractions(before[1]):
            before = now
        else:
            after = now
    return before, after


def _differences(one: EquilibriumSet, other: EquilibriumSet) -> tuple[bool, int]:
    """Return whether two sets are of another kind, and how many of their ends are infinite."""
    ends = [np.isfinite([s.lower, s.upper]) for s in (one, other)]
    return _kind(one) != _kind(other), int(np.count_nonzero(ends[0] != ends[1]))


def _distance(one: EquilibriumSet, near: Array) -> float:
    ends = [np.where(np.isfinite(e), e, 0.0) for e in (one.lower, one.upper)]
    return float(np.abs(0.5 * (ends[0] + ends[1]) - near).sum())


def _band(family: Family, run: Run) -> EquilibriumBand:
    def solver(value: float, near: Array) -> EquilibriumSet | None:
        found = [aligned(one, near, family.field.periods) for one in family.sets(value)]
        if not found:
            return None
        # the set that is like that of the nearest row
        row = min(run, key=lambda one: abs(one[0] - value))[1]
        return min(found, key=lambda one: (*_differences(one, row), _distance(one, near)))

    first = run[0][1]
    return EquilibriumBand(
        states=first.states,
        parameter=family.field.parameter,
        region=first.region,
        interfaces=first.interfaces,
        dimension=first.dimension,
        parameters=dict(family.field.model.parameters),
        values=np.array([v for v, _ in run]),
        lower=np.array([one.lower for _, one in run]),
        upper=np.array([one.upper for _, one in run]),
        corners=np.array([one.corners for _, one in run]),
        eigenvalues=np.array([one.eigenvalues for _, one in run]),
        attracting=first.attracting,
        stable=np.array([one.stable for _, one in run]),
        exact=first.exact,
        solver=solver,
    )
