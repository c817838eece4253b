"""Compiled evaluation along curves: rates, test functions at rows, Newton's method."""

from __future__ import annotations

import math

import numpy as np

from fastslow.continuation.engine import solve
from fastslow.continuation.location import FLUSH_THRESHOLD, RESIDUAL_ROUNDING
from fastslow.continuation.spaces import Condition
from fastslow.kernels.compiler.decorators import unfused_kernel
from fastslow.kernels.compiler.pointers import call_address

#: Rounding of one operation.
EPS = 2.220446049250313e-16


@unfused_kernel
def evaluate(address, modes, points, parameters, out):  # type: ignore[no-untyped-def]
    """Evaluate the generated function at every row of ``points`` into ``out``, shape (N, width)."""
    for k in range(points.shape[0]):
        call_address(address, modes[k], points[k], parameters, out[k])


@unfused_kernel
def value_at(address, mode, point, parameters, out):  # type: ignore[no-untyped-def]
    """Evaluate the generated function at one point into ``out``, shape (width,)."""
    call_address(address, mode, point, parameters, out)


@unfused_kernel
def newton_from(  # type: ignore[no-untyped-def]
    curve, states, damped, converged, value, unit, iterations, space
):
    """Newton's method at a fixed last component from many starts.

    A step longer than ten times the size of the state, in its units, is shortened to it.

    Parameters
    ----------
    states : ndarray, shape (m, n)
        Initial guesses, replaced by the results.
    damped : ndarray of bool, shape (m,)
        Whether steps are shortened until the next correction is smaller; then positive states
        remain positive.
    converged : ndarray of bool, shape (m,)
        Filled in.
    """
    address, mode, parameters = curve
    count, n = states.shape
    out, u = space.out, space.u
    matrix, right, slopes = space.matrix, space.right[:n], space.slopes
    for k in range(count):
        for i in range(n):
            u[i] = states[k, i]
        u[n] = value
        converged[k] = False
        positive = damped[k]
        for i in range(n):
            positive = positive and u[i] > 0.0
        last = 1.0
        for _ in range(iterations):
            call_address(address, mode, u, parameters, out)
            for i in range(n):
                right[i] = -out[i]
                for j in range(n):
                    matrix[i, j] = slopes[i, j] = out[n + i * (n + 1) + j]
            if solve(matrix, right) == 0:
                break
            length = 0.0
            size = 1.0
            for i in range(n):
                length = max(length, abs(right[i]) / unit[i])
                size = max(size, abs(u[i]) / unit[i])
            shrink = min(1.0, 10.0 * size / length) if length > 0.0 else 1.0
            if damped[k]:
                if positive:
                    for i in range(n):
                        if u[i] + shrink * right[i] <= 0.0:
                            shrink = -0.9 * u[i] / right[i]
                if length > 1e-7 * size:
                    shrink = monotone(curve, min(shrink, 4.0 * last), unit, space)
                    if shrink == 0.0:
                        break
                last = shrink
            for i in range(n):
                u[i] += shrink * right[i]
            if length <= 1e-7 * size:
                converged[k] = True
                break
        for i in range(n):
            states[k, i] = u[i]


@unfused_kernel
def monotone(curve, shrink, unit, space):  # type: ignore[no-untyped-def]
    """Return the fraction of a Newton step for which the next correction is smaller, 0 for none.

    The natural monotonicity test, which is independent of the units of the rates (Deuflhard 2004,
    section 3.3): the correction with the same Jacobian is compared with the step, relative to the
    states. Fractions at which the rates are not finite are rejected.

    Parameters
    ----------
    shrink : float
        Largest fraction; halved until the test is passed.
    """
    address, mode, parameters = curve
    n = unit.shape[0]
    u, step, trial = space.u, space.right, space.terms
    out, matrix, next_step = space.out, space.matrix, space.value[:n]
    length = 0.0
    for i in range(n):
        length = max(length, abs(step[i]) / max(abs(u[i]), 1e-6 * unit[i]))
    trial[n] = u[n]
    for _ in range(20):
        for i in range(n):
            trial[i] = u[i] + shrink * step[i]
        call_address(address, mode, trial, parameters, out)
        for i in range(n):
            next_step[i] = -out[i]
            for j in range(n):
                matrix[i, j] = space.slopes[i, j]
        if solve(matrix, next_step) == 0:
            return 0.0
        after = 0.0
        for i in range(n):
            size = abs(next_step[i]) / max(abs(u[i]), 1e-6 * unit[i])
            if not size <= after:
                after = size
                if after != after:
                    break
        if after <= (1.0 - 0.25 * shrink) * length:
            return shrink
        shrink *= 0.5
    return 0.0


