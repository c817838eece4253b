"""Properties of the equations that classify the outcome of a run."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

import sympy as sp

from fastslow.errors import ModelError
from fastslow.model.expansion import cancelled, expanded
from fastslow.model.invariance import invariant_states, jointly_invariant_states
from fastslow.model.motions import PARTITIONS_KEPT
from fastslow.model.recurrences import scalar_code
from fastslow.model.structure import TIME, Partition, Structure, real
from fastslow.results.stored.model import Traits


@lru_cache(maxsize=PARTITIONS_KEPT)
def traits_of(partition: Partition, slopes: tuple[tuple[str, float | None], ...]) -> Traits:
    """Return the traits of a model.

    Parameters
    ----------
    partition : Partition
        The regions of the model.
    slopes : tuple of (str, float or None)
        The values of the parameters in the slopes of interfaces.

    Examples
    --------
    >>> from fastslow.model.model import Model
    >>> x, y, k = sp.symbols("x y k")
    >>> traits = Model({x: x * (k - y), y: k * x - y}, parameters={k: 1}).traits
    >>> traits.vanishing, traits.names, traits.growth
    (('x',), ('k',), (('p0 - y1',),))
    """
    vanishing, together, names, growth = _invariant_growth(partition)
    values = {real(name): value for name, value in slopes if value is not None}
    functions = [i.function for i in partition.interfaces.values()]
    rising = tuple(_growth(partition.structure, function, values) for function in functions)
    return Traits(vanishing, together, names, growth, _bounds_gap(partition), rising)


@lru_cache(maxsize=PARTITIONS_KEPT)
def _invariant_growth(
    partition: Partition,
) -> tuple[
    tuple[str, ...], tuple[tuple[str, ...], ...], tuple[str, ...], tuple[tuple[str, ...], ...]
]:
    """States that remain zero, and their growth rates there."""
    if partition.pieces is not None:
        # undecided in regions that are not formed
        return (), (), (), ()
    vanishing, together = invariant_states(partition), jointly_invariant_states(partition)
    rates = [
        [
            region.rates[name]
            .diff(real(name))
            .subs(real(name), 0)
            .subs({real(n): law for n, law in region.forcing.items()})
            for region in partition.regions.values()
        ]
        for name in vanishing
    ]
    structure = partition.structure
    states = {real(n): f"y{k}" for k, n in enumerate((*structure.states, *structure.slow_states))}
    used = set().union(*(rate.free_symbols for row in rates for rate in row))
    switches = set(map(real, structure.switch_names))
    names = sorted(s.name for s in used - set(states) - switches - {TIME})
    new = {**states, **{real(n): f"p{k}" for k, n in enumerate(names)}}
    # unknown where it depends on a switch
    growth = tuple(
        tuple("" if rate.free_symbols & switches else text_of(rate, new) for rate in row)
        for row in rates
    )
    return vanishing, together, tuple(names), growth


def text_of(expression: sp.Expr, names: Mapping[sp.Symbol, str]) -> str:
    """Return an expression as text in canonical names, empty if it has none."""
    try:
        return scalar_code(expression.xreplace({s: real(n) for s, n in names.items()}))
    except ModelError:
        return ""


def first_slope(structure: Structure, function: sp.Expr) -> sp.Expr | None:
    """Return the derivative of an interface function by its first moving symbol, if any."""
    for symbol in structure.moving:
        if symbol in function.free_symbols:
            return function.diff(symbol)
    return None


def _bounds_gap(partition: Partition) -> bool:
    """Check whether the two interfaces of a model bound a gap between bodies.

    They are equal up to a constant and a factor. Contact accelerates, so that the rate of the
    interface function is the same in all regions; without inertia, the rate inside does not
    depend on the position. The three regions of a climate or a neuron are no gap.
    """
    if len(partition.interfaces) != 2:
        return False
    one, other = (i.function for i in partition.interfaces.values())
    moving = partition.structure.moving
    shared = [s for s in moving if s in one.free_symbols & other.free_symbols]
    if not shared:
        return False
    factor = cancelled(other.diff(shared[0]) / one.diff(shared[0]))
    rest = expanded(factor * one - other)
    if (factor.free_symbols | rest.free_symbols) & set(moving):
        return False
    places = one.free_symbols & set(moving)
    rates = [
        expanded(sum(one.diff(place) * region.rates.get(place.name, 0) for place in places))
        for region in partition.regions.values()
    ]
    if len(set(rates)) == 1:
        return True
    signs = [tuple(region.signs.values()) for region in partition.regions.values()]
    inside = [
        rate
        for own, rate in zip(signs, rates, strict=True)
        if sum(sum(a != b for a, b in zip(own, other, strict=True)) == 1 for other in signs) == 2
    ]
    return len(inside) == 1 and not inside[0].free_symbols & places


def _growth(structure: Structure, function: sp.Expr, values: Mapping[sp.Symbol, float]) -> int:
    """Sign of the derivative of an interface function by its first state."""
    slope = first_slope(structure, function)
    rate = sp.Integer(1) if slope is None else slope.subs(values)
    return -1 if rate.is_number and rate.is_negative else 1
