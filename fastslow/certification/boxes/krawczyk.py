"""Compiled tests of boxes for curves F(u) = 0 of n equations in N = n + 1 unknowns.

The Krawczyk operator (Krawczyk 1969; Neumaier 1990, theorem 5.1.8) with one unknown free: if the
image of a box lies in its interior for all values of the free unknown, then there is exactly one
solution in the box for each of these values, a smooth curve.
"""

from __future__ import annotations

from typing import NamedTuple

from fastslow.kernels.compiler.decorators import unfused_kernel
from fastslow.kernels.compiler.records import Integers, Matrix, Vector
from fastslow.kernels.intervals.arithmetic import add, divide, multiply, scale, subtract
from fastslow.kernels.intervals.program import Registers, differentiate, evaluate

#: Results of a test.
NO_ZERO, PROVED, OPEN = 0, 1, 2

#: Smallest pivot of the equilibrated matrix, below which it is singular to rounding.
PIVOT = 1e-13

#: Enlargement of a box in which a curve is to be proved: by this fraction of its width, and by
#: this fraction of its size and of the window, so that exact solutions have room for rounding.
ENLARGED_WIDTH, ENLARGED_SIZE = 0.1, 1e-14

#: Enlargements tried.
ENLARGEMENTS = 4

_TINY = 1e-300


class Rules(NamedTuple):
    """How boxes are searched.

    Parameters
    ----------
    unit : ndarray, shape (N,)
        Width of the window in each unknown, 1 for an unknown of one value.
    fixed : int
        Unknown that has one value and is never free, −1 without one.
    width : float
        Smallest width of a box, in these units.
    """

    unit: Vector
    fixed: int
    width: float


class Box(NamedTuple):
    """A box with its middle, F at the middle and F' over the box.

    Parameters
    ----------
    low, high, middle : ndarray, shape (N,)
    value_low, value_high : ndarray, shape (n,)
    slope_low, slope_high : ndarray, shape (n, N)
    """

    low: Vector
    high: Vector
    middle: Vector
    value_low: Vector
    value_high: Vector
    slope_low: Matrix
    slope_high: Matrix


class Krawczyk(NamedTuple):
    """Preconditioner and image of the Krawczyk operator for one free unknown.

    Parameters
    ----------
    matrix : ndarray, shape (n, 2n + 1)
        Workspace of the elimination.
    inverse : ndarray, shape (n, n)
        Approximate inverse Y of the derivatives by the other unknowns.
    columns : ndarray of int, shape (n,)
        The other unknowns.
    rows, used : ndarray of int, shape (N,)
        Workspace of the elimination.
    low, high : ndarray, shape (n,)
        The image of a box.
    """

    matrix: Matrix
    inverse: Matrix
    columns: Integers
    rows: Integers
    used: Integers
    low: Vector
    high: Vector


class KrawczykSpace(NamedTuple):
    """Workspace of the search: registers, a box, an enlarged box, and the operator."""

    registers: Registers
    box: Box
    larger: Box
    operator: Krawczyk


@unfused_kernel
def centre(program, registers, box):  # type: ignore[no-untyped-def]
    """Compute the middle of a box and F there."""
    for j in range(box.low.shape[0]):
        box.middle[j] = 0.5 * box.low[j] + 0.5 * box.high[j]
    evaluate(program, box.middle, box.middle, registers)
    for i in range(box.value_low.shape[0]):
        box.value_low[i] = registers.low[program.rows[i]]
        box.value_high[i] = registers.high[program.rows[i]]


@unfused_kernel
def has_no_zero(program, registers, box):  # type: ignore[no-untyped-def]
    """Evaluate F over a box and return True if it has no zero there."""
    evaluate(program, box.low, box.high, registers)
    for i in range(program.rows.shape[0]):
        row = program.rows[i]
        if registers.low[row] > 0.0 or registers.high[row] < 0.0:
            return True
    return False


@unfused_kernel
def slopes(program, registers, box):  # type: ignore[no-untyped-def]
    """Enclose F' over a box whose F has been evaluated."""
    differentiate(program, registers)
    for i in range(program.slopes.shape[0]):
        for j in range(program.slopes.shape[1]):
            box.slope_low[i, j] = registers.low[program.slopes[i, j]]
            box.slope_high[i, j] = registers.high[program.slopes[i, j]]