@unfused_kernel
def refine(curve, u, scale, condition, iterations, space):  # type: ignore[no-untyped-def]
    """Newton's method for F = 0 with one more equation along the curve.

    Parameters
    ----------
    u : ndarray, shape (n + 1,)
        Initial guess, replaced by the solution.
    condition : Condition

    Returns
    -------
    residual, size : float
        Residual of the equations, and size of the last correction in units of the scale.
    converged : bool
    """
    address, mode, parameters = curve
    row, normal, point, m = condition
    out, slopes, matrix = space.out, space.slopes, space.matrix
    value, right, flushed, terms = space.value, space.right, space.u, space.terms
    columns = u.shape[0]
    n = columns - 1
    size = np.inf
    least = np.inf
    heights = n * (n + 2)
    for turn in range(iterations + 1):
        call_address(address, mode, u, parameters, out)
        for i in range(n):
            value[i] = out[i]
            for j in range(columns):
                slopes[i, j] = out[n + i * columns + j]
        if row >= 0:
            value[n] = out[heights + row]
            for j in range(columns):
                slopes[n, j] = out[heights + m + row * columns + j]
        else:
            value[n] = 0.0
            for j in range(columns):
                value[n] += normal[j] * (u[j] - point[j])
                slopes[n, j] = normal[j]
        if turn > 0 and (size < 1e-16 or (size < 1e-10 and size >= 0.5 * least)):
            break
        if turn > 0:
            least = size
        if turn == iterations:
            break
        for i in range(columns):
            largest = 0.0
            for j in range(columns):
                matrix[i, j] = slopes[i, j] * scale[j]
                largest = max(largest, abs(matrix[i, j]))
            if not (math.isfinite(largest) and math.isfinite(value[i])):
                return np.inf, np.inf, False
            largest = largest if largest > 0.0 else 1.0
            for j in range(columns):
                matrix[i, j] /= largest
            right[i] = -value[i] / largest
        if solve(matrix, right) == 0:
            return np.inf, np.inf, False
        size = 0.0
        for j in range(columns):
            u[j] += right[j] * scale[j]
            size = max(size, abs(right[j]))
    # as in `flush_to_zero` and `grown`
    for j in range(columns):
        flushed[j] = 0.0 if abs(u[j]) < FLUSH_THRESHOLD * scale[j] else u[j]
    call_address(address, mode, flushed, parameters, out)
    for i in range(n):
        right[i] = out[i]
    if row >= 0:
        right[n] = out[heights + row]
    else:
        right[n] = 0.0
        for j in range(columns):
            right[n] += normal[j] * (flushed[j] - point[j])
    grown = False
    for i in range(columns):
        terms[i] = 0.0
        for j in range(columns):
            terms[i] += abs(slopes[i, j]) * abs(u[j])
        grown = grown or not abs(right[i]) <= abs(value[i]) + RESIDUAL_ROUNDING * terms[i]
    if not grown:
        for j in range(columns):
            u[j], value[j] = flushed[j], right[j]
    residual = 0.0
    balanced = True
    for i in range(columns):
        total = 0.0
        for j in range(columns):
            total += abs(slopes[i, j]) * max(abs(u[j]), scale[j])
        residual = max(residual, abs(value[i]))
        balanced = balanced and abs(value[i]) <= 1e-9 * total + 1e-300
    return residual, size, size < 1e-8 and balanced


