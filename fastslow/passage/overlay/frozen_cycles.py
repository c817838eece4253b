"""Continuation of the cycle of the frozen fast subsystem to its end, by simulation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import FastSlowError
from fastslow.model.model import Model
from fastslow.passage.overlay.transitions import Passage
from fastslow.results.angles import apart
from fastslow.results.point_types import HOPF
from fastslow.simulation.one import simulate

Array = NDArray[np.float64]

#: Length of a frozen run, in periods of the previous cycle or of the last oscillation.
PERIODS = 25.0

#: Factor by which an unsettled run is extended, and the number of extensions.
LONGER, EXTENSIONS = 4.0, 2

#: Relative accuracy of the end of the cycle in the interval searched.
LOCATED = 1e-7

#: Number of steps beyond the last cycle found, each twice the previous one.
STEPS = 12

#: Ratio of successive distances from the end at which periods are compared.
FACTOR = 4.0

#: Number of cycles nearest to the end that are used for the classification.
NEAREST = 6

#: Smallest distance from the end, in units of the error of the end.
KNOWN = 30.0

#: Points per cycle at which its distance from a saddle is computed.
ROUND = 2000

#: Points of a cycle from which a neighbouring cycle is searched.
STARTS = 6

#: Relative tolerance between measured and predicted slope.
AGREES = 0.2

#: Largest ratio of successive increments of a period that remains finite.
SHRINKING = 0.8

#: Tolerance of the exponent or factor of a square-root law.
ROOT = 0.1


@dataclass(frozen=True, eq=False)
class FrozenCycle:
    """A stable cycle of the frozen fast subsystem.

    Parameters
    ----------
    value : float
        Value of the slow quantity.
    period : float
    size : float
        Extent of the cycle, in units of the extents of the run.
    states : ndarray, shape (STARTS, n)
        Points on it; the first is the farthest from all equilibria.
    saddle : float
        Distance from the nearest saddle, in the same units; nan without one.
    rate : float
        Unstable eigenvalue of that saddle; nan unless it is single and real.
    """

    value: float
    period: float
    size: float
    states: Array
    saddle: float
    rate: float


@dataclass(frozen=True, eq=False)
class FrozenEnd:
    """End of the cycle of the frozen fast subsystem and its bifurcation.

    Parameters
    ----------
    name : str
        ``"homoclinic"``, ``"circle"``, ``"Hopf"``, ``"fold cycle (candidate)"``, or
        ``"unclassified"``.
    value : float
        Value of the slow quantity.
    evidence : str
    """

    name: str
    value: float
    evidence: str


def frozen_end(p: Passage, times: Sequence[float]) -> FrozenEnd | None:
    """Continue the cycle of the frozen fast subsystem to its end.

    Towards a homoclinic orbit of a saddle with the unstable eigenvalue λ the period grows as
    −ln|w − w*|/λ, and the distance from the saddle tends to zero; on an invariant circle with a
    saddle-node it grows as |w − w*|^(−1/2) (Kuznetsov 2004, sections 6.2 and 7.1). At a fold of
    cycles the period and the size remain finite, at a Hopf point the size decreases as
    |w − w*|^(1/2).

    Parameters
    ----------
    p : Passage
    times : sequence of float
        Maxima of the observed state in one oscillating phase.

    Returns
    -------
    FrozenEnd or None
        None without a frozen model.
    """
    model = _frozen(p)
    if model is None or len(times) < 2:
        return None
    here = _first_cycle(p, model, times)
    name = p.diagram.parameter
    if here is None:
        return FrozenEnd("unclassified", np.nan, "the frozen fast subsystem has no stable cycle")
    found, bad = _towards(p, model, here, times)
    if bad is None:
        words = f"the frozen cycle still exists at {name} = {found[-1].value:.6g}"
        return FrozenEnd("unclassified", np.nan, words)
    found, bad = _located(p, model, found, bad)
    return _classified(p, model, found, bad)


def _frozen(p: Passage) -> Model | None:
    """The frozen fast subsystem with one free parameter; None if it is not known."""
    run, diagram = p.slow.run, p.diagram
    if run.symbolic_model is None or diagram.path:
        return None
    fast: Model = run.symbolic_model.frozen()
    held = {n: v for n, v in diagram.parameters.items() if n in (*fast.parameters, *fast.free)}
    fast = fast.with_parameters(held)
    known = fast.states == diagram.states and fast.free == (diagram.parameter,)
    return fast if known else None


def _continued(p: Passage, model: Model, value: float, last: FrozenCycle) -> FrozenCycle | None:
    """The stable cycle at another value, from points of a neighbouring cycle.

    Several points are tried, as some may be outside the basin of attraction.
    """
    for state in last.states:
        cycle = _cycle(p, model, value, state, last.period)
        if cycle is not None and 0.5 * last.size < cycle.size < 2.0 * last.size:
            return cycle
    return None


def _cycle(
    p: Passage, model: Model, value: float, state: Array, period: float
) -> FrozenCycle | None:
    """The stable cycle that the frozen model converges to from a state, if any."""
    at: dict[str, Any] = {p.diagram.parameter: value}
    frozen, length = model.with_parameters(at), PERIODS * period
    for _ in range(EXTENSIONS + 1):
        try:
            run = simulate(frozen, state, t=(0.0, length))
            settled = run.periodicity()
        except FastSlowError:
            return None
        if settled.outcome.code not in ("too short", "drifting", "not periodic"):
            break
        length *= LONGER
    if settled.period is None:
        return None
    times = np.linspace(run.span[1] - settled.period, run.span[1], ROUND)
    points = run.dense_columns(times)[: len(p.diagram.states)].T / p.m.extent
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    away, saddle, rate = _equilibria(p, value, points)
    first = int(np.argmax(np.where(np.isfinite(away), away, 0.0)))
    rows = (first + np.arange(STARTS) * ROUND // STARTS) % ROUND
    return FrozenCycle(value, settled.period, size, points[rows] * p.m.extent, saddle, rate)


def _equilibria(p: Passage, value: float, points: Array) -> tuple[Array, float, float]:
    """Scaled distances of points from equilibria and from the nearest saddle, its eigenvalue."""
    low, high = p.diagram.over
    at: dict[str, Any] = {p.diagram.parameter: float(np.clip(value, low, high))}
    away = np.full(len(points), np.inf)
    nearest, rate = np.nan, np.nan
    for q in p.diagram.at(**at):
        if not q.admissible:
            continue
        here = np.linalg.norm(apart(points, q.state / p.m.extent, p.m.periods), axis=1)
        away = np.minimum(away, here)
        unstable = q.eigenvalues[q.eigenvalues.real > 0]
        one = len(unstable) == 1 and unstable[0].imag == 0
        # with one state, a reset can be on an unstable equilibrium
        saddle = q.type.startswith("saddle") or (one and len(q.eigenvalues) == 1)
        if saddle and not here.min() >= nearest:
            nearest, rate = float(here.min()), float(unstable[0].real) if one else np.nan
    return away, nearest, rate


def _first_cycle(p: Passage, model: Model, times: Sequence[float]) -> FrozenCycle | None:
    """The cycle of the frozen model at the last maximum at which it has one."""
    intervals = np.diff(times)
    for k in range(len(times) - 1, -1, -1):
        last = p.state_at(times[k])
        period = float(intervals[min(k, len(intervals) - 1)])
        cycle = _cycle(p, model, last.value, last.state, period)
        if cycle is not None:
            return cycle
    return None


def _towards(
    p: Passage, model: Model, here: FrozenCycle, times: Sequence[float]
) -> tuple[list[FrozenCycle], float | None]:
    """Cycles in the direction of the drift, and the first value without a cycle."""
    values = [p.state_at(t).value for t in (times[0], times[-2], times[-1])]
    # a slow state may oscillate with the fast states
    drift = values[2] - values[1] or values[2] - values[0]
    step = np.sign(drift) * max(abs(drift), 1e-3 * p.m.span)
    found = [here]
    low, high = p.diagram.over
    for _ in range(STEPS):
        value = float(np.clip(found[-1].value + step, low, high))
        cycle = _continued(p, model, value, found[-1])
        if cycle is None:
            return found, value
        found.append(cycle)
        if value in (low, high):
            break
        step *= 2.0
    return found, None


def _located(
    p: Passage, model: Model, found: list[FrozenCycle], bad: float
) -> tuple[list[FrozenCycle], float]:
    """Locate the end by bisection: cycles on the way, and a value beyond the end."""
    good = found[-1]
    reach = abs(bad - good.value)
    found = [good]
    while abs(bad - found[-1].value) > LOCATED * reach:
        good = found[-1]
        value = 0.5 * (good.value + bad)
        if value in (good.value, bad):
            break
        cycle = _continued(p, model, value, good)
        if cycle is None:
            bad = value
        else:
            found.append(cycle)
    return found, bad


def _sequence(p: Passage, model: Model, found: list[FrozenCycle], bad: float) -> list[FrozenCycle]:
    """Cycles at distances from the end that decrease geometrically."""
    end = 0.5 * (found[-1].value + bad)
    error = max(abs(bad - found[-1].value), 1e-14 * abs(end))
    away, sequence = found[0].value - end, [found[0]]
    while abs(away) / FACTOR > KNOWN * error:
        away /= FACTOR
        value = end + away
        # a cycle that is not nearer to the end
        behind = [c for c in found if abs(c.value - end) >= abs(away)]
        last = min([*behind, sequence[-1]], key=lambda c: abs(c.value - value))
        cycle = _continued(p, model, value, last)
        if cycle is None:
            break
        sequence.append(cycle)
    return sequence


def _classified(p: Passage, model: Model, found: list[FrozenCycle], bad: float) -> FrozenEnd:
    """Classify the end by the trends of period, size and distance from a saddle."""
    end = 0.5 * (found[-1].value + bad)
    name = p.diagram.parameter
    cycles = _sequence(p, model, found, bad)[-NEAREST:]
    where = f"the frozen cycle exists up to {name} = {end:.6g}"
    if len(cycles) < NEAREST - 2:
        return FrozenEnd("unclassified", end, f"{where}; too few cycles before it to classify it")
    period = np.array([c.period for c in cycles])
    size = np.array([c.size for c in cycles])
    away = np.array([abs(c.value - end) for c in cycles])
    saddle = np.array([c.saddle for c in cycles])
    growth = np.diff(period)
    first, last = period[0], period[-1]
    words = (
        f"its period is {first:.4g} at a distance of {away[0]:.2g} and {last:.4g} at {away[-1]:.2g}"
    )
    slope = -float(np.polyfit(np.log(away), period, 1)[0])
    predicted = 1.0 / cycles[-1].rate
    if (growth > 0).all() and (np.diff(saddle) < 0).all() and abs(slope / predicted - 1) < AGREES:
        words += (
            f": it grows as −{slope:.3g} ln|{name} − {end:.6g}| (1/λ of the saddle: "
            f"{predicted:.3g}), and the cycle passes the saddle within {saddle[0]:.2g} to "
            f"{saddle[-1]:.2g} of the extent"
        )
        return FrozenEnd("homoclinic", end, f"{where}; {words}")
    power = float(np.polyfit(np.log(away), np.log(period), 1)[0])
    near = [q for q in p.diagram.folds if abs(q[name] - end) < away[0]]
    if (growth > 0).all() and abs(power + 0.5) < ROOT and near:
        words += f": it grows with the power {power:.3g} of the distance from {near[0].label}"
        return FrozenEnd("circle", end, f"{where}; {words}")
    shrinks = size[1:] / size[:-1]
    hopf = [q for q in p.diagram.special(HOPF) if abs(q[name] - end) < away[0]]
    if hopf and (abs(shrinks - 1.0 / np.sqrt(FACTOR)) < ROOT).all():
        words = f"its size decreases as the square root of the distance from {hopf[0].label}"
        return FrozenEnd("Hopf", end, f"{where}; {words}")
    if _oscillates_beyond(p, model, found[0], end):
        return FrozenEnd("unclassified", end, f"{where}; {words}; the oscillation persists beyond")
    finite = (np.abs(growth[1:]) <= SHRINKING * np.abs(growth[:-1])).all()
    alone = not (saddle[-1] < 0.5 * saddle[0])
    if (finite or alone) and size[-1] > 0.5 * size[0]:
        words += ": it remains finite, " if finite else ": no saddle is approached, and "
        words += f"the size changes to {size[-1] / size[0]:.0%}"
        return FrozenEnd("fold cycle (candidate)", end, f"{where}; {words}")
    return FrozenEnd("unclassified", end, f"{where}; {words}")


def _oscillates_beyond(p: Passage, model: Model, cycle: FrozenCycle, end: float) -> bool:
    """Whether the frozen model still oscillates beyond the end, as on a torus or in chaos."""
    at: dict[str, Any] = {p.diagram.parameter: 2.0 * end - cycle.value}
    frozen = model.with_parameters(at)
    run = simulate(frozen, cycle.states[0], t=(0.0, 2.0 * PERIODS * cycle.period))
    late = np.linspace(run.span[1] - 4.0 * cycle.period, run.span[1], ROUND)
    points = run.dense_columns(late)[: len(p.diagram.states)].T / p.m.extent
    return bool(np.linalg.norm(np.ptp(points, axis=0)) > 0.5 * cycle.size)
