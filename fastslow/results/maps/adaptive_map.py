"""A plane of two parameters divided by what happens at each point, finely at boundaries only."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastslow.arguments import function, items, numbers, shown, validated
from fastslow.errors import ArgumentError, unknown_name
from fastslow.results.base.outcome import Outcome
from fastslow.results.base.result import Result
from fastslow.results.maps.boundaries import MapBoundary, MapEdges, boundaries_of

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Label = str | bool | int

#: The label of points that could not be evaluated.
FAILED = "failed"


@dataclass(frozen=True, eq=False, repr=False)
class RefinedMap(Result):
    """Labels over a plane of two parameters.

    Positions are counted in the finest cells, of which a cell of size s holds
    s × s. A cell larger than the finest has one label at all points evaluated
    on its rim. Between points evaluated the label of the nearest corner holds.

    Parameters
    ----------
    names : (str, str)
        What is along the first and the second axis.
    over : ((float, float), (float, float))
        Range of each.
    shape : (int, int)
        Number of finest cells along each axis.
    labels : tuple of str, bool or int
        In order; ``"failed"`` for points that could not be evaluated.
    corners : ndarray of int, shape (N, 2)
        Positions of the points evaluated, in lexicographic order.
    codes : ndarray of int, shape (N,)
        Which of the labels each point has.
    cells : ndarray of int, shape (M, 3)
        First corner and size of each cell; together they fill the plane.
    edges : MapEdges
        Sides of the finest cells along which the label changes.
    failures : tuple of ((float, float), str)
        Points labelled ``"failed"``, each with the reason.
    n_evaluations : int
        Points evaluated in all, those for narrowing the edges included.

    Examples
    --------
    >>> import fastslow as fs
    >>> disc = fs.refined_map(lambda x, y: x**2 + y**2 < 1, {"x": (0, 2), "y": (0, 2)}, levels=5)
    >>> disc.at(0.6, 0.7), disc.at(x=1.5, y=0.1)
    (True, False)
    >>> round(4 * 4 * disc.shares[True], 2)
    3.14
    """

    names: tuple[str, str]
    over: tuple[tuple[float, float], tuple[float, float]]
    shape: tuple[int, int]
    labels: tuple[Label, ...]
    corners: Integers
    codes: Integers
    cells: Integers
    edges: MapEdges
    failures: tuple[tuple[tuple[float, float], str], ...]
    n_evaluations: int

    @property
    def steps(self) -> Floats:
        """Sides of a finest cell in the units of the axes, shape (2,)."""
        return np.array([high - low for low, high in self.over]) / self.shape

    @property
    def points(self) -> Floats:
        """The points evaluated, shape (N, 2)."""
        return self._located(self.corners)

    @property
    def point_labels(self) -> NDArray[Any]:
        """The label of each point evaluated, shape (N,)."""
        return self._worded(self.codes)

    @property
    def bounds(self) -> Floats:
        """Of each cell: low and high along the first axis, then along the second, shape (M, 4)."""
        low = self._located(self.cells[:, :2])
        high = self._located(self.cells[:, :2] + self.cells[:, 2:])
        return np.stack([low[:, 0], high[:, 0], low[:, 1], high[:, 1]], axis=1)

    @cached_property
    def corner_rows(self) -> Integers:
        """Which of the points evaluated are the corners of each cell, shape (M, 2, 2)."""
        height = self.shape[1] + 1
        keys = self.corners @ np.array([height, 1])
        far = self.cells[:, 2, None, None] * np.array([[0, 1]])
        i, j = self.cells[:, 0, None, None] + far.swapaxes(1, 2), self.cells[:, 1, None, None] + far
        return np.asarray(np.searchsorted(keys, i * height + j))

    @property
    def corner_codes(self) -> Integers:
        """Which of the labels each corner of each cell has, shape (M, 2, 2)."""
        return self.codes[self.corner_rows]

    @property
    def mixed(self) -> NDArray[np.bool_]:
        """Whether the corners of a cell differ, shape (M,): a boundary passes through it."""
        codes = self.corner_codes.reshape(-1, 4)
        return np.any(codes != codes[:, :1], axis=1)

    @property
    def n_pixels(self) -> int:
        """Points that a grid as fine as the finest cells would need."""
        return (self.shape[0] + 1) * (self.shape[1] + 1)

    @cached_property
    def areas(self) -> Floats:
        """How many of the finest cells each point evaluated stands for, shape (N,)."""
        quarter = np.repeat(0.25 * self.cells[:, 2].astype(float) ** 2, 4)
        sums = np.bincount(self.corner_rows.reshape(-1), quarter, len(self.corners))
        return sums.astype(float)

    @property
    def shares(self) -> dict[Label, float]:
        """The part of the plane's area that each label has."""
        sums = np.bincount(self.codes, self.areas, len(self.labels)) / np.prod(self.shape)
        return dict(zip(self.labels, sums.tolist(), strict=True))

    @cached_property
    def boundaries(self) -> tuple[MapBoundary, ...]:
        """All boundaries between two labels, as polylines."""
        finest = self.cells[:, 2] == 1
        cells, codes = self.cells[finest, :2], self.corner_codes[finest]
        return boundaries_of(cells, codes, self.labels, self.edges, self._located)

    def boundary(self, one: Label, other: Label) -> tuple[MapBoundary, ...]:
        """The polylines between two labels, longest first.

        Raises
        ------
        UnknownNameError
            For a label that is not in the map.
        """
        for label in (one, other):
            _require_label(label, self.labels)
        found = [b for b in self.boundaries if set(b.labels) == {one, other}]
        return tuple(sorted(found, key=lambda b: -len(b.points)))

    def at(self, *values: ArrayLike, **named: ArrayLike) -> Any:
        """The label at points of the plane, given in order or by the names of the axes.

        Returns
        -------
        str, bool or int, or ndarray of them
            For numbers one label, for arrays an array.

        Raises
        ------
        UnknownNameError
            For a name that is no axis.
        ArgumentError
            For values that are missing, or that lie outside the map.
        """
        for name in named:
            if name not in self.names:
                raise unknown_name("axis", name, self.names)
        given = [*values, *(named[n] for n in self.names[len(values) :] if n in named)]
        if len(given) != 2 or len(values) + len(named) != 2:
            raise ArgumentError(f"expected a value for each of {', '.join(self.names)}")
        columns = [numbers(name, values) for name, values in zip(self.names, given, strict=True)]
        shapes = [c.shape for c in columns]
        if all(shapes) and shapes[0] != shapes[1]:
            raise ArgumentError(
                f"{' and '.join(self.names)} have the shapes {shapes[0]} and {shapes[1]}; "
                "expected numbers, or arrays of one shape"
            )
        place = np.stack(np.broadcast_arrays(*columns), axis=-1)
        for k, (name, (low, high)) in enumerate(zip(self.names, self.over, strict=True)):
            outside = ~((place[..., k] >= low) & (place[..., k] <= high))
            if outside.any():
                wrong = place[..., k][outside].flat[0]
                raise ArgumentError(f"{name} = {wrong:g}; the map covers [{low:g}, {high:g}]")
        found = self._worded(self._codes_at(place.reshape(-1, 2))).reshape(place.shape[:-1])
        return found if found.ndim else found.item()

    @validated(predict=function)
    def compare(self, predict: Callable[[Floats, Floats], Sequence[Any]]) -> MapComparison:
        """Set what a function predicts beside what was found, at every point evaluated.

        Parameters
        ----------
        predict : callable
            Two arrays of shape (N,), the parameters, to N labels.

        Returns
        -------
        MapComparison

        Raises
        ------
        ArgumentError
            If it returns another number of labels.
        """
        points = self.points
        predicted = items()("what predict returns", predict(points[:, 0], points[:, 1]))
        if len(predicted) != len(points):
            raise ArgumentError(
                f"the prediction has {len(predicted)} labels for {len(points)} points"
            )
        found = self.point_labels.tolist()
        agree = np.array([one == other for one, other in zip(found, predicted, strict=True)])
        return MapComparison(points, tuple(found), tuple(predicted), agree, self.areas)

    def _located(self, positions: ArrayLike) -> Floats:
        part = np.asarray(positions, dtype=float) / self.shape
        low, high = np.transpose(self.over)
        return np.asarray(low * (1.0 - part) + high * part)

    def _worded(self, codes: Integers) -> NDArray[Any]:
        kinds = {type(label) for label in self.labels}
        words = np.empty(len(self.labels), dtype=object)
        words[:] = self.labels
        return words[codes] if len(kinds) > 1 else np.array(self.labels)[codes]

    def _codes_at(self, place: Floats) -> Integers:
        """The label of the nearest corner of the cell that holds each point."""
        low, high = np.transpose(self.over)
        position = (place - low) / (high - low) * self.shape
        unit = np.clip(np.floor(position), 0, np.array(self.shape) - 1).astype(np.int64)
        codes = np.full(len(place), -1)
        height = self.shape[1] + 1
        for size in np.unique(self.cells[:, 2]).tolist():
            rows = np.flatnonzero(self.cells[:, 2] == size)
            keys = self.cells[rows, :2] @ np.array([height, 1])
            order = np.argsort(keys)
            wanted = (unit // size * size) @ np.array([height, 1])
            spot = np.minimum(np.searchsorted(keys[order], wanted), len(keys) - 1)
            cell = rows[order[spot]]
            hit = keys[order[spot]] == wanted
            far = (position - self.cells[cell, :2] >= 0.5 * size).astype(int)
            codes[hit] = self.corner_codes[cell, far[:, 0], far[:, 1]][hit]
        return codes

    def __repr__(self) -> str:
        axes = [
            f"{name} from {low:.6g} to {high:.6g}"
            for name, (low, high) in zip(self.names, self.over, strict=True)
        ]
        lines = [f"RefinedMap over {axes[0]} and {axes[1]}"]
        lines += [f"  {label}: {share:.2%} of the area" for label, share in self.shares.items()]
        lines.append(
            f"  {len(self.cells)} cells with {len(self.corners)} corners, where a grid as fine has "
            f"{self.n_pixels}; {self.n_evaluations} evaluations"
        )
        if self.failures:
            (x, y), reason = self.failures[0]
            at = f"{self.names[0]} = {x:.6g}, {self.names[1]} = {y:.6g}"
            lines.append(f"  {len(self.failures)} failed; at {at}: {reason}")
        return "\n".join(lines)


@dataclass(frozen=True, eq=False, repr=False)
class MapComparison(Result):
    """What was found at the points of a map beside what was predicted.

    Parameters
    ----------
    points : ndarray, shape (N, 2)
    found, predicted : tuple
        Labels at each.
    agree : ndarray of bool, shape (N,)
    areas : ndarray, shape (N,)
        How many of the finest cells each point stands for.
    """

    points: Floats
    found: tuple[Any, ...]
    predicted: tuple[Any, ...]
    agree: NDArray[np.bool_]
    areas: Floats

    @property
    def share(self) -> float:
        """The part of the area on which the two agree."""
        return float(self.areas[self.agree].sum() / self.areas.sum())

    @property
    def disagreements(self) -> Mapping[tuple[Any, Any], Floats]:
        """Points by what was found and what was predicted instead, each of shape (any, 2)."""
        pairs = list(zip(self.found, self.predicted, strict=True))
        differing = dict.fromkeys(p for p, same in zip(pairs, self.agree, strict=True) if not same)
        return {
            pair: self.points[[k for k, p in enumerate(pairs) if p == pair]] for pair in differing
        }

    def __repr__(self) -> str:
        count = len(self.agree)
        lines = [
            f"MapComparison: agreement on {self.share:.4%} of the area, at "
            f"{int(self.agree.sum())} of {count} points"
        ]
        for (found, predicted), points in self.disagreements.items():
            lines.append(f"  {len(points)} found {found}, predicted {predicted}")
        return "\n".join(lines)


def label_of(value: Any) -> tuple[Label, str]:
    """A label as a plain value, and the reason where it says that a point failed.

    Parameters
    ----------
    value : str, bool, int, None, float, Exception or Outcome
        None, NaN, an exception and an outcome without success are failures.

    Raises
    ------
    ArgumentError
        For anything else, e.g. a number that is not whole.

    Examples
    --------
    >>> label_of(np.int64(3)), label_of(2.0), label_of(None)
    ((3, ''), (2, ''), ('failed', 'no outcome'))
    """
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, np.ndarray | Sequence) and not isinstance(value, str):
        raise ArgumentError(f"{shown(value)} is no label of a map; expected one for each point")
    if value is None or value != value:
        return FAILED, "no outcome"
    if isinstance(value, Exception) or (isinstance(value, Outcome) and not value):
        return FAILED, str(value)
    if isinstance(value, Outcome):
        return value.code, ""
    if isinstance(value, float) and value.is_integer():
        return int(value), ""
    if isinstance(value, str | bool | int):
        return value, ""
    raise ArgumentError(f"{value!r} is no label of a map; expected a string, a bool or a count")


def _require_label(label: Any, labels: tuple[Label, ...]) -> None:
    if not isinstance(label, str | bool | int) or label not in labels:
        raise unknown_name("label", label if isinstance(label, str) else shown(label), labels)
