"""Greatest common divisors and factors of sparse polynomials in many symbols.

A polynomial that is linear in one of its symbols, as most are in some parameter, is
irreducible once the common divisor of its two coefficients is divided out. This takes a
few divisions where general algorithms are slow; only polynomials that are linear in no
symbol are factored by SymPy. Beyond a budget of terms an exception is raised, so that the
result depends on the polynomial alone.
"""

from __future__ import annotations

import math

import sympy as sp
from sympy.polys.domains import ZZ
from sympy.polys.heuristicgcd import heugcd
from sympy.polys.polyerrors import HeuristicGCDFailed
from sympy.polys.rings import PolyElement

from fastslow.model.work import spend

#: Largest number of terms of a polynomial.
TERMS = 600

#: Largest number of products of terms in one multiplication.
PRODUCTS = 12_000

#: Bits of the integers that a heuristic common divisor may reach.
BITS = 200_000

#: Limits of polynomials that SymPy factors: terms, and terms times symbols.
FACTORED, FACTORED_MANY = 200, 1000

#: Largest product of the terms, the highest degree and the bits of a polynomial that SymPy factors.
FACTORED_WORK = 200_000

#: Integer points at which irreducibility is tested (Hilbert).
HILBERT_POINTS = 3


class PastBudgetError(Exception):
    """A polynomial exceeds the budget of terms."""


def product(one: PolyElement, two: PolyElement) -> PolyElement:
    """Return the product of two polynomials.

    Raises
    ------
    PastBudgetError
    """
    spend(len(one) * len(two))
    if len(one) * len(two) > PRODUCTS:
        raise PastBudgetError
    result = one * two
    if len(result) > TERMS:
        raise PastBudgetError
    return result


def used(poly: PolyElement) -> list[int]:
    """Return the indices of the generators that occur."""
    return [k for k in range(poly.ring.ngens) if any(m[k] for m in poly)]


def degree(poly: PolyElement, k: int) -> int:
    """Return the degree in generator k."""
    return max((m[k] for m in poly), default=0)


def coefficients(poly: PolyElement, k: int) -> dict[int, PolyElement]:
    """Map each power of generator k to its coefficient."""
    found: dict[int, PolyElement] = {}
    for monomial, value in poly.items():
        rest = (*monomial[:k], 0, *monomial[k + 1 :])
        found.setdefault(monomial[k], poly.ring.zero)[rest] = value
    return found


def content(poly: PolyElement, k: int) -> PolyElement:
    """Return the greatest common divisor of the coefficients with respect to generator k."""
    total = poly.ring.zero
    for part in sorted(coefficients(poly, k).values(), key=len):
        total = gcd(total, part)
        if total == 1:
            break
    return total


def divided(poly: PolyElement, by: PolyElement) -> PolyElement | None:
    """Return the exact quotient, None if there is a remainder."""
    if by == 1:
        return poly
    spend(len(poly))
    if len(by) == 1:
        ((low, factor),) = by.items()
        result = poly.ring.zero
        for monomial, value in poly.items():
            lowered = tuple(a - b for a, b in zip(monomial, low, strict=True))
            if min(lowered, default=0) < 0 or value % factor:
                return None
            result[lowered] = value // factor
        return result
    if any(degree(poly, k) < degree(by, k) for k in used(by)):
        return None
    if not _may_divide(poly, by):
        return None
    spend(len(poly) * len(by))
    quotient, rest = poly.div(by)
    return quotient if not rest else None


def _may_divide(poly: PolyElement, by: PolyElement) -> bool:
    """Check that the values at an integer point divide, before a long division."""
    point = [sp.prime(k + 4) for k in range(poly.ring.ngens)]
    below = _value(by, point)
    return below == 0 or _value(poly, point) % below == 0


def _value(poly: PolyElement, point: list[int]) -> int:
    return sum(
        int(c) * math.prod(p**e for p, e in zip(point, m, strict=True) if e)
        for m, c in poly.items()
    )


def gcd(one: PolyElement, two: PolyElement) -> PolyElement:
    """Return the greatest common divisor over the integers, with positive leading coefficient.

    Raises
    ------
    PastBudgetError
        If the computation would need huge integers.

    Examples
    --------
    >>> from sympy.polys.rings import ring
    >>> _, x, y, a = ring("x y a", ZZ)
    >>> gcd((x + a * y) * (x - 1), (x + a * y) * (y**2 + a))
    x + y*a
    """
    spend(len(one) + len(two))
    if not one or not two:
        return _positive(one or two)
    if len(one) == 1 or len(two) == 1:
        return _monomial_gcd(one, two)
    first, second = _monomial_content(one), _monomial_content(two)
    common = _monomial_gcd(first, second)
    return product(common, _gcd(divided(one, first), divided(two, second)))


