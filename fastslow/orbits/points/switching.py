"""Changes of the sequence of segments along a branch, where an orbit touches an interface."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastslow.orbits.flow.flows import fields, flow
from fastslow.orbits.flow.segments import Segments
from fastslow.orbits.flow.shooting import Shooting, hits_of
from fastslow.orbits.points.contacts import (
    Contact,
    divided_at,
    functions_along,
    locate_edge,
    locate_slow_impact,
    locate_touch,
    near_touches,
    other_side,
)
from fastslow.orbits.points.corners import ZERO_AT_CORNER, SurfaceApproach, approaches

Array = NDArray[np.float64]

#: Drift on the other side at an edge of sliding, as a fraction of that on the own side.
AT_EDGE = 1e-7

#: Distance of an orbit from an interface that it touches, in units of its unknowns.
TOUCHING = 1e-9

#: Fraction of the period by which an orbit without events begins later; no simple one, at which a
#: symmetric orbit might touch again.
BEGIN_LATER = 0.381966

#: Distance from an interface, in units of its change over the orbit, within which an orbit may
#: be beyond it unnoticed.
BEFORE = 1e-4


class Violation(NamedTuple):
    """A condition that an orbit violates, and the fraction of the step at which it began to.

    Parameters
    ----------
    kind : str
        ``"touch"``, ``"vanishing"``, ``"edge"``, ``"speed"`` of an impact or into a threshold, or
        ``"corner"``, where the state at an event reaches an interface.
    segment : int
    offset : float
        Time of a touch since the beginning of the segment.
    function : int
        Switching function.
    mode : int
        Region on the other side of an edge.
    fraction : float
    approach : SurfaceApproach or None
        Of a corner.
    """

    kind: str
    segment: int
    offset: float
    function: int
    mode: int
    fraction: float
    approach: SurfaceApproach | None = None


@dataclass(frozen=True, eq=False)
class ContactSide:
    """The segments of a branch on one side of a contact.

    Parameters
    ----------
    shooting : Shooting
    u : ndarray
        Unknowns of an orbit.
    """

    shooting: Shooting
    u: Array


def violated(
    shooting: Shooting, before: Array, after: Array, *, corners: bool = True
) -> Violation | None:
    """Return the first condition of the itinerary that is violated between two orbits.

    Both are solutions of the same equations, which continue the rates of a region beyond its
    borders; the second one is no orbit. Without ``corners`` events that reach an interface are
    left out.
    """
    found = _vanishing(shooting, before, after)
    if not found:
        # beyond a vanishing segment its neighbours overlap, and touch interfaces there
        slow = _slow_impacts(shooting, before, after)
        # with a negative approach speed the flow passes the wall before its impact and after it
        late = {candidate.segment + k for candidate in slow for k in range(2)}
        edges = _edges(shooting, before, after)
        # and past an edge of sliding it returns to the interface that it crosses
        past = [((one.segment + 1) % len(shooting.form), one.function) for one in edges]
        touches = [
            one
            for one in _touches(shooting, before, after)
            if one.segment not in late and (one.segment, one.function) not in past
        ]
        near = [
            one
            for one in (_corners(shooting, before, after) if corners else [])
            if one.segment not in late and (one.segment, one.function) not in past
        ]
        found = [*edges, *slow, *touches, *near]
    return min(found, key=lambda candidate: candidate.fraction, default=None)


def _vanishing(shooting: Shooting, before: Array, after: Array) -> list[Violation]:
    """Segments whose duration becomes negative."""
    one, two = (shooting.unpack(u)[0].durations for u in (before, after))
    return [
        Violation("vanishing", int(k), 0.0, -1, -1, float(one[k] / (one[k] - two[k])))
        for k in np.flatnonzero((two <= 0) & (one > 0))
    ]


def _corners(shooting: Shooting, before: Array, after: Array) -> list[Violation]:
    """Events at which the state passes an interface, or a bound of sliding."""
    found = []
    for one, two in zip(approaches(shooting, before), approaches(shooting, after), strict=True):
        # an orbit slightly beyond is confirmed too, within the tolerance of the times of events
        if two.value < -ZERO_AT_CORNER and one.value > max(two.value, -BEFORE):
            fraction = max(one.value, 0.0) / (max(one.value, 0.0) - two.value)
            found.append(Violation("corner", one.segment, 0.0, one.function, -1, fraction, one))
    return found


def _edges(shooting: Shooting, before: Array, after: Array) -> list[Violation]:
    """Events at which the drift on the other side of a discontinuity changes sign."""
    found = []
    for k, end, other in _crossings_of_jumps(shooting):
        one, two = (_drift_at_end(shooting, u, k, other, end) for u in (before, after))
        if one * two < 0:
            found.append(Violation("edge", k, 0.0, end, other, one / (one - two)))
    return found


def edges_of(form: ContactSide) -> list[Violation]:
    """All events of an orbit at an edge of sliding, by symmetry several at once, in order."""
    shooting, u = form.shooting, form.u
    found = []
    for k, end, other in _crossings_of_jumps(shooting):
        own = int(shooting.form.modes[k])
        drift, speed = (_drift_at_end(shooting, u, k, mode, end) for mode in (other, own))
        if abs(drift) <= AT_EDGE * abs(speed):
            found.append(Violation("edge", k, 0.0, end, other, 0.0))
    return found


def _crossings_of_jumps(shooting: Shooting) -> Iterator[tuple[int, int, int]]:
    """Segments that end at a discontinuity, its function, and the region on the other side."""
    variations, form = shooting.variations, shooting.form
    signs = variations.signs
    for k, end in enumerate(form.ends.tolist()):
        if not 0 <= end < variations.interfaces or variations.continuous[end]:
            continue
        mode, following = int(form.modes[k]), int(form.modes[(k + 1) % len(form)])
        if signs[mode, end] == 0:
            continue
        sliding = signs[following, end] == 0
        other = other_side(signs, mode, end) if sliding else following
        if other is not None:
            yield k, end, other


def approach_speeds(shooting: Shooting, u: Array) -> dict[int, float]:
    """Speeds into walls and thresholds of switches, by the number of the segment."""
    form, durations = shooting.form, shooting.unpack(u)[0].durations
    hits = hits_of(form, shooting.variations).tolist()
    return {
        k: float(functions_along(shooting, u, k, durations[[k]])[1][0, form.ends[k]]) for k in hits
    }


def _slow_impacts(shooting: Shooting, before: Array, after: Array) -> list[Violation]:
    """Impacts, and changes of switches, whose approach speed becomes negative."""
    one, two = approach_speeds(shooting, before), approach_speeds(shooting, after)
    ends = shooting.form.ends
    return [
        Violation("speed", k, 0.0, int(ends[k]), -1, one[k] / (one[k] - two[k]))
        for k in one
        if one[k] > 0 >= two[k]
    ]


def _drift_at_end(shooting: Shooting, u: Array, segment: int, mode: int, function: int) -> float:
    segments, _ = shooting.unpack(u)
    K = len(segments)
    state = segments.states[(segment + 1) % K] + (shooting.winding if segment == K - 1 else 0.0)
    known = fields(
        shooting.variations,
        np.array([mode]),
        state[None],
        segments.times[segment + 1 : segment + 2],
        shooting.parameters_at(u),
        segments.constants[[segment]],
        drifts=True,
    )
    return float(known.g[0, function])


def _touches(shooting: Shooting, before: Array, after: Array) -> list[Violation]:
    """Interfaces, and bounds of sliding, that are passed inside a segment."""
    found = []
    for touch in near_touches(shooting, after, before):
        if touch.distance < 0:
            k, offset = touch.segment, touch.offset
            earlier, share = _same_time(shooting, before, after, k, offset)
            near = earlier + np.linspace(-0.05, 0.05, 21) * share
            values = functions_along(shooting, before, k, near)[0][:, touch.function]
            height = float((touch.side * values).min())
            fraction = height / (height - touch.distance) if height > 0 else 0.5
            found.append(Violation("touch", k, offset, touch.function, -1, fraction))
    return found


def _same_time(
    shooting: Shooting, before: Array, after: Array, segment: int, offset: float
) -> tuple[float, float]:
    """The same fraction of a segment of another orbit, and the duration of that segment."""
    one, two = (shooting.unpack(u)[0].durations[segment] for u in (before, after))
    return float(offset / two * one), float(one)


def touches_of(form: ContactSide) -> list[Violation]:
    """All touches of an orbit at a contact, by symmetry several at once, in order."""
    scale = np.abs(form.u).max()
    return [
        Violation("touch", touch.segment, touch.offset, touch.function, -1, 0.0)
        for touch in near_touches(form.shooting, form.u)
        if abs(touch.distance) <= TOUCHING * scale
    ]


def sliding_between(signs: NDArray[np.int64], mode: int, function: int) -> int | None:
    """The sliding motion along an interface of a region."""
    wanted = signs[mode].copy()
    wanted[function] = 0
    found = np.flatnonzero((signs == wanted).all(axis=1))
    return int(found[0]) if len(found) else None


def contact_of(
    shooting: Shooting, candidate: Violation, before: Array, after: Array, scale: Array
) -> tuple[Contact, ContactSide] | None:
    """Locate the contact; return it with the orbit without the touch.

    None if segments vanish in another way than at a touch.
    """
    guess = before + min(max(candidate.fraction, 0.0), 1.0) * (after - before)
    shooting, k = shooting.with_phase(guess), candidate.segment
    if candidate.kind == "edge":
        contact = locate_edge(shooting, guess, scale, k, candidate.mode)
        return contact, ContactSide(shooting, contact.u)
    function, offset = candidate.function, candidate.offset
    if candidate.kind == "touch" and is_bound_of_rest(shooting, k, function):
        return None
    if candidate.kind == "speed":
        contact = locate_slow_impact(shooting, guess, scale, k, function)
        if contact.exponent == 0.0:
            return contact, ContactSide(shooting, contact.u)
        without = without_event(shooting, guess, scale, k)
        if without is None:
            return None
        offset = float(shooting.unpack(guess)[0].durations[k])
        shooting, guess, scale = without
    if candidate.kind == "vanishing":
        if explained(shooting, candidate):
            return None
        segments, period = shooting.unpack(guess)
        _, last = (shooting.unpack(u)[0].durations for u in (before, after))
        gone = [int(row) for row in np.flatnonzero(last <= 0)]
        form, n = shooting.form, shooting.variations.n
        if min(gone) == 0 or max(gone) == len(form) - 1:
            return None
        returns = {bool(form.modes[row - 1] == form.modes[row + 1]) for row in gone}
        if returns == {False}:
            return _edge_of(shooting, guess, scale, k, gone)
        if len(returns) > 1:
            return None
        function = int(form.ends[k - 1])
        offset = float(segments.durations[k - 1] + 0.5 * segments.durations[k])
        # from the last one, so that the numbers of the others remain
        for row in reversed(gone):
            segments, form = without_segment(segments, row), without_segment(form, row)
        k -= 1 + 2 * sum(row < candidate.segment for row in gone)
        scale = np.concatenate(
            [
                np.tile(scale[:n], len(segments)),
                np.full(len(segments) + 1, scale[shooting.size - 1]),
                scale[shooting.size :],
            ]
        )
        shooting = replace(shooting, form=form)
        guess = np.concatenate([shooting.pack(segments, period)[: shooting.size], guess[-1:]])
    contact = locate_touch(shooting, guess, scale, k, offset, function)
    K, n = len(contact.shooting.form), shooting.variations.n
    segments, period = contact.shooting.unpack(contact.u)
    durations = np.delete(segments.durations, k + 1)
    durations[k] += segments.durations[k + 1]
    states = np.delete(segments.states, k + 1, axis=0)
    u = np.concatenate([states.reshape(-1), durations, contact.u[K * (n + 1) :]])
    return contact, ContactSide(shooting, u)


def without_event(
    shooting: Shooting, u: Array, scale: Array, k: int
) -> tuple[Shooting, Array, Array] | None:
    """The equations without the event at the end of a segment, their unknowns and units.

    None if the mode changes at the event.
    """
    segments, period = shooting.unpack(u)
    form, n = shooting.form, shooting.variations.n
    if form.modes[k] != form.modes[k + 1]:
        return None
    other = replace(shooting, form=joined_with_next(form, k))
    K = len(other.form)
    fewer = np.concatenate([np.tile(scale[:n], K), np.full(K + 1, scale[shooting.size - 1])])
    packed = other.pack(joined_with_next(segments, k), period)[: other.size]
    parameters = slice(shooting.size, None)
    return other, np.append(packed, u[parameters]), np.append(fewer, scale[parameters])


def without_nodes(form: ContactSide) -> ContactSide:
    """The same orbit with segments that end at events alone, where no touch is at a node.

    An orbit without events begins at another phase, since it may touch an interface at its start.
    """
    shooting = form.shooting
    segments, period = shooting.unpack(form.u)
    more, reference = segments.without_nodes(), shooting.form.without_nodes()
    if len(more) == 1:
        offset = BEGIN_LATER * more.durations
        known = shooting.parameters_at(form.u), more.constants
        states = flow(
            shooting.variations, more.modes, more.states, more.times[:1], offset, *known
        ).ends
        more = replace(more, start=more.start + float(offset[0]), states=states)
        reference = more
    whole = replace(shooting, form=reference)
    return ContactSide(whole, np.concatenate([whole.pack(more, period)[: whole.size], form.u[-1:]]))


def joined_with_next(segments: Segments, k: int) -> Segments:
    """The segments with one of them joined with the next, of the same mode."""
    durations = segments.durations.copy()
    durations[k + 1] += durations[k]
    return Segments(
        segments.start,
        np.delete(segments.modes, k),
        np.delete(segments.ends, k),
        np.delete(segments.states, k + 1, axis=0),
        np.delete(durations, k),
        np.delete(segments.jumps, k),
        np.delete(segments.constants, k, axis=0),
    )


def with_impacts(form: ContactSide, touches: Sequence[Violation]) -> ContactSide:
    """The same orbit with an impact of speed zero wherever it touches a wall."""
    shooting, u, scale = form.shooting, form.u, np.ones(len(form.u))
    variations = shooting.variations
    for touch in reversed(touches):
        k, mode = touch.segment, int(shooting.form.modes[touch.segment])
        shooting, u, scale = divided_at(shooting, u, scale, k, touch.offset, touch.function)
        jumps = shooting.form.jumps.copy()
        jumps[k] = variations.jumps.number(touch.function - variations.interfaces, mode, mode)
        shooting = replace(shooting, form=replace(shooting.form, jumps=jumps))
    return ContactSide(shooting, u)


def is_bound_of_rest(shooting: Shooting, segment: int, function: int) -> bool:
    """Check that a function is a contact force during rest on a wall."""
    variations = shooting.variations
    mode = int(shooting.form.modes[segment])
    rests = variations.deficiency[mode] > (variations.signs[mode] == 0).sum()
    return bool(rests and function >= len(variations.continuous))


def explained(shooting: Shooting, candidate: Violation) -> str:
    """Why no orbit is sought beyond a condition that is no contact, empty for others."""
    k, form, variations = candidate.segment, shooting.form, shooting.variations
    if candidate.kind == "touch" and is_bound_of_rest(shooting, k, candidate.function):
        return "the contact force vanishes during the rest on a wall, which ends there"
    if candidate.kind != "vanishing" or not 0 < k < len(form) - 1:
        return ""
    around = form.ends[k - 1 : k + 1]
    inside = around[around < len(variations.continuous)]
    if (inside >= variations.first_trigger).any():
        return "an event meets another change, beyond which their order is another"
    if (inside >= variations.first_switch).any():
        return "an event meets a change of a switch, beyond which their order is another"
    if (form.jumps[k - 1 : k + 1] >= 0).any():
        rests = variations.deficiency[form.modes] > 0
        return (
            "the rest on a wall begins or ends at an impact"
            if rests[k - 1] or rests[k] or rests[k + 1]
            else "two resets meet"
        )
    return ""


def _edge_of(
    shooting: Shooting, u: Array, scale: Array, k: int, gone: Sequence[int]
) -> tuple[Contact, ContactSide]:
    """The contact at which segments between two other modes vanish, one of which is chosen."""
    segments, period = shooting.unpack(u)
    form, n, signs = shooting.form, shooting.variations.n, shooting.variations.signs
    own, function = int(form.modes[k]), int(form.ends[k - 1])
    mode = own if signs[own, function] != 0 else int(form.modes[k + 1])
    for row in reversed(gone):
        form, segments = _skipping(form, row), _skipping(segments, row)
    shooting = replace(shooting, form=form)
    K, N = len(segments), shooting.size
    scale = np.concatenate([np.tile(scale[:n], K), np.full(K + 1, scale[-2]), scale[-1:]])
    guess = np.concatenate([shooting.pack(segments, period)[:N], u[-1:]])
    place = k - 1 - sum(row < k for row in gone)
    contact = locate_edge(shooting, guess, scale, place, mode)
    return contact, ContactSide(shooting, contact.u)


def _skipping(segments: Segments, k: int) -> Segments:
    """The segments without one of them, in whose place the next one begins earlier."""
    durations = segments.durations.copy()
    durations[k + 1] += durations[k]
    states = segments.states.copy()
    states[k + 1] = states[k]
    return Segments(
        segments.start,
        np.delete(segments.modes, k),
        np.delete(segments.ends, k),
        np.delete(states, k, axis=0),
        np.delete(durations, k),
        np.delete(segments.jumps, k),
        np.delete(segments.constants, k, axis=0),
    )


def without_segment(segments: Segments, k: int) -> Segments:
    """The segments without one of them, its neighbours joined."""
    durations = segments.durations.copy()
    durations[k - 1] += durations[k] + durations[k + 1]
    return Segments(
        segments.start,
        np.delete(segments.modes, [k, k + 1]),
        np.delete(segments.ends, [k - 1, k]),
        np.delete(segments.states, [k, k + 1], axis=0),
        np.delete(durations, [k, k + 1]),
        np.delete(segments.jumps, [k - 1, k]),
        np.delete(segments.constants, [k, k + 1], axis=0),
    )


def inserted(
    form: ContactSide, touches: Sequence[Violation], new: Sequence[tuple[int, int]], duration: float
) -> tuple[ContactSide, list[int]]:
    """An approximate orbit with short segments of other modes at its touches.

    Parameters
    ----------
    form : ContactSide
    touches : sequence of Violation
        In order along the orbit.
    new : sequence of (int, int)
        Mode and end of every short segment.
    duration : float
        Of every one.

    Returns
    -------
    form : ContactSide
    places : list of int
        Numbers of the short segments.
    """
    shooting, half = form.shooting, 0.5 * duration
    segments, period = shooting.unpack(form.u)
    reference = shooting.form.states
    places: list[int] = []
    for touch, (mode, end) in zip(reversed(touches), reversed(new), strict=True):
        k = touch.segment
        offsets = np.array([touch.offset - half, touch.offset + half])
        ends = flow(
            shooting.variations,
            np.full(2, segments.modes[k]),
            np.tile(segments.states[k], (2, 1)),
            np.full(2, segments.times[k]),
            offsets,
            shooting.parameters_at(form.u),
            np.tile(segments.constants[k], (2, 1)),
        ).ends
        rest = segments.durations[k] - touch.offset - half
        durations = np.insert(segments.durations, k + 1, [duration, rest])
        durations[k] = touch.offset - half
        old = segments.modes[k]
        segments = Segments(
            segments.start,
            np.insert(segments.modes, k + 1, [mode, old]),
            np.insert(segments.ends, k, [touch.function, end]),
            np.insert(segments.states, [k + 1, k + 1], ends, axis=0),
            durations,
            np.insert(segments.jumps, k, [-1, -1]),
            np.insert(segments.constants, k, segments.constants[[k, k]], axis=0),
        )
        reference = np.insert(reference, [k + 1, k + 1], ends, axis=0)
        places = [k + 1, *(place + 2 for place in places)]
    wider = replace(shooting, form=replace(segments, states=reference))
    u = np.concatenate([wider.pack(segments, period)[: wider.size], form.u[-1:]])
    return ContactSide(wider, u), places


def inserted_after(
    form: ContactSide, segment: int, mode: int, end: int, duration: float
) -> ContactSide:
    """An approximate orbit with a short segment of another mode after the end of a segment."""
    shooting = form.shooting
    segments, period = shooting.unpack(form.u)
    place = segment + 1
    row = slice(place, place + 1)
    offset = np.array([duration])
    following = flow(
        shooting.variations,
        np.array([mode]),
        segments.states[row],
        segments.times[row],
        offset,
        shooting.parameters_at(form.u),
        segments.constants[row],
    ).ends[0]
    durations = np.insert(segments.durations, place, duration)
    durations[place + 1] -= duration
    more = Segments(
        segments.start,
        np.insert(segments.modes, place, mode),
        np.insert(segments.ends, place, end),
        np.insert(segments.states, place + 1, following, axis=0),
        durations,
        np.insert(segments.jumps, place, -1),
        np.insert(segments.constants, place, segments.constants[place], axis=0),
    )
    reference = np.insert(shooting.form.states, place + 1, following, axis=0)
    wider = replace(shooting, form=replace(more, states=reference))
    u = np.concatenate([wider.pack(more, period)[: wider.size], form.u[-1:]])
    return ContactSide(wider, u)
