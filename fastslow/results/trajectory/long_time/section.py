"""Poincaré sections and stroboscopic sections of a trajectory."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.results.base.outcome import early_end
from fastslow.results.base.result import Result
from fastslow.results.base.table import Row, RowTable
from fastslow.results.trajectory.steps.dense import DenseOutput


@dataclass(frozen=True, eq=False, repr=False)
class Section(RowTable[Row], Result):
    """Points of a trajectory on a section.

    Parameters
    ----------
    rule : str
        The condition of the section, e.g. ``"v = 0 downwards"``.
    names : tuple of str
        Columns: states, slow states and, if known, slow quantities.
    t : ndarray, shape (K,)
    table : ndarray, shape (len(names), K)
        Every column at those times.
    directions : ndarray of int, shape (K,)
        +1 upwards, −1 downwards, 0 for a tangency; 0 throughout for a stroboscopic section.
    ended : str
        The outcome code of a run that ended early, else empty.
    """

    rule: str
    names: tuple[str, ...]
    t: NDArray[np.float64]
    table: NDArray[np.float64]
    directions: NDArray[np.int64]
    ended: str = ""

    _row = "t"
    _places = ("t",)

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Return time t, every column, and the direction."""
        columns = dict(zip(self.names, self.table, strict=True))
        return {"t": self.t, **columns, "direction": self.directions}

    def __len__(self) -> int:
        return len(self.t)

    def _words(self) -> Mapping[str, Collection[int]]:
        return {"direction": (-1, 0, 1)}

    def _rows(self, rows: slice | NDArray[np.intp]) -> Section:
        table, directions = self.table[:, rows], self.directions[rows]
        return replace(self, t=self.t[rows], table=table, directions=directions)

    def __repr__(self) -> str:
        when = f", t from {self.t[0]:.6g} to {self.t[-1]:.6g}" if len(self) else ""
        early = f"; the run ended early: {self.ended}" if self.ended else ""
        return f"Section {self.rule}: {len(self)} points of {', '.join(self.names)}{when}{early}"


def stroboscopic_section(
    dense: DenseOutput, period: float, phase: float, window: tuple[float, float]
) -> Section:
    """Return the states once every period; see `Trajectory.stroboscopic`."""
    first, last = window
    begin = dense.span[0] + phase * period
    # include the ends of a run of whole periods despite rounding
    slack = 1e-9
    lowest = math.ceil((first - begin) / period - slack)
    highest = math.floor((last - begin) / period + slack)
    times = np.clip(begin + period * np.arange(lowest, highest + 1), *dense.span)
    rule = f"every {period:.6g}" + (f" at phase {phase:.6g}" if phase else "")
    none = np.zeros(len(times), dtype=np.int64)
    table = np.array(dense.columns_at(times))
    return Section(rule, dense.columns, times, table, none, early_end(dense.outcome))


def level_section(dense: DenseOutput, expression: object, level: float) -> Section:
    """Return all points at a level of an expression, in any direction."""
    roots = dense.roots(expression, level)
    offset = roots.part * dense.steps[roots.step, 1]
    times, table = dense.steps[roots.step, 0] + offset, dense.evaluate(roots.step, offset)
    rule, ended = f"{expression} = {level:g}", early_end(dense.outcome)
    return Section(rule, dense.columns, times, table, roots.direction, ended)


def selected(found: Section, direction: int | None, window: tuple[float, float]) -> Section:
    """Return the points of a section in one direction and in a time interval."""
    kept = (found.t >= window[0]) & (found.t <= window[1])
    if direction is not None:
        kept &= found.directions == direction
    return replace(
        found,
        rule=found.rule + {1: " upwards", -1: " downwards", 0: " touching", None: ""}[direction],
        t=found.t[kept],
        table=found.table[:, kept],
        directions=found.directions[kept],
    )
