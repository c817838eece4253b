"""Crossing of a gap, a region with a continuum of equilibria."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import Name
from fastslow.diagrams.points.normal_forms import null_vectors, solve_bordered
from fastslow.errors import ArgumentError
from fastslow.model.model import Model
from fastslow.passage.delays.delay_law import LocalLaw
from fastslow.passage.delays.interface_passages import (
    RETURNED,
    InterfaceApproach,
    approach_of,
    judged,
    passage_behind,
    settling_before,
)
from fastslow.passage.delays.local_field import LocalField, delay_fields, passage_at, require_law
from fastslow.passage.delays.local_passages import EndOfPassage
from fastslow.results.overlay.delays import Delay, GapCrossing
from fastslow.results.overlay.drifts import Drift
from fastslow.results.points import SpecialPoint

Array = NDArray[np.float64]

#: Relative size of a vanishing product of null vectors, or of one with a gradient.
ZERO_PRODUCT = 1e-9


def gap_crossing(
    point: SpecialPoint,
    rate: float | Drift,
    *,
    parameter: Name | None = None,
    model: Model | None = None,
) -> GapCrossing:
    """Delay of the gap crossing that a drifting parameter causes.

    In a region whose equilibria form a continuum at one value of the parameter
    (no stiffness between two contacts) the motion y' = J y + b μ with J q = 0,
    ψ J = 0, ψ·q = 1 drifts along q by ξ' = β μ, β = ψ·b; the other modes add the time τ.
    From contact to contact over the length ℓ, for slow drift,

        delay = √(2ℓ |rate/β|) + τ |rate|.

    For x'' + c x' = w between x = ±D with s = |rate| that is Δw = 2√(c D s) + s/c, in
    Δt = √(4 c D/s) + 1/c: the slow limit, `GapCrossing.asymptotic`. The prediction itself is
    computed from the linear motion in the gap (by integration if the rates or the drift are
    nonlinear), from the quasi-static state at the near interface; the two agree in the limit
    of slow drift.

    Parameters
    ----------
    point : SpecialPoint
        The near end of the continuum: a degenerate boundary equilibrium, code BE.
    rate : float or Drift
        Signed rate of the parameter.
    parameter : str or Symbol, optional
        The drifting parameter, by default that of the point's diagram.
    model : Model, optional
        The model of a point that was read from a file.

    Returns
    -------
    GapCrossing

    Raises
    ------
    ArgumentError
        For a point of another code or subtype, without a continuum that ends at another
        interface, or for a rate of zero or towards the contact.

    Examples
    --------
    >>> import fastslow as fs
    >>> fast = fs.systems.harmonic_gear(D=0.25).frozen()
    >>> diagram = fs.continue_equilibria(fast, "w", over=(-1, 1))
    >>> upper = [p for p in diagram.boundary_equilibria if p["x"] > 0][0]
    >>> law = gap_crossing(upper, -0.001)
    >>> round(law.asymptotic - 2 * (0.25 * 0.001) ** 0.5, 12), round(law.duration, 2)
    (0.001, 32.58)
    """
    require_law(point, LAW.name, "a gap crossing")
    if point.clarke is None or point.type != "degenerate":
        kind = point.type or "one of a Filippov field"
        raise ArgumentError(
            f"expected a degenerate boundary equilibrium of a continuous field, the end of a "
            f"continuum; received {point.label}, {kind}"
        )
    local, drift = passage_at(point, rate, parameter, model)
    way = approach_of(local, drift)
    jacobian, slope = local.slopes(way.behind)
    p, q = null_vectors(jacobian, local.unit)
    p, q = _normalised(local, p, q, way)
    drifts = float(p @ slope)
    far, length, outward = _far_side(local, way, q)
    # the inverse of J on its range gives the lag of the other modes
    lean = solve_bordered(jacobian, p, q, slope - drifts * q)
    n = local.n
    relaxation = float(outward[:n] @ lean / (outward[:n] @ q)) / drifts
    relaxation -= float(outward[n] / (outward[:n] @ q)) / drifts
    stop = EndOfPassage(interface=far)
    slowest = math.sqrt(2.0 * length / abs(drifts * drift.rate)) + abs(relaxation)
    place, reason, linear = passage_behind(local, drift, way, stop, slowest)
    delay, time, error = drift.way * float(place.z[-1]), place.time, math.nan
    if reason:
        delay = time = math.nan
        back = "the motion returns to the contact that it left"
        words = f"none: {back if reason == RETURNED else 'the far interface is not reached'}"
    else:
        linear &= local.affine(way.before)
        words, error = judged(local, drift, way, stop, delay, linear=linear)
        values = np.linalg.eigvals(jacobian)
        others = np.delete(values, np.argmin(np.abs(values))).real
        fastest = float(others.max(initial=-math.inf)) * (time - way.time)
        words += (
            f"; remaining transient relative to the slow limit {math.exp(min(fastest, 700.0)):.1g}"
        )
    return GapCrossing(
        **delay_fields(local, drift),
        delay=delay,
        validity=words,
        error=error,
        delay_time=time,
        lag=drift.way * way.mu,
        length=length,
        slope=drifts,
        relaxation=relaxation,
        interfaces=(local.field.interfaces[way.interface], local.field.interfaces[far]),
        lag_time=way.time,
    )


def _normalised(
    local: LocalField, p: Array, q: Array, way: InterfaceApproach
) -> tuple[Array, Array]:
    """Null vectors with ψ·q = 1 and q pointing into the gap."""
    across, unit = way.inward[: local.n], local.unit
    overlap, inward, length = float(p @ q), float(across @ q), np.linalg.norm(q / unit)
    if (
        abs(overlap) <= ZERO_PRODUCT * np.linalg.norm(p * unit) * length
        or abs(inward) <= ZERO_PRODUCT * np.linalg.norm(across * unit) * length
    ):
        raise ArgumentError(
            f"no continuum of equilibria with damped motion along it starts behind "
            f"{local.point.label}"
        )
    q = math.copysign(1.0, inward) * q
    return p / float(p @ q), q


def _far_side(local: LocalField, way: InterfaceApproach, q: Array) -> tuple[int, float, Array]:
    """Far interface of the continuum, its distance, and its function, positive inside."""
    field, n = local.field, local.n
    _, _, heights, gradients = field.evaluate(way.behind, local.u)
    found: list[tuple[float, int]] = []
    for j in range(len(field.interfaces)):
        along = float(gradients[j, :n] @ q)
        if j != way.interface and along != 0.0 and -heights[j] / along > 0.0:
            found.append((float(-heights[j] / along), j))
    if not found:
        raise ArgumentError(
            f"the continuum behind {local.point.label} ends at no other interface; expected a gap "
            "between two interfaces"
        )
    length, j = min(found)
    sign = field.signs[way.behind, j]
    return j, length, sign * np.append(gradients[j], heights[j])


class GapLaw(LocalLaw):
    """The crossing of the continuum that ends at a degenerate boundary equilibrium."""

    name = "boundary"

    def applies(self, point: SpecialPoint) -> bool:
        return point.type == "degenerate"

    def at_point(
        self,
        point: SpecialPoint,
        rate: float | Drift,
        *,
        level: Mapping[Any, float] | str | None,
        parameter: Name | None,
        model: Model | None,
    ) -> Delay:
        return gap_crossing(point, rate, parameter=parameter, model=model)

    def settling_distance(self, local: LocalField, delay: Delay) -> float:
        return settling_before(local, delay)


LAW = GapLaw()
