"""Where within a step its smooth motion ends."""

from __future__ import annotations

from typing import NamedTuple

from fastslow.kernels.decorators import part
from fastslow.kernels.pointers import call_address
from fastslow.kernels.records import Flags, Integers, Matrix, Vector, zeros
from fastslow.simulation.stepper.modes import (
    BEGINNING,
    bounds_of,
    interface_noise,
    scaled,
    turned_round,
)
from fastslow.simulation.stepper.polynomials import (
    EPSILON,
    ONE,
    ZERO,
    curvature,
    excluded,
    first_root,
    first_strong,
    horner,
    kept_away,
    slope,
)
from fastslow.simulation.stepper.scales import NOW

#: Rows of the stack in which intervals are halved.
STACK_ROWS = 46


class Search(NamedTuple):
    """Work space for events, and what is known of every interface.

    Parameters
    ----------
    on, hit, rests : bool array, shape (n_interfaces,)
        Whether a step begins on it, has ended on it, or begins on it and does not leave.
    side : int64 array, shape (n_interfaces,)
        Sign of h.
    noise : float64 array, shape (n_interfaces,)
        Size of h that is rounding error.
    gradient : float64 array, shape (2 + n_states,)
    b, d : float64 arrays, shape (order + 1,)
    stack : float64 array, shape (STACK_ROWS, order + 4)
    ahead : float64 array, shape (1 + n_states + n_forcing,)
    rates : float64 array, shape (n_states,)
    basis : float64 array, shape (n_interfaces, n_states)
    move : float64 array, shape (n_states,)
    """

    on: Flags
    hit: Flags
    rests: Flags
    side: Integers
    noise: Vector
    gradient: Vector
    b: Vector
    d: Vector
    stack: Matrix
    ahead: Vector
    rates: Vector
    basis: Matrix
    move: Vector


def search_for(n_states: int, n_forcing: int, n_interfaces: int, order: int) -> Search:
    """Work space for the events of a model of these sizes."""
    columns, n = order + 1, n_states
    return zeros(
        Search,
        *[n_interfaces] * 5,
        2 + n,
        *(columns, columns),
        (STACK_ROWS, columns + 3),
        1 + n + n_forcing,
        n,
        (n_interfaces, n),
        n,
    )


@part
def find_event(problem, run, mode, W, h, search):
    """The first time in a step at which its motion ends, as a part of the step.

    Fills ``rests``: the interfaces that it began on and does not leave.

    Returns
    -------
    s : float
        Above 1 when the whole step is free of events.
    j : int
        The interface (that is slid along, where sliding ends), -1 for none.
    touch : bool
        Whether h does not change its sign there.
    depth : float
        Relative change of h that would undo the crossing.
    floor : float
        Size of h that is rounding error there.
    """
    signs, n_interfaces, order = problem.signs, problem.n_interfaces, problem.order
    on, rests, noise, b = search.on, search.rests, search.noise, search.b
    stack, gradient = search.stack, search.gradient
    first_h = problem.n_states + problem.n_forcing
    drift = first_h + n_interfaces
    best, interface, touched, depth, floor = 2.0, ZERO - 1, False, 1.0, 0.0
    for j in range(n_interfaces):
        rests[j] = False
        sign = signs[mode, j]
        if sign == 0:
            row, several = bounds_of(signs, mode, j, drift)
            turned = turned_round(W, row, several, order + 1)
            for k in range(2):
                scaled(W, row + k, order, h, b)
                small = 32.0 * EPSILON * abs(b[0])
                start = ZERO
                if b[0] * (2 * k - 1) * turned <= 0.0:
                    start = first_strong(b, ONE, order, small)
                    if start > order:
                        continue
                if not excluded(b, start, order):
                    s, touch = first_root(b, start, order, small, stack)
                    if s < best and not touch:
                        best, interface, touched, depth = s, j, False, 1.0
            continue
        row = (first_h + j) * (order + 1)
        if W[row] * sign > 0.0 and not on[j] and kept_away(W, row, row + order, h):
            continue
        start = ZERO
        if on[j]:
            scaled(W, first_h + j, order, BEGINNING * h, b)
            start = first_strong(b, ONE, order, noise[j])
        total = scaled(W, first_h + j, order, h, b)
        if on[j]:
            if start > order:
                rests[j] = True
                if total > noise[j] and best > BEGINNING:
                    # only the beginning is known to rest: look again after it
                    best, interface, touched = BEGINNING, j, False
                continue
        elif b[0] * sign <= 0.0:
            return 0.0, j, False, 1.0, 0.0
        if excluded(b, start, order):
            continue
        small = interface_noise(problem, run, j, gradient)
        small = max(small, 8.0 * EPSILON * total)
        s, touch = first_root(b, start, order, small, stack)
        if s <= 1.0 and not touch:
            s, touch = turning_point(b, order, s, small, sign)
        if s < best and s <= 1.0:
            best, interface, touched, floor = s, j, touch, small
            depth = undoing(b, order, s, max(gradient[1], total))
    return best, interface, touched, depth, floor


