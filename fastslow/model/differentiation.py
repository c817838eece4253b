"""First derivatives of expressions, term by term."""

from __future__ import annotations

from functools import lru_cache

import sympy as sp

#: Number of expressions whose gradients are kept.
GRADIENTS_KEPT = 1024


@lru_cache(maxsize=GRADIENTS_KEPT)
def gradient(expression: sp.Expr, symbols: tuple[sp.Symbol, ...]) -> tuple[sp.Expr, ...]:
    """Return the derivatives by several symbols, kept because regions have rates in common.

    Examples
    --------
    >>> x, y = sp.symbols("x y")
    >>> gradient(x**2 * y, (x, y))
    (2*x*y, x**2)
    """
    return tuple(derivative(expression, symbol) for symbol in symbols)


def derivative(expression: sp.Expr, symbol: sp.Symbol) -> sp.Expr:
    """Return the derivative of an expression by a symbol, as ``expression.diff(symbol)``.

    SymPy differentiates a product of m factors as m products of m derivatives each. Here factors
    without the symbol are not differentiated, which is several times faster for polynomials, and
    powers with a parameter as exponent are not divided by their base.

    Examples
    --------
    >>> x, a = sp.symbols("x a")
    >>> derivative(3 * a * x**2 * (x + a) - sp.sin(a * x), x)
    3*a*x**2 + 6*a*x*(a + x) - a*cos(a*x)
    >>> derivative(x**a, x)
    a*x**(a - 1)
    """
    if expression.is_Add:
        return sp.Add(*(derivative(term, symbol) for term in expression.args))
    if not expression.is_Mul:
        return _of_factor(expression, symbol)
    args = expression.args
    slopes = [_of_factor(factor, symbol) for factor in args]
    return sp.Add(
        *(sp.Mul(*args[:k], s, *args[k + 1 :]) for k, s in enumerate(slopes) if s is not sp.S.Zero)
    )


def _of_factor(factor: sp.Expr, symbol: sp.Symbol) -> sp.Expr:
    """Return the derivative of an expression that is not a product."""
    if factor.is_Atom:
        return sp.S.One if factor == symbol else sp.S.Zero
    if factor.is_Pow and factor.base.is_Symbol and factor.exp.is_Integer:
        if factor.base != symbol:
            return sp.S.Zero
        return factor.exp * factor.base ** (factor.exp - 1)
    if factor.is_Pow and symbol not in factor.exp.free_symbols:
        base, exponent = factor.base, factor.exp
        slope = derivative(base, symbol)
        if exponent.free_symbols:
            # SymPy divides by the base, so that x**n would have no derivative at zero
            return exponent * base ** (exponent - 1) * slope
        return factor * (slope * exponent / base)
    if factor.is_Add:
        return derivative(factor, symbol)
    return factor.diff(symbol) if symbol in factor.free_symbols else sp.S.Zero
