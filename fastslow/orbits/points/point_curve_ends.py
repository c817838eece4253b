"""Ends of curves of special points of periodic orbits: contacts and resonances."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation import curves
from fastslow.continuation.curve_points import CurvePoint, search, solved_from
from fastslow.diagrams.curves.point_curves import Plane
from fastslow.orbits.flow.segments import EVENT_MARGIN
from fastslow.orbits.points.codimension_two import DEGENERATE_CONTACT, OrbitCodimensionTwo
from fastslow.orbits.points.contacts import near_touches
from fastslow.orbits.points.curve_tests import Start
from fastslow.orbits.points.kinds import DOUBLING, FOLD
from fastslow.orbits.points.point_equations import PointEquations, equations_of
from fastslow.orbits.points.switching import approach_speeds, joined_with_next, without_segment

Array = NDArray[np.float64]

#: Distance beyond an interface, as a fraction of the range of its function, that is rounding.
INTERFACE_ROUNDING = 1e-7


@dataclass(frozen=True, eq=False)
class CurveEnd:
    """A row after which a curve ends.

    Parameters
    ----------
    kind : str
        ``"vanishing"``, ``"touch"``, ``"speed"``, ``"resonance"`` or ``"unfolded"``.
    segment : int
    offset : float
    function : int
    """

    kind: str
    segment: int = -1
    offset: float = 0.0
    function: int = -1


def end_at(start: Start, z: Array) -> CurveEnd | bool | None:
    """What ends a curve at a row; None to begin a new stretch, False to continue."""
    u = z[: start.width]
    if start.kind.leaves(z):
        return CurveEnd(start.kind.end)
    segments, _ = start.shooting.unpack(u)
    inner = segments.durations[1:-1]
    # the segments at the start are two parts of one
    whole = segments.durations[0] + segments.durations[-1] if len(segments) > 1 else 1.0
    if whole <= 0 or inner.min(initial=1.0) <= 0:
        return CurveEnd("vanishing", int(np.argmin(inner)) + 1 if whole > 0 else 0)
    speeds = approach_speeds(start.shooting, u)
    if speeds and min(speeds.values()) <= 0:
        return CurveEnd("speed", min(speeds, key=speeds.__getitem__))
    touches = [
        one for one in near_touches(start.shooting, u) if one.clearance < -INTERFACE_ROUNDING
    ]
    if touches:
        last = min(touches, key=lambda one: one.clearance)
        return CurveEnd("touch", last.segment, last.offset, last.function)
    near = min(segments.durations[0], segments.durations[-1]) < EVENT_MARGIN * segments.period
    if len(segments) > 1 and near and start.contact is None:
        return None
    return False


def past_resonance(
    equations: PointEquations, plane: Plane, table: Array, end: CurveEnd | None
) -> Start | None:
    """The curve of TR beyond an angle 0 or π that is no resonance R1 or R2.

    The double multiplier has two eigenvectors there, as by a symmetry under which the return map
    is the square of another map. The equations are singular at that angle alone.
    """
    if end is None or end.kind != "resonance" or len(table) < 3:
        return None
    one, two, frame = table[-3], table[-2], equations.frame
    middle = np.pi * np.round(two[-1] / np.pi)
    turned, left = two[-1] - one[-1], middle - two[-1]
    if not turned * left > 0 or end_point(equations, plane, table, end) is not None:
        return None
    chord = two - one
    length = float(np.sqrt(chord**2 @ frame.weight))
    guess = two + 2.0 * left / turned * chord
    found = curves.corrected(
        equations.system, guess, chord / (length or 1.0), frame, plane.continuation
    )
    if found is None or abs(found[0][-1] - guess[-1]) > 0.5 * abs(left):
        return None
    if np.sqrt((found[0] - guess) ** 2 @ frame.weight) > plane.continuation.max_step:
        return None
    # the conjugate multiplier
    angle = float(2.0 * middle - found[0][-1])
    return replace(equations.start, u=found[0][:-1], angle=abs(angle))


def end_point(
    equations: PointEquations, plane: Plane, table: Array, end: CurveEnd
) -> tuple[PointEquations, CurvePoint] | None:
    """The equations and the point at which a curve ends."""
    start, good = equations.start, table[-2] if len(table) > 1 else table[-1]
    if end.kind == "speed":
        return None
    if end.kind == "touch":
        if len(table) < 2:
            return None
        tests = equations.tests(table[-2:])
        criterion = tests.touch(end.segment, end.offset, end.function)
        found = next(search(equations.rows(table[-2:], plane), [criterion]), None)
        return None if found is None or not found.converged else (equations, found)
    if end.kind == "resonance":
        fold = good[-1] < 0.5 * np.pi
        kind = FOLD if fold else DOUBLING
        u = good[:-1]
        if len(table) > 2:
            # the orbit is a smooth function of the square of the angle
            one, two = ((z[-1] if fold else np.pi - z[-1]) ** 2 for z in table[-3:-1])
            u = u + (good - table[-3])[:-1] * two / (one - two) if one > two else u
        other = replace(start, kind=kind, u=u)
        wanted: OrbitCodimensionTwo | None = kind.resonance
    else:
        merged = _merged(start, good[: start.width], end.segment)
        if merged is None:
            return None
        other, offset, function, wanted = merged
    near, z = equations_of(other, plane)
    landing = curves.landed(near.system, z, near.frame)
    if landing is None:
        return None
    tests = near.tests(landing)
    if wanted is not None:
        criterion = next(c for c in tests.criteria() if c.kind is wanted)
    else:
        criterion = tests.touch(end.segment - 1, offset, function)
    unit = criterion.value(landing)[1] or 1.0
    found = solved_from(near.rows(landing, plane), landing, criterion, unit)
    gap = found.z[other.width - 2 : other.width] - good[start.width - 2 : start.width]
    apart = np.abs(gap / (plane.upper - plane.lower)).max()
    if not found.converged or apart > 2.0 * plane.continuation.max_step:
        return None
    return near, found


def _merged(
    start: Start, u: Array, gone: int
) -> tuple[Start, float, int, OrbitCodimensionTwo | None] | None:
    """The orbit without a segment that vanishes at a touch.

    Returns
    -------
    start : Start
    offset : float
        Of the touch in the segment before.
    function : int
    kind : OrbitCodimensionTwo or None
        DGR if the segment is between a touch and a crossing.
    """
    shooting, form = start.shooting, start.shooting.form
    segments, period = shooting.unpack(u)
    contact, K = start.contact, len(form)
    if start.touching and contact is not None and gone in (contact[0], contact[0] + 1):
        place, function, mode = contact
        before = gone == place
        if form.ends[place - 1 if before else gone] != function or (before and place == 0):
            return None
        segments, reference = (joined_with_next(one, place) for one in (segments, form))
        contact, offset = (place - before, function, mode), 0.0
        kind: OrbitCodimensionTwo | None = DEGENERATE_CONTACT
    elif 0 < gone < K - 1 and form.modes[gone - 1] == form.modes[gone + 1]:
        function, kind = int(form.ends[gone - 1]), None
        offset = float(segments.durations[gone - 1] + 0.5 * segments.durations[gone])
        segments, reference = without_segment(segments, gone), without_segment(form, gone)
        if contact is not None:
            if contact[0] in (gone - 1, gone):
                return None
            contact = (contact[0] - 2 * (contact[0] > gone), *contact[1:])
    else:
        return None
    smaller = replace(shooting, form=reference)
    packed = np.append(smaller.pack(segments, period)[: smaller.size], u[-2:])
    return replace(start, shooting=smaller, u=packed, contact=contact), offset, function, kind
