"""Dense output: a solution as polynomials in time, one for every step."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastslow.errors import ArgumentError, unknown_name
from fastslow.formulas.columns import written_formula
from fastslow.formulas.definitions import with_definitions
from fastslow.results.base.immutable import Immutable
from fastslow.results.base.outcome import Outcome
from fastslow.results.base.result import LIVE
from fastslow.results.base.upper_layers import computed
from fastslow.results.trajectory.steps.step_polynomials import Expansion, StepPolynomials
from fastslow.results.trajectory.steps.step_roots import (
    STEP_JUMP,
    StepRoots,
    find_roots,
    find_roots_modulo,
    to_bernstein,
)

Array = NDArray[np.float64]

#: Tolerated error of a plotted polyline, as a fraction of the range of each column.
FLATNESS = 2e-4

#: Maximal number of line segments for a step, and minimal number for an implicit step,
#: which may extend over much of a slow period.
MOST_POINTS, LEAST_POINTS = 48, 16

#: Parts of a step at which values are compared with the bounds of other steps.
SAMPLED = np.linspace(0.0, 1.0, 9)

#: Relative difference of times that are equal to rounding.
ROUNDING = 16 * np.finfo(float).eps

#: Values of solutions that were computed in this process.
COMPILED = "fastslow.simulation.compiled_values"

#: Relative difference of the times of the samples before and after a jump.
JUMP_GAP = 1.25 * ROUNDING


@dataclass(frozen=True, eq=False, repr=False)
class DenseOutput(Immutable):
    """A solution as polynomials in time, one for every step.

    ``dense(t)`` returns the states at any times of the span, shape (n, N).

    Parameters
    ----------
    states, forcing : tuple of str
        Names of the columns: states and slow states, then slow quantities.
    parameters : mapping
        Parameter values, for expressions.
    periods : mapping
        The period of each periodic state.
    span : tuple of float
        First and last time.
    end : ndarray, shape (n,)
        States at the last time.
    steps : ndarray, shape (n_steps, 4)
        Time, length, mode and method of every step, as in a `Trajectory`.
    series : ndarray, shape (n_steps, n + n_forcing, order + 1)
        Taylor coefficients of every step, about its start.
    outcome : Outcome
        The outcome at the last time.
    definitions : mapping
        Named definitions as text, for expressions.
    compiled : bool
        Whether the solution was computed in this process, which has the compiled loops.

    Examples
    --------
    A parabola of one step, its root and its extremes:

    >>> dense = DenseOutput(
    ...     states=("x",), forcing=(), parameters={"a": 1.0}, periods={}, span=(0.0, 2.0),
    ...     end=np.array([3.0]), steps=np.array([[0.0, 2.0, 0.0, 0.0]]),
    ...     series=np.array([[[-1.0, 0.0, 1.0]]]), outcome=Outcome("end of time", "", True),
    ... )
    >>> dense([0.5, 2.0])
    array([[-0.75,  3.  ]])
    >>> 2.0 * dense.roots("x + a", 1.0).part
    array([1.])
    >>> dense.extremes("x", (0.0, 1.0))
    (-1.0, 0.0)
    """

    states: tuple[str, ...]
    forcing: tuple[str, ...]
    parameters: Mapping[str, float]
    periods: Mapping[str, float]
    span: tuple[float, float]
    end: Array
    steps: Array
    series: Array
    outcome: Outcome
    definitions: Mapping[str, str] = field(default_factory=dict)
    compiled: bool = field(default=False, repr=False, metadata=LIVE)

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns: states, slow states, slow quantities."""
        return (*self.states, *self.forcing)

    @cached_property
    def step_starts(self) -> Array:
        """Start times of the steps, contiguous in memory for a binary search."""
        return np.ascontiguousarray(self.steps[:, 0])

    @cached_property
    def nodes(self) -> Array:
        """States at the starts of all steps and at the last time, shape (n_steps + 1, n)."""
        return np.vstack([self.series[:, : len(self.states), 0], self.end])

    @cached_property
    def nodes_and_jumps(self) -> tuple[Array, Array]:
        """States at all nodes and before jumps, shape (N, n), and their times, infinite at last."""
        rows = self._jumps
        before = self.evaluate(rows, self.steps[rows, 1])[: len(self.states)].T
        times = np.concatenate([self.step_starts, [np.inf], self.step_starts[rows + 1]])
        return np.concatenate([self.nodes, before]), times

    def __call__(self, times: ArrayLike) -> Array:
        """Return the states at times of the span, shape (n, N)."""
        return self.columns_at(times, slice(len(self.states)))

    def columns_at(self, times: ArrayLike, wanted: Sequence[int] | slice = slice(None)) -> Array:
        """Return columns at times of the span, by default all, shape (n + n_forcing, N).

        At a jump, to rounding of its time, they are those after it.

        Raises
        ------
        ArgumentError
            For a time outside the span, or without any step.
        """
        where = np.asarray(times, dtype=float)
        low, high = self.span
        if where.size and not (where.min() >= low and where.max() <= high):
            worst = float(where[~((where >= low) & (where <= high))].flat[0])
            raise ArgumentError(f"time {worst:g} is outside the run, which is [{low:g}, {high:g}]")
        if not len(self.steps):
            raise ArgumentError(f"the run made no step: {self.outcome}")
        flat, starts = self.after_jumps(where.reshape(-1)), self.step_starts
        series = self.series[:, wanted]
        if self.compiled and isinstance(wanted, slice):
            values = computed(COMPILED, "values_at")(self.series, starts, flat)[wanted]
        elif len(flat) > len(starts) and bool((flat[1:] >= flat[:-1]).all()):
            # fewer steps than times: search for the steps among the times
            first = np.searchsorted(flat, starts)
            first[0] = 0
            counts = np.diff(first, append=len(flat))
            values = _spread(series.transpose(2, 1, 0), counts, flat - np.repeat(starts, counts))
        else:
            row = np.searchsorted(starts, flat, side="right") - 1
            values = _at(series, row, flat - starts[row])
        if self._jumps_at_end:
            last = high - flat <= ROUNDING * abs(high)
            own = np.arange(self.series.shape[1])[wanted]
            states = np.flatnonzero(own < len(self.end))
            values[np.ix_(states, last)] = self.end[own[states], None]
        return values.reshape(len(values), *where.shape)

    def after_jumps(self, times: Array) -> Array:
        """Return times with those of jumps in place of times that are equal to rounding."""
        starts = self.step_starts
        if len(times) > len(starts) and bool((times[1:] >= times[:-1]).all()):
            # fewer steps than times: search for the steps among the times
            before = np.searchsorted(times, starts - ROUNDING * np.abs(starts))
            if (before == np.searchsorted(times, starts)).all():
                return times
        after = np.searchsorted(starts, times, side="right")
        gap = starts[np.minimum(after, len(starts) - 1)] - times
        near = np.flatnonzero((gap > 0.0) & (gap <= ROUNDING * np.abs(times)))
        if len(near):
            near = near[np.isin(after[near] - 1, self._jumps)]
        if not len(near):
            return times
        moved = times.copy()
        moved[near] = starts[after[near]]
        return moved

    @cached_property
    def _jumps_at_end(self) -> bool:
        """True if a state jumps at the last time."""
        last = _at(self.series, np.array([len(self.steps) - 1]), self.steps[-1:, 1])
        with np.errstate(invalid="ignore"):
            moved = np.abs(self.end - last[: len(self.end), 0])
        return bool((moved > STEP_JUMP * np.abs(self.nodes).max(axis=0)).any())

    def evaluate(self, row: NDArray[np.intp], offset: Array) -> Array:
        """Return all columns at offsets into given steps, shape (n + n_forcing, N)."""
        return _at(self.series, row, offset)

    def modulo(self, times: ArrayLike, period: float) -> Array:
        """Shift times by whole periods into the span, which is one period of an orbit."""
        low, high = self.span
        return np.clip(low + np.mod(np.asarray(times, dtype=float) - low, period), low, high)

    def polynomials(self, expression: object) -> StepPolynomials:
        """Expand a column, or a polynomial in columns, parameters and time, along every step.

        Parameters
        ----------
        expression : str or Expr
            A polynomial in columns and t of total degree up to ``DEGREE``, whose coefficients
            are numbers, parameters and functions of these.

        Raises
        ------
        UnknownNameError
            For a name that is neither a column nor a parameter.
        ArgumentError
            For an expression that is not a polynomial.
        """
        text = written_formula(with_definitions(expression, self.definitions))
        if text in self.columns:
            return self._column(self.columns.index(text))
        columns = {name: partial(self._column, k) for k, name in enumerate(self.columns)}
        return Expansion(text, columns, self.parameters, self.steps[:, :2]).polynomials()

    def _column(self, row: int) -> StepPolynomials:
        power = self.steps[:, 1:2] ** np.arange(self.series.shape[2])
        return StepPolynomials.of(self.series[:, row] * power)

    def roots(self, expression: object, level: float) -> StepRoots:
        """Compute all roots of an expression at a level; that of a periodic state is modulo it."""
        line, period = self.polynomials(expression), self.periods.get(str(expression))
        if period is None:
            return find_roots(line.minus(level))
        return find_roots_modulo(line, level, period)

    def extremes(self, name: object, window: tuple[float, float]) -> tuple[float, float]:
        """Return minimum and maximum of a column in a time interval; see `Trajectory.extremes`."""
        (low, _), (high, _) = self.extreme_points(name, window)
        return low, high

    def extreme_points(
        self, name: object, window: tuple[float, float]
    ) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return minimum and maximum of a column in a time interval, each with its time."""
        if str(name) not in self.columns:
            raise unknown_name("column", name, self.columns)
        row = self.columns.index(str(name))
        begin, end = window
        ends = self.columns_at([begin, end])[row]
        start, length = self.steps[:, 0], self.steps[:, 1]
        used = np.flatnonzero((start + length > begin) & (start < end))
        start, length = start[used], length[used]
        scaled = self.series[used, row] * length[:, None] ** np.arange(self.series.shape[2])
        after = np.maximum(begin - start, 0.0) / length
        before = np.minimum((end - start) / length, 1.0)
        last = len(self.steps) - 1
        jumps = (np.isin(used, self._jumps) | (used == last)) & (before == 1)
        values = np.concatenate([ends, scaled[after == 0, 0], scaled[jumps].sum(axis=1)])
        times = np.concatenate([window, start[after == 0], (start + length)[jumps]])
        least, most = int(values.argmin()), int(values.argmax())
        low = float(values[least]), float(times[least])
        high = float(values[most]), float(times[most])
        reach = np.abs(scaled[:, 1:]).sum(axis=1)
        near = np.flatnonzero((scaled[:, 0] + reach > high[0]) | (scaled[:, 0] - reach < low[0]))
        near = near[_beyond(scaled[near], after[near], before[near], low[0], high[0])]
        for i in near:
            roots = np.polynomial.polynomial.polyroots(np.polynomial.polynomial.polyder(scaled[i]))
            critical = roots.real[np.abs(roots.imag) < 1e-6]
            critical = critical[(critical >= after[i]) & (critical <= before[i])]
            for part in critical:
                value = float(np.polynomial.polynomial.polyval(part, scaled[i]))
                here = value, float(start[i] + part * length[i])
                low, high = min(low, here), max(high, here)
        return low, high

    def mean(self, name: str, since: float) -> float:
        """Return the time average of a column over the steps that begin after a given time."""
        late = self.steps[:, 0] >= since
        if not late.any():
            late = np.ones(len(self.steps), dtype=bool)
        length = self.steps[late, 1]
        k = np.arange(self.series.shape[2])
        area = self.series[late, self.columns.index(name)] * length[:, None] ** (k + 1) / (k + 1)
        return float(area.sum() / length.sum())

    def of_steps(self, rows: NDArray[np.intp]) -> DenseOutput:
        """Return the dense output of some steps."""
        return replace(self, steps=self.steps[rows], series=self.series[rows])

    @cached_property
    def refined(self) -> tuple[Array, Array]:
        """Times and columns, dense enough that a polyline looks smooth.

        A jump, at a reset or an instant of a table, has two points: the time before it differs
        by rounding, as ``rows_before_jumps`` finds.
        """
        length = self.steps[:, 1]
        least = np.where(self.steps[:, 3] >= 2, LEAST_POINTS, 1)
        lines = np.clip(self._line_segments(), least, MOST_POINTS).astype(int)
        counts = lines.copy()
        jumps = self._jumps
        counts[jumps] += 1
        counts[-1] += 1
        number = np.arange(int(counts.sum())) - np.repeat(np.cumsum(counts) - counts, counts)
        offset = number * np.repeat(length / lines, counts)
        offset[-1] = length[-1]
        times = np.repeat(self.step_starts, counts) + offset
        before = np.cumsum(counts)[jumps] - 1
        offset[before] = length[jumps]
        # not equal to rounding, and not before the beginning of a short step
        at = self.step_starts[jumps + 1]
        times[before] = np.maximum(at - JUMP_GAP * np.abs(at), self.step_starts[jumps])
        times[-1] = self.span[1]
        table = self._spread(counts, offset)
        if self._jumps_at_end:
            times, table = np.append(times, times[-1]), np.column_stack([table, table[:, -1]])
            times[-2] -= JUMP_GAP * abs(times[-1])
            table[: len(self.end), -1] = self.end
        return times, table

    @property
    def jump_times(self) -> Array:
        """Times at which a column jumps."""
        return np.asarray(self.step_starts[self._jumps + 1])

    @cached_property
    def _jumps(self) -> NDArray[np.intp]:
        """Numbers of the steps at whose ends a column jumps."""
        ends = self._spread(np.ones(len(self.steps), dtype=np.intp), self.steps[:, 1])
        starts = np.ascontiguousarray(self.series[:, :, 0].T)
        scale = np.abs(starts).max(axis=1, keepdims=True)
        moved = np.abs(ends[:, :-1] - starts[:, 1:]) > STEP_JUMP * scale
        return np.flatnonzero(moved.any(axis=0))

    def _spread(self, counts: NDArray[np.intp], offset: Array) -> Array:
        """Return all columns at given numbers of offsets into each step, shape (columns, N)."""
        if self.compiled:
            values: Array = computed(COMPILED, "values_by_steps")(self.series, counts, offset)
            return values
        return _spread(np.ascontiguousarray(self.series.transpose(2, 1, 0)), counts, offset)

    def _line_segments(self) -> Array:
        """Return the number of line segments for each step, from bounds of second derivatives."""
        if self.compiled:
            bend = computed(COMPILED, "bends_of_steps")(self.series, self.steps[:, 1])
        else:
            bend = _bends(np.ascontiguousarray(self.series.transpose(2, 1, 0)), self.steps[:, 1])
        reach = np.ptp(self.series[:, :, 0], axis=0)
        reach = np.where(reach > 0, reach, bend.max(axis=1) + np.finfo(float).tiny)
        count = np.sqrt((bend / (8 * FLATNESS * reach[:, None])).max(axis=0))
        return np.nan_to_num(np.ceil(count), nan=1.0)


def _beyond(
    scaled: Array, after: Array, before: Array, low: float, high: float
) -> NDArray[np.bool_]:
    """Check which polynomials may leave the range of all, by their Bernstein coefficients.

    The range is that of values at some parts of each, between ``after`` and ``before``, with
    ``low`` and ``high``.
    """
    order = scaled.shape[1] - 1
    values = scaled @ np.vander(SAMPLED, order + 1, increasing=True).T
    values = values[(after[:, None] <= SAMPLED) & (before[:, None] >= SAMPLED)]
    most, least = float(values.max(initial=high)), float(values.min(initial=low))
    slack = ROUNDING * max(abs(most), abs(least)) + 1e-9 * (most - least)
    bounds = scaled @ to_bernstein(order).T
    return np.asarray(
        (bounds.max(axis=1) > most - slack) | (bounds.min(axis=1) < least + slack), dtype=bool
    )


def rows_before_jumps(times: Array) -> NDArray[np.intp]:
    """Return the rows of samples that are followed by another at the same time, to rounding.

    Examples
    --------
    >>> rows_before_jumps(np.array([0.0, 1.0 - 4e-15, 1.0, 2.0]))
    array([1])
    """
    return np.flatnonzero(np.diff(times) <= 2.0 * JUMP_GAP * np.abs(times[1:]))


def _at(series: Array, row: NDArray[np.intp], offset: Array) -> Array:
    """Return columns at offsets into given steps, shape (columns, N)."""
    if len(row) and row.min() == row.max():
        taken = series[row[0]].T[:, :, None]
        return _horner(np.repeat(taken[-1], len(row), axis=1), taken[-2::-1], offset)
    # coefficients of each power contiguous in memory
    if len(row) < len(series):
        taken = np.ascontiguousarray(series[row].transpose(2, 1, 0))
        return _horner(taken[-1], taken[-2::-1], offset)
    powers = np.ascontiguousarray(series.transpose(2, 1, 0))
    value = powers[-1].take(row, axis=1)
    below = np.empty_like(value)
    lower = (power.take(row, axis=1, out=below, mode="clip") for power in powers[-2::-1])
    return _horner(value, lower, offset)


def _spread(powers: Array, counts: NDArray[np.intp], offset: Array) -> Array:
    """Return columns at given numbers of offsets into each step, shape (columns, N).

    The coefficients have the shape (order + 1, columns, n_steps).
    """
    lower = (power.repeat(counts, axis=1) for power in powers[-2::-1])
    return _horner(powers[-1].repeat(counts, axis=1), lower, offset)


def _horner(
    value: Array,
    lower: Iterable[Array],
    offset: Array,
) -> Array:
    """Evaluate polynomials in the offset by Horner's scheme; overwrites ``value``."""
    # the last step of a blow-up may end beyond the largest number
    with np.errstate(over="ignore"):
        for power in lower:
            value *= offset
            value += power
    return value


def _bends(powers: Array, length: Array) -> Array:
    """Return bounds of second derivatives, times the squared length, shape (columns, n_steps)."""
    bend = np.zeros(powers.shape[1:])
    for k in range(len(powers) - 1, 1, -1):
        bend *= length
        bend += k * (k - 1) * np.abs(powers[k])
    bend *= length**2
    return bend
