"""Slow quantity of a diagram along a run: a column, or the parameter of a path."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import ArgumentError, unknown_name
from fastslow.formulas.columns import evaluation, names_in
from fastslow.kernels.loops import load_loop
from fastslow.results.trajectory.trajectory import Trajectory
from fastslow.simulation.loops import STEP_VALUES

Array = NDArray[np.float64]

#: Number of values of a path's parameter that are tried for each sample.
TRIED = 2001

#: Largest distance of a run from a path, relative to the range of each quantity.
ON_PATH = 1e-6

#: Difference of the times of two rows at a jump, and least change of the slow quantity there,
#: as fractions of those of the run.
JUMP_DURATION, JUMP_CHANGE = 1e-10, 1e-9


@dataclass(frozen=True, eq=False)
class SlowQuantity:
    """Evaluation of the parameter of a diagram along a run.

    Parameters
    ----------
    run : Trajectory
    states : tuple of str
        The fast states, in the diagram's order.
    name : str
        Name of the parameter.
    laws : mapping
        Slow quantity to its formula in the parameter; empty if the parameter is a column.
    constants : mapping
        Values of the other symbols in the formulas.
    table : ndarray, shape (N,)
        The parameter at the samples of the run.
    spacing : float
        Spacing of the values tried along the path.
    bounds : tuple of float
        Range of the diagram.
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
        """Whether it is a slow state, with feedback from the fast states."""
        return any(name in self.run.states for name in (self.laws or [self.name]))

    def at(self, times: Array) -> tuple[Array, Array]:
        """The parameter (N,) and the fast states (N, n) at times inside the run.

        Without dense output the samples are interpolated linearly.
        """
        if not self.dense:
            rows = [np.interp(times, self.run.t, self.run[n]) for n in self.states]
            return np.interp(times, self.run.t, self.table), np.column_stack(rows)
        run, names = self.run, self.run.columns
        columns = np.empty((len(names), len(times)))
        if load_loop(STEP_VALUES)(run.series, run.step_starts, *run.span, times, columns):
            # raises for the times outside the run
            columns = run.dense_columns(times)
        state = columns[self._rows].T
        if not self.laws:
            return columns[names.index(self.name)], state
        start = np.interp(times, self.run.t, self.table)
        wanted = np.array([columns[names.index(n)] for n in self.laws])
        return self._solved(start, wanted), state

    @cached_property
    def _rows(self) -> list[int]:
        """Indices of the fast states among the columns of the run."""
        return [self.run.columns.index(n) for n in self.states]

    def _values(self, value: Array) -> Array:
        """Slow quantities on the path, shape (quantities, N)."""
        known = {**self.constants, self.name: value}
        return np.array([np.broadcast_to(law(known), value.shape) for law in self._formulas])

    @cached_property
    def _formulas(self) -> list[Callable[[Mapping[str, Any]], Array]]:
        """Evaluation of each slow quantity, of which every root of a run takes thousands."""
        names = (*self.constants, self.name)
        return [evaluation(text, names) for text in self.laws.values()]

    def _solved(self, start: Array, wanted: Array) -> Array:
        """Point of the path nearest to the given quantities, close to an initial value.

        A point in the range of the diagram is preferred: a path that reverses at the end of
        the range passes the same values beyond.
        """
        inside = self._searched(start, wanted, self.bounds)
        reach = np.maximum(np.ptp(wanted, axis=1), 1e-3 * np.abs(wanted).max(axis=1))[:, None]
        off = np.abs(self._values(inside) - wanted) > 0.1 * ON_PATH * reach
        if not off.any():
            return inside
        return np.where(off.any(axis=0), self._searched(start, wanted, None), inside)

    def _searched(self, start: Array, wanted: Array, bounds: tuple[float, float] | None) -> Array:
        """Nearest point of the path close to an initial value, within bounds.

        A pattern search with decreasing steps, as Newton's method diverges where the path
        reverses, followed by Newton's method up to rounding.
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
        """Values and residuals, replaced where the tried ones have smaller residuals."""
        left = (wanted - self._values(tried)) / unit
        better = (left**2).sum(axis=0) < (rest**2).sum(axis=0)
        return np.where(better, tried, value), np.where(better, left, rest)


class FrozenResult(Protocol):
    """A diagram, or what is known of branches of orbits: results of a frozen model."""

    @property
    def parameter(self) -> str: ...
    @property
    def states(self) -> tuple[str, ...]: ...
    @property
    def over(self) -> tuple[float, float]: ...
    @property
    def parameters(self) -> Mapping[str, float]: ...
    @property
    def path(self) -> Mapping[str, str]: ...


def slow_quantity(diagram: FrozenResult, run: Trajectory) -> SlowQuantity:
    """Evaluate the parameter of a diagram along a run, from a column or from the path.

    Raises
    ------
    UnknownNameError
        If the parameter is no slow quantity of the run.
    ArgumentError
        If the run has no slow quantity or leaves the path along which the model was frozen,
        or the path takes every value twice.
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
            f"this run has no slow quantity, and the diagram is over {name}; simulate a model "
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


def _nearest(grid: Array, curve: Array, wanted: Array, diagram: FrozenResult) -> Array:
    """Value of the nearest point on the path at each sample, continuous in time.

    Values in the range of the diagram are preferred, as a path may reverse beyond it.
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
            f"the path takes every value twice, so that {diagram.parameter} is ambiguous along the "
            "trajectory; freeze along a path on which one slow quantity is monotone in it"
        )
    return found


def rates_and_jumps(time: Array, slow: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Rate of the slow quantity, zero if it varies by rounding only, and rows next to its jumps.

    At a jump of a load two rows share their time, to rounding.
    """
    jumps, rates = np.zeros(len(time), dtype=bool), np.zeros(len(time))
    if len(time) < 2 or np.ptp(slow) <= 1e-9 * float(np.abs(slow).max()):
        return rates, jumps
    together = np.diff(time) <= JUMP_DURATION * (time[-1] - time[0])
    far = np.flatnonzero(together & (np.abs(np.diff(slow)) > JUMP_CHANGE * np.ptp(slow)))
    jumps[far] = jumps[far + 1] = True
    for rows in np.split(np.arange(len(time)), far + 1):
        # where a state grows without bound, samples may share their time
        apart = rows[np.r_[True, np.diff(time[rows]) > 0]]
        if len(apart) > 1:
            slopes = np.gradient(slow[apart], time[apart])
            rates[rows] = np.interp(time[rows], time[apart], slopes)
    return rates, jumps
