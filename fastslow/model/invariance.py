"""States that stay zero once they are: the rates that have them as a factor."""

from __future__ import annotations

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
