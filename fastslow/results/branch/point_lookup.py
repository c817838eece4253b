"""Lookup of points of a curve of special points by the value of a parameter."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fastslow.results.branch.curve_intersections import step_slopes
from fastslow.results.point_types import FOLD, HOPF
from fastslow.results.points import SpecialPoint, SpecialPoints

if TYPE_CHECKING:
    from fastslow.results.branch.point_branch import PointBranch

Array = NDArray[np.float64]

#: Relative distance below which a row is at a value of the parameter.
AT = 1e-12

#: Roots outside a step by less than this fraction, due to rounding, belong to it.
BEYOND = 1e-9


def points_at(curve: PointBranch, name: str, value: float) -> SpecialPoints:
    """Return the points of a curve at one value of a parameter; see `PointBranch.at`."""
    column = curve.values[:, curve.parameter_names.index(name)] - value
    extent = float(np.abs(curve.values[:, curve.parameter_names.index(name)]).max())
    near = np.abs(column) <= AT * max(extent, abs(value))
    places = [float(row) for row in _rows(near, curve.closed)]
    places += _between(curve, column, name, near)
    found = []
    for place in sorted(places):
        row = min(int(place), max(len(curve) - 2, 0))
        part = place - row
        solved = None if curve.corrector is None else curve.corrector(row, part, name, value)
        found.append(solved or _read_off(curve, row, part))
    return SpecialPoints(found)


def _rows(near: NDArray[np.bool_], closed: bool) -> list[int]:
    """Return the first row of every run at the value; a closed curve repeats its first row."""
    begins = np.flatnonzero(near & ~np.append(False, near[:-1]))
    rows = [int(row) for row in begins]
    if closed and len(rows) > 1 and rows[0] == 0 and near[-1]:
        rows.pop()
    return rows


def _between(curve: PointBranch, column: Array, name: str, near: NDArray[np.bool_]) -> list[float]:
    """Return fractional rows at which the cubic of a step takes the value."""
    k = len(curve.states) + curve.parameter_names.index(name)
    leaving, arriving = step_slopes(curve)
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
        found += [row + float(r) for r in real if -BEYOND <= r < 1.0 + BEYOND]
    return found


def _read_off(curve: PointBranch, row: int, part: float) -> SpecialPoint:
    """Return a point interpolated by the cubic of a step, marked as such in its note."""
    points, n = curve.points, len(curve.states)
    other = min(row + 1, len(curve) - 1)
    nearest = row if part < 0.5 else other
    at = points[row]
    if part > 0:
        leaving, arriving = (table[row] for table in step_slopes(curve))
        chord = points[other] - points[row]
        bend, twist = 3 * chord - 2 * leaving - arriving, leaving + arriving - 2 * chord
        at = points[row] + part * (leaving + part * (bend + part * twist))
    weights = np.array([1.0 - part, part])
    pair = curve.eigenvalues[[row, other]]
    code = str(curve.codes[nearest])
    coefficient = float(weights @ curve.coefficient[[row, other]])
    known = None if np.isnan(coefficient) else coefficient
    return SpecialPoint(
        code=code,
        label=code,
        states=curve.states,
        state=at[:n].copy(),
        parameters={
            **curve.parameters,
            **dict(zip(curve.parameter_names, map(float, at[n:]), strict=True)),
        },
        regions=(curve.region,),
        eigenvalues=weights @ pair.real + 1j * (weights @ pair.imag),
        tangent=curve.tangent[nearest].copy(),
        residual=0.0 if part == 0 else float("nan"),
        converged=part == 0,
        coefficient=known if code == FOLD else None,
        lyapunov=known if code == HOPF else None,
        admissible=bool(curve.admissible[nearest]),
        note="" if part == 0 else "interpolated between rows of the curve",
    )
