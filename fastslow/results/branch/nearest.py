"""Nearest-point queries on branches."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import finite
from fastslow.errors import ArgumentError, unknown_name
from fastslow.results.angles import copies, periods_of
from fastslow.results.branch.lookup import between, read_off, stored
from fastslow.results.points import Corrector, Equilibrium

if TYPE_CHECKING:
    from fastslow.results.branch.branch import Branch

Array = NDArray[np.float64]


def nearest_of(
    branches: Sequence[Branch],
    constants: Mapping[str, float],
    values: Mapping[str, float],
    corrector: Corrector | None,
) -> Equilibrium:
    """Return the nearest point of several branches; see `Branch.nearest`."""
    if not branches:
        raise ArgumentError("this diagram has no branches")
    valid = (*branches[0].states, branches[0].parameter)
    if not values:
        raise ArgumentError(f"expected values of some of {', '.join(valid)}, received none")
    for name, value in values.items():
        if name not in valid:
            raise unknown_name("state or parameter", name, valid)
        finite(name, value)
    tables = [np.column_stack([b[name] for name in values]) for b in branches]
    low = np.min([t.min(axis=0) for t in tables], axis=0)
    high = np.max([t.max(axis=0) for t in tables], axis=0)
    scale = np.where(high > low, high - low, 1.0)
    periods = periods_of(tuple(values), branches[0].periods)
    scale = np.where(periods > 0, periods, scale)
    ways = [
        copies(float(v), *entry)
        for v, *entry in zip(values.values(), low, high, periods, strict=True)
    ]
    targets = [np.array(way) / scale for way in product(*ways)]
    _, row, part, best = min(
        (*_closest(t / scale, target), k) for k, t in enumerate(tables) for target in targets
    )
    return _point(branches[best], row, part, constants, corrector)


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


def _point(
    branch: Branch,
    row: int,
    part: float,
    constants: Mapping[str, float],
    corrector: Corrector | None,
) -> Equilibrium:
    if part in (0.0, 1.0):
        return stored(branch, row + int(part), constants)
    low, high = branch.values[row : row + 2]
    where = float(low + part * (high - low))
    if min(low, high) < where < max(low, high):
        return between(branch, row, where, constants, corrector)
    state = (1 - part) * branch.state[row] + part * branch.state[row + 1]
    return read_off(branch, row, part, state, {**constants, branch.parameter: where})
