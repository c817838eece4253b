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
from fastslow.passage.tipping.landings import Constraint, Landed, landed, residual
from fastslow.passage.tipping.rate_landings import RateLanding
from fastslow.results.base.outcome import Outcome
from fastslow.results.threshold_curves import ThresholdCurve
from fastslow.results.tipping import RateThreshold

if TYPE_CHECKING:
    from fastslow.diagrams.curves.point_curves import Plane

Array = NDArray[np.float64]

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
        constraint = Constraint(
            (direction * frame.weight)[None],
            guess,
            self.scale,
            np.full(2, -np.inf),
            np.full(2, np.inf),
        )
        landing = self.landing.moved(guess)
        if landing is None:
            return None
        for time in landing.first_ends(guess):
            found = landed(landing, guess, time, constraint)
            if found is not None:
                return self.kept(landing, found, frame)
        return None

    def kept(self, landing: RateLanding, found: Landed, frame: Frame) -> tuple[Array, int, Array]:
        z = found.unknowns
        self.ends[z.tobytes()] = found
        self.landing = landing.moved(z) or landing
        return z, found.steps // ROUNDING_STEPS, tangent(self, z, frame)


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
    traces = []
    for side in (-1.0, 1.0):
        traced = RateCurve(landing.moved(z) or landing, scale)
        traced.ends.update(system.ends)
        traces.append(follow(traced, z, side * along, frame, plane.continuation))
    (back, before, first), (ahead, after, last) = traces
    rows = np.vstack([back[::-1], ahead[1:]])
    return ThresholdCurve(
        parameter_names=plane.names,
        values=rows,
        tangent=np.vstack([-before[::-1], after[1:]]),
        parameters=dict(threshold.parameters),
        outcomes=(_outcome(first, back, plane), _outcome(last, ahead, plane)),
    )


def _outcome(status: str, rows: Array, plane: Plane) -> Outcome:
    at = ", ".join(f"{n} = {v:.6g}" for n, v in zip(plane.names, rows[-1], strict=True))
    if status == RANGE:
        return END_OF_RANGE.at(where=at)
    if status == CLOSED:
        return CLOSED_LOOP.at(curve="curve")
    if status == FULL:
        return TOO_MANY_POINTS.at(curve="curve", count=len(rows), where=at)
    least, why = plane.continuation.min_step, "no run nearby lands on the edge"
    return STEP_TOO_SMALL.at(where=at, step=least, why=why)
