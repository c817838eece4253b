"""Compiled enclosures of proved pieces of curves, and of their tangents."""

from __future__ import annotations

import math

from fastslow.certification.boxes.krawczyk import (
    ENLARGED_SIZE,
    centre,
    contract_by_image,
    has_no_zero,
    image,
    maps_inside,
    precondition,
    preconditioned,
    slopes,
)
from fastslow.kernels.compiler.decorators import unfused_kernel
from fastslow.kernels.intervals.program import evaluate

#: Largest number of contractions, and the ratio of volumes from which on they end. Some twenty
#: are needed for solutions that are exactly zero.
CONTRACTIONS, ENOUGH = 30, 0.8

#: Norm of I − Y F' from which on a box is too wide to be contracted, and steps of Newton's method
#: to the middle of the curve in it.
WIDEST_NORM, MIDPOINT_STEPS = 0.5, 12

#: Radius of a box around a curve, in units of its slope times its extent in the free unknown.
BOX_RADIUS = 0.75

#: Factor that covers the rounding of a bound computed to nearest.
ROUNDED_UP = 1.0 + 1e-10


@unfused_kernel
def tighten(program, unit, free, low, high, tangent_low, tangent_high, space):  # type: ignore[no-untyped-def]
    """Contract boxes around proved curves, and enclose their tangents.

    Parameters
    ----------
    program : Program
    unit : ndarray, shape (N,)
    free : ndarray of int, shape (m,)
        The free unknown of each box.
    low, high : ndarray, shape (m, N)
        The boxes, which are contracted for all values of their free unknown in the box.
    tangent_low, tangent_high : ndarray, shape (m, N)
        Filled with bounds of the derivatives by the free unknown, infinite if the box is too
        wide to bound them; NaN for a box without a solution.
    space : Space
    """
    box = space.box
    for row in range(low.shape[0]):
        for j in range(low.shape[1]):
            box.low[j], box.high[j] = low[row, j], high[row, j]
            tangent_low[row, j], tangent_high[row, j] = -math.inf, math.inf
        found, norm = _contracted(program, unit, free[row], space)
        if found >= 0 and norm > WIDEST_NORM and _located(program, unit, free[row], space):
            found, norm = _contracted(program, unit, free[row], space)
        for j in range(low.shape[1]):
            low[row, j], high[row, j] = box.low[j], box.high[j]
        if found < 0:
            tangent_low[row, :] = math.nan
            tangent_high[row, :] = math.nan
        elif found > 0:
            _tangent(space, unit, free[row], tangent_low[row], tangent_high[row])


@unfused_kernel
def _contracted(program, unit, free, space):  # type: ignore[no-untyped-def]
    """Contract the box: 1 with F' and its preconditioner, 0 if it is singular, −1 if empty.

    The second result is the norm of I − Y F'.
    """
    box, operator, norm = space.box, space.operator, math.inf
    for _ in range(CONTRACTIONS):
        if has_no_zero(program, space.registers, box):
            return -1, norm
        slopes(program, space.registers, box)
        centre(program, space.registers, box)
        if precondition(box, unit, free, operator) < 0:
            return 0, norm
        norm = image(box, free, operator)
        ratio = contract_by_image(box, operator)
        if ratio < 0.0:
            return -1, norm
        # a volume of zero is one below the range of numbers
        if ratio > ENOUGH:
            break
    return 1, norm


@unfused_kernel
def _located(program, unit, free, space):  # type: ignore[no-untyped-def]
    """Replace a wide box by a small one around its curve, found by Newton's method.

    The small box is mapped into its interior and is inside the wide one, so that both contain
    the same curve.
    """
    box, small, operator = space.box, space.larger, space.operator
    for j in range(box.low.shape[0]):
        small.low[j] = small.high[j] = 0.5 * box.low[j] + 0.5 * box.high[j]
    for _ in range(MIDPOINT_STEPS):
        if not _prepared(program, unit, free, space):
            return False
        image(small, free, operator)
        for a in range(operator.columns.shape[0]):
            j = operator.columns[a]
            value = 0.5 * operator.low[a] + 0.5 * operator.high[a]
            small.low[j] = small.high[j] = min(max(value, box.low[j]), box.high[j])
    if not _prepared(program, unit, free, space):
        return False
    extent = box.high[free] - box.low[free]
    for a in range(operator.columns.shape[0]):
        j = operator.columns[a]
        by = preconditioned(small, operator, a, free)
        radius = BOX_RADIUS * max(abs(by[0]), abs(by[1])) * extent
        radius += 10.0 * ENLARGED_SIZE * (abs(small.low[j]) + unit[j])
        small.low[j], small.high[j] = small.low[j] - radius, small.high[j] + radius
    small.low[free], small.high[free] = box.low[free], box.high[free]
    if not _prepared(program, unit, free, space):
        return False
    image(small, free, operator)
    if not (maps_inside(small, operator) and maps_inside(box, operator)):
        return False
    for a in range(operator.columns.shape[0]):
        j = operator.columns[a]
        box.low[j], box.high[j] = operator.low[a], operator.high[a]
    return True


@unfused_kernel
def _prepared(program, unit, free, space):  # type: ignore[no-untyped-def]
    """Evaluate F and F' over the small box, and invert F'; False if it is singular."""
    small = space.larger
    evaluate(program, small.low, small.high, space.registers)
    slopes(program, space.registers, small)
    centre(program, space.registers, small)
    return precondition(small, unit, free, space.operator) >= 0


@unfused_kernel
def _tangent(space, unit, free, low, high):  # type: ignore[no-untyped-def]
    """Enclose the solution t of F' t = 0 with t = 1 in the free unknown.

    For the others (Y A) t = −Y F'_k, so that ‖t‖ is at most ‖Y F'_k‖/(1 − r) with r = ‖I − Y A‖ in
    the maximum norm in units of the unknowns, and each component of t differs from that of −Y F'_k
    by at most ‖t‖ times the norm of its row of I − Y A.
    """
    box, operator = space.box, space.operator
    n, columns, rows = operator.columns.shape[0], operator.columns, operator.low
    norm, largest = 0.0, 0.0
    for a in range(n):
        row = 0.0
        for b in range(n):
            entry = preconditioned(box, operator, a, columns[b])
            one = 1.0 if a == b else 0.0
            size = max(abs(entry[0] - one), abs(entry[1] - one))
            row += size * unit[columns[b]] / unit[columns[a]]
        rows[a] = row * ROUNDED_UP + 1e-15
        norm = max(norm, rows[a])
        entry = preconditioned(box, operator, a, free)
        size = max(abs(entry[0]), abs(entry[1])) / unit[columns[a]]
        largest = max(largest, size)
        low[columns[a]], high[columns[a]] = -entry[1], -entry[0]
    if not norm < 1.0:
        for j in range(low.shape[0]):
            low[j], high[j] = -math.inf, math.inf
        return
    more = ROUNDED_UP * largest / (1.0 - norm)
    for a in range(n):
        j = columns[a]
        slack = more * rows[a] * unit[j] + 1e-14 * (abs(low[j]) + abs(high[j]))
        low[j], high[j] = low[j] - slack, high[j] + slack
    low[free], high[free] = 1.0, 1.0
