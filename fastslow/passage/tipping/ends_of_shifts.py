"""Attractors on which runs of a shift end, over its rate and other parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from fastslow.diagrams.solve.solving import equilibria
from fastslow.model.model import Model
from fastslow.passage.tipping.shifts import Shift
from fastslow.passage.tipping.tracked_branches import SAME_EQUILIBRIUM, TrackedBranch
from fastslow.results.orbits.orbit import Orbit
from fastslow.results.points import Equilibrium
from fastslow.simulation.many import final_states
from fastslow.simulation.settings import EXECUTION, Integration, resolve
from fastslow.sweeps.survey import Survey

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

#: Index of runs that grow without bound, and of those that reach no known attractor.
UNBOUNDED, UNDECIDED_END = -1, -2

#: Size of a state, in units of the equilibria, beyond which a run is unbounded.
UNBOUNDED_SIZE = 1e6

#: Fraction of the range of a shift within which it counts as settled where runs are assigned to
#: attractors, and relaxation times after which it does at the latest.
SETTLED_SHIFT, LONGEST_SETTLING = 1e-9, 1000.0

#: Fraction of the range of a shift at which it begins, and the logarithm by which errors of the
#: start decay until then.
SHIFT_BEGINS, START_DECAY = 1e-3, 36.0

#: Fraction of the range of a shift that is rounding, and fraction of its duration by which runs
#: begin before a corner at its start.
SHIFT_ROUNDING, BEFORE_CORNER = 1e-15, 1e-3


@dataclass(frozen=True, eq=False)
class FutureSystem:
    """The frozen model at the future limit of a shift, with the attractors that runs reach.

    Parameters
    ----------
    model : Model
        Without slow quantities.
    equilibria : tuple of Equilibrium
        All that are admissible and isolated.
    integration : Integration
    known : list of Orbit or Equilibrium
        Attractors, to which others are added as runs reach them.
    chosen : Equilibrium, optional
        The only edge to consider.
    """

    model: Model
    equilibria: tuple[Equilibrium, ...]
    integration: Integration
    known: list[Orbit | Equilibrium] = field(default_factory=list)
    chosen: Equilibrium | None = None

    @classmethod
    def of(cls, model: Model, integration: Integration) -> FutureSystem:
        """The system of a model with values of all parameters and no slow quantity."""
        points = tuple(e for e in equilibria(model) if e.admissible and not e.continuum)
        stable: list[Orbit | Equilibrium] = [e for e in points if e.stable]
        return cls(model, points, integration, stable)

    @property
    def edges(self) -> tuple[Equilibrium, ...]:
        """Equilibria whose stable manifold has codimension one, or the only one considered."""
        if self.chosen is not None:
            return (self.chosen,)
        return tuple(e for e in self.equilibria if is_edge(e))

    def with_edge(self, edge: Equilibrium) -> FutureSystem:
        """Return the system with one edge alone."""
        return replace(self, chosen=edge)

    @cached_property
    def size(self) -> Array:
        """Unit of each state: the range of the equilibria."""
        states = np.array([e.state for e in self.equilibria])
        reach = np.ptp(states, axis=0) if len(states) else np.zeros(len(self.model.states))
        largest = np.abs(states).max(axis=0, initial=0.0)
        reach = np.where(reach > 0.0, reach, largest)
        most = float(reach.max(initial=0.0)) or 1.0
        return np.asarray(np.where(reach > 0.0, reach, most))

    def reached(self, states: Array, codes: Integers) -> Integers:
        """Index of the attractor that each state reaches, or why there is none."""
        largest = np.abs(states).max(axis=1)
        grown = ~(largest < UNBOUNDED_SIZE * (1.0 + float(self.size.max())))
        found = np.where(grown, UNBOUNDED, UNDECIDED_END)
        bounded = np.flatnonzero((codes == 0) & ~grown)
        if not len(bounded):
            return found
        survey = Survey(self.model, self.integration, self.size, known=self.known)
        switches = np.full((len(bounded), len(self.model.switches)), np.nan)
        assigned, ends, _ = survey.assign(np.hstack([states[bounded], switches]))
        left = np.flatnonzero(assigned < 0)
        largest = np.abs(ends[left]).max(axis=1, initial=0.0)
        finite = largest < UNBOUNDED_SIZE * (1.0 + float(self.size.max()))
        assigned[left] = UNBOUNDED
        if finite.any():
            solved = survey.assign(ends[left[finite]], solve=True)[0]
            assigned[left[finite]] = np.where(solved < 0, UNDECIDED_END, solved)
        found[bounded] = assigned
        return found

    def index_of(self, point: Equilibrium | None) -> int | None:
        """Index of a stable equilibrium among the attractors."""
        if point is None:
            return None
        for k, one in enumerate(self.known):
            if isinstance(one, Equilibrium):
                away = np.abs((one.state - point.state) / self.size)
                if float(away.max()) < SAME_EQUILIBRIUM:
                    return k
        return None

    def words(self, index: int, tracked: int | None) -> str:
        """Where a run ends."""
        if index == UNBOUNDED:
            return "tips, unbounded"
        if index == UNDECIDED_END:
            return "undecided"
        if index == tracked:
            return "tracks"
        one = self.known[index]
        where = (
            one._values() if isinstance(one, Equilibrium) else f"orbit of period {one.period:.6g}"
        )
        return f"tips to {where}"


def is_edge(point: Equilibrium) -> bool:
    """Whether the stable manifold of an equilibrium has codimension one.

    At a two-fold there is no motion with a derivative, and from an escaping region runs leave in
    finite time: what separates basins there is not reached along a stable manifold.
    """
    real = point.eigenvalues.real
    return (
        bool(np.isfinite(point.eigenvalues[real > 0]).all())
        and int((real > 0).sum()) == 1
        and not point.at_two_fold
    )


@dataclass(frozen=True, eq=False)
class ShiftRuns:
    """Runs of a model whose slow quantity shifts, from the tracked branch.

    Parameters
    ----------
    model : Model
    rate : str
    branch : TrackedBranch
    shift : Shift
        At one rate; its limits are those at all rates.
    integration : Integration
    future : FutureSystem
    """

    model: Model
    rate: str
    branch: TrackedBranch
    shift: Shift
    integration: Integration
    future: FutureSystem

    def shift_at(self, rate: float) -> Shift:
        """The shift at another rate."""
        return replace(self.shift, values={**self.shift.values, self.rate: rate})

    @cached_property
    def relaxation(self) -> float:
        """Rate at which the slowest perturbation of the start decays."""
        start = self.branch.point(self.shift.past)
        assert start is not None
        real = -start.eigenvalues.real
        return float(real[np.isfinite(real)].min(initial=np.inf))

    def begin(self, shift: Shift) -> float:
        """Time at which a run starts, where the error of its start decays before the shift."""
        if not shift.settles:
            return 0.0
        early = shift.began(SHIFT_BEGINS)
        if np.isfinite(self.relaxation):
            early -= START_DECAY / self.relaxation
        return max(early, shift.began(SHIFT_ROUNDING)) - BEFORE_CORNER * shift.duration

    def start(self, shift: Shift, time: float) -> Array:
        """State on the slowly moving branch at a time."""
        value = float(shift.at(time))
        moving = self.branch.moving(value)
        state = moving.state(value)
        if state is None:
            return np.full(len(moving.near), np.nan)
        if not shift.settles:
            return state
        return np.asarray(state + moving.late(state, value, shift.speed(time, -1)))

    def end(self, shift: Shift) -> float:
        """Time at which the shift has settled."""
        late = shift.settled(0.01) + LONGEST_SETTLING / self.relaxation
        return max(
            min(late, shift.settled(SETTLED_SHIFT)), self.begin(shift) + 1.0 / self.relaxation
        )

    def ends(self, rates: Array) -> Integers:
        """Index of the attractor that the run at each rate reaches."""
        shifts = [self.shift_at(rate) for rate in rates.tolist()]
        begins = [self.begin(one) for one in shifts]
        starts = np.array([self.start(s, t) for s, t in zip(shifts, begins, strict=True)])
        spans = np.array([(t, self.end(s)) for s, t in zip(shifts, begins, strict=True)])
        states, codes = self.final(starts, spans, {self.rate: rates})
        return self.future.reached(states, codes)

    def sampled(
        self, starts: Array, spans: Array, swept: Mapping[str, Array], times: Array
    ) -> Array:
        """States of runs at times of shape (m, k), shape (m, n, k); NaN after their end."""
        return final_states(
            self.model,
            np.ascontiguousarray(starts),
            swept,
            spans,
            resolve(self.integration, self.model, implicit=False),
            EXECUTION,
            times,
        )[2]

    def final(
        self, starts: Array, spans: Array, swept: Mapping[str, Array]
    ) -> tuple[Array, Integers]:
        """Final states and outcome codes of runs."""
        found = final_states(
            self.model,
            np.ascontiguousarray(starts),
            swept,
            spans,
            resolve(self.integration, self.model, implicit=False),
            EXECUTION,
        )
        return found[0], found[1]
