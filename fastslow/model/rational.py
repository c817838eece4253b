"""Rational functions over one denominator, cancelled, with roots reduced.

An expression in symbols and roots of rational expressions becomes a quotient of two
sparse polynomials; one square root goes to the numerator, as A/D + (B/D) √R.

Floating-point numbers become exact here and nowhere else: as decimals, by `decimal` and `exact`.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from fractions import Fraction

import sympy as sp
from mpmath.libmp import prec_to_dps, to_str
from sympy.polys.domains import ZZ
from sympy.polys.rings import PolyElement, PolyRing

from fastslow.model.polynomials import (
    PastBudgetError,
    coefficients,
    degree,
    divided,
    factor,
    gcd,
    product,
    used,
)
from fastslow.model.work import cached, nodes, spend

#: Number of cached quotients.
QUOTIENTS_KEPT = 4096

#: Largest power of a sum that is expanded.
EXPANDED_POWER = 24

#: Largest index of roots that are reduced.
INDEX = 4

#: Largest number of nodes of an expression that is read.
READ_NODES = 1500

#: Bits of a floating-point number.
MANTISSA_BITS = 53

#: Digits of numbers that are written by hand, and the largest distance in units of the last place
#: of such a number from the result of a few operations.
WRITTEN, OPERATION = 10, 16


def decimal(number: float) -> Fraction:
    """Return the shortest decimal that is read as a floating-point number.

    Examples
    --------
    >>> decimal(2.4), decimal(0.1 + 0.2)
    (Fraction(12, 5), Fraction(7500000000000001, 25000000000000000))
    """
    return Fraction(repr(float(number)))


def exact(expression: sp.Expr | float) -> sp.Expr:
    """Replace floats by the decimals that they are read from, as rational numbers.

    SymPy multiplies numbers into sums, 1.1 (x − 1.1) to 1.1 x − 1.2100000000000002: a float of
    an expression is a decimal of at most `WRITTEN` digits where one is within `OPERATION`.

    Examples
    --------
    >>> exact(2.4), exact(sp.Float(0.1) * (sp.Symbol("x") + 3))
    (12/5, x/10 + 3/10)
    """
    if not isinstance(expression, sp.Basic):
        found = decimal(expression)
        return sp.Rational(found.numerator, found.denominator)
    return expression.xreplace({f: _rational(f) for f in expression.atoms(sp.Float)})


@functools.lru_cache(maxsize=QUOTIENTS_KEPT)
def _rational(number: sp.Float) -> sp.Rational:
    """Return the decimal that a float of SymPy is read from."""
    value = float(number) if number._prec == MANTISSA_BITS else math.nan
    if not math.isfinite(value) or value == 0:
        return sp.Rational(to_str(number._mpf_, prec_to_dps(number._prec)))
    written = f"{value:.{WRITTEN}g}"
    near = abs(float(written) - value) <= OPERATION * math.ulp(value)
    return sp.Rational(written if near else repr(value))


@dataclass(frozen=True)
class Quotient:
    """Numerator and denominator without a common factor.

    Parameters
    ----------
    numerator, denominator : PolyElement
        Over the integers; the leading coefficient of the denominator is positive.
    roots : dict
        Index of a generator that is a root to (radicand, n): its n-th power is the
        radicand, a polynomial of the same ring.
    """

    numerator: PolyElement
    denominator: PolyElement
    roots: dict[int, tuple[PolyElement, int]]

    @property
    def polynomial(self) -> bool:
        """True if the denominator is one term."""
        return len(self.denominator) == 1

    def expanded(self) -> sp.Expr:
        """Return a sum of terms where the denominator is one term, else one quotient.

        Examples
        --------
        >>> x, a = sp.symbols("x a")
        >>> quotient((x**2 - a**2) / (x - a) + 1 / a).expanded()
        a + x + 1/a
        """
        if self.polynomial:
            below = self.denominator.as_expr()
            return sp.Add(*(t / below for t in sp.Add.make_args(self.numerator.as_expr())))
        try:
            number, parts = factor(self.denominator)
        except PastBudgetError:
            return self.numerator.as_expr() / self.denominator.as_expr()
        below = sp.Mul(*(p.as_expr() ** e for p, e in parts))
        inside = sp.Add(*(t / number for t in sp.Add.make_args(self.numerator.as_expr())))
        return inside / below

    def factored(self) -> sp.Expr:
        """Return numerator and denominator as products of irreducible factors.

        Past the budget of factorisation they are as in `expanded`.

        Examples
        --------
        >>> x, a = sp.symbols("x a")
        >>> quotient(x**2 - a**2 + x - a).factored()
        (-a + x)*(a + x + 1)
        """
        try:
            number, parts = self.factors()
        except PastBudgetError:
            return self.expanded()
        whole = [(p, e) for p, e in parts if not (p.is_Add and len(parts) == 1 and e == 1)]
        if whole != list(parts):
            return self.expanded()
        return number * sp.Mul(*(p**e for p, e in parts))

    def factors(self) -> tuple[sp.Rational, tuple[tuple[sp.Expr, int], ...]]:
        """Return the constant and the irreducible factors, with negative powers in the denominator.

        Raises
        ------
        PastBudgetError
        """
        if not self.numerator:
            return sp.S.Zero, ()
        (above, over), (below, under) = factor(self.numerator), factor(self.denominator)
        pieces = [(p.as_expr(), e) for p, e in over] + [(p.as_expr(), -e) for p, e in under]
        return sp.Rational(above, below), tuple(pieces)


@cached(QUOTIENTS_KEPT)
def quotient(expression: sp.Expr) -> Quotient | None:
    """Return the cancelled quotient of an expression.

    Returns
    -------
    Quotient or None
        None if the expression is not rational in symbols and roots, or beyond the budget.

    Examples
    --------
    >>> x, a = sp.symbols("x a")
    >>> found = quotient(1 / (x + sp.sqrt(a)) + 1 / (x - sp.sqrt(a)))
    >>> found.numerator, found.denominator
    (2*x, x**2 - a)
    """
    parts = nodes(expression, READ_NODES + 1)
    spend(parts // 4)
    if parts > READ_NODES:
        return None
    kernels = _kernels(expression)
    if kernels is None:
        return None
    try:
        return _Reader(kernels).read(expression)
    except PastBudgetError:
        return None


def _kernels(expression: sp.Expr) -> list[sp.Expr] | None:
    """Symbols and roots that an expression is rational in, None if it is not."""
    found: set[sp.Expr] = set()
    waiting: list[sp.Basic] = [expression]
    while waiting:
        node = waiting.pop()
        if node.is_Symbol:
            found.add(node)
        elif node.is_Rational:
            continue
        elif node.is_Add or node.is_Mul:
            waiting += node.args
        elif node.is_Pow and node.exp.is_Integer:
            waiting.append(node.base)
        elif node.is_Pow and node.exp.is_Rational:
            if node.base.is_Rational and not node.base.is_Integer:
                return None
            found.add(_root(node))
            waiting.append(node.base)
        else:
            return None
    symbols = [s for s in found if s.is_Symbol]
    # in SymPy's order, on which the signs of factors depend
    ordered = sp.Poly(sp.Add(*symbols)).gens if symbols else ()
    roots = sorted(found - set(symbols), key=lambda s: (sp.count_ops(s), str(s)))
    return [*ordered, *roots]


def _root(power: sp.Pow) -> sp.Expr:
    """The root of which a power is formed; one of high index is a generator of its own."""
    if power.exp.q > INDEX:
        return sp.Pow(power.base, abs(power.exp))
    return sp.Pow(power.base, sp.Rational(1, power.exp.q))


class _Reader:
    """An expression as a quotient in one ring."""

    def __init__(self, kernels: list[sp.Expr]) -> None:
        names = kernels or [sp.Dummy()]
        self.ring = PolyRing(names, ZZ)
        self.place = dict(zip(names, self.ring.gens, strict=True))
        self.roots: dict[int, tuple[PolyElement, int]] = {}
        for k, kernel in enumerate(kernels):
            if kernel.is_Pow:
                over, under = self.value(kernel.base)
                if under == 1 and kernel.exp.p == 1 and kernel.exp.q <= INDEX:
                    self.roots[k] = (over, int(kernel.exp.q))

    def read(self, expression: sp.Expr) -> Quotient:
        over, under = self.value(expression)
        square = [k for k in used(under) if k in self.roots]
        if len(square) == 1 and self.roots[square[0]][1] == 2:
            (k,) = square
            parts = coefficients(under, k)
            low = parts.get(0, self.ring.zero)
            conjugate = low - self.ring.gens[k] * parts[1]
            over = self.reduced(product(over, conjugate))
            under = self.reduced(product(under, conjugate))
            over, under = self.cancelled(over, under)
        return Quotient(over, under, self.roots)

    def value(self, node: sp.Expr) -> tuple[PolyElement, PolyElement]:
        ring = self.ring
        if node in self.place:
            return self.place[node], ring.one
        if node.is_Rational:
            return ring.one * int(node.p), ring.one * int(node.q)
        if node.is_Add:
            return self.sum(node)
        if node.is_Mul:
            over, under = ring.one, ring.one
            for argument in node.args:
                a, b = self.value(argument)
                a, under = self.cancelled(a, under)
                over, b = self.cancelled(over, b)
                over, under = self.reduced(product(over, a)), self.reduced(product(under, b))
            # products of roots may leave a common factor
            return self.cancelled(over, under) if self.roots else (over, under)
        if node.exp.is_Integer:
            power = int(node.exp)
            if abs(power) > EXPANDED_POWER and not node.base.is_Symbol:
                raise PastBudgetError
            over, under = self.value(node.base)
            if power < 0:
                over, under = under, over
            return self.power(over, abs(power)), self.power(under, abs(power))
        base = self.place[_root(node)]
        power = base if node.exp.q > INDEX else self.power(base, abs(int(node.exp.p)))
        return (power, ring.one) if node.exp > 0 else (ring.one, power)

    def sum(self, node: sp.Expr) -> tuple[PolyElement, PolyElement]:
        grouped: list[tuple[PolyElement, PolyElement]] = []
        for argument in node.args:
            a, b = self.value(argument)
            for j, (one, two) in enumerate(grouped):
                if two == b:
                    grouped[j] = (one + a, two)
                    break
            else:
                grouped.append((a, b))
        over, under = grouped[0]
        for a, b in grouped[1:]:
            shared = gcd(under, b)
            left, right = divided(under, shared), divided(b, shared)
            over = self.reduced(product(over, right) + product(a, left))
            under = self.reduced(product(under, right))
        return self.cancelled(over, under)

    def power(self, base: PolyElement, power: int) -> PolyElement:
        if len(base) == 1:
            return self.reduced(base**power)
        result = self.ring.one
        for _ in range(power):
            result = self.reduced(product(result, base))
        return result

    def reduced(self, poly: PolyElement) -> PolyElement:
        """Replace powers of roots by their radicands, innermost last."""
        for k in sorted(self.roots, reverse=True):
            inside, index = self.roots[k]
            while degree(poly, k) >= index:
                total = self.ring.zero
                for power, part in coefficients(poly, k).items():
                    if power >= index:
                        part = product(part, inside) * self.ring.gens[k] ** (power - index)
                        total += part
                    else:
                        total += part * self.ring.gens[k] ** power
                poly = total
        return poly

    def cancelled(self, over: PolyElement, under: PolyElement) -> tuple[PolyElement, PolyElement]:
        if not over:
            return over, self.ring.one
        if not under:
            raise PastBudgetError
        shared = gcd(over, under)
        if shared != 1:
            over, under = divided(over, shared), divided(under, shared)
        return (-over, -under) if under.LC < 0 else (over, under)
