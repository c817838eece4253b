"""Equivalent systems of polynomial equations of lower degree."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import permutations

import sympy as sp

from fastslow.symbolic.algebra import growth

#: Number of combinations that lower degrees.
LOWERING_ROUNDS = 4

#: Largest total number of terms of equations that are combined.
COMBINED_TERMS = 400


def lower_degrees(
    equations: Sequence[sp.Expr], states: Sequence[sp.Symbol], rounds: int = LOWERING_ROUNDS
) -> list[tuple[sp.Expr, ...]]:
    """Return systems with the same solutions in total, with terms of highest degree cancelled.

    If the terms of highest degree of one equation are a multiple of those of another, it is
    replaced by each factor of the combination in which they cancel.

    Examples
    --------
    >>> x, y = sp.symbols("x y")
    >>> lower_degrees((x**2 + y**2 - 2, 2 * x**2 + 2 * y**2 - x - 3), (x, y))
    [(x**2 + y**2 - 2, x - 1)]
    >>> lower_degrees((x**2 + y - 3, x**2 * 2 + x * y - 6), (x, y))
    [(x**2 + y - 3, 2*x**2 + x*y - 6)]
    """
    if sum(map(growth, equations)) > COMBINED_TERMS:
        return [tuple(equations)]
    symbols = sorted(set().union(*(e.free_symbols for e in equations)) - set(states), key=str)
    if not all(e.is_polynomial(*states, *symbols) for e in equations):
        return [tuple(equations)]
    polynomials = [sp.Poly(e, *states, *symbols) for e in equations]
    highest = [_highest(p, len(states)) for p in polynomials]
    for one, other in permutations(range(len(equations)), 2):
        if not 1 <= highest[one][0] <= highest[other][0] or highest[other][0] == 1:
            continue
        ratio, left = highest[other][1].div(highest[one][1])
        if not left.is_zero:
            continue
        rest = polynomials[other] - ratio * polynomials[one]
        factors = [f.as_expr() for f, _ in rest.factor_list()[1]]
        # a factor without states remains in every system
        common = sp.Mul(*(f for f in factors if not f.has(*states)))
        # zero is redundant, and a nonzero constant has no solution
        choices = [sp.expand(common * f) for f in factors if f.has(*states)] or [rest.as_expr()]
        each = [(*equations[:other], f, *equations[other + 1 :]) for f in choices]
        if rounds == 1:
            return each
        return [e for some in each for e in lower_degrees(some, states, rounds - 1)]
    return [tuple(equations)]


def _highest(polynomial: sp.Poly, states: int) -> tuple[int, sp.Poly]:
    """Degree in the states, which come first, and the terms of that degree."""
    degree = max(sum(e[:states]) for e in polynomial.monoms())
    terms = {e: c for e, c in polynomial.terms() if sum(e[:states]) == degree}
    return degree, sp.Poly.from_dict(terms, *polynomial.gens)
