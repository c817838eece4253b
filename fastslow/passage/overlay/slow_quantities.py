"""The slow quantity of a diagram along a run: a column, or the parameter of a path."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import ArgumentError, unknown_name
from fastslow.formulas.columns import evaluated, names_in
from fastslow.kernels.loops import load_loop
from fastslow.passage.loops import STEP_VALUES
from fastslow.results.branch.diagram import Diagram
from fastslow.results.trajectory.dense import columns_at
from fastslow.results.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]

#: Values of a path's parameter that are tried for each sample.
TRIED = 2001

#: A run lies on a path when it is no farther from it than this part of each quantity's range.
ON_PATH = 1e-6


@dataclass(frozen=True, eq=False)
class SlowQuantity:
    """How the parameter of a diagram is read off a run.

    Parameters
    ----------
    run : Trajectory
    states : tuple of str
        The fast states, in the diagram's order.
    name : str
        The parameter.
    laws : mapping
        Slow quantity to its text in the parameter; empty where the parameter is a column.
    constants : mapping
        Values of what else stands in the laws.
    table : ndarray, shape (N,)
        The parameter at the samples of the run.
    spacing : float
        How finely the path was tried.
    bounds : tuple of float
        The range of the diagram.
    """

    run: Trajectory
    states: tuple[str, ...]
    name: str
    laws: Mapping[str, str]
    constants: Mapping[str, float]
    table: Array
    spacing: float = 0.0
    bounds: tuple[float, float] = (-np.inf, np.inf)

    @property
    def dense(self) -> bool:
        return self.run.series is not None and len(self.run.steps) > 0

    @property
    def responds(self) -> bool:
        """Whether it is a slow state, which the fast states drive back."""
        return any(name in self.run.states for name in (self.laws or [self.name]))

    def at(self, times: Array) -> tuple[Array, Array]:
        """The parameter (N,) and the fast states (N, n) at times inside the run.

        Without dense output the samples are joined by straight lines.
        """
        if not self.dense:
            rows = [np.interp(times, self.run.t, self.run[n]) for n in self.states]
            return np.interp(times, self.run.t, self.table), np.column_stack(rows)
        run, names = self.run, self.run.columns
        columns = np.empty((len(names), len(times)))
        if load_loop(STEP_VALUES)(run.series, run.step_starts, *run.span, times, columns):
            # says which of the times is outside the run
            columns = columns_at(run, times)
        state = columns[self._rows].T
        if not self.laws:
            return columns[names.index(self.name)], state
        start = np.interp(times, self.run.t, self.table)
        wanted = np.array([columns[names.index(n)] for n in self.laws])
        return self._solved(start, wanted), state

    @cached_property
    def _rows(self) -> list[int]:
        """Of the fast states among the columns of the run."""
        return [self.run.columns.index(n) for n in self.states]

    def _values(self, value: Array) -> Array:
        """The slow quantities on the path, shape (quantities, N)."""
        known = {**self.constants, self.name: value}
        laws = [evaluated(text, known) for text in self.laws.values()]
        return np.array([np.broadcast_to(law, value.shape) for law in laws])

    def _solved(self, start: Array, wanted: Array) -> Array:
        """The point of the path nearest to the wanted quantities, beside a start.

        In the range of the diagram where there is one: a path that turns at an end of it
        goes through the same places beyond.
        """
        inside = self._searched(start, wanted, self.bounds)
        reach = np.maximum(np.ptp(wanted, axis=1), 1e-3 * np.abs(wanted).max(axis=1))[:, None]
        off = np.abs(self._values(inside) - wanted) > 0.1 * ON_PATH * reach
        return np.where(off.any(axis=0), self._searched(start, wanted, None), inside)

    def _searched(self, start: Array, wanted: Array, bounds: tuple[float, float] | None) -> Array:
        """The nearest point of the path beside a start, within bounds.

        A search in ever shorter steps, since Newton's leaps away where the path
        turns, and then Newton to rounding.
        """
        unit = np.maximum(np.ptp(wanted, axis=1), 1e-12 * np.abs(wanted).max(axis=1))
        unit = np.where(unit > 0, unit, 1.0)[:, None]
        low, high = bounds or (-np.inf, np.inf)
        value = np.clip(start, low, high)
        rest = (wanted - self._values(value)) / unit
        reach = self.spacing
        for _ in range(14):
            for side in (-1.0, -0.5, 0.5, 1.0):
                tried = np.clip(value + side * reach, low, high)
                value, rest = self._better(value, rest, tried, wanted, unit)
            reach *= 0.4
        step = 1e-4 * self.spacing
        for _ in range(6):
            slope = (self._values(value + step) - self._values(value - step)) / (2 * step * unit)
            square = (slope**2).sum(axis=0)
            moved = (slope * rest).sum(axis=0) / np.where(square > 0, square, np.inf)
            tried = np.clip(value + np.nan_to_num(moved), low, high)
            value, rest = self._better(value, rest, tried, wanted, unit)
        return value

    def _better(
        self, value: Array, rest: Array, tried: Array, wanted: Array, unit: Array
    ) -> tuple[Array, Array]:
        """Values and what is left there, or others where less is left."""
        left = (wanted - self._values(tried)) / unit
        better = (left**2).sum(axis=0) < (rest**2).sum(axis=0)
        return np.where(better, tried, value), np.where(better, left, rest)


def slow_quantity(diagram: Diagram, run: Trajectory) -> SlowQuantity:
    """Find the parameter of a diagram among the columns of a run, or from the path.

    Raises
    ------
    UnknownNameError
        If the parameter is no slow quantity of the run.
    ArgumentError
        If nothing varies slowly in the run, it leaves the path along which the model was
        frozen, or the path passes the same place twice along its whole length.
    """
    name = diagram.parameter
    quantities = (*run.forcing, *(s for s in run.states if s not in diagram.states))
    if name in quantities:
        return SlowQuantity(run, diagram.states, name, {}, {}, run[name])
    constants = {**run.parameters, **diagram.parameters}
    known = {**constants, name: 0.0}
    laws = {q: t for q, t in diagram.path.items() if name in names_in(t, known)}
    if not laws and not quantities:
        raise ArgumentError(
            f"nothing varies slowly in this run, and the diagram is over {name}; run a model "
            f"with forcing={{{name}: ...}} or slow={{{name}: ...}}"
        )
    if not laws:
        raise unknown_name("slow quantity of the trajectory", name, quantities)
    wanted = np.array([run[q] for q in laws])
    low, high = diagram.over
    grid = np.linspace(low - 0.5 * (high - low), high + 0.5 * (high - low), TRIED)
    spacing = float(grid[1] - grid[0])
    empty = SlowQuantity(
        run, diagram.states, name, laws, constants, np.zeros(0), spacing, diagram.over
    )
    start = _nearest(grid, empty._values(grid), wanted, diagram)
    solved = empty._solved(start, wanted)
    reach = np.maximum(np.ptp(wanted, axis=1), 1e-3 * np.abs(wanted).max(axis=1))
    off = np.abs(empty._values(solved) - wanted).max(axis=1) / np.where(reach > 0, reach, 1.0)
    if not off.max() <= ON_PATH:
        worst = list(laws)[int(np.argmax(np.nan_to_num(off, nan=np.inf)))]
        raise ArgumentError(
            f"the trajectory leaves the path {worst} = {laws[worst]}, along which the model was "
            f"frozen, by {off.max():.2g} of the range of {worst}"
        )
    return replace(empty, table=solved)


def _nearest(grid: Array, curve: Array, wanted: Array, diagram: Diagram) -> Array:
    """The value whose place on the path is nearest at each sample, followed in time.

    Values in the range of the diagram come first: beyond it a path may come back to itself.
    """
    unit = np.maximum(np.ptp(curve, axis=1), 1e-300)[:, None]
    curve, wanted = curve / unit, wanted / unit
    usable = np.isfinite(curve).all(axis=0)
    grid, curve = grid[usable], curve[:, usable]
    spacing = np.zeros(len(grid))
    gaps = np.linalg.norm(np.diff(curve, axis=1), axis=0)
    spacing[:-1], spacing[1:] = gaps, np.maximum(spacing[1:], gaps)
    inside = (grid >= diagram.over[0]) & (grid <= diagram.over[1])
    found = np.empty(wanted.shape[1])
    twofold = 0
    last = None
    for k, place in enumerate(wanted.T):
        apart = np.linalg.norm(curve - place[:, None], axis=0)
        near = np.flatnonzero(apart <= apart.min() + 2 * spacing)
        near = near[inside[near]] if inside[near].any() else near
        twofold += len(near) > 1 and np.diff(near).max() > 8
        order = apart[near] if last is None else np.abs(near - last)
        last = int(near[np.argmin(order)])
        found[k] = grid[last]
    if twofold > 0.5 * len(found):
        raise ArgumentError(
            f"the path passes every place twice, so that the trajectory does not give "
            f"{diagram.parameter}; freeze along a path on which one slow quantity grows with it"
        )
    return found
