"""Many trajectories: their plain steps several at once, everything else one by one.

What becomes of a trajectory depends on itself alone: a step that can be taken in
lanes is taken in lanes, beside copies of another one where there are too few.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.compiled import lane_steps as step
from fastslow.compiled.lanes import WIDTH
from fastslow.compiled.parts import part
from fastslow.compiled.pointers import call_address
from fastslow.simulation.driver import HANDED_OVER, OUT_OF_WORK, REACHED_END, drive
from fastslow.simulation.extremes import widen_extremes
from fastslow.simulation.polynomials import ZERO, sample
from fastslow.simulation.rooms import CALM, LATE, MODE, SAMPLES, SIZES, STEPS, USUAL, WORK
from fastslow.simulation.scales import FIXED, LASTING

#: Trajectories under way at a time, so that some region has one for every lane.
UNDER_WAY = 8 * WIDTH

#: Steps in lanes before the loop is asked whether to go on.
IN_LANES = 1000

#: What the loop goes on from after a pause: that it paused, the next trajectory that is not yet
#: under way, how many are to be followed alone and in lanes, the mode of those, the work left.
PAUSED, FOLLOWING, ALONE, COUNT, LANES_MODE, LEFT = range(6)


def pool_for(
    layout: tuple[int, int, int, int, int], regions: int, n_values: int, count: int
) -> tuple[NDArray[Any], ...]:
    """Work space of `drive_many`: what is in the lanes, and who waits for what."""
    n, n_forcing, n_interfaces, _, order = layout
    rows = n + n_forcing + n_interfaces
    under_way = min(UNDER_WAY, count)
    return (
        np.zeros((1 + n + step.ROWS + 2 * n + rows, WIDTH)),
        np.zeros((n_values + 1 + 2 * rows, WIDTH)),
        np.empty(((n + n_forcing) * (order + 1), WIDTH)),
        np.empty(WIDTH, dtype=np.int64),
        np.empty((max(1, regions), under_way), dtype=np.int64),
        np.empty(max(1, regions), dtype=np.int64),
        np.empty(under_way, dtype=np.int64),
        np.zeros(WIDTH, dtype=np.int64),
        np.zeros(LEFT + 1, dtype=np.int64),
    )


@part
def drive_many(
    bounds,
    late_code,
    address,
    lanes,
    layout,
    sizes,
    signs,
    continuous,
    tol,
    rules,
    limits,
    parameters,
    spans,
    since,
    times,
    samples,
    extremes,
    hits,
    seen,
    places,
    carried,
    counted,
    codes,
    pool,
    room,
):
    """Follow the trajectories from one number to another to their ends, or to a pause.

    The arguments are those of `drive` with one row for each trajectory
    (``times`` may have one row for all); ``lanes`` holds the address of the plain
    steps and the number of their regions, ``codes`` is filled with how each
    ended, ``pool`` comes from `pool_for` and ``room`` from `room_for`; both keep what it
    goes on from after a pause. The last number of the pool is the work up to the next one.

    Returns
    -------
    int
        `REACHED_END`, or why it pauses, as `drive`.
    """
    n_states = layout[0]
    steps, regions = lanes
    rows, given, series, held, ready, n_ready, alone, beyond, progress = pool
    table, store, left = np.empty((0, 0)), np.empty(0), progress[LEFT]
    following, n_alone = progress[FOLLOWING], progress[ALONE]
    count, mode = progress[COUNT], progress[LANES_MODE]
    if progress[PAUSED] == 0:
        following = bounds[0]
        n_alone = count = mode = ZERO
        for region in range(n_ready.shape[0]):
            n_ready[region] = 0
        for lane in range(WIDTH):
            held[lane] = -1
            given[parameters.shape[1], lane] = math.log2(tol)
            for k in range(rules.shape[1]):
                given[parameters.shape[1] + 1 + k, lane] = rules[FIXED, k]
                given[parameters.shape[1] + 1 + rules.shape[1] + k, lane] = rules[LASTING, k]
        while n_alone < min(alone.shape[0], bounds[1] - bounds[0]):
            alone[n_alone] = following
            n_alone += 1
            following += 1
    code = ZERO + REACHED_END
    while True:
        while n_alone > 0:
            i = alone[n_alone - 1]
            counted[i, WORK] = left
            codes[i] = drive(
                late_code,
                address,
                layout,
                sizes,
                signs,
                continuous,
                parameters[i],
                (spans[i, 0], spans[i, 1]),
                tol,
                rules,
                times[min(i, times.shape[0] - 1)],
                samples[i],
                since[i],
                limits,
                table,
                table,
                store,
                extremes[i],
                hits[i],
                seen[i],
                room,
                places[i],
                carried[i],
                counted[i],
                regions,
            )
            left = counted[i, WORK]
            if codes[i] < HANDED_OVER:
                code = codes[i]
                break
            if codes[i] != HANDED_OVER and following < bounds[1]:
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
                    put_down(
                        rows, lane, i, limits, beyond, since, places, carried, counted, extremes,
                        seen,
                    )  # fmt: skip
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
                take_up(
                    rows, lane, i, limits, beyond, since, spans, times, places, carried, counted,
                    extremes,
                )  # fmt: skip
                if sizes[2] == 0:
                    rows[1 + n_states + step.CALM, lane] = np.inf
                for k in range(parameters.shape[1]):
                    given[k, lane] = parameters[i, k]
        if count < WIDTH:
            copy_into_the_rest(held, rows, given)
        allowed = rows[1 + n_states + step.ALLOWED, 0]
        call_address(steps, mode, rows, given, series)
        # the lanes go together, two steps of a trajectory alone in one of theirs
        left -= 2 + 2 * np.int64(allowed - rows[1 + n_states + step.ALLOWED, 0])
        for lane in range(WIDTH):
            i = held[lane]
            if i < 0:
                continue
            outcome = rows[1 + n_states + step.OUTCOME, lane]
            if outcome == step.REPORTED:
                report(
                    rows, lane, i, series, layout, since, times, counted, samples, extremes, room
                )
            elif outcome == step.NOT_TAKEN:
                if rows[1 + n_states + step.ALLOWED, lane] < 1.0 and beyond[lane] > 0:
                    allow(rows, lane, n_states, beyond, beyond[lane])
                    continue
                put_down(
                    rows, lane, i, limits, beyond, since, places, carried, counted, extremes, seen
                )
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


@part
def allow(rows, lane, n, beyond, steps):
    """Allow a lane so many steps, a part of them at a time."""
    first = min(steps, IN_LANES)
    rows[1 + n + step.ALLOWED, lane] = first
    beyond[lane] = steps - first


@part
def take_up(rows, lane, i, limits, beyond, since, spans, times, places, carried, counted, extremes):
    """Give a trajectory a lane."""
    n = extremes.shape[2]
    for k in range(1 + n):
        rows[k, lane] = places[i, k]
    rows[1 + n + step.LATE, lane] = carried[i, LATE]
    rows[1 + n + step.USUAL, lane] = carried[i, USUAL]
    first = 1 + n + step.ROWS + 2 * n
    for k in range(rows.shape[0] - first):
        rows[first + k, lane] = carried[i, SIZES + k]
    allow(rows, lane, n, beyond, limits[0] - counted[i, STEPS])
    rows[1 + n + step.CALM, lane] = counted[i, CALM]
    rows[1 + n + step.NEXT, lane] = next_time(times, i, counted[i, SAMPLES])
    # no extremes are widened before they count, and no step goes from there to where they do
    counting = places[i, 0] >= since[i]
    rows[1 + n + step.LIMIT, lane] = spans[i, 1] if counting else min(since[i], spans[i, 1])
    for k in range(n):
        rows[1 + n + step.ROWS + k, lane] = extremes[i, 0, k] if counting else -np.inf
        rows[1 + n + step.ROWS + n + k, lane] = extremes[i, 1, k] if counting else np.inf


@part
def put_down(rows, lane, i, limits, beyond, since, places, carried, counted, extremes, seen):
    """Take a trajectory from its lane."""
    n = extremes.shape[2]
    steps = limits[0] - beyond[lane] - np.int64(rows[1 + n + step.ALLOWED, lane])
    if steps > counted[i, STEPS]:
        seen[i, counted[i, MODE]] = rows[0, lane]
        counted[i, STEPS] = steps
        if rows[1 + n + step.CALM, lane] < np.inf:
            counted[i, CALM] = np.int64(rows[1 + n + step.CALM, lane])
    if places[i, 0] >= since[i]:
        for k in range(n):
            extremes[i, 0, k] = rows[1 + n + step.ROWS + k, lane]
            extremes[i, 1, k] = rows[1 + n + step.ROWS + n + k, lane]
    for k in range(1 + n):
        places[i, k] = rows[k, lane]
    carried[i, USUAL] = rows[1 + n + step.USUAL, lane]
    first = 1 + n + step.ROWS + 2 * n
    for k in range(rows.shape[0] - first):
        carried[i, SIZES + k] = rows[first + k, lane]


@part
def copy_into_the_rest(held, rows, given):
    """Put copies of one trajectory into the lanes that hold none."""
    first = 0
    while held[first] < 0:
        first += 1
    for lane in range(WIDTH):
        if held[lane] < 0:
            for k in range(rows.shape[0]):
                rows[k, lane] = rows[k, first]
            for k in range(given.shape[0]):
                given[k, lane] = given[k, first]


@part
def report(rows, lane, i, series, layout, since, times, counted, samples, extremes, room):
    """Add the samples and the extremes within the last step of a lane."""
    n, order = layout[0], layout[4]
    _, W, b, d, stack = room[:5]
    offsets = room[11]
    began, length = rows[1 + n + step.BEGAN, lane], rows[1 + n + step.LENGTH, lane]
    for k in range(series.shape[0]):
        W[k] = series[k, lane]
    if began >= since[i]:
        for k in range(n):
            extremes[i, 0, k] = rows[1 + n + step.ROWS + k, lane]
            extremes[i, 1, k] = rows[1 + n + step.ROWS + n + k, lane]
        widen_extremes(W, n, order, 0.0, length, extremes[i], b, d, stack)
        for k in range(n):
            rows[1 + n + step.ROWS + k, lane] = extremes[i, 0, k]
            rows[1 + n + step.ROWS + n + k, lane] = extremes[i, 1, k]
    first = last = counted[i, SAMPLES]
    while next_time(times, i, last) <= rows[0, lane]:
        offsets[last] = (next_time(times, i, last) - began) - rows[1 + n + step.LATE, lane]
        last += 1
    if last > first:
        sample(W, order + 1, samples.shape[1], offsets[first:last], samples[i], first)
    counted[i, SAMPLES] = last
    rows[1 + n + step.NEXT, lane] = next_time(times, i, last)


@part
def next_time(times, i, k):
    """When a sample of a trajectory is due, infinite after the last."""
    return times[min(i, times.shape[0] - 1), k] if k < times.shape[1] else np.inf
