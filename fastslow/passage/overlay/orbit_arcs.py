"""Stable slices of branches of periodic orbits, and curves of their strobed states."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from fastslow.results.angles import apart, periods_of
from fastslow.results.base.intervals import runs_of
from fastslow.results.orbits.orbit_branch import OrbitBranch
from fastslow.results.orbits.special_orbit import SpecialOrbit
from fastslow.results.overlay.transitions import StableBranch

Array = NDArray[np.float64]
Rows = NDArray[np.intp]

#: Points per step of a branch on the curve through its rows.
POINTS_PER_STEP = 64

#: Difference of the same orbits on two branches, relative to the ranges of their states.
SAME_ORBIT = 1e-3

#: Distance of rows, relative to the length of the curve, below which one is left out.
CLOSE_ROWS = 1e-5

#: Regions of an itinerary in a description.
NAMED_REGIONS = 8


@dataclass(frozen=True, eq=False)
class OrbitArc:
    """Strobed states of a branch over rows along which the parameter is monotone.

    Orbits of m periods of the forcing have m states at its phase 0, through which a run
    passes in turn; an arc is a curve of orbits with the number of the state at time 0.

    Parameters
    ----------
    branch : OrbitBranch
    rows : ndarray of int
        In ascending order of the parameter.
    values : ndarray, shape (P,)
        Ascending values of the parameter along the curve.
    states : ndarray, shape (m, P, n)
        The strobed states there.
    offset : int
        Number of the state at time 0.
    stable_branches : tuple of int
        Indices into all stable branches.
    ranges : ndarray, shape (k, 2)
        Range of the parameter of each of them.
    """

    branch: OrbitBranch
    rows: Rows
    values: Array
    states: Array
    offset: int
    stable_branches: tuple[int, ...]
    ranges: Array

    def numbers(self, strobes: NDArray[np.int64]) -> NDArray[np.int64]:
        """Index of the state at strobes, which are numbered from time 0."""
        return np.asarray((strobes + self.offset) % len(self.states))

    def at(self, strobes: NDArray[np.int64], slow: Array) -> Array:
        """Strobed states at values of the parameter, shape (N, n); constant beyond the range."""
        found = np.empty((len(slow), self.states.shape[2]))
        numbers = self.numbers(strobes)
        for number, curve in enumerate(self.states):
            here = numbers == number
            columns = [np.interp(slow[here], self.values, column) for column in curve.T]
            found[here] = np.column_stack(columns)
        return found

    def slope(self, strobes: NDArray[np.int64], slow: Array) -> Array:
        """Derivative of the strobed states by the parameter, shape (N, n); 0 beyond the range."""
        right = np.clip(np.searchsorted(self.values, slow), 1, len(self.values) - 1)
        numbers = self.numbers(strobes)
        rise = self.states[numbers, right] - self.states[numbers, right - 1]
        width = self.values[right] - self.values[right - 1]
        inside = (slow >= self.values[0]) & (slow <= self.values[-1]) & (width > 0)
        return np.where(inside[:, None], rise / np.where(width > 0, width, 1.0)[:, None], 0.0)

    def relaxation(self, slow: Array) -> Array:
        """Largest log|μ| / T at values of the parameter, shape (N,)."""
        # at a contact the multipliers are not known
        known = ~np.isnan(self._rates)
        if not known.any():
            return np.full(len(slow), np.nan)
        return np.interp(slow, self.branch.values[self.rows][known], self._rates[known])

    @cached_property
    def _rates(self) -> Array:
        largest = self.branch.log_multipliers[self.rows].max(axis=1)
        return np.maximum(largest / self.branch.period[self.rows], -1e300)

    def present(self, slow: Array) -> NDArray[np.bool_]:
        """Whether the arc contains a stable orbit at values of the parameter."""
        found = np.zeros(len(slow), dtype=bool)
        for low, high in self.ranges.tolist():
            found |= (slow >= low) & (slow <= high)
        return found


def arcs_of_orbits(
    branches: Sequence[OrbitBranch],
) -> tuple[tuple[StableBranch, ...], tuple[OrbitArc, ...]]:
    """Return the stable slices of branches, and the arcs on which they are.

    Slices of the same orbits at another phase are left out: a branch of doubled orbits passes
    through the period doubling and returns along the same orbits, shifted by half their period.
    """
    stable: list[StableBranch] = []
    arcs: list[OrbitArc] = []
    for number, branch in enumerate(branches):
        strobed = _strobed(branch)
        curve = _curve(branch, strobed) if len(branch) > 1 else np.empty((0, 0))
        for start, stop in _monotone(branch.values):
            slices = _stable_slices(branch, start, stop)
            if not slices:
                continue
            way = 1 if branch.values[stop - 1] > branch.values[start] else -1
            rows = np.arange(start, stop)[::way]
            points = curve[start * POINTS_PER_STEP : (stop - 1) * POINTS_PER_STEP + 1][::way]
            values = np.maximum.accumulate(points[:, 0])
            states = points[:, 1:].reshape(len(points), *strobed.shape[::2]).transpose(1, 0, 2)
            inside: list[int] = []
            ranges: list[list[float]] = []
            for low, high in slices:
                reach = sorted(branch.values[[low, high]].tolist())
                if any(_repeats(arc, values, states, reach) for arc in arcs):
                    continue
                route = branch.itineraries[(low + high) // 2]
                words = " → ".join(route[:NAMED_REGIONS]) + " → …" * (len(route) > NAMED_REGIONS)
                inside.append(len(stable))
                stable.append(StableBranch(f"O{len(stable) + 1}", number, low, high + 1, words))
                ranges.append(reach)
            if inside:
                of = branch, rows, values, states
                arcs += [
                    OrbitArc(*of, offset, tuple(inside), np.array(ranges))
                    for offset in range(branch.multiple or 1)
                ]
    return tuple(stable), tuple(arcs)


def _repeats(arc: OrbitArc, values: Array, states: Array, reach: Sequence[float]) -> bool:
    """Whether an arc has the orbits of a curve over a range of the parameter, at any phase."""
    if len(states) != len(arc.states):
        return False
    middle = np.array([0.5 * (reach[0] + reach[1])])
    slack = SAME_ORBIT * (reach[1] - reach[0])
    if not ((arc.ranges[:, 0] <= reach[0] + slack) & (arc.ranges[:, 1] >= reach[1] - slack)).any():
        return False
    lengths = periods_of(arc.branch.states, arc.branch.template.trajectory.periods)
    place = [np.interp(middle, values, column)[0] for column in states[0].T]
    away = apart(arc.at(np.zeros(1, dtype=np.int64), middle)[0], place, lengths)
    return bool((np.abs(away) <= SAME_ORBIT * np.ptp(states, axis=(0, 1))).all())


def ends_branch(point: SpecialOrbit) -> bool:
    """Whether a stable branch may end at a point: a bifurcation, or a contact with an interface."""
    return point.kind.changes_stability or bool(point.interface)


def _strobed(branch: OrbitBranch) -> Array:
    """States of every row at the phase 0 of all periods of the forcing, shape (m, rows, n)."""
    count = branch.multiple or 1
    shares = np.arange(count) / count
    states = np.array([orbit(shares * orbit.period).T for orbit in branch.orbits])
    lengths = periods_of(branch.states, branch.template.trajectory.periods)
    for k in np.flatnonzero(lengths > 0):
        states[:, :, k] = np.unwrap(states[:, :, k], period=lengths[k], axis=0)
    return states.transpose(1, 0, 2)


def _monotone(values: Array) -> list[tuple[int, int]]:
    """Ranges of rows with monotone parameter; consecutive ones share the row of the fold."""
    sense = np.sign(np.diff(values))
    moving = np.flatnonzero(sense)
    turns = [int(b) for a, b in pairwise(moving) if sense[a] != sense[b]]
    if not len(moving):
        return []
    bounds = [0, *turns, len(values) - 1]
    return [(a, b + 1) for a, b in pairwise(bounds)]


def _stable_slices(branch: OrbitBranch, start: int, stop: int) -> list[tuple[int, int]]:
    """First and last row of every stable slice in a range; special points bound them exactly."""
    found = []
    for first, last in runs_of(branch.stable[start:stop]):
        low, high = start + first, start + last - 1
        low -= low - 1 >= start and low - 1 in branch.special_rows
        high += high + 1 < stop and high + 1 in branch.special_rows
        if high > low:
            found.append((low, high))
    return found


def _curve(branch: OrbitBranch, strobed: Array) -> Array:
    """Points on the curve of parameter and strobed states, smooth in its length and across folds.

    Shape (POINTS (rows − 1) + 1, 1 + m n); the rows are every ``POINTS_PER_STEP``-th of them.
    """
    table = np.column_stack([branch.values, *strobed])
    scale = np.ptp(table, axis=0)
    steps = np.linalg.norm(np.diff(table / np.where(scale > 0, scale, 1.0), axis=0), axis=1)
    along = np.r_[0.0, np.cumsum(steps)]
    kinks = [row for p, row in zip(branch.special, branch.special_rows, strict=True) if p.interface]
    fine = (
        along[:-1, None] + steps[:, None] * (np.arange(POINTS_PER_STEP) / POINTS_PER_STEP)
    ).reshape(-1)
    parts = []
    for a, b in pairwise(np.unique([0, *kinks, len(table) - 1])):
        kept = a + _apart(along[a : b + 1], CLOSE_ROWS * along[-1])
        parts.append(
            _smooth(along[kept], table[kept], fine[a * POINTS_PER_STEP : b * POINTS_PER_STEP])
        )
    return np.vstack([*parts, table[-1:]])


def _apart(along: Array, least: float) -> Rows:
    """Indices of the first and the last point, and of those not too close to another one."""
    kept = [0]
    for k in range(1, len(along) - 1):
        if along[k] - along[kept[-1]] > least and along[-1] - along[k] > least:
            kept.append(k)
    return np.array([*kept, len(along) - 1])


def _smooth(along: Array, table: Array, fine: Array) -> Array:
    """Values of the cubic spline through rows, of the line through less than four."""
    if len(along) < 4:
        return np.column_stack([np.interp(fine, along, column) for column in table.T])
    # an import of some tenths of a second
    from scipy.interpolate import CubicSpline

    return np.asarray(CubicSpline(along, table)(fine))
