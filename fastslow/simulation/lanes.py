"""Many trajectories: their plain steps several at once, everything else one by one.

What becomes of a trajectory depends on itself alone: a step that can be taken in
lanes is taken in lanes, beside copies of another one where there are too few.
"""

from __future__ import annotations

import math

import numpy as np

from fastslow.compiled import lane_steps as step
from fastslow.compiled.lanes import WIDTH
from fastslow.compiled.parts import part
from fastslow.compiled.pointers import call_address
from fastslow.simulation.driver import HANDED_OVER, advance
from fastslow.simulation.extremes import widen_extremes
from fastslow.simulation.polynomials import ZERO, sample
from fastslow.simulation.rooms import (
    CALM,
    CARRIED,
    COUNTED,
    LATE,
    MODE,
    SAMPLES,
    STEPS,
    USUAL,
    put_at_start,
    room_for,
)

#: Trajectories under way at a time, so that some region has one for every lane.
UNDER_WAY = 8 * WIDTH


@part
def drive_many(
    bounds,
    address,
    lanes,
    layout,
    sizes,
    signs,
    continuous,
    tol,
    limits,
    parameters,
    starts,
    spans,
    since,
    times,
    samples,
    extremes,
    hits,
    seen,
    ends,
    codes,
):
    """Follow the trajectories from one number to another.

    The arguments are those of `advance` with one row for each trajectory
    (``times`` may have one row for all); ``lanes`` holds the address of the plain
    steps and the number of their regions; ``ends`` is filled with time and state
    reached, ``codes`` with how it ended, in which mode, after how many steps.
    """
    n_states, n_forcing, _, _, order = layout
    columns, kept = order + 1, n_states + n_forcing
    steps, regions = lanes
    n_values = parameters.shape[1]
    under_way = min(UNDER_WAY, bounds[1] - bounds[0])
    places = np.empty((under_way, 1 + kept))
    carried = np.empty((under_way, CARRIED))
    counted = np.empty((under_way, COUNTED), dtype=np.int64)
    which = np.empty(under_way, dtype=np.int64)
    room = room_for(layout, sizes, times.shape[1])
    rows = np.zeros((1 + n_states + step.ROWS + 2 * n_states, WIDTH))
    given = np.empty((n_values + 1, WIDTH))
    series = np.empty((kept * columns, WIDTH))
    held = np.full(WIDTH, -1, dtype=np.int64)
    given[n_values] = math.log2(tol)
    # stacks of those that wait for a lane in each region, and for a step by themselves
    ready, n_ready = (
        np.empty((max(regions, 1), under_way), dtype=np.int64),
        np.zeros(max(regions, 1), np.int64),
    )
    alone, n_alone = np.arange(under_way), under_way
    store = np.empty(0)
    count = mode = ZERO
    following = bounds[0]
    for slot in range(under_way):
        which[slot] = following
        put_at_start(
            places[slot], carried[slot], counted[slot], spans[following, 0], starts[following]
        )
        following += 1
    while True:
        while n_alone > 0:
            slot = alone[n_alone - 1]
            i = which[slot]
            code, _ = advance(
                address,
                layout,
                sizes,
                signs,
                continuous,
                parameters[i],
                (spans[i, 0], spans[i, 1]),
                tol,
                times[min(i, times.shape[0] - 1)],
                samples[i],
                since[i],
                False,
                limits,
                store,
                extremes[i],
                hits[i],
                seen[i],
                room,
                places[slot],
                carried[slot],
                counted[slot],
                regions,
            )
            if code == HANDED_OVER:
                region = counted[slot, MODE]
                ready[region, n_ready[region]] = slot
                n_ready[region] += 1
                n_alone -= 1
                continue
            for k in range(1 + n_states):
                ends[i, k] = places[slot, k]
            codes[i, 0], codes[i, 1], codes[i, 2] = code, counted[slot, MODE], counted[slot, STEPS]
            if following < bounds[1]:
                which[slot] = following
                put_at_start(
                    places[slot],
                    carried[slot],
                    counted[slot],
                    spans[following, 0],
                    starts[following],
                )
                following += 1
            else:
                n_alone -= 1
        fullest = mode
        for region in range(regions):
            if n_ready[region] > n_ready[fullest]:
                fullest = region
        if count == 0 or count + n_ready[mode] < min(n_ready[fullest], WIDTH):
            # another region fills more lanes
            for lane in range(WIDTH):
                slot = held[lane]
                if slot >= 0:
                    i = which[slot]
                    put_down(
                        rows, lane, limits[0], since[i], places[slot], carried[slot],
                        counted[slot], extremes[i], seen[i],
                    )  # fmt: skip
                    ready[mode, n_ready[mode]] = slot
                    n_ready[mode] += 1
                    held[lane] = -1
            count, mode = ZERO, fullest
        if count + n_ready[mode] == 0:
            break
        for lane in range(WIDTH):
            if held[lane] < 0 and n_ready[mode] > 0:
                n_ready[mode] -= 1
                count += 1
                slot = ready[mode, n_ready[mode]]
                i = which[slot]
                held[lane] = slot
                take_up(
                    rows, lane, limits[0], sizes[2] > 0, since[i], places[slot], carried[slot],
                    counted[slot], extremes[i], spans[i, 1], times[min(i, times.shape[0] - 1)],
                )  # fmt: skip
                for k in range(n_values):
                    given[k, lane] = parameters[i, k]
        if count < WIDTH:
            copy_into_the_rest(held, rows, given)
        call_address(steps, mode, rows, given, series)
        for lane in range(WIDTH):
            slot = held[lane]
            if slot < 0:
                continue
            i = which[slot]
            outcome = rows[1 + n_states + step.OUTCOME, lane]
            if outcome == step.REPORTED:
                report(
                    rows, lane, series, layout, since[i], counted[slot],
                    times[min(i, times.shape[0] - 1)], samples[i], extremes[i], room,
                )  # fmt: skip
            elif outcome == step.NOT_TAKEN:
                put_down(
                    rows, lane, limits[0], since[i], places[slot], carried[slot],
                    counted[slot], extremes[i], seen[i],
                )  # fmt: skip
                held[lane] = -1
                count -= 1
                alone[n_alone] = slot
                n_alone += 1


