"""Continuation of periodic orbits in one parameter, across changes of their itinerary."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import Name, finite, formula, instance, interval, items, validated
from fastslow.continuation import curves
from fastslow.continuation.settings import Continuation
from fastslow.errors import ArgumentError
from fastslow.model.model import Model
from fastslow.orbits import detection
from fastslow.orbits.contacts import Contact, other_side
from fastslow.orbits.finding import find_orbit
from fastslow.orbits.flows import fields
from fastslow.orbits.point_curves import PointSource
from fastslow.orbits.problem import OrbitProblem, growth_of
from fastslow.orbits.segments import (
    GROWTH,
    OrbitError,
    restarted,
    segments_of,
    winding_of,
)
from fastslow.orbits.shooting import Linearised, Shooting, Solution, sizes_of, solved
from fastslow.orbits.special_points import Located, is_branch_point, solve_extended
from fastslow.orbits.switching import (
    Candidate,
    Form,
    contact_of,
    inserted,
    inserted_after,
    sliding_between,
    touches_of,
    violated,
)
from fastslow.results.base.outcome import Outcome
from fastslow.results.orbits.orbit import Orbit
from fastslow.results.orbits.orbit_branch import OrbitBranch, branch_of
from fastslow.results.orbits.special_orbit import SpecialOrbit
from fastslow.results.point_types import (
    BRANCH_POINT_OF_CYCLES,
    FOLD_OF_CYCLES,
    GRAZING_SLIDING,
    PERIOD_DOUBLING,
    TORUS,
    USER_VALUE,
)
from fastslow.simulation.settings import Integration, integration_settings

Array = NDArray[np.float64]

#: Largest distance of an orbit from its prediction, as a fraction of the step.
ASIDE = 0.3

#: Step in arclength after a contact, beyond which multipliers move like a square root.
AFTER_CONTACT = 1e-4

#: Durations of the segment that begins at a contact, as fractions of the period, in order of
#: trial.
NEW_SEGMENT = (1e-3, 1e-4, 1e-2)

#: Component of the tangent along the parameter from which its sign identifies a direction.
STEEP = 1e-3

#: Fraction of the segment with the start of the orbit, within which events keep away from it.
NEAR_START = 0.2

#: Growth along a segment from which nodes are inserted anew.
TOO_MUCH = 100.0 * GROWTH

#: Range of a cycle in units of its states at which it is a point.
POINT = 1e-4

#: Distance in units of the ranges between the starts of two cycles on both sides of a Hopf point.
MIRRORED = 0.5

#: A multiplier within this distance of the unit circle is on it.
ON_CIRCLE = 1e-9


@validated(
    orbit=instance(Orbit),
    parameter=formula,
    over=interval,
    continuation=instance(Continuation),
    integration=integration_settings,
    marks=items(finite),
)
def continue_orbits(
    orbit: Orbit,
    parameter: Name,
    over: tuple[float, float],
    *,
    continuation: Continuation | None = None,
    integration: Integration | None = None,
    marks: Sequence[float] = (),
) -> OrbitBranch:
    """Trace the branch of a periodic orbit in both directions of a parameter.

    Pseudo-arclength continuation of the equations of multiple shooting, through folds. Every
    orbit is confirmed by a free run. Where the orbit touches an interface, the contact is solved
    for and the branch continues with the itinerary beyond it, forwards or backwards in the
    parameter.

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
    marks : sequence of float, optional
        Values of the parameter for rows of their own.

    Returns
    -------
    OrbitBranch

    Raises
    ------
    ArgumentError
        For an orbit that was not found, or outside the range, or with forcing frequencies
        that are incommensurable at other values of the parameter.
    UnknownNameError
        For an unknown parameter.

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
    if not orbit.outcome:
        raise ArgumentError(f"the orbit was not found, so that it has no branch: {orbit.outcome}")
    low, high = over
    settings = continuation or Continuation()
    problem = OrbitProblem.of(model, orbit.multiple or 1, None, integration, (name,))
    value = model.parameters[name]
    if not low <= value <= high:
        raise ArgumentError(
            f"the orbit is at {name} = {value:g}, outside over = ({low:g}, {high:g})"
        )
    for mark in marks:
        if not low <= mark <= high:
            raise ArgumentError(f"mark {name} = {mark:g} is outside the range [{low:g}, {high:g}]")
    first = _first_row(problem, orbit)
    forwards = _Tracer(problem, name, over, settings, tuple(marks))
    forwards.trace(first, 1.0)
    if forwards.closed:
        return forwards.branch([], Outcome("closed loop", "the branch is a closed curve.", True))
    backwards = _Tracer(problem, name, over, settings, tuple(marks))
    backwards.trace(first, -1.0)
    return forwards.branch(backwards.rows[:0:-1], backwards.outcome)


