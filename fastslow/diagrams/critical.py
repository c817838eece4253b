"""Parameter values at which the number of equilibria of a region can change."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import sympy as sp

from fastslow.continuation.polynomial_systems import (
    FARTHEST,
    Terms,
    at_value,
    solve_polynomials,
    units,
)
from fastslow.diagrams.equations import RegionEquations, real_roots, terms_of
from fastslow.model.structure import real

#: Degree in the unknown up to which discriminants and resultants are formed.
DEGREE = 8

#: Critical values closer than this fraction of the range are one.
SHORTEST = 1e-8

#: Size of a resultant up to which its discriminant is formed: its degrees in the unknown, twice,
#: and in the parameter, times the bits of its coefficients. A few seconds at the most.
LARGEST = 400_000

#: Highest degree of a discriminant or resultant in the parameter whose roots are trusted.
ROOTS = 12


def critical_values(
    equations: RegionEquations, lower: float, upper: float, edges: Sequence[sp.Expr] = ()
) -> list[float] | None:
    """Values between which a region's admissible equilibria move without meeting or leaving.

    These are the values at which two equilibria meet (the rates and the determinant of their
    Jacobian vanish), at which one runs to infinity, and at which one meets an interface (for
    sliding also where a drift vanishes, at boundary equilibria and two-folds). A start in every
    interval between them is therefore a start on every branch.

    One polynomial of low degree in one unknown has its discriminant, leading coefficient
    and resultants. For up to three unknowns the solutions of these polynomial systems in
    unknowns and parameter are isolated (see `solve_polynomials`).

    Parameters
    ----------
    equations : RegionEquations
    lower, upper : float
        Range of the parameter.
    edges : sequence of Expr
        Further functions of the states at whose zeros a start is wanted on both sides.

    Returns
    -------
    list of float or None
        None where the region's equations are no polynomials in few unknowns and the
        parameter, or too large, so that nothing is proved.
    """
    left = equations.elimination
    if equations.impossible:
        return []
    alone = [e for e in left.remaining if not e.has(*left.unknowns)] if left.unknowns else []
    alone = list(left.remaining) if not left.unknowns else alone
    p = real(equations.field.parameter)
    if not all(e.is_polynomial(p) for e in alone):
        return None
    if len(alone) == len(left.remaining) and (alone or left.unknowns):
        return _values(alone, p, lower, upper)
    if alone:
        return None
    bounds = _along(equations, [*equations.bounds, *edges])
    if bounds is None:
        return None
    conditions = _resultants(equations, bounds)
    if conditions is not None and all(sp.degree(c, p) <= ROOTS for c in conditions):
        return _values(conditions, p, lower, upper)
    return _isolated(equations, bounds, lower, upper)


def _values(
    conditions: Sequence[sp.Expr], p: sp.Symbol, lower: float, upper: float
) -> list[float] | None:
    """Real roots in a range of polynomials in the parameter; None if one vanishes identically."""
    values: set[float] = set()
    for condition in conditions:
        polynomial = sp.Poly(condition, p)
        if polynomial.is_zero:
            return None
        size = max(abs(c) for c in polynomial.all_coeffs())
        coefficients = np.array([float(c / size) for c in polynomial.all_coeffs()])
        values |= {v for v in real_roots(coefficients) if lower < v < upper}
    return sorted(values)


def _along(equations: RegionEquations, bounds: Sequence[sp.Expr]) -> list[sp.Expr] | None:
    """Functions of the states along equilibria, over unknowns and parameter; None if no polynomial.

    A denominator has been shown not to vanish, or is a zero of the rates' own.
    """
    left = equations.elimination
    p = real(equations.field.parameter)
    solved = {real(n): e for n, e in left.solved.items()}
    found = []
    for bound in bounds:
        h = bound.subs(solved)
        if not h.is_polynomial(p, *left.unknowns):
            h = sp.together(h).as_numer_denom()[0]
        if not h.is_polynomial(p, *left.unknowns):
            return None
        found.append(sp.expand(h))
    return found


def _resultants(equations: RegionEquations, edges: Sequence[sp.Expr]) -> list[sp.Expr] | None:
    """Polynomials in the parameter, for at most one unknown and a low degree."""
    left = equations.elimination
    p = real(equations.field.parameter)
    if not left.unknowns:
        return list(edges)
    equation = left.remaining[0]
    if len(left.unknowns) > 1 or not equation.is_polynomial(*left.unknowns, p):
        return None
    (x,) = left.unknowns
    if sp.degree(equation, x) > DEGREE:
        return None
    polynomial = sp.Poly(equation, x)
    found = [polynomial.LC()]
    if polynomial.degree() > 1:
        found.append(sp.discriminant(equation, x))
    for edge in edges:
        found.append(sp.resultant(equation, edge, x) if edge.has(x) else edge)
    return [sp.expand(f) for f in found]


def _isolated(
    equations: RegionEquations, bounds: Sequence[sp.Expr], lower: float, upper: float
) -> list[float] | None:
    """Values at which systems in unknowns and parameter have solutions."""
    if equations.system is None:
        return None
    unknowns = equations.elimination.unknowns
    p = real(equations.field.parameter)
    symbols = [*unknowns, p]
    rates = list(equations.elimination.remaining)
    if not all(r.is_polynomial(*symbols) for r in rates):
        return None
    # as polynomials the determinant is expanded while it is formed
    slopes = [[sp.Poly(r, *symbols).diff(x) for x in unknowns] for r in rates]
    values: set[float] = set()
    determinant = _determinant(slopes).as_expr()
    for condition in (None, determinant, *bounds):
        found = _meetings(equations, condition, lower, upper)
        if found is None and condition is determinant:
            found = _double_roots(equations, lower, upper)
        if found is None:
            return None
        values |= set(found)
    kept: list[float] = []
    for value in sorted(v for v in values if lower < v < upper):
        # what runs to infinity gives several values that are nearly equal
        if not kept or value - kept[-1] > SHORTEST * (upper - lower):
            kept.append(value)
    return kept


@lru_cache(maxsize=512)
def _meetings(
    equations: RegionEquations, condition: sp.Expr | None, lower: float, upper: float
) -> list[float] | None:
    """Values at which a function vanishes at an equilibrium, or without one those at infinity."""
    unknowns = equations.elimination.unknowns
    p = real(equations.field.parameter)
    symbols = [*unknowns, p]
    base = terms_of(equations.elimination.remaining, symbols)
    if base is None:
        return None
    if condition is None:
        systems = _at_infinity(base, {len(unknowns): (lower, upper)})
    elif condition.has(*unknowns) or condition == 0:
        extra = terms_of([condition], symbols)
        if extra is None:
            return None
        systems = [[*base, *extra]]
    else:
        return _values([condition], p, lower, upper)
    values: set[float] = set()
    for system in systems:
        solved = solve_polynomials(system, {len(system) - 1: (lower, upper)})
        if not solved.complete:
            return None
        values |= {float(v) for v in solved.simple[:, -1]}
        # on either side of what is not told apart
        values |= {float(v) for v in solved.clusters[:, :, -1].ravel()}
    return sorted(values)


@lru_cache(maxsize=64)
def _double_roots(equations: RegionEquations, lower: float, upper: float) -> list[float] | None:
    """Values at which two equilibria in two unknowns meet, by exact elimination.

    Where the determinant nearly vanishes along branches that run to infinity, folds are not
    isolated there. Two equilibria that meet are a double root of the resultant R of both rates:
    they are among the real roots of its discriminant, its leading coefficient and its content.

    Returns
    -------
    list of float or None
        None for more unknowns, a resultant that is too large (see `LARGEST`), or one with a
        multiple factor, which has double roots everywhere.
    """
    unknowns = equations.elimination.unknowns
    p = real(equations.field.parameter)
    terms = terms_of(equations.elimination.remaining, [*unknowns, p])
    if len(unknowns) != 2 or terms is None:
        return None
    symbols = [*unknowns, p]
    first, second = (
        sp.Poly({e: sp.Rational(c.numerator, c.denominator) for e, c in one.items()}, *symbols)
        .clear_denoms(convert=True)[1]
        .as_expr()
        for one in terms
    )
    smallest: tuple[int, list[sp.Poly]] | None = None
    for kept, gone in (unknowns, unknowns[::-1]):
        resultant = sp.Poly(sp.resultant(first, second, gone), kept, p)
        if resultant.is_zero:
            return None
        factors = resultant.factor_list()[1]
        if any(power > 1 and factor.degree(kept) > 0 for factor, power in factors):
            continue
        bits = max(abs(int(c)).bit_length() for c in resultant.primitive()[1].coeffs())
        size = resultant.degree(kept) ** 2 * max(resultant.degree(p), 1) * bits
        conditions = [factor for factor, _ in factors if factor.degree(kept) == 0]
        whole = sp.Mul(*(factor.as_expr() for factor, _ in factors if factor.degree(kept) > 0))
        if size <= LARGEST and (smallest is None or size < smallest[0]):
            smallest = (size, [*conditions, sp.Poly(whole, kept)])
    if smallest is None:
        return None
    *content, polynomial = smallest[1]
    conditions = [c.as_expr() for c in content] + [polynomial.LC()]
    if polynomial.degree() > 1:
        conditions.append(polynomial.discriminant().as_expr())
    return _exact_roots(conditions, p, lower, upper)


def _exact_roots(
    conditions: Sequence[sp.Expr], p: sp.Symbol, lower: float, upper: float
) -> list[float]:
    """Ends of the intervals that isolate the real roots, in a range, of exact polynomials."""
    low, high = sp.Rational(lower), sp.Rational(upper)
    values: set[float] = set()
    for condition in conditions:
        polynomial = sp.Poly(condition, p)
        if polynomial.degree() > 0:
            for factor, _ in polynomial.factor_list()[1]:
                for (a, b), _ in factor.intervals(inf=low, sup=high):
                    values |= {float(a), float(b)}
    return sorted(values)


def _at_infinity(rates: list[Terms], ranges: dict[int, tuple[float, float]]) -> list[list[Terms]]:
    """Systems for the parameter at which an unknown has the largest size that is looked at."""
    count = len(rates)
    scales, _ = units(rates, ranges)
    return [
        [at_value(terms, m, sign * scales[m] * int(FARTHEST)) for terms in rates]
        for m in range(count)
        for sign in (1, -1)
    ]


def _determinant(rows: list[list[sp.Poly]]) -> sp.Poly:
    if len(rows) == 1:
        return rows[0][0]
    total = rows[0][0] * 0
    for k, entry in enumerate(rows[0]):
        if not entry.is_zero:
            minor = [[*row[:k], *row[k + 1 :]] for row in rows[1:]]
            term = entry * _determinant(minor)
            total = total - term if k % 2 else total + term
    return total
