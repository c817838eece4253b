"""Adaptive maps of an outcome over two parameters, refined at its boundaries."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastslow.arguments import function, items, numbers, shown, validated
from fastslow.errors import ArgumentError, unknown_name
from fastslow.results.base.display import Summarized
from fastslow.results.base.outcome import Outcome
from fastslow.results.base.result import Result
from fastslow.results.base.table import Row, Table
from fastslow.results.maps.boundaries import MapBoundary, MapEdges, boundaries_of

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Label = str | bool | int

#: The label of points that could not be evaluated.
FAILED = "failed"

#: The text of a failure without one.
NO_REASON = "failed without a reason"


@dataclass(frozen=True, eq=False, repr=False)
class RefinedMap(Summarized, Table[Row], Result):
    """Labels over a plane of two parameters.

    Positions are in units of the finest cells; a cell of size s contains s × s of
    them. All points evaluated on the sides of a larger cell have the same label.
    Between evaluated points the label is that of the nearest corner.

    Parameters
    ----------
    names : (str, str)
        The parameters along the first and the second axis.
    over : ((float, float), (float, float))
        The range of each.
    shape : (int, int)
        Number of finest cells along each axis.
    labels : tuple of str, bool or int
        In order; ``"failed"`` for points that could not be evaluated.
    corners : ndarray of int, shape (N, 2)
        Positions of the evaluated points, in lexicographic order.
    codes : ndarray of int, shape (N,)
        Index of each point's label.
    cells : ndarray of int, shape (M, 3)
        First corner and size of each cell; the cells tile the plane.
    edges : MapEdges
        Sides of the finest cells along which the label changes.
    failures : tuple of ((float, float), str)
        Points labelled ``"failed"``, each with the reason.
    n_evaluations : int
        Total number of evaluated points, including those of the bisection.

    Examples
    --------
    >>> import fastslow as fs
    >>> five = fs.Refinement(levels=5)
    >>> plane = {"x": (0, 2), "y": (0, 2)}
    >>> disc = fs.refined_map(lambda x, y: x**2 + y**2 < 1, plane, refinement=five)
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

    _row = "point"

    def __len__(self) -> int:
        return len(self.corners)

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Return both parameters and the label of every evaluated point."""
        labels = self.point_labels
        columns = dict(zip(self.names, self.points.T, strict=True))
        return {**columns, "label": labels.astype(str) if labels.dtype == object else labels}

    @property
    def steps(self) -> Floats:
        """Side lengths of a finest cell in the units of the axes, shape (2,)."""
        return np.array([high - low for low, high in self.over]) / self.shape

    @property
    def points(self) -> Floats:
        """The evaluated points, shape (N, 2)."""
        return self._coordinates(self.corners)

    @property
    def point_labels(self) -> NDArray[Any]:
        """The label of each evaluated point, shape (N,)."""
        return self._labels_of(self.codes)

    @property
    def bounds(self) -> Floats:
        """Bounds of each cell, low and high along the first axis, then the second, (M, 4)."""
        low = self._coordinates(self.cells[:, :2])
        high = self._coordinates(self.cells[:, :2] + self.cells[:, 2:])
        return np.stack([low[:, 0], high[:, 0], low[:, 1], high[:, 1]], axis=1)

    @cached_property
    def corner_rows(self) -> Integers:
        """Indices of the corners of each cell among the evaluated points, shape (M, 2, 2)."""
        height = self.shape[1] + 1
        keys = self.corners @ np.array([height, 1])
        far = self.cells[:, 2, None, None] * np.array([[0, 1]])
        i, j = self.cells[:, 0, None, None] + far.swapaxes(1, 2), self.cells[:, 1, None, None] + far
        return np.asarray(np.searchsorted(keys, i * height + j))

    @property
    def corner_codes(self) -> Integers:
        """Index of the label of each corner of each cell, shape (M, 2, 2)."""
        return self.codes[self.corner_rows]

    @property
    def mixed(self) -> NDArray[np.bool_]:
        """True for cells whose corners differ, crossed by a boundary, shape (M,)."""
        codes = self.corner_codes.reshape(-1, 4)
        return np.any(codes != codes[:, :1], axis=1)

    @property
    def n_pixels(self) -> int:
        """Number of points of a uniform grid as fine as the finest cells."""
        return (self.shape[0] + 1) * (self.shape[1] + 1)

    @cached_property
    def areas(self) -> Floats:
        """Area represented by each evaluated point, in finest cells, shape (N,)."""
        quarter = np.repeat(0.25 * self.cells[:, 2].astype(float) ** 2, 4)
        sums = np.bincount(self.corner_rows.reshape(-1), quarter, len(self.corners))
        return sums.astype(float)

    @property
    def shares(self) -> dict[Label, float]:
        """The fraction of the area with each label."""
        sums = np.bincount(self.codes, self.areas, len(self.labels)) / np.prod(self.shape)
        return dict(zip(self.labels, sums.tolist(), strict=True))

    @cached_property
    def boundaries(self) -> tuple[MapBoundary, ...]:
        """All boundaries between two labels, as polylines."""
        finest = self.cells[:, 2] == 1
        cells, codes = self.cells[finest, :2], self.corner_codes[finest]
        return boundaries_of(cells, codes, self.labels, self.edges, self._coordinates)

    def boundary(self, one: Label, other: Label) -> tuple[MapBoundary, ...]:
        """Return the polylines between two labels, longest first.

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
        """Return the label at points given by position or by the names of the axes.

        Returns
        -------
        str, bool or int, or ndarray of them
            One label for numbers, an array for arrays.

        Raises
        ------
        UnknownNameError
            For a name that is not an axis.
        ArgumentError
            For missing values, or values outside the map.
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
        found = self._labels_of(self._codes_at(place.reshape(-1, 2))).reshape(place.shape[:-1])
        return found if found.ndim else found.item()

    @validated(predict=function)
    def compare(self, predict: Callable[[Floats, Floats], Sequence[Any]]) -> MapComparison:
        """Compare a prediction with the label found at every evaluated point.

        Parameters
        ----------
        predict : callable
            Maps two arrays of shape (N,), the parameters, to N labels.

        Returns
        -------
        MapComparison

        Raises
        ------
        ArgumentError
            If it returns a different number of labels.
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

    def _coordinates(self, positions: ArrayLike) -> Floats:
        fraction = np.asarray(positions, dtype=float) / self.shape
        low, high = np.transpose(self.over)
        return np.asarray(low * (1.0 - fraction) + high * fraction)

    def _labels_of(self, codes: Integers) -> NDArray[Any]:
        kinds = {type(label) for label in self.labels}
        words = np.empty(len(self.labels), dtype=object)
        words[:] = self.labels
        return words[codes] if len(kinds) > 1 else np.array(self.labels)[codes]

    def _codes_at(self, place: Floats) -> Integers:
        """Return the label index at the nearest corner of the cell containing each point."""
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

    def _groups(self) -> list[list[str]]:
        axes = [
            f"{name} from {low:.6g} to {high:.6g}"
            for name, (low, high) in zip(self.names, self.over, strict=True)
        ]
        shares = [f"  {label}: {share:.2%} of the area" for label, share in self.shares.items()]
        lines = [
            f"  {len(self.cells)} cells with {len(self.corners)} corners, where a grid as fine has "
            f"{self.n_pixels}; {self.n_evaluations} evaluations"
        ]
        if self.failures:
            (x, y), reason = self.failures[0]
            at = f"{self.names[0]} = {x:.6g}, {self.names[1]} = {y:.6g}"
            lines.append(f"  {len(self.failures)} failed; at {at}: {reason}")
        return [[f"RefinedMap over {axes[0]} and {axes[1]}"], shares, lines]


