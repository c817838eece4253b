"""Entry-exit integral over time along the slow path of a run."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from fastslow.model.functions import numpy_function
from fastslow.model.structure import TIME, real
from fastslow.passage.delays.critical_modes import CriticalMode
from fastslow.passage.delays.entry_exits import FIRST_ORDER_SAFETY, INTEGRAL_ERROR
from fastslow.passage.roots import sign_change
from fastslow.passage.slow_quantities import SlowQuantity

Array = NDArray[np.float64]

#: Gauss points within one interval of time.
NODES, WEIGHTS = np.polynomial.legendre.leggauss(6)

#: Number of time intervals of the path, besides the steps of the run.
INTERVALS = 400

#: Intervals on which growth rates with and without the feedback of a slow state are compared.
FEEDBACK = 48

#: Bisections within an interval.
EXIT_BISECTIONS = 60

#: Exponents next to entry and exit over which amplitudes are compared with their linear growth.
COMPARED_EXPONENTS = (1.5, 3.0)

#: Amplitude, relative to the lag, below which the second-order terms of the slow manifold prevail.
UNREADABLE = 1e-3

#: Length of the continuation of the path beyond the run, relative to the path.
PATH_BEYOND = 1.0


@dataclass(frozen=True, eq=False)
class SlowPath:
    """Slow quantity of a run since the entry, continued beyond the run.

    Parameters
    ----------
    slow : SlowQuantity
    start : float
        Time of the entry.
    known : float
        Time up to which the path is that of the run.
    beyond : callable or None
        Values at later times; None if they are not known.
    source : str
        Description of the source of the values beyond.
    """

    slow: SlowQuantity
    start: float
    known: float
    beyond: Callable[[Array], Array] | None
    source: str

    def at(self, times: Array) -> Array:
        """Values at times, nan if they are not known."""
        inside = times <= self.known
        found = np.full(len(times), np.nan)
        if inside.any():
            found[inside] = self.slow.at(times[inside])[0]
        if self.beyond is not None and not inside.all():
            found[~inside] = self.beyond(times[~inside])
        return found

    def rate(self, time: float) -> float:
        """dw/dt at a time of the run."""
        begin, end = float(self.slow.run.t[0]), float(self.slow.run.t[-1])
        step = 1e-5 * (end - begin)
        pair = np.clip([time - step, time + step], begin, end)
        one, other = self.slow.at(pair)[0]
        return float((other - one) / (pair[1] - pair[0]))

    def edges(self, stop: float) -> Array:
        """Ends of intervals on which the path is smooth, from the entry to a time."""
        run = self.slow.run
        even = np.linspace(self.start, stop, INTERVALS + 1)
        steps = np.asarray(run.step_starts) if self.slow.dense else np.empty(0)
        inside = steps[(steps > self.start) & (steps < min(stop, self.known))]
        every = np.unique(np.concatenate([even, inside, [min(self.known, stop)]]))
        # intervals of the length of rounding are dropped
        apart = np.diff(every) > 1e-13 * np.abs(every[1:])
        return np.asarray(every[np.r_[True, apart]])


def path_of(mode: CriticalMode, slow: SlowQuantity, start: float, left: float) -> SlowPath:
    """Slow path of a run between entry and departure, continued beyond the run.

    A forcing is continued by its formula, a slow state by its rate on the branch after the
    departure, if that depends on no other slow quantity.
    """
    run, model, name = slow.run, slow.run.symbolic_model, slow.name
    end = float(run.t[-1])
    if slow.laws or name in run.forcing:
        beyond = None
        if model is not None and not slow.laws:
            law = _numbers(model, model.forcing[name])
            beyond = _vectorised(numpy_function(TIME, law))
        return SlowPath(slow, start, end, beyond, "the forcing")
    law = None if model is None else _numbers(model, model.rates[name])
    names = [real(n) for n in (*slow.states, name)]
    if law is None or not law.free_symbols <= {*names, TIME}:
        return SlowPath(slow, start, left, None, "")
    rate = numpy_function([*names, TIME], law)
    return SlowPath(slow, start, left, _along_the_branch(mode, slow, rate, left), "the branch")


def _numbers(model: Any, law: sp.Expr) -> sp.Expr:
    return law.xreplace({n: sp.Float(value, 17) for n, value in model.values.items()})


def _vectorised(function: Callable[..., Any]) -> Callable[[Array], Array]:
    def values(times: Array) -> Array:
        return np.array(np.broadcast_to(function(times), times.shape), dtype=float)

    return values


def _along_the_branch(
    mode: CriticalMode, slow: SlowQuantity, rate: Callable[..., Any], left: float
) -> Callable[[Array], Array]:
    """Solution of w' = g(X(w), w, t) since the departure, nan beyond the branch."""
    from scipy.integrate import solve_ivp

    low, high = sorted((mode.before.end, mode.behind.end))

    def flow(time: float, w: Array) -> list[float]:
        value = float(w[0])
        if not low <= value <= high:
            return [0.0]
        return [float(rate(*mode.side(value).place(value)[1], value, time))]

    def values(times: Array) -> Array:
        start = float(slow.at(np.array([left]))[0][0])
        span = (left, float(times.max()))
        solved = solve_ivp(flow, span, [start], rtol=1e-9, atol=1e-12, dense_output=True)
        found = np.asarray(solved.sol(times))[0]
        return np.where((found > low) & (found < high), found, np.nan)

    return values


