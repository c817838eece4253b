"""The stepping loop: Taylor steps, crossings and samples, compiled once for all models."""

from __future__ import annotations

import numpy as np

from fastslow.compiled.parts import part
from fastslow.compiled.pointers import call_address
from fastslow.simulation.collocation import memory_size
from fastslow.simulation.events import find_event, holds, put_on
from fastslow.simulation.extremes import widen_extremes
from fastslow.simulation.modes import (
    MANY_MODES,
    NOT_DEFINED,
    choose_mode,
    expand,
    interface_noise,
)
from fastslow.simulation.polynomials import ZERO, horner
from fastslow.simulation.settled import DAMPING, IMPLICIT, PAYS, long_step, settled

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


@part
def grown(array):
    """A copy with room for twice as many rows."""
    larger = np.empty((2 * array.shape[0] + 16, array.shape[1]))
    for i in range(array.shape[0]):
        for j in range(array.shape[1]):
            larger[i, j] = array[i, j]
    return larger


@part
def sample(W, columns, rows, s, out, first):
    """Evaluate rows of a step at the offsets s, into the columns of ``out`` from the first."""
    n = s.shape[0]
    for i in range(rows):
        top = i * columns + columns - 1
        # four at a time, because each waits for its own last product
        for c in range(0, n - 3, 4):
            s0, s1, s2, s3 = s[c], s[c + 1], s[c + 2], s[c + 3]
            v0 = v1 = v2 = v3 = W[top]
            for k in range(1, columns):
                coefficient = W[top - k]
                v0 = v0 * s0 + coefficient
                v1 = v1 * s1 + coefficient
                v2 = v2 * s2 + coefficient
                v3 = v3 * s3 + coefficient
            out[i, first + c] = v0
            out[i, first + c + 1] = v1
            out[i, first + c + 2] = v2
            out[i, first + c + 3] = v3
        for c in range(n - n % 4, n):
            out[i, first + c] = horner(W, top - columns + 1, top, s[c])


