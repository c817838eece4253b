"""Events: they are queued when their condition becomes true, and executed when they are due."""

from __future__ import annotations

import numpy as np

from fastslow.kernels.compiler.decorators import kernel
from fastslow.kernels.compiler.pointers import call_address
from fastslow.results.stored.conditions import AND, NEGATION, OR, TRUE
from fastslow.simulation.stepper.motion_selection import interface_noise
from fastslow.simulation.stepper.phases import ENDLESS_EVENTS, MANY_PENDING, RESET_NOT_FINITE
from fastslow.simulation.stepper.polynomials import EPSILON, ZERO
from fastslow.simulation.stepper.resets import list_reset
from fastslow.simulation.stepper.switches import set_switch
from fastslow.simulation.stepper.workspace import INTERFACE, MODE, RESETS, SIZES

#: Columns of `Problem.events`; then the condition, filled up by `END_OF_CONDITION`.
PERSISTENT, INITIALLY, AT_TRIGGER, PRIORITISED, PROGRAM = range(5)
END_OF_CONDITION = -9

#: Events are queued in the memory of a run, after that of chattering: their number, the time of
#: the last execution and the number of executions at that time; whether each condition is true;
#: then for every waiting event its number, the time of its execution, and its values.
QUEUED, LAST_TIME, AT_ONCE, TRUTH = range(4)

#: Executions at one instant for every event, in addition to `LEAST_AT_ONCE`, that end a run.
EACH_AT_ONCE, LEAST_AT_ONCE = 10, 50

#: Waiting events of which there is space for every event, and the least space.
EACH_WAITING, LEAST_WAITING = 16, 16


def memory_size(n_events: int, n_states: int) -> int:
    """Return the size of the memory of a run for its events, 0 without events."""
    if not n_events:
        return 0
    return TRUTH + n_events + (LEAST_WAITING + EACH_WAITING * n_events) * (2 + n_states)


@kernel
def executions_at_once(problem):
    """Largest number of events that are executed at the same time."""
    n_events = problem.events.shape[0]
    return (n_events > 0) * (LEAST_AT_ONCE + EACH_AT_ONCE * n_events)


@kernel
def memory_start(problem):
    """Return where the memory of events begins in what a run carries."""
    return SIZES + problem.rules.shape[1] + 2 + problem.n_states


@kernel
def next_execution(problem, carried):
    """Time at which the next waiting event is executed, infinite if none is waiting."""
    soonest = np.inf
    if problem.events.shape[0] > 0:
        memory, size = carried[memory_start(problem) :], 2 + problem.n_states
        row = TRUTH + problem.events.shape[0]
        for _ in range(np.int64(memory[QUEUED])):
            soonest = min(soonest, memory[row + 1])
            row += size
    return soonest


@kernel
def set_triggers(problem, run, event, W, search):
    """Set the inequalities that depend on what an event assigns, or all if it is −1.

    Where h is zero after an event, what the event has not assigned decides, a moment later: then
    t > k is true after k = t, and x > 1 is not after x = 1.
    """
    parameters, n_states = run.parameters, problem.n_states
    n_switches = problem.first_trigger - problem.first_switch
    for k in range(problem.closed.shape[0]):
        if event < 0 or problem.effects[event, n_states + k] > 0:
            # then the function is h
            set_switch(problem, parameters, n_switches + k, 0.0)
            noise = interface_noise(problem, run, problem.first_trigger + k, search.gradient)
            height = search.gradient[0]
            above = height > noise
            if abs(height) <= noise:
                slope = 0.0
                if event >= 0 and run.counted[MODE] >= 0:
                    slope = slope_of_others(problem, run, event, k, W, search)
                above = slope > 0.0 or (problem.closed[k] and slope == 0.0)
            set_switch(problem, parameters, n_switches + k, 1.0 * above)


@kernel
def slope_of_others(problem, run, event, k, W, search):
    """Rate of h along the motion before an event, without the states that it has assigned.

    ``search.ahead`` is the place before it. Rates within rounding of zero are zero.
    """
    columns, n_states = problem.order + 1, problem.n_states
    call_address(problem.series, run.counted[MODE], search.ahead, run.parameters, W)
    row = n_states + problem.n_forcing + problem.first_trigger + k
    slope = W[row * columns + 1]
    size = abs(slope)
    for i in range(n_states):
        if problem.effects[event, i] > 0:
            part = search.gradient[2 + i] * W[i * columns + 1]
            slope -= part
            size += abs(part)
    return slope if abs(slope) > 32.0 * EPSILON * size else 0.0


@kernel
def condition_is_true(problem, parameters, event):
    """Evaluate the condition of an event."""
    first = problem.switch_place + 2 * (problem.first_trigger - problem.first_switch)
    # a stack of bits
    stack = ZERO
    for column in range(PROGRAM, problem.events.shape[1]):
        code = problem.events[event, column]
        if code == END_OF_CONDITION:
            break
        top = stack & 1
        if code >= 0:
            stack = 2 * stack + np.int64(parameters[first + 2 * code])
        elif code == AND:
            below = stack >> 1
            stack = below - (1 - top) * (below & 1)
        elif code == OR:
            stack = (stack >> 1) | top
        elif code == NEGATION:
            stack += 1 - 2 * top
        else:
            stack = 2 * stack + (code == TRUE)
    return (stack & 1) > 0


@kernel
def expressions_of(problem, run, event, values):
    """Fill in the values of all states after an event, its delay and its priority."""
    number = problem.n_resets + problem.n_rests + event
    call_address(problem.series, -1 - number, run.inputs, run.parameters, values)


