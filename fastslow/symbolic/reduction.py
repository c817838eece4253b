"""Reduction of a system by a symmetry or by conserved quantities."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import sympy as sp

from fastslow.arguments import mapping, validated
from fastslow.errors import ArgumentError
from fastslow.model.equations import read_expression, sympified
from fastslow.model.structure import real
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.symbolic.algebra import rational_form


@validated(rates=mapping, combinations=mapping, conserved=mapping)
def reduce_states(
    rates: Mapping[Any, Any],
    combinations: Mapping[Any, Any],
    *,
    conserved: Mapping[Any, Any] | None = None,
) -> NamedMapping[sp.Expr]:
    """Return the rates of linear combinations of states that form a closed system.

    Parameters
    ----------
    rates : mapping
        State to its rate.
    combinations : mapping
        New state to a linear combination of the old ones.
    conserved : mapping, optional
        New parameter to a conserved linear combination of the old states, of which it is
        the value.

    Returns
    -------
    NamedMapping of sympy.Expr
        Rate of each new state in new states and parameters.

    Raises
    ------
    ArgumentError
        If a combination is not linear, if the combinations are linearly dependent or not
        closed, or if a quantity in ``conserved`` is not conserved.

    See Also
    --------
    fastslow.nondimensionalise, fastslow.derive

    Examples
    --------
    >>> a, b, u, k = sp.symbols("a b u k")
    >>> reduce_states({a: -k * (a - b), b: k * (a - b)}, {u: a - b})
    {u: -2*k*u}
    >>> reduce_states({a: -k * a, b: k * a}, {b: b}, conserved={"N": a + b})
    {b: N*k - b*k}
    """
    known = {str(s): real(str(s)) for s in rates}
    inside = {str(s): _real(e) for s, e in rates.items()}
    new = {real(str(s)): _real(e) for s, e in combinations.items()}
    totals = {real(str(s)): _real(e) for s, e in (conserved or {}).items()}
    states = list(known.values())
    for symbol in totals:
        if symbol in new or symbol in states:
            raise ArgumentError(
                f"{symbol} is a state; expected a new name for the conserved quantity"
            )
    every = {**new, **totals}
    matrix = sp.Matrix([[e.diff(s) for s in states] for e in every.values()])
    if matrix.free_symbols & set(states):
        raise ArgumentError("expected combinations that are linear in the states")
    for symbol, expression in totals.items():
        rate = rational_form(sum((expression.diff(s) * inside[s.name] for s in states), sp.S.Zero))
        if rate != 0:
            raise ArgumentError(f"{symbol} = {expression} is not conserved; its rate is {rate}")
    _, pivots = matrix.rref()
    if len(pivots) < len(every):
        raise ArgumentError("the combinations are linearly dependent")
    kept = [states[k] for k in pivots]
    rest = [e.subs(dict.fromkeys(kept, 0), simultaneous=True) for e in every.values()]
    block = matrix.extract(list(range(len(every))), list(pivots))
    # new states may have names of old ones
    aside = {s: sp.Dummy(s.name, real=True) for s in every}
    values = [aside[s] - r for s, r in zip(every, rest, strict=True)]
    solution = block.inv() * sp.Matrix(values)
    place = {s: sp.expand(e) for s, e in zip(kept, solution, strict=True)}
    back = {d: s for s, d in aside.items()}
    reduced = {}
    for symbol, expression in new.items():
        rate = sum((expression.diff(s) * inside[s.name] for s in states), sp.S.Zero)
        rate = _arguments_expanded(rate.subs(place, simultaneous=True))
        rate = sp.expand(rate)
        others = sorted(rate.free_symbols & set(states), key=lambda s: s.name)
        if others:
            raise ArgumentError(
                f"the rate of {symbol} = {expression} also depends on "
                f"{', '.join(map(str, others))}; add a combination that contains it"
            )
        reduced[symbol.name] = rate.xreplace(back)
    return NamedMapping("state", reduced)


def _real(expression: Any) -> sp.Expr:
    return read_expression("a formula", sympified("a formula", expression, exact=True))


def _arguments_expanded(expression: sp.Expr) -> sp.Expr:
    """Expand the arguments of functions and conditions, so that terms cancel."""
    return sp.sympify(
        expression.replace(
            lambda e: (
                isinstance(e, (sp.Function, sp.core.relational.Relational))
                and not isinstance(e, sp.Piecewise)
            ),
            lambda e: e.func(*map(sp.expand, e.args)),
        )
    )
