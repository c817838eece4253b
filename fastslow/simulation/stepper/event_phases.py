"""Phases of the stepping loop between two steps: events are applied, and a motion is selected."""

from __future__ import annotations

from fastslow.kernels.compiler.decorators import inlined_kernel, kernel
from fastslow.kernels.compiler.pointers import call_address
from fastslow.simulation.stepper.event_location import MOST_MOVED
from fastslow.simulation.stepper.implicit import WAIT
from fastslow.simulation.stepper.instants import next_instant
from fastslow.simulation.stepper.motion_selection import (
    MANY_MODES,
    NO_MODE,
    NOT_DEFINED,
    UNFORMED_MODE,
    UNKNOWN_MODE,
    UNPROPOSED,
    all_formed,
    choose_mode,
    departs,
    interface_noise,
    laws_after,
    laws_jump,
    neighbour_mode,
)
from fastslow.simulation.stepper.phases import (
    ACCUMULATION,
    APPLY,
    BEYOND_WALL,
    CONTACT,
    CROSS,
    CROWD,
    HANDED_OVER,
    NEEDS_COLLOCATION,
    NEEDS_MOTION,
    NO_CONTINUATION,
    NO_SWITCH_STATE,
    NOT_FINITE,
    NOT_UNIQUE,
    PASS,
    RESET_NOT_FINITE,
    SELECT,
    TOO_MANY_CROSSINGS,
)
from fastslow.simulation.stepper.polynomials import ZERO
from fastslow.simulation.stepper.queued_events import (
    begin_events,
    execute_events,
    next_execution,
)
from fastslow.simulation.stepper.resets import (
    AWAY,
    BEYOND,
    INTO,
    PRESSED,
    UNKNOWN,
    apply_jump,
    chatter_ends,
    enter_rest,
    is_rest,
    list_reset,
    matching_mode,
    motion_at_walls,
    note_walls,
    pulled_wall,
    rest_beside,
)
from fastslow.simulation.stepper.switches import (
    SWITCHES,
    UNCHANGED,
    begin_switches,
    change_switches,
)
from fastslow.simulation.stepper.workspace import (
    AHEAD,
    ANEW,
    APPLIED,
    CALM,
    CHOOSING,
    CROSSINGS,
    CROWDED,
    DEPTH,
    DUE,
    FLOOR,
    FRESH,
    IN_A_ROW,
    INTERFACE,
    JUMPED,
    LAST_EVENT,
    MODE,
    NEXT_MODE,
    PAUSE,
    PROPOSED,
    RESETS,
    RESTING,
    SPEED,
    TOUCHED,
    UNTIL,
    WORK,
)

#: A crossing is near-tangential (near grazing) when shifting h by this fraction of its scale
#: removes it.
NEAR_TANGENTIAL = 1e-6


@inlined_kernel
def decide(problem, run, record, W, scales, search):
    """Decide whether the interface of the last event is crossed, or its wall or switch is due."""
    counted, side, first_wall = run.counted, search.side, problem.first_wall
    before, interface = counted[MODE], counted[INTERFACE]
    n_events = problem.events.shape[0]
    if first_wall == problem.n_interfaces and n_events == 0:
        return SELECT
    if before < 0 and (problem.first_switch < problem.n_interfaces or n_events > 0):
        interface = begin_switches(problem, run, run.stop - run.begin, W, scales, search)
        counted[INTERFACE] = interface
        if interface >= 0:
            return NO_SWITCH_STATE
        if n_events > 0:
            begin_events(problem, run, W, search)
            executed = execute_events(problem, run, record, run.inputs[0], W, search)
            if executed < 0:
                return -executed
            counted[JUMPED] = executed > 0
            renew_end(problem, run)
    # the contact force, or the speed of a wall, may jump at an instant and across an interface:
    # rest is decided anew
    known = before >= 0 and counted[JUMPED] == 0
    crossed = 0 <= interface < first_wall and counted[TOUCHED] == 0
    anew = crossed and not search.remains[interface] and before >= 0 and is_rest(problem, before)
    counted[ANEW] = anew
    if known and anew:
        enter_rest(problem, run, run.inputs, before, search.rates)
    for j in range(first_wall, problem.n_interfaces):
        side[j] = problem.signs[before, j] if known and not anew else -1
    if interface >= first_wall and side[interface] == 0:
        # the contact force vanishes
        side[interface] = -1
    elif interface >= first_wall and counted[TOUCHED] == 0:
        counted[DUE] = interface
    return APPLY