@dataclass(frozen=True, eq=False, repr=False)
class MapComparison(Summarized, Result):
    """Comparison of the labels of a map with predicted ones.

    Parameters
    ----------
    points : ndarray, shape (N, 2)
    found, predicted : tuple
        Labels at each point.
    agree : ndarray of bool, shape (N,)
    areas : ndarray, shape (N,)
        Area represented by each point, in finest cells.
    """

    points: Floats
    found: tuple[Any, ...]
    predicted: tuple[Any, ...]
    agree: NDArray[np.bool_]
    areas: Floats

    @property
    def share(self) -> float:
        """The fraction of the area on which both agree."""
        return float(self.areas[self.agree].sum() / self.areas.sum())

    @property
    def disagreements(self) -> Mapping[tuple[Any, Any], Floats]:
        """Points of disagreement by (found, predicted) labels, each of shape (k, 2)."""
        pairs = list(zip(self.found, self.predicted, strict=True))
        differing = dict.fromkeys(p for p, same in zip(pairs, self.agree, strict=True) if not same)
        return {
            pair: self.points[[k for k, p in enumerate(pairs) if p == pair]] for pair in differing
        }

    def _groups(self) -> list[list[str]]:
        head = (
            f"MapComparison: agreement on {self.share:.4%} of the area, at "
            f"{int(self.agree.sum())} of {len(self.agree)} points"
        )
        lines = [
            f"  {len(points)} found {found}, predicted {predicted}"
            for (found, predicted), points in self.disagreements.items()
        ]
        return [[head], lines]


def label_of(value: Any) -> tuple[Label, str]:
    """Return a label as a plain value, and the reason for a failed point.

    Parameters
    ----------
    value : str, bool, int, None, float, Exception or Outcome
        None, NaN, an exception and an outcome without success are failures.

    Raises
    ------
    ArgumentError
        For any other value, e.g. a number that is not an integer.

    Examples
    --------
    >>> label_of(np.int64(3)), label_of(2.0), label_of(None)
    ((3, ''), (2, ''), ('failed', 'no outcome'))
    """
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, np.ndarray | Sequence) and not isinstance(value, str):
        raise ArgumentError(f"{shown(value)} is not a label of a map; expected one for each point")
    if value is None or value != value:
        return FAILED, "no outcome"
    if isinstance(value, Exception) or (isinstance(value, Outcome) and not value):
        return FAILED, str(value) or NO_REASON
    if isinstance(value, Outcome):
        return value.code, ""
    if isinstance(value, float) and value.is_integer():
        return int(value), ""
    if value == FAILED:
        return FAILED, NO_REASON
    if isinstance(value, str | bool | int):
        return value, ""
    raise ArgumentError(f"{value!r} is not a label of a map; expected a string, a bool or a count")


def _require_label(label: Any, labels: tuple[Label, ...]) -> None:
    if not isinstance(label, str | bool | int) or label not in labels:
        raise unknown_name("label", label if isinstance(label, str) else shown(label), labels)
