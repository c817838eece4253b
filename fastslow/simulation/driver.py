"""The stepping loop: Taylor steps, crossings and samples, compiled once for all models."""

from __future__ import annotations

import numpy as np
from numba import njit

from fastslow.compiled.pointers import call_address
from fastslow.simulation.modes import (
    EPSILON,
    MANY_MODES,
    NOT_DEFINED,
    choose_mode,
    interface_noise,
    scaled,
    step_length,
)
from fastslow.simulation.polynomials import excluded, first_root, first_strong, horner, slope

#: How the loop ended.
REACHED_END = 0
TOO_MANY_STEPS = 1
TOO_MANY_CROSSINGS = 2
STEP_TOO_SMALL = 3
NOT_FINITE = 4
NOT_UNIQUE = 5
NO_WAY_ON = 6
ACCUMULATION = 7

#: Crossings in a row, none farther from the last than rounding of time, that end a run.
CROWD = 40

#: A crossing is near-tangential when moving h by this part of its scale would undo it.
TANGENTIAL = 1e-6


@njit
def find_event(address, layout, signs, mode, inputs, parameters, W, h, on, noise, b, stack, gradient):
    """The first time in a step at which its motion ends, as a part of the step.

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
    n_states, n_forcing, n_interfaces, n_modes, order = layout
    first_h = n_states + n_forcing
    drift = first_h + n_interfaces
    best, interface, touched, depth, floor = 2.0, -1, False, 1.0, 0.0
    for j in range(n_interfaces):
        sign = signs[mode, j]
        if sign == 0:
            for k in range(2):
                scaled(W, drift + k, order, h, b)
                small = 32.0 * EPSILON * abs(b[0])
                start = 0
                if b[0] * (2 * k - 1) <= 0.0:
                    start = first_strong(b, 1, order, small)
                    if start > order:
                        continue
                if not excluded(b, start, order):
                    s, touch = first_root(b, start, order, small, stack)
                    if s < best and not touch:
                        best, interface, touched, depth = s, j, False, 1.0
            continue
        total = scaled(W, first_h + j, order, h, b)
        start = 0
        if on[j]:
            start = first_strong(b, 1, order, noise[j])
            if start > order:
                continue
            on[j] = False
        elif b[0] * sign <= 0.0:
            return 0.0, j, False, 1.0, 0.0
        if excluded(b, start, order):
            continue
        small = interface_noise(address, n_modes, j, inputs, parameters, gradient)
        small = max(small, 8.0 * EPSILON * total)
        s, touch = first_root(b, start, order, small, stack)
        if s <= 1.0 and not touch:
            s, touch = turning_point(b, order, s, small, sign)
        if s < best and s <= 1.0:
            best, interface, touched, floor = s, j, touch, small
            depth = undoing(b, order, s, max(gradient[1], total))
    return best, interface, touched, depth, floor


@njit
def holds(address, layout, mode, inputs, parameters, W, part, tol, work):
    """Whether the rates at the end of a step are the derivatives of its series."""
    n_states, order = layout[0], layout[4]
    columns = order + 1
    ahead = np.empty(inputs.shape[0])
    ahead[0] = inputs[0] + part
    for i in range(n_states):
        ahead[1 + i] = horner(W[i * columns : (i + 1) * columns], 0, order, part)
    call_address(address, mode, ahead, parameters, work)
    for i in range(n_states):
        row = i * columns
        rate = work[row + 1]
        defect = abs(slope(W[row : row + columns], 0, order, part) - rate) * part
        if not defect <= 100.0 * (tol * (1.0 + abs(ahead[1 + i])) + EPSILON * abs(rate) * part):
            return False
    return True


@njit
def turning_point(b, order, s, small, sign):
    """The root again, or where h turns back just there: a touch, as far as rounding can tell."""
    rate = slope(b, 0, order, s)
    bend = curvature(b, order, s)
    if bend * sign <= 0.0 or 0.5 * rate * rate > small * bend * sign:
        return s, False
    turn = min(max(s - rate / bend, 0.0), 1.0)
    beyond = turn + 4.0 * (small / (bend * sign)) ** 0.5
    if beyond < 1.0 and horner(b, 0, order, beyond) * sign > 0.0:
        return turn, True
    return s, False


@njit
def curvature(b, order, s):
    """Second derivative by s of sum b_k s**k."""
    value = 0.0
    for k in range(order, 1, -1):
        value = value * s + k * (k - 1) * b[k]
    return value


@njit
def undoing(b, order, s, size):
    """Depth of the parabola that h follows beyond its root, relative to its size."""
    rate = slope(b, 0, order, s)
    bend = curvature(b, order, s)
    if bend == 0.0 or size == 0.0:
        return 1.0
    return min(1.0, 0.5 * rate * rate / (abs(bend) * size))


@njit
def put_on(address, n_modes, j, inputs, parameters, gradient, n_states):
    """Move the state onto an interface, by Newton along its gradient."""
    call_address(address, n_modes + j, inputs, parameters, gradient)
    square = 0.0
    for i in range(n_states):
        square += gradient[2 + i] * gradient[2 + i]
    if square > 0.0:
        for i in range(n_states):
            inputs[1 + i] -= gradient[0] * gradient[2 + i] / square


@njit
def grown(array):
    """A copy with room for twice as many rows."""
    larger = np.empty((2 * array.shape[0] + 16, array.shape[1]))
    larger[: array.shape[0]] = array
    return larger


@njit(fastmath={"contract"})
def sample(W, columns, rows, s, out, first):
    """Evaluate rows of a step at the offsets s, into the columns of ``out`` from the first."""
    n = s.shape[0]
    for i in range(rows):
        top = i * columns + columns - 1
        for c in range(n):
            value = W[top]
            for k in range(1, columns):
                value = value * s[c] + W[top - k]
            out[i, first + c] = value


@njit
def drive(
    address, layout, sizes, signs, parameters, start, span, tol, times, sampled_rows, dense,
    limits, store,
):
    """Follow one trajectory from start to end.

    Parameters
    ----------
    address : int
        Of the compiled series.
    layout : tuple of int
        (n_states, n_forcing, n_interfaces, n_modes, order).
    sizes : tuple of int
        (number of rows that the series fills, work space for the event search).
    signs : int64 array, shape (n_modes, n_interfaces)
    parameters, start : float64 arrays
    span : tuple of float
        Start and end of time.
    tol : float
    times : float64 array
        Increasing times of the samples, within the span.
    sampled_rows : int
        How many rows are sampled.
    dense : bool
        Whether the series of every step is kept.
    limits : tuple of int
        Largest numbers of steps and crossings.
    store : float64 array
        Room for the series, replaced by a larger one where it does not suffice.

    Returns
    -------
    code, mode : int
        How it ended, and in which mode.
    end : ndarray, shape (1 + n_states,)
        Time and state reached.
    steps : ndarray, shape (n_steps, 3)
        Time, length and mode of every step.
    store : ndarray
        Coefficients of states and slow quantities, step by step, when ``dense``.
    crossings : ndarray, shape (n_crossings, 6 + n_states)
        Time, interface, direction, mode before, mode after, near-tangential, state.
    samples : ndarray, shape (sampled_rows, n_times)
    n_samples : int
        How many samples were reached.
    """
    n_states, n_forcing, n_interfaces, n_modes, order = layout
    n_rows, stack_rows = sizes
    columns = order + 1
    kept = n_states + n_forcing
    drift = kept + n_interfaces
    stride = kept * columns
    size = n_rows * columns
    t, late, stop = span[0], 0.0, span[1]
    whole = stop - t
    inputs = np.empty(1 + kept)
    inputs[0] = t
    inputs[1 : 1 + n_states] = start
    work, W = np.empty(size), np.empty(size)
    b = np.empty(columns)
    stack = np.empty((stack_rows, columns + 3))
    gradient = np.empty(2 + n_states)
    noise = np.zeros(n_interfaces)
    on = np.zeros(n_interfaces, dtype=np.bool_)
    hit = np.zeros(n_interfaces, dtype=np.bool_)
    side = np.zeros(n_interfaces, dtype=np.int64)
    steps = np.empty((64, 3))
    crossings = np.empty((16, 6 + n_states))
    samples = np.empty((sampled_rows, times.shape[0]))
    offsets = np.empty(times.shape[0])
    n_steps = n_crossings = n_samples = crowd = 0
    mode = interface = -1
    depth, floor, last_event, usual = 1.0, 0.0, -np.inf, 0.0
    code = REACHED_END
    choosing, touched = True, False
    while True:
        if choosing:
            call_address(address, max(mode, 0), inputs, parameters, work)
            for i in range(n_states, kept):
                inputs[1 + i] = work[i * columns]
            for j in range(n_interfaces):
                noise[j] = interface_noise(address, n_modes, j, inputs, parameters, gradient)
                if j == interface:
                    noise[j] = max(noise[j], floor)
                on[j] = hit[j] or abs(gradient[0]) <= noise[j]
                side[j] = 1 if gradient[0] > 0.0 else -1
            before = mode
            mode = choose_mode(
                address, layout, signs, inputs, parameters, tol, whole, on, side, before,
                work, b, noise,
            )
            if mode < 0:
                code = NO_WAY_ON
                if mode == MANY_MODES:
                    code = NOT_UNIQUE
                elif mode == NOT_DEFINED:
                    code = NOT_FINITE
                mode = before
                break
            for j in range(n_interfaces):
                changed = before >= 0 and signs[before, j] != signs[mode, j]
                if changed or (touched and mode == before and j == interface):
                    if n_crossings == crossings.shape[0]:
                        crossings = grown(crossings)
                    entry = crossings[n_crossings]
                    entry[0], entry[1] = t, j
                    entry[2] = np.sign(signs[mode, j] - signs[before, j])
                    entry[3], entry[4] = before, mode
                    entry[5] = depth < TANGENTIAL or not changed
                    entry[6:] = inputs[1 : 1 + n_states]
                    n_crossings += 1
            if n_crossings > limits[1]:
                code = TOO_MANY_CROSSINGS
                break
            choosing = touched = False
        remaining = (stop - t) - late
        if not remaining > 0.0:
            break
        if n_steps == limits[0]:
            code = TOO_MANY_STEPS
            break
        if dense:
            if n_steps * stride + size > store.shape[0]:
                larger = np.empty(2 * store.shape[0] + 64 * stride + size)
                larger[: n_steps * stride] = store[: n_steps * stride]
                store = larger
            W = store[n_steps * stride : n_steps * stride + size]
        call_address(address, mode, inputs, parameters, W)
        longest = step_length(W, drift, order, tol)
        if not longest > 0.0:
            code = NOT_FINITE
            break
        final = longest >= remaining
        # a step between two times that are exact in floating point loses none of it
        h = remaining if final else (t + longest) - t
        if h == 0.0:
            code = STEP_TOO_SMALL
            break
        for i in range(n_states, kept):
            inputs[1 + i] = W[i * columns]
        while True:
            s, interface, touched, depth, floor = find_event(
                address, layout, signs, mode, inputs, parameters, W, h, on, noise, b, stack,
                gradient,
            )
            part = s * h if interface >= 0 else h
            # where a step grew much its last terms may be small by accident
            doubtful = part > 2.0 * usual or longest > 4.0 * remaining
            if not doubtful or holds(
                address, layout, mode, inputs, parameters, W, part, tol, work
            ):
                break
            h, final = (t + 0.25 * part) - t, False
        usual = max(part, 0.1 * usual)
        if h == 0.0:
            code = STEP_TOO_SMALL
            break
        begin, lag = t, late
        if interface >= 0:
            t = begin + part
            late = lag + (part - (t - begin))
            if s == 1.0 and final:
                t, late = stop, 0.0
        elif final:
            t, late = stop, 0.0
        else:
            t = begin + h
        if part > 0.0:
            if n_steps == steps.shape[0]:
                steps = grown(steps)
            steps[n_steps, 0], steps[n_steps, 1], steps[n_steps, 2] = begin, part, mode
            n_steps += 1
            first = n_samples
            while n_samples < times.shape[0] and times[n_samples] <= t:
                offsets[n_samples] = (times[n_samples] - begin) - lag
                n_samples += 1
            if n_samples > first:
                sample(W, columns, sampled_rows, offsets[first:n_samples], samples, first)
            for i in range(kept):
                row = i * columns
                inputs[1 + i] = horner(W[row : row + columns], 0, order, part)
        inputs[0] = t
        for j in range(n_interfaces):
            hit[j] = signs[mode, j] == 0
            if hit[j]:
                put_on(address, n_modes, j, inputs, parameters, gradient, n_states)
            # still on an interface after a whole step: it rests there, so look again
            choosing = choosing or on[j] and signs[mode, j] != 0
        if interface >= 0:
            hit[interface] = choosing = True
            put_on(address, n_modes, interface, inputs, parameters, gradient, n_states)
            crowd = crowd + 1 if t - last_event <= 1e-13 * max(abs(t), whole) else 0
            last_event = t
            if crowd == CROWD:
                code = ACCUMULATION
                break
    end = np.empty(1 + n_states)
    end[0] = t
    end[1:] = inputs[1 : 1 + n_states]
    return (
        code, mode, end, steps[:n_steps], store, crossings[:n_crossings], samples, n_samples
    )
