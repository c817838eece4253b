"""Invariant coordinate planes: states that remain zero, alone or together."""

from __future__ import annotations

from collections.abc import Iterator

import sympy as sp

from fastslow.model.expansion import MULTIPLIED, expanded, n_terms, vanishes
from fastslow.model.resets import Reset
from fastslow.model.structure import Partition, real


def invariant_states(partition: Partition) -> tuple[str, ...]:
    """Return the states x with rate x g in every region, g finite at x = 0.

    The plane x = 0 is then invariant. Decided from the equations: the rate vanishes at
    x = 0, and its derivative by x is finite there.

    Parameters
    ----------
    partition : Partition
        The regions of the model.

    Returns
    -------
    tuple of str
        Names of states and slow states.

    Examples
    --------
    >>> from fastslow.model.model import Model
    >>> x, y, k = sp.symbols("x y k")
    >>> invariant_states(Model({x: x * (1 - y), y: k * x - y}, parameters={k: 1}).partition)
    ('x',)
    """
    structure = partition.structure
    names = (*structure.states, *structure.slow_states)
    return tuple(
        name
        for name in names
        if all(_is_factor(real(name), region.rates[name]) for region in partition.regions.values())
        and not any(_leaves(real(name), reset) for reset in structure.resets)
    )


def _leaves(symbol: sp.Symbol, reset: Reset) -> bool:
    """Check whether a reset may take a state from zero to another value."""
    if symbol.name not in reset.jump:
        return False
    return not vanishes(reset.jump[symbol.name].subs(symbol, 0))


def _is_factor(symbol: sp.Symbol, rate: sp.Expr) -> bool:
    if not vanishes(rate.subs(symbol, 0)):
        return False
    slope = rate.diff(symbol).subs(symbol, 0)
    return not slope.has(sp.nan, sp.zoo, sp.oo, -sp.oo)


#: Largest number of states that vanish together.
MOST_TOGETHER = 4


def jointly_invariant_states(partition: Partition) -> tuple[tuple[str, ...], ...]:
    """Return minimal sets of two to four states that remain zero together.

    E' = b S I − s E and I' = s E − g I vanish where E = I = 0, though neither is a
    multiple of its state. In every region, each term of the rates of a set has one of
    its states as a factor, and no state of the set decreases another one when all symbols
    are positive (the subsystem is cooperative), so that positive values change sign only
    in oscillations about zero. The set of all states is excluded: its zero is an equilibrium.

    Parameters
    ----------
    partition : Partition
        The regions of the model.

    Returns
    -------
    tuple of tuple of str
        Names of states and slow states.

    Examples
    --------
    >>> from fastslow.model.model import Model
    >>> S, E, I, b = sp.symbols("S E I b")
    >>> rates = {S: -b * S * I, E: b * S * I - E, I: E - I}
    >>> jointly_invariant_states(Model(rates, parameters={b: 2}).partition)
    (('E', 'I'),)
    """
    structure = partition.structure
    names = (*structure.states, *structure.slow_states)
    alone = invariant_states(partition)
    terms = {name: _terms(partition, name) for name in names}
    found: list[frozenset[str]] = []
    for name in names:
        if name not in alone:
            found += _closures(frozenset([name]), terms)
    smallest = [s for s in dict.fromkeys(found) if not any(other < s for other in found)]
    return tuple(
        tuple(name for name in names if name in chosen)
        for chosen in smallest
        if len(chosen) < len(names)
        and not chosen.intersection(alone)
        and not any(chosen.intersection(reset.jump) for reset in structure.resets)
        and _feed_one_another(partition, chosen)
    )


def _terms(partition: Partition, name: str) -> list[frozenset[str]] | None:
    """Return the states that are factors of each term of a rate, None if that is unknown."""
    structure = partition.structure
    known = {real(n): n for n in (*structure.states, *structure.slow_states)}
    found = []
    for rate in dict.fromkeys(region.rates[name] for region in partition.regions.values()):
        if n_terms(rate) > MULTIPLIED:
            return None
        for term in sp.Add.make_args(expanded(rate)):
            powers = term.as_powers_dict().items()
            found.append(
                frozenset(
                    known[base]
                    for base, power in powers
                    if base in known and power.is_number and power >= 1
                )
            )
    return list(dict.fromkeys(found))


def _closures(
    chosen: frozenset[str], terms: dict[str, list[frozenset[str]] | None]
) -> Iterator[frozenset[str]]:
    """Yield all closures of a set under the terms that have none of its states."""
    for name in sorted(chosen):
        own = terms[name]
        if own is None:
            return
        for factors in own:
            if not factors & chosen:
                if len(chosen) < MOST_TOGETHER:
                    for added in sorted(factors):
                        yield from _closures(chosen | {added}, terms)
                return
    yield chosen


def _feed_one_another(partition: Partition, chosen: frozenset[str]) -> bool:
    zero = {real(name): sp.Integer(0) for name in chosen}
    for region in partition.regions.values():
        for name in chosen:
            for other in chosen - {name}:
                slope = region.rates[name].diff(real(other)).subs(zero)
                if slope.has(sp.nan, sp.zoo, sp.oo, -sp.oo):
                    return False
                positive = {s: sp.Dummy(s.name, positive=True) for s in slope.free_symbols}
                if not slope.xreplace(positive).is_nonnegative:
                    return False
    return True