def _gcd(one: PolyElement, two: PolyElement) -> PolyElement:
    """As `gcd`, for two polynomials without monomial factors."""
    ring = one.ring
    if len(one) > len(two):
        one, two = two, one
    if len(one) == 1:
        return ring.one
    mine, theirs = used(one), used(two)
    for poly, other, alone in (
        (one, two, set(mine) - set(theirs)),
        (two, one, set(theirs) - set(mine)),
    ):
        if alone:
            return gcd(content(poly, min(alone)), other)
    if divided(two, one) is not None:
        return _positive(one)
    for poly, other in ((one, two), (two, one)):
        k = next((k for k in mine if degree(poly, k) == 1), None)
        if k is not None:
            # its primitive part is irreducible: it divides the other one or is coprime to it
            inside = content(poly, k)
            bare = divided(poly, inside)
            rest = gcd(inside, content(other, k))
            if divided(other, bare) is None:
                return rest
            return _positive(product(rest, bare))
    bits = max(_height(one), _height(two)).bit_length() + 2
    for k in mine:
        bits *= min(degree(one, k), degree(two, k)) + 1
    if bits > BITS:
        raise PastBudgetError
    spend(len(one) + len(two) + bits // 100)
    try:
        return _positive(heugcd(one, two)[0])
    except HeuristicGCDFailed:
        raise PastBudgetError from None


def _height(poly: PolyElement) -> int:
    return max(abs(int(c)) for c in poly.values())


def _positive(poly: PolyElement) -> PolyElement:
    return -poly if poly and poly.LC < 0 else poly


def _monomial_content(poly: PolyElement) -> PolyElement:
    """Greatest monomial, with integer coefficient, that divides every term."""
    low = tuple(map(min, zip(*poly, strict=True)))
    return poly.ring.from_dict({low: ZZ(math.gcd(*map(int, poly.values())))})


def _monomial_gcd(one: PolyElement, two: PolyElement) -> PolyElement:
    first, second = _monomial_content(one), _monomial_content(two)
    ((low, a),), ((high, b),) = first.items(), second.items()
    powers = tuple(map(min, low, high))
    return one.ring.from_dict({powers: ZZ(math.gcd(int(a), int(b)))})


def factor(poly: PolyElement) -> tuple[int, list[tuple[PolyElement, int]]]:
    """Return the integer factor and the irreducible factors with their powers.

    A long factor may remain unfactored.

    Raises
    ------
    PastBudgetError

    Examples
    --------
    >>> from sympy.polys.rings import ring
    >>> _, x, y, a = ring("x y a", ZZ)
    >>> factor(-2 * (x + a * y) ** 2 * (x**2 - y**2) * a)
    (-2, [(a, 1), (x + y, 1), (x + y*a, 2), (x - y, 1)])
    """
    inside = _monomial_content(poly)
    ((powers, number),) = inside.items()
    ring = poly.ring
    found = [(g, e) for g, e in zip(ring.gens, powers, strict=True) if e]
    rest = divided(poly, inside)
    assert rest is not None
    sign = 1
    if rest.LC < 0:
        rest, sign = -rest, -1
    for part, power in _factors(rest):
        if part.LC < 0:
            part, sign = -part, sign * (-1) ** power
        found.append((part, power))
    merged: dict[frozenset[tuple[tuple[int, ...], int]], tuple[PolyElement, int]] = {}
    for part, power in found:
        # the hash of a PolyElement goes stale when it is changed in place
        key = frozenset((m, int(c)) for m, c in part.items())
        merged[key] = (part, power + merged[key][1] if key in merged else power)
    ordered = sorted(merged.values(), key=lambda p: (len(p[0]), sum(p[0].LM), str(p[0])))
    return sign * int(number), ordered


def _factors(poly: PolyElement) -> list[tuple[PolyElement, int]]:
    """Factors of a polynomial without monomial content."""
    if len(poly) == 1:
        return []
    inside = sorted(used(poly), key=lambda k: degree(poly, k))
    for k in inside:
        common = content(poly, k)
        if common != 1 and common != -1:
            return [*_factors(common), *_factors(divided(poly, common))]
    if degree(poly, inside[0]) == 1:
        return [(poly, 1)]
    k = inside[0]
    repeated = gcd(poly, poly.diff(poly.ring.gens[k]))
    if repeated != 1:
        once = divided(poly, repeated)
        return [*_factors(once), *_factors(repeated)]
    work = len(poly) * degree(poly, inside[-1]) * _height(poly).bit_length()
    many = len(poly) > FACTORED or len(poly) * len(inside) > FACTORED_MANY
    if many or work > FACTORED_WORK or _irreducible(poly, k):
        return [(poly, 1)]
    spend(work // 10)
    return [(p, int(e)) for p, e in poly.factor_list()[1]]


def _irreducible(poly: PolyElement, k: int) -> bool:
    """Test a primitive polynomial for irreducibility at integer points."""
    size = degree(poly, k)
    for trial in range(HILBERT_POINTS):
        point = [sp.prime(3 * trial + 2 * j + 3) for j in range(poly.ring.ngens)]
        row = [0] * (size + 1)
        for monomial, value in poly.items():
            others = (p**e for j, (p, e) in enumerate(zip(point, monomial, strict=True)) if j != k)
            row[size - monomial[k]] += int(value) * math.prod(others)
        if row[0] and sp.Poly(row, sp.Dummy()).is_irreducible:
            return True
    return False


def square_root(poly: PolyElement) -> PolyElement | None:
    """Return the square root of a polynomial that is a square, else None.

    Examples
    --------
    >>> from sympy.polys.rings import ring
    >>> _, x, y = ring("x y", ZZ)
    >>> square_root((x - 2 * y) ** 2), square_root(x**2 + y**2)
    (x - 2*y, None)
    """
    number, parts = factor(poly)
    if number < 0 or math.isqrt(number) ** 2 != number or any(e % 2 for _, e in parts):
        return None
    result = poly.ring.one * math.isqrt(number)
    for part, power in parts:
        result *= part ** (power // 2)
    return result