@unfused_kernel
def slope(box, i, j):  # type: ignore[no-untyped-def]
    """An entry of F' over the box."""
    return box.slope_low[i, j], box.slope_high[i, j]


@unfused_kernel
def offset(box, j):  # type: ignore[no-untyped-def]
    """Enclose the range of u_j − m_j in a box."""
    return subtract((box.low[j], box.high[j]), (box.middle[j], box.middle[j]))


@unfused_kernel
def row_sum(box, i, without):  # type: ignore[no-untyped-def]
    """Enclose F_i(m) + Σ F'_ij (u_j − m_j), without one unknown."""
    total = (box.value_low[i], box.value_high[i])
    for j in range(box.low.shape[0]):
        if j != without and (box.slope_low[i, j] != 0.0 or box.slope_high[i, j] != 0.0):
            total = add(total, multiply(slope(box, i, j), offset(box, j)))
    return total


@unfused_kernel
def narrow(box, j, interval):  # type: ignore[no-untyped-def]
    """Intersect a side of a box with an interval; return the ratio of widths, −1 if empty."""
    low, high = max(box.low[j], interval[0]), min(box.high[j], interval[1])
    if low > high:
        return -1.0
    before = box.high[j] - box.low[j]
    box.low[j], box.high[j] = low, high
    return (high - low) / before if before > 0.0 else 1.0


@unfused_kernel
def contract_by_rows(box, fixed):  # type: ignore[no-untyped-def]
    """Contract a box by each equation, solved for each unknown.

    Returns the ratio of the new volume to the old one, −1 if nothing is left.
    """
    ratio, n, width = 1.0, box.value_low.shape[0], box.low.shape[0]
    for i in range(n):
        total = row_sum(box, i, -1)
        if total[0] > 0.0 or total[1] < 0.0:
            return -1.0
        for j in range(width):
            by = slope(box, i, j)
            if j == fixed or by[0] <= 0.0 <= by[1]:
                continue
            quotient = divide(row_sum(box, i, j), by)
            share = narrow(box, j, subtract((box.middle[j], box.middle[j]), quotient))
            if share < 0.0:
                return -1.0
            ratio *= share
    return ratio


@unfused_kernel
def precondition(box, unit, fixed, operator):  # type: ignore[no-untyped-def]
    """Choose the free unknown and invert the derivatives by the others at the middle of F'.

    Gauss-Jordan elimination with full pivoting of the matrix scaled by the units of the unknowns;
    the unknown without a pivot is free. Returns it, −1 for a singular matrix.
    """
    matrix, used, rows = operator.matrix, operator.used, operator.rows
    n, width = box.slope_low.shape
    for i in range(n):
        largest = 0.0
        for j in range(width):
            matrix[i, j] = 0.5 * (box.slope_low[i, j] + box.slope_high[i, j]) * unit[j]
            if not abs(matrix[i, j]) < 1e300:
                return -1
            largest = max(largest, abs(matrix[i, j]))
        if largest == 0.0:
            return -1
        for j in range(width):
            matrix[i, j] /= largest
        for j in range(n):
            matrix[i, width + j] = 1.0 / largest if i == j else 0.0
    for j in range(width):
        used[j], rows[j] = 0, -1
    for _ in range(n):
        best, row, column = PIVOT, -1, -1
        for i in range(n):
            taken = False
            for j in range(width):
                taken = taken or rows[j] == i
            if taken:
                continue
            for j in range(width):
                if used[j] == 0 and j != fixed and abs(matrix[i, j]) > best:
                    best, row, column = abs(matrix[i, j]), i, j
        if row < 0:
            return -1
        pivot = matrix[row, column]
        for j in range(matrix.shape[1]):
            matrix[row, j] /= pivot
        for i in range(n):
            factor = matrix[i, column]
            if i != row and factor != 0.0:
                for j in range(matrix.shape[1]):
                    matrix[i, j] -= factor * matrix[row, j]
        used[column], rows[column] = 1, row
    free, place = -1, 0
    for j in range(width):
        if used[j] == 0:
            free = j
            continue
        operator.columns[place] = j
        for i in range(n):
            operator.inverse[place, i] = matrix[rows[j], width + i] * unit[j]
        place += 1
    return free


