"""Compiled isolation of all real solutions of a square polynomial system in boxes.

Subdivision in the Bernstein basis (Sherbrooke & Patrikalakis 1993; Garloff & Smith 2001): a box
contains no solution if the coefficients of one polynomial, or of one preconditioned by the
inverse Jacobian at the centre, have one sign. It contains exactly one if the Krawczyk operator
(Krawczyk 1969; Neumaier 1990, theorem 5.1.8) maps a slightly larger box into itself. Rounding
errors are bounded along with the coefficients, so that no solution is lost.
"""

from __future__ import annotations

import numpy as np

from fastslow.continuation.evaluation import EPS
from fastslow.continuation.spaces import PAUSED, TABLE_FULL
from fastslow.kernels.compiler.decorators import unfused_kernel

#: Enlargement of a box on either side for Krawczyk's test, in units of its width: a solution on
#: a common face is then inside both boxes.
BOX_MARGIN = 0.1

#: An interval of one sign with a larger ratio of its ends is divided at its geometric mean.
ENDS_RATIO = 4.0

#: Cut of other intervals: not the midpoint, where solutions are common.
CUT = 0.4871

#: What is known of a box: without a solution, with one near its centre, or neither.
EMPTY, NEAR, UNDECIDED = range(3)


@unfused_kernel
def _least(values):  # type: ignore[no-untyped-def]
    """Minimum, NaN if any value is NaN."""
    found = values[0]
    for k in range(values.shape[0]):
        if not values[k] >= found:
            found = values[k]
            if found != found:
                break
    return found


@unfused_kernel
def _greatest(values):  # type: ignore[no-untyped-def]
    """Maximum, NaN if any value is NaN."""
    found = values[0]
    for k in range(values.shape[0]):
        if not values[k] <= found:
            found = values[k]
            if found != found:
                break
    return found


@unfused_kernel
def _total(values):  # type: ignore[no-untyped-def]
    total = 0.0
    for k in range(values.shape[0]):
        total += values[k]
    return total


@unfused_kernel
def _binomials(most, table):  # type: ignore[no-untyped-def]
    for i in range(most + 1):
        table[i, 0] = 1.0
        for j in range(1, i + 1):
            table[i, j] = table[i - 1, j - 1] + (table[i - 1, j] if j < i else 0.0)


@unfused_kernel
def _along(matrix, degree, stride, tensor, scratch):  # type: ignore[no-untyped-def]
    """Multiply a flat tensor by a matrix along the axis of a degree and stride, in place."""
    size = tensor.shape[0]
    block = stride * (degree + 1)
    for first in range(0, size, block):
        for offset in range(first, first + stride):
            for i in range(degree + 1):
                total = 0.0
                for j in range(degree + 1):
                    total += matrix[i, j] * tensor[offset + j * stride]
                scratch[i] = total
            for i in range(degree + 1):
                tensor[offset + i * stride] = scratch[i]


@unfused_kernel
def _converted(power, degrees, low, high, out, error, space):  # type: ignore[no-untyped-def]
    """Convert polynomials from the power to the Bernstein basis on a box, with error bounds."""
    equations, size = power.shape
    matrix, scratch, sizes = space.conversion, space.scratch, space.moduli
    strides, table = space.strides, space.table
    for k in range(equations):
        for s in range(size):
            out[k, s] = power[k, s]
            sizes[s] = abs(power[k, s])
        operations = 8.0
        for m in range(degrees.shape[0]):
            d = degrees[m]
            operations += 4.0 * d + 4.0
            for weighed in range(2):
                a = low[m] if weighed == 0 else abs(low[m])
                b = high[m] if weighed == 0 else abs(high[m])
                for i in range(d + 1):
                    for j in range(d + 1):
                        total = 0.0
                        for chosen in range(max(0, j - (d - i)), min(i, j) + 1):
                            total += (
                                table[i, chosen]
                                * table[d - i, j - chosen]
                                * b**chosen
                                * a ** (j - chosen)
                            )
                        matrix[i, j] = total / table[d, j]
                _along(matrix, d, strides[m], out[k] if weighed == 0 else sizes, scratch)
        error[k] = operations * EPS * _greatest(sizes)


