"""Zeros of a condition on a family of equilibria."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import sympy as sp

from fastslow.model.rational import quotient
from fastslow.symbolic.algebra import (
    expanded_form,
    generators,
    irrational,
    longer,
    numerator,
    rational_form,
    shortest,
    undefined,
    within_budget,
)
from fastslow.symbolic.signs.signs import Signs
from fastslow.symbolic.solving.candidates import Candidates, choose_symbol
from fastslow.symbolic.solving.solution_families import SolutionFamily, abridged, open_factors
from fastslow.symbolic.solving.trigonometric import trigonometric_roots
from fastslow.symbolic.solving.univariate import Root, factors_in, roots, solved_for
from fastslow.symbolic.solving.verification import vanishes

#: Conditions with more nodes remain equations.
CONDITION_NODES = 500

#: Roots with more nodes are not substituted into a condition.
SUBSTITUTED_NODES = 150

#: Largest degree in the eliminated unknown for which a resultant is formed.
RESULTANT = 6

#: Ratio of operations below which a quotient of products is preferred to a sum.
SHORTER = 0.75

Place = dict[sp.Symbol, sp.Expr]


@dataclass(frozen=True)
class LocatedForm:
    """Values of the unknown and of parameters, with the remaining conditions.

    Parameters
    ----------
    place : dict
        Symbol to value.
    radicands : tuple of sympy.Expr
        Expressions that are nonnegative if the point is real.
    equations : tuple of sympy.Expr
        Remaining equations, = 0.
    note : str
        An integer in the values, or a divisor assumed nonzero.
    """

    place: Place
    radicands: tuple[sp.Expr, ...] = ()
    equations: tuple[sp.Expr, ...] = ()
    note: str = ""


def locate(
    family: SolutionFamily, condition: sp.Expr, signs: Signs, candidates: Iterable[sp.Symbol]
) -> list[LocatedForm]:
    """Solve condition = 0 on a family for its unknown or for one more parameter.

    Parameters
    ----------
    family : SolutionFamily
    condition : sympy.Expr
        Expression in states and parameters.
    signs : Signs
    candidates : Candidates or iterable of Symbol
        Parameters to solve for, best first.

    Returns
    -------
    list of LocatedForm
        Empty if the condition has no zeros.

    Examples
    --------
    >>> from fastslow.model.structure import real
    >>> from fastslow.symbolic.solving.solution_families import families
    >>> x, w, q = map(real, "xwq")
    >>> signs = Signs({q: 1})
    >>> (cubic,) = families({"x": w + q * x - x**3}, ["x"], signs, [w, q])
    >>> [point.place[x] for point in locate(cubic, q - 3 * x**2, signs, [w, q])]
    [sqrt(3)*sqrt(q)/3, -sqrt(3)*sqrt(q)/3]
    """
    candidates = Candidates.of(candidates)
    unknown = family.unknown
    if unknown is None and family.elimination.unknowns:
        return [LocatedForm({}, equations=(*family.equations, family.reduced(condition)))]
    if family.bent:
        return _on_bent_curve(family, condition, signs, candidates)
    reduced = family.reduced(condition)
    if longer(reduced, CONDITION_NODES):
        return [LocatedForm({}, equations=(*family.equations, reduced))]
    if unknown is None:
        return parameters_where(reduced, {}, (), signs, candidates)
    if family.curve is not None and family.parameter is not None:
        found = []
        for factor in _open(reduced, [unknown, *candidates], signs):
            found += _on_curve(family, factor, signs, candidates)
        return found
    if family.roots is None:
        return [LocatedForm({}, equations=(*family.equations, reduced))]
    result = []
    for root in family.roots:
        result += _at_root(family, root, reduced, signs, candidates)
    if any(point.equations for point in result):
        return _by_another(family, condition, signs, candidates) or result
    return result


def _by_another(
    family: SolutionFamily, condition: sp.Expr, signs: Signs, candidates: Candidates
) -> list[LocatedForm]:
    """Solve for a parameter that occurs affinely, with the unknown free."""
    (equation,) = family.equations
    other = solved_for(equation, candidates.without(family.unknown), signs)
    if other is None:
        return []
    curve = replace(family, parameter=other[0], curve=other[1])
    found = locate(curve, condition, signs, candidates)
    note = _divided(other[0], other[2], signs)
    if any(point.equations for point in found):
        return []
    return [replace(point, note=both_notes(point.note, note)) for point in found]


def both_notes(*notes: str) -> str:
    """Return distinct notes as one."""
    return "; ".join(dict.fromkeys(n for n in notes if n))


def _on_curve(
    family: SolutionFamily, factor: sp.Expr, signs: Signs, candidates: Candidates
) -> list[LocatedForm]:
    unknown, parameter, curve = family.unknown, family.parameter, family.curve
    assert unknown is not None
    assert parameter is not None
    assert curve is not None
    if unknown in factor.free_symbols:
        closed, note = roots(factor, unknown, signs), ""
        if closed is None:
            taken = {*curve.free_symbols, *candidates}
            periodic = trigonometric_roots(factor, unknown, signs, taken)
            if periodic is not None:
                closed, note = periodic[0], f"{periodic[1]} is any integer"
        if closed is not None:
            return [
                LocatedForm(
                    {unknown: r.value, parameter: short_form(curve.subs(unknown, r.value))},
                    r.radicands,
                    note=note,
                )
                for r in closed
            ]
    found = _solved(factor, candidates.without(parameter, unknown), signs)
    return [
        replace(one, place={**one.place, parameter: short_form(curve.subs(one.place))})
        for one in found
    ]


def _solved(factor: sp.Expr, candidates: Candidates, signs: Signs) -> list[LocatedForm]:
    """Solve a condition for a parameter in which it is affine, where its coefficient is nonzero.

    Where both the coefficient and the rest vanish the parameter is arbitrary.
    """
    other = solved_for(factor, candidates, signs)
    if other is None:
        return [LocatedForm({}, equations=(factor,))]
    symbol, value, slope = other
    if value == 0:
        left = open_factors(slope, signs)
        return [LocatedForm({symbol: value}), *(LocatedForm({}, equations=(f,)) for f in left)]
    return [LocatedForm({symbol: value}, note=_divided(symbol, slope, signs))]


def _divided(symbol: sp.Symbol, slope: sp.Expr, signs: Signs) -> str:
    """Return a note on the coefficient of a symbol, unless it is known to be nonzero."""
    nonzero = ", ".join(f"{abridged(f)} ≠ 0" for f in open_factors(slope, signs))
    return f"{symbol} is solved for where {nonzero}" if nonzero else ""


def _on_bent_curve(
    family: SolutionFamily, condition: sp.Expr, signs: Signs, candidates: Candidates
) -> list[LocatedForm]:
    """Zeros on a curve given by a root, by elimination of the parameter.

    Solutions on the other root are discarded.
    """
    unknown, parameter, curve = family.unknown, family.parameter, family.curve
    assert unknown is not None
    assert parameter is not None
    assert curve is not None
    (equation,) = family.equations
    free = numerator(replace(family, parameter=None, curve=None).reduced(condition))
    short = not longer(free, SUBSTITUTED_NODES) and not longer(curve, SUBSTITUTED_NODES)
    whole = short and equation.is_polynomial(parameter) and free.is_polynomial(parameter)
    if not whole or max(sp.degree(e, parameter) for e in (equation, free)) > RESULTANT:
        return [LocatedForm({}, family.radicands, (equation, free))]
    both = sp.resultant(equation, free, parameter) if parameter in free.free_symbols else free
    found = []
    for factor in _open(both, [unknown, *candidates], signs):
        closed = roots(factor, unknown, signs) if unknown in factor.free_symbols else None
        if closed is None:
            places = _solved(factor, candidates.without(parameter, unknown), signs)
        else:
            places = [LocatedForm({unknown: r.value}, r.radicands) for r in closed]
        for one in places:
            if one.equations:
                at = {**one.place, parameter: curve}
                found.append(LocatedForm(at, family.radicands, one.equations))
                continue
            place, radicands = one.place, one.radicands
            value = short_form(curve.subs(place))
            if undefined(value) or not vanishes(free.subs(place).subs(parameter, value), signs):
                continue
            under = tuple(short_form(r.subs(place)) for r in family.radicands)
            found.append(
                LocatedForm({**place, parameter: value}, (*radicands, *under), note=one.note)
            )
    return found


def _at_root(
    family: SolutionFamily, root: Root, reduced: sp.Expr, signs: Signs, candidates: Candidates
) -> list[LocatedForm]:
    unknown = family.unknown
    assert unknown is not None
    at = reduced.xreplace({unknown: root.value})
    if longer(at, CONDITION_NODES):
        return [LocatedForm({unknown: root.value}, root.radicands, (at,))]
    at = rational_form(at)
    if irrational(at):
        (equation,) = family.equations
        polys = equation.is_polynomial(unknown) and reduced.is_polynomial(unknown)
        if not polys or sp.degree(reduced, unknown) > RESULTANT:
            return [LocatedForm({unknown: root.value}, root.radicands, (at,))]
        at = sp.resultant(equation, reduced, unknown)
    found = parameters_where(at, {unknown: root.value}, root.radicands, signs, candidates)
    return [
        point
        for point in found
        # a zero of the resultant may belong to another root
        if point.equations or vanishes(reduced.subs(point.place).subs(point.place), signs)
    ]


def parameters_where(
    condition: sp.Expr,
    known: Place,
    radicands: tuple[sp.Expr, ...],
    signs: Signs,
    candidates: Iterable[sp.Symbol],
) -> list[LocatedForm]:
    """Solve a condition on parameters for one of them, and substitute it into known values.

    Examples
    --------
    >>> from fastslow.model.structure import real
    >>> a, x = real("a"), real("x")
    >>> parameters_where(a - 1, {x: a**2}, (), Signs({}), [a])[0].place
    {x: 1, a: 1}
    """
    if longer(condition, CONDITION_NODES):
        return [LocatedForm(dict(known), radicands, (condition,))]
    candidates = Candidates.of(candidates)
    result = []
    for factor in _open(condition, list(candidates), signs):
        choice = choose_symbol(factor, candidates, signs)
        if choice is None:
            result.append(LocatedForm(dict(known), radicands, (factor,)))
            continue
        note = "" if choice.slope is None else _divided(choice.symbol, choice.slope, signs)
        for option in choice.values:
            value = {choice.symbol: option.value}
            place = {s: short_form(e.subs(value)) for s, e in known.items()}
            under = tuple(short_form(r.subs(value)) for r in radicands)
            result.append(LocatedForm({**place, **value}, (*under, *option.radicands), note=note))
    return result


def _open(condition: sp.Expr, symbols: Sequence[sp.Symbol], signs: Signs) -> list[sp.Expr]:
    """Factors that may vanish."""
    return [f for f, _ in factors_in(condition, symbols) if signs.sign(f) not in (1, -1)]


def short_form(expression: sp.Expr) -> sp.Expr:
    """Return a short form with expanded radicals; long expressions are unchanged.

    Examples
    --------
    >>> a = sp.Symbol("a", positive=True)
    >>> short_form(sp.sqrt(a) * (sp.sqrt(a) + 1) - sp.sqrt(a))
    a
    """
    if expression.has(sp.polys.rootoftools.ComplexRootOf):
        return expression
    found = quotient(expression) if irrational(expression) else None
    if found is not None:
        flat, whole = found.expanded(), found.factored()
        return whole if sp.count_ops(whole) < SHORTER * sp.count_ops(flat) else flat
    if irrational(expression) and within_budget(expression) and not generators(expression):
        expanded = expanded_form(expression)
        return min(expanded, expanded_form(sp.together(expanded)), key=sp.count_ops)
    return shortest(expression)
