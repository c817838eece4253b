"""Compiled pseudo-arclength continuation of a curve F(u) = 0 inside one region.

Keller (1977). A curve is given by the address of a function that fills in F, its
Jacobian, and the switching functions h with their gradients.
"""

from __future__ import annotations

import math

import numpy as np

from fastslow.continuation.location import JITTER, ROUNDINGS
from fastslow.continuation.spaces import (
    CLOSED,
    FULL,
    INTERFACE,
    PAUSED,
    RANGE,
    SMALL_STEP,
    WINDOW,
)
from fastslow.kernels.compiler.decorators import unfused_kernel
from fastslow.kernels.compiler.pointers import call_address

#: A state is scaled by this fraction of its distance from the centre of the starting equilibria,
#: once that exceeds its unit: a branch to infinity has rows equally spaced in log(x).
FAR = 0.5

#: Maximum growth of the largest step where a state is far away.
GROWTH = 10.0

#: Maximum Newton displacement of a prediction, as a fraction of the step. A smooth curve that
#: turns by the angle a in one step deviates from its tangent by a/2; more is another curve.
ASIDE = 0.2

#: Maximum Newton displacement of the cubic midpoint between two points, as a fraction of the
#: step: beyond it the second point is on another curve, across a fold or a pole.
BETWEEN = 0.01

#: Length in units of the smallest step, below which a change of the orientation is not bisected
#: further: a turn within a gap of a tenth of it is traced with steps above the smallest one.
SHORTEST = 100.0

#: Number of changes of a point by which the rounding of Newton's displacement is measured.
JITTERED = 4

#: Tolerance for a branch tangent to an edge of the window, in units of the state.
TANGENT = 1e-9


@unfused_kernel
def solve(matrix, right):  # type: ignore[no-untyped-def]
    """Solve a small dense system in place by elimination with row pivoting.

    Returns the sign of the determinant; 0, with the arrays overwritten, if a pivot is zero or not
    finite.
    """
    size = right.shape[0]
    sign = 1
    for k in range(size):
        best = k
        for i in range(k + 1, size):
            if abs(matrix[i, k]) > abs(matrix[best, k]):
                best = i
        pivot = matrix[best, k]
        if pivot == 0.0 or not math.isfinite(pivot):
            return 0
        if pivot < 0.0:
            sign = -sign
        if best != k:
            sign = -sign
            for j in range(k, size):
                matrix[k, j], matrix[best, j] = matrix[best, j], matrix[k, j]
            right[k], right[best] = right[best], right[k]
        for i in range(k + 1, size):
            factor = matrix[i, k] / pivot
            if factor != 0.0:
                for j in range(k + 1, size):
                    matrix[i, j] -= factor * matrix[k, j]
                right[i] -= factor * right[k]
    for k in range(size - 1, -1, -1):
        total = right[k]
        for j in range(k + 1, size):
            total -= matrix[k, j] * right[j]
        right[k] = total / matrix[k, k]
        if not math.isfinite(right[k]):
            return 0
    return sign


@unfused_kernel
def _bordered(out, n, border, weight, matrix):  # type: ignore[no-untyped-def]
    for i in range(n):
        for j in range(n + 1):
            matrix[i, j] = out[n + i * (n + 1) + j]
    for j in range(n + 1):
        matrix[n, j] = border[j] * weight[j]


@unfused_kernel
def _norm(vector, weight):  # type: ignore[no-untyped-def]
    total = 0.0
    for j in range(vector.shape[0]):
        total += vector[j] * vector[j] * weight[j]
    return math.sqrt(total)


@unfused_kernel
def _dips(h0, s0, h1, s1):  # type: ignore[no-untyped-def]
    """Check whether the cubic through two positive values with given slopes becomes negative."""
    if not (s0 < 0.0 < s1):
        return False
    a = 2.0 * (h0 - h1) + s0 + s1
    b = 3.0 * (h1 - h0) - 2.0 * s0 - s1
    inside = b * b - 3.0 * a * s0
    if inside < 0.0:
        return False
    q = b + math.copysign(math.sqrt(inside), b)
    for root in (-q / (3.0 * a) if a != 0.0 else -1.0, -s0 / q if q != 0.0 else -1.0):
        if 0.0 < root < 1.0 and ((a * root + b) * root + s0) * root + h0 < 0.0:
            return True
    return False


