"""A model in every state of its switches."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import sympy as sp

from fastslow.model.model import Model
from fastslow.model.resets import Reset
from fastslow.model.structure import real
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.results.stored.switch_state_names import in_state, threshold


def switch_states(model: Model) -> Iterator[Model]:
    """Yield the model with its switches in every combination of states.

    Regions are named with the states, such as ``"S1 (q = 0)"``. The thresholds at which a switch
    changes are walls without contact: an equilibrium beyond is virtual, and a branch ends there.

    Examples
    --------
    >>> x, w, q = sp.symbols("x w q")
    >>> relay = Model({x: w - x - q}, parameters={w: 0}, switches={q: (x > 1, x < 0)})
    >>> for one in switch_states(relay):
    ...     print(list(one.regions), list(one.resets))
    ['S1 (q = 0)'] ['x > 1 (q → 1)']
    ['S1 (q = 1)'] ['x < 0 (q → 0)']
    """
    for values in product((0, 1), repeat=len(model.switches)):
        state = dict(zip(model.switches, values, strict=True))
        numbers = {real(name): sp.Integer(value) for name, value in state.items()}
        fixed = model.with_switches(state)
        structure = fixed.structure
        thresholds = []
        for switch in model.switches.values():
            value = state[switch.name]
            function = switch.watched(value).xreplace(numbers)
            if function.free_symbols:
                name = threshold(switch.relations[value], switch.name, 1 - value)
                thresholds.append(Reset(name, function, NamedMapping("state", {})))
        named = {name: in_state(name, state) for _, name in structure.names}
        conditions = {in_state(n, state): c for n, c in structure.conditions.items()}
        changed = replace(
            structure,
            names=tuple((cell, named[name]) for cell, name in structure.names),
            conditions=NamedMapping("region", conditions),
            resets=(*structure.resets, *thresholds),
        )
        yield Model._from(changed, fixed.parameters)
