"""NumPy functions of expressions."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
import sympy as sp
from sympy.printing.numpy import NumPyPrinter

from fastslow.model.tabulated import TableValue

#: Number of cached functions.
FUNCTIONS_KEPT = 1024

#: Names that printed expressions use. SymPy would import all of NumPy for them, including f2py,
#: which takes longer than many a diagram.
_NAMES = {name: vars(np)[name] for name in np.__all__ if name in vars(np)} | {"I": 1j}

_PRINTING = {"fully_qualified_modules": False, "inline": True, "allow_unknown_functions": True}


def numpy_function(symbols: Any, expression: Any, *, cse: bool = False) -> Callable[..., Any]:
    """Return a NumPy function that evaluates an expression.

    Parameters
    ----------
    symbols : sympy.Symbol or sequence of sympy.Symbol
        Arguments of the function.
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
    names = {**_NAMES, **{value.key: value.evaluate for value in _tables(expression)}}
    return sp.lambdify(symbols, expression, [names], printer, cse=cse)


def _tables(expression: Any) -> set[TableValue]:
    """Values of tables in an expression or a nested sequence of them."""
    if isinstance(expression, sp.Basic):
        return expression.atoms(TableValue)
    return set().union(*map(_tables, expression)) if isinstance(expression, list | tuple) else set()


@lru_cache(maxsize=FUNCTIONS_KEPT)
def function_of(
    expression: sp.Expr, values: tuple[tuple[sp.Symbol, float], ...] = ()
) -> tuple[tuple[sp.Symbol, ...], Callable[..., Any]]:
    """Return the symbols of an expression, sorted by name, and its NumPy function of them.

    Parameters
    ----------
    expression : sympy.Expr
    values : tuple of (Symbol, float), optional
        Values that are substituted first.

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
