"""Phases of the stepping loop within a step: it is expanded, ended at an event, and recorded."""

from __future__ import annotations

from fastslow.kernels.compiler.decorators import inlined_kernel, kernel
from fastslow.kernels.simd.lane_steps import SUDDEN
from fastslow.simulation.stepper.event_location import (
    error_acceptable,
    find_event,
    project_onto_interfaces,
)
from fastslow.simulation.stepper.extremes import widen_extremes
from fastslow.simulation.stepper.implicit import (
    DAMPING,
    IMPLICIT,
    LONGEST_WAIT,
    PAYS,
    RADAU,
    WAIT,
    Lengths,
    limited_by_stability,
    long_step,
)
from fastslow.simulation.stepper.motion_selection import MISSING, expand, expanded, series_length
from fastslow.simulation.stepper.phases import (
    ACCUMULATION,
    ADVANCE,
    BEGIN,
    CROWD,
    HANDED_OVER,
    LOCATE,
    NEEDS_COLLOCATION,
    NEEDS_RADAU,
    NOT_FINITE,
    OUT_OF_WORK,
    SETTLE,
    STEP_TOO_SMALL,
    TOO_MANY_STEPS,
)
from fastslow.simulation.stepper.polynomials import horner, slope, take_samples
from fastslow.simulation.stepper.scales import (
    REACHED,
    flush,
    raise_sizes,
    remember_sizes,
)
from fastslow.simulation.stepper.workspace import (
    AHEAD,
    CALM,
    CHOOSING,
    COLLOCATED_WORK,
    CROWDED,
    DEPTH,
    FINAL,
    FLOOR,
    FRESH,
    IMPLICIT_WORK,
    IN_A_ROW,
    INTERFACE,
    LAST_EVENT,
    LATE,
    LONG,
    LONGEST,
    MODE,
    PAUSE,
    RAISED,
    SAMPLES,
    SIZES,
    SPEED,
    STEP_LENGTH,
    STEPS,
    TOUCHED,
    UNTIL,
    USUAL,
    WANTED,
    WORK,
)


@kernel
def remaining_time(run):
    """Time until the next instant, or the end."""
    return (run.carried[UNTIL] - run.inputs[0]) - run.carried[LATE]


@kernel
def length_at(t, h, resets):
    """Length of a step at time t that ends at a floating-point number, up to rounding h.

    In a model with resets it may be shorter than the rounding error of t, as in the upstroke of
    a spike that a reset ends; elsewhere it is then zero.
    """
    between = (t + h) - t
    return h if between == 0.0 and resets else between


@inlined_kernel
def expand_motion(problem, run, W, scales, collocation):
    """Expand the series of the motion, where no implicit step has left its beginning."""
    counted, carried, columns = run.counted, run.carried, problem.order + 1
    if counted[STEPS] == problem.max_steps:
        return TOO_MANY_STEPS
    if counted[IN_A_ROW] == 0:
        mode, remaining = counted[MODE], remaining_time(run)
        if counted[AHEAD] > 0:
            longest = expanded(problem, run, mode, remaining, W, scales, collocation, True)
        else:
            longest = expand(problem, run, mode, remaining, W, scales, collocation, True)
        counted[AHEAD] = counted[RAISED] = False
        if longest == MISSING:
            return NEEDS_COLLOCATION
        usual, collocated = carried[USUAL], collocation.memory[0] > 0.0
        if counted[FRESH] > 0 and longest < SUDDEN * (usual if usual > 0.0 else remaining):
            # a repeated step starts from the sizes before it
            counted[RAISED] = True
            n_rows = problem.rules.shape[1]
            for i in range(n_rows):
                carried[SIZES + i] = scales[REACHED, i]
            raise_sizes(W, n_rows, problem.order, problem.tol, remaining, problem.rules, scales)
            if not collocated:
                longest = series_length(problem, mode, remaining, W, scales)
        if not longest > 0.0:
            return NOT_FINITE
        carried[LONGEST] = longest
        if collocated:
            counted[WORK] -= COLLOCATED_WORK
    for i in range(problem.n_states, problem.n_states + problem.n_forcing):
        run.inputs[1 + i] = W[i * columns]
    counted[CALM] -= 1
    if problem.n_fast > 0 and counted[CALM] <= 0:
        longest = carried[LONGEST]
        if counted[IN_A_ROW] > 0 or limited_by_stability(problem, W, longest, scales):
            return SETTLE
    return LOCATE


