"""Models in every state of their switches, and equilibria of all of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import Any

import sympy as sp

from fastslow.model.model import Model
from fastslow.model.resets import Reset
from fastslow.model.structure import real
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.results.branch.branch import Branch
from fastslow.results.branch.diagram import Diagram
from fastslow.results.branch.equilibrium_sets import Equilibria
from fastslow.results.points import SpecialPoints
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


def joined_equilibria(parts: Sequence[Equilibria]) -> Equilibria:
    """Return the equilibria of all switch states as one list."""
    known = all(part.completeness == "complete" for part in parts)
    return Equilibria(
        [one for part in parts for one in part],
        "complete" if known else "found",
        [one for part in parts for one in part.sets],
    )


def joined_diagram(model: Model, parts: Sequence[Diagram]) -> Diagram:
    """Return the diagrams of all switch states as one, with unique labels of special points."""
    first = parts[0]
    failed = [part.outcome for part in parts if not part.outcome]
    windows = [part.window for part in parts if part.window is not None]
    window = None
    if windows:
        lower, upper = (
            tuple(zip(*ends, strict=True))
            for ends in zip(*((w.lower, w.upper) for w in windows), strict=True)
        )
        window = replace(windows[0], lower=tuple(map(min, lower)), upper=tuple(map(max, upper)))
    return replace(
        first,
        parameters=dict(first.parameters),
        branches=tuple(_relabelled(parts)),
        completeness="complete" if all(p.completeness == "complete" for p in parts) else "found",
        interfaces=tuple(dict.fromkeys(name for part in parts for name in part.interfaces)),
        regions=tuple(dict.fromkeys(name for part in parts for name in part.regions)),
        interface_values=_merged([part.interface_values for part in parts]),
        equations=model.equations,
        corrector=None,
        outcome=failed[0] if failed else first.outcome,
        window=window,
        bands=tuple(band for part in parts for band in part.bands),
        model=model,
    )


def _merged(mappings: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    return {name: value for one in mappings for name, value in one.items()}


def _relabelled(parts: Sequence[Diagram]) -> Iterator[Branch]:
    """Yield the branches of all diagrams; labels LP1, LP2, … continue from one to the next."""
    counts: dict[str, int] = {}
    for part in parts:
        labels: dict[str, str] = {}
        for branch in part.branches:
            points = []
            for point in branch.special:
                if point.label not in labels:
                    counts[point.code] = counts.get(point.code, 0) + 1
                    labels[point.label] = f"{point.code}{counts[point.code]}"
                points.append(replace(point, label=labels[point.label]))
            yield replace(branch, special=SpecialPoints(points))
