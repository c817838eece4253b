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
FAR_UNIT = 0.5

#: Maximum growth of the largest step where a state is far away.
STEP_GROWTH = 10.0

#: Maximum Newton displacement of a prediction, as a fraction of the step. A smooth curve that
#: turns by the angle a in one step deviates from its tangent by a/2; more is another curve.
LARGEST_DEFLECTION = 0.2

#: Maximum Newton displacement of the cubic midpoint between two points, as a fraction of the
#: step: beyond it the second point is on another curve, across a fold or a pole.
BETWEEN = 0.01

#: Maximum Newton displacement of that midpoint, as a fraction of its distance from the chord, and
#: in scaled units below which it does not count. Of a wave it is 0.05 at five points per wave;
#: steps longer than waves would pass folds.
SMOOTH, SMALLEST_WAVE = 0.05, 1e-7

#: Length in units of the smallest step, below which a change of the orientation is not bisected
#: further: a turn within a gap of a tenth of it is traced with steps above the smallest one.
SHORTEST_TURN = 100.0

#: Number of changes of a point by which the rounding of Newton's displacement is measured.
JITTERED = 4

#: Tolerance for a branch tangent to an edge of the window, in units of the state.
EDGE_SLACK = 1e-9


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
            away = FAR_UNIT * abs(point[j] - middle[j]) * math.sqrt(weight[j])
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
def _along_interfaces(signs, n, tangent, space, h, slope):  # type: ignore[no-untyped-def]
    """Fill in the signed switching functions in ``space.out`` and their slopes along a tangent."""
    out, m, size = space.out, signs.shape[0], n + 1
    heights = n * (n + 2)
    for k in range(m):
        h[k] = signs[k] * out[heights + k]
        slope[k] = 0.0
        for j in range(size):
            slope[k] += signs[k] * out[heights + m + k * size + j] * tangent[j]


@unfused_kernel
def _solved(curve, stepping, last, direction, step, unit, space):  # type: ignore[no-untyped-def]
    """Solve for ``space.guess`` at a distance along the tangent by Newton's method.

    Returns the number of iterations, 0 without convergence.
    """
    address, mode, parameters = curve
    guess, right, out, matrix, local = (
        space.guess, space.right, space.out, space.matrix, space.local,
    )  # fmt: skip
    size = guess.shape[0]
    n = size - 1
    for j in range(size):
        guess[j] = last[j] + step * unit * direction[j]
    for used in range(1, stepping.iterations + 1):
        call_address(address, mode, guess, parameters, out)
        along = 0.0
        for j in range(size):
            along += direction[j] * local[j] * (guess[j] - last[j])
        for i in range(n):
            right[i] = -out[i]
        right[n] = step / unit - along
        _bordered(out, n, direction, local, matrix)
        if solve(matrix, right) == 0:
            return 0
        for j in range(size):
            guess[j] += right[j]
        if _norm(right, local) <= stepping.tolerance:
            return used
    return 0


@unfused_kernel
def _turned(curve, direction, space):  # type: ignore[no-untyped-def]
    """Fill in ``space.turned``, the tangent at ``space.guess`` without its length.

    Returns the orientation, the sign of the determinant; 0 if F or the tangent is not finite.
    """
    address, mode, parameters = curve
    out, turned, matrix = space.out, space.turned, space.matrix
    n = turned.shape[0] - 1
    finite = True
    call_address(address, mode, space.guess, parameters, out)
    for i in range(n):
        turned[i] = 0.0
        finite = finite and math.isfinite(out[i])
    turned[n] = 1.0
    _bordered(out, n, direction, space.local, matrix)
    orientation = solve(matrix, turned)
    return orientation if finite else 0


@unfused_kernel
def _on_one_curve(curve, last, direction, step, units, space):  # type: ignore[no-untyped-def]
    """Check whether ``space.guess`` is on the curve of the last row, which has no waves between.

    If Newton's method has converged to another curve, the midpoint of a cubic is on neither; if
    the curve has waves shorter than the step, its distance from the curve is not small compared
    with its distance from the chord. ``units`` are the inverse lengths of the tangents at both.
    """
    unit, new_unit = units
    guess, turned, middle_point = space.guess, space.turned, space.middle_point
    size = guess.shape[0]
    square = 0.0
    for j in range(size):
        bend = 0.125 * step * (direction[j] * unit - turned[j] * new_unit)
        square += bend * bend * space.local[j]
        middle_point[j] = 0.5 * (last[j] + guess[j]) + bend
    if _displaced(curve, size - 1, direction, space.local, middle_point, space) == 0:
        return True
    away = _norm(space.right, space.local)
    return away <= BETWEEN * step and away <= max(SMALLEST_WAVE, SMOOTH * math.sqrt(square))


