"""Walls: application of resets, and the passage of chattering to rest."""

from __future__ import annotations

import numpy as np

from fastslow.kernels.compiler.decorators import kernel
from fastslow.kernels.compiler.pointers import call_address
from fastslow.simulation.stepper.motion_selection import (
    BEGINNING,
    NO_MODE,
    UNFORMED_MODE,
    UNPROPOSED,
    bounds_of,
    interface_noise,
    scaled,
)
from fastslow.simulation.stepper.polynomials import EPSILON, ONE, ZERO, first_above_noise
from fastslow.simulation.stepper.scales import REACHED, step_length
from fastslow.simulation.stepper.workspace import JUMPED, NEXT_MODE, PROPOSED, SIZES

#: Motion relative to the walls: away from all that it touches, into one (to be reset), with zero
#: velocity and pressed onto one (to rest), beyond one, or unknown because the series is not finite.
AWAY, INTO, PRESSED, BEYOND, UNKNOWN = range(5)

#: Entries of the memory of chattering: 1 + wall of the last prediction (0 for none), its time; then
#: its state.
WALL, END, STATE = range(3)

#: Times that a state is moved onto each of several walls.
ENTRIES = 50


@kernel
def matching_mode(signs, side):
    """The mode with given sides of all interfaces and walls, -1 if there is none."""
    for mode in range(signs.shape[0]):
        alike = True
        for j in range(signs.shape[1]):
            alike = alike and signs[mode, j] == side[j]
        if alike:
            return mode
    return -1


@kernel
def note_walls(problem, run, search, fresh):
    """Before a jump, note the walls that the state is off; ``fresh`` for the first at a time."""
    for j in range(problem.first_wall, problem.first_switch):
        error = interface_noise(problem, run, j, search.gradient)
        off = search.gradient[0] < -error
        search.below[j] = off or (search.below[j] and not fresh)


@kernel
def is_rest(problem, mode):
    """Check whether a motion rests on a wall."""
    found = False
    for j in range(problem.first_wall, problem.first_switch):
        found = found or problem.signs[mode, j] == 0
    return found


@kernel
def rest_beside(problem, run, wall, search):
    """The mode that rests on a wall besides those on which the selected motion rests.

    `NO_MODE` if there is none, `UNFORMED_MODE` if it has not been formed so far.
    """
    signs, side, selected = problem.signs, search.side, run.counted[NEXT_MODE]
    if problem.forming == 0:
        before = side[wall]
        side[wall] = 0
        rest = matching_mode(signs, side)
        side[wall] = before
        return rest
    if not problem.rests[wall]:
        return ZERO + NO_MODE
    for mode in range(signs.shape[0]):
        alike = signs[mode, wall] == 0
        for j in range(signs.shape[1]):
            alike = alike and (j == wall or signs[mode, j] == signs[selected, j])
        if alike:
            return mode
    return ZERO + (UNFORMED_MODE if run.counted[PROPOSED] == UNPROPOSED else NO_MODE)


@kernel
def replaced(problem, run, place, number, values):
    """Replace the states of a place by the values of a jump; return False if one is not finite."""
    call_address(problem.series, -1 - number, place, run.parameters, values)
    for i in range(problem.n_states):
        if not np.isfinite(values[i]):
            return False
    for i in range(problem.n_states):
        place[1 + i] = values[i]
    return True


@kernel
def apply_jump(problem, run, number, values):
    """Replace the state by the values of a jump; return False where one is not finite."""
    return replaced(problem, run, run.inputs, number, values)


@kernel
def enter_rest(problem, run, place, mode, values):
    """Replace the states of a place by those on the walls of a motion at rest.

    Where motions are formed during a run, the state is moved onto one wall after the other: of
    walls that depend on each other this is the iteration of Gauss and Seidel.
    Returns False where a value is not finite.
    """
    if problem.forming == 0:
        number = problem.n_resets + mode - (problem.n_modes - problem.n_rests)
        return replaced(problem, run, place, number, values)
    count = ZERO
    for j in range(problem.first_wall, problem.first_switch):
        count += problem.signs[mode, j] == 0
    for _ in range(ENTRIES if count > 1 else 1):
        for j in range(problem.first_wall, problem.first_switch):
            number = problem.n_resets + j - problem.first_wall
            if problem.signs[mode, j] == 0 and not replaced(problem, run, place, number, values):
                return False
    return True


@kernel
def list_reset(problem, run, record, row, number, after):
    """List time, number and state before or after a reset; without lists, count it."""
    resets, n = record.resets, problem.n_states
    if record.extremes.shape[0] > 0:
        # those at instants of time follow the interfaces, walls and switches
        beyond = number - (problem.first_switch - problem.first_wall)
        row = problem.n_interfaces + beyond if beyond >= 0 else problem.first_wall + number
        if after:
            record.hits[row, 0] += run.inputs[0] >= run.since
        return
    first = 2 + (n if after else 0)
    resets[row, 0], resets[row, 1] = run.inputs[0], number
    for i in range(n):
        resets[row, first + i] = run.inputs[1 + i]


