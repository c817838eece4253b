"""Event location: the first time within a step at which its smooth motion ends."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from fastslow.kernels.compiler.decorators import kernel
from fastslow.kernels.compiler.pointers import call_address
from fastslow.kernels.compiler.records import Flags, Integers, Matrix, Vector, zeros
from fastslow.simulation.stepper.motion_selection import (
    BEGINNING,
    EARLY,
    bounds_of,
    interface_noise,
    orientation,
    scaled,
)
from fastslow.simulation.stepper.polynomials import (
    EPSILON,
    ONE,
    ZERO,
    bounded_away,
    curvature,
    excluded,
    first_above_noise,
    first_nonzero,
    first_root,
    horner,
    reach,
    slope,
)
from fastslow.simulation.stepper.scales import NOW

#: Multiple of its rounding error at which a value has a sign.
CLEARLY = 16.0

#: Largest move of a state onto an interface that it crosses, in units of its scale and of the
#: tolerance, the accuracy of the crossing. Only along a sliding motion does the distance grow.
MOST_MOVED = 100.0

#: Logarithm of e to base 2.
LOG2_E = 1.0 / math.log(2.0)

#: Rows of the bisection stack.
STACK_ROWS = 46


class EventSearch(NamedTuple):
    """Work space of event location, and the status of every interface.

    Parameters
    ----------
    on, hit, remains, below : bool array, shape (n_interfaces,)
        Whether a step starts on it, has ended on it, or starts on it and does not leave; of a
        wall, whether the state was off it before the last jump.
    side : int64 array, shape (n_interfaces,)
        Sign of h.
    noise : float64 array, shape (n_interfaces,)
        Rounding error of h.
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
    remains: Flags
    below: Flags
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


def search_for(n_states: int, n_forcing: int, n_interfaces: int, order: int) -> EventSearch:
    """Allocate the work space of event location for a model of these sizes."""
    columns, n = order + 1, n_states
    return zeros(
        EventSearch,
        on=n_interfaces,
        hit=n_interfaces,
        remains=n_interfaces,
        below=n_interfaces,
        side=n_interfaces,
        noise=n_interfaces,
        gradient=2 + n,
        b=columns,
        d=columns,
        stack=(STACK_ROWS, columns + 3),
        ahead=1 + n + n_forcing,
        rates=n,
        basis=(n_interfaces, n),
        move=n,
    )


@kernel
def find_event(problem, run, mode, W, h, search):
    """Locate the first event in a step, as a fraction of the step.

    Fills ``remains``: the interfaces on which the step starts and which it does not leave.

    Returns
    -------
    s : float
        Above 1 without an event.
    j : int
        The interface (at the end of sliding, the sliding interface), -1 for none.
    touch : bool
        Whether h touches zero without a change of sign (grazing).
    depth : float
        Relative change of h that would remove the crossing.
    floor : float
        Rounding error of h there.
    """
    signs, n_interfaces, order = problem.signs, problem.n_interfaces, problem.order
    on, remains, noise, b = search.on, search.remains, search.noise, search.b
    stack, gradient = search.stack, search.gradient
    first_h = problem.n_states + problem.n_forcing
    drift, columns = first_h + n_interfaces, order + 1
    best, interface, touched, depth, floor = 2.0, ZERO - 1, False, 1.0, 0.0
    for j in range(n_interfaces):
        remains[j] = False
        sign = signs[mode, j]
        if sign == 0:
            row, several = bounds_of(problem, mode, j, drift)
            turned = orientation(W, row, several, columns)
            for k in range(2):
                scaled(W, row + k, order, h, b)
                small = 32.0 * EPSILON * abs(b[0])
                start, side = ZERO, (2 * k - 1) * turned
                if b[0] * side <= 0.0:
                    start = first_above_noise(b, ONE, order, small)
                    if start <= order and b[start] * side < 0.0:
                        size = abs(W[row * columns]) + abs(W[(row + 1) * columns])
                        small = 32.0 * EPSILON * size
                        start = first_above_noise(b, ONE, order, small)
                    if start > order:
                        continue
                    if b[start] * side < 0.0:
                        # it ends at once: where the bound is clearly above its rounding error
                        s = (CLEARLY * small / abs(b[start])) ** (1.0 / start)
                        if s < min(best, 1.0):
                            best, interface, touched, depth = s, j, False, 1.0
                        continue
                if not excluded(b, start, order):
                    s, _ = first_root(b, start, order, small, stack, False)
                    if s < best:
                        best, interface, touched, depth = s, j, False, 1.0
            continue
        row = (first_h + j) * columns
        if W[row] * sign > 0.0 and not on[j] and bounded_away(W, row, row + order, h):
            continue
        start = ZERO
        if on[j]:
            scaled(W, first_h + j, order, BEGINNING * h, b)
            start = first_above_noise(b, ONE, order, noise[j])
            if j >= problem.first_wall and start <= order and b[start] * sign < 0.0:
                # away from the wall by less than the rounding error, and back
                start = first_nonzero(b, ONE, order)
                if b[start] * sign < 0.0:
                    return 0.0, j, False, 1.0, 0.0
        total = scaled(W, first_h + j, order, h, b)
        if on[j]:
            if start > order:
                remains[j] = True
                if total > noise[j] and best > BEGINNING:
                    # it is known to remain at the beginning only: check again after it
                    best, interface, touched = BEGINNING, j, j >= problem.first_wall
                continue
        elif b[0] * sign <= 0.0:
            return 0.0, j, False, 1.0, 0.0
        if excluded(b, start, order):
            continue
        least = interface_noise(problem, run, j, gradient)
        small = max(least, 8.0 * EPSILON * total)
        s, touch = first_root(b, start, order, small, stack, True)
        if s < EARLY:
            # a long step with large terms: two crossings may have been taken for a touch
            small = max(least, 8.0 * EPSILON * reach(b, ZERO, order, 2.0 * s))
            if touch:
                s, touch = first_root(b, start, order, small, stack, True)
        if s <= 1.0 and not touch:
            s, touch = grazing_point(b, order, s, small, sign)
        if s < best and s <= 1.0:
            best, interface, touched, floor = s, j, touch, small
            depth = crossing_depth(b, order, s, max(gradient[1], total))
    return best, interface, touched, depth, floor


