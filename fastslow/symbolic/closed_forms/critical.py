"""Folds, branch points, cusps and Hopf points of one region in closed form."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import sympy as sp
from sympy.logic.boolalg import Boolean
from sympy.polys.rootoftools import ComplexRootOf

from fastslow.model.structure import real
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.symbolic.closed_forms.forms import CriticalPoint
from fastslow.symbolic.closed_forms.stability import HopfTest, Stability
from fastslow.symbolic.signs.inequalities import conjunction, general, implied, nonnegative
from fastslow.symbolic.signs.signs import Signs
from fastslow.symbolic.solving.algebra import spread, tidy, undefined
from fastslow.symbolic.solving.candidates import Candidates
from fastslow.symbolic.solving.location import Located, locate, neat, parameters_where
from fastslow.symbolic.solving.solution_families import Family
from fastslow.symbolic.solving.verification import OPEN, all_vanish, checked


@dataclass(frozen=True)
class Setting:
    """What all closed forms of one region are derived with.

    Parameters
    ----------
    region : str
    states : tuple of str
    rates : NamedMapping of sympy.Expr
        Smooth, with exact coefficients.
    inside : tuple of sympy.Expr
        Positive in the region.
    signs : Signs
    candidates : Candidates
        Parameters to solve for, slow quantities first.
    geometry : tuple of Symbol
        Parameters of the interfaces, whose signs are never set aside.
    written : tuple of sympy.Expr
        As ``inside``, in the form in which the interfaces are written.
    """

    region: str
    states: tuple[str, ...]
    rates: NamedMapping[sp.Expr]
    inside: tuple[sp.Expr, ...]
    signs: Signs
    candidates: Candidates
    geometry: tuple[sp.Symbol, ...]
    written: tuple[sp.Expr, ...]

    def holds(self, expressions: Iterable[sp.Expr]) -> Boolean:
        """When all expressions are positive, without assumptions that only decide it."""
        order, kept = self.candidates, self.geometry
        return conjunction((general(e, self.signs, order, kept) for e in expressions), self.signs)

    def real(self, radicands: Iterable[sp.Expr]) -> Boolean:
        """When none of the radicands is negative."""
        order, kept = self.candidates, self.geometry
        return conjunction(
            (general(r, self.signs, order, kept, nonnegative) for r in radicands), self.signs
        )


def state_at(
    family: Family, setting: Setting, place: dict[sp.Symbol, sp.Expr]
) -> NamedMapping[sp.Expr]:
    """Give the state vector of a family where some of its symbols have closed forms."""
    values = family.elimination.state({}, setting.states)
    return NamedMapping(
        "state", {n: neat(_put(e, place)) for n, e in zip(setting.states, values, strict=True)}
    )


def _put(expression: sp.Expr, place: dict[sp.Symbol, sp.Expr]) -> sp.Expr:
    return sp.sympify(expression.xreplace(place))


def fold_condition(family: Family) -> sp.Expr | None:
    """Vanishes where two equilibria of a family meet; None where the family has no folds."""
    unknown = family.unknown
    if unknown is None:
        return None
    if family.curve is not None and not family.bent:
        return tidy(family.curve.diff(unknown))
    (equation,) = family.equations
    if equation.is_polynomial(unknown) and sp.degree(equation, unknown) < 2:
        return None
    return spread(equation.diff(unknown))


def folds(
    family: Family, others: Sequence[Family], stability: Stability, setting: Setting
) -> list[CriticalPoint]:
    """Where two equilibria of a family meet: folds, and branch points where another passes too.

    Parameters
    ----------
    family : Family
    others : sequence of Family
        The other families of the region.
    stability : Stability
        Of the region's Jacobian in states, to verify that the determinant vanishes.
    setting : Setting
    """
    condition = fold_condition(family)
    if condition is None:
        return _meetings(family, others, stability, setting)
    if family.curve is None and family.roots is not None and family.discriminant is not None:
        found = _double(family, setting)
    else:
        found = locate(family, condition, setting.signs, setting.candidates)
    points = []
    for located in found:
        point = critical_point("LP", family, located, stability.determinant, setting)
        if not _defined(point):
            continue
        if any(_passes(other, point, setting) for other in others):
            point = replace(point, code="BP")
        points.append(point)
    return points


def _double(family: Family, setting: Setting) -> list[Located]:
    """Where the polynomial of a family has a double root, by its discriminant."""
    unknown = family.unknown
    assert unknown is not None
    assert family.discriminant is not None
    (equation,) = family.equations
    poly = sp.Poly(equation, unknown)
    if poly.degree() != 2:
        return [Located({}, equations=(equation, family.discriminant))]
    middle = -poly.nth(1) / (2 * poly.nth(2))
    return parameters_where(
        family.discriminant, {unknown: middle}, (), setting.signs, setting.candidates
    )


def _meetings(
    family: Family, others: Sequence[Family], stability: Stability, setting: Setting
) -> list[CriticalPoint]:
    """Where an explicit equilibrium is singular because another family passes through it."""
    if family.unknown is not None or family.elimination.unknowns or not others:
        return []
    found = locate(family, stability.determinant, setting.signs, setting.candidates)
    points = [
        critical_point("BP", family, f, stability.determinant, setting)
        for f in found
        if not f.equations
    ]
    return [p for p in points if _defined(p) and any(_passes(o, p, setting) for o in others)]


def _defined(point: CriticalPoint) -> bool:
    """Whether a point was not found by dividing by zero at the parameter values located."""
    return not any(undefined(e) for e in (*point.state.values(), *point.parameters.values()))


def _passes(other: Family, point: CriticalPoint, setting: Setting) -> bool:
    """Whether another family holds a point."""
    if point.equations or any(e.has(ComplexRootOf) for e in point.state.values()):
        # roots of numbers alone are told apart by their polynomials
        return False
    place = {real(n): e for n, e in {**point.parameters, **point.state}.items()}
    gaps = [e.xreplace(place) for e in other.equations]
    for name, value in other.elimination.solved.items():
        gaps.append(sp.sympify(value.xreplace(place)) - point.state[name])
    return all_vanish(gaps, setting.signs)


def cusps(family: Family, setting: Setting) -> list[CriticalPoint]:
    """Where two folds of a curve meet: first and second derivative vanish along it."""
    unknown, curve, parameter = family.unknown, family.curve, family.parameter
    if unknown is None or curve is None or parameter is None or family.bent:
        return []
    first, second = tidy(curve.diff(unknown)), tidy(curve.diff(unknown, 2))
    points = []
    others = setting.candidates.without(parameter)
    for located in locate(family, second, setting.signs, setting.candidates):
        if located.equations or unknown not in located.place:
            continue
        at = tidy(first.subs(unknown, located.place[unknown]))
        known, under = located.place, located.radicands
        for further in parameters_where(at, known, under, setting.signs, others):
            if not further.equations:
                points.append(critical_point("CP", family, further, first, setting))
    return [p for p in points if _defined(p)]


def hopf_points(family: Family, stability: Stability, setting: Setting) -> list[CriticalPoint]:
    """Where a pair of eigenvalues of a family is imaginary.

    The sign of the squared frequency is part of the condition, so that a neutral
    saddle is never called Hopf.

    Parameters
    ----------
    family : Family
    stability : Stability
        Along the family, in states: a pair belongs to one of its blocks.
    setting : Setting
    """
    points = []
    for one in stability.hopf_tests:
        found = locate(family, one.test, setting.signs, setting.candidates)
        points += [critical_point("HB", family, f, one.test, setting, one) for f in found]
    return [p for p in points if p.exists != sp.false and _defined(p)]


def critical_point(
    code: str,
    family: Family,
    located: Located,
    condition: sp.Expr,
    setting: Setting,
    hopf: HopfTest | None = None,
) -> CriticalPoint:
    """Give a located place as a point: its state, when it exists and is admissible, verified.

    Parameters
    ----------
    code : str
    family : Family
    located : Located
    condition : sympy.Expr
        What vanishes there besides the rates.
    setting : Setting
    hopf : HopfTest, optional
        Given for a Hopf point.
    """
    state = state_at(family, setting, located.place)
    states = {real(n) for n in setting.states}
    parameters = {s: e for s, e in located.place.items() if s not in states}
    if family.parameter is not None and family.parameter not in parameters:
        parameters[family.parameter] = _put(family.curve or sp.S.Zero, located.place)
    place = {**parameters, **{real(n): e for n, e in state.items()}}
    exists = setting.real(located.radicands)
    frequency = None
    if hopf is not None:
        frequency = neat(tidy(_put(family.reduced(hopf.frequency_squared), place)))
        exists = sp.And(exists, setting.holds([frequency]))
    inside = [tidy(_put(e, place)) for e in setting.inside]
    admissible = conjunction((exists, setting.holds(inside)), setting.signs)
    zeros = (*setting.rates.values(), condition)
    # an equation that is left holds by itself, so only its absence can be verified
    check = OPEN if located.equations else checked(zeros, place, setting.signs)
    return CriticalPoint(
        code,
        setting.region,
        state,
        NamedMapping("parameter", {s.name: e for s, e in parameters.items()}),
        located.equations,
        exists,
        admissible,
        implied(sp.And(admissible, *_agreeing(parameters, setting.signs)), setting.signs),
        frequency,
        check,
    )


def _agreeing(parameters: dict[sp.Symbol, sp.Expr], signs: Signs) -> list[Boolean]:
    """Conditions for located parameters to have the signs that are assumed of them."""
    if any(undefined(e) for e in parameters.values()):
        return [sp.false]
    return [sp.Gt(signs.known[s] * e, 0) for s, e in parameters.items() if s in signs.known]
