"""The same orbit of a branch from another start, from another phase, or with other nodes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation import curves
from fastslow.orbits.find.orbit_curve import (
    Beginning,
    CurveSystem,
    OrbitCurve,
    Row,
    same_direction,
)
from fastslow.orbits.flow.events import OrbitError
from fastslow.orbits.flow.problem import OrbitProblem
from fastslow.orbits.flow.segments import Segments, restarted, segments_of
from fastslow.orbits.points.switching import Violation
from fastslow.results.base.outcome import Outcome

Array = NDArray[np.float64]

#: Fraction of the segment with the start of the orbit, within which events keep away from it.
NEAR_START = 0.2

#: Phase from which a cycle without events begins instead, if it touches an interface there.
OTHER_PHASE = 0.37


def early(segments: Segments, period: float, problem: OrbitProblem) -> Segments:
    """The same orbit, begun less than a period away from time 0.

    The phase of the forcing at a fixed time t changes by t for a unit of the frequency.
    """
    moved = replace(segments, start=segments.start - np.round(segments.start / period) * period)
    return moved.with_constants(problem.variations, problem.parameters)


def renewed(curve: OrbitCurve, row: Row, ahead: Beginning) -> tuple[Row, Beginning] | Outcome:
    """The orbit of a row with another start, or other nodes, and its tangent; why there is none.

    Parameters
    ----------
    curve : OrbitCurve
    row : Row
    ahead : (Shooting, ndarray, ndarray)
        The equations of the row, their unknowns and the tangent.
    """
    shooting, u, along = ahead
    here = curve.problem.at(shooting.parameters_at(u))
    segments, period = shooting.unpack(u)
    winding = shooting.winding
    slides = bool(here.variations.deficiency[segments.modes].any())
    try:
        if len(segments.without_nodes()) == 1 and not slides:
            segments = early(segments, period, here)
            ranges = row.sizes
            other, again = here.with_other_nodes(segments, period, winding, ranges)
        else:
            parts = here.variations, here.parameters
            moved = early(restarted(segments, period, winding, *parts), period, here)
            # where perturbations grow, the states of a run are a better guess than the flow
            run = row.orbit.trajectory if moved.start == segments.start else None
            other, solution = here.solve(moved, period, winding, run)
            again = solution.u
    except OrbitError as error:
        message = f"at {curve.name} = {u[-1]:.10g} {error.outcome.message}"
        return replace(error.outcome, message=message)
    frame = curve.frame(other, again, row.arrays)
    turned = curves.tangent(CurveSystem(other), again, frame)
    turned = same_direction((shooting, u, along), (other, again, turned))
    moved_row = replace(row, shooting=other, u=again, earlier=(shooting, u))
    return moved_row, (other, again, turned)


def begun_elsewhere(
    curve: OrbitCurve, row: Row, ahead: Beginning, touch: Violation
) -> tuple[Row, Beginning] | None:
    """The same cycle from another phase, if it has no events and would touch near its start."""
    shooting, u, along = ahead
    segments, period = shooting.unpack(u)
    phase = float(segments.times[touch.segment] + touch.offset - segments.start) / period
    events = len(segments.without_nodes()) > 1
    if events or shooting.forcing is not None or abs(phase - np.round(phase)) > NEAR_START:
        return None
    here = curve.problem.at(shooting.parameters_at(u))
    run = row.orbit.trajectory
    since = run.span[0] + OTHER_PHASE * period
    switches = segments.constants[0, len(here.variations.instants.symbols) :]
    again = here.run(run(since), since, since + period, switches)
    known = period, shooting.winding
    try:
        moved = segments_of(again, since, *known, here.variations, here.parameters)
        other, solution = here.solve(early(moved, period, here), *known, again)
    except OrbitError:
        return None
    frame = curve.frame(other, solution.u, row.arrays)
    turned = curves.tangent(CurveSystem(other), solution.u, frame)
    # period and parameter do not depend on the phase
    weight = frame.weight[-2:]
    same = turned[-2:] @ (weight * along[-2:]) >= 0
    moved_row = replace(row, shooting=other, u=solution.u)
    return moved_row, (other, solution.u, turned if same else -turned)
