"""Equilibrium sets within discontinuities, where 0 is in the convex hull of the vector fields.

On the interfaces of a sliding motion its rates and the weights s of the fields are functions of
the states. If the rates vanish identically, as for a block with x' = v at v = 0, the conditions
|s_i| ≤ 1 bound a set of equilibria: an interval, or a polytope if all functions are affine.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property, partial
from itertools import pairwise, product
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from fastslow.continuation.ordering import in_order
from fastslow.diagrams.field import IDLE, FrozenField
from fastslow.diagrams.solve.exact_polynomials import coefficient_function, ratios, real_roots
from fastslow.diagrams.solve.intersections import attracts, two_fold_rate
from fastslow.model.functions import numpy_function
from fastslow.model.motion import Motion, drift
from fastslow.model.motions import motions_of
from fastslow.model.rational import exact
from fastslow.model.structure import exact_values, real
from fastslow.results.angles import apart, nearest_copy, principal
from fastslow.results.branch.equilibrium_sets import EquilibriumSet
from fastslow.results.stored.operations import AT_TWO_FOLD

Array = NDArray[np.float64]

#: Half-width of the interval of the free state, in natural units, in which ends are searched for
#: if they are not roots of a polynomial.
SEARCHED_REACH = 10.0

#: Distance, in natural units, from the end of an unbounded interval at which it is classified.
INFINITE_END = 1e3

#: Error of an end, as a fraction of the interval that is searched.
XTOL = 1e-15

#: Number of points in this interval at which non-polynomial functions are evaluated.
PLACES = 1001

#: Largest excess of a weight over 1 on a computed edge.
EDGE = 1e-6

#: Bound below which a function is zero, relative to its terms.
ZERO_FUNCTION = 1e-9

#: Grid points along each free state, by dimension, for flood-filling a set; odd, so that the
#: starting point is one of them.
FILL_POINTS = {2: 81, 3: 31}

#: Half-width of the first of these grids, in units of the states; doubled up to `SEARCHED_REACH`.
FIRST_GRID = 1e-3

#: Translates of a set by whole periods differ by less than this fraction of the period.
COPY = 1e-6


@dataclass(frozen=True, eq=False)
class Family:
    """Equilibria of one sliding motion as functions of free coordinates and the parameter.

    Parameters
    ----------
    field : FrozenField
    motion : Motion
    free : tuple of Symbol
        States that are not determined, d of them.
    solved : tuple of sympy.Expr
        Every state as a function of these and the parameter.
    bounds : tuple of sympy.Expr
        Functions that are non-negative in the set: 1 ∓ sᵢ for every weight, and the switching
        functions of the other interfaces with their signs.
    """

    field: FrozenField
    motion: Motion
    free: tuple[sp.Symbol, ...]
    solved: tuple[sp.Expr, ...]
    bounds: tuple[sp.Expr, ...]

    @property
    def dimension(self) -> int:
        return len(self.free)

    @cached_property
    def _symbols(self) -> tuple[sp.Symbol, ...]:
        return (real(self.field.parameter), *self.free)

    @cached_property
    def _states(self) -> Callable[..., Any]:
        return numpy_function(self._symbols, list(self.solved))

    @cached_property
    def _bounds(self) -> Callable[..., Any]:
        return numpy_function(self._symbols, list(self.bounds))

    @cached_property
    def _rates(self) -> Callable[..., Any]:
        """Rates of the heights over the interfaces in every adjacent region, at a point."""
        names, numbers = self.field.model.states, numbers_of(self.field)
        regions = motions_of(self.field.model.partition, with_jumps=True).regions
        heights = [exact(h).subs(numbers) for h in heights_of(self.field, self.motion)]
        fields = ([exact(r).subs(numbers) for r in regions[k].rates] for k in self.motion.corners)
        table = [[drift(h, names, rates) for h in heights] for rates in fields]
        return numpy_function([*map(real, names), real(self.field.parameter)], table)

    @cached_property
    def affine(self) -> bool:
        """Whether states and bounds are affine in the free coordinates."""
        free = set(self.free)
        return all(
            not (e.diff(c).free_symbols & free)
            for e in (*self.solved, *self.bounds)
            for c in self.free
        )

    @cached_property
    def _polynomials(self) -> list[list[Callable[[float], Fraction]]] | None:
        """Coefficients of the bounds' numerators in a single free state, if polynomials."""
        forms = [sp.together(e).as_numer_denom()[0] for e in self.bounds]
        if self.dimension != 1 or not all(e.is_polynomial(*self.free) for e in forms):
            return None
        p = real(self.field.parameter)
        return [
            [coefficient_function(c, p) for c in sp.Poly(e, *self.free).all_coeffs()] for e in forms
        ]

    @property
    def exact(self) -> bool:
        """Whether the computed sets are provably complete."""
        return self.affine or self._polynomials is not None

    def state(self, value: float, *free: float) -> Array:
        with np.errstate(all="ignore"):
            return np.array([float(s) for s in self._states(np.float64(value), *free)])

    def values(self, value: float, *free: Any) -> Array:
        """Evaluate the bounds at one point or, for one free state, at several: (bounds, …)."""
        with np.errstate(all="ignore"):
            # a weight may be infinite at a value, as 1/w at w = 0
            found = self._bounds(np.float64(value), *free)
        return np.array(np.broadcast_arrays(*found, *free)[: len(found)], dtype=float)

    def _bound(self, value: float, number: int, free: float) -> float:
        """Evaluate one of the bounds at a value of the single free state."""
        return float(self.values(value, free)[number])

    def _units(self, value: float) -> Array:
        """Return the natural unit of each free state, shape (d,)."""
        names = self.field.model.states
        return self.field.units_at(abs(value))[[names.index(c.name) for c in self.free]]

    def sets(self, value: float) -> list[EquilibriumSet]:
        """Return the sets at a value of the parameter, those of dimension 1 in ascending order.

        Of translates by whole periods the one with its middle in the principal range.
        """
        periods = self.field.periods
        found = self._sets(value)
        if not periods.any():
            return found
        kept: list[EquilibriumSet] = []
        for one in found:
            moved = aligned(one, principal(middle_of(one), periods), periods)
            if not any(_copies(moved, other, periods) for other in kept):
                kept.append(moved)
        return kept

    def _sets(self, value: float) -> list[EquilibriumSet]:
        """Return the sets at a value of the parameter, including translates."""
        if self.dimension == 0:
            if not (self.values(value) >= -ZERO_FUNCTION).all():
                return []
            state = self.state(value)
            return [self._made(value, (), state, state, state[None])]
        if self.affine:
            found = self._polytope(value)
            return [] if found is None else [found]
        if self.dimension == 1:
            return [self._interval(value, *segment) for segment in self._pieces(value)]
        return self._searched(value) if self.dimension == len(self.motion.slides) else []

    def _interval(self, value: float, low: float, high: float) -> EquilibriumSet:
        """Return the set of dimension 1 between two values of the free state."""
        inside = np.linspace(low, high, 65) if np.isfinite(high - low) else np.array([low, high])
        with np.errstate(all="ignore"):
            table = np.array(np.broadcast_arrays(*self._states(value, inside), inside)[:-1]).T
        known = [(c,) for c in (low, high) if np.isfinite(c)]
        middle = (float(np.mean(known)),) if known else (0.0,)
        if len(known) == 1:
            # inside of the only end
            middle = (
                middle[0] + np.copysign(self._units(value)[0], high if low > -np.inf else low),
            )
        corners = [self.state(value, *free) for free in known or [middle]]
        # without a limit at infinity, as of x - x**2
        lower = np.where(np.isnan(table).any(axis=0), -np.inf, table.min(axis=0))
        upper = np.where(np.isnan(table).any(axis=0), np.inf, table.max(axis=0))
        return self._made(value, middle, lower, upper, np.array(corners))

    def _made(
        self, value: float, middle: tuple[float, ...], lower: Array, upper: Array, corners: Array
    ) -> EquilibriumSet:
        model, name = self.field.model, self.field.parameter
        u = np.append(self.state(value, *middle), value)
        attracting, eigenvalues, decays = self._linear(u)
        names = tuple(model.interfaces)
        return EquilibriumSet(
            states=model.states,
            region=self.motion.name,
            interfaces=tuple(names[j] for j in self.motion.slides),
            dimension=self.dimension,
            parameters={**model.parameters, **({} if name == IDLE else {name: value})},
            lower=lower,
            upper=upper,
            corners=corners,
            eigenvalues=eigenvalues,
            attracting=attracting,
            stable=decays,
            exact=self.exact,
        )

    def _linear(self, u: Array) -> tuple[bool | None, NDArray[np.complex128], bool]:
        """Return whether the set attracts at a point, its eigenvalues, and whether it is stable."""
        if self.at_two_folds:
            return self._turning(u)
        attracting = attracts(np.array(self._rates(*u), dtype=float))
        finite = self._finite(u)
        far = np.nan if attracting is None else -np.inf if attracting else np.inf
        across = np.full(len(self.motion.slides), far, dtype=complex)
        decays = attracting is True and self._decays(finite)
        return attracting, np.concatenate([finite, across]), decays

    @property
    def at_two_folds(self) -> bool:
        """Whether the equilibria are at two-folds, without a sliding motion."""
        return self.motion.name.endswith(AT_TWO_FOLD)

    def _turning(self, u: Array) -> tuple[bool | None, NDArray[np.complex128], bool]:
        """Return the same at a two-fold, decided for two states; heights are squares of widths."""
        n = self.field.n
        if n != 2 or self.dimension:
            return None, np.full(n, np.nan, dtype=complex), False
        attracting, rate = two_fold_rate(*(np.array(m, dtype=float) for m in self._fields(*u)))
        finite = np.isfinite(rate) or np.isnan(rate)
        both = [rate, 2.0 * rate] if finite else [-np.inf, np.inf]
        return attracting, np.array(both, dtype=complex), attracting is True

    @cached_property
    def _fields(self) -> Callable[..., Any]:
        """Both vector fields, their Jacobians, and the derivatives of the interface function."""
        names = [real(n) for n in self.field.model.states]
        numbers = numbers_of(self.field)
        regions = motions_of(self.field.model.partition, with_jumps=True).regions
        fields = [
            sp.Matrix([exact(r).subs(numbers) for r in regions[k].rates])
            for k in self.motion.corners
        ]
        (height,) = (
            sp.Matrix([exact(h).subs(numbers)]) for h in heights_of(self.field, self.motion)
        )
        gradient = height.jacobian(names)
        table = [
            [list(f) for f in fields],
            [f.jacobian(names).tolist() for f in fields],
            list(gradient),
            gradient.jacobian(names).tolist(),
        ]
        return numpy_function([*names, real(self.field.parameter)], table)

    def _decays(self, finite: NDArray[np.complex128]) -> bool:
        """Return whether all eigenvalues transverse to the set have negative real parts."""
        real_parts = finite.real[np.argsort(np.abs(finite))][self.dimension :]
        least = ZERO_FUNCTION * np.abs(finite).max(initial=0.0)
        return bool((real_parts < -least).all())

    def _finite(self, u: Array) -> NDArray[np.complex128]:
        """Return the eigenvalues of the sliding motion along its interfaces at a point."""
        matrix, gradients = (np.array(m, dtype=float) for m in self._slopes(*u))
        if not (np.isfinite(matrix).all() and np.isfinite(gradients).all()):
            return np.full(len(u) - 1 - len(gradients), np.nan, dtype=complex)
        along = np.linalg.qr(gradients.T, mode="complete")[0][:, len(gradients) :]
        return np.linalg.eigvals(along.T @ matrix @ along).astype(complex)

    @cached_property
    def _slopes(self) -> Callable[..., Any]:
        names = [real(n) for n in self.field.model.states]
        numbers = numbers_of(self.field)
        rates = sp.Matrix([exact(r).subs(numbers) for r in self.motion.rates])
        heights = sp.Matrix([exact(h).subs(numbers) for h in heights_of(self.field, self.motion)])
        both = [rates.jacobian(names).tolist(), heights.jacobian(names).tolist()]
        return numpy_function([*names, real(self.field.parameter)], both)

    def _polytope(self, value: float) -> EquilibriumSet | None:
        """Compute ranges of the states by linear programming, and corners from the weights."""
        from scipy.optimize import linprog

        d = self.dimension
        origin, base = self.values(value, *[0.0] * d), self.state(value, *[0.0] * d)
        # in natural units of the free states
        units = self._units(value)
        rows = np.array([self.values(value, *step) - origin for step in np.diag(units)]).T
        moves = np.array([self.state(value, *step) - base for step in np.diag(units)]).T
        if d == 1:
            ends = _interval(origin, rows[:, 0])
            if ends is None:
                return None
            return self._interval(value, ends[0] * units[0], ends[1] * units[0])

        size = np.maximum(np.abs(rows).max(axis=1), np.finfo(float).tiny)
        system, right = -rows / size[:, None], origin / size
        lower, upper = base.copy(), base.copy()
        for k, move in enumerate(moves):
            if not move.any():
                continue
            for sign, into in ((1.0, lower), (-1.0, upper)):
                found = linprog(
                    sign * move, A_ub=system, b_ub=right, bounds=[(None, None)] * d, method="highs"
                )
                if found.status == 2:
                    return None
                into[k] = -sign * np.inf if found.status == 3 else base[k] + move @ found.x
        corners = [tuple((units * c).tolist()) for c in self._corners(rows, origin)]
        states = [self.state(value, *free) for free in corners]
        middle = tuple(np.mean(corners, axis=0)) if corners else (0.0,) * d
        return self._made(value, middle, lower, upper, np.array(states or [base]))

    def _corners(self, rows: Array, origin: Array) -> list[tuple[float, ...]]:
        """Return the points with all weights ±1, if there are as many as free coordinates."""
        m, found = len(self.motion.slides), []
        if m != self.dimension or np.linalg.matrix_rank(rows[: 2 * m : 2]) < m:
            return []
        # the bounds are pairs 1 - s, 1 + s
        for side in product((0, 1), repeat=m):
            chosen = [2 * i + k for i, k in enumerate(side)]
            free = np.linalg.solve(rows[chosen], -origin[chosen])
            if (rows @ free + origin >= -ZERO_FUNCTION * (1.0 + np.abs(origin))).all():
                found.append(tuple(free.tolist()))
        return found

    def _pieces(self, value: float) -> list[tuple[float, float]]:
        """Return the intervals of the free coordinate in which no bound is negative."""
        from scipy.optimize import brentq

        ends: list[float] = []
        if self._polynomials is not None:
            for coefficients in self._polynomials:
                ends += real_roots(ratios([c(value) for c in coefficients]))
            ends = [-np.inf, *sorted(set(ends)), np.inf]
        else:
            from scipy.optimize import brentq

            # a set with its middle in the principal range is within one period of zero
            period = self.field.periods[self.field.model.states.index(self.free[0].name)]
            reach = float(period or SEARCHED_REACH * self._units(value)[0])
            grid = np.linspace(-reach, reach, PLACES)
            table = self.values(value, grid)
            if (table >= 0).all():
                return [(-np.inf, np.inf)]
            for number, row in enumerate(table):
                ends += grid[row == 0].tolist()
                for i in np.flatnonzero(row[1:] * row[:-1] < 0):
                    bound = partial(self._bound, value, number)
                    fine = XTOL * reach
                    ends.append(float(brentq(bound, grid[i], grid[i + 1], xtol=fine)))
            ends = sorted(set(ends))
        inside = []
        far = INFINITE_END * float(self._units(value)[0])
        for low, high in pairwise(ends):
            place = 0.5 * (max(low, min(high, 0.0) - far) + min(high, max(low, 0.0) + far))
            if (self.values(value, place) >= 0).all():
                inside.append((low, high))
        joined: list[tuple[float, float]] = []
        for low, high in inside:
            if joined and joined[-1][1] == low:
                joined[-1] = joined[-1][0], high
            else:
                joined.append((low, high))
        return joined

    @cached_property
    def _weights(self) -> Callable[..., Any]:
        """Weights and their derivatives by the free states, with points along a last axis."""
        weights = sp.Matrix([1 - e for e in self.bounds[: 2 * len(self.motion.slides) : 2]])
        both = [list(weights), list(weights.jacobian(self.free))]
        return numpy_function(self._symbols, both)

    def _newton(
        self, value: float, places: Array, targets: Array
    ) -> tuple[Array, NDArray[np.bool_]]:
        """Solve for points with given weights, both of shape (N, d), with convergence flags."""
        d = self.dimension
        with np.errstate(all="ignore"):
            for _ in range(12):
                given, slopes = self._weights(value, *places.T)
                left = np.stack(np.broadcast_arrays(*given, places[:, 0])[:-1], axis=-1) - targets
                table = np.stack(np.broadcast_arrays(*slopes, places[:, 0])[:-1], axis=-1)
                matrices = table.reshape(-1, d, d)
                finite = np.isfinite(matrices).all(axis=(1, 2))
                sizes = np.abs(np.linalg.det(np.where(finite[:, None, None], matrices, 0.0)))
                sound = np.logical_and(finite, sizes > 0)
                matrices = np.where(sound[:, None, None], matrices, np.eye(d))
                places = places - np.linalg.solve(matrices, left[..., None])[..., 0]
        near = np.abs(left).max(axis=1) < ZERO_FUNCTION
        return places, np.logical_and(near, np.isfinite(places).all(axis=1))

    def _searched(self, value: float) -> list[EquilibriumSet]:
        """Compute sets of several dimensions, from zero weights to the faces of their cube.

        The ranges are those of the points reached from a grid on the faces. If the states are
        not functions of the weights throughout, the set is flood-filled on a grid.
        """
        d = self.dimension
        units = self._units(value)
        line = np.linspace(-1.0, 1.0, 9)
        grid = np.array(list(product(line, repeat=d))) * SEARCHED_REACH * units
        middles, found = self._newton(value, grid, np.zeros_like(grid))
        inside = np.logical_and(found, (np.abs(middles) <= SEARCHED_REACH * units).all(axis=1))
        distinct: list[Array] = []
        for middle in middles[inside]:
            if not any((np.abs(middle - o) <= 1e-6 * units).all() for o in distinct):
                distinct.append(middle)
        cube = np.array(list(product(np.linspace(-1.0, 1.0, 9 if d == 2 else 5), repeat=d)))
        cube = cube[np.abs(cube).max(axis=1) == 1.0]
        sets: list[EquilibriumSet] = []
        filled: list[_Filled] = []
        for middle in (distinct[k] for k in in_order(np.reshape(distinct, (-1, d)), units)):
            if any(one.holds(middle) for one in filled):
                continue
            if not (self.values(value, *middle) >= 0).all():
                continue
            places, alive = np.tile(middle, (len(cube), 1)), np.ones(len(cube), dtype=bool)
            reached = [places]
            for part in np.linspace(0.0, 1.0, 11)[1:]:
                further, near = self._newton(value, places, part * cube)
                alive &= near
                places = np.where(alive[:, None], further, places)
                reached.append(places)
            if not alive.all() and d in FILL_POINTS:
                filled.append(self._filled(value, middle, units))
                sets.append(self._polished(value, filled[-1]))
                continue
            states = np.array([self.state(value, *free) for free in np.concatenate(reached)])
            corner = alive & np.asarray(np.abs(cube).min(axis=1) == 1.0)
            corners = np.array([self.state(value, *free) for free in places[corner]])
            sets.append(
                self._made(
                    value,
                    tuple(middle.tolist()),
                    states.min(axis=0),
                    states.max(axis=0),
                    corners if len(corners) else self.state(value, *middle)[None],
                )
            )
        return sets

    def _filled(self, value: float, middle: Array, units: Array) -> _Filled:
        """Return the points of a grid that are connected to its middle within the bounds."""
        from scipy.ndimage import label

        count = FILL_POINTS[self.dimension]
        half, most = FIRST_GRID * units, SEARCHED_REACH * units
        while True:
            axes = [np.linspace(m - h, m + h, count) for m, h in zip(middle, half, strict=True)]
            places = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
            flat = places.reshape(-1, self.dimension)
            inside = (self.values(value, *flat.T) >= 0).all(axis=0).reshape(places.shape[:-1])
            parts = label(inside)[0]
            own = parts == parts[(count // 2,) * self.dimension]
            ends = [bool(own.take([0, -1], axis=k).any()) for k in range(self.dimension)]
            touched = np.array(ends, dtype=bool)
            if not (touched & (half < most)).any():
                return _Filled(places, own, touched)
            half = np.where(touched, np.minimum(2.0 * half, most), half)

    def _polished(self, value: float, filled: _Filled) -> EquilibriumSet:
        """Return the set of given grid points, with computed ranges and corners."""
        inside, cell = filled.places[filled.own], filled.cell
        given = self._states(value, *inside.T)
        states = np.stack(np.broadcast_arrays(*given, inside[:, 0])[:-1], axis=-1)
        lower, upper = states.min(axis=0), states.max(axis=0)
        free = [c.name for c in self.free]
        for k, name in enumerate(self.field.model.states):
            if name in free and filled.touched[free.index(name)]:
                lower[k], upper[k] = -np.inf, np.inf
                continue
            lower[k] = self._least(value, k, 1.0, inside[np.argmin(states[:, k])], cell)
            upper[k] = self._least(value, k, -1.0, inside[np.argmax(states[:, k])], cell)
        weights = np.stack(np.broadcast_arrays(*self._weights(value, *inside.T)[0]), axis=-1)
        targets = np.array(list(product((-1.0, 1.0), repeat=self.dimension)))
        starts = np.array([inside[np.argmin(np.abs(weights - t).max(axis=1))] for t in targets])
        corners, near = self._newton(value, starts, targets)
        near = np.logical_and(near, (np.abs(corners - starts) <= 4.0 * cell).all(axis=1))
        middle = inside[len(inside) // 2]
        chosen = corners[near] if near.any() else middle[None]
        return self._made(
            value,
            tuple(middle.tolist()),
            lower,
            upper,
            np.array([self.state(value, *place) for place in chosen]),
        )

    def _least(self, value: float, k: int, sign: float, start: Array, cell: Array) -> float:
        """Compute the end of the range of a state in a set, from the nearest grid point."""
        from scipy.optimize import minimize

        def height(steps: Array) -> float:
            return sign * float(self.state(value, *(start + steps * cell))[k])

        def bounds(steps: Array) -> Array:
            return self.values(value, *(start + steps * cell))

        with np.errstate(all="ignore"):
            found = minimize(
                height,
                np.zeros(len(start)),
                method="SLSQP",
                constraints={"type": "ineq", "fun": bounds},
                options={"ftol": 1e-14},
            )
            near = np.abs(found.x).max() <= 4.0 and (bounds(found.x) >= -ZERO_FUNCTION).all()
        still = height(np.zeros(len(start)))
        return sign * (min(height(found.x), still) if near else still)

    def contains(self, u: Array, unit: Array | float) -> bool:
        """Return whether a point (states, parameter) is in the closed set.

        ``unit`` is the size of every state, the scale of rounding errors.
        """
        value = float(u[-1])
        names = self.field.model.states
        free = [float(u[names.index(c.name)]) for c in self.free]
        state = self.state(value, *free)
        near = ZERO_FUNCTION * np.maximum(unit, np.abs(u[:-1]))
        if not np.all(np.abs(state - u[:-1]) <= 10 * near):
            return False
        return bool((self.values(value, *free) >= -EDGE).all())


@dataclass(frozen=True, eq=False)
class _Filled:
    """Points of a grid, shape (N, …, d), those in a set, and where the set exceeds the grid."""

    places: Array
    own: NDArray[np.bool_]
    touched: NDArray[np.bool_]

    @property
    def cell(self) -> Array:
        """Grid spacing, shape (d,)."""
        flat = self.places.reshape(-1, self.places.shape[-1])
        return np.asarray(np.ptp(flat, axis=0) / (self.own.shape[0] - 1))

    def holds(self, place: Array) -> bool:
        """Return whether the grid point nearest to a point is in the set."""
        first = self.places[(0,) * self.own.ndim]
        part = np.rint((place - first) / self.cell)
        if not ((part >= 0) & (part < self.own.shape[0])).all():
            return False
        return bool(self.own[tuple(part.astype(int))])


def middle_of(one: EquilibriumSet) -> Array:
    """Return the middle of the ranges, zero for unbounded ones."""
    ends = np.isfinite(one.lower) & np.isfinite(one.upper)
    return np.where(ends, 0.5 * np.where(ends, one.lower, 0.0), 0.0) + np.where(
        ends, 0.5 * np.where(ends, one.upper, 0.0), 0.0
    )


def aligned(one: EquilibriumSet, target: Array, periods: Array) -> EquilibriumSet:
    """Return the translate of a set whose middle is nearest to a point."""
    middle = middle_of(one)
    by = nearest_copy(middle, target, periods) - middle
    if not by.any():
        return one
    return replace(one, lower=one.lower + by, upper=one.upper + by, corners=one.corners + by)


def _copies(one: EquilibriumSet, other: EquilibriumSet, periods: Array) -> bool:
    """Return whether two sets are translates by whole periods, or identical."""
    if not np.array_equal(np.isfinite(one.lower), np.isfinite(other.lower)):
        return False
    away = apart(middle_of(one), middle_of(other), periods)
    size = np.where(periods > 0, periods, np.abs(middle_of(one)) + np.abs(middle_of(other)))
    return bool((np.abs(away) <= COPY * size).all())


def _interval(origin: Array, slope: Array) -> tuple[float, float] | None:
    """Return the interval of c with origin + slope c >= 0."""
    size = np.maximum(np.abs(origin), np.abs(slope))
    still = np.abs(slope) <= 1e-14 * size
    if (origin[still] < 0).any():
        return None
    ends = -origin[~still] / slope[~still]
    low = float(ends[slope[~still] > 0].max(initial=-np.inf))
    high = float(ends[slope[~still] < 0].min(initial=np.inf))
    return (low, high) if low < high else None


def numbers_of(field: FrozenField) -> dict[sp.Symbol, sp.Rational]:
    """Return the exact values of all parameters but the varying one."""
    return exact_values(field.model.parameters, (field.parameter,))


def heights_of(field: FrozenField, motion: Motion) -> list[sp.Expr]:
    """Return the interface functions of the sliding interfaces of a motion."""
    functions = [i.function for i in field.model.interfaces.values()]
    return [functions[j] for j in motion.slides]
