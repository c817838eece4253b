"""All equilibria of a frozen model at one parameter value."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from fastslow.continuation.location import with_condition
from fastslow.continuation.loops import loop
from fastslow.diagrams.fields import FrozenField
from fastslow.model.model import Model
from fastslow.model.structure import real
from fastslow.results.points import Equilibria, Equilibrium
from fastslow.symbolic.elimination import Elimination, eliminate

Array = NDArray[np.float64]

#: Starting states tried by Newton's method where a region has no univariate polynomial.
STARTS = 200

#: Stands for the varying parameter in a model that has none; no user's symbol has this name.
IDLE = "(none)"

#: Degree up to which the roots of a univariate polynomial are trusted to be complete.
DEGREE = 60


@dataclass(frozen=True, eq=False)
class RegionEquations:
    """The equilibrium equations of one region, eliminated, at fixed other parameters.

    Parameters
    ----------
    field : FrozenField
    region : int
        Number of the region.
    """

    field: FrozenField
    region: int

    @cached_property
    def numbers(self) -> dict[sp.Symbol, sp.Rational]:
        """Exact value of every parameter but the one that varies."""
        values = self.field.model.parameters
        return {real(n): sp.Rational(v) for n, v in values.items() if n != self.field.parameter}

    @cached_property
    def elimination(self) -> Elimination:
        """Of the rates with every other parameter a number, so that its sign is known."""
        region = self.field.model.regions[self.field.regions[self.region]]
        rates = {n: region.rates[n].subs(self.numbers) for n in self.field.model.states}
        return eliminate(rates, self.field.model.states)

    @cached_property
    def polynomial(self) -> sp.Poly | None:
        """The one remaining equation as a polynomial in its unknown, if it is one."""
        left = self.elimination
        if not (left.is_univariate and left.is_polynomial):
            return None
        polynomial = sp.Poly(left.remaining[0], left.unknowns[0])
        return polynomial if polynomial.degree() <= DEGREE else None

    @cached_property
    def _coefficients(self) -> Any:
        assert self.polynomial is not None
        p = real(self.field.parameter)
        return sp.lambdify(p, [sp.N(c, 17) for c in self.polynomial.all_coeffs()], "math")

    @cached_property
    def _formula(self) -> Any:
        left = self.elimination
        p = real(self.field.parameter)
        states = left.state({}, self.field.model.states)
        return sp.lambdify((p, *left.unknowns), [sp.N(s, 17) for s in states], "math")

    def _whole(self, value: float, *unknowns: float) -> list[Array]:
        """The full state at values of the unknowns; none outside the domain of the formulas."""
        try:
            return [np.array(self._formula(value, *unknowns), dtype=float)]
        except (ArithmeticError, ValueError, TypeError):
            return []

    @property
    def complete(self) -> bool:
        """Whether `states` is sure to find every equilibrium."""
        left = self.elimination
        return not left.unknowns or self.polynomial is not None or self._conditions is not None

    @cached_property
    def _conditions(self) -> list[sp.Expr] | None:
        """Equations without unknowns, where nothing else is left: a continuum or nothing."""
        left = self.elimination
        if left.unknowns and all(not e.has(*left.unknowns) for e in left.remaining):
            return list(left.remaining)
        return None

    def states(self, value: float) -> list[Array]:
        """Isolated equilibria of the region's rates at a parameter value, admissible or not."""
        left = self.elimination
        if not left.unknowns:
            return self._holding(value, self._whole(value))
        if self._conditions is not None:
            return []
        if self.polynomial is None:
            return self._searched(value)
        try:
            coefficients = np.array(self._coefficients(value), dtype=float)
        except (ArithmeticError, ValueError, TypeError):
            return []
        found = [s for root in real_roots(coefficients) for s in self._whole(value, root)]
        return self._polished(value, found)

    def continuum(self, value: float) -> bool:
        """Whether the region's equilibria at this value form a continuum."""
        if self._conditions is None:
            return False
        p = real(self.field.parameter)
        return all(abs(float(e.subs(p, value))) < 1e-14 for e in self._conditions)

    def edges(self, value: float) -> list[Array]:
        """Where a one-parameter continuum of equilibria meets an interface, or its middle."""
        unknowns = self.elimination.unknowns
        if len(unknowns) != 1:
            return self._whole(value, *([0.0] * len(unknowns)))
        ends = []
        for interface in self.field.model.interfaces.values():
            h = interface.function.subs(self.numbers).subs(real(self.field.parameter), value)
            solved = {real(n): e.subs(self.numbers) for n, e in self.elimination.solved.items()}
            line = sp.together(h.subs(solved)).as_numer_denom()[0]
            if line.is_polynomial(*unknowns) and line.has(*unknowns):
                coefficients = np.array(sp.Poly(line, *unknowns).all_coeffs(), dtype=float)
                ends += [s for root in real_roots(coefficients) for s in self._whole(value, root)]
        return ends or self._whole(value, 0.0)

    def _holding(self, value: float, states: list[Array]) -> list[Array]:
        """Those states at which equations without unknowns hold too."""
        p = real(self.field.parameter)
        rest = [float(e.subs(p, value)) for e in self.elimination.remaining]
        return self._polished(value, states) if all(abs(r) < 1e-14 for r in rest) else []

    def _polished(self, value: float, states: Sequence[Array]) -> list[Array]:
        """Newton's last digits at fixed parameter; what does not converge was no root."""
        kept: list[Array] = []
        for state in states:
            solved = self.corrected(state, value)
            if solved is not None and not any(_same(solved, other) for other in kept):
                kept.append(solved)
        return kept

    def corrected(self, state: Array, value: float) -> Array | None:
        """The equilibrium near a state at a parameter value, None without convergence."""
        target = np.append(np.zeros(len(state)), 1.0)
        scale = np.append(np.maximum(1.0, np.abs(state)), max(1.0, abs(value)))
        found = with_condition(
            lambda u: self.field.curve(self.region, u),
            lambda u: (u[-1] - value, target),
            np.append(state, value),
            scale,
        )
        # at a double root Newton's last corrections stay near the root of the rounding
        if not (np.isfinite(found.residual) and found.correction < 1e-6):
            return None
        rates, slopes = self.field.curve(self.region, found.u)
        terms = np.abs(slopes[:, :-1]) @ np.maximum(1.0, np.abs(found.u[:-1]))
        small = np.abs(rates) <= 1e-9 * np.maximum(1.0, terms)
        moved = np.abs(found.u[:-1] - state) / scale[:-1]
        there = abs(found.u[-1] - value) <= 1e-12 * scale[-1]
        return found.u[:-1] if there and small.all() and moved.max() < 1e6 else None

    def _searched(self, value: float) -> list[Array]:
        """Newton's method from many states, a fixed sequence spread over several scales."""
        field, n = self.field, self.field.n
        generator = np.random.default_rng(20231)
        spread = 10.0 ** generator.uniform(-2, 1.5, (STARTS, 1))
        starts = np.vstack([np.zeros(n), generator.standard_normal((STARTS, n)) * spread])
        states, converged = loop("newton_from")(
            field.compiled.address, self.region, field.values, starts, value,
            field.compiled.size, 100,
        )  # fmt: skip
        distinct: list[Array] = []
        for state in states[converged]:
            near = (np.abs(state - o).max() / max(1.0, np.abs(o).max()) for o in distinct)
            if min(near, default=1.0) > 1e-5:
                distinct.append(state)
        return sorted(self._polished(value, distinct), key=lambda s: tuple(s))


