"""Poincaré sections and stroboscopic sections of a trajectory."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import ArgumentError, unknown_name
from fastslow.results.base.outcome import early_end
from fastslow.results.base.result import Result
from fastslow.results.base.table import RowTable
from fastslow.results.trajectory.dense import evaluate
from fastslow.results.trajectory.step_polynomials import StepPolynomials, along_steps
from fastslow.results.trajectory.step_roots import StepRoots, find_roots

if TYPE_CHECKING:
    from fastslow.results.trajectory.trajectory import Trajectory


@dataclass(frozen=True, eq=False, repr=False)
class Section(RowTable, Result):
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


def window_of(
    run: Trajectory, since: float | None = None, until: float | None = None
) -> tuple[float, float]:
    """Validate a time interval, by default that of the run.

    Raises
    ------
    ArgumentError
        For times outside the run, or in the wrong order.
    """
    low, high = run.span
    first = low if since is None else since
    last = high if until is None else until
    if not low <= first <= high:
        raise ArgumentError(f"since = {first:g} is outside the run, which is [{low:g}, {high:g}]")
    if not first <= last <= high:
        raise ArgumentError(f"until = {last:g}; expected a time from {first:g} to {high:g}")
    return first, last


def period_of(run: Trajectory, period: float | None) -> float:
    """Return the given period, else that of the forcing.

    Raises
    ------
    ArgumentError
        Without either.
    """
    if period is None:
        period = run.period
    if period is None:
        raise ArgumentError("this run has no forcing with a common period; give period=")
    return period


def stroboscopic_section(
    run: Trajectory, period: float | None, phase: float, since: float | None
) -> Section:
    """Return the states once every period; see `Trajectory.stroboscopic`."""
    length = period_of(run, period)
    first, last = window_of(run, since)
    begin = run.span[0] + phase
    # include the ends of a run of whole periods despite rounding
    slack = 1e-9
    lowest = math.ceil((first - begin) / length - slack)
    highest = math.floor((last - begin) / length + slack)
    times = np.clip(begin + length * np.arange(lowest, highest + 1), *run.span)
    rule = f"every {length:.6g}" + (f" at phase {phase:.6g}" if phase else "")
    table = run.dense_columns(times)
    none = np.zeros(len(times), dtype=np.int64)
    return Section(rule, run.columns, times, table, none, early_end(run))


def poincare_section(
    run: Trajectory,
    expression: object,
    level: float,
    direction: int | None,
    interface: object,
    window: tuple[float, float],
) -> Section:
    """Return the points at a level or on an interface; see `Trajectory.section`."""
    if (expression is None) == (interface is None):
        received = "both" if interface is not None else "neither"
        raise ArgumentError(
            f"expected an expression with its level, or interface=, received {received}"
        )
    if interface is None:
        found = _on_level(run, expression, float(level))
        rule = f"{expression} = {level:g}"
    else:
        found = _on_interface(run, interface)
        rule = f"{interface} = 0"
    rule += {1: " upwards", -1: " downwards", 0: " touching", None: ""}[direction]
    kept = (found.t >= window[0]) & (found.t <= window[1])
    if direction is not None:
        kept &= found.directions == direction
    return Section(
        rule,
        found.names,
        found.t[kept],
        found.table[:, kept],
        found.directions[kept],
        early_end(run),
    )


def _on_level(run: Trajectory, expression: object, level: float) -> Section:
    line = along_steps(run, expression)
    period = run.periods.get(str(expression))
    roots = find_roots(line.minus(level)) if period is None else _modulo(line, level, period)
    offset = roots.part * run.steps[roots.step, 1]
    table = evaluate(run, roots.step, offset)
    times = run.steps[roots.step, 0] + offset
    return Section("", run.columns, times, table, roots.direction)


def _modulo(line: StepPolynomials, level: float, period: float) -> StepRoots:
    """Return the roots of a periodic quantity at a level, modulo its period.

    The steps near each copy of the level, shifted by whole periods, follow those near
    the previous copy, joined by a linear step whose roots are discarded.
    """
    c = line.coefficients
    count = len(c)
    moved = np.abs(c[:, 1:]).sum(axis=1) + 1e-9 * period
    low = np.ceil((c[:, 0] - moved - level) / period)
    high = np.floor((c[:, 0] + moved - level) / period)
    # including their neighbours, so that a root between two steps is detected from both
    first, last = low.copy(), high.copy()
    for shifted, source in ((slice(1, None), slice(-1)), (slice(-1), slice(1, None))):
        first[shifted] = np.minimum(first[shifted], low[source])
        last[shifted] = np.maximum(last[shifted], high[source])
    copies = np.maximum(last - first + 1, 0).astype(np.intp)
    step = np.repeat(np.arange(count), copies)
    turn = first[step] + np.arange(len(step)) - np.repeat(np.cumsum(copies) - copies, copies)
    order = np.lexsort((step, turn))
    step, turn = step[order], turn[order]
    if not len(step):
        return StepRoots(step, np.empty(0), np.empty(0, dtype=np.int64))
    rows = c[step].copy()
    rows[:, 0] -= level + period * turn
    size = line.size[step] + np.abs(level + period * turn)
    gaps = np.flatnonzero((np.diff(step) != 1) | (np.diff(turn) != 0)) + 1
    between = np.zeros((len(gaps), c.shape[1]))
    between[:, 0] = rows[gaps - 1].sum(axis=1)
    between[:, 1] = rows[gaps, 0] - between[:, 0]
    rows, size = np.insert(rows, gaps, between, axis=0), np.insert(size, gaps, size[gaps])
    number = np.insert(step, gaps, -1)
    roots = find_roots(StepPolynomials(rows, size))
    found = number[roots.step]
    kept = (found >= 0) & ~((found == 0) & (roots.part == 0.0))
    order = np.lexsort((roots.part[kept], found[kept]))
    return StepRoots(found[kept][order], roots.part[kept][order], roots.direction[kept][order])


def _on_interface(run: Trajectory, interface: object) -> Section:
    if str(interface) not in run.interfaces:
        raise unknown_name("interface", interface, run.interfaces)
    mine = run.crossing_table[run.crossing_table[:, 1] == run.interfaces.index(str(interface))]
    times, states = mine[:, 0], mine[:, 6:].T
    names, table = run.states, states
    if run.series is not None:
        # states projected onto the interface, slow quantities from the series
        slow = run.dense_columns(times)[len(run.states) :]
        names, table = run.columns, np.vstack([states, slow])
    return Section("", names, times, table, mine[:, 2].astype(np.int64))
