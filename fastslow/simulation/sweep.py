"""Bifurcation diagrams by simulation: a parameter swept up and down from the last state."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastslow.arguments import (
    Name,
    StateLike,
    finite_numbers,
    flag,
    formula,
    instance,
    positive,
    validated,
    whole,
)
from fastslow.errors import ArgumentError, FastSlowError, unknown_name
from fastslow.model.model import Model
from fastslow.results.base.outcome import Outcome, with_notes
from fastslow.results.trajectory.sweep import BifurcationSweep, SweepPass
from fastslow.results.trajectory.trajectory import Trajectory
from fastslow.simulation.arguments import start_values
from fastslow.simulation.one import simulate
from fastslow.simulation.settings import (
    DEFAULT,
    EXECUTION,
    STROBOSCOPIC,
    Execution,
    Integration,
    Observation,
    integration_settings,
    observation,
    progress_bar,
    resolve,
    thread_settings,
)

Array = NDArray[np.float64]


@validated(
    model=instance(Model),
    parameter=formula,
    column=formula,
    settle=whole(0, 10**9),
    keep=whole(1, 10**9),
    observe=observation,
    back=flag,
    integration=integration_settings,
    period=positive,
    execution=thread_settings,
)
def bifurcation_sweep(
    model: Model,
    parameter: Name,
    over: ArrayLike,
    state: StateLike,
    *,
    column: Name | None = None,
    settle: int = 200,
    keep: int = 32,
    observe: Observation = STROBOSCOPIC,
    period: float | None = None,
    back: bool = True,
    integration: Integration = DEFAULT,
    execution: Execution = EXECUTION,
) -> BifurcationSweep:
    """Compute a brute-force bifurcation diagram: the attractor at each parameter value.

    Every run starts from the final state of the previous one, so that an attractor is
    followed until it disappears; sweeping back reveals hysteresis and coexisting
    attractors. The equations are compiled once.

    Parameters
    ----------
    model : Model
    parameter : str or Symbol
        A parameter, or the slow quantity of a frozen model.
    over : array_like, shape (m,)
        Values of the parameter, increasing or decreasing; the first pass takes them in this
        order.
    state : sequence of float, shape (n,), or mapping
        Initial states of the first run.
    column : str or Symbol, optional
        Recorded column, by default the first state.
    settle, keep : int
        Numbers of periods discarded and recorded at each value.
    observe : Observation
        Recorded points, by default one in every period.
    period : float, optional
        By default that of the forcing at each value. Required without forcing, as the unit
        of time of ``settle`` and ``keep``.
    back : bool
        Whether to sweep back as well.
    integration : Integration
        Error control and limits of the runs.
    execution : Execution
        Progress bar; every run starts from the last one, so that all take one thread.

    Returns
    -------
    BifurcationSweep
        A value whose run fails has no points, and its outcome gives the reason; the next
        value continues from the last successful state.

    Raises
    ------
    UnknownNameError
        For an unknown parameter, state or column.
    ArgumentError
        For values that are not monotone, an invalid initial state, or a missing period.

    Examples
    --------
    >>> import sympy as sp
    >>> x, c, t = sp.symbols("x c t")
    >>> model = Model({x: c * sp.cos(t) - x}, parameters={c: 1})
    >>> swept = bifurcation_sweep(model, "c", [1, 2], [0], settle=5, keep=1, back=False)
    >>> swept.x.round(9)
    array([0.5, 1. ])
    """
    known = dict.fromkeys([*model.parameters, *model.free])
    if str(parameter) not in known:
        raise unknown_name("parameter", parameter, known)
    order = _values(over)
    columns = (*model.states, *model.slow_states, *model.forcing, *model.switches)
    name = columns[0] if column is None else str(column)
    if name not in columns:
        raise unknown_name("column", name, columns)
    settings = _Settings(
        str(parameter),
        columns.index(name),
        observe,
        settle,
        keep,
        period,
        integration,
    )
    begin: Start = start_values(model, state)
    rule = _rule(observe, name)
    _try_first(model, order[0], begin, settings)
    turns = [order, order[::-1]] if back else [order]
    passes: list[SweepPass] = []
    with progress_bar(execution, "value", sum(map(len, turns))) as bar:
        for turn in turns:
            one, begin = _one_pass(model, turn, begin, settings, bar.update)
            passes.append(one)
    others = {n: v for n, v in model.parameters.items() if n != settings.parameter}
    runs = resolve(integration, model, implicit=True).recorded()
    kept = {"settle": settings.settle, "keep": settings.keep, **runs}
    return BifurcationSweep(
        settings.parameter, name, observe.what, rule, tuple(passes), others, model.equations, kept
    )


#: States, slow states and switches by name.
Start = Mapping[str, float]


@dataclass(frozen=True)
class _Settings:
    """Settings of the runs at every value."""

    parameter: str
    column: int
    observe: Observation
    settle: int
    keep: int
    period: float | None
    integration: Integration


def _values(over: ArrayLike) -> Array:
    order = finite_numbers("over", over)
    if order.ndim != 1 or not len(order):
        raise ArgumentError(
            f"over has shape {order.shape}; expected a non-empty one-dimensional array"
        )
    change = np.diff(order)
    if not ((change > 0).all() or (change < 0).all()):
        raise ArgumentError("over: expected strictly increasing or strictly decreasing numbers")
    return order


def _rule(observe: Observation, name: str) -> str:
    """Describe the recorded points."""
    if observe.what == "section":
        way = {1: " upwards", -1: " downwards", 0: " touching", None: ""}
        passed = f"{observe.section} = {observe.level:g}{way[observe.direction]}"
        return f"{name} where {passed}"
    if observe.what == "extremes":
        return f"minimum and maximum of {name} in every period"
    return f"{name} once every period" + (f" at {observe.phase:g} of it" * (observe.phase > 0))


def _try_first(model: Model, value: float, begin: Start, settings: _Settings) -> None:
    """Check the arguments by a short run at the first value."""
    here = model.with_parameters({settings.parameter: value})
    if settings.period is None and here.period() is None:
        raise ArgumentError(
            f"nothing in this model has a common period at {settings.parameter} = {value:g}; give "
            "the unit of time of settle= and keep= as period="
        )
    run = simulate(
        here,
        begin,
        periods=1,
        period=settings.period,
        integration=replace(settings.integration, max_steps=1),
    )
    if len(run.steps):
        _points(run, settings)


def _one_pass(
    model: Model, values: Array, begin: Start, settings: _Settings, advance: Callable[[], Any]
) -> tuple[SweepPass, Start]:
    """Run all values; return the pass with the last successful state."""
    points: list[Array] = []
    names = (*model.states, *model.slow_states)
    ends = np.full((len(values), len(names)), np.nan)
    outcomes = []
    for row, value in enumerate(values):
        found, outcome, end = _at_value(model, float(value), begin, settings)
        points.append(found)
        outcomes.append(outcome)
        if end is not None:
            begin, ends[row] = end, [end[name] for name in names]
        advance()
    counts = np.array([len(p) for p in points], dtype=np.intp)
    one = SweepPass(
        1 if len(values) < 2 or values[1] > values[0] else -1,
        values,
        counts,
        np.repeat(values, counts),
        np.concatenate(points),
        ends,
        tuple(outcomes),
    )
    return one, begin


def _at_value(
    model: Model, value: float, begin: Start, settings: _Settings
) -> tuple[Array, Outcome, Start | None]:
    """Points, outcome and last state (None after a failure) at one value."""
    nothing = np.empty(0)
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
                return nothing, settled.outcome, None
            begin, first = settled.final_state, settled.span[1]
            notes = settled.outcome.notes
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
            return nothing, outcome, None
        return _points(run, settings), outcome, run.final_state
    except FastSlowError as error:
        return nothing, Outcome("error", str(error), False), None


def _points(run: Trajectory, settings: _Settings) -> Array:
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
    edges = np.linspace(*run.span, settings.keep + 1)
    pairs = [run.extremes(name, since=a, until=b) for a, b in pairwise(edges.tolist())]
    return np.array(pairs).reshape(-1)
