"""Numerical integration of the passage of a special point."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from fastslow.kernels.loops import load_loop
from fastslow.passage.delays.drift_laws import DriftLaw, drift_law
from fastslow.passage.delays.local_field import TURN, LocalField
from fastslow.passage.delays.radau_passages import Law, LocalMotion, RadauEnd, space_for
from fastslow.passage.loops import PASS_THROUGH
from fastslow.results.overlay.drifts import Drift

Array = NDArray[np.float64]

#: Relative error of the integrated passage, ten thousand times the observed one.
PASSAGE_ERROR = 1e-7

#: Error bound of a law relative to its difference from the integrated passage.
LAW_SAFETY = 1.25

#: Largest number of regions on the way to a level.
REGIONS_CROSSED = 12

#: Reasons for which the integration of a passage does not end.
TOO_LONG, FAILED = "it takes longer than expected", "the integration failed"


@dataclass(frozen=True, eq=False)
class LocalDrift:
    """w' as a function of states, parameter and time about a special point.

    Parameters
    ----------
    local : LocalField
    drift : Drift
    """

    local: LocalField
    drift: Drift

    @cached_property
    def gradient(self) -> Array:
        """Derivatives of w' by the states and by w, shape (n + 1,)."""
        names = self.local.field.model.states
        return np.array([*(self.drift.by_state.get(n, 0.0) for n in names), self.drift.by_value])

    @cached_property
    def _law(self) -> DriftLaw | None:
        names = (*self.local.field.model.states, self.local.field.parameter)
        return drift_law(self.drift.law, names) if self.drift.law else None

    def __call__(self, z: Array, time: float) -> float:
        """Rate w' at z = (x − x*, w − w*)."""
        if self._law is not None:
            return self._law.at(self.local.u + z, time)
        return float(self.drift.rate + self.drift.change * time + self.gradient @ z)

    def on_a_path(self, states: Array) -> Array:
        """Rate w' at states (N, n) with w = w* and t = 0, shape (N,)."""
        if self._law is not None:
            here = np.full(len(states), float(self.local.u[-1]))
            return self._law.along(np.column_stack([states, here]), np.zeros(len(states)))
        rate = self.drift.rate + (states - self.local.u[:-1]) @ self.gradient[:-1]
        return np.asarray(rate, dtype=float)

    def numbers(self, start: float, stop: float) -> Law:
        """Representation for compiled code between two times."""
        law, none = self._law, np.zeros(len(self.gradient))
        if law is None:
            return Law(self.drift.rate, self.drift.change, self.gradient)
        if law.in_time:
            return Law(0.0, 0.0, none, *law.table(start, stop))
        address, numbers = law.compiled
        return Law(0.0, 0.0, none, address=address, numbers=numbers)


@dataclass(frozen=True, eq=False)
class EndOfPassage:
    """Event that ends a passage: a level of a state, an interface, or an extremum of w.

    Parameters
    ----------
    level : (int, float), "turn" or None
    interface : int, optional
    """

    level: tuple[int, float] | str | None = None
    interface: int = -1


@dataclass(frozen=True, eq=False)
class PassagePlace:
    """Region, (x − x*, w − w*), and the time since w passed the point."""

    region: int
    z: Array
    time: float


def quasi_static(
    local: LocalField, drift: Drift, region: int, mu: float, guess: Array
) -> Array | None:
    """(x − x*, μ) on the first-order slow manifold of a region's stable branch, near a guess.

    None if Newton's method finds no stable equilibrium.
    """
    y, n = guess.copy(), local.n
    jacobian = np.empty((n, n))
    for _ in range(60):
        rates, slopes, _, _ = local.field.evaluate(region, local.u + np.append(y, mu))
        jacobian = slopes[:, :n]
        try:
            step = np.linalg.solve(jacobian, -rates)
        except np.linalg.LinAlgError:
            return None
        y = y + step
        if not np.isfinite(y).all():
            return None
        if (np.abs(step) <= 1e-14 * (np.abs(y) + local.unit)).all():
            break
    _, slopes, heights, _ = local.field.evaluate(region, local.u + np.append(y, mu))
    count = len(local.field.interfaces)
    if (local.field.signs[region, :count] * heights[:count] < 0).any():
        return None
    jacobian = slopes[:, :n]
    if not np.linalg.eigvals(jacobian).real.max() < 0:
        return None
    rate = LocalDrift(local, drift)(np.append(y, mu), _time_before(drift, mu))
    lag = np.linalg.solve(jacobian, np.linalg.solve(jacobian, slopes[:, n])) * rate
    return np.append(y - lag, mu)


