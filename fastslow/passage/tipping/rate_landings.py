"""The condition of a critical rate: the run of a shift lands on the edge of the future."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fastslow.model.model import Model
from fastslow.passage.tipping.ends_of_shifts import ShiftRuns
from fastslow.passage.tipping.landings import EdgeLanding, Target
from fastslow.passage.tipping.moving_equilibria import MovingEquilibrium
from fastslow.passage.tipping.shifts import Shift, shift_of

Array = NDArray[np.float64]

#: Fractions of the range of a shift within which it has settled at the first length of a run, and
#: the times of the growth of the edge that are added.
SETTLED_AT_FIRST, GROWTHS_AT_FIRST = (1e-2, 1e-3, 1e-9), 0.5


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
    origin : MovingEquilibrium, optional
        The stable equilibrium, by default that of the branch of the runs.
    """

    runs: ShiftRuns
    edge: MovingEquilibrium
    names: tuple[str, ...]
    begin: float
    origin: MovingEquilibrium | None = None

    @property
    def parameters(self) -> tuple[tuple[int, str], ...]:
        return tuple(enumerate(self.names))

    def model(self, unknowns: Array) -> Model:
        return self.runs.model.with_parameters(self._given(unknowns))

    def start(self, unknowns: Array) -> tuple[Array, Array] | None:
        shift, frozen = self._at(unknowns)
        value = float(shift.at(self.begin))
        moving = self._resting(value, frozen)
        resting = moving.state(value)
        if resting is None:
            return None
        slopes = [moving.by(shift, resting, self.begin, name, -1) for name in self.names]
        late = moving.late(resting, value, shift.speed(self.begin, -1)) if shift.settles else 0.0
        return resting + late, np.column_stack(slopes)

    def _resting(self, value: float, frozen: Model) -> MovingEquilibrium:
        """The stable equilibrium from which runs begin."""
        if self.origin is None:
            return self.runs.branch.moving(value, frozen)
        return replace(self.origin, frozen=frozen)

    def moved(self, unknowns: Array) -> RateLanding | None:
        """Return the condition with both equilibria and the beginning of runs at other unknowns."""
        shift, frozen = self._settling(unknowns), self._at(unknowns)[1]
        begin = self.runs.begin(shift)
        value = float(shift.at(begin))
        moving, edge = self._resting(value, frozen), replace(self.edge, frozen=frozen)
        resting, end = moving.state(value), edge.state(shift.future)
        if resting is None or end is None:
            return None
        origin = replace(moving, frozen=self.edge.frozen, near=resting)
        return replace(self, begin=begin, origin=origin, edge=replace(self.edge, near=end))

    def first_ends(self, unknowns: Array) -> list[float]:
        """Ends of runs at which to begin, the shortest first."""
        shift, frozen = self._settling(unknowns), self._at(unknowns)[1]
        edge, state = replace(self.edge, frozen=frozen), self.edge_at(unknowns)
        if state is None:
            return []
        growth, _ = edge.adjoint(state, shift.future)
        if not growth > 0.0:
            return []
        more = GROWTHS_AT_FIRST / growth
        return [shift.settled(one) + more for one in SETTLED_AT_FIRST]

    def edge_at(self, unknowns: Array) -> Array | None:
        """The edge at the future limit of the shift."""
        shift, frozen = self._settling(unknowns), self._at(unknowns)[1]
        return replace(self.edge, frozen=frozen).state(shift.future)

    def _settling(self, unknowns: Array) -> Shift:
        """The shift with its limits at the other parameter."""
        model = self.model(unknowns)
        return shift_of(model, self.runs.rate, model.parameters[self.runs.rate])

    def target(self, unknowns: Array, end: float, state: Array) -> Target | None:
        shift, frozen = self._at(unknowns)
        edge, value = replace(self.edge, frozen=frozen), float(shift.at(end))
        point = edge.state(value)
        if point is None:
            return None
        growth, adjoint = edge.adjoint(point, value)
        slopes = [edge.by(shift, point, end, name, 1) for name in self.names]
        late = edge.late(point, value, shift.speed(end, 1))
        return Target(point + late, adjoint, growth, np.column_stack(slopes))

    def _given(self, unknowns: Array) -> dict[str, float]:
        return dict(zip(self.names, unknowns.tolist(), strict=True))

    def _at(self, unknowns: Array) -> tuple[Shift, Model]:
        """The shift, and the frozen model."""
        given, shift = self._given(unknowns), self.runs.shift
        frozen = self.edge.frozen
        shared = {n: v for n, v in given.items() if n in frozen.parameters}
        if len(self.names) > 1:
            # the limits of the shift may depend on the other parameter
            shift = self._settling(unknowns)
        shift = replace(shift, values={**shift.values, **given})
        return shift, frozen.with_parameters(shared) if shared else frozen