@part
def take_up(rows, lane, max_steps, settling, since, place, carried, counted, extremes, stop, times):
    """Give a trajectory a lane."""
    n = extremes.shape[1]
    for k in range(1 + n):
        rows[k, lane] = place[k]
    rows[1 + n + step.LATE, lane] = carried[LATE]
    rows[1 + n + step.USUAL, lane] = carried[USUAL]
    rows[1 + n + step.ALLOWED, lane] = max_steps - counted[STEPS]
    rows[1 + n + step.CALM, lane] = counted[CALM] if settling else np.inf
    rows[1 + n + step.NEXT, lane] = next_time(times, counted[SAMPLES])
    counting = place[0] >= since
    rows[1 + n + step.LIMIT, lane] = stop if counting else min(since, stop)
    for k in range(n):
        rows[1 + n + step.ROWS + k, lane] = extremes[0, k] if counting else -np.inf
        rows[1 + n + step.ROWS + n + k, lane] = extremes[1, k] if counting else np.inf


@part
def put_down(rows, lane, max_steps, since, place, carried, counted, extremes, seen):
    """Take a trajectory from its lane."""
    n = extremes.shape[1]
    steps = max_steps - np.int64(rows[1 + n + step.ALLOWED, lane])
    if steps > counted[STEPS]:
        seen[counted[MODE]] = rows[0, lane]
        if rows[1 + n + step.CALM, lane] < np.inf:
            counted[CALM] = np.int64(rows[1 + n + step.CALM, lane])
        counted[STEPS] = steps
    if place[0] >= since:
        for k in range(n):
            extremes[0, k] = rows[1 + n + step.ROWS + k, lane]
            extremes[1, k] = rows[1 + n + step.ROWS + n + k, lane]
    for k in range(1 + n):
        place[k] = rows[k, lane]
    carried[USUAL] = rows[1 + n + step.USUAL, lane]


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
def report(rows, lane, series, layout, since, counted, times, samples, extremes, room):
    """Add the samples and the extremes within the last step of a lane."""
    n, _, _, _, order = layout
    _, W, b, d, stack = room[:5]
    offsets = room[11]
    began, length = rows[1 + n + step.BEGAN, lane], rows[1 + n + step.LENGTH, lane]
    for k in range(series.shape[0]):
        W[k] = series[k, lane]
    if began >= since:
        for k in range(n):
            extremes[0, k] = rows[1 + n + step.ROWS + k, lane]
            extremes[1, k] = rows[1 + n + step.ROWS + n + k, lane]
        widen_extremes(W, n, order, 0.0, length, extremes, b, d, stack)
        for k in range(n):
            rows[1 + n + step.ROWS + k, lane] = extremes[0, k]
            rows[1 + n + step.ROWS + n + k, lane] = extremes[1, k]
    first = last = counted[SAMPLES]
    while last < times.shape[0] and times[last] <= rows[0, lane]:
        offsets[last] = (times[last] - began) - rows[1 + n + step.LATE, lane]
        last += 1
    if last > first:
        sample(W, order + 1, samples.shape[0], offsets[first:last], samples, first)
    counted[SAMPLES] = last
    rows[1 + n + step.NEXT, lane] = next_time(times, last)


@part
def next_time(times, k):
    """The time of a sample, infinite after the last."""
    return times[k] if k < times.shape[0] else np.inf
