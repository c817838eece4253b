"""Interfaces (switching manifolds) and the regions that they bound."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from random import Random

import mpmath
import sympy as sp

from fastslow.model.clocks import ClockFunction
from fastslow.model.expansion import EXPRESSIONS_KEPT, expanded
from fastslow.model.rational import exact
from fastslow.model.tabulated import TableValue
from fastslow.results.base.display import Displayed
from fastslow.results.base.named_mapping import NamedMapping


@dataclass(frozen=True)
class Interface(Displayed):
    """A switching manifold, the zero set of a smooth function.

    Parameters
    ----------
    name : str
        Given by the user, else the printed function.
    function : sympy.Expr
        h, a function of states, parameters, slow quantities and time.

    Examples
    --------
    >>> x, D = sp.symbols("x D", real=True)
    >>> print(Interface("upper", x - D))
    upper: -D + x = 0
    """

    name: str
    function: sp.Expr

    def __str__(self) -> str:
        return f"{self.name}: {self.function} = 0"


@dataclass(frozen=True)
class Region(Displayed):
    """The open set of one sign pattern of the interfaces, where every rate is smooth.

    Parameters
    ----------
    name : str
        S1, S2, … or as named by the user.
    signs : NamedMapping of int
        +1 or −1 for every interface.
    conditions : tuple of sympy.Rel
        The strict inequalities, and states of switches, that describe the region.
    rates : NamedMapping of sympy.Expr
        Rate of each state and slow state, without any Piecewise.
    forcing : NamedMapping of sympy.Expr
        Law of each slow quantity, without any Piecewise.
    """

    name: str
    signs: NamedMapping[int]
    conditions: tuple[sp.Rel, ...]
    rates: NamedMapping[sp.Expr]
    forcing: NamedMapping[sp.Expr]

    def __str__(self) -> str:
        where = (f"{c.lhs} = {c.rhs}" if isinstance(c, sp.Eq) else str(c) for c in self.conditions)
        return f"{self.name}: {', '.join(where) or 'everywhere'}"


#: Points of a zero set at which an expression is evaluated, and the number of digits.
ZERO_SET_POINTS, ZERO_SET_DIGITS = 4, 40

#: Values below this, relative to those next to the zero set, are zero.
ZERO_SET_VALUE = 1e-25


@lru_cache(maxsize=EXPRESSIONS_KEPT)
def vanishes_on(difference: sp.Expr, function: sp.Expr) -> bool:
    """Check that an expression vanishes on the zero set of a smooth function.

    The expression is evaluated at generic points of the zero set, with 40 digits. If no
    point is found, the function is solved for a symbol in which it is affine, or
    polynomial division is used; where neither applies, only an identical zero counts.

    Examples
    --------
    >>> x, D = sp.symbols("x D", real=True)
    >>> vanishes_on((x**2 + 1) * (x - D), x - D), vanishes_on(x, x - D)
    (True, False)
    """
    difference = sp.sympify(difference)
    if difference == 0:
        return True
    if difference.is_number:
        return False
    # functions of time that are constants, or polynomials, between their instants
    opaque = difference.atoms(ClockFunction, TableValue) | function.atoms(ClockFunction, TableValue)
    constants = {one: sp.Dummy(real=True) for one in opaque}
    difference, function = difference.xreplace(constants), function.xreplace(constants)
    decided = _on_points(difference, function)
    if decided is not None:
        return decided
    for symbol in sorted(function.free_symbols, key=lambda s: s.name):
        slope = function.diff(symbol)
        if slope != 0 and symbol not in slope.free_symbols:
            root = expanded(symbol - function / slope)
            return bool(sp.simplify(difference.subs(symbol, root)) == 0)
    numerator = sp.together(difference).as_numer_denom()[0]
    symbols = sorted(function.free_symbols, key=lambda s: s.name)
    if numerator.is_polynomial(*symbols) and function.is_polynomial(*symbols):
        return bool(sp.simplify(sp.rem(numerator, function, *symbols)) == 0)
    return bool(sp.simplify(difference) == 0)


def _on_points(difference: sp.Expr, function: sp.Expr) -> bool | None:
    """Check that an expression vanishes at random points of a zero set; None if none is found.

    All symbols but one get random values, and the function is a polynomial in the other.
    """
    symbol = next(
        (
            s
            for s in sorted(function.free_symbols, key=lambda s: s.name)
            if function.is_polynomial(s)
        ),
        None,
    )
    if symbol is None:
        return None
    difference, function = exact(difference), exact(function)
    used = sorted(difference.free_symbols | function.free_symbols, key=lambda s: s.name)
    others = [s for s in used if s != symbol]
    try:
        coefficients = sp.lambdify(others, sp.Poly(function, symbol).all_coeffs(), "mpmath")
        value = sp.lambdify([symbol, *others], difference, "mpmath")
    except (sp.PolynomialError, TypeError, ValueError):
        return None
    generator, found = Random(1), 0
    with mpmath.workdps(ZERO_SET_DIGITS):
        for _ in range(5 * ZERO_SET_POINTS):
            given = [mpmath.mpf(generator.randint(100, 2000)) / 997 for _ in others]
            try:
                line = [mpmath.mpmathify(c) for c in coefficients(*given)]
                roots = mpmath.polyroots(line, maxsteps=200, extraprec=4 * ZERO_SET_DIGITS)
                real_roots = [r.real for r in roots if abs(r.imag) <= ZERO_SET_VALUE * (1 + abs(r))]
                for root in real_roots[:1]:
                    beside = value(root + mpmath.mpf(1) / 7, *given)
                    size = abs(beside) + abs(value(root - mpmath.mpf(1) / 11, *given))
                    at = abs(value(root, *given))
                    if not (mpmath.isfinite(size) and mpmath.isfinite(at)):
                        continue
                    if at > ZERO_SET_VALUE * max(size, ZERO_SET_VALUE):
                        return False
                    found += 1
            except (ArithmeticError, ValueError, TypeError, NameError, mpmath.mp.NoConvergence):
                continue
            if found == ZERO_SET_POINTS:
                return True
    return None