@dataclass(frozen=True, eq=False)
class Row:
    """A row of a branch: the equations and unknowns of an orbit, with its special point."""

    shooting: Shooting
    u: Array
    orbit: Orbit
    slope: float
    point: SpecialOrbit | None = None

    @property
    def value(self) -> float:
        return float(self.u[-1])


@dataclass(eq=False)
class _System:
    """The equations of a branch for `curves`, with exact derivatives."""

    shooting: Shooting
    known: Linearised | None = None
    key: bytes = b""

    def residual(self, z: Array, guide: Array) -> Array:
        if z.ndim > 1:
            return np.array([self.residual(one, guide) for one in z])
        return self._at(z, guide).residual

    def slopes(self, z: Array, guide: Array) -> Array:
        return self._at(z, guide).jacobian

    def renewed(self, z: Array) -> Array:
        return z

    def _at(self, z: Array, guide: Array) -> Linearised:
        key = z.tobytes() + guide.tobytes()
        if self.known is None or key != self.key:
            self.known, self.key = guided(self.shooting, guide).linearised(z), key
        return self.known


def guided(shooting: Shooting, guide: Array) -> Shooting:
    """The equations with the phase condition of a reference orbit."""
    if shooting.forcing is not None:
        return shooting
    segments, _ = shooting.unpack(guide)
    first = segments.modes[:1], segments.states[:1], np.zeros(1)
    rate = fields(shooting.variations, *first, shooting.parameters_at(guide)).f[0]
    size = sizes_of(segments.states, segments.states)
    return replace(shooting, form=segments, direction=rate / size**2 / np.linalg.norm(rate / size))


def _first_row(problem: OrbitProblem, orbit: Orbit) -> Row:
    """Solve for the orbit with the parameter among the unknowns."""
    run, period = orbit.trajectory, orbit.period
    winding = winding_of(run, orbit.t0, period)
    parts = problem.variations, problem.parameters
    segments = segments_of(run, orbit.t0, period, winding, *parts)
    try:
        shooting, solution = problem.solve(segments, period, winding, run)
    except OrbitError as error:
        raise ArgumentError(f"the orbit is none at its parameters: {error.outcome}") from None
    solved_segments, length = shooting.unpack(solution.u)
    found = problem.orbit(solved_segments, length, solution)
    if not found.outcome:
        raise ArgumentError(f"the orbit is none at its parameters: {found.outcome}")
    return Row(shooting, solution.u, found, 0.0)


