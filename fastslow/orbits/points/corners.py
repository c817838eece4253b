"""Corner collisions (CC): periodic orbits at which two events coincide.

The events are crossings of two interfaces or impacts on walls, or one of them and an instant of a
clock or a table. Beyond the corner their order is another. Where the state after both is the same
for both orders, the return map is continuous, and its derivatives on the two sides are those of
the two sequences of segments: they differ if the saltation matrices do, as where a force jumps
along an interface, and agree, up to a jump of the second derivatives, for springs with a gap
(di Bernardo, Budd & Champneys 2001). On one side at least a segment has the duration zero at the
corner, or the state at an event is on an interface, or a bound of sliding.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastslow.orbits.flow.events import Events, OrbitError, events_of
from fastslow.orbits.flow.flows import after_jumps, fields, flow
from fastslow.orbits.flow.problem import OrbitProblem
from fastslow.orbits.flow.segments import Segments
from fastslow.orbits.flow.shooting import Shooting
from fastslow.orbits.flow.variations import Variations
from fastslow.orbits.points.contacts import ContactEquations
from fastslow.orbits.points.location import Extended, row_units, solve_extended

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

#: Duration, in units of the period, that is zero at a corner; and value of a switching function
#: there, in units of its change over the orbit.
ZERO_AT_CORNER = 1e-9

#: Distances in arclength from a corner at which runs show the order of events, in order of trial;
#: and length of these runs before and after the corner, in units of the period.
CORNER_DISTANCES, CORNER_RUN = (1e-6, 1e-5, 1e-4, 1e-3), 1e-2

#: Rate of change of a switching function, in units of its change over the orbit in one period,
#: at which it is tangent.
TANGENT_RATE = 1e-6

#: Change of the state by the other order of events, in units of its ranges, that is rounding.
CONTINUOUS_CORNER = 1e-6

#: Jump of rates, of their derivatives or of multipliers, relative to them, that is rounding.
SMOOTH_JUMP = 1e-8

#: End, and following mode, of every event.
Order = tuple[tuple[int, int], ...]


class SurfaceApproach(NamedTuple):
    """A switching function at an event of another one.

    Parameters
    ----------
    segment : int
        The one that ends at the event.
    function, mode : int
        Switching function, or bound of sliding, in a mode before or after the event.
    beyond : bool
        Whether it is after.
    drifts : bool
        Whether it is the rate of change of the function, where the motion leaves the interface.
    value : float
        Positive where the mode is valid, in units of its change over the orbit.
    """

    segment: int
    function: int
    mode: int
    beyond: bool
    drifts: bool
    value: float


@dataclass(frozen=True, eq=False)
class Corner:
    """A solved corner collision, in the segments of one side.

    Parameters
    ----------
    shooting : Shooting
    u : ndarray
    places : tuple of (int, int)
        Segments before and after every corner, by symmetry several; those between have the
        duration zero.
    surfaces : tuple of int
        Switching functions that vanish at the first corner.
    residual, accuracy : float
    converged : bool
    """

    shooting: Shooting
    u: Array
    places: tuple[tuple[int, int], ...]
    surfaces: tuple[int, ...]
    residual: float
    accuracy: float
    converged: bool

    @property
    def time(self) -> float:
        """Time of the first corner."""
        return float(self.shooting.unpack(self.u)[0].times[self.places[0][0] + 1])

    @property
    def state(self) -> Array:
        """State at the first corner, before a reset."""
        return np.asarray(self.shooting.linearised(self.u).flows.ends[self.places[0][0]])

    def order(self, place: tuple[int, int]) -> Order:
        """The events at a corner."""
        form, (first, last) = self.shooting.form, place
        after = form.modes[first + 1 : last + 1].tolist()
        return tuple(zip(form.ends[first:last].tolist(), after, strict=True))

    @property
    def new(self) -> Integers:
        """Segments of duration zero."""
        return np.array([k for a, b in self.places for k in range(a + 1, b)], dtype=np.int64)

    @property
    def is_smooth(self) -> bool:
        """Whether rates and derivatives are the same before and after an instant there.

        At a knot of a spline only higher derivatives jump.
        """
        shooting, variations = self.shooting, self.shooting.variations
        first = variations.interfaces + variations.walls
        instants = range(first, first + variations.instants.count)
        if not set(self.surfaces) & set(instants) or (shooting.form.jumps >= 0).any():
            return False
        p, q = self.places[0]
        form, known = shooting.form, []
        for row in (p, q):
            for mode in (p, q):
                known.append(
                    fields(
                        variations,
                        form.modes[[mode]],
                        self.state[None],
                        np.array([self.time]),
                        shooting.parameters_at(self.u),
                        form.constants[[row]],
                    )
                )
        n = variations.n
        jumps = [
            np.abs(one - two).max(initial=0.0) <= SMOOTH_JUMP * np.abs(one).max(initial=0.0)
            for a, b in zip(known[:2], known[2:], strict=True)
            for one, two in ((a.f, b.f), (a.f_u[..., :n], b.f_u[..., :n]))
        ]
        return all(jumps)


def surface_of(shooting: Shooting, segment: int) -> int:
    """The function at whose zero a segment ends, of a bound of sliding that of its interface."""
    end, signs = int(shooting.form.ends[segment]), shooting.variations.signs
    if end < signs.shape[1]:
        return end
    on = np.flatnonzero(signs[shooting.form.modes[segment]] == 0)
    return int(on[(end - signs.shape[1]) // 2])


def is_between_surfaces(shooting: Shooting, segment: int) -> bool:
    """Whether a segment begins and ends at events of two functions, and beside no rest."""
    form, variations = shooting.form, shooting.variations
    if not 0 < segment < len(form) - 1 or (form.ends[segment - 1 : segment + 1] < 0).any():
        return False
    around = form.modes[segment - 1 : segment + 2]
    rests = variations.deficiency[around] > (variations.signs[around] == 0).sum(axis=1)
    return not rests.any() and surface_of(shooting, segment - 1) != surface_of(shooting, segment)


def approaches(shooting: Shooting, u: Array) -> list[SurfaceApproach]:
    """Interfaces, walls and bounds of sliding at all events of other functions."""
    form, variations = shooting.form, shooting.variations
    segments, _ = shooting.unpack(u)
    p, times = shooting.parameters_at(u), segments.times[1:-1]
    ends = shooting.linearised(u).flows.ends[:-1]
    sides = (
        (form.modes[:-1], ends, times, p, form.constants[:-1]),
        (form.modes[1:], segments.states[1:], times, p, form.constants[1:]),
    )
    units = np.append(shooting.ranges_at(u), segments.period)

    def heights(side: tuple[Any, ...], *, drifts: bool = False) -> Array:
        at = fields(variations, *side, drifts=drifts)
        unit = (np.abs(at.g_u[..., : len(units)]) * units).sum(axis=-1)
        return at.g / np.where(unit > 0, unit, 1.0)

    values = [heights(side) for side in sides]
    drifts = heights(sides[1], drifts=True)
    found = []
    for k in np.flatnonzero(form.ends[:-1] >= 0).tolist():
        own = surface_of(shooting, k)
        for beyond in (False, True):
            mode, earlier = int(form.modes[k + beyond]), int(form.modes[k])
            for j, sign, leaves in _conditions(shooting, mode, earlier if beyond else mode, own):
                g = (drifts if leaves else values[beyond])[k, j]
                found.append(SurfaceApproach(k, j, mode, beyond, leaves, float(sign * g)))
    return found


def _conditions(
    shooting: Shooting, mode: int, before: int, own: int
) -> Iterator[tuple[int, int, bool]]:
    """Functions with their signs in a mode, and whether it leaves their interface, slid on before.

    Those of the event itself are left out.
    """
    variations = shooting.variations
    signs, count = variations.signs, variations.signs.shape[1]
    for j in range(variations.interfaces + variations.walls):
        if j != own and signs[mode, j] != 0:
            yield j, int(signs[mode, j]), bool(signs[before, j] == 0)
    for place, j in enumerate(np.flatnonzero(signs[mode] == 0).tolist()):
        if j != own and j < variations.interfaces:
            yield count + 2 * place, -1, False
            yield count + 2 * place + 1, 1, False


@dataclass(frozen=True, eq=False)
class _Vanishing:
    """The equations of orbits with a segment of duration zero, called with unknowns."""

    shooting: Shooting
    scale: Array
    place: int

    def __call__(self, u: Array) -> Extended:
        last = self.shooting.linearised(u)
        rows = row_units(self.shooting, last, self.scale)
        row = np.zeros(len(u))
        row[self.place] = 1.0
        values = np.append(last.residual / rows, u[self.place] / self.scale[self.place])
        jacobian = np.vstack([last.jacobian * self.scale / rows[:, None], row])
        return values, jacobian, np.zeros(0, dtype=complex)


@np.errstate(all="ignore")
def located_corner(
    shooting: Shooting,
    before: Array,
    after: Array,
    scale: Array,
    fraction: float,
    segment: int,
    approach: SurfaceApproach | None = None,
    *,
    tangent: bool = False,
) -> Corner | None:
    """Solve for the orbit at a corner, between two others; None if it meets none.

    Parameters
    ----------
    shooting : Shooting
        With one chosen parameter.
    before, after : ndarray, shape (N + 1,)
        Unknowns of an orbit before the corner, and of a solution beyond it.
    scale : ndarray, shape (N + 1,)
    fraction : float
        Estimate of the place of the corner between them.
    segment : int
        The one whose duration vanishes, or ends at the corner.
    approach : SurfaceApproach, optional
        What vanishes there in place of the duration.
    tangent : bool
        Whether the orbit may be tangent to an interface there.
    """
    guess = before + min(max(fraction, 0.0), 1.0) * (after - before)
    shooting = shooting.with_phase(guess)
    system: Any = _Vanishing(shooting, scale, len(shooting.form) * shooting.variations.n + segment)
    if approach is not None:
        where = segment, approach.function, approach.mode
        known = {"drifts": approach.drifts, "beyond": approach.beyond}
        system = ContactEquations(shooting, scale, *where, **known)
    u, _, residual, accuracy, converged = solve_extended(system, guess, scale)
    if not np.isfinite(u).all():
        return None
    places = _places(shooting, u, segment, approach)
    if not places:
        return None
    first, last = places[0]
    surfaces = [surface_of(shooting, k) for k in range(first, last)]
    if approach is not None:
        surfaces.append(_interface(shooting, approach))
    near = tuple(dict.fromkeys(surfaces))
    if not tangent and any(_touches(shooting, u, scale, first, function) for function in near):
        return None
    return Corner(shooting, u, places, near, residual, accuracy, converged)


def _touches(shooting: Shooting, u: Array, scale: Array, segment: int, function: int) -> bool:
    """Whether the orbit touches an interface or a wall at the end of a segment."""
    variations, mode = shooting.variations, int(shooting.form.modes[segment])
    crossed = function < variations.interfaces + variations.walls
    if not crossed or variations.signs[mode, function] == 0:
        return False
    system = ContactEquations(shooting, scale, segment, function, mode)
    drift, slopes = system.at(u, mode)[2], system.at(u, mode, drifts=False)[3]
    units = np.append(scale[: variations.n], shooting.unpack(u)[1])
    reach = np.abs(slopes[: variations.n + 1]) @ units
    return bool(abs(drift) * units[-1] <= TANGENT_RATE * reach)


def _interface(shooting: Shooting, approach: SurfaceApproach) -> int:
    """The interface of a function, which may be a bound of sliding."""
    signs, function = shooting.variations.signs, approach.function
    if function < signs.shape[1]:
        return function
    on = np.flatnonzero(signs[approach.mode] == 0)
    return int(on[(function - signs.shape[1]) // 2])


def _places(
    shooting: Shooting, u: Array, segment: int, approach: SurfaceApproach | None
) -> tuple[tuple[int, int], ...]:
    """Segments before and after all corners of an orbit, that of a segment first."""
    segments, period = shooting.unpack(u)
    if approach is not None:
        alike = [one for one in approaches(shooting, u) if one[3:5] == approach[3:5]]
        there = {one.segment for one in alike if abs(one.value) <= ZERO_AT_CORNER}
        places = [(k, k + 1) for k in sorted(there | {segment})]
    else:
        gone = np.flatnonzero(np.abs(segments.durations) <= ZERO_AT_CORNER * period)
        if segment not in gone or gone[0] == 0 or gone[-1] == len(segments) - 1:
            return ()
        groups = np.split(gone, np.flatnonzero(np.diff(gone) > 1) + 1)
        places = [(int(group[0]) - 1, int(group[-1]) + 1) for group in groups]
    if any((segments.ends[first:last] < 0).any() for first, last in places):
        return ()
    own = next(k for k, (first, last) in enumerate(places) if first <= segment < last)
    return places[own], *places[:own], *places[own + 1 :]


def other_side(problem: OrbitProblem, corner: Corner, along: Array) -> Corner | None:
    """The corner in the segments of the other order of events.

    Runs past the corner on both sides show the order; on the own side it must be that of the
    equations.

    Parameters
    ----------
    problem : OrbitProblem
    corner : Corner
    along : ndarray
        Tangent of the branch in its equations, towards the corner and beyond.

    Returns
    -------
    Corner or None
        None if the return map is discontinuous, or several events are met in another way.
    """
    for step in CORNER_DISTANCES:
        found = []
        for place in corner.places:
            own, beyond = (
                _events_near(problem, corner, corner.u + sign * step * along, place)
                for sign in (-1.0, 1.0)
            )
            wanted = corner.order(place)
            if own is None or beyond is None or _order(own) != wanted or _order(beyond) == wanted:
                break
            found.append(beyond)
        else:
            return _with_events(corner, found)
    return None


def onwards(problem: OrbitProblem, corner: Corner, along: Array) -> Array | None:
    """The tangent of the branch in the direction in which the segments are those of a run."""
    if len(corner.new):
        lengths = along[len(corner.shooting.form) * corner.shooting.variations.n + corner.new]
        signs = set(np.sign(lengths).tolist())
        return along * signs.pop() if len(signs) == 1 and 0.0 not in signs else None
    (place, *_), wanted = corner.places, corner.order(corner.places[0])
    for step in CORNER_DISTANCES:
        there = [
            near is not None and _order(near) == wanted
            for sign in (1.0, -1.0)
            for near in [_events_near(problem, corner, corner.u + sign * step * along, place)]
        ]
        if there[0] != there[1]:
            return along if there[0] else -along
    return None


def _order(events: Events) -> Order:
    return tuple(zip(events.ends.tolist(), events.after.tolist(), strict=True))


def _events_near(
    problem: OrbitProblem, corner: Corner, u: Array, place: tuple[int, int]
) -> Events | None:
    """The events of a run past a corner, on one side of it.

    Its first state is that of the equations at unknowns u, before the first of the events. None
    if the motion after the events is not that after the corner.
    """
    shooting, (first, last) = corner.shooting, place
    variations, row = shooting.variations, slice(first, first + 1)
    (whole, period), (segments, _) = shooting.unpack(corner.u), shooting.unpack(u)
    time, reach = whole.times[first + 1], CORNER_RUN * period
    since = float(time - min(reach, 0.5 * whole.durations[first]))
    until = float(time + min(reach, 0.5 * whole.durations[last]))
    here = problem.at(shooting.parameters_at(u))
    offset = np.array([since - segments.times[first]])
    known = segments.modes[row], segments.states[row], segments.times[:-1][row], offset
    constants = segments.constants[row]
    state = flow(variations, *known, here.parameters, constants).ends
    length = np.array([until - since])
    start = Segments(since, known[0], segments.ends[row], state, length, constants=constants)
    switches = segments.constants[:, len(variations.instants.symbols) :]
    run = here.run(here.on_interfaces(start, 0), since, until, switches[first])
    if not run.outcome:
        return None
    try:
        events = events_of(run, since, until, variations, here.parameters)
    except OrbitError:
        return None
    if not len(events) or events.before[0] != segments.modes[first]:
        return None
    same = np.array_equal(events.switches[-1], switches[last])
    return events if same and events.after[-1] == segments.modes[last] else None


def _with_events(corner: Corner, found: list[Events]) -> Corner | None:
    """The orbit with other events at its corners; None if the states after them differ."""
    shooting = corner.shooting
    variations, parameters = shooting.variations, shooting.parameters_at(corner.u)
    segments, period = shooting.unpack(corner.u)
    ends, sizes = shooting.linearised(corner.u).flows.ends, shooting.ranges_at(corner.u)
    known = sorted(zip(corner.places, found, strict=True), key=lambda one: one[0])
    parts: list[Segments] = []
    places: dict[tuple[int, int], tuple[int, int]] = {}
    begin, number = 0, 0
    for (first, last), events in known:
        part = _through(corner, ends[first], first, events, variations, parameters)
        if (np.abs(part.states[-1] - segments.states[last]) > CONTINUOUS_CORNER * sizes).any():
            return None
        parts += [_rows(segments, begin, first), _rows(part, 0, len(events))]
        number += first - begin
        places[first, last] = number, number + len(events)
        begin, number = last, number + len(events)
    parts.append(_rows(segments, begin, len(segments)))
    columns = "modes", "ends", "states", "durations", "jumps", "constants"
    tables = (np.concatenate([getattr(part, name) for part in parts]) for name in columns)
    other = replace(shooting, form=Segments(segments.start, *tables))
    u = np.append(other.pack(other.form, period)[: other.size], corner.u[shooting.size :])
    moved = tuple(places[place] for place in corner.places)
    return replace(corner, shooting=other, u=u, places=moved)


def _rows(segments: Segments, first: int, last: int) -> Segments:
    """Some of the segments, in a record of the same form."""
    rows = slice(first, last)
    return Segments(
        segments.start,
        segments.modes[rows],
        segments.ends[rows],
        segments.states[rows],
        segments.durations[rows],
        segments.jumps[rows],
        segments.constants[rows],
    )


def _through(
    corner: Corner, end: Array, first: int, events: Events, variations: Variations, p: Array
) -> Segments:
    """The segment before a corner, those of duration zero, and the first state after them."""
    segments, _ = corner.shooting.unpack(corner.u)
    time, count = segments.times[[first + 1]], len(events)
    middle = 0.5 * (events.times[:-1] + events.times[1:])
    between = variations.constants_at(middle, p, events.switches[:-1])
    constants = np.vstack([segments.constants[[first]], between])
    states, left = [segments.states[first]], end
    for k in range(count):
        after, _ = after_jumps(variations, events.jumps[[k]], left[None], time, p, constants[[k]])
        left = after[0]
        states.append(left)
    return Segments(
        segments.start,
        np.append(segments.modes[first], events.after),
        events.ends,
        np.array(states),
        np.append(segments.durations[first], np.zeros(count)),
        events.jumps,
        constants,
    )
