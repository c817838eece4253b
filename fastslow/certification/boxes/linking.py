"""Proved pieces joined to curves: chains of arcs, divided until their properties are decided."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from fastslow.certification.boxes.krawczyk import KrawczykSpace
from fastslow.certification.boxes.pruning import Pruned, workspace
from fastslow.certification.loops import ENCLOSE, TIGHTEN
from fastslow.kernels.intervals.printer import IntervalProgram
from fastslow.kernels.loops import load_loop
from fastslow.results.certificates import NOT_CONTINUED, NOT_SEPARATED

Array = NDArray[np.float64]
Whole = NDArray[np.int64]

#: Smallest extent of an arc in its free unknown, in units of the window: what is not decided on
#: it is left undecided.
SHORTEST_ARC = 1e-9

#: Smallest range of the parameter on an arc that is divided at a fold, in units of the window.
NARROWEST_FOLD = 1e-10

#: Largest number of divisions of an arc, and of arcs divided at once: more of them are not at
#: isolated points, as on a curve along an interface.
LINK_DIVISIONS, MOST_AT_ONCE = 40, 1000

#: Distance from a box left, in units of the window, at which a curve ends there.
NEAR_LEFT_BOX = 1e-6

#: Boxes whose ends are compared with all pieces at once.
_BOXES_AT_ONCE = 256


def enclosed(program: IntervalProgram, low: Array, high: Array) -> tuple[Array, Array]:
    """Enclose functions and then their derivatives over boxes, shapes (m, n (N + 1))."""
    shape = len(low), len(program.program.rows) * (low.shape[1] + 1)
    below, above = np.empty(shape), np.empty(shape)
    load_loop(ENCLOSE)(
        program.program,
        np.ascontiguousarray(low),
        np.ascontiguousarray(high),
        program.registers(),
        below,
        above,
    )
    return below, above


@dataclass(frozen=True, eq=False)
class IntervalProblem:
    """Equations of one motion in interval arithmetic, on a window.

    Parameters
    ----------
    program : IntervalProgram
        The rows that vanish.
    heights : IntervalProgram or None
        The functions that bound the region.
    signs : tuple of int
        Their signs in it.
    low, high : ndarray, shape (N,)
        The window.
    """

    program: IntervalProgram
    heights: IntervalProgram | None
    signs: tuple[int, ...]
    low: Array
    high: Array

    @property
    def unit(self) -> Array:
        """The widths of the window."""
        extent = self.high - self.low
        return np.where(extent > 0, extent, 1.0)

    def enclosed(self, space: KrawczykSpace, free: Whole, low: Array, high: Array) -> CurveBoxes:
        """Contract boxes around proved curves, and enclose their tangents."""
        boxes = CurveBoxes(low.copy(), high.copy(), np.empty_like(low), np.empty_like(low))
        load_loop(TIGHTEN)(
            self.program.program, self.unit, np.ascontiguousarray(free), boxes.low, boxes.high,
            boxes.tangent_low, boxes.tangent_high, space,
        )  # fmt: skip
        return boxes

    def position(self, low: Array, high: Array) -> Whole:
        """Return 1 for boxes inside region and window, 0 for boxes outside, −1 for others."""
        inside = ((low >= self.low) & (high <= self.high)).all(axis=1)
        outside = ((high < self.low) | (low > self.high)).any(axis=1)
        if self.heights is not None:
            below, above = enclosed(self.heights, low, high)
            for k, sign in enumerate(self.signs):
                small, large = (below, above) if sign > 0 else (-above, -below)
                inside &= small[:, k] > 0
                outside |= large[:, k] < 0
        return np.where(outside, 0, np.where(inside, 1, -1))


@dataclass(frozen=True, eq=False)
class CurveBoxes:
    """Boxes around curves, with bounds of the derivatives by their free unknowns."""

    low: Array
    high: Array
    tangent_low: Array
    tangent_high: Array

    def signs(self, unknown: Any, rows: Whole | None = None) -> Whole:
        """Signs of the derivative of one unknown, or one per box; 0 where not decided."""
        rows = np.arange(len(self.low)) if rows is None else rows
        low, high = self.tangent_low[rows, unknown], self.tangent_high[rows, unknown]
        return np.where(low > 0, 1, np.where(high < 0, -1, 0))


#: Arrays of arcs.
COLUMNS = (
    "low", "high", "free", "forward", "first", "last", "direction", "position", "unstable"
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Arcs:
    """Consecutive arcs of one curve.

    Parameters
    ----------
    low, high : ndarray, shape (m, N)
        Boxes, in which the curve is a graph over the free unknown.
    free, forward : ndarray of int, shape (m,)
        The free unknown and the direction in which the curve runs through it.
    first, last : ndarray, shape (m, 2)
        Bounds of the free unknown at the beginning and the end of each arc.
    direction : ndarray of int, shape (m,)
        1 or −1 where the parameter increases or decreases along the arc, 0 if not decided.
    position : ndarray of int, shape (m,)
        1 inside region and window, 0 outside, −1 if not decided.
    unstable : ndarray of int, shape (m,)
        Number of eigenvalues with positive real part, −1 if not decided.
    closed : bool
    ends : tuple of str
        Why the curve ends: ``"edge"`` of window or region, ``"boxes left"``,
        ``"not continued"``, or ``"not separated"`` from another curve, which may be the same.
    """

    low: Array
    high: Array
    free: Whole
    forward: Whole
    first: Array
    last: Array
    direction: Whole
    position: Whole
    unstable: Whole
    closed: bool = False
    ends: tuple[str, str] = ("edge", "edge")

    def rows(self, rows: Any) -> Arcs:
        """Return some of the arcs."""
        return replace(self, **{name: getattr(self, name)[rows] for name in COLUMNS})


def curves_of(problem: IntervalProblem, pruned: Pruned) -> list[Arcs]:
    """Join the pieces of a search to curves, and decide monotony and position of their arcs.

    Parameters
    ----------
    problem : IntervalProblem
    pruned : Pruned

    Returns
    -------
    list of Arcs
        Connected curves, not yet divided at the edges of window and region.
    """
    if not len(pruned.free):
        return []
    space = workspace(problem.program)
    return [_divided(problem, space, chain) for chain in _Linked(problem, pruned, space).chains()]


class _Linked:
    """The pieces, with enclosures of their ends and the pieces that continue them."""

    def __init__(self, problem: IntervalProblem, pruned: Pruned, space: KrawczykSpace) -> None:
        self.problem, self.pruned = problem, pruned
        m = len(pruned.free)
        rows = np.arange(m)
        low, high = np.repeat(pruned.low, 2, axis=0), np.repeat(pruned.high, 2, axis=0)
        free = np.repeat(pruned.free, 2)
        ends = np.empty(2 * m)
        ends[0::2], ends[1::2] = pruned.low[rows, pruned.free], pruned.high[rows, pruned.free]
        both = np.arange(2 * m)
        low[both, free] = high[both, free] = ends
        #: End 2i is the lower end of piece i, end 2i + 1 the upper one.
        self.ends = problem.enclosed(space, free, low, high)
        #: Pairs of pieces: an end of the first is in the second, so that they are of one curve, or
        #: an end of the first has points in common with the second.
        self.same: list[tuple[Whole, Whole]] = []
        self.meet: list[tuple[Whole, Whole]] = []
        self.next = self._continued(free)

    def _continued(self, free: Whole) -> Whole:
        """For each end, the end towards which the curve continues in another piece, −1 if none."""
        low, high = self.pruned.low, self.pruned.high
        unit = self.problem.unit
        # the box in which a piece is unique contains its image in the interior
        below, above = np.nextafter(low, -np.inf), np.nextafter(high, np.inf)
        own = np.arange(len(low)), self.pruned.free
        below[own], above[own] = low[own], high[own]
        found = np.full(len(free), -1)
        # blocks of neighbouring ends, which only the pieces around them can meet
        middles = 0.5 * (self.ends.low + self.ends.high)
        spread = np.ptp(middles, axis=0) / unit if len(free) else np.zeros(low.shape[1])
        order = np.argsort(middles[:, int(np.argmax(spread))], kind="stable")
        for start in range(0, len(free), _BOXES_AT_ONCE):
            rows = order[start : start + _BOXES_AT_ONCE]
            lowest, highest = self.ends.low[rows].min(axis=0), self.ends.high[rows].max(axis=0)
            near = np.flatnonzero(((below <= highest) & (lowest <= above)).all(axis=1))
            inside, meets = np.ones((2, len(rows), len(near)), dtype=bool)
            for j in range(low.shape[1]):
                first, last = self.ends.low[rows, j, None], self.ends.high[rows, j, None]
                inside &= (below[near, j] <= first) & (last <= above[near, j])
                meets &= (below[near, j] <= last) & (first <= above[near, j])
            ends, pieces = np.nonzero(meets)
            self.meet.append((rows[ends] // 2, near[pieces]))
            ends, pieces = np.nonzero(inside)
            ends, pieces = rows[ends], near[pieces]
            other = pieces != ends // 2
            ends, pieces = ends[other], pieces[other]
            self.same.append((ends // 2, pieces))
            own = self.pruned.free[pieces]
            outwards = np.where(ends % 2 == 1, 1, -1)
            heading = outwards * self.ends.signs(own, ends)
            target = np.where(heading > 0, high[pieces, own], low[pieces, own])
            middle = 0.5 * (self.ends.low[ends, own] + self.ends.high[ends, own])
            rest = heading * (target - middle) / unit[own]
            # the longest continuation comes last
            longest = np.argsort(rest, kind="stable")
            for k in longest[rest[longest] > 0]:
                found[ends[k]] = 2 * pieces[k] + (heading[k] > 0)
        return found

    def chains(self) -> Iterator[Arcs]:
        """Every connected curve once."""
        m = len(self.pruned.free)
        one, other = (np.concatenate(pieces) for pieces in zip(*self.same, strict=True))
        joined = np.ones(len(one)), (one, other)
        _, groups = connected_components(coo_array(joined, shape=(m, m)), directed=False)
        one, other = (groups[np.concatenate(pieces)] for pieces in zip(*self.meet, strict=True))
        # each pair meets in both orders or in one: the shorter curve may be part of the longer
        sizes = np.bincount(groups)
        shorter = np.where(sizes[one] <= sizes[other], one, other)
        unclear = set(shorter[one != other].tolist())
        done: set[int] = set()
        # curves with ends first, then closed ones
        for end in [*np.flatnonzero(self.next < 0), *range(2 * m)]:
            group = int(groups[end // 2])
            if group not in done:
                done.add(group)
                chain = self._chain(int(end))
                yield replace(chain, ends=(NOT_SEPARATED,) * 2) if group in unclear else chain

    def _chain(self, end: int) -> Arcs:
        """The curve that begins at an end, up to an end without continuation or to itself."""
        opened = self.next[end] < 0
        heading = end ^ 1
        visited: dict[int, int] = {}
        path: list[int] = []
        while heading not in visited:
            visited[heading] = len(path)
            path.append(heading)
            if self.next[heading] < 0:
                break
            heading = int(self.next[heading])
        else:
            path = path[visited[heading] :]
        closed = bool(self.next[path[-1]] >= 0)
        return self._arcs(path, closed, end if opened else -1)

    def _arcs(self, path: Sequence[int], closed: bool, start: int) -> Arcs:
        headings = np.array(path)
        pieces, forward = headings // 2, np.where(headings % 2 == 1, 1, -1)
        free = self.pruned.free[pieces]
        low, high = self.pruned.low[pieces].copy(), self.pruned.high[pieces].copy()
        rows = np.arange(len(path))
        before = np.roll(headings, 1)
        first = np.column_stack([self.ends.low[before, free], self.ends.high[before, free]])
        last = np.column_stack([self.ends.low[headings, free], self.ends.high[headings, free]])
        if not closed:
            own = headings[0] ^ 1 if start < 0 else start
            first[0] = self.ends.low[own, free[0]], self.ends.high[own, free[0]]
        both = np.concatenate([first, last], axis=1)
        low[rows, free], high[rows, free] = both.min(axis=1), both.max(axis=1)
        nothing = np.zeros(len(path), dtype=np.int64)
        unknown = np.full(len(path), -1)
        ends = ("edge", "edge") if closed else (self._why(path[0] ^ 1), self._why(path[-1]))
        return Arcs(
            low=low,
            high=high,
            free=free,
            forward=forward,
            first=first,
            last=last,
            direction=nothing,
            position=nothing.copy(),
            unstable=unknown,
            closed=closed,
            ends=ends,
        )

    def _why(self, end: int) -> str:
        """Why a curve ends: at the edge of the window, at boxes left, or for no known reason."""
        low, high = self.ends.low[end], self.ends.high[end]
        if not np.all((low > self.problem.low) & (high < self.problem.high)):
            return "edge"
        near, pruned = NEAR_LEFT_BOX * self.problem.unit, self.pruned
        for boxes_low, boxes_high in (
            (pruned.left_low, pruned.left_high),
            (pruned.open_low, pruned.open_high),
        ):
            if np.any(np.all((boxes_low <= high + near) & (low - near <= boxes_high), axis=1)):
                return "boxes left"
        return NOT_CONTINUED


def _divided(problem: IntervalProblem, space: KrawczykSpace, arcs: Arcs) -> Arcs:
    """Divide arcs until direction and position are decided, or they are too short."""
    parameter = len(problem.low) - 1
    pending = np.ones(len(arcs.free), dtype=bool)
    for division in range(LINK_DIVISIONS):
        rows = np.flatnonzero(pending)
        if not len(rows):
            break
        boxes = problem.enclosed(space, arcs.free[rows], arcs.low[rows], arcs.high[rows])
        arcs.low[rows], arcs.high[rows] = boxes.low, boxes.high
        arcs.direction[rows] = boxes.signs(parameter) * arcs.forward[rows]
        arcs.position[rows] = problem.position(boxes.low, boxes.high)
        reach = (boxes.high - boxes.low)[:, parameter] / problem.unit[parameter]
        turning = (arcs.direction[rows] == 0) & (reach > NARROWEST_FOLD)
        undecided = (arcs.position[rows] < 0) | ((arcs.position[rows] > 0) & turning)
        free = arcs.free[rows]
        extent = (boxes.high - boxes.low)[np.arange(len(rows)), free] / problem.unit[free]
        pending = np.zeros(len(arcs.free), dtype=bool)
        pending[rows[undecided & (extent > SHORTEST_ARC)]] = True
        if division and pending.sum() > MOST_AT_ONCE:
            break
        arcs, pending = halved(arcs, pending)
    return arcs


def halved(arcs: Arcs, chosen: NDArray[np.bool_]) -> tuple[Arcs, NDArray[np.bool_]]:
    """Divide the chosen arcs at the middle of their free unknown."""
    copies = arcs.rows(np.repeat(np.arange(len(chosen)), np.where(chosen, 2, 1)))
    halves = np.repeat(chosen, np.where(chosen, 2, 1))
    one = np.flatnonzero(halves)[0::2]
    free = copies.free[one]
    middle = 0.5 * copies.low[one, free] + 0.5 * copies.high[one, free]
    copies.last[one] = copies.first[one + 1] = middle[:, None]
    up = copies.forward[one] > 0
    copies.high[one[up], free[up]] = copies.low[one[up] + 1, free[up]] = middle[up]
    copies.low[one[~up], free[~up]] = copies.high[one[~up] + 1, free[~up]] = middle[~up]
    return copies, halves


def nodes_of(problem: IntervalProblem, arcs: Arcs) -> tuple[Array, Array]:
    """Enclose the points at which the arcs begin, and the end of the last, shapes (m + 1, N)."""
    space = workspace(problem.program)
    rows = np.arange(len(arcs.free))
    low, high = arcs.low.copy(), arcs.high.copy()
    low[rows, arcs.free], high[rows, arcs.free] = arcs.first.T
    low, high = np.vstack([low, arcs.low[-1:]]), np.vstack([high, arcs.high[-1:]])
    low[-1, arcs.free[-1]], high[-1, arcs.free[-1]] = arcs.last[-1]
    free = np.append(arcs.free, arcs.free[-1])
    boxes = problem.enclosed(space, free, low, high)
    return boxes.low, boxes.high
