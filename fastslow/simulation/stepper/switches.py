"""Switches: their states at the start of a run, and their changes."""

from __future__ import annotations

import numpy as np

from fastslow.kernels.compiler.decorators import kernel
from fastslow.kernels.compiler.pointers import call_address
from fastslow.simulation.stepper.motion_selection import (
    BEGINNING,
    interface_noise,
    laws_after,
    scaled,
)
from fastslow.simulation.stepper.polynomials import EPSILON, ONE, ZERO, first_above_noise
from fastslow.simulation.stepper.scales import step_length
from fastslow.simulation.stepper.workspace import MODE, RESETS

#: What has changed; inequalities are those in the conditions of events.
UNCHANGED, INEQUALITIES, SWITCHES = range(3)


@kernel
def set_switch(problem, parameters, k, value):
    """Set a switch to a value, which is NaN if it is not known."""
    place = problem.switch_place + 2 * k
    parameters[place], parameters[place + 1] = value, 1.0 - value


@kernel
def begin_switches(problem, run, whole, W, scales, search):
    """Set the switches at the start of a run as their relations require.

    A switch of which neither relation is true keeps the given value. All are evaluated at once,
    and again as relations may depend on other switches.

    Parameters
    ----------
    problem : Problem
    run : Run
        With given states of the switches, NaN for none.
    whole : float
        Longest useful step.
    W : float64 array
        Work space.
    scales : float64 array
    search : EventSearch

    Returns
    -------
    int
        Row of a switch without a state, -1 for none.
    """
    parameters, side, n = run.parameters, search.side, problem.n_states
    first, count = problem.first_switch, problem.first_trigger - problem.first_switch
    laws_after(problem, run, ZERO, whole, W, scales, search)
    for i in range(n, n + problem.n_forcing):
        run.inputs[1 + i] = W[i * (problem.order + 1)]
    missing = ZERO - 1
    for _ in range(count + 1):
        for k in range(count):
            given = parameters[problem.switch_place + 2 * k]
            found = given
            for value in range(2):
                # this function is positive where the relation is true that sets the value
                set_switch(problem, parameters, k, 1.0 - value)
                noise = interface_noise(problem, run, first + k, search.gradient)
                height = search.gradient[0]
                if height > noise or (np.isnan(given) and height >= 0.0):
                    found = 1.0 * value
            set_switch(problem, parameters, k, given)
            side[first + k] = -1 if np.isnan(found) else np.int64(found)
        missing = ZERO - 1
        for k in range(count):
            if side[first + k] >= 0:
                set_switch(problem, parameters, k, 1.0 * side[first + k])
            elif missing < 0:
                missing = first + k
    return missing


@kernel
def list_switch(problem, run, record, k, value):
    """List the time, the number and the state at a change of a switch; without lists, count it."""
    row = run.counted[RESETS]
    run.counted[RESETS] += 1
    if record.extremes.shape[0] > 0:
        record.hits[problem.first_switch + k, 1 - value] += run.inputs[0] >= run.since
        return
    n, resets = problem.n_states, record.resets
    resets[row, 0], resets[row, 1] = (
        run.inputs[0],
        problem.n_resets + problem.events.shape[0] + 2 * k + value,
    )
    for i in range(n):
        resets[row, 2 + i] = resets[row, 2 + n + i] = run.inputs[1 + i]


@kernel
def change_switches(problem, run, record, certain, W, scales, search, expanded):
    """Change all switches and inequalities at once that are, or become by a motion, true.

    Fills ``on`` and ``noise`` of the others.

    Parameters
    ----------
    problem : Problem
    run : Run
    record : Record
    certain : int
        Row of a switch or inequality that has been located to become true, -1 for none.
    W : float64 array
        Series of the motion, if it is expanded.
    scales : float64 array
    search : EventSearch
    expanded : bool
        Without it the motion is expanded here if it decides.

    Returns
    -------
    int
        `UNCHANGED`, `INEQUALITIES`, or `SWITCHES` if any of these has changed.
    """
    on, noise, side, b = search.on, search.noise, search.side, search.b
    order, first, n_interfaces = problem.order, problem.first_switch, problem.n_interfaces
    first_h = problem.n_states + problem.n_forcing
    length, measured = 0.0, False
    for j in range(first, n_interfaces):
        error = interface_noise(problem, run, j, search.gradient)
        height = search.gradient[0]
        timed = j >= problem.first_trigger and problem.of_time[j]
        near = j != certain and (timed or -error <= height <= error)
        if near and not expanded:
            call_address(problem.series, run.counted[MODE], run.inputs, run.parameters, W)
            expanded = True
        if near and not measured:
            length = step_length(W, first_h + n_interfaces, order, problem.tol, scales)
            length, measured = min(run.stop - run.begin, length), True
        if near and timed:
            # reached up to the rounding error of time
            rate = abs(W[(first_h + j) * (order + 1) + 1])
            error = max(error, 8.0 * EPSILON * abs(run.inputs[0]) * rate)
        changes = j == certain or height > error
        on[j] = not changes and height >= -error
        if on[j] and length > 0.0:
            total = scaled(W, first_h + j, order, BEGINNING * length, b)
            noise[j] = max(error, 32.0 * EPSILON * total)
            k = first_above_noise(b, ONE, order, noise[j])
            changes = k <= order and b[k] > 0.0
        side[j] = 1 if changes else -1
    changed = ZERO + UNCHANGED
    for j in range(first, n_interfaces):
        if side[j] > 0:
            k = j - first
            value = 1 - np.int64(run.parameters[problem.switch_place + 2 * k])
            set_switch(problem, run.parameters, k, 1.0 * value)
            if j < problem.first_trigger:
                list_switch(problem, run, record, k, value)
            side[j] = -1
            changed = max(changed, SWITCHES if j < problem.first_trigger else INEQUALITIES)
    return changed
