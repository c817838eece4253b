"""Simulating a model from many states or at many parameter sets."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastslow.arguments import finite, flag, instance, mapping, takes, text, whole
from fastslow.compiled.generic import load_loop
from fastslow.compiled.lane_steps import CompiledSteps, compile_steps
from fastslow.compiled.series import CompiledSeries
from fastslow.model.model import Model
from fastslow.results.ensembles import Ensemble, regimes
from fastslow.results.named import Named
from fastslow.simulation.grouping import alike
from fastslow.simulation.lanes import pool_for
from fastslow.simulation.many_arguments import (
    periods_of,
    spans_of,
    starts_and_parameters,
    threads_of,
    times_of,
)
from fastslow.simulation.rooms import MODE, STEPS, beginnings
from fastslow.simulation.settings import (
    DEFAULT,
    Integration,
    Resolved,
    integration_settings,
    resolve,
)
from fastslow.simulation.trajectories import (
    SOURCES,
    error_rules,
    gap_of,
    layout_of,
    once_a_model,
    series_of,
    sizes_of,
)

Floats = NDArray[np.float64]

steps_of = once_a_model(compile_steps)

_ARGUMENTS = (
    "bounds",
    "address",
    "lanes",
    "layout",
    "sizes",
    "signs",
    "continuous",
    "tol",
    "rules",
    "limits",
    "parameters",
    "spans",
    "since",
    "times",
    "samples",
    "extremes",
    "hits",
    "seen",
    "places",
    "carried",
    "counted",
    "codes",
    "pool",
)

_LANES = ("fastslow.compiled.lanes", "fastslow.compiled.lane_steps")

#: Trajectories that a thread takes at a time, at most.
_CHUNK = 512


@takes(
    model=instance(Model),
    parameters=mapping,
    start=finite,
    settle=finite,
    integration=integration_settings,
    gap=text,
    threads=whole(1, 1024),
    progress=flag,
)
def simulate_many(
    model: Model,
    states: ArrayLike | Mapping[Any, ArrayLike],
    *,
    parameters: Mapping[Any, ArrayLike] | None = None,
    t: tuple[float, float] | None = None,
    periods: float | None = None,
    start: float = 0.0,
    period: ArrayLike | None = None,
    settle: float = 0.0,
    integration: Integration = DEFAULT,
    samples: int | Sequence[float] | Floats | None = None,
    gap: str | None = None,
    threads: int | None = None,
    progress: bool = False,
) -> Ensemble:
    """Follow many trajectories, and keep of each what sums it up.

    Plain steps are taken for several trajectories at once, by vector
    instructions; crossings and all that is not plain one by one, as `simulate`
    takes them. A trajectory is the same to the last bit whatever the others,
    their order and the number of threads, and that of `simulate` to the tolerance.
    One that cannot go on stops nothing; `Ensemble.outcomes` says why it ended.

    Parameters
    ----------
    model : Model
        With forcing, with slow states, or frozen with every parameter given.
    states : array_like, shape (m, n) or (n,), or mapping
        Initial states and slow states; by name, each a number or of shape (m,).
    parameters : mapping, optional
        Parameter to its values, a number or of shape (m,): the first values make
        the first set, and so on; no product is formed.
    t : (float, float)
        Start and end of time, for all.
    periods : float
        Instead of ``t``: how many periods of the forcing, each trajectory by its own.
    start : float
        Start of time with ``periods``.
    period : float or array_like, shape (m,), optional
        The period, where the model's own is not wanted or cannot be found.
    settle : float
        How much is left out of extremes, hits and evenly spaced samples at the
        beginning: periods with ``periods``, time with ``t``.
    integration : Integration
        Error allowed, order and method of the steps, and where to stop a trajectory.
    samples : int or sequence of float, optional
        How many evenly spaced samples of every column to keep, or at which times.
    gap : str, optional
        The region that counts as the gap for `Ensemble.regime`.
    threads : int, optional
        By default the cores that this process may use.
    progress : bool
        Whether to show a progress bar.

    Returns
    -------
    Ensemble

    Raises
    ------
    ArgumentError
        For lengths that differ, numbers that are not finite, a wrong span, or
        ``periods`` without a common period.
    UnknownNameError
        For a state, parameter or gap that is not in the model.
    ModelError
        For a function that cannot be compiled.

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
    resolved = resolve(integration, model, implicit=False)
    threads = threads_of(threads)
    own = periods_of(model, period, count, swept)
    spans, since = spans_of(t, periods, start, settle, own)
    times = times_of(samples, spans, since)
    groups = [
        (one, chosen, series_of(one, resolved.order), steps_of(one, resolved.order))
        for one, chosen in alike(model, swept, count)
    ]
    gaps = [gap_of(one, gap) for one, *_ in groups]
    modes = tuple(dict.fromkeys(name for *_, compiled, _ in groups for name in compiled.modes))
    interfaces = tuple(dict.fromkeys(name for one, *_ in groups for name in one.interfaces))
    n = starts.shape[1]
    columns = n + len(model.forcing)
    extremes = np.empty((count, 2, n))
    hits = np.zeros((count, len(interfaces), 2), dtype=np.int64)
    ends = np.empty((count, 1 + n))
    codes = np.empty((count, 3), dtype=np.int64)
    regime = np.zeros(count, dtype="U16")
    sampled = np.empty((count, columns if times.size else 0, times.shape[1]))
    with _bar(count, progress) as bar:
        for (one, chosen, compiled, lanes), between in zip(groups, gaps, strict=True):
            values = _parameter_table(compiled, one, swept, chosen)
            run = _run(
                compiled,
                lanes,
                resolved,
                error_rules(one, resolved, compiled),
                threads,
                sizes_of(model, compiled, resolved.implicit),
                (values, starts[chosen], spans[chosen], since[chosen]),
                times if len(times) == 1 else times[chosen],
                columns if times.size else 0,
                bar.update,
            )
            extremes[chosen], ends[chosen], codes[chosen], sampled[chosen] = run[0], *run[3:]
            for j, name in enumerate(one.interfaces):
                hits[chosen, interfaces.index(name)] = run[1][:, j]
            # the mode is -1 before any was chosen
            names = [*map(modes.index, compiled.modes), -1]
            codes[chosen, 1] = np.array(names)[codes[chosen, 1]]
            if between is not None:
                regime[chosen] = regimes(
                    run[2], ends[chosen, 0], own[chosen], compiled.modes, between
                )
    return Ensemble(
        (*model.states, *model.slow_states),
        tuple(model.forcing),
        interfaces,
        modes,
        Named("parameter", swept),
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
    )