@unfused_kernel
def preconditioned(box, operator, a, column):  # type: ignore[no-untyped-def]
    """Enclose an entry of Y F', in the column of one unknown."""
    total = (0.0, 0.0)
    for i in range(box.slope_low.shape[0]):
        factor = operator.inverse[a, i]
        if factor != 0.0 and (box.slope_low[i, column] != 0.0 or box.slope_high[i, column] != 0.0):
            total = add(total, scale(factor, slope(box, i, column)))
    return total


@unfused_kernel
def image(box, free, operator):  # type: ignore[no-untyped-def]
    """Enclose m − Y F(m) − Y F'_k (u_k − m_k) + (I − Y F')(u − m) for the other unknowns.

    Returns a bound of the norm of I − Y F' in units of the box: a box can only be mapped into
    its interior if the bound is below 1.
    """
    norm, n, columns = 0.0, box.value_low.shape[0], operator.columns
    for a in range(n):
        own = columns[a]
        total, row = (box.middle[own], box.middle[own]), 0.0
        for i in range(n):
            if operator.inverse[a, i] != 0.0:
                value = (box.value_low[i], box.value_high[i])
                total = subtract(total, scale(operator.inverse[a, i], value))
        moved = multiply(preconditioned(box, operator, a, free), offset(box, free))
        total = subtract(total, moved)
        for b in range(n):
            other = columns[b]
            one = 1.0 if a == b else 0.0
            entry = subtract((one, one), preconditioned(box, operator, a, other))
            row += max(abs(entry[0]), abs(entry[1])) * _extent(box, other)
            total = add(total, multiply(entry, offset(box, other)))
        norm = max(norm, row / _extent(box, own))
        operator.low[a], operator.high[a] = total
    return norm


@unfused_kernel
def _extent(box, j):  # type: ignore[no-untyped-def]
    """Width of a box in one unknown, for estimates."""
    size = abs(box.low[j]) + abs(box.high[j])
    return box.high[j] - box.low[j] + 10.0 * ENLARGED_SIZE * size + _TINY


@unfused_kernel
def contract_by_image(box, operator):  # type: ignore[no-untyped-def]
    """Intersect a box with the image; return the ratio of volumes, −1 if nothing is left."""
    ratio = 1.0
    for a in range(operator.columns.shape[0]):
        share = narrow(box, operator.columns[a], (operator.low[a], operator.high[a]))
        if share < 0.0:
            return -1.0
        ratio *= share
    return ratio


@unfused_kernel
def maps_inside(box, operator):  # type: ignore[no-untyped-def]
    """Return True if the image lies in the interior of the box."""
    for a in range(operator.columns.shape[0]):
        j = operator.columns[a]
        if not (operator.low[a] > box.low[j] and operator.high[a] < box.high[j]):
            return False
    return True


@unfused_kernel
def _misses(box, operator):  # type: ignore[no-untyped-def]
    """Return True if the image and the box have no common point."""
    for a in range(operator.columns.shape[0]):
        j = operator.columns[a]
        if operator.low[a] > box.high[j] or operator.high[a] < box.low[j]:
            return True
    return False


@unfused_kernel
def prove_on_larger_box(program, rules, space, free):  # type: ignore[no-untyped-def]
    """Prove a curve on a box that contains the box and its last image.

    Returns `PROVED` with the image in the operator, `NO_ZERO` if no solution of it is in the box,
    or `OPEN`.
    """
    box, larger, operator = space.box, space.larger, space.operator
    larger.low[free], larger.high[free] = box.low[free], box.high[free]
    for _ in range(ENLARGEMENTS):
        for a in range(operator.columns.shape[0]):
            j = operator.columns[a]
            low, high = min(operator.low[a], box.low[j]), max(operator.high[a], box.high[j])
            more = (
                ENLARGED_WIDTH * (high - low)
                + ENLARGED_SIZE * (abs(low) + abs(high) + rules.unit[j])
                + _TINY
            )
            larger.low[j], larger.high[j] = low - more, high + more
        centre(program, space.registers, larger)
        evaluate(program, larger.low, larger.high, space.registers)
        slopes(program, space.registers, larger)
        if not image(larger, free, operator) < 1.0:
            return OPEN
        if _misses(box, operator):
            return NO_ZERO
        if maps_inside(larger, operator):
            return PROVED
    return OPEN
