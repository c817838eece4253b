"""Derivatives of equilibria and of their special points by a parameter."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import Name
from fastslow.continuation import curves
from fastslow.continuation.settings import Continuation
from fastslow.diagrams.curves.point_curves import ISOLATED, Plane, first_row
from fastslow.diagrams.field import FrozenField
from fastslow.diagrams.points.defining import Crossing, row_sizes
from fastslow.errors import ArgumentError, unknown_name
from fastslow.model.model import Model
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.results.point_types import POINT_TYPES
from fastslow.results.points import Equilibrium, SpecialPoint

Array = NDArray[np.float64]

#: Reciprocal condition of the balanced Jacobian below which an equilibrium has no derivative.
SINGULAR = 1e-12

#: Share of the parameter's change in a tangent below which a special point has no derivative.
TURNING = 1e-9


def gradient_of(point: Equilibrium | SpecialPoint, name: Name) -> NamedMapping[float]:
    """Compute the derivatives of a point; see `Equilibrium.gradient`, `SpecialPoint.gradient`."""
    if point.source is None:
        raise ArgumentError(
            "this point has no model (it was read from a file or another process); compute it "
            "again and use its point"
        )
    key = str(name)
    model: Model = point.source if isinstance(point, Equilibrium) else point.source.model
    if key not in (*model.parameters, *model.free):
        raise unknown_name("parameter", key, (*model.parameters, *model.free))
    if isinstance(point, Equilibrium):
        return _along_branch(model, point, key)
    return _along_curve(model, point, key)


def _along_branch(model: Model, point: Equilibrium, name: str) -> NamedMapping[float]:
    """du/dp = −F_u⁻¹ F_p."""
    if point.continuum:
        raise ArgumentError("a point of a continuum of equilibria has no derivative: not isolated")
    field = FrozenField(model.with_parameters(dict(point.parameters)).with_free(name), name)
    region = field.regions.index(point.region)
    u = np.append(point.state, point.parameters[name])
    _, slopes = field.residual_and_jacobian(region, u)
    unit = np.maximum(np.abs(point.state), field.units_at(abs(u[-1]))[: field.n])
    matrix = slopes[:, :-1] * unit
    size = row_sizes(matrix)
    if 1.0 / np.linalg.cond(matrix / size[:, None]) < SINGULAR:
        raise ArgumentError(
            f"the equilibrium has no derivative by {name}: its Jacobian is singular, as at a fold"
        )
    found = -unit * np.linalg.solve(matrix / size[:, None], slopes[:, -1] / size)
    return NamedMapping("state", dict(zip(point.states, found.tolist(), strict=True)))


def _along_curve(model: Model, point: SpecialPoint, name: str) -> NamedMapping[float]:
    """Tangent of the curve of such points in the plane of the diagram's parameter and another."""
    if not POINT_TYPES[point.code].curves or len(point.tangent) != len(point.states) + 1:
        codes = [c for c, kind in POINT_TYPES.items() if kind.curves[:1] == (c,)]
        known = ", ".join(c for c in codes if not POINT_TYPES[c].orbits)
        raise ArgumentError(
            f"{point.label} ({point.words}) has no derivative by one parameter; expected a point "
            f"of a diagram with a code among {known}"
        )
    (own,) = (p for p in model.free if p not in model.parameters)
    if name == own:
        raise ArgumentError(f"{name} is the parameter of the diagram, which is determined")
    values = np.array([point.parameters[own], point.parameters[name]])
    reach = np.maximum(np.abs(values), 1.0)
    lower, upper = values - reach, values + reach
    plane = Plane((own, name), lower, upper, Continuation(), True, None, [])
    system, z, frame, _ = first_row(point, plane, POINT_TYPES[point.code].curves[0])
    along = curves.tangent(system, z, frame)
    n, scaled = system.n, along / frame.scale
    if isinstance(system, Crossing) and abs(scaled[-1]) > ISOLATED:
        raise ArgumentError(f"{point.label} is isolated: it does not persist when {name} changes")
    if abs(scaled[n + 1]) < TURNING:
        raise ArgumentError(
            f"{point.label} has no derivative by {name}: the curve of these points turns there"
        )
    found = along[: n + 1] / along[n + 1]
    keys = (*point.states, own)
    return NamedMapping("state or parameter", dict(zip(keys, found.tolist(), strict=True)))