@unfused_kernel
def correct(  # type: ignore[no-untyped-def]
    curve, points, scales, natural, limits, iterations, plain, space
):
    """Newton's method at a fixed last component, with strict tests of the solutions.

    Parameters
    ----------
    points : ndarray, shape (N, n + 1)
        Initial guesses, replaced by the results.
    scales : ndarray, shape (N, n + 1)
    natural : ndarray, shape (N, n)
        Natural size of each equation.
    limits : Limits
    plain : ndarray of bool, shape (N,)
        Filled in: whether a solution passed all tests; the others are undecided.
    """
    address, mode, parameters = curve
    out, start, normal = space.out, space.beside, space.constant
    count, columns = points.shape
    n = columns - 1
    for j in range(columns):
        normal[j] = 1.0 if j == n else 0.0
    condition = Condition(-1, normal, start, 0)
    for k in range(count):
        u, scale = points[k], scales[k]
        for j in range(columns):
            start[j] = u[j]
        residual, size, good = refine(curve, u, scale, condition, iterations, space)
        good = good and math.isfinite(residual) and size < limits.correction
        call_address(address, mode, u, parameters, out)
        for i in range(n):
            terms = 0.0
            for j in range(n):
                terms += abs(out[n + i * columns + j]) * abs(u[j])
            good = good and abs(out[i]) <= limits.residual * natural[k, i]
            good = good and EPS * terms <= limits.pole * natural[k, i]
            good = good and abs(u[i] - start[i]) < limits.moved * scale[i]
            good = good and abs(u[i]) <= limits.farthest * scale[i]
        plain[k] = good and abs(u[n] - start[n]) <= limits.beside * scale[n]


@unfused_kernel
def survey(  # type: ignore[no-untyped-def]
    curve, points, tangents, scale, reach, vertical, tests, space
):
    """Evaluate the test functions at every row of a traced segment.

    Parameters
    ----------
    reach : float
        Distance ahead and behind, in units of the scale, of the rows that give the units.
    vertical : float
        Last component of a tangent that counts as zero.
    tests : RowTests
        Filled in.
    """
    address, mode, parameters = curve
    branching, turning, jacobians = tests
    out, matrix, largest, beside = space.out, space.matrix, space.largest, space.beside
    count, columns = points.shape
    n = columns - 1
    for k in range(count):
        for i in range(columns):
            largest[i] = 0.0
        length = 0.0
        for j in range(columns):
            length = max(length, abs(tangents[k, j] / scale[j]))
        length = length if length > 0.0 else 1.0
        for side in (-1.0, 1.0):
            for j in range(columns):
                beside[j] = points[k, j] + side * reach / length * tangents[k, j]
            call_address(address, mode, beside, parameters, out)
            for i in range(n):
                for j in range(columns):
                    entry = abs(out[n + i * columns + j] * scale[j])
                    # beside the edge of a domain it may be infinite
                    if math.isfinite(entry):
                        largest[i] = max(largest[i], entry)
        call_address(address, mode, points[k], parameters, out)
        for i in range(n):
            for j in range(n):
                jacobians[k, i, j] = out[n + i * columns + j]
        for i in range(columns):
            for j in range(columns):
                if i < n:
                    matrix[i, j] = out[n + i * columns + j] * scale[j]
                else:
                    matrix[i, j] = tangents[k, j] / scale[j]
        branching[k] = signed_distance(matrix, largest, space.constant)
        far = 1.0
        for j in range(n):
            away = abs(points[k, j] / scale[j])
            if not away <= far:
                far = away
                if far != far:
                    break
        along = tangents[k, n] / scale[n]
        turning[k] = 0.0 if far * abs(along) < vertical else along


