"""Shift of a slow quantity: its law in time, its limits, and when it has settled."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from fastslow.errors import (
    ArgumentError,
    ModelError,
    refuse_events,
    refuse_switches,
    unknown_name,
)
from fastslow.model.functions import numpy_function
from fastslow.model.model import Model
from fastslow.model.structure import TIME, real

Array = NDArray[np.float64]

#: Times in a decade, and decades on both sides of 1, at which a law is evaluated for its limits.
TIMES_IN_DECADE, LAW_DECADES = 8, 15

#: Last times, of those, at which a law has to be at its limit, and the distance, as a fraction of
#: its range.
AGREEING_TIMES, AGREEMENT = 12, 1e-9

#: Refinements of the time at which a law settles, each with so many times.
TIME_REFINEMENTS, TIMES_BETWEEN = 4, 101

#: Times at which the range of a shift is sampled.
SHIFT_SAMPLES = 2001

#: Change of a time by which one side of a corner is taken, relative to it or to the duration.
ASIDE_OF_CORNER = 1e-14

#: Fraction of its range from its limits during which a shift changes.
CHANGING = 0.05

#: Fraction of its range within which a shift has not begun, and beyond which it exceeds a limit.
WHOLE_SHIFT = 1e-6


@dataclass(frozen=True, eq=False)
class Shift:
    """The law of the slow quantity of a model, at values of its parameters.

    Parameters
    ----------
    name : str
        The slow quantity.
    law : sympy.Expr
        In time and parameters.
    values : mapping
        Parameter to value.
    past, future : float
        Limits as time goes to −∞ and to ∞. A law without a limit in the past starts at t = 0,
        from rest at its value there.
    settles : bool
        Whether there is a limit in the past.
    """

    name: str
    law: sp.Expr
    values: Mapping[str, float]
    past: float
    future: float
    settles: bool

    def at(self, times: Array | float) -> Array:
        """The slow quantity at times."""
        return _evaluated(self.law, times, self.values)

    def speed(self, time: float, side: int) -> float:
        """Rate of change just before a time (side = −1), or after it (1)."""
        aside = time + side * self._aside(time)
        return float(_evaluated(_derivative(self.law, TIME), aside, self.values))

    def by(self, time: float, name: str, side: int) -> float:
        """Derivative with respect to a parameter, on one side of a time."""
        if real(name) not in self.law.free_symbols:
            return 0.0
        aside = time + side * self._aside(time)
        return float(_evaluated(_derivative(self.law, real(name)), aside, self.values))

    def _aside(self, time: float) -> float:
        return ASIDE_OF_CORNER * max(abs(time), self.duration)

    @cached_property
    def duration(self) -> float:
        """Time in which the slow quantity changes."""
        return self.settled(CHANGING) - self.began(CHANGING)

    @property
    def range(self) -> float:
        """Largest distance of the slow quantity from its future limit."""
        low, high = self.extent
        return max(high - self.future, self.future - low)

    @property
    def extent(self) -> tuple[float, float]:
        """Least and largest value of the slow quantity."""
        first, last = self.began(WHOLE_SHIFT), self.settled(WHOLE_SHIFT)
        values = self.at(np.linspace(first, last, SHIFT_SAMPLES))
        ends = np.array([self.past, self.future])
        return float(min(values.min(), ends.min())), float(max(values.max(), ends.max()))

    def path(self, count: int) -> Array:
        """Values in the order of time, from limit to limit, evenly spaced in their change."""
        times = np.linspace(self.began(WHOLE_SHIFT), self.settled(WHOLE_SHIFT), SHIFT_SAMPLES)
        values = np.array([self.past, *self.at(times).tolist(), self.future])
        passed = np.append(0.0, np.cumsum(np.abs(np.diff(values))))
        return np.interp(np.linspace(0.0, passed[-1], count), passed, values)

    @property
    def returns(self) -> bool:
        """Whether the slow quantity goes beyond both of its limits."""
        low, high = self.extent
        slack = WHOLE_SHIFT * (high - low)
        least, most = sorted((self.past, self.future))
        return low < least - slack or high > most + slack

    def settled(self, fraction: float) -> float:
        """First time after which it remains within a fraction of its range from its limit."""
        return self._last_outside(1, self.future, fraction)

    def began(self, fraction: float) -> float:
        """Last time before which it is within a fraction of its range from its past limit."""
        return self._last_outside(-1, self.past, fraction) if self.settles else 0.0

    @cached_property
    def _coarse(self) -> tuple[Array, Array]:
        """Times over all decades, from the start on, and the slow quantity there."""
        times = np.concatenate([-_decades()[::-1], [0.0], _decades()])
        if not self.settles:
            times = times[times >= 0.0]
        return times, self.at(times)

    def _last_outside(self, side: int, limit: float, fraction: float) -> float:
        times, values = self._coarse
        times, away = times[::side], np.abs(values[::side] - limit)
        reach = away[np.isfinite(away)].max() * fraction
        outside = np.flatnonzero(~(away <= reach))
        if not len(outside):
            return 0.0
        if outside[-1] == len(times) - 1:
            return float(times[-1])
        inner, outer = float(times[outside[-1]]), float(times[outside[-1] + 1])
        for _ in range(TIME_REFINEMENTS):
            between = np.linspace(inner, outer, TIMES_BETWEEN)
            away = np.abs(self.at(between) - limit)
            away[0] = np.inf
            last = min(int(np.flatnonzero(~(away <= reach))[-1]), TIMES_BETWEEN - 2)
            inner, outer = float(between[last]), float(between[last + 1])
        return outer


def shift_of(model: Model, rate: str, value: float) -> Shift:
    """Return the shift of a model at a value of its rate.

    Raises
    ------
    UnknownNameError
        For a rate that is no parameter of the model.
    ModelError
        For a model without exactly one slow quantity that is a forcing, with switches or events.
    ArgumentError
        For a rate that is no parameter of the forcing, and a law that does not settle.
    """
    refuse_switches(model.switches, "a run of this shift")
    refuse_events(model.events, "a run of this shift")
    if model.slow_states or len(model.forcing) != 1:
        quantities = ", ".join((*model.slow_states, *model.forcing)) or "none"
        raise ModelError(
            f"the model has the slow quantities {quantities}; expected one, with its law in time "
            "as forcing="
        )
    ((name, law),) = model.forcing.items()
    require_rate(model, rate)
    values = {**model.parameters, rate: value}
    ends = [_limit(law, values, side) for side in (-1, 1)]
    past, future = ends
    settles = past is not None
    if past is None:
        past = float(_evaluated(law, 0.0, values)) + 0.0
    if future is None or not np.isfinite(past):
        raise ArgumentError(
            f"the shift {name} = {law} does not settle: at {rate} = {value:.6g} it has no limit as "
            "t goes to infinity; expected a shift that ends, such as a sigmoid or "
            "Min(r*t, D), or a ramp of a model with one fast and one slow state (slow=), whose "
            "threshold is the canard of a folded saddle"
        )
    return Shift(name, law, values, past, future, settles)


def require_rate(model: Model, rate: str) -> None:
    """Raise unless a name is a parameter of the only forcing of a model."""
    if rate not in model.parameters:
        raise unknown_name("parameter", rate, model.parameters)
    ((name, law),) = model.forcing.items()
    inside = sorted(s.name for s in law.free_symbols if s.name in model.parameters)
    if rate not in inside:
        raise ArgumentError(
            f"{rate} is no parameter of the forcing {name} = {law}; expected one of "
            f"{', '.join(inside) or 'its parameters, of which it has none'}"
        )


def _limit(law: sp.Expr, values: Mapping[str, float], side: int) -> float | None:
    """Value at which a law settles as time goes to ±∞, None if it does not."""
    times = side * _decades()
    found = _evaluated(law, np.concatenate([-times[::-1], [0.0], times]), values)
    last = found[-AGREEING_TIMES:]
    if not np.isfinite(last).all():
        return None
    bounded = found[np.isfinite(found)]
    # one side alone may grow without bound
    later = bounded[-len(times) :]
    reach = max(float(np.ptp(later)), float(np.finfo(float).tiny))
    return float(last[-1]) + 0.0 if np.ptp(last) <= AGREEMENT * reach else None


def _decades() -> Array:
    return np.logspace(-LAW_DECADES, LAW_DECADES, 2 * LAW_DECADES * TIMES_IN_DECADE + 1)


@lru_cache(maxsize=256)
def _derivative(law: sp.Expr, symbol: sp.Symbol) -> sp.Expr:
    return law.diff(symbol)


@lru_cache(maxsize=256)
def _function(law: sp.Expr) -> tuple[tuple[sp.Symbol, ...], Callable[..., Array]]:
    used = tuple(sorted(law.free_symbols - {TIME}, key=lambda s: s.name))
    return used, numpy_function((TIME, *used), law)


@np.errstate(all="ignore")
def _evaluated(law: sp.Expr, times: Array | float, values: Mapping[str, float]) -> Array:
    used, function = _function(law)
    given = np.asarray(times, dtype=float)
    # conditions of nested pieces are arrays of one shape
    found = function(given, *(np.broadcast_to(values[s.name], given.shape) for s in used))
    return np.broadcast_to(np.asarray(found, dtype=float), given.shape)