@inlined_kernel
def settle(problem, run, series, scales, search, implicit, collocation):
    """Try an implicit step; where none pays, go on with the series."""
    counted, carried = run.counted, run.carried
    mode, longest, in_a_row = counted[MODE], carried[LONGEST], counted[IN_A_ROW]
    remaining = remaining_time(run)
    if in_a_row == 0:
        carried[WANTED] = 1.25 * longest
        implicit.radau.phase[0] = 0.0
    counted[WORK] -= IMPLICIT_WORK + problem.n_fast * problem.n_fast // 8
    least = (1.1 if in_a_row < DAMPING else PAYS) * longest
    lengths = Lengths(carried[WANTED], least, longest, remaining)
    taken, growth = long_step(problem, run, mode, lengths, series, scales, search, implicit)
    if taken == MISSING:
        if in_a_row == 0 and counted[RAISED] > 0:
            for i in range(problem.rules.shape[1]):
                scales[REACHED, i] = carried[SIZES + i]
        counted[CALM] += 1
        return NEEDS_RADAU
    if taken > 0.0:
        carried[WANTED], carried[STEP_LENGTH] = growth * taken, taken
        counted[PAUSE], counted[IN_A_ROW], counted[INTERFACE] = WAIT, in_a_row + 1, -1
        counted[FINAL], counted[LONG], counted[FRESH] = taken >= remaining, True, False
        return ADVANCE
    counted[PAUSE] = min(2 * counted[PAUSE], LONGEST_WAIT)
    counted[CALM] = counted[PAUSE]
    if in_a_row > 0:
        counted[IN_A_ROW] = 0
        longest = expand(problem, run, mode, remaining, series.left, scales, collocation, True)
        if longest == MISSING:
            counted[CALM] += 1
            return NEEDS_COLLOCATION
        if not longest > 0.0:
            return NOT_FINITE
        carried[LONGEST] = longest
    return LOCATE


@inlined_kernel
def locate(problem, run, W, work, scales, search):
    """Locate the first event within a step of the series, whose end is checked if it is long."""
    counted, carried, t = run.counted, run.carried, run.inputs[0]
    mode, longest, usual = counted[MODE], carried[LONGEST], carried[USUAL]
    resets, remaining = problem.first_wall < problem.n_interfaces, remaining_time(run)
    final = longest >= remaining
    # a step between two floating-point times loses no time to rounding
    h = remaining if final else length_at(t, longest, resets)
    if h == 0.0:
        return STEP_TOO_SMALL
    while True:
        s, interface, touched, depth, floor = find_event(problem, run, mode, W, h, search)
        taken = s * h if interface >= 0 else h
        # after strong growth of the step the last terms may be small by accident
        doubtful = taken > 2.0 * usual or longest > 4.0 * remaining
        if (
            h == 0.0
            or not doubtful
            or error_acceptable(problem, run, mode, W, taken, scales, work, search)
        ):
            break
        h, final = length_at(t, 0.25 * taken, resets), False
    if h == 0.0:
        return STEP_TOO_SMALL
    carried[USUAL], carried[STEP_LENGTH] = max(taken, 0.1 * usual), taken
    carried[DEPTH], carried[FLOOR] = depth, floor
    counted[INTERFACE], counted[TOUCHED] = interface, touched
    counted[FINAL] = final and (interface < 0 or s == 1.0)
    counted[LONG], counted[FRESH] = False, False
    return ADVANCE


