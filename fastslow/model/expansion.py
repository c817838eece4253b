"""Multiplying out under a budget of terms; beyond it an expression remains as written."""

from __future__ import annotations

from functools import lru_cache
from math import comb

import sympy as sp

from fastslow.model.polynomials import BITS, FACTORED, FACTORED_MANY, FACTORED_WORK
from fastslow.model.rational import exact

#: Largest number of terms of an expression that is multiplied out, in any part of it.
MULTIPLIED = 1000

#: The same where quotients with elementary functions are cancelled.
CANCELLED = 50

#: Largest numerator or denominator in exponents of expressions that are cancelled or factored.
LARGEST_EXPONENT = 1000

#: Ratio of a coefficient that cancels to all that remain from which a sum is multiplied out.
LOST = 1e6

#: Number of cached expressions.
EXPRESSIONS_KEPT = 4096


def n_terms(expression: sp.Basic, most: int = MULTIPLIED) -> int:
    """Return the number of terms of an expression once its products are multiplied out.

    Like terms are counted one by one, and the largest number of any part counts, as
    `sympy.expand` multiplies out arguments of functions and denominators as well. Each
    common subexpression is read once.

    Parameters
    ----------
    expression : sympy.Basic
    most : int
        Counting ends beyond it, with ``most + 1``.

    Examples
    --------
    >>> x, y, z = sp.symbols("x y z")
    >>> n_terms((x + y + z) ** 2), n_terms(sp.exp((x + y) * (x + z))), n_terms((x + y) ** 60, 50)
    (6, 4, 51)
    """
    largest = 1
    known: dict[sp.Basic, int] = {}
    waiting = [expression]
    while waiting:
        node = waiting[-1]
        inside = [a for a in node.args if a not in known]
        if node in known or inside:
            if node in known:
                waiting.pop()
            waiting += inside
            continue
        waiting.pop()
        known[node] = count = _terms_of(node, known)
        largest = max(largest, count)
        if largest > most:
            return most + 1
    return largest


def _terms_of(node: sp.Basic, known: dict[sp.Basic, int]) -> int:
    counts = [known[a] for a in node.args]
    if isinstance(node, sp.Add):
        return sum(counts)
    if isinstance(node, sp.Mul):
        # no larger than it need be to exceed any budget
        total = 1
        for count in counts:
            total = min(total * count, 10**9)
        return total
    if isinstance(node, sp.Pow) and node.exp.is_Integer:
        power = min(abs(int(node.exp)), 10**4)
        return min(comb(counts[0] + power - 1, power), 10**9) if counts[0] > 1 else 1
    return 1


@lru_cache(maxsize=EXPRESSIONS_KEPT)
def expanded(expression: sp.Expr, most: int = MULTIPLIED) -> sp.Expr:
    """Multiply out an expression of at most ``most`` terms; return others as written.

    Examples
    --------
    >>> x, y = sp.symbols("x y")
    >>> expanded(x * (x + y)), expanded((x + y) ** 60, 50)
    (x**2 + x*y, (x + y)**60)
    """
    return sp.expand(expression) if n_terms(expression, most) <= most else expression


def vanishes(expression: sp.Expr) -> bool:
    """Check that an expression is zero as written or multiplied out; False past the budget.

    Examples
    --------
    >>> x, y = sp.symbols("x y")
    >>> vanishes((x + y) ** 2 - x**2 - 2 * x * y - y**2), vanishes(x)
    (True, False)
    """
    return bool(expression == 0 or expanded(expression) == 0)


@lru_cache(maxsize=EXPRESSIONS_KEPT)
def cancelled(expression: sp.Expr) -> sp.Expr:
    """Cancel common factors of a quotient, unless their computation may take huge integers.

    Exponentials of multiples of one symbol become powers of one generator, of any degree: the
    largest common divisor of their polynomials may exceed the memory.

    Examples
    --------
    >>> x, y, z = sp.symbols("x y z")
    >>> cancelled((x**2 - y**2) / (x - y))
    x + y
    >>> large = sum(sp.exp(s / k) + sp.exp(s) for s, k in ((x, 400), (y, 300), (z, 200)))
    >>> cancelled(large / (large + 1)) == large / (large + 1)
    True
    """
    parts = sp.factor_terms(expression, radical=True).as_numer_denom()
    most = CANCELLED if expression.has(sp.Function) else MULTIPLIED
    if any(n_terms(part) > most for part in parts) or _has_high_powers(expression):
        return expression
    polys = _polynomials(parts)
    if polys is not None:
        bits = max(map(_bits, polys))
        for low, high in zip(*(poly.degree_list() for poly in polys), strict=True):
            bits *= min(low, high) + 1
        if bits > BITS:
            return expression
    return sp.cancel(expression)


