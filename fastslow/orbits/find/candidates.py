"""Runs of which the last period may be near an orbit: settled ones, and first returns."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import ArgumentError
from fastslow.orbits.flow.flows import after_jumps, fields
from fastslow.orbits.flow.problem import OrbitProblem
from fastslow.orbits.flow.shooting import sizes_of
from fastslow.results.angles import apart, periods_of
from fastslow.results.base.outcome import Outcome
from fastslow.results.trajectory.events.jumps import assignments_of
from fastslow.results.trajectory.trajectory import Trajectory
from fastslow.simulation.prepared_runs import prepared_run
from fastslow.simulation.settings import Integration

Array = NDArray[np.float64]

#: Distance from the guess, in units of the orbit's ranges, up to which an orbit is that of the
#: guess, so that no transient is integrated.
NEAR_GUESS = 0.2

#: Change over one period, in the same units, below which a run is near enough to its limit for
#: Newton's method.
SETTLED_RUN = 0.02

#: Lengths of the runs in which transients decay: periods, and steps without forcing.
TRANSIENT_PERIODS = (20, 40, 80, 160, 320, 640, 1280)
TRANSIENT_STEPS = (400, 2_000, 10_000, 50_000)

#: Distance of a first return from the state it returns to, in units of the ranges.
RETURN = 0.05

#: Samples after a reset at the end of a run, from which the state is taken whose return is sought.
SAMPLES_AFTER_RESET = 4

#: Multiples of the period tested for a run that does not repeat after the given one.
MULTIPLES = 16

#: A rate below this fraction of its terms vanishes: the state is an equilibrium to nine digits.
STILL = 1e-9

#: Size of a state, in units of its largest one before, below which only rounding is left.
VANISHED = 1e-14

#: Steps from which the unit of time of a model is measured, and a span of time in these units
#: that no run reaches.
TIME_UNIT_STEPS, ENDLESS = 16, 1e5


class Guess(NamedTuple):
    """A time and a state, with the run over the preceding period if there is one.

    ``switches`` are their given states, NaN for none.
    """

    time: float
    state: Array
    run: Trajectory | None = None
    period: float | None = None
    switches: Array | None = None


def candidates_of(
    problem: OrbitProblem, start: Guess, period: float | None
) -> Iterator[tuple[Trajectory, float, float, float]]:
    """Yield runs with the beginning and length of their last period, and the distance allowed."""
    forced = problem.forced_period()
    if start.run is not None and start.period is not None:
        same = forced is None or abs(start.period - forced) < 0.5 * forced / problem.multiple
        if same:
            yield start.run, start.time, start.period, np.inf
    if forced is not None:
        yield from _forced_candidates(problem, start, forced)
    else:
        yield from _free_candidates(problem, start, period)


def _forced_candidates(
    problem: OrbitProblem, start: Guess, period: float
) -> Iterator[tuple[Trajectory, float, float, float]]:
    # times within one period of the forcing, where its phase is accurate
    time, state = start.time % period, start.state
    switches = start.switches
    run = problem.run(state, time, time + period, switches)
    yield run, time, period, NEAR_GUESS
    largest = np.zeros(len(state))
    for count in TRANSIENT_PERIODS:
        run = problem.run(state, time, time + count * period, switches)
        switches = run.end_switches
        time = time % period
        state = _end_of(run, time, problem)
        if not run.outcome:
            yield run, run.span[0], period, 0.0
            return
        sizes = np.abs(_starts_of(run))
        largest = np.maximum(largest, sizes.max(axis=0))
        late = np.abs(_starts_of(run, run.span[1] - period))
        reached = np.maximum(late.max(axis=0, initial=0.0), np.abs(state))
        gone = reached <= VANISHED * largest
        if changes_over(run, period)[~gone].max(initial=0.0) <= SETTLED_RUN:
            # what rounding leaves of a state that decays to 0 is no unit
            state[gone] = 0.0
            last = problem.run(state, time, time + period, switches)
            yield last, time, period, np.inf
    outcome = _other_multiple(problem, run, period)
    yield replace(run, outcome=outcome), run.span[1] - period, period, 0.0


def _free_candidates(
    problem: OrbitProblem, start: Guess, hint: float | None
) -> Iterator[tuple[Trajectory, float, float, float]]:
    """Runs of an autonomous model, cut at first returns."""
    if start.run is not None and start.period is None:
        known = _first_return(start.run, hint, problem.multiple)
        if known is not None:
            yield start.run, start.run.span[1] - known, known, np.inf
    state, switches = start.state, start.switches
    unit = _unit_of_time(problem, state, switches)
    last: Trajectory | None = None
    returned: float | None = None
    largest = np.zeros(len(state))
    for number, steps in enumerate(TRANSIENT_STEPS):
        if hint is not None:
            run = problem.run(state, 0.0, 20 * hint, switches)
        else:
            run = _limited(problem, steps).run(state, 0.0, ENDLESS * unit, switches)
        ending = run.outcome.code
        if not run.outcome and ending != "too many steps":
            yield run, run.span[0], run.span[1] - run.span[0], 0.0
            return
        if ending != "too many steps" and len(run.steps):
            # the first steps were far shorter than those of the motion
            unit = max(unit, _longest_step(run))
        run = replace(run, outcome=Outcome("end of time", "", True))
        if number == 0:
            ahead = _first_return_ahead(run, hint, problem.multiple)
            if ahead is not None:
                yield run, run.span[0], ahead, NEAR_GUESS
        largest = np.maximum(largest, np.abs(_starts_of(run)).max(axis=0))
        if (np.abs(_last_place(run)[1]) <= VANISHED * largest).all() or _still(run):
            text = (
                "the run settles on an equilibrium; give a guess near the orbit, which does not "
                "attract it."
            )
            yield (
                replace(run, outcome=Outcome("equilibrium", text, False)),
                *(run.span[0], run.span[1] - run.span[0], 0.0),
            )
            return
        period = _first_return(run, hint, problem.multiple)
        if period is not None:
            returned = period
            yield run, run.span[1] - period, period, np.inf
        state, last, switches = run.end[1:].copy(), run, run.end_switches
    assert last is not None
    why = f"the run returns after {returned or 0.0:.6g}, but no orbit was solved for there:"
    if returned is None:
        why = f"no first return within {sum(TRANSIENT_STEPS)} steps: no oscillation,"
    elif counters := _counters(problem, last, returned):
        why = f"{counters}, which events assign, has another value after every return:"
    text = (
        f"{why} a slow transient, or chaotic motion; give a guess nearer to an orbit, and an "
        "estimate of its period as period=."
    )
    last = replace(last, outcome=Outcome("not settled", text, False))
    yield last, last.span[0], last.span[1] - last.span[0], 0.0


def _unit_of_time(problem: OrbitProblem, state: Array, switches: Array | None) -> float:
    """Largest of the first steps of a run.

    Raises
    ------
    ArgumentError
        If the state is an equilibrium.
    """
    modes = np.arange(len(problem.variations.modes))
    here = modes, np.tile(state, (len(modes), 1)), np.zeros(len(modes)), problem.parameters
    values = np.nan_to_num(np.zeros(0) if switches is None else switches)
    constants = problem.variations.constants_at(np.zeros(len(modes)), problem.parameters, values)
    with np.errstate(all="ignore"):
        found = fields(problem.variations, *here, constants)
    slopes = found.f_u[:, :, : len(state)]
    # a sliding motion may be undefined off its interface
    defined = slopes[np.isfinite(slopes).all(axis=(1, 2))]
    fastest = float(np.abs(np.linalg.eigvals(defined)).max(initial=0.0))
    unit = 1.0 / fastest if fastest > 0 else 1.0
    run = _limited(problem, TIME_UNIT_STEPS).run(state, 0.0, ENDLESS * unit, switches)
    if not len(run.steps):
        return unit
    unit = _longest_step(run)
    mode = int(run.steps[0, 2])
    terms = np.abs(slopes[mode])
    # also terms of states that vanish at an equilibrium, as a velocity
    size = np.abs(state) + unit * (terms @ np.abs(state))
    if (np.abs(found.f[mode]) <= STILL * (terms @ size)).all():
        raise ArgumentError(
            "the guess is an equilibrium, where all rates vanish; expected a state off it"
        )
    return unit


def _longest_step(run: Trajectory) -> float:
    return float(np.diff(run.steps[:, 0], append=run.span[1]).max())


def _limited(problem: OrbitProblem, steps: int) -> OrbitProblem:
    """The problem with runs of a number of steps."""
    resolved = problem.prepared.resolved
    settings = Integration(
        rtol=resolved.rtol, order=resolved.order, implicit=resolved.implicit, max_steps=steps
    )
    prepared = prepared_run(problem.model, settings)
    return replace(problem, prepared=prepared)


def _end_of(run: Trajectory, time: float, problem: OrbitProblem) -> Array:
    """The last state of a run, on its walls to rounding at the same phase of the forcing."""
    state, variations = run.end[1:].copy(), problem.variations
    mode = int(run.steps[-1, 2]) if len(run.steps) else 0
    number = variations.jumps.rest_entry(mode)
    if number < 0:
        return state
    here = np.array([number]), state[None], np.array([time]), problem.parameters
    switches = variations.switches_at(run, run.steps[-1:, 0])
    constants = variations.constants_at(np.array([time]), problem.parameters, switches)
    return after_jumps(variations, *here, constants)[0][0]


def _other_multiple(problem: OrbitProblem, run: Trajectory, period: float) -> Outcome:
    """Outcome of a run that does not repeat after one period."""
    single = period / problem.multiple
    for count in range(1, MULTIPLES + 1):
        if count % problem.multiple and changes_over(run, count * single).max() <= 1e-6:
            return Outcome(
                "other multiple",
                f"the run repeats after {count} periods of the forcing, not after "
                f"{problem.multiple}: use multiple={count}, or give a guess near an orbit of "
                f"{problem.multiple}.",
                False,
            )
    return Outcome(
        "not settled",
        f"the run does not repeat after {problem.multiple} periods of the forcing, within "
        f"{sum(TRANSIENT_PERIODS) * problem.multiple} periods: a slow transient, quasi-periodic or "
        "chaotic motion, or an unstable orbit; give a guess nearer to an orbit.",
        False,
    )


def changes_over(run: Trajectory, period: float) -> Array:
    """Changes of the states over the last period of a run, in units of their ranges."""
    until = run.span[1]
    since = max(until - period, run.span[0])
    lengths = periods_of(run.states, run.periods)
    states = np.vstack([run(np.array([since, until])).T, _starts_of(run, since)])
    return np.abs(apart(run(until), run(since), lengths)) / sizes_of(states, states)


def _counters(problem: OrbitProblem, run: Trajectory, period: float) -> str:
    """Names of the parameters that are assigned other values in the last period of a run."""
    last = run.span[1]
    gained = run(last) - run(max(last - period, run.span[0]))
    names = problem.variations.states
    return " and ".join(n for n in problem.model.assigned if gained[names.index(n)] != 0.0)


def _starts_of(run: Trajectory, since: float = -np.inf) -> Array:
    """States at the beginnings of the steps from a time on, and before jumps, shape (m, n)."""
    assert run.series is not None
    n, table = len(run.states), assignments_of(run)
    starts = run.series[run.steps[:, 0] >= since, :n, 0]
    return np.vstack([starts, table[table[:, 0] >= since, 2 : 2 + n]])


def _still(run: Trajectory) -> bool:
    """Check whether the last quarter of a run is constant."""
    states = np.vstack([_starts_of(run), run.end[1:]])
    starts = run.steps[:, 0]
    since = starts[min(3 * (len(starts) + 1) // 4, len(starts) - 1)]
    quarter = np.vstack([_starts_of(run, since), run.end[1:]])
    size = np.abs(states).max(axis=0)
    return bool((np.ptp(quarter, axis=0) <= 1e-7 * np.where(size > 0, size, 1.0)).all())


def _last_place(run: Trajectory) -> tuple[float, Array]:
    """Last time and state of a run, or those in the last step of a run that ends at a jump.

    The state just after a reset or an event is no state that a run passes, and the rate jumps at a
    switch.
    """
    last = run.span[1]
    tables = (run.reset_table, run.switch_table, run.event_table)
    if any(table is not None and len(table) and table[-1, 0] == last for table in tables):
        last = float(run.steps[-1, 0] + 0.5 * run.steps[-1, 1])
        return last, run(last)
    return last, run.end[1:]


def _first_return(run: Trajectory, hint: float | None, multiple: int) -> float | None:
    """Time since the last passage of the state at the end of a run, in its direction."""
    times, states = run.t, run.sampled_columns[: len(run.states)]
    last, state = _last_place(run)
    if last < times[-1]:
        kept = times < last
        times, states = np.append(times[kept], last), np.column_stack([states[:, kept], state])
    late = times >= 0.5 * (run.span[0] + run.span[1])
    return _return_time(run, times[late][::-1], states[:, late][:, ::-1], hint, multiple)


def _first_return_ahead(run: Trajectory, hint: float | None, multiple: int) -> float | None:
    """Time until the first return to the state at the beginning of a run."""
    return _return_time(run, run.t, run.sampled_columns[: len(run.states)], hint, multiple)


def _return_time(
    run: Trajectory, times: Array, states: Array, hint: float | None, multiple: int
) -> float | None:
    """Time from the first sample to the nearest return to its state.

    A return crosses the plane through the state normal to the flow, in the direction of the
    flow, close to the state.
    """
    # at a reset there are two samples
    kept = np.append(True, np.diff(times) != 0)
    times, states = times[kept], states[:, kept]
    if (assignments_of(run)[:, 0] == times[0]).any():
        # the return of a state on the way
        times, states = times[SAMPLES_AFTER_RESET:], states[:, SAMPLES_AFTER_RESET:]
    if len(times) < 8:
        return None
    size = np.ptp(states, axis=1)
    size = np.where(size > 0, size, 1.0)
    lengths = periods_of(run.states, run.periods)
    away = apart(states.T, states[:, 0], lengths).T / size[:, None]
    step = 1e-3 * (times[1] - times[0])
    rate = (run(times[0] + step) - states[:, 0]) / step / size
    height = rate @ away * np.sign(times[-1] - times[0])
    crossed = np.flatnonzero((height[:-1] < 0) & (height[1:] >= 0))
    if not len(crossed):
        return None
    share = height[crossed] / (height[crossed] - height[crossed + 1])
    at = times[crossed] + share * (times[crossed + 1] - times[crossed])
    gap = np.abs(away[:, crossed] + share * (away[:, crossed + 1] - away[:, crossed])).max(axis=0)
    lasting = np.abs(at - times[0])
    if hint is not None:
        return float(lasting[np.argmin(np.abs(lasting - hint))])
    close = np.flatnonzero(gap <= max(RETURN, 1.5 * float(gap.min())))
    if gap.min() > NEAR_GUESS:
        return None
    return float(lasting[close[0]]) * multiple
