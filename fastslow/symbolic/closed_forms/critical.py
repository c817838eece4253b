"""Folds, branch points, cusps and Hopf points of one region in closed form."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import permutations

import sympy as sp
from sympy.logic.boolalg import Boolean
from sympy.polys.rootoftools import ComplexRootOf

from fastslow.model.differentiation import derivative
from fastslow.model.structure import real
from fastslow.model.work import spend_traversal
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.results.point_types import BRANCH_POINT, CUSP, FOLD, HOPF
from fastslow.symbolic.algebra import expanded_form, rational_form, undefined
from fastslow.symbolic.closed_forms.forms import CriticalPoint
from fastslow.symbolic.closed_forms.stability import HopfTest, Stability
from fastslow.symbolic.signs.inequalities import (
    conjunction,
    general_condition,
    implied,
    nonnegative,
)
from fastslow.symbolic.signs.signs import Signs
from fastslow.symbolic.solving.candidates import Candidates
from fastslow.symbolic.solving.location import (
    LocatedForm,
    both_notes,
    locate,
    parameters_where,
    short_form,
)
from fastslow.symbolic.solving.solution_families import SolutionFamily
from fastslow.symbolic.solving.verification import OPEN, all_vanish, checked

#: Nodes of a squared frequency that exhaust a budget: its condition would fill many pages.
FREQUENCY_NODES = 100_000


@dataclass(frozen=True)
class RegionContext:
    """Rates, assumptions and conditions from which the closed forms of a region are derived.

    Parameters
    ----------
    region : str
    states : tuple of str
    rates : NamedMapping of sympy.Expr
        Smooth, with exact coefficients.
    inside : tuple of sympy.Expr
        Expressions that are positive in the region.
    signs : Signs
    candidates : Candidates
        Parameters to solve for, slow quantities first.
    geometry : tuple of Symbol
        Parameters of the interfaces, whose signs are always assumed.
    written : tuple of sympy.Expr
        The expressions ``inside`` as the interfaces are written.
    """

    region: str
    states: tuple[str, ...]
    rates: NamedMapping[sp.Expr]
    inside: tuple[sp.Expr, ...]
    signs: Signs
    candidates: Candidates
    geometry: tuple[sp.Symbol, ...]
    written: tuple[sp.Expr, ...]

    def all_positive(self, expressions: Iterable[sp.Expr]) -> Boolean:
        """Return the condition for all expressions to be positive, in general form."""
        order, kept = self.candidates, self.geometry
        return conjunction(
            (general_condition(e, self.signs, order, kept) for e in expressions), self.signs
        )

    def all_nonnegative(self, radicands: Iterable[sp.Expr]) -> Boolean:
        """Return the condition for all radicands to be nonnegative."""
        order, kept = self.candidates, self.geometry
        return conjunction(
            (general_condition(r, self.signs, order, kept, nonnegative) for r in radicands),
            self.signs,
        )


def state_at(
    family: SolutionFamily, context: RegionContext, place: dict[sp.Symbol, sp.Expr]
) -> NamedMapping[sp.Expr]:
    """Return the state vector of a family, with closed forms substituted for symbols."""
    values = family.elimination.state({}, context.states)
    return NamedMapping(
        "state",
        {n: short_form(_put(e, place)) for n, e in zip(context.states, values, strict=True)},
    )


def _put(expression: sp.Expr, place: dict[sp.Symbol, sp.Expr]) -> sp.Expr:
    spend_traversal(expression)
    return sp.sympify(expression.xreplace(place))


def fold_condition(family: SolutionFamily) -> sp.Expr | None:
    """Return the expression that vanishes at folds of a family; None if it has none."""
    unknown = family.unknown
    if unknown is None:
        return None
    if family.curve is not None and not family.bent:
        return rational_form(family.curve.diff(unknown))
    (equation,) = family.equations
    if equation.is_polynomial(unknown) and sp.degree(equation, unknown) < 2:
        return None
    return expanded_form(equation.diff(unknown))


def folds(
    family: SolutionFamily,
    others: Sequence[SolutionFamily],
    stability: Stability,
    context: RegionContext,
) -> list[CriticalPoint]:
    """Return folds of a family, and branch points, where another family also passes.

    Where several equations remain, both are the zeros of the determinant.

    Parameters
    ----------
    family : SolutionFamily
    others : sequence of SolutionFamily
        Other families of the region.
    stability : Stability
        Stability of the region's Jacobian, to verify that the determinant vanishes.
    context : RegionContext
    """
    if len(family.elimination.unknowns) > 1:
        found = locate(family, stability.determinant, context.signs, context.candidates)
        return [critical_point(FOLD, family, f, stability.determinant, context) for f in found]
    condition = fold_condition(family)
    if condition is None:
        return _intersections(family, others, stability, context)
    if family.curve is None and family.roots is not None and family.discriminant is not None:
        found = _double(family, context)
    else:
        found = locate(family, condition, context.signs, context.candidates)
    points = []
    for located in found:
        point = critical_point(FOLD, family, located, stability.determinant, context)
        if not _defined(point):
            continue
        if any(_passes(other, point, context) for other in others):
            point = replace(point, code=BRANCH_POINT)
        points.append(point)
    return points


def _double(family: SolutionFamily, context: RegionContext) -> list[LocatedForm]:
    """Locate double roots of the polynomial of a family by its discriminant."""
    unknown = family.unknown
    assert unknown is not None
    assert family.discriminant is not None
    (equation,) = family.equations
    poly = sp.Poly(equation, unknown)
    if poly.degree() != 2:
        return [LocatedForm({}, equations=(equation, family.discriminant))]
    middle = -poly.nth(1) / (2 * poly.nth(2))
    return parameters_where(
        family.discriminant, {unknown: middle}, (), context.signs, context.candidates
    )


def _intersections(
    family: SolutionFamily,
    others: Sequence[SolutionFamily],
    stability: Stability,
    context: RegionContext,
) -> list[CriticalPoint]:
    """Branch points of an explicit equilibrium, where another family passes through it."""
    if family.unknown is not None or family.elimination.unknowns or not others:
        return []
    found = locate(family, stability.determinant, context.signs, context.candidates)
    points = [
        critical_point(BRANCH_POINT, family, f, stability.determinant, context)
        for f in found
        if not f.equations
    ]
    return [p for p in points if _defined(p) and any(_passes(o, p, context) for o in others)]


def _defined(point: CriticalPoint) -> bool:
    """Check that no expression of a point is undefined at the parameter values located."""
    return not any(undefined(e) for e in (*point.state.values(), *point.parameters.values()))


def _passes(other: SolutionFamily, point: CriticalPoint, context: RegionContext) -> bool:
    """Check that another family contains a point."""
    if point.equations or any(e.has(ComplexRootOf) for e in point.state.values()):
        # numerical roots are distinguished by their polynomials
        return False
    place = {real(n): e for n, e in {**point.parameters, **point.state}.items()}
    gaps = [e.xreplace(place) for e in other.equations]
    for name, value in other.elimination.solved.items():
        gaps.append(sp.sympify(value.xreplace(place)) - point.state[name])
    return all_vanish(gaps, context.signs)


def cusps(family: SolutionFamily, context: RegionContext) -> list[CriticalPoint]:
    """Return the cusps of a curve, where its first and second derivatives vanish."""
    unknown, curve, parameter = family.unknown, family.curve, family.parameter
    if unknown is None or curve is None or parameter is None or family.bent:
        return []
    slope = derivative(curve, unknown)
    first, second = rational_form(slope), rational_form(derivative(slope, unknown))
    points = []
    others = context.candidates.without(parameter)
    for located in locate(family, second, context.signs, context.candidates):
        if located.equations or unknown not in located.place:
            left = (*located.equations, rational_form(first.xreplace(located.place)))
            # where no equation is left, all states are equilibria
            if any(left) and not _excluded(left, context.signs):
                whole = replace(located, equations=left)
                points.append(critical_point(CUSP, family, whole, first, context))
            continue
        at = rational_form(first.subs(unknown, located.place[unknown]))
        known, under = located.place, located.radicands
        for further in parameters_where(at, known, under, context.signs, others):
            further = replace(further, note=both_notes(located.note, further.note))
            points.append(critical_point(CUSP, family, further, first, context))
    return [p for p in points if _defined(p)]


def _excluded(equations: Sequence[sp.Expr], signs: Signs) -> bool:
    """Check whether equations have no common zero because one is nonzero, or where a power is zero.

    Where b**e vanishes, so do b and all powers of b with larger exponents.
    """
    if any(signs.nonzero(e) for e in equations):
        return True
    return any(
        signs.nonzero(other.replace(partial(_vanishes_with, power), lambda _: sp.S.Zero))
        for power, other in permutations(equations, 2)
        if power.is_Pow
    )


def _vanishes_with(power: sp.Expr, other: sp.Expr) -> bool:
    """Check whether a power is zero where another power of its base is."""
    base, exponent = power.as_base_exp()
    own, least = other.as_base_exp()
    return bool(own == base and (least - exponent).is_nonnegative)


def hopf_points(
    family: SolutionFamily, stability: Stability, context: RegionContext
) -> list[CriticalPoint]:
    """Return the Hopf points of a family.

    The condition includes the sign of the squared frequency, which excludes neutral
    saddles.

    Parameters
    ----------
    family : SolutionFamily
    stability : Stability
        Stability along the family; the eigenvalue pair belongs to one of its blocks.
    context : RegionContext
    """
    points = []
    for one in stability.hopf_tests:
        spend_traversal(one.frequency_squared, FREQUENCY_NODES)
        found = locate(family, one.test, context.signs, context.candidates)
        points += [critical_point(HOPF, family, f, one.test, context, one) for f in found]
    return [p for p in points if p.exists != sp.false and _defined(p)]


def critical_point(
    code: str,
    family: SolutionFamily,
    located: LocatedForm,
    condition: sp.Expr,
    context: RegionContext,
    hopf: HopfTest | None = None,
) -> CriticalPoint:
    """Return a located point with its state, its conditions and its verification.

    Parameters
    ----------
    code : str
    family : SolutionFamily
    located : LocatedForm
    condition : sympy.Expr
        Expression that vanishes there, in addition to the rates.
    context : RegionContext
    hopf : HopfTest, optional
        For a Hopf point.
    """
    state = state_at(family, context, located.place)
    states = {real(n) for n in context.states}
    parameters = {s: e for s, e in located.place.items() if s not in states}
    if family.parameter is not None and family.parameter not in parameters:
        parameters[family.parameter] = _put(family.curve or sp.S.Zero, located.place)
    place = {**parameters, **{real(n): e for n, e in state.items()}}
    exists = context.all_nonnegative(located.radicands)
    frequency = None
    if hopf is not None:
        frequency = short_form(rational_form(_put(family.reduced(hopf.frequency_squared), place)))
        exists = sp.And(exists, context.all_positive([frequency]))
    inside = [rational_form(_put(e, place)) for e in context.inside]
    admissible = conjunction((exists, context.all_positive(inside)), context.signs)
    zeros = (*context.rates.values(), condition)
    # remaining equations define the point, so nothing can be verified
    check = OPEN if located.equations else checked(zeros, place, context.signs)
    return CriticalPoint(
        code=code,
        region=context.region,
        state=state,
        parameters=NamedMapping("parameter", {s.name: e for s, e in parameters.items()}),
        equations=located.equations,
        exists=exists,
        admissible=admissible,
        possible=implied(sp.And(admissible, *_agreeing(parameters, context.signs)), context.signs),
        frequency_squared=frequency,
        check=check,
        note=located.note,
    )


def _agreeing(parameters: dict[sp.Symbol, sp.Expr], signs: Signs) -> list[Boolean]:
    """Conditions for located parameters to have their assumed signs."""
    if any(undefined(e) for e in parameters.values()):
        return [sp.false]
    return [sp.Gt(signs.known[s] * e, 0) for s, e in parameters.items() if s in signs.known]
