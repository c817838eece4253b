"""Interfaces and regions: what a model's right-hand side switches on."""

from __future__ import annotations

from dataclasses import dataclass

import sympy as sp

from fastslow.results.named import Named


@dataclass(frozen=True)
class Interface:
    """A switching manifold, the zero set of a smooth function.

    Parameters
    ----------
    name : str
        Given by the user, else what the function prints.
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
class Region:
    """One sign pattern of the interfaces, where every rate is smooth.

    Parameters
    ----------
    name : str
        S1, S2, … or as named by the user.
    signs : Named of int
        +1 or −1 for every interface.
    conditions : tuple of sympy.Rel
        The strict inequalities that describe the region.
    rates : Named of sympy.Expr
        Rate of each state and slow state, without any Piecewise.
    forcing : Named of sympy.Expr
        Law of each slow quantity, without any Piecewise.
    """

    name: str
    signs: Named[int]
    conditions: tuple[sp.Rel, ...]
    rates: Named[sp.Expr]
    forcing: Named[sp.Expr]

    def __str__(self) -> str:
        where = ", ".join(str(c) for c in self.conditions) or "everywhere"
        return f"{self.name}: {where}"


def vanishes_on(difference: sp.Expr, function: sp.Expr) -> bool:
    """Whether an expression is zero wherever a smooth function is.

    Decided by solving the function for a symbol it is affine in, else by
    polynomial division; where neither applies, only an identical zero counts.

    Examples
    --------
    >>> x, D = sp.symbols("x D", real=True)
    >>> vanishes_on((x**2 + 1) * (x - D), x - D), vanishes_on(x, x - D)
    (True, False)
    """
    difference = sp.sympify(difference)
    if difference == 0:
        return True
    for symbol in sorted(function.free_symbols, key=lambda s: s.name):
        slope = function.diff(symbol)
        if slope != 0 and symbol not in slope.free_symbols:
            root = sp.expand(symbol - function / slope)
            return bool(sp.simplify(difference.subs(symbol, root)) == 0)
    numerator = sp.together(difference).as_numer_denom()[0]
    symbols = sorted(function.free_symbols, key=lambda s: s.name)
    if numerator.is_polynomial(*symbols) and function.is_polynomial(*symbols):
        return bool(sp.simplify(sp.rem(numerator, function, *symbols)) == 0)
    return bool(sp.simplify(difference) == 0)
