"""The stepping loop: a sequence of phases, compiled once for all models.

The drawing of the phases is in ``docs/architecture.md``. What a phase leaves to others is in the
named places of `fastslow.simulation.stepper.workspace`.
"""

from __future__ import annotations

from fastslow.kernels.compiler.decorators import inlined_kernel, kernel
from fastslow.simulation.stepper.event_phases import (
    apply_event,
    cross,
    decide,
    meet_walls,
    renew_end,
    select,
)
from fastslow.simulation.stepper.implicit import Series
from fastslow.simulation.stepper.instants import instant_due, pass_instant
from fastslow.simulation.stepper.phases import (
    ADVANCE,
    APPLY,
    BEGIN,
    BEYOND_WALL,
    CONTACT,
    CROSS,
    CROWD,
    DECIDE,
    EXPAND,
    HANDED_OVER,
    LOCATE,
    NO_SWITCH_STATE,
    OUT_OF_ROWS,
    PASS,
    REACHED_END,
    RESET_NOT_FINITE,
    SELECT,
    SETTLE,
)
from fastslow.simulation.stepper.polynomials import ZERO
from fastslow.simulation.stepper.queued_events import (
    execute_events,
    executions_at_once,
    next_execution,
)
from fastslow.simulation.stepper.resets import note_walls
from fastslow.simulation.stepper.scales import REACHED
from fastslow.simulation.stepper.steps import (
    advance,
    expand_motion,
    locate,
    remaining_time,
    settle,
)
from fastslow.simulation.stepper.workspace import (
    AHEAD,
    ANEW,
    CHOOSING,
    CROSSINGS,
    DEPTH,
    DUE,
    FLOOR,
    FRESH,
    IN_A_ROW,
    INTERFACE,
    JUMPED,
    LONGEST,
    MODE,
    PAUSED,
    RAISED,
    RESETS,
    RESUMED,
    SIZES,
    STEPS,
    TOUCHED,
    UNTIL,
    WANTED,
)


@kernel
def events_at_once(problem):
    """Largest number of resets, events and changes of switches listed at the same time."""
    n_switches = problem.first_trigger - problem.first_switch
    most = (CROWD + 1) * (1 + n_switches) + problem.instants.shape[0]
    return most + executions_at_once(problem)


@inlined_kernel
def start(problem, run, workspace):
    """Start a run, or go on with one that the lanes have handed over."""
    counted, carried, search = run.counted, run.carried, workspace.search
    for i in range(workspace.collocation.memory.shape[0]):
        workspace.collocation.memory[i] = 0.0
    for i in range(problem.rules.shape[1]):
        workspace.scales[REACHED, i] = carried[SIZES + i]
    for j in range(problem.n_interfaces):
        search.on[j] = search.hit[j] = search.remains[j] = False
    interface, new = counted[INTERFACE], counted[MODE] < 0
    if interface >= 0:
        # the lanes did not take the step that leaves the interface
        search.on[interface], search.noise[interface] = True, carried[FLOOR]
    carried[WANTED] = carried[LONGEST] = carried[FLOOR] = 0.0
    carried[DEPTH] = 1.0
    counted[CHOOSING], counted[FRESH], counted[DUE] = new, new or interface >= 0, -1
    counted[TOUCHED] = counted[AHEAD] = counted[RAISED] = counted[ANEW] = False
    counted[IN_A_ROW] = 0


@inlined_kernel
def begin(problem, run, record):
    """Check the space in the tables; then select a motion where one is to be, else go on."""
    counted, steps, store = run.counted, record.steps, record.store
    stride = (problem.n_states + problem.n_forcing) * (problem.order + 1)
    if record.extremes.shape[0] == 0 and (
        counted[STEPS] == steps.shape[0]
        or counted[RESETS] + events_at_once(problem) > record.resets.shape[0]
        or counted[CROSSINGS] + problem.n_interfaces > record.crossings.shape[0]
        or (store.shape[0] > 0 and (counted[STEPS] + 1) * stride > store.shape[0])
    ):
        return OUT_OF_ROWS
    return DECIDE if counted[CHOOSING] > 0 else PASS


