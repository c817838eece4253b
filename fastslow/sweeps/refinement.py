"""Adaptive maps of the outcome in two parameters, refined at its boundaries."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import (
    function,
    interval,
    mapping,
    validated,
)
from fastslow.errors import ArgumentError
from fastslow.results.maps.adaptive_map import FAILED, Label, RefinedMap
from fastslow.results.maps.boundaries import MapEdges
from fastslow.simulation.settings import (
    EXECUTION,
    Execution,
    map_settings,
    progress_bar,
)
from fastslow.sweeps.batch_stores import BatchStores
from fastslow.sweeps.label_batches import Batches, Function
from fastslow.sweeps.settings import REFINEMENT, Refinement, refinement_settings

Floats = NDArray[np.float64]
Position = tuple[int, int]
Cell = tuple[int, int, int]


@validated(
    function=function,
    over=mapping,
    refinement=refinement_settings,
    execution=map_settings,
)
def refined_map(
    function: Function,
    over: Mapping[Any, tuple[float, float]],
    *,
    refinement: Refinement = REFINEMENT,
    execution: Execution = EXECUTION,
) -> RefinedMap:
    """Compute an adaptive map of an outcome over a plane of two parameters.

    The plane is divided into equal cells. A cell whose corners differ in outcome
    is halved along both axes, and so are its neighbours, level by level; all new
    corners of a level are evaluated in one call, each once. The cost grows with
    the length of the boundaries, not with the area. A feature inside a single
    cell of the first level is not detected.

    Parameters
    ----------
    function : callable
        Maps two arrays of shape (m,), the parameters, to m labels: strings, bools or
        counts. None, NaN, an exception or an unsuccessful `Outcome` in place of a
        label marks that point as failed. If the function raises, its points are
        evaluated in smaller groups, and those that raise alone are marked as failed.
    over : mapping
        The two parameters by name, each with its range (low, high).
    refinement : Refinement
        Cells of the first level, their refinement, and the resolution of boundaries.
    execution : Execution
        Executor and number of points of its tasks, of which those of a level are computed at
        once; by default the function is called once for each level, in the calling thread. A
        store has a group for each level, and the same call resumes inside it. Progress bar.

    Returns
    -------
    RefinedMap

    Raises
    ------
    ArgumentError
        If the ranges are empty or not finite, or not two; for too many levels; for labels
        of an unsupported type or wrong number.
    Exception
        Any exception that the function raises at every point of the first level, or a
        signal handler at any time.

    See Also
    --------
    fastslow.regime_map, fastslow.sweep, fastslow.plot.regime_map

    Examples
    --------
    >>> over = {"x": (0, 1), "y": (0, 1)}
    >>> fine = Refinement(levels=3, resolution=1e-9)
    >>> half = refined_map(lambda x, y: x > y, over, refinement=fine)
    >>> half
    RefinedMap over x from 0 to 1 and y from 0 to 1
      False: 50.78% of the area
      True: 49.22% of the area
      991 cells with 1120 corners, where a grid as fine has 4225; 4192 evaluations
    >>> (line,) = half.boundary(True, False)
    >>> bool(np.abs(line.points[:, 0] - line.points[:, 1]).max() < 1e-9)
    True
    """
    names, ranges = _ranges(over)
    first, levels = refinement.cells, refinement.levels
    size = 2**levels
    shape = (first[0] * size, first[1] * size)
    if math.prod(shape) > 2**60:
        raise ArgumentError(
            f"levels = {levels}; expected fewer: too many cells at the finest level"
        )
    with progress_bar(execution, "point") as bar, BatchStores(execution) as stores:
        settings = {"over": str(ranges), "refinement": str(refinement)}
        batches = Batches(function, names, stores, settings, bar.update)
        points = _Points(ranges, shape, batches)
        tiling = _Tiling(points, shape, size, refinement.guard)
        places, brackets = _narrowed(points, tiling.leaves, refinement.resolution)
    corners = sorted(points.known)
    labels, codes = _coded([points.known[p] for p in corners])
    return RefinedMap(
        names=names,
        over=ranges,
        shape=shape,
        labels=labels,
        corners=np.array(corners, dtype=np.int64),
        codes=codes,
        cells=np.array([(i, j, s) for (i, j), s in sorted(tiling.leaves.items())], dtype=np.int64),
        edges=MapEdges(places, brackets),
        failures=tuple(points.failures),
        n_evaluations=points.count,
    )


def _ranges(
    over: Mapping[Any, tuple[float, float]],
) -> tuple[tuple[str, str], tuple[tuple[float, float], tuple[float, float]]]:
    names = [str(name) for name in over]
    if len(set(names)) != 2:
        received = ", ".join(names) or "none"
        raise ArgumentError(f"over: expected the ranges of two parameters, received {received}")
    ranges = []
    for name, given in zip(names, over.values(), strict=True):
        ranges.append(interval(f"over {name}", given))
    return (names[0], names[1]), (ranges[0], ranges[1])


def _coded(found: Sequence[Label]) -> tuple[tuple[Label, ...], NDArray[np.int64]]:
    """Return the labels in order, failures last, and the index of each point's label."""
    kinds = {type(label) for label in found}
    if {bool, int} <= kinds:
        raise ArgumentError("some labels are bools, some counts; expected one or the other")
    keys = [(label == FAILED, type(label).__name__, label) for label in found]
    order = sorted(set(keys))
    number = {key: k for k, key in enumerate(order)}
    return tuple(key[2] for key in order), np.array([number[k] for k in keys], dtype=np.int64)