@unfused_kernel
def _local_weight(point, weight, middle, local):  # type: ignore[no-untyped-def]
    """Fill in the weights at a point; return the distance of the farthest state in its unit."""
    farthest = 1.0
    for j in range(point.shape[0]):
        local[j] = weight[j]
        if j < middle.shape[0]:
            away = FAR * abs(point[j] - middle[j]) * math.sqrt(weight[j])
            # a periodic state has no centre (NaN) and is never far away
            if away > 1.0:
                local[j] = weight[j] / (away * away)
                farthest = max(farthest, away)
    return farthest


@unfused_kernel
def _between(share, length, ends, point):  # type: ignore[no-untyped-def]
    """Fill in the point of a cubic at a fraction of its length: ends and tangents as rows."""
    rest = 1.0 - share
    for j in range(point.shape[0]):
        chord = rest * rest * (1.0 + 2.0 * share) * ends[0, j]
        chord += share * share * (3.0 - 2.0 * share) * ends[2, j]
        slope = rest * ends[1, j] - share * ends[3, j]
        point[j] = chord + share * rest * length * slope


@unfused_kernel
def _displaced(curve, n, border, local, point, space):  # type: ignore[no-untyped-def]
    """Fill in Newton's displacement of a point, normal to a direction; return the sign of `solve`.

    The displacement is in ``space.right``.
    """
    address, mode, parameters = curve
    call_address(address, mode, point, parameters, space.beside)
    for i in range(n):
        space.right[i] = -space.beside[i]
    space.right[n] = 0.0
    _bordered(space.beside, n, border, local, space.matrix)
    return solve(space.matrix, space.right)