@inlined_kernel
def advance(problem, run, record, W, workspace, handed):
    """Advance to the end of the step, and record it."""
    counted, carried, inputs, search = run.counted, run.carried, run.inputs, workspace.search
    mode, interface, taken = counted[MODE], counted[INTERFACE], carried[STEP_LENGTH]
    columns, kept = problem.order + 1, problem.n_states + problem.n_forcing
    begin, lag = inputs[0], carried[LATE]
    if interface >= problem.first_wall:
        row = (kept + interface) * columns
        carried[SPEED] = slope(W, row, row + problem.order, taken)
    t = advance_time(run)
    if taken > 0.0:
        remember_sizes(problem.rules, workspace.scales)
        if interface >= problem.first_wall:
            # a flight may begin and end on the wall
            row = (kept + interface) * columns
            height = abs(horner(W, row, row + problem.order, 0.5 * taken))
            reached = workspace.scales[REACHED, kept + interface]
            workspace.scales[REACHED, kept + interface] = max(reached, height)
        record_step(problem, run, record, W, begin, lag, t, workspace)
        step, count = (begin, lag, t), counted[SAMPLES]
        counted[SAMPLES] = take_samples(
            W, columns, step, record.times, record.samples, count, workspace.offsets
        )
        for i in range(kept):
            inputs[1 + i] = horner(W, i * columns, i * columns + problem.order, taken)
        flush(inputs, problem.n_states)
    inputs[0] = t
    for j in range(problem.n_interfaces):
        search.hit[j] = problem.signs[mode, j] == 0
        # a motion that remains on an interface may leave it in the next step: check again
        search.on[j] = search.remains[j]
        if search.remains[j]:
            counted[CHOOSING] = True
    if interface >= 0:
        search.hit[interface] = counted[CHOOSING] = True
    project_onto_interfaces(problem, run, interface, search, workspace.scales)
    counted[WORK] -= 1
    if interface >= 0:
        near = t - carried[LAST_EVENT] <= 1e-13 * max(abs(t), run.stop - run.begin)
        counted[CROWDED] = counted[CROWDED] + 1 if near else 0
        carried[LAST_EVENT] = t
        if counted[CROWDED] == CROWD:
            return ACCUMULATION
    elif mode < handed and counted[CHOOSING] + counted[FINAL] + counted[IN_A_ROW] == 0:
        return HANDED_OVER
    return OUT_OF_WORK if counted[WORK] <= 0 else BEGIN


@inlined_kernel
def advance_time(run):
    """Return the time at the end of the step, of which `LATE` keeps what is lost to rounding."""
    counted, carried, begin = run.counted, run.carried, run.inputs[0]
    taken, lag = carried[STEP_LENGTH], carried[LATE]
    if counted[FINAL] > 0:
        t, carried[LATE] = carried[UNTIL], 0.0
    elif counted[INTERFACE] >= 0:
        t = begin + taken
        carried[LATE] = lag + (taken - (t - begin))
    elif (begin + taken) - begin == taken:
        t = begin + taken
    else:
        # a step within the rounding error of the time
        t = begin + (lag + taken)
        carried[LATE] = (lag + taken) - (t - begin)
    return t


@inlined_kernel
def record_step(problem, run, record, W, begin, lag, t, workspace):
    """List the step, and store its series; without lists, update extremes and times."""
    counted, steps, store = run.counted, record.steps, record.store
    row, mode, taken = counted[STEPS], counted[MODE], run.carried[STEP_LENGTH]
    if record.extremes.shape[0] == 0:
        steps[row, 0], steps[row, 1], steps[row, 2] = begin, taken, mode
        kind = RADAU if workspace.implicit.radau.phase[0] > 0.0 else IMPLICIT
        steps[row, 3] = kind if counted[LONG] > 0 else workspace.collocation.memory[0]
    else:
        record.seen[mode] = t
        if t > run.since:
            unused = (run.since - begin) - lag
            widen_extremes(W, problem.order, unused, taken, record.extremes, workspace.search)
    if store.shape[0] > 0:
        stride = (problem.n_states + problem.n_forcing) * (problem.order + 1)
        coefficients = store[row * stride : (row + 1) * stride]
        for i in range(stride):
            coefficients[i] = W[i]
    counted[STEPS] += 1
