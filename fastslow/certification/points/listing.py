"""Proved special points and those of a diagram: what it lacks is located and added."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation.location import Located, fold, hopf_or_neutral_saddle
from fastslow.diagrams.field import FrozenField
from fastslow.diagrams.points.normal_forms import fold_form, forms_at, lyapunov_at
from fastslow.diagrams.segments import BranchSegment
from fastslow.diagrams.trace.assembly import (
    EquilibriumCurve,
    boundary_equilibrium,
    special_point,
)
from fastslow.model.model import Model
from fastslow.results.angles import apart, periods_of
from fastslow.results.branch.branch import Branch
from fastslow.results.branch.diagram import Diagram
from fastslow.results.point_types import kind_of
from fastslow.results.points import SpecialPoint, SpecialPoints

Array = NDArray[np.float64]

#: Distance of a point from the boxes in which it is proved, in units of the window, up to which it
#: is in them, and distance from a row up to which it is this row.
IN_BOXES, ON_ROW = 1e-7, 1e-9

#: Distance from these boxes, in units of the window, up to which a point of the diagram that is no
#: other proved point is an inaccurate one.
DISPLACED = 1e-3

#: Distance of a point of a diagram from the proved one, in units of the window, from which on it is
#: named.
INACCURATE = 1e-5


@dataclass(frozen=True, eq=False)
class ProvedPoint:
    """A special point that is proved to be on a curve, the only one of its kind in some boxes.

    Parameters
    ----------
    code : str
        LP, HB or BE.
    region : str
    interface : str
        The interface of a boundary equilibrium.
    low, high : ndarray, shape (n + 1,)
        Bounds of states and parameter.
    near_low, near_high : ndarray, shape (k, n + 1)
        The boxes.
    """

    code: str
    region: str
    interface: str
    low: Array
    high: Array
    near_low: Array
    near_high: Array

    @property
    def middle(self) -> Array:
        return 0.5 * self.low + 0.5 * self.high

    def distance(self, point: SpecialPoint, name: str, unit: Array, periods: Array) -> float:
        """Distance of a point of a diagram from the boxes, infinite if it is of another kind."""
        if point.code != self.code or not point.admissible:
            return np.inf
        regions = [region.partition(" (")[0] for region in point.regions]
        if point.interface != self.interface if self.interface else regions[0] != self.region:
            return np.inf
        u = np.append(point.state, point.parameters[name])
        return _distance(u, self.near_low, self.near_high, unit, periods)

    def error(self, point: SpecialPoint, name: str, unit: Array, periods: Array) -> float:
        """Distance of a point of a diagram from the bounds."""
        u = np.append(point.state, point.parameters[name])
        return _distance(u, self.low[None], self.high[None], unit, periods)


def _distance(u: Array, low: Array, high: Array, unit: Array, periods: Array) -> float:
    """Distance of a point from the nearest of some boxes, shapes (k, n + 1)."""
    away = np.abs(apart(0.5 * low + 0.5 * high, u, periods))
    return max(0.0, float(((away - 0.5 * (high - low)) / unit).max(axis=1).min()))


def listed(
    model: Model, diagram: Diagram, proved: Sequence[ProvedPoint], unit: Array
) -> tuple[Diagram, list[str | None], list[str]]:
    """Return a diagram with all proved points, their labels in it, and those that it lacked.

    The label is None where no branch passes through a point.
    """
    periods = np.append(periods_of(diagram.states, dict(model.periodic)), 0.0)
    labels: list[str | None] = [None] * len(proved)

    def known(one: ProvedPoint, reach: float) -> str | None:
        # a boundary equilibrium is on a curve of either region, other points on one
        free = [
            p
            for p in diagram.special
            if p.label not in labels or (p.kind.two_rows and reach == IN_BOXES)
        ]
        near = {p.label: one.distance(p, diagram.parameter, unit, periods) for p in free}
        label = min(near, key=lambda name: near[name], default=None)
        return label if label is not None and near[label] <= reach else None

    # those at some distance are points of the diagram that no nearer one is
    for reach in (IN_BOXES, DISPLACED):
        for k, one in enumerate(proved):
            labels[k] = labels[k] or known(one, reach)
    lacked: list[str] = []
    for k, one in enumerate(proved):
        # the boundary equilibrium added on the curve of the other region
        labels[k] = labels[k] or known(one, IN_BOXES)
        added = None if labels[k] else _added(model, diagram, one, unit, periods)
        if added is not None:
            diagram, labels[k] = added
            lacked.append(added[1])
    return diagram, labels, lacked


def repeated(
    model: Model,
    diagram: Diagram,
    proved: Sequence[ProvedPoint],
    labels: Sequence[str | None],
    unit: Array,
) -> set[str]:
    """Return the labels of further points of a diagram in the boxes of proved points.

    They are the same points, on branches that run along the same curve.
    """
    periods = np.append(periods_of(diagram.states, dict(model.periodic)), 0.0)
    return {
        point.label
        for point in diagram.special
        if point.label not in labels
        and any(one.distance(point, diagram.parameter, unit, periods) <= IN_BOXES for one in proved)
    }


def inaccurate(
    model: Model,
    diagram: Diagram,
    proved: Sequence[ProvedPoint],
    labels: Sequence[str | None],
    unit: Array,
) -> list[str]:
    """Name the points of a diagram that are at some distance from the proved ones."""
    periods = np.append(periods_of(diagram.states, dict(model.periodic)), 0.0)
    known = {point.label: point for point in diagram.special}
    errors = {
        label: one.error(known[label], diagram.parameter, unit, periods)
        for one, label in zip(proved, labels, strict=True)
        if label is not None
    }
    return [
        f"{label} is not accurate: the proved point is {error:.1g} of the window from it"
        for label, error in errors.items()
        if error > INACCURATE
    ]


def _added(
    model: Model, diagram: Diagram, one: ProvedPoint, unit: Array, periods: Array
) -> tuple[Diagram, str] | None:
    """Add a point to the branch through it; also its label. None without such a branch."""
    places = [
        (*_place(branch, one, unit, periods), number)
        for number, branch in enumerate(diagram.branches)
        if branch.admissible
    ]
    away, row, number = min(places, default=(np.inf, 0, 0))
    if not away <= 0.5:
        return None
    branch = diagram.branches[number]
    numbers = [p.label.removeprefix(one.code) for p in diagram.special(one.code)]
    label = f"{one.code}{1 + max((int(n) for n in numbers if n.isdigit()), default=0)}"
    field = FrozenField(model.with_free(diagram.parameter), diagram.parameter)
    source = next((p.source for p in branch.special if p.source is not None), None)
    point = replace(_located(field, branch, row, one, unit), label=label, source=source)
    branches = list(diagram.branches)
    branches[number] = _with_point(branch, row, point, unit, periods)
    return replace(diagram, branches=tuple(branches)), label


def _place(branch: Branch, one: ProvedPoint, unit: Array, periods: Array) -> tuple[float, int]:
    """Return the excess of the path over a point, relative to the step, and the row before it.

    A point between two rows is as far from both together as they are from each other.
    """
    rows = np.column_stack([branch.state, branch.values])
    away = np.linalg.norm(apart(rows, one.middle, periods) / unit, axis=1)
    steps = np.linalg.norm(np.diff(rows, axis=0) / unit, axis=1)
    names = np.char.partition(branch.region.astype(str), " (")[:, 0]
    own = names == one.region
    inside = own[:-1] & own[1:]
    if kind_of(one.code).two_rows:
        # the two rows on the interface, or an end there
        changes = own[:-1] != own[1:]
        inside = changes if changes.any() else inside
    if not inside.any():
        return np.inf, 0
    excess = np.where(inside, (away[:-1] + away[1:] - steps) / (steps + IN_BOXES), np.inf)
    row = int(np.argmin(excess))
    return float(excess[row]), row


def _located(
    field: FrozenField, branch: Branch, row: int, one: ProvedPoint, unit: Array
) -> SpecialPoint:
    """Compute a point from the middle of its bounds."""
    region, n = field.regions.index(one.region), field.n

    def curve(u: Array) -> tuple[Array, Array]:
        return field.residual_and_jacobian(region, u)

    before = branch.tangent[row]
    if kind_of(one.code).two_rows:
        names = branch.region[[row, row + 1]].tolist()
        if names[0] == names[1]:
            # the branch ends there
            return special_point(
                field, one.code, region, one.middle, before, interface=one.interface
            )
        tangents = branch.tangent[[row, row + 1]]
        sides = tuple(
            BranchSegment(field.regions.index(name), one.middle[None], tangent[None])
            for name, tangent in zip(names, tangents, strict=True)
        )
        interface = field.interfaces.index(one.interface)
        joined = EquilibriumCurve(sides, (interface,), branch.outcomes, (None, None), False)
        return boundary_equilibrium(field, joined, 0)
    more: dict[str, object] = {}
    if kind_of(one.code).turning:
        found = _near(fold(curve, one.middle, unit), one, unit)
        matrix = curve(found.u)[1][:, :n]
        more["coefficient"] = fold_form(forms_at(field, region, found.u), matrix, unit[:-1])
    else:
        values = field.finite_eigenvalues(region, one.middle)
        squared = float(np.abs(values[np.argmin(np.abs(values.real))]) ** 2)
        found = _near(hopf_or_neutral_saddle(curve, one.middle, unit, squared), one, unit)
        frequency = float(np.sqrt(found.extra[0])) if found.extra.size else squared**0.5
        more["frequency"] = frequency
        more["lyapunov"] = lyapunov_at(field, region, found.u, frequency)
    tangent, single = field.tangent(region, found.u, unit**-2.0)
    if not single:
        tangent = before
    else:
        # of the length of the one before, in units of the window
        length = np.linalg.norm(before / unit) / np.linalg.norm(tangent / unit)
        tangent = tangent * np.copysign(length, (tangent / unit**2) @ before)
    return special_point(
        field, one.code, region, found.u, tangent, converged=found.converged,
        accuracy=found.correction, **more,
    )  # fmt: skip


def _near(found: Located, one: ProvedPoint, unit: Array) -> Located:
    """Return a located point, or the middle of the bounds if it is another one."""
    close = np.all(np.abs(found.u - one.middle) <= 0.5 * (one.high - one.low) + IN_BOXES * unit)
    return found if close else Located(one.middle, np.nan, False, np.empty(0), np.nan)


def _with_point(
    branch: Branch, row: int, point: SpecialPoint, unit: Array, periods: Array
) -> Branch:
    """Insert a point after a row, as a row of its own unless one of the two next to it is it."""
    u = np.append(point.state, point.parameters[branch.parameter])
    rows = np.column_stack([branch.state, branch.values])[row : row + 2]
    # in the turn of the rows
    u = rows[0] + apart(u, rows[0], periods)
    near = np.abs((rows - u) / unit).max(axis=1) <= ON_ROW
    before = np.array(branch.special_rows, dtype=int)
    if point.kind.two_rows or near.any():
        # of two rows, one in each region, the first
        first = branch.region[row] != branch.region[row + 1] or near[0]
        at = row if first else row + 1
        changed = branch
    else:
        at = row + 1
        before = before + (before >= at)

        def grown(column: Any, value: Any) -> Any:
            return np.insert(column, at, value, axis=0)

        known = branch.known_stability
        changed = replace(
            branch,
            state=grown(branch.state, u[:-1]),
            values=grown(branch.values, u[-1]),
            tangent=grown(branch.tangent, point.tangent),
            eigenvalues=grown(branch.eigenvalues, point.eigenvalues),
            region=grown(branch.region, point.regions[0]),
            known_stability=None if known is None else grown(known, known[row]),
        )
    place = int(np.searchsorted(before, at, side="right"))
    special = [*branch.special]
    special.insert(place, point)
    return replace(
        changed,
        special=SpecialPoints(special),
        special_rows=tuple(np.insert(before, place, at).tolist()),
    )
