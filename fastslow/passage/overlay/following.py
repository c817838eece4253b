"""When a trajectory follows which course of stable sheets, and when it leaves."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from fastslow.kernels.loops import load_loop
from fastslow.passage.loops import BESIDE, NEARNESS
from fastslow.passage.overlay.attracting_branches import Course
from fastslow.passage.overlay.extents import extents_of
from fastslow.passage.overlay.slow_quantities import SlowQuantity
from fastslow.results.angles import apart, nearest_copy, periods_of

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: A new sheet is followed once this part of the way to it from the old one is done.
WAY = 2.0 / 3.0

#: Points that a course is drawn by when distances from it are measured.
POINTS = 257

#: A sheet is followed by what stays beside it for this many of its relaxation times.
SETTLED = 0.5

#: A landing overshoots where the sheet is left again within so many of its relaxation times,
#: and met again within as many more.
OVERSHOOT = 3.0


@dataclass(frozen=True, eq=False)
class Measured:
    """A run measured against the courses of a diagram, sample by sample.

    Parameters
    ----------
    time, slow : ndarray, shape (N,)
    scaled : ndarray, shape (N, n)
        Fast states in units of ``extent``.
    extent : ndarray, shape (n,)
    within : ndarray of bool, shape (N,)
        Whether the slow quantity is in the range of the diagram.
    courses : tuple of Course
    places : ndarray, shape (N, courses, n)
        Scaled states of the courses; beyond its end a course stays at its end state.
    present : ndarray of bool, shape (N, courses)
        Whether a stable sheet exists there.
    curves : tuple of ndarray, shape (M, n + 1)
        Points along each course, scaled: the states, and the slow quantity in units of ``span``.
    span : float
        The slow quantity's range in the run.
    radius : float
        What counts as near.
    periods : ndarray, shape (n,)
        Scaled period of each state, 0 where it has none.
    velocities : ndarray of bool, shape (n,)
        Whether a state is the time derivative of another, up to a factor.
    """

    time: Array
    slow: Array
    scaled: Array
    extent: Array
    within: Mask
    courses: tuple[Course, ...]
    places: Array
    present: Mask
    curves: tuple[Array, ...]
    span: float
    radius: float
    periods: Array
    velocities: Mask

    def apart(self, course: int) -> Array:
        """Distance from a course at the same value of the slow quantity, shape (N,)."""
        if course not in self._apart:
            deviation = self.deviation(course)
            self._apart[course] = np.sqrt(products(deviation, deviation))
        return self._apart[course]

    @cached_property
    def _apart(self) -> dict[int, Array]:
        return {}

    def deviation(self, course: int, rows: slice | Mask | int = slice(None)) -> Array:
        """Scaled states less those of a course at the same value of the slow quantity."""
        return apart(self.scaled[rows], self.places[rows, course], self.periods)

    def beside(self, course: int) -> Mask:
        """Which samples are nearer than the radius to a course as a curve, shape (N,).

        What lags behind a sheet is beside it all the same: the place where it is to
        be found is one of a moment ago.
        """
        points = self._points(course, self.slow, self.scaled)
        beside = np.empty(len(self.slow), dtype=bool)
        load_loop(BESIDE)(points, self.curves[course], self.radius, beside)
        return beside

    def nearness(self, course: int, slow: Array, scaled: Array) -> Array:
        """The radius less the distance of states from a course as a curve, shape (N,).

        −radius where they are far from all of it in the slow quantity.
        """
        points, near = self._points(course, slow, scaled), np.empty(len(slow))
        load_loop(NEARNESS)(points, self.curves[course], self.radius, near)
        return near

    def _points(self, course: int, slow: Array, scaled: Array) -> Array:
        """States and the slow quantity in the units of the curves, shape (n + 1, N)."""
        if self.periods.any():
            place = self.courses[course].state(slow) / self.extent
            scaled = nearest_copy(scaled, place, self.periods)
        return np.vstack([scaled.T, slow / self.span])

    def way(self, old: int, new: int) -> Array:
        """Which part of the way from one course to another the state has done, shape (N,)."""
        if (old, new) not in self._ways:
            places = self.places[:, old], self.places[:, new]
            self._ways[old, new] = way_done(self.scaled, *places, self.periods)
        return self._ways[old, new]

    @cached_property
    def _ways(self) -> dict[tuple[int, int], Array]:
        return {}


@dataclass(frozen=True)
class Stay:
    """Samples ``start`` to ``stop - 1``, in which one course is followed."""

    course: int
    start: int
    stop: int


def measured(
    slow: SlowQuantity,
    courses: tuple[Course, ...],
    over: tuple[float, float],
    radius: float,
) -> Measured:
    """Measure the samples of a run against all courses."""
    run = slow.run
    # the samples of each state side by side in memory
    state = np.array([run[name] for name in slow.states]).T
    within = (slow.table >= over[0]) & (slow.table <= over[1])
    count, n = state.shape
    places = np.empty((len(courses), n, count)).transpose(2, 0, 1)
    present = np.empty((len(courses), count), dtype=bool).T
    for k, course in enumerate(courses):
        present[:, k] = course.present(slow.table) & within
        places[:, k] = course.state(slow.table)
    met = [rows_of(places[:, k], np.flatnonzero(present[:, k])) for k in range(len(courses))]
    extent, velocities = extents_of(slow, courses, state, met)
    periods = periods_of(slow.states, run.periods)
    span = max(float(np.ptp(slow.table)), 1e-3 * (over[1] - over[0]))
    curves = tuple(_resampled(course.curve() / np.append(extent, span)) for course in courses)
    return Measured(
        run.t,
        slow.table,
        state / extent,
        extent,
        within,
        courses,
        places / extent,
        present,
        curves,
        span,
        radius,
        periods / extent,
        velocities,
    )


def _resampled(curve: Array) -> Array:
    """A curve by points evenly spaced along it."""
    along = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))]
    even = np.linspace(0.0, along[-1], POINTS)
    return np.column_stack([np.interp(even, along, column) for column in curve.T])


def products(one: Array, other: Array) -> Array:
    """The scalar product of each row of one table (N, n) with that of another, shape (N,)."""
    # columns are few, and long
    total = one[:, 0] * other[:, 0]
    for k in range(1, one.shape[1]):
        total += one[:, k] * other[:, k]
    return np.asarray(total)


def rows_of(table: Array, rows: NDArray[np.intp]) -> Array:
    """Some rows of a table (N, n) whose columns lie side by side in memory, as those of it."""
    return np.asarray(table.T.take(rows, axis=1).T)


def way_done(scaled: Array, old: Array, new: Array, periods: Array) -> Array:
    """Which part of the way from an old place to a new one states have done."""
    chord = apart(new, old, periods)
    length = products(chord, chord)
    done = products(apart(scaled, old, periods), chord)
    return np.asarray(done / np.where(length > 0, length, np.inf))


def stays_of(m: Measured) -> list[Stay]:
    """Every course that is followed, in order of time.

    A course is come to where its stable part is near for half a relaxation time (less
    at the end of the run, where more is not to be had); what only passes by is gone
    sooner. It is left where it is no longer near, or where two thirds of the way to
    another stable sheet are done.
    """
    beside = [m.beside(k) for k in range(len(m.courses))]
    visits = [v for k, near in enumerate(beside) for v in _visits(k, near & m.present[:, k])]
    stays: list[Stay] = []
    here = 0
    while True:
        following = [(max(v.start, here), v) for v in visits if v.stop > here]
        if stays:
            # back on the same course only after it was away
            following = [
                (s, v) for s, v in following if v.course != stays[-1].course or v.start >= here
            ]
        following = [(s, v) for s, v in following if _settles(m, v.course, s, v.stop)]
        if not following:
            return _landed(m, stays)
        first = min(s for s, _ in following)
        tied = [v.course for s, v in following if s == first]
        course = tied[0] if len(tied) == 1 else _nearest(m, first, tied)
        here = _left(m, course, first, beside[course])
        stays.append(Stay(course, first, here))
        if here >= len(m.time):
            return _landed(m, stays)


def _landed(m: Measured, stays: list[Stay]) -> list[Stay]:
    """Stays, less those in which the state only swings through a sheet before it settles there."""
    followed = [s for s, after in pairwise(stays) if not _overshoots(m, s, after)]
    return [*followed, *stays[-1:]]


def _overshoots(m: Measured, stay: Stay, after: Stay) -> bool:
    """Whether a short stay and the next are one landing, on a sheet that is stable all along."""
    between = Stay(stay.course, stay.start, after.start + 1)
    return (
        after.course == stay.course
        and bool(m.present[between.start : between.stop, between.course].all())
        and _relaxed(m, stay) < OVERSHOOT
        and _relaxed(m, between) < 2.0 * OVERSHOOT
    )


def _relaxed(m: Measured, stay: Stay) -> float:
    """How many relaxation times of a course a stay lasts."""
    rows = slice(stay.start, stay.stop)
    rate = -m.courses[stay.course].relaxation(m.slow[rows])
    steps = np.minimum(0.5 * (rate[1:] + rate[:-1]) * np.diff(m.time[rows]), 1e12)
    return float(steps.sum())


def _visits(course: int, near: Mask) -> list[Stay]:
    edges = np.flatnonzero(np.diff(np.r_[False, near, False].astype(int)))
    return [Stay(course, int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _settles(m: Measured, course: int, start: int, stop: int) -> bool:
    """Whether a visit lasts for the relaxation times that make it a stay."""
    if stop - start < 2:
        return False
    if stop == len(m.time) and len(m.time) > 2:
        return True
    return _relaxed(m, Stay(course, start, stop)) >= SETTLED


def _nearest(m: Measured, row: int, tied: list[int]) -> int:
    return min(tied, key=lambda k: float(m.apart(k)[row]))


def _left(m: Measured, course: int, start: int, beside: Mask) -> int:
    """The first sample from ``start`` on at which a course is left."""
    rows = slice(start, None)
    away = ~beside[rows] | ~m.within[rows]
    for other in range(len(m.courses)):
        if other != course:
            away |= m.present[rows, other] & (m.way(course, other)[rows] > WAY)
    away[0] = False
    return start + (int(np.argmax(away)) if away.any() else len(away))
