"""Verification of closed forms by substitution, exactly or numerically at points."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import mpmath
import sympy as sp

from fastslow.model.rational import quotient
from fastslow.model.work import Budget, PastWorkError, nodes, spend
from fastslow.symbolic.algebra import expanded_form, longer, numerator, undefined
from fastslow.symbolic.signs.signs import Signs

#: Budget of work of one verification at points.
VERIFICATION = 100_000

#: Work of Newton's method for each node of the equations.
NEWTON_WORK = 50

#: Work of evaluating one node to 50 digits.
EVALUATION = 10

#: Points at which an expression is evaluated if it is not reduced exactly.
EVALUATED_POINTS = 4

#: Digits of the evaluation; residuals are below 10**-(EVALUATED_DIGITS - 15) of the largest term.
EVALUATED_DIGITS = 50

#: Expressions with more nodes are only evaluated.
REDUCED_NODES = 400

#: Newton steps from one start.
NEWTON_STEPS = 40

#: Points without a root after which the search ends.
ROOTLESS = 2

#: Methods of verification, the stronger first; empty for none.
EXACT, NUMERIC, OPEN = "exact", f"{EVALUATED_DIGITS} digits", ""

Place = Mapping[sp.Symbol, sp.Expr]


def vanishes(expression: sp.Expr, signs: Signs | None = None) -> bool:
    """Check that an expression vanishes for all values allowed by the assumptions.

    Expansion over one denominator is exact for rational expressions and single
    radicals. Other expressions are evaluated with 50 digits at four fixed
    points.

    Examples
    --------
    >>> from fastslow.model.structure import real
    >>> A = real("A")
    >>> vanishes(sp.sqrt(A + 1)**2 - A - 1), vanishes(sp.sqrt(A) - A)
    (True, False)
    """
    return all_vanish([expression], signs)


def all_vanish(expressions: Iterable[sp.Expr], signs: Signs | None = None) -> bool:
    """Check that all expressions vanish for all values allowed by the assumptions."""
    return checked(expressions, {}, signs) != OPEN


def weakest(checks: Iterable[str]) -> str:
    """Return the weakest of several methods of verification.

    Examples
    --------
    >>> weakest(["exact", "50 digits"])
    '50 digits'
    """
    each = set(checks)
    return OPEN if OPEN in each else NUMERIC if NUMERIC in each else EXACT


def checked(
    expressions: Iterable[sp.Expr],
    place: Place,
    signs: Signs | None = None,
    equations: Sequence[sp.Expr] = (),
    unknowns: Sequence[sp.Symbol] = (),
) -> str:
    """Return the method that verifies that expressions vanish at a closed form.

    Parameters
    ----------
    expressions : iterable of sympy.Expr
    place : mapping
        Symbol to value, in unknowns and other symbols.
    signs : Signs, optional
    equations : sequence of sympy.Expr
        Hold among the unknowns, = 0; there a root is found at each point.
    unknowns : sequence of Symbol

    Returns
    -------
    str
        ``"exact"``, ``"50 digits"`` or, if it is false or undecided, ``""``.

    Examples
    --------
    >>> x, a = sp.symbols("x a")
    >>> checked([x**2 - a**2], {x: -a}), checked([x - a], {x: -a})
    ('exact', '')
    """
    values = {s: e for s, e in place.items() if s != e}
    left = []
    for expression in map(sp.sympify, expressions):
        if not _exactly(expression, values, equations, unknowns):
            left.append(expression)
    if not left:
        return EXACT
    known = signs.known if signs is not None else {}
    try:
        with Budget(VERIFICATION).spending():
            vanish = _at_points(left, values, known, equations, unknowns)
    except PastWorkError:
        vanish = False
    return NUMERIC if vanish else OPEN


def _multiple(expression: sp.Expr, equation: sp.Expr, unknowns: Sequence[sp.Symbol]) -> bool:
    """Check whether the numerator of an expression has an equation as a factor."""
    over, under = quotient(expression), quotient(equation)
    if over is None or under is None:
        return False
    ratio = quotient(over.numerator.as_expr() / under.numerator.as_expr())
    return ratio is not None and not ratio.denominator.as_expr().free_symbols & set(unknowns)


def _exactly(
    expression: sp.Expr,
    values: Place,
    equations: Sequence[sp.Expr],
    unknowns: Sequence[sp.Symbol],
) -> bool:
    if expression == 0:
        return True
    if equations:
        inside = expanded_form(expression.xreplace(dict(values)))
        if inside == 0 or any(inside in (e, expanded_form(-e)) for e in equations):
            return True
        return any(_multiple(inside, e, unknowns) for e in equations)
    used = [values[s] for s in expression.free_symbols if s in values]
    if longer(expression, REDUCED_NODES) or any(longer(e, REDUCED_NODES // 4) for e in used):
        return False
    whole = expression.xreplace(dict(values))
    return not whole.has(sp.polys.rootoftools.ComplexRootOf) and numerator(whole) == 0


def _at_points(
    expressions: Sequence[sp.Expr],
    values: Place,
    known: Mapping[sp.Symbol, int],
    equations: Sequence[sp.Expr],
    unknowns: Sequence[sp.Symbol],
) -> bool:
    everything = (*expressions, *values.values(), *equations)
    if any(undefined(e) for e in everything):
        return False
    symbols = set().union(*(e.free_symbols for e in everything)) - set(values)
    if equations:
        symbols -= set(unknowns)
    ordered = sorted(symbols, key=lambda s: s.name)
    seen = rootless = 0
    for k in range(6 * EVALUATED_POINTS):
        # quotients of primes, spread over four decades
        point: dict[sp.Symbol, sp.Expr] = {
            s: sp.Float(
                sp.Rational(sp.prime(3 * k + 5 * j + 7), sp.prime(11 + 2 * j + k))
                * sp.Integer(10) ** ((k + j) % 4 - 2)
                * known.get(s, (-1) ** (k // (j + 1))),
                3 * EVALUATED_DIGITS,
            )
            for j, s in enumerate(ordered)
        }
        if equations:
            found = _root([e.xreplace(point) for e in equations], unknowns, k)
            if found is None:
                rootless += 1
                if rootless == ROOTLESS:
                    break
                continue
            point |= found
        spend(EVALUATION * sum(map(nodes, values.values())))
        point |= {s: e.xreplace(point).evalf(EVALUATED_DIGITS + 10) for s, e in values.items()}
        sizes = [_left_over(e, point) for e in expressions]
        if None in sizes:
            continue
        if not all(sizes):
            return False
        seen += 1
        if seen == EVALUATED_POINTS or not ordered:
            break
    return seen > 0


def _left_over(expression: sp.Expr, point: Place) -> bool | None:
    """Check whether the terms of a sum or factor cancel at a point; None if undefined."""
    if expression.is_Mul:
        each = [_left_over(factor, point) for factor in expression.args]
        return None if None in each else any(each)
    spend(EVALUATION * nodes(expression))
    terms = [t.xreplace(dict(point)).evalf(EVALUATED_DIGITS) for t in sp.Add.make_args(expression)]
    if not all(t.is_number and t.is_finite for t in terms):
        return None
    size = max((abs(t) for t in terms), default=sp.Integer(0))
    total = abs(sp.Add(*terms).evalf(EVALUATED_DIGITS))
    return bool(total <= size * sp.Float(10) ** (15 - EVALUATED_DIGITS))


def _root(
    equations: Sequence[sp.Expr], unknowns: Sequence[sp.Symbol], start: int
) -> dict[sp.Symbol, sp.Expr] | None:
    """Compute a real or complex root by Newton's method; None if it does not converge."""
    with mpmath.workdps(EVALUATED_DIGITS + 10):
        function = sp.lambdify(list(unknowns), list(equations), "mpmath")
        for attempt in range(3):
            first = [
                mpmath.mpc(1 + (start + j) % 3 - attempt, (attempt + 1) / (j + 2))
                for j in range(len(unknowns))
            ]
            spend(NEWTON_WORK * sum(map(nodes, equations)))
            try:
                tolerance = mpmath.mpf(10) ** -(EVALUATED_DIGITS + 2)
                found = mpmath.findroot(
                    function, first, solver="mdnewton", tol=tolerance, maxsteps=NEWTON_STEPS
                )
            except (ValueError, ZeroDivisionError, OverflowError):
                continue
            return {
                u: sp.Float(z.real, EVALUATED_DIGITS + 10)
                + sp.I * sp.Float(z.imag, EVALUATED_DIGITS + 10)
                for u, z in zip(unknowns, map(mpmath.mpc, found), strict=True)
            }
    return None
