"""Boundaries between the labels of a map, as polylines."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.results.base.immutable import Immutable

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

#: A point of a boundary: on a side of a cell (i, j, axis), or at the centre of a cell (i, j, 2).
Node = tuple[int, int, int]


@dataclass(frozen=True, eq=False, repr=False)
class MapEdges(Immutable):
    """Sides of the finest cells along which the label changes.

    Parameters
    ----------
    places : ndarray of int, shape (E, 3)
        Position of the first end, and the axis of the side, 0 or 1.
    brackets : ndarray, shape (E, 2)
        Bracket of the change of label, as fractions of the side.
    """

    places: Integers
    brackets: Floats


@dataclass(frozen=True, eq=False, repr=False)
class MapBoundary(Immutable):
    """A polyline between two labels.

    Parameters
    ----------
    labels : tuple of two labels
        The labels on the two sides.
    points : ndarray, shape (N, 2)
        In the units of the axes; the last point of a closed line repeats the first.
    accuracy : ndarray, shape (N, 2)
        Error bound of each point along both axes; zero along the axis transverse to
        the side of the cell that contains the point.
    """

    labels: tuple[Any, Any]
    points: Floats
    accuracy: Floats

    @property
    def closed(self) -> bool:
        """True for a closed line."""
        return len(self.points) > 2 and bool(np.all(self.points[0] == self.points[-1]))

    def __repr__(self) -> str:
        kind = "closed line" if self.closed else "line"
        one, other = self.labels
        return f"MapBoundary: {kind} of {len(self.points)} points between {one} and {other}"


def boundaries_of(
    cells: Integers,
    codes: Integers,
    labels: tuple[Any, ...],
    edges: MapEdges,
    coordinates: Callable[[Floats], Floats],
) -> tuple[MapBoundary, ...]:
    """Join the sides on which the label changes, cell by cell, into polylines.

    In a cell with two labels the line connects two sides; with three or more labels
    the lines end at the centre of the cell. If two labels are at opposite corners,
    the corners of the later label are separated.

    Parameters
    ----------
    cells : ndarray of int, shape (M, 2)
        Positions of the finest cells.
    codes : ndarray of int, shape (M, 2, 2)
        Labels at the corners of each.
    labels : tuple
    edges : MapEdges
    coordinates : callable
        Maps positions, shape (N, 2), to points in the units of the axes.

    Returns
    -------
    tuple of MapBoundary
        Ordered by pairs of labels.
    """
    segments: dict[tuple[int, int], list[tuple[Node, Node]]] = {}
    for (i, j), corner in zip(cells.tolist(), codes.tolist(), strict=True):
        for pair, one, other in _segments(i, j, corner):
            segments.setdefault(pair, []).append((one, other))
    brackets = dict(zip(map(tuple, edges.places.tolist()), edges.brackets.tolist(), strict=True))
    unit = coordinates(np.ones((1, 2)))[0] - coordinates(np.zeros((1, 2)))[0]
    found = []
    for pair in sorted(segments):
        for line in _chained(segments[pair]):
            placed = np.array([_place(node, brackets) for node in line])
            accuracy = np.array([_spread(node, brackets) for node in line]) * np.abs(unit)
            between = (labels[pair[0]], labels[pair[1]])
            found.append(MapBoundary(between, coordinates(placed), accuracy))
    return tuple(found)


def _segments(
    i: int, j: int, corner: list[list[int]]
) -> Iterable[tuple[tuple[int, int], Node, Node]]:
    """Yield the boundary segments of a cell: the labels on both sides, and both ends."""
    (a, b), (d, c) = corner
    around = (a, d, c, b)
    sides: list[Node] = [(i, j, 0), (i + 1, j, 1), (i, j + 1, 0), (i, j, 1)]
    crossed: dict[tuple[int, int], list[int]] = {}
    for k in range(4):
        one, other = around[k], around[(k + 1) % 4]
        if one != other:
            crossed.setdefault((min(one, other), max(one, other)), []).append(k)
    for pair, where in crossed.items():
        if len(where) == 1:
            yield pair, sides[where[0]], (i, j, 2)
        elif len(where) == 2:
            yield pair, sides[where[0]], sides[where[1]]
        else:
            # side k ends in corner k + 1, and side k + 1 begins there
            for k in (0, 2) if around[1] == pair[1] else (1, 3):
                yield pair, sides[k], sides[(k + 1) % 4]


def _chained(segments: list[tuple[Node, Node]]) -> Iterable[list[Node]]:
    """Join segments end to end into lines, open ones first."""
    beside: dict[Node, list[Node]] = {}
    for one, other in segments:
        beside.setdefault(one, []).append(other)
        beside.setdefault(other, []).append(one)
    ends = sorted(node for node, others in beside.items() if len(others) == 1)
    for start in (*ends, *sorted(beside)):
        line = [start]
        while beside[line[-1]]:
            following = beside[line[-1]].pop()
            beside[following].remove(line[-1])
            line.append(following)
        if len(line) > 1:
            yield line


def _place(node: Node, brackets: dict[Any, list[float]]) -> tuple[float, float]:
    i, j, axis = node
    if axis == 2:
        return i + 0.5, j + 0.5
    along = 0.5 * sum(brackets[node])
    return (i + along, float(j)) if axis == 0 else (float(i), j + along)


def _spread(node: Node, brackets: dict[Any, list[float]]) -> tuple[float, float]:
    if node[2] == 2:
        return 0.5, 0.5
    low, high = brackets[node]
    half = 0.5 * (high - low)
    return (half, 0.0) if node[2] == 0 else (0.0, half)
