"""Changes of the itinerary along a branch of periodic orbits: contacts, corners and chatter."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation import curves
from fastslow.continuation.settings import Continuation
from fastslow.orbits.endings import AT_CONTACT, NOT_CONFIRMED
from fastslow.orbits.find.orbit_curve import Beginning, CurveSystem, OrbitCurve, Row, completed
from fastslow.orbits.flow.events import OrbitError
from fastslow.orbits.flow.segments import segments_of
from fastslow.orbits.flow.shooting import Shooting
from fastslow.orbits.points.corners import is_between_surfaces
from fastslow.orbits.points.multiplier_signs import LEVEL_SLOPE
from fastslow.orbits.points.switching import Violation, contact_of, explained, violated
from fastslow.orbits.trace.beyond_contacts import ContactPassage
from fastslow.orbits.trace.beyond_corners import CornerPassage, corner_passage
from fastslow.orbits.trace.restarts import begun_elsewhere, early, renewed
from fastslow.orbits.trace.vanishing_cycles import is_mirrored, vanished
from fastslow.results.base.outcome import Outcome
from fastslow.results.point_types import NON_SMOOTH_FOLD
from fastslow.results.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]

#: Largest number of times that the distance to a violated condition is halved.
NARROWED = 8


@dataclass(frozen=True, eq=False)
class ItineraryChange:
    """The passage of a branch across a change of its itinerary.

    Parameters
    ----------
    curve : OrbitCurve
    settings : Continuation
    rows : list of Row
        Of the branch so far; rows on the way are added.
    """

    curve: OrbitCurve
    settings: Continuation
    rows: list[Row]

    @property
    def run(self) -> Trajectory:
        """The trajectory of the last row."""
        return self.rows[-1].orbit.trajectory

    def replaced(self, found: tuple[Row, Beginning] | Outcome) -> Beginning | Outcome:
        """Replace the last row by the same orbit from another start."""
        if isinstance(found, Outcome):
            return found
        self.rows[-1], beginning = found
        return beginning

    def across(
        self, shooting: Shooting, z: Array, tangents: Array, frame: curves.Frame, bad: Array
    ) -> Beginning | Outcome:
        """Cross a contact between the last good row and a bad one.

        Parameters
        ----------
        shooting : Shooting
        z, tangents : ndarray
            Unknowns and tangents of the rows of the stretch.
        frame : Frame
        bad : ndarray
            The solution that a free run does not confirm.

        Returns
        -------
        (Shooting, ndarray, ndarray) or Outcome
            The equations, unknowns and tangent beyond the contact, or why the branch ends.
        """
        before, after = self.rows[-1].u, bad
        if len(before) != len(after):
            before = z[-2]
        place = f"{self.curve.name} = {before[-1]:.10g}"
        if shooting.chatters:
            again = self.chattering(shooting, before, after)
            if again is not None:
                return again
        if self.curve.problem.forcing is None and is_mirrored(shooting, before, after):
            return vanished(self.curve, self.rows)
        candidate = violated(shooting, before, after)
        ends = 0, len(shooting.form) - 1
        if candidate and candidate.kind == "vanishing" and candidate.segment in ends:
            # no contact: an event passes the start of the orbit
            ahead = shooting, before, tangents[-2]
            return self.replaced(renewed(self.curve, self.rows[-1], ahead))
        if candidate and candidate.kind == "touch":
            ahead = shooting, before, tangents[-2]
            moved = begun_elsewhere(self.curve, self.rows[-1], ahead, candidate)
            if moved is not None:
                return self.replaced(moved)
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
            unknown = ", and no contact was located that explains it"
            return NOT_CONFIRMED.at(where=place, why=f": {why}" if why else unknown)
        contact, form = found
        where = contact, form, candidate, self.settings, self.run, after - before
        return self.past_contact(ContactPassage(self.curve, *where), shooting, before, after)

    def past_contact(
        self, passage: ContactPassage, shooting: Shooting, before: Array, after: Array
    ) -> Beginning | Outcome:
        """Add the rows at a contact."""
        contact, form = passage.contact, passage.form
        arrival = passage.arrival(shooting, before, after)
        slope = self.rows[-1].slope if arrival is None else float(arrival.beginning[2][-1])
        if arrival is not None and arrival.row is not None:
            self.rows.append(arrival.row)
        beyond = passage.following()
        inwards = np.zeros(len(form.u))
        if arrival is not None and len(arrival.beginning[2]) == len(form.u) and not arrival.row:
            inwards = -arrival.beginning[2]
        if beyond is None:
            self.rows.append(passage.row(slope, "", inwards))
            where = f"{self.curve.name} = {contact.u[-1]:.10g}{_reason(passage)}"
            return AT_CONTACT.at(contact=f"the contact {contact.code}", where=where)
        (other, u, along), following = beyond
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
        self.rows.extend(completed([row], [self.rows[-1].slope]))
        return row.u, after

    def past_corner(self, met: CornerPassage) -> Beginning | Outcome:
        """Add the rows at a corner."""
        self.rows.extend(met.rows)
        if met.beginning is None:
            where = f"{self.curve.name} = {met.value:.10g}"
            why = "where the return map is discontinuous or several events meet"
            return AT_CONTACT.at(contact="the corner collision", where=f"{where}, {why}")
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
                found = early(segments_of(run, since, *known), length, here)
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
        return f", where the orbit repeats after {shorter}"
    if passage.at_two_fold:
        return ", a two-fold: both vector fields are tangent to the interface there"
    return ", where the return map is discontinuous" if passage.contact.exponent == 0 else ""


def _changes(modes: NDArray[np.int64]) -> list[int]:
    """A sequence of modes without repetitions."""
    return [int(modes[0]), *(int(two) for one, two in pairwise(modes) if one != two)]
