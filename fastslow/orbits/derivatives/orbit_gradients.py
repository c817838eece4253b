"""Derivatives of periodic orbits and of their special points with respect to a parameter."""

from __future__ import annotations

import numpy as np

from fastslow.arguments import Name
from fastslow.continuation import curves
from fastslow.continuation.settings import Continuation
from fastslow.diagrams.curves.point_curves import Plane
from fastslow.diagrams.curves.point_gradients import SINGULAR_CONDITION, TURNING
from fastslow.errors import ArgumentError, unknown_name
from fastslow.model.model import Model
from fastslow.orbits.derivatives.run_sensitivities import require_no_forcing
from fastslow.orbits.points.point_equations import equations_of
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.results.orbits.orbit import Orbit
from fastslow.results.orbits.special_orbit import SpecialOrbit
from fastslow.results.point_types import POINT_TYPES


def gradient_of_orbit(orbit: Orbit, name: Name) -> NamedMapping[float]:
    """Compute the derivatives of an orbit; see `Orbit.gradient`.

    Let M and b be the derivatives of one period with respect to the initial state and the
    parameter. The derivative s of the initial state of a closed orbit satisfies
    (I − M) s − f T' = b. With forcing T' is known; without it s is normal to the flow.
    """
    key, run = str(name), orbit.trajectory
    if not orbit.outcome:
        raise ArgumentError(f"this orbit was not found, and has no derivatives: {orbit.outcome}")
    if isinstance(run.symbolic_model, Model):
        require_no_forcing(run.symbolic_model, key)
    if key not in run.parameters:
        raise unknown_name("parameter", key, run.parameters)
    found, n = run.sensitivity([*run.states, key]), len(run.states)
    if not found.outcome:
        raise ArgumentError(f"the orbit has no derivative by {key}: {found.outcome}")
    monodromy, forced = found.final[:, :n], found.final[:, n]
    rate = found.final_rate
    matrix, right = np.eye(n + 1), np.zeros(n + 1)
    matrix[:n, :n] -= monodromy
    matrix[:n, n], right[:n] = -rate, forced
    if orbit.multiple is None:
        matrix[n, :n], matrix[n, n] = rate / np.linalg.norm(rate), 0.0
    else:
        right[n] = orbit.multiple * found.period[n]
    size = np.append(np.ptp(run.sampled_columns[:n], axis=1), orbit.period)
    size[size == 0] = 1.0
    scaled = matrix * size / size[:, None]
    rows = np.linalg.norm(scaled, axis=1)
    if 1.0 / np.linalg.cond(scaled / rows[:, None]) < SINGULAR_CONDITION:
        raise ArgumentError(
            f"the orbit has no derivative by {key}: it is not isolated, or at a fold of orbits"
        )
    solved = size * np.linalg.solve(scaled / rows[:, None], right / size / rows)
    values = {**dict(zip(run.states, solved[:n].tolist(), strict=True)), "period": float(solved[n])}
    for state, extremes in found.extremes.items():
        for kind, by in zip(("min", "max"), extremes, strict=True):
            values[f"{kind}({state})"] = float(by[:n] @ solved[:n] + by[n])
    return NamedMapping("state, period or extreme", values)


def gradient_of_point(point: SpecialOrbit, name: Name) -> NamedMapping[float]:
    """Compute the derivatives of a special point of orbits; see `SpecialOrbit.gradient`."""
    key, own = str(name), point.parameter
    if point.source is None:
        raise ArgumentError(
            "this point has no model (it was read from a file or another process); trace its "
            "branch again and use its point"
        )
    if key not in point.parameters:
        raise unknown_name("parameter", key, point.parameters)
    if key == own:
        raise ArgumentError(f"{key} is the parameter of the branch, which is determined")
    if not POINT_TYPES[point.code].curves:
        known = [c for c, kind in POINT_TYPES.items() if kind.curves[:1] == (c,) and kind.orbits]
        raise ArgumentError(
            f"{point.label} ({point.words}) has no derivative by one parameter; expected a point "
            f"with a code among {', '.join(known)}"
        )
    values = np.array([point.parameters[own], point.parameters[key]])
    reach = np.maximum(np.abs(values), 1.0)
    plane = Plane((own, key), values - reach, values + reach, Continuation(), True, None, ())
    start, _ = point.source.start(point, plane)
    equations, z = equations_of(start, plane)
    landing = curves.landed(equations.system, z, equations.frame)
    if landing is None:
        raise ArgumentError(f"Newton's method did not converge from {point.label}")
    along = curves.tangent(equations.system, landing, equations.frame)
    place = start.shooting.size
    if abs(along[place + 1] / equations.frame.scale[place + 1]) < TURNING:
        raise ArgumentError(
            f"{point.label} has no derivative by {key}: the curve of these points turns there"
        )
    by = along / along[place + 1]
    found = {own: float(by[place]), "period": float(by[place - 1])}
    return NamedMapping("parameter or period", found)
