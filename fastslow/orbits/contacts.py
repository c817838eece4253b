"""Contacts of periodic orbits with interfaces: grazing (GR) and the sliding bifurcations.

At a contact the drift h' = ∇h·f + h_t of a switching function vanishes where the orbit is on its
zero set. Where the orbit touches an interface from inside a region, its own drift vanishes:
grazing, and grazing-sliding (GS) where the other side points back. Where a bound of sliding
is touched from inside it is adding-sliding (AS). Where the orbit crosses an interface, the drift
on the other side vanishes: crossing-sliding (CS) if the motion there curves away from the
interface, and switching-sliding (SS) if it curves back (di Bernardo, Kowalczyk & Nordmark 2002).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fastslow.orbits.flows import fields, flow
from fastslow.orbits.shooting import Shooting
from fastslow.orbits.special_points import Extended, row_units, solve_extended
from fastslow.results.point_types import (
    ADDING_SLIDING,
    CROSSING_SLIDING,
    GRAZING,
    GRAZING_SLIDING,
    SWITCHING_SLIDING,
)

Array = NDArray[np.float64]

#: A drift, or a jump of the rates' derivatives, below this fraction of its terms is zero.
ZERO = 1e-9

#: Points per segment at which the distances from interfaces are sampled.
SAMPLES = 65


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
    divided, at, units = _divided(shooting, u, scale, segment, offset, function)
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


def _divided(
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
    """The equations of orbits with a contact at the end of a segment, called with unknowns.

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
    """

    shooting: Shooting
    scale: Array
    segment: int
    function: int
    mode: int

    @property
    def following(self) -> NDArray[np.int64]:
        """Places of the state at the contact among the unknowns."""
        n = self.shooting.variations.n
        return (self.segment + 1) % len(self.shooting.form) * n + np.arange(n)

    def time(self, u: Array) -> float:
        """Time of the contact."""
        return float(self.shooting.unpack(u)[0].times[self.segment + 1])

    def state(self, u: Array) -> Array:
        """State at the contact."""
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
            drifts=drifts,
        )
        g = found.g[0, self.function], found.g_u[0, self.function]
        return found.f[0], found.f_u[0], float(g[0]), g[1]

    def __call__(self, u: Array) -> Extended:
        shooting, scale = self.shooting, self.scale
        K, n, N = len(shooting.form), shooting.variations.n, shooting.size
        last = shooting.linearised(u)
        _, _, value, slopes = self.at(u, self.mode)
        row = np.zeros(len(u))
        row[self.following] = slopes[:n]
        row[K * n : K * n + self.segment + 1] = slopes[n]
        row[N:] = slopes[n + 1 :]
        rows = np.append(row_units(shooting, last, scale), np.abs(row * scale).max())
        values = np.append(last.residual, value) / rows
        jacobian = np.vstack([last.jacobian, row]) * scale / rows[:, None]
        return values, jacobian, np.zeros(0, dtype=complex)


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
    if not touching:
        # away from the interface, or back to it
        code, exponent = (
            (CROSSING_SLIDING, 2.0) if curvature * side > 0 else (SWITCHING_SLIDING, 3.0)
        )
    elif function >= count:
        code, exponent = ADDING_SLIDING, 2.0
    else:
        other = other_side(signs, mode, function)
        g, g_u = f, f_u
        normal = system.at(found, mode, drifts=False)[3]
        if other is not None:
            g, g_u = system.at(found, other)[:2]
        drift, least = float(normal[:n] @ g + normal[n]), ZERO * abs(curvature) * u[K * (n + 1)]
        if variations.continuous[function]:
            jump = np.abs(f_u - g_u)[:, : n + 1].max()
            code, exponent = GRAZING, 1.5 if jump > ZERO * np.abs(f_u).max(initial=1e-300) else 2.5
        elif abs(drift) <= least:
            # the rates jump along the interface alone
            code, exponent = GRAZING, 0.5
        else:
            code, exponent = (GRAZING_SLIDING, 1.0) if drift * side > 0 else (GRAZING, 0.0)
    return Contact(
        code,
        shooting,
        found,
        system.time(found),
        system.state(found),
        curvature,
        exponent,
        (segment, function, mode),
        residual,
        accuracy,
        converged,
    )


def other_side(signs: NDArray[np.int64], mode: int, function: int) -> int | None:
    """The region on the other side of an interface."""
    wanted = signs[mode].copy()
    wanted[function] *= -1
    found = np.flatnonzero((signs == wanted).all(axis=1))
    return int(found[0]) if len(found) else None


def near_touches(shooting: Shooting, u: Array) -> list[tuple[int, float, int, float]]:
    """Return where the segments of an orbit come nearest to interfaces that they do not reach.

    Parameters
    ----------
    shooting : Shooting
    u : ndarray
        Unknowns of the shooting equations.

    Returns
    -------
    list of (int, float, int, float)
        Segment, offset and function for `locate_touch`, and the function there as a fraction of
        its range along the orbit, negative beyond the interface; the smallest modulus first.
    """
    variations, (segments, _) = shooting.variations, shooting.unpack(u)
    K, count = len(segments), len(variations.continuous)
    if not count:
        return []
    shares = np.linspace(0.0, 1.0, SAMPLES)
    number = np.repeat(np.arange(K), SAMPLES)
    offsets = np.tile(shares, K) * segments.durations[number]
    modes, times = segments.modes[number], segments.times[:-1][number]
    p = shooting.parameters_at(u)
    states = flow(variations, modes, segments.states[number], times, offsets, p).ends
    g = fields(variations, modes, states, times + offsets, p).g.reshape(K, SAMPLES, -1)
    ranges = np.ptp(g[:, :, :count].reshape(-1, count), axis=0)
    found = []
    for k in range(K):
        signs = variations.signs[segments.modes[k]]
        functions = [(j, float(sign)) for j, sign in enumerate(signs) if sign]
        functions += [
            (count + i, float(np.sign(g[k, SAMPLES // 2, count + i])))
            for i in range(2 * int((signs == 0).sum()))
        ]
        for j, side in functions:
            values = side * g[k, :, j]
            reach = ranges[j] if j < count else float(np.ptp(values))
            # no event divides the orbit at a node
            open_end = segments.ends[k - 1] < 0
            earlier = side * g[k - 1, -2, j] if open_end else -np.inf
            left = np.append(earlier, values[:-2])
            inner = np.flatnonzero((values[:-1] <= left) & (values[:-1] < values[1:]))
            found += [
                (k, float(shares[i] * segments.durations[k]), j, float(values[i] / reach))
                for i in inner
                if reach > 0
            ]
    return sorted(found, key=lambda one: abs(one[3]))