@unfused_kernel
def _set_ends(last, direction, units, space):  # type: ignore[no-untyped-def]
    """Fill in points and unit tangents of the last row and of ``space.guess``."""
    unit, new_unit = units
    ends = space.ends
    for j in range(last.shape[0]):
        ends[0, j] = last[j]
        ends[1, j] = direction[j] * unit
        ends[2, j] = space.guess[j]
        ends[3, j] = space.turned[j] * new_unit


@unfused_kernel
def _leaves_between(region, smallest, last, direction, step, units, space):  # type: ignore[no-untyped-def]
    """Check whether the curve leaves the region or the window and returns within a step.

    Fills in ``space.new_h`` and ``space.new_slope``.
    """
    unit, new_unit = units
    low, high, signs = region.low, region.high, region.signs
    guess, turned, local = space.guess, space.turned, space.local
    h, slope, new_h, new_slope = space.h, space.slope, space.new_h, space.new_slope
    n, leaves = guess.shape[0] - 1, False
    _along_interfaces(signs, n, turned, space, new_h, new_slope)
    if not step > 4.0 * smallest:
        return False
    for k in range(signs.shape[0]):
        before, after = slope[k] * step * unit, new_slope[k] * step * new_unit
        if new_h[k] > 0.0 and _dips(max(h[k], 0.0), before, new_h[k], after):
            leaves = True
    for i in range(n):
        before, after = step * unit * direction[i], step * new_unit * turned[i]
        if not (before < 0.0 < after or after < 0.0 < before):
            # no extremum, and so no dip
            continue
        slack = EDGE_SLACK / math.sqrt(local[i])
        above, new_above = max(last[i] - low[i], 0.0) + slack, guess[i] - low[i] + slack
        below, new_below = max(high[i] - last[i], 0.0) + slack, high[i] - guess[i] + slack
        if guess[i] > low[i] and _dips(above, before, new_above, after):
            leaves = True
        if guess[i] < high[i] and _dips(below, -before, new_below, -after):
            leaves = True
    return leaves


@unfused_kernel
def _next_point(  # type: ignore[no-untyped-def]
    curve, region, stepping, last, direction, step, orientation, space
):
    """Take one step: fill in ``space.guess``, its unit tangent ``space.turned``, and h there.

    Returns
    -------
    used : int
        Newton iterations, 0 if the step is rejected.
    cosine : float
        Of the angle between the tangents.
    orientation : int
        Sign of the determinant at the point.
    """
    guess, turned, right, local = space.guess, space.turned, space.right, space.local
    size, smallest, turn = guess.shape[0], stepping.smallest, stepping.turn
    unit = 1.0 / _norm(direction, local)
    used = _solved(curve, stepping, last, direction, step, unit, space)
    if used == 0:
        return 0, 1.0, 0
    new_orientation = _turned(curve, direction, space)
    if new_orientation == 0:
        return 0, 1.0, 0
    length = _norm(turned, region.weight)
    cosine = 0.0
    for j in range(size):
        turned[j] /= length
        cosine += turned[j] * local[j] * direction[j]
    new_unit = 1.0 / _norm(turned, local)
    cosine *= unit * new_unit
    for j in range(size):
        right[j] = guess[j] - last[j] - step * unit * direction[j]
    aside = _norm(right, local)
    if not (cosine > math.cos(turn) and aside <= max(LARGEST_DEFLECTION, turn) * step):
        return 0, cosine, new_orientation
    units = (unit, new_unit)
    if step > 4.0 * smallest:
        if not _on_one_curve(curve, last, direction, step, units, space):
            return 0, cosine, new_orientation
        if new_orientation == -orientation:
            _set_ends(last, direction, units, space)
            if not _continues(curve, step, SHORTEST_TURN * smallest, orientation, local, space):
                return 0, cosine, new_orientation
    if _leaves_between(region, smallest, last, direction, step, units, space):
        return 0, cosine, new_orientation
    return used, cosine, new_orientation