@kernel
def change_at_conditions(problem, run, record, due, W, scales, search, expanded):
    """Change switches and execute events; see `change_switches`.

    Returns
    -------
    changed : int
        See `change_switches`.
    executed : int
        Number of executions of events, or minus the outcome of a run that cannot go on.
    """
    note_walls(problem, run, search, run.counted[JUMPED] == 0)
    changed = change_switches(problem, run, record, due, W, scales, search, expanded)
    executed, now = ZERO, run.inputs[0]
    some = changed > UNCHANGED or next_execution(problem, run.carried) <= now
    if some and problem.events.shape[0] > 0:
        executed = execute_events(problem, run, record, now, W, search)
        if executed < 0:
            return changed, executed
        renew_end(problem, run)
    if changed == SWITCHES or executed > 0:
        forget_sides(problem, run, search)
    return changed, executed


@inlined_kernel
def apply_event(problem, run, record, W, scales, search):
    """Apply the reset of the wall that is due, or change switches."""
    counted, first_wall, first_switch = run.counted, problem.first_wall, problem.first_switch
    due, interface = counted[DUE], counted[INTERFACE]
    crossed = 0 <= interface < first_wall and counted[TOUCHED] == 0
    if first_switch < problem.n_interfaces and (crossed or due >= first_switch):
        # decided by the motion up to here, also where an interface is met at once
        _, executed = change_at_conditions(problem, run, record, due, W, scales, search, False)
        if executed < 0:
            return -executed
        if due >= 0:
            counted[APPLIED] = counted[INTERFACE] = counted[DUE] = -1
    elif due >= 0:
        number = due - first_wall
        note_walls(problem, run, search, counted[JUMPED] == 0)
        search.below[due], counted[APPLIED], counted[JUMPED] = False, due, True
        list_reset(problem, run, record, counted[RESETS], number, False)
        if not apply_jump(problem, run, number, search.rates):
            counted[INTERFACE] = due
            return RESET_NOT_FINITE
        list_reset(problem, run, record, counted[RESETS], number, True)
        counted[RESETS] += 1
        for j in range(problem.n_interfaces):
            search.hit[j] = search.hit[j] and j == due
        for j in range(first_wall, problem.n_interfaces):
            search.side[j] = -1
        counted[INTERFACE] = counted[DUE] = -1
    return SELECT


@kernel
def renew_end(problem, run):
    """Note the time at which the next step ends at the latest, after events have been queued."""
    soonest = min(next_instant(problem, run.parameters), next_execution(problem, run.carried))
    run.carried[UNTIL] = min(soonest, run.stop)


@inlined_kernel
def forget_sides(problem, run, search):
    """After a switch or an event: the state is on no interface, and rests on no wall."""
    run.counted[JUMPED] = True
    for j in range(problem.n_interfaces):
        search.hit[j] = False
    for j in range(problem.first_wall, problem.first_switch):
        search.side[j] = -1


