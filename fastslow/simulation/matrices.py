"""Small matrices within compiled loops: linear systems, and whether a flow contracts."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import types

from fastslow.compiled.parts import part
from fastslow.compiled.records import ComplexMatrix, ComplexVector, Matrix, Vector, zeros

_NUMBERS = types.CPointer(types.complex128)

# LAPACK's zgeev, as Numba finds it in SciPy
_GEEV: Any = types.ExternalFunction(
    "numba_ez_cgeev",
    types.intc(
        *[types.char] * 3,
        *[types.intp, _NUMBERS] * 2,
        _NUMBERS,
        *[types.intp, _NUMBERS, types.intp],
    ),
)
_KIND, _NONE = ord("z"), ord("N")


class Spectrum(NamedTuple):
    """Work space for the eigenvalues of a matrix."""

    shifted: Matrix
    product: Matrix
    last: Matrix
    coefficients: Vector
    above: Vector
    below: Vector
    matrix: ComplexMatrix
    values: ComplexVector


def spectrum_for(n: int) -> Spectrum:
    """Work space for matrices of up to n rows."""
    half = n // 2 + 2
    return zeros(Spectrum, (n, n), (n, n), (n, n), n + 1, half, half, (n, n), n)


@part
def contracts(jacobian, n, rate, space):
    """Whether all eigenvalues of the first rows and columns have a real part below -rate.

    By the coefficients of the characteristic polynomial (Faddeev and Le Verrier)
    of the matrix moved by the rate, and the scheme of Routh.
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


@part
def forgotten_in(jacobian, n, rate, space):
    """The largest modulus of the eigenvalues whose real parts are not below -rate.

    Of the first rows and columns. 0 where there is none, NaN where they are not known.
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


@part
def eigenvalues_of(matrix, n, space):
    """Fill in the eigenvalues of the first rows and columns; whether they are known.

    They are not where something is not finite, or where LAPACK's iteration does not converge.
    """
    # stored column by column
    entries = space.matrix.reshape(space.matrix.size)
    for i in range(n):
        for j in range(n):
            if not abs(matrix[i, j]) < np.inf:
                return False
            entries[i + n * j] = matrix[i, j]
    where, values = entries.ctypes, space.values.ctypes
    return _GEEV(_KIND, _NONE, _NONE, n, where, n, values, values, 1, values, 1) == 0


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
