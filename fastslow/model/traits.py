"""What the outcome of a run needs of the equations, beside the steps."""

from __future__ import annotations

from collections.abc import Mapping

import sympy as sp

from fastslow.errors import ModelError
from fastslow.model.derived import once, partition_of, sloped
from fastslow.model.invariance import factor_states, states_together
from fastslow.model.model import Model
from fastslow.model.recurrences import scalar_code
from fastslow.model.structure import TIME, real
from fastslow.results.stored.model import Traits


@once(sloped)
def traits_of(model: Model) -> Traits:
    """The traits of a model.

    Parameters
    ----------
    model : Model

    Examples
    --------
    >>> x, y, k = sp.symbols("x y k")
    >>> traits = traits_of(Model({x: x * (k - y), y: k * x - y}, parameters={k: 1}))
    >>> traits.vanishing, traits.names, traits.growth
    (('x',), ('k',), (('p0 - y1',),))
    """
    vanishing, together, names, growth = _lasting(model)
    functions = [i.function for i in model.interfaces.values()]
    rising = tuple(_growth(model, function) for function in functions)
    return Traits(vanishing, together, names, growth, _parallel(model), rising)


@once(partition_of)
def _lasting(
    model: Model,
) -> tuple[
    tuple[str, ...], tuple[tuple[str, ...], ...], tuple[str, ...], tuple[tuple[str, ...], ...]
]:
    """States that stay zero, and how they grow there."""
    vanishing, together = factor_states(model), states_together(model)
    rates = [
        [
            region.rates[name]
            .diff(real(name))
            .subs(real(name), 0)
            .subs({real(n): law for n, law in region.forcing.items()})
            for region in model.regions.values()
        ]
        for name in vanishing
    ]
    states = {real(n): f"y{k}" for k, n in enumerate((*model.states, *model.slow_states))}
    used = set().union(*(rate.free_symbols for row in rates for rate in row))
    names = sorted(s.name for s in used - set(states) - {TIME})
    new = {**states, **{real(n): f"p{k}" for k, n in enumerate(names)}}
    growth = tuple(tuple(text_of(rate, new) for rate in row) for row in rates)
    return vanishing, together, tuple(names), growth


def text_of(expression: sp.Expr, names: Mapping[sp.Symbol, str]) -> str:
    """An expression as text in canonical names, empty where it has none."""
    try:
        return scalar_code(expression.xreplace({s: real(n) for s, n in names.items()}))
    except ModelError:
        return ""


def first_slope(model: Model, function: sp.Expr) -> sp.Expr | None:
    """Slope of an interface function by the first symbol in it that moves, if there is one."""
    for symbol in model.structure.moving:
        if symbol in function.free_symbols:
            return function.diff(symbol)
    return None


def _parallel(model: Model) -> bool:
    """Whether there are two interfaces that differ by a constant, apart from a factor."""
    if len(model.interfaces) != 2:
        return False
    one, other = (i.function for i in model.interfaces.values())
    moving = set(model.structure.moving)
    shared = [s for s in model.structure.moving if s in one.free_symbols & other.free_symbols]
    if not shared:
        return False
    factor = sp.cancel(other.diff(shared[0]) / one.diff(shared[0]))
    rest = sp.expand(factor * one - other)
    return not (factor.free_symbols | rest.free_symbols) & moving


def _growth(model: Model, function: sp.Expr) -> int:
    """Whether the first state in an interface function raises or lowers it."""
    slope = first_slope(model, function)
    rate = sp.Integer(1) if slope is None else slope.subs(model.values)
    return -1 if rate.is_number and rate.is_negative else 1
