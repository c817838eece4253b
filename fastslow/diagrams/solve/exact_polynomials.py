"""Polynomials with exact coefficients, in unknowns, a parameter, and other parameters."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import mpmath
import numpy as np
import sympy as sp
from mpmath.libmp import to_rational
from numpy.typing import NDArray

from fastslow.continuation.polynomial_systems import IntegerTerms, Terms
from fastslow.model.rational import decimal, exact

Array = NDArray[np.float64]

#: Digits of what is not rational.
IRRATIONAL_DIGITS = 30

#: Exponents of the kept symbols, of the parameters, and the coefficient of every term.
Parts = tuple[tuple[tuple[int, ...], tuple[int, ...], int], ...]


@dataclass(frozen=True)
class ParametricPolynomials:
    """Polynomials in some symbols, with coefficients that are polynomials in the parameters.

    Parameters
    ----------
    parts : tuple of Parts
    degrees : tuple of int
        The largest exponent of each parameter.
    """

    parts: tuple[Parts, ...]
    degrees: tuple[int, ...]

    def at(self, values: Sequence[Fraction]) -> list[IntegerTerms]:
        """Evaluate at parameter values; all are multiplied by a common factor to be integer.

        Examples
        --------
        >>> x, a, b = sp.symbols("x a b")
        >>> polynomials_of([a * x**2 + b * x, a], [x], [a, b]).at([Fraction(1, 2), Fraction(3)])
        [{(2,): 1, (1,): 6}, {(0,): 1}]
        """
        powers = [
            [v.numerator**k * v.denominator ** (most - k) for k in range(most + 1)]
            for v, most in zip(values, self.degrees, strict=True)
        ]
        return [_specialised(parts, powers) for parts in self.parts]


def polynomials_of(
    expressions: Sequence[sp.Expr], kept: Sequence[sp.Symbol], parameters: Sequence[sp.Symbol]
) -> ParametricPolynomials | None:
    """Return polynomials in kept symbols and parameters; None if one is not rational."""
    symbols = [*kept, *parameters]
    read: list[list[tuple[tuple[int, ...], Fraction]]] = []
    for expression in expressions:
        if not expression.is_polynomial(*symbols):
            return None
        terms = sp.Poly(expression, *symbols).terms() if symbols else [((), expression)]
        if not all(number.is_Rational for _, number in terms):
            return None
        read.append([(e, Fraction(int(c.p), int(c.q))) for e, c in terms if c != 0])
    common = math.lcm(1, *(c.denominator for terms in read for _, c in terms))
    first = len(kept)
    parts = tuple(
        tuple((e[:first], e[first:], int(c * common)) for e, c in terms) for terms in read
    )
    every = [e for one in parts for _, e, _ in one]
    degrees = tuple(max((e[k] for e in every), default=0) for k in range(len(parameters)))
    return ParametricPolynomials(parts, degrees)


def _specialised(parts: Parts, powers: Sequence[Sequence[int]]) -> dict[tuple[int, ...], int]:
    found: dict[tuple[int, ...], int] = {}
    for kept, exponents, number in parts:
        for table, exponent in zip(powers, exponents, strict=True):
            number *= table[exponent]
        found[kept] = found[kept] + number if kept in found else number
    return {kept: number for kept, number in found.items() if number}


def terms_of(
    expressions: Sequence[sp.Expr], symbols: Sequence[sp.Symbol]
) -> list[IntegerTerms] | None:
    """Return polynomials by exponents, each with integer coefficients up to a positive factor.

    None if one is not a polynomial in the symbols.
    """
    found: list[IntegerTerms] = []
    for expression in expressions:
        if not expression.is_polynomial(*symbols):
            return None
        terms = sp.Poly(expression, *symbols).terms() if symbols else [((), expression)]
        numbers = {e: _fraction(c) for e, c in terms if c != 0}
        common = math.lcm(1, *(c.denominator for c in numbers.values()))
        found.append({e: int(c * common) for e, c in numbers.items()})
    return found


def numerator(expression: sp.Expr) -> sp.Expr:
    """Return the numerator of an expression over a common denominator."""
    return sp.together(expression).as_numer_denom()[0]


def values_at(polynomials: Sequence[IntegerTerms], place: Sequence[Fraction]) -> list[int]:
    """Evaluate polynomials at a point; all are multiplied by a common factor to be integer."""
    powers = []
    for k, at in enumerate(place):
        most = max((e[k] for terms in polynomials for e in terms), default=0)
        n, d = at.numerator, at.denominator
        powers.append([n**j * d ** (most - j) for j in range(most + 1)])
    return [
        sum(
            c * math.prod(table[j] for table, j in zip(powers, e, strict=True))
            for e, c in terms.items()
        )
        for terms in polynomials
    ]


def coefficient_function(coefficient: sp.Expr, p: sp.Symbol) -> Callable[[float], Fraction]:
    """Return a coefficient as a function of the parameter, exact if it is a polynomial.

    Others are computed to `IRRATIONAL_DIGITS`, without a bound on their size.
    """
    if coefficient.is_Rational:
        number = Fraction(int(coefficient.p), int(coefficient.q))
        return lambda value: number
    if coefficient.is_polynomial(p):
        powers = [_fraction(c) for c in sp.Poly(coefficient, p).all_coeffs()]

        def horner(value: float) -> Fraction:
            total, at = Fraction(0), decimal(value)
            for power in powers:
                total = total * at + power
            return total

        return horner
    function = sp.lambdify(p, sp.N(coefficient, IRRATIONAL_DIGITS), "mpmath")

    def rounded(value: float) -> Fraction:
        with mpmath.workdps(IRRATIONAL_DIGITS):
            number = mpmath.mpf(function(value))
        if not mpmath.isfinite(number):
            raise ArithmeticError("the coefficient is not finite")
        return Fraction(*to_rational(number._mpf_))

    return rounded


def ratios(numbers: Sequence[Fraction | int]) -> Array:
    """Return numbers relative to the largest, each rounded once."""
    largest = max((max(number, -number) for number in numbers), default=0) or 1
    # a quotient of integers, too, is rounded once
    return np.array([float(number / largest) for number in numbers])


def real_roots(coefficients: Array) -> list[float]:
    """Return real roots of a polynomial, highest coefficient first, double ones once or twice.

    A root is real if its imaginary part is within the rounding error of a double root, relative
    to the largest root; Newton's method decides afterwards.

    Examples
    --------
    >>> [round(r, 12) for r in real_roots(np.array([1.0, 0.0, -4.0]))]
    [-2.0, 2.0]
    """
    leading = np.flatnonzero(coefficients)
    if len(leading) == 0:
        return []
    shares = coefficients[leading[0] :] / coefficients[leading[0]]
    if len(shares) < 3:
        return [0.0 - float(share) for share in shares[1:]]
    powers = np.arange(len(shares))
    # Fujiwara's bound: in this unit no root exceeds two, and no coefficient one
    bounds = np.abs(shares[1:]) ** (1.0 / powers[1:])
    unit = float(bounds.max(initial=0.0)) or 1.0
    roots = np.roots(shares / unit**powers)
    real = roots.real[np.abs(roots.imag) < 1e-6 * np.maximum(1.0, np.abs(roots))]
    return sorted(float(unit * r) for r in real)


def multiple_root(terms: Terms, near: float) -> float:
    """Return the root of the derivative near a multiple root, where it is simple."""
    powers = ratios([terms.get((k,), 0) for k in range(1 + max(e for (e,) in terms))])
    roots: NDArray[Any] = np.polynomial.Polynomial(powers).deriv().roots()
    roots = roots.real[np.abs(roots - near) < 1e-3 * abs(near)]
    return float(roots[np.argmin(np.abs(roots - near))]) if len(roots) else near


def _fraction(number: sp.Expr) -> Fraction:
    """Convert a number to a fraction, exact or to 40 digits."""
    number = exact(number)
    rational = number if number.is_Rational else sp.Rational(sp.N(number, 40))
    return Fraction(int(rational.p), int(rational.q))


def exactly(values: Mapping[sp.Symbol, sp.Rational]) -> list[Fraction]:
    """Convert SymPy rationals to Python fractions."""
    return [Fraction(int(v.p), int(v.q)) for v in values.values()]
