"""Fewer states by symmetry: rates of combinations that form a system of their own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import sympy as sp

from fastslow.arguments import mapping, takes
from fastslow.errors import ArgumentError
from fastslow.model.structure import read_expression, real
from fastslow.results.named import Named
from fastslow.symbolic.reading import read_formula


@takes(rates=mapping, combinations=mapping)
def reduce_states(rates: Mapping[Any, Any], combinations: Mapping[Any, Any]) -> Named[sp.Expr]:
    """Rates of linear combinations of states, where these need no other state.

    Parameters
    ----------
    rates : mapping
        State to its rate.
    combinations : mapping
        New state to a linear combination of the old ones.

    Returns
    -------
    Named of sympy.Expr
        Rate of each new state in new states and parameters.

    Raises
    ------
    ArgumentError
        If a combination is not linear, they are dependent, or their rates need another state.

    Examples
    --------
    >>> a, b, u, k = sp.symbols("a b u k")
    >>> reduce_states({a: -k * (a - b), b: k * (a - b)}, {u: a - b})
    {u: -2*k*u}
    """
    known = {str(s): real(str(s)) for s in rates}
    inside = {str(s): _real(e) for s, e in rates.items()}
    new = {real(str(s)): _real(e) for s, e in combinations.items()}
    states = list(known.values())
    matrix = sp.Matrix([[e.diff(s) for s in states] for e in new.values()])
    if matrix.free_symbols & set(states):
        raise ArgumentError("expected combinations that are linear in the states")
    _, pivots = matrix.rref()
    if len(pivots) < len(new):
        raise ArgumentError("the combinations depend on one another")
    kept = [states[k] for k in pivots]
    rest = [e.subs(dict.fromkeys(kept, 0), simultaneous=True) for e in new.values()]
    block = matrix.extract(list(range(len(new))), list(pivots))
    solution = block.inv() * sp.Matrix([n - r for n, r in zip(new, rest, strict=True)])
    place = {s: sp.expand(e) for s, e in zip(kept, solution, strict=True)}
    reduced = {}
    for symbol, expression in new.items():
        rate = sum((expression.diff(s) * inside[s.name] for s in states), sp.S.Zero)
        rate = _arguments_expanded(rate.subs(place, simultaneous=True))
        rate = sp.expand(rate)
        others = sorted((rate.free_symbols & set(states)) - set(new), key=lambda s: s.name)
        if others:
            raise ArgumentError(
                f"the rate of {symbol} = {expression} needs {', '.join(map(str, others))} as well; "
                "add a combination that gives it"
            )
        reduced[symbol.name] = rate
    return Named("state", reduced)


def _real(expression: Any) -> sp.Expr:
    written = read_formula(expression) if isinstance(expression, str) else expression
    return read_expression("a formula", written)


def _arguments_expanded(expression: sp.Expr) -> sp.Expr:
    """Arguments of functions and of conditions expanded, so that what cancels does."""
    return sp.sympify(
        expression.replace(
            lambda e: (
                isinstance(e, (sp.Function, sp.core.relational.Relational))
                and not isinstance(e, sp.Piecewise)
            ),
            lambda e: e.func(*map(sp.expand, e.args)),
        )
    )
