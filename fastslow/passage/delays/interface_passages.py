"""Passage of an interface by a quasi-static motion, and the motion behind it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import ArgumentError
from fastslow.passage.delays.delay_law import FORGOTTEN
from fastslow.passage.delays.linear_flow import LinearFlow
from fastslow.passage.delays.local_field import TURN, LocalField, wrong_way
from fastslow.passage.delays.local_passages import (
    REGIONS_CROSSED,
    EndOfPassage,
    PassagePlace,
    bound_of,
    follow,
    quasi_static,
    reached_delay,
    rounding,
)
from fastslow.results.overlay.delays import Delay
from fastslow.results.overlay.drifts import Drift

Array = NDArray[np.float64]

#: Relative error of a closed-form passage after root finding.
CLOSED_FORM_ERROR = 1e-9

#: Reasons for which a passage behind an interface does not end.
NOT_REACHED = "the motion behind the interface does not reach the level"
RETURNED = "the motion returns across the interface before it reaches the level"

#: Relaxation times before the point at which the integrated passage may start, tried in order.
RELAXATIONS_BEFORE = (36.0, 24.0, 12.0, 6.0)


@dataclass(frozen=True, eq=False)
class InterfaceApproach:
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


def approach_of(local: LocalField, drift: Drift) -> InterfaceApproach:
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
        return InterfaceApproach(before, behind, k, inward, float(values.max()), manifold[0], z)
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


def judged(
    local: LocalField,
    drift: Drift,
    way: InterfaceApproach,
    stop: EndOfPassage,
    delay: float,
    *,
    linear: bool,
) -> tuple[str, float]:
    """Validity and error of a passage."""
    if linear and not drift.law:
        if not drift.complete:
            return "exact for a drift of this form, whose other terms are not known", math.nan
        return "exact: the rates and the drift are linear", CLOSED_FORM_ERROR * abs(
            delay
        ) + rounding(local)
    words = "from the rates linearised before the interface"
    words += "" if stop.level is None else ", integrated behind it"
    passed = math.nan
    for count in RELAXATIONS_BEFORE:
        mu = -count * drift.rate / -way.stable
        start = quasi_static(local, drift, way.before, mu, way.first * mu)
        if start is not None:
            span = 4.0 * (count / -way.stable + abs(delay / drift.rate))
            place = PassagePlace(way.before, start, 0.0)
            passed, _ = reached_delay(local, drift, place, stop, span)
        if math.isfinite(passed):
            break
    error, more = bound_of(local, delay, passed, drift)
    return words + more, error


def passage_behind(
    local: LocalField, drift: Drift, way: InterfaceApproach, stop: EndOfPassage, slowest: float
) -> tuple[PassagePlace, str, bool]:
    """End of the passage behind an interface, reason of failure, and whether it is linear."""
    span = 40.0 * slowest
    if local.affine(way.behind) and not drift.law:
        place, reason, linear = _linear_legs(local, drift, way, stop)
        if linear:
            return place, reason, True
        span += 4.0 * (abs(place.time) if not reason else 0.0)
    start = PassagePlace(way.behind, way.z[: local.n + 1], way.time)
    place, reason = follow(local, drift, start, stop, span=span)
    return place, reason and NOT_REACHED, False


def _linear_legs(
    local: LocalField, drift: Drift, way: InterfaceApproach, stop: EndOfPassage
) -> tuple[PassagePlace, str, bool]:
    """Closed-form passage behind an interface; False if it is not linear."""
    field, n, count = local.field, local.n, len(local.field.interfaces)
    region, z, linear = way.behind, way.z, True
    for _ in range(REGIONS_CROSSED):
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
                return PassagePlace(region, z[: n + 1], float(z[-2])), "", linear
            rows[count] *= math.copysign(1.0, float(rows[count] @ z))
        else:
            rows[count, -1] = 1.0
        time, reached = flow.reaches(z, rows)
        if math.isnan(time):
            return PassagePlace(region, z[: n + 1], math.nan), NOT_REACHED, linear
        z = flow.at(z, time)
        place = PassagePlace(region, z[: n + 1], float(z[-2]))
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


def settling_before(local: LocalField, delay: Delay) -> float:
    """Distance over which transients decay on the stable branch that ends at an interface."""
    stable = approach_of(local, Drift(delay.rate)).stable
    return FORGOTTEN * abs(delay.rate) / abs(stable)
