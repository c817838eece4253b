"""The condition of a ramp's critical rate: its run passes a folded saddle onto the other sheet."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from fastslow.model.model import Model
from fastslow.model.structure import real
from fastslow.passage.tipping.landings import EdgeLanding, Target
from fastslow.passage.tipping.moving_equilibria import MovingEquilibrium, leading_adjoint
from fastslow.passage.tipping.ramps import Ramp

Array = NDArray[np.float64]

#: Distance of a run from the repelling sheet, in units of that of the sheet from the fold, within
#: which Newton's method is applied.
NEAR_SHEET = 1.0


@dataclass(frozen=True, eq=False)
class SheetLanding(EdgeLanding):
    """The condition that a run ends on the repelling slow manifold beyond a folded saddle.

    With the fast state X of the repelling sheet over (y, w), x(T) = X + f_x⁻¹ dX/dt. The farther
    the run follows the sheet, the less is neglected. Runs that have left it are not examined.

    Parameters
    ----------
    ramp : Ramp
    names : tuple of str
    origin : MovingEquilibrium
        The stable equilibrium from which runs start, of the model with both states free.
    saddle : ndarray, shape (3,)
        A folded saddle near that of the unknowns.
    begin : float
    """

    ramp: Ramp
    names: tuple[str, ...]
    origin: MovingEquilibrium
    saddle: Array
    begin: float = 0.0

    @property
    def parameters(self) -> tuple[tuple[int, str], ...]:
        return tuple(enumerate(self.names))

    def model(self, unknowns: Array) -> Model:
        return self.ramp.model.with_parameters(self._given(unknowns))

    def _given(self, unknowns: Array) -> dict[str, float]:
        return dict(zip(self.names, unknowns.tolist(), strict=True))

    def values(self, unknowns: Array) -> dict[str, float]:
        """Values of all parameters."""
        return {**self.ramp.model.parameters, **self._given(unknowns)}

    def _moving(self, unknowns: Array) -> MovingEquilibrium:
        frozen = self.origin.frozen
        given = {n: v for n, v in self._given(unknowns).items() if n in frozen.parameters}
        return replace(self.origin, frozen=frozen.with_parameters(given)) if given else self.origin

    def start(self, unknowns: Array) -> tuple[Array, Array] | None:
        moving, values = self._moving(unknowns), self.values(unknowns)
        value = self.ramp.at(self.saddle, values).begin
        state = moving.state(value)
        if state is None:
            return None
        jacobian, by_value = moving.slopes(state, value)
        columns = []
        for name in self.names:
            changed = by_value * self._by_parameter(self.saddle, values, name)[3]
            if name in moving.frozen.parameters:
                changed = changed + moving.by_parameter(state, value, name)
            columns.append(-np.linalg.solve(jacobian, changed))
        return state, np.column_stack(columns)

    def _by_parameter(self, place: Array, values: dict[str, float], name: str) -> Array:
        return np.array(self.ramp.by_parameter(name)(*place, *values.values()), dtype=float)

    def target(self, unknowns: Array, end: float, state: Array) -> Target | None:
        values = self.values(unknowns)
        local = self.ramp.at(self.saddle, values)
        value = local.begin + local.speed * end
        sheet = self.ramp.repelling(np.array([self.saddle[0], state[1], value]), values)
        if sheet is None:
            return None
        place, from_fold = sheet
        here = self.ramp.at(place, values)
        if not abs(state[0] - place[0]) < NEAR_SHEET * abs(from_fold):
            return None
        growth, by_slow, by_value = here.slopes
        slopes = np.zeros((2, len(self.names)))
        for k, name in enumerate(self.names):
            rate, _, _, begin, speed = self._by_parameter(place, values, name)
            slopes[0, k] = -(rate + by_value * (begin + speed * end)) / growth
        adjoint = np.array([1.0, by_slow / growth])
        return Target(np.array([place[0] + here.late, state[1]]), adjoint, float(growth), slopes)

    def folded(self, unknowns: Array) -> Array | None:
        """The folded saddle at values of the unknowns, None if there is none nearby."""
        values = self.values(unknowns)
        found = self.ramp.folded(self.saddle, values)
        return found if found is not None and self.ramp.at(found, values).is_saddle else None

    def passage(self, unknowns: Array) -> tuple[float, float]:
        """Time at which w passes the folded saddle, and the rate of change of f_x there."""
        here = self.ramp.at(self.saddle, self.values(unknowns))
        names = self.ramp.names
        return (self.saddle[names.index(names[2])] - here.begin) / here.speed, -here.eigenvalues[0]

    def ends(self, unknowns: Array, growths: Sequence[float]) -> list[float]:
        """Times beyond the folded saddle at which ∫f_x dt is about that given."""
        time, bend = self.passage(unknowns)
        return [time + math.sqrt(2.0 * one / bend) for one in growths]

    def moved(self, unknowns: Array) -> SheetLanding | None:
        """Return the condition with the start and the folded saddle at other unknowns."""
        saddle, moving = self.folded(unknowns), self._moving(unknowns)
        if saddle is None:
            return None
        state = moving.state(self.ramp.at(saddle, self.values(unknowns)).begin)
        if state is None:
            return None
        return replace(self, saddle=saddle, origin=replace(self.origin, near=state))


@dataclass(frozen=True, eq=False)
class SlowFlowLanding(EdgeLanding):
    """The condition that the slow flow from the start of a ramp ends at its folded saddle.

    Parameters
    ----------
    landing : SheetLanding
        In the rate alone.
    begin : float
    """

    landing: SheetLanding
    begin: float = 0.0

    @property
    def parameters(self) -> tuple[tuple[int, str], ...]:
        return self.landing.parameters

    @cached_property
    def _flow(self) -> Model:
        ramp = self.landing.ramp
        rates = dict(zip(map(real, ramp.names), ramp.desingularised, strict=True))
        return Model(rates, parameters=dict(ramp.model.parameters))

    def model(self, unknowns: Array) -> Model:
        return self._flow.with_parameters(self.landing.values(unknowns))

    def start(self, unknowns: Array) -> tuple[Array, Array] | None:
        begun = self.landing.start(unknowns)
        if begun is None:
            return None
        state, slopes = begun
        begin = self.landing.ramp.at(self.landing.saddle, self.landing.values(unknowns)).begin
        return np.append(state, begin), np.vstack([slopes, np.zeros(len(unknowns))])

    def target(self, unknowns: Array, end: float, state: Array) -> Target | None:
        landing, values = self.landing, self.landing.values(unknowns)
        saddle = landing.folded(unknowns)
        if saddle is None:
            return None
        growth, adjoint = leading_adjoint(landing.ramp.at(saddle, values).matrix)
        slopes = [landing.ramp.folded_slopes(saddle, values, name) for name in landing.names]
        return Target(saddle, adjoint, growth, np.column_stack(slopes))
