"""Extremes of a run that stores neither its steps nor its crossings."""

from __future__ import annotations

from fastslow.kernels.compiler.decorators import kernel
from fastslow.simulation.stepper.polynomials import (
    DEEPEST,
    EPSILON,
    ZERO,
    excluded,
    halve,
    horner,
    reach,
    refine,
    to_bernstein,
)


@kernel
def widen_extremes(W, order, begin, taken, extremes, search):
    """Update the extremes of every state with those within a step, from an offset on.

    Parameters
    ----------
    W : float64 array
        Coefficients of the step, row by row.
    order : int
    begin, taken : float
        The interval of the step that counts, as offsets in time.
    extremes : float64 array, shape (2, n_states)
        Smallest and largest values so far, updated in place.
    search : EventSearch
        Work space.
    """
    columns = order + 1
    b, d = search.b, search.d
    for i in range(extremes.shape[1]):
        first = i * columns
        low, high = extremes[0, i], extremes[1, i]
        if begin <= 0.0:
            # a bound excludes new extremes in most steps
            most = reach(W, first, first + order, taken)
            if W[first] - most >= low and W[first] + most <= high:
                continue
        for k in range(columns):
            b[k] = W[first + k]
        if begin > 0.0:
            # the same polynomial about the later time, by repeated synthetic division
            for j in range(order):
                for k in range(order - 1, j - 1, -1):
                    b[k] += begin * b[k + 1]
        power, length = 1.0, taken - max(begin, 0.0)
        for k in range(columns):
            b[k] *= power
            power *= length
        last = horner(b, ZERO, order, 1.0)
        low, high = min(low, b[0], last), max(high, b[0], last)
        for k in range(order):
            d[k] = (k + 1) * b[k + 1]
        if not excluded(d, ZERO, order - 1):
            low, high = widen_by_extrema(b, d, order, low, high, search.stack)
        extremes[0, i], extremes[1, i] = low, high


@kernel
def widen_by_extrema(b, d, order, low, high, stack):
    """Widen [low, high] by the extrema of sum b_k s**k on [0, 1].

    An interval whose Bernstein coefficients are between the current extremes contains no
    new ones; monotone coefficients put the extremes at its ends, and one change of
    direction adds one extremum inside. Every other interval is bisected.

    Parameters
    ----------
    b, d : float64 arrays
        The coefficients, and those of the derivative.
    order : int
    low, high : float
    stack : float64 array, shape (DEEPEST + 2, > order + 3)
        Work space.
    """
    n = order
    to_bernstein(b, ZERO, n, stack)
    depth = 1
    while depth > 0:
        row = depth - 1
        begin, wide = stack[row, n + 1], stack[row, n + 2]
        turns, previous = 0, 0.0
        smallest = largest = stack[row, 0]
        for j in range(1, n + 1):
            smallest = min(smallest, stack[row, j])
            largest = max(largest, stack[row, j])
            change = stack[row, j] - stack[row, j - 1]
            if change != 0.0:
                if change * previous < 0.0:
                    turns += 1
                previous = change
        rounding = EPSILON * max(abs(smallest), abs(largest))
        if smallest >= low - rounding and largest <= high + rounding:
            depth -= 1
            continue
        first, last = stack[row, 0], stack[row, n]
        low, high = min(low, first, last), max(high, first, last)
        if turns == 0 or depth > DEEPEST:
            depth -= 1
            continue
        if turns == 1 and (stack[row, 1] - first) * (last - stack[row, n - 1]) < 0.0:
            rate = stack[row, 1] - first
            s = refine(d, ZERO, order - 1, begin, begin + wide, rate)
            value = horner(b, ZERO, order, s)
            low, high = min(low, value), max(high, value)
            depth -= 1
            continue
        halve(stack, row, n)
        depth += 1
    return low, high