def real_roots(coefficients: Array) -> list[float]:
    """Real roots of a polynomial, highest coefficient first, double ones once or twice.

    A root counts as real when its imaginary part is within the error that
    rounding makes at a double root; Newton decides afterwards.

    Examples
    --------
    >>> [round(r, 12) for r in real_roots(np.array([1.0, 0.0, -4.0]))]
    [-2.0, 2.0]
    """
    size = np.abs(coefficients).max(initial=0.0)
    if size == 0:
        return []
    start = int(np.argmax(np.abs(coefficients) > 1e-15 * size))
    roots = np.roots(coefficients[start:])
    scale = np.maximum(1.0, np.abs(roots))
    return sorted(float(r) for r in roots.real[np.abs(roots.imag) < 1e-6 * scale])


def _same(one: Array, other: Array) -> bool:
    return bool(np.all(np.abs(one - other) <= 1e-8 * np.maximum(1.0, np.abs(one))))


def equilibria(
    model: Model,
    values: Mapping[Any, float] | None = None,
    /,
    *,
    virtual: bool = False,
    **named: float,
) -> Equilibria:
    """All equilibria of a frozen model at given values of its slow quantities.

    Where a region's equations reduce to one polynomial all its roots are
    found, and the list's ``coverage`` is ``"complete"``; elsewhere Newton's
    method from many starts, and it is ``"found"``. A continuum (the gap of a
    backlash at zero load) is given by its ends, with ``continuum=True``.

    Parameters
    ----------
    model : Model
        A frozen model.
    values : mapping, optional
        Slow quantity or parameter (symbol or name) to its value.
    virtual : bool
        Whether to add the virtual ones, which lie outside their region.
    **named : float
        The same by name.

    Returns
    -------
    Equilibria
        A list of Equilibrium, region by region.

    Raises
    ------
    UnknownNameError
        For a name that is no parameter.
    ModelError
        For a slow quantity without value.

    Examples
    --------
    >>> x, w, t = sp.symbols("x w t")
    >>> model = Model({x: w - sp.Abs(x)}, forcing={w: sp.sin(t)}).frozen()
    >>> [e.state.tolist() for e in equilibria(model, w=2)]
    [[2.0], [-2.0]]
    """
    given = model.with_parameters(values, **named)
    name = next(iter(given.parameters), IDLE)
    value = given.parameters[name] if given.parameters else 0.0
    return solve_at(FrozenField(given, name), value, virtual)


