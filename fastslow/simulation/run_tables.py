"""Tables that the stepping loop fills in one run, and what a thread keeps from run to run."""

from __future__ import annotations

import math
import threading
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastslow.simulation.stepper.driver import events_at_once
from fastslow.simulation.stepper.problems import Problem
from fastslow.simulation.stepper.workspace import (
    CROSSINGS,
    RESETS,
    STEPS,
    StepWorkspace,
    workspace_for,
)

#: Numbers copied at a time, and minimum and maximum initial size of a table.
_BLOCK, _LEAST, _MOST = 2**22, 2**12, 2**23

#: Bytes of a table of one run, which is copied from one of half the size.
MOST_BYTES = 2**30


class RunTables(NamedTuple):
    """Tables that `integrate` fills: steps, crossings, resets, and the series of all steps.

    Changes of switches are in the table of resets.
    """

    steps: NDArray[np.float64]
    crossings: NDArray[np.float64]
    resets: NDArray[np.float64]
    store: NDArray[np.float64]

    def filled(self, counted: NDArray[np.int64], stride: int) -> tuple[int, int, int, int]:
        """Numbers of filled rows, with `stride` coefficients for each step."""
        steps = int(counted[STEPS])
        return steps, int(counted[CROSSINGS]), int(counted[RESETS]), steps * stride

    def with_space(
        self, counted: NDArray[np.int64], problem: Problem, stride: int
    ) -> RunTables | None:
        """Tables with space for another step, a crossing of every interface, and some resets.

        None if they would be larger than `MOST_BYTES`.
        """
        needed = (1, problem.n_interfaces, events_at_once(problem), stride)
        found = []
        for table, used, more in zip(self, self.filled(counted, stride), needed, strict=True):
            larger = table if used + more <= len(table) else _larger(table, used, more)
            if larger is None:
                return None
            found.append(larger)
        return RunTables(*found)


def _larger(table: NDArray[np.float64], used: int, more: int) -> NDArray[np.float64] | None:
    """A copy with space for twice as many rows, made in blocks; None if it is too large."""
    allowed = MOST_BYTES // (table.itemsize * math.prod(table.shape[1:]))
    length = min(2 * len(table) + more, allowed)
    if length < used + more:
        return None
    copy = np.empty((length, *table.shape[1:]))
    rows = max(1, _BLOCK // math.prod(table.shape[1:]))
    for first in range(0, used, rows):
        last = min(first + rows, used)
        copy[first:last] = table[first:last]
    return copy


class RunMemory(threading.local):
    """Memory shared by the runs of a thread: work space, and the sizes of the last tables."""

    def __init__(self) -> None:
        self.kept = (0, 0, 0, 0)
        self.sizes = (_LEAST, _LEAST, _LEAST, _LEAST)
        self.workspaces: dict[tuple[int, ...], StepWorkspace] = {}

    def workspace(self, shape: tuple[int, ...], problem: Problem, n_rows: int) -> StepWorkspace:
        """Take the work space of a shape, for a series of so many rows; the run puts it back."""
        found = self.workspaces.pop(shape, None)
        if found is None:
            # limits the memory with many models
            self.workspaces.clear()
            found = workspace_for(problem, n_rows)
        return found

    def tables(self, problem: Problem, stride: int) -> RunTables:
        """Allocate tables of the sizes of the last run."""
        n_states, least = problem.n_states, events_at_once(problem)
        steps, crossings, resets, store = self.sizes
        # an empty store means no dense output
        return RunTables(
            np.empty((steps // 4, 4)),
            np.empty((crossings // (6 + n_states), 6 + n_states)),
            np.empty((max(resets // (2 + 2 * n_states), least), 2 + 2 * n_states)),
            np.empty(store if stride else 0),
        )

    def filled(self, tables: RunTables, counted: NDArray[np.int64], stride: int) -> RunTables:
        """Truncate the tables in place to their filled rows."""
        for table, used in zip(tables, tables.filled(counted, stride), strict=True):
            table.resize((used, *table.shape[1:]), refcheck=False)
            table.flags.writeable = False
        kept = (tables.steps.size, tables.crossings.size, tables.resets.size, tables.store.size)
        if kept != self.kept:
            steps, crossings, resets, store = (min(max(n + n // 8, _LEAST), _MOST) for n in kept)
            self.kept, self.sizes = kept, (steps, crossings, resets, store)
        return tables
