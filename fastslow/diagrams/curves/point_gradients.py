"""Derivatives of equilibria and of their special points with respect to a parameter."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import Name
from fastslow.continuation import curves
from fastslow.continuation.settings import Continuation
from fastslow.diagrams.curves.point_curves import Plane, first_row
from fastslow.diagrams.field import FrozenField
from fastslow.diagrams.points.defining import DefiningSystem, row_sizes
from fastslow.diagrams.points.kinds import curve_kind
from fastslow.errors import ArgumentError, unknown_name
from fastslow.model.model import Model
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.results.point_types import POINT_TYPES
from fastslow.results.points import Equilibrium, SpecialPoint
from fastslow.symbolic.folded_points import FoldedFlow

Array = NDArray[np.float64]

#: Reciprocal condition of the balanced Jacobian below which an equilibrium has no derivative.
SINGULAR_CONDITION = 1e-12

#: Share of the parameter's change in a tangent below which a special point has no derivative.
TURNING = 1e-9


def gradient_of(point: Equilibrium | SpecialPoint, name: Name) -> NamedMapping[float]:
    """Compute the derivatives of a point; see `Equilibrium.gradient`, `SpecialPoint.gradient`."""
    key = str(name)
    if isinstance(point, Equilibrium):
        return _along_branch(_model_of(point, key), point, key)
    path = path_of(point, key)
    found = path.along[: path.system.n + 1].tolist()
    return NamedMapping(
        "state or parameter", dict(zip((*point.states, path.own), found, strict=True))
    )


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
    if 1.0 / np.linalg.cond(matrix / size[:, None]) < SINGULAR_CONDITION:
        raise ArgumentError(
            f"the equilibrium has no derivative by {name}: its Jacobian is singular, as at a fold"
        )
    found = -unit * np.linalg.solve(matrix / size[:, None], slopes[:, -1] / size)
    return NamedMapping("state", dict(zip(point.states, found.tolist(), strict=True)))


@dataclass(frozen=True, eq=False)
class PointPath:
    """Curve of a special point in the plane of its diagram's parameter and another one.

    Parameters
    ----------
    point : SpecialPoint
    own, name : str
        The parameter of the diagram, and the other one.
    system : DefiningSystem
    z : ndarray
        The unknowns at the point.
    frame : Frame
    along : ndarray
        Derivatives of the unknowns by the other parameter.
    """

    point: SpecialPoint
    own: str
    name: str
    system: DefiningSystem
    z: Array
    frame: curves.Frame
    along: Array

    def at(self, value: float) -> SpecialPoint | None:
        """The point at a value of the other parameter; None if Newton's method fails."""
        entry, n = self.system.width - 1, self.system.n
        direction = np.zeros(len(self.z))
        direction[entry] = 1.0
        guess = self.z + (value - self.z[entry]) * self.along
        found = curves.corrected(self.system, guess, direction, self.frame, Continuation())
        if found is None:
            return None
        z, _ = found
        values = {**self.point.parameters, self.own: float(z[n]), self.name: value}
        return replace(self.point, state=z[:n].copy(), parameters=NamedMapping("parameter", values))


def path_of(point: SpecialPoint, name: str, own: str = "") -> PointPath:
    """Return the curve of a special point over another parameter.

    Parameters
    ----------
    point : SpecialPoint
    name : str
    own : str
        The parameter that determines the point, by default that of its diagram.

    Raises
    ------
    ArgumentError
        For a point without such a curve, or where the curve turns.
    UnknownNameError
        For a name that is no parameter.
    """
    model = _model_of(point, name)
    if not point.curves or len(point.tangent) != len(point.states) + 1:
        codes = [c for c, kind in POINT_TYPES.items() if kind.curves[:1] == (c,)]
        known = ", ".join(c for c in codes if not POINT_TYPES[c].orbits)
        raise ArgumentError(
            f"{point.label} ({point.words}) has no derivative by one parameter; expected a point "
            f"of a diagram with a code among {known}"
        )
    of_diagram = next(p for p in model.free if p not in model.parameters)
    own = own or of_diagram
    if name == own:
        what = "the parameter of the diagram, which is determined"
        raise ArgumentError(
            f"{name} is {what if own == of_diagram else 'the parameter that drifts'}"
        )
    values = np.array([point.parameters[own], point.parameters[name]])
    reach = np.maximum(np.abs(values), 1.0)
    lower, upper = values - reach, values + reach
    plane = Plane((own, name), lower, upper, Continuation(), True, None, ())
    system, z, frame, _ = first_row(point, plane, curve_kind(point.curves[0]))
    along = curves.tangent(system, z, frame)
    n, scaled = system.n, along / frame.scale
    if system.lost(along, frame.scale):
        raise ArgumentError(f"{point.label} is isolated: it does not persist when {name} changes")
    if abs(scaled[n + 1]) < TURNING:
        raise ArgumentError(
            f"{point.label} has no derivative by {name}: the curve of these points turns there"
        )
    return PointPath(point, own, name, system, z, frame, along / along[n + 1])


def _model_of(point: Equilibrium | SpecialPoint, name: str) -> Model:
    """The model of a point, if it has a parameter of that name."""
    if point.source is None:
        raise ArgumentError(
            "this point has no model (it was read from a file or another process); compute it "
            "again and use its point"
        )
    if isinstance(point.source, FoldedFlow):
        raise ArgumentError(
            "this is a point of the slow flow, which has no gradient; trace its curve by "
            "continue_points"
        )
    model: Model = point.source if isinstance(point, Equilibrium) else point.source.model
    if name not in (*model.parameters, *model.free):
        raise unknown_name("parameter", name, (*model.parameters, *model.free))
    return model
