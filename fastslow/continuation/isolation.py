"""Compiled isolation of all real solutions of a square polynomial system in boxes.

Subdivision in the Bernstein basis (Sherbrooke & Patrikalakis 1993; Garloff & Smith 2001): a box
contains no solution if the coefficients of one polynomial, or of one preconditioned by the
inverse Jacobian at the centre, have one sign. It contains exactly one if the Krawczyk operator
(Krawczyk 1969; Neumaier 1990, theorem 5.1.8) maps a slightly larger box into itself. Rounding
errors are bounded along with the coefficients, so that no solution is lost.
"""

from __future__ import annotations

import numpy as np

from fastslow.continuation.spaces import PAUSED, TABLE_FULL
from fastslow.kernels.compiler.decorators import unfused_kernel

#: Enlargement of a box on either side for Krawczyk's test, in units of its width: a solution on
#: a common face is then inside both boxes.
MARGIN = 0.1

#: An interval of one sign with a larger ratio of its ends is divided at its geometric mean.
RATIO = 4.0

#: Cut of other intervals: not the midpoint, where solutions are common.
CUT = 0.4871

#: Rounding of one operation.
EPS = 2.220446049250313e-16


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
    low, high, logarithmic, floor, tolerance, budget, large, small, share = subdivision
    solutions, clusters, progress = isolated
    n = degrees.shape[0]
    rows, size = power.shape
    strides, table, weights, enlarging = space.strides, space.table, space.weights, space.enlarging
    stride, most = 1, 0
    for m in range(n - 1, -1, -1):
        strides[m] = stride
        stride *= degrees[m] + 1
        most = max(most, degrees[m])
    _binomials(most, table)
    # value and derivatives at the centre of the unit box, as sums over coefficients
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
    # blossoms from the unit interval to the one with a margin
    blossom, growth = space.blossom, 1.0
    for m in range(n):
        d = degrees[m]
        largest = 0.0
        for i in range(d + 1):
            # value of the blossom at i copies of 1 + margin and d − i copies of −margin
            for j in range(d + 1):
                blossom[j] = 0.0
            blossom[0] = 1.0
            for step in range(d):
                t = 1.0 + MARGIN if step < i else -MARGIN
                for j in range(step + 1, 0, -1):
                    blossom[j] = blossom[j] * (1.0 - t) + blossom[j - 1] * t
                blossom[0] *= 1.0 - t
            total = 0.0
            for j in range(d + 1):
                enlarging[m, i, j] = blossom[j]
                total += abs(blossom[j])
            largest = max(largest, total)
        growth *= largest

    tensors, errors, lows, highs = stack
    capacity = lows.shape[0]
    seed, waiting, found = progress[0], progress[1], progress[2]
    unclear, looked_at, left = progress[3], progress[4], progress[5]
    jacobian, inverse, preconditioned = space.jacobian, space.inverse, space.preconditioned
    enlarged, rounding, centre = space.enlarged, space.rounding, space.centre
    deviation, scratch, sizes = space.deviation, space.scratch, space.sizes
    code = 0
    while waiting > 0 or seed < low.shape[0]:
        if waiting == 0:
            for m in range(n):
                lows[0, m] = low[seed, m]
                highs[0, m] = high[seed, m]
            _converted(power, degrees, lows[0], highs[0], tensors[0], errors[0], space)
            seed += 1
            waiting += 1
        while waiting > 0:
            if left <= 0:
                code = PAUSED
                break
            if found == solutions.shape[0] or unclear == clusters.shape[0]:
                code = TABLE_FULL
                break
            left -= 1
            looked_at += 1
            if looked_at > budget:
                break
            waiting -= 1
            here = waiting
            tensor = tensors[here]
            empty = False
            spent = False
            for k in range(n):
                least = _least(tensor[k])
                largest = _greatest(tensor[k])
                sizes[k] = max(abs(least), abs(largest))
                if least > errors[here, k] or largest < -errors[here, k]:
                    empty = True
                    break
                spent = spent or sizes[k] <= 4.0 * errors[here, k]
            if empty:
                continue
            for k in range(n, rows):
                largest = _greatest(tensor[k])
                sizes[k] = max(abs(_least(tensor[k])), abs(largest))
                if largest < -errors[here, k]:
                    empty = True
                    break
            if empty:
                continue
            if large >= 0:
                least = min(abs(lows[here, large]), abs(highs[here, large]))
                for m in range(n):
                    if small[m] and lows[here, m] * highs[here, m] > 0.0:
                        size_here = min(abs(lows[here, m]), abs(highs[here, m]))
                        empty = empty or size_here * least > share * (1.0 + 1e-9)
            if empty:
                continue
            # the interval with the largest ratio of its ends is divided first
            axis = -1
            widest = RATIO
            for m in range(n):
                a = lows[here, m]
                b = highs[here, m]
                if logarithmic[m] and a * b > 0.0:
                    ratio = max(b / a, a / b)
                    if ratio > widest:
                        widest = ratio
                        axis = m
            if axis >= 0:
                a = lows[here, axis]
                b = highs[here, axis]
                middle = np.sqrt(a * b) if a > 0.0 else -np.sqrt(a * b)
                for m in range(n):
                    lows[here + 1, m] = lows[here, m]
                    highs[here + 1, m] = highs[here, m]
                highs[here, axis] = middle
                lows[here + 1, axis] = middle
                for part in range(here, here + 2):
                    _converted(
                        power, degrees, lows[part], highs[part], tensors[part], errors[part], space
                    )
                waiting += 2
                continue
            for k in range(n):
                for m in range(n):
                    total = 0.0
                    for s in range(size):
                        total += weights[m + 1, s] * tensor[k, s]
                    jacobian[k, m] = total
            if _inverted(jacobian, inverse):
                near = True
                for k in range(n):
                    row = preconditioned[k]
                    for s in range(size):
                        row[s] = 0.0
                    rounding[k] = 0.0
                    for j in range(n):
                        factor = inverse[k, j]
                        rounding[k] += abs(factor) * (errors[here, j] + 4.0 * n * EPS * sizes[j])
                        for s in range(size):
                            row[s] += factor * tensor[j, s]
                    if _least(row) > rounding[k] or _greatest(row) < -rounding[k]:
                        empty = True
                        break
                    value = 0.0
                    for s in range(size):
                        value += weights[0, s] * row[s]
                    _deviation(row, degrees, strides, k, 1.0, rounding[k], deviation)
                    centre[k] = 0.5 - value
                    reach = 0.5 * _total(deviation) + rounding[k]
                    if centre[k] + reach < 0.0 or centre[k] - reach > 1.0:
                        empty = True
                        break
                    near = near and _total(deviation) < 0.8
                if empty:
                    continue
                if near:
                    width = 1.0 + 2.0 * MARGIN
                    for k in range(n):
                        for s in range(size):
                            enlarged[s] = preconditioned[k, s]
                        for m in range(n):
                            _along(enlarging[m], degrees[m], strides[m], enlarged, scratch)
                        _deviation(
                            enlarged, degrees, strides, k, width, growth * rounding[k], deviation
                        )
                        total = _total(deviation)
                        reach = 0.5 * width * total + rounding[k]
                        near = (
                            near
                            and total < 1.0
                            and centre[k] - reach > -MARGIN
                            and centre[k] + reach < 1.0 + MARGIN
                        )
                    if near:
                        for m in range(n):
                            wide = highs[here, m] - lows[here, m]
                            solutions[found, m] = lows[here, m] + centre[m] * wide
                        found += 1
                        continue
            # divide along the axis of the largest change; if one polynomial is rounding on the
            # whole box, no decision is possible
            axis = -1
            most_change = -1.0
            for m in range(0 if spent else n):
                a = lows[here, m]
                b = highs[here, m]
                if b - a <= tolerance * max(abs(a), abs(b), floor[m]):
                    # near a multiple solution, or along a set that extends to infinity, the
                    # other unknowns would be divided without end
                    axis = -1
                    break
                change = 0.0
                d = degrees[m]
                block = strides[m] * (d + 1)
                for k in range(n):
                    steep = 0.0
                    for first in range(0, size, block):
                        for at in range(first, first + strides[m] * d):
                            steep = max(steep, abs(tensor[k, at + strides[m]] - tensor[k, at]))
                    change += d * steep / sizes[k] if sizes[k] > 0.0 else 0.0
                if change > most_change:
                    most_change = change
                    axis = m
            if axis < 0 or here + 2 >= capacity:
                for m in range(n):
                    clusters[unclear, 0, m] = lows[here, m]
                    clusters[unclear, 1, m] = highs[here, m]
                unclear += 1
                continue
            for m in range(n):
                lows[here + 1, m] = lows[here, m]
                highs[here + 1, m] = highs[here, m]
            cut = lows[here, axis] + CUT * (highs[here, axis] - lows[here, axis])
            for k in range(rows):
                _halves(tensors[here, k], degrees[axis], strides[axis], CUT, tensors[here + 1, k])
                errors[here, k] += 2.0 * degrees[axis] * EPS * sizes[k]
                errors[here + 1, k] = errors[here, k]
            lows[here, axis] = cut
            highs[here + 1, axis] = cut
            waiting += 2
        if code != 0 or looked_at > budget:
            break
    progress[0], progress[1], progress[2] = seed, waiting, found
    progress[3], progress[4], progress[5] = unclear, looked_at, left
    return code
