"""Named definitions of a model, in terms of its states, parameters and each other."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import sympy as sp

from fastslow.errors import ModelError
from fastslow.formulas.grammar import RESERVED


def resolved(
    given: Mapping[str, Any], read: Callable[[str, Any], sp.Expr]
) -> dict[sp.Symbol, sp.Expr]:
    """Return definitions without the names of others, in the given order.

    Parameters
    ----------
    given : mapping
        Name to expression, in any order.
    read : callable
        Reads an expression, with a description of it.

    Raises
    ------
    ModelError
        For a name that no formula can contain, and for definitions that contain each other.

    Examples
    --------
    >>> a, x = sp.symbols("a x", real=True)
    >>> resolved({"b": 2 * a, "a": x + 1}, lambda what, e: e)
    {b: 2*x + 2, a: x + 1}
    """
    for name in given:
        if not name.isidentifier() or name in RESERVED:
            raise ModelError(
                f"definition {name!r}: expected an identifier that means nothing else in formulas, "
                "such as i_Ca"
            )
    left = {sp.Symbol(name, real=True): read(f"definition {name}", e) for name, e in given.items()}
    order = [*left]
    found: dict[sp.Symbol, sp.Expr] = {}
    while left:
        ready = [s for s, e in left.items() if not e.free_symbols & left.keys()]
        if not ready:
            raise ModelError(f"definitions contain each other: {' → '.join(_circle(left))}")
        for symbol in ready:
            found[symbol] = left.pop(symbol).xreplace(found)
    return {symbol: found[symbol] for symbol in order}


def _circle(left: Mapping[sp.Symbol, sp.Expr]) -> list[str]:
    """Names of definitions of which each contains the next, from one back to it."""
    path = [next(iter(left))]
    while True:
        inside = left[path[-1]].free_symbols & left.keys()
        following = min(inside, key=lambda s: s.name)
        if following in path:
            return [s.name for s in (*path[path.index(following) :], following)]
        path.append(following)