@unfused_kernel
def _halves(tensor, degree, stride, cut, left):  # type: ignore[no-untyped-def]
    """De Casteljau subdivision: the upper part in place, the lower part into ``left``."""
    size = tensor.shape[0]
    block = stride * (degree + 1)
    for first in range(0, size, block):
        for offset in range(first, first + stride):
            left[offset] = tensor[offset]
            for level in range(1, degree + 1):
                for i in range(degree - level + 1):
                    at = offset + i * stride
                    tensor[at] += cut * (tensor[at + stride] - tensor[at])
                left[offset + level * stride] = tensor[offset]


@unfused_kernel
def _inverted(matrix, inverse):  # type: ignore[no-untyped-def]
    """Inverse by elimination with row pivoting; False if singular to rounding."""
    n = matrix.shape[0]
    for i in range(n):
        largest = 0.0
        for j in range(n):
            largest = max(largest, abs(matrix[i, j]))
        if not (largest > 0.0 and np.isfinite(largest)):
            return False
        for j in range(n):
            matrix[i, j] /= largest
            inverse[i, j] = 1.0 / largest if i == j else 0.0
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(matrix[i, k]) > abs(matrix[best, k]):
                best = i
        if abs(matrix[best, k]) < 1e-13:
            return False
        for j in range(n):
            matrix[k, j], matrix[best, j] = matrix[best, j], matrix[k, j]
            inverse[k, j], inverse[best, j] = inverse[best, j], inverse[k, j]
        pivot = matrix[k, k]
        for j in range(n):
            matrix[k, j] /= pivot
            inverse[k, j] /= pivot
        for i in range(n):
            if i != k:
                factor = matrix[i, k]
                for j in range(n):
                    matrix[i, j] -= factor * matrix[k, j]
                    inverse[i, j] -= factor * inverse[k, j]
    return True


@unfused_kernel
def _deviation(tensor, degrees, strides, row, width, rounding, deviation):  # type: ignore[no-untyped-def]
    """Bounds on row ``row`` of |G' − I| over a box, from the coefficients of G."""
    size = tensor.shape[0]
    for m in range(degrees.shape[0]):
        d = degrees[m]
        stride = strides[m]
        block = stride * (d + 1)
        one = 1.0 if m == row else 0.0
        worst = one if d == 0 else 0.0
        for first in range(0, size, block):
            for at in range(first, first + stride * d):
                slope = d * (tensor[at + stride] - tensor[at]) / width
                worst = max(worst, abs(slope - one))
        deviation[m] = worst + 2.0 * d * rounding / width


