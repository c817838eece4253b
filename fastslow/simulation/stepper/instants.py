"""Instants known in advance, at which a step ends exactly: knots of tables, and clocks."""

from __future__ import annotations

import numpy as np

from fastslow.kernels.compiler.decorators import kernel
from fastslow.simulation.stepper.polynomials import EPSILON, ZERO
from fastslow.simulation.stepper.resets import apply_jump, list_reset
from fastslow.simulation.stepper.switches import list_switch, set_switch
from fastslow.simulation.stepper.workspace import RESETS

#: Columns of `Problem.instants`, one row for each table and clock. The first of its parameters:
#: for a table the index of the piece, counted over all periods, its knot, and its coefficients,
#: and in `Problem.knots` its last knot, infinite without a period; for a clock the number of
#: the last instant, its time, the period, and the time of instant 0. Then for a table the
#: number of its parameters without the index, and the rows of `Problem.knots` of its first and
#: its last piece (-1 for a clock). Last the jump at every instant of a clock, -1 for none; after
#: the resets, two for every switch: it becomes 0 or 1.
PLACE, LENGTH, FIRST, LAST, JUMP = range(5)

#: Instants are the same up to this rounding error of times.
ROUNDING = 32.0 * EPSILON


@kernel
def instant_after(problem, parameters, k):
    """Time of the next instant of one table or clock, infinite after the last."""
    instants = problem.instants
    place = instants[k, PLACE]
    if instants[k, FIRST] < 0:
        return parameters[place + 3] + (parameters[place] + 1.0) * parameters[place + 2]
    row, shift = piece_of(problem, parameters, k)
    return problem.knots[row + 1, 0] + shift


@kernel
def piece_of(problem, parameters, k):
    """Row of `Problem.knots` of the current piece of a table, and the time of its period."""
    instants, knots = problem.instants, problem.knots
    first, last, piece = instants[k, FIRST], instants[k, LAST], parameters[instants[k, PLACE]]
    length = knots[last + 1, 0] - knots[first, 0]
    if not length < np.inf:
        return first + np.int64(piece), 0.0
    count = last + 1 - first
    period = np.floor(piece / count)
    return first + np.int64(piece - period * count), period * length


@kernel
def next_instant(problem, parameters):
    """Time of the next instant, infinite after the last."""
    soonest = np.inf
    for k in range(problem.instants.shape[0]):
        soonest = min(soonest, instant_after(problem, parameters, k))
    return soonest


@kernel
def due(problem, parameters, k, t):
    """Check whether the next instant of one table or clock is at time t, up to rounding."""
    place, after = problem.instants[k, PLACE], instant_after(problem, parameters, k)
    gap = after - parameters[place + 1]
    size = abs(t) + gap
    if problem.instants[k, FIRST] < 0:
        size += abs(parameters[place + 3])
    return after - t < min(ROUNDING * size, 0.25 * gap)


@kernel
def instant_due(problem, parameters, t):
    """Check whether an instant is at time t, up to rounding."""
    found = False
    for k in range(problem.instants.shape[0]):
        found = found or due(problem, parameters, k, t)
    return found


@kernel
def pass_instant(problem, run, record, t, values):
    """Move every table with a knot at this time to its next piece, and apply the jumps of clocks.

    Returns the number of a jump to values that are not finite, −1 for none.
    """
    failed = ZERO - 1
    instants, knots, parameters = problem.instants, problem.knots, run.parameters
    counted = run.counted
    for k in range(instants.shape[0]):
        if due(problem, parameters, k, t):
            place = instants[k, PLACE]
            parameters[place] += 1.0
            if instants[k, FIRST] < 0:
                count = parameters[place]
                instant = parameters[place + 3] + count * parameters[place + 2]
                parameters[place + 1] = min(instant, t)
            else:
                row, shift = piece_of(problem, parameters, k)
                for j in range(ZERO, instants[k, LENGTH]):
                    parameters[place + 1 + j] = knots[row, j]
                parameters[place + 1] += shift
            jump = instants[k, JUMP]
            if jump >= problem.n_resets:
                switch, value = (jump - problem.n_resets) // 2, (jump - problem.n_resets) % 2
                if parameters[problem.switch_place + 2 * switch] != value:
                    set_switch(problem, parameters, switch, 1.0 * value)
                    list_switch(problem, run, record, switch, value)
            elif jump >= 0:
                list_reset(problem, run, record, counted[RESETS], jump, False)
                if not apply_jump(problem, run, jump, values):
                    failed = ZERO + jump
                    continue
                list_reset(problem, run, record, counted[RESETS], jump, True)
                counted[RESETS] += 1
    return failed
