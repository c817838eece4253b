"""Simulation of one trajectory of a model, with event location."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial.polynomial import polyval
from numpy.typing import NDArray

from fastslow.arguments import Condition, StateLike, finite, flag, positive, validated
from fastslow.errors import ArgumentError, refuse_events
from fastslow.formulas.definitions import definitions_of, with_definitions
from fastslow.kernels.loops import load_loop
from fastslow.kernels.taylor.motions_by_signs import MOST_FORMED, SignedSeries, compile_by_signs
from fastslow.kernels.taylor.series import SERIES_KEPT, CompiledSeries, compile_series
from fastslow.results.base.immutable import fixed, read_only
from fastslow.results.base.outcome import Outcome, with_notes
from fastslow.results.stored.reversal import in_reversed_time
from fastslow.results.stored.sign_names import name_of_signs
from fastslow.results.stored.sign_patterns import Pattern
from fastslow.results.trajectory.endings import outcome_of
from fastslow.results.trajectory.long_time.regimes import gap_regions
from fastslow.results.trajectory.trajectory import Trajectory
from fastslow.simulation.arguments import (
    Simulated,
    initial_state,
    initial_switches,
    is_backwards,
    require_tables,
    require_values,
    sample_times,
    simulated,
    time_span,
)
from fastslow.simulation.backwards import (
    Reversed,
    crossings_in_order,
    first_branching,
    steps_in_order,
)
from fastslow.simulation.crossing_notes import note_on_frequent_crossings
from fastslow.simulation.formed_motions import FormedMotions
from fastslow.simulation.instants import (
    events_of,
    fill_instants,
    fill_switches,
    instants_of,
)
from fastslow.simulation.loops import INTEGRATE
from fastslow.simulation.noise_notes import with_noise
from fastslow.simulation.pauses import Pace, provide, with_lazy_callbacks
from fastslow.simulation.run_tables import RunMemory
from fastslow.simulation.settings import (
    DEFAULT,
    Integration,
    Resolved,
    integration_settings,
    resolve,
)
from fastslow.simulation.stepper.event_execution import memory_size
from fastslow.simulation.stepper.implicit import DEGREE, IMPLICIT, RADAU, SETTLED_ORDER
from fastslow.simulation.stepper.phases import (
    ACCUMULATION,
    ENDLESS_EVENTS,
    MANY_PENDING,
    NEEDS_MOTION,
    NO_SWITCH_STATE,
    NOT_UNIQUE,
    OUT_OF_ROWS,
    OUT_OF_WORK,
    RESET_NOT_FINITE,
)
from fastslow.simulation.stepper.problems import Problem, Record, Run
from fastslow.simulation.stepper.radau import RADAU_ORDER
from fastslow.simulation.stepper.scales import FORGETTING, rules_of
from fastslow.simulation.stepper.workspace import (
    INTERFACE,
    MODE,
    SAMPLES,
    STEPS,
    WORK,
    beginnings,
)
from fastslow.simulation.stopping import Stop, StopSearch, read_stops, stops

#: Steps of the first slice of a run with events; each slice has twice as many as the last.
FIRST_SLICE_STEPS = 64

#: Outcome of a run whose tables would be too large, beside those of the loop.
OUT_OF_MEMORY = 11

#: Work space and sizes of tables that a thread keeps from run to run.
_memory = RunMemory()

#: Empty extremes, hits and mode times: steps and crossings are listed instead.
_LISTED = (np.empty((0, 0)), np.empty((0, 2), dtype=np.int64), np.empty(0))


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
        at a zero after the start. Events are located to rounding on the dense output, and
        ``outcome`` names the one that happened. What happens at the same time, a crossing or
        a reset, is included. The steps are those of a run without events.

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
    if prepared.series is None:
        require_tables(model, low, high)
    times = None if samples is None else sample_times(samples, (low, high))
    named = definitions_of(model)
    events = read_stops(
        [with_definitions(one, named) for one in stop],
        (*prepared.names, *prepared.quantities),
        model.parameters,
    )
    run = integrated(
        prepared,
        begin,
        span,
        period,
        times,
        initial_switches(model, state),
        dense=dense,
        stops=events,
        n_periods=periods,
    )
    if run.outcome.code == "beyond a wall" and not len(run.steps) and not len(run.resets):
        raise ArgumentError(f"the initial state is beyond a wall: {run.outcome}")
    return run


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
    last = np.append(prepared.direction * end[0] + 0.0, end[1:])
    reached = sampled.shape[1]
    if reached < len(times):
        times = times[:reached].copy()
    outcome = _outcome(prepared, found, (span[0], begin), last, times)
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
        columns=dict(zip((*prepared.names, *prepared.quantities), ends.T, strict=True)),
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
    found: dict[str, NDArray[np.float64] | None] = dict.fromkeys(
        ("reset_table", "switch_table", "end_switches", "event_table")
    )
    if not (compiled.resets or compiled.events or compiled.switches):
        return found
    number = listed[:, 1] - len(compiled.resets)
    if compiled.resets:
        alone = not compiled.switches and not compiled.events
        found["reset_table"] = listed if alone else listed[number < 0]
    if compiled.events:
        events = listed[(number >= 0) & (number < len(compiled.events))]
        events[:, 1] -= len(compiled.resets)
        found["event_table"] = events
    number -= len(compiled.events)
    if compiled.switches:
        changes, which = listed[number >= 0], number[number >= 0]
        columns = (changes[:, 0], which // 2, which % 2, changes[:, 2 : 2 + compiled.n_states])
        found["switch_table"] = np.column_stack(columns)
        found["end_switches"] = place[-len(compiled.switches) :].copy()
    return {name: read_only(table) for name, table in found.items()}


def no_switch_state(name: str, which: str = "") -> str:
    """Return the message for a switch without a state at the start of a run."""
    return (
        f"the switch {name} has no value at the start{which}, where neither of its relations is "
        f'true; give the states by name, with "{name}": 0 or 1'
    )


class RunArrays(NamedTuple):
    """Arrays of a run.

    Parameters
    ----------
    code, mode : int
        Return code of the loop, 0 at the end of the time span, and the last mode.
    steps, crossings : ndarray
        As in a `Trajectory`.
    series : ndarray, shape (n_steps, n + n_forcing, order + 1), optional
    place : ndarray, shape (1 + n + n_forcing,)
        Time and columns reached.
    sampled : ndarray
        Columns at the sample times up to the time reached.
    resets : ndarray
        Resets, events and changes of switches, as in a `Record`.
    wall : str
        Relation of the reset beyond whose wall the run ended, the reset or event which failed, or
        the switch without a state at its start; empty for other endings.
    stop : Stop, optional
        The event that ended the run.
    modes : tuple of str
        Names of the modes where they are formed during the run, else empty.
    """

    code: int
    mode: int
    steps: NDArray[np.float64]
    crossings: NDArray[np.float64]
    series: NDArray[np.float64] | None
    place: NDArray[np.float64]
    sampled: NDArray[np.float64]
    resets: NDArray[np.float64]
    wall: str
    stop: Stop | None = None
    modes: tuple[str, ...] = ()

    def until(self, step: int, offset: float, times: NDArray[np.float64]) -> RunArrays:
        """Return the run until an offset into a step; it has samples at some times."""
        assert self.series is not None
        steps, place = self.steps[: step + (offset > 0.0)].copy(), self.place.copy()
        mode = self.mode
        if offset > 0.0:
            steps[step, 1] = offset
            place[0], place[1:] = steps[step, 0] + offset, polyval(offset, self.series[step].T)
            mode = int(steps[step, 2])
        elif step < len(self.steps):
            place[0], place[1:] = self.steps[step, 0], self.series[step, :, 0]
            mode = int(self.steps[step, 2])
        return RunArrays(
            code=0,
            mode=mode,
            steps=read_only(steps),
            crossings=self.crossings[self.crossings[:, 0] <= place[0]],
            series=self.series[: len(steps)],
            place=place,
            sampled=self.sampled[:, : int(np.searchsorted(times, place[0], side="right"))],
            resets=self.resets[self.resets[:, 0] <= place[0]],
            wall="",
            modes=self.modes,
        )


def with_own_modes(
    arrays: RunArrays, patterns: Sequence[Pattern], first: Sequence[Pattern]
) -> RunArrays:
    """Return a run with the modes that it meets, regions before sliding, after the first ones."""
    steps, crossings = arrays.steps.copy(), arrays.crossings.copy()
    met = [*crossings[:, 3:5].reshape(-1), *steps[:, 2], arrays.mode]
    used = [patterns[int(k)] for k in dict.fromkeys(met) if k >= 0]
    kept = dict.fromkeys([*first, *sorted(used, key=lambda signs: 0 in signs)])
    number = {signs: k for k, signs in enumerate(kept)}
    new = np.array([number.get(signs, -1) for signs in patterns] or [-1])
    steps[:, 2] = new[steps[:, 2].astype(int)]
    crossings[:, 3:5] = new[crossings[:, 3:5].astype(int)]
    return arrays._replace(
        mode=int(new[arrays.mode]) if arrays.mode >= 0 else arrays.mode,
        steps=read_only(steps),
        crossings=read_only(crossings),
        modes=tuple(map(name_of_signs, kept)),
    )


def run_arrays(
    prepared: Prepared,
    run: Run,
    times: NDArray[np.float64],
    *,
    dense: bool = True,
    stops: tuple[Stop, ...] = (),
) -> RunArrays:
    """Integrate a run to its end or to the first of some events, with samples at given times."""
    compiled, problem = prepared.compiled, prepared.problem
    kept = compiled.n_states + compiled.n_forcing
    sampled = np.empty((compiled.n_states if dense else kept, len(times)))
    counted = run.counted
    backwards = prepared.direction < 0
    stride = kept * (compiled.order + 1) if dense or stops or backwards else 0
    tables = _memory.tables(problem, stride)
    workspace = _memory.workspace(prepared.shape, prepared.problem, prepared.compiled.n_rows)
    loop, pace = load_loop(INTEGRATE), Pace(compiled.n_rows, compiled.order)
    motions = prepared.formed_motions()
    if motions is not None:
        motions.begin(run)
        problem, run = motions.problem(problem), motions.run(run)
    columns = (*prepared.names, *prepared.quantities)
    search = StopSearch(stops, columns, prepared.model.parameters, prepared.direction)
    found, quota = None, FIRST_SLICE_STEPS
    while found is None:
        counted[WORK] = pace.begin()
        if stops:
            counted[WORK], quota = min(counted[WORK], quota), 2 * quota
        record = Record(times, sampled, *tables, *_LISTED)
        code = loop(with_lazy_callbacks(problem), run, record, workspace, 0)
        if code == NEEDS_MOTION:
            assert motions is not None
            motions.propose(run, workspace.search)
            problem, run = motions.problem(problem), motions.run(run)
        if stops:
            steps, store = tables.steps[: counted[STEPS]], tables.store[: counted[STEPS] * stride]
            series = store.reshape(len(steps), kept, compiled.order + 1)
            found = search.first(steps, series, run.inputs if code >= 0 else None)
        if code == OUT_OF_WORK:
            pace.end()
        elif code == OUT_OF_ROWS:
            larger = tables.with_space(counted, problem, stride)
            if larger is None:
                code = OUT_OF_MEMORY
                break
            tables = larger
        elif code < 0 and code != NEEDS_MOTION:
            provide(code, problem.n_fast)
        elif code >= 0:
            break
    _memory.workspaces[prepared.shape] = workspace
    steps, crossings, resets, store = _memory.filled(tables, counted, stride)
    reached = int(counted[SAMPLES])
    if reached < len(times):
        sampled = sampled[:, :reached].copy()
    arrays = RunArrays(
        code=code,
        mode=int(counted[MODE]),
        steps=steps,
        crossings=crossings,
        series=store.reshape(len(steps), kept, compiled.order + 1) if stride else None,
        place=run.inputs,
        sampled=sampled,
        resets=resets,
        wall=_wall_passed(compiled, counted, code),
    )
    if motions is not None:
        arrays = with_own_modes(arrays, motions.patterns, prepared.first_motions)
    if found is not None:
        arrays = arrays.until(found.step, found.offset, times)._replace(stop=found.stop)
    if backwards:
        arrays = _until_branching(prepared, arrays, run.parameters, times)
    return arrays if dense else arrays._replace(series=None)


def _until_branching(
    prepared: Prepared,
    arrays: RunArrays,
    parameters: NDArray[np.float64],
    times: NDArray[np.float64],
) -> RunArrays:
    """Return a backward run until the first time from which it is not unique."""
    assert arrays.series is not None
    branching = first_branching(
        prepared.compiled,
        in_reversed_time(prepared.model.operations),
        parameters,
        arrays.steps,
        arrays.series,
        arrays.crossings,
    )
    if branching is None:
        return arrays
    step = max(int(np.searchsorted(arrays.steps[:, 0], branching)) - 1, 0)
    offset = branching - float(arrays.steps[step, 0])
    if offset >= arrays.steps[step, 1]:
        step, offset = step + 1, 0.0
    return arrays.until(step, offset, times)._replace(code=NOT_UNIQUE)


@dataclass(frozen=True, eq=False)
class Prepared:
    """Data shared by all runs of a model with the same settings.

    Parameters
    ----------
    model : Model
    names : tuple of str
        States and slow states.
    compiled : CompiledSeries
    resolved : Resolved
    problem : Problem
    gap : tuple of str or None
    vanishing, together : tuple
        See `with_noise`.
    direction : float
        1, or −1 for runs backwards, whose series, times and places are in the time τ = −t.
    series : SignedSeries, optional
        Of a model whose motions are formed when a run needs them.
    first_motions : tuple of tuple of int
        Signs of those that are formed at once, the first of its modes.
    """

    model: Simulated
    names: tuple[str, ...]
    compiled: CompiledSeries
    resolved: Resolved
    problem: Problem
    gap: tuple[str, str, str] | None
    vanishing: tuple[str, ...]
    together: tuple[tuple[str, ...], ...]
    direction: float = 1.0
    series: SignedSeries | None = None
    first_motions: tuple[Pattern, ...] = ()

    def formed_motions(self) -> FormedMotions | None:
        """The motions of one run, where they are formed when it needs them."""
        return None if self.series is None else FormedMotions(self.series, self.first_motions)

    @property
    def quantities(self) -> tuple[str, ...]:
        """Columns after the states: slow quantities and switches."""
        return (*self.model.forcing, *self.model.switches)

    @cached_property
    def period(self) -> float | None:
        """The common period of the forcing."""
        return self.model.period()

    @cached_property
    def shared(self) -> dict[str, Any]:
        """Fields of a `Trajectory` that are common to all runs."""
        model = self.model
        content = {
            "states": self.names,
            "forcing": self.quantities,
            "interfaces": tuple(model.interfaces),
            "reset_names": tuple(model.resets),
            "switch_names": tuple(model.switches),
            "event_names": tuple(model.events),
            "regions": () if self.series is not None else tuple(model.regions),
            "parameters": constants_of(model),
            "gap": self.gap,
            "modes": self.compiled.modes,
            "equations": model.equations,
            "settings": self.resolved.recorded(),
            "periods": dict(model.periodic),
            "model": model,
        }
        return {name: fixed(name, value) for name, value in content.items()}

    @cached_property
    def shape(self) -> tuple[int, ...]:
        """Sizes on which the work space depends."""
        problem = self.problem
        sizes = (problem.n_states, problem.n_forcing, problem.n_interfaces, problem.order)
        return (*sizes, problem.n_fast, self.compiled.n_rows)

    @cached_property
    def _beginning(self) -> tuple[NDArray[Any], ...]:
        """Parameters, and the initial carried state of a run."""
        (_,), (carried,), (counted,) = beginnings(
            np.zeros(1),
            np.zeros((1, len(self.names))),
            0,
            self.problem.rules,
            memory_size(len(self.compiled.events), len(self.names)),
        )
        return self.compiled.parameter_array(self.model), carried, counted

    def run(
        self,
        state: NDArray[np.float64],
        span: tuple[float, float],
        values: Mapping[str, float] | None = None,
        switches: NDArray[np.float64] | None = None,
    ) -> Run:
        """Create a run in its initial state, with other values of some parameters.

        ``switches`` are their given states, NaN for none.
        """
        parameters, carried, counted = self._beginning
        if values:
            parameters = parameters.copy()
            for name, value in values.items():
                if name in self.compiled.parameters:
                    parameters[self.compiled.parameters.index(name)] = value
        changing = (self.compiled.tables, self.compiled.clocks, self.compiled.switches)
        if any(changing) or self.compiled.events:
            parameters = parameters.copy()
            fill_instants(self.compiled, parameters[None, :], np.array([span[0]]))
            fill_switches(self.compiled, parameters[None, :], switches)
        place = np.zeros(1 + len(state) + self.compiled.n_forcing)
        place[0] = span[0]
        place[1 : 1 + len(state)] = state
        return Run(*span, span[0], parameters, place, carried.copy(), counted.copy())


@lru_cache(maxsize=SERIES_KEPT)
def prepared_run(
    model: Simulated, integration: Integration, *, backwards: bool = False
) -> Prepared:
    """Prepare the runs of a model with all parameters given, for some settings."""
    require_values(model)
    if backwards:
        refuse_events(model.events, "a run backwards")
    resolved = resolve(integration, model, implicit=True)
    partition = getattr(model, "partition", None)
    if partition is not None and partition.pieces is not None:
        return _forming(model, resolved, backwards=backwards)
    compiled = compile_series(Reversed(model) if backwards else model, resolved.order)
    return Prepared(
        model=model,
        names=(*model.states, *model.slow_states, *model.assigned),
        compiled=compiled,
        resolved=resolved,
        problem=problem_of(model, compiled, resolved, error_rules(model, resolved, compiled)),
        gap=gap_regions(model),
        vanishing=model.traits.vanishing,
        together=model.traits.together,
        direction=-1.0 if backwards else 1.0,
    )


def _forming(model: Any, resolved: Resolved, *, backwards: bool) -> Prepared:
    """Prepare the runs of a model whose motions are formed when a run needs them."""
    from fastslow.model.piece_operations import operations_by_signs
    from fastslow.model.restriction import whole

    regions = whole(model).partition
    if backwards:
        regions.require_all("a run backwards")
    series = compile_by_signs(operations_by_signs(regions), resolved.order)
    compiled = series.compiled
    problem = problem_of(model, compiled, resolved, error_rules(model, resolved, compiled))
    return Prepared(
        model=model,
        names=(*model.states, *model.slow_states),
        compiled=compiled,
        resolved=resolved,
        problem=problem._replace(n_modes=MOST_FORMED, forming=1),
        gap=None,
        vanishing=(),
        together=(),
        series=series,
        first_motions=model.structure.formed,
    )


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


def _wall_passed(compiled: CompiledSeries, counted: NDArray[np.int64], code: int) -> str:
    """Name of the reset, switch or event at which a run ended or did not begin, else empty."""
    place = int(counted[INTERFACE])
    if place < 0 or code == ENDLESS_EVENTS:
        return ""
    failed = code in (RESET_NOT_FINITE, MANY_PENDING)
    resets = [f"reset at {name}" if failed else name for name in compiled.resets]
    walls, kicks = resets[: compiled.n_walls], resets[compiled.n_walls :]
    conditions = [""] * len(compiled.triggers)
    events = [f"event {event.name}" for event in compiled.events]
    names = (*walls, *compiled.switches, *conditions, *kicks, *events)
    count = len(walls) + len(compiled.switches) + len(conditions)
    place -= compiled.n_interfaces - count
    return names[place] if place >= 0 else ""


def constants_of(model: Simulated) -> dict[str, float]:
    """Return the parameters that keep their values in a run: those that no event assigns."""
    return {n: v for n, v in model.parameters.items() if n not in model.assigned}


def problem_of(
    model: Simulated, compiled: CompiledSeries, resolved: Resolved, rules: NDArray[np.float64]
) -> Problem:
    """Bundle model, series and error control for the stepping loops."""
    settling = resolved.implicit and compiled.order >= DEGREE and not compiled.values_only
    instants, knots = instants_of(compiled)
    first_trigger = compiled.n_interfaces - len(compiled.triggers)
    first_switch = first_trigger - len(compiled.switches)
    return Problem(
        series=compiled.address,
        collocation=0,
        radau=0,
        n_states=compiled.n_states,
        n_forcing=compiled.n_forcing,
        n_interfaces=compiled.n_interfaces,
        n_modes=len(compiled.modes),
        order=compiled.order,
        first_wall=first_switch - compiled.n_walls,
        first_switch=first_switch,
        first_trigger=first_trigger,
        n_resets=len(compiled.resets),
        n_rests=compiled.n_rests,
        switch_place=compiled.switch_place,
        n_fast=len(model.states) if settling else 0,
        max_steps=resolved.max_steps,
        max_crossings=resolved.max_crossings,
        forming=0,
        tol=resolved.rtol,
        signs=compiled.signs,
        saturating=compiled.saturating,
        saturations=compiled.saturations,
        continuous=compiled.continuous,
        of_time=compiled.of_time,
        of_laws=compiled.of_laws,
        rules=rules,
        instants=instants,
        knots=knots,
        events=events_of(compiled),
        effects=compiled.effects.astype(np.int64),
        closed=np.array(compiled.triggers, dtype=bool),
    )


def error_rules(
    model: Simulated, resolved: Resolved, compiled: CompiledSeries
) -> NDArray[np.float64]:
    """Error scale rules of a run, from its tolerances."""
    names = (*model.states, *model.slow_states)
    fixed, lasting = np.zeros(len(names)), np.zeros(len(names))
    traits = model.traits
    vanishing = {*traits.vanishing, *(n for some in traits.together for n in some)}
    for i, name in enumerate(names):
        given = resolved.atol[name]
        if given is not None:
            fixed[i] = given / resolved.rtol
        elif name not in vanishing:
            lasting[i] = FORGETTING
    # the parameters that events assign are constant between them
    fixed, lasting = (np.append(v, np.zeros(len(model.assigned))) for v in (fixed, lasting))
    return rules_of(fixed, lasting, compiled.n_forcing, compiled.n_interfaces)