@kernel
def begin_events(problem, run, W, search):
    """Set all inequalities at the start of a run, and the conditions that count as true there."""
    set_triggers(problem, run, ZERO - 1, W, search)
    memory = run.carried[memory_start(problem) :]
    memory[QUEUED], memory[LAST_TIME] = 0.0, -np.inf
    for event in range(problem.events.shape[0]):
        memory[TRUTH + event] = 1.0 * problem.events[event, INITIALLY]


@kernel
def remove(problem, memory, k):
    """Remove the k-th waiting event; the others keep their order."""
    size, first = 2 + problem.n_states, TRUTH + problem.events.shape[0]
    count = np.int64(memory[QUEUED])
    for place in range(first + k * size, first + (count - 1) * size):
        memory[place] = memory[place + size]
    memory[QUEUED] = count - 1.0


@kernel
def note_conditions(problem, run, values):
    """Queue the events whose condition has become true, and drop those that do not persist.

    Returns 0, or the outcome of a run that cannot go on.
    """
    memory, n_states = run.carried[memory_start(problem) :], problem.n_states
    size, first = 2 + n_states, TRUTH + problem.events.shape[0]
    for event in range(problem.events.shape[0]):
        before = memory[TRUTH + event] > 0.0
        now = condition_is_true(problem, run.parameters, event)
        memory[TRUTH + event] = 1.0 * now
        if before and not now and problem.events[event, PERSISTENT] == 0:
            for k in range(np.int64(memory[QUEUED]) - 1, -1, -1):
                if memory[first + k * size] == event:
                    remove(problem, memory, k)
        if now and not before:
            row = first + np.int64(memory[QUEUED]) * size
            if row + size > memory.shape[0]:
                run.counted[INTERFACE] = row_of(problem, event)
                return ZERO + MANY_PENDING
            expressions_of(problem, run, event, values)
            if not 0.0 <= values[n_states] < np.inf:
                run.counted[INTERFACE] = row_of(problem, event)
                return ZERO + RESET_NOT_FINITE
            memory[row] = event
            memory[row + 1] = run.inputs[0] + values[n_states]
            for i in range(n_states):
                memory[row + 2 + i] = values[i]
            memory[QUEUED] += 1.0
    return ZERO


@kernel
def row_of(problem, event):
    """Place of an event after all interfaces and the resets at instants."""
    kicks = problem.n_resets - (problem.first_switch - problem.first_wall)
    return problem.n_interfaces + kicks + event


@kernel
def next_due(problem, run, until, values):
    """Place in the queue of the event that is executed next, −1 for none.

    Parameters
    ----------
    until : float
        Events up to this time are due.
    """
    memory, size = run.carried[memory_start(problem) :], 2 + problem.n_states
    first, chosen, number, highest = TRUTH + problem.events.shape[0], ZERO - 1, ZERO, -np.inf
    for k in range(ZERO, np.int64(memory[QUEUED])):
        row = first + k * size
        if memory[row + 1] <= until:
            event, priority = np.int64(memory[row]), -np.inf
            if problem.events[event, PRIORITISED] > 0:
                expressions_of(problem, run, event, values)
                priority = values[problem.n_states + 1]
            equal = priority == highest and event < number
            if chosen < 0 or priority > highest or equal:
                chosen, number, highest = k, event, priority
    return chosen


@kernel
def execute_events(problem, run, record, until, values, search):
    """Execute all events that are due, in order of priority.

    Parameters
    ----------
    problem : Problem
    run : Run
    record : Record
    until : float
        Events up to this time are due.
    values : float64 array
        Work space, such as that of a series.
    search : EventSearch

    Returns
    -------
    int
        Number of executions, or minus the outcome of a run that cannot go on.
    """
    n_states, memory, counted = problem.n_states, run.carried[memory_start(problem) :], run.counted
    size, first, done = 2 + n_states, TRUTH + problem.events.shape[0], ZERO
    failed = note_conditions(problem, run, values)
    while failed == 0:
        k = next_due(problem, run, until, values)
        if k < 0:
            return done
        row = first + k * size
        event = np.int64(memory[row])
        counted[INTERFACE] = row_of(problem, event)
        if memory[LAST_TIME] != run.inputs[0]:
            memory[LAST_TIME], memory[AT_ONCE] = run.inputs[0], 0.0
        memory[AT_ONCE] += 1.0
        if memory[AT_ONCE] > executions_at_once(problem):
            return ZERO - ENDLESS_EVENTS
        if problem.events[event, AT_TRIGGER] > 0:
            for i in range(n_states):
                values[i] = memory[row + 2 + i]
        else:
            expressions_of(problem, run, event, values)
        for i in range(n_states):
            if problem.effects[event, i] > 0 and not np.isfinite(values[i]):
                return ZERO - RESET_NOT_FINITE
        list_reset(problem, run, record, counted[RESETS], problem.n_resets + event, False)
        for i in range(run.inputs.shape[0]):
            search.ahead[i] = run.inputs[i]
        for i in range(n_states):
            if problem.effects[event, i] > 0:
                run.inputs[1 + i] = values[i]
        list_reset(problem, run, record, counted[RESETS], problem.n_resets + event, True)
        counted[RESETS] += 1
        counted[INTERFACE] = -1
        remove(problem, memory, k)
        set_triggers(problem, run, event, values, search)
        done += 1
        failed = note_conditions(problem, run, values)
    return -failed
