"""Error scales of a step, determined from the run itself.

In every row of a step (state, slow quantity, switching function) an error of
rtol times a size is allowed. That size is the maximum of the value itself, of a
fixed one (atol / rtol, if atol is given), and of the recent maximum of the run.
It is free of units: a run in other units of states or time takes the same steps.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.kernels.compiler.decorators import kernel
from fastslow.simulation.stepper.polynomials import reach

#: Rows of the array of sizes: at the beginning of this step, and the recent maximum.
NOW, REACHED = 0, 1

#: Rows of the rules: the fixed size, and the decay factor of the recent maximum per step.
FIXED, LASTING = 0, 1

#: Decay factor per step of the recent maximum: one half after 35 steps, so that a large
#: transient does not loosen later errors, and a passage through zero does not tighten them.
FORGETTING = 0.98

#: Smallest nonzero size: below it digits are lost, and the reciprocal overflows.
SMALLEST_SIZE = 1e-300

#: Factor by which a step is shortened over which the argument of a saturating function changes.
SATURATION_FACTOR = 0.7

#: Fraction of the step below which it is not shortened for them.
SHORTEST = 1e-9

#: Leading terms that give the size of a row that starts at zero.
LEADING = 4


def rules_of(
    fixed: NDArray[np.float64], lasting: NDArray[np.float64], n_forcing: int, n_interfaces: int
) -> NDArray[Any]:
    """Scale rules of the rows of a step, from those of its states.

    Parameters
    ----------
    fixed : float64 array, shape (n_states,)
        atol / rtol, 0 if none is given.
    lasting : float64 array, shape (n_states,)
        `FORGETTING`, or 0 if the size is the value itself or the fixed one.
    n_forcing, n_interfaces : int
    """
    nothing, ones = np.zeros(n_forcing + n_interfaces), np.ones(n_interfaces)
    # the function of a sliding interface is rounding: its size is that of the whole run
    others = np.concatenate([np.full(n_forcing, FORGETTING), ones])
    return np.stack([np.concatenate([fixed, nothing]), np.concatenate([lasting, others])])


@kernel
def step_length(W, n_rows, order, tol, scales):
    """Step length for which the last terms equal the tolerance (Jorba and Zou 2005).

    An error of ``tol`` times its size is allowed in every row. Three terms are used,
    because series of even or odd functions lack every other one. The current sizes are
    filled in; a row that starts at zero gets the size of its series within the step.

    Returns
    -------
    float
        Infinite if the series terminates, NaN if it is not finite.
    """
    columns = order + 1
    last = before = third = finite = 0.0
    blank = False
    for i in range(n_rows):
        row = i * columns
        size = max(abs(W[row]), scales[REACHED, i])
        scales[NOW, i] = size
        finite += 0.0 * (W[row] + W[row + order] + W[row + order - 1])
        if size > SMALLEST_SIZE:
            scale = 1.0 / size
            last = max(last, abs(W[row + order]) * scale)
            before = max(before, abs(W[row + order - 1]) * scale)
            third = max(third, abs(W[row + order - 2]) * scale)
        else:
            blank = True
    if finite != 0.0:
        return np.nan
    # logarithms of the lengths: powers with whole exponents take longer
    allowed, length = math.log(tol), np.inf
    if last > 0.0:
        length = (allowed - math.log(last)) / order
    if before > 0.0:
        length = min(length, (allowed - math.log(before)) / (order - 1))
    if third > 0.0:
        length = min(length, (allowed - math.log(third)) / (order - 2))
    length = math.exp(length)
    if blank:
        for i in range(n_rows):
            if scales[NOW, i] <= SMALLEST_SIZE:
                length = min(length, own_length(W, i * columns, order, tol))
        for i in range(n_rows):
            if scales[NOW, i] <= SMALLEST_SIZE:
                scales[NOW, i] = within(W, i * columns, length)
    return length


@kernel
def unsaturated_length(W, order, mode, rows, limits, length, room):
    """Shorten a step until no argument of a function that saturates may pass its transition.

    Parameters
    ----------
    W : float64 array
    order, mode : int
    rows, limits : arrays
        See `fastslow.kernels.taylor.saturation.saturation_arrays`.
    length, room : float
        Length of the step, and the largest useful one.

    Returns
    -------
    float
        ``length``, or a smaller one.
    """
    whole = min(length, room)
    h, least = whole, SHORTEST * whole
    for k in range(rows.shape[1]):
        if rows[mode, k] < 0:
            break
        first = rows[mode, k] * (order + 1)
        size = abs(W[first])
        if not size < np.inf:
            continue
        # the last coefficients of work rows may be missing
        last = first + order - 1
        while h > least and not remains_saturated(limits, mode, k, size, reach(W, first, last, h)):
            h *= SATURATION_FACTOR
    return length if h == whole else h


@kernel
def remains_saturated(limits, mode, k, size, change):
    """Check that an argument passes no transition of its function.

    Parameters
    ----------
    limits : float64 array
    mode, k : int
        Mode and number of the argument.
    size, change : float
        Its modulus at the beginning, and the largest change.
    """
    change_allowed = limits[mode, 4 * k] + limits[mode, 4 * k + 1] * size
    low, high = limits[mode, 4 * k + 2], limits[mode, 4 * k + 3]
    return change <= change_allowed or size + change <= low or size - change >= high


@kernel
def own_length(W, row, order, tol):
    """Step length for which the last terms are the tolerance times the largest leading one."""
    length = np.inf
    for k in range(order - 2, order + 1):
        last = abs(W[row + k])
        if last > 0.0:
            longest = 0.0
            for m in range(LEADING):
                first = abs(W[row + m])
                if first > 0.0:
                    longest = max(longest, math.exp(math.log(tol * (first / last)) / (k - m)))
            if longest > 0.0:
                length = min(length, longest)
    return length


@kernel
def within(W, row, h):
    """Largest leading term of a row within a step; infinite lengths count as 0."""
    size = abs(W[row])
    if h < np.inf:
        power = 1.0
        for m in range(1, LEADING):
            power *= h
            size = max(size, abs(W[row + m]) * power)
    return size


@kernel
def raise_sizes(W, n_rows, order, tol, room, rules, scales):
    """Raise the sizes that follow the run to those given by the series."""
    columns = order + 1
    length = room
    for i in range(n_rows):
        length = min(length, own_length(W, i * columns, order, tol))
    for i in range(n_rows):
        if rules[LASTING, i] > 0.0:
            size = within(W, i * columns, length)
            if size < np.inf:
                scales[REACHED, i] = max(scales[REACHED, i], size)


@kernel
def remember_sizes(rules, scales):
    """Update the recent maxima after a step."""
    for i in range(rules.shape[1]):
        scales[REACHED, i] = max(rules[FIXED, i], rules[LASTING, i] * scales[NOW, i])


@kernel
def flush(inputs, n_states):
    """Set every state below `SMALLEST_SIZE`, of which rounding would leave a residue, to zero."""
    for i in range(n_states):
        if abs(inputs[1 + i]) < SMALLEST_SIZE:
            inputs[1 + i] = 0.0


@kernel
def ratio_of(error, allowed):
    """Error in units of the allowed one; infinite for a nonzero error where none is allowed."""
    if error == 0.0:
        return 0.0
    return abs(error) / allowed if allowed > 0.0 else np.inf
