"""Contacts of periodic orbits with interfaces: grazing (GR) and the sliding bifurcations.

At a contact the drift h' = ∇h·f + h_t of a switching function vanishes where the orbit is on its
zero set. Where the orbit touches an interface from inside a region, its own drift vanishes:
grazing, and grazing-sliding (GS) where the other side points back. Where a bound of sliding
is touched from inside it is adding-sliding (AS). Where the orbit crosses an interface, the drift
on the other side vanishes: crossing-sliding (CS) if the motion there curves away from the
interface, and switching-sliding (SS) if it curves back (di Bernardo, Kowalczyk & Nordmark 2002).
At a wall the drift is the approach speed: an impact with speed zero is grazing (GR), from both
sides, and where the reset is the identity there, the return map has a square root (Nordmark 1991).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastslow.orbits.flow.flows import after_jumps, fields, flow
from fastslow.orbits.flow.segments import Segments
from fastslow.orbits.flow.shooting import Shooting
from fastslow.orbits.points.location import Extended, row_units, solve_extended
from fastslow.results.point_types import (
    ADDING_SLIDING,
    CROSSING_SLIDING,
    GRAZING,
    GRAZING_SLIDING,
    SWITCHING_SLIDING,
)

Array = NDArray[np.float64]

#: Fractions of a segment at which the signs of the bounds of sliding are read.
INSIDE = np.array([0.29, 0.5, 0.71])

#: A drift, or a jump of the rates' derivatives, below this fraction of its terms is zero.
ZERO_DRIFT = 1e-9

#: Change of a state by a reset, in units of the unknowns, that is rounding.
UNCHANGED = 1e-6

#: Bounds of sliding at a two-fold, as fractions of their largest values along the orbit.
NEAR_TWO_FOLD = 1e-2

#: Points per segment at which the distances from interfaces are sampled.
CONTACT_SAMPLES = 48

#: Samples that are computed from the same state.
STRIDE = 8

#: Division of an interval that contains a minimum: rounds, and points in each. The time of the
#: minimum is accurate to the root of rounding, the distance to rounding.
ROUNDS, PER_ROUND = 3, 17


@dataclass(frozen=True, eq=False)
class Contact:
    """A solved contact of an orbit.

    Parameters
    ----------
    code : str
        GR, GS, AS, CS or SS.
    shooting : Shooting
        The equations, in which a segment ends at the contact.
    u : ndarray
        Their unknowns.
    time : float
    state : ndarray, shape (n,)
    curvature : float
        h'' at the contact: of the orbit where it touches, else of the motion on the other side.
    exponent : float
        Of the leading singular term of the return map in the distance of the touch: 1/2 (square
        root), 3/2, 5/2 (or higher) or 1 (piecewise linear); 0 for a map that is discontinuous.
    place : (int, int, int)
        Segment that ends at the contact, its switching function, and the mode in which the
        drift vanishes.
    residual, accuracy : float
        Largest residual in units of the rows, and size of the last Newton step in units of the
        scales.
    converged : bool
    """

    code: str
    shooting: Shooting
    u: Array
    time: float
    state: Array
    curvature: float
    exponent: float
    place: tuple[int, int, int]
    residual: float
    accuracy: float
    converged: bool


def locate_touch(
    shooting: Shooting, u: Array, scale: Array, segment: int, offset: float, function: int
) -> Contact:
    """Solve for an orbit that touches an interface, or a bound of sliding, inside a segment.

    Parameters
    ----------
    shooting : Shooting
        With one chosen parameter.
    u : ndarray, shape (N + 1,)
        An orbit nearby.
    scale : ndarray, shape (N + 1,)
        Units of the unknowns.
    segment : int
    offset : float
        Time since the beginning of the segment at which the function is smallest in modulus.
    function : int
        Index among the switching functions of the mode.
    """
    divided, at, units = divided_at(shooting, u, scale, segment, offset, function)
    mode = int(shooting.form.modes[segment])
    return _located(divided, at, units, segment, function, mode, touching=True)


def locate_edge(shooting: Shooting, u: Array, scale: Array, segment: int, mode: int) -> Contact:
    """Solve for an orbit whose event at the end of a segment is at an edge of the sliding set.

    Parameters
    ----------
    shooting, u, scale
        As for `locate_touch`.
    segment : int
        Ends at an interface.
    mode : int
        Region on the other side, whose drift vanishes.
    """
    function = int(shooting.form.ends[segment])
    return _located(shooting, u, scale, segment, function, mode, touching=False)


def locate_slow_impact(
    shooting: Shooting, u: Array, scale: Array, segment: int, function: int
) -> Contact:
    """Solve for an orbit whose event at the end of a segment has the approach speed zero."""
    mode = int(shooting.form.modes[segment])
    return _located(shooting, u, scale, segment, function, mode, touching=True)


def divided_at(
    shooting: Shooting, u: Array, scale: Array, segment: int, offset: float, function: int
) -> tuple[Shooting, Array, Array]:
    """The same orbit with a segment that ends where it touches, its unknowns and their units."""
    segments, period = shooting.unpack(u)
    n, K = shooting.variations.n, len(segments)
    row = slice(segment, segment + 1)
    first = flow(
        shooting.variations,
        segments.modes[row],
        segments.states[row],
        segments.times[:-1][row],
        np.array([offset]),
        shooting.parameters_at(u),
        segments.constants[row],
    )
    rest = segments.durations[segment] - offset
    durations = np.insert(segments.durations, segment + 1, rest)
    durations[segment] = offset
    form = replace(
        segments,
        modes=np.insert(segments.modes, segment, segments.modes[segment]),
        ends=np.insert(segments.ends, segment, function),
        states=np.insert(segments.states, segment + 1, first.ends[0], axis=0),
        durations=durations,
        jumps=np.insert(segments.jumps, segment, -1),
        constants=np.insert(segments.constants, segment, segments.constants[segment], axis=0),
    )
    reference = np.insert(shooting.form.states, segment + 1, first.ends[0], axis=0)
    divided = replace(shooting, form=replace(form, states=reference))
    units = np.concatenate(
        [np.tile(scale[:n], K + 1), np.full(K + 2, scale[K * n]), scale[shooting.size :]]
    )
    values = np.concatenate([form.states.reshape(-1), durations, [period], u[shooting.size :]])
    return divided, values, units


@dataclass(frozen=True, eq=False)
class ContactEquations:
    """The equations of orbits with a condition at the end of a segment, called with unknowns.

    At a contact the drift of a switching function vanishes there.

    Parameters
    ----------
    shooting : Shooting
        With one or several chosen parameters.
    scale : ndarray
        Units of the unknowns, with all parameters.
    segment, function : int
        Segment and its switching function that vanishes at its end.
    mode : int
        Motion in which the drift of the function vanishes there.
    drifts : bool
        False for the value of the function in place of its drift.
    beyond : bool
        True for the state after a reset, and the clocks and switches of the next segment.
    """

    shooting: Shooting
    scale: Array
    segment: int
    function: int
    mode: int
    drifts: bool = True
    beyond: bool = False

    @property
    def following(self) -> NDArray[np.int64]:
        """Places of the state at the contact among the unknowns."""
        n = self.shooting.variations.n
        return (self.segment + 1) % len(self.shooting.form) * n + np.arange(n)

    def time(self, u: Array) -> float:
        """Time of the contact."""
        return float(self.shooting.unpack(u)[0].times[self.segment + 1])

    @property
    def resets(self) -> bool:
        """Whether the state at the contact is not the first state of the next segment."""
        return bool(self.shooting.form.jumps[self.segment] >= 0) and not self.beyond

    def state(self, u: Array) -> Array:
        """State at the contact, before a reset."""
        if self.resets:
            return np.asarray(self.shooting.linearised(u).flows.ends[self.segment])
        last = self.segment == len(self.shooting.form) - 1
        return np.asarray(u[self.following] + (self.shooting.winding if last else 0.0))

    def at(self, u: Array, mode: int, *, drifts: bool = True) -> tuple[Array, Array, float, Array]:
        """Rates and the function, or its drift, at the contact, with derivatives."""
        found = fields(
            self.shooting.variations,
            np.array([mode]),
            self.state(u)[None],
            np.array([self.time(u)]),
            self.shooting.parameters_at(u),
            self.shooting.form.constants[[self.segment + self.beyond]],
            drifts=drifts,
        )
        g = found.g[0, self.function], found.g_u[0, self.function]
        return found.f[0], found.f_u[0], float(g[0]), g[1]

    def __call__(self, u: Array) -> Extended:
        shooting, scale = self.shooting, self.scale
        K, n, N = len(shooting.form), shooting.variations.n, shooting.size
        last = shooting.linearised(u)
        _, _, value, slopes = self.at(u, self.mode, drifts=self.drifts)
        row, lengths = np.zeros(len(u)), K * n + np.arange(self.segment + 1)
        row[lengths], row[N:] = slopes[n], slopes[n + 1 :]
        if self.resets:
            through = slopes[:n] @ last.flows.slopes[self.segment]
            row[self.segment * n : (self.segment + 1) * n] = through[:n]
            row[lengths[:-1]] += through[n]
            row[lengths[-1]] += slopes[:n] @ last.fields.f[self.segment]
            row[N:] += through[n + 1 :]
        else:
            row[self.following] = slopes[:n]
        rows = np.append(row_units(shooting, last, scale), np.abs(row * scale).max())
        values = np.append(last.residual, value) / rows
        jacobian = np.vstack([last.jacobian, row]) * scale / rows[:, None]
        return values, jacobian, np.zeros(0, dtype=complex)


@np.errstate(all="ignore")
def _located(
    shooting: Shooting,
    u: Array,
    scale: Array,
    segment: int,
    function: int,
    mode: int,
    *,
    touching: bool,
) -> Contact:
    n, K = shooting.variations.n, len(shooting.form)
    system = ContactEquations(shooting, scale, segment, function, mode)
    found, _, residual, accuracy, converged = solve_extended(system, u, scale)
    f, f_u, _, slopes = system.at(found, mode)
    curvature = float(slopes[:n] @ f + slopes[n])
    variations = shooting.variations
    signs, count = variations.signs, len(variations.continuous)
    side = int(signs[mode, function]) if function < count else 0
    if not touching and not variations.continuous[function]:
        own = int(shooting.form.modes[segment])
        speed = system.at(found, own)[2]
        if abs(speed) <= ZERO_DRIFT * abs(curvature) * u[K * (n + 1)]:
            # at a two-fold the orbit is tangent as well, and the motion beside it goes either way
            code, exponent = GRAZING, 0.0
        else:
            # away from the interface, or back to it
            code, exponent = (
                (CROSSING_SLIDING, 2.0) if curvature * side > 0 else (SWITCHING_SLIDING, 3.0)
            )
    elif function >= count:
        code, exponent = ADDING_SLIDING, 2.0
    elif function >= variations.first_instant:
        # beyond the touch a switch changes, or an event is executed
        code, exponent = GRAZING, 0.0
    elif function >= variations.interfaces:
        # a square root if the reset is the identity at speed zero
        code, exponent = GRAZING, 0.5 if stays_at_rest(system, found) else 0.0
    else:
        other = other_side(signs, mode, function)
        g, g_u = f, f_u
        normal = system.at(found, mode, drifts=False)[3]
        if other is not None:
            g, g_u = system.at(found, other)[:2]
        drift, least = (
            float(normal[:n] @ g + normal[n]),
            ZERO_DRIFT * abs(curvature) * u[K * (n + 1)],
        )
        if variations.continuous[function]:
            jump = np.abs(f_u - g_u)[:, : n + 1].max()
            code, exponent = (
                GRAZING,
                1.5 if jump > ZERO_DRIFT * np.abs(f_u).max(initial=1e-300) else 2.5,
            )
        elif abs(drift) <= least:
            # the rates jump along the interface alone
            code, exponent = GRAZING, 0.5
        else:
            code, exponent = (GRAZING_SLIDING, 1.0) if drift * side > 0 else (GRAZING, 0.0)
    return Contact(
        code=code,
        shooting=shooting,
        u=found,
        time=system.time(found),
        state=system.state(found),
        curvature=curvature,
        exponent=exponent,
        place=(segment, function, mode),
        residual=residual,
        accuracy=accuracy,
        converged=converged,
    )


def stays_at_rest(system: ContactEquations, u: Array) -> bool:
    """Check that the reset of a wall does not change the state that touches it."""
    shooting, state = system.shooting, system.state(u)
    wall = system.function - shooting.variations.interfaces
    number = shooting.variations.jumps.number(wall, system.mode, system.mode)
    here = state[None], np.array([system.time(u)]), shooting.parameters_at(u)
    constants = shooting.form.constants[[system.segment]]
    after, _ = after_jumps(shooting.variations, np.array([number]), *here, constants)
    size = np.abs(system.scale[: len(state)])
    return bool((np.abs(after[0] - state) <= UNCHANGED * size).all())


def other_side(signs: NDArray[np.int64], mode: int, function: int) -> int | None:
    """The region on the other side of an interface."""
    wanted = signs[mode].copy()
    wanted[function] *= -1
    found = np.flatnonzero((signs == wanted).all(axis=1))
    return int(found[0]) if len(found) else None


class NearTouch(NamedTuple):
    """A local minimum of the distance from an interface, or from a bound of sliding.

    Parameters
    ----------
    segment : int
    offset : float
        Time since the beginning of the segment.
    function : int
    side : float
        Sign of the function along the segment.
    distance : float
        Its absolute value, negative beyond the interface.
    clearance : float
        The distance as a fraction of the range of the function along the orbit.
    """

    segment: int
    offset: float
    function: int
    side: float
    distance: float
    clearance: float


def near_touches(shooting: Shooting, u: Array, reference: Array | None = None) -> list[NearTouch]:
    """Return where the segments of an orbit approach interfaces most closely, in order.

    Parameters
    ----------
    shooting : Shooting
    u : ndarray
        Unknowns of the shooting equations.
    reference : ndarray, optional
        Those of an orbit that determines the signs of the bounds of sliding; by default the same.
    """
    variations, (segments, _) = shooting.variations, shooting.unpack(u)
    count = len(variations.continuous)
    if not count:
        return []
    earlier = segments if reference is None else shooting.unpack(reference)[0]
    samples = [
        _Samples.of(shooting, u, k) if segments.durations[k] > 0 else None
        for k in range(len(segments))
    ]
    inner = [one.g[:, :count] for one in samples if one is not None]
    ranges = np.ptp(np.concatenate(inner), axis=0)
    found = []
    for k, one in enumerate(samples):
        if one is None:
            continue
        signs = variations.signs[segments.modes[k]]
        # where sliding ends the drift vanishes: the motion does not touch the interface it leaves
        left = (variations.signs[segments.modes[k - 1]] == 0) & (signs != 0)
        inside = INSIDE * earlier.durations[k]
        values = functions_along(shooting, u if reference is None else reference, k, inside)[0]
        # in the middle of a symmetric orbit one may vanish
        known = values[np.abs(values).argmax(axis=0), np.arange(values.shape[1])]
        for j in range(count + 2 * int((signs == 0).sum())):
            if variations.first_trigger <= j < count and (values[:, j] > 0.0).any():
                # the motion passes conditions in both directions
                continue
            side = float(signs[j] if j < count else np.sign(known[j]))
            reach = ranges[j] if j < count else float(np.ptp(one.g[:, j]))
            drift = side * one.drifts[:, j]
            first = int(j < count and left[j])
            for i in first + np.flatnonzero((drift[first:-1] < 0) & (drift[first + 1 :] >= 0)):
                offset, value = one.minimum(int(i), j, side)
                found.append(NearTouch(k, offset, j, side, value, value / (reach or 1.0)))
    signs = variations.signs[:, : variations.first_trigger]
    found += _touches_at_events(segments, signs, samples, ranges)
    return sorted(found, key=lambda touch: (touch.segment, touch.offset))


def _touches_at_events(
    segments: Segments, signs: NDArray[np.int64], samples: list[_Samples | None], ranges: Array
) -> list[NearTouch]:
    """Where a drift vanishes at an event of another function, as at a corner, up to rounding."""
    found = []
    for k, (one, two) in enumerate(pairwise(samples), start=1):
        if one is None or two is None or segments.jumps[k - 1] >= 0:
            continue
        here = signs[segments.modes[k]]
        same = (here == signs[segments.modes[k - 1]]) & (here != 0)
        for j in np.flatnonzero(same).tolist():
            side = float(here[j])
            before, after = side * one.drifts[-1, j], side * two.drifts[0, j]
            largest = np.abs([one.drifts[:, j], two.drifts[:, j]]).max()
            if before < 0 <= after and max(-before, after) <= ZERO_DRIFT * largest:
                value = side * float(two.g[0, j])
                found.append(NearTouch(k, 0.0, j, side, value, value / (ranges[j] or 1.0)))
    return found


@dataclass(frozen=True, eq=False)
class _Samples:
    """Switching functions and their drifts along a segment, continued past its borders."""

    known: tuple[Shooting, Array, int, Array]
    start: float
    offsets: Array
    states: Array
    g: Array
    drifts: Array

    @classmethod
    def of(cls, shooting: Shooting, u: Array, segment: int) -> _Samples:
        segments, _ = shooting.unpack(u)
        mode, start = int(segments.modes[segment]), float(segments.times[segment])
        offsets = np.linspace(0.0, segments.durations[segment], CONTACT_SAMPLES)
        # from a few states along the segment: to most samples the way is short
        first = offsets[::STRIDE]
        known = shooting, u, mode, segments.constants[segment]
        coarse = _flowed(*known, segments.states[segment], np.full(len(first), start), first)
        number = np.arange(CONTACT_SAMPLES) // STRIDE
        states = _flowed(*known, coarse[number], start + first[number], offsets - first[number])
        g, drifts = _functions(*known, states, start + offsets)
        return cls(known, start, offsets, states, g, drifts)

    def minimum(self, i: int, function: int, side: float) -> tuple[float, float]:
        """Offset between two samples at which a drift vanishes, and the distance there."""
        begin = self.start + self.offsets[i]
        known = self.known
        low, high = 0.0, float(self.offsets[i + 1] - self.offsets[i])
        for _ in range(ROUNDS):
            tried = np.linspace(low, high, PER_ROUND)
            states = _flowed(*known, self.states[i], np.full(PER_ROUND, begin), tried)
            g, drifts = _functions(*known, states, begin + tried)
            drift, value = side * drifts[:, function], side * g[:, function]
            # rounding may move the zero to an end
            k = min(max(int(np.argmax(drift >= 0)), 1), PER_ROUND - 1)
            low, high = float(tried[k - 1]), float(tried[k])
        change = float(drift[k] - drift[k - 1])
        share = float(np.clip(-drift[k - 1] / change, 0.0, 1.0)) if change else 0.5
        offset = self.offsets[i] + low + share * (high - low)
        # a parabola through the minimum
        distance = value[k - 1] + 0.5 * share * (high - low) * drift[k - 1]
        return float(offset), float(distance)


def two_fold_near(shooting: Shooting, u: Array) -> int | None:
    """Interface on which an orbit slides past a two-fold within `NEAR_TWO_FOLD`, None without.

    There both bounds of sliding vanish, and the rates of sliding are unbounded.
    """
    variations, (segments, _) = shooting.variations, shooting.unpack(u)
    count = len(variations.continuous)
    largest: dict[int, Array] = {}
    for k, mode in enumerate(segments.modes.tolist()):
        zero = np.flatnonzero(variations.signs[mode] == 0)
        if not len(zero) or zero.max() >= variations.interfaces:
            continue
        offsets = np.linspace(0.0, segments.durations[k], CONTACT_SAMPLES)
        g = np.abs(functions_along(shooting, u, k, offsets)[0][:, count:])
        for place, interface in enumerate(zero.tolist()):
            both = g[:, 2 * place : 2 * place + 2].max(axis=1)
            low, high = largest.get(interface, np.array([np.inf, 0.0]))
            largest[interface] = np.array([min(low, both.min()), max(high, both.max())])
    near = (one for one, (low, high) in largest.items() if low <= NEAR_TWO_FOLD * high)
    return next(near, None)


def functions_along(
    shooting: Shooting, u: Array, segment: int, offsets: Array
) -> tuple[Array, Array]:
    """Switching functions and their drifts at offsets into a segment, continued past borders."""
    segments, _ = shooting.unpack(u)
    known = shooting, u, int(segments.modes[segment]), segments.constants[segment]
    times = np.full(len(offsets), segments.times[segment])
    states = _flowed(*known, segments.states[segment], times, offsets)
    return _functions(*known, states, times + offsets)


def _flowed(
    shooting: Shooting,
    u: Array,
    mode: int,
    constants: Array,
    states: Array,
    times: Array,
    offsets: Array,
) -> Array:
    """States at offsets after states, of shape (n,) or (m, n)."""
    count, n = len(offsets), shooting.variations.n
    first = np.array(np.broadcast_to(states, (count, n)))
    modes, parameters = np.full(count, mode), shooting.parameters_at(u)
    along = np.tile(constants, (count, 1))
    return flow(shooting.variations, modes, first, times, offsets, parameters, along).ends


def _functions(
    shooting: Shooting, u: Array, mode: int, constants: Array, states: Array, times: Array
) -> tuple[Array, Array]:
    """Switching functions and their drifts at states."""
    modes, along = np.full(len(states), mode), np.tile(constants, (len(states), 1))
    point = shooting.variations, modes, states, times, shooting.parameters_at(u), along
    return fields(*point).g, fields(*point, drifts=True).g
