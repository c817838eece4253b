"""The orbit beyond a contact with an interface, on another sequence of segments."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation import curves
from fastslow.continuation.settings import Continuation
from fastslow.orbits.contacts import Contact, other_side
from fastslow.orbits.orbit_curve import Beginning, CurveSystem, OrbitCurve, Row
from fastslow.orbits.point_curves import PointSource
from fastslow.orbits.shooting import Shooting
from fastslow.orbits.special_points import solve_extended
from fastslow.orbits.switching import (
    Candidate,
    Form,
    inserted,
    inserted_after,
    sliding_between,
    touches_of,
)
from fastslow.results.orbits.special_orbit import SpecialOrbit
from fastslow.results.point_types import GRAZING_SLIDING
from fastslow.results.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]

#: Step in arclength after a contact, beyond which multipliers move like a square root.
AFTER_CONTACT = 1e-4

#: Durations of the segment that begins at a contact, as fractions of the period, in order of
#: trial.
NEW_SEGMENT = (1e-3, 1e-4, 1e-2)


@dataclass(frozen=True, eq=False)
class Passage:
    """The passage of a branch across a contact.

    Parameters
    ----------
    curve : OrbitCurve
    contact : Contact
    form : Form
        The orbit without the touch.
    candidate : Candidate
    settings : Continuation
    run : Trajectory
        Of the last orbit before the contact.
    """

    curve: OrbitCurve
    contact: Contact
    form: Form
    candidate: Candidate
    settings: Continuation
    run: Trajectory

    def arrival(self, shooting: Shooting, u: Array, after: Array) -> Beginning | None:
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
            frame = self.curve.frame(shooting, self.form.u, self.run)
            along = curves.tangent(CurveSystem(shooting), self.form.u, frame)
            return shooting, self.form.u, along if (along * frame.weight) @ gap >= 0 else -along
        place = len(shooting.form) * shooting.variations.n + self.candidate.segment
        duration = NEW_SEGMENT[0] * shooting.unpack(u)[1]
        if u[place] <= duration:
            return None
        share = (u[place] - duration) / (u[place] - after[place])
        found = self._with_duration(Form(shooting, u + share * gap), place, duration)
        if found is None or not self.curve.orbit(shooting, found).outcome:
            return None
        frame = self.curve.frame(shooting, found, self.run)
        along = curves.tangent(CurveSystem(shooting), found, frame)
        return shooting, found, along if along[place] < 0 else -along

    def following(self) -> Beginning | None:
        """The orbit from which the branch continues, None where it ends."""
        if self.candidate.kind == "vanishing":
            return self._away()
        if self.candidate.kind == "touch":
            return self._beyond()
        return self._past_edge()

    def row(self, slope: float, type_: str) -> Row:
        """The row of the contact."""
        contact, form, curve = self.contact, self.form, self.curve
        orbit = curve.orbit(form.shooting, form.u, confirm=False)
        place = self.candidate.segment - (self.candidate.kind == "vanishing")
        function = int(contact.shooting.form.ends[place])
        interfaces = orbit.trajectory.interfaces
        special = SpecialOrbit(
            contact.code,
            "",
            curve.name,
            orbit,
            contact.residual,
            contact.accuracy,
            contact.converged,
            time=contact.time,
            state=contact.state,
            interface=interfaces[function] if function < len(interfaces) else "bound of sliding",
            curvature=contact.curvature,
            exponent=contact.exponent,
            type=type_,
            source=PointSource(curve.problem, contact.shooting, contact.u, contact.place),
        )
        return curve.row(form.shooting, form.u, orbit, slope, special)

    def _beyond(self) -> Beginning | None:
        """The orbit with a short segment across every interface that it touches."""
        touches = [touch for touch in touches_of(self.form) if touch.segment >= 0]
        new = [self._new_segment(touch) for touch in touches]
        known = [one for one in new if one is not None]
        if not touches or len(known) < len(new):
            return None
        segment = self.candidate.segment
        chosen = next((k for k, touch in enumerate(touches) if touch.segment == segment), 0)

        def wider(duration: float) -> tuple[Form, int]:
            form, places = inserted(self.form, touches, known, duration)
            return form, places[chosen]

        return self._with_short_segment(wider)

    def _past_edge(self) -> Beginning | None:
        """The orbit with a short segment after an event at the edge of the sliding set.

        An entry into sliding becomes a crossing, from which the motion returns to slide; a
        crossing becomes an entry into sliding, which ends where the drift beyond vanishes.
        """
        k, function = self.candidate.segment, self.candidate.function
        following = int(self.form.shooting.form.modes[k + 1])
        if self._signs[following, function] == 0:
            mode, end = self.candidate.mode, function
        else:
            sliding = sliding_between(self._signs, following, function)
            if sliding is None:
                return None
            mode, end = sliding, self._end_of_sliding(sliding, following, function)
        return self._with_short_segment(
            lambda duration: (inserted_after(self.form, k, mode, end, duration), k + 1)
        )

    def _with_short_segment(self, wider: Callable[[float], tuple[Form, int]]) -> Beginning | None:
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
            u = self._with_duration(form, place, duration)
            if u is None or not self.curve.orbit(shooting, u).outcome:
                continue
            frame = self.curve.frame(shooting, u, self.run)
            along = curves.tangent(CurveSystem(shooting), u, frame)
            return shooting, u, along if along[place] > 0 else -along
        return None

    @property
    def _signs(self) -> NDArray[np.int64]:
        return self.form.shooting.variations.signs

    def _new_segment(self, touch: Candidate) -> tuple[int, int] | None:
        """Mode and end of the short segment at a touch, None if there is none."""
        mode, function = int(self.form.shooting.form.modes[touch.segment]), touch.function
        if function >= self._signs.shape[1] or self.contact.exponent == 0.0:
            return None
        if self.contact.code != GRAZING_SLIDING:
            new = other_side(self._signs, mode, function)
            return None if new is None else (new, function)
        new = sliding_between(self._signs, mode, function)
        return None if new is None else (new, self._end_of_sliding(new, mode, function))

    def _end_of_sliding(self, sliding: int, mode: int, function: int) -> int:
        """The bound of sliding at which the drift in a region vanishes."""
        place = np.flatnonzero(self._signs[sliding] == 0).tolist().index(function)
        return self._signs.shape[1] + 2 * place + (0 if self._signs[mode, function] > 0 else 1)

    def _with_duration(self, form: Form, place: int, duration: float) -> Array | None:
        """Solve for the orbit with a given duration at a place of the unknowns."""
        shooting = form.shooting.with_phase(form.u)
        scale = self.curve.frame(shooting, form.u, self.run).scale
        row = np.zeros(shooting.size + 1)
        row[place] = 1.0

        def system(u: Array) -> tuple[Array, Array, NDArray[np.complex128]]:
            last = shooting.linearised(u)
            matrix = np.vstack([last.jacobian, row]) * scale
            rows = np.abs(matrix).max(axis=1)
            values = np.append(last.residual, u[place] - duration) / rows
            return values, matrix / rows[:, None], np.zeros(0, dtype=complex)

        u, _, _, _, converged = solve_extended(system, form.u, scale)
        return u if converged else None

    def _away(self) -> Beginning | None:
        """The direction in which the orbit without the touch leaves the interface."""
        shooting, u = self.form.shooting, self.form.u
        frame = self.curve.frame(shooting, u, self.run)
        system = CurveSystem(shooting)
        along = curves.tangent(system, u, frame)
        for step in (AFTER_CONTACT, 10 * AFTER_CONTACT):
            for direction in (along, -along):
                guess = u + step * direction
                found = curves.corrected(system, guess, direction, frame, self.settings)
                if found is not None and self.curve.orbit(shooting, found[0]).outcome:
                    return shooting, u, direction
        return None
