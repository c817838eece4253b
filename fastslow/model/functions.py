"""NumPy functions of expressions."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
import sympy as sp
from sympy.printing.numpy import NumPyPrinter

#: Expressions whose function is kept.
KEPT = 1024

#: What printed expressions call. SymPy would import all of NumPy for them, and its compiler of
#: Fortran with it, which takes longer than many a diagram.
_NAMES = {name: vars(np)[name] for name in np.__all__ if name in vars(np)} | {"I": 1j}

_PRINTING = {"fully_qualified_modules": False, "inline": True, "allow_unknown_functions": True}


def numpy_function(symbols: Any, expression: Any, *, cse: bool = False) -> Callable[..., Any]:
    """A function of numbers or arrays.

    Parameters
    ----------
    symbols : sympy.Symbol or sequence of sympy.Symbol
        Its arguments.
    expression : sympy.Expr, or a nested sequence of them
    cse : bool
        Compute common subexpressions once.

    Examples
    --------
    >>> a, b = sp.symbols("a b")
    >>> numpy_function([a, b], sp.Max(a, b) + sp.sin(a))(0.0, np.array([1.0, 2.0])).tolist()
    [1.0, 2.0]
    """
    printer = NumPyPrinter(_PRINTING)
    return sp.lambdify(symbols, expression, [_NAMES], printer, cse=cse)


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
    return used, numpy_function(used, given)
