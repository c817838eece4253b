"""Ensembles: plain steps are taken in SIMD lanes, everything else one trajectory at a time.

The result of a trajectory does not depend on the others: a step that can be taken in
lanes always is, with copies of another trajectory in the unused lanes.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from fastslow.kernels.compiler.decorators import kernel
from fastslow.kernels.compiler.pointers import call_address
from fastslow.kernels.compiler.records import (
    IntegerMatrix,
    Integers,
    IntegerTensor,
    Matrix,
    Tensor,
    Vector,
    zeros,
)
from fastslow.kernels.simd import lane_steps as step
from fastslow.kernels.simd.lanes import WIDTH
from fastslow.simulation.stepper.driver import integrate
from fastslow.simulation.stepper.extremes import widen_extremes
from fastslow.simulation.stepper.instants import next_instant
from fastslow.simulation.stepper.phases import HANDED_OVER, OUT_OF_WORK, REACHED_END
from fastslow.simulation.stepper.polynomials import ZERO, take_samples
from fastslow.simulation.stepper.problems import Problem, Record, Run
from fastslow.simulation.stepper.queued_events import next_execution
from fastslow.simulation.stepper.scales import FIXED, LASTING
from fastslow.simulation.stepper.workspace import (
    CALM,
    INTERFACE,
    LATE,
    MODE,
    SAMPLES,
    SIZES,
    STEPS,
    USUAL,
    WORK,
)

#: Trajectories in progress at a time, enough to fill every lane in some region.
IN_PROGRESS = 8 * WIDTH

#: Steps in lanes before the work quota is checked.
IN_LANES = 1000

#: State of the loop across a pause: whether it paused, the next trajectory not yet started, the
#: numbers of those to step alone and of those in lanes, the mode of the lanes, the work left.
PAUSED, FOLLOWING, ALONE, COUNT, LANES_MODE, LEFT = range(6)


class RunTable(NamedTuple):
    """Many runs of a problem with their records: as `Run` and `Record`, row by row.

    Parameters
    ----------
    parameters : float64 array, shape (m, n_parameters)
    spans : float64 array, shape (m, 2)
    since : float64 array, shape (m,)
    times : float64 array, shape (m, n_times) or (1, n_times)
    samples : float64 array, shape (m, n_rows, n_times)
    extremes : float64 array, shape (m, 2, n_states)
    hits : int64 array, shape (m, n_interfaces + n_kicks, 2)
    seen : float64 array, shape (m, n_modes)
    places : float64 array, shape (m, 1 + n_states + n_forcing)
    carried : float64 array, shape (m, SIZES + rows + 2 + n_states)
    counted : int64 array, shape (m, INTEGERS)
    codes : int64 array, shape (m,)
        Outcome of each.
    """

    parameters: Matrix
    spans: Matrix
    since: Vector
    times: Matrix
    samples: Tensor
    extremes: Tensor
    hits: IntegerTensor
    seen: Matrix
    places: Matrix
    carried: Matrix
    counted: IntegerMatrix
    codes: Integers


class Pool(NamedTuple):
    """Assignment of runs to lanes, and the queues of waiting runs.

    Parameters
    ----------
    rows, given, series : float64 arrays, shape (., WIDTH)
        Arguments of the compiled steps.
    held : int64 array, shape (WIDTH,)
        The run in each lane, -1 for none.
    ready : int64 array, shape (regions, under way)
        Runs waiting for a lane, per region; ``n_ready`` is their number.
    n_ready : int64 array, shape (regions,)
    alone : int64 array, shape (under way,)
        Runs whose next step is taken alone.
    beyond : int64 array, shape (WIDTH,)
        Steps allowed to each lane beyond its current quota.
    progress : int64 array, shape (6,)
        State of the loop across a pause, and the work until the next one.
    table : float64 array, shape (0, 0)
    nothing : float64 array, shape (0,)
    """

    rows: Matrix
    given: Matrix
    series: Matrix
    held: Integers
    ready: IntegerMatrix
    n_ready: Integers
    alone: Integers
    beyond: Integers
    progress: Integers
    table: Matrix
    nothing: Vector


def pool_for(problem: Problem, regions: int, n_values: int, count: int) -> Pool:
    """Allocate an empty pool for ``count`` runs with ``n_values`` parameters."""
    n, n_forcing, order = problem.n_states, problem.n_forcing, problem.order
    rows = n + n_forcing + problem.n_interfaces
    in_progress = min(IN_PROGRESS, count)
    return zeros(
        Pool,
        rows=(1 + n + step.LANE_ROWS + 2 * n + rows, WIDTH),
        given=(n_values + 1 + 2 * rows, WIDTH),
        series=((n + n_forcing) * (order + 1), WIDTH),
        held=WIDTH,
        ready=(max(1, regions), in_progress),
        n_ready=max(1, regions),
        alone=in_progress,
        beyond=WIDTH,
        progress=LEFT + 1,
        table=(0, 0),
        nothing=0,
    )


@kernel
def integrate_many(problem, steps, regions, runs, pool, workspace, first, last):
    """Integrate a range of trajectories to their ends, or to a pause.

    Parameters
    ----------
    problem : Problem
    steps, regions : int
        Address of the plain steps, and number of regions.
    runs : RunTable
        Updated in place.
    pool : Pool
        From `pool_for`.
    workspace : StepWorkspace
        Both keep the state of the loop across a pause.
    first, last : int
        Range of runs, the last excluded.

    Returns
    -------
    int
        `REACHED_END`, or the reason of a pause, as in `integrate`.
    """
    n_states, n_values = problem.n_states, runs.parameters.shape[1]
    rules, times = problem.rules, runs.times
    rows, given, held, beyond = pool.rows, pool.given, pool.held, pool.beyond
    ready, n_ready, alone, progress = pool.ready, pool.n_ready, pool.alone, pool.progress
    counted, codes, left = runs.counted, runs.codes, progress[LEFT]
    following, n_alone = progress[FOLLOWING], progress[ALONE]
    count, mode = progress[COUNT], progress[LANES_MODE]
    if progress[PAUSED] == 0:
        following = first
        n_alone = count = mode = ZERO
        for region in range(n_ready.shape[0]):
            n_ready[region] = 0
        for lane in range(WIDTH):
            held[lane] = -1
            given[n_values, lane] = math.log2(problem.tol)
            for k in range(rules.shape[1]):
                given[n_values + 1 + k, lane] = rules[FIXED, k]
                given[n_values + 1 + rules.shape[1] + k, lane] = rules[LASTING, k]
        while n_alone < min(alone.shape[0], last - first):
            alone[n_alone] = following
            n_alone += 1
            following += 1
    code = ZERO + REACHED_END
    while True:
        while n_alone > 0:
            i = alone[n_alone - 1]
            counted[i, WORK] = left
            run = Run(
                begin=runs.spans[i, 0],
                stop=runs.spans[i, 1],
                since=runs.since[i],
                parameters=runs.parameters[i],
                inputs=runs.places[i],
                carried=runs.carried[i],
                counted=counted[i],
            )
            record = Record(
                times=times[min(i, times.shape[0] - 1)],
                samples=runs.samples[i],
                steps=pool.table,
                crossings=pool.table,
                resets=pool.table,
                store=pool.nothing,
                extremes=runs.extremes[i],
                hits=runs.hits[i],
                seen=runs.seen[i],
            )
            codes[i] = integrate(problem, run, record, workspace, regions)
            left = counted[i, WORK]
            if codes[i] < HANDED_OVER:
                code = codes[i]
                break
            if codes[i] != HANDED_OVER and following < last:
                alone[n_alone - 1] = following
                following += 1
                continue
            n_alone -= 1
            if codes[i] == HANDED_OVER:
                region = counted[i, MODE]
                ready[region, n_ready[region]] = i
                n_ready[region] += 1
        if code != REACHED_END:
            break
        fullest = mode
        for region in range(regions):
            if n_ready[region] > n_ready[fullest]:
                fullest = region
        if count == 0 or count + n_ready[mode] < min(n_ready[fullest], WIDTH):
            # another region fills more lanes
            for lane in range(WIDTH):
                i = held[lane]
                if i >= 0:
                    store_lane(problem, runs, pool, lane, i)
                    ready[mode, n_ready[mode]] = i
                    n_ready[mode] += 1
                    held[lane] = -1
            count, mode = ZERO, fullest
        if count + n_ready[mode] == 0:
            break
        for lane in range(WIDTH):
            if held[lane] < 0 and n_ready[mode] > 0:
                n_ready[mode] -= 1
                count += 1
                i = held[lane] = ready[mode, n_ready[mode]]
                load_lane(problem, runs, pool, lane, i)
        if count < WIDTH:
            fill_empty_lanes(held, rows, given)
        allowed = rows[1 + n_states + step.ALLOWED, 0]
        call_address(steps, mode, rows, given, pool.series)
        # one step of all lanes counts as two steps of a single trajectory
        left -= 2 + 2 * np.int64(allowed - rows[1 + n_states + step.ALLOWED, 0])
        for lane in range(WIDTH):
            i = held[lane]
            if i < 0:
                continue
            outcome = rows[1 + n_states + step.OUTCOME, lane]
            if outcome == step.REPORTED:
                report(problem, runs, pool, workspace, lane, i)
            elif outcome == step.NOT_TAKEN:
                if rows[1 + n_states + step.ALLOWED, lane] < 1.0 and beyond[lane] > 0:
                    allow(rows, lane, n_states, beyond, beyond[lane])
                    continue
                store_lane(problem, runs, pool, lane, i)
                held[lane] = -1
                count -= 1
                alone[n_alone] = i
                n_alone += 1
        if left <= 0:
            code = ZERO + OUT_OF_WORK
            break
    progress[PAUSED] = code != REACHED_END
    progress[FOLLOWING], progress[ALONE] = following, n_alone
    progress[COUNT], progress[LANES_MODE] = count, mode
    return code


@kernel
def allow(rows, lane, n, beyond, steps):
    """Set the step quota of a lane, in portions."""
    first = min(steps, IN_LANES)
    rows[1 + n + step.ALLOWED, lane] = first
    beyond[lane] = steps - first


@kernel
def load_lane(problem, runs, pool, lane, i):
    """Load a trajectory into a lane."""
    n, rows, given, begin = problem.n_states, pool.rows, pool.given, runs.places[i, 0]
    carried, counted, extremes, since = runs.carried, runs.counted, runs.extremes, runs.since[i]
    for k in range(1 + n):
        rows[k, lane] = runs.places[i, k]
    rows[1 + n + step.LATE, lane] = carried[i, LATE]
    rows[1 + n + step.USUAL, lane] = carried[i, USUAL]
    first = 1 + n + step.LANE_ROWS + 2 * n
    for k in range(rows.shape[0] - first):
        rows[first + k, lane] = carried[i, SIZES + k]
    allow(rows, lane, n, pool.beyond, problem.max_steps - counted[i, STEPS])
    # no implicit steps without fast states
    rows[1 + n + step.CALM, lane] = counted[i, CALM] if problem.n_fast > 0 else np.inf
    rows[1 + n + step.NEXT, lane] = next_time(runs.times, i, counted[i, SAMPLES])
    rows[1 + n + step.LEFT, lane] = counted[i, INTERFACE]
    # extremes do not change before ``since``, and no step crosses it
    counting = begin >= since
    soonest = min(next_instant(problem, runs.parameters[i]), next_execution(problem, carried[i]))
    stop = min(runs.spans[i, 1], soonest)
    rows[1 + n + step.LIMIT, lane] = stop if counting else min(since, stop)
    for k in range(n):
        rows[1 + n + step.LANE_ROWS + k, lane] = extremes[i, 0, k] if counting else -np.inf
        rows[1 + n + step.LANE_ROWS + n + k, lane] = extremes[i, 1, k] if counting else np.inf
    for k in range(runs.parameters.shape[1]):
        given[k, lane] = runs.parameters[i, k]


@kernel
def store_lane(problem, runs, pool, lane, i):
    """Store a trajectory from its lane."""
    n, rows, places = problem.n_states, pool.rows, runs.places
    carried, counted, extremes = runs.carried, runs.counted, runs.extremes
    steps = problem.max_steps - pool.beyond[lane] - np.int64(rows[1 + n + step.ALLOWED, lane])
    if steps > counted[i, STEPS]:
        runs.seen[i, counted[i, MODE]] = rows[0, lane]
        counted[i, STEPS] = steps
        if rows[1 + n + step.CALM, lane] < np.inf:
            counted[i, CALM] = np.int64(rows[1 + n + step.CALM, lane])
    if places[i, 0] >= runs.since[i]:
        for k in range(n):
            extremes[i, 0, k] = rows[1 + n + step.LANE_ROWS + k, lane]
            extremes[i, 1, k] = rows[1 + n + step.LANE_ROWS + n + k, lane]
    counted[i, INTERFACE] = np.int64(rows[1 + n + step.LEFT, lane])
    for k in range(1 + n):
        places[i, k] = rows[k, lane]
    carried[i, USUAL] = rows[1 + n + step.USUAL, lane]
    first = 1 + n + step.LANE_ROWS + 2 * n
    for k in range(rows.shape[0] - first):
        carried[i, SIZES + k] = rows[first + k, lane]


@kernel
def fill_empty_lanes(held, rows, given):
    """Fill unused lanes with copies of one trajectory."""
    first = 0
    while held[first] < 0:
        first += 1
    for lane in range(WIDTH):
        if held[lane] < 0:
            for k in range(rows.shape[0]):
                rows[k, lane] = rows[k, first]
            for k in range(given.shape[0]):
                given[k, lane] = given[k, first]


@kernel
def report(problem, runs, pool, workspace, lane, i):
    """Add the samples and the extremes within the last step of a lane."""
    n, order, rows, times = problem.n_states, problem.order, pool.rows, runs.times
    W, extremes, counted = workspace.W, runs.extremes, runs.counted
    began, length = rows[1 + n + step.BEGAN, lane], rows[1 + n + step.LENGTH, lane]
    for k in range(pool.series.shape[0]):
        W[k] = pool.series[k, lane]
    if began >= runs.since[i]:
        for k in range(n):
            extremes[i, 0, k] = rows[1 + n + step.LANE_ROWS + k, lane]
            extremes[i, 1, k] = rows[1 + n + step.LANE_ROWS + n + k, lane]
        widen_extremes(W, order, 0.0, length, extremes[i], workspace.search)
        for k in range(n):
            rows[1 + n + step.LANE_ROWS + k, lane] = extremes[i, 0, k]
            rows[1 + n + step.LANE_ROWS + n + k, lane] = extremes[i, 1, k]
    whole = (began, rows[1 + n + step.LATE, lane], rows[0, lane])
    own, samples, offsets = times[min(i, times.shape[0] - 1)], runs.samples[i], workspace.offsets
    counted[i, SAMPLES] = take_samples(
        W, order + 1, whole, own, samples, counted[i, SAMPLES], offsets
    )
    rows[1 + n + step.NEXT, lane] = next_time(times, i, counted[i, SAMPLES])


@kernel
def next_time(times, i, k):
    """Time of the next sample of a trajectory, infinite after the last."""
    return times[min(i, times.shape[0] - 1), k] if k < times.shape[1] else np.inf
