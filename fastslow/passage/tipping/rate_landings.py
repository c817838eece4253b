"""The condition of a critical rate: the run of a shift lands on the edge of the future."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fastslow.model.model import Model
from fastslow.passage.tipping.ends_of_shifts import ShiftRuns
from fastslow.passage.tipping.landings import EdgeLanding, Target
from fastslow.passage.tipping.moving_equilibria import MovingEquilibrium
from fastslow.passage.tipping.shifts import Shift

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class RateLanding(EdgeLanding):
    """The condition in the rate of a shift, and in another parameter of shift or rates.

    The edge moves with the slow quantity, and is computed to first order in its rate of change.

    Parameters
    ----------
    runs : ShiftRuns
    edge : MovingEquilibrium
    names : tuple of str
        The unknowns.
    begin : float
        Time at which runs begin.
    """

    runs: ShiftRuns
    edge: MovingEquilibrium
    names: tuple[str, ...]
    begin: float

    @property
    def parameters(self) -> tuple[tuple[int, str], ...]:
        return tuple(enumerate(self.names))

    def model(self, unknowns: Array) -> Model:
        return self.runs.model.with_parameters(self._given(unknowns))

    def start(self, unknowns: Array) -> tuple[Array, Array] | None:
        shift, frozen = self._at(unknowns)
        value = float(shift.at(self.begin))
        moving = self.runs.branch.moving(value, frozen)
        resting = moving.state(value)
        if resting is None:
            return None
        slopes = [moving.by(shift, resting, self.begin, name, -1) for name in self.names]
        return self.runs.start(shift, self.begin, frozen), np.column_stack(slopes)

    def target(self, unknowns: Array, end: float) -> Target | None:
        shift, frozen = self._at(unknowns)
        edge, value = replace(self.edge, frozen=frozen), float(shift.at(end))
        state = edge.state(value)
        if state is None:
            return None
        growth, adjoint = edge.adjoint(state, value)
        slopes = [edge.by(shift, state, end, name, 1) for name in self.names]
        late = edge.late(state, value, shift.speed(end, 1))
        return Target(state + late, adjoint, growth, np.column_stack(slopes))

    def _given(self, unknowns: Array) -> dict[str, float]:
        return dict(zip(self.names, unknowns.tolist(), strict=True))

    def _at(self, unknowns: Array) -> tuple[Shift, Model]:
        """The shift, and the frozen model."""
        given, shift = self._given(unknowns), self.runs.shift
        frozen = self.edge.frozen
        shared = {n: v for n, v in given.items() if n in frozen.parameters}
        values = {**shift.values, **given}
        return replace(shift, values=values), frozen.with_parameters(shared) if shared else frozen
