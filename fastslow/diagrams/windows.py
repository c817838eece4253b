"""Restriction of equilibria to a window of the states."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fastslow.diagrams.field import DOUBTFUL, FrozenField
from fastslow.results.branch.branch import Branch
from fastslow.results.branch.windows import LEFT, StateWindow
from fastslow.results.points import Equilibrium

Array = NDArray[np.float64]

#: Equilibria determine the size of a state up to this multiple of its natural unit.
LARGEST_STATE = 1e3

#: For each state, whether its lower and its upper bound are selected.
Sides = tuple[tuple[bool, bool], ...]


def known(field: FrozenField, points: Sequence[Equilibrium]) -> np.ndarray:
    """Return which components of equilibria exceed rounding errors, shape (m, n)."""
    found = np.reshape([np.abs(e.state) > 0 for e in points], (-1, field.n)).astype(bool)
    # sliding along several interfaces is not a mode of the field
    rows = [k for k, e in enumerate(points) if e.region in field.regions]
    found[rows] = field.certain([_place(field, points[k]) for k in rows])
    return found


def _place(field: FrozenField, point: Equilibrium) -> tuple[int, Array]:
    """Return the number of the region and the point u."""
    value = point.parameters.get(field.parameter, 0.0)
    return field.regions.index(point.region), np.append(point.state, value)


def size_of(field: FrozenField, points: Sequence[Equilibrium]) -> Array:
    """Return the unit of each state given some equilibria, shape (n,)."""
    size = field.sizes([_place(field, e) for e in points if e.region in field.regions])
    # on several interfaces and at two-folds there is no mode, whose rates determine rounding errors
    others = [np.abs(e.state) for e in points if e.region not in field.regions]
    largest = np.reshape(others, (-1, field.n)).max(axis=0, initial=0.0)
    return np.where(largest > DOUBTFUL * size, np.maximum(largest, size), size)


def limited(field: FrozenField, sizes: Array, value: float) -> Array:
    """Return sizes of states without that of a distant equilibrium, such as one near a pole."""
    return np.minimum(sizes, LARGEST_STATE * field.units_at(abs(value))[: field.n])


def within(
    field: FrozenField, window: StateWindow, points: Sequence[Equilibrium]
) -> list[Equilibrium]:
    """Return the equilibria in a window.

    Equilibria on an edge up to rounding are included. Rounding is relative to the size of the
    state among these equilibria, without distant ones, or to its natural unit if all are zero.
    """
    if not window.chosen:
        return list(points)
    states = np.reshape([e.state for e in points], (-1, field.n))
    value = float(points[0].parameters.get(field.parameter, 0.0)) if points else 0.0
    inside = window.contains(window.shifted(states), limited(field, size_of(field, points), value))
    return [e for e, kept in zip(points, inside, strict=True) if kept]


def edges_left(window: StateWindow, branches: Sequence[Branch]) -> Sides:
    """Return the bounds at which branches have left a window."""
    bounds = np.array([window.lower, window.upper]).T
    reached = np.zeros(bounds.shape, dtype=bool)
    for branch in branches:
        for outcome, row in zip(branch.outcomes, (0, -1), strict=True):
            if outcome.code == LEFT:
                reached |= branch.state[row][:, None] == bounds
    return tuple((bool(low), bool(high)) for low, high in reached)
