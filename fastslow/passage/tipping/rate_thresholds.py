"""Location of the critical rates between runs of a shift that end differently."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fastslow.diagrams.correcting import corrections
from fastslow.passage.tipping.ends_of_shifts import SETTLED_SHIFT, UNDECIDED_END, ShiftRuns
from fastslow.passage.tipping.landings import Constraint, Landed, landed, residual
from fastslow.passage.tipping.moving_equilibria import MovingEquilibrium
from fastslow.passage.tipping.rate_landings import RateLanding
from fastslow.results.points import Equilibrium
from fastslow.results.tipping import RateThreshold
from fastslow.results.trajectory.trajectory import Trajectory
from fastslow.simulation.one import simulate

Array = NDArray[np.float64]

#: Bisections of a bracket at most, and its length relative to the rate at which they end.
BRACKET_BISECTIONS, RATE_RESOLVED = 60, 1e-15

#: Fractions at which a bracket is divided, and its relative length within which runs that have no
#: unique continuation end the bisection.
BISECTING, NOT_UNIQUE_WITHIN = (0.5, 0.382, 0.618), 1e-9

#: Distance of a run from an edge, in units of the range of equilibria, at which Newton's method is
#: tried, and the factor by which it decreases before the next attempt.
NEAR_EDGE, NEARER = 0.2, 0.4

#: Fraction of the range of a shift within which the edge is compared, its largest first-order
#: correction, and the number of times.
EDGE_COMPARED, LARGEST_LATENESS, COMPARED_TIMES = 0.05, 0.1, 200

#: Times of the growth of an edge during which runs are compared with it.
EDGE_GROWTHS = 30.0

#: Factor of the tolerance of runs by whose change the error of a bisection is estimated, and the
#: distances from the rate, relative to it, at which they are compared.
COARSER_RUNS, RATE_DISTANCES = 100.0, tuple(10.0**k for k in range(-15, -3))

#: Relaxation times by which a run begins earlier, to measure the truncation error of its start.
EARLIER_START = 5.0


@dataclass(frozen=True, eq=False)
class RateBracket:
    """Two rates whose runs end differently.

    Parameters
    ----------
    low, high : float
    below, above : int
        Attractors that they reach.
    """

    low: float
    high: float
    below: int
    above: int


@dataclass(frozen=True, eq=False)
class Approach:
    """The edge that a run comes nearest to.

    Parameters
    ----------
    edge : Equilibrium
    time : float
    distance : float
    """

    edge: Equilibrium
    time: float
    distance: float


def thresholds_between(
    runs: ShiftRuns, bracket: RateBracket, tracked: int | None
) -> list[RateThreshold]:
    """Return the critical rates in a bracket, of which more than one may be found."""
    low, high, tried = bracket.low, bracket.high, NEAR_EDGE / NEARER
    approach: Approach | None = None
    for _ in range(BRACKET_BISECTIONS):
        middle = 0.5 * (low + high)
        run = _run_at(runs, middle)
        approach = _nearest_approach(runs, middle, run)
        if approach is not None and approach.distance < NEARER * tried:
            tried = approach.distance
            found = _landed(runs, approach, middle, bracket)
            if found is not None:
                return [_threshold(runs, bracket, tracked, approach.edge, *found)]
        middle, end = _end_between(runs, low, high)
        if end == UNDECIDED_END and high - low <= NOT_UNIQUE_WITHIN * max(abs(low), abs(high)):
            break
        if end == bracket.below:
            low = middle
        elif end == bracket.above:
            high = middle
        else:
            parts = (
                RateBracket(low, middle, bracket.below, end),
                RateBracket(middle, high, end, bracket.above),
            )
            return [one for part in parts for one in thresholds_between(runs, part, tracked)]
        if high - low <= RATE_RESOLVED * max(abs(low), abs(high)):
            break
    return [_bisected(runs, RateBracket(low, high, bracket.below, bracket.above), tracked)]


def _end_between(runs: ShiftRuns, low: float, high: float) -> tuple[float, int]:
    """A rate between two, and the attractor that its run reaches.

    Runs through a tangency have no unique continuation: another rate is tried.
    """
    for share in BISECTING:
        middle = low + share * (high - low)
        end = int(runs.ends(np.array([middle]))[0])
        if end != UNDECIDED_END:
            break
    return middle, end


def _run_at(runs: ShiftRuns, rate: float) -> Trajectory:
    shift = runs.shift_at(rate)
    begin = runs.begin(shift)
    growth = min((_growth(edge) for edge in runs.future.edges), default=runs.relaxation)
    end = max(runs.end(shift), begin) + EDGE_GROWTHS / growth
    model = runs.model.with_parameters({runs.rate: rate})
    return simulate(model, runs.start(shift, begin), t=(begin, end), integration=runs.integration)


def _growth(edge: Equilibrium) -> float:
    real = edge.eigenvalues.real
    return float(real[np.isfinite(real)].max(initial=0.0)) or 1.0


def _nearest_approach(runs: ShiftRuns, rate: float, run: Trajectory) -> Approach | None:
    """The edge that a run comes nearest to once the shift has nearly settled."""
    shift, size = runs.shift_at(rate), runs.future.size
    first = max(shift.settled(EDGE_COMPARED), run.span[0])
    if not first < run.span[1]:
        return None
    late = shift.settled(SETTLED_SHIFT)
    times = np.linspace(first, run.span[1], COMPARED_TIMES)
    if first < late < run.span[1]:
        half = COMPARED_TIMES // 2
        times = np.unique([*np.linspace(first, late, half), *np.linspace(late, run.span[1], half)])
    states, values = run(times).T, shift.at(times)
    best: Approach | None = None
    for edge in runs.future.edges:
        moving = _moving(runs, edge)
        correction = corrections(moving.field)[moving.number]
        on_edge = correction.corrected_many(np.tile(edge.state, (len(times), 1)), values)
        away = np.abs((states - on_edge) / size).max(axis=1)
        for k in np.argsort(np.where(np.isnan(away), np.inf, away)).tolist():
            lateness = moving.late(on_edge[k], float(values[k]), shift.speed(float(times[k]), 1))
            if np.abs(lateness / size).max() < LARGEST_LATENESS:
                if best is None or away[k] < best.distance:
                    best = Approach(edge, float(times[k]), float(away[k]))
                break
    return best


def _moving(runs: ShiftRuns, edge: Equilibrium) -> MovingEquilibrium:
    return MovingEquilibrium(runs.branch.frozen, runs.shift.name, edge.region, edge.state)


def _landed(
    runs: ShiftRuns, approach: Approach, rate: float, bracket: RateBracket
) -> tuple[RateLanding, Landed, float] | None:
    """The critical rate by Newton's method, with the error of the truncation at the start."""
    shift = runs.shift_at(rate)
    landing = RateLanding(runs, _moving(runs, approach.edge), (runs.rate,), runs.begin(shift))
    constraint = Constraint.of_one(rate, bracket.low, bracket.high)
    found = landed(landing, np.array([rate]), approach.time, constraint)
    if found is None:
        return None
    if not shift.settles:
        return landing, found, 0.0
    earlier = replace(landing, begin=landing.begin - EARLIER_START / runs.relaxation)
    other = residual(earlier, found.unknowns, found.end)
    missed = np.nan if other is None else other.value - found.residual.value
    error = abs(missed / float(found.residual.slopes[0]))
    return landing, found, error