@unfused_kernel
def signed_distance(matrix, least, right):  # type: ignore[no-untyped-def]
    """Estimate of the smallest singular value, with the sign of the determinant.

    The rows are normalised, so that the result depends neither on units nor on the number
    of rows, except that no row is divided by less than ``least``: a vanishing row makes the
    matrix singular. The estimate is 1/|A⁻¹ b| for a fixed unit vector b, an upper bound of
    the smallest singular value that vanishes with it. The matrix is overwritten.
    """
    size = matrix.shape[0]
    total = 0.0
    for i in range(size):
        squares = 0.0
        largest = 0.0
        for j in range(size):
            largest = max(largest, abs(matrix[i, j]))
        if not math.isfinite(largest):
            return np.nan
        if largest == 0.0:
            return 0.0
        largest = max(largest, least[i])
        for j in range(size):
            matrix[i, j] /= largest
            squares += matrix[i, j] * matrix[i, j]
        # the minimum length counts as one entry
        for j in range(size):
            matrix[i, j] /= max(math.sqrt(squares), 1.0)
        # in general position: no symmetry of a model makes it orthogonal to a null vector
        right[i] = 0.5 + (0.6180339887498949 * (i + 1)) % 1.0
        total += right[i] * right[i]
    sign = 1.0
    for k in range(size):
        best = k
        for i in range(k + 1, size):
            if abs(matrix[i, k]) > abs(matrix[best, k]):
                best = i
        pivot = matrix[best, k]
        if pivot == 0.0:
            return 0.0
        if best != k:
            sign = -sign
            for j in range(k, size):
                matrix[k, j], matrix[best, j] = matrix[best, j], matrix[k, j]
            right[k], right[best] = right[best], right[k]
        if pivot < 0.0:
            sign = -sign
        for i in range(k + 1, size):
            factor = matrix[i, k] / pivot
            if factor != 0.0:
                for j in range(k + 1, size):
                    matrix[i, j] -= factor * matrix[k, j]
                right[i] -= factor * right[k]
    solved = 0.0
    for k in range(size - 1, -1, -1):
        rest = right[k]
        for j in range(k + 1, size):
            rest -= matrix[k, j] * right[j]
        right[k] = rest / matrix[k, k]
        solved += right[k] * right[k]
    if not math.isfinite(solved):
        return 0.0
    return sign * math.sqrt(total / solved)


@unfused_kernel
def eigenvalues_of_2x2(jacobians, result):  # type: ignore[no-untyped-def]
    """Compute the eigenvalues of 2×2 matrices as LAPACK's dlanv2 does, shape (N, 2)."""
    count = jacobians.shape[0]
    for k in range(count):
        a, b = jacobians[k, 0, 0], jacobians[k, 0, 1]
        c, d = jacobians[k, 1, 0], jacobians[k, 1, 1]
        if not math.isfinite(a + b + c + d):
            result[k, 0] = result[k, 1] = np.nan
            continue
        half = 0.5 * (a - d)
        inside = half * half + b * c
        if inside >= 0.0:
            z = half + math.copysign(math.sqrt(inside), half)
            result[k, 0] = d + z
            result[k, 1] = d - b * c / z if z != 0.0 else d
        else:
            result[k, 0] = complex(0.5 * (a + d), math.sqrt(-inside))
            result[k, 1] = complex(0.5 * (a + d), -math.sqrt(-inside))


@unfused_kernel
def _modulus(value):  # type: ignore[no-untyped-def]
    return abs(value.real) if value.imag == 0.0 else math.hypot(value.real, value.imag)


@unfused_kernel
def _in_order_of_modulus(values, real):  # type: ignore[no-untyped-def]
    """Sort the real ones of some eigenvalues by their modulus; return their number."""
    count = 0
    for i in range(values.shape[0]):
        if values[i].imag == 0.0:
            value, place = values[i].real, count
            while place > 0 and abs(real[place - 1]) > abs(value):
                real[place] = real[place - 1]
                place -= 1
            real[place] = value
            count += 1
    return count


@unfused_kernel
def eigenvalue_pair_sums(values, rounding, alike, real, result):  # type: ignore[no-untyped-def]
    """Compute the smallest relative sums of two eigenvalues, signed, for rows of eigenvalues.

    0 if no sum remains or an eigenvalue is not finite. ``real`` is a work space of their number.
    """
    n = values.shape[1]
    for k in range(values.shape[0]):
        result[k] = top = total = 0.0
        for i in range(n):
            total += values[k, i].real + values[k, i].imag
            top = max(top, _modulus(values[k, i]))
        if not (math.isfinite(total) and math.isfinite(top)):
            continue
        noise = rounding * n * top
        least, negative, known = 1.0, 0, 0
        # complex pairs, represented by the eigenvalue with positive imaginary part
        for i in range(n):
            modulus, part = _modulus(values[k, i]), values[k, i].real
            if values[k, i].imag > 0.0 and abs(part) >= max(noise, alike * modulus):
                known += 1
                negative += part < 0.0
                least = min(least, abs(part) / modulus)
        # two real eigenvalues: in order of modulus the sum has the sign of the second
        count = _in_order_of_modulus(values[k], real)
        known += count * (count - 1) // 2
        for i in range(1, count):
            one, other = abs(real[i - 1]), abs(real[i])
            opposite = (real[i - 1] < 0.0) != (real[i] < 0.0)
            # the smallest relative sum is one of neighbours of opposite signs
            lost = opposite and other - one < max(noise, alike * (one + other))
            lost = lost or other < noise
            known -= lost
            if real[i] < 0.0:
                negative += i - lost
            if opposite and not lost:
                least = min(least, (other - one) / (other + one))
        if known > 0:
            result[k] = -least if negative % 2 == 1 else least


