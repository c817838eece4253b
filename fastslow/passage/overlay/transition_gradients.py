"""Derivatives of the transitions of an overlay: variational columns and moving special points."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from fastslow.arguments import Name, position, refusal
from fastslow.errors import ArgumentError, ModelError
from fastslow.model.model import Model
from fastslow.model.structure import TIME, real
from fastslow.orbits.derivatives.run_sensitivities import TANGENTIAL_SPEED, Path, path_through
from fastslow.passage.slow_quantities import slow_quantity
from fastslow.results.angles import apart
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.results.overlay.overlay import Overlay
from fastslow.results.overlay.transitions import Transition
from fastslow.results.points import SpecialPoint
from fastslow.results.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]

#: Difference of two times of one event, relative to the length of the run.
SAME_EVENT = 1e-12

#: Largest distance, in units of the radius of the overlay, of the equilibrium that is left.
FARTHEST_LEFT = 2.0


def gradient_of_transition(
    overlay: Overlay, transition: int | Transition, name: Name
) -> NamedMapping[float]:
    """Compute the derivatives of a transition; see `Overlay.gradient`."""
    t = transition
    if not isinstance(t, Transition):
        if isinstance(t, bool) or not isinstance(t, int | np.integer):
            raise refusal("transition", t, "a Transition of this overlay, or its index")
        t = overlay.transitions[position(t, len(overlay.transitions), "transition")]
    elif not any(t is other for other in overlay.transitions):
        raise ArgumentError("the transition is not one of this overlay")
    if overlay.diagram.corrector is None:
        raise ModelError(
            "the diagram of this overlay has no model (it was read from a file); compute it again"
        )
    return _Passed(overlay, t, str(name)).found()


@dataclass(frozen=True, eq=False)
class _Passed:
    """A transition and the derivatives of its run by one parameter or initial state.

    Parameters
    ----------
    overlay : Overlay
    t : Transition
    name : str
    """

    overlay: Overlay
    t: Transition
    name: str

    def found(self) -> NamedMapping[float]:
        t, law = self.t, self.t.law
        if t.type == "end of oscillation":
            raise ArgumentError(
                "the derivative of the end of an oscillation, its last maximum, is not computed; "
                "expected a departure from a stable branch"
            )
        if law is not None and law.lost:
            raise ArgumentError(f"the exit has no derivative: {law.lost}")
        time, value = self._turn() if t.turned else self._moved(t.time, self._event())
        found = {"time": time, "value": value}
        if math.isfinite(t.delay) and isinstance(t.special, SpecialPoint):
            found["delay"] = self._outward * (value - self._of_point(t.special))
        if t.type == "gap crossing" and t.land is not None:
            one, other = (self._moved(s.time, self._crossing(s.time)) for s in (t.leave, t.land))
            found["duration"] = other[0] - one[0]
            sign = math.copysign(1.0, t.land.value - t.leave.value)
            found["width"] = sign * (other[1] - one[1])
        return NamedMapping("quantity", found)

    @property
    def run(self) -> Trajectory:
        return self.overlay.run

    @property
    def own(self) -> str:
        return self.overlay.diagram.parameter

    @cached_property
    def path(self) -> Path:
        t = self.t
        ends = [t.time, t.leave.time, *([] if t.land is None else [t.land.time])]
        return path_through(self.run, [self.name], np.array(ends))

    def _row(self, time: float) -> int:
        """Row of a time at which the run has derivatives."""
        row = int(np.argmin(np.abs(self.path.times - time)))
        if np.isnan(self.path.values[row]).any():
            raise ArgumentError(f"the transition has no derivative: {self.path.outcome}")
        return row

    def _moved(self, time: float, shift: float) -> tuple[float, float]:
        """Derivatives of the time of an event and of the slow quantity at it."""
        by, rate, _ = self._slow(time)
        return shift, by + rate * shift

    @property
    def _outward(self) -> float:
        """+1 if the delay is a distance above the special point, −1 below."""
        assert self.t.special is not None
        past = self.t.value - self.t.special[self.own]
        return math.copysign(1.0, past if self.t.delay != 0.0 else self._slow(self.t.time)[1])

    def _of_point(self, point: SpecialPoint) -> float:
        return point.gradient(self.name)[self.own] if self._in_diagram else 0.0

    @property
    def _in_diagram(self) -> bool:
        """Whether the frozen model depends on the name, a parameter."""
        return self.name in self.overlay.diagram.parameters

    def _slow(self, time: float) -> tuple[float, float, Array]:
        """Derivative of the slow quantity at a time, its rate, and the change of both in time."""
        if slow_quantity(self.overlay.diagram, self.run).laws:
            raise ArgumentError(
                f"{self.own} is the parameter of a path of several slow quantities: its "
                "derivatives are not computed"
            )
        row, names = self._row(time), self.run.states
        if self.own in names:
            k = names.index(self.own)
            values, rates = self.path.values[row, :, 0], self.path.rates[row]
            law = self._model.rates[self.own]
            return float(values[k]), float(rates[k]), self._change(law, row, values, rates)
        law = self._model.forcing[self.own]
        none = np.zeros(len(names))
        by = self._number(law.diff(self._symbol), row) if self._by_parameter else 0.0
        rate = law.diff(TIME)
        return by, self._number(rate, row), self._change(rate, row, none, none)

    def _change(self, law: sp.Expr, row: int, values: Array, rates: Array) -> Array:
        """Derivatives of a rate by the name and by time, along the run."""
        states = [real(n) for n in self.run.states]
        slopes = np.array([self._number(law.diff(s), row) for s in states])
        by = self._number(law.diff(self._symbol), row) if self._by_parameter else 0.0
        later = self._number(law.diff(TIME), row)
        return np.array([by + slopes @ values, later + slopes @ rates])

    @property
    def _model(self) -> Model:
        model: Model = self.run.symbolic_model
        return model

    @property
    def _symbol(self) -> sp.Symbol:
        return real(self.name)

    @property
    def _by_parameter(self) -> bool:
        return self.name not in self.run.states

    def _number(self, expression: sp.Expr, row: int) -> float:
        """Value of an expression at a time of the run."""
        model = self._model
        laws = {real(n): law for n, law in model.forcing.items()}
        state = zip(self.run.states, self.path.states[row].tolist(), strict=True)
        at = {**{real(n): v for n, v in state}, TIME: float(self.path.times[row])}
        return float(expression.xreplace(laws).subs({**model.values, **at}))

    def _turn(self) -> tuple[float, float]:
        """At an extremum of the slow quantity its own change in time drops out."""
        by, _, (changed, later) = self._slow(self.t.time)
        if later == 0.0:
            raise ArgumentError("the slow quantity is constant at its extremum: no derivative")
        return -float(changed / later), by

    def _event(self) -> float:
        """Derivative of the time of the transition."""
        t = self.t
        length = self.run.span[1] - self.run.span[0]
        if (
            np.abs(self.run.crossing_table[:, 0] - t.time).min(initial=np.inf)
            <= SAME_EVENT * length
        ):
            return self._crossing(t.time)
        if t.time == t.leave.time:
            return self._departure()
        way = (t.state - t.leave.state) / self.overlay.extent
        number = int(np.argmax(np.abs(way)))
        slope = np.zeros(len(self.overlay.diagram.states))
        slope[number] = 1.0
        return self._reached(slope, 0.0, 0.0)

    def _crossing(self, time: float) -> float:
        """Derivative of the time of a crossing of an interface."""
        self._row(time)
        row = int(np.argmin(np.abs(self.run.crossing_table[:, 0] - time)))
        shift = float(self.path.crossing_times[row, 0])
        if math.isnan(shift):
            raise ArgumentError(f"the transition has no derivative: {self.path.outcome}")
        return shift

    def _departure(self) -> float:
        """Derivative of the time at which the distance from a branch has its present value.

        Past the end of the branch it is that from the special point.
        """
        t, extent = self.t, self.overlay.extent
        names, periods = self.overlay.diagram.states, self.run.periods
        turns = np.array([periods.get(n, 0.0) for n in names]) / extent

        def away(state: Array) -> Array:
            return apart(t.state / extent, state / extent, turns)

        here: dict[str, Any] = {self.own: t.value}
        near = self.overlay.diagram.at(**here)
        if t.special is not None:
            near.append(t.special)
        nearest = min(near, key=lambda e: float(np.linalg.norm(away(e.state))), default=None)
        if (
            nearest is None
            or np.linalg.norm(away(nearest.state)) > FARTHEST_LEFT * self.overlay.radius
        ):
            raise ArgumentError(
                "no equilibrium is near the departure, from which its distance is measured: the "
                "derivative is not computed"
            )

        def moved(name: str) -> Array:
            found = nearest.gradient(name)
            return np.array([found[n] for n in names])

        slope, none = away(nearest.state) / extent, np.zeros(len(names))
        by_name = moved(self.name) if self._in_diagram else none
        by_slow = none if nearest is t.special else moved(self.own)
        return self._reached(slope, -float(slope @ by_name), -float(slope @ by_slow))

    def _reached(self, slope: Array, by: float, by_slow: float) -> float:
        """Derivative of the time at which a function of the fast states and w has its value.

        ``slope``, ``by`` and ``by_slow`` are its derivatives by the states, the name and w.
        """
        row = self._row(self.t.time)
        places = [self.run.states.index(n) for n in self.overlay.diagram.states]
        values, rates = self.path.values[row, places, 0], self.path.rates[row, places]
        by_name, drift, _ = self._slow(self.t.time)
        speed = slope @ rates + by_slow * drift
        size = np.abs(slope) @ np.abs(rates) + abs(by_slow * drift)
        if abs(speed) <= TANGENTIAL_SPEED * size:
            raise ArgumentError(
                "the transition has no derivative: its level is touched tangentially"
            )
        return -float((slope @ values + by + by_slow * by_name) / speed)
