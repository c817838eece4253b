"""The branch of orbits on both sides of a corner collision."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation import curves
from fastslow.orbits.find.orbit_curve import Beginning, CurveSystem, OrbitCurve, Row
from fastslow.orbits.flow.shooting import Shooting
from fastslow.orbits.points.corners import Corner, located_corner, onwards, other_side
from fastslow.orbits.points.kinds import CORNER
from fastslow.orbits.points.switching import ContactSide, Violation
from fastslow.orbits.trace.beyond_contacts import orbit_by_run
from fastslow.results.orbits.special_orbit import SpecialOrbit
from fastslow.results.point_types import NON_SMOOTH_FOLD
from fastslow.results.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]

#: Distances in arclength from a corner, on its own side, at which a run has the events of the
#: segments: at the corner itself rounding decides on their order.
OWN_SIDE = (1e-6, 1e-5, 1e-4)

#: Difference of multipliers, relative to the largest, from which the return map has a corner.
CORNER_DIFFERENCE = 1e-7


@dataclass(frozen=True, eq=False)
class CornerPassage:
    """The rows at a corner, and the orbit from which the branch continues.

    Parameters
    ----------
    rows : list of Row
        In the segments before the corner, with the special point; and in those beyond it.
    beginning : Beginning or None
        None where the branch ends.
    value : float
        The parameter at the corner.
    """

    rows: list[Row]
    beginning: Beginning | None
    value: float


def corner_passage(
    curve: OrbitCurve,
    candidate: Violation,
    shooting: Shooting,
    before: Array,
    after: Array,
    run: Trajectory,
    *,
    tangent: bool = False,
) -> CornerPassage | None:
    """Solve for the orbit at a corner in the segments of both sides; None if it meets none.

    Parameters
    ----------
    curve : OrbitCurve
    candidate : Violation
        Of a segment that vanishes, or of an event that reaches an interface.
    shooting : Shooting
    before, after : ndarray, shape (N + 1,)
        Unknowns of the last orbit before the corner, and of a solution beyond it.
    run : Trajectory
        Of the last orbit.
    tangent : bool
        Whether the orbit may be tangent to an interface there.
    """
    frame = curve.frame(shooting, before, run)
    where = candidate.fraction, candidate.segment, candidate.approach
    corner = located_corner(shooting, before, after, frame.scale, *where, tangent=tangent)
    if corner is None or not corner.converged:
        return None
    along = curves.tangent(CurveSystem(corner.shooting), corner.u, frame)
    along = along if (along * frame.weight) @ (after - before) >= 0 else -along
    if not any(_is_orbit(curve, corner, corner.u - step * along) for step in OWN_SIDE):
        return None
    first, value = _row(curve, corner, float(along[-1])), float(corner.u[-1])
    other, ahead = other_side(curve.problem, corner, along), None
    if other is not None:
        size = curve.frame(other.shooting, other.u, run)
        direction = curves.tangent(CurveSystem(other.shooting), other.u, size)
        ahead = onwards(curve.problem, other, direction)
    if other is None or ahead is None:
        form = ContactSide(corner.shooting, corner.u)
        near = orbit_by_run(curve, form, after - before, run)
        if near is None or near.row is None:
            rows = [replace(first, point=_special(curve, corner, first, "", 0.0))]
            return CornerPassage(rows, None, value)
        special = _special(curve, corner, first, "transition", np.nan)
        rows = [replace(first, point=replace(special, multipliers_beyond=_of(near.row)))]
        return CornerPassage([*rows, near.row], near.beginning, value)
    beyond = _row(curve, other, float(ahead[-1]))
    beginning = other.shooting, other.u, ahead
    one, two = (np.sort_complex(_of(row)) for row in (first, beyond))
    jumps = bool(
        np.abs(one - two).max() > CORNER_DIFFERENCE * max(np.abs(one).max(), np.abs(two).max())
    )
    if not jumps and corner.is_smooth:
        return CornerPassage([first, beyond], beginning, value)
    words = "transition" if ahead[-1] * along[-1] > 0 else NON_SMOOTH_FOLD
    special = _special(curve, corner, first, words, 1.0 if jumps else 2.0)
    special = replace(special, multipliers_beyond=_of(beyond))
    return CornerPassage([replace(first, point=special), beyond], beginning, value)


def _is_orbit(curve: OrbitCurve, corner: Corner, u: Array) -> bool:
    """Whether a free run has the events of the segments, so that no other condition is violated."""
    segments, period = corner.shooting.unpack(u)
    return curve.problem.confirmed(segments, period, {curve.name: float(u[-1])}) is not None


def _of(row: Row) -> NDArray[np.complex128]:
    return row.arrays.multipliers


def _row(curve: OrbitCurve, corner: Corner, slope: float) -> Row:
    # a run at the corner itself meets the events in either order
    orbit = curve.orbit(corner.shooting, corner.u, confirm=False)
    return curve.row(corner.shooting, corner.u, orbit, slope, None)


def _special(
    curve: OrbitCurve, corner: Corner, row: Row, type_: str, exponent: float
) -> SpecialOrbit:
    """The special point of a corner."""
    names = corner.shooting.variations.function_names
    return CORNER.point(
        *(curve.name, row.orbit, (corner.residual, corner.accuracy), corner.converged),
        time=corner.time,
        state=corner.state,
        interface=" and ".join(names[function] for function in sorted(corner.surfaces)),
        exponent=exponent,
        type=type_,
    )
