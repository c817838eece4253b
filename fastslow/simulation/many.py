"""Simulation of ensembles: many initial states or parameter sets."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, ThreadPoolExecutor, wait
from dataclasses import dataclass
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastslow.arguments import finite, instance, mapping, validated
from fastslow.errors import ArgumentError
from fastslow.kernels.loops import load_loop
from fastslow.kernels.simd.lanes import WIDTH
from fastslow.kernels.simd.steps import CompiledSteps, compile_steps
from fastslow.kernels.taylor.series import CompiledSeries, compile_series
from fastslow.model.model import Model
from fastslow.results.angles import periods_of
from fastslow.results.base.immutable import read_only
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.results.trajectory.ensemble import Ensemble
from fastslow.results.trajectory.long_time.periodicity import INTEGRATION_ERRORS
from fastslow.results.trajectory.long_time.regimes import (
    REPEATING,
    bits_of,
    gap_regions,
    numbers_of,
    periods_at_the_end,
    repeats,
)
from fastslow.simulation.arguments import no_switch_state, require_tables
from fastslow.simulation.grouping import same_regions
from fastslow.simulation.instants import fill_instants, fill_switches
from fastslow.simulation.loops import INTEGRATE_MANY
from fastslow.simulation.many_arguments import (
    periods_of_trajectories,
    spans_of,
    starts_and_parameters,
    starts_of_switches,
    times_of,
)
from fastslow.simulation.noise_notes import notes_on_noise
from fastslow.simulation.pauses import Pace, provide, with_lazy_callbacks
from fastslow.simulation.prepared_runs import constants_of, error_rules, problem_of
from fastslow.simulation.settings import (
    DEFAULT,
    EXECUTION,
    Execution,
    Integration,
    Resolved,
    integration_settings,
    progress_bar,
    resolve,
    thread_settings,
)
from fastslow.simulation.stepper.lanes import LEFT, Pool, RunTable, pool_for
from fastslow.simulation.stepper.phases import NO_SWITCH_STATE, OUT_OF_WORK, REACHED_END
from fastslow.simulation.stepper.problems import Problem
from fastslow.simulation.stepper.queued_events import memory_size
from fastslow.simulation.stepper.workspace import (
    INTERFACE,
    MODE,
    STEPS,
    StepWorkspace,
    beginnings,
    workspace_for,
)

Floats = NDArray[np.float64]


#: Number of trajectories that have all that their integration needs in memory at a time.
IN_MEMORY = 16384

#: Maximum number of trajectories that a thread takes at a time.
_CHUNK = 512


@validated(
    model=instance(Model),
    parameters=mapping,
    t0=finite,
    settle=finite,
    integration=integration_settings,
    execution=thread_settings,
)
def simulate_many(
    model: Model,
    states: ArrayLike | Mapping[Any, ArrayLike],
    *,
    parameters: Mapping[Any, ArrayLike] | None = None,
    t: tuple[float, float] | None = None,
    periods: float | None = None,
    t0: float = 0.0,
    period: ArrayLike | None = None,
    settle: float = 0.0,
    integration: Integration = DEFAULT,
    samples: int | Sequence[float] | Floats | None = None,
    execution: Execution = EXECUTION,
) -> Ensemble:
    """Simulate many trajectories and return summaries: extremes, hits, final states.

    Steps without events are taken for several trajectories at once by SIMD instructions,
    all others one trajectory at a time as in `simulate`. Each result is bitwise independent
    of the other trajectories, their order and the number of threads, and agrees with
    `simulate` to the tolerance. A trajectory that ends early does not affect the others;
    `Ensemble.outcomes` gives the reason.

    Parameters
    ----------
    model : Model
        With forcing, with slow states, or frozen with all parameters given.
    states : array_like, shape (m, n) or (n,), or mapping
        Initial states and slow states; by name, each a number or of shape (m,).
    parameters : mapping, optional
        Parameter to its values, a number or of shape (m,). Values are paired, not combined:
        set k takes the k-th value of each array.
    t : (float, float)
        Start and end of time, for all.
    periods : float
        Instead of ``t``: length in periods of the forcing of each trajectory.
    t0 : float
        Start of time with ``periods``.
    period : float or array_like, shape (m,), optional
        Period, by default that of the forcing.
    settle : float
        Transient excluded from extremes, hits and evenly spaced samples: in periods with
        ``periods``, in time with ``t``.
    integration : Integration
        Error control, order and method of the steps, and limits of a trajectory.
    samples : int or sequence of float, optional
        Number of evenly spaced samples of every column, or their times.
    execution : Execution
        Number of threads, and progress bar.

    Returns
    -------
    Ensemble

    Raises
    ------
    ArgumentError
        For different lengths, numbers that are not finite, an invalid time span,
        ``periods`` without a common period, or a switch without a value at the start.
    UnknownNameError
        For an unknown state or parameter.
    ModelError
        For a function without compiled code.

    See Also
    --------
    fastslow.simulate, fastslow.bifurcation_sweep, fastslow.sweep

    Examples
    --------
    >>> import numpy as np, sympy as sp
    >>> x, v, k = sp.symbols("x v k")
    >>> oscillator = Model({x: v, v: -k * x}, parameters={k: 1})
    >>> fine = Integration(rtol=1e-12)
    >>> many = simulate_many(
    ...     oscillator, [1, 0], parameters={k: [1, 4]}, t=(0, np.pi), integration=fine
    ... )
    >>> many.minimum.round(9)
    array([[-1., -1.],
           [-1., -2.]])
    """
    starts, swept = starts_and_parameters(model, states, parameters)
    count = len(starts)
    switches = starts_of_switches(model, states, count)
    names = (*model.states, *model.slow_states, *model.assigned)
    resolved = resolve(integration, model, implicit=False)
    own = periods_of_trajectories(model, period, count, swept)
    spans, since = spans_of(t, periods, t0, settle, own)
    times = times_of(samples, spans, since)
    require_tables(model.operations.tables, float(spans[:, 0].min()), float(spans[:, 1].max()))
    groups = [
        (one, chosen, compile_series(one, resolved.order), compile_steps(one, resolved.order))
        for one, chosen in same_regions(model, swept, count)
    ]
    given = _Initial(starts, swept, switches, spans, since, times, own)
    found = _summaries(model, groups, given, resolved, execution)
    traits = model.traits
    together = tuple(name for some in traits.together for name in some)
    return Ensemble(
        states=names,
        forcing=(*model.forcing, *model.switches),
        interfaces=found.interfaces,
        modes=found.modes,
        parameters=NamedMapping("parameter", swept),
        initial=starts,
        span=spans,
        since=since,
        minimum=found.minimum,
        maximum=found.maximum,
        final=found.final,
        reached=found.reached,
        hits=found.hits,
        regime_numbers=found.regime_numbers,
        n_steps=found.n_steps,
        codes=found.codes,
        last_mode=found.last_mode,
        sampled=None if samples is None else (times if len(times) > 1 else times[0], found.sampled),
        method="; ".join(dict.fromkeys(compiled.method for *_, compiled, _ in groups)),
        limits=resolved.limits,
        constants={n: v for n, v in constants_of(model).items() if n not in swept},
        equations=model.equations,
        settings=resolved.recorded(),
        undecided=tuple(dict.fromkeys(u for *_, made, _ in groups for u in made.undecided)),
        notes=notes_on_noise(
            names,
            resolved,
            (*traits.vanishing, *together),
            starts,
            found.minimum,
            found.maximum,
            found.final,
        ),
        touched=found.touched,
        multiples=found.multiples,
        changes=found.changes,
        reset_names=tuple(model.resets),
        switch_names=tuple(model.switches),
        event_names=tuple(model.events),
        **found.counts(),
    )


class _Initial(NamedTuple):
    """What is given of all trajectories, with one row for each.

    Parameters
    ----------
    starts : ndarray, shape (m, n)
    swept : mapping
        Parameter to its values, shape (m,).
    switches : ndarray, shape (m, n_switches)
        Initial states of switches, NaN for none.
    spans, since, times
        As in `RunTable`.
    periods : ndarray, shape (m,)
        NaN for none.
    """

    starts: Floats
    swept: Mapping[str, Floats]
    switches: Floats | None
    spans: Floats
    since: Floats
    times: Floats
    periods: Floats


def _summaries(
    model: Model,
    groups: Sequence[tuple[Model, NDArray[np.intp], CompiledSeries, CompiledSteps]],
    given: _Initial,
    resolved: Resolved,
    execution: Execution,
) -> _Summaries:
    """Integrate trajectories in groups with common regions."""
    spans, times, own = given.spans, given.times, given.periods
    gaps = [gap_regions(one) for one, *_ in groups]
    parts = [slice(start, start + IN_MEMORY) for start in range(0, len(spans), IN_MEMORY)]
    columns = given.starts.shape[1] + len(model.forcing) + len(model.switches) if times.size else 0
    found = _Summaries.empty(
        model,
        tuple(dict.fromkeys(name for one, *_ in groups for name in one.interfaces)),
        tuple(dict.fromkeys(name for *_, compiled, _ in groups for name in compiled.modes)),
        given.starts.shape,
        (columns, times.shape[1]),
        max(int(_windows(given, part).max()) for part in parts)
        if any(between is not None for between in gaps)
        else 0,
        np.dtype(np.int32 if max(resolved.limits) < 2**31 else np.int64),
    )
    with progress_bar(execution, "run", len(spans)) as bar:
        for (one, group, compiled, lanes), between in zip(groups, gaps, strict=True):
            rules = error_rules(one, resolved, compiled)
            problem = problem_of(model, compiled, resolved, rules)
            blocks = [group[start : start + IN_MEMORY] for start in range(0, len(group), IN_MEMORY)]
            classified = between is not None and not any(np.isnan(own[b]).any() for b in blocks)
            for chosen in blocks:
                values = _parameter_table(
                    compiled, one, given.swept, chosen, spans[chosen, 0], given.switches
                )
                ending = None
                if between is not None and classified:
                    bits = bits_of(compiled.modes, between)
                    ending = _Ends(own[chosen], _windows(given, chosen), bits)
                run = _run(
                    compiled,
                    lanes,
                    problem,
                    (values, given.starts[chosen], spans[chosen], given.since[chosen]),
                    times if len(times) == 1 else times[chosen],
                    threads=execution.workers,
                    n_columns=columns,
                    report=bar.update,
                    ending=ending,
                )
                found.fill(one, compiled, chosen, run, values)
                if ending is not None and run.last is not None:
                    found.classify(model, chosen, run, ending, spans[chosen], resolved.rtol)
    return found.closed()


def _windows(given: _Initial, rows: slice | NDArray[np.intp]) -> NDArray[np.int64]:
    """Number of periods in the second half of some runs."""
    spans = given.spans[rows]
    return periods_at_the_end(spans[:, 1] - spans[:, 0], given.periods[rows])


@dataclass(frozen=True, eq=False)
class _Summaries:
    """Summaries of all trajectories, filled in for one group of them after the other.

    The fields are those of `Ensemble`, each an array of its own, which the ensemble takes over.
    """

    interfaces: tuple[str, ...]
    modes: tuple[str, ...]
    minimum: Floats
    maximum: Floats
    hits: NDArray[np.int64]
    resets: NDArray[np.int64]
    switches: NDArray[np.int64]
    end_switches: NDArray[np.int64]
    events: NDArray[np.int64]
    final: Floats
    reached: Floats
    codes: NDArray[np.int16]
    last_mode: NDArray[np.int32]
    n_steps: NDArray[Any]
    sampled: Floats
    regime_numbers: NDArray[np.uint8]
    touched: NDArray[np.uint8]
    multiples: NDArray[np.int16]
    changes: Floats

    @classmethod
    def empty(
        cls,
        model: Model,
        interfaces: tuple[str, ...],
        modes: tuple[str, ...],
        shape: tuple[int, ...],
        samples: tuple[int, int],
        looked: int,
        steps: np.dtype[Any],
    ) -> _Summaries:
        """Summaries of trajectories from initial states of a shape, with periods looked at.

        ``steps`` is the type of a number of steps.
        """
        count, n = shape

        def integers(*more: int) -> NDArray[np.int64]:
            return np.zeros((count, *more), dtype=np.int64)

        return cls(
            interfaces=interfaces,
            modes=modes,
            minimum=np.empty((count, n)),
            maximum=np.empty((count, n)),
            hits=integers(len(interfaces), 2),
            resets=integers(len(model.resets)),
            switches=integers(len(model.switches), 2),
            end_switches=integers(len(model.switches)),
            events=integers(len(model.events)),
            final=np.empty((count, n)),
            reached=np.empty(count),
            codes=np.zeros(count, dtype=np.int16),
            last_mode=np.zeros(count, dtype=np.int32),
            n_steps=np.zeros(count, dtype=steps),
            sampled=np.empty((count, *samples)),
            regime_numbers=np.zeros(count, dtype=np.uint8),
            touched=np.zeros((count, looked), dtype=np.uint8),
            multiples=np.zeros(count, dtype=np.int16),
            changes=np.full(count, np.nan),
        )

    def fill(
        self,
        model: Model,
        compiled: CompiledSeries,
        chosen: NDArray[np.intp],
        run: _Completed,
        values: Floats,
    ) -> None:
        """Fill in a group of trajectories with common regions, with their final parameters."""
        self.minimum[chosen], self.maximum[chosen] = run.extremes[:, 0], run.extremes[:, 1]
        self.reached[chosen], self.final[chosen] = run.ends[:, 0], run.ends[:, 1:]
        self.codes[chosen], self.n_steps[chosen] = run.codes[:, 0], run.codes[:, 2]
        self.sampled[chosen] = run.samples
        for j, name in enumerate(model.interfaces):
            self.hits[chosen, self.interfaces.index(name)] = run.hits[:, j]
        walls = slice(len(model.interfaces), len(model.interfaces) + compiled.n_walls)
        self.resets[chosen, : compiled.n_walls] = run.hits[:, walls, 0]
        after = run.hits[:, compiled.n_interfaces :, 0]
        kicks = len(compiled.resets) - compiled.n_walls
        self.resets[chosen, compiled.n_walls :] = after[:, :kicks]
        self.events[chosen] = after[:, kicks:]
        self.switches[chosen] = run.hits[:, walls.stop : walls.stop + len(model.switches)]
        self.end_switches[chosen] = _switches_in(compiled, model, values)
        # the mode is -1 before the first selection
        names = [*map(self.modes.index, compiled.modes), -1]
        self.last_mode[chosen] = np.array(names)[run.codes[:, 1]]

    def classify(
        self,
        model: Model,
        chosen: NDArray[np.intp],
        run: _Completed,
        ending: _Ends,
        spans: Floats,
        rtol: float,
    ) -> None:
        """Fill in contact regimes, and periods after which the states repeat, of a group."""
        assert run.last is not None
        touched, visited = run.last
        looked = self.touched.shape[1]
        self.touched[chosen, looked - touched.shape[1] :] = touched
        names = (*model.states, *model.slow_states, *model.assigned)
        turns = periods_of(names, dict(model.periodic))
        ranges = np.ptp(run.extremes, axis=1)
        for k in np.unique(ending.windows):
            rows = np.flatnonzero((ending.windows == k) & (run.codes[:, 0] == 0))
            of = chosen[rows]
            if not len(of):
                continue
            kept = visited[rows, -1 - k :]
            widths = np.fmax(ranges[rows], np.ptp(kept, axis=1))
            scale = np.where(widths > 0, widths, 1.0)
            allowed = max(REPEATING, INTEGRATION_ERRORS * rtol)
            found, moved = repeats(kept, scale, turns, allowed)
            short = np.diff(spans[rows], axis=1)[:, 0] < (k - 1e-9) * ending.period[rows]
            self.multiples[of] = np.where(short, 0, found)
            self.changes[of] = np.where(short, np.nan, moved)
            sides = self.touched[of, looked - k :]
            self.regime_numbers[of] = numbers_of(sides, self.multiples[of])

    def closed(self) -> Self:
        """Return the summaries read-only: an ensemble then takes their arrays."""
        read_only(vars(self))
        return self

    def counts(self) -> dict[str, NDArray[np.int64]]:
        """Counts of resets, of changes of switches and of events, of a model that has them."""
        found = {}
        if self.resets.shape[1]:
            found["resets"] = self.resets
        if self.switches.shape[1]:
            found |= {"switches": self.switches, "end_switches": self.end_switches}
        if self.events.shape[1]:
            found["events"] = self.events
        return found


def final_states(
    model: Model,
    starts: Floats,
    swept: Mapping[str, Floats],
    spans: Floats,
    resolved: Resolved,
    execution: Execution,
    times: Floats | None = None,
    report: Callable[[int], object] = lambda _: None,
    switches: Floats | None = None,
    extremes: Floats | None = None,
) -> tuple[Floats, NDArray[np.int64], Floats, Floats]:
    """Final states of trajectories with different time spans, and samples at given times.

    Parameters
    ----------
    model : Model
    starts : ndarray, shape (m, n)
    swept : mapping
        Parameter to its values, shape (m,).
    spans : ndarray, shape (m, 2)
    resolved : Resolved
    execution : Execution
    times : ndarray, shape (m, k), optional
        Increasing, within the spans.
    report : callable, optional
        Called with numbers of finished trajectories.
    switches : ndarray, shape (m, n_switches)
        Given initial states of switches, NaN for none.
    extremes : ndarray, shape (m, 2, n), optional
        Filled with the smallest and largest values.

    Returns
    -------
    ends : ndarray, shape (m, n)
    codes : ndarray of int, shape (m,)
        Outcome of each, 0 at the end of its span.
    samples : ndarray, shape (m, n, k)
        NaN after the end of a trajectory.
    end_switches : ndarray, shape (m, n_switches)
    """
    count, n = starts.shape
    end_switches = np.empty((count, len(model.switches)))
    require_tables(model.operations.tables, float(spans[:, 0].min()), float(spans[:, 1].max()))
    ends, codes = np.empty((count, n)), np.empty(count, dtype=np.int64)
    grid = np.empty((count, 0)) if times is None else times
    samples = np.empty((count, n, grid.shape[1]))
    for one, chosen in same_regions(model, swept, count):
        compiled = compile_series(one, resolved.order)
        problem = problem_of(model, compiled, resolved, error_rules(one, resolved, compiled))
        values = _parameter_table(compiled, one, swept, chosen, spans[chosen, 0], switches)
        run = _run(
            compiled,
            compile_steps(one, resolved.order),
            problem,
            (
                values,
                starts[chosen],
                spans[chosen],
                spans[chosen, 1 if extremes is None else 0],
            ),
            grid[chosen],
            threads=execution.workers,
            n_columns=n if grid.shape[1] else 0,
            report=report,
        )
        if extremes is not None:
            extremes[chosen] = run.extremes
        ends[chosen], codes[chosen] = run.ends[:, 1:], run.codes[:, 0]
        if grid.shape[1]:
            samples[chosen] = run.samples
        end_switches[chosen] = _switches_in(compiled, model, values)
    return ends, codes, samples, end_switches


def _parameter_table(
    compiled: CompiledSeries,
    model: Model,
    swept: Mapping[str, Floats],
    chosen: NDArray[np.intp],
    times: Floats,
    switches: Floats | None = None,
) -> Floats:
    """Parameter values for each trajectory in the order of the compiled function.

    They are followed by those of tables, clocks and switches at the starts of the trajectories.
    """
    table = np.zeros((len(chosen), len(compiled.parameter_array(model))))
    for column, name in enumerate(compiled.parameters):
        table[:, column] = swept[name][chosen] if name in swept else model.parameters[name]
    fill_instants(compiled, table, times)
    fill_switches(compiled, table, None if switches is None else switches[chosen])
    return table


def _switches_in(compiled: CompiledSeries, model: Model, values: Floats) -> Floats:
    """Values of the switches in a table of parameters, one row for each trajectory."""
    place = compiled.switch_place
    return values[:, place : place + 2 * len(model.switches) : 2]


@dataclass(frozen=True, eq=False)
class _Ends:
    """Periods at the end of runs that are classified individually.

    Parameters
    ----------
    period, windows : ndarray, shape (m,)
        Length and number of the periods.
    bits : ndarray of int, shape (n_modes,)
        Sides of a gap touched in each mode.
    """

    period: Floats
    windows: NDArray[np.int64]
    bits: NDArray[np.int64]


class _Kept:
    """Sides touched and states in the last periods, recorded at stops between periods.

    A stop only ends a step; it does not change the run otherwise.
    """

    def __init__(self, ending: _Ends, spans: Floats, starts: Floats) -> None:
        self.ending, self.spans = ending, spans
        most = int(ending.windows.max())
        self.touched = np.zeros((len(spans), most), dtype=np.int64)
        self.states = np.repeat(starts[:, None], most + 1, axis=1)
        self.failed = np.zeros(len(spans), dtype=np.int64)

    def stops(self, chunk: tuple[int, int]) -> int:
        """Number of stops of a chunk: before the first of the periods, and after each."""
        return int(self.ending.windows[slice(*chunk)].max()) + 1

    def _edge(self, chunk: tuple[int, int], left: NDArray[np.int64]) -> Floats:
        """Time at which ``left`` periods remain of each run, not before its beginning."""
        rows = slice(*chunk)
        edge = self.spans[rows, 1] - left * self.ending.period[rows]
        return np.asarray(np.maximum(edge, self.spans[rows, 0]))

    def before(
        self,
        stop: int,
        chunk: tuple[int, int],
        stops: Floats,
        codes: NDArray[np.int64],
    ) -> None:
        """Set the next stops of the runs of a chunk."""
        rows = slice(*chunk)
        most = self.ending.windows[rows]
        left = np.minimum(self.stops(chunk) - 1 - stop, most)
        # a period that begins with the run needs no stop before it
        left = np.where(self._edge(chunk, left) > self.spans[rows, 0], left, most - 1)
        stops[rows, 1] = self._edge(chunk, left)
        if stop > 0:
            self.failed[rows] = codes[rows]
            # finished runs do not continue
            stops[rows, 1] = np.where(codes[rows] != 0, -np.inf, stops[rows, 1])

    def after(
        self,
        stop: int,
        chunk: tuple[int, int],
        places: Floats,
        seen: Floats,
        codes: NDArray[np.int64],
    ) -> None:
        """Record the sides touched since the previous stop, and the states."""
        rows = slice(*chunk)
        if stop > 0:
            codes[rows] = np.where(self.failed[rows] != 0, self.failed[rows], codes[rows])
        left = self.stops(chunk) - 1 - stop
        most = self.ending.windows[rows]
        width = self.touched.shape[1]
        begun = self._edge(chunk, np.minimum(left, most)) > self.spans[rows, 0]
        now = places[rows, 1 : 1 + self.states.shape[2]]
        self.states[rows, width - left] = np.where(
            begun[:, None], now, self.states[rows, width - left]
        )
        if stop > 0:
            begin = self._edge(chunk, np.full(len(most), left + 1))
            inside = seen[rows] > begin[:, None]
            sides = np.bitwise_or.reduce(np.where(inside, self.ending.bits, 0), axis=1)
            self.touched[rows, width - 1 - left] = np.where(left < most, sides, 0)


class _Completed(NamedTuple):
    """What is known of trajectories at their ends.

    Parameters
    ----------
    extremes, hits : ndarray
        As in `RunTable`.
    ends : ndarray, shape (m, 1 + n)
        Final times and states.
    codes : ndarray of int, shape (m, 3)
        Outcome, last mode and number of steps.
    samples : ndarray, shape (m, n_columns, n_times)
    last : tuple of ndarray, optional
        Sides touched in the last periods, and the states between them.
    """

    extremes: Floats
    hits: NDArray[np.int64]
    ends: Floats
    codes: NDArray[np.int64]
    samples: Floats
    last: tuple[NDArray[np.int64], Floats] | None


def _run(
    compiled: CompiledSeries,
    lanes: CompiledSteps,
    problem: Problem,
    rows: tuple[Floats, Floats, Floats, Floats],
    times: Floats,
    *,
    threads: int,
    n_columns: int,
    report: Callable[[int], object],
    ending: _Ends | None = None,
) -> _Completed:
    """Integrate trajectories that share one compiled series.

    ``rows`` are the parameters of each, its initial state, time span, and the time from which
    extremes and hits count.
    """
    values, starts, spans, since = rows
    count, n = starts.shape
    counted = (since <= spans[:, 0])[:, None]
    extremes = np.stack([np.where(counted, starts, sign * np.inf) for sign in (1, -1)], axis=1)
    n_hits = len(compiled.resets) - compiled.n_walls + len(compiled.events)
    hits = np.zeros((count, compiled.n_interfaces + n_hits, 2), dtype=np.int64)
    seen = np.full((count, len(compiled.modes)), -np.inf)
    memory = memory_size(len(compiled.events), n)
    places, carried, whole = beginnings(
        spans[:, 0], starts, compiled.n_forcing, problem.rules, memory
    )
    codes = np.empty(count, dtype=np.int64)
    samples = np.full((count, n_columns, times.shape[1]), np.nan)
    many = load_loop(INTEGRATE_MANY)
    stops = spans.copy()
    runs = RunTable(
        parameters=values,
        spans=stops,
        since=since,
        times=times,
        samples=samples,
        extremes=extremes,
        hits=hits,
        seen=seen,
        places=places,
        carried=carried,
        counted=whole,
        codes=codes,
    )
    kept = _Kept(ending, spans, starts) if ending is not None else None
    stopping = threading.Event()

    def follow(chunk: tuple[int, int]) -> Iterator[int]:
        """Integrate a chunk to its end, yielding the codes of code that must be loaded first."""
        pool = pool_for(problem, lanes.regions, values.shape[1], count)
        workspace = workspace_for(problem, compiled.n_rows)
        for stop in range(1 if kept is None else kept.stops(chunk)):
            if kept is not None:
                kept.before(stop, chunk, stops, codes)
            yield from advance(chunk, pool, workspace)
            if kept is not None:
                kept.after(stop, chunk, places, seen, codes)

    def advance(chunk: tuple[int, int], pool: Pool, workspace: StepWorkspace) -> Iterator[int]:
        pace = Pace(compiled.n_rows, compiled.order)
        while True:
            pool.progress[LEFT] = pace.begin()
            given = with_lazy_callbacks(problem)
            code = many(given, lanes.address, lanes.regions, runs, pool, workspace, *chunk)
            if code == REACHED_END:
                return
            if stopping.is_set():
                raise CancelledError
            if code == OUT_OF_WORK:
                pace.end()
            else:
                yield code

    # fewer runs than lanes would leave lanes empty, unless threads would have none
    full = min(WIDTH, -(-count // threads))
    size = min(_CHUNK, max(full, count // (4 * threads)))
    chunks = [(i, min(i + size, count)) for i in range(0, count, size)]
    in_progress = {follow(chunk): chunk[1] - chunk[0] for chunk in chunks}
    _complete(in_progress, min(threads, len(chunks)), problem.n_fast, report, stopping)
    undecided = np.flatnonzero(codes == NO_SWITCH_STATE)
    if len(undecided):
        which = int(undecided[0])
        name = compiled.switches[int(whole[which, INTERFACE]) - problem.first_switch]
        raise ArgumentError(no_switch_state(name, f" of a trajectory from {starts[which]}"))
    extremes[np.isinf(extremes)] = np.nan
    endings = np.column_stack([codes, whole[:, MODE], whole[:, STEPS]])
    last = None if kept is None else (kept.touched, kept.states)
    return _Completed(extremes, hits, places[:, : 1 + n], endings, samples, last)


def _complete(
    in_progress: Mapping[Iterator[int], int],
    threads: int,
    n_fast: int,
    report: Callable[[int], object],
    stopping: threading.Event,
) -> None:
    """Complete chunks of trajectories, with their numbers, in several threads.

    Each yields the code of what must be loaded before it goes on, and ends at its next pause once
    ``stopping`` is set.
    """
    if threads == 1:
        for following, number in in_progress.items():
            for code in following:
                provide(code, n_fast)
            report(number)
        return
    executor = ThreadPoolExecutor(threads)
    try:
        waiting = {executor.submit(next, f, None): f for f in in_progress}
        while waiting:
            # this thread handles signals, on some systems only between two waits
            for done in wait(waiting, timeout=0.5, return_when=FIRST_COMPLETED).done:
                following, needed = waiting.pop(done), done.result()
                if needed is None:
                    report(in_progress[following])
                else:
                    provide(needed, n_fast)
                    waiting[executor.submit(next, following, None)] = following
    finally:
        stopping.set()
        executor.shutdown(cancel_futures=True)
