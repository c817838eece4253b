"""Branch and prune of the equations of one region over a window."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.certification.boxes.krawczyk import Box, Krawczyk, KrawczykSpace, Rules
from fastslow.certification.boxes.pruning_kernel import (
    BOXES_LEFT,
    PIECES_FOUND,
    SEARCH_FINISHED,
    SEARCH_FULL,
    SEARCHED,
    STACK,
    BoxSearch,
)
from fastslow.certification.loops import PRUNE
from fastslow.kernels.compiler.records import zeros
from fastslow.kernels.intervals.printer import IntervalProgram
from fastslow.kernels.loops import load_loop

Array = NDArray[np.float64]

#: Boxes between two pauses for signals: some hundredths of a second.
BOXES_BETWEEN_PAUSES = 4096

#: Rows of the tables of pieces and of boxes left between two copies, and boxes on the stack: the
#: search is depth first, so that the stack is as long as boxes are divided often.
CAPACITY, TABLE_ROWS = 2048, 65_536

#: The boxes left at the first of these widths, in units of the window, are searched again down to
#: smaller and smaller widths.
WIDEST, NARROWER = 1e-2, 10.0

#: Numbers of boxes left that are not searched again: too many, or many of which each leaves
#: several smaller ones. They are not near some points but near a curve, such as a pole, which no
#: width resolves.
MOST_LEFT, MANY_LEFT, BOXES_PER_BOX = 50_000, 200, 5.0


@dataclass(frozen=True, eq=False)
class Pruned:
    """Result of a search.

    Parameters
    ----------
    low, high : ndarray, shape (m, N)
        Pieces: boxes with exactly one solution for each value of their free unknown.
    free : ndarray of int, shape (m,)
    left_low, left_high : ndarray, shape (k, N)
        Small boxes in which nothing is proved.
    open_low, open_high : ndarray, shape (l, N)
        Boxes that were not searched.
    searched : int
        Number of boxes searched.
    interrupted : bool
    """

    low: Array
    high: Array
    free: NDArray[np.int64]
    left_low: Array
    left_high: Array
    open_low: Array
    open_high: Array
    searched: int
    interrupted: bool = False

    @property
    def complete(self) -> bool:
        """True if nothing is left."""
        return not len(self.left_low) and not len(self.open_low)


def workspace(program: IntervalProgram) -> KrawczykSpace:
    """Return the workspace of the search for a program."""
    n, width = program.program.slopes.shape
    box, larger = (zeros(Box, *(width,) * 3, n, n, *((n, width),) * 2) for _ in range(2))
    operator = zeros(Krawczyk, (n, width + n), (n, n), n, width, width, n, n)
    return KrawczykSpace(program.registers(), box, larger, operator)


def prune_window(
    program: IntervalProgram,
    low: Array,
    high: Array,
    *,
    max_boxes: int,
    width: float,
    fixed: int = -1,
) -> Pruned:
    """Search a window for all solutions.

    Parameters
    ----------
    program : IntervalProgram
        n functions of N = n + 1 unknowns.
    low, high : ndarray, shape (N,)
        The window.
    max_boxes : int
    width : float
        Smallest width of a box, in units of the window; boxes at poles and other sets that are
        not isolated points are left at a larger width.
    fixed : int, optional
        An unknown of one value, which is not free.

    Returns
    -------
    Pruned
    """
    size = len(low)
    tables = ((CAPACITY, size),) * 2
    search = zeros(BoxSearch, (TABLE_ROWS, size), (TABLE_ROWS, size), *tables, CAPACITY, *tables, 4)
    search.stack_low[0], search.stack_high[0] = low, high
    search.counts[STACK] = 1
    extent = np.asarray(high, dtype=float) - low
    unit = np.where(extent > 0, extent, 1.0)
    prune, space = load_loop(PRUNE), workspace(program)
    collected = _Collected(search)
    interrupted, smallest, before = False, max(width, WIDEST), math.inf
    try:
        while True:
            rules = Rules(unit, fixed, smallest)
            _run(prune, program.program, rules, search, space, max_boxes, collected)
            collected.take()
            count = len(collected.left()[0])
            growing = count > MANY_LEFT and count > BOXES_PER_BOX * before
            if search.counts[STACK] or not 0 < count <= MOST_LEFT or growing or smallest <= width:
                break
            before = count
            collected.return_left()
            smallest = max(width, smallest / NARROWER)
    except KeyboardInterrupt:
        interrupted = True
        collected.take()
    waiting = search.counts[STACK]
    return Pruned(
        *collected.pieces(),
        *collected.left(),
        search.stack_low[:waiting].copy(),
        search.stack_high[:waiting].copy(),
        int(search.counts[SEARCHED]),
        interrupted,
    )


class _Collected:
    """Results copied from the tables of a search, which are then empty."""

    def __init__(self, search: BoxSearch) -> None:
        size = search.stack_low.shape[1]
        self.search = search
        self._pieces = [(np.empty((0, size)), np.empty((0, size)), np.empty(0, dtype=np.int64))]
        self._left = [(np.empty((0, size)), np.empty((0, size)))]

    def take(self) -> None:
        """Copy the tables of pieces and of boxes left."""
        search, counts = self.search, self.search.counts
        m, k = counts[PIECES_FOUND], counts[BOXES_LEFT]
        tables = search.piece_low, search.piece_high, search.free
        self._pieces.append(tuple(table[:m].copy() for table in tables))  # type: ignore[arg-type]
        self._left.append((search.left_low[:k].copy(), search.left_high[:k].copy()))
        counts[PIECES_FOUND] = counts[BOXES_LEFT] = 0

    def pieces(self) -> tuple[Array, Array, NDArray[np.int64]]:
        """Return the bounds of all pieces and their free unknowns."""
        low, high, free = (np.concatenate(columns) for columns in zip(*self._pieces, strict=True))
        return low, high, free

    def left(self) -> tuple[Array, Array]:
        """Return the bounds of all boxes left."""
        low, high = (np.concatenate(columns) for columns in zip(*self._left, strict=True))
        return low, high

    def return_left(self) -> None:
        """Search the boxes left again, down to a smaller width."""
        low, high = self.left()
        self.search.stack_low[: len(low)], self.search.stack_high[: len(low)] = low, high
        self.search.counts[STACK] = len(low)
        self._left = self._left[:1]


def _run(
    prune: Callable[..., Any],
    program: Any,
    rules: Rules,
    search: BoxSearch,
    space: KrawczykSpace,
    max_boxes: int,
    collected: _Collected,
) -> None:
    while True:
        budget = min(BOXES_BETWEEN_PAUSES, max_boxes - int(search.counts[SEARCHED]))
        if budget <= 0:
            return
        state = prune(program, rules, search, space, budget)
        if state == SEARCH_FINISHED:
            return
        if state == SEARCH_FULL:
            collected.take()
            if search.counts[STACK] + 2 > TABLE_ROWS:
                return