def _parameter_table(
    compiled: CompiledSeries, model: Model, swept: Mapping[str, Floats], chosen: NDArray[np.intp]
) -> Floats:
    """Parameter values for each trajectory in the order of the compiled function."""
    table = np.zeros((len(chosen), max(1, len(compiled.parameters))))
    for column, name in enumerate(compiled.parameters):
        table[:, column] = swept[name][chosen] if name in swept else model.parameters[name]
    return table


def _run(
    compiled: CompiledSeries,
    lanes: CompiledSteps,
    resolved: Resolved,
    rules: Floats,
    threads: int,
    sizes: tuple[int, int, int],
    rows: tuple[Floats, Floats, Floats, Floats],
    times: Floats,
    n_columns: int,
    report: Callable[[int], object],
) -> tuple[Any, ...]:
    """Extremes, hits, times seen, ends, codes and samples of trajectories with one series."""
    values, starts, spans, since = rows
    count, n = starts.shape
    counted = (since <= spans[:, 0])[:, None]
    extremes = np.stack(
        [np.where(counted, starts, np.inf), np.where(counted, starts, -np.inf)], axis=1
    )
    hits = np.zeros((count, compiled.n_interfaces, 2), dtype=np.int64)
    seen = np.full((count, len(compiled.modes)), -np.inf)
    places, carried, whole = beginnings(spans[:, 0], starts, compiled.n_forcing, rules)
    codes = np.empty(count, dtype=np.int64)
    samples = np.full((count, n_columns, times.shape[1]), np.nan)
    layout = layout_of(compiled)
    many = _many_loop()

    def follow(chunk: tuple[int, int]) -> None:
        many(
            chunk,
            compiled.address,
            (lanes.address, lanes.regions),
            layout,
            sizes,
            compiled.signs,
            compiled.continuous,
            resolved.rtol,
            rules,
            resolved.limits,
            values,
            spans,
            since,
            times,
            samples,
            extremes,
            hits,
            seen,
            places,
            carried,
            whole,
            codes,
            pool_for(layout, lanes.regions, values.shape[1], count),
        )

    size = min(_CHUNK, max(1, count // (4 * threads)))
    chunks = [(i, min(i + size, count)) for i in range(0, count, size)]
    if min(threads, len(chunks)) == 1:
        for chunk in chunks:
            follow(chunk)
            report(chunk[1] - chunk[0])
    else:
        pool = ThreadPoolExecutor(min(threads, len(chunks)))
        try:
            waiting = {pool.submit(follow, chunk): chunk for chunk in chunks}
            for done in as_completed(waiting):
                done.result()
                first, last = waiting[done]
                report(last - first)
        finally:
            pool.shutdown(cancel_futures=True)
    extremes[np.isinf(extremes)] = np.nan
    endings = np.column_stack([codes, whole[:, MODE], whole[:, STEPS]])
    return extremes, hits, seen, places[:, : 1 + n], endings, samples


def _bar(count: int, shown: bool) -> Any:
    from tqdm import tqdm

    return tqdm(total=count, disable=not shown, unit="run")


def _many_loop() -> Callable[..., Any]:
    """The compiled loop over trajectories."""
    return load_loop("fastslow.simulation.lanes", "drive_many", _ARGUMENTS, (*SOURCES, *_LANES))
