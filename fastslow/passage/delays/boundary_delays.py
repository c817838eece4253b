"""Lag at persistence, delay of a non-smooth fold, and gap crossing."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import Name
from fastslow.diagrams.points.normal_forms import null_vectors, solve_bordered
from fastslow.errors import ArgumentError
from fastslow.model.model import Model
from fastslow.passage.delays.linear_flow import LinearFlow
from fastslow.passage.delays.local_field import (
    TURN,
    LocalField,
    delay_fields,
    level_of,
    named_level,
    passage_at,
    require_code,
    wrong_way,
)
from fastslow.passage.delays.local_passages import (
    REGIONS,
    Event,
    Place,
    bound_of,
    follow,
    quasi_static,
    reached_delay,
    rounding,
)
from fastslow.results.overlay.delays import BoundaryDelay, GapCrossing
from fastslow.results.overlay.drifts import Drift
from fastslow.results.point_types import BOUNDARY_EQUILIBRIUM, NON_SMOOTH_FOLD
from fastslow.results.points import SpecialPoint

Array = NDArray[np.float64]

#: Relative size of a vanishing product of null vectors, or of one with a gradient.
ZERO = 1e-9

#: Relative error of a closed-form passage after root finding.
EXACT = 1e-9

#: Reasons for which a passage behind an interface does not end.
NOT_REACHED = "the motion behind the interface does not reach the level"
RETURNED = "the motion returns across the interface before it reaches the level"

#: Relaxation times before the point at which the integrated passage may start, tried in order.
FORGOTTEN = (36.0, 24.0, 12.0, 6.0)


@dataclass(frozen=True, eq=False)
class Approach:
    """Quasi-static motion up to an interface.

    Parameters
    ----------
    before, behind : int
        Regions.
    interface : int
    inward : ndarray, shape (n + 3,)
        Row whose product with z = (y, μ, t, 1) is positive behind the interface.
    stable : float
        Largest real part of the eigenvalues before the interface.
    first : ndarray, shape (n,)
        dX/dμ of its slow manifold.
    z : ndarray, shape (n + 3,)
        Crossing of the quasi-static motion, with t = 0 at the passage of the point.
    """

    before: int
    behind: int
    interface: int
    inward: Array
    stable: float
    first: Array
    z: Array

    @property
    def mu(self) -> float:
        return float(self.z[-3])

    @property
    def time(self) -> float:
        return float(self.z[-2])


def boundary_delay(
    point: SpecialPoint,
    rate: float | Drift,
    *,
    level: Mapping[Any, float] | str | None = None,
    parameter: Name | None = None,
    model: Model | None = None,
) -> BoundaryDelay:
    """Lag or delay of a slow passage through a boundary equilibrium.

    Before the interface the rates are linearised, y' = J₁ y + b₁ μ with μ' linear as well: the
    motion on the slow manifold, y = −J₁⁻¹ b₁ μ − J₁⁻² b₁ rate at a constant drift, crosses
    with a lag of the order of the rate, which is the result for persistence. At a non-smooth
    fold the motion behind the interface, y' = J₂ y + b₂ μ + …, grows along the unstable
    direction of J₂ until the level is reached, at

        delay = (rate/λ₂) ln(1/rate) + O(rate)

    with a term of order rate that depends on the level; this is not a power of the rate. The
    passage is solved in closed form, region by region, if the rates and the drift are linear,
    and integrated from the crossing otherwise. For x' = p + |x|, p = εt, it gives
    p = ε (1 + ln((x + p + ε)/(2ε))).

    Parameters
    ----------
    point : SpecialPoint
        A boundary equilibrium of a continuous field, code BE, of subtype
        ``"persistence"`` or ``"non-smooth fold"``.
    rate : float or Drift
        Signed rate of the parameter.
    level : mapping or "turn"
        One state and its value, e.g. ``{"x": 1.0}``, or the extremum of the parameter;
        required at a non-smooth fold.
    parameter : str or Symbol, optional
        The drifting parameter, by default that of the point's diagram.
    model : Model, optional
        The model of a point that was read from a file.

    Returns
    -------
    BoundaryDelay
        Exact if the rates and the drift are linear. ``delay`` is the lag
        for persistence, and nan if the level is never reached.

    Raises
    ------
    ArgumentError
        For a point of another code or subtype, a rate of zero or towards the
        stable branch, or a missing level.

    Examples
    --------
    >>> import sympy as sp, fastslow as fs
    >>> x, p = sp.symbols("x p")
    >>> corner = fs.Model({x: p + sp.Abs(x)}, parameters={p: -1})
    >>> diagram = fs.continue_equilibria(corner, "p", over=(-1, 1))
    >>> law = boundary_delay(diagram.boundary_equilibria[0], 0.01, level={"x": 1})
    >>> round(law.delay, 10)
    0.0497000894
    """
    require_code(point, BOUNDARY_EQUILIBRIUM, "the delay at a boundary equilibrium")
    if point.clarke is None or point.type not in ("persistence", NON_SMOOTH_FOLD):
        kind = "a degenerate one" if point.type == "degenerate" else "one of a Filippov field"
        if point.at_switch:
            kind = "one at the threshold of a switch, where its branch ends"
        elif point.at_wall:
            kind = "one at a wall, which a state leaves as soon as the contact force vanishes"
        hint = "; see gap_crossing" if point.type == "degenerate" else ""
        raise ArgumentError(
            f"expected a boundary equilibrium of a continuous field with persistence or a "
            f"non-smooth fold, received {point.label}, {kind}{hint}"
        )
    local, drift = passage_at(point, rate, parameter, model)
    height = level_of(local, level, drift)
    way = approach_of(local, drift)
    jacobian, _ = local.slopes(way.behind)
    unstable = float(np.linalg.eigvals(jacobian).real.max())
    stop = Event(interface=way.interface)
    sense, delay, time, words, error = drift.way, drift.way * way.mu, way.time, "", math.nan
    if point.type == "persistence":
        words, error = _judged(local, drift, way, stop, delay, linear=local.affine(way.before))
        words = f"no delay but a lag, {words}"
        if unstable >= 0:
            words += "; the branch behind the interface is not stable"
    elif height is None:
        raise ArgumentError(
            "the delay of a non-smooth fold depends on the level that ends it; "
            "give level={state: value}"
        )
    else:
        stop = Event(height)
        place, reason, linear = _behind(local, drift, way, stop, 40.0 / max(unstable, -way.stable))
        delay, time = sense * float(place.z[-1]), place.time
        if reason:
            delay = time = math.nan
            words = f"none: {reason}"
        else:
            linear &= local.affine(way.before)
            words, error = _judged(local, drift, way, stop, delay, linear=linear)
    return BoundaryDelay(
        **delay_fields(local, drift),
        delay=delay,
        validity=words,
        error=error,
        delay_time=time,
        lag=sense * way.mu,
        stable=way.stable,
        unstable=unstable,
        level=named_level(local, height),
    )


def _judged(
    local: LocalField, drift: Drift, way: Approach, stop: Event, delay: float, *, linear: bool
) -> tuple[str, float]:
    """Validity and error of a passage."""
    if linear and not drift.law:
        if not drift.complete:
            return "exact for a drift of this form, whose other terms are not known", math.nan
        return "exact: the rates and the drift are linear", EXACT * abs(delay) + rounding(local)
    words = "from the rates linearised before the interface"
    words += "" if stop.level is None else ", integrated behind it"
    passed = math.nan
    for count in FORGOTTEN:
        mu = -count * drift.rate / -way.stable
        start = quasi_static(local, drift, way.before, mu, way.first * mu)
        if start is not None:
            span = 4.0 * (count / -way.stable + abs(delay / drift.rate))
            place = Place(way.before, start, 0.0)
            passed, _ = reached_delay(local, drift, place, stop, span)
        if math.isfinite(passed):
            break
    error, more = bound_of(local, delay, passed, drift)
    return words + more, error


def _behind(
    local: LocalField, drift: Drift, way: Approach, stop: Event, slowest: float
) -> tuple[Place, str, bool]:
    """End of the passage behind an interface, reason of failure, and whether it is linear."""
    span = 40.0 * slowest
    if local.affine(way.behind) and not drift.law:
        place, reason, linear = _linear_legs(local, drift, way, stop)
        if linear:
            return place, reason, True
        span += 4.0 * (abs(place.time) if not reason else 0.0)
    start = Place(way.behind, way.z[: local.n + 1], way.time)
    place, reason = follow(local, drift, start, stop, span=span)
    return place, reason and NOT_REACHED, False


def _linear_legs(
    local: LocalField, drift: Drift, way: Approach, stop: Event
) -> tuple[Place, str, bool]:
    """Closed-form passage behind an interface; False if it is not linear."""
    field, n, count = local.field, local.n, len(local.field.interfaces)
    region, z, linear = way.behind, way.z, True
    for _ in range(REGIONS):
        linear &= local.affine(region)
        flow = _flow(local, drift, region)
        rows = np.zeros((count + 1, n + 3))
        _, _, heights, gradients = field.evaluate(region, local.u)
        rows[:count, : n + 1] = field.signs[region, :count, None] * gradients[:count]
        rows[:count, -1] = field.signs[region, :count] * heights[:count]
        if stop.level == TURN:
            rows[count] = drift.way * flow.drift
        elif isinstance(stop.level, tuple):
            rows[count, stop.level[0]], rows[count, -1] = 1.0, -stop.level[1]
            size = float(np.abs(rows[count]) @ np.abs(z))
            if abs(float(rows[count] @ z)) <= 1e-12 * size:
                return Place(region, z[: n + 1], float(z[-2])), "", linear
            rows[count] *= math.copysign(1.0, float(rows[count] @ z))
        else:
            rows[count, -1] = 1.0
        time, reached = flow.reaches(z, rows)
        if math.isnan(time):
            return Place(region, z[: n + 1], math.nan), NOT_REACHED, linear
        z = flow.at(z, time)
        place = Place(region, z[: n + 1], float(z[-2]))
        if reached in (count, stop.interface):
            return place, "", linear
        across = field.neighbour(region, reached)
        if across == way.before:
            return place, RETURNED, linear
        if across is None or field.modes[across].sides is not None:
            return place, NOT_REACHED, linear
        region = across
    return place, NOT_REACHED, linear


def _flow(local: LocalField, drift: Drift, region: int) -> LinearFlow:
    """Linearised rates of a region at the point, with a drift."""
    rates, slopes, _, _ = local.field.evaluate(region, local.u)
    by_state = np.array([drift.by_state.get(name, 0.0) for name in local.field.model.states])
    # the rates at an equilibrium of the region are rounding
    rounding = 1e-12 * (np.abs(slopes) @ np.abs(local.u))
    offset = np.where(np.abs(rates) > rounding, rates, 0.0)
    return LinearFlow(
        slopes[:, : local.n],
        slopes[:, local.n],
        drift.rate,
        drift.change,
        drift.by_value,
        by_state,
        offset,
    )


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
    require_code(point, BOUNDARY_EQUILIBRIUM, "a gap crossing")
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
    stop = Event(interface=far)
    slowest = math.sqrt(2.0 * length / abs(drifts * drift.rate)) + abs(relaxation)
    place, reason, linear = _behind(local, drift, way, stop, slowest)
    delay, time, error = drift.way * float(place.z[-1]), place.time, math.nan
    if reason:
        delay = time = math.nan
        back = "the motion returns to the contact that it left"
        words = f"none: {back if reason == RETURNED else 'the far interface is not reached'}"
    else:
        linear &= local.affine(way.before)
        words, error = _judged(local, drift, way, stop, delay, linear=linear)
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


def approach_of(local: LocalField, drift: Drift) -> Approach:
    """Region whose stable branch ends under the drift, and the quasi-static crossing.

    Raises
    ------
    ArgumentError
        If the drift has the other direction or is not slow, or the branch before the
        interface is unstable.
    """
    field, n = local.field, local.n
    k = field.interfaces.index(str(local.point.interface))
    regions = [local.region(name) for name in local.point.regions]
    unstable, moved = -math.inf, False
    for before, behind in (regions, regions[::-1]):
        jacobian, slope = local.slopes(before)
        values = np.linalg.eigvals(jacobian).real
        if np.abs(values).min() <= 1e-10 * np.abs(values).max(initial=0.0):
            continue
        first = np.linalg.solve(-jacobian, slope)
        _, _, _, gradients = field.evaluate(behind, local.u)
        inward = np.zeros(n + 3)
        inward[: n + 1] = field.signs[behind, k] * gradients[k]
        speed = float(inward[:n] @ first + inward[n]) * drift.rate
        if abs(speed) <= 1e-12 * abs(drift.rate) * float(np.abs(inward[:n]) @ np.abs(first)):
            continue
        moved = True
        if speed < 0:
            continue
        if values.max() >= 0:
            unstable = max(unstable, float(values.max()))
            continue
        flow = _flow(local, drift, before)
        manifold = flow.slow_manifold()
        time = math.nan if manifold is None else flow.slow_crossing(manifold, inward)
        if manifold is None or math.isnan(time):
            raise ArgumentError(
                f"the drift of {field.parameter} is not slow compared with the branch before "
                f"{local.point.label}, whose slowest eigenvalue is {values.max():.3g}"
            )
        z = flow.slow_motion(manifold, time)
        return Approach(before, behind, k, inward, float(values.max()), manifold[0], z)
    if unstable >= 0:
        raise ArgumentError(
            f"no stable branch ends at {local.point.label}: before the interface an eigenvalue has "
            f"real part {unstable:.3g}"
        )
    if not moved:
        raise ArgumentError(
            f"a drift of {field.parameter} keeps the equilibrium at {local.point.label} on the "
            "interface"
        )
    raise wrong_way(local, drift.rate)


def _normalised(local: LocalField, p: Array, q: Array, way: Approach) -> tuple[Array, Array]:
    """Null vectors with ψ·q = 1 and q pointing into the gap."""
    across, unit = way.inward[: local.n], local.unit
    overlap, inward, length = float(p @ q), float(across @ q), np.linalg.norm(q / unit)
    if (
        abs(overlap) <= ZERO * np.linalg.norm(p * unit) * length
        or abs(inward) <= ZERO * np.linalg.norm(across * unit) * length
    ):
        raise ArgumentError(
            f"no continuum of equilibria with damped motion along it starts behind "
            f"{local.point.label}"
        )
    q = math.copysign(1.0, inward) * q
    return p / float(p @ q), q


def _far_side(local: LocalField, way: Approach, q: Array) -> tuple[int, float, Array]:
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
