"""Starting points from which the branches of a diagram are traced."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property, lru_cache
from itertools import pairwise, product

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from fastslow.diagrams.field import FrozenField
from fastslow.diagrams.solve.critical import critical_values
from fastslow.diagrams.solve.families import all_known, covered
from fastslow.diagrams.solve.motion_equations import region_equations
from fastslow.diagrams.solve.solving import solve_at
from fastslow.diagrams.windows import Sides, edges_left, known, size_of, within
from fastslow.model.periods import common_period, outside_periodic
from fastslow.model.rational import exact
from fastslow.model.structure import real
from fastslow.results.angles import apart
from fastslow.results.branch.branch import Branch
from fastslow.results.branch.windows import DISTANCE_ROUNDING, StateWindow, state_window, typical
from fastslow.results.points import Equilibrium

Array = NDArray[np.float64]


#: Critical values closer than this fraction of the range are identical up to rounding.
SAME_VALUE = 1e-10

#: A state whose typical size is below this fraction of its largest one is zero except at a few
#: equilibria, which determine its unit.
FAINT = 1e-14

#: Difference, as a fraction of an undeclared period, below which two states are copies.
COPIES = 1e-6

#: Relative rounding error of a state many periods away.
PERIODS_ROUNDING = 1e-15

#: Equilibria between critical values closer than this may be far away, near a pole, and are
#: disregarded in the units and the window.
NARROW = 1e-3


#: Values at which the equilibria are not isolated, after which they are only searched for.
FAILURES = 3


#: Number of values between special points, and of equilibria at them, after which no more are used.
VALUES_BETWEEN, MOST_EQUILIBRIA = 200, 5000


#: Of at most this number of regions and sliding motions all critical values are considered.
ALL_LEVELS = 64


class Starts:
    """Starting points of branches, computed once at each parameter value."""

    def __init__(
        self,
        field: FrozenField,
        lower: float,
        upper: float,
        inside: int,
        window: StateWindow,
        virtual: bool,
    ) -> None:
        self._field = field
        self._over = (lower, upper)
        self._asked = window
        # the golden ratio spreads the values and avoids round numbers
        parts = [(0.5 + k * 0.6180339887498949) % 1.0 for k in range(inside)]
        spread = [lower + p * (upper - lower) for p in parts]
        # equilibria in exact sets are found with the sets
        sets = covered(field, lower, upper)
        equations = self._equations = tuple(
            e for e in dict.fromkeys(region_equations(field)) if e.region not in sets
        )
        self._edges = edges_of(window, window.given)
        between = [critical_values(e, lower, upper, self._edges) for e in equations]
        if len(equations) > ALL_LEVELS and not virtual:
            # of so many regions most contain none of their equilibria
            between = [
                found and [value for value in found if not one.outside(value)]
                for one, found in zip(equations, between, strict=True)
            ]
        self.complete = all(b is not None for b in between) and all_known(field)
        self._continua = [
            (field.regions[equation.region], value)
            for equation in equations
            for value in equation.continua()
            if lower <= value <= upper
        ]
        levels = sorted({lower, upper, *(v for b in between for v in b or ())})
        least = SAME_VALUE * (upper - lower)
        middles = [0.5 * (a + b) for a, b in pairwise(levels) if b - a > least]
        self._first = [lower, upper, *(middles if self.complete else [*middles, *spread])]
        wide = NARROW * (upper - lower)
        self._typical = [
            lower,
            upper,
            *(0.5 * (a + b) for a, b in pairwise(levels) if b - a > wide),
        ]
        if not self.complete:
            self._typical += spread
        self._found: dict[float, list[Equilibrium]] = {}
        self._everywhere: dict[float, list[Equilibrium]] = {}
        self._sure: dict[float, bool] = {}
        # without and with bounds
        self._failed = {True: 0, False: 0}

    def at(self, value: float, admissible: bool) -> list[Equilibrium]:
        """Return the equilibria in the window at a value."""
        unit = self.scale[:-1]
        if self._bounds and not self._sure.get(value, False):
            # equilibria that diverge near a pole need not be resolved
            self._solve(value, self._bounds)
        points = self._requested_at(value, admissible)
        return [e for e in points if self.window.contains(self.window.shifted(e.state), unit)]

    def _requested_at(self, value: float, admissible: bool) -> list[Equilibrium]:
        """Return the equilibria within the requested bounds."""
        if value not in self._found:
            self._solve(value, None)
        return [e for e in self._found[value] if e.admissible == admissible]

    def _solve(self, value: float, bounds: Mapping[str, float] | None) -> None:
        """Compute the equilibria at a value, all or those within bounds."""
        # after a few values at which equilibria were not isolated, they will not be at others
        unlimited = bounds is None
        search = self._failed[unlimited] >= FAILURES
        solved = solve_at(
            self._field, value, virtual=True, with_sets=False, bounds=bounds, search=search
        )
        sure = solved.completeness == "complete"
        self._failed[unlimited] += not sure
        if bounds is None or sure:
            self._sure[value] = sure
            # branches do not contain elements of equilibrium sets
            single = [e for e in solved if not e.continuum and e.region in self._field.regions]
            self._found[value] = within(self._field, self._asked, single)
            if bounds is None:
                self._everywhere[value] = single

    @cached_property
    def _bounds(self) -> dict[str, float]:
        return self.window.moduli

    @cached_property
    def shifts(self) -> Array:
        """Periods of the rates in states that are not declared as periodic, 0 without one.

        Equilibria that differ by them are on copies of one curve. Of the states that the requested
        window bounds on both sides: it contains finitely many copies.
        """
        field, model = self._field, self._field.model
        terms = [e for mode in field.modes for e in (*mode.rates, *mode.rows)]
        values = {real(name): value for name, value in model.parameters.items()}
        values.pop(real(field.parameter), None)
        found = np.zeros(field.n)
        bounded = np.isfinite(self._asked.lower) & np.isfinite(self._asked.upper)
        for k, name in enumerate(model.states):
            state = real(name)
            if not bounded[k] or name in model.periodic:
                continue
            if not any(outside_periodic(e, state) for e in terms):
                found[k] = common_period(terms, state, values) or 0.0
        return found

    @cached_property
    def outside(self) -> tuple[StateWindow, list[tuple[Equilibrium, float]]]:
        """Return admissible equilibria outside the requested window, and a window around them.

        Their branches may enter the requested window between the values at which equilibria
        are computed. If critical values are known, every interval between them has a starting
        point, and the list is empty. Of equilibria that differ by `shifts` there is one, which may
        be inside.
        """
        if self.complete or not self._asked.chosen:
            return self._asked, []
        for value in self._first:
            if value not in self._everywhere:
                self._solve(value, None)
        found = [(e, v) for v in self._first for e in self._everywhere[v] if e.admissible]
        points = [e for e, _ in found]
        open_window = state_window(self._asked.states, None, self._field.model.periodic)
        states = np.reshape([e.state for e in points], (-1, self._field.n))
        kept = {id(e) for e in within(self._field, self._asked, points)}
        if self.shifts.any():
            found, kept = _once(found, self.shifts), set()
            points = [e for e, _ in found]
            states = np.reshape([e.state for e in points], (-1, self._field.n))
        wide = open_window.around(states, known(self._field, points))
        return wide, [(e, v) for e, v in found if id(e) not in kept]

    @cached_property
    def window(self) -> StateWindow:
        """Return the requested window, with defaults around the equilibria at the first values."""
        for values, admissible in product((self._typical, self._first), (True, False)):
            points = [e for v in values for e in self._requested_at(v, admissible)]
            if points:
                break
        states = np.reshape([e.state for e in points], (-1, self._field.n))
        return self._asked.around(states, known(self._field, points))

    def values(self, branches: Sequence[Branch]) -> Iterable[float]:
        """Yield the first values, then those between exits and special points found so far."""
        yield from self._first
        done: set[float] = set()
        found = 0
        left = self._asked.given
        while True:
            if (now := edges_left(self.window, branches)) != left:
                left = now
                yield from self._beside_edges(left)[1]
            special = {p[b.parameter] for b in branches for p in b.special}
            levels = sorted({*self._over, *special})
            gap = 1e-6 * (self._over[1] - self._over[0])
            middles = {0.5 * (a + b) for a, b in pairwise(levels) if b - a > gap}
            fresh = sorted(middles - done)
            if not fresh:
                return
            for value in fresh:
                done.add(value)
                yield value
                found += len(self._found.get(value, ()))
                if len(done) > VALUES_BETWEEN or found > MOST_EQUILIBRIA:
                    return

    def prove(self, branches: Sequence[Branch]) -> bool:
        """Return whether these are provably all branches in the window."""
        provable, middles = self._beside_edges(edges_left(self.window, branches))
        return (
            self.complete and provable and all(self._sure.get(v) for v in (*self._first, *middles))
        )

    def _beside_edges(self, left: Sides) -> tuple[bool, list[float]]:
        """Return values between those with an equilibrium on an edge at which a branch has left.

        A branch that leaves may re-enter between two values at which equilibria are computed.
        The flag is whether there can be no other values.
        """
        edges = tuple(e for e in edges_of(self.window, left) if e not in self._edges)
        if not edges:
            return True, []
        between = [critical_values(e, *self._over, edges) for e in self._equations]
        levels = sorted({*self._over, *(v for b in between for v in b or ())})
        middles = [0.5 * (a + b) for a, b in pairwise(levels)]
        return all(b is not None for b in between), middles

    def missed(self, branches: Sequence[Branch]) -> list[tuple[str, float]]:
        """Return regions and values at which a continuum of equilibria is not on any branch."""
        near = 1e-9 * (self._over[1] - self._over[0])
        # most are readily recognized as part of a branch
        return [
            (region, value)
            for region, value in self._continua
            if not any(_upright(b, value, near, self.scale) for b in branches)
            and self._lies_within(region, value)
        ]

    def _lies_within(self, region: str, value: float) -> bool:
        """Return whether a continuum is in its region, at least in part."""
        return not self._field.interfaces or any(
            e.continuum and e.admissible and e.region == region
            for e in solve_at(self._field, value, virtual=True)
        )

    @cached_property
    def scale(self) -> Array:
        """Return the unit of each state, its size at equilibria, and the length of the range."""
        n = self._field.n
        both = [e for v in self._typical for k in (True, False) for e in self._requested_at(v, k)]
        table = np.reshape([e.state for e in both], (-1, n))
        inside = self.window.contains(self.window.shifted(table))
        states = table[inside]
        largest = size = size_of(self._field, [both[k] for k in np.flatnonzero(inside)])
        # a few distant equilibria near a pole must not determine the unit
        wide = typical(states, DISTANCE_ROUNDING * size)
        middle = np.median(states, axis=0) if len(states) else np.zeros(n)
        spread = np.minimum(np.ptp(states, axis=0) if len(states) else np.zeros(n), wide)
        size = np.minimum(size, np.abs(middle) + wide)
        # far from zero the differences determine the unit
        moved = np.where(spread > DISTANCE_ROUNDING * size, np.maximum(spread, 1e-3 * size), size)
        size = np.where(size > FAINT * largest, moved, largest)
        # an angle is measured in radians
        periods = self._field.periods
        size = np.where(periods > 0, periods / (2.0 * np.pi), size)
        return np.append(size, self._over[1] - self._over[0])


def _upright(branch: Branch, value: float, near: float, scale: Array) -> bool:
    """Return whether a branch has a vertical segment at a parameter value."""
    steps: Array = np.diff(branch.state, axis=0)
    step = np.abs(steps / scale[:-1]).max(axis=1)
    there = np.abs(branch.values - value) < near
    return bool(np.any(there[1:] & there[:-1] & (step > 1e-6)))


#: The starting points of a field over a range, cached.
starts_of = lru_cache(maxsize=64)(Starts)


def edges_of(window: StateWindow, sides: Sides) -> tuple[sp.Expr, ...]:
    """Return functions that vanish on the finite edges among some bounds of a window.

    Examples
    --------
    >>> from fastslow.results.branch.windows import state_window
    >>> edges_of(state_window(("x", "y"), {"y": (0, 0.5)}), ((True, True), (False, True)))
    (y - 1/2,)
    """
    found = []
    for k, name in enumerate(window.states):
        for bound, meant in zip((window.lower[k], window.upper[k]), sides[k], strict=True):
            if meant and np.isfinite(bound):
                found.append(real(name) - exact(bound))
    return tuple(found)


def _once(
    points: Sequence[tuple[Equilibrium, float]], shifts: Array
) -> list[tuple[Equilibrium, float]]:
    """Equilibria at values of the parameter, without copies of others by whole shifts.

    The copies nearest to zero, which are known best.
    """
    kept: list[tuple[Equilibrium, float]] = []
    order = sorted(points, key=lambda one: float(np.abs(one[0].state[shifts > 0]).sum()))
    for point, value in order:
        reach = np.maximum(COPIES * shifts, PERIODS_ROUNDING * np.abs(point.state))
        same = (
            (np.abs(apart(point.state, other.state, shifts)) <= reach).all()
            for other, level in kept
            if level == value and other.region == point.region
        )
        if not any(same):
            kept.append((point, value))
    return kept
