"""Continuation of periodic orbits in one parameter, across changes of their itinerary."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import (
    Name,
    either,
    finite,
    formula,
    instance,
    interval,
    items,
    mapping,
    validated,
)
from fastslow.continuation import curves
from fastslow.continuation.marks import ValueMark
from fastslow.continuation.settings import Continuation
from fastslow.errors import ArgumentError
from fastslow.model.model import Model
from fastslow.orbits.ends.homoclinic import InfinitePeriod
from fastslow.orbits.find.finding import find_orbit
from fastslow.orbits.find.orbit_curve import (
    Beginning,
    CurveSystem,
    OrbitCurve,
    Row,
    completed,
    same_direction,
    states_along,
)
from fastslow.orbits.flow.events import OrbitError
from fastslow.orbits.flow.problem import OrbitProblem
from fastslow.orbits.flow.segments import (
    SEGMENT_GROWTH,
    SHORT_SEGMENT,
    Segments,
    restarted,
    segments_of,
    winding_of,
)
from fastslow.orbits.flow.shooting import Shooting, sizes_of
from fastslow.orbits.points.contacts import two_fold_near
from fastslow.orbits.points.corners import is_between_surfaces
from fastslow.orbits.points.kinds import MARKED
from fastslow.orbits.points.marks import OrbitMark, OrbitNames, read_orbit_marks
from fastslow.orbits.points.multiplier_signs import LEVEL_SLOPE, MultiplierSigns, changes
from fastslow.orbits.points.switching import Violation, contact_of, explained, violated
from fastslow.orbits.trace.beyond_contacts import AFTER_CONTACT, ContactPassage
from fastslow.orbits.trace.beyond_corners import CornerPassage, corner_passage
from fastslow.orbits.trace.bifurcation_rows import bifurcations, halved, place_of
from fastslow.orbits.trace.marked_rows import own_rows, row_at, rows_with_marks
from fastslow.orbits.trace.retracing import Retracing
from fastslow.orbits.trace.vanishing_cycles import is_mirrored, is_passed, is_point, vanished
from fastslow.results.base.outcome import Outcome, with_notes
from fastslow.results.orbits.orbit import Orbit
from fastslow.results.orbits.orbit_arrays import OrbitArrays
from fastslow.results.orbits.orbit_branch import OrbitBranch, branch_of
from fastslow.results.point_types import NON_SMOOTH_FOLD
from fastslow.results.points import SpecialPoint
from fastslow.results.trajectory.trajectory import Trajectory
from fastslow.simulation.settings import Integration, integration_settings

Array = NDArray[np.float64]

#: Largest distance of an orbit from its prediction, as a fraction of the step.
PREDICTION_ERROR = 0.3

#: Fraction of the segment with the start of the orbit, within which events keep away from it.
NEAR_START = 0.2

#: Phase from which a cycle without events begins instead, if it touches an interface there.
OTHER_PHASE = 0.37

#: Growth of the period or of the range of a state from which its unit is renewed.
LARGER = 1.5

#: Largest number of times that the distance to a violated condition is halved.
NARROWED = 8

#: Growth along a segment from which nodes are inserted anew in a branch of orbits that slide:
#: beside a two-fold nodes do not reduce it.
SLIDING = 100.0 * SEGMENT_GROWTH

#: Growth of the states, from the first orbit, at which a branch ends.
LARGEST_GROWTH = 1e8

#: How far on the way from the last cycle to a Hopf point a smaller one is computed.
APPROACH = 0.65


@validated(
    orbit=instance(Orbit),
    parameter=formula,
    over=interval,
    continuation=instance(Continuation),
    integration=integration_settings,
    marks=either(mapping, items(finite)),
)
def continue_orbits(
    orbit: Orbit,
    parameter: Name,
    over: tuple[float, float],
    *,
    continuation: Continuation | None = None,
    integration: Integration | None = None,
    marks: Sequence[float] | Mapping[Any, Any] = (),
) -> OrbitBranch:
    """Trace the branch of a periodic orbit in both directions of a parameter.

    Pseudo-arclength continuation of the equations of multiple shooting, through folds. Every
    orbit is confirmed by a free run. Where the orbit touches an interface, the contact is solved
    for and the branch continues with the itinerary beyond it, forwards or backwards in the
    parameter; so at a wall, where the speed of an impact vanishes, and at a corner collision, CC,
    where two events, or an event and an instant of a clock, exchange their order. A branch of
    cycles ends at a homoclinic orbit, HC, which is solved for without resets, extrapolated with
    resets, and not recognised with switches.

    Parameters
    ----------
    orbit : Orbit
        From `find_orbit`.
    parameter : str or Symbol
        Any parameter, the frequency of the forcing included.
    over : (float, float)
        Range of the parameter; it contains its value at the orbit.
    continuation : Continuation, optional
    integration : Integration, optional
        Settings of the free runs; by default ``rtol=1e-13``.
    marks : sequence of float, or mapping
        Values of the parameter for rows of their own. In a mapping of names to expressions, such
        as ``{"level": "max(x) - 2*a"}``, the zeros of each expression are special points labelled
        level1, level2, …; values are then given by the name of the parameter. An expression is in
        parameters, ``period``, the functionals min, max, mean and rms of columns or of
        expressions in them, and ``abs(multiplier_1)``, ``re(multiplier_1)``,
        ``im(multiplier_1)`` of the multipliers in the order of `Orbit`.

    Returns
    -------
    OrbitBranch
        Of one row for an orbit that was not found, or is not solved for with the parameter among
        the unknowns; its outcome states the reason.

    Raises
    ------
    ArgumentError
        For an orbit outside the range, for a mark outside it or whose name is that of a column or
        a code, or with forcing frequencies that are incommensurable at
        other values of the parameter.
    UnknownNameError
        For an unknown parameter, or an unknown name in an expression.

    Examples
    --------
    >>> import sympy as sp, fastslow as fs
    >>> x, v, c, w, t = sp.symbols("x v c w t")
    >>> linear = fs.Model({x: v, v: sp.cos(w * t) - x - c * v}, parameters={c: 0.1, w: 1})
    >>> branch = fs.continue_orbits(fs.find_orbit(linear, [0, 0]), "w", over=(0.5, 2))
    >>> round(float(branch["max(x)"].max()), 4)  # the resonance: 1/(c sqrt(1 - c**2/4))
    10.0125
    """
    name = str(parameter)
    model = orbit.model
    if not isinstance(model, Model):
        raise ArgumentError(
            "the orbit is loaded from a file without its equations in SymPy; find it again with "
            "find_orbit(model, orbit)"
        )
    low, high = over
    settings = continuation or Continuation()
    problem = OrbitProblem.of(model, orbit.multiple or 1, None, integration, (name,))
    value = model.parameters[name]
    if not low <= value <= high:
        raise ArgumentError(
            f"the orbit is at {name} = {value:g}, outside over = ({low:g}, {high:g})"
        )
    wanted = read_orbit_marks(marks, OrbitNames.of(orbit), {name: (low, high)})
    if not orbit.outcome:
        return single_row(orbit, name, orbit.outcome)
    try:
        first, along, curve = _beginning(problem, orbit, (low, high))
    except OrbitError as error:
        return single_row(orbit, name, error.outcome)
    forwards = _Tracer(curve, settings, wanted)
    along = along if along[-1] >= 0 else -along
    forwards.trace(first, along)
    if forwards.closed:
        return forwards.branch([], Outcome("closed loop", "the branch is a closed curve.", True))
    backwards = _Tracer(curve, settings, wanted, before=forwards.rows[:0:-1])
    backwards.trace(first, -along)
    return forwards.branch(backwards.rows[:0:-1], backwards.outcome)


def branch_away(
    problem: OrbitProblem,
    orbit: Orbit,
    over: tuple[float, float],
    settings: Continuation,
    point: SpecialPoint,
    marks: tuple[ValueMark | OrbitMark, ...] = (),
) -> OrbitBranch:
    """Trace the branch of a small cycle in the direction in which it leaves a Hopf point.

    Parameters
    ----------
    problem : OrbitProblem
        With the parameter chosen.
    orbit : Orbit
        From `find_orbit`.
    over : (float, float)
    settings : Continuation
    point : SpecialPoint
    marks : tuple
    """
    try:
        first, along, curve = _beginning(problem, orbit, over)
    except OrbitError as error:
        return single_row(orbit, problem.variations.chosen[0], error.outcome)
    n = problem.variations.n
    states = orbit.trajectory.sampled_columns[:n].T
    outwards = (first.u[:n] - np.array(point.state)) / sizes_of(states, states) ** 2
    tracer = _Tracer(curve, settings, marks)
    tracer.trace(first, along if along[:n] @ outwards > 0 else -along)
    words = f"the cycles emanate from {point.label}."
    return tracer.branch([], Outcome("Hopf point", words, True))


def single_row(orbit: Orbit, name: str, outcome: Outcome) -> OrbitBranch:
    """The branch of one orbit that states why it was not traced."""
    row = OrbitArrays.of(orbit, orbit, name)
    return branch_of([row], [None], (outcome, outcome), False, None)


def _beginning(
    problem: OrbitProblem, orbit: Orbit, over: tuple[float, float]
) -> tuple[Row, Array, OrbitCurve]:
    """The first row of a branch, its tangent, and the curve."""
    shooting, u, found = _first_orbit(problem, orbit)
    curve = OrbitCurve(problem, problem.variations.chosen[0], over, found)
    first = curve.row(shooting, u, found, 0.0, None)
    frame = curve.frame(shooting, u, found.trajectory)
    return first, curves.tangent(CurveSystem(shooting), u, frame), curve


def _first_orbit(problem: OrbitProblem, orbit: Orbit) -> tuple[Shooting, Array, Orbit]:
    """Solve for the orbit with the parameter among the unknowns."""
    run, period = orbit.trajectory, orbit.period
    winding = winding_of(run, orbit.t0, period)
    parts = problem.variations, problem.parameters
    segments = segments_of(run, orbit.t0, period, winding, *parts)
    shooting, solution = problem.solve(segments, period, winding, run)
    shooting = replace(shooting, form=_early(shooting.form, period, problem))
    solved_segments, length = shooting.unpack(solution.u)
    found = problem.orbit(solved_segments, length, solution)
    if not found.outcome:
        raise OrbitError(found.outcome)
    return shooting, solution.u, found


def _early(segments: Segments, period: float, problem: OrbitProblem) -> Segments:
    """The same orbit, begun less than a period away from time 0.

    The phase of the forcing at a fixed time t changes by t for a unit of the frequency.
    """
    moved = replace(segments, start=segments.start - np.round(segments.start / period) * period)
    return moved.with_constants(problem.variations, problem.parameters)


@dataclass(eq=False)
class _Tracer:
    """The trace of a branch in one direction, row by row."""

    curve: OrbitCurve
    settings: Continuation
    marks: tuple[ValueMark | OrbitMark, ...] = ()
    #: Rows of the other direction, in order along the branch.
    before: Sequence[Row] = ()
    rows: list[Row] = field(default_factory=list)
    outcome: Outcome = field(default_factory=lambda: Outcome("end of range", "", True))
    closed: bool = False
    #: Why the last stretch was stopped: a bad row, or a row from which to start anew, with other
    #: segments or units.
    bad: Array | None = None
    renew: bool = False
    rescale: bool = False
    #: Growth along a segment from which nodes are inserted, and whether they were at the last row.
    limit: float = SEGMENT_GROWTH
    divided: bool = False
    #: Whether the branch ended at an equilibrium, at an infinite period or where it is halved.
    ended: bool = False
    #: Units of the states and the period of this stretch.
    units: Array = field(default_factory=lambda: np.empty(0))
    retracing: Retracing = field(init=False)

    def trace(self, first: Row, along: Array) -> None:
        """Trace from a row along a tangent."""
        self.rows = [replace(first, slope=float(along[-1]))]
        self.retracing = Retracing(self.curve, self.settings, self.before)
        known = self.curve.problem
        excluded = known.forcing or known.variations.jumps.switches
        infinite = None if excluded else InfinitePeriod(self.curve)
        step = self.settings.step
        shooting, u = first.shooting, first.u
        while True:
            self.bad, self.renew, self.rescale = None, False, False
            self.units = self.units_of(self.rows[-1])
            # the states of a single node have no ranges
            alone = known.forcing is None and len(shooting.form) == 1
            if alone or (infinite is not None and shooting.winding.any()):
                shooting, along = self.with_ranges(shooting, u, along)
            system = CurveSystem(shooting)
            left = self.settings.max_points - len(self.rows)
            if left < 2:
                self.outcome = Outcome(
                    "too many points",
                    f"stopped at {self.curve.name} = {u[-1]:.6g} after {len(self.rows)} points; "
                    "raise max_points= of Continuation.",
                    False,
                )
                return
            settings = replace(self.settings, step=step, max_points=left)
            frame = self.curve.frame(shooting, u, self.rows[-1].arrays)
            along = along / np.sqrt(along**2 @ frame.weight)
            z, tangents, status = curves.follow(
                *(system, u, along, frame, settings),
                stop=partial(self.judged, system, infinite),
                aside=PREDICTION_ERROR,
            )
            if status == curves.RANGE and system.point is not None:
                self.judged(system, None, z[-1])
            self.complete(tangents[:, -1])
            if self.ended:
                return
            if self.bad is not None:
                after = self.across(shooting, z, tangents, frame)
                if after is None:
                    if self.outcome.code == "itinerary not confirmed":
                        self.doubt(infinite)
                    return
                shooting, u, along = after
                step = max(AFTER_CONTACT, self.settings.min_step)
                continue
            if self.renew or self.rescale:
                ahead = shooting, z[-1], tangents[-1]
                renewed = self.renewed(*ahead) if self.renew else ahead
                if renewed is None:
                    self.doubt(infinite)
                    return
                shooting, u, along = renewed
                if self.rescale:
                    frame = self.curve.frame(*ahead[:2], self.run)
                gap = (z[-1] - z[-2])[: frame.size]
                step = float(np.sqrt((gap**2) @ frame.weight[: frame.size]))
                step = min(max(step, self.settings.min_step), self.settings.max_step)
                continue
            self.finish(status, float(z[-1][-1]))
            if not self.outcome:
                self.doubt(infinite)
            return

    def doubt(self, infinite: InfinitePeriod | None) -> None:
        """Set the outcome of a trace that fails close to a saddle."""
        if infinite is not None and infinite.candidate is not None:
            self.outcome = infinite.candidate

    @property
    def run(self) -> Trajectory:
        """The trajectory of the last row."""
        return self.rows[-1].orbit.trajectory

    def judged(self, system: CurveSystem, infinite: InfinitePeriod | None, _: Array) -> bool:
        """Add the last point as a row; return True if the stretch ends there."""
        shooting, point = system.shooting, system.point
        assert point is not None
        row = self.curve.confirmed(shooting, point)
        if row is None:
            self.bad = point.u
            return True
        self.ended = self.ends(row)
        if self.ended:
            if self.outcome.code == "Hopf point":
                self.approach(system, row)
            return True
        self.rows.append(row)
        if self.unbounded(row) or self.retraced():
            self.ended = True
            return True
        found = None if infinite is None else infinite.end(self.rows)
        if found is not None:
            self.outcome, self.ended = found.outcome, True
            self.rows += [] if found.row is None else [found.row]
            return True
        whole = shooting.unpack(point.u)[0].without_nodes()
        begin, end = whole.durations[0], whole.durations[-1]
        near = min(begin, end) < NEAR_START * (begin + end)
        near |= begin + end < 0.5 * SHORT_SEGMENT * whole.durations.max()
        slides = self.curve.problem.variations.deficiency[shooting.form.modes].any()
        least = SLIDING if slides else SEGMENT_GROWTH
        grown = point.growth > max(self.limit, least)
        if grown and self.divided:
            # nodes do not reduce it, as in a segment along which a state hardly changes
            self.limit, grown = LARGER * point.growth, False
        elif point.growth <= least:
            self.limit = least
        self.divided = grown
        if grown and self.at_two_fold(shooting, row):
            self.ended = True
            return True
        self.renew = bool(len(whole) > 1 and near) or grown
        if infinite is not None:
            self.rescale = bool((self.units_of(row) > LARGER * self.units).any())
        return self.renew or self.rescale

    def at_two_fold(self, shooting: Shooting, row: Row) -> bool:
        """Check whether the orbits reach a two-fold while they slide; then set the outcome."""
        interface = two_fold_near(shooting, row.u)
        if interface is None:
            return False
        name = row.orbit.trajectory.interfaces[interface]
        self.outcome = Outcome(
            "two-fold",
            f"at {self.curve.name} = {row.value:.7g} the orbit slides past a two-fold on {name}, "
            "at which the rates of sliding are unbounded: a candidate for the end of the branch, "
            "which was not located.",
            False,
        )
        return True

    def unbounded(self, row: Row) -> bool:
        """Check whether the orbits have become far larger than the first; then set the outcome."""
        n = self.curve.problem.variations.n
        first = np.abs(states_along(self.rows[0].arrays, n)).max(axis=0)
        last = np.abs(states_along(row.arrays, n)).max(axis=0)
        if not last.max() > LARGEST_GROWTH * first.max():
            return False
        self.outcome = Outcome(
            "amplitude unbounded",
            f"the states have grown to 10⁸ times those of the first orbit at {self.curve.name} = "
            f"{row.value:.6g}: a candidate for a bifurcation from infinity.",
            False,
        )
        return True

    def retraced(self) -> bool:
        """Check whether the last rows repeat earlier ones; then remove them, set the outcome."""
        first = self.retracing.first_repeated(self.rows)
        if first is None:
            return False
        del self.rows[first:]
        self.outcome = Outcome(
            "retraced",
            f"beyond {self.curve.name} = {self.rows[-1].value:.10g} the same orbits were computed "
            "again, which are removed: the branch turned back where rounding decides on its "
            "direction, or is a closed curve. What follows there is not known; begin at an orbit "
            "beyond, or give a smaller max_step of Continuation.",
            False,
        )
        return True

    def with_ranges(self, shooting: Shooting, u: Array, along: Array) -> tuple[Shooting, Array]:
        """The equations with the ranges of the last orbit in the phase condition; the tangent."""
        shooting = replace(shooting, ranges=self.units[:-1])
        frame = self.curve.frame(shooting, u, self.rows[-1].arrays)
        turned = curves.tangent(CurveSystem(shooting), u, frame)
        return shooting, turned if (turned * frame.weight) @ along >= 0 else -turned

    def units_of(self, row: Row) -> Array:
        """The units of the states and the period."""
        n = self.curve.problem.variations.n
        along = states_along(row.arrays, n)
        return np.append(sizes_of(along, along), row.arrays.period)

    def ends(self, row: Row) -> bool:
        """Check whether the branch ends before an orbit; then set the outcome."""
        if self.curve.problem.forcing is None:
            met = is_point(self.rows, row)
            if not met and is_passed(self.rows, row):
                del self.rows[-1]
                met = True
            if met:
                self.outcome = vanished(self.curve, self.rows)
                return True
        last = halved(self.curve, self.rows[-1], row)
        if last is None:
            return False
        self.rows.append(last)
        self.outcome = Outcome(
            "period doubling",
            f"the orbit repeats after half its period, at {self.curve.name} = {last.value:.10g}: "
            "the branch ends on that of the simple orbits.",
            True,
        )
        return True

    def approach(self, system: CurveSystem, beyond: Row) -> None:
        """Add a smaller cycle before a Hopf point, between the last one and one beyond it."""
        last, shooting = self.rows[-1], beyond.shooting
        if len(last.u) != len(beyond.u):
            return
        sizes = [self.units_of(one)[:-1].max() for one in (last, beyond)]
        gap = beyond.u - last.u
        frame = self.curve.frame(shooting, last.u, last.arrays)
        share = APPROACH * sizes[0] / (sizes[0] + sizes[1])
        along = gap / np.sqrt(gap**2 @ frame.weight)
        system.solved(last.u + share * gap, along, frame, self.settings)
        row = None if system.point is None else self.curve.confirmed(shooting, system.point)
        if row is not None and self.units_of(row)[:-1].max() < sizes[0]:
            self.rows += completed([row], [last.slope])

    def complete(self, slopes: Array) -> None:
        """Complete the rows of a stretch: components of the tangents along the parameter."""
        places = [k for k, row in enumerate(self.rows) if row.solved is not None]
        known = slopes[1 : 1 + len(places)].tolist()
        for k, row in zip(places, completed([self.rows[k] for k in places], known), strict=True):
            self.rows[k] = row

    def renewed(self, shooting: Shooting, u: Array, along: Array) -> Beginning | None:
        """The same orbit with another start, or other nodes, and its tangent; None without."""
        here = self.curve.problem.at(shooting.parameters_at(u))
        segments, period = shooting.unpack(u)
        winding = shooting.winding
        slides = bool(here.variations.deficiency[segments.modes].any())
        try:
            if len(segments.without_nodes()) == 1 and not slides:
                segments = _early(segments, period, here)
                ranges = self.units_of(self.rows[-1])[:-1]
                other, again = here.with_other_nodes(segments, period, winding, ranges)
            else:
                parts = here.variations, here.parameters
                moved = _early(restarted(segments, period, winding, *parts), period, here)
                # where perturbations grow, the states of a run are a better guess than the flow
                run = self.rows[-1].orbit.trajectory if moved.start == segments.start else None
                other, solution = here.solve(moved, period, winding, run)
                again = solution.u
        except OrbitError as error:
            message = f"at {self.curve.name} = {u[-1]:.10g} {error.outcome.message}"
            self.outcome = replace(error.outcome, message=message)
            return None
        frame = self.curve.frame(other, again, self.rows[-1].arrays)
        turned = curves.tangent(CurveSystem(other), again, frame)
        turned = same_direction((shooting, u, along), (other, again, turned))
        self.rows[-1] = replace(self.rows[-1], shooting=other, u=again, earlier=(shooting, u))
        return other, again, turned

    def across(
        self, shooting: Shooting, z: Array, tangents: Array, frame: curves.Frame
    ) -> Beginning | None:
        """Cross a contact between the last good row and a bad one; None if the branch ends."""
        assert self.bad is not None
        before, after = self.rows[-1].u, self.bad
        if len(before) != len(after):
            before = z[-2]
        place = f"{self.curve.name} = {before[-1]:.10g}"
        if shooting.chatters:
            again = self.chattering(shooting, before, after)
            if again is not None:
                return again
        if self.curve.problem.forcing is None and is_mirrored(shooting, before, after):
            self.outcome = vanished(self.curve, self.rows)
            return None
        candidate = violated(shooting, before, after)
        ends = 0, len(shooting.form) - 1
        if candidate and candidate.kind == "vanishing" and candidate.segment in ends:
            # no contact: an event passes the start of the orbit
            return self.renewed(shooting, before, tangents[-2])
        if candidate and candidate.kind == "touch":
            again = self.begun_elsewhere(shooting, before, tangents[-2], candidate)
            if again is not None:
                return again
        met, before, after, candidate = self.at_corner(shooting, before, after, frame, candidate)
        if met is not None:
            return self.past_corner(met)
        found = None
        if candidate is not None:
            found = contact_of(shooting, candidate, before, after, frame.scale)
        if candidate is None or found is None or not found[0].converged:
            first = violated(shooting, before, after)
            if first and may_be_corner(shooting, first):
                known = first, shooting, before, after, self.run
                met = corner_passage(self.curve, *known, tangent=True)
                if met is not None and met.beginning is not None:
                    return self.past_corner(met)
            why = explained(shooting, candidate) if candidate else ""
            if shooting.chatters and not why:
                why = "the rest on a wall, or the chatter before it, begins or ends differently"
            self.outcome = Outcome(
                "itinerary not confirmed",
                f"beyond {place} a free run has another itinerary than the orbit"
                + (f": {why}." if why else ", and no contact was located that explains it."),
                False,
            )
            return None
        contact, form = found
        across = contact, form, candidate, self.settings, self.run, after - before
        passage = ContactPassage(self.curve, *across)
        arrival = passage.arrival(shooting, before, after)
        slope = self.rows[-1].slope if arrival is None else float(arrival.beginning[2][-1])
        if arrival is not None and arrival.row is not None:
            self.rows.append(arrival.row)
        ahead = passage.following()
        inwards = np.zeros(len(form.u))
        if arrival is not None and len(arrival.beginning[2]) == len(form.u) and not arrival.row:
            inwards = -arrival.beginning[2]
        if ahead is None:
            self.rows.append(passage.row(slope, "", inwards))
            self.outcome = Outcome(
                "end at a contact",
                f"no orbit was found beyond the contact {contact.code} at {self.curve.name} = "
                f"{contact.u[-1]:.10g}" + _reason(passage),
                False,
            )
            return None
        (other, u, along), following = ahead
        # the direction of the parameter beyond the contact
        away = following is None
        on = np.sign(along[-1] if away else u[-1] - contact.u[-1])
        words = "transition" if on * slope > 0 else NON_SMOOTH_FOLD
        if min(abs(slope), abs(float(along[-1]))) <= LEVEL_SLOPE:
            # along a family at one value of the parameter
            words = ""
        # in the segments of the contact's own row
        own = (float(along[-1]), words, along) if away else (slope, words, inwards)
        self.rows.append(passage.row(*own))
        if following is not None:
            self.rows.append(following)
        return other, u, along

    def begun_elsewhere(
        self, shooting: Shooting, u: Array, along: Array, touch: Violation
    ) -> Beginning | None:
        """The same cycle from another phase, if it has no events and would touch near its start."""
        segments, period = shooting.unpack(u)
        phase = float(segments.times[touch.segment] + touch.offset - segments.start) / period
        events = len(segments.without_nodes()) > 1
        if events or shooting.forcing is not None or abs(phase - np.round(phase)) > NEAR_START:
            return None
        here = self.curve.problem.at(shooting.parameters_at(u))
        since = self.run.span[0] + OTHER_PHASE * period
        switches = segments.constants[0, len(here.variations.instants.symbols) :]
        run = here.run(self.run(since), since, since + period, switches)
        known = period, shooting.winding
        try:
            moved = segments_of(run, since, *known, here.variations, here.parameters)
            other, solution = here.solve(_early(moved, period, here), *known, run)
        except OrbitError:
            return None
        frame = self.curve.frame(other, solution.u, self.rows[-1].arrays)
        turned = curves.tangent(CurveSystem(other), solution.u, frame)
        # period and parameter do not depend on the phase
        weight = frame.weight[-2:]
        ahead = turned[-2:] @ (weight * along[-2:]) >= 0
        self.rows[-1] = replace(self.rows[-1], shooting=other, u=solution.u)
        return other, solution.u, turned if ahead else -turned

    def at_corner(
        self,
        shooting: Shooting,
        before: Array,
        after: Array,
        frame: curves.Frame,
        candidate: Violation | None,
    ) -> tuple[CornerPassage | None, Array, Array, Violation | None]:
        """The passage of a corner; without one a solution beyond another condition, and that.

        The condition may be violated before the corner, so that the step is halved.
        """
        count, widest, nearer = len(self.rows), before, after
        for _ in range(NARROWED):
            if candidate is None or not may_be_corner(shooting, candidate):
                return None, before, nearer, candidate
            met = corner_passage(self.curve, candidate, shooting, before, nearer, self.run)
            if met is not None:
                return met, before, nearer, candidate
            before, nearer = self.narrowed(shooting, before, nearer, frame)
            candidate = violated(shooting, before, nearer)
        del self.rows[count:]
        return None, widest, after, violated(shooting, widest, after, corners=False)

    def narrowed(
        self, shooting: Shooting, before: Array, after: Array, frame: curves.Frame
    ) -> tuple[Array, Array]:
        """Halve the distance between the last orbit and a solution that is none."""
        gap, system = after - before, CurveSystem(shooting)
        along = gap / np.sqrt(gap**2 @ frame.weight)
        system.solved(before + 0.5 * gap, along, frame, self.settings)
        if system.point is None:
            return before, after
        row = self.curve.confirmed(shooting, system.point)
        if row is None:
            return before, system.point.u
        self.rows += completed([row], [self.rows[-1].slope])
        return row.u, after

    def past_corner(self, met: CornerPassage) -> Beginning | None:
        """Add the rows at a corner; None if the branch ends there."""
        self.rows += met.rows
        if met.beginning is None:
            self.outcome = Outcome(
                "end at a contact",
                f"no orbit was found beyond the corner collision at {self.curve.name} = "
                f"{met.value:.10g}, where the return map is discontinuous or several events meet.",
                False,
            )
        return met.beginning

    def chattering(self, shooting: Shooting, before: Array, after: Array) -> Beginning | None:
        """The next orbit with a completed chatter, with the impacts of a run; None without.

        Their number changes along a branch. The chatter makes the orbit superstable, so that
        the second period of a run is the orbit.
        """
        segments, period = shooting.unpack(before)
        n, modes = self.curve.problem.variations.n, segments.without_nodes().modes
        for share in (1.0, 0.1):
            guess = before + share * (after - before)
            here = self.curve.problem.at(shooting.parameters_at(guess))
            since = segments.start + (here.forced_period() or period)
            switches = segments.constants[0, len(here.variations.instants.symbols) :]
            span = segments.start, 2 * since - segments.start
            run = here.run(before[:n].copy(), *span, switches)
            if not run.outcome:
                continue
            length = since - segments.start
            known = length, shooting.winding, here.variations, here.parameters
            try:
                found = _early(segments_of(run, since, *known), length, here)
                other, solution = here.solve(found, length, shooting.winding)
            except OrbitError:
                continue
            orbit = self.curve.orbit(other, solution.u)
            alike = other.form.without_nodes().modes
            if not orbit.outcome or not other.chatters or _changes(alike) != _changes(modes):
                continue
            frame = self.curve.frame(other, solution.u, orbit.trajectory)
            along = curves.tangent(CurveSystem(other), solution.u, frame)
            along = along if along[-1] * (after[-1] - before[-1]) >= 0 else -along
            self.rows.append(self.curve.row(other, solution.u, orbit, float(along[-1]), None))
            return other, solution.u, along
        return None

    def finish(self, status: str, value: float) -> None:
        """Set the outcome of the end of a trace."""
        at = f"{self.curve.name} = {value:.6g}"
        if status == curves.CLOSED:
            self.closed = True
            self.outcome = Outcome("closed loop", "the branch is a closed curve.", True)
        elif status == curves.RANGE:
            self.outcome = Outcome("end of range", f"reached {at}, the end of the range.", True)
        elif status == curves.SMALL_STEP:
            self.outcome = Outcome(
                "step too small",
                f"the step became smaller than min_step at {at}, where Newton's method does not "
                "converge.",
                False,
            )
        else:
            self.outcome = Outcome(
                "too many points",
                f"stopped at {at} after {len(self.rows)} points; raise max_points= of "
                "Continuation.",
                False,
            )

    def branch(self, before: list[Row], outcome: Outcome) -> OrbitBranch:
        """Return the branch of the rows traced backwards (reversed), and of those forwards."""
        turned = [replace(row, slope=-row.slope) for row in before]
        notes: list[str] = []
        rows = self.with_points([*turned, *self.rows], notes)
        return branch_of(
            [_with_known_multipliers(row) for row in rows],
            [row.point for row in rows],
            (outcome, with_notes(self.outcome, notes)),
            self.closed,
            partial(_orbit_at, self.curve.problem, self.curve.name),
        )

    def with_points(self, rows: list[Row], notes: list[str]) -> list[Row]:
        """Insert the rows of bifurcations and of marks; add notes on marks without a point."""
        expressions = [mark for mark in self.marks if isinstance(mark, OrbitMark)]
        marked = rows_with_marks(self.curve, self.settings, expressions, rows, notes)
        found = own_rows(rows[0], marked[0])
        changed = changes(MultiplierSigns.of_rows([(row.arrays, row.slope) for row in rows]))
        for k, (differs, two) in enumerate(zip(changed.tolist(), rows[1:], strict=True)):
            one = rows[k]
            between = bifurcations(self.curve, one, two) if differs else []
            inside = [each.row for each in marked[k] if not each.at_row]
            if more := [*self.marked(one, two), *inside]:
                between = sorted([*between, *more], key=partial(place_of, self.curve, one, two))
            found += [*between, *own_rows(two, marked[k + 1])]
        return found

    def marked(self, one: Row, two: Row) -> list[Row]:
        """Rows at given values of the parameter between two rows."""
        values = [mark.value for mark in self.marks if isinstance(mark, ValueMark)]
        inside = [m for m in values if min(one.value, two.value) < m < max(one.value, two.value)]
        found = []
        for mark in inside:
            row = row_at(self.curve, one, two, mark)
            if row is not None:
                found.append(
                    replace(row, point=MARKED.point(self.curve.name, row.orbit, (0.0, 0.0)))
                )
        return found


def may_be_corner(shooting: Shooting, candidate: Violation) -> bool:
    """Check whether a condition may be violated at a corner collision."""
    vanishes = candidate.kind == "vanishing"
    between = vanishes and is_between_surfaces(shooting, candidate.segment)
    return candidate.kind == "corner" or between


def _reason(passage: ContactPassage) -> str:
    """The end of the sentence that no orbit was found beyond a contact."""
    if passage.at_wall and passage.repeats:
        forced = passage.curve.problem.forcing is not None
        shorter = "one period of the forcing" if forced else "a fraction of its period"
        return f", where the orbit repeats after {shorter}."
    if passage.at_two_fold:
        return ", a two-fold: both vector fields are tangent to the interface there."
    return ", where the return map is discontinuous." if passage.contact.exponent == 0 else "."


def _changes(modes: NDArray[np.int64]) -> list[int]:
    """A sequence of modes without repetitions."""
    return [int(modes[0]), *(int(two) for one, two in pairwise(modes) if one != two)]


def _with_known_multipliers(row: Row) -> OrbitArrays:
    """The orbit of a row, without multipliers where its special point has none."""
    if row.point is None or not np.isnan(row.point.orbit.log_multipliers).all():
        return row.arrays
    unknown = row.point.orbit
    return row.arrays._replace(
        multipliers=unknown.multipliers, log_multipliers=unknown.log_multipliers
    )


def _orbit_at(problem: OrbitProblem, name: str, orbit: Orbit, value: float) -> Orbit:
    """Return the orbit at a value of the parameter, near another one."""
    model = problem.model.with_parameters({name: value})
    return find_orbit(model, orbit, multiple=orbit.multiple or 1)