@unfused_kernel
def _rounding(curve, n, border, local, space):  # type: ignore[no-untyped-def]
    """Return the largest change of Newton's displacement as the point changes by rounding.

    ``space.right``, which contains the displacement, is overwritten.
    """
    point, kept, moved, right = space.middle_point, space.kept, space.moved, space.right
    size = n + 1
    for j in range(size):
        kept[j] = right[j]
    largest = 0.0
    for k in range(JITTERED):
        for j in range(size):
            # all four signs of even and odd unknowns
            side = 1.0 if ((k + 1) >> (j % 2)) & 1 else -1.0
            moved[j] = point[j] * (1.0 + (1 + k // 2) * side * JITTER)
        if _displaced(curve, n, border, local, moved, space) == 0:
            return math.inf
        for j in range(size):
            right[j] -= kept[j]
        largest = max(largest, _norm(right, local))
    return largest


@unfused_kernel
def _continues(curve, length, shortest, sign, local, space):  # type: ignore[no-untyped-def]
    """Check that two points between which the orientation changes are on one curve.

    The determinant of the Jacobian with the tangent as its last row changes sign along a curve at
    branch points alone. Elsewhere Newton's method has converged to another curve, across the gap
    between their folds: by bisection the gap is compared with ever shorter steps, until rounding
    of the equations, or the shortest length, leaves both undistinguished.
    """
    address, mode, parameters = curve
    ends, point, right = space.ends, space.middle_point, space.right
    out, matrix = space.beside, space.matrix
    size = point.shape[0]
    n = size - 1
    while length > shortest:
        share = 0.5
        for attempt in range(2):
            _between(share, length, ends, point)
            solved = _displaced(curve, n, ends[1], local, point, space)
            away = _norm(right, local)
            if solved != 0 and away <= BETWEEN * length:
                break
            if attempt == 1:
                if solved == 0:
                    return False
                rounding = _rounding(curve, n, ends[1], local, space)
                return away <= ROUNDINGS * rounding
            # the first one may be at the branch point, where the matrix is singular
            share = 0.3
        for j in range(size):
            point[j] += right[j]
            right[j] = 0.0
        right[n] = 1.0
        call_address(address, mode, point, parameters, out)
        _bordered(out, n, ends[1], local, matrix)
        side = solve(matrix, right)
        if side == 0:
            return True
        unit = _norm(right, local)
        first = 0 if side == sign else 2
        for j in range(size):
            ends[first, j] = point[j]
            ends[first + 1, j] = right[j] / unit
        length *= 1.0 - share if side == sign else share
    return True


@unfused_kernel
def trace(curve, region, stepping, traced, space):  # type: ignore[no-untyped-def]
    """Trace one curve inside one region to its end, or to a pause.

    Parameters
    ----------
    curve : CompiledCurve
    region : Region
    stepping : Stepping
    traced : Traced
        Updated in place.
    space : TraceSpace

    Returns
    -------
    int
        The kind of end, or PAUSED. With RANGE, INTERFACE and WINDOW the last row is beyond
        the end.
    """
    address, mode, parameters = curve
    signs, weight, lower, upper, low, high, middle, periods = region
    smallest, largest, turn, tolerance, iterations, closing = stepping
    rows, tangents, in_use, progress = traced
    out, beside, matrix, right, guess, turned, middle_point = space[:7]
    h, slope, new_h, new_slope, local, ends = space[7:13]
    size = rows.shape[1]
    start = rows[0]
    tangent = tangents[0]
    step = in_use[0]
    n = size - 1
    m = signs.shape[0]
    heights = n * (n + 2)
    widest, wide = math.cos(turn), math.cos(0.5 * turn)

    count = progress[0]
    call_address(address, mode, rows[count - 1], parameters, out)
    for k in range(m):
        h[k] = signs[k] * out[heights + k]
        slope[k] = 0.0
        for j in range(size):
            slope[k] += signs[k] * out[heights + m + k * size + j] * tangents[count - 1, j]
    for i in range(n):
        right[i] = 0.0
    right[n] = 1.0
    _bordered(out, n, tangents[count - 1], weight, matrix)
    orientation = solve(matrix, right)
    new_orientation = 0
    while count < rows.shape[0]:
        progress[0] = count
        in_use[0] = step
        if progress[1] <= 0:
            return PAUSED
        progress[1] -= 1
        last = rows[count - 1]
        direction = tangents[count - 1]
        accepted = False
        used = 0
        cosine = 1.0
        if step < smallest:
            return SMALL_STEP
        farthest = _local_weight(last, weight, middle, local)
        unit = 1.0 / _norm(direction, local)
        for j in range(size):
            guess[j] = last[j] + step * unit * direction[j]
        for used in range(1, iterations + 1):  # noqa: B007  the step size depends on it
            call_address(address, mode, guess, parameters, out)
            along = 0.0
            for j in range(size):
                along += direction[j] * local[j] * (guess[j] - last[j])
            for i in range(n):
                right[i] = -out[i]
            right[n] = step / unit - along
            _bordered(out, n, direction, local, matrix)
            if solve(matrix, right) == 0:
                break
            for j in range(size):
                guess[j] += right[j]
            if _norm(right, local) <= tolerance:
                accepted = True
                break
        if accepted:
            call_address(address, mode, guess, parameters, out)
            for i in range(n):
                turned[i] = 0.0
                accepted = accepted and math.isfinite(out[i])
            turned[n] = 1.0
            _bordered(out, n, direction, local, matrix)
            new_orientation = solve(matrix, turned)
            accepted = accepted and new_orientation != 0
        new_unit = 1.0
        if accepted:
            length = _norm(turned, weight)
            cosine = 0.0
            for j in range(size):
                turned[j] /= length
                cosine += turned[j] * local[j] * direction[j]
            new_unit = 1.0 / _norm(turned, local)
            cosine *= unit * new_unit
            for j in range(size):
                right[j] = guess[j] - last[j] - step * unit * direction[j]
            aside = _norm(right, local)
            accepted = cosine > widest and aside <= max(ASIDE, turn) * step
        if accepted and step > 4.0 * smallest:
            # if Newton's method has converged to another curve, the midpoint is on neither
            for j in range(size):
                bend = direction[j] * unit - turned[j] * new_unit
                middle_point[j] = 0.5 * (last[j] + guess[j]) + 0.125 * step * bend
            call_address(address, mode, middle_point, parameters, beside)
            for i in range(n):
                right[i] = -beside[i]
            right[n] = 0.0
            _bordered(beside, n, direction, local, matrix)
            if solve(matrix, right) != 0:
                accepted = _norm(right, local) <= BETWEEN * step
            if accepted and new_orientation == -orientation:
                for j in range(size):
                    ends[0, j] = last[j]
                    ends[1, j] = direction[j] * unit
                    ends[2, j] = guess[j]
                    ends[3, j] = turned[j] * new_unit
                accepted = _continues(curve, step, SHORTEST * smallest, orientation, local, space)
        if accepted:
            for k in range(m):
                new_h[k] = signs[k] * out[heights + k]
                new_slope[k] = 0.0
                for j in range(size):
                    new_slope[k] += signs[k] * out[heights + m + k * size + j] * turned[j]
                before = slope[k] * step * unit
                after = new_slope[k] * step * new_unit
                if (
                    new_h[k] > 0.0
                    and step > 4.0 * smallest
                    and _dips(max(h[k], 0.0), before, new_h[k], after)
                ):
                    accepted = False
            if step > 4.0 * smallest:
                for i in range(n):
                    before = step * unit * direction[i]
                    after = step * new_unit * turned[i]
                    if not (before < 0.0 < after or after < 0.0 < before):
                        # no extremum, and so no dip
                        continue
                    slack = TANGENT / math.sqrt(local[i])
                    if guess[i] > low[i] and _dips(
                        max(last[i] - low[i], 0.0) + slack,
                        before,
                        guess[i] - low[i] + slack,
                        after,
                    ):
                        accepted = False
                    if guess[i] < high[i] and _dips(
                        max(high[i] - last[i], 0.0) + slack,
                        -before,
                        high[i] - guess[i] + slack,
                        -after,
                    ):
                        accepted = False
        if not accepted:
            step *= 0.5
            continue
        for j in range(size):
            rows[count, j] = guess[j]
            tangents[count, j] = turned[j]
        count += 1
        orientation = new_orientation
        progress[0] = count
        for k in range(m):
            if signs[k] != 0.0 and new_h[k] < 0.0:
                return INTERFACE
            h[k] = new_h[k]
            slope[k] = new_slope[k]
        if guess[n] < lower or guess[n] > upper:
            return RANGE
        for i in range(n):
            if guess[i] < low[i] or guess[i] > high[i]:
                slack = TANGENT / math.sqrt(local[i])
                if guess[i] < low[i] - slack or guess[i] > high[i] + slack:
                    return WINDOW
        if closing and count > 4:
            ahead = 0.0
            same = 0.0
            for j in range(size):
                gap = start[j] - last[j]
                if j < n and periods[j] > 0.0:
                    gap -= periods[j] * np.round(gap / periods[j])
                ahead += gap * local[j] * direction[j] * unit
                same += tangent[j] * weight[j] * turned[j]
            if 0.0 < ahead <= step and same > 0.9:
                apart = 0.0
                for j in range(size):
                    gap = start[j] - last[j]
                    if j < n and periods[j] > 0.0:
                        gap -= periods[j] * np.round(gap / periods[j])
                    off = gap - ahead * direction[j] * unit
                    apart += off * off * local[j]
                if math.sqrt(apart) < 0.2 * step:
                    return CLOSED
        if used <= 3 and cosine > wide:
            step = min(1.5 * step, largest * min(farthest, GROWTH))
        elif used >= 6:
            step *= 0.7
    in_use[0] = step
    return FULL
