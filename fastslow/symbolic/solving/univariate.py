"""Roots of a polynomial, and solution of an affine equation, in short closed form."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import sympy as sp

from fastslow.symbolic.algebra import expanded_form, factors, longer, numerator, shortest
from fastslow.symbolic.signs.signs import Signs

#: Equations with more nodes are not solved.
SOLVED_NODES = 400

#: Polynomials of higher degree are not solved.
SOLVED_DEGREE = 16


@dataclass(frozen=True)
class Root:
    """A root of an equation in closed form.

    Parameters
    ----------
    value : sympy.Expr
        Radicals, or a CRootOf where the coefficients are numbers.
    radicand : sympy.Expr
        Must not be negative for the root to be real (1 where it always is).
    multiplicity : int
    further : tuple of sympy.Expr
        What else must not be negative.
    """

    value: sp.Expr
    radicand: sp.Expr = sp.S.One
    multiplicity: int = 1
    further: tuple[sp.Expr, ...] = ()

    @property
    def radicands(self) -> tuple[sp.Expr, ...]:
        """Expressions that are nonnegative for a real root, without positive numbers."""
        return tuple(e for e in (self.radicand, *self.further) if not e.is_positive)


def factors_in(equation: sp.Expr, unknowns: Sequence[sp.Symbol]) -> list[tuple[sp.Expr, int]]:
    """Return irreducible factors that contain an unknown; one factor past the budget.

    Examples
    --------
    >>> from fastslow.model.structure import real
    >>> x, a = real("x"), real("a")
    >>> factors_in(a * x * (x**2 - a), [x])
    [(x, 1), (-a + x**2, 1)]
    """
    expanded = numerator(equation)
    inside = [u for u in unknowns if u in expanded.free_symbols]
    if not inside:
        return []
    found = [(f, p) for f, p in factors(expanded)[1] if p > 0 and f.free_symbols & set(inside)]
    return [(f, p) for f, p in found if not f.is_positive and not f.is_negative]


def roots(factor: sp.Expr, unknown: sp.Symbol, signs: Signs) -> list[Root] | None:
    """Return all real roots of an irreducible factor, None if they have no short form.

    Degrees one and two and x**n = c are solved by radicals, polynomials with numerical
    coefficients by CRootOf.

    Examples
    --------
    >>> from fastslow.model.structure import real
    >>> x, A, D = map(real, "xAD")
    >>> for root in roots(3 * x**2 - 2 * D * x + A, x, Signs({D: 1})):
    ...     print(root.value, root.radicand)
    D/3 + sqrt(-3*A + D**2)/3 -3*A + D**2
    D/3 - sqrt(-3*A + D**2)/3 -3*A + D**2
    """
    if longer(factor, SOLVED_NODES) or not factor.is_polynomial(unknown):
        return None
    poly = sp.Poly(factor, unknown)
    degree = poly.degree()
    if degree == 1:
        a, b = poly.all_coeffs()
        return [Root(sp.cancel(-b / a))]
    if degree == 2:
        a, b, c = poly.all_coeffs()
        return _quadratic(a, b, c, signs)
    if not factor.free_symbols - {unknown}:
        if degree > SOLVED_DEGREE or not all(c.is_Rational for c in poly.all_coeffs()):
            return None
        return [Root(r) for r in sp.Poly(factor, unknown, domain="QQ").real_roots()]
    if len(poly.monoms()) == 2 and poly.nth(0) != 0:
        return _power(sp.cancel(-poly.nth(0) / poly.LC()), degree, signs)
    return None


def _quadratic(a: sp.Expr, b: sp.Expr, c: sp.Expr, signs: Signs) -> list[Root]:
    inside = expanded_form(b**2 - 4 * a * c)
    outer, radicand = squares_out(inside, signs)
    middle, half = sp.cancel(-b / (2 * a)), sp.cancel(outer / (2 * a))
    if signs.sign(half) == -1:
        half = -half
    if radicand == 0:
        return [Root(middle, multiplicity=2)]
    root = half * sp.sqrt(radicand)
    return [Root(middle + root, radicand), Root(middle - root, radicand)]


def _power(level: sp.Expr, degree: int, signs: Signs) -> list[Root]:
    if degree % 2:
        # the real odd root, for either sign
        side = signs.sign(level)
        if side is None:
            return [Root(sp.sign(level) * sp.Abs(level) ** sp.Rational(1, degree))]
        return [Root(side * (side * level) ** sp.Rational(1, degree))]
    value = level ** sp.Rational(1, degree)
    return [Root(value, level), Root(-value, level)]


def squares_out(radicand: sp.Expr, signs: Signs) -> tuple[sp.Expr, sp.Expr]:
    """Write R = s² r with all square factors in s, so that √R = |s| √r.

    Examples
    --------
    >>> from fastslow.model.structure import real
    >>> A, D = real("A"), real("D")
    >>> squares_out(4 * D**2 - 12 * A, Signs({}))
    (2, -3*A + D**2)
    """
    over, under = sp.together(radicand).as_numer_denom()
    outside, inside = sp.Integer(1), sp.Integer(1)
    for part, place in ((over, 1), (under, -1)):
        constant, pieces = factors(part)
        for base, power in [(sp.Abs(constant), 1), *pieces]:
            if base.is_Integer:
                free, square = sp.Integer(1), sp.Integer(1)
                for prime, count in sp.factorint(base).items():
                    square *= prime ** (count // 2)
                    free *= prime ** (count % 2)
                outside *= square**place
                inside *= free**place
                continue
            outside *= base ** (place * (power // 2))
            inside *= base ** (place * (power % 2))
        inside *= sp.sign(constant)
    return outside, expanded_form(inside) if under == 1 else sp.cancel(inside)


def solved_for(
    equation: sp.Expr, candidates: Iterable[sp.Symbol], signs: Signs
) -> tuple[sp.Symbol, sp.Expr, sp.Expr] | None:
    """Solve an equation for the first candidate in which it is affine: (symbol, value, slope).

    Candidates whose coefficient is known to be nonzero are preferred.

    Examples
    --------
    >>> from fastslow.model.structure import real
    >>> x, w, A, D = map(real, "xwAD")
    >>> solved_for(w - (x**2 + A) * (x - D), [w], Signs({}))
    (w, (A + x**2)*(-D + x), 1)
    """
    spare = None
    if longer(equation, SOLVED_NODES):
        return None
    for symbol in candidates:
        slope = expanded_form(equation).diff(symbol)
        if slope == 0 or symbol in slope.free_symbols:
            continue
        if signs.nonzero(slope):
            return symbol, shortest(-equation.subs(symbol, 0) / slope), slope
        if spare is None:
            spare = symbol, slope
    if spare is None:
        return None
    symbol, slope = spare
    return symbol, shortest(-equation.subs(symbol, 0) / slope), slope