@unfused_kernel
def _set_weights(degrees, table, strides, weights):  # type: ignore[no-untyped-def]
    """Fill in the sums over coefficients that give value and derivatives at the centre of a box."""
    n, size = degrees.shape[0], weights.shape[1]
    for row in range(n + 1):
        for s in range(size):
            weights[row, s] = 1.0
    for m in range(n):
        d = degrees[m]
        for s in range(size):
            i = (s // strides[m]) % (d + 1)
            plain = table[d, i] / 2.0**d
            for row in range(n + 1):
                if row == m + 1:
                    slope = 0.0
                    if d > 0:
                        upper = table[d - 1, i - 1] if i > 0 else 0.0
                        under = table[d - 1, i] if i < d else 0.0
                        slope = d * (upper - under) / 2.0 ** (d - 1)
                    weights[row, s] *= slope
                else:
                    weights[row, s] *= plain


@unfused_kernel
def _set_enlarging(degrees, enlarging, blossom):  # type: ignore[no-untyped-def]
    """Fill in the blossoms from the unit interval to the one with a margin; return their growth."""
    growth = 1.0
    for m in range(degrees.shape[0]):
        d = degrees[m]
        largest = 0.0
        for i in range(d + 1):
            # value of the blossom at i copies of 1 + margin and d − i copies of −margin
            for j in range(d + 1):
                blossom[j] = 0.0
            blossom[0] = 1.0
            for step in range(d):
                t = 1.0 + BOX_MARGIN if step < i else -BOX_MARGIN
                for j in range(step + 1, 0, -1):
                    blossom[j] = blossom[j] * (1.0 - t) + blossom[j - 1] * t
                blossom[0] *= 1.0 - t
            total = 0.0
            for j in range(d + 1):
                enlarging[m, i, j] = blossom[j]
                total += abs(blossom[j])
            largest = max(largest, total)
        growth *= largest
    return growth


@unfused_kernel
def _prepared(degrees, space):  # type: ignore[no-untyped-def]
    """Fill in the tables that depend on the degrees; return the growth of an enlarged box."""
    stride, most = 1, 0
    for m in range(degrees.shape[0] - 1, -1, -1):
        space.strides[m] = stride
        stride *= degrees[m] + 1
        most = max(most, degrees[m])
    _binomials(most, space.table)
    _set_weights(degrees, space.table, space.strides, space.weights)
    return _set_enlarging(degrees, space.enlarging, space.blossom)


@unfused_kernel
def _examined(subdivision, stack, here, sizes):  # type: ignore[no-untyped-def]
    """Exclude a box by the signs of the coefficients, or by the sizes of the unknowns.

    Fills in the largest modulus of the coefficients of each function.

    Returns
    -------
    empty : bool
    spent : bool
        Whether one polynomial is rounding on the whole box.
    """
    tensor, error = stack.coefficients[here], stack.rounding[here]
    low, high, large = stack.low[here], stack.high[here], subdivision.large
    n, spent, empty = low.shape[0], False, False
    for k in range(n):
        least, largest = _least(tensor[k]), _greatest(tensor[k])
        sizes[k] = max(abs(least), abs(largest))
        if least > error[k] or largest < -error[k]:
            return True, spent
        spent = spent or sizes[k] <= 4.0 * error[k]
    for k in range(n, tensor.shape[0]):
        largest = _greatest(tensor[k])
        sizes[k] = max(abs(_least(tensor[k])), abs(largest))
        if largest < -error[k]:
            return True, spent
    if large >= 0:
        least = min(abs(low[large]), abs(high[large]))
        for m in range(n):
            if subdivision.small[m] and low[m] * high[m] > 0.0:
                size = min(abs(low[m]), abs(high[m]))
                empty = empty or size * least > subdivision.share * (1.0 + 1e-9)
    return empty, spent


@unfused_kernel
def _copy_corners(stack, here):  # type: ignore[no-untyped-def]
    """Fill in the corners of the box after this one with those of this one."""
    for m in range(stack.low.shape[1]):
        stack.low[here + 1, m] = stack.low[here, m]
        stack.high[here + 1, m] = stack.high[here, m]


@unfused_kernel
def _divided_by_ratio(polynomials, logarithmic, stack, here, space):  # type: ignore[no-untyped-def]
    """Divide a box at the geometric mean of the interval with the largest ratio of its ends.

    Returns False if no ratio is large.
    """
    low, high = stack.low, stack.high
    axis, widest = -1, ENDS_RATIO
    for m in range(low.shape[1]):
        a, b = low[here, m], high[here, m]
        if logarithmic[m] and a * b > 0.0:
            ratio = max(b / a, a / b)
            if ratio > widest:
                widest, axis = ratio, m
    if axis < 0:
        return False
    a, b = low[here, axis], high[here, axis]
    middle = np.sqrt(a * b) if a > 0.0 else -np.sqrt(a * b)
    _copy_corners(stack, here)
    high[here, axis] = low[here + 1, axis] = middle
    power, degrees = polynomials
    for part in range(here, here + 2):
        tensor, error = stack.coefficients[part], stack.rounding[part]
        _converted(power, degrees, low[part], high[part], tensor, error, space)
    return True


@unfused_kernel
def _preconditioned(degrees, stack, here, space):  # type: ignore[no-untyped-def]
    """Precondition by the inverse Jacobian at the centre, and apply Krawczyk's operator.

    Returns `EMPTY`, `NEAR` if the solution is to be proved on the box with a margin, whose
    centre is then in ``space.centre``, or `UNDECIDED`.
    """
    tensor, error = stack.coefficients[here], stack.rounding[here]
    weights, jacobian, inverse = space.weights, space.jacobian, space.inverse
    rounding, centre, deviation = space.rounding, space.centre, space.deviation
    n, size, near = degrees.shape[0], tensor.shape[1], True
    for k in range(n):
        for m in range(n):
            total = 0.0
            for s in range(size):
                total += weights[m + 1, s] * tensor[k, s]
            jacobian[k, m] = total
    if not _inverted(jacobian, inverse):
        return UNDECIDED
    for k in range(n):
        row = space.preconditioned[k]
        for s in range(size):
            row[s] = 0.0
        rounding[k] = 0.0
        for j in range(n):
            factor = inverse[k, j]
            rounding[k] += abs(factor) * (error[j] + 4.0 * n * EPS * space.sizes[j])
            for s in range(size):
                row[s] += factor * tensor[j, s]
        if _least(row) > rounding[k] or _greatest(row) < -rounding[k]:
            return EMPTY
        value = 0.0
        for s in range(size):
            value += weights[0, s] * row[s]
        _deviation(row, degrees, space.strides, k, 1.0, rounding[k], deviation)
        centre[k] = 0.5 - value
        reach = 0.5 * _total(deviation) + rounding[k]
        if centre[k] + reach < 0.0 or centre[k] - reach > 1.0:
            return EMPTY
        near = near and _total(deviation) < 0.8
    return NEAR if near else UNDECIDED


@unfused_kernel
def _isolates(degrees, growth, space):  # type: ignore[no-untyped-def]
    """Check whether Krawczyk's operator maps the box with a margin into itself."""
    enlarged, strides, deviation = space.enlarged, space.strides, space.deviation
    rounding, centre = space.rounding, space.centre
    n, width, inside = degrees.shape[0], 1.0 + 2.0 * BOX_MARGIN, True
    for k in range(n):
        for s in range(enlarged.shape[0]):
            enlarged[s] = space.preconditioned[k, s]
        for m in range(n):
            _along(space.enlarging[m], degrees[m], strides[m], enlarged, space.scratch)
        _deviation(enlarged, degrees, strides, k, width, growth * rounding[k], deviation)
        total = _total(deviation)
        reach = 0.5 * width * total + rounding[k]
        inside = inside and total < 1.0
        inside = inside and centre[k] - reach > -BOX_MARGIN and centre[k] + reach < 1.0 + BOX_MARGIN
    return inside


@unfused_kernel
def _axis_of(degrees, subdivision, stack, here, space):  # type: ignore[no-untyped-def]
    """Axis of the largest change, along which a box is divided; -1 if it is not.

    Near a multiple solution, or along a set that extends to infinity, a box is narrow along one
    unknown, and the others would be divided without end.
    """
    tensor, low, high = stack.coefficients[here], stack.low[here], stack.high[here]
    axis, most_change = -1, -1.0
    n, size = degrees.shape[0], tensor.shape[1]
    for m in range(n):
        a, b = low[m], high[m]
        if b - a <= subdivision.tolerance * max(abs(a), abs(b), subdivision.floor[m]):
            return -1
        change = 0.0
        d, stride = degrees[m], space.strides[m]
        for k in range(n):
            steep = 0.0
            for first in range(0, size, stride * (d + 1)):
                for at in range(first, first + stride * d):
                    steep = max(steep, abs(tensor[k, at + stride] - tensor[k, at]))
            change += d * steep / space.sizes[k] if space.sizes[k] > 0.0 else 0.0
        if change > most_change:
            most_change, axis = change, m
    return axis


@unfused_kernel
def _divide(degrees, axis, stack, here, space):  # type: ignore[no-untyped-def]
    """Divide a box along an axis into one in its place, the upper part, and one after it."""
    low, high, tensors, errors = stack.low, stack.high, stack.coefficients, stack.rounding
    _copy_corners(stack, here)
    cut = low[here, axis] + CUT * (high[here, axis] - low[here, axis])
    for k in range(tensors.shape[1]):
        left = tensors[here + 1, k]
        _halves(tensors[here, k], degrees[axis], space.strides[axis], CUT, left)
        errors[here, k] += 2.0 * degrees[axis] * EPS * space.sizes[k]
        errors[here + 1, k] = errors[here, k]
    low[here, axis] = high[here + 1, axis] = cut


@unfused_kernel
def isolate(  # type: ignore[no-untyped-def]
    polynomials, subdivision, stack, isolated, space
):
    """Isolate all solutions of N polynomial equations in N unknowns inside boxes, or pause.

    Boxes in which one of the further functions is negative are left out.

    Parameters
    ----------
    polynomials : Polynomials
    subdivision : Subdivision
    stack : Boxes
        Memory for the waiting boxes: coefficients (B, N + K, S), their rounding errors
        (B, N + K), and the two corners (B, N).
    isolated : Isolated
        Filled in.
    space : IsolationSpace

    Returns
    -------
    int
        0, `PAUSED`, or `TABLE_FULL` if there is no space for another solution or cluster.
    """
    power, degrees = polynomials
    low, high, budget = subdivision.low, subdivision.high, subdivision.budget
    solutions, clusters, progress = isolated
    n = degrees.shape[0]
    growth = _prepared(degrees, space)
    tensors, errors, lows, highs = stack
    capacity = lows.shape[0]
    seed, waiting, found = progress[0], progress[1], progress[2]
    unclear, looked_at, left = progress[3], progress[4], progress[5]
    code = 0
    while waiting > 0 or seed < low.shape[0]:
        if waiting == 0:
            for m in range(n):
                lows[0, m], highs[0, m] = low[seed, m], high[seed, m]
            _converted(power, degrees, lows[0], highs[0], tensors[0], errors[0], space)
            seed, waiting = seed + 1, waiting + 1
        if left <= 0:
            code = PAUSED
            break
        if found == solutions.shape[0] or unclear == clusters.shape[0]:
            code = TABLE_FULL
            break
        left, looked_at = left - 1, looked_at + 1
        if looked_at > budget:
            break
        waiting -= 1
        here = waiting
        empty, spent = _examined(subdivision, stack, here, space.sizes)
        if empty:
            continue
        if _divided_by_ratio(polynomials, subdivision.logarithmic, stack, here, space):
            waiting += 2
            continue
        verdict = _preconditioned(degrees, stack, here, space)
        if verdict == EMPTY:
            continue
        if verdict == NEAR and _isolates(degrees, growth, space):
            for m in range(n):
                wide = highs[here, m] - lows[here, m]
                solutions[found, m] = lows[here, m] + space.centre[m] * wide
            found += 1
            continue
        # if one polynomial is rounding on the whole box, no decision is possible
        axis = -1 if spent else _axis_of(degrees, subdivision, stack, here, space)
        if axis < 0 or here + 2 >= capacity:
            for m in range(n):
                clusters[unclear, 0, m] = lows[here, m]
                clusters[unclear, 1, m] = highs[here, m]
            unclear += 1
            continue
        _divide(degrees, axis, stack, here, space)
        waiting += 2
    progress[0], progress[1], progress[2] = seed, waiting, found
    progress[3], progress[4], progress[5] = unclear, looked_at, left
    return code
