"""Rows of a branch at the bifurcations between two of its orbits."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from itertools import product

import numpy as np
from numpy.typing import NDArray

from fastslow.orbits.find.orbit_curve import OrbitCurve, Row
from fastslow.orbits.find.starts import known_equations
from fastslow.orbits.flow.events import OrbitError
from fastslow.orbits.flow.multipliers import Multipliers
from fastslow.orbits.flow.segments import segments_of
from fastslow.orbits.flow.shooting import Shooting
from fastslow.orbits.points.detection import kinds_between, located_between, tangent_point
from fastslow.orbits.points.kinds import BRANCHING, DOUBLING, FOLD, BifurcationKind
from fastslow.orbits.points.location import branch_tangents, is_branch_point
from fastslow.orbits.points.multiplier_signs import MultiplierSigns
from fastslow.orbits.points.point_curves import PointSource
from fastslow.orbits.points.rounding import rounding_of
from fastslow.results.angles import apart, periods_of
from fastslow.results.orbits.orbit_arrays import OrbitArrays
from fastslow.results.orbits.special_orbit import SpecialOrbit
from fastslow.results.point_types import CANDIDATE

Array = NDArray[np.float64]

#: Exponent of the return map at a contact from which multipliers are continuous there.
CONTINUOUS_MULTIPLIERS = 1.5

#: Logarithm of the critical multiplier of a fold or branch point. Without one the equations are
#: singular where an orbit crosses an interface with speed zero.
CRITICAL = 0.05

#: Distance of the orbit at which a branch of doubled orbits ends from the last one, in units of
#: that of the following one.
END_DISTANCE_RATIO = 1.5

#: The same of a fold or branch point that is not solved for: without a multiplier near 1 the
#: parameter turns for another reason.
WITHIN = 1.0

#: Largest distance of the critical multiplier from its value at a bifurcation.
CRITICAL_MULTIPLIER_ERROR = 1e-6

#: Distance of the halves of an orbit, in units of its ranges, below which it repeats.
REPEATED = 1e-7

#: Interval of time, as a fraction of the period, of a difference quotient along an orbit.
PHASE_STEP = 1e-4

#: Cosine of the angle between these distances on both sides of the simple orbit.
OPPOSITE = -0.5


def bifurcations(curve: OrbitCurve, one: Row, two: Row) -> list[Row]:
    """Return rows of the bifurcations between two rows of a branch, in order along it."""
    known = [(row.arrays.period, *row.arrays.log_multipliers) for row in (one, two)]
    if not (np.array(known) < np.inf).all():
        # homoclinic, or with an unbounded saltation matrix
        return []
    forms = product(one.forms, two.forms)
    one, two = next((pair for pair in forms if pair[0].continues(pair[1])), (one, two))
    same = one.is_alike(two)
    if not same:
        # across a contact: those before it, if the multipliers are continuous
        if two.point is None or two.point.exponent < CONTINUOUS_MULTIPLIERS:
            return []
        two = replace(two, shooting=one.shooting)
    signs = [MultiplierSigns.of(row.arrays, row.slope) for row in (one, two)]
    kinds = [kind for kind in kinds_between(*signs) if same or kind.across_contacts]
    found = (_bifurcation(curve, kind, one, two, signs) for kind in kinds)
    return sorted((row for row in found if row is not None), key=partial(place_of, curve, one, two))


def place_of(curve: OrbitCurve, one: Row, two: Row, row: Row) -> float:
    """Place of a row between two others, as a fraction of the step."""
    if not len(one.u) == len(row.u) == len(two.u):
        return (row.value - one.value) / (two.value - one.value or 1.0)
    scale = curve.frame(one.shooting, one.u, one.arrays).scale
    step = (two.u - one.u) / scale
    return float((row.u - one.u) / scale @ step / (step @ step))


def _bifurcation(
    curve: OrbitCurve,
    kind: BifurcationKind,
    one: Row,
    two: Row,
    signs: Sequence[MultiplierSigns],
) -> Row | None:
    """Solve for a bifurcation between two rows; unconverged, it is the second row."""
    shooting = one.shooting.with_phase(one.u)
    scale = curve.frame(shooting, one.u, one.orbit.trajectory).scale
    if one.continues(two):
        gap = (two.u - one.u) / scale
        begin, end = (tangent_point(shooting, row.u, scale, gap) for row in (one, two))
        point = located_between(shooting, kind, begin, end, scale)
    else:
        point = kind.located(shooting, one.u, scale, _critical_angle(signs))
        low, high = sorted((one.value, two.value))
        slack = 2.0 * (high - low) + 1e-6 * abs(high)
        near = low - slack <= point.u[-1] <= high + slack
        point = replace(point, converged=bool(point.converged and near))
    branches = kind.singular and point.converged and is_branch_point(shooting, point, scale)
    if kind is BRANCHING and not branches:
        if signs[0].slope * signs[1].slope < 0:
            # a fold beside another change of sign
            return _bifurcation(curve, FOLD, one, two, signs)
        if point.converged:
            return None
    if not point.converged:
        if kind.singular and not any(abs(one.nearest_unit) <= WITHIN for one in signs):
            return None
        return replace(two, point=_candidate(curve, kind, two, point.multiplier))
    tangent = None
    if branches:
        kind = BRANCHING
        tangents = branch_tangents(shooting, point.u, scale)
        if tangents is not None and one.continues(two):
            along = np.abs(tangents @ ((two.u - one.u) / scale))
            tangent = tangents[np.argmax(along)]
    orbit = curve.orbit(shooting, point.u, confirm=False)
    found = curve.row(shooting, point.u, orbit, 0.0, None)
    left = _left_over(kind, MultiplierSigns.of(found.arrays, 0.0), point.multiplier)
    if kind.singular and left > CRITICAL:
        return None
    if not left <= CRITICAL_MULTIPLIER_ERROR:
        return replace(found, point=_candidate(curve, kind, found, point.multiplier))
    special = kind.point(
        *(curve.name, orbit, (point.residual, point.accuracy)),
        angle=kind.angle_of(point.multiplier),
        source=PointSource(curve.problem, shooting, point.u, scale=scale, tangent=tangent),
    )
    return replace(found, point=special)


def _left_over(kind: BifurcationKind, signs: MultiplierSigns, critical: complex) -> float:
    """Distance of the nearest multiplier from that of a bifurcation, but that along the orbit.

    Infinite without such a multiplier, NaN for unresolved ones.
    """
    if np.isnan(signs.logs).any():
        return np.nan
    left = kind.distance(signs, critical)
    return np.inf if np.isnan(left) else left


def _candidate(
    curve: OrbitCurve, kind: BifurcationKind, row: Row, critical: complex
) -> SpecialOrbit:
    """The point at an orbit whose multipliers do not confirm it, with what rounding allows."""

    def distance(found: Multipliers | OrbitArrays) -> float:
        return _left_over(kind, MultiplierSigns.of(found, 0.0), critical)

    shooting = row.shooting.with_phase(row.u)
    scale = curve.frame(shooting, row.u, row.arrays).scale
    return kind.point(
        *(curve.name, row.orbit),
        type=CANDIDATE,
        deviation=distance(row.arrays),
        rounding=rounding_of(shooting, row.u, scale, distance),
    )


def _is_near(curve: OrbitCurve, last: Row, following: Row, shooting: Shooting, u: Array) -> bool:
    """Check that period and parameter of an orbit are as close to a row as the following row is."""
    if len(last.u) != len(following.u):
        # across a contact of a forced orbit
        return True
    frame = curve.frame(last.shooting, last.u, last.arrays)
    length = np.sqrt((following.u - last.u) ** 2 @ frame.weight)
    periods = [one.unpack(v)[1] for one, v in ((shooting, u), (last.shooting, last.u))]
    gap = np.array([periods[0] - periods[1], u[-1] - last.u[-1]])
    return bool(np.sqrt(gap**2 @ frame.weight[-2:]) <= END_DISTANCE_RATIO * length)


def _critical_angle(signs: Iterable[MultiplierSigns]) -> float:
    """Argument of the complex multiplier nearest to the unit circle."""
    pairs = [one.pair for one in signs]
    known = [pair for pair in pairs if pair is not None]
    return min(known, key=lambda pair: abs(pair[0]), default=(0.0, 0.5 * np.pi))[1]


def halved(curve: OrbitCurve, last: Row, following: Row) -> Row | None:
    """Return the row at which a branch of doubled orbits ends, None if it was not passed.

    There the orbit repeats after half its period, a period doubling of the simple orbit. Beyond
    it the same branch is traversed again with both halves exchanged.

    Parameters
    ----------
    curve : OrbitCurve
    last, following : Row
        Next to each other on the branch.
    """
    problem, winding = curve.problem, 0.5 * last.shooting.winding
    forced = problem.forcing is not None
    if problem.multiple % 2 if forced else last.shooting.form is not following.shooting.form:
        return None
    lengths = periods_of(last.orbit.states, last.orbit.trajectory.periods)
    halves = [row.halves for row in (last, following)]
    gaps = [apart(half[:, 1], half[:, 0], lengths) for half in halves]
    if gaps[0] @ gaps[1] >= 0:
        return None
    size = last.sizes
    distances = [float(np.linalg.norm(gap / size)) for gap in gaps]
    if (gaps[0] / size) @ (gaps[1] / size) > OPPOSITE * distances[0] * distances[1]:
        return None
    if min(distances) < REPEATED:
        return None
    simple = replace(problem, multiple=max(problem.multiple // 2, 1))
    at = last.shooting.parameters_at(last.u)
    run, period = last.orbit.trajectory, 0.5 * last.orbit.period
    try:
        segments = segments_of(run, run.span[0], period, winding, problem.variations, at)
        shooting, solution = simple.at(at).solve(segments, period, winding, run)
        scale = curve.frame(shooting, solution.u, run).scale
        point = DOUBLING.located(shooting, solution.u, scale, np.pi)
        if not point.converged:
            return None
        single = replace(curve, problem=simple).orbit(shooting, point.u, confirm=False)
        at = shooting.parameters_at(point.u)
        double, u = known_equations(problem.at(at), single, doubles=True)
    except OrbitError:
        return None
    share = distances[0] / sum(distances)
    middle = halves[0][:, 0] + share * apart(halves[1][:, 0], halves[0][:, 0], lengths)
    start = last.start
    off = apart(single(start), middle, lengths) / size
    if not forced:
        # but for its phase, which the equations of the simple orbit choose anew
        ahead = single(start + np.array([-0.5, 0.5]) * PHASE_STEP * single.period)
        along = apart(ahead[:, 1], ahead[:, 0], lengths) / size
        off -= (off @ along) / (along @ along or 1.0) * along
    if np.linalg.norm(off) > sum(distances) or not _is_near(curve, last, following, double, u):
        return None
    special = DOUBLING.point(
        *(curve.name, single, (point.residual, point.accuracy)),
        source=PointSource(simple, shooting, point.u),
    )
    orbit = curve.orbit(double, u, confirm=False)
    return curve.row(double, u, orbit, 0.0, special)