@dataclass(frozen=True, eq=False)
class PathGrowth:
    """Exponent ∫ Re λ(w(t)) dt since the entry, at the edges of time intervals.

    Parameters
    ----------
    mode : CriticalMode
    path : SlowPath
    edges, exponent : ndarray
        The exponent is nan after the path leaves the range of the branch.
    """

    mode: CriticalMode
    path: SlowPath
    edges: Array
    exponent: Array

    def rate(self, times: Array) -> Array:
        w = self.path.at(times)
        return self._of_values(w)

    def _of_values(self, w: Array) -> Array:
        behind = self.mode.behind
        ahead = behind.way * (w - behind.here) >= 0.0
        return np.where(ahead, behind.rate(w), self.mode.before.rate(w))

    def at(self, time: float) -> float:
        """Exponent at a time."""
        k = min(max(int(np.searchsorted(self.edges, time)) - 1, 0), len(self.edges) - 2)
        half = 0.5 * (time - self.edges[k])
        inner = self.rate(self.edges[k] + half * (1.0 + NODES)) @ WEIGHTS * half
        return float(self.exponent[k] + inner)

    def first(self, level: float, since: float) -> float:
        """First time after ``since`` at which the exponent reaches a level, else nan."""
        late = np.flatnonzero((self.edges > since) & (self.exponent >= level))
        if not len(late):
            return math.nan
        k = int(late[0])
        low, high = max(float(self.edges[k - 1]), since), float(self.edges[k])
        if self.at(low) >= level:
            return low
        fine = 4e-16 * max(abs(low), abs(high))
        return sign_change(lambda time: self.at(time) - level, low, high, fine)

    def last(self, level: float, until: float) -> float:
        """Last edge before ``until`` at which the exponent is below a level, else nan."""
        early = np.flatnonzero((self.edges < until) & (self.exponent <= level))
        return float(self.edges[early[-1]]) if len(early) else math.nan


def growth_along(mode: CriticalMode, path: SlowPath, stop: float) -> PathGrowth:
    """Integrate the growth of a mode along a path up to a time."""
    edges = path.edges(stop)
    half = 0.5 * np.diff(edges)
    times = edges[:-1, None] + half[:, None] * (1.0 + NODES)
    growth = PathGrowth(mode, path, edges, np.zeros(len(edges)))
    rates = growth.rate(times.ravel()).reshape(times.shape)
    exponent = np.r_[0.0, np.cumsum(rates @ WEIGHTS * half)]
    return PathGrowth(mode, path, edges, exponent)


