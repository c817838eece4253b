"""Runs of a bifurcation sweep at one parameter value, and passes over all values in order."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import FastSlowError
from fastslow.model.model import Model
from fastslow.results.base.outcome import Outcome, with_notes
from fastslow.results.trajectory.long_time.sweep import SweepPass
from fastslow.results.trajectory.trajectory import Trajectory
from fastslow.simulation.one import simulate
from fastslow.simulation.settings import Execution, Integration, Observation

Array = NDArray[np.float64]

#: States, slow states and switches by name.
Start = Mapping[str, float]


@dataclass(frozen=True)
class ValueSettings:
    """Settings of the runs at every value."""

    parameter: str
    column: int
    observe: Observation
    settle: int
    keep: int
    period: float | None
    integration: Integration
    execution: Execution

    def sampled(self, model: Model) -> bool:
        """Whether the recorded points are samples of a state once every period.

        Samples do not tell whether a state that is a factor of its rate left zero by rounding.
        """
        # at the instant of a kick a sample is the state before it
        kicks = any(reset.clock is not None for reset in model.resets.values())
        own = self.column < len(model.states) + len(model.slow_states)
        strobed = self.observe.what == "stroboscopic" and own
        zeros = model.traits.vanishing or model.traits.together
        return strobed and not (kicks or model.events or zeros)


class ValueRun(NamedTuple):
    """Recorded points, outcome, and the recorded run, None after a failure."""

    points: Array
    outcome: Outcome
    run: Trajectory | None


def pass_in_order(
    model: Model, values: Array, begin: Start, settings: ValueSettings, advance: Callable[[], Any]
) -> tuple[SweepPass, Start]:
    """Run all values, each from the last state; return the pass with the last successful state."""
    points: list[Array] = []
    names = (*model.states, *model.slow_states)
    ends = np.full((len(values), len(names)), np.nan)
    outcomes = []
    at = strobed_at if settings.sampled(model) else run_at
    for row, value in enumerate(values):
        found = at(model, float(value), begin, settings)
        points.append(found.points)
        outcomes.append(found.outcome)
        if found.run is not None:
            begin = found.run.final_state
            ends[row] = [begin[name] for name in names]
        advance()
    return pass_of(values, points, ends, outcomes), begin


def pass_of(
    values: Array,
    points: Sequence[Array],
    ends: Array,
    outcomes: Sequence[Outcome],
    irregular: NDArray[np.bool_] | None = None,
) -> SweepPass:
    """Return a pass from the points at each value, and one row of the others for each value."""
    counts = np.array([len(p) for p in points], dtype=np.intp)
    return SweepPass(
        1 if len(values) < 2 or values[1] > values[0] else -1,
        values,
        counts,
        np.repeat(values, counts),
        np.concatenate(points),
        ends,
        tuple(outcomes),
        irregular,
    )


def run_at(model: Model, value: float, begin: Start, settings: ValueSettings) -> ValueRun:
    """Run the transient and the recorded periods at one value."""
    try:
        here = model.with_parameters({settings.parameter: value})
        first = 0.0
        notes: tuple[str, ...] = ()
        if settings.settle:
            settled = simulate(
                here,
                begin,
                periods=settings.settle,
                period=settings.period,
                dense=False,
                integration=settings.integration,
            )
            if not settled.outcome:
                return ValueRun(np.empty(0), settled.outcome, None)
            begin, first = settled.final_state, settled.span[1]
            notes = settled.outcome.notes
        return recorded_run(here, begin, first, settings, notes)
    except FastSlowError as error:
        return ValueRun(np.empty(0), Outcome("error", str(error), False), None)


def strobed_at(model: Model, value: float, begin: Start, settings: ValueSettings) -> ValueRun:
    """Run the transient and the recorded periods at one value, as one run with samples."""
    try:
        here = model.with_parameters({settings.parameter: value})
        period = settings.period or here.period()
        assert period is not None
        first = settings.settle + settings.observe.phase
        times: Array = period * np.arange(first, first + settings.keep - 0.5)
        run = simulate(
            here,
            begin,
            periods=settings.settle + settings.keep,
            period=period,
            samples=times,
            dense=False,
            integration=settings.integration,
        )
    except FastSlowError as error:
        return ValueRun(np.empty(0), Outcome("error", str(error), False), None)
    if not run.outcome or run.outcome.notes:
        # the reason, and what noise decides, are those of a run that is recorded whole
        return run_at(model, value, begin, settings)
    return ValueRun(run[run.columns[settings.column]], run.outcome, run)


def recorded_run(
    here: Model, begin: Start, first: float, settings: ValueSettings, notes: tuple[str, ...] = ()
) -> ValueRun:
    """Run the recorded periods at one value, after a transient with some notes."""
    run = simulate(
        here,
        begin,
        periods=settings.keep,
        t0=first,
        period=settings.period,
        integration=settings.integration,
    )
    outcome = with_notes(run.outcome, notes)
    if not outcome:
        return ValueRun(np.empty(0), outcome, None)
    return ValueRun(recorded_points(run, settings), outcome, run)


def recorded_points(run: Trajectory, settings: ValueSettings) -> Array:
    """Recorded points of a settled run."""
    name = run.columns[settings.column]
    assert run.period is not None
    observe = settings.observe
    if observe.what == "section":
        level, direction = observe.level, observe.direction
        return run.section(observe.section, level=level, direction=direction)[name]
    if observe.what == "stroboscopic":
        # the end of the last period belongs to the next value
        return run.stroboscopic(phase=observe.phase)[name][: settings.keep]
    return extremes_of(run, name, settings.keep).reshape(-1)


def extremes_of(run: Trajectory, name: str, keep: int) -> Array:
    """Smallest and largest value of a column in every period, shape (keep, 2)."""
    edges = np.linspace(*run.span, keep + 1)
    return np.array([run.extremes(name, since=a, until=b) for a, b in pairwise(edges.tolist())])
