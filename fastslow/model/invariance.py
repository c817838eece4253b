"""States that stay zero once they are, alone or together: the rates that have them as factors."""

from __future__ import annotations

from collections.abc import Iterator

import sympy as sp

from fastslow.model.model import Model
from fastslow.model.structure import real


def factor_states(model: Model) -> tuple[str, ...]:
    """States whose rate is x g, with g finite at x = 0, in every region of a model.

    Decided from the equations: the rate vanishes at x = 0, and so does not the
    denominator of its derivative there.

    Parameters
    ----------
    model : Model

    Returns
    -------
    tuple of str
        Names of states and slow states.

    Examples
    --------
    >>> x, y, k = sp.symbols("x y k")
    >>> factor_states(Model({x: x * (1 - y), y: k * x - y}, parameters={k: 1}))
    ('x',)
    """
    names = (*model.states, *model.slow_states)
    return tuple(
        name
        for name in names
        if all(_is_factor(real(name), region.rates[name]) for region in model.regions.values())
    )


def _is_factor(symbol: sp.Symbol, rate: sp.Expr) -> bool:
    if sp.expand(rate.subs(symbol, 0)) != 0:
        return False
    slope = rate.diff(symbol).subs(symbol, 0)
    return not slope.has(sp.nan, sp.zoo, sp.oo, -sp.oo)


#: Most states of a set that vanish together.
MOST_TOGETHER = 4

#: Expressions of more operations are not multiplied out.
LONGEST = 2000


def states_together(model: Model) -> tuple[tuple[str, ...], ...]:
    """Smallest sets of two to four states that stay zero together, and feed one another.

    E' = b S I − s E and I' = s E − g I vanish where E = I = 0, though neither is a
    multiple of its state. Every term of the rates of a set has one of its states as a
    factor, in every region, and with positive symbols no state of the set diminishes
    another one: from positive values none of them passes zero, other than in an
    oscillation about it. All states of a model together are no set, but an equilibrium.

    Parameters
    ----------
    model : Model

    Returns
    -------
    tuple of tuple of str
        Names of states and slow states.

    Examples
    --------
    >>> S, E, I, b = sp.symbols("S E I b")
    >>> states_together(Model({S: -b * S * I, E: b * S * I - E, I: E - I}, parameters={b: 2}))
    (('E', 'I'),)
    """
    names = (*model.states, *model.slow_states)
    alone = factor_states(model)
    terms = {name: _terms(model, name) for name in names}
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
        and _feed_one_another(model, chosen)
    )


def _terms(model: Model, name: str) -> list[frozenset[str]] | None:
    """The states that are factors of each term of a rate, None where that is not known."""
    known = {real(n): n for n in (*model.states, *model.slow_states)}
    found = []
    for region in model.regions.values():
        rate = region.rates[name]
        if sp.count_ops(rate) > LONGEST:
            return None
        for term in sp.Add.make_args(sp.expand(rate)):
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
    """All ways to make a set complete by states of the terms that have none of it."""
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


def _feed_one_another(model: Model, chosen: frozenset[str]) -> bool:
    zero = {real(name): sp.Integer(0) for name in chosen}
    for region in model.regions.values():
        for name in chosen:
            for other in chosen - {name}:
                slope = region.rates[name].diff(real(other)).subs(zero)
                if slope.has(sp.nan, sp.zoo, sp.oo, -sp.oo):
                    return False
                positive = {s: sp.Dummy(s.name, positive=True) for s in slope.free_symbols}
                if not slope.xreplace(positive).is_nonnegative:
                    return False
    return True
