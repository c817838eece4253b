"""Branch and prune of the equations of one region over a window."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.certification.krawczyk import Box, Krawczyk, Rules, Space
from fastslow.certification.loops import PRUNE
from fastslow.certification.pruning_kernel import (
    FINISHED,
    FULL,
    LEFT,
    PIECES,
    SEARCHED,
    STACK,
    Search,
)
from fastslow.kernels.intervals.printer import IntervalProgram
from fastslow.kernels.loops import load_loop
from fastslow.kernels.records import zeros

Array = NDArray[np.float64]

#: Boxes between two pauses for signals: some hundredths of a second.
BUDGET = 4096

#: Rows of the tables of pieces and of boxes left between two copies, and boxes on the stack: the
#: search is depth first, so that the stack is as long as boxes are divided often.
CAPACITY, DEPTH = 2048, 8192


@dataclass(frozen=True, eq=False)
class Pruned:
    """Result of a search.

    Parameters
    ----------
    low, high : ndarray, shape (m, N)
        Pieces: boxes with exactly one solution for each value of their free unknown.
    free : ndarray of int, shape (m,)
    left_low, left_high : ndarray, shape (k, N)
        Boxes of the smallest width, in which nothing is proved.
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


def workspace(program: IntervalProgram) -> Space:
    """Return the workspace of the search for a program."""
    n, width = program.program.slopes.shape
    box, larger = (zeros(Box, *(width,) * 3, n, n, *((n, width),) * 2) for _ in range(2))
    operator = zeros(Krawczyk, (n, width + n), (n, n), n, width, width, n, n)
    return Space(program.registers(), box, larger, operator)


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
        Smallest width of a box, in units of the window.
    fixed : int, optional
        An unknown of one value, which is not free.

    Returns
    -------
    Pruned
    """
    size = len(low)
    tables = ((CAPACITY, size),) * 2
    search = zeros(Search, (DEPTH, size), (DEPTH, size), *tables, CAPACITY, *tables, 4)
    search.stack_low[0], search.stack_high[0] = low, high
    search.counts[STACK] = 1
    extent = np.asarray(high, dtype=float) - low
    rules = Rules(np.where(extent > 0, extent, 1.0), fixed, width)
    prune, space = load_loop(PRUNE), workspace(program)
    collected = _Collected(search)
    interrupted = False
    try:
        _run(prune, program.program, rules, search, space, max_boxes, collected)
    except KeyboardInterrupt:
        interrupted = True
    collected.take()
    pieces, free, left = collected.pieces, collected.free, collected.left
    waiting = search.counts[STACK]
    return Pruned(
        np.concatenate([p[0] for p in pieces]),
        np.concatenate([p[1] for p in pieces]),
        np.concatenate(free),
        np.concatenate([b[0] for b in left]),
        np.concatenate([b[1] for b in left]),
        search.stack_low[:waiting].copy(),
        search.stack_high[:waiting].copy(),
        int(search.counts[SEARCHED]),
        interrupted,
    )


class _Collected:
    """Results copied from the tables of a search, which are then empty."""

    def __init__(self, search: Search) -> None:
        self.search = search
        self.pieces: list[tuple[Array, Array]] = []
        self.free: list[NDArray[np.int64]] = []
        self.left: list[tuple[Array, Array]] = []

    def take(self) -> None:
        search, counts = self.search, self.search.counts
        m, k = counts[PIECES], counts[LEFT]
        self.pieces.append((search.piece_low[:m].copy(), search.piece_high[:m].copy()))
        self.free.append(search.free[:m].copy())
        self.left.append((search.left_low[:k].copy(), search.left_high[:k].copy()))
        counts[PIECES] = counts[LEFT] = 0


def _run(
    prune: Callable[..., Any],
    program: Any,
    rules: Rules,
    search: Search,
    space: Space,
    max_boxes: int,
    collected: _Collected,
) -> None:
    while True:
        budget = min(BUDGET, max_boxes - int(search.counts[SEARCHED]))
        if budget <= 0:
            return
        state = prune(program, rules, search, space, budget)
        if state == FINISHED:
            return
        if state == FULL:
            collected.take()
            if search.counts[STACK] + 2 > DEPTH:
                return