@part
def drive(
    address,
    layout,
    sizes,
    signs,
    continuous,
    parameters,
    start,
    span,
    tol,
    times,
    samples,
    since,
    dense,
    limits,
    store,
    extremes,
    hits,
    seen,
):
    """Follow one trajectory from start to end.

    Every step and every crossing is put into a table, or, where there are
    arrays for it, they are summed up as the run goes. Which of the two is
    settled when this is compiled: without arrays their place holds None.

    Parameters
    ----------
    address : int
        Of the compiled series.
    layout : tuple of int
        (n_states, n_forcing, n_interfaces, n_modes, order).
    sizes : tuple of int
        (number of rows that the series fills, work space for the event search,
        number of fast states, or 0 for no implicit steps).
    signs : int64 array, shape (n_modes, n_interfaces)
    continuous : bool array, shape (n_interfaces,)
    parameters, start : float64 arrays
    span : tuple of float
        Start and end of time.
    tol : float
    times : float64 array
        Increasing times of the samples, within the span.
    samples : float64 array, shape (n_rows, n_times)
        The first rows at those times, as far as they are reached; filled here.
    since : float
        Time from which extremes and hits count.
    dense : bool
        Whether the series of every step is kept.
    limits : tuple of int
        Largest numbers of steps and crossings.
    store : float64 array
        Room for the series, replaced by a larger one where it does not suffice.
    extremes : float64 array, shape (2, n_states), or None
        Smallest and largest value of every state, widened here.
    hits : int64 array, shape (n_interfaces, 2), or None
        Crossings upwards and downwards, counted here.
    seen : float64 array, shape (n_modes,), or None
        When each mode was last left, set here.

    Returns
    -------
    code, mode : int
        How it ended, and in which mode.
    end : ndarray, shape (1 + n_states,)
        Time and state reached.
    n_steps : int
    steps : ndarray, shape (n_steps, 3)
        Time, length and mode of every step; no rows where they are summed up.
    store : ndarray
        Coefficients of states and slow quantities, step by step, when ``dense``.
    crossings : ndarray, shape (n_crossings, 6 + n_states)
        Time, interface, direction, mode before, mode after, near-tangential, state.
    n_samples : int
        How many samples were reached.
    """
    n_states, n_forcing, n_interfaces, n_modes, order = layout
    n_rows, stack_rows, n_fast = sizes
    columns = order + 1
    kept = n_states + n_forcing
    stride = kept * columns
    size = n_rows * columns
    t, late, stop = span[0], 0.0, span[1]
    whole = stop - t
    inputs = np.empty(1 + kept)
    inputs[0] = t
    for i in range(n_states):
        inputs[1 + i] = start[i]
    work, W = np.empty(size), np.empty(size)
    right, poly = np.empty(size if n_fast > 0 else 0), np.empty(size if n_fast > 0 else 0)
    matrices = np.empty((2, n_states, n_states + 1))
    vectors = np.empty((5, max(1 + kept, columns)))
    b, d = np.empty(columns), np.empty(columns)
    stack = np.empty((stack_rows, columns + 3))
    memory = np.zeros(memory_size(n_states, order))
    gradient = np.empty(2 + n_states)
    noise = np.zeros(n_interfaces)
    on = np.zeros(n_interfaces, dtype=np.bool_)
    hit = np.zeros(n_interfaces, dtype=np.bool_)
    rests = np.zeros(n_interfaces, dtype=np.bool_)
    side = np.zeros(n_interfaces, dtype=np.int64)
    steps = np.empty((64 if extremes is None else 0, 4))
    crossings = np.empty((16 if extremes is None else 0, 6 + n_states))
    offsets = np.empty(times.shape[0])
    n_steps = n_crossings = n_samples = crowd = ZERO
    mode = interface = np.int64(-1)
    depth, floor, last_event, usual, longest = 1.0, 0.0, -np.inf, 0.0, 0.0
    code = REACHED_END
    choosing, touched = True, False
    # implicit steps: when to try again, how long to wait after a failure, how many, how long
    calm, pause, in_a_row, wanted = ZERO + 4, ZERO + 4, ZERO, 0.0
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
                address,
                layout,
                signs,
                continuous,
                inputs,
                parameters,
                tol,
                whole,
                on,
                side,
                before,
                work,
                b,
                noise,
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
                    turn = signs[mode, j] - signs[before, j]
                    if extremes is None:
                        if n_crossings == crossings.shape[0]:
                            crossings = grown(crossings)
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
            if n_crossings >= limits[1]:
                code = TOO_MANY_CROSSINGS
                break
            choosing = touched = False
            calm = pause = ZERO + 4
            in_a_row = ZERO
        remaining = (stop - t) - late
        if not remaining > 0.0:
            break
        if n_steps == limits[0]:
            code = TOO_MANY_STEPS
            break
        if in_a_row > 0:
            # an implicit step has left the first coefficients of the series at its end
            W, right = right, W
        else:
            longest = expand(address, layout, mode, inputs, parameters, tol, remaining, W, memory)
            if not longest > 0.0:
                code = NOT_FINITE
                break
        taken, long = 0.0, False
        for i in range(n_states, kept):
            inputs[1 + i] = W[i * columns]
        calm -= 1
        if n_fast > 0 and calm <= 0 and (in_a_row > 0 or settled(W, layout, longest, tol)):
            if in_a_row == 0:
                wanted = 1.25 * longest
            taken, growth = long_step(
                address,
                layout,
                n_fast,
                signs,
                mode,
                inputs,
                parameters,
                tol,
                wanted,
                (1.1 if in_a_row < DAMPING else PAYS) * longest,
                longest,
                remaining,
                W,
                right,
                poly,
                matrices,
                vectors,
                on,
                rests,
                noise,
                b,
                stack,
                gradient,
            )
            long = taken > 0.0
            if long:
                wanted, pause, in_a_row = growth * taken, ZERO + 4, in_a_row + 1
                W, poly = poly, W
                s, h, interface, final = 2.0, taken, ZERO - 1, taken >= remaining
            else:
                if in_a_row > 0:
                    longest = expand(
                        address, layout, mode, inputs, parameters, tol, remaining, W, memory
                    )
                pause = min(2 * pause, 64)
                calm, in_a_row = pause, ZERO
        if not long:
            final = longest >= remaining
            # a step between two times that are exact in floating point loses none of it
            h = remaining if final else (t + longest) - t
            if h == 0.0:
                code = STEP_TOO_SMALL
                break
            while True:
                s, interface, touched, depth, floor = find_event(
                    address,
                    layout,
                    signs,
                    mode,
                    inputs,
                    parameters,
                    W,
                    h,
                    on,
                    rests,
                    noise,
                    b,
                    stack,
                    gradient,
                )
                taken = s * h if interface >= 0 else h
                # where a step grew much its last terms may be small by accident
                doubtful = taken > 2.0 * usual or longest > 4.0 * remaining
                if (
                    h == 0.0
                    or not doubtful
                    or holds(address, layout, mode, inputs, parameters, W, taken, tol, work)
                ):
                    break
                h, final = (t + 0.25 * taken) - t, False
            usual = max(taken, 0.1 * usual)
        if h == 0.0:
            code = STEP_TOO_SMALL
            break
        begin, lag = t, late
        if interface >= 0:
            t = begin + taken
            late = lag + (taken - (t - begin))
            if s == 1.0 and final:
                t, late = stop, 0.0
        elif final:
            t, late = stop, 0.0
        else:
            t = begin + h
        if taken > 0.0:
            if extremes is None:
                if n_steps == steps.shape[0]:
                    steps = grown(steps)
                steps[n_steps, 0], steps[n_steps, 1], steps[n_steps, 2] = begin, taken, mode
                steps[n_steps, 3] = IMPLICIT if long else memory[0]
            else:
                seen[mode] = t
                if t > since:
                    unused = (since - begin) - lag
                    widen_extremes(W, n_states, order, unused, taken, extremes, b, d, stack)
            if dense:
                if (n_steps + 1) * stride > store.shape[0]:
                    larger = np.empty(2 * store.shape[0] + 64 * stride)
                    for i in range(n_steps * stride):
                        larger[i] = store[i]
                    store = larger
                for i in range(stride):
                    store[n_steps * stride + i] = W[i]
            n_steps += 1
            first = n_samples
            while n_samples < times.shape[0] and times[n_samples] <= t:
                offsets[n_samples] = (times[n_samples] - begin) - lag
                n_samples += 1
            if n_samples > first:
                sample(W, columns, samples.shape[0], offsets[first:n_samples], samples, first)
            for i in range(kept):
                inputs[1 + i] = horner(W, i * columns, i * columns + order, taken)
        inputs[0] = t
        for j in range(n_interfaces):
            hit[j] = signs[mode, j] == 0
            if hit[j]:
                put_on(address, n_modes, j, inputs, parameters, gradient, n_states)
            # a motion that rests on an interface may leave it in the next step: look again
            on[j] = rests[j]
            choosing = choosing or rests[j]
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
    for i in range(n_states):
        end[1 + i] = inputs[1 + i]
    listed = (steps[:n_steps], store, crossings[:n_crossings])
    return (code, mode, end, n_steps, listed, n_samples)
