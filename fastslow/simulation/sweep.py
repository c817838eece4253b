"""Bifurcation diagrams by simulation: a parameter swept up and down from the last state."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from tqdm import tqdm

from fastslow.arguments import (
    among,
    finite,
    finite_numbers,
    flag,
    formula,
    instance,
    positive,
    text,
    validated,
    whole,
)
from fastslow.errors import ArgumentError, FastSlowError, unknown_name
from fastslow.model.model import Model
from fastslow.results.base.outcome import Outcome, with_notes
from fastslow.results.trajectory.sweep import BifurcationSweep, SweepPass
from fastslow.results.trajectory.trajectory import Trajectory
from fastslow.simulation.arguments import initial_state
from fastslow.simulation.one import simulate
from fastslow.simulation.settings import DEFAULT, Integration, integration_settings, resolve

Array = NDArray[np.float64]

What = Literal["stroboscopic", "extremes", "section"]
KINDS = ("stroboscopic", "extremes", "section")


@validated(
    model=instance(Model),
    parameter=formula,
    column=formula,
    settle=whole(0, 10**9),
    keep=whole(1, 10**9),
    what=text,
    phase=finite,
    section=formula,
    level=finite,
    direction=among(-1, 0, 1, None),
    back=flag,
    integration=integration_settings,
    period=positive,
    progress=flag,
)
def bifurcation_sweep(
    model: Model,
    parameter: object,
    over: ArrayLike,
    state: Sequence[float] | Mapping[Any, float] | NDArray[np.float64],
    *,
    column: object = None,
    settle: int = 200,
    keep: int = 32,
    what: What = "stroboscopic",
    phase: float = 0.0,
    section: object = None,
    level: float = 0.0,
    direction: int | None = 1,
    period: float | None = None,
    back: bool = True,
    integration: Integration = DEFAULT,
    progress: bool = False,
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
    what : {"stroboscopic", "extremes", "section"}
        Record the column once every period, its minimum and maximum in every
        period, or its values on a Poincaré section.
    phase : float
        For stroboscopic points: phase of the period, 0 to 1.
    section : str or Expr
        For a Poincaré section: the expression, see `Trajectory.section`. The rate of a state
        with direction −1 gives its maxima.
    level, direction
        Level of the section, and direction of crossing (None for both).
    period : float, optional
        By default that of the forcing at each value. Required without forcing, as the unit
        of time of ``settle`` and ``keep``.
    back : bool
        Whether to sweep back as well.
    integration : Integration
        Error control and limits of the runs.
    progress : bool
        Whether to show a progress bar.

    Returns
    -------
    BifurcationSweep
        A value whose run fails has no points, and its outcome gives the reason; the next
        value continues from the last successful state.

    Raises
    ------
    UnknownNameError
        For an unknown parameter, state, column or kind.
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
    columns = (*model.states, *model.slow_states, *model.forcing)
    name = columns[0] if column is None else str(column)
    if name not in columns:
        raise unknown_name("column", name, columns)
    settings = _Settings(
        str(parameter),
        columns.index(name),
        what,
        settle,
        keep,
        phase,
        section,
        level,
        direction,
        period,
        integration,
    )
    begin = initial_state(model, state)
    rule = _rule(settings, name)
    _try_first(model, order[0], begin, settings)
    turns = [order, order[::-1]] if back else [order]
    passes: list[SweepPass] = []
    with tqdm(total=sum(map(len, turns)), unit="value", disable=not progress) as bar:
        for turn in turns:
            passes.append(_one_pass(model, turn, begin, settings, bar.update))
            finished = passes[-1].ends[np.isfinite(passes[-1].ends).all(axis=1)]
            begin = finished[-1] if len(finished) else begin
    others = {n: v for n, v in model.parameters.items() if n != settings.parameter}
    runs = resolve(integration, model, implicit=True).recorded()
    kept = {"settle": settings.settle, "keep": settings.keep, **runs}
    return BifurcationSweep(
        settings.parameter, name, what, rule, tuple(passes), others, model.equations, kept
    )


@dataclass(frozen=True)
class _Settings:
    """Settings of the runs at every value."""

    parameter: str
    column: int
    what: str
    settle: int
    keep: int
    phase: float
    section: object
    level: float
    direction: int | None
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


def _rule(settings: _Settings, name: str) -> str:
    """Describe the recorded points; raise for invalid combinations."""
    if settings.what not in KINDS:
        raise unknown_name("kind of point", settings.what, KINDS)
    if (settings.section is not None) != (settings.what == "section"):
        raise ArgumentError(
            'section= goes with what="section", and what="section" needs it: the expression of '
            "the Poincaré section"
        )
    if not 0.0 <= settings.phase <= 1.0:
        raise ArgumentError(f"phase = {settings.phase:g}; expected a fraction of a period, 0 to 1")
    if settings.what == "section":
        way = {1: " upwards", -1: " downwards", 0: " touching", None: ""}
        passed = f"{settings.section} = {settings.level:g}{way[settings.direction]}"
        return f"{name} where {passed}"
    if settings.what == "extremes":
        return f"minimum and maximum of {name} in every period"
    return f"{name} once every period" + (f" at {settings.phase:g} of it" * (settings.phase > 0))


def _try_first(model: Model, value: float, begin: Array, settings: _Settings) -> None:
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
    model: Model, values: Array, begin: Array, settings: _Settings, advance: Callable[[], Any]
) -> SweepPass:
    points: list[Array] = []
    ends = np.full((len(values), len(begin)), np.nan)
    outcomes = []
    for row, value in enumerate(values):
        found, outcome, end = _at_value(model, float(value), begin, settings)
        points.append(found)
        outcomes.append(outcome)
        if end is not None:
            begin = ends[row] = end
        advance()
    counts = np.array([len(p) for p in points], dtype=np.intp)
    return SweepPass(
        1 if len(values) < 2 or values[1] > values[0] else -1,
        values,
        counts,
        np.repeat(values, counts),
        np.concatenate(points),
        ends,
        tuple(outcomes),
    )


def _at_value(
    model: Model, value: float, begin: Array, settings: _Settings
) -> tuple[Array, Outcome, Array | None]:
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
            begin, first = settled.end[1:], settled.span[1]
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
        return _points(run, settings), outcome, run.end[1:]
    except FastSlowError as error:
        return nothing, Outcome("error", str(error), False), None


def _points(run: Trajectory, settings: _Settings) -> Array:
    """Recorded points of a settled run."""
    name = run.columns[settings.column]
    assert run.period is not None
    if settings.what == "section":
        level, direction = settings.level, settings.direction
        return run.section(settings.section, level=level, direction=direction)[name]
    if settings.what == "stroboscopic":
        # the end of the last period belongs to the next value
        return run.stroboscopic(phase=settings.phase * run.period)[name][: settings.keep]
    edges = np.linspace(*run.span, settings.keep + 1)
    pairs = [run.extremes(name, *pair) for pair in pairwise(edges.tolist())]
    return np.array(pairs).reshape(-1)