@lru_cache(maxsize=EXPRESSIONS_KEPT)
def without_cancellation(expression: sp.Expr) -> sp.Expr:
    """Multiply out a sum in which large terms cancel, or most of them; return others as written.

    At most half as many terms then remain, or coefficients cancel that are `LOST` times as large
    as all that remain: as written, the value in floating point may consist of rounding errors.

    Examples
    --------
    >>> x, c = sp.symbols("x c")
    >>> without_cancellation((x + 10**8) ** 2 - x**2 - 2 * 10**8 * x - 10**16 + c)
    c
    >>> without_cancellation((x + c) ** 2 - x**2 - c**2)
    2*c*x
    >>> without_cancellation((x - 1) ** 4 + x)
    x + (x - 1)**4
    >>> rate = sp.exp(0.05547153 * x) * c - sp.exp(-0.036588 * x) * (1 - c)
    >>> without_cancellation(rate) == rate
    True
    """
    terms = sp.Add.make_args(expression)
    if len(terms) < 2 or not CANCELLED >= n_terms(expression, CANCELLED) > len(terms):
        return expression
    written = tuple(map(exact, terms))
    polys = None if any(map(_has_high_powers, written)) else _polynomials(written)
    if polys is None:
        return expression
    total = sum(polys[1:], polys[0])
    remaining = 0 if total.is_zero else len(total.terms())
    largest = max(abs(number) for poly in polys for number in poly.coeffs())
    if 2 * remaining <= len(terms) or largest >= LOST * max(map(abs, total.coeffs())):
        return total.as_expr()
    return expression


def factors(expression: sp.Expr) -> tuple[sp.Expr, list[tuple[sp.Expr, int]]]:
    """Return the constant and the irreducible factors of an expression with their powers.

    An expression whose factorisation may take long is its own only factor.

    Examples
    --------
    >>> x, y = sp.symbols("x y")
    >>> factors(2 * x**2 - 2 * x * sp.exp(y))
    (2, [(x, 1), (x - exp(y), 1)])
    >>> factors((x + y) ** 60 - sp.exp(y))
    (1, [((x + y)**60 - exp(y), 1)])
    >>> factors(sp.exp(sp.Rational("0.1111111111111111") * x) - sp.exp(x))[1][0][1]
    1
    """
    whole = (sp.S.One, [(expression, 1)])
    if n_terms(expression) > MULTIPLIED or _has_high_powers(expression):
        return whole
    polys = _polynomials((expression,))
    if polys is not None:
        (poly,) = polys
        count, symbols = len(poly.terms()), len(poly.gens)
        work = count * max(poly.degree_list()) * _bits(poly)
        if count > FACTORED or count * symbols > FACTORED_MANY or work > FACTORED_WORK:
            return whole
    constant, pieces = sp.factor_list(expression)
    return constant, pieces


def _has_high_powers(expression: sp.Expr) -> bool:
    """Check whether exponentials are powers of a common one above `LARGEST_EXPONENT`.

    The polynomials of SymPy store every power: exp(0.1111111111111111 x) is one of exp(x/10¹⁶).
    """
    exponents = [e.exp for e in expression.atoms(sp.exp, sp.Pow)]
    numbers = set().union(*(e.atoms(sp.Rational) for e in exponents if not e.is_Integer))
    return any(max(abs(number.p), number.q) > LARGEST_EXPONENT for number in numbers)


def _polynomials(expressions: tuple[sp.Expr, ...]) -> list[sp.Poly] | None:
    """Return expressions as polynomials with rational coefficients, None if they are not."""
    try:
        polys, _ = sp.parallel_poly_from_expr(expressions)
    except (sp.PolynomialError, sp.PolificationFailed):
        return None
    return polys if all(poly.domain in (sp.ZZ, sp.QQ) for poly in polys) else None


def _bits(poly: sp.Poly) -> int:
    """Bits of the largest coefficient, over one denominator."""
    _, whole = poly.clear_denoms(convert=True)
    return int(max((abs(int(c)) for c in whole.coeffs()), default=0)).bit_length() + 2
