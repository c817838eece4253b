"""Simulation of ensembles: many initial states or parameter sets."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, ThreadPoolExecutor, wait
from dataclasses import dataclass
from typing import Any

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
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.results.trajectory.ensemble import Ensemble
from fastslow.results.trajectory.long_time.periodicity import INTEGRATION_ERRORS
from fastslow.results.trajectory.long_time.regimes import (
    REPEATING,
    bits_of,
    gap_regions,
    labels_of,
    periods_at_the_end,
    repeats,
)
from fastslow.simulation.arguments import require_tables
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
from fastslow.simulation.one import (
    error_rules,
    no_switch_state,
    problem_of,
)
from fastslow.simulation.pauses import Pace, provide, with_lazy_callbacks
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
from fastslow.simulation.stepper.driver import NO_SWITCH_STATE, OUT_OF_WORK, REACHED_END
from fastslow.simulation.stepper.lanes import LEFT, Pool, Runs, pool_for
from fastslow.simulation.stepper.problems import Problem
from fastslow.simulation.stepper.workspace import (
    INTERFACE,
    MODE,
    STEPS,
    Workspace,
    beginnings,
    workspace_for,
)

Floats = NDArray[np.float64]


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
    given = starts_of_switches(model, states, count)
    resolved = resolve(integration, model, implicit=False)
    own = periods_of_trajectories(model, period, count, swept)
    spans, since = spans_of(t, periods, t0, settle, own)
    times = times_of(samples, spans, since)
    require_tables(model, float(spans[:, 0].min()), float(spans[:, 1].max()))
    groups = [
        (one, chosen, compile_series(one, resolved.order), compile_steps(one, resolved.order))
        for one, chosen in same_regions(model, swept, count)
    ]
    gaps = [gap_regions(one) for one, *_ in groups]
    modes = tuple(dict.fromkeys(name for *_, compiled, _ in groups for name in compiled.modes))
    interfaces = tuple(dict.fromkeys(name for one, *_ in groups for name in one.interfaces))
    n = starts.shape[1]
    quantities = (*model.forcing, *model.switches)
    columns = n + len(quantities)
    extremes = np.empty((count, 2, n))
    hits = np.zeros((count, len(interfaces), 2), dtype=np.int64)
    resets = np.zeros((count, len(model.resets)), dtype=np.int64)
    changes_of_switches = np.zeros((count, len(model.switches), 2), dtype=np.int64)
    end_switches = np.zeros((count, len(model.switches)), dtype=np.int64)
    ends = np.empty((count, 1 + n))
    codes = np.empty((count, 3), dtype=np.int64)
    regime = np.zeros(count, dtype="U16")
    windows = periods_at_the_end(spans[:, 1] - spans[:, 0], own)
    looked = int(windows.max()) if any(between is not None for between in gaps) else 0
    touched = np.zeros((count, looked), dtype=np.int64)
    multiples, changes = np.zeros(count, dtype=np.int64), np.full(count, np.nan)
    turns = periods_of((*model.states, *model.slow_states), dict(model.periodic))
    sampled = np.empty((count, columns if times.size else 0, times.shape[1]))
    with progress_bar(execution, "run", count) as bar:
        for (one, chosen, compiled, lanes), between in zip(groups, gaps, strict=True):
            values = _parameter_table(compiled, one, swept, chosen, spans[chosen, 0], given)
            rules = error_rules(one, resolved, compiled)
            run = _run(
                compiled,
                lanes,
                problem_of(model, compiled, resolved, rules),
                execution.workers,
                (values, starts[chosen], spans[chosen], since[chosen]),
                times if len(times) == 1 else times[chosen],
                columns if times.size else 0,
                bar.update,
                _Ends(own[chosen], windows[chosen], bits_of(compiled.modes, between))
                if between is not None and not np.isnan(own[chosen]).any()
                else None,
            )
            extremes[chosen], ends[chosen], codes[chosen], sampled[chosen] = run[0], *run[3:6]
            for j, name in enumerate(one.interfaces):
                hits[chosen, interfaces.index(name)] = run[1][:, j]
            walls = slice(len(one.interfaces), len(one.interfaces) + compiled.n_walls)
            resets[chosen, : compiled.n_walls] = run[1][:, walls, 0]
            resets[chosen, compiled.n_walls :] = run[1][:, compiled.n_interfaces :, 0]
            changes_of_switches[chosen] = run[1][:, walls.stop : compiled.n_interfaces]
            place = compiled.switch_place
            end_switches[chosen] = values[:, place : place + 2 * len(model.switches) : 2]
            # the mode is -1 before the first selection
            names = [*map(modes.index, compiled.modes), -1]
            codes[chosen, 1] = np.array(names)[codes[chosen, 1]]
            if run[6] is not None:
                last, visited = run[6]
                touched[chosen, looked - last.shape[1] :] = last
                ranges = np.ptp(run[0], axis=1)
                for k in np.unique(windows[chosen]):
                    rows = np.flatnonzero((windows[chosen] == k) & (codes[chosen, 0] == 0))
                    of = chosen[rows]
                    if not len(of):
                        continue
                    kept = visited[rows, -1 - k :]
                    widths = np.fmax(ranges[rows], np.ptp(kept, axis=1))
                    scale = np.where(widths > 0, widths, 1.0)
                    allowed = max(REPEATING, INTEGRATION_ERRORS * resolved.rtol)
                    found, moved = repeats(kept, scale, turns, allowed)
                    short = np.diff(spans[of], axis=1)[:, 0] < (k - 1e-9) * own[of]
                    multiples[of] = np.where(short, 0, found)
                    changes[of] = np.where(short, np.nan, moved)
                    regime[of] = labels_of(touched[of, looked - k :], multiples[of])
    return Ensemble(
        (*model.states, *model.slow_states),
        quantities,
        interfaces,
        modes,
        NamedMapping("parameter", swept),
        starts,
        spans,
        since,
        extremes[:, 0],
        extremes[:, 1],
        ends[:, 1:],
        ends[:, 0],
        hits,
        regime,
        codes[:, 2],
        codes[:, 0],
        codes[:, 1],
        (times if len(times) > 1 else times[0], sampled) if samples is not None else None,
        "; ".join(dict.fromkeys(compiled.method for *_, compiled, _ in groups)),
        resolved.limits,
        {n: v for n, v in model.parameters.items() if n not in swept},
        model.equations,
        resolved.recorded(),
        tuple(dict.fromkeys(u for *_, compiled, _ in groups for u in compiled.undecided)),
        notes_on_noise(
            (*model.states, *model.slow_states),
            resolved,
            (*model.traits.vanishing, *(name for some in model.traits.together for name in some)),
            starts,
            extremes,
            ends[:, 1:],
        ),
        touched,
        multiples,
        changes,
        tuple(model.resets),
        resets if model.resets else np.zeros((0, 0), dtype=np.int64),
        tuple(model.switches),
        *((changes_of_switches, end_switches) if model.switches else ()),
    )


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
    switches : ndarray, shape (m, n_switches), optional
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
    require_tables(model, float(spans[:, 0].min()), float(spans[:, 1].max()))
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
            execution.workers,
            (
                values,
                starts[chosen],
                spans[chosen],
                spans[chosen, 1 if extremes is None else 0],
            ),
            grid[chosen],
            n if grid.shape[1] else 0,
            report,
        )
        if extremes is not None:
            extremes[chosen] = run[0]
        ends[chosen], codes[chosen] = run[3][:, 1:], run[4][:, 0]
        if grid.shape[1]:
            samples[chosen] = run[5]
        place = compiled.switch_place
        end_switches[chosen] = values[:, place : place + 2 * len(model.switches) : 2]
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


def _run(
    compiled: CompiledSeries,
    lanes: CompiledSteps,
    problem: Problem,
    threads: int,
    rows: tuple[Floats, Floats, Floats, Floats],
    times: Floats,
    n_columns: int,
    report: Callable[[int], object],
    ending: _Ends | None = None,
) -> tuple[Any, ...]:
    """Extremes, hits, times seen, ends, codes, samples and last periods of trajectories.

    All share one compiled series.
    """
    values, starts, spans, since = rows
    count, n = starts.shape
    counted = (since <= spans[:, 0])[:, None]
    extremes = np.stack(
        [np.where(counted, starts, np.inf), np.where(counted, starts, -np.inf)], axis=1
    )
    kicks = len(compiled.resets) - compiled.n_walls
    hits = np.zeros((count, compiled.n_interfaces + kicks, 2), dtype=np.int64)
    seen = np.full((count, len(compiled.modes)), -np.inf)
    places, carried, whole = beginnings(spans[:, 0], starts, compiled.n_forcing, problem.rules)
    codes = np.empty(count, dtype=np.int64)
    samples = np.full((count, n_columns, times.shape[1]), np.nan)
    many = load_loop(INTEGRATE_MANY)
    stops = spans.copy()
    runs = Runs(
        values, stops, since, times, samples, extremes, hits, seen, places, carried, whole, codes
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

    def advance(chunk: tuple[int, int], pool: Pool, workspace: Workspace) -> Iterator[int]:
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
    if min(threads, len(chunks)) == 1:
        for following, number in in_progress.items():
            for code in following:
                provide(code, problem.n_fast)
            report(number)
    else:
        executor = ThreadPoolExecutor(min(threads, len(chunks)))
        try:
            waiting = {executor.submit(next, f, None): f for f in in_progress}
            while waiting:
                # this thread handles signals, on some systems only between two waits
                for done in wait(waiting, timeout=0.5, return_when=FIRST_COMPLETED).done:
                    following, needed = waiting.pop(done), done.result()
                    if needed is None:
                        report(in_progress[following])
                    else:
                        provide(needed, problem.n_fast)
                        waiting[executor.submit(next, following, None)] = following
        finally:
            stopping.set()
            executor.shutdown(cancel_futures=True)
    undecided = np.flatnonzero(codes == NO_SWITCH_STATE)
    if len(undecided):
        which = int(undecided[0])
        name = compiled.switches[int(whole[which, INTERFACE]) - problem.first_switch]
        raise ArgumentError(no_switch_state(name, f" of a trajectory from {starts[which]}"))
    extremes[np.isinf(extremes)] = np.nan
    endings = np.column_stack([codes, whole[:, MODE], whole[:, STEPS]])
    last = None if kept is None else (kept.touched, kept.states)
    return extremes, hits, seen, places[:, : 1 + n], endings, samples, last
