"""Solutions: states as functions of time, from the series of every step or from samples."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from itertools import chain
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastslow.arguments import Condition, Name, among, finite, numbers, text, validated
from fastslow.errors import ArgumentError, unknown_name
from fastslow.formulas.columns import rows_where
from fastslow.formulas.definitions import definitions_of, with_definitions
from fastslow.results.base.intervals import limits_of, runs_of
from fastslow.results.base.outcome import Outcome
from fastslow.results.base.result import Result
from fastslow.results.base.table import Table, at_values, check_values, inside, named_value
from fastslow.results.trajectory.events.crossings import Segment
from fastslow.results.trajectory.queries.lookup import (
    states_at_level,
    states_between_samples,
    windows_where,
)
from fastslow.results.trajectory.queries.nearest import nearest_time
from fastslow.results.trajectory.queries.state_at import StatePoint
from fastslow.results.trajectory.steps.dense import DenseOutput
from fastslow.results.trajectory.steps.slicing import cut_steps, slice_bounds

Array = NDArray[np.float64]

#: Number of samples evaluated at once by an iteration.
SAMPLES_AT_ONCE = 1024


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Solution(Table[StatePoint], Result):
    """States as functions of time, from the series of every step or from samples.

    The fields are described in `Trajectory`.
    """

    states: tuple[str, ...]
    forcing: tuple[str, ...]
    regions: tuple[str, ...]
    parameters: Mapping[str, float]
    outcome: Outcome
    span: tuple[float, float]
    end: Array
    steps: Array
    modes: tuple[str, ...]
    series: Array | None
    sampled: tuple[Array, Array] | None
    periods: Mapping[str, float] = field(default_factory=dict)

    _row = "t"
    _places = ("t",)
    _entry = "sample"

    @cached_property
    def t(self) -> Array:
        """Times of the samples; without samples, times dense enough for a plot."""
        return self._table[0]

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns: states, slow states, slow quantities."""
        return (*self.states, *self.forcing)

    def __len__(self) -> int:
        return len(self.t)

    def __iter__(self) -> Iterator[StatePoint]:
        return chain.from_iterable(self.points_in_blocks())

    def _item(self, row: int) -> StatePoint:
        return self._points(self.t[[row]], self.sampled_columns[:, [row]])[0]

    def _rows(self, rows: Any) -> Self:
        start, stop = slice_bounds(rows, len(self), "a trajectory")
        if stop - start == len(self):
            return self
        kept = self.t[start:stop], self.sampled_columns[:, start:stop]
        return self._cut(float(kept[0][0]), float(kept[0][-1]), kept)

    def _columns(self) -> Mapping[str, Callable[[], Array]]:
        columns = {name: partial(self._column, k) for k, name in enumerate(self.columns)}
        return {**columns, "t": lambda: self.t}

    def _column(self, row: int) -> Array:
        values = self._table[1]
        return values[row] if row < len(values) else self._all_sampled[row]

    @cached_property
    def _table(self) -> tuple[Array, Array]:
        if self.sampled is not None:
            return self.sampled
        known = self.series is not None and len(self.steps) > 0
        return self.dense.refined if known else (self.end[:1], self.end[1:, None])

    @cached_property
    def _all_sampled(self) -> Array:
        return self.dense_columns(self.t)

    @property
    def sampled_columns(self) -> Array:
        """Columns at the times ``t``: all of them, or the stored ones without dense output."""
        values = self._table[1]
        known = len(values) == len(self.columns) or not self.is_dense
        return values if known else self._all_sampled

    @cached_property
    def step_starts(self) -> Array:
        """Start times of the steps, contiguous in memory for a binary search."""
        return np.ascontiguousarray(self.steps[:, 0])

    @property
    def is_dense(self) -> bool:
        """True for a run with dense output."""
        return self.series is not None and len(self.steps) > 0 and self.span[0] < self.span[1]

    @cached_property
    def dense(self) -> DenseOutput:
        """The dense output: the solution as polynomials in time, one for every step.

        Raises
        ------
        ArgumentError
            For a run without dense output.
        """
        if self.series is None:
            raise ArgumentError("this run has no dense output; simulate with dense=True")
        return DenseOutput(
            states=self.states,
            forcing=self.forcing,
            parameters=self.parameters,
            periods=self.periods,
            span=self.span,
            end=self.end[1:],
            steps=self.steps,
            series=self.series,
            outcome=self.outcome,
            definitions=self.definitions,
            compiled=self._computed_here,
        )

    @property
    def _computed_here(self) -> bool:
        """Whether it was computed in this process, which has the compiled loops."""
        return False

    @property
    def definitions(self) -> dict[str, str]:
        """The named definitions of the model as text."""
        return definitions_of(getattr(self, "model", None))

    @validated(t=numbers)
    def __call__(self, t: ArrayLike) -> Array:
        """Return the states at any times of the run, shape (n, N); (n,) for a scalar time.

        At a jump, by a reset or a kick, the state is that after it; `Trajectory.resets` has both.
        A time that differs from that of a jump by rounding is at the jump.

        Raises
        ------
        ArgumentError
            For a time outside the run, or without dense output.
        """
        return self.dense(t)

    @validated(t=numbers)
    def dense_columns(self, t: ArrayLike) -> Array:
        """Return all columns at any times of the run, shape (n + n_forcing, N).

        Raises
        ------
        ArgumentError
            For a time outside the run, or without dense output.
        """
        return self.dense.columns_at(t)

    @validated(t=numbers)
    def regions_at(self, t: ArrayLike) -> NDArray[np.str_]:
        """Return the region at each time; at a crossing the one entered."""
        if not len(self.steps):
            return np.full(np.shape(t), "")
        times = np.asarray(t, dtype=float)
        if self.is_dense:
            times = self.dense.after_jumps(times.reshape(-1)).reshape(times.shape)
        row = np.searchsorted(self.step_starts, times, side="right") - 1
        return np.array(self.modes)[self.steps[np.maximum(row, 0), 2].astype(int)]

    @cached_property
    def segments(self) -> tuple[Segment, ...]:
        """The time intervals in one region, in order."""
        if not len(self.steps):
            return ()
        mode = self.steps[:, 2].astype(int)
        starts = np.flatnonzero(np.r_[True, mode[1:] != mode[:-1]])
        times = np.append(self.steps[starts, 0], self.span[1])
        return tuple(
            Segment(float(times[i]), float(times[i + 1]), self.modes[mode[first]])
            for i, first in enumerate(starts)
        )

    @property
    def itinerary(self) -> tuple[str, ...]:
        """The sequence of regions, with the states of switches, along the trajectory."""
        return tuple(segment.name for segment in self.segments)

    @validated(region=text, direction=among(-1, 0, 1, None))
    def at(
        self, *, region: str | None = None, direction: int | None = None, **value: Any
    ) -> list[Any]:
        """Return the states at which a column has a given value, or the state at a time.

        All roots of the series of every step are computed to rounding. A tangency counts
        once, and so does an end of the run that misses the value by rounding. A time
        interval in which the column is constant at the value is represented by its two
        ends, with ``resting=True``. Without dense output the states are interpolated
        linearly between samples (``interpolated=True``).

        Parameters
        ----------
        region : str, optional
            Select states in one region (or sliding, as ``"S1|S2"``).
        direction : int, optional
            Select crossings of the value upwards (+1) or downwards (−1), or tangencies (0).
        **value : float or array_like, shape (m,)
            A state, slow state, slow quantity or ``t`` by name, e.g. ``x=0.5``.

        Returns
        -------
        list of StatePoint, or list of m such lists
            In order of time; a list for each value of an array.

        Raises
        ------
        UnknownNameError
            For an unknown column or region.
        ArgumentError
            If the run does not reach the value.

        Examples
        --------
        >>> import sympy as sp, fastslow as fs
        >>> x, v = sp.symbols("x v")
        >>> fine = fs.Integration(rtol=1e-13)
        >>> run = fs.simulate(fs.Model({x: v, v: -x}), [1, 0], t=(0, 6), integration=fine)
        >>> for point in run.at(x=0.5):  # at π/3 and 5π/3
        ...     print(point)
        StatePoint(t = 1.04719755: x = 0.5, v = -0.866025; in S1)
        StatePoint(t = 5.23598776: x = 0.5, v = 0.866025; in S1)
        >>> run.at(t=3.2)
        [StatePoint(t = 3.2: x = -0.998295, v = 0.0583741; in S1)]
        >>> [part.span for part in run.select(between=(1, 2))]
        [(1.0, 2.0)]
        """
        name, given = named_value("column", (*self.columns, "t"), value)
        self._check_readable()
        self._check_region(region)

        def query(level: float) -> list[StatePoint]:
            found = self._at_level(name, level, direction)
            return [point for point in found if region in (None, point.region)]

        return at_values(name, given, query)

    def _at_level(self, name: str, level: float, direction: int | None) -> list[StatePoint]:
        """Return the states at which a column has a value."""
        if name == "t":
            inside("run", name, level, self.span if self.is_dense else (self.t[0], self.t[-1]))
            return self._points_at(np.array([level])) if direction in (None, 1) else []
        if self.is_dense:
            return states_at_level(self._points_at, self.dense, name, level, direction)
        samples = self.t, self[name]
        return states_between_samples(self._points_at, samples, name, level, direction)

    def nearest(self, **values: float) -> StatePoint:
        """Return the state nearest to given values of columns.

        Distances are measured in units of each column's range. The minimum is computed
        on the series, to rounding; without dense output by linear interpolation.

        Parameters
        ----------
        **values : float
            At least one of the states, slow quantities and ``t``, e.g. ``x=0.1, v=0``.

        Returns
        -------
        StatePoint

        Raises
        ------
        UnknownNameError
            For a name that is not a column.
        ArgumentError
            For a number that is not finite, or without any value.
        """
        check_values(values, (*self.columns, "t"), "column")
        self._check_readable()
        if self.is_dense:
            # samples may be few
            times, table = self.dense.refined
            columns = {**dict(zip(self.columns, table, strict=True)), "t": times}
            time = nearest_time(values, times, columns, self.periods, self.dense)
        else:
            columns = {name: self[name] for name in values}
            time = nearest_time(values, self.t, columns, self.periods, None)
        return self._points_at(np.array([time]))[0]

    @validated(region=text)
    def select(
        self,
        condition: Condition | None = None,
        /,
        *,
        region: str | None = None,
        between: tuple[float, float] | None = None,
    ) -> tuple[Self, ...]:
        """Return the slices of the run that satisfy all conditions, in order.

        Each slice is a trajectory with exact ends, its series, and the crossings at its
        ends. Without dense output it extends from the first to the last sample inside.

        Parameters
        ----------
        condition : str or Expr, optional
            A condition that compares polynomials in columns, parameters and ``t``, such as
            ``"x > 0 and -E < v < E"``; its ends are roots of the series. Without dense output
            any condition, at the samples.
        region : str, optional
            Select the time in one region (or sliding, as ``"S1|S2"``).
        between : (float, float), optional
            Select a closed time interval.

        Returns
        -------
        tuple of Trajectory

        Raises
        ------
        UnknownNameError
            For an unknown column or region.
        ArgumentError
            For an invalid condition or interval.

        Examples
        --------
        >>> import sympy as sp, fastslow as fs
        >>> x, v = sp.symbols("x v")
        >>> run = fs.simulate(fs.Model({x: v, v: -x}), [1, 0], t=(0, 7))
        >>> [np.round(part.span, 6).tolist() for part in run.select("x < 0 and v > 0")]
        [[3.141593, 4.712389]]
        """
        self._check_region(region)
        windows = [self.span] if condition is None else self._windows(condition)
        if region is not None:
            inside = _joined((s.start, s.end) for s in self.segments if s.region == region)
            windows = [(max(a, c), min(b, d)) for a, b in windows for c, d in inside]
        if between is not None:
            low, high = limits_of(between)
            windows = [(max(low, begin), min(high, end)) for begin, end in windows]
        parts = (self._between(begin, end) for begin, end in windows if begin < end)
        return tuple(part for part in parts if part is not None)

    @validated(since=finite, until=finite)
    def extremes(
        self, name: Name, *, since: float | None = None, until: float | None = None
    ) -> tuple[float, float]:
        """Return minimum and maximum of a column in a time interval, to rounding.

        The polynomial of a step is maximised if its coefficients allow values beyond
        the extremes at the ends of the steps.

        Parameters
        ----------
        name : str or Symbol
        since, until : float, optional
            The time interval, by default that of the run.

        Raises
        ------
        UnknownNameError
            For a name that is not a column.
        ArgumentError
            For a time outside the run, or without dense output.
        """
        return self.dense.extremes(name, self._window(since, until))

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Return time t, every column, and the region."""
        columns = {name: self[name] for name in self.columns}
        return {"t": self.t, **columns, "region": self.regions_at(self.t)}

    def _points_at(self, times: Array) -> list[StatePoint]:
        """Return the states at times inside the run, in the given order."""
        if self.is_dense:
            return self._points(times, self.dense_columns(times))
        # without series a run may have samples of its states alone
        rows = self.sampled_columns
        # only the samples next to each time are evaluated
        after = np.clip(np.searchsorted(self.t, times), 1, max(len(self.t) - 1, 1))
        near = np.minimum(np.stack([after - 1, after]), len(self.t) - 1)
        low, high = self.t[near]
        weight = np.where(high > low, (times - low) / np.where(high > low, high - low, 1.0), 0.0)
        columns = (1 - weight) * rows[:, near[0]] + weight * rows[:, near[1]]
        return self._points(times, columns, (weight > 0.0) & (weight < 1.0))

    def points_in_blocks(self) -> Iterator[list[StatePoint]]:
        """Yield the states at all samples, in blocks."""
        for row in range(0, len(self), SAMPLES_AT_ONCE):
            rows = slice(row, row + SAMPLES_AT_ONCE)
            yield self._points(self.t[rows], self.sampled_columns[:, rows])

    def _points(
        self, times: Array, columns: Array, interpolated: NDArray[np.bool_] | None = None
    ) -> list[StatePoint]:
        """Return states at instants from columns, shape (n or n + n_forcing, N)."""
        n = len(self.states)
        states, slow = np.ascontiguousarray(columns[:n].T), columns[n:].T.tolist()
        regions = self.regions_at(times).tolist()
        between = [False] * len(times) if interpolated is None else interpolated.tolist()
        return [
            StatePoint(
                time,
                self.states,
                states[k],
                dict(zip(self.forcing, slow[k], strict=False)),
                regions[k],
                self.parameters,
                between[k],
            )
            for k, time in enumerate(times.tolist())
        ]

    def _windows(self, condition: Any) -> list[tuple[float, float]]:
        """Return the time intervals on which a condition is true."""
        condition = with_definitions(condition, self.definitions)
        if self.is_dense:
            return windows_where(self.dense, condition)
        wanted = rows_where(condition, self._columns(), self.parameters, len(self))
        return [(float(self.t[a]), float(self.t[b - 1])) for a, b in runs_of(wanted)]

    def _check_readable(self) -> None:
        if not self.is_dense and not len(self):
            raise ArgumentError(
                "this run has no samples and no dense output; simulate with dense=True or samples="
            )

    def _check_region(self, region: str | None) -> None:
        """Raise UnknownNameError for a name that is neither a region nor a sliding motion."""
        valid = tuple(dict.fromkeys([*self.regions, *self.modes]))
        if region is not None and region not in valid:
            raise unknown_name("region", region, valid)

    def _window(self, since: float | None, until: float | None = None) -> tuple[float, float]:
        """Validate a time interval, by default that of the run."""
        low, high = self.span
        first, last = low if since is None else since, high if until is None else until
        if not low <= first <= high:
            raise ArgumentError(
                f"since = {first:g} is outside the run, which is [{low:g}, {high:g}]"
            )
        if not first <= last <= high:
            raise ArgumentError(f"until = {last:g}; expected a time from {first:g} to {high:g}")
        return first, last

    def _between(self, begin: float, end: float) -> Self | None:
        """Return the slice between two times, or without dense output that of the samples."""
        if (begin, end) == self.span:
            return self
        if not self.is_dense:
            first = int(np.searchsorted(self.t, begin, side="left"))
            last = int(np.searchsorted(self.t, end, side="right"))
            return self[first:last] if last > first else None
        if self.sampled is None:
            return self._cut(begin, end, None)
        times, columns = self.sampled
        inside = (times > begin) & (times < end)
        ends = self.dense_columns([begin, end])[: len(columns)]
        kept = np.column_stack([ends[:, 0], columns[:, inside], ends[:, 1]])
        return self._cut(begin, end, (np.concatenate([[begin], times[inside], [end]]), kept))

    def _cut(self, begin: float, end: float, sampled: tuple[Array, Array] | None) -> Self:
        """Return the slice between two times, with its crossings and exact ends."""
        low, high = self.span
        steps, series = cut_steps(self.steps, self.series, begin, end)
        cut = f"cut to t from {begin:g} to {end:g} of a run from {low:g} to {high:g}."
        part = replace(
            self,
            span=(begin, end),
            steps=steps,
            series=series,
            sampled=sampled,
            outcome=self.outcome if end == high else Outcome("cut", cut, True),
        )
        if part.is_dense:
            last = np.array([len(steps) - 1])
            state = part.dense.evaluate(last, end - steps[last, 0])[:, 0]
        else:
            state = part.sampled_columns[:, -1]
        return replace(part, end=np.append(end, state[: len(self.states)]))


def _joined(intervals: Iterable[tuple[float, float]]) -> list[tuple[float, float]]:
    """Join consecutive intervals that touch."""
    found: list[tuple[float, float]] = []
    for begin, end in intervals:
        if found and found[-1][1] == begin:
            begin = found.pop()[0]
        found.append((begin, end))
    return found