@inlined_kernel
def pass_time(problem, run, record, W, search):
    """Pass the instant that is reached, end at the end of time, or take a step."""
    counted, carried, until = run.counted, run.carried, run.carried[UNTIL]
    if remaining_time(run) > 0.0:
        return EXPAND
    executes = next_execution(problem, carried) <= until
    if not executes and not instant_due(problem, run.parameters, until):
        return REACHED_END
    note_walls(problem, run, search, counted[JUMPED] == 0)
    counted[JUMPED] = True
    failed = pass_instant(problem, run, record, until, search.rates)
    if failed >= 0:
        # resets at instants follow all interfaces
        beyond = failed - (problem.first_switch - problem.first_wall)
        counted[INTERFACE] = problem.n_interfaces + beyond
        return RESET_NOT_FINITE
    if executes:
        executed = execute_events(problem, run, record, until, W, search)
        if executed < 0:
            return -executed
    renew_end(problem, run)
    # the switching functions may jump
    counted[CHOOSING], counted[TOUCHED], counted[INTERFACE] = True, False, -1
    for j in range(problem.n_interfaces):
        search.hit[j] = False
    return BEGIN


@inlined_kernel
def noted(run, phase, following):
    """Note the phase in which a run goes on if it pauses there; return the following one."""
    if following < HANDED_OVER:
        run.counted[RESUMED] = phase
    return following


@inlined_kernel
def leave(problem, run, workspace, series, code):
    """Leave a run at its end, at a hand-over to the lanes, or at a pause."""
    counted, carried, W, right = run.counted, run.carried, workspace.W, workspace.implicit.right
    counted[PAUSED] = code < HANDED_OVER
    if counted[PAUSED] > 0:
        if counted[IN_A_ROW] > 0:
            # the arrays have been exchanged
            for i in range(W.shape[0]):
                workspace.work[i] = series.right[i]
            for i in range(W.shape[0]):
                W[i] = series.left[i]
            for i in range(W.shape[0]):
                right[i] = workspace.work[i]
    elif code == HANDED_OVER:
        if counted[INTERFACE] >= 0:
            carried[FLOOR] = workspace.search.noise[counted[INTERFACE]]
    elif code != BEYOND_WALL and code < NO_SWITCH_STATE:
        counted[INTERFACE] = -1
    for i in range(problem.rules.shape[1]):
        carried[SIZES + i] = workspace.scales[REACHED, i]


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
    workspace : StepWorkspace
        From `workspace_for`; after a pause the same one.
    handed : int
        Number of leading modes in which the run is handed over after a plain step or a crossing.

    Returns
    -------
    int
        The outcome, `HANDED_OVER`, or the reason of a pause. Only a number is returned: to create
        an array Numba runs Python, in which an interrupt would be raised and lost.
    """
    counted, work, scales, search = run.counted, workspace.work, workspace.scales, workspace.search
    implicit, collocation = workspace.implicit, workspace.collocation
    if counted[PAUSED] == 0:
        start(problem, run, workspace)
    # no step crosses an instant
    renew_end(problem, run)
    series = Series(workspace.W, implicit.right, implicit.poly, work)
    phase = ZERO + BEGIN
    if counted[PAUSED] > 0 and counted[RESUMED] > 0:
        phase = counted[RESUMED]
    counted[RESUMED] = 0
    while phase >= BEGIN:
        # in the order of a step, so that the compiler knows which test follows which phase
        W = series.left
        if phase == BEGIN:
            phase = begin(problem, run, record)
        if phase == DECIDE:
            phase = decide(problem, run, record, W, scales, search)
        if phase == APPLY:
            phase = apply_event(problem, run, record, W, scales, search)
        if phase == SELECT:
            phase = select(problem, run, W, work, scales, search, collocation)
            phase = noted(run, SELECT, phase)
        if phase == CONTACT:
            phase = meet_walls(problem, run, record, W, work, scales, search)
            phase = noted(run, CONTACT, phase)
        if phase == CROSS:
            phase = cross(problem, run, record, search, handed)
        if phase == PASS:
            phase = pass_time(problem, run, record, W, search)
        if phase == EXPAND:
            if counted[IN_A_ROW] > 0:
                # an implicit step leaves the first coefficients of the series at its end
                series = Series(series.right, W, series.poly, work)
            phase = expand_motion(problem, run, series.left, scales, collocation)
        if phase == SETTLE:
            phase = settle(problem, run, series, scales, search, implicit, collocation)
            if phase == ADVANCE:
                series = Series(series.poly, series.right, series.left, work)
            elif phase < BEGIN and counted[IN_A_ROW] > 0:
                # the step is repeated
                series = Series(series.right, series.left, series.poly, work)
        if phase == LOCATE:
            phase = locate(problem, run, series.left, work, scales, search)
        if phase == ADVANCE:
            phase = advance(problem, run, record, series.left, workspace, handed)
    leave(problem, run, workspace, series, phase)
    return phase
