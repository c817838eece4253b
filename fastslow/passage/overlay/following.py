"""Intervals in which a trajectory follows an arc of stable branches."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.kernels.loops import load_loop
from fastslow.passage.loops import BESIDE, NEARNESS
from fastslow.passage.overlay.attracting_branches import Arc
from fastslow.passage.overlay.extents import extents_of
from fastslow.passage.slow_quantities import SlowQuantity, rates_and_jumps
from fastslow.results.angles import apart, nearest_copy, periods_of
from fastslow.results.stored.operations import AT_REST
from fastslow.results.stored.switch_state_names import state_of
from fastslow.results.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Rows = NDArray[np.intp]

#: Fraction of the distance from the old to the new branch at which the new one is followed.
WAY = 2.0 / 3.0

#: Vertices of the polygon by which distances from an arc are computed.
POLYGON_VERTICES = 257

#: Shortest episode, in relaxation times of the branch.
SHORTEST_EPISODE = 0.5

#: Relaxation times within which a departure after a landing, and again a return, is overshoot.
OVERSHOOT = 3.0


@dataclass(frozen=True, eq=False)
class Distances:
    """Distances of the rows of a run from arcs of attractors, by which arcs are followed.

    Parameters
    ----------
    t, slow : ndarray, shape (N,)
        Times, and the slow quantity there.
    scaled : ndarray, shape (N, n)
        Fast states in units of ``extent``.
    extent : ndarray, shape (n,)
    within : ndarray of bool, shape (N,)
        Whether the slow quantity is in the range of the arcs.
    arcs : tuple
    places : ndarray, shape (N, arcs, n)
        Scaled states on the arcs; beyond its ends an arc is constant.
    present : ndarray of bool, shape (N, arcs)
        Whether the arc is stable there.
    span : float
        Unit of the slow quantity in distances from a curve, its range in the run.
    radius : float
        Distance that counts as near.
    periods : ndarray, shape (n,)
        Scaled period of each state, 0 where it has none.
    drift : ndarray, shape (N,)
        Rate of the slow quantity, between its jumps.
    jumps : ndarray of bool, shape (N,)
        Rows next to a jump of the slow quantity, where it has no rate.
    """

    t: Array
    slow: Array
    scaled: Array
    extent: Array
    within: Mask
    arcs: tuple[Any, ...]
    places: Array
    present: Mask
    span: float
    radius: float
    periods: Array
    drift: Array
    jumps: Mask

    @abstractmethod
    def beside(self, arc: int) -> Mask:
        """Rows nearer than the radius to an arc as a curve, shape (N,).

        States that lag behind a branch are near it: they are close to an earlier attractor.
        """

    @abstractmethod
    def place(self, arc: int, rows: Rows, slow: Array) -> Array:
        """Scaled states on an arc at other values of the slow quantity in some rows."""

    @abstractmethod
    def slope(self, arc: int, rows: Rows) -> Array:
        """Derivative of the scaled states on an arc by the slow quantity in some rows."""

    def bounces(self, arc: int, start: int, stop: int) -> bool:
        """Whether a state is not yet at rest on the wall that holds the attractors of an arc."""
        return False

    @property
    def moving(self) -> Array:
        """1 for the states that a lag displaces along an arc, 0 for the others."""
        return np.ones(self.scaled.shape[1])

    def deviation(self, arc: int, rows: slice | Mask | int = slice(None)) -> Array:
        """Scaled deviation from an arc at the same value of the slow quantity."""
        return apart(self.scaled[rows], self.places[rows, arc], self.periods)

    def apart(self, arc: int) -> Array:
        """Distance from an arc at the same value of the slow quantity, shape (N,)."""
        if arc not in self._apart:
            deviation = self.deviation(arc)
            self._apart[arc] = np.sqrt(products(deviation, deviation))
        return self._apart[arc]

    @cached_property
    def _apart(self) -> dict[int, Array]:
        return {}

    def way(self, old: int, new: int) -> Array:
        """Fraction of the distance from one arc to another that is covered, shape (N,)."""
        if (old, new) not in self._ways:
            places = self.places[:, old], self.places[:, new]
            self._ways[old, new] = way_done(self.scaled, *places, self.periods)
        return self._ways[old, new]

    @cached_property
    def _ways(self) -> dict[tuple[int, int], Array]:
        return {}


@dataclass(frozen=True, eq=False)
class Measured(Distances):
    """Distances of the samples of a run from the arcs of a diagram.

    Parameters
    ----------
    switched : ndarray of bool, shape (N, arcs)
        Whether a switch has another value than on the arc.
    curves : tuple of ndarray, shape (M, n + 1)
        Points along each arc, scaled: the states, and the slow quantity in units of ``span``.
    velocities : ndarray of bool, shape (n,)
        Whether a state is the time derivative of another, up to a factor.
    resting : ndarray of bool, shape (N,)
        Whether the state is at rest on a wall; empty for a run without resets.
    """

    arcs: tuple[Arc, ...]
    switched: Mask
    curves: tuple[Array, ...]
    velocities: Mask
    resting: Mask

    def beside(self, arc: int) -> Mask:
        points = self._points(arc, self.slow, self.scaled)
        beside = np.empty(len(self.slow), dtype=bool)
        load_loop(BESIDE)(points, self.curves[arc], self.radius, beside)
        return beside & ~self.switched[:, arc]

    def nearness(self, arc: int, slow: Array, scaled: Array) -> Array:
        """The radius minus the distance of states from an arc as a curve, shape (N,).

        −radius where the slow quantity alone is farther away.
        """
        points, near = self._points(arc, slow, scaled), np.empty(len(slow))
        load_loop(NEARNESS)(points, self.curves[arc], self.radius, near)
        return near

    def _points(self, arc: int, slow: Array, scaled: Array) -> Array:
        """States and the slow quantity in the units of the curves, shape (n + 1, N)."""
        if self.periods.any():
            place = self.arcs[arc].state(slow) / self.extent
            scaled = nearest_copy(scaled, place, self.periods)
        return np.vstack([scaled.T, slow / self.span])

    def place(self, arc: int, rows: Rows, slow: Array) -> Array:
        return self.arcs[arc].state(slow) / self.extent

    def slope(self, arc: int, rows: Rows) -> Array:
        return self.arcs[arc].slope(self.slow[rows]) / self.extent

    @property
    def moving(self) -> Array:
        # a velocity is not displaced along the branch by a lag
        return np.where(self.velocities, 0.0, 1.0)

    def bounces(self, arc: int, start: int, stop: int) -> bool:
        rows = slice(start, stop)
        held = bool(self.resting.size) and bool(self.arcs[arc].held(self.slow[rows]).all())
        return held and not self.resting[rows].any()


@dataclass(frozen=True)
class Episode:
    """Samples ``start`` to ``stop - 1``, in which one arc is followed."""

    arc: int
    start: int
    stop: int


def stable_branches_at(m: Distances, episodes: Sequence[Episode]) -> NDArray[np.intp]:
    """Return the stable branch followed at every sample, the last one past its end; −1 for none."""
    followed = np.full(len(m.t), -1, dtype=np.intp)
    for episode in episodes:
        rows = slice(episode.start, episode.stop)
        arc, inside, slow = m.arcs[episode.arc], m.present[rows, episode.arc], m.slow[rows, None]
        low, high = arc.ranges.T
        nearest = np.argmin(np.maximum(np.maximum(low - slow, slow - high), 0.0), axis=1)
        last = np.maximum.accumulate(np.where(inside, np.arange(len(inside)), 0))
        followed[rows] = np.asarray(arc.stable_branches, dtype=np.intp)[nearest[last]]
    return followed


def measured(
    slow: SlowQuantity,
    arcs: tuple[Arc, ...],
    over: tuple[float, float],
    radius: float,
) -> Measured:
    """Compute the distances of the samples of a run from all arcs."""
    run = slow.run
    # samples of one state are contiguous in memory
    state = np.array([run[name] for name in slow.states]).T
    within = (slow.table >= over[0]) & (slow.table <= over[1])
    count, n = state.shape
    places = np.empty((len(arcs), n, count)).transpose(2, 0, 1)
    present = np.empty((len(arcs), count), dtype=bool).T
    for k, arc in enumerate(arcs):
        present[:, k] = arc.present(slow.table) & within
        places[:, k] = arc.state(slow.table)
    stable = [rows_of(places[:, k], np.flatnonzero(present[:, k])) for k in range(len(arcs))]
    extent, velocities = extents_of(slow, arcs, state, stable)
    periods = periods_of(slow.states, run.periods)
    span = max(float(np.ptp(slow.table)), 1e-3 * (over[1] - over[0]))
    curves = tuple(resampled(arc.curve() / np.append(extent, span)) for arc in arcs)
    drift, jumps = rates_and_jumps(run.t, slow.table)
    return Measured(
        t=run.t,
        slow=slow.table,
        scaled=state / extent,
        extent=extent,
        within=within,
        arcs=arcs,
        places=places / extent,
        present=present,
        switched=np.column_stack([_switched(run, arc) for arc in arcs])
        if run.switch_names and arcs
        else np.zeros(present.shape, dtype=bool),
        curves=curves,
        span=span,
        radius=radius,
        periods=periods / extent,
        drift=drift,
        jumps=jumps,
        velocities=velocities,
        resting=np.array(
            [AT_REST in name for name in run.regions_at(run.t)] if run.reset_names else []
        ),
    )


def _switched(run: Trajectory, arc: Arc) -> Mask:
    """Whether a switch has another value than on an arc, at the samples of a run."""
    known = state_of(arc.pieces[0].region)
    other = [run[name] != value for name, value in known.items()]
    return np.any(other, axis=0) if other else np.zeros(len(run.t), dtype=bool)


def resampled(curve: Array) -> Array:
    """Resample a curve at equal arclengths."""
    along = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))]
    even = np.linspace(0.0, along[-1], POLYGON_VERTICES)
    return np.column_stack([np.interp(even, along, column) for column in curve.T])


def products(one: Array, other: Array) -> Array:
    """Scalar products of the rows of two tables (N, n), shape (N,)."""
    # few, long columns; a state that grew without bound is infinitely far away
    with np.errstate(over="ignore"):
        total = one[:, 0] * other[:, 0]
        for k in range(1, one.shape[1]):
            total += one[:, k] * other[:, k]
    return np.asarray(total)


def rows_of(table: Array, rows: NDArray[np.intp]) -> Array:
    """Rows of a table (N, n) with contiguous columns; the layout is kept."""
    return np.asarray(table.T.take(rows, axis=1).T)


def way_done(scaled: Array, old: Array, new: Array, periods: Array) -> Array:
    """Fraction of the distance from an old to a new place that states have covered."""
    chord = apart(new, old, periods)
    length = products(chord, chord)
    done = products(apart(scaled, old, periods), chord)
    return np.asarray(done / np.where(length > 0, length, np.inf))


def episodes_of(m: Distances) -> list[Episode]:
    """Episodes of all arcs that are followed, in order of time.

    An episode begins where the state is near the stable part of an arc for half a relaxation
    time (less at the end of the run), which excludes mere passages. It ends where the state is
    no longer near, or has covered two thirds of the distance to another stable branch.
    """
    beside = [m.beside(k) for k in range(len(m.arcs))]
    visits = [v for k, near in enumerate(beside) for v in _visits(k, near & m.present[:, k])]
    episodes: list[Episode] = []
    here = 0
    while True:
        following = [(max(v.start, here), v) for v in visits if v.stop > here]
        if episodes:
            # the same arc again only after a departure
            following = [
                (s, v) for s, v in following if v.arc != episodes[-1].arc or v.start >= here
            ]
        following = [(s, v) for s, v in following if _settles(m, v.arc, s, v.stop)]
        if not following:
            return _landed(m, episodes)
        first = min(s for s, _ in following)
        tied = [v.arc for s, v in following if s == first]
        arc = tied[0] if len(tied) == 1 else _nearest(m, first, tied)
        here = _left(m, arc, first, beside[arc])
        episodes.append(Episode(arc, first, here))
        if here >= len(m.t):
            return _landed(m, episodes)


def _landed(m: Distances, episodes: list[Episode]) -> list[Episode]:
    """Drop episodes in which the state overshoots before it relaxes to the branch."""
    followed = [s for s, after in pairwise(episodes) if not _overshoots(m, s, after)]
    return [*followed, *episodes[-1:]]


def _overshoots(m: Distances, episode: Episode, after: Episode) -> bool:
    """Whether a short episode and the next are one landing on a branch stable throughout.

    On a wall the landing ends with the last impact.
    """
    between = Episode(episode.arc, episode.start, after.start + 1)
    return (
        after.arc == episode.arc
        and bool(m.present[between.start : between.stop, between.arc].all())
        and (
            m.bounces(episode.arc, episode.start, after.start)
            or (_relaxed(m, episode) < OVERSHOOT and _relaxed(m, between) < 2.0 * OVERSHOOT)
        )
    )


def _relaxed(m: Distances, episode: Episode) -> float:
    """Duration of an episode in relaxation times of its arc."""
    rows = slice(episode.start, episode.stop)
    rate = -m.arcs[episode.arc].relaxation(m.slow[rows])
    steps = np.minimum(0.5 * (rate[1:] + rate[:-1]) * np.diff(m.t[rows]), 1e12)
    return float(steps.sum())


def _visits(arc: int, near: Mask) -> list[Episode]:
    edges = np.flatnonzero(np.diff(np.r_[False, near, False].astype(int)))
    return [Episode(arc, int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _settles(m: Distances, arc: int, start: int, stop: int) -> bool:
    """Whether a visit is long enough for an episode, in relaxation times."""
    if stop - start < 2:
        return False
    if stop == len(m.t) and len(m.t) > 2:
        return True
    return _relaxed(m, Episode(arc, start, stop)) >= SHORTEST_EPISODE


def _nearest(m: Distances, row: int, tied: list[int]) -> int:
    return min(tied, key=lambda k: float(m.apart(k)[row]))


def _left(m: Distances, arc: int, start: int, beside: Mask) -> int:
    """First sample from ``start`` on at which an arc is left."""
    rows = slice(start, None)
    away = ~beside[rows] | ~m.within[rows]
    for other in range(len(m.arcs)):
        if other != arc:
            away |= m.present[rows, other] & (m.way(arc, other)[rows] > WAY)
    away[0] = False
    return start + (int(np.argmax(away)) if away.any() else len(away))
