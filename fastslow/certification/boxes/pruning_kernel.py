"""Compiled branch and prune: every box is empty, contains one proved piece of curve, or is left."""

from __future__ import annotations

from typing import NamedTuple

from fastslow.certification.boxes.krawczyk import (
    NO_ZERO,
    OPEN,
    PROVED,
    centre,
    contract_by_image,
    contract_by_rows,
    has_no_zero,
    image,
    maps_inside,
    precondition,
    prove_on_larger_box,
    slopes,
)
from fastslow.kernels.compiler.decorators import unfused_kernel
from fastslow.kernels.compiler.records import Integers, Matrix

#: States of a search when the loop returns.
SEARCH_FINISHED, SEARCH_PAUSED, SEARCH_FULL = 0, 1, 2

#: Entries of the counts of a search.
STACK, PIECES_FOUND, BOXES_LEFT, SEARCHED = 0, 1, 2, 3

#: A box that was contracted to less than this fraction of its volume is searched again, by rows
#: and by the Krawczyk operator.
BY_ROWS, BY_IMAGE = 0.5, 0.4

#: Overlap of the halves of a box, in units of its width: the end of a piece is then inside the
#: next one.
OVERLAP = 1e-9

#: Rows of the tables that one box may need.
_SPARE = 2


class BoxSearch(NamedTuple):
    """Boxes to be searched, and the results so far.

    Parameters
    ----------
    stack_low, stack_high : ndarray, shape (depth, N)
        Boxes not yet searched.
    piece_low, piece_high : ndarray, shape (capacity, N)
        Boxes that contain exactly one solution for each value of their free unknown.
    free : ndarray of int, shape (capacity,)
        The free unknown of each piece.
    left_low, left_high : ndarray, shape (capacity, N)
        Boxes of the smallest width, in which nothing is proved.
    counts : ndarray of int, shape (4,)
        Numbers of boxes on the stack, of pieces, of boxes left, and of boxes searched.
    """

    stack_low: Matrix
    stack_high: Matrix
    piece_low: Matrix
    piece_high: Matrix
    free: Integers
    left_low: Matrix
    left_high: Matrix
    counts: Integers


@unfused_kernel
def prune(program, rules, search, space, budget):  # type: ignore[no-untyped-def]
    """Search boxes of the stack, at most ``budget`` of them.

    Returns `SEARCH_FINISHED`, `SEARCH_PAUSED` after the budget, or `SEARCH_FULL` if a table has no
    more rows.
    """
    counts, last = search.counts, search.counts[SEARCHED] + budget
    while counts[STACK] > 0:
        if counts[SEARCHED] >= last:
            return SEARCH_PAUSED
        if (
            counts[STACK] + _SPARE > search.stack_low.shape[0]
            or counts[PIECES_FOUND] == search.piece_low.shape[0]
            or counts[BOXES_LEFT] == search.left_low.shape[0]
        ):
            return SEARCH_FULL
        _take(search, space.box)
        counts[SEARCHED] += 1
        _search_box(program, rules, search, space)
    return SEARCH_FINISHED


@unfused_kernel
def _take(search, box):  # type: ignore[no-untyped-def]
    search.counts[STACK] -= 1
    row = search.counts[STACK]
    for j in range(box.low.shape[0]):
        box.low[j], box.high[j] = search.stack_low[row, j], search.stack_high[row, j]


@unfused_kernel
def _append(low, high, counts, table, box):  # type: ignore[no-untyped-def]
    """Append a box to one of the tables."""
    row = counts[table]
    for j in range(box.low.shape[0]):
        low[row, j], high[row, j] = box.low[j], box.high[j]
    counts[table] += 1


@unfused_kernel
def _search_box(program, rules, search, space):  # type: ignore[no-untyped-def]
    box, registers = space.box, space.registers
    if has_no_zero(program, registers, box):
        return
    slopes(program, registers, box)
    centre(program, registers, box)
    ratio = contract_by_rows(box, rules.fixed)
    if ratio < 0.0:
        return
    if 0.0 < ratio < BY_ROWS:
        _append(search.stack_low, search.stack_high, search.counts, STACK, box)
        return
    free = precondition(box, rules.unit, rules.fixed, space.operator)
    if free >= 0:
        if ratio < 1.0:
            # F' over the larger box remains valid
            centre(program, registers, box)
        found, ratio = _krawczyk(program, rules, space, free)
        if found == NO_ZERO:
            return
        if found == PROVED:
            _append_piece(search, space, free)
            return
        if 0.0 < ratio < BY_IMAGE:
            _append(search.stack_low, search.stack_high, search.counts, STACK, box)
            return
    _bisect(rules, search, box)


@unfused_kernel
def _krawczyk(program, rules, space, free):  # type: ignore[no-untyped-def]
    """Test a box, and return the result and the ratio of volumes by which it was contracted."""
    box, operator = space.box, space.operator
    norm = image(box, free, operator)
    inside = maps_inside(box, operator)
    ratio = contract_by_image(box, operator)
    if ratio < 0.0:
        return NO_ZERO, ratio
    if inside:
        return PROVED, ratio
    if norm < 1.0:
        return prove_on_larger_box(program, rules, space, free), ratio
    return OPEN, ratio


@unfused_kernel
def _append_piece(search, space, free):  # type: ignore[no-untyped-def]
    """Append the image of the proved box over the values of the free unknown."""
    row, operator, box = search.counts[PIECES_FOUND], space.operator, space.box
    search.free[row] = free
    search.piece_low[row, free], search.piece_high[row, free] = box.low[free], box.high[free]
    for a in range(operator.columns.shape[0]):
        j = operator.columns[a]
        search.piece_low[row, j], search.piece_high[row, j] = operator.low[a], operator.high[a]
    search.counts[PIECES_FOUND] += 1


@unfused_kernel
def _bisect(rules, search, box):  # type: ignore[no-untyped-def]
    """Divide a box at its widest unknown, or leave it if it has the smallest width."""
    widest, j = -1.0, -1
    for k in range(box.low.shape[0]):
        width = (box.high[k] - box.low[k]) / rules.unit[k]
        if k != rules.fixed and width > widest:
            widest, j = width, k
    if widest < rules.width:
        _append(search.left_low, search.left_high, search.counts, BOXES_LEFT, box)
        return
    low, high = box.low[j], box.high[j]
    cut, more = 0.5 * low + 0.5 * high, OVERLAP * (high - low)
    box.high[j] = cut + more
    _append(search.stack_low, search.stack_high, search.counts, STACK, box)
    box.low[j], box.high[j] = cut - more, high
    _append(search.stack_low, search.stack_high, search.counts, STACK, box)
