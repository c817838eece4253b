"""The lag of persistence, the delay of a non-smooth fold, and the crossing of a gap."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.diagrams.normal_forms import null_vectors
from fastslow.errors import ArgumentError
from fastslow.model.model import Model
from fastslow.passage.linear_flow import LinearFlow
from fastslow.passage.sites import (
    Site,
    drift,
    level_of,
    named_level,
    require_code,
    site_of,
    wrong_way,
)
from fastslow.results.delays import BoundaryDelay, GapTransit
from fastslow.results.points import SpecialPoint

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Approach:
    """The stable sheet followed up to an interface.

    Parameters
    ----------
    before, behind : int
        The regions.
    interface : int
    inward : ndarray, shape (n + 2,)
        Positive, applied to z = (y, μ, 1), behind the interface.
    stable : float
        Largest real part of the eigenvalues before it.
    time : float
        When the quasi-static motion crosses, from when the parameter is at the point.
    z : ndarray, shape (n + 2,)
        Where it crosses.
    """

    before: int
    behind: int
    interface: int
    inward: Array
    stable: float
    time: float
    z: Array


def boundary_delay(
    point: SpecialPoint,
    rate: float,
    *,
    level: Mapping[Any, float] | None = None,
    parameter: object = None,
    model: Model | None = None,
) -> BoundaryDelay:
    """How late a drifting parameter finds the trajectory at a boundary equilibrium.

    The passage is solved for the rates linearised on both sides of the interface,
    y' = J₁ y + b₁ μ and y' = J₂ y + b₂ μ with μ = rate·t: the quasi-static motion
    y = −J₁⁻¹ b₁ μ − J₁⁻² b₁ rate crosses with a lag of the order of the rate. With
    persistence that is all. At a non-smooth fold the motion behind the interface
    grows along the unstable direction of J₂ until the level is reached, at

        delay = (rate/λ₂) ln(1/rate) + O(rate)

    with a part of order rate that depends on the level: no power of the rate. For
    x' = p + |x|, p = εt, the linear equations give p = ε (1 + ln((x + p + ε)/(2ε))).

    Parameters
    ----------
    point : SpecialPoint
        A boundary equilibrium of a continuous field, code BE, of subtype
        ``"persistence"`` or ``"non-smooth fold"``.
    rate : float
        Of the parameter, with its sign.
    level : mapping
        One state and its value, e.g. ``{"x": 1.0}``; a non-smooth fold needs it.
    parameter : str or Symbol, optional
        What drifts, by default the parameter of the point's diagram.
    model : Model, optional
        For a point that was read from a file: its model.

    Returns
    -------
    BoundaryDelay
        Exact where the rates are linear on both sides. There ``delay`` is the lag
        for persistence, and nan where the level is never reached.

    Raises
    ------
    ArgumentError
        For a point of another code or subtype, a rate of zero or towards the
        stable sheet, or a missing level.

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
    require_code(point, "BE", "the delay of a boundary equilibrium")
    speed = drift(rate)
    if point.clarke is None or point.subtype not in ("persistence", "non-smooth fold"):
        kind = "a degenerate one" if point.subtype == "degenerate" else "one of a Filippov field"
        hint = "; see gap_transit" if point.subtype == "degenerate" else ""
        raise ArgumentError(
            f"expected a boundary equilibrium of a continuous field with persistence or a "
            f"non-smooth fold, received {point.label}, {kind}{hint}"
        )
    site = site_of(point, parameter, model)
    height = level_of(site, level)
    way = approach_of(site, speed)
    jacobian, slope = site.slopes(way.behind)
    unstable = float(np.linalg.eigvals(jacobian).real.max())
    exact = site.affine(way.before) and site.affine(way.behind)
    words = (
        "exact: the rates are linear on both sides"
        if exact
        else "from the rates linearised at the point, the better the nearer the level is"
    )
    time = way.time
    if point.subtype == "persistence":
        words = f"no delay but a lag, {words}"
        if unstable >= 0:
            words += "; the sheet behind the interface is not stable"
    else:
        if height is None:
            raise ArgumentError(
                "the delay of a non-smooth fold is that of reaching a level; give level={state: "
                "value}"
            )
        flow = LinearFlow(jacobian, slope, speed)
        row = np.zeros(site.n + 2)
        row[height[0]], row[-1] = 1.0, -height[1]
        more, back = flow.reaches(way.z, row, way.inward)
        time += more
        if back:
            words = "none: the motion returns across the interface before it reaches the level"
        elif math.isnan(more):
            words = "none: the motion behind the interface does not reach the level"
    return BoundaryDelay(
        point=point,
        parameter=site.field.parameter,
        rate=speed,
        delay=abs(speed) * time,
        validity=words,
        lag=abs(speed) * way.time,
        stable=way.stable,
        unstable=unstable,
        level=named_level(site, height),
    )


