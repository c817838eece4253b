"""Stable branches of a diagram, and the monotone arcs that contain them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from fastslow.results.branch.branch import Branch, MonotonePiece
from fastslow.results.branch.diagram import Diagram
from fastslow.results.branch.interpolation import Cubics, cubics
from fastslow.results.overlay.transitions import StableBranch
from fastslow.results.points import SpecialPoint
from fastslow.results.stored.operations import AT_REST

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Arc:
    """Arc of a branch along which the parameter is monotone, possibly across interfaces.

    Parameters
    ----------
    branch : Branch
    pieces : tuple of MonotonePiece
        One for each region, in order along the branch, joined at boundary equilibria.
    stable_branches : tuple of int
        Stable branches on the arc, as indices into those of the diagram.
    ranges : ndarray, shape (len(stable_branches), 2)
        Parameter range of each of them.
    """

    branch: Branch
    pieces: tuple[MonotonePiece, ...]
    stable_branches: tuple[int, ...]
    ranges: Array

    @cached_property
    def _rows(self) -> NDArray[np.intp]:
        """Rows in ascending order of the parameter; a joint has two rows."""
        rows = np.concatenate([np.arange(p.start, p.stop) for p in self.pieces])
        values = self.branch.values
        return rows if values[rows[-1]] >= values[rows[0]] else rows[::-1]

    @cached_property
    def _ordered(self) -> Array:
        return self.branch.values[self._rows]

    @cached_property
    def _leading(self) -> Array:
        eigenvalues = self.branch.eigenvalues[self._rows]
        real = np.where(np.isinf(eigenvalues.real), -np.inf, eigenvalues.real)
        return np.maximum(real.max(axis=1), -1e300)

    @cached_property
    def _softest(self) -> Array:
        size = np.abs(self.branch.eigenvalues[self._rows])
        return np.where(np.isfinite(size), size, np.inf).min(axis=1)

    @cached_property
    def range(self) -> tuple[float, float]:
        return float(self._ordered[0]), float(self._ordered[-1])

    def present(self, slow: Array) -> NDArray[np.bool_]:
        """Whether the arc contains a stable equilibrium at values of the parameter."""
        found = np.zeros(len(slow), dtype=bool)
        for low, high in self.ranges.tolist():
            found |= (slow >= low) & (slow <= high)
        return found

    def held(self, slow: Array) -> NDArray[np.bool_]:
        """Whether the equilibria at values of the parameter are held against walls."""
        rows = self._rows[np.minimum(self._step(slow), len(self._rows) - 2)]
        there = np.array([AT_REST in str(name) for name in self.branch.region])
        return np.asarray(there[rows])

    def fastest(self) -> float:
        """Median modulus of the largest finite eigenvalue."""
        size = np.abs(self.branch.eigenvalues[self._rows])
        return float(np.median(np.where(np.isfinite(size), size, 0.0).max(axis=1)))

    def curve(self) -> Array:
        """States and parameter of all rows, shape (rows, n + 1)."""
        return np.column_stack([self.branch.state[self._rows], self._ordered])

    def state(self, slow: Array) -> Array:
        """Equilibria at values of the parameter, shape (N, n); constant beyond the range."""
        low, high = self.range
        slow = np.minimum(np.maximum(slow, low), high)
        return self._cubics.at(self._step(slow), slow)

    @cached_property
    def _cubics(self) -> Cubics:
        return cubics(self.branch.table, np.minimum(self._rows[:-1], self._rows[1:]))

    def slope(self, slow: Array) -> Array:
        """dX/dw at parameter values, shape (N, n); infinite at a fold, 0 beyond the range."""
        low, high = self.range
        inside = np.minimum(np.maximum(slow, low), high)
        step, (begin, width, lower, upper) = self._step(inside), self._tangents
        part = (inside - begin[step]) / width[step]
        mean = (1 - part) * lower.take(step, axis=1) + part * upper.take(step, axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = mean[:-1] / mean[-1]
        slope[:, (slow < low) | (slow > high)] = 0.0
        return slope.T

    @cached_property
    def _tangents(self) -> tuple[Array, Array, Array, Array]:
        """Start and width of each step, and tangents at its lower and upper row.

        The two tangents of a step, in columns, have the same orientation.
        """
        values, tangent = self._ordered, self.branch.tangent[self._rows]
        one, other = tangent[:-1], tangent[1:]
        other = np.where(np.sum(one * other, axis=1, keepdims=True) < 0, -other, other)
        lower, upper = (np.ascontiguousarray(t.T) for t in (one, other))
        return values[:-1], np.diff(values), lower, upper

    def relaxation(self, slow: Array) -> Array:
        """Largest real part of the eigenvalues at values of the parameter, shape (N,)."""
        return np.interp(slow, self._ordered, self._leading)

    def stiffness(self, slow: Array) -> Array:
        """Smallest modulus of the eigenvalues at values of the parameter, shape (N,)."""
        return np.interp(slow, self._ordered, self._softest)

    def _step(self, slow: Array) -> NDArray[np.intp]:
        """Index of the step that contains each value inside the range."""
        return self._step_after[np.searchsorted(self._ordered, slow, side="right")]

    @cached_property
    def _step_after(self) -> NDArray[np.intp]:
        """Index of the step of a value, by the number of rows not above it."""
        place = np.clip(np.arange(len(self._ordered) + 1) - 1, 0, len(self._ordered) - 2)
        # the two rows of a joint bound no step
        return np.where(self._ordered[place] == self._ordered[place + 1], place - 1, place)


def arcs_of(diagram: Diagram) -> tuple[tuple[StableBranch, ...], tuple[Arc, ...]]:
    """Collect the stable branches of all admissible branches and their arcs."""
    found: list[tuple[int, int, int, str]] = []
    members: list[tuple[Branch, list[MonotonePiece], list[int]]] = []
    for number, branch in enumerate(diagram.branches):
        if not branch.admissible:
            continue
        stable = branch.stable
        for pieces in _monotone(branch):
            inside = []
            for piece in pieces:
                rows = np.arange(piece.start, piece.stop)
                for part in np.split(rows, np.flatnonzero(np.diff(stable[rows].astype(int))) + 1):
                    if stable[part[0]]:
                        start = max(piece.start, int(part[0]) - 1)
                        stop = min(piece.stop, int(part[-1]) + 2)
                        inside.append(len(found))
                        found.append((number, start, stop, piece.region))
            if inside:
                members.append((branch, pieces, inside))
    counts = {f[3]: sum(g[3] == f[3] for g in found) for f in found}
    seen: dict[str, int] = {}
    stable_branches = []
    for number, start, stop, region in found:
        seen[region] = seen.get(region, 0) + 1
        label = region if counts[region] == 1 else f"{region}.{seen[region]}"
        stable_branches.append(StableBranch(label, number, start, stop, region))
    arcs = []
    for branch, pieces, inside in members:
        ends = [
            sorted(branch.values[[stable_branches[k].start, stable_branches[k].stop - 1]])
            for k in inside
        ]
        arcs.append(Arc(branch, tuple(pieces), tuple(inside), np.array(ends)))
    return tuple(stable_branches), tuple(arcs)


def _monotone(branch: Branch) -> list[list[MonotonePiece]]:
    """Monotone pieces of a branch, joined where the parameter continues in one direction."""
    joined: list[list[MonotonePiece]] = []
    sense = 0.0
    for piece in branch.monotone_pieces():
        values = branch.values[[piece.start, piece.stop - 1]]
        now = float(np.sign(values[1] - values[0]))
        touching = joined and joined[-1][-1].stop == piece.start
        if touching and now == sense and branch.values[piece.start - 1] == values[0]:
            joined[-1].append(piece)
        else:
            joined.append([piece])
        sense = now
    return joined


def ends_of(diagram: Diagram, stable_branch: StableBranch) -> list[SpecialPoint]:
    """Special points at which a stable branch ends."""
    branch = diagram.branches[stable_branch.branch]
    low, high = sorted(branch.values[[stable_branch.start, stable_branch.stop - 1]])
    near = 1e-9 * max(abs(low), abs(high), high - low)
    return [
        point
        for point, row in zip(branch.special, branch.special_rows, strict=True)
        if point.kind.changes_stability
        and stable_branch.start - 1 <= row <= stable_branch.stop
        and min(abs(point[diagram.parameter] - low), abs(point[diagram.parameter] - high)) <= near
    ]


def over_a_gap(diagram: Diagram, one: StableBranch, other: StableBranch) -> bool:
    """Whether a continuum joins two stable branches: rows at one parameter value."""
    if one.branch != other.branch:
        return False
    first, second = sorted((one, other), key=lambda s: s.start)
    values = diagram.branches[one.branch].values[first.stop - 1 : second.start + 1]
    size = max(float(np.abs(diagram.over).max()), np.finfo(float).tiny)
    return len(values) > 2 and bool(np.ptp(values) <= 1e-9 * size)
