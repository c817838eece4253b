"""Attractors along stable parts of branches of equilibria and orbits."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from fastslow.diagrams.trace.tracing import continue_equilibria
from fastslow.model.model import Model
from fastslow.orbits.trace.branches import continue_orbits
from fastslow.results.base.intervals import runs_of
from fastslow.results.branch.branch import Branch
from fastslow.results.branch.diagram import Diagram
from fastslow.results.orbits.orbit import Orbit
from fastslow.results.orbits.orbit_branch import OrbitBranch
from fastslow.results.points import Equilibrium

Attractor = Orbit | Equilibrium

#: Relative difference of the periods of one orbit: one of twice the period is another attractor.
PERIOD_OF_ARC = 1e-5


@dataclass(frozen=True, eq=False)
class AttractorArc:
    """An attractor over a parameter.

    Parameters
    ----------
    first : Orbit or Equilibrium
        Where it was found.
    value : float
        The parameter there.
    branch : Branch or OrbitBranch or None
        The stable rows of its branch, with the row beyond at each end; None if it could not be
        continued, so that it is known at one value alone.
    parameter : str
    """

    first: Attractor
    value: float
    branch: Branch | OrbitBranch | None
    parameter: str

    def at(self, value: float) -> Attractor | None:
        """The attractor at a value, None where it does not exist."""
        if value == self.value:
            return self.first
        if self.branch is None:
            return None
        found = attracting_at(self.branch, self.parameter, value)
        return found[0] if found else None


def attracting_at(branch: Branch | OrbitBranch, parameter: str, value: float) -> list[Attractor]:
    """Stable members of a branch at a value, none beyond its range."""
    low, high = branch.range
    if not low <= value <= high:
        return []
    here: dict[str, Any] = {parameter: value}
    return list(branch.at(stable=True, **here))


def stable_parts(branch: Branch | OrbitBranch) -> list[Branch | OrbitBranch]:
    """The stable parts of a branch over which the parameter is monotone.

    Each has the row beyond at both ends, where stability ends between two rows.
    """
    parts = []
    for begin, end in runs_of(branch.stable):
        change = np.sign(np.diff(branch.values[begin:end]))
        turns = begin + 1 + np.flatnonzero(change[1:] * change[:-1] < 0.0)
        bounds = [max(begin - 1, 0), *turns.tolist(), min(end, len(branch) - 1)]
        parts += [branch[k : m + 1] for k, m in pairwise(bounds)]
    return parts


def arc_of(
    one: Attractor,
    model: Model,
    along: Diagram | OrbitBranch,
    value: float,
    same: Callable[[Attractor, Attractor], bool],
) -> AttractorArc:
    """Continue an attractor over the range of a branch.

    Parameters
    ----------
    one : Orbit or Equilibrium
    model : Model
        With the value of the parameter.
    along : Diagram or OrbitBranch
        Searched first; without the attractor on it, a branch is traced from the attractor.
    value : float
    same : callable
        Whether two attractors at this value are one.
    """

    def is_one(other: Attractor) -> bool:
        if isinstance(one, Orbit) and isinstance(other, Orbit):
            return abs(one.period - other.period) <= PERIOD_OF_ARC * one.period and same(one, other)
        return type(one) is type(other) and same(one, other)

    def part_with(branches: Iterable[Branch | OrbitBranch]) -> Branch | OrbitBranch | None:
        parts = (part for branch in branches for part in stable_parts(branch))
        return next((p for p in parts if any(map(is_one, attracting_at(p, name, value)))), None)

    name = along.parameter
    branches: list[Branch | OrbitBranch] = (
        [along] if isinstance(along, OrbitBranch) else list(along.branches)
    )
    known = part_with(branches)
    if known is None:
        over = range_of(along)
        if isinstance(one, Orbit):
            traced: list[Branch | OrbitBranch] = [continue_orbits(one, name, over)]
        else:
            frozen = model.frozen()
            traced = list(continue_equilibria(frozen, name, over, from_points=[one]).branches)
        known = part_with(traced)
    return AttractorArc(one, value, known, name)


def range_of(along: Diagram | OrbitBranch) -> tuple[float, float]:
    """The range of the parameter of a diagram, or of a branch of orbits."""
    return along.range if isinstance(along, OrbitBranch) else along.over
