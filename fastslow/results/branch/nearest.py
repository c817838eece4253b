"""The place on branches that is nearest to given values."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import ArgumentError
from fastslow.results.angles import copies, periods_of
from fastslow.results.base.table import check_values
from fastslow.results.branch.table import BranchTable, Place

Array = NDArray[np.float64]


def nearest_place(tables: Sequence[BranchTable], values: Mapping[str, float]) -> tuple[int, Place]:
    """Return the table and the place nearest to given values; see `Branch.nearest`."""
    if not tables:
        raise ArgumentError("this diagram has no branches")
    check_values(values, tables[0].names, "state or parameter")
    lines = [np.column_stack([table.column(name) for name in values]) for table in tables]
    low = np.min([line.min(axis=0) for line in lines], axis=0)
    high = np.max([line.max(axis=0) for line in lines], axis=0)
    scale = np.where(high > low, high - low, 1.0)
    periods = periods_of(tuple(values), tables[0].periods)
    scale = np.where(periods > 0, periods, scale)
    ways = [
        copies(float(v), *entry)
        for v, *entry in zip(values.values(), low, high, periods, strict=True)
    ]
    targets = [np.array(way) / scale for way in product(*ways)]
    _, row, part, best = min(
        (*_closest(line / scale, target), k) for k, line in enumerate(lines) for target in targets
    )
    if part in (0.0, 1.0):
        row, part = row + int(part), 0.0
    first, last = tables[best].values[[row, row + (part > 0.0)]]
    return best, Place(row, part, float(first + part * (last - first)))


def _closest(line: Array, target: Array) -> tuple[float, int, float]:
    """Return distance, row and fraction of the following step, of the nearest point of a line."""
    if len(line) == 1:
        return float(np.linalg.norm(line[0] - target)), 0, 0.0
    distance, part = along_line(line, target)
    row = int(np.argmin(distance))
    return math.sqrt(distance[row]), row, float(part[row])


def along_line(line: Array, target: Array) -> tuple[Array, Array]:
    """Return the squared distance of every step of a line, and the fraction of the step."""
    step = np.diff(line, axis=0)
    length = (step**2).sum(axis=1)
    part = ((target - line[:-1]) * step).sum(axis=1) / np.where(length > 0, length, 1.0)
    part = np.clip(part, 0.0, 1.0)
    return ((line[:-1] + part[:, None] * step - target) ** 2).sum(axis=1), part