@dataclass(eq=False)
class _Tracer:
    """The trace of a branch in one direction, row by row."""

    problem: OrbitProblem
    name: str
    over: tuple[float, float]
    settings: Continuation
    marks: tuple[float, ...]
    rows: list[Row] = field(default_factory=list)
    outcome: Outcome = field(default_factory=lambda: Outcome("end of range", "", True))
    closed: bool = False
    #: Why the last stretch was stopped: a bad row, or a row from which to start anew.
    bad: Array | None = None
    renew: bool = False
    #: Whether the last stretch ended at an equilibrium.
    shrunk: bool = False

    def trace(self, first: Row, sign: float) -> None:
        """Trace from a row, with the parameter at first in the direction of a sign."""
        self.rows = [first]
        frame = self.frame(first.shooting, first.u)
        along = curves.tangent(_System(first.shooting), first.u, frame)
        along = along if along[-1] * sign >= 0 else -along
        self.rows = [replace(first, slope=float(along[-1]))]
        step = self.settings.step
        shooting, u = first.shooting, first.u
        while True:
            self.bad, self.renew = None, False
            system = _System(shooting)
            left = self.settings.max_points - len(self.rows)
            if left < 2:
                self.outcome = Outcome(
                    "too many points",
                    f"stopped at {self.name} = {u[-1]:.6g} after {len(self.rows)} points; raise "
                    "max_points= of Continuation.",
                    False,
                )
                return
            settings = replace(self.settings, step=step, max_points=left)
            frame = self.frame(shooting, u)
            along = along / np.sqrt(along**2 @ frame.weight)
            z, tangents, status = curves.follow(
                *(system, u, along, frame, settings, lambda z, s=shooting: self.judged(s, z)),
                aside=ASIDE,
            )
            if status == curves.RANGE and len(z) > 1:
                self.judged(shooting, z[-1])
            self.add_slopes(tangents[:, -1], self.bad is not None)
            if self.shrunk:
                self.outcome = Outcome(
                    "Hopf point",
                    f"the cycles shrink to an equilibrium, a Hopf point, at {self.name} = "
                    f"{self.rows[-1].value:.6g}.",
                    True,
                )
                return
            if self.bad is not None:
                after = self.across(shooting, z, tangents, frame)
                if after is None:
                    return
                shooting, u, along = after
                step = max(AFTER_CONTACT, self.settings.min_step)
                continue
            if self.renew:
                renewed = self.renewed(shooting, z[-1], tangents[-1])
                if renewed is None:
                    return
                shooting, u, along = renewed
                gap = (z[-1] - z[-2])[: frame.size]
                step = float(np.sqrt((gap**2) @ frame.weight[: frame.size]))
                step = min(max(step, self.settings.min_step), self.settings.max_step)
                continue
            self.finish(status, float(z[-1][-1]))
            return

    def frame(self, shooting: Shooting, u: Array) -> curves.Frame:
        """Units of the unknowns: a step is a change of the orbit, averaged over segments."""
        segments, period = shooting.unpack(u)
        K, size = len(segments), shooting.size + 1
        n = shooting.variations.n
        scale = np.append(shooting.scales(segments, period), self.over[1] - self.over[0])
        run = self.rows[-1].orbit.trajectory
        along = run.sampled_columns[:n].T
        scale[: K * n] = np.tile(sizes_of(along, along), K)
        scale[: shooting.size] *= np.sqrt(K)
        lower, upper = np.full(size, -np.inf), np.full(size, np.inf)
        lower[-1], upper[-1] = self.over
        return curves.Frame(size, scale, lower, upper)

    def orbit(self, shooting: Shooting, u: Array, *, confirm: bool = True) -> Orbit:
        """Return the orbit of unknowns, with its multipliers, confirmed by a free run."""
        segments, period = shooting.unpack(u)
        here = self.problem.at(shooting.parameters_at(u))
        last = guided(shooting, u).linearised(u)
        N = shooting.size
        scale = shooting.scales(segments, period)
        matrix = last.jacobian[:, :N] * scale
        rows = np.abs(matrix).max(axis=1)
        step = np.linalg.lstsq(
            np.column_stack([matrix, last.jacobian[:, N]]) / rows[:, None],
            -last.residual / rows,
            rcond=None,
        )[0]
        residual = float(np.abs(last.residual / rows).max())
        solution = Solution(u, last, residual, float(np.abs(step).max()))
        return here.orbit(segments, period, solution, confirm=confirm)

    def judged(self, shooting: Shooting, u: Array) -> bool:
        """Add the orbit of a point as a row; return True if the stretch ends there."""
        segments, _ = shooting.unpack(u)
        if (segments.durations <= 0).any():
            self.bad = u
            return True
        found = self.orbit(shooting, u)
        if not found.outcome:
            self.bad = u
            return True
        self.shrunk = self.problem.forcing is None and self.at_equilibrium(shooting, u, found)
        if self.shrunk:
            return True
        self.rows.append(Row(shooting, u, found, np.nan))
        whole = segments.without_nodes()
        begin, end = whole.durations[0], whole.durations[-1]
        near = min(begin, end) < NEAR_START * (begin + end)
        last = guided(shooting, u).linearised(u)
        wild = growth_of(last, segments).max() > TOO_MUCH
        self.renew = bool(len(whole) > 1 and near) or bool(wild)
        return self.renew

    def at_equilibrium(self, shooting: Shooting, u: Array, orbit: Orbit) -> bool:
        """Check whether a cycle is a point to rounding, or grows again mirrored beyond it."""
        last = self.rows[-1]
        reach, before = (
            np.ptp(one.trajectory.sampled_columns[: shooting.variations.n], axis=1).max()
            for one in (orbit, last.orbit)
        )
        if reach < before and reach <= POINT * np.abs(shooting.unpack(u)[0].states).max():
            return True
        if len(last.u) != len(u):
            return False
        one, two = guided(shooting, last.u), guided(shooting, u)
        n = shooting.variations.n
        run = last.orbit.trajectory.sampled_columns[:n].T
        gap = np.abs(one.form.states[0] - two.form.states[0]) / sizes_of(run, run)
        return bool(one.direction @ two.direction < 0 and gap.max() >= MIRRORED)

    def add_slopes(self, slopes: Array, bad: bool) -> None:
        """Store the components of tangents along the parameter; the first row has one already."""
        new = [k for k, row in enumerate(self.rows) if np.isnan(row.slope)]
        for k, slope in zip(new, slopes[1:], strict=False):
            self.rows[k] = replace(self.rows[k], slope=float(slope))

    def renewed(
        self, shooting: Shooting, u: Array, along: Array
    ) -> tuple[Shooting, Array, Array] | None:
        """The same orbit with another start, or other nodes, and its tangent; None without."""
        here = self.problem.at(shooting.parameters_at(u))
        segments, period = shooting.unpack(u)
        moved = restarted(segments, period, shooting.winding, here.variations, here.parameters)
        # where perturbations grow, the states of a run are a better guess than the flow
        run = self.rows[-1].orbit.trajectory if moved.start == segments.start else None
        try:
            other, solution = here.solve(moved, period, shooting.winding, run)
        except OrbitError as error:
            message = f"at {self.name} = {u[-1]:.10g} {error.outcome.message}"
            self.outcome = replace(error.outcome, message=message)
            return None
        frame = self.frame(other, solution.u)
        turned = curves.tangent(_System(other), solution.u, frame)
        turned = turned if turned[-1] * along[-1] >= 0 else -turned
        self.rows[-1] = replace(self.rows[-1], shooting=other, u=solution.u)
        return other, solution.u, turned

    def across(
        self, shooting: Shooting, z: Array, tangents: Array, frame: curves.Frame
    ) -> tuple[Shooting, Array, Array] | None:
        """Cross a contact between the last good row and a bad one; None if the branch ends."""
        assert self.bad is not None
        before, after = self.rows[-1].u, self.bad
        if len(before) != len(after):
            before = z[-2]
        place = f"{self.name} = {before[-1]:.10g}"
        candidate = violated(shooting, before, after)
        ends = 0, len(shooting.form) - 1
        if candidate and candidate.kind == "vanishing" and candidate.segment in ends:
            # no contact: an event passes the start of the orbit
            return self.renewed(shooting, before, tangents[-2])
        found = None
        if candidate is not None:
            found = contact_of(shooting, candidate, before, after, frame.scale)
        if candidate is None or found is None or not found[0].converged:
            self.outcome = Outcome(
                "itinerary not confirmed",
                f"beyond {place} a free run has another itinerary than the orbit, and no contact "
                "with an interface was located that explains it.",
                False,
            )
            return None
        contact, form = found
        point = self.contact_row(contact, form, candidate.segment, candidate.kind)
        # beyond the contact the equations continue to no orbits, and may turn back
        way = np.sign(contact.u[-1] - before[-1]) or 1.0
        if candidate.kind == "vanishing":
            ahead = self.away(form)
        elif candidate.kind == "touch":
            ahead = self.beyond(contact, form, candidate.segment)
        else:
            ahead = self.past_edge(form, candidate)
        if ahead is None:
            self.rows.append(point)
            self.outcome = Outcome(
                "end at a contact",
                f"no orbit was found beyond the contact {contact.code} at {self.name} = "
                f"{contact.u[-1]:.10g}"
                + (", where the return map is discontinuous." if contact.exponent == 0 else "."),
                False,
            )
            return None
        other, u, along = ahead
        # the direction of the parameter beyond the contact
        away = candidate.kind == "vanishing"
        on = np.sign(along[-1]) if away else np.sign(u[-1] - contact.u[-1])
        assert point.point is not None
        words = "transition" if on == way else "non-smooth fold"
        self.rows.append(replace(point, point=replace(point.point, type=words)))
        if not away:
            self.rows.append(Row(other, u, self.orbit(other, u), float(along[-1])))
        return other, u, along

    def contact_row(self, contact: Contact, form: Form, segment: int, kind: str) -> Row:
        """The row of a contact."""
        orbit = self.orbit(form.shooting, form.u, confirm=False)
        ends = contact.shooting.form.ends
        place = segment - (kind == "vanishing")
        function = int(ends[place])
        interfaces = orbit.trajectory.interfaces
        special = SpecialOrbit(
            contact.code,
            "",
            self.name,
            orbit,
            contact.residual,
            contact.accuracy,
            contact.converged,
            time=contact.time,
            state=contact.state,
            interface=interfaces[function] if function < len(interfaces) else "bound of sliding",
            curvature=contact.curvature,
            exponent=contact.exponent,
            source=PointSource(self.problem, contact.shooting, contact.u, contact.place),
        )
        return Row(form.shooting, form.u, orbit, self.rows[-1].slope, special)

    def beyond(
        self, contact: Contact, form: Form, segment: int
    ) -> tuple[Shooting, Array, Array] | None:
        """The orbit with a short segment across every interface that it touches."""
        variations = self.problem.variations
        period = form.shooting.unpack(form.u)[1]
        touches = [touch for touch in touches_of(form) if touch.segment >= 0]
        new = [self.new_segment(form, touch, contact) for touch in touches]
        if not touches or None in new:
            return None
        chosen = next((k for k, touch in enumerate(touches) if touch.segment == segment), 0)
        for fraction in NEW_SEGMENT:
            duration = fraction * period
            wider, places = inserted(form, touches, [n for n in new if n is not None], duration)
            place = len(wider.shooting.form) * variations.n + places[chosen]
            solved_u = self.with_duration(wider, place, duration)
            if solved_u is None or not self.orbit(wider.shooting, solved_u).outcome:
                continue
            frame = self.frame(wider.shooting, solved_u)
            along = curves.tangent(_System(wider.shooting), solved_u, frame)
            return wider.shooting, solved_u, along if along[place] > 0 else -along
        return None

    def past_edge(self, form: Form, edge: Candidate) -> tuple[Shooting, Array, Array] | None:
        """The orbit with a short segment after an event at the edge of the sliding set.

        An entry into sliding becomes a crossing, from which the motion comes back to slide; a
        crossing becomes an entry into sliding, which ends where the drift beyond vanishes.
        """
        variations = self.problem.variations
        signs, interfaces = variations.signs, len(variations.continuous)
        k, function = edge.segment, edge.function
        following = int(form.shooting.form.modes[k + 1])
        mode: int | None = edge.mode
        end = function
        if signs[following, function] != 0:
            mode = sliding_between(signs, following, function)
            if mode is None:
                return None
            place = np.flatnonzero(signs[mode] == 0).tolist().index(function)
            end = interfaces + 2 * place + (0 if signs[following, function] > 0 else 1)
        assert mode is not None
        period = form.shooting.unpack(form.u)[1]
        for fraction in NEW_SEGMENT:
            duration = fraction * period
            wider = inserted_after(form, k, mode, end, duration)
            place = len(wider.shooting.form) * variations.n + k + 1
            solved_u = self.with_duration(wider, place, duration)
            if solved_u is None or not self.orbit(wider.shooting, solved_u).outcome:
                continue
            frame = self.frame(wider.shooting, solved_u)
            along = curves.tangent(_System(wider.shooting), solved_u, frame)
            return wider.shooting, solved_u, along if along[place] > 0 else -along
        return None

    def new_segment(self, form: Form, touch: Candidate, contact: Contact) -> tuple[int, int] | None:
        """Mode and end of the short segment at a touch, None if there is none."""
        variations = self.problem.variations
        signs, interfaces = variations.signs, len(variations.continuous)
        mode, function = int(form.shooting.form.modes[touch.segment]), touch.function
        if function >= interfaces or contact.exponent == 0.0:
            return None
        if contact.code != GRAZING_SLIDING:
            new = other_side(signs, mode, function)
            return None if new is None else (new, function)
        new = sliding_between(signs, mode, function)
        if new is None:
            return None
        # sliding ends where the drift of this side vanishes
        place = np.flatnonzero(signs[new] == 0).tolist().index(function)
        return new, interfaces + 2 * place + (0 if signs[mode, function] > 0 else 1)

    def with_duration(self, form: Form, place: int, duration: float) -> Array | None:
        """Solve for the orbit with a given duration at a place of the unknowns."""
        shooting = guided(form.shooting, form.u)
        scale = self.frame(shooting, form.u).scale
        N = shooting.size
        row = np.zeros(N + 1)
        row[place] = 1.0

        def system(u: Array) -> tuple[Array, Array, NDArray[np.complex128]]:
            last = shooting.linearised(u)
            matrix = np.vstack([last.jacobian, row]) * scale
            rows = np.abs(matrix).max(axis=1)
            values = np.append(last.residual, u[place] - duration) / rows
            return values, matrix / rows[:, None], np.zeros(0, dtype=complex)

        u, _, _, _, converged = solve_extended(system, form.u, scale)
        return u if converged else None

    def away(self, form: Form) -> tuple[Shooting, Array, Array] | None:
        """The direction in which the orbit without the touch leaves the interface."""
        frame = self.frame(form.shooting, form.u)
        system = _System(form.shooting)
        along = curves.tangent(system, form.u, frame)
        for step in (AFTER_CONTACT, 10 * AFTER_CONTACT):
            for direction in (along, -along):
                guess = form.u + step * direction
                found = curves.corrected(system, guess, direction, frame, self.settings)
                if found is not None and self.orbit(form.shooting, found[0]).outcome:
                    return form.shooting, form.u, direction
        return None

    def finish(self, status: str, value: float) -> None:
        """Set the outcome of the end of a trace."""
        at = f"{self.name} = {value:.6g}"
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
        rows = self.with_points([*turned, *self.rows])
        return branch_of(
            self.name,
            [row.orbit for row in rows],
            [row.point for row in rows],
            (outcome, self.outcome),
            self.closed,
            partial(_orbit_at, self.problem, self.name),
        )

    def with_points(self, rows: list[Row]) -> list[Row]:
        """Insert the rows of bifurcations and of marks."""
        found = [rows[0]]
        for one, two in pairwise(rows):
            found += sorted(
                [*self.bifurcations(one, two), *self.marked(one, two)],
                key=lambda row: (row.value - one.value) * (1.0 if two.value >= one.value else -1.0),
            )
            found.append(two)
        return found

    def marked(self, one: Row, two: Row) -> list[Row]:
        """Rows at given values of the parameter between two rows."""
        inside = [
            m for m in self.marks if min(one.value, two.value) < m < max(one.value, two.value)
        ]
        found = []
        for mark in inside:
            row = self.at_value(one, two, mark)
            if row is not None:
                found.append(
                    replace(row, point=self.special(USER_VALUE, row.orbit, 0.0, 0.0, True))
                )
        return found

    def at_value(self, one: Row, two: Row, value: float) -> Row | None:
        """Solve for the orbit at a value of the parameter between two rows."""
        near = one if two.point is None or len(one.u) == len(two.u) else two
        share = (value - one.value) / (two.value - one.value)
        same = len(one.u) == len(two.u) and one.shooting.form.start == two.shooting.form.start
        u = one.u + share * (two.u - one.u) if same else near.u.copy()
        u[-1] = value
        segments, period = near.shooting.unpack(u)
        shooting = guided(near.shooting, u)
        try:
            solution = solved(shooting, u, shooting.scales(segments, period))
        except OrbitError:
            return None
        orbit = self.orbit(shooting, solution.u)
        return Row(shooting, solution.u, orbit, one.slope) if orbit.outcome else None

    def special(
        self, code: str, orbit: Orbit, residual: float, accuracy: float, converged: bool
    ) -> SpecialOrbit:
        return SpecialOrbit(code, "", self.name, orbit, residual, accuracy, converged)

    def bifurcations(self, one: Row, two: Row) -> list[Row]:
        """Rows of the bifurcations between two rows."""
        if len(one.u) != len(two.u):
            # across a contact: those before it
            one, two = (one, replace(two, shooting=one.shooting)) if two.point else (two, two)
            if one is two:
                return []
        tests = [_tests(row.orbit) for row in (one, two)]
        codes = []
        turns = one.slope * two.slope < 0 and two.point is None and one.point is None
        if turns:
            codes.append(FOLD_OF_CYCLES)
        elif tests[0][0] * tests[1][0] < 0 and two.point is None and one.point is None:
            codes.append(BRANCH_POINT_OF_CYCLES)
        if tests[0][1] * tests[1][1] < 0:
            codes.append(PERIOD_DOUBLING)
        pairs = [round(test[2]) for test in tests]
        if pairs[0] != pairs[1]:
            codes.append(TORUS)
        found = (self.located(code, one, two) for code in codes)
        return [row for row in found if row is not None]

    def located(self, code: str, one: Row, two: Row) -> Row | None:
        """Solve for a bifurcation between two rows; unconverged, it is the second row."""
        shooting = guided(one.shooting, one.u)
        scale = self.frame(shooting, one.u).scale
        if len(one.u) == len(two.u) and one.shooting.form.start == two.shooting.form.start:
            gap = (two.u - one.u) / scale
            rows = [detection.row_of(shooting, row.u, scale, gap) for row in (one, two)]
            point = detection.located_between(shooting, code, rows[0], rows[1], scale)
        else:
            angle = _critical_angle(one.orbit, two.orbit)
            point = detection.located_from(shooting, code, one.u, scale, angle)
            point = replace(point, converged=point.converged and _between(point, one, two))
        if not point.converged:
            return replace(two, point=self.special(code, two.orbit, np.nan, np.nan, False))
        branches = code in (FOLD_OF_CYCLES, BRANCH_POINT_OF_CYCLES) and is_branch_point(
            shooting, point, scale
        )
        if branches:
            # the parameter turns on the branch of lower symmetry
            code = BRANCH_POINT_OF_CYCLES
        elif code == BRANCH_POINT_OF_CYCLES:
            return None
        orbit = self.orbit(shooting, point.u, confirm=False)
        special = self.special(code, orbit, point.residual, point.accuracy, point.converged)
        angle = abs(float(np.angle(point.multiplier))) if code == TORUS else np.nan
        source = PointSource(self.problem, shooting, point.u)
        return Row(shooting, point.u, orbit, 0.0, replace(special, angle=angle, source=source))


