"""The stepping loop: Taylor steps, crossings and samples, compiled once for all models."""

from __future__ import annotations

from fastslow.kernels.compiler.decorators import inlined_kernel, kernel
from fastslow.kernels.compiler.pointers import call_address
from fastslow.kernels.simd.lane_steps import SUDDEN
from fastslow.simulation.stepper.events import (
    MOST_MOVED,
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
    Series,
    limited_by_stability,
    long_step,
)
from fastslow.simulation.stepper.instants import instant_due, next_instant, pass_instant
from fastslow.simulation.stepper.modes import (
    MANY_MODES,
    MISSING,
    NOT_DEFINED,
    UNKNOWN_MODE,
    choose_mode,
    departs,
    expand,
    expanded,
    interface_noise,
    laws_after,
    laws_jump,
    neighbour_mode,
)
from fastslow.simulation.stepper.polynomials import ZERO, horner, slope, take_samples
from fastslow.simulation.stepper.scales import (
    REACHED,
    flush,
    raise_sizes,
    remember_sizes,
    step_length,
)
from fastslow.simulation.stepper.switches import begin_switches, change_switches
from fastslow.simulation.stepper.walls import (
    AWAY,
    BEYOND,
    INTO,
    PRESSED,
    UNKNOWN,
    apply_jump,
    chatter_ends,
    entry_of,
    list_reset,
    matching_mode,
    motion_at_walls,
    note_walls,
    pulled_wall,
)
from fastslow.simulation.stepper.workspace import (
    APPLIED,
    CALM,
    CHOOSING,
    COLLOCATED_WORK,
    CROSSINGS,
    CROWDED,
    DEPTH,
    FLOOR,
    FRESH,
    IMPLICIT_WORK,
    IN_A_ROW,
    INTERFACE,
    JUMPED,
    LAST_EVENT,
    LATE,
    LONGEST,
    MODE,
    PAUSE,
    PAUSED,
    RESETS,
    SAMPLES,
    SIZES,
    SPEED,
    STEPS,
    TOUCHED,
    USUAL,
    WANTED,
    WORK,
)

#: Outcomes of the loop.
REACHED_END = 0
TOO_MANY_STEPS = 1
TOO_MANY_CROSSINGS = 2
STEP_TOO_SMALL = 3
NOT_FINITE = 4
NOT_UNIQUE = 5
NO_CONTINUATION = 6
ACCUMULATION = 7
BEYOND_WALL = 8
NO_SWITCH_STATE = 9
RESET_NOT_FINITE = 10

#: Not finished: after a plain step or a crossing in a region, the lanes may take the next step.
HANDED_OVER = -1

#: Paused between two steps, to be resumed by the next call with identical results: the work
#: quota is used up, a table is full, or code is needed that is not loaded.
OUT_OF_WORK, TABLE_FULL, NEEDS_COLLOCATION, NEEDS_RADAU = -2, -3, -4, -5

#: Consecutive crossings, separated by no more than rounding of time, that end a run.
CROWD = 40

#: A crossing is near-tangential (near grazing) when shifting h by this fraction of its scale
#: removes it.
TANGENTIAL = 1e-6


@kernel
def events_at_once(problem):
    """Largest number of resets and changes of switches that are listed at the same time."""
    n_switches = problem.n_interfaces - problem.first_switch
    return (CROWD + 1) * (1 + n_switches) + problem.instants.shape[0]


@kernel
def length_at(t, h, resets):
    """Length of a step at time t that ends at a floating-point number, up to rounding h.

    In a model with resets it may be shorter than the rounding error of t, as in the upstroke of
    a spike that a reset ends; elsewhere it is then zero.
    """
    between = (t + h) - t
    return h if between == 0.0 and resets else between