def _threshold(
    runs: ShiftRuns,
    bracket: RateBracket,
    tracked: int | None,
    edge: Equilibrium,
    landing: RateLanding,
    found: Landed,
    start_error: float,
) -> RateThreshold:
    rate = float(found.unknowns[0])
    return RateThreshold(
        parameter=runs.rate,
        rate=rate,
        below=runs.future.words(bracket.below, tracked),
        above=runs.future.words(bracket.above, tracked),
        edge=edge,
        method="Newton",
        start_error=start_error,
        end_error=found.change,
        expansion=abs(float(found.residual.slopes[0])),
        run=found.residual.run,
        parameters={**runs.model.parameters, runs.rate: rate},
        source=(landing, found),
    )


def _bisected(runs: ShiftRuns, bracket: RateBracket, tracked: int | None) -> RateThreshold:
    """The critical rate of an edge that is no equilibrium, by bisection, with the error of runs."""
    rate = 0.5 * (bracket.low + bracket.high)
    width = bracket.high - bracket.low
    return RateThreshold(
        parameter=runs.rate,
        rate=rate,
        below=runs.future.words(bracket.below, tracked),
        above=runs.future.words(bracket.above, tracked),
        edge=None,
        method="bisection",
        start_error=np.nan,
        end_error=max(width, _error_of_runs(runs, replace(bracket, low=rate, high=rate))),
        expansion=np.nan,
        run=_run_at(runs, rate),
        parameters={**runs.model.parameters, runs.rate: rate},
    )


def _error_of_runs(runs: ShiftRuns, bracket: RateBracket) -> float:
    """Distance from a rate at which runs of a coarser tolerance end as they should on both sides.

    Infinite if they do at none of the distances that are tried.
    """
    rtol = COARSER_RUNS * (runs.integration.rtol or np.finfo(float).eps)
    coarse = replace(runs, integration=replace(runs.integration, rtol=rtol))
    for distance in RATE_DISTANCES:
        apart = distance * max(abs(bracket.low), np.finfo(float).tiny)
        rates = np.array([bracket.low - apart, bracket.high + apart])
        if coarse.ends(rates).tolist() == [bracket.below, bracket.above]:
            return apart
    return np.inf
