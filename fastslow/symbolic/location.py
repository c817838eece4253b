"""Where on a family of equilibria a condition vanishes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import sympy as sp

from fastslow.symbolic.algebra import generators, irrational, light, longer, shortest, spread, tidy
from fastslow.symbolic.signs import Signs
from fastslow.symbolic.solution_families import Family
from fastslow.symbolic.univariate import Root, factors_in, roots, solved_for
from fastslow.symbolic.verification import vanishes

#: A longer condition, in parts of its tree, is left as an equation.
PARTS = 500

#: Resultants are formed up to this degree of the eliminated unknown.
RESULTANT = 6

Place = dict[sp.Symbol, sp.Expr]


@dataclass(frozen=True)
class Located:
    """Values of the unknown and of parameters, and what they leave open.

    Parameters
    ----------
    place : dict
        Symbol to value.
    radicands : tuple of sympy.Expr
        None of them negative where the point is real.
    equations : tuple of sympy.Expr
        Still to hold, = 0.
    """

    place: Place
    radicands: tuple[sp.Expr, ...] = ()
    equations: tuple[sp.Expr, ...] = ()


def locate(
    family: Family, condition: sp.Expr, signs: Signs, candidates: Sequence[sp.Symbol]
) -> list[Located]:
    """Solve condition = 0 on a family, for its unknown or for one more parameter.

    Parameters
    ----------
    family : Family
    condition : sympy.Expr
        In states and parameters.
    signs : Signs
    candidates : sequence of Symbol
        Parameters to solve for, best first.

    Returns
    -------
    list of Located
        Empty where the condition cannot vanish.

    Examples
    --------
    >>> from fastslow.model.structure import real
    >>> from fastslow.symbolic.solution_families import families
    >>> x, w, q = map(real, "xwq")
    >>> signs = Signs({q: 1})
    >>> (cubic,) = families({"x": w + q * x - x**3}, ["x"], signs, [w, q])
    >>> [point.place[x] for point in locate(cubic, q - 3 * x**2, signs, [w, q])]
    [sqrt(3)*sqrt(q)/3, -sqrt(3)*sqrt(q)/3]
    """
    unknown = family.unknown
    if unknown is None and family.elimination.unknowns:
        return [Located({}, equations=(*family.equations, family.reduced(condition)))]
    reduced = family.reduced(condition)
    if longer(reduced, PARTS):
        return [Located({}, equations=(*family.equations, reduced))]
    if unknown is None:
        return parameters_where(reduced, {}, (), signs, candidates)
    if family.curve is not None and family.parameter is not None:
        found = []
        for factor in _open(reduced, [unknown, *candidates], signs):
            found += _on_curve(family, factor, signs, candidates)
        return found
    if family.roots is None:
        return [Located({}, equations=(*family.equations, reduced))]
    result = []
    for root in family.roots:
        result += _at_root(family, root, reduced, signs, candidates)
    return result


def _on_curve(
    family: Family, factor: sp.Expr, signs: Signs, candidates: Sequence[sp.Symbol]
) -> list[Located]:
    unknown, parameter, curve = family.unknown, family.parameter, family.curve
    assert unknown is not None
    assert parameter is not None
    assert curve is not None
    if unknown in factor.free_symbols:
        closed = roots(factor, unknown, signs)
        if closed is not None:
            return [
                Located(
                    {unknown: r.value, parameter: neat(curve.subs(unknown, r.value))},
                    (r.radicand,),
                )
                for r in closed
            ]
    other = solved_for(factor, [c for c in candidates if c not in (parameter, unknown)], signs)
    if other is None:
        return [Located({parameter: curve}, equations=(factor,))]
    symbol, value, _ = other
    return [Located({symbol: value, parameter: neat(curve.subs(symbol, value))})]


def _at_root(
    family: Family, root: Root, reduced: sp.Expr, signs: Signs, candidates: Sequence[sp.Symbol]
) -> list[Located]:
    unknown = family.unknown
    assert unknown is not None
    at = reduced.xreplace({unknown: root.value})
    if longer(at, PARTS):
        return [Located({unknown: root.value}, (root.radicand,), (at,))]
    at = tidy(at)
    if irrational(at):
        (equation,) = family.equations
        polys = equation.is_polynomial(unknown) and reduced.is_polynomial(unknown)
        if not polys or sp.degree(reduced, unknown) > RESULTANT:
            return [Located({unknown: root.value}, (root.radicand,), (at,))]
        at = sp.resultant(equation, reduced, unknown)
    found = parameters_where(at, {unknown: root.value}, (root.radicand,), signs, candidates)
    return [
        point
        for point in found
        # a root of the resultant may belong to another root of the unknown
        if point.equations or vanishes(reduced.subs(point.place).subs(point.place), signs)
    ]


def parameters_where(
    condition: sp.Expr,
    known: Place,
    radicands: tuple[sp.Expr, ...],
    signs: Signs,
    candidates: Sequence[sp.Symbol],
) -> list[Located]:
    """Solve a condition on parameters alone for one of them, and put it into what is known.

    Examples
    --------
    >>> from fastslow.model.structure import real
    >>> a, x = real("a"), real("x")
    >>> parameters_where(a - 1, {x: a**2}, (), Signs({}), [a])[0].place
    {x: 1, a: 1}
    """
    if longer(condition, PARTS):
        return [Located(dict(known), radicands, (condition,))]
    result = []
    for factor in _open(condition, list(candidates), signs):
        solved = solved_for(factor, candidates, signs)
        if solved is not None:
            options = [Root(solved[1])]
            symbol = solved[0]
        else:
            symbol, options = _nonlinear(factor, candidates, signs)
        if symbol is None:
            result.append(Located(dict(known), radicands, (factor,)))
        for option in options:
            place = {s: neat(e.subs(symbol, option.value)) for s, e in known.items()}
            under = tuple(neat(r.subs(symbol, option.value)) for r in radicands)
            result.append(Located({**place, symbol: option.value}, (*under, option.radicand)))
    return result


def _nonlinear(
    factor: sp.Expr, candidates: Sequence[sp.Symbol], signs: Signs
) -> tuple[sp.Symbol | None, list[Root]]:
    for symbol in candidates if light(factor) else ():
        if symbol in factor.free_symbols:
            closed = roots(factor, symbol, signs)
            if closed is not None:
                return symbol, closed
    return None, []


def _open(condition: sp.Expr, symbols: Sequence[sp.Symbol], signs: Signs) -> list[sp.Expr]:
    """Factors that may vanish."""
    return [f for f, _ in factors_in(condition, symbols) if signs.sign(f) not in (1, -1)]


def neat(expression: sp.Expr) -> sp.Expr:
    """Short, with radicals expanded; as it is when long.

    Examples
    --------
    >>> a = sp.Symbol("a", positive=True)
    >>> neat(sp.sqrt(a) * (sp.sqrt(a) + 1) - sp.sqrt(a))
    a
    """
    if expression.has(sp.polys.rootoftools.ComplexRootOf):
        return expression
    if irrational(expression) and light(expression) and not generators(expression):
        expanded = spread(expression)
        return min(expanded, spread(sp.together(expanded)), key=sp.count_ops)
    return shortest(expression)
