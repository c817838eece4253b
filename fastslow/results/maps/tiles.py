"""Layout of the outputs of a grid, and division of its points into tasks."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import ArgumentError

#: The dimension of paired axes.
POINT = "point"

#: The text of the failures of a task during which a worker died twice.
WORKER_DIED = (
    "the worker process died twice during this task: out of memory, killed, a crash of compiled "
    "code, or a script without if __name__ == '__main__'"
)

#: Values of points without an output, by kind of array.
FILL: dict[str, Any] = {"f": np.nan, "c": complex(np.nan, np.nan), "b": False, "U": ""}


@dataclass(frozen=True)
class Tiles:
    """Boxes of a grid whose points follow each other, the last axis fastest.

    Parameters
    ----------
    shape : tuple of int
        Number of values along each axis.
    size : tuple of int
        That of one box; the last box along an axis may be smaller.
    """

    shape: tuple[int, ...]
    size: tuple[int, ...]

    @property
    def counts(self) -> tuple[int, ...]:
        """Number of boxes along each axis."""
        return tuple(-(-n // m) for n, m in zip(self.shape, self.size, strict=True))

    def __len__(self) -> int:
        return math.prod(self.counts)

    def slices(self, k: int) -> tuple[slice, ...]:
        """Return the box of a task, as slices along the axes."""
        place = np.unravel_index(k, self.counts)
        return tuple(
            slice(int(i) * m, min((int(i) + 1) * m, n))
            for i, m, n in zip(place, self.size, self.shape, strict=True)
        )

    def box(self, k: int) -> tuple[int, ...]:
        """Return the number of points of a task along each axis."""
        return tuple(part.stop - part.start for part in self.slices(k))

    def points(self, k: int) -> slice:
        """Return the points of a task among those of the whole grid in order."""
        part = self.slices(k)
        first = int(np.ravel_multi_index([s.start for s in part], self.shape))
        return slice(first, first + math.prod(self.box(k)))

    def spread(self, marks: NDArray[Any]) -> NDArray[Any]:
        """Return a value for each point from one for each task, shape ``shape``."""
        for axis, (n, m) in enumerate(zip(self.shape, self.size, strict=True)):
            marks = np.repeat(marks, m, axis=axis)[(slice(None),) * axis + (slice(n),)]
        return marks


def tiles_of(shape: tuple[int, ...], chunk: int) -> Tiles:
    """Return the tasks of a grid.

    Parameters
    ----------
    shape : tuple of int
    chunk : int
        Number of points of a task: at most one row of the last axis, or whole rows.

    Raises
    ------
    ArgumentError
        For a number of points that is neither.

    Examples
    --------
    >>> tiles_of((3, 4), 2), len(tiles_of((3, 4), 8))
    (Tiles(shape=(3, 4), size=(1, 2)), 2)
    >>> tiles_of((3, 4), 5)
    Traceback (most recent call last):
    ...
    fastslow.errors.ArgumentError: chunk = 5; expected at most one row of 4 points, or whole rows \
of the axes, such as 4
    """
    left = min(chunk, math.prod(shape))
    size: list[int] = []
    inner = 1
    for n in reversed(shape):
        whole, rest = divmod(left, inner)
        if rest:
            near = math.prod(default_tiles(shape, chunk).size)
            raise ArgumentError(
                f"chunk = {chunk}; expected at most one row of {shape[-1]} points, or whole rows "
                f"of the axes, such as {near}"
            )
        size.insert(0, min(max(whole, 1), n))
        if whole >= n:
            inner *= n
        else:
            size[:0] = [1] * (len(shape) - len(size))
            break
    return Tiles(shape, tuple(size))


def default_tiles(shape: tuple[int, ...], points: int) -> Tiles:
    """Return tasks of about a number of points, from the shape of a grid alone.

    Examples
    --------
    >>> default_tiles((100, 30), 100), default_tiles((100, 30), 7)
    (Tiles(shape=(100, 30), size=(3, 30)), Tiles(shape=(100, 30), size=(1, 6)))
    """
    size: list[int] = []
    left = max(1, points)
    for n in reversed(shape):
        m = min(n, left)
        if len(size) == 0 and m < n:
            m = -(-n // -(-n // m))  # boxes of nearly equal size along a row
        size.insert(0, m)
        left = left // n if m == n else 1
    return Tiles(shape, tuple(size))


def trailing(name: str, count: int) -> tuple[str, ...]:
    """Return names of the further dimensions of an output."""
    return tuple(f"{name}_axis{k + 1}" for k in range(count))


def unit_attributes(units: Mapping[str, str], name: str) -> dict[str, str]:
    """Return the attributes of an array of a data set, by the conventions of NetCDF."""
    return {"units": units[name]} if name in units else {}