def gap_transit(
    point: SpecialPoint,
    rate: float,
    *,
    parameter: object = None,
    model: Model | None = None,
) -> GapTransit:
    """How long a drifting parameter needs to carry the trajectory across a gap.

    In a region whose equilibria form a continuum at one value of the parameter
    (no stiffness between two contacts) the motion y' = J y + b μ with J q = 0,
    ψ J = 0, ψ·q = 1 is pushed along q by ξ' = β μ, β = ψ·b; the other motions
    follow with the time τ. From contact to contact over the length ℓ, for slow drift,

        delay = √(2ℓ |rate/β|) + τ |rate|.

    For x'' + c x' = w between x = ±D with s = |rate| that is Δw = 2√(c D s) + s/c, in
    Δt = √(4 c D/s) + 1/c. The prediction itself is solved from the exact linear
    motion in the gap, from the quasi-static state in which it is entered.

    Parameters
    ----------
    point : SpecialPoint
        The end of the continuum at which it is entered: a degenerate boundary
        equilibrium, code BE.
    rate : float
        Of the parameter, with its sign.
    parameter : str or Symbol, optional
        What drifts, by default the parameter of the point's diagram.
    model : Model, optional
        For a point that was read from a file: its model.

    Returns
    -------
    GapTransit

    Raises
    ------
    ArgumentError
        For a point of another code or subtype, or without a continuum behind it
        that ends at another interface; for a rate of zero or towards the contact.

    Examples
    --------
    >>> import fastslow as fs
    >>> fast = fs.systems.harmonic_gear(D=0.25).frozen()
    >>> diagram = fs.continue_equilibria(fast, "w", over=(-1, 1))
    >>> upper = [p for p in diagram.boundary_equilibria if p["x"] > 0][0]
    >>> law = gap_transit(upper, -0.001)
    >>> round(law.asymptotic - 2 * (0.25 * 0.001) ** 0.5, 12), round(law.transit_time, 2)
    (0.001, 32.58)
    """
    require_code(point, "BE", "the crossing of a gap")
    speed = drift(rate)
    if point.clarke is None or point.subtype != "degenerate":
        kind = point.subtype or "one of a Filippov field"
        raise ArgumentError(
            f"expected a degenerate boundary equilibrium of a continuous field, the end of a "
            f"continuum; received {point.label}, {kind}"
        )
    site = site_of(point, parameter, model)
    way = approach_of(site, speed)
    jacobian, slope = site.slopes(way.behind)
    p, q = null_vectors(jacobian)
    p, q = _normalised(site, p, q, way)
    drifts = float(p @ slope)
    far, length, outward = _far_side(site, way, q)
    # the inverse of J on its range: the other motions lag behind by it
    bordered = np.block([[jacobian, q[:, None]], [p[None, :], np.zeros((1, 1))]])
    lean = np.linalg.solve(bordered, np.append(slope - drifts * q, 0.0))[:-1]
    n = site.n
    relaxation = float(outward[:n] @ lean / (outward[:n] @ q)) / drifts
    relaxation -= float(outward[n] / (outward[:n] @ q)) / drifts
    time, back = LinearFlow(jacobian, slope, speed).reaches(way.z, outward, way.inward)
    values = np.linalg.eigvals(jacobian)
    others = np.delete(values, np.argmin(np.abs(values))).real
    words = "exact for the linear motion in the gap, at a constant rate of drift"
    if not site.affine(way.behind):
        words = "from the rates in the gap linearised where it is entered"
    if back:
        words = "none: the motion returns to the contact that it left"
    elif math.isnan(time):
        words = "none: the far interface is not reached"
    else:
        left = math.exp(min(float(others.max(initial=-math.inf)) * time, 700.0))
        words += f"; of the slow-drift law a part {left:.1g} has not died out"
    return GapTransit(
        point=point,
        parameter=site.field.parameter,
        rate=speed,
        delay=abs(speed) * (way.time + time),
        validity=words,
        lag=abs(speed) * way.time,
        length=length,
        slope=drifts,
        relaxation=relaxation,
        interfaces=(site.field.interfaces[way.interface], site.field.interfaces[far]),
    )


