"""NumPy functions of expressions in parameters, each made once."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import sympy as sp

#: Expressions whose function is kept.
KEPT = 1024


@lru_cache(maxsize=KEPT)
def function_of(
    expression: sp.Expr, values: tuple[tuple[sp.Symbol, float], ...] = ()
) -> tuple[tuple[sp.Symbol, ...], Callable[..., Any]]:
    """The symbols of an expression in the order of their names, and its function of them.

    Parameters
    ----------
    expression : sympy.Expr
    values : tuple of (Symbol, float), optional
        What is put in for symbols first.

    Examples
    --------
    >>> a, b = sp.symbols("a b")
    >>> symbols, function = function_of(a * b + 1, ((b, 2.0),))
    >>> symbols, function(3.0)
    ((a,), 7.0)
    """
    given = expression.subs(dict(values)) if values else expression
    used = tuple(sorted(given.free_symbols, key=lambda s: s.name))
    return used, sp.lambdify(used, given, "numpy")
