"""Curves of critical rates over another parameter."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation.curves import (
    CLOSED,
    FULL,
    RANGE,
    ExactSystem,
    Frame,
    follow,
    tangent,
)
from fastslow.continuation.endings import (
    CLOSED_LOOP,
    END_OF_RANGE,
    STEP_TOO_SMALL,
    TOO_MANY_POINTS,
)
from fastslow.continuation.settings import Continuation
from fastslow.errors import ArgumentError, unknown_name
from fastslow.passage.tipping.landings import FINE, Constraint, Landed, landed, residual
from fastslow.passage.tipping.parting import event_of_one
from fastslow.passage.tipping.rate_landings import RateLanding
from fastslow.results.base.intervals import runs_of
from fastslow.results.base.outcome import Outcome
from fastslow.results.threshold_curves import ThresholdCurve
from fastslow.results.tipping import RateThreshold
from fastslow.simulation.one import simulate

if TYPE_CHECKING:
    from fastslow.diagrams.curves.point_curves import Plane

Array = NDArray[np.float64]

#: Distance of a point of the curve from its prediction, in units of the step, beyond which it is on
#: another curve.
OTHER_CURVE = 0.5

#: Times of the last solutions at which the next one is tried: one of them may not have been used.
KEPT_ENTRIES = 2

#: Distance from a prediction, in units of the largest step, up to which Newton's method may go.
NEWTON_REACH = 2.0

#: Distance from the edge, in units of the range of equilibria, within which the first runs end: the
#: condition is nearly linear there.
LANDING_BEGINS = 0.03

#: Distance beyond the end of a curve, along its tangent, at which the events of runs are compared,
#: and the same in units of the least step.
BEYOND_CURVE, BEYOND_STEPS = 1e-4, 10.0

#: Steps of Newton's method that count as one in the control of steps along the curve: they are
#: taken to rounding.
ROUNDING_STEPS = 2


@dataclass(eq=False)
class RateCurve(ExactSystem):
    """The condition of a critical rate in the rate and another parameter.

    The equilibria at both ends are continued from one point of the curve to the next.

    Parameters
    ----------
    landing : RateLanding
        In both unknowns.
    scale : ndarray, shape (2,)
    """

    landing: RateLanding
    scale: Array

    def __post_init__(self) -> None:
        self.ends: dict[bytes, Landed] = {}
        self.entry: list[float] = []

    def residual(self, z: Array, guide: Array) -> Array:
        found = self._at(z)
        return np.array([np.nan if found is None else found.residual.value])

    def slopes(self, z: Array, guide: Array) -> Array:
        found = self._at(z)
        if found is None:
            return np.full((1, 2), np.nan)
        return np.asarray(found.residual.slopes[None])

    def _at(self, z: Array) -> Landed | None:
        """What is known of a point of the curve."""
        return self.ends.get(z.tobytes())

    def solved(
        self, guess: Array, direction: Array, frame: Frame, continuation: Continuation
    ) -> tuple[Array, int, Array] | None:
        try:
            return self._landed_near(guess, direction, frame, continuation)
        except ArgumentError:
            # the shift does not settle at such values
            return None

    def _landed_near(
        self, guess: Array, direction: Array, frame: Frame, continuation: Continuation
    ) -> tuple[Array, int, Array] | None:
        reach = NEWTON_REACH * continuation.max_step * self.scale
        normal = (direction * frame.weight)[None]
        constraint = Constraint(normal, guess, self.scale, guess - reach, guess + reach)
        landing = self.landing.moved(guess)
        if landing is None:
            return None
        furthest = OTHER_CURVE * continuation.max_step
        for time in (*self.entry, *landing.first_ends(guess)):
            found = landed(landing, guess, time, constraint)
            # a run of another length may land after a passage more or less of the edge
            if found is not None and _apart(found.unknowns, guess, frame) <= furthest:
                return self.kept(landing, found, frame)
        return None

    def obstacle(self, z: Array, along: Array, distance: float) -> str:
        """Why the curve ends at a point: the event that its run has, and not the one beyond."""
        runs = []
        for point in (z, z + distance * along):
            known, begun = self._at(z), self.landing.start(point)
            if known is not None and begun is not None:
                span = self.landing.begin, known.end
                runs.append(simulate(self.landing.model(point), begun[0], t=span, integration=FINE))
        lacking = event_of_one(self.landing.model(z), runs) if len(runs) == 2 else ""
        if lacking:
            return f"runs beyond differ by {lacking}, which is grazed here"
        return "no run nearby lands on the edge"

    def kept(self, landing: RateLanding, found: Landed, frame: Frame) -> tuple[Array, int, Array]:
        z = found.unknowns
        self.ends[z.tobytes()] = found
        self.landing = landing.moved(z) or landing
        self.entry = [*_entry(landing, found), *self.entry][:KEPT_ENTRIES]
        return z, found.steps // ROUNDING_STEPS, tangent(self, z, frame)


def _apart(z: Array, guess: Array, frame: Frame) -> float:
    return float(np.sqrt((z - guess) ** 2 @ frame.weight))


def _entry(landing: RateLanding, found: Landed) -> list[float]:
    """Time at which a run that lands comes near the edge for longest, none if it does not."""
    run, edge = found.residual.run, landing.edge_at(found.unknowns)
    if edge is None:
        return []
    states = run(run.t)[: len(edge)].T
    near = np.abs((states - edge) / landing.runs.future.size).max(axis=1) < LANDING_BEGINS
    stays = [(float(run.t[end - 1] - run.t[k]), float(run.t[k])) for k, end in runs_of(near)]
    return [max(stays)[1]] if stays else []


def curve_of_rates(threshold: RateThreshold, plane: Plane) -> ThresholdCurve:
    """Trace the curve of a critical rate in the plane of its rate and another parameter."""
    own = threshold.parameter
    for name in plane.names:
        if name not in threshold.parameters:
            raise unknown_name("parameter", name, threshold.parameters)
    if own not in plane.names:
        raise ArgumentError(f"plane = {plane.names!r}; expected the rate {own} among them")
    if threshold.canard is not None:
        raise ArgumentError(
            "this critical rate has no curve, as it is that of a canard: runs nearby leave the "
            "repelling sheet; compute critical rates at several values of the other parameter"
        )
    if threshold.source is None or threshold.method != "Newton":
        raise ArgumentError(
            "this critical rate has no curve: it was located by bisection, or read from a file or "
            "another process"
        )
    known, found = threshold.source
    z = np.array([threshold.parameters[name] for name in plane.names])
    if np.any(z < plane.lower) or np.any(z > plane.upper):
        at = ", ".join(f"{n} = {v:g}" for n, v in zip(plane.names, z, strict=True))
        raise ArgumentError(f"the critical rate at {at} is outside over={plane.ranges}")
    landing = replace(known, names=plane.names)
    here = residual(landing, z, found.end)
    if here is None or not np.isfinite(here.slopes).all():
        reason = "the run fails" if here is None else here.reason
        raise ArgumentError(f"the critical rate has no curve: {reason}")
    scale = plane.upper - plane.lower
    frame = Frame(2, scale, plane.lower, plane.upper)
    system = RateCurve(landing, scale)
    start = replace(found, unknowns=z, residual=here)
    z, _, along = system.kept(landing, start, frame)
    outcomes, traces = [], []
    for side in (-1.0, 1.0):
        traced = RateCurve(landing.moved(z) or landing, scale)
        traced.ends.update(system.ends)
        traced.entry = system.entry
        trace, ways, status = follow(
            traced, z, side * along, frame, plane.continuation, aside=OTHER_CURVE, corners=True
        )
        traces.append((trace, ways))
        outcomes.append(_outcome(status, traced, trace, ways, plane))
    (back, before), (ahead, after) = traces
    rows = np.vstack([back[::-1], ahead[1:]])
    return ThresholdCurve(
        parameter_names=plane.names,
        values=rows,
        tangent=np.vstack([-before[::-1], after[1:]]),
        parameters=dict(threshold.parameters),
        outcomes=(outcomes[0], outcomes[1]),
    )


def _outcome(status: str, curve: RateCurve, rows: Array, tangents: Array, plane: Plane) -> Outcome:
    at = ", ".join(f"{n} = {v:.6g}" for n, v in zip(plane.names, rows[-1], strict=True))
    if status == RANGE:
        return END_OF_RANGE.at(where=at)
    if status == CLOSED:
        return CLOSED_LOOP.at(curve="curve")
    if status == FULL:
        return TOO_MANY_POINTS.at(curve="curve", count=len(rows), where=at)
    least = plane.continuation.min_step
    why = curve.obstacle(rows[-1], tangents[-1], max(BEYOND_CURVE, BEYOND_STEPS * least))
    return STEP_TOO_SMALL.at(where=at, step=least, why=why)
