"""Lookup of points of a curve of special points by the value of a parameter."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastslow.results.branch.curve_intersections import step_slopes
from fastslow.results.branch.table import AT, BranchTable, Place

Array = NDArray[np.float64]

#: Roots outside a step by less than this fraction, due to rounding, belong to it.
ROOT_OVERSHOOT = 1e-9


def places_on_cubics(table: BranchTable, name: str, value: float) -> list[Place]:
    """Return the places at which the cubics of a curve take a value; see `PointBranch.at`."""
    column = table.column(name) - value
    extent = float(np.abs(table.column(name)).max())
    near = np.abs(column) <= AT * max(extent, abs(value))
    found = [float(row) for row in _rows(near, table.closed)]
    found += _between(table, column, name, near)
    last = max(len(table) - 2, 0)
    rows = [(min(int(place), last), place) for place in sorted(found)]
    return [Place(row, place - row, value) for row, place in rows]


def _rows(near: NDArray[np.bool_], closed: bool) -> list[int]:
    """Return the first row of every run at the value; a closed curve repeats its first row."""
    begins = np.flatnonzero(near & ~np.append(False, near[:-1]))
    rows = [int(row) for row in begins]
    if closed and len(rows) > 1 and rows[0] == 0 and near[-1]:
        rows.pop()
    return rows


def _between(table: BranchTable, column: Array, name: str, near: NDArray[np.bool_]) -> list[float]:
    """Return fractional rows at which the cubic of a step takes the value."""
    k = table.names.index(name)
    leaving, arriving = step_slopes(table)
    start, end = column[:-1], column[1:]
    first, last = leaving[:, k], arriving[:, k]
    # a cubic is contained in the convex hull of its Bézier points
    hull = np.stack([start, start + first / 3.0, end - last / 3.0, end])
    found: list[float] = []
    inside = (hull.min(axis=0) <= 0) & (hull.max(axis=0) >= 0) & ~near[:-1] & ~near[1:]
    for row in np.flatnonzero(inside):
        chord = end[row] - start[row]
        cubic = [
            first[row] + last[row] - 2 * chord,
            3 * chord - 2 * first[row] - last[row],
            first[row],
            start[row],
        ]
        roots = np.roots(cubic)
        real = roots.real[np.abs(roots.imag) < 1e-9]
        found += [row + float(r) for r in real if -ROOT_OVERSHOOT <= r < 1.0 + ROOT_OVERSHOOT]
    return found
