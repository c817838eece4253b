"""Roots of the polynomials of a step: the first crossing of an interface, none missed.

Polynomials are given by coefficients scaled to the step, b_k = c_k h**k, so that the
step is 0 <= s <= 1.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from fastslow.kernels.compiler.decorators import kernel
from fastslow.kernels.vectors import horner_of_four

EPSILON = float(np.finfo(float).eps)

#: Maximum depth of the bisection.
DEEPEST = 44

_INVERSE_BINOMIALS = np.array(
    [[1.0 / math.comb(n, k) if k <= n else 0.0 for k in range(41)] for n in range(41)]
)

# plain integers would be literal types to Numba, and every function compiled once for each
ZERO: Any = np.int64(0)
ONE: Any = np.int64(1)


@kernel
def horner(b, first, last, s):
    """Value of sum b_k s**(k - first) over first <= k <= last."""
    if last - first < 2:
        return b[first] if last == first else b[last] * s + b[first]
    # even and odd powers apart, because each sum waits for its own last product
    square = s * s
    even, odd = b[last], b[last - 1]
    for k in range(last - 2, first, -2):
        even = even * square + b[k]
        odd = odd * square + b[k - 1]
    if (last - first) & 1 == 0:
        return even * square + b[first] + odd * s
    return even * s + odd


@kernel
def take_samples(W, columns, step, times, out, first, offsets):
    """Evaluate rows of a step at the sample times in it; return the index of the next sample.

    Parameters
    ----------
    W : float64 array
    columns : int
    step : tuple of float
        Begin, its compensation, and end.
    times : float64 array
        Increasing.
    out : float64 array, shape (rows, n_times)
    first : int
    offsets : float64 array
        Work space.
    """
    begin, lag, end = step
    while first < times.shape[0] and times[first] <= end:
        count, most = ZERO, min(offsets.shape[0], times.shape[0] - first)
        while count < most and times[first + count] <= end:
            offsets[count] = (times[first + count] - begin) - lag
            count += 1
        sample(W, columns, offsets[:count], out, first)
        first += count
    return first


@kernel
def sample(W, columns, s, out, first):
    """Evaluate rows of a step at the offsets s, into the columns of ``out`` from the first."""
    n, rows = s.shape[0], out.shape[0]
    for i in range(rows):
        last = i * columns + columns - 1
        for c in range(0, n - 3, 4):
            horner_of_four(W, last, columns, s, c, out, i * out.shape[1] + first + c)
        for c in range(n - n % 4, n):
            out[i, first + c] = horner(W, i * columns, last, s[c])


@kernel
def slope(b, first, last, s):
    """Derivative by s of the same sum."""
    value = 0.0
    for k in range(last, first, -1):
        value = value * s + (k - first) * b[k]
    return value


@kernel
def curvature(b, order, s):
    """Second derivative by s of sum b_k s**k."""
    value = 0.0
    for k in range(order, 1, -1):
        value = value * s + k * (k - 1) * b[k]
    return value


@kernel
def bounded_away(c, first, last, h):
    """Check |c_0| > sum |c_k| h**k, which excludes a root on [0, h]."""
    return abs(c[first]) > reach(c, first, last, h)


@kernel
def reach(c, first, last, h):
    """Sum of |c_k| h**(k - first) over first < k <= last."""
    square = h * h
    even, odd = abs(c[last]), abs(c[last - 1])
    for k in range(last - 2, first + 1, -2):
        even = even * square + abs(c[k])
        odd = odd * square + abs(c[k - 1])
    if (last - first) & 1 == 0:
        return even * square + odd * h
    return (even * square + abs(c[first + 1])) * h + odd * square


@kernel
def excluded(b, first, last):
    """Check whether the moduli of the coefficients exclude a root on (0, 1]."""
    rest = 0.0
    for k in range(first + 1, last + 1):
        rest += abs(b[k])
    return abs(b[first]) > rest


@kernel
def to_bernstein(b, first, n, stack):
    """Bernstein coefficients of sum b_k s**(k - first) on [0, 1], followed by begin and width."""
    # divide by the binomials, then sum along Pascal's triangle
    for k in range(n + 1):
        stack[0, k] = b[first + k] * _INVERSE_BINOMIALS[n, k]
    # two of its rows at a time, because every number that is put away has to be fetched again
    for level in range(1, n, 2):
        before, here = stack[0, level - 1], stack[0, level]
        above = stack[0, level] = here + before
        for j in range(level + 1, n + 1):
            before, here = here, stack[0, j]
            new = here + before
            stack[0, j] = new + above
            above = new
    if n % 2 == 1:
        stack[0, n] += stack[0, n - 1]
    stack[0, n + 1] = 0.0
    stack[0, n + 2] = 1.0


@kernel
def halve(stack, row, n):
    """Halve an interval by de Casteljau; its left half goes on top of the stack."""
    for j in range(n + 1):
        stack[row + 1, j] = stack[row, j]
    for level in range(1, n + 1):
        before = stack[row + 1, level - 1]
        for j in range(level, n + 1):
            here = stack[row + 1, j]
            stack[row + 1, j] = 0.5 * (here + before)
            before = here
    for level in range(1, n + 1):
        for j in range(n - level + 1):
            stack[row, j] = 0.5 * (stack[row, j] + stack[row, j + 1])
    begin, half = stack[row, n + 1], 0.5 * stack[row, n + 2]
    stack[row, n + 1], stack[row, n + 2] = begin + half, half
    stack[row + 1, n + 1], stack[row + 1, n + 2] = begin, half


@kernel
def first_root(b, first, last, noise, stack, touches):
    """First root on (0, 1] of sum b_k s**(k - first), and whether it is a touch.

    The signs of the Bernstein coefficients bound the number of roots of an
    interval from above, with equality for 0 and 1 (Descartes' rule); an
    interval with more is bisected. Two roots that agree with a double root
    within the noise are one, a touch.

    Parameters
    ----------
    b : float64 array
    first, last : int
    noise : float
        Size below which a value of the polynomial is rounding error.
    stack : float64 array, shape (DEEPEST + 2, > last + 3)
        Work space.
    touches : bool
        Whether a touch is a root.

    Returns
    -------
    s : float
        The root, or 2 if there is none.
    touch : bool
        Whether the sign is the same on both sides, up to rounding.
    """
    n = last - first
    to_bernstein(b, first, n, stack)
    depth = 1
    while depth > 0:
        row = depth - 1
        low, wide = stack[row, n + 1], stack[row, n + 2]
        changes, previous, largest = 0, 0.0, 0.0
        for j in range(n + 1):
            value = stack[row, j]
            largest = max(largest, abs(value))
            if value != 0.0:
                if value * previous < 0.0:
                    changes += 1
                previous = value
        ends = stack[row, 0] * stack[row, n]
        if changes == 0:
            if stack[row, n] == 0.0 and low + wide > 0.0:
                return low + wide, False
            depth -= 1
            continue
        if changes == 1 and ends < 0.0:
            return refine(b, first, last, low, low + wide, stack[row, 0]), False
        if largest <= noise or depth > DEEPEST:
            if ends < 0.0:
                return refine(b, first, last, low, low + wide, stack[row, 0]), False
            if touches:
                return (low + 0.5 * wide if low + wide < 1.0 else low + wide), True
            if stack[row, n] == 0.0:
                return low + wide, False
            depth -= 1
            continue
        halve(stack, row, n)
        depth += 1
    return 2.0, False


@kernel
def refine(b, first, last, low, high, at_low):
    """The root of a sign change on [low, high] to rounding: Newton, kept inside the bracket.

    ``at_low`` has the sign at its lower end, where rounding may change that of a sum.
    """
    s, moved = 0.5 * (low + high), 0.0
    for _ in range(100):
        # value and derivative at once, because each waits for its own last product
        value, rate = b[last], 0.0
        for k in range(last - 1, first - 1, -1):
            rate = rate * s + value
            value = value * s + b[k]
        if value == 0.0:
            break
        if (value > 0.0) == (at_low > 0.0):
            low = s
        else:
            high = s
        new = s - value / rate if rate != 0.0 else low - 1.0
        move = abs(new - s)
        if low < new < high:
            # the next correction is about K moved**2, as this one was K times the last squared
            near = move * move * move <= 1e-17 * abs(new) * moved * moved
            s, moved = new, move
            if near or move <= 1e-16 * abs(new):
                break
        elif move <= 1e-16 * abs(s):
            # at the root, which is an end of the bracket: the correction is rounding
            break
        else:
            # a bisection gives no information on the convergence of Newton's method
            new, moved = 0.5 * (low + high), 0.0
            if new == s:
                break
            s = new
    return s


@kernel
def first_above_noise(b, first, last, noise):
    """Index of the first coefficient above the noise, last + 1 if there is none."""
    for k in range(first, last + 1):
        if abs(b[k]) > noise:
            return k
    return last + 1


@kernel
def first_nonzero(b, first, last):
    """Index of the first coefficient that is not exactly zero, last + 1 if there is none."""
    return first_above_noise(b, first, last, 0.0)
