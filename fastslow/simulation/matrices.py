"""Small matrices within compiled loops: linear systems, and whether a flow contracts."""

from __future__ import annotations

import numpy as np

from fastslow.compiled.parts import part


@part
def contracts(jacobian, n, rate):
    """Whether all eigenvalues of the first rows and columns have a real part below -rate.

    By the coefficients of the characteristic polynomial (Faddeev and Le Verrier)
    of the matrix moved by the rate, and the scheme of Routh.
    """
    if n < 3:
        last = jacobian[n - 1, n - 1] + rate
        if n == 1:
            return last < 0.0
        first = jacobian[0, 0] + rate
        return first + last < 0.0 and first * last > jacobian[0, 1] * jacobian[1, 0]
    moved, product = np.empty((n, n)), np.zeros((n, n))
    c = np.empty(n + 1)
    c[0] = 1.0
    for i in range(n):
        for j in range(n):
            moved[i, j] = jacobian[i, j] + (rate if i == j else 0.0)
    for k in range(1, n + 1):
        # product = moved @ (product + c[k - 1] I)
        for j in range(n):
            product[j, j] += c[k - 1]
        last = product.copy()
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
    above, below = np.zeros(n // 2 + 2), np.zeros(n // 2 + 2)
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


@part
def forgotten_in(jacobian, n, rate):
    """The largest modulus of the eigenvalues whose real parts are not below -rate.

    Of the first rows and columns. 0 where there is none, NaN where something is
    not finite.
    """
    if contracts(jacobian, n, rate):
        return 0.0
    if n == 1:
        return abs(jacobian[0, 0])
    matrix = np.empty((n, n), dtype=np.complex128)
    for i in range(n):
        for j in range(n):
            if not abs(jacobian[i, j]) < np.inf:
                return np.nan
            matrix[i, j] = jacobian[i, j]
    largest = 0.0
    for value in np.linalg.eigvals(matrix):
        if not value.real < -rate:
            largest = max(largest, abs(value))
    return largest


@part
def factorise_in_place(matrix, n):
    """LU factors with the largest pivots; the last column keeps the exchanges of rows."""
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
            matrix[i, k] /= matrix[k, k]
            for j in range(k + 1, n):
                matrix[i, j] -= matrix[i, k] * matrix[k, j]
    return True


@part
def solve_in_place(factors, right, solution, n):
    """Solve with the factors of `factorise_in_place`; the right-hand side is kept."""
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