def follow(
    local: LocalField, drift: Drift, start: PassagePlace, stop: EndOfPassage, *, span: float
) -> tuple[PassagePlace, str]:
    """Integrate x' = F(x, w) and w' of a drift up to the event that ends the passage.

    A passage that starts before the point is first integrated up to w = w*, where t = 0; the
    event is detected only afterwards.

    Parameters
    ----------
    local : LocalField
    drift : Drift
    start : PassagePlace
    stop : EndOfPassage
    span : float
        Largest duration.

    Returns
    -------
    place : PassagePlace
        Final place.
    reason : str
        Empty if the event was reached, else the reason why not.
    """
    place, reason = start, ""
    way, speed = drift.way, LocalDrift(local, drift)
    if start.z[-1] * way < 0.0:
        begin = start.time if start.time < 0.0 else _time_before(drift, float(start.z[-1]))
        early = PassagePlace(start.region, start.z, begin)
        place, reason = _legs(local, speed, early, None, way, span)
        if reason:
            return place, reason
        # the time of the drift before the point was an estimate
        place = PassagePlace(place.region, place.z, 0.0)
    return _legs(local, speed, place, stop, way, span)


def _time_before(drift: Drift, mu: float) -> float:
    """Time at which w = w* + μ, from the rate of the drift and its change."""
    time = mu / drift.rate
    square = 1.0 + 2.0 * drift.change * mu / drift.rate**2
    return 2.0 * time / (1.0 + math.sqrt(square)) if square > 0.0 else time


def _legs(
    local: LocalField,
    speed: LocalDrift,
    start: PassagePlace,
    stop: EndOfPassage | None,
    way: float,
    span: float,
) -> tuple[PassagePlace, str]:
    """Integrate across regions up to an event (without one, up to w = w*)."""
    place, final = start, start.time + span
    for _ in range(REGIONS_CROSSED):
        place, reached, reason = _leg(local, speed, place, stop, way, final)
        if reason or reached < 0 or (stop is not None and reached == stop.interface):
            return place, reason
        across = local.field.neighbour(place.region, reached)
        if across is None or local.field.modes[across].sides is not None:
            return place, "it leaves the regions of the model"
        place = PassagePlace(across, place.z, place.time)
    return place, "it passes through too many regions"


def _leg(
    local: LocalField,
    speed: LocalDrift,
    start: PassagePlace,
    stop: EndOfPassage | None,
    way: float,
    final: float,
) -> tuple[PassagePlace, int, str]:
    """Integrate within one region: final place, interface (−1: the event), reason of failure."""
    field, n = local.field, local.n
    count = len(field.interfaces)
    reach = abs(float(start.z[n])) or abs(speed.drift.rate * final)
    motion = LocalMotion(
        field.compiled.address,
        start.region,
        field.values,
        field.compiled.size,
        local.u,
        np.ascontiguousarray(field.signs[start.region, :count]),
    )
    z, times = np.array(start.z, dtype=float), np.array([start.time, final], dtype=float)
    reached, status = load_loop(PASS_THROUGH)(
        motion,
        speed.numbers(start.time, final),
        _end(stop, way),
        z,
        times,
        np.append(local.unit, reach),
        space_for(n, count, field.compiled.size),
    )
    return PassagePlace(start.region, z, float(times[0])), reached, ("", TOO_LONG, FAILED)[status]


def _end(stop: EndOfPassage | None, way: float) -> RadauEnd:
    """Numerical representation of an event."""
    if stop is None:
        return RadauEnd(1, 0, 0.0, way)
    if stop.level == TURN:
        return RadauEnd(2, 0, 0.0, way)
    if isinstance(stop.level, tuple):
        return RadauEnd(3, stop.level[0], float(stop.level[1]), way)
    return RadauEnd(0, 0, 0.0, way)


def reached_delay(
    local: LocalField, drift: Drift, start: PassagePlace | None, stop: EndOfPassage, span: float
) -> tuple[float, float]:
    """Delay and time at which a passage ends; (nan, nan) if it does not."""
    if start is None:
        return math.nan, math.nan
    place, reason = follow(local, drift, start, stop, span=span)
    if reason:
        return math.nan, math.nan
    return drift.way * float(place.z[-1]), place.time


def rounding(local: LocalField) -> float:
    """Rounding of the parameter at a special point, the smallest error of a delay."""
    return 4.0 * float(np.spacing(abs(local.u[-1])))


def bound_of(local: LocalField, delay: float, passed: float, drift: Drift) -> tuple[float, str]:
    """Error bound of a law from the integrated passage, and its statement."""
    if math.isnan(delay):
        return math.nan, ""
    if not drift.complete:
        return math.nan, "; no error bound, as the drift is not fully known"
    if math.isnan(passed):
        return math.nan, "; no error bound"
    error = LAW_SAFETY * abs(delay - passed) + PASSAGE_ERROR * abs(passed) + rounding(local)
    return error, f"; error below {error:.2g}, by integration of the passage with this drift"
