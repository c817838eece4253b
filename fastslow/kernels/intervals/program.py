"""Evaluation of rates and their derivatives in interval arithmetic, without code per model.

A program is a table of operations on registers, rows (operation, target, a, b, c). The first
registers are the unknowns, the next ones constants.
"""

from __future__ import annotations

from typing import NamedTuple

from fastslow.kernels.compiler.decorators import unfused_kernel
from fastslow.kernels.compiler.records import IntegerMatrix, Integers, Vector
from fastslow.kernels.intervals import arithmetic as interval
from fastslow.kernels.intervals.elementary import enclosed

# operations: the target is …
ADD = 0  # a + b
SUBTRACT = 1  # a − b
MULTIPLY = 2  # a b
SCALE = 3  # a b, where a is a number
ADD_PRODUCT = 4  # a b + c
ADD_SCALED = 5  # a b + c, where a is a number
DIVIDE = 6  # a / b
NEGATE = 7  # −a
SQUARE = 8  # a²
POWER = 9  # aⁿ, where n = b
SQUARE_ROOT = 10
REAL_POWER = 11  # a^b for a > 0
EXP_QUOTIENT = 12  # derivative of order b of y/(e^y − 1)
# larger ones are those of `fastslow.kernels.intervals.elementary`


class Registers(NamedTuple):
    """Bounds of unknowns, constants and intermediate values."""

    low: Vector
    high: Vector


class Program(NamedTuple):
    """Operations that compute n functions F, and then their derivatives by N unknowns.

    Parameters
    ----------
    code : ndarray of int, shape (m, 5)
    values : int
        Number of operations that compute F; the others compute the derivatives.
    rows : ndarray of int, shape (n,)
        Registers of F.
    slopes : ndarray of int, shape (n, N)
        Registers of the derivatives.
    """

    code: IntegerMatrix
    values: int
    rows: Integers
    slopes: IntegerMatrix


@unfused_kernel
def _result(operation, a, b, count):  # type: ignore[no-untyped-def]
    """Result of an operation of one or two arguments; count is a whole number in place of b."""
    if operation == DIVIDE:
        return interval.divide(a, b)
    if operation == SUBTRACT:
        return interval.subtract(a, b)
    if operation == NEGATE:
        return interval.negative(a)
    if operation == POWER:
        return interval.power(a, count)
    if operation == SQUARE_ROOT:
        return interval.square_root(a)
    if operation == REAL_POWER:
        return interval.real_power(a, b)
    if operation == EXP_QUOTIENT:
        return interval.exp_quotient(a, count)
    return enclosed(operation, a, count)


@unfused_kernel
def execute(code, first, last, registers):  # type: ignore[no-untyped-def]
    """Execute the operations from first to before last."""
    low, high = registers.low, registers.high
    for k in range(first, last):
        operation, i, j = code[k, 0], code[k, 2], code[k, 3]
        if operation == ADD_SCALED:
            term = interval.scale(low[i], (low[j], high[j]))
            c = code[k, 4]
            z = interval.add(term, (low[c], high[c]))
        elif operation == ADD:
            z = interval.add((low[i], high[i]), (low[j], high[j]))
        elif operation == SCALE:
            z = interval.scale(low[i], (low[j], high[j]))
        elif operation == MULTIPLY:
            z = interval.multiply((low[i], high[i]), (low[j], high[j]))
        elif operation == ADD_PRODUCT:
            term = interval.multiply((low[i], high[i]), (low[j], high[j]))
            c = code[k, 4]
            z = interval.add(term, (low[c], high[c]))
        elif operation == SQUARE:
            z = interval.square((low[i], high[i]))
        else:
            # a whole number is no register
            other = max(0, min(j, low.shape[0] - 1))
            z = _result(operation, (low[i], high[i]), (low[other], high[other]), j)
        target = code[k, 1]
        low[target], high[target] = z


@unfused_kernel
def set_unknowns(registers, low, high):  # type: ignore[no-untyped-def]
    """Write a box to the first registers."""
    for k in range(low.shape[0]):
        registers.low[k], registers.high[k] = low[k], high[k]


@unfused_kernel
def evaluate(program, low, high, registers):  # type: ignore[no-untyped-def]
    """Enclose F over a box."""
    set_unknowns(registers, low, high)
    execute(program.code, 0, program.values, registers)


@unfused_kernel
def differentiate(program, registers):  # type: ignore[no-untyped-def]
    """Enclose the derivatives over the box of the last evaluation."""
    execute(program.code, program.values, program.code.shape[0], registers)


@unfused_kernel
def enclose(program, boxes_low, boxes_high, registers, low, high):  # type: ignore[no-untyped-def]
    """Enclose F and its derivatives, row by row, over many boxes.

    Parameters
    ----------
    boxes_low, boxes_high : ndarray, shape (m, N)
    low, high : ndarray, shape (m, n (N + 1))
        Filled with the values and then the derivatives.
    """
    n, width = program.slopes.shape
    for box in range(boxes_low.shape[0]):
        evaluate(program, boxes_low[box], boxes_high[box], registers)
        differentiate(program, registers)
        for i in range(n):
            low[box, i] = registers.low[program.rows[i]]
            high[box, i] = registers.high[program.rows[i]]
            for j in range(width):
                low[box, n + i * width + j] = registers.low[program.slopes[i, j]]
                high[box, n + i * width + j] = registers.high[program.slopes[i, j]]