def _tests(orbit: Orbit) -> tuple[float, float, float]:
    """Signs of det(M − I) and det(M + I), and the number of complex pairs outside the circle."""
    values = orbit.multipliers
    if orbit.trivial is not None:
        values = np.delete(values, orbit.trivial)
    real = values[np.abs(values.imag) <= 1e-9 * np.abs(values)].real
    pairs = values[(values.imag > 1e-9 * np.abs(values)) & (np.abs(values) > 1.0 + ON_CIRCLE)]
    off = real[np.abs(real - 1.0) > 1e-7]
    fold = float(np.prod(np.sign(off - 1.0)))
    doubling = float(np.prod(np.sign(real + 1.0)))
    # a pair outside the circle may meet on the real axis and separate
    outside = len(pairs) + 0.5 * int((np.abs(real) > 1.0 + ON_CIRCLE).sum())
    return fold, doubling, float(np.floor(outside))


def _critical_angle(one: Orbit, two: Orbit) -> float:
    """Argument of the complex multiplier nearest to the unit circle."""
    values = np.concatenate([one.multipliers, two.multipliers])
    values = values[values.imag > 0]
    if not len(values):
        return 0.5 * np.pi
    return float(np.angle(values[np.argmin(np.abs(np.log(np.abs(values))))]))


def _between(point: Located, one: Row, two: Row) -> bool:
    """Check that a located point is near two rows, whose distance is the unit."""
    low, high = sorted((one.value, two.value))
    slack = 2.0 * (high - low) + 1e-6 * abs(high)
    return bool(low - slack <= point.u[-1] <= high + slack)


def _orbit_at(problem: OrbitProblem, name: str, orbit: Orbit, value: float) -> Orbit:
    """Return the orbit at a value of the parameter, near another one."""
    model = problem.model.with_parameters({name: value})
    return find_orbit(model, orbit, multiple=orbit.multiple or 1)
