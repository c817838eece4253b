"""Edge states: what separates the basins of two attractors, found by edge tracking."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import StateLike, instance, validated
from fastslow.diagrams.solve.solving import equilibria
from fastslow.errors import ArgumentError, FastSlowError, ModelError, refuse_switches
from fastslow.model.events import refuse_memory
from fastslow.model.model import Model
from fastslow.orbits.find.finding import find_orbit
from fastslow.passage.tipping.parting import Parting, parting_of
from fastslow.passage.tipping.tracked_branches import state_of
from fastslow.results.base.outcome import Outcome
from fastslow.results.edge_states import EdgeState
from fastslow.results.orbits.orbit import Orbit
from fastslow.results.points import Equilibrium
from fastslow.results.trajectory.trajectory import Trajectory
from fastslow.simulation.arguments import require_values
from fastslow.simulation.one import simulate
from fastslow.simulation.settings import Integration
from fastslow.sweeps.survey import Survey, extent_of

Array = NDArray[np.float64]

#: Error control of the runs.
TRACKING = Integration(rtol=1e-12)

#: Distance of two states on both sides of the boundary after bisection, and the distance from
#: which it is bisected again, in units of the ranges of both attractors.
EDGE_BISECTED, EDGE_PARTED = 1e-12, 1e-4

#: Fractions at which the segment between two states is divided.
DIVIDING = (0.5, 0.45, 0.55)

#: Rounds of tracking and bisection, and those after which an orbit is solved for.
TRACKING_ROUNDS, ROUNDS_BEFORE_ORBIT = 40, 4

#: Distance from an equilibrium, in the same units, at which the tracking ends on it.
TRACKED_TO_POINT = 2e-2

#: Distance of an orbit from the tracked states, in the same units.
NEAR_TRACK = 0.1

#: Relaxation times of the slower attractor that a round lasts at most.
LONGEST_ROUND = 100.0


@validated(model=instance(Model))
def edge_state(
    model: Model,
    a: Equilibrium | Orbit | StateLike,
    b: Equilibrium | Orbit | StateLike,
) -> EdgeState:
    """Compute the edge state between two attractors.

    A state on the segment between both is bisected by the attractor that it reaches, and a pair
    of runs on both sides is followed until they part, and bisected again (edge tracking, Skufca,
    Yorke and Eckhardt 2006). They stay on the boundary and approach its attractor, an equilibrium,
    pseudo-equilibrium or periodic orbit with one unstable direction, which is then solved for by
    Newton's method. In piecewise-smooth models the runs may part at an event instead.

    Parameters
    ----------
    model : Model
        Autonomous, or periodically forced, with all parameter values.
    a, b : Equilibrium, Orbit, mapping or sequence
        Two attractors, or states in their basins.

    Returns
    -------
    EdgeState

    Raises
    ------
    ArgumentError
        If both reach the same attractor, one reaches none, or a state between them reaches a third
        one.
    ModelError
        For a model with slow quantities that are not periodic.

    See Also
    --------
    fastslow.basins, fastslow.minimal_shock, fastslow.critical_rate

    Examples
    --------
    >>> import sympy as sp, fastslow as fs
    >>> x, v = sp.symbols("x v")
    >>> well = fs.Model({x: v, v: x - x**3 - v / 2})
    >>> fs.edge_state(well, {x: -1, v: 0}, {x: 1, v: 0})
    EdgeState(saddle at x = 0, v = 0; in S1; between x = -1, v = 0 and x = 1, v = 0)
    """
    require_values(model)
    refuse_memory(model.structure.events, model.assigned, "edge_state")
    refuse_switches(model.switches, "tracking an edge")
    if model.forcing and model.period() is None:
        raise ModelError(
            f"'{next(iter(model.forcing))}' still varies in time; expected an autonomous "
            "or periodic model, such as model.frozen() with a value"
        )
    starts = [_state(model, one, name) for one, name in ((a, "a"), (b, "b"))]
    tracking = _Tracking(model, np.array(starts))
    return tracking.result()


def _state(model: Model, given: Equilibrium | Orbit | StateLike, name: str) -> Array:
    if isinstance(given, Orbit):
        return np.asarray(given(given.t0))
    return state_of(model, given, name)


@dataclass(eq=False)
class _Tracking:
    """A pair of states on both sides of the boundary between two basins.

    Parameters
    ----------
    model : Model
    starts : ndarray, shape (2, n)
    """

    model: Model
    starts: Array

    def __post_init__(self) -> None:
        self.survey = Survey(self.model, TRACKING, extent_of(self.starts))
        reached = self._reached(self.starts, solve=True)
        for name, one in zip("ab", reached, strict=True):
            if one < 0:
                why = "; ".join(dict.fromkeys(self.survey.reasons))
                raise ArgumentError(f"{name}: its run reaches no attractor{why and f' ({why})'}")
        if reached[0] == reached[1]:
            raise ArgumentError(
                f"a and b reach the same attractor, {self.survey.known[reached[0]]!r}; expected "
                "states in two basins"
            )
        self.sides = reached
        self.track = [self.starts.mean(axis=0)]

    @property
    def attractors(self) -> tuple[Equilibrium | Orbit, Equilibrium | Orbit]:
        first, second = (self.survey.known[k] for k in self.sides)
        return first, second

    @cached_property
    def size(self) -> Array:
        """Unit of each state: its range over both attractors and starts."""
        states = [self.starts]
        for one in self.attractors:
            states.append(one.state[None] if isinstance(one, Equilibrium) else _rows(one))
        reach = np.ptp(np.vstack(states), axis=0)
        most = float(reach.max()) or 1.0
        return np.where(reach > 0.0, reach, most)

    @cached_property
    def edges(self) -> tuple[Equilibrium, ...]:
        if self.model.period() is not None:
            return ()
        known = equilibria(self.model.frozen())
        points = (e for e in known if e.admissible and not e.continuum)
        return tuple(e for e in points if int((e.eigenvalues.real > 0).sum()) == 1)

    @cached_property
    def round_time(self) -> float:
        times = [_relaxation(one) for one in self.attractors]
        return LONGEST_ROUND * max(times)

    def _reached(self, states: Array, *, solve: bool = False) -> list[int]:
        switches = np.full((len(states), len(self.model.switches)), np.nan)
        found = self.survey.assign(np.hstack([states, switches]), solve=solve)[0]
        return [int(k) for k in found]

    def bisected(self, pair: Array) -> Array:
        """The pair moved together on its segment, one state in each basin."""
        first, second = pair
        while float(np.abs((second - first) / self.size).max()) > EDGE_BISECTED:
            middle, side = self._between(first, second)
            if side < 0 or (middle == first).all() or (middle == second).all():
                break
            if side == self.sides[0]:
                first = middle
            elif side == self.sides[1]:
                second = middle
            else:
                raise ArgumentError(
                    f"a state between both reaches a third attractor, {self.survey.known[side]!r}; "
                    "expected two attractors whose basins touch"
                )
        return np.array([first, second])

    def _between(self, first: Array, second: Array) -> tuple[Array, int]:
        """A state between two, and the attractor that it reaches; on the boundary another one."""
        for share in DIVIDING:
            middle = first + share * (second - first)
            (side,) = self._reached(middle[None], solve=True)
            if side >= 0:
                break
        return middle, side

    def result(self) -> EdgeState:
        pair = self.starts
        for number in range(TRACKING_ROUNDS):
            pair = self.bisected(pair)
            middle = pair.mean(axis=0)
            self.track.append(middle)
            found = self._equilibrium(middle)
            if found is not None:
                return self._made(found.state, point=found)
            if number >= ROUNDS_BEFORE_ORBIT and number % 2 == 0:
                orbit = self._orbit(middle)
                if orbit is not None:
                    return self._made(np.asarray(orbit(orbit.t0)), orbit=orbit)
            runs = [self._run(state) for state in pair]
            parting = parting_of(self.model, runs, self.size)
            if parting is not None:
                return self._made(parting.state, parting=parting)
            pair = self._followed(runs)
        return self._made(self.track[-1])

    def _run(self, state: Array) -> Trajectory:
        return simulate(self.model, state, t=(0.0, self.round_time), integration=TRACKING)

    def _followed(self, runs: list[Trajectory]) -> Array:
        """Both states where they have parted, at a whole period of a forcing."""
        end = min(run.span[1] for run in runs)
        period = self.model.period()
        times = np.linspace(0.0, end, 2001) if period is None else np.arange(0.0, end, period)
        states = np.array([run(times).T for run in runs])
        apart = np.abs((states[1] - states[0]) / self.size).max(axis=1)
        parted = np.flatnonzero(apart > EDGE_PARTED)
        last = int(parted[0]) if len(parted) else len(times) - 1
        self.track += list(states.mean(axis=0)[: last : max(1, last // 8)])
        return states[:, last]

    def _equilibrium(self, state: Array) -> Equilibrium | None:
        away = [float(np.abs((e.state - state) / self.size).max()) for e in self.edges]
        if not away or min(away) > TRACKED_TO_POINT:
            return None
        return self.edges[int(np.argmin(away))]

    def _orbit(self, state: Array) -> Orbit | None:
        try:
            found = find_orbit(self.model, state.tolist())
        except FastSlowError:
            return None
        if not found.outcome or found.stable:
            return None
        rows = _rows(found)
        nearest = float(np.abs((rows - state) / self.size).max(axis=1).min())
        outside = int((np.abs(found.multipliers) > 1.0 + 1e-6).sum())
        return found if outside == 1 and nearest < NEAR_TRACK else None

    def _made(
        self,
        state: Array,
        point: Equilibrium | None = None,
        orbit: Orbit | None = None,
        parting: Parting | None = None,
    ) -> EdgeState:
        first, second = self.attractors
        if point is not None:
            kind, outcome = point.type, Outcome("equilibrium", "an equilibrium, solved for.", True)
        elif orbit is not None:
            kind = "orbit"
            outcome = Outcome("periodic orbit", "a periodic orbit, solved for.", True)
        elif parting is not None:
            kind = parting.type
            outcome = Outcome("event", parting.words, True)
        else:
            kind = "not settled"
            outcome = Outcome(
                "not settled",
                f"the states on the boundary have not settled within {TRACKING_ROUNDS} rounds: a "
                "chaotic or quasi-periodic edge, or a slow one; track is what was followed.",
                False,
            )
        return EdgeState(
            type=kind,
            states=(*self.model.states, *self.model.slow_states),
            state=np.asarray(state, dtype=float),
            point=point,
            orbit=orbit,
            interface="" if parting is None else parting.interface,
            between=(first, second),
            track=np.array(self.track),
            parameters=dict(self.model.parameters),
            outcome=outcome,
        )


def _rows(orbit: Orbit) -> Array:
    """States along an orbit."""
    return np.asarray(orbit(orbit.trajectory.t)).T


def _relaxation(one: Equilibrium | Orbit) -> float:
    """Time in which the slowest perturbation of an attractor decays."""
    if isinstance(one, Orbit):
        return one.period
    decay = -one.eigenvalues.real
    return 1.0 / float(decay[np.isfinite(decay)].min(initial=1e300)) or 1.0
