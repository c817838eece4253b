"""Views: diagram, trajectory and overlay of a model at one set of values."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from fastslow.arguments import interval
from fastslow.diagrams.trace.tracing import continue_equilibria
from fastslow.errors import ArgumentError, FastSlowError, unknown_name
from fastslow.model.model import Model
from fastslow.passage.overlay.overlays import overlay as overlay_of
from fastslow.results.base.outcome import Outcome
from fastslow.results.branch.diagram import Diagram
from fastslow.results.overlay.overlay import Overlay
from fastslow.results.trajectory.trajectory import Trajectory
from fastslow.simulation.arguments import initial_state, start_values, time_span
from fastslow.simulation.one import simulate
from fastslow.simulation.settings import DEFAULT, Integration

R = TypeVar("R")
Range = tuple[float, float]

#: Margin of the range of a diagram, as a fraction of the range of its slow quantity.
DIAGRAM_MARGIN = 0.2

#: Duration of a run of a model without a period.
DEFAULT_DURATION = 100.0


@dataclass(frozen=True)
class Setup:
    """Settings by which the views of a model are computed.

    Parameters
    ----------
    parameter : str or None
        Continuation parameter of the diagram; None for a model without slow quantities and
        parameters.
    over : tuple of float or None
        Range of the diagram; None for that of the run with a margin.
    state : tuple of float
        Initial states, then slow states.
    t : tuple of float or None
    periods : float or None
        Length of the run; one of the two.
    integration : Integration
        Error control of the run.
    y : str
        State drawn over time and over the parameter.
    otherwise : tuple of float, optional
        Range of the diagram if there is no run.
    switches : tuple of (str, float)
        Given initial states of switches.
    """

    parameter: str | None
    over: Range | None
    state: tuple[float, ...]
    t: Range | None
    periods: float | None
    integration: Integration
    y: str
    otherwise: Range | None = None
    switches: tuple[tuple[str, float], ...] = ()

    def start(self, model: Model) -> dict[str, float]:
        """Return the initial state of a model by name."""
        names = (*model.states, *model.slow_states)
        return {**dict(zip(names, self.state, strict=True)), **dict(self.switches)}


@dataclass(frozen=True, eq=False)
class View:
    """Diagram, trajectory and overlay of a model at one set of values.

    Results that could not be computed are None; ``outcomes`` gives the reasons.

    Parameters
    ----------
    model : Model
    setup : Setup
    changes : mapping
        Parameters that differ from those of the given model.
    diagram : Diagram or None
    run : Trajectory or None
    overlay : Overlay or None
        None too if the diagram is not over a slow quantity, or the overlay was skipped.
    held : mapping
        Values at which further slow quantities are frozen in the diagram.
    outcomes : tuple of Outcome
        Outcomes of failed and of incomplete computations.
    """

    model: Model
    setup: Setup
    changes: Mapping[str, float]
    diagram: Diagram | None
    run: Trajectory | None
    overlay: Overlay | None
    held: Mapping[str, float]
    outcomes: tuple[Outcome, ...]

    def call(self) -> str:
        """Return Python source that reproduces the view of a model named ``model``.

        Examples
        --------
        >>> import fastslow as fs
        >>> gear = fs.systems.harmonic_gear()
        >>> view = view_of(gear, setup_of(gear, over=(-2, 6)), {"D": 0.3})
        >>> print(view.call())
        model = model.with_parameters({'D': 0.3})
        run = fs.simulate(model, {'x': 0.0, 'v': 0.0}, periods=2.0)
        diagram = fs.continue_equilibria(model.frozen(), 'w', over=(-2.0, 6.0))
        overlay = fs.overlay(diagram, run)
        fs.plot.panel(overlay, 'x')
        """
        setup = self.setup
        lines = []
        if self.changes:
            lines.append(f"model = model.with_parameters({dict(self.changes)!r})")
        length = f"t={setup.t!r}" if setup.t is not None else f"periods={setup.periods!r}"
        if self.run is not None:
            start = setup.start(self.model)
            given = (
                "" if setup.integration == DEFAULT else f", integration=fs.{setup.integration!r}"
            )
            lines.append(f"run = fs.simulate(model, {start!r}, {length}{given})")
        if self.diagram is not None:
            frozen = "model.frozen()"
            if self.held:
                frozen += f".with_parameters({dict(self.held)!r})"
            lines.append(
                f"diagram = fs.continue_equilibria({frozen}, {self.diagram.parameter!r}, "
                f"over={self.diagram.over!r})"
            )
        if self.overlay is not None:
            lines += ["overlay = fs.overlay(diagram, run)", f"fs.plot.panel(overlay, {setup.y!r})"]
        else:
            if self.diagram is not None:
                lines.append(f"fs.plot.diagram(diagram, {setup.y!r})")
            if self.run is not None:
                lines.append(f"fs.plot.time_series(run, {setup.y!r})")
        lines += [f"# {' '.join(str(outcome).split())}" for outcome in self.outcomes]
        return "\n".join(lines)


def setup_of(
    model: Model,
    *,
    parameter: object = None,
    over: Sequence[float] | None = None,
    state: Any = None,
    t: Sequence[float] | None = None,
    periods: float | None = None,
    integration: Integration = DEFAULT,
    y: object = None,
) -> Setup:
    """Validate the settings of views, and fill in defaults.

    Parameters are those of `fastslow.explore`.

    Raises
    ------
    UnknownNameError
        For a parameter or state that is not in the model.
    ArgumentError
        For an invalid range, initial state or time span.

    Examples
    --------
    >>> import fastslow as fs
    >>> setup_of(fs.systems.hindmarsh_rose()).parameter, setup_of(fs.systems.stick_slip()).over
    ('z', (0.0, 2.0))
    """
    slow = (*model.forcing, *model.slow_states)
    known = tuple(dict.fromkeys((*slow, *model.free, *model.parameters)))
    name = str(parameter) if parameter is not None else next(iter(known), None)
    if name is not None and name not in known:
        raise unknown_name("slow quantity or parameter", name, known)
    shown = model.states[0] if y is None else str(y)
    if shown not in model.states:
        raise unknown_name("state", shown, model.states)
    names = (*model.states, *model.slow_states)
    zero = dict.fromkeys((*names, *model.switches), 0.0)
    begin = start_values(model, zero if state is None else state)
    if t is None and periods is None:
        t, periods = ((0.0, DEFAULT_DURATION), None) if model.period() is None else (None, 2.0)
    time_span(t, periods, 0.0, None, model.period)
    limits = None if over is None else interval("over", over)
    if limits is None and name is not None and name not in slow:
        limits = around(dict(model.parameters).get(name, 0.0))
    return Setup(
        name,
        limits,
        tuple(begin[name] for name in names),
        None if t is None else (float(t[0]), float(t[1])),
        None if periods is None else float(periods),
        integration,
        shown,
        switches=tuple((name, begin[name]) for name in model.switches if name in begin),
    )


def view_of(
    model: Model,
    setup: Setup,
    changes: Mapping[str, float] | None = None,
    *,
    measured: bool = True,
) -> View:
    """Compute a view; failures are recorded as outcomes.

    Parameters
    ----------
    model : Model
        The model as given.
    setup : Setup
    changes : mapping, optional
        Changed parameters with their values.
    measured : bool
        Whether to compute the overlay, which takes longest.

    Returns
    -------
    View

    Raises
    ------
    UnknownNameError
        For a name that is not a parameter of the model.
    ModelError
        For a value that is not a finite number.
    """
    changes = dict(changes or {})
    here = model.with_parameters(changes) if changes else model
    failures: list[Outcome] = []
    run = _attempted(
        failures,
        "trajectory",
        lambda: simulate(
            here,
            setup.start(here),
            t=setup.t,
            periods=setup.periods,
            integration=setup.integration,
        ),
    )
    diagram, held = None, _held(here, setup, run)
    if setup.parameter is not None:
        diagram = _attempted(failures, "diagram", lambda: _diagram(here, setup, run, held))
    overlay = None
    slow = diagram is not None and diagram.parameter in _slow(here)
    if measured and slow and run is not None and diagram is not None:
        overlay = _attempted(failures, "overlay", lambda: overlay_of(diagram, run))
    reached = [result.outcome for result in (run, diagram, overlay) if result is not None]
    return View(
        here,
        setup,
        {name: float(value) for name, value in changes.items()},
        diagram,
        run,
        overlay,
        held,
        (*failures, *(outcome for outcome in reached if not outcome)),
    )


def around(value: float) -> Range:
    """Return a range around a value: from zero to twice the value, for zero from −1 to 1.

    Examples
    --------
    >>> around(0.25), around(-3.0), around(0.0)
    ((0.0, 0.5), (-6.0, 0.0), (-1.0, 1.0))
    """
    if value == 0:
        return -1.0, 1.0
    return (0.0, 2.0 * value) if value > 0 else (2.0 * value, 0.0)


def at_start(setup: Setup, model: Model, states: Mapping[str, float]) -> Setup:
    """Return the setup with other initial values of some states."""
    names = (*model.states, *model.slow_states)
    begin = {**dict(zip(names, setup.state, strict=True)), **states}
    return replace(setup, state=tuple(initial_state(model, begin).tolist()))


def _attempted(failures: list[Outcome], what: str, compute: Callable[[], R]) -> R | None:
    """Return a result, or None after recording why it failed."""
    try:
        return compute()
    except FastSlowError as error:
        failures.append(Outcome("not computed", f"no {what}: {error}", False))
        return None


def _slow(model: Model) -> tuple[str, ...]:
    return (*model.forcing, *model.slow_states)


def _held(model: Model, setup: Setup, run: Trajectory | None) -> dict[str, float]:
    """Return values of the other slow quantities, the middles of their ranges in the run."""
    others = [name for name in _slow(model) if name != setup.parameter]
    covered = {name: _covered(run, name) for name in others}
    return {name: 0.0 if c is None else 0.5 * (c[0] + c[1]) for name, c in covered.items()}


def _covered(run: Trajectory | None, name: str) -> Range | None:
    """Return the smallest and largest finite value of a column of a run."""
    values = np.empty(0) if run is None else run[name]
    values = values[np.isfinite(values)]
    return (float(values.min()), float(values.max())) if len(values) else None


def _diagram(
    model: Model, setup: Setup, run: Trajectory | None, held: Mapping[str, float]
) -> Diagram:
    assert setup.parameter is not None
    frozen = model.frozen()
    if held:
        frozen = frozen.with_parameters(held)
    over = setup.over
    if over is None:
        covered = _covered(run, setup.parameter)
        over = setup.otherwise if covered is None else widened(*covered)
    if over is None:
        raise ArgumentError(
            f"the range of {setup.parameter} is unknown without a trajectory; give it as over="
        )
    return continue_equilibria(frozen, setup.parameter, over)


def widened(low: float, high: float) -> Range:
    """Return a range with a margin, its ends rounded outwards.

    Examples
    --------
    >>> widened(-1.174, 5.918), widened(2.0, 2.0)
    ((-3.0, 8.0), (1.0, 3.0))
    """
    margin = DIAGRAM_MARGIN * (high - low) or 0.4 * max(abs(high), 1.0)
    unit = 10.0 ** math.floor(math.log10(high - low + 2.0 * margin))
    unit = unit if high - low + 2.0 * margin >= 5.0 * unit else 0.5 * unit
    ends = unit * math.floor((low - margin) / unit), unit * math.ceil((high + margin) / unit)
    # multiples of 0.1 are rounded in decimal: 23 of them give 2.3
    return float(f"{ends[0]:.12g}"), float(f"{ends[1]:.12g}")
