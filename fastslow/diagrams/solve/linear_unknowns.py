"""Elimination of unknowns of polynomial systems that occur linearly, with a number as coefficient.

A parameter that is added to a rate, and a state in the equation of an affine interface, are
polynomials in the other unknowns: one unknown fewer is isolated.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray
from sympy.polys.domains import QQ
from sympy.polys.rings import PolyElement, ring

from fastslow.continuation.polynomial_systems import Terms, solve_polynomials

Array = NDArray[np.float64]

#: Largest number of terms of a polynomial to be inserted, and largest degree after it.
INSERTED_TERMS, INSERTED_DEGREE = 40, 12


@dataclass(frozen=True, eq=False)
class Reduced:
    """A polynomial system after the elimination.

    Parameters
    ----------
    equations : list of Terms
        Polynomials in the remaining unknowns.
    kept : tuple of int
        Numbers of these unknowns.
    last : Terms
        The last unknown of the original system as a polynomial in them.
    """

    equations: list[Terms]
    kept: tuple[int, ...]
    last: Terms


def reduced(system: Sequence[Terms], count: int, *, bent: bool = False) -> Reduced:
    """Eliminate unknowns, as long as the system does not become larger.

    Parameters
    ----------
    system : sequence of Terms
    count : int
        Number of unknowns.
    bent : bool
        Whether to eliminate any unknown by polynomials of higher degree, not only the last one.

    Examples
    --------
    For x² + y − p and x − y:

    >>> one = {(2, 0, 0): 1, (0, 1, 0): 1, (0, 0, 1): -1}
    >>> found = reduced([one, {(1, 0, 0): 1, (0, 1, 0): -1}], 3)
    >>> found.equations, found.kept, sorted(found.last)
    ([], (0,), [(1,), (2,)])
    """
    polynomials, *gens = ring([f"u{k}" for k in range(count)], QQ)
    left = [
        polynomials.from_dict({e: QQ(c.numerator, c.denominator) for e, c in terms.items()})
        for terms in system
    ]
    kept, last = list(range(count)), gens[-1]
    straight = None if bent else count - 1
    while (best := _smallest(left, kept, straight)) is not None:
        row, unknown, value = best
        one = gens[unknown]
        left = [_put(q, one, value) for k, q in enumerate(left) if k != row]
        last = _put(last, one, value)
        kept.remove(unknown)
    return Reduced([_terms(q, kept) for q in left], tuple(kept), _terms(last, kept))


def _smallest(
    left: Sequence[PolyElement], kept: Sequence[int], straight: int | None
) -> tuple[int, int, PolyElement] | None:
    """Return the elimination after which the system is smallest: row, unknown and its value.

    The bound on the number of solutions, the product of the degrees, must not become larger. With
    the number of an unknown all others have values that are affine.
    """
    best, least, most = None, _size(left, kept), _solutions_at_most(left)
    for row, equation in enumerate(left):
        for unknown in kept:
            alone = [e for e in equation if e[unknown]]
            if len(alone) != 1 or sum(alone[0]) != 1 or len(equation) > INSERTED_TERMS:
                continue
            if straight not in (None, unknown) and max(map(sum, equation)) > 1:
                continue
            one = equation.ring.gens[unknown]
            value = one - equation * (1 / equation[alone[0]])
            others = [q for k, q in enumerate(left) if k != row]
            if any(_degree_after(q, unknown, value) > INSERTED_DEGREE for q in others):
                continue
            rest = [k for k in kept if k != unknown]
            inserted = [_put(q, one, value) for q in others]
            size = _size(inserted, rest)
            if size <= least and _solutions_at_most(inserted) <= most:
                best, least = (row, unknown, value), size
    return best


def _degree_after(polynomial: PolyElement, unknown: int, value: PolyElement) -> int:
    degree = max((sum(e) for e in value), default=0)
    return max((sum(e) + e[unknown] * (degree - 1) for e in polynomial), default=0)


def _size(left: Sequence[PolyElement], kept: Sequence[int]) -> int:
    """Return the number of coefficients of a system in the Bernstein basis."""
    degrees = [max((e[k] for q in left for e in q), default=0) for k in kept]
    return len(left) * math.prod(d + 1 for d in degrees)


def _solutions_at_most(left: Sequence[PolyElement]) -> int:
    return math.prod(max((sum(e) for e in q), default=0) or 1 for q in left)


def _put(polynomial: PolyElement, one: PolyElement, value: PolyElement) -> PolyElement:
    (unknown,) = (k for k, e in enumerate(one.LM) if e)
    if not any(e[unknown] for e in polynomial):
        return polynomial
    return polynomial.compose(one, value)


def _terms(polynomial: PolyElement, kept: Sequence[int]) -> Terms:
    return {
        tuple(e[k] for k in kept): Fraction(int(c.numerator), int(c.denominator))
        for e, c in polynomial.items()
    }


def last_values(
    system: Sequence[Terms], lower: float, upper: float, *, eliminating: bool = True
) -> tuple[list[float], bool]:
    """Return the values of the last unknown, in a range, at the solutions of a square system.

    On both sides of unresolved clusters. The flag is whether none is missing. Far away, where
    the last unknown is a small difference of large terms, it is not to be eliminated.
    """
    count = len(system)
    if not eliminating:
        last = (*[0] * (count - 1), 1)
        return _values_of(Reduced(list(system), tuple(range(count)), {last: 1}), lower, upper)
    first = reduced(system, count)
    values, complete = _values_of(first, lower, upper)
    if not complete:
        other = reduced(system, count, bent=True)
        if other.kept != first.kept:
            return _values_of(other, lower, upper)
    return values, complete


def _values_of(found: Reduced, lower: float, upper: float) -> tuple[list[float], bool]:
    """Return the values of the last unknown at the solutions of a reduced system."""
    if not found.kept:
        value = _value(found.last, np.empty(0))
        return ([value] if lower <= value <= upper else []), True
    alone = [k for k in range(len(found.kept)) if list(found.last) == [_unit(k, len(found.kept))]]
    if alone:
        solved = solve_polynomials(found.equations, {alone[0]: (lower, upper)})
    else:
        solved = solve_polynomials(found.equations, within=[(found.last, lower, upper)])
    values = [_value(found.last, point) for point in solved.simple]
    slack = 1e-9 * (upper - lower)
    values = [v for v in values if lower - slack <= v <= upper + slack]
    for box in solved.clusters:
        middle, half = 0.5 * (box[0] + box[1]), 0.5 * (box[1] - box[0])
        value, reach = _value(found.last, middle), _reach(found.last, middle, half)
        values += [value - reach, value + reach]
    return values, solved.complete


def _unit(place: int, count: int) -> tuple[int, ...]:
    return tuple(int(k == place) for k in range(count))


def _value(terms: Terms, point: Array) -> float:
    place = [Fraction(float(p)) for p in point]
    total = sum(
        (c * math.prod(p**k for p, k in zip(place, e, strict=True)) for e, c in terms.items()),
        Fraction(0),
    )
    try:
        return float(total)
    except OverflowError:
        return math.inf if total > 0 else -math.inf


def _reach(terms: Terms, middle: Array, half: Array) -> float:
    """Return a bound on the change of a polynomial over a small box, to first order twice."""
    total = 0.0
    for e, c in terms.items():
        for k, power in enumerate(e):
            if power:
                rest = [
                    abs(float(m)) ** (p - (j == k))
                    for j, (m, p) in enumerate(zip(middle, e, strict=True))
                ]
                total += abs(float(c)) * power * math.prod(rest) * float(half[k])
    return 2.0 * total