@dataclass(frozen=True, eq=False)
class PathExit:
    """Exit at which growth along a path balances the decay.

    Parameters
    ----------
    entry, exit : float
        Values of the slow quantity; the exit is nan if there is none.
    passed, time : float
        Times of the last loss of stability of the branch, and of the exit.
    decay, gain : float
        As in `HopfExit`.
    amplitude : float
        Amplitude at the entry, states in their units; nan if it cannot be determined.
    error : float
        Error bound of the exit, nan without one.
    words : str
        Source of the path and the amplitudes.
    """

    entry: float
    exit: float
    passed: float
    time: float
    decay: float
    gain: float
    amplitude: float
    error: float
    words: str


def path_exit(
    mode: CriticalMode, slow: SlowQuantity, start: float, small: float, left: float
) -> PathExit | None:
    """Predict the exit of a run from a branch, given the times of entry and departure.

    The amplitudes of the critical mode at both times are those of the run about the
    first-order slow manifold.

    Parameters
    ----------
    mode : CriticalMode
    slow : SlowQuantity
    start, small, left : float
        Times of the entry, of the last sample near the branch, and of the departure.

    Returns
    -------
    PathExit or None
        None if the run leaves both sides of the point in between.
    """
    path = path_of(mode, slow, start, left)
    growth = growth_along(mode, path, max(left, path.known))
    inside = growth.edges <= left
    if not np.isfinite(growth.exponent[inside]).all() or inside.sum() < 2:
        return None
    lowest = int(np.argmin(growth.exponent[inside]))
    passed, decay = _stability_lost(growth, lowest), -float(growth.exponent[lowest])
    first, last = _amplitude(growth, start), _amplitude(growth, left)
    gain, words = last / first, "with the amplitudes at entry and departure"
    if not math.isfinite(gain) or gain <= 0.0:
        gain, words = (
            1.0,
            "exit at the amplitude of the entry, which cannot be determined from the run",
        )
    level = math.log(gain)
    at = growth.first(level, passed)
    if math.isnan(at) and path.beyond is not None:
        growth = growth_along(mode, path, path.known + PATH_BEYOND * (path.known - start))
        at = growth.first(level, passed)
        if math.isfinite(at):
            words += f"; beyond t = {path.known:.6g} along {path.source}"
    entry = float(path.at(np.array([start]))[0])
    if math.isnan(at):
        why = "the branch or the path ends before growth balances the decay"
        if path.beyond is None and not slow.laws and slow.name not in slow.run.forcing:
            why += "; the slow quantity after the departure is not known"
        nan = math.nan
        return PathExit(
            entry=entry,
            exit=nan,
            passed=passed,
            time=nan,
            decay=decay,
            gain=gain,
            amplitude=first,
            error=nan,
            words=f"none: {why}",
        )
    value = float(path.at(np.array([at]))[0])
    error = math.nan
    if math.isfinite(first) and math.isfinite(last):
        if path.beyond is not None and growth.edges[-1] <= path.known:
            # the error bound needs the path beyond the exit
            growth = growth_along(mode, path, path.known + PATH_BEYOND * (path.known - start))
        error = _error(growth, entry, value, passed, at, level, (small, left))
    return PathExit(
        entry=entry,
        exit=value,
        passed=passed,
        time=at,
        decay=decay,
        gain=gain,
        amplitude=first,
        error=error,
        words=words,
    )


def _stability_lost(growth: PathGrowth, lowest: int) -> float:
    """Time at which the path passes the point, near the smallest exponent."""
    behind, edges = growth.mode.behind, growth.edges
    low, high = (float(edges[min(max(lowest + k, 0), len(edges) - 1)]) for k in (-1, 1))
    for _ in range(EXIT_BISECTIONS):
        middle = 0.5 * (low + high)
        ahead = behind.way * (growth.path.at(np.array([middle]))[0] - behind.here) >= 0.0
        low, high = (low, middle) if ahead else (middle, high)
    return high


