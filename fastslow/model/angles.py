"""States modulo a period, and the check that a model is periodic in them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import sympy as sp

from fastslow.arguments import shown
from fastslow.errors import ModelError, unknown_name
from fastslow.formulas.grammar import normalised
from fastslow.model.equations import sympified
from fastslow.model.functions import numpy_function
from fastslow.model.structure import Structure, real

#: Random states and parameter values at which an expression is compared with its translate.
TRANSLATED_POINTS = 40

#: Largest difference, relative to the size of the expression, that is rounding.
TRANSLATE_ROUNDING = 1e-9


def read_periods(
    structure: Structure, values: Mapping[str, float], periodic: Mapping[Any, Any]
) -> dict[str, sp.Expr]:
    """Return the periods of states, each checked against every rate, law and interface.

    Raises
    ------
    UnknownNameError
        For a name that is no state.
    ModelError
        For a period that is not a positive number, or in which an expression is not periodic.

    Examples
    --------
    >>> from fastslow.model.model import Model
    >>> theta = sp.Symbol("theta")
    >>> Model({theta: 1 - theta}, periodic={theta: 2 * sp.pi})
    Traceback (most recent call last):
    ...
    fastslow.errors.ModelError: theta modulo 2*pi: the rate of theta, 1 - theta, is not \
periodic in theta with period 2*pi
    """
    periods: dict[str, sp.Expr] = {}
    for key, given in periodic.items():
        name = normalised(str(key))
        if name not in structure.states:
            raise unknown_name("state in periodic", name, structure.states)
        periods[name] = _period(name, given)
        for what, expression in _expressions(structure).items():
            if not _repeats(expression, name, periods[name], values):
                raise ModelError(
                    f"{name} modulo {periods[name]}: the {what}, {expression}, is not "
                    f"periodic in {name} with period {periods[name]}"
                )
    return periods


def _period(name: str, given: Any) -> sp.Expr:
    expected = "a positive number or an expression of numbers, such as 2*pi"
    if isinstance(given, bool):
        raise ModelError(f"period of {name}: expected {expected}, received {given}")
    period = sympified(f"period of {name}", given)
    if period.free_symbols or not period.is_finite or not period.is_positive:
        raise ModelError(f"period of {name}: expected {expected}, received {shown(given)}")
    return period


def _expressions(structure: Structure) -> dict[str, sp.Expr]:
    """Expressions that must be periodic, by description."""
    rates = {f"rate of {n}": e for n, e in structure.rates.items()}
    laws = {f"law of {n}": e for n, e in structure.forcing.items()}
    edges = {f"interface {i.name}": i.function for i in structure.interfaces}
    walls = {f"reset {r.name}": r.function for r in structure.resets}
    jumps = {
        f"change of {n} by the reset {r.name}": e - real(n)
        for r in structure.resets
        for n, e in r.jump.items()
    }
    relations = {
        f"relation {relation} of the switch {s.name}": function
        for s in structure.switches
        for relation, function in zip(s.relations, s.functions, strict=True)
    }
    return {**rates, **laws, **edges, **walls, **jumps, **relations}


def _repeats(expression: sp.Expr, name: str, period: sp.Expr, values: Mapping[str, float]) -> bool:
    """Check that an expression is unchanged when a state is shifted by its period."""
    symbol = real(name)
    if symbol not in expression.free_symbols:
        return True
    moved = expression.subs(symbol, symbol + period)
    if moved == expression:
        return True
    symbols = sorted(expression.free_symbols, key=lambda s: s.name)
    generator = np.random.default_rng(1988)
    table = generator.normal(0.0, 2.0, (len(symbols), TRANSLATED_POINTS))
    for row, one in enumerate(symbols):
        if one.name in values:
            table[row] = values[one.name]
    both = numpy_function(symbols, [expression, moved])
    with np.errstate(all="ignore"):
        try:
            first, second = (
                np.broadcast_to(v, TRANSLATED_POINTS).astype(float) for v in both(*table)
            )
        except (TypeError, ValueError, NameError):
            return bool(sp.simplify(moved - expression) == 0)
    known = np.isfinite(first) & np.isfinite(second)
    if not known.any():
        return bool(sp.simplify(moved - expression) == 0)
    size = np.maximum(np.abs(first[known]), np.abs(second[known]).max())
    return bool(np.all(np.abs(first - second)[known] <= TRANSLATE_ROUNDING * size))