@inlined_kernel
def select(problem, run, W, work, scales, search, collocation):
    """Select the motion that continues from this point, before the walls are considered."""
    counted, inputs, noise, side = run.counted, run.inputs, search.noise, search.side
    signs, first_wall, on = problem.signs, problem.first_wall, search.on
    whole, walls = run.stop - run.begin, first_wall < problem.n_interfaces
    before, interface = counted[MODE], counted[INTERFACE]
    counted[WORK] -= problem.signs.shape[0]
    # the common case: one interface is crossed and the rates are continuous
    crossed = 0 <= interface < first_wall and counted[TOUCHED] == 0
    mode = neighbour_mode(signs, before, interface) if crossed else before
    # interfaces are evaluated with the slow quantities after this instant
    shown = laws_after(problem, run, max(mode, 0), whole, W, scales, search)
    moved = before >= 0 and laws_jump(problem, run, W, scales)
    if moved:
        note_walls(problem, run, search, counted[JUMPED] == 0)
        counted[JUMPED] = True
        for j in range(first_wall, problem.first_switch):
            side[j] = -1
    for i in range(problem.n_states, problem.n_states + problem.n_forcing):
        inputs[1 + i] = W[i * (problem.order + 1)]
    others, alike = sides_here(problem, run, mode, shown, moved, search)
    if mode != shown:
        mode = before
    ahead = (
        mode != before
        and others == 0
        and alike
        and counted[ANEW] == 0
        and problem.continuous[interface]
        and departs(problem, W, interface, signs[mode, interface], whole, scales, noise)
    )
    if not ahead and walls:
        for j in range(first_wall):
            others += on[j] and j == interface
        for j in range(first_wall, problem.n_interfaces):
            on[j] = False
        if others == 0:
            mode = matching_mode(signs, side)
            if mode < 0 and problem.forming > 0 and counted[PROPOSED] == UNPROPOSED:
                return NEEDS_MOTION
    if not ahead and (others > 0 or not walls):
        proposed = counted[PROPOSED]
        asks = problem.forming > 0 and proposed == UNPROPOSED
        if asks and not all_formed(problem, before, interface):
            # a first motion, and those beside the last one at an event
            return NEEDS_MOTION
        mode = choose_mode(problem, run, before, work, scales, search, collocation, proposed)
    if mode < 0:
        if mode == MANY_MODES:
            return NOT_UNIQUE
        if mode == NOT_DEFINED:
            return NOT_FINITE
        if mode == UNFORMED_MODE:
            return NEEDS_MOTION
        return NEEDS_COLLOCATION if mode == UNKNOWN_MODE else NO_CONTINUATION
    if walls and mode != shown:
        call_address(problem.series, mode, inputs, run.parameters, W)
    counted[NEXT_MODE], counted[AHEAD], counted[PROPOSED] = mode, ahead, UNPROPOSED
    return CONTACT if walls else CROSS


@inlined_kernel
def sides_here(problem, run, mode, shown, moved, search):
    """Fill in the side of every interface, and whether it contains the point.

    Returns the number of interfaces that contain it besides that of the event, and whether the
    point is otherwise on the side of the motion that is shown.
    """
    counted, carried, gradient = run.counted, run.carried, search.gradient
    on, hit, side, noise = search.on, search.hit, search.side, search.noise
    interface, others, alike = counted[INTERFACE], ZERO, mode == shown
    for j in range(problem.first_wall):
        if not problem.of_time[j]:
            noise[j] = interface_noise(problem, run, j, gradient)
            if moved and problem.of_laws[j]:
                near = abs(gradient[0]) <= MOST_MOVED * problem.tol * gradient[1]
                hit[j] = hit[j] and near
            on[j] = hit[j] or abs(gradient[0]) <= noise[j]
            side[j] = 1 if gradient[0] > 0.0 else -1
        if j == interface:
            noise[j] = max(noise[j], carried[FLOOR])
        others += on[j] and j != interface
        alike = alike and (on[j] or side[j] == problem.signs[shown, j])
    return others, alike


@inlined_kernel
def at_once(run):
    """Apply a further event at the same time, if there have not been too many."""
    counted, carried = run.counted, run.carried
    counted[CROWDED] = counted[CROWDED] + 1 if run.inputs[0] == carried[LAST_EVENT] else 0
    carried[LAST_EVENT] = run.inputs[0]
    counted[TOUCHED], counted[INTERFACE], counted[PROPOSED] = False, -1, UNPROPOSED
    return ACCUMULATION if counted[CROWDED] >= CROWD else APPLY


