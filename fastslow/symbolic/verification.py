"""Whether an expression is identically zero: exactly where that is cheap, else at points."""

from __future__ import annotations

from collections.abc import Iterable

import sympy as sp

from fastslow.symbolic.algebra import numerator
from fastslow.symbolic.signs import Signs

#: Points at which an expression that does not reduce exactly is evaluated.
POINTS = 4

#: Digits of that evaluation; what is left must be below 10**-(DIGITS - 15) of the largest term.
DIGITS = 50


def vanishes(expression: sp.Expr, signs: Signs | None = None) -> bool:
    """Whether an expression is zero for all values that the assumptions allow.

    Expansion over one denominator settles rational expressions and single
    radicals. What is left over is evaluated with 50 digits at four fixed
    points where it is real.

    Examples
    --------
    >>> from fastslow.model.structure import real
    >>> A = real("A")
    >>> vanishes(sp.sqrt(A + 1)**2 - A - 1), vanishes(sp.sqrt(A) - A)
    (True, False)
    """
    expression = sp.sympify(expression)
    if expression == 0:
        return True
    if not expression.has(sp.polys.rootoftools.ComplexRootOf) and numerator(expression) == 0:
        return True
    return _at_points(expression, signs or Signs({}))


def all_vanish(expressions: Iterable[sp.Expr], signs: Signs | None = None) -> bool:
    """Whether every one of them does."""
    return all(vanishes(e, signs) for e in expressions)


def _at_points(expression: sp.Expr, signs: Signs) -> bool:
    symbols = sorted(expression.free_symbols, key=lambda s: s.name)
    seen = 0
    for k in range(6 * POINTS):
        # quotients of primes, spread over four decades
        place = {
            s: sp.Rational(sp.prime(3 * k + 5 * j + 7), sp.prime(11 + 2 * j + k))
            * sp.Integer(10) ** ((k + j) % 4 - 2)
            * signs.known.get(s, (-1) ** (k // (j + 1)))
            for j, s in enumerate(symbols)
        }
        terms = [t.subs(place).evalf(DIGITS) for t in sp.Add.make_args(expression)]
        if not all(t.is_number and t.is_finite for t in terms):
            continue
        size = max((abs(t) for t in terms), default=sp.Integer(0))
        if abs(sp.Add(*terms)) > size * sp.Float(10) ** (15 - DIGITS):
            return False
        seen += 1
        if seen == POINTS or not symbols:
            break
    return seen > 0