def approach_of(site: Site, rate: float) -> Approach:
    """Which region's stable sheet the drift runs off, and the quasi-static crossing.

    Raises
    ------
    ArgumentError
        If the drift goes the other way, or the sheet before the interface is unstable.
    """
    field, n = site.field, site.n
    k = field.interfaces.index(str(site.point.interface))
    regions = [site.region(name) for name in site.point.regions]
    unstable, moved = -math.inf, False
    for before, behind in (regions, regions[::-1]):
        jacobian, slope = site.slopes(before)
        values = np.linalg.eigvals(jacobian).real
        if np.abs(values).min() <= 1e-10 * np.abs(values).max(initial=0.0):
            continue
        flow = LinearFlow(jacobian, slope, rate)
        first, second = flow.quasi_static()
        _, _, _, gradients = field.at(behind, site.u)
        inward = np.append(field.signs[behind, k] * gradients[k], 0.0)
        speed = float(inward[:n] @ first + inward[n]) * rate
        if abs(speed) <= 1e-12 * abs(rate) * float(np.abs(inward[:n]) @ np.abs(first)):
            continue
        moved = True
        if speed < 0:
            continue
        if values.max() >= 0:
            unstable = max(unstable, float(values.max()))
            continue
        time = -float(inward[:n] @ second) / speed
        mu = rate * time
        z = np.concatenate([first * mu + second, [mu, 1.0]])
        return Approach(before, behind, k, inward, float(values.max()), time, z)
    if unstable >= 0:
        raise ArgumentError(
            f"no stable sheet ends at {site.point.label}: before the interface an eigenvalue has "
            f"real part {unstable:.3g}"
        )
    if not moved:
        raise ArgumentError(
            f"a drift of {field.parameter} leaves the equilibrium at {site.point.label} on the "
            "interface"
        )
    raise wrong_way(site, rate)


def _normalised(site: Site, p: Array, q: Array, way: Approach) -> tuple[Array, Array]:
    """Null vectors with ψ·q = 1, q into the gap."""
    overlap, inward = float(p @ q), float(way.inward[: site.n] @ q)
    if abs(overlap) <= 1e-9 or abs(inward) <= 1e-9 * float(np.linalg.norm(way.inward)):
        raise ArgumentError(
            f"behind {site.point.label} no continuum of equilibria with damped motion along it "
            "leads away from the interface"
        )
    q = math.copysign(1.0, inward) * q
    return p / float(p @ q), q


def _far_side(site: Site, way: Approach, q: Array) -> tuple[int, float, Array]:
    """The next interface along the continuum, how far it is, and its function, positive inside."""
    field, n = site.field, site.n
    _, _, heights, gradients = field.at(way.behind, site.u)
    found: list[tuple[float, int]] = []
    for j in range(len(field.interfaces)):
        along = float(gradients[j, :n] @ q)
        if j != way.interface and along != 0.0 and -heights[j] / along > 0.0:
            found.append((float(-heights[j] / along), j))
    if not found:
        raise ArgumentError(
            f"the continuum behind {site.point.label} ends at no other interface; a gap lies "
            "between two"
        )
    length, j = min(found)
    sign = field.signs[way.behind, j]
    return j, length, sign * np.append(gradients[j], heights[j])
