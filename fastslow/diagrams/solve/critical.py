"""Parameter values at which the number of equilibria of a region can change."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from fractions import Fraction
from functools import lru_cache
from itertools import pairwise

import sympy as sp

from fastslow.continuation.polynomial_systems import (
    FARTHEST,
    IntegerTerms,
    Terms,
    at_value,
    units,
)
from fastslow.diagrams.solve.equations import RegionEquations
from fastslow.diagrams.solve.exact_polynomials import ratios, real_roots, terms_of
from fastslow.diagrams.solve.linear_unknowns import last_values
from fastslow.diagrams.solve.resultants import discriminant, resultant
from fastslow.model.structure import real

#: Degree in the unknown up to which discriminants and resultants are formed.
RESULTANT_DEGREE = 8

#: Critical values closer than this fraction of the range are identical.
IDENTICAL_VALUES = 1e-8

#: Size of a resultant up to which its discriminant is formed: its squared degree in the unknown
#: times its degree in the parameter times the bits of its coefficients. A few seconds at most.
LARGEST_RESULTANT = 400_000

#: Bisections of the range until an interval around exact roots is sufficiently narrow.
HALVINGS = 30

#: Highest degree of a discriminant or resultant in the parameter whose roots are trusted.
ROOTS = 12


def critical_values(
    equations: RegionEquations, lower: float, upper: float, edges: Sequence[sp.Expr] = ()
) -> list[float] | None:
    """Compute parameter values between which a region's equilibria neither collide nor leave.

    These are the values at which two equilibria collide (the rates and the determinant of their
    Jacobian vanish), at which one diverges to infinity, and at which one is on an interface (for
    sliding also the zeros of a drift, at boundary equilibria and two-folds). A starting point in
    every interval between them is therefore a starting point on every branch.

    For one polynomial of low degree in one unknown they are zeros of the discriminant, the leading
    coefficient and resultants. For up to three unknowns the solutions of these polynomial systems
    in unknowns and parameter are isolated (see `solve_polynomials`).

    Parameters
    ----------
    equations : RegionEquations
    lower, upper : float
        Range of the parameter.
    edges : sequence of Expr
        Further functions of the states, whose zeros also separate starting points.

    Returns
    -------
    list of float or None
        None if the region's equations are not polynomials in few unknowns and the parameter,
        or are too large, so that completeness is not proved.
    """
    if equations.factors:
        values: set[float] = set()
        for one in equations.factors:
            # equilibria of different factors collide where both factors vanish
            others = [e for other in equations.factors for e in other.chosen]
            apart = [e for e in dict.fromkeys(others) if e not in one.chosen]
            found = critical_values(one, lower, upper, [*edges, *apart])
            if found is None:
                return None
            values |= set(found)
        return sorted(values)
    if equations.impossible:
        return []
    left = equations.polynomials
    if left is None:
        return None
    count = len(equations.unknowns)
    alone = [q for q in left if not any(any(e[:-1]) for e in q)]
    if len(alone) == len(left) and (alone or count):
        return _values([_in_parameter(q) for q in alone], lower, upper)
    if alone:
        return None
    bounds, further = equations.edge_polynomials, equations.along(edges) if edges else []
    if bounds is None or further is None:
        return None
    # an edge that contains the equilibria at all values separates none of them
    bounds = [*bounds, *(terms for terms in further if any(terms.values()))]
    conditions = _resultants(equations, bounds)
    if conditions is not None and all(len(c) <= ROOTS + 1 for c in conditions):
        return _values(conditions, lower, upper)
    return _isolated(equations, bounds, lower, upper)


def _in_parameter(terms: Terms) -> list[Fraction | int]:
    """Return coefficients of a polynomial in the parameter alone, the highest first."""
    powers = {e[-1]: c for e, c in terms.items()}
    return [powers.get(k, 0) for k in range(max(powers, default=-1), -1, -1)]


def _values(
    conditions: Iterable[Sequence[Fraction | int]], lower: float, upper: float
) -> list[float] | None:
    """Return real roots in a range of polynomials; None if one vanishes identically."""
    values: set[float] = set()
    # powers of the range itself may not be representable
    unit = Fraction(max(abs(lower), abs(upper)))
    for condition in conditions:
        if not any(condition):
            return None
        degree = len(condition) - 1
        scaled = [c * unit ** (degree - k) for k, c in enumerate(condition)]
        values |= {float(unit) * r for r in real_roots(ratios(scaled))}
    return sorted(v for v in values if lower < v < upper)


def _resultants(
    equations: RegionEquations, edges: Sequence[IntegerTerms]
) -> list[list[Fraction | int]] | None:
    """Return polynomials in the parameter, for at most one unknown and a low degree."""
    if not equations.unknowns:
        return [_in_parameter(edge) for edge in edges]
    assert equations.polynomials is not None
    if len(equations.unknowns) > 1:
        return None
    (equation,) = equations.polynomials
    degree = max(e for e, _ in equation)
    if degree > RESULTANT_DEGREE:
        return None
    found = [_in_parameter({e: c for e, c in equation.items() if e[0] == degree})]
    if degree > 1:
        found.append([*discriminant(equation)])
    for edge in edges:
        if any(e for e, _ in edge):
            found.append([*resultant(equation, edge)])
        else:
            found.append(_in_parameter(edge))
    return found


def _isolated(
    equations: RegionEquations, bounds: Sequence[IntegerTerms], lower: float, upper: float
) -> list[float] | None:
    """Return values at which systems in unknowns and parameter have solutions."""
    if not equations.isolated:
        return None
    unknowns = equations.unknowns
    symbols = [*unknowns, real(equations.field.parameter)]
    rates = [_polynomial(q, symbols).as_expr() for q in equations.polynomials or ()]
    # with polynomials the determinant is expanded during its computation
    slopes = [[sp.Poly(r, *symbols).diff(x) for x in unknowns] for r in rates]
    values: set[float] = set()
    determinant = _determinant(slopes).as_expr()
    edges = [_polynomial(q, symbols).as_expr() for q in bounds]
    for condition in (None, determinant, *edges):
        found = _zeros_at_equilibria(equations, condition, lower, upper)
        if found is None and condition is determinant:
            found = _double_roots(equations, lower, upper)
        elif found is None and condition is not None:
            found = _on_edge(equations, condition, lower, upper)
        if found is None:
            return None
        values |= set(found)
    kept: list[float] = []
    for value in sorted(v for v in values if lower < v < upper):
        # equilibria that diverge yield several nearly equal values
        if not kept or value - kept[-1] > IDENTICAL_VALUES * (upper - lower):
            kept.append(value)
    return kept


@lru_cache(maxsize=512)
def _zeros_at_equilibria(
    equations: RegionEquations, condition: sp.Expr | None, lower: float, upper: float
) -> list[float] | None:
    """Return values at which a function vanishes at an equilibrium, or one is at infinity."""
    unknowns, base = equations.unknowns, equations.polynomials
    p = real(equations.field.parameter)
    if base is None:
        return None
    if condition is None:
        systems = _at_infinity(base, {len(unknowns): (lower, upper)})
    elif condition.has(*unknowns) or condition == 0:
        extra = terms_of([condition], [*unknowns, p])
        if extra is None:
            return None
        systems = [[*base, *extra]]
    else:
        alone = terms_of([condition], [p])
        return None if alone is None else _values(map(_in_parameter, alone), lower, upper)
    values: set[float] = set()
    for system in systems:
        if len(system) == 1:
            # in the parameter alone, with nearly equal roots
            if not system[0]:
                return None
            values |= set(_exact_roots([_polynomial(system[0], [p]).as_expr()], p, lower, upper))
            continue
        found, complete = last_values(system, lower, upper, eliminating=condition is not None)
        if not complete:
            return None
        values |= set(found)
    return sorted(values)


@lru_cache(maxsize=64)
def _double_roots(equations: RegionEquations, lower: float, upper: float) -> list[float] | None:
    """Return values at which two equilibria in at most two unknowns collide, by elimination.

    Needed if the determinant nearly vanishes along branches that diverge, where folds cannot be
    isolated. Colliding equilibria are a double root of the resultant R of both rates, or of the
    only one: the values are among the real roots of its discriminant, leading coefficient and
    content.

    Returns
    -------
    list of float or None
        None for more unknowns, a resultant that is too large (see `LARGEST_RESULTANT`), or one with
        a multiple factor, which has double roots everywhere.
    """
    unknowns, terms = equations.unknowns, equations.polynomials
    p = real(equations.field.parameter)
    if len(unknowns) > 2 or terms is None:
        return None
    rates = [_polynomial(one, [*unknowns, p]).as_expr() for one in terms]
    smallest: tuple[int, list[sp.Poly]] | None = None
    for kept, *gone in dict.fromkeys((tuple(unknowns), tuple(unknowns[::-1]))):
        resultant = sp.Poly(sp.resultant(*rates, *gone) if gone else rates[0], kept, p)
        if resultant.is_zero:
            return None
        factors = resultant.factor_list()[1]
        if any(power > 1 and factor.degree(kept) > 0 for factor, power in factors):
            continue
        size = resultant.degree(kept) ** 2 * max(resultant.degree(p), 1) * _bits(resultant)
        conditions = [factor for factor, _ in factors if factor.degree(kept) == 0]
        whole = sp.Mul(*(factor.as_expr() for factor, _ in factors if factor.degree(kept) > 0))
        if size <= LARGEST_RESULTANT and (smallest is None or size < smallest[0]):
            smallest = (size, [*conditions, sp.Poly(whole, kept)])
    if smallest is None:
        return None
    *content, polynomial = smallest[1]
    conditions = [c.as_expr() for c in content] + [polynomial.LC()]
    if polynomial.degree() > 1:
        conditions.append(polynomial.discriminant().as_expr())
    return _exact_roots(conditions, p, lower, upper)


@lru_cache(maxsize=512)
def _on_edge(
    equations: RegionEquations, edge: sp.Expr, lower: float, upper: float
) -> list[float] | None:
    """Return values at which an equilibrium is on an edge, by exact elimination.

    Returns
    -------
    list of float or None
        None for more than two unknowns, or a function that is not linear in one of them or
        vanishes at all equilibria.
    """
    unknowns, terms = equations.unknowns, equations.polynomials
    p = real(equations.field.parameter)
    if terms is None or len(unknowns) > 2:
        return None
    rates = [_polynomial(one, [*unknowns, p]).as_expr() for one in terms]
    in_edge = [x for x in unknowns if edge.has(x)]
    if len(in_edge) != 1:
        return None
    (along,) = in_edge
    if len(unknowns) > 1 and sp.degree(edge, along) > 1:
        return None
    conditions = [sp.resultant(rate, edge, along) for rate in rates]
    for other in unknowns:
        if other != along:
            conditions = [sp.resultant(*conditions, other)]
    found = sp.Poly(conditions[0], p)
    if found.is_zero or found.degree() ** 2 * _bits(found) > LARGEST_RESULTANT:
        return None
    return _exact_roots([found.as_expr()], p, lower, upper)


def _bits(polynomial: sp.Poly) -> int:
    """Return the bits of the largest coefficient of a primitive integer polynomial."""
    return max(abs(int(c)).bit_length() for c in polynomial.primitive()[1].coeffs())


def _polynomial(terms: Terms, symbols: Sequence[sp.Symbol]) -> sp.Poly:
    """Return the polynomial with integer coefficients, up to a factor."""
    rational = {e: sp.Rational(c.numerator, c.denominator) for e, c in terms.items()}
    polynomial: sp.Poly = sp.Poly(rational, *symbols).clear_denoms(convert=True)[1]
    return polynomial


def _exact_roots(
    conditions: Sequence[sp.Expr], p: sp.Symbol, lower: float, upper: float
) -> list[float]:
    """Return ends of intervals that contain the real roots of exact polynomials in a range.

    Subdivision of integer Bernstein coefficients: an interval without a change of sign has no
    root (Descartes' rule; Lane & Riesenfeld 1981). Adjacent intervals are merged, so that a value
    without a root separates any two.
    """
    values: set[float] = set()
    for condition in conditions:
        polynomial = sp.Poly(condition, p)
        if polynomial.degree() > 0:
            powers = [Fraction(int(c.p), int(c.q)) for c in reversed(polynomial.all_coeffs())]
            for a, b in _root_intervals(powers, Fraction(lower), Fraction(upper)):
                values |= {a, b}
    return sorted(values)


def _root_intervals(
    powers: Sequence[Fraction], lower: Fraction, upper: Fraction
) -> list[tuple[float, float]]:
    """Return disjoint intervals of a dyadic subdivision that may contain roots, ascending."""
    degree = len(powers) - 1
    # on the unit interval: Horner's scheme in lower + t (upper − lower)
    shifted = [Fraction(0)]
    for power in reversed(powers):
        moved = [lower * c for c in shifted] + [Fraction(0)]
        for k, c in enumerate(shifted):
            moved[k + 1] += (upper - lower) * c
        moved[0] += power
        shifted = moved
    shifted = shifted[: degree + 1]
    bernstein = [
        sum(Fraction(math.comb(j, i), math.comb(degree, i)) * shifted[i] for i in range(j + 1))
        for j in range(degree + 1)
    ]
    common = math.lcm(*(c.denominator for c in bernstein))
    waiting = [(0, 0, [int(c * common) for c in bernstein])]
    found: list[list[Fraction]] = []
    while waiting:
        level, number, coefficients = waiting.pop()
        signs = [c > 0 for c in coefficients if c]
        changes = any(one != other for one, other in pairwise(signs))
        if not changes and coefficients[0] and coefficients[-1]:
            continue
        if level == HALVINGS or not changes:
            ends = [Fraction(number, 2**level), Fraction(number + 1, 2**level)]
            if not changes:
                # a root at an end only
                ends = [e for e, c in zip(ends, coefficients[::degree], strict=True) if not c]
            if found and ends[0] <= found[-1][-1]:
                found[-1][-1] = max(found[-1][-1], ends[-1])
            else:
                found.append([ends[0], ends[-1]])
            continue
        left, rest = [coefficients[0] << degree], coefficients
        right = [coefficients[-1] << degree]
        for k in range(1, degree + 1):
            rest = [a + b for a, b in pairwise(rest)]
            left.append(rest[0] << (degree - k))
            right.append(rest[-1] << (degree - k))
        waiting.append((level + 1, 2 * number + 1, right[::-1]))
        waiting.append((level + 1, 2 * number, left))
    wide = upper - lower
    return [(float(lower + a * wide), float(lower + b * wide)) for a, b in found]


def _at_infinity(
    rates: Sequence[Terms], ranges: dict[int, tuple[float, float]]
) -> list[list[Terms]]:
    """Return systems for the parameter at which an unknown has the largest size considered."""
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
