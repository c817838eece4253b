"""The slow quantity of a diagram along a run: a column, or the parameter of a path."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import ArgumentError, unknown_name
from fastslow.results.diagrams import Diagram
from fastslow.results.formulas import evaluated, names_in
from fastslow.results.trajectories import Trajectory

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
    """

    run: Trajectory
    states: tuple[str, ...]
    name: str
    laws: Mapping[str, str]
    constants: Mapping[str, float]
    table: Array

    @property
    def dense(self) -> bool:
        return self.run.series is not None and len(self.run.steps) > 0

    def at(self, times: Array) -> tuple[Array, Array]:
        """The parameter (N,) and the fast states (N, n) at times inside the run.

        Without dense output the samples are joined by straight lines.
        """
        names = self.run.columns
        if not self.dense:
            rows = [np.interp(times, self.run.t, self.run[n]) for n in self.states]
            return np.interp(times, self.run.t, self.table), np.column_stack(rows)
        columns = self.run.dense_columns(times)
        state = columns[[names.index(n) for n in self.states]].T
        if not self.laws:
            return columns[names.index(self.name)], state
        start = np.interp(times, self.run.t, self.table)
        wanted = np.array([columns[names.index(n)] for n in self.laws])
        return self._solved(start, wanted), state

    def _values(self, value: Array) -> Array:
        """The slow quantities on the path, shape (quantities, N)."""
        known = {**self.constants, self.name: value}
        laws = [evaluated(text, known) for text in self.laws.values()]
        return np.array([np.broadcast_to(law, value.shape) for law in laws])

    def _solved(self, start: Array, wanted: Array) -> Array:
        """Gauss-Newton for the point of the path nearest to the wanted quantities."""
        value = start.copy()
        unit = np.maximum(np.ptp(wanted, axis=1), 1e-12 * np.abs(wanted).max(axis=1))
        unit = np.where(unit > 0, unit, 1.0)[:, None]
        step = 1e-6 * max(float(np.ptp(self.table)) if len(self.table) else 0.0, 1e-3)
        for _ in range(8):
            rest = (wanted - self._values(value)) / unit
            slope = (self._values(value + step) - self._values(value - step)) / (2 * step * unit)
            square = (slope**2).sum(axis=0)
            moved = (slope * rest).sum(axis=0) / np.where(square > 0, square, np.inf)
            value = value + np.clip(np.nan_to_num(moved), -1e4 * step, 1e4 * step)
        return value


def slow_quantity(diagram: Diagram, run: Trajectory) -> SlowQuantity:
    """Find the parameter of a diagram among the columns of a run, or from the path.

    Raises
    ------
    UnknownNameError
        If the parameter is no slow quantity of the run.
    ArgumentError
        If the run leaves the path along which the model was frozen, or the path
        passes the same place twice along its whole length.
    """
    name = diagram.parameter
    quantities = (*run.forcing, *(s for s in run.states if s not in diagram.states))
    if name in quantities:
        return SlowQuantity(run, diagram.states, name, {}, {}, run[name])
    constants = {**run.parameters, **diagram.parameters}
    known = {**constants, name: 0.0}
    laws = {q: t for q, t in diagram.path.items() if name in names_in(t, known)}
    if not laws:
        raise unknown_name("slow quantity of the trajectory", name, quantities)
    # a quantity that is the parameter itself gives it without solving
    wanted = np.array([run[q] for q in laws])
    empty = SlowQuantity(run, diagram.states, name, laws, constants, np.zeros(0))
    low, high = diagram.over
    grid = np.linspace(low - 0.5 * (high - low), high + 0.5 * (high - low), TRIED)
    start = _nearest(grid, empty._values(grid), wanted, name)
    path = SlowQuantity(run, diagram.states, name, laws, constants, start)
    solved = path._solved(start, wanted)
    reach = np.maximum(np.ptp(wanted, axis=1), 1e-3 * np.abs(wanted).max(axis=1))
    off = np.abs(path._values(solved) - wanted).max(axis=1) / np.where(reach > 0, reach, 1.0)
    if not off.max() <= ON_PATH:
        worst = list(laws)[int(np.argmax(np.nan_to_num(off, nan=np.inf)))]
        raise ArgumentError(
            f"the trajectory leaves the path {worst} = {laws[worst]}, along which the model was "
            f"frozen, by {off.max():.2g} of the range of {worst}"
        )
    return SlowQuantity(run, diagram.states, name, laws, constants, solved)


def _nearest(grid: Array, curve: Array, wanted: Array, name: str) -> Array:
    """The value whose place on the path is nearest at each sample, followed in time."""
    unit = np.maximum(np.ptp(curve, axis=1), 1e-300)[:, None]
    curve, wanted = curve / unit, wanted / unit
    usable = np.isfinite(curve).all(axis=0)
    grid, curve = grid[usable], curve[:, usable]
    spacing = np.zeros(len(grid))
    gaps = np.linalg.norm(np.diff(curve, axis=1), axis=0)
    spacing[:-1], spacing[1:] = gaps, np.maximum(spacing[1:], gaps)
    found = np.empty(wanted.shape[1])
    twofold = 0
    last = None
    for k, place in enumerate(wanted.T):
        apart = np.linalg.norm(curve - place[:, None], axis=0)
        near = np.flatnonzero(apart <= apart.min() + 2 * spacing)
        twofold += len(near) > 1 and np.diff(near).max() > 8
        last = int(np.argmin(apart) if last is None else near[np.argmin(np.abs(near - last))])
        found[k] = grid[last]
    if twofold > 0.5 * len(found):
        raise ArgumentError(
            f"the path passes every place twice, so that the trajectory does not give {name}; "
            f"freeze along a path on which one slow quantity grows with {name}"
        )
    return found
