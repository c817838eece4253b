"""Functions with removable singularities as single functions with their derivatives."""

from __future__ import annotations

from typing import Any

import sympy as sp


class ExpQuotient(sp.Function):
    """Derivative of order k of y/(e^y − 1), continuous at 0: ``ExpQuotient(y, k)``."""

    nargs = 2

    def fdiff(self, argindex: int = 1) -> Any:
        y, order = self.args
        return ExpQuotient(y, order + 1)


def with_atoms(expression: sp.Expr) -> sp.Expr:
    """Replace quotients g/(e^g − 1), times constants, by `ExpQuotient`.

    Numbers must be exact: a quotient whose numerator and denominator have no common zero has a
    pole.

    Examples
    --------
    >>> V = sp.Symbol("V")
    >>> with_atoms((V + 40) / (1 - sp.exp(-(V + 40) / 10)) / 10)
    ExpQuotient(-V/10 - 4, 0)
    """
    if not expression.has(sp.exp):
        return expression
    return expression.replace(lambda e: isinstance(e, sp.Mul), _product)


def _product(product: sp.Mul) -> sp.Expr:
    """Replace such quotients in a product, and whole powers of them."""
    powers = [factor.as_base_exp() for factor in product.args]
    above = [(base, n) for base, n in powers if n.is_Integer and n > 0]
    for base, n in powers:
        found = _exponent(base) if n.is_Integer and n < 0 else None
        if found is None:
            continue
        size, exponent = found
        for other, m in above:
            ratio = _ratio(other, exponent)
            if ratio is not None:
                quotient = ratio * ExpQuotient(exponent, sp.Integer(0)) / size
                k = min(m, -n)
                # SymPy does not cancel factors of which a number was extracted
                left = {base: n + k, other: m - k}
                rest = sp.Mul(*(b ** left.get(b, e) for b, e in powers))
                return (_product(rest) if isinstance(rest, sp.Mul) else rest) * quotient**k
    return product


def _exponent(denominator: sp.Expr) -> tuple[sp.Expr, sp.Expr] | None:
    """Return a and g of a denominator a (e^g − 1)."""
    constant, terms = denominator.as_coeff_add()
    if constant == 0 or len(terms) != 1:
        return None
    size, function = terms[0].as_coeff_Mul()
    if not isinstance(function, sp.exp) or size != -constant:
        return None
    return size, function.args[0]


def _ratio(numerator: sp.Expr, exponent: sp.Expr) -> sp.Expr | None:
    """Return the constant ratio of two expressions, None if they are not proportional."""
    if not numerator.free_symbols or numerator.free_symbols != exponent.free_symbols:
        return None
    symbol = min(numerator.free_symbols, key=str)
    slope = sp.expand(exponent).coeff(symbol)
    if slope == 0 or slope.free_symbols:
        return None
    ratio = sp.expand(numerator).coeff(symbol) / slope
    same = sp.expand(numerator - ratio * exponent) == 0
    return ratio if same and ratio != 0 and not ratio.free_symbols else None