class _Points:
    """The points evaluated so far."""

    def __init__(
        self,
        ranges: tuple[tuple[float, float], tuple[float, float]],
        shape: Position,
        batches: Batches,
    ) -> None:
        self.batches = batches
        self.low, self.high = np.transpose(ranges)
        self.shape = np.array(shape, dtype=float)
        self.known: dict[Position, Label] = {}
        self.failures: list[tuple[tuple[float, float], str]] = []
        self.count = 0

    def evaluate_new(self, wanted: Iterable[Position]) -> list[Position]:
        """Evaluate the points that have no label yet, and return them."""
        new = sorted({p for p in wanted if p not in self.known})
        self.known.update(zip(new, self.evaluate(np.array(new, dtype=float)), strict=True))
        return new

    def evaluate(self, positions: Floats) -> list[Label]:
        """Return the labels at positions of shape (m, 2), in units of the finest cells."""
        if not len(positions):
            return []
        fraction = positions / self.shape
        points = self.low * (1.0 - fraction) + self.high * fraction
        found = self.batches.evaluate(points)
        self.count += len(points)
        for point, (label, reason) in zip(points.tolist(), found, strict=True):
            if label == FAILED:
                self.failures.append(((point[0], point[1]), reason))
        return [label for label, _ in found]


class _Tiling:
    """The cells, halved until every cell with different corners is one of the finest."""

    def __init__(self, points: _Points, shape: Position, size: int, guard: int) -> None:
        self.points, self.shape, self.size = points, shape, size
        self.smallest = size
        coarse = [(i, j) for i in range(0, shape[0], size) for j in range(0, shape[1], size)]
        self.leaves: dict[Position, int] = dict.fromkeys(coarse, size)
        points.evaluate_new((i + a, j + b) for i, j in coarse for a in (0, size) for b in (0, size))
        waiting = {(*at, size) for at in coarse if self._differs((*at, size))}
        while waiting := {c for c in waiting if c[2] > 1 and self.leaves.get(c[:2]) == c[2]}:
            divided = set(waiting)
            for cell in waiting:
                divided |= self._neighbours(cell, guard)
            waiting = self._divide(divided)

    def _divide(self, cells: set[Cell]) -> set[Cell]:
        """Halve cells along both axes; return cells now known to have different labels."""
        wanted = []
        for i, j, size in cells:
            half = size // 2
            wanted += [(i + a, j + b) for a in (0, half, size) for b in (0, half, size)]
        new = self.points.evaluate_new(wanted)
        differing = set()
        for i, j, size in cells:
            half = size // 2
            self.smallest = min(self.smallest, half)
            for child in ((i, j), (i + half, j), (i, j + half), (i + half, j + half)):
                self.leaves[child] = half
                if self._differs((*child, half)):
                    differing.add((*child, half))
        for i, j in new:
            # a new point may lie on the side of a larger neighbour
            for cell in {self._cell_at(i - a, j - b) for a in (0, 1) for b in (0, 1)} - {None}:
                assert cell is not None
                if self.points.known[i, j] != self.points.known[cell[:2]]:
                    differing.add(cell)
        return differing

    def _differs(self, cell: Cell) -> bool:
        """Return True if the evaluated points on the sides of a cell differ in label."""
        i, j, size = cell
        around = [(i, j), (i + size, j), (i + size, j + size), (i, j + size)]
        known = self.points.known
        label = known[i, j]
        return any(known[p] != label for p in around) or any(
            known[p] != label
            for k in range(4)
            for p in self._between(around[k], around[(k + 1) % 4])
        )

    def _between(self, one: Position, other: Position) -> Iterator[Position]:
        """Yield the evaluated points on a side, found by bisection."""
        middle = ((one[0] + other[0]) // 2, (one[1] + other[1]) // 2)
        if middle not in (one, other) and middle in self.points.known:
            yield middle
            yield from self._between(one, middle)
            yield from self._between(middle, other)

    def _cell_at(self, i: int, j: int) -> Cell | None:
        """Return the cell that contains a finest cell, None outside the plane."""
        if 0 <= i < self.shape[0] and 0 <= j < self.shape[1]:
            size = self.smallest  # near a boundary, where most are looked for
            while size <= self.size:
                at = (i - i % size, j - j % size)
                if self.leaves.get(at) == size:
                    return (*at, size)
                size *= 2
        return None

    def _neighbours(self, cell: Cell, rings: int) -> set[Cell]:
        """Return a cell and its neighbours that are not smaller, within so many rings."""
        found, rim = {cell}, {cell}
        for _ in range(rings):
            beside = set()
            for i, j, size in rim:
                for a in (i - 1, i, i + size):
                    for b in (j - 1, j, j + size):
                        other = self._cell_at(a, b)
                        if other is not None and other[2] >= cell[2]:
                            beside.add(other)
            rim = beside - found
            found |= beside
        return found


def _narrowed(
    points: _Points, leaves: Mapping[Position, int], resolution: float | None
) -> tuple[NDArray[np.int64], Floats]:
    """Return the sides of finest cells whose ends differ, and brackets of the change."""
    known = points.known
    places = set()
    for (i, j), size in leaves.items():
        if size == 1:
            for a, b, axis in ((i, j, 0), (i, j + 1, 0), (i, j, 1), (i + 1, j, 1)):
                if known[a, b] != known[a + 1 - axis, b + axis]:
                    places.add((a, b, axis))
    table = np.array(sorted(places), dtype=np.int64).reshape(-1, 3)
    brackets = np.tile([0.0, 1.0], (len(table), 1))
    along = np.eye(2)[table[:, 2]]
    first = [known[i, j] for i, j in table[:, :2].tolist()]
    while resolution is not None and len(table):
        middle = brackets.mean(axis=1)
        wide = (brackets[:, 1] - brackets[:, 0]) / points.shape[table[:, 2]] > resolution
        wide &= (middle > brackets[:, 0]) & (middle < brackets[:, 1])
        rows = np.flatnonzero(wide)
        if not len(rows):
            break
        labels = points.evaluate(table[rows, :2] + middle[rows, None] * along[rows])
        for row, label in zip(rows.tolist(), labels, strict=True):
            brackets[row, 0 if label == first[row] else 1] = middle[row]
    return table, brackets
