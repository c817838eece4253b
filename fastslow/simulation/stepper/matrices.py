"""Small dense matrices in compiled loops: linear systems, eigenvalues, contraction."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from fastslow.kernels.compiler.decorators import kernel
from fastslow.kernels.compiler.records import ComplexVector, Matrix, Vector, zeros
from fastslow.simulation.stepper.polynomials import EPSILON

#: Maximum iterations for one eigenvalue, and the interval between exceptional shifts.
_ITERATIONS, _EXCEPTIONAL = 60, 10


class EigenvalueSpace(NamedTuple):
    """Work space for the eigenvalues of a matrix."""

    shifted: Matrix
    product: Matrix
    last: Matrix
    coefficients: Vector
    above: Vector
    below: Vector
    values: ComplexVector


def spectrum_for(n: int) -> EigenvalueSpace:
    """Allocate the work space for matrices of up to n rows."""
    half = n // 2 + 2
    return zeros(EigenvalueSpace, (n, n), (n, n), (n, n), n + 1, half, half, n)


@kernel
def contracts(jacobian, n, rate, space):
    """Check that all eigenvalues of the leading n×n block have real parts below -rate.

    By the characteristic polynomial of the shifted matrix (Faddeev-Le Verrier) and the
    Routh-Hurwitz criterion.
    """
    if n < 3:
        second = jacobian[n - 1, n - 1] + rate
        if n == 1:
            return second < 0.0
        first = jacobian[0, 0] + rate
        return first + second < 0.0 and first * second > jacobian[0, 1] * jacobian[1, 0]
    moved, product, last, c = space.shifted, space.product, space.last, space.coefficients
    c[0] = 1.0
    for i in range(n):
        for j in range(n):
            moved[i, j] = jacobian[i, j] + (rate if i == j else 0.0)
            product[i, j] = 0.0
    for k in range(1, n + 1):
        # product = moved @ (product + c[k - 1] I)
        for j in range(n):
            product[j, j] += c[k - 1]
        for i in range(n):
            for j in range(n):
                last[i, j] = product[i, j]
        trace = 0.0
        for i in range(n):
            for j in range(n):
                value = 0.0
                for m in range(n):
                    value += moved[i, m] * last[m, j]
                product[i, j] = value
            trace += product[i, i]
        c[k] = -trace / k
        if not c[k] > 0.0:
            return False
    above, below = space.above, space.below
    for k in range(n // 2 + 2):
        above[k] = below[k] = 0.0
    for k in range(n + 1):
        if k % 2 == 0:
            above[k // 2] = c[k]
        else:
            below[k // 2] = c[k]
    for _ in range(n - 1):
        if not below[0] > 0.0:
            return False
        ratio = above[0] / below[0]
        for k in range(n // 2 + 1):
            above[k] = above[k + 1] - ratio * below[k + 1]
        above, below = below, above
    return below[0] > 0.0


@kernel
def undamped_modulus(jacobian, n, rate, space):
    """Largest modulus of the eigenvalues of the leading block with real parts from -rate.

    0 if there is none, NaN if the eigenvalues cannot be computed.
    """
    if contracts(jacobian, n, rate, space):
        return 0.0
    if n == 1:
        return abs(jacobian[0, 0])
    if not eigenvalues_of(jacobian, n, space):
        return np.nan
    largest = 0.0
    for i in range(n):
        value = space.values[i]
        if not value.real < -rate:
            largest = max(largest, abs(value))
    return largest


@kernel
def eigenvalues_of(matrix, n, space):
    """Compute the eigenvalues of the leading block; return whether this succeeded.

    It fails for entries that are not finite and without convergence. Householder reduction
    and Francis's double-shift QR steps, as in EISPACK (Smith et al. 1976).
    """
    h = space.shifted
    for i in range(n):
        for j in range(n):
            if not abs(matrix[i, j]) < np.inf:
                return False
            h[i, j] = matrix[i, j]
    balance(h, n)
    to_hessenberg(h, n, space.coefficients)
    size = 0.0
    for i in range(n):
        for j in range(max(i - 1, 0), n):
            size += abs(h[i, j])
    last, moved, steps = n - 1, 0.0, 0
    while last >= 0:
        first = uncoupled(h, last, size)
        x = h[last, last]
        if first == last:
            space.values[last] = x + moved
            last, steps = last - 1, 0
            continue
        y, w = h[last - 1, last - 1], h[last, last - 1] * h[last - 1, last]
        if first == last - 1:
            half = 0.5 * (y - x)
            inside = half * half + w
            root = math.sqrt(abs(inside))
            if inside >= 0.0:
                root = half + math.copysign(root, half)
                space.values[last - 1] = x + moved + root
                space.values[last] = x + moved + (-w / root if root != 0.0 else root)
            else:
                space.values[last - 1] = complex(x + moved + half, root)
                space.values[last] = complex(x + moved + half, -root)
            last, steps = last - 2, 0
            continue
        if steps == _ITERATIONS:
            return False
        if steps % _EXCEPTIONAL == _EXCEPTIONAL - 1:
            moved += x
            for i in range(last + 1):
                h[i, i] -= x
            s = abs(h[last, last - 1]) + abs(h[last - 1, last - 2])
            x = y = 0.75 * s
            w = -0.4375 * s * s
        steps += 1
        double_step(h, first, last, x, y, w)
    return True


@kernel
def balance(h, n):
    """Balance a matrix: scale rows and columns by powers of two to similar norms."""
    changed = True
    while changed:
        changed = False
        for i in range(n):
            column = row = 0.0
            for j in range(n):
                if j != i:
                    column += abs(h[j, i])
                    row += abs(h[i, j])
            if column == 0.0 or row == 0.0 or not column + row < np.inf:
                continue
            factor, total = 1.0, column + row
            while column < 0.5 * row:
                factor *= 2.0
                column *= 4.0
            while column >= 2.0 * row:
                factor *= 0.5
                column *= 0.25
            if (column + row) / factor < 0.95 * total:
                changed = True
                for j in range(n):
                    h[i, j] /= factor
                for j in range(n):
                    h[j, i] *= factor


@kernel
def to_hessenberg(h, n, v):
    """Reduce a matrix to Hessenberg form by Householder reflections."""
    for m in range(1, n - 1):
        size = 0.0
        for i in range(m + 1, n):
            size = max(size, abs(h[i, m - 1]))
        if size == 0.0:
            continue
        size = max(size, abs(h[m, m - 1]))
        squares = 0.0
        for i in range(m, n):
            v[i] = h[i, m - 1] / size
            squares += v[i] * v[i]
        length = -math.copysign(math.sqrt(squares), v[m])
        # half the square of the length of v
        half = squares - v[m] * length
        v[m] -= length
        for j in range(m, n):
            total = 0.0
            for i in range(m, n):
                total += v[i] * h[i, j]
            for i in range(m, n):
                h[i, j] -= total / half * v[i]
        for i in range(n):
            total = 0.0
            for j in range(m, n):
                total += h[i, j] * v[j]
            for j in range(m, n):
                h[i, j] -= total / half * v[j]
        h[m, m - 1] = size * length
        for i in range(m + 1, n):
            h[i, m - 1] = 0.0


@kernel
def uncoupled(h, last, size):
    """First row of the trailing block that is decoupled from the rows above."""
    first = last
    while first > 0:
        around = abs(h[first - 1, first - 1]) + abs(h[first, first])
        if abs(h[first, first - 1]) <= EPSILON * (around if around > 0.0 else size):
            break
        first -= 1
    return first


@kernel
def double_step(h, first, last, x, y, w):
    """One double-shift Francis step on the rows from the first to the last.

    The shifts have the sum x + y and the product x y - w.
    """
    m, p, q, r = last - 2, 0.0, 0.0, 0.0
    while True:
        # two consecutive small entries allow a later start
        z = h[m, m]
        p = ((x - z) * (y - z) - w) / h[m + 1, m] + h[m, m + 1]
        q = h[m + 1, m + 1] + z - x - y
        r = h[m + 2, m + 1]
        s = abs(p) + abs(q) + abs(r)
        p, q, r = p / s, q / s, r / s
        if m == first:
            break
        beside = abs(h[m - 1, m - 1]) + abs(z) + abs(h[m + 1, m + 1])
        if abs(h[m, m - 1]) * (abs(q) + abs(r)) <= EPSILON * abs(p) * beside:
            break
        m -= 1
    for i in range(m + 2, last + 1):
        h[i, i - 2] = 0.0
        if i > m + 2:
            h[i, i - 3] = 0.0
    for k in range(m, last):
        three = k < last - 1
        if k > m:
            p, q = h[k, k - 1], h[k + 1, k - 1]
            r = h[k + 2, k - 1] if three else 0.0
            x = abs(p) + abs(q) + abs(r)
            if x == 0.0:
                continue
            p, q, r = p / x, q / x, r / x
        s = math.copysign(math.sqrt(p * p + q * q + r * r), p)
        if k > m:
            h[k, k - 1] = -s * x
        elif first != m:
            h[k, k - 1] = -h[k, k - 1]
        p += s
        x, y, z, q, r = p / s, q / s, r / s, q / p, r / p
        for j in range(k, last + 1):
            total = h[k, j] + q * h[k + 1, j]
            if three:
                total += r * h[k + 2, j]
                h[k + 2, j] -= total * z
            h[k + 1, j] -= total * y
            h[k, j] -= total * x
        for i in range(first, min(last, k + 3) + 1):
            total = x * h[i, k] + y * h[i, k + 1]
            if three:
                total += z * h[i, k + 2]
                h[i, k + 2] -= total * r
            h[i, k + 1] -= total * q
            h[i, k] -= total


@kernel
def factorise_in_place(matrix, n):
    """LU factors with partial pivoting; the last column stores the row exchanges."""
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(matrix[i, k]) > abs(matrix[pivot, k]):
                pivot = i
        matrix[k, n] = pivot
        if not 0.0 < abs(matrix[pivot, k]) < np.inf:
            return False
        for j in range(n):
            matrix[k, j], matrix[pivot, j] = matrix[pivot, j], matrix[k, j]
        for i in range(k + 1, n):
            # most entries of the equations of multiple shooting are zero
            if matrix[i, k] != 0.0:
                matrix[i, k] /= matrix[k, k]
                for j in range(k + 1, n):
                    matrix[i, j] -= matrix[i, k] * matrix[k, j]
    return True


@kernel
def solve_in_place(factors, right, solution, n):
    """Solve with the factors of `factorise_in_place`; the right-hand side is not changed."""
    for i in range(n):
        solution[i] = right[i]
    for k in range(n):
        pivot = int(factors[k, n].real)
        solution[k], solution[pivot] = solution[pivot], solution[k]
    for i in range(n):
        for j in range(i):
            solution[i] -= factors[i, j] * solution[j]
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            solution[i] -= factors[i, j] * solution[j]
        solution[i] /= factors[i, i]