@kernel
def motion_at_walls(problem, run, mode, whole, W, floor, scales, search):
    """Classify a motion, given by its series, relative to all walls at which it does not rest.

    Fills ``on`` for the walls. A wall onto which the state has jumped, and on which it stays
    without a motion at rest, is moved into: its relation has become true.

    Returns
    -------
    int
        `AWAY`, `INTO`, `PRESSED`, `BEYOND` or `UNKNOWN`.
    wall : int
        Its index among the interfaces, -1 for none.
    """
    signs, order, n_interfaces = problem.signs, problem.order, problem.n_interfaces
    on, hit, noise, b = search.on, search.hit, search.noise, search.b
    jumped = run.counted[JUMPED] > 0
    first_h = problem.n_states + problem.n_forcing
    length = min(whole, step_length(W, first_h + n_interfaces, order, problem.tol, scales))
    if not length > 0.0:
        return UNKNOWN, ZERO - 1
    for j in range(problem.first_wall, problem.first_switch):
        on[j] = False
        if signs[mode, j] == 0:
            on[j] = True
            continue
        error = interface_noise(problem, run, j, search.gradient)
        height = search.gradient[0]
        if hit[j]:
            error = max(error, floor)
        if height < -error:
            continue
        if height > error:
            # the error of a state is that of its range, also where it is small
            total = 0.0
            for i in range(problem.n_states):
                total += abs(search.gradient[2 + i]) * scaled(W, i, order, length, b)
            if height > 64.0 * EPSILON * total:
                return BEYOND, j
            error = height
        total = scaled(W, first_h + j, order, BEGINNING * length, b)
        noise[j] = max(error, 32.0 * EPSILON * total)
        on[j] = True
        k = first_above_noise(b, ONE, order, noise[j])
        if k <= order and b[k] > 0.0:
            return INTO if k == 1 else PRESSED, j
        if k > order and jumped and search.below[j] and not problem.rests[j]:
            return INTO, j
    return AWAY, ZERO - 1


@kernel
def pulled_wall(problem, mode, longest, W, scales, search):
    """First of several walls at rest, given by its series, that would have to pull; -1 for none.

    The contact force of one may change sign by the contact at another.
    """
    signs, order, b = problem.signs, problem.order, search.b
    first_h, resting = problem.n_states + problem.n_forcing, ZERO
    for j in range(problem.first_wall, problem.first_switch):
        resting += signs[mode, j] == 0
    drift = first_h + problem.n_interfaces
    length = min(longest, step_length(W, drift, order, problem.tol, scales))
    if resting < 2 or not length > 0.0:
        return ZERO - 1
    for j in range(problem.first_wall, problem.first_switch):
        if signs[mode, j] == 0:
            row, _ = bounds_of(problem, mode, j, drift)
            scaled(W, row + 1, order, BEGINNING * length, b)
            small = 32.0 * EPSILON * (abs(W[row * (order + 1)]) + abs(b[0]))
            k = first_above_noise(b, ZERO, order, small)
            if k <= order and b[k] < 0.0:
                return ZERO + j
    return ZERO - 1


@kernel
def chatter_ends(problem, run, wall, speed, W, work, scales, search):
    """Check whether the rest of a chatter may be passed in one step.

    After an impact with approach speed v, flights are r times shorter each, and the state
    rests on the wall after 2 r v / ((1 − r) a), a being the acceleration into the wall. The
    end and the state predicted from this impact are compared with those from the previous one:
    the difference measures the error, which is of second order in v. So is the height of the
    flights that are not computed, which must be below the tolerance as well.

    Parameters
    ----------
    problem : Problem
    run : Run
        After the reset.
    wall : int
    speed : float
        v.
    W : float64 array
        Series of the flight.
    work : float64 array
        Work space.
    scales : float64 array
    search : EventSearch
        ``side`` of all interfaces.

    Returns
    -------
    int
        The mode at rest, `NO_MODE` if the chatter is not passed, `UNFORMED_MODE` if the mode at
        rest has not been formed so far.
    """
    n, columns, ahead = problem.n_states, problem.order + 1, search.ahead
    # the last prediction
    memory = run.carried[SIZES + problem.rules.shape[1] :]
    row = (n + problem.n_forcing + wall) * columns
    away, pressed = -W[row + 1], 2.0 * W[row + 2]
    known = memory[WALL] == wall + 1.0
    low = problem.tol * scales[REACHED, n + problem.n_forcing + wall]
    ratio, height, rest = 1.0, np.inf, ZERO + NO_MODE
    if 0.0 < away < speed and pressed > 0.0:
        ratio, height = away / speed, 0.5 * away * away / pressed
        # else not even the flight after this one is low
        if height * ratio * ratio <= low:
            rest = rest_beside(problem, run, wall, search)
    if rest == UNFORMED_MODE:
        return rest
    memory[WALL] = 0.0
    if rest < 0:
        return rest
    length = 2.0 * away / ((1.0 - ratio) * pressed)
    for i in range(run.inputs.shape[0]):
        ahead[i] = run.inputs[i]
    enter_rest(problem, run, ahead, rest, search.rates)
    call_address(problem.series, rest, ahead, run.parameters, work)
    end = run.inputs[0] + length
    small = height <= low
    for i in range(n):
        rate = work[i * columns + 1]
        state = ahead[1 + i] + rate * length
        lag = rate * (end - memory[END])
        error = abs(state - memory[STATE + i] - lag) + abs(lag)
        size = max(abs(state), scales[REACHED, i])
        allowed = (1.0 - ratio) * problem.tol * size
        allowed += 8.0 * EPSILON * (abs(state) + abs(rate * end))
        small = small and error <= allowed
        memory[STATE + i] = state
    memory[WALL], memory[END] = wall + 1.0, end
    return rest if known and small else ZERO + NO_MODE
