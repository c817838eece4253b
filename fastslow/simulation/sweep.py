"""Bifurcation diagrams by simulation: a parameter swept up and down from the last state."""

from __future__ import annotations

from dataclasses import replace

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
from fastslow.errors import ArgumentError, unknown_name
from fastslow.model.events import refuse_memory
from fastslow.model.model import Model
from fastslow.results.trajectory.long_time.sweep import BifurcationSweep, SweepPass
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
from fastslow.simulation.strips import pass_in_strips
from fastslow.simulation.sweep_runs import Start, ValueSettings, pass_in_order, recorded_points

Array = NDArray[np.float64]


@validated(
    model=instance(Model),
    parameter=formula,
    settle=whole(0, 10**9),
    keep=whole(1, 10**9),
    observe=observation,
    back=flag,
    strips=whole(1, 10**9),
    integration=integration_settings,
    period=positive,
    execution=thread_settings,
)
def bifurcation_sweep(
    model: Model,
    parameter: Name,
    values: ArrayLike,
    state: StateLike,
    *,
    settle: int = 200,
    keep: int = 32,
    observe: Observation = STROBOSCOPIC,
    period: float | None = None,
    back: bool = True,
    strips: int = 1,
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
    values : array_like, shape (m,)
        Values of the parameter, increasing or decreasing; the first pass takes them in this
        order.
    state : sequence of float, shape (n,), or mapping
        Initial states of the first run.
    settle, keep : int
        Numbers of periods discarded and recorded at each value.
    observe : Observation
        Recorded column and points, by default the first state once in every period.
    period : float, optional
        By default that of the forcing at each value. Required without forcing, as the unit
        of time of ``settle`` and ``keep``.
    back : bool
        Whether to sweep back as well.
    strips : int
        Number of strips of consecutive values that run at once, as an ensemble from the same
        initial state. A strip that does not begin with the final state of the previous one runs
        again from there, until both runs agree at a value: in the state to 1e-10, in the periodic
        orbit up to its phase, or, for chaotic motion, in its range. Eight strips per thread fill
        its SIMD lanes.
    integration : Integration
        Error control and limits of the runs.
    execution : Execution
        Progress bar, and number of threads for strips; without strips every run starts from
        the last one, and all take one thread.

    Returns
    -------
    BifurcationSweep
        A value whose run fails has no points, and its outcome gives the reason; the next
        value continues from the last successful state. With strips, values at which the motion
        does not repeat are ``irregular``: chaotic motion there is that of another initial state.

    Raises
    ------
    UnknownNameError
        For an unknown parameter, state or column.
    ArgumentError
        For values that are not monotone, more strips than values, an invalid initial state, or
        a missing period.

    See Also
    --------
    fastslow.plot.sweep, fastslow.simulate_many, fastslow.continue_orbits

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
    refuse_memory(model.structure.events, model.assigned, "bifurcation_sweep")
    order = _values(values)
    if strips > len(order):
        raise ArgumentError(
            f"strips = {strips} of {len(order)} values; expected an integer from 1 to {len(order)}"
        )
    columns = (*model.states, *model.slow_states, *model.forcing, *model.switches)
    name = columns[0] if observe.column is None else str(observe.column)
    if name not in columns:
        raise unknown_name("column", name, columns)
    settings = ValueSettings(
        str(parameter),
        columns.index(name),
        observe,
        settle,
        keep,
        period,
        integration,
        execution,
    )
    begin: Start = start_values(model, state)
    rule = _rule(observe, name)
    _try_first(model, order[0], begin, settings)
    turns = [order, order[::-1]] if back else [order]
    passes: list[SweepPass] = []
    with progress_bar(execution, "value", sum(map(len, turns))) as bar:
        for turn in turns:
            if strips == 1:
                one, begin = pass_in_order(model, turn, begin, settings, bar.update)
            else:
                one, begin = pass_in_strips(model, turn, begin, settings, strips, bar.update)
            passes.append(one)
    others = {n: v for n, v in model.parameters.items() if n != settings.parameter}
    runs = resolve(integration, model, implicit=True).recorded()
    kept = {"settle": settle, "keep": keep, "strips": strips, **runs}
    return BifurcationSweep(
        settings.parameter, name, observe.what, rule, tuple(passes), others, model.equations, kept
    )


def _values(given: ArrayLike) -> Array:
    order = finite_numbers("values", given)
    if order.ndim != 1 or not len(order):
        raise ArgumentError(
            f"values has shape {order.shape}; expected a non-empty one-dimensional array"
        )
    change = np.diff(order)
    if not ((change > 0).all() or (change < 0).all()):
        raise ArgumentError("values: expected strictly increasing or strictly decreasing numbers")
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


def _try_first(model: Model, value: float, begin: Start, settings: ValueSettings) -> None:
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
        recorded_points(run, settings)