@unfused_kernel
def _outside(region, space):  # type: ignore[no-untyped-def]
    """Return the kind of end if ``space.guess`` is outside the region, range or window, or -1."""
    low, high, signs = region.low, region.high, region.signs
    guess, new_h = space.guess, space.new_h
    n = guess.shape[0] - 1
    for k in range(signs.shape[0]):
        if signs[k] != 0.0 and new_h[k] < 0.0:
            return INTERFACE
    if guess[n] < region.lower or guess[n] > region.upper:
        return RANGE
    for i in range(n):
        if guess[i] < low[i] or guess[i] > high[i]:
            slack = EDGE_SLACK / math.sqrt(space.local[i])
            if guess[i] < low[i] - slack or guess[i] > high[i] + slack:
                return WINDOW
    return -1


@unfused_kernel
def _gap(start, last, periods, j):  # type: ignore[no-untyped-def]
    """Component of the way back to the start, for a periodic state the shortest."""
    gap = start[j] - last[j]
    if j < periods.shape[0] and periods[j] > 0.0:
        gap -= periods[j] * np.round(gap / periods[j])
    return gap


@unfused_kernel
def _closes(region, start, tangent, last, direction, step, space):  # type: ignore[no-untyped-def]
    """Check whether a step passes the start of the curve in its direction."""
    local, periods = space.local, region.periods
    size = start.shape[0]
    unit = 1.0 / _norm(direction, local)
    ahead = same = 0.0
    for j in range(size):
        ahead += _gap(start, last, periods, j) * local[j] * direction[j] * unit
        same += tangent[j] * region.weight[j] * space.turned[j]
    if not (0.0 < ahead <= step and same > 0.9):
        return False
    apart = 0.0
    for j in range(size):
        off = _gap(start, last, periods, j) - ahead * direction[j] * unit
        apart += off * off * local[j]
    return math.sqrt(apart) < 0.2 * step


@unfused_kernel
def trace(curve, region, stepping, traced, space):  # type: ignore[no-untyped-def]
    """Trace one curve inside one region to its end, or to a pause.

    Parameters
    ----------
    curve : CompiledCurve
    region : CurveDomain
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
    rows, tangents, in_use, progress = traced
    right, matrix, h, slope = space.right, space.matrix, space.h, space.slope
    size = rows.shape[1]
    n, wide, step = size - 1, math.cos(0.5 * stepping.turn), in_use[0]
    count = progress[0]
    call_address(address, mode, rows[count - 1], parameters, space.out)
    _along_interfaces(region.signs, n, tangents[count - 1], space, h, slope)
    for i in range(n):
        right[i] = 0.0
    right[n] = 1.0
    _bordered(space.out, n, tangents[count - 1], region.weight, matrix)
    orientation = solve(matrix, right)
    while count < rows.shape[0]:
        progress[0] = count
        in_use[0] = step
        if progress[1] <= 0:
            return PAUSED
        progress[1] -= 1
        if step < stepping.smallest:
            return SMALL_STEP
        last, direction = rows[count - 1], tangents[count - 1]
        farthest = _local_weight(last, region.weight, region.middle, space.local)
        used, cosine, side = _next_point(
            curve, region, stepping, last, direction, step, orientation, space
        )
        if used == 0:
            step *= 0.5
            continue
        orientation = side
        for j in range(size):
            rows[count, j] = space.guess[j]
            tangents[count, j] = space.turned[j]
        count += 1
        progress[0] = count
        end = _outside(region, space)
        if end >= 0:
            return end
        for k in range(h.shape[0]):
            h[k], slope[k] = space.new_h[k], space.new_slope[k]
        closing = stepping.closing and count > 4
        if closing and _closes(region, rows[0], tangents[0], last, direction, step, space):
            return CLOSED
        if used <= 3 and cosine > wide:
            step = min(1.5 * step, stepping.largest * min(farthest, STEP_GROWTH))
        elif used >= 6:
            step *= 0.7
    in_use[0] = step
    return FULL