@inlined_kernel
def meet_walls(problem, run, record, W, work, scales, search):
    """Compare the selected motion with walls and switches: one may be due, or rest begin or end."""
    counted, carried, side = run.counted, run.carried, search.side
    whole, first_wall, mode = run.stop - run.begin, problem.first_wall, counted[NEXT_MODE]
    verdict, wall = motion_at_walls(problem, run, mode, whole, W, carried[FLOOR], scales, search)
    applied, rest, pulled = counted[APPLIED], ZERO - 1, ZERO - 1
    if verdict == BEYOND and counted[JUMPED] > 0 and wall != applied:
        # the relation has become true by a jump
        verdict = INTO
    if verdict == BEYOND:
        counted[INTERFACE] = wall
        return BEYOND_WALL
    met = wall if verdict == PRESSED else applied
    if verdict == PRESSED:
        rest = rest_beside(problem, run, wall, search)
        if rest == NO_MODE:
            # nothing rests here: the relation becomes true
            verdict = INTO
    elif verdict == AWAY and applied >= 0:
        rest = chatter_ends(problem, run, applied, carried[SPEED], W, work, scales, search)
    if rest == UNFORMED_MODE:
        counted[RESTING] = met
        return NEEDS_MOTION
    if rest >= 0:
        side[met] = 0
        if not enter_rest(problem, run, run.inputs, rest, search.rates):
            counted[INTERFACE] = max(wall, applied)
            return RESET_NOT_FINITE
        if record.extremes.shape[0] == 0 and applied >= 0:
            # the last reset ends the chatter
            list_reset(problem, run, record, counted[RESETS] - 1, applied - first_wall, True)
        counted[APPLIED] = -1
    elif verdict == AWAY and is_rest(problem, mode):
        pulled = pulled_wall(problem, mode, whole, W, scales, search)
        if pulled >= 0:
            side[pulled] = -1
    if verdict == INTO:
        counted[DUE], search.hit[wall] = wall, True
        carried[SPEED] = W[(problem.n_states + problem.n_forcing + wall) * (problem.order + 1) + 1]
    if rest >= 0 or pulled >= 0 or verdict == INTO:
        return at_once(run)
    if problem.first_switch < problem.n_interfaces:
        changed, executed = change_at_conditions(
            problem, run, record, ZERO - 1, W, scales, search, True
        )
        if executed < 0:
            return -executed
        if changed > UNCHANGED or executed > 0:
            return at_once(run)
    # the series is that of the next step
    counted[AHEAD] = verdict != UNKNOWN
    return CROSS


@inlined_kernel
def cross(problem, run, record, search, handed):
    """Record the crossings of the selected motion, which then begins."""
    counted, first_wall = run.counted, problem.first_wall
    before, mode = counted[MODE], counted[NEXT_MODE]
    for j in range(first_wall):
        changed = before >= 0 and problem.signs[before, j] != problem.signs[mode, j]
        met = counted[TOUCHED] > 0 and mode == before and j == counted[INTERFACE]
        if changed or met:
            list_crossing(problem, run, record, j, changed)
    counted[MODE], counted[PROPOSED] = mode, UNPROPOSED
    if counted[CROSSINGS] + counted[RESETS] >= problem.max_crossings:
        return TOO_MANY_CROSSINGS
    counted[CHOOSING] = counted[TOUCHED] = counted[JUMPED] = False
    counted[APPLIED], counted[FRESH], counted[IN_A_ROW] = -1, True, 0
    counted[CALM] = counted[PAUSE] = WAIT
    lone = ZERO
    if first_wall < problem.n_interfaces:
        # the lanes leave one interface or wall at most
        counted[INTERFACE] = -1
        for j in range(problem.n_interfaces):
            if search.on[j]:
                lone, counted[INTERFACE] = lone + 1, j
    return HANDED_OVER if counted[AHEAD] > 0 and mode < handed and lone < 2 else PASS


@inlined_kernel
def list_crossing(problem, run, record, j, changed):
    """List a crossing or contact of an interface; without lists, count it."""
    counted, crossings, row = run.counted, record.crossings, run.counted[CROSSINGS]
    before, mode = counted[MODE], counted[NEXT_MODE]
    turn = problem.signs[mode, j] - problem.signs[before, j]
    counted[CROSSINGS] += 1
    if record.extremes.shape[0] > 0:
        counts = turn != 0 and run.inputs[0] >= run.since
        record.hits[j, 0 if turn > 0 else 1] += counts
        return
    crossings[row, 0], crossings[row, 1] = run.inputs[0], j
    crossings[row, 2] = min(max(turn, -1), 1)
    crossings[row, 3], crossings[row, 4] = before, mode
    crossings[row, 5] = run.carried[DEPTH] < NEAR_TANGENTIAL or not changed
    for i in range(problem.n_states):
        crossings[row, 6 + i] = run.inputs[1 + i]