@part
def holds(problem, run, mode, W, taken, scales, work, search):
    """Whether the rates at the end of a step are the derivatives of its series.

    As far as rounding of the states lets them be known: where they differ, the rates are
    evaluated again at states that differ by it.
    """
    n_states, order, tol = problem.n_states, problem.order, problem.tol
    columns = order + 1
    ahead, rates = search.ahead, search.rates
    ahead[0] = run.inputs[0] + taken
    for i in range(n_states):
        ahead[1 + i] = horner(W, i * columns, i * columns + order, taken)
    call_address(problem.series, mode, ahead, run.parameters, work)
    for i in range(n_states):
        rates[i] = work[i * columns + 1]
    looked = False
    for i in range(n_states):
        row = i * columns
        rate = rates[i]
        size = max(scales[NOW, i], abs(ahead[1 + i]))
        defect = abs(slope(W, row, row + order, taken) - rate) * taken
        allowed = 100.0 * (tol * size + EPSILON * abs(rate) * taken)
        if not defect <= allowed:
            if not looked:
                for k in range(n_states):
                    ahead[1 + k] *= 1.0 + (2 - k % 2) * EPSILON
                call_address(problem.series, mode, ahead, run.parameters, work)
                looked = True
            if not defect <= allowed + 100.0 * abs(work[row + 1] - rate) * taken:
                return False
    return True


@part
def turning_point(b, order, s, small, sign):
    """The root again, or where h turns back just there: a touch, as far as rounding can tell."""
    rate = slope(b, ZERO, order, s)
    bend = curvature(b, order, s)
    if bend * sign <= 0.0 or 0.5 * rate * rate > small * bend * sign:
        return s, False
    turn = min(max(s - rate / bend, 0.0), 1.0)
    beyond = turn + 4.0 * (small / (bend * sign)) ** 0.5
    if beyond < 1.0 and horner(b, ZERO, order, beyond) * sign > 0.0:
        return turn, True
    return s, False


@part
def undoing(b, order, s, size):
    """Depth of the parabola that h follows beyond its root, relative to its size."""
    rate = slope(b, ZERO, order, s)
    bend = curvature(b, order, s)
    if bend == 0.0 or size == 0.0:
        return 1.0
    return min(1.0, 0.5 * rate * rate / (abs(bend) * size))


@part
def put_on(problem, run, j, gradient):
    """Move the state onto an interface, by Newton along its gradient."""
    inputs, n_states = run.inputs, problem.n_states
    call_address(problem.series, problem.n_modes + j, inputs, run.parameters, gradient)
    square = 0.0
    for i in range(n_states):
        square += gradient[2 + i] * gradient[2 + i]
    if square > 0.0:
        for i in range(n_states):
            inputs[1 + i] -= gradient[0] * gradient[2 + i] / square


@part
def put_on_all(problem, run, search):
    """Move the state onto every interface that is hit, by the least-norm Newton step.

    Of interfaces that coincide, or whose gradients depend on one another, the first decide.
    """
    hit, gradient, n_states = search.hit, search.gradient, problem.n_states
    count = ZERO
    for j in range(hit.shape[0]):
        count += hit[j]
    if count == 0:
        return
    if count == 1:
        for j in range(hit.shape[0]):
            if hit[j]:
                put_on(problem, run, j, gradient)
        return
    # gradients made orthogonal one after the other (Gram and Schmidt), each with what is
    # left of its function's value once the moves along those before are made
    basis, move = search.basis, search.move
    for i in range(n_states):
        move[i] = 0.0
    kept = ZERO
    for j in range(hit.shape[0]):
        if not hit[j]:
            continue
        call_address(problem.series, problem.n_modes + j, run.inputs, run.parameters, gradient)
        value = whole = left = 0.0
        value = gradient[0]
        for i in range(n_states):
            whole += gradient[2 + i] * gradient[2 + i]
            value += gradient[2 + i] * move[i]
            basis[kept, i] = gradient[2 + i]
        for k in range(kept):
            along = size = 0.0
            for i in range(n_states):
                along += basis[kept, i] * basis[k, i]
                size += basis[k, i] * basis[k, i]
            for i in range(n_states):
                basis[kept, i] -= along / size * basis[k, i]
        for i in range(n_states):
            left += basis[kept, i] * basis[kept, i]
        if left > 1e-12 * whole:
            for i in range(n_states):
                move[i] -= value * basis[kept, i] / left
            kept += 1
    for i in range(n_states):
        run.inputs[1 + i] += move[i]