def _amplitude(growth: PathGrowth, time: float) -> float:
    """Amplitude of the critical mode at a time of the run; nan if the lag dominates it."""
    value, state = growth.path.slow.at(np.array([time]))
    rate = growth.path.rate(time)
    mode = growth.mode.at(float(value[0]))
    if mode is None:
        return math.nan
    found = growth.mode.amplitude(state[0], float(value[0]), rate)
    lag = abs(mode.left @ mode.lag) * abs(rate)
    return found if found > UNREADABLE * lag else math.nan


def _error(
    growth: PathGrowth,
    entry: float,
    value: float,
    passed: float,
    at: float,
    level: float,
    leaving: tuple[float, float],
) -> float:
    """Error bound from first-order terms, feedback of a slow state, and finite amplitudes."""
    mode, path = growth.mode, growth.path
    speed = path.rate(min(passed, path.known))
    off = mode.exponent_error(entry, value, speed) + abs(_feedback(growth, at))
    off += _nonlinear(growth, *leaving)
    around = []
    for side in (-1.0, 1.0):
        time = growth.first(level + side * off, passed)
        if math.isnan(time):
            if side > 0.0:
                return math.nan
            time = passed
        around.append(float(path.at(np.array([time]))[0]))
    return FIRST_ORDER_SAFETY * max(abs(value - other) for other in around) + INTEGRAL_ERROR * abs(
        value - entry
    )


def _nonlinear(growth: PathGrowth, small: float, left: float) -> float:
    """Deviation of amplitudes from linear growth, next to the entry and the exit."""
    start = growth.path.start
    total = 0.0
    reached = growth.at(small)
    falls = np.flatnonzero((growth.exponent <= -COMPARED_EXPONENTS[0]) & (growth.edges > start))
    inner = float(growth.edges[falls[0]]) if len(falls) else math.nan
    outer = growth.last(reached - COMPARED_EXPONENTS[1], small)
    for one, other in ((start, inner), (outer, left)):
        if math.isnan(one) or math.isnan(other) or not other > one:
            continue
        sizes = _amplitude(growth, one), _amplitude(growth, other)
        if all(math.isfinite(s) and s > 0.0 for s in sizes):
            grown = growth.at(other) - growth.at(one)
            total += abs(math.log(sizes[1] / sizes[0]) - grown)
    return total


def _feedback(growth: PathGrowth, at: float) -> float:
    """Contribution of the feedback of a slow state to the exponent, by λ of the full system."""
    slow = growth.path.slow
    model, name = slow.run.symbolic_model, slow.name
    if model is None or slow.laws or name in slow.run.forcing:
        return 0.0
    law = _numbers(model, model.rates[name])
    names = [real(n) for n in (*slow.states, name)]
    others = [n for n in slow.run.columns if n not in (*slow.states, name)]
    symbols = [*names, *map(real, others), TIME]
    slopes = numpy_function(symbols, [law.diff(n) for n in names])
    edges = np.linspace(growth.path.start, at, FEEDBACK + 1)
    times = 0.5 * (edges[1:] + edges[:-1])
    total = 0.0
    values = growth.path.at(times)
    for time, value, mode in zip(times, values, growth.mode.modes(values), strict=True):
        if mode is None:
            continue
        inside = min(float(time), growth.path.known)
        extra: list[float] = []
        if others and slow.dense:
            columns = slow.run.dense_columns(np.array([inside]))[:, 0]
            extra = [float(columns[slow.run.columns.index(n)]) for n in others]
        unit = growth.mode.unit
        gradient = np.array(slopes(*(mode.state * unit), value, *extra, time), dtype=float)
        n = len(unit)
        full = np.zeros((n + 1, n + 1))
        full[:n, :n], full[:n, n] = mode.jacobian, mode.by_parameter
        full[n, :n], full[n, n] = gradient[:n] * unit, gradient[n]
        found = np.linalg.eigvals(full)
        near = complex(found[np.argmin(np.abs(found - mode.value))])
        total += (near.real - mode.value.real) * (edges[1] - edges[0])
    return total
