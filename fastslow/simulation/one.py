"""Simulation of one trajectory of a model, with event location."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import Condition, StateLike, finite, flag, positive, validated
from fastslow.errors import ArgumentError
from fastslow.formulas.definitions import definitions_of, with_definitions
from fastslow.kernels.taylor.series import CompiledSeries
from fastslow.results.base.immutable import fixed, read_only
from fastslow.results.base.outcome import Outcome, with_notes
from fastslow.results.trajectory.endings import outcome_of
from fastslow.results.trajectory.events.jumps import tables_of_kinds
from fastslow.results.trajectory.trajectory import Trajectory
from fastslow.simulation.arguments import (
    Simulated,
    initial_state,
    initial_switches,
    is_backwards,
    no_switch_state,
    require_tables,
    sample_times,
    simulated,
    time_span,
)
from fastslow.simulation.backwards import (
    crossings_in_order,
    steps_in_order,
)
from fastslow.simulation.crossing_notes import note_on_frequent_crossings
from fastslow.simulation.noise_notes import with_noise
from fastslow.simulation.prepared_runs import (
    Prepared,
    RunArrays,
    constants_of,
    prepared_run,
    run_arrays,
)
from fastslow.simulation.rate_rounding import notes_on_cancelled_terms
from fastslow.simulation.settings import (
    DEFAULT,
    Integration,
    integration_settings,
)
from fastslow.simulation.stepper.implicit import IMPLICIT, RADAU, SETTLED_ORDER
from fastslow.simulation.stepper.phases import (
    ACCUMULATION,
    ENDLESS_EVENTS,
    NO_SWITCH_STATE,
)
from fastslow.simulation.stepper.radau import RADAU_ORDER
from fastslow.simulation.stopping import Stop, read_stops, stops
from fastslow.simulation.touch_notes import notes_on_touches


@validated(
    model=simulated,
    t0=finite,
    period=positive,
    integration=integration_settings,
    dense=flag,
    stop=stops,
)
def simulate(
    model: Simulated,
    state: StateLike,
    *,
    t: tuple[float, float] | None = None,
    periods: float | None = None,
    t0: float = 0.0,
    period: float | None = None,
    integration: Integration = DEFAULT,
    samples: int | Sequence[float] | NDArray[np.float64] | None = None,
    dense: bool = True,
    stop: Condition | Sequence[Condition] = (),
) -> Trajectory:
    """Simulate one trajectory and locate every crossing of a switching manifold.

    The Taylor method (Jorba and Zou 2005) is used; crossings are the roots of the switching
    functions along the series of a step, so that two crossings within one step are both
    located. Functions without a Taylor recurrence (gamma, Bessel functions, …), and points
    where the series is singular but the rates are not, are treated by collocation.

    Parameters
    ----------
    model : Model or StoredModel
        With forcing, with slow states, or frozen with all parameters given. The model of a
        loaded run is a stored one, which does not need SymPy.
    state : sequence of float, shape (n,), or mapping
        Initial states and slow states, in order or by name. By name it may contain switches, 0
        or 1, which is required where no relation of a switch is true.
    t : (float, float)
        Start and end of time. With an end before the start the run is integrated backwards; it
        is returned in the order of time, from the time reached to the start. Where a backward
        motion is not unique, as at an interface that slides, it ends with the time reached.
    periods : float
        Instead of ``t``: length of the run in periods of the forcing.
    t0 : float
        Start of time with ``periods``.
    period : float, optional
        Period, by default that of the forcing.
    integration : Integration
        Error control, order and method of the steps, and limits of the run.
    samples : int or sequence of float, optional
        Number of evenly spaced samples, or their times. By default plots use the dense
        output of the steps.
    dense : bool
        Whether to store the series, for evaluation at any time, of at most 1 GiB; a run with a
        longer series ends with the outcome ``"out of memory"``. Without it memory grows by at
        most 24 bytes per step, and notes on states that leave zero by rounding are based on
        the samples and the final state.
    stop : str or Expr, or sequence of them
        Events that end the run before the end of time, in states, slow quantities, parameters
        and t. An inequality, such as ``x >= 2``, ends it when it becomes true, as for resets:
        one that is true at the start has to become false first. Any other expression ends it
        at a zero after the start. A jump of the state is an event too, where it makes an
        inequality true or changes the sign of an expression. Events are located to rounding
        on the dense output, and ``outcome`` names the one that happened. What happens at the
        same time, a crossing or a reset, is included. The steps are those of a run without
        events.

    Returns
    -------
    Trajectory
        Also if the run ended early; ``outcome`` gives the reason.

    Raises
    ------
    ArgumentError
        For an invalid initial state, one beyond the wall of a reset or without the value of a
        switch between its relations, an invalid time span or sample times, a frozen model with
        free parameters, or ``periods`` without a common period.
    UnknownNameError
        For an unknown state.
    ModelError
        For a function without compiled code, or a run backwards of a model with resets or
        switches.

    See Also
    --------
    fastslow.simulate_many, fastslow.overlay, fastslow.plot.time_series,
    fastslow.plot.phase_portrait

    Examples
    --------
    >>> import sympy as sp, fastslow as fs
    >>> x, v = sp.symbols("x v")
    >>> oscillator = fs.Model({x: v, v: -x})
    >>> fine = Integration(rtol=1e-12)
    >>> run = simulate(oscillator, [1, 0], t=(0, 2 * sp.pi), integration=fine)
    >>> run(sp.pi).round(10) + 0.0
    array([-1.,  0.])
    >>> simulate(oscillator, [1, 0], t=(0, 9), stop=["v"]).outcome
    Outcome(code='stopped', message='stopped at t = 3.141592654, where v reached zero.', \
success=True, notes=())
    >>> simulate(oscillator, [1, 0], t=(0, -9), integration=fine).span
    (-9.0, 0.0)
    """
    prepared = prepared_run(model, integration, backwards=is_backwards(t))
    begin = initial_state(model, state)
    span, period = time_span(t, periods, t0, period, lambda: prepared.period, backwards=True)
    low, high = sorted(span)
    forwards = prepared.direction > 0
    require_tables((prepared.compiled if forwards else model.operations).tables, low, high)
    times = None if samples is None else sample_times(samples, (low, high))
    run = integrated(
        prepared,
        begin,
        span,
        period,
        times,
        initial_switches(model, state),
        dense=dense,
        stops=_stops(prepared, model, stop) if stop else (),
        n_periods=periods,
    )
    if run.outcome.code == "beyond a wall" and not len(run.steps) and not len(run.resets):
        raise ArgumentError(f"the initial state is beyond a wall: {run.outcome}")
    return run


def _stops(prepared: Prepared, model: Simulated, given: Sequence[Condition]) -> tuple[Stop, ...]:
    """Read the events that end a run."""
    named = definitions_of(model)
    return read_stops(
        [with_definitions(one, named) for one in given],
        prepared.columns,
        constants_of(model),
    )


def integrated(
    prepared: Prepared,
    begin: NDArray[np.float64],
    span: tuple[float, float],
    period: float | None = None,
    samples: NDArray[np.float64] | None = None,
    switches: NDArray[np.float64] | None = None,
    *,
    dense: bool = True,
    stops: tuple[Stop, ...] = (),
    n_periods: float | None = None,
) -> Trajectory:
    """Integrate a prepared run from a validated state over a time span; see `simulate`.

    ``switches`` are their given states, NaN for none.
    """
    compiled = prepared.compiled
    times = np.empty(0) if samples is None else samples
    backwards = prepared.direction < 0
    if backwards:
        # in reversed time
        span, times = (0.0 - span[0], 0.0 - span[1]), 0.0 - times[::-1]
    start = prepared.run(begin, span, switches=switches)
    found = run_arrays(prepared, start, times, dense=dense, stops=stops)
    steps, crossings, series, sampled = found.steps, found.crossings, found.series, found.sampled
    if found.code == NO_SWITCH_STATE:
        raise ArgumentError(no_switch_state(found.wall))
    end = read_only(found.place[: 1 + compiled.n_states].copy())
    last = end.copy()
    last[0] = prepared.direction * end[0] + 0.0
    reached = sampled.shape[1]
    if reached < len(times):
        times = times[:reached].copy()
    outcome = _outcome(prepared, found, (span[0], begin), last, times)
    if notes := notes_on_cancelled_terms(prepared, found, start.parameters):
        outcome = with_notes(outcome, notes)
    if notes := notes_on_touches(prepared, found, start.parameters):
        outcome = with_notes(outcome, notes)
    whole_span = (span[0], float(end[0]))
    if backwards:
        steps, series = steps_in_order(steps, series, end[0])
        steps, series = read_only(steps), read_only(series)
        crossings = read_only(crossings_in_order(crossings))
        times, sampled = 0.0 - times[::-1], sampled[:, ::-1].copy()
        whole_span, end = (
            (float(last[0]), 0.0 - span[0]),
            read_only(np.append(0.0 - span[0], begin)),
        )
    return Trajectory.of_fixed(
        prepared.shared | _own_modes(found),
        period=period,
        outcome=outcome,
        span=whole_span,
        end=end,
        method=_method(compiled, steps),
        steps=steps,
        crossing_table=crossings,
        **_events(compiled, found.resets, found.place),
        series=series,
        sampled=read_only((times, sampled)) if samples is not None else None,
        n_periods=n_periods if end[0] == span[1] else None,
        backwards=backwards,
        earliest=read_only(last[1:]) if backwards else None,
    )


def _own_modes(found: RunArrays) -> dict[str, Any]:
    """Modes and regions of a run that forms them, as fields of a `Trajectory`."""
    if not found.modes:
        return {}
    regions = tuple(name for name in found.modes if "|" not in name)
    return {"modes": fixed("modes", found.modes), "regions": fixed("regions", regions)}


def _outcome(
    prepared: Prepared,
    found: RunArrays,
    start: tuple[float, NDArray[np.float64]],
    last: NDArray[np.float64],
    samples: NDArray[np.float64],
) -> Outcome:
    """Return the outcome of a run, with notes on its crossings and on states that left zero.

    Parameters
    ----------
    prepared : Prepared
    found : RunArrays
    start : (float, ndarray)
        Time, in the direction of the run, and state of the beginning.
    last : ndarray
        Time and state reached.
    samples : ndarray
        Times of the samples, in the direction of the run.
    """
    compiled, steps, (since, begin) = prepared.compiled, found.steps, start
    outcome = outcome_of(
        found.code,
        found.mode,
        last,
        len(steps),
        begin,
        modes=found.modes or compiled.modes,
        limits=prepared.resolved.limits,
        undecided=compiled.undecided,
        wall=found.wall or _last_events(compiled, found),
        backwards=prepared.direction < 0,
    )
    if found.stop is not None:
        outcome = found.stop.happened(float(last[0]))
    if outcome.code in ("too many steps", "too many crossings"):
        outcome = with_notes(outcome, note_on_frequent_crossings(found.crossings[:, 0], last))
    if not (prepared.vanishing or prepared.together):
        return outcome
    kept = compiled.n_states + compiled.n_forcing
    if found.series is not None:
        table, known = steps, found.series[:, :, 0]
    else:
        # available values: the beginning, the samples and the end
        times = np.append(since, samples)
        table = np.zeros((len(times), 4))
        table[:, 0], table[:, 2] = times, found.mode
        known = np.full((len(times), kept), np.nan)
        known[0, : compiled.n_states], known[1:] = begin, found.sampled.T
    ends = np.vstack([known, found.place[1 : 1 + kept]])
    return with_noise(
        outcome,
        prepared.model,
        prepared.resolved,
        vanishing=prepared.vanishing,
        together=prepared.together,
        steps=np.vstack([table, [found.place[0], 0.0, found.mode, 0.0]]),
        columns=dict(zip(prepared.columns, ends.T, strict=True)),
        modes=compiled.modes,
        direction=prepared.direction,
    )


def _last_events(compiled: CompiledSeries, found: RunArrays) -> str:
    """Name the events at the end of a run that ends by too many of them, else empty."""
    if found.code not in (ACCUMULATION, ENDLESS_EVENTS):
        return ""
    number = found.resets[found.resets[:, 0] == found.place[0], 1] - len(compiled.resets)
    inside = (number >= 0) & (number < len(compiled.events))
    return ", ".join(compiled.events[int(k)].name for k in np.unique(number[inside]))


def _events(
    compiled: CompiledSeries, listed: NDArray[np.float64], place: NDArray[np.float64]
) -> dict[str, NDArray[np.float64] | None]:
    """Return resets, events, changes of switches and their final values, None for no such kind.

    Parameters
    ----------
    compiled : CompiledSeries
    listed : ndarray
        Resets, events and changes of switches, as in a `Record`.
    place : ndarray
        Time and columns reached.
    """
    n_switches = len(compiled.switches)
    found = tables_of_kinds(listed, len(compiled.resets), len(compiled.events), n_switches)
    found["end_switches"] = place[-n_switches:].copy() if n_switches else None
    return {name: read_only(table) for name, table in found.items()}


def _method(compiled: CompiledSeries, steps: NDArray[np.float64]) -> str:
    """Describe the methods of the steps of a run."""
    if not np.count_nonzero(steps[:, 3]):
        return compiled.method
    words = [compiled.method]
    collocated, implicit, stiff = (
        int(np.count_nonzero(steps[:, 3] == k)) for k in (1, IMPLICIT, RADAU)
    )
    if collocated and not compiled.values_only:
        words.append(f"{collocated} steps by collocation where it is singular")
    if implicit:
        words.append(f"{implicit} implicit steps of order {SETTLED_ORDER} through settled phases")
    if stiff:
        words.append(f"{stiff} steps of Radau IIA of order {RADAU_ORDER} through stiff phases")
    return ", ".join(words)
