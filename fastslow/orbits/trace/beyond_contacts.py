"""The orbit beyond a contact with an interface, on another sequence of segments."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation import curves
from fastslow.continuation.settings import Continuation
from fastslow.orbits.find.orbit_curve import Beginning, CurveSystem, OrbitCurve, Row, completed
from fastslow.orbits.flow.events import OrbitError
from fastslow.orbits.flow.flows import fields
from fastslow.orbits.flow.segments import segments_of
from fastslow.orbits.flow.shooting import Shooting, sizes_of
from fastslow.orbits.points.contacts import Contact, other_side
from fastslow.orbits.points.kinds import KINDS
from fastslow.orbits.points.point_curves import PointSource
from fastslow.orbits.points.switching import (
    ContactSide,
    Violation,
    approach_speeds,
    edges_of,
    inserted,
    inserted_after,
    sliding_between,
    touches_of,
    with_impacts,
    without_nodes,
)
from fastslow.results.angles import apart, periods_of
from fastslow.results.orbits.orbit import Orbit, itinerary_of
from fastslow.results.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]

#: Step in arclength after a contact, beyond which multipliers move like a square root.
AFTER_CONTACT = 1e-4

#: Exponent of the return map from which it is Lipschitz continuous.
LIPSCHITZ_EXPONENT = 1.0

#: Largest change of the state from a touch to an orbit beyond it, in units of the step across it.
TOUCH_CHANGE = 2.0

#: Distances beyond a touch in order of trial, as fractions of the step across it.
TOUCH_DISTANCES = (0.3, 0.03)

#: Distances in arclength from a contact at which a free run does not pass the interface.
CONTACT_DISTANCES = (1e-9, 1e-8, 1e-7, 1e-6)

#: Difference of the ends of a closed run, in units of its ranges.
CLOSURE_ERROR = 1e-4

#: Rate across an interface, relative to the lengths of its gradient and the rates, below which a
#: vector field is tangent at a contact, whose state is known to the square root of rounding.
TANGENT_DRIFT = 1e-6

#: Durations of the segment that begins at a contact, as fractions of the period, in order of
#: trial.
NEW_SEGMENT = (1e-3, 1e-4, 1e-2)


class Neighbour(NamedTuple):
    """An orbit beside a contact, with its row; without a row it is that of the contact."""

    beginning: Beginning
    row: Row | None


def orbit_by_run(
    curve: OrbitCurve, form: ContactSide, gap: Array, run: Trajectory
) -> Neighbour | None:
    """The orbit with the itinerary of a run beyond a touch, as at a corner of two interfaces.

    Where the return map is continuous there, the orbit beyond is near. A segment that vanishes may
    do so where its equations have a fold, so that their solution beyond is on the same side of the
    parameter as the last orbit: both sides are tried.

    Parameters
    ----------
    curve : OrbitCurve
    form : ContactSide
        The orbit without the touch.
    gap : ndarray
        From the unknowns of the last orbit to those of a solution beyond.
    run : Trajectory
        Of the last orbit.
    """
    shooting, n = form.shooting, form.shooting.variations.n
    segments, period = shooting.unpack(form.u)
    columns = run.sampled_columns[:n].T
    sizes = sizes_of(columns, columns)
    for side, share in product((1.0, -1.0), TOUCH_DISTANCES):
        guess = form.u.copy()
        guess[:n] += share * gap[:n]
        guess[-1] += side * share * gap[-1]
        here = curve.problem.at(shooting.parameters_at(guess))
        switches = segments.constants[0, len(here.variations.instants.symbols) :]
        # the guess may be in another mode than the orbit at that time
        since = segments.start - period
        begin = guess[:n] - shooting.winding
        two = here.run(begin, since, segments.start + period, switches)
        if not two.outcome:
            continue
        orbit = None
        for start in (since, segments.start):
            with suppress(OrbitError):
                known = period, shooting.winding, here.variations, here.parameters
                found = segments_of(two, start, *known)
                other, solution = here.solve(found, period, shooting.winding)
                orbit = curve.orbit(other, solution.u)
                break
        if orbit is None or not orbit.outcome or orbit.itinerary == itinerary_of(run):
            continue
        moved = np.abs(orbit(segments.start)[:n] - form.u[:n]) / sizes
        if moved.max() <= TOUCH_CHANGE * np.abs(gap[:n] / sizes).max():
            frame = curve.frame(other, solution.u, orbit.trajectory)
            along = curves.tangent(CurveSystem(other), solution.u, frame)
            along = along if side * along[-1] * gap[-1] >= 0 else -along
            row = curve.row(other, solution.u, orbit, float(along[-1]), None)
            return Neighbour((other, solution.u, along), row)
    return None


@dataclass(frozen=True, eq=False)
class ContactPassage:
    """The passage of a branch across a contact.

    Parameters
    ----------
    curve : OrbitCurve
    contact : Contact
    form : ContactSide
        The orbit without the touch.
    candidate : Violation
    settings : Continuation
    run : Trajectory
        Of the last orbit before the contact.
    gap : ndarray
        From the unknowns of that orbit to those of an orbit beyond the contact.
    """

    curve: OrbitCurve
    contact: Contact
    form: ContactSide
    candidate: Violation
    settings: Continuation
    run: Trajectory
    gap: Array

    def arrival(self, shooting: Shooting, u: Array, after: Array) -> Neighbour | None:
        """The orbit at the contact, or shortly before a segment vanishes, with its tangent there.

        None if that segment is so short already.

        Parameters
        ----------
        shooting : Shooting
        u, after : ndarray
            Unknowns of the last orbit before the contact, and beyond it.
        """
        gap = after - u
        if self.candidate.kind != "vanishing":
            at = self.form.u
            if self.candidate.kind == "speed" and self.contact.exponent:
                shooting, at = self._hit.shooting, self._hit.u
                if len(at) != len(u):
                    # the orbit touches more walls than it hits
                    return None
            frame = self.curve.frame(shooting, at, self.run)
            along = curves.tangent(CurveSystem(shooting), at, frame)
            along = along if (along * frame.weight) @ gap >= 0 else -along
            return Neighbour((shooting, at, along), None)
        place = len(shooting.form) * shooting.variations.n + self.candidate.segment
        duration = NEW_SEGMENT[0] * shooting.unpack(u)[1]
        if u[place] <= duration:
            return None
        share = (u[place] - duration) / (u[place] - after[place])
        form = ContactSide(shooting, u + share * gap)
        return self._with_duration(form, place, duration, -1.0)

    def following(self) -> Neighbour | None:
        """The orbit from which the branch continues, None where it ends."""
        if self.is_singular or (self.at_wall and (self.contact.exponent == 0.0 or self.repeats)):
            return None
        if self.candidate.kind in ("vanishing", "speed"):
            found = self._away()
        elif self.at_wall:
            found = self._with_impacts()
        elif self.candidate.kind == "touch":
            found = None if self._beside_node() else self._beyond()
            found = found or replace(self, form=without_nodes(self.form))._beyond()
        else:
            found = self._past_edge()
        if found is None and self.contact.exponent >= LIPSCHITZ_EXPONENT:
            return orbit_by_run(self.curve, self.form, self.gap, self.run)
        return found

    def row(self, slope: float, type_: str, inwards: Array) -> Row:
        """The row of the contact.

        Parameters
        ----------
        slope : float
            Of the parameter along the branch.
        type_ : str
        inwards : ndarray, shape (N + 1,)
            Tangent of the orbits without the touch, in its segments.
        """
        contact, form, curve = self.contact, self.form, self.curve
        orbit = self._without_touch(inwards)
        if self.at_wall or self.is_singular:
            # the saltation matrix is unbounded, or 0/0
            unknown = np.full(len(orbit.multipliers), np.nan)
            orbit = replace(orbit, multipliers=unknown.astype(complex), log_multipliers=unknown)
        special = KINDS[contact.code].point(
            *(curve.name, orbit, (contact.residual, contact.accuracy), contact.converged),
            time=contact.time,
            state=contact.state,
            interface=self._name_of(contact.place[1]),
            curvature=contact.curvature,
            exponent=contact.exponent,
            type=type_,
            source=PointSource(curve.problem, contact.shooting, contact.u, contact.place),
        )
        return curve.row(form.shooting, form.u, orbit, slope, special)

    def _name_of(self, function: int) -> str:
        names = self.form.shooting.variations.function_names
        return names[function] if function < len(names) else "bound of sliding"

    @property
    def at_wall(self) -> bool:
        """Whether the contact is with a wall."""
        variations = self.form.shooting.variations
        place = self.contact.place[1] - variations.interfaces
        return 0 <= place < variations.walls

    @property
    def is_singular(self) -> bool:
        """Whether the orbit is tangent to what it crosses, and ends there."""
        tangent = self.candidate.kind in ("edge", "speed") and self.contact.exponent == 0.0
        return tangent or self.at_two_fold

    @cached_property
    def at_two_fold(self) -> bool:
        """Whether the vector fields on both sides are tangent to the interface at the contact."""
        contact, variations = self.contact, self.form.shooting.variations
        segment, function, mode = contact.place
        if not (function < variations.interfaces and variations.jumping[function]):
            return False
        (form, period), n = contact.shooting.unpack(contact.u), variations.n
        sides = np.tile(self._signs[mode], (2, 1))
        sides[:, function] = 1, -1
        modes = [np.flatnonzero((self._signs == side).all(axis=1)) for side in sides]
        if not all(len(found) for found in modes):
            return False
        known = fields(
            variations,
            np.concatenate([found[:1] for found in modes]),
            np.tile(contact.state, (2, 1)),
            np.full(2, contact.time),
            contact.shooting.parameters_at(contact.u),
            np.tile(form.constants[segment], (2, 1)),
        )
        slopes, size = known.g_u[:, function, : n + 1], np.append(self._sizes, period)
        rates = np.column_stack([known.f, np.ones(2)])
        drifts = np.abs((slopes * rates).sum(axis=1))
        lengths = np.linalg.norm(slopes * size, axis=1) * np.linalg.norm(rates / size, axis=1)
        return bool((drifts <= TANGENT_DRIFT * lengths).all())

    @property
    def _sizes(self) -> Array:
        """Units of the states: their ranges along the last orbit before the contact."""
        columns = self.run.sampled_columns[: self.form.shooting.variations.n].T
        return sizes_of(columns, columns)

    @property
    def repeats(self) -> bool:
        """Whether the orbits before the contact end there on an orbit of a shorter period.

        At the contact each repetition of that orbit touches the wall, or hits it with speed zero.
        """
        problem = self.curve.problem
        shooting, u = self.form.shooting, self.form.u
        touches = touches_of(self.form)
        if not touches:
            return False
        most = len(touches) + len(approach_speeds(shooting, u))
        if problem.forcing is not None:
            most = problem.multiple
        counts = [count for count in range(2, most + 1) if most % count == 0 or not problem.forcing]
        segments, period = shooting.unpack(u)
        lengths, size = periods_of(self.run.states, self.run.periods), self._sizes
        since, until = self.run.span
        for count in counts:
            after = segments.durations[: touches[0].segment].sum() + touches[0].offset
            times = segments.start + (after + np.arange(count) * period / count) % period
            rows = np.searchsorted(segments.times[1:-1], times, side="right")
            states = problem.at(shooting.parameters_at(u)).states_at(
                segments.modes[rows],
                segments.states[rows],
                segments.times[rows],
                times - segments.times[rows],
                segments.constants[rows],
            )
            # the last orbit before it does not repeat
            later = self.run(since + (until - since) / count) - self.run(since)
            before = np.abs(apart(later, np.zeros(len(later)), lengths) / size).max()
            if np.abs(apart(states, states[0], lengths) / size).max() < min(
                CLOSURE_ERROR, 0.01 * before
            ):
                return True
        return False

    @cached_property
    def _hit(self) -> ContactSide:
        """The orbit at the contact with impacts of speed zero at all walls that it touches."""
        return with_impacts(self.form, touches_of(self.form))

    def _with_impacts(self) -> Neighbour | None:
        """The orbit with slow impacts at all walls that it touches."""
        variations = self.form.shooting.variations
        walls = range(variations.interfaces, variations.interfaces + variations.walls)
        touches = touches_of(self.form)
        if not touches or any(touch.function not in walls for touch in touches):
            return None
        shooting, u = self._hit.shooting, self._hit.u
        frame, system = self.curve.frame(shooting, u, self.run), CurveSystem(shooting)
        along = curves.tangent(system, u, frame)
        for step in (AFTER_CONTACT, 10 * AFTER_CONTACT, 0.1 * AFTER_CONTACT):
            for direction in (along, -along):
                system.solved(u + step * direction, direction, frame, self.settings)
                if system.point is None:
                    continue
                row = self.curve.confirmed(shooting, system.point)
                if row is not None:
                    tangent = system.point.tangent
                    (row,) = completed([row], [float(tangent[-1])])
                    return Neighbour((shooting, row.u, tangent), row)
        return None

    def _without_touch(self, inwards: Array) -> Orbit:
        """The orbit at the contact, whose free run does not pass the interface.

        Where the return map is not continuous, rounding decides whether a run passes it.
        """
        shooting, u = self.form.shooting, self.form.u
        n = shooting.variations.n
        step = inwards.copy()
        step[-1] = 0.0
        for distance in (0.0, *CONTACT_DISTANCES):
            moved = u + distance * step
            orbit = self.curve.orbit(shooting, moved, confirm=False)
            run = orbit.trajectory
            columns = run.sampled_columns[:n].T
            gap = run.end[1 : n + 1] - moved[:n] - shooting.winding
            if run.outcome and (np.abs(gap) <= CLOSURE_ERROR * sizes_of(columns, columns)).all():
                break
        return orbit

    def _beside_node(self) -> bool:
        """Check whether a node is nearer to a touch than half of any new segment."""
        segments, period = self.form.shooting.unpack(self.form.u)
        half = 0.5 * min(NEW_SEGMENT) * period
        return any(
            not half < touch.offset < segments.durations[touch.segment] - half
            for touch in touches_of(self.form)
            if touch.segment >= 0
        )

    def _beyond(self) -> Neighbour | None:
        """The orbit with a short segment across every interface that it touches."""
        touches = [touch for touch in touches_of(self.form) if touch.segment >= 0]
        new = [self._new_segment(touch) for touch in touches]
        known = [one for one in new if one is not None]
        if not touches or len(known) < len(new):
            return None
        segment = self.candidate.segment
        chosen = next((k for k, touch in enumerate(touches) if touch.segment == segment), 0)

        def wider(duration: float) -> tuple[ContactSide, int]:
            form, places = inserted(self.form, touches, known, duration)
            return form, places[chosen]

        return self._with_short_segment(wider)

    def _past_edge(self) -> Neighbour | None:
        """The orbit with a short segment after every event at the edge of the sliding set.

        An entry into sliding becomes a crossing, from which the motion returns to slide; a
        crossing becomes an entry into sliding, which ends where the drift beyond vanishes.
        """
        edges = edges_of(self.form)
        new = [self._new_segment_past(edge) for edge in edges]
        known = [one for one in new if one is not None]
        if not edges or len(known) < len(new):
            return None
        segment = self.candidate.segment
        number = segment + 1 + sum(edge.segment < segment for edge in edges)

        def wider(duration: float) -> tuple[ContactSide, int]:
            form = self.form
            for edge, one in zip(reversed(edges), reversed(known), strict=True):
                form = inserted_after(form, edge.segment, *one, duration)
            return form, number

        return self._with_short_segment(wider)

    def _new_segment_past(self, edge: Violation) -> tuple[int, int] | None:
        """Mode and end of the short segment at an edge of sliding, None if there is none."""
        function = edge.function
        following = int(self.form.shooting.form.modes[edge.segment + 1])
        if self._signs[following, function] == 0:
            return edge.mode, function
        sliding = sliding_between(self._signs, following, function)
        if sliding is None:
            return None
        return sliding, self._end_of_sliding(sliding, following, function)

    def _with_short_segment(
        self, wider: Callable[[float], tuple[ContactSide, int]]
    ) -> Neighbour | None:
        """The orbit with a new segment, and the tangent along which its duration increases.

        ``wider`` returns an approximate orbit with new segments of a given duration, and the
        number of one of them.
        """
        period = self.form.shooting.unpack(self.form.u)[1]
        for fraction in NEW_SEGMENT:
            duration = fraction * period
            form, number = wider(duration)
            shooting = form.shooting
            place = len(shooting.form) * shooting.variations.n + number
            found = self._with_duration(form, place, duration, 1.0)
            if found is not None:
                return found
        return None

    def _with_duration(
        self, form: ContactSide, place: int, duration: float, sign: float
    ) -> Neighbour | None:
        """The orbit with a given duration at a place of the unknowns.

        Its tangent is that along which the duration increases (1) or decreases (-1).
        """
        guess = form.u.copy()
        guess[place] = duration
        frame = self.curve.frame(form.shooting, guess, self.run)
        system = CurveSystem(form.shooting)
        system.solved(guess, np.eye(len(guess))[place], frame, self.settings)
        row = None if system.point is None else self.curve.confirmed(form.shooting, system.point)
        if system.point is None or row is None:
            return None
        along = system.point.tangent
        along = along if along[place] * sign > 0 else -along
        (row,) = completed([row], [float(along[-1])])
        return Neighbour((form.shooting, row.u, along), row)

    @property
    def _signs(self) -> NDArray[np.int64]:
        return self.form.shooting.variations.signs

    def _new_segment(self, touch: Violation) -> tuple[int, int] | None:
        """Mode and end of the short segment at a touch, None if there is none."""
        mode, function = int(self.form.shooting.form.modes[touch.segment]), touch.function
        if function >= self._signs.shape[1]:
            return self._off_sliding(mode, function)
        if self.contact.exponent == 0.0:
            return None
        if not KINDS[self.contact.code].enters_sliding:
            new = other_side(self._signs, mode, function)
            return None if new is None else (new, function)
        new = sliding_between(self._signs, mode, function)
        return None if new is None else (new, self._end_of_sliding(new, mode, function))

    def _off_sliding(self, sliding: int, bound: int) -> tuple[int, int] | None:
        """The region into which sliding ends at a bound, and the interface that it left."""
        place, side = divmod(bound - self._signs.shape[1], 2)
        function = int(np.flatnonzero(self._signs[sliding] == 0)[place])
        wanted = self._signs[sliding].copy()
        wanted[function] = 1 - 2 * side
        found = np.flatnonzero((self._signs == wanted).all(axis=1))
        return (int(found[0]), function) if len(found) else None

    def _end_of_sliding(self, sliding: int, mode: int, function: int) -> int:
        """The bound of sliding at which the drift in a region vanishes."""
        place = np.flatnonzero(self._signs[sliding] == 0).tolist().index(function)
        return self._signs.shape[1] + 2 * place + (0 if self._signs[mode, function] > 0 else 1)

    def _away(self) -> Neighbour | None:
        """The direction in which the orbit without the touch leaves the interface."""
        shooting, u = self.form.shooting, self.form.u
        frame = self.curve.frame(shooting, u, self.run)
        system = CurveSystem(shooting)
        along = curves.tangent(system, u, frame)
        for step in (AFTER_CONTACT, 10 * AFTER_CONTACT):
            for direction in (along, -along):
                guess = u + step * direction
                system.solved(guess, direction, frame, self.settings)
                if system.point and self.curve.confirmed(shooting, system.point) is not None:
                    return Neighbour((shooting, u, direction), None)
        return None