@inlined_kernel
def integrate(problem, run, record, workspace, handed):
    """Integrate one trajectory to its end, to a hand-over to the lanes, or to a pause.

    Steps and crossings are listed in tables or, if arrays are given for it, accumulated
    into extremes and counts.

    Parameters
    ----------
    problem : Problem
    run : Run
        Updated in place.
    record : Record
        Filled in.
    workspace : Workspace
        From `workspace_for`; after a pause the same one.
    handed : int
        Number of leading modes in which the run is handed over after a plain step or a crossing.

    Returns
    -------
    int
        The outcome, `HANDED_OVER`, or the reason of a pause. Only a number is returned: to create
        an array Numba runs Python, in which an interrupt would be raised and lost.
    """
    address, n_states, n_modes, tol = problem.series, problem.n_states, problem.n_modes, problem.tol
    n_interfaces, n_fast, order = problem.n_interfaces, problem.n_fast, problem.order
    first_wall, first_switch = problem.first_wall, problem.first_switch
    signs, continuous, rules = problem.signs, problem.continuous, problem.rules
    first_rest = n_modes - problem.n_rests
    of_time, of_laws = problem.of_time, problem.of_laws
    parameters, inputs, carried, counted = run.parameters, run.inputs, run.carried, run.counted
    times, steps, crossings, store = record.times, record.steps, record.crossings, record.store
    extremes, hits, seen, since = record.extremes, record.hits, record.seen, run.since
    W, work, scales = workspace.W, workspace.work, workspace.scales
    search, collocation = workspace.search, workspace.collocation
    implicit, memory = workspace.implicit, workspace.collocation.memory
    right, poly, phase = implicit.right, implicit.poly, implicit.radau.phase
    on, hit, remains, side, noise = search.on, search.hit, search.remains, search.side, search.noise
    gradient, offsets, samples = search.gradient, workspace.offsets, record.samples
    columns = order + 1
    kept = n_states + problem.n_forcing
    stride = kept * columns
    t, late, stop = inputs[0], carried[LATE], run.stop
    whole = stop - run.begin
    at_once = events_at_once(problem)
    # no step crosses an instant
    until = min(next_instant(problem, parameters), stop)
    n_rows = kept + n_interfaces
    listing, dense = extremes.shape[0] == 0, store.shape[0] > 0
    n_steps, n_crossings = counted[STEPS], counted[CROSSINGS]
    n_samples, crowd, n_resets = counted[SAMPLES], counted[CROWDED], counted[RESETS]
    mode, interface = counted[MODE], ZERO - 1
    usual, last_event, depth, floor = carried[USUAL], carried[LAST_EVENT], 1.0, 0.0
    # implicit steps: steps until the next attempt, wait after a failure, number, lengths
    calm, pause, in_a_row = counted[CALM], counted[PAUSE], ZERO
    wanted = longest = 0.0
    code = REACHED_END
    # the wall whose reset is to be applied, that of the last one, and the approach speed;
    # whether the state has jumped, and whether the mode is selected again, at the same time
    reset, applied, speed = ZERO - 1, counted[APPLIED], carried[SPEED]
    jumped, again, anew = counted[JUMPED] > 0, False, False
    lone = ZERO
    choosing, touched, ahead, fresh, raised = mode < 0, False, False, mode < 0, False
    left = counted[WORK]
    if counted[PAUSED] > 0:
        in_a_row, interface = counted[IN_A_ROW], counted[INTERFACE]
        wanted, longest = carried[WANTED], carried[LONGEST]
        depth, floor = carried[DEPTH], carried[FLOOR]
        choosing, touched = counted[CHOOSING] > 0, counted[TOUCHED] > 0
        fresh = counted[FRESH] > 0
    else:
        for i in range(memory.shape[0]):
            memory[i] = 0.0
        for i in range(n_rows):
            scales[REACHED, i] = carried[SIZES + i]
        for j in range(n_interfaces):
            on[j] = hit[j] = remains[j] = False
        interface = counted[INTERFACE]
        if interface >= 0:
            # the lanes did not take the step that leaves the interface
            on[interface], noise[interface], fresh = True, carried[FLOOR], True
    while True:
        if (
            listing
            and not again
            and (
                n_steps == steps.shape[0]
                or n_resets + at_once > record.resets.shape[0]
                or n_crossings + n_interfaces > crossings.shape[0]
                or (dense and (n_steps + 1) * stride > store.shape[0])
            )
        ):
            code = TABLE_FULL
            break
        if choosing:
            left -= n_modes
            before = mode
            if first_wall < n_interfaces:
                if not again:
                    if before < 0 and first_switch < n_interfaces:
                        interface = begin_switches(problem, run, whole, W, scales, search)
                        if interface >= 0:
                            code = NO_SWITCH_STATE
                            break
                    # the contact force, or the speed of a wall, may jump at an instant and across
                    # an interface: rest is decided anew
                    known = before >= 0 and not jumped
                    entering = 0 <= interface < first_wall and not touched
                    anew = entering and not remains[interface] and before >= first_rest
                    if known and anew:
                        apply_jump(problem, run, entry_of(problem, before), search.rates)
                    for j in range(first_wall, n_interfaces):
                        side[j] = signs[before, j] if known and not anew else -1
                    if interface >= first_wall and side[interface] == 0:
                        # the contact force vanishes
                        side[interface] = -1
                    elif interface >= first_wall and not touched:
                        reset = interface
                again = False
                crossed = 0 <= interface < first_wall and not touched
                if first_switch < n_interfaces and (crossed or reset >= first_switch):
                    # decided by the motion up to here, also where an interface is met at once
                    listed = n_resets
                    call_address(address, before, inputs, parameters, W)
                    note_walls(problem, run, search, not jumped)
                    counted[RESETS] = n_resets
                    n_resets = change_switches(
                        problem, run, record, reset, whole, W, scales, search
                    )
                    if n_resets > listed:
                        jumped = True
                        for j in range(n_interfaces):
                            hit[j] = False
                        for j in range(first_wall, first_switch):
                            side[j] = -1
                    if reset >= 0:
                        applied, interface, reset = ZERO - 1, ZERO - 1, ZERO - 1
                elif reset >= 0:
                    number = reset - first_wall
                    note_walls(problem, run, search, not jumped)
                    search.below[reset], applied, jumped = False, reset, True
                    list_reset(problem, run, record, n_resets, number, False)
                    if not apply_jump(problem, run, number, search.rates):
                        code, mode, interface = RESET_NOT_FINITE, before, reset
                        break
                    list_reset(problem, run, record, n_resets, number, True)
                    n_resets += 1
                    for j in range(n_interfaces):
                        hit[j] = hit[j] and j == reset
                    for j in range(first_wall, n_interfaces):
                        side[j] = -1
                    interface, reset = ZERO - 1, ZERO - 1
            # the common case: one interface is crossed and the rates are continuous
            mode = (
                neighbour_mode(signs, before, interface)
                if 0 <= interface < first_wall and not touched
                else before
            )
            # interfaces are evaluated with the slow quantities after this instant
            shown = laws_after(problem, run, max(mode, 0), whole, W, scales, search)
            moved = before >= 0 and laws_jump(problem, run, W, scales)
            if moved:
                note_walls(problem, run, search, not jumped)
                jumped = True
                for j in range(first_wall, first_switch):
                    side[j] = -1
            for i in range(n_states, kept):
                inputs[1 + i] = W[i * columns]
            others, alike = ZERO, mode == shown
            for j in range(first_wall):
                if not of_time[j]:
                    noise[j] = interface_noise(problem, run, j, gradient)
                    if moved and of_laws[j]:
                        near = abs(gradient[0]) <= MOST_MOVED * tol * gradient[1]
                        hit[j] = hit[j] and near
                    on[j] = hit[j] or abs(gradient[0]) <= noise[j]
                    side[j] = 1 if gradient[0] > 0.0 else -1
                if j == interface:
                    noise[j] = max(noise[j], floor)
                others += on[j] and j != interface
                alike = alike and (on[j] or side[j] == signs[shown, j])
            if mode != shown:
                mode = before
            ahead = (
                mode != before
                and others == 0
                and alike
                and not anew
                and continuous[interface]
                and departs(problem, W, interface, signs[mode, interface], whole, scales, noise)
            )
            if not ahead and first_wall < n_interfaces:
                for j in range(first_wall):
                    others += on[j] and j == interface
                for j in range(first_wall, n_interfaces):
                    on[j] = False
                if others == 0:
                    mode = matching_mode(signs, side)
            if not ahead and (others > 0 or first_wall == n_interfaces):
                mode = choose_mode(problem, run, before, whole, work, scales, search, collocation)
            if mode < 0:
                code = NO_CONTINUATION
                if mode == MANY_MODES:
                    code = NOT_UNIQUE
                elif mode == NOT_DEFINED:
                    code = NOT_FINITE
                elif mode == UNKNOWN_MODE:
                    code = NEEDS_COLLOCATION
                mode = before
                break
            if first_wall < n_interfaces:
                if mode != shown:
                    call_address(address, mode, inputs, parameters, W)
                counted[JUMPED] = jumped
                verdict, wall = motion_at_walls(problem, run, mode, whole, W, floor, scales, search)
                rest = ZERO - 1
                if verdict == BEYOND and jumped and wall != applied:
                    # the relation has become true by a jump
                    verdict = INTO
                if verdict == BEYOND:
                    code, mode, interface = BEYOND_WALL, before, wall
                    break
                if verdict == PRESSED:
                    side[wall] = 0
                    rest = matching_mode(signs, side)
                    if rest < 0:
                        # nothing rests here: the relation becomes true
                        side[wall], verdict = -1, INTO
                elif verdict == AWAY and applied >= 0:
                    rest = chatter_ends(problem, run, applied, speed, W, work, scales, search)
                    if rest >= 0:
                        side[applied] = 0
                if rest >= 0:
                    if not apply_jump(problem, run, entry_of(problem, rest), search.rates):
                        code, mode, interface = RESET_NOT_FINITE, before, max(wall, applied)
                        break
                    if listing and applied >= 0:
                        # the last reset ends the chatter
                        number = applied - first_wall
                        list_reset(problem, run, record, n_resets - 1, number, True)
                    applied = ZERO - 1
                pulled = ZERO - 1
                if rest < 0 and verdict == AWAY and mode >= first_rest:
                    pulled = pulled_wall(problem, mode, whole, W, scales, search)
                    if pulled >= 0:
                        side[pulled] = -1
                if rest >= 0 or pulled >= 0 or verdict == INTO:
                    if verdict == INTO:
                        reset = wall
                        speed = W[(kept + wall) * columns + 1]
                        hit[wall] = True
                    crowd = crowd + 1 if t == last_event else 0
                    last_event = t
                    if crowd >= CROWD:
                        code, mode = ACCUMULATION, before
                        break
                    again, touched, interface, mode = True, False, ZERO - 1, before
                    continue
                if first_switch < n_interfaces:
                    listed = n_resets
                    note_walls(problem, run, search, not jumped)
                    counted[RESETS] = n_resets
                    n_resets = change_switches(
                        problem, run, record, ZERO - 1, whole, W, scales, search
                    )
                    if n_resets > listed:
                        jumped = True
                        crowd = crowd + 1 if t == last_event else 0
                        last_event = t
                        if crowd >= CROWD:
                            code, mode = ACCUMULATION, before
                            break
                        for j in range(n_interfaces):
                            hit[j] = False
                        for j in range(first_wall, first_switch):
                            side[j] = -1
                        again, touched, interface, mode = True, False, ZERO - 1, before
                        continue
                # the series is that of the next step
                ahead = verdict != UNKNOWN
            for j in range(first_wall):
                changed = before >= 0 and signs[before, j] != signs[mode, j]
                if changed or (touched and mode == before and j == interface):
                    turn = signs[mode, j] - signs[before, j]
                    if listing:
                        crossings[n_crossings, 0] = t
                        crossings[n_crossings, 1] = j
                        crossings[n_crossings, 2] = min(max(turn, -1), 1)
                        crossings[n_crossings, 3] = before
                        crossings[n_crossings, 4] = mode
                        crossings[n_crossings, 5] = depth < TANGENTIAL or not changed
                        for i in range(n_states):
                            crossings[n_crossings, 6 + i] = inputs[1 + i]
                    else:
                        hits[j, 0 if turn > 0 else 1] += turn != 0 and t >= since
                    n_crossings += 1
            if n_crossings + n_resets >= problem.max_crossings:
                code = TOO_MANY_CROSSINGS
                break
            choosing = touched = jumped = False
            applied, fresh = ZERO - 1, True
            calm = pause = ZERO + WAIT
            in_a_row = ZERO
            if first_wall < n_interfaces:
                # the lanes leave one interface or wall at most
                lone, interface = ZERO, ZERO - 1
                for j in range(n_interfaces):
                    if on[j]:
                        lone, interface = lone + 1, ZERO + j
            if ahead and mode < handed and lone < 2:
                code = HANDED_OVER
                break
        remaining = (until - t) - late
        if not remaining > 0.0:
            if not instant_due(problem, parameters, until):
                break
            note_walls(problem, run, search, not jumped)
            jumped = True
            n_resets, failed = pass_instant(problem, run, record, until, n_resets, search.rates)
            if failed >= 0:
                # resets at instants follow all interfaces
                beyond = failed - (first_switch - first_wall)
                code, interface = RESET_NOT_FINITE, n_interfaces + beyond
                break
            until = min(next_instant(problem, parameters), stop)
            # the switching functions may jump
            choosing, touched, interface = True, False, ZERO - 1
            for j in range(n_interfaces):
                hit[j] = False
            continue
        if n_steps == problem.max_steps:
            code = TOO_MANY_STEPS
            break
        if in_a_row > 0:
            # an implicit step leaves the first coefficients of the series at its end
            W, right = right, W
        else:
            if ahead:
                longest = expanded(problem, run, mode, remaining, W, scales, collocation, True)
            else:
                longest = expand(problem, run, mode, remaining, W, scales, collocation, True)
            ahead = raised = False
            if longest == MISSING:
                code = NEEDS_COLLOCATION
                break
            if fresh and longest < SUDDEN * (usual if usual > 0.0 else remaining):
                # a repeated step starts from the sizes before it
                raised = True
                for i in range(n_rows):
                    carried[SIZES + i] = scales[REACHED, i]
                raise_sizes(W, n_rows, order, tol, remaining, rules, scales)
                if memory[0] == 0.0:
                    longest = step_length(W, n_rows, order, tol, scales)
            if not longest > 0.0:
                code = NOT_FINITE
                break
            if memory[0] > 0.0:
                left -= COLLOCATED_WORK
        taken, long = 0.0, False
        for i in range(n_states, kept):
            inputs[1 + i] = W[i * columns]
        calm -= 1
        if (
            n_fast > 0
            and calm <= 0
            and (in_a_row > 0 or limited_by_stability(problem, W, longest, scales))
        ):
            if in_a_row == 0:
                wanted = 1.25 * longest
                phase[0] = 0.0
            left -= IMPLICIT_WORK + n_fast * n_fast // 8
            least = (1.1 if in_a_row < DAMPING else PAYS) * longest
            taken, growth = long_step(
                problem,
                run,
                mode,
                Lengths(wanted, least, longest, remaining),
                Series(W, right, poly, work),
                scales,
                search,
                implicit,
            )
            if taken == MISSING:
                code = NEEDS_RADAU
                if in_a_row > 0:
                    W, right = right, W
                elif raised:
                    for i in range(n_rows):
                        scales[REACHED, i] = carried[SIZES + i]
                calm += 1
                break
            long = taken > 0.0
            if long:
                wanted, pause, in_a_row = growth * taken, ZERO + WAIT, in_a_row + 1
                W, poly = poly, W
                s, h, interface, final = 2.0, taken, ZERO - 1, taken >= remaining
            else:
                pause = min(2 * pause, LONGEST_WAIT)
                calm = pause
                if in_a_row > 0:
                    in_a_row = ZERO
                    longest = expand(problem, run, mode, remaining, W, scales, collocation, True)
                    if longest == MISSING:
                        code = NEEDS_COLLOCATION
                        calm += 1
                        break
                    if not longest > 0.0:
                        code = NOT_FINITE
                        break
        fresh = False
        if not long:
            final = longest >= remaining
            # a step between two floating-point times loses no time to rounding
            h = remaining if final else length_at(t, longest, first_wall < n_interfaces)
            if h == 0.0:
                code = STEP_TOO_SMALL
                break
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
                h, final = length_at(t, 0.25 * taken, first_wall < n_interfaces), False
            usual = max(taken, 0.1 * usual)
        if h == 0.0:
            code = STEP_TOO_SMALL
            break
        begin, lag = t, late
        if interface >= first_wall:
            row = (kept + interface) * columns
            speed = slope(W, row, row + order, taken)
        if interface >= 0:
            t = begin + taken
            late = lag + (taken - (t - begin))
            if s == 1.0 and final:
                t, late = until, 0.0
        elif final:
            t, late = until, 0.0
        elif (begin + h) - begin == h:
            t = begin + h
        else:
            # a step within the rounding error of the time
            t = begin + (lag + h)
            late = (lag + h) - (t - begin)
        if taken > 0.0:
            remember_sizes(rules, scales)
            if interface >= first_wall:
                # a flight may begin and end on the wall
                height = abs(horner(W, row, row + order, 0.5 * taken))
                scales[REACHED, kept + interface] = max(scales[REACHED, kept + interface], height)
            if listing:
                steps[n_steps, 0], steps[n_steps, 1], steps[n_steps, 2] = begin, taken, mode
                kind = RADAU if phase[0] > 0.0 else IMPLICIT
                steps[n_steps, 3] = kind if long else memory[0]
            else:
                seen[mode] = t
                if t > since:
                    unused = (since - begin) - lag
                    widen_extremes(W, order, unused, taken, extremes, search)
            if dense:
                coefficients = store[n_steps * stride : (n_steps + 1) * stride]
                for i in range(stride):
                    coefficients[i] = W[i]
            n_steps += 1
            step = (begin, lag, t)
            n_samples = take_samples(W, columns, step, times, samples, n_samples, offsets)
            for i in range(kept):
                inputs[1 + i] = horner(W, i * columns, i * columns + order, taken)
            flush(inputs, n_states)
        inputs[0] = t
        for j in range(n_interfaces):
            hit[j] = signs[mode, j] == 0
            # a motion that remains on an interface may leave it in the next step: check again
            on[j] = remains[j]
            choosing = choosing or remains[j]
        if interface >= 0:
            hit[interface] = choosing = True
        project_onto_interfaces(problem, run, interface, search, scales)
        left -= 1
        if interface >= 0:
            crowd = crowd + 1 if t - last_event <= 1e-13 * max(abs(t), whole) else 0
            last_event = t
            if crowd == CROWD:
                code = ACCUMULATION
                break
        elif mode < handed and not choosing and not final and in_a_row == 0:
            code = HANDED_OVER
            break
        if left <= 0:
            code = OUT_OF_WORK
            break
    counted[PAUSED] = code < HANDED_OVER
    if code < HANDED_OVER:
        if in_a_row > 0:
            # the arrays have been swapped
            held_W, held_right = workspace.W, implicit.right
            for i in range(W.shape[0]):
                work[i] = right[i]
            for i in range(W.shape[0]):
                held_W[i] = W[i]
            for i in range(W.shape[0]):
                held_right[i] = work[i]
        counted[IN_A_ROW], counted[INTERFACE] = in_a_row, interface
        counted[CHOOSING], counted[TOUCHED], counted[FRESH] = choosing, touched, fresh
        counted[APPLIED], counted[JUMPED] = applied, jumped
        carried[WANTED], carried[LONGEST] = wanted, longest
        carried[DEPTH], carried[FLOOR] = depth, floor
    else:
        # the interface crossed, if the run is handed over before the step that leaves it; the
        # wall that was passed, or whose reset failed
        ending = code in (HANDED_OVER, BEYOND_WALL, NO_SWITCH_STATE, RESET_NOT_FINITE)
        counted[INTERFACE] = interface if ending else -1
        if code == HANDED_OVER and interface >= 0:
            carried[FLOOR] = noise[interface]
    counted[WORK] = left
    carried[LATE], carried[USUAL], carried[LAST_EVENT] = late, usual, last_event
    carried[SPEED] = speed
    for i in range(n_rows):
        carried[SIZES + i] = scales[REACHED, i]
    counted[STEPS], counted[CROSSINGS] = n_steps, n_crossings
    counted[SAMPLES], counted[CROWDED], counted[MODE] = n_samples, crowd, mode
    counted[RESETS] = n_resets
    counted[CALM], counted[PAUSE] = calm, pause
    return code