@kernel
def error_acceptable(problem, run, mode, W, taken, scales, work, search):
    """Check the rates at the end of a step against the derivatives of its series.

    If they differ, the rates are evaluated again at states perturbed by rounding, and the
    difference is allowed for.
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


@kernel
def grazing_point(b, order, s, small, sign):
    """The root, or the nearby extremum of h where the two agree to rounding: a grazing point."""
    rate = slope(b, ZERO, order, s)
    bend = curvature(b, order, s)
    if bend * sign <= 0.0 or 0.5 * rate * rate > small * bend * sign:
        return s, False
    turn = min(max(s - rate / bend, 0.0), 1.0)
    beyond = turn + 4.0 * (small / (bend * sign)) ** 0.5
    if beyond < 1.0 and horner(b, ZERO, order, beyond) * sign > 0.0:
        return turn, True
    return s, False


@kernel
def crossing_depth(b, order, s, size):
    """Depth of the osculating parabola of h beyond its root, relative to the size of h."""
    rate = slope(b, ZERO, order, s)
    bend = curvature(b, order, s)
    if bend == 0.0 or size == 0.0:
        return 1.0
    return min(1.0, 0.5 * rate * rate / (abs(bend) * size))


@kernel
def unit_at(size):
    """Power of two at a size, by which nothing is rounded; 0 of zero and of no finite size."""
    return 2.0 ** math.ceil(math.log(size) * LOG2_E) if 0.0 < size < np.inf else 0.0


@kernel
def unit_of(run, scales, i):
    """Unit of a state, from its scale and its value."""
    return unit_at(max(scales[NOW, i], abs(run.inputs[1 + i])))


@kernel
def scaled_gradient(problem, run, j, gradient, scales, row):
    """Fill ``row`` with the gradient of an interface in units of the scales, at most 1.

    Returns the value of its function in the same unit; NaN if the gradient vanishes.
    """
    call_address(problem.series, problem.n_modes + j, run.inputs, run.parameters, gradient)
    largest = 0.0
    for i in range(problem.n_states):
        row[i] = gradient[2 + i] * unit_of(run, scales, i)
        largest = max(largest, abs(row[i]))
    unit = unit_at(largest)
    if unit == 0.0:
        return np.nan
    for i in range(problem.n_states):
        row[i] /= unit
    return gradient[0] / unit


@kernel
def project_onto_interfaces(problem, run, crossed, search, scales):
    """Project the state onto all interfaces hit, by the least Newton step in units of the scales.

    The move of a state is then independent of the units of all, and relative to the value of a
    state whose scale is its value, which may be small by many orders of magnitude. No state is
    moved by more than the tolerance onto the interface ``crossed``, if any: if it moves in time,
    its distance may be the rounding error of time. Of interfaces with linearly dependent
    gradients the first ones are used.
    """
    hit, basis, move, n_states = search.hit, search.basis, search.move, problem.n_states
    for i in range(n_states):
        move[i] = 0.0
    # Gram-Schmidt on the gradients, each with the value of its function that remains after
    # the moves along the previous ones
    kept = ZERO
    for j in range(hit.shape[0]):
        if not hit[j]:
            continue
        row = basis[kept]
        value = scaled_gradient(problem, run, j, search.gradient, scales, row)
        whole = left = 0.0
        for i in range(n_states):
            whole += row[i] * row[i]
            value += row[i] * move[i]
        for k in range(kept):
            along = size = 0.0
            for i in range(n_states):
                along += row[i] * basis[k, i]
                size += basis[k, i] * basis[k, i]
            for i in range(n_states):
                row[i] -= along / size * basis[k, i]
        for i in range(n_states):
            left += row[i] * row[i]
        most = MOST_MOVED * problem.tol if j == crossed else np.inf
        if left > 1e-12 * whole and abs(value) / left <= most:
            for i in range(n_states):
                move[i] -= value * row[i] / left
            kept += 1
    for i in range(n_states):
        if move[i] != 0.0:
            run.inputs[1 + i] += move[i] * unit_of(run, scales, i)