@unfused_kernel
def _alike(one, other):  # type: ignore[no-untyped-def]
    """Check whether two numbers have the same nonzero sign."""
    return (one > 0.0 and other > 0.0) or (one < 0.0 and other < 0.0)


@unfused_kernel
def _fall(test, length, row):  # type: ignore[no-untyped-def]
    """Rate of decrease of the modulus of a test on a step; NaN at a change of sign."""
    if not (_alike(test[row], test[row + 1]) and length[row] > 0.0):
        return np.nan
    return (abs(test[row]) - abs(test[row + 1])) / length[row]


@unfused_kernel
def possible_double_zeros(test, length, share, found):  # type: ignore[no-untyped-def]
    """Find the steps in which a test function without a change of sign may touch zero.

    The chords of both neighbouring steps are extended into the step: for a convex modulus
    they are lower bounds.

    Parameters
    ----------
    test : ndarray, shape (N,)
    length : ndarray, shape (N - 1,)
        Length of every step.
    share : float
        Fraction of the smaller end value that the bound must fall below.
    found : ndarray of int, shape (N - 1,)
        Rows before these steps, filled in.

    Returns
    -------
    int
        Their number.
    """
    number = 0
    steps = length.shape[0]
    for row in range(steps):
        if not _alike(test[row], test[row + 1]):
            continue
        left, right, step = abs(test[row]), abs(test[row + 1]), length[row]
        falls = _fall(test, length, row - 1) if row > 0 else np.nan
        rises = -_fall(test, length, row + 1) if row + 1 < steps else np.nan
        # with one unknown slope the other one decides
        if falls != falls and rises > 0.0:
            least = right - rises * step
        elif rises != rises and falls > 0.0:
            least = left - falls * step
        elif falls > 0.0 and rises > 0.0:
            # intersection of the two lines, within the step or at its nearer end
            meet = (left - right + rises * step) / (falls + rises)
            meet = 0.0 if meet < 0.0 else step if meet > step else meet
            one, other = left - falls * meet, right - rises * (step - meet)
            least = one if one > other or one != one else other
        else:
            continue
        if least < share * min(left, right):
            found[number] = row
            number += 1
    return number


@unfused_kernel
def nearby_chords(points, scale, u, within, found, apart):  # type: ignore[no-untyped-def]
    """Find the chords of a curve nearest to a point, each nearer than its two neighbours.

    Parameters
    ----------
    found : ndarray of int, shape (N - 1,)
        Numbers of the chords with a distance below ``within``, in scaled units, filled in.
    apart : ndarray, shape (N - 1,)
        Work space.

    Returns
    -------
    int
        Their number.
    """
    count, columns = points.shape
    for k in range(count - 1):
        length = 0.0
        ahead = 0.0
        for j in range(columns):
            chord = (points[k + 1, j] - points[k, j]) / scale[j]
            length += chord * chord
            ahead += (u[j] - points[k, j]) / scale[j] * chord
        part = min(max(ahead / max(length, 1e-300), 0.0), 1.0)
        total = 0.0
        for j in range(columns):
            off = (points[k, j] + part * (points[k + 1, j] - points[k, j]) - u[j]) / scale[j]
            total += off * off
        apart[k] = math.sqrt(total)
    number = 0
    for k in range(count - 1):
        if (
            apart[k] < within
            and (k == 0 or apart[k] <= apart[k - 1])
            and (k == count - 2 or apart[k] <= apart[k + 1])
        ):
            found[number] = k
            number += 1
    return number
