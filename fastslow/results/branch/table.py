"""The rows of a curve: columns with tangents, stability, and the special points on them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastslow.results.base.immutable import Immutable
from fastslow.results.base.table import ResultTable
from fastslow.results.points import SpecialPoint, stability_of

Array = NDArray[np.float64]

#: Relative distance below which a row is at a value of the parameter.
AT = 1e-12

#: Relative change of a column between rows at one value from which they are a continuum.
CONTINUUM_CHANGE = 1e-9


class Place(NamedTuple):
    """A place on a curve: a fraction of the step after a row, with the parameter there.

    ``vertical`` is True for an end of a segment with constant parameter.
    """

    row: int
    part: float
    value: float
    vertical: bool = False


@dataclass(frozen=True, eq=False, repr=False)
class MonotoneRuns(Immutable):
    """Ranges of rows with monotone parameter; each begins at the last row of the previous one.

    Parameters
    ----------
    first, last : ndarray of int, shape (K,)
        Rows.
    low, high : ndarray, shape (K,)
        Smallest and largest parameter value.
    signed : ndarray, shape (2, N)
        The parameter and its negative, one of which increases along each range.
    """

    first: NDArray[np.intp]
    last: NDArray[np.intp]
    low: Array
    high: Array
    signed: Array

    def around(self, value: float, near: float) -> tuple[list[tuple[int, int]], list[int]]:
        """Return ranges of rows at a value, and rows before a crossing of the value."""
        level: list[tuple[int, int]] = []
        passed: list[int] = []
        for k in np.flatnonzero((self.low <= value + near) & (self.high >= value - near)):
            first, last = int(self.first[k]), int(self.last[k])
            falling = int(self.signed[0, last] < self.signed[0, first])
            rising = self.signed[falling, first : last + 1]
            target = -value if falling else value
            begin = int(np.searchsorted(rising, target - near, side="left"))
            end = int(np.searchsorted(rising, target + near, side="right"))
            if end > begin:
                begin, end = first + begin, first + end - 1
                if level and begin <= level[-1][1] + 1:
                    level[-1] = (level[-1][0], end)
                else:
                    level.append((begin, end))
            elif 0 < begin < len(rising):
                passed.append(first + begin - 1)
        return level, passed


def monotone_runs(parameter: Array) -> MonotoneRuns:
    """Split a branch at the extrema of its parameter.

    Examples
    --------
    >>> runs = monotone_runs(np.array([0.0, 1.0, 1.0, 2.0, 1.0, 0.0]))
    >>> runs.first.tolist(), runs.last.tolist()
    ([0, 3], [3, 5])
    >>> runs.around(0.5, 0.0)
    ([], [0, 4])
    """
    way = np.sign(np.diff(parameter))
    moving = np.flatnonzero(way)
    if len(moving):
        # a constant step continues in the direction of the step before it
        source = np.zeros(len(way), dtype=np.intp)
        source[moving] = moving
        source = np.maximum.accumulate(source)
        source[: moving[0]] = moving[0]
        way = way[source]
    turns = np.flatnonzero(way[1:] != way[:-1]) + 1
    first = np.append(0, turns)
    last = np.append(turns, len(parameter) - 1)
    ends = parameter[first], parameter[last]
    return MonotoneRuns(
        first, last, np.minimum(*ends), np.maximum(*ends), np.stack([parameter, -parameter])
    )


@dataclass(frozen=True, eq=False, repr=False)
class BranchTable(Immutable):
    """The rows of a traced curve of equilibria, special points or orbits.

    All queries of branches take this table and return rows, places or numbers; the owner
    turns them into its points.

    Parameters
    ----------
    columns, free : tuple of str
        Names of the dependent columns (states, or properties of an orbit), and of the free
        parameters.
    points : ndarray, shape (N, k)
        Dependent columns, then free parameters.
    tangent : ndarray, shape (N, k)
        Unit tangents, in the direction of tracing.
    special : SpecialPoints or SpecialOrbits
        In order along the curve.
    special_rows : tuple of int
        The row of each special point (of one with two rows, the first).
    eigenvalues : ndarray of complex, shape (N, m)
        Eigenvalues of equilibria, or multipliers of orbits.
    region : ndarray of str, shape (N,)
        The region, or the itinerary of an orbit.
    closed : bool
        True for a closed curve, whose last row repeats the first.
    known_stability : ndarray of str, shape (N,), optional
        The stability where it does not follow from the signs of the eigenvalues' real parts.
    periods : mapping
        The period of each periodic column.

    Examples
    --------
    >>> from fastslow.results.points import SpecialPoints
    >>> p = np.array([0.0, 1.0, 2.0])
    >>> points, tangent = np.column_stack([p**2, p]), np.column_stack([2 * p, p**0])
    >>> rows = {"eigenvalues": np.full((3, 1), -1.0 + 0j), "region": np.full(3, "S1")}
    >>> table = BranchTable(("x",), ("p",), points, tangent, SpecialPoints(), (), **rows)
    >>> table.places(0.5)
    [Place(row=0, part=0.5, value=0.5, vertical=False)]
    """

    columns: tuple[str, ...]
    free: tuple[str, ...]
    points: Array
    tangent: Array
    special: ResultTable[Any]
    special_rows: tuple[int, ...]
    eigenvalues: NDArray[np.complex128]
    region: NDArray[np.str_]
    closed: bool = False
    known_stability: NDArray[np.str_] | None = None
    periods: Mapping[str, float] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.points)

    @cached_property
    def stability(self) -> NDArray[np.str_]:
        """``"stable"``, ``"unstable"``, ``"neutral"`` or ``"undecided"``, shape (N,)."""
        if self.known_stability is not None:
            return self.known_stability
        return stability_of(self.eigenvalues)

    @cached_property
    def stable(self) -> NDArray[np.bool_]:
        """True for stable rows, shape (N,)."""
        return self.stability == "stable"

    @property
    def region_changes(self) -> NDArray[np.intp]:
        """The first row of every region but the first, in order."""
        return np.flatnonzero(self.region[1:] != self.region[:-1]) + 1

    @cached_property
    def regions(self) -> tuple[str, ...]:
        """The regions along the curve, each once, in order."""
        return tuple(dict.fromkeys(self.region[np.append(0, self.region_changes)].tolist()))

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the columns of ``points``."""
        return (*self.columns, *self.free)

    def column(self, name: str) -> Array:
        """Return a dependent column or a free parameter, shape (N,)."""
        return self.points[:, self.names.index(name)]

    @property
    def state(self) -> Array:
        """The dependent columns, shape (N, n)."""
        return self.points[:, : len(self.columns)]

    @cached_property
    def values(self) -> Array:
        """The last free parameter, contiguous in memory, shape (N,)."""
        return np.ascontiguousarray(self.points[:, -1])

    @cached_property
    def monotone_runs(self) -> MonotoneRuns:
        """Ranges of rows with monotone parameter."""
        return monotone_runs(self.values)

    @property
    def range(self) -> tuple[float, float]:
        """Smallest and largest value of the parameter."""
        return float(self.monotone_runs.low.min()), float(self.monotone_runs.high.max())

    def places(self, value: float) -> list[Place]:
        """Return the places at which the parameter takes a value, in order along the curve.

        A segment with constant parameter is represented by its two ends. The lookup costs a
        comparison per monotone range and a binary search in those that contain the value.
        """
        level, passed = self.monotone_runs.around(
            value, AT * float(np.abs(self.values).max(initial=0.0))
        )
        runs = [(begin, begin, end) for begin, end in level]
        if self.closed and len(runs) > 1 and runs[0][1] == 0 and runs[-1][2] == len(self) - 1:
            # the last row repeats the first: merge both ranges
            last = runs.pop()
            runs[0] = (0, last[1], runs[0][2])
        found: list[tuple[int, Place]] = []
        for order, begin, end in runs:
            moved = np.abs(self.state[end] - self.state[begin])
            vertical = bool(np.any(moved > CONTINUUM_CHANGE * self._unit))
            for row in (begin, end) if vertical else (begin,):
                found.append((order, Place(row, 0.0, float(self.values[row]), vertical)))
        for row in passed:
            low, high = self.values[row : row + 2]
            found.append((row, Place(row, float((value - low) / (high - low)), value)))
        return [place for _, place in sorted(found, key=lambda entry: entry[0])]

    @property
    def _unit(self) -> Array:
        """The scale of each dependent column, at least the unit of the model."""
        unit = np.abs(self.state).max(axis=0, initial=0.0)
        for point in self.special[:1]:
            if isinstance(point, SpecialPoint) and point.source is not None:
                unit = np.maximum(unit, point.source.unit)
        return unit

    @property
    def labels(self) -> NDArray[np.str_]:
        """The labels of the special points on each row, empty without any, shape (N,)."""
        texts: dict[int, str] = {}
        for point, row in zip(self.special, self.special_rows, strict=True):
            texts[row] = f"{texts.get(row, '')} {point.label}".strip()
        labels = np.zeros(len(self), dtype=f"<U{max([1, *map(len, texts.values())])}")
        labels[list(texts)] = list(texts.values())
        return labels