def solve_at(field: FrozenField, value: float, virtual: bool = False) -> Equilibria:
    """Equilibria of every region at a value of the field's parameter."""
    found: list[Equilibrium] = []
    complete = True
    for number, equations in enumerate(region_equations(field)):
        complete &= equations.complete
        whole = equations.continuum(value)
        states = equations.edges(value) if whole else equations.states(value)
        for state in states:
            u = np.append(state, value)
            admissible = field.admissible(number, u)
            if admissible or virtual:
                found.append(point_at(field, number, u, admissible, continuum=whole))
    return Equilibria(_distinct(found), "complete" if complete else "found")


@lru_cache(maxsize=64)
def region_equations(field: FrozenField) -> tuple[RegionEquations, ...]:
    """The eliminated equations of every region, kept while the field is in use."""
    return tuple(RegionEquations(field, k) for k in range(len(field.regions)))


def point_at(
    field: FrozenField, region: int, u: Array, admissible: bool = True, continuum: bool = False
) -> Equilibrium:
    """The equilibrium at a point u, with its eigenvalues."""
    rates, slopes = field.curve(region, u)
    return Equilibrium(
        field.model.states,
        u[:-1].copy(),
        {**field.model.parameters, field.parameter: float(u[-1])},
        field.regions[region],
        admissible,
        np.linalg.eigvals(slopes[:, : field.n]).astype(complex),
        float(np.abs(rates).max()),
        continuum,
    )


def _distinct(points: list[Equilibrium]) -> list[Equilibrium]:
    """Each admissible state once: on an interface two regions share it; a continuum wins."""
    kept: list[Equilibrium] = []
    for point in sorted(points, key=lambda p: not p.continuum):
        shared = point.admissible and any(
            k.admissible and _same(k.state, point.state) for k in kept
        )
        if not shared:
            kept.append(point)
    order = {id(p): k for k, p in enumerate(points)}
    return sorted(kept, key=lambda p: order[id(p)])
