"""Symbolic second and third derivatives of rates, cached."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import sympy as sp

from fastslow.model.differentiation import derivative
from fastslow.model.known_functions import CLOSED, IN_MPMATH, OPEN

Entries = list[tuple[int, ...]]


@lru_cache(maxsize=64)
def derivatives(
    rates: tuple[sp.Expr, ...], states: tuple[sp.Symbol, ...], others: tuple[sp.Symbol, ...]
) -> tuple[Entries, Callable[..., Any]]:
    """Derive all second and third derivatives that do not vanish.

    Parameters
    ----------
    rates : tuple of sympy.Expr
    states : tuple of Symbol
    others : tuple of Symbol
        Every other symbol of the rates.

    Returns
    -------
    entries : list of tuple
        (i, j, k) or (i, j, k, l) with j ≤ k ≤ l.
    values : callable
        Function of states and others that returns the list of values.

    Examples
    --------
    >>> x, y = sp.symbols("x y", real=True)
    >>> entries, values = derivatives((x**2 * y, y), (x, y), ())
    >>> entries, values(3.0, 5.0)
    ([(0, 0, 0), (0, 0, 1), (0, 0, 0, 1)], [10.0, 6.0, 2])
    """
    table: dict[tuple[int, ...], sp.Expr] = {}
    number = {symbol: k for k, symbol in enumerate(states)}
    for i, rate in enumerate(rates):
        level: dict[tuple[int, ...], sp.Expr] = {(i,): rate}
        for _ in range(3):
            deeper = {}
            for index, expression in level.items():
                first = index[-1] if len(index) > 1 else 0
                present = sorted(number[s] for s in expression.free_symbols if s in number)
                for j in present:
                    if j >= first and (slope := derivative(expression, states[j])) != 0:
                        deeper[(*index, j)] = slope
            level = deeper
            table |= {k: e for k, e in level.items() if len(k) > 2}
    entries = sorted(table, key=lambda k: (len(k), k))
    found = [table[k] for k in entries]
    special = any(e.has(*CLOSED, *OPEN) for e in found)
    modules = [IN_MPMATH, "mpmath"] if special else "numpy"
    return entries, sp.lambdify((*states, *others), found, modules, cse=True)
