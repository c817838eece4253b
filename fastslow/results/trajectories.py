"""A solution in time: its series, its crossings, and the regions it went through."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastslow.errors import ArgumentError, unknown_name
from fastslow.results.outcome import Outcome

#: A plotted curve may leave the solution by this part of the range of each column.
FLATNESS = 2e-4

#: Most points that one step is divided into for plotting.
MOST_POINTS = 48


@dataclass(frozen=True, eq=False)
class Crossing:
    """One passage through an interface, or one touch.

    Parameters
    ----------
    time : float
    state : ndarray, shape (n,)
        States and slow states, on the interface.
    interface : str
    direction : int
        +1 where h grows, −1 where it falls, 0 where it only touches zero.
    from_region, to_region : str
        The same region for a touch; ``"A|B"`` is sliding between A and B.
    tangential : bool
        Whether a change of h by a millionth of its size would undo the crossing,
        so that its time is known less well than others.
    """

    time: float
    state: NDArray[np.float64]
    interface: str
    direction: int
    from_region: str
    to_region: str
    tangential: bool

    def __repr__(self) -> str:
        arrow = {1: "upwards", -1: "downwards", 0: "touching"}[self.direction]
        near = ", near-tangential" if self.tangential and self.direction else ""
        return (
            f"Crossing(t = {self.time:.9g}, {self.interface} {arrow}, "
            f"{self.from_region} → {self.to_region}{near})"
        )


@dataclass(frozen=True)
class Segment:
    """A stretch of time within one region (or of sliding between two)."""

    start: float
    end: float
    region: str

    @property
    def duration(self) -> float:
        return self.end - self.start


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory:
    """A solution in time.

    Parameters
    ----------
    states : tuple of str
        States, then slow states: the order of every state vector.
    forcing : tuple of str
        Slow quantities.
    interfaces, regions : tuple of str
        Names in the model's order.
    parameters : mapping
        Parameter values.
    period : float or None
        Common period of all forcing.
    gap : tuple of str or None
        For a model with a gap, the regions below, inside and above it.
    outcome : Outcome
        Why the run ended.
    end : ndarray, shape (1 + n,)
        Time and state reached.
    steps : ndarray, shape (n_steps, 3)
        Time, length and mode of every step.
    modes : tuple of str
        What the modes in ``steps`` and ``crossing_table`` are: regions, then sliding motions.
    crossing_table : ndarray, shape (n_crossings, 6 + n)
        Time, interface, direction, mode before, mode after, near-tangential, state.
    series : ndarray, shape (n_steps, n + n_forcing, order + 1), optional
        Taylor coefficients of every step.
    sampled : tuple of ndarray, optional
        Times (N,) asked for and their columns (n or n + n_forcing, N).
    span : tuple of float
        First and last time reached.

    Examples
    --------
    >>> import sympy as sp, fastslow as fs
    >>> x, v = sp.symbols("x v")
    >>> run = fs.simulate(fs.Model({x: v, v: -sp.sign(x)}), [0.5, 0.0], t=(0, 3))
    >>> run.crossings
    (Crossing(t = 1, x downwards, S1 → S2),)
    >>> run.word
    ('S1', 'S2')
    >>> run(3.0).round(12)
    array([0., 1.])
    """

    states: tuple[str, ...]
    forcing: tuple[str, ...]
    interfaces: tuple[str, ...]
    regions: tuple[str, ...]
    parameters: Mapping[str, float]
    period: float | None
    gap: tuple[str, str, str] | None
    outcome: Outcome
    span: tuple[float, float]
    end: NDArray[np.float64]
    steps: NDArray[np.float64]
    modes: tuple[str, ...]
    crossing_table: NDArray[np.float64]
    series: NDArray[np.float64] | None
    sampled: tuple[NDArray[np.float64], NDArray[np.float64]] | None

    @cached_property
    def t(self) -> NDArray[np.float64]:
        """Times of the samples; without samples, enough of them to plot."""
        return self._table[0]

    @property
    def columns(self) -> tuple[str, ...]:
        """Names that can be asked for: states, slow states, slow quantities."""
        return (*self.states, *self.forcing)

    def __getitem__(self, name: object) -> NDArray[np.float64]:
        """A state, slow state or slow quantity at the times ``t``, shape (N,)."""
        key = str(name)
        if key == "t":
            return self.t
        if key not in self.columns:
            raise unknown_name("column", key, self.columns)
        row = self.columns.index(key)
        values = self._table[1]
        if row >= len(values):
            values = self._all_sampled
        return values[row]

    def __call__(self, times: ArrayLike) -> NDArray[np.float64]:
        """States at any times of the run, shape (n, N); (n,) for a scalar time.

        Raises
        ------
        ArgumentError
            For a time outside the run, or without dense output.
        """
        return self.dense_columns(times)[: len(self.states)]

    def dense_columns(self, times: ArrayLike) -> NDArray[np.float64]:
        """All columns at any times of the run, shape (n + n_forcing, N).

        Raises
        ------
        ArgumentError
            For a time outside the run, or without dense output.
        """
        where = np.asarray(times, dtype=float)
        if self.series is None:
            raise ArgumentError(
                "this run kept no dense output; simulate with dense=True, or ask for samples="
            )
        low, high = self.span
        outside = ~((where >= low) & (where <= high))
        if outside.any():
            worst = float(where[outside].flat[0])
            raise ArgumentError(f"time {worst:g} is outside the run, which is [{low:g}, {high:g}]")
        if not len(self.steps):
            raise ArgumentError(f"the run made no step: {self.outcome}")
        flat = where.reshape(-1)
        row = np.searchsorted(self.steps[:, 0], flat, side="right") - 1
        values = self._evaluate(row, flat - self.steps[row, 0])
        return values.reshape(len(self.columns), *where.shape)

    def _evaluate(self, row: NDArray[np.intp], offset: NDArray[np.float64]) -> NDArray[np.float64]:
        """Columns at offsets into given steps, shape (n + n_forcing, N)."""
        assert self.series is not None
        value = self.series[row, :, -1].T
        for k in range(self.series.shape[2] - 2, -1, -1):
            value = value * offset + self.series[row, :, k].T
        return np.ascontiguousarray(value)

    @cached_property
    def _table(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return self.sampled if self.sampled is not None else self._refined()

    @cached_property
    def _all_sampled(self) -> NDArray[np.float64]:
        return self.dense_columns(self.t)

    def _refined(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Every step divided finely enough that straight lines look smooth."""
        if self.series is None or not len(self.steps):
            return self.end[:1], self.end[1:, None]
        length = self.steps[:, 1]
        order = self.series.shape[2] - 1
        k = np.arange(2, order + 1)
        power = length[:, None] ** k
        bend = np.abs(self.series[:, :, 2:] * (k * (k - 1) * power)[:, None, :]).sum(axis=2)
        reach = np.ptp(self.series[:, :, 0], axis=0)
        reach = np.where(reach > 0, reach, np.abs(bend).max(axis=0) + np.finfo(float).tiny)
        pieces = np.sqrt((bend / (8 * FLATNESS * reach)).max(axis=1))
        pieces = np.clip(np.nan_to_num(np.ceil(pieces), nan=1.0), 1, MOST_POINTS).astype(int)
        row = np.repeat(np.arange(len(length)), pieces)
        first = np.repeat(np.cumsum(pieces) - pieces, pieces)
        offset = (np.arange(len(row)) - first) * (length / pieces)[row]
        row, offset = np.append(row, len(length) - 1), np.append(offset, length[-1])
        times = self.steps[row, 0] + offset
        times[-1] = self.span[1]
        return times, self._evaluate(row, offset)

    @cached_property
    def crossings(self) -> tuple[Crossing, ...]:
        """Every crossing in order of time."""
        return tuple(
            Crossing(
                float(entry[0]),
                entry[6:].copy(),
                self.interfaces[int(entry[1])],
                int(entry[2]),
                self.modes[int(entry[3])],
                self.modes[int(entry[4])],
                bool(entry[5]),
            )
            for entry in self.crossing_table
        )

    @cached_property
    def segments(self) -> tuple[Segment, ...]:
        """Stretches of one region, in order."""
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
    def word(self) -> tuple[str, ...]:
        """The regions in the order they were gone through."""
        return tuple(segment.region for segment in self.segments)

    @cached_property
    def regime(self) -> str | None:
        """How the sides of a gap are touched in the last period of the run.

        ``"bilateral"``, ``"unilateral upper"``, ``"unilateral lower"``,
        ``"meshed upper"``, ``"meshed lower"`` or ``"free"``; None for models
        without a gap or without a period.
        """
        if self.gap is None or self.period is None:
            return None
        begin = self.span[1] - self.period
        seen = {s.region for s in self.segments if s.end > begin}
        lower, inside, upper = (name in seen for name in self.gap)
        if lower and upper:
            return "bilateral"
        if lower or upper:
            side = "upper" if upper else "lower"
            return f"unilateral {side}" if inside else f"meshed {side}"
        return "free" if inside else None

    @property
    def residence(self) -> dict[str, float]:
        """The part of the run spent in every region (and in every sliding motion)."""
        total = self.span[1] - self.span[0]
        spent = dict.fromkeys(self.regions, 0.0)
        for segment in self.segments:
            spent[segment.region] = spent.get(segment.region, 0.0) + segment.duration / total
        return spent

    def hits(self, interface: object, direction: int | None = None) -> int:
        """How often an interface was crossed, upwards (+1), downwards (−1) or either way.

        Raises
        ------
        UnknownNameError
            For an interface that is not in the model.
        """
        if str(interface) not in self.interfaces:
            raise unknown_name("interface", interface, self.interfaces)
        table = self.crossing_table
        mine = table[table[:, 1] == self.interfaces.index(str(interface)), 2]
        return int(np.count_nonzero(mine != 0 if direction is None else mine == direction))

    def extremes(self, name: object, since: float | None = None) -> tuple[float, float]:
        """Minimum and maximum of a column from a time to the end, to rounding.

        Every step's polynomial is maximised where its coefficients allow more
        than the extremes at the ends of the steps.

        Parameters
        ----------
        name : str or Symbol
        since : float, optional
            By default the start of the run.

        Raises
        ------
        UnknownNameError
            For a name that is no column.
        ArgumentError
            For a time outside the run, or without dense output.
        """
        if str(name) not in self.columns:
            raise unknown_name("column", name, self.columns)
        row = self.columns.index(str(name))
        begin = self.span[0] if since is None else float(since)
        ends = self.dense_columns([begin, self.span[1]])[row]
        assert self.series is not None
        used = np.flatnonzero(self.steps[:, 0] + self.steps[:, 1] > begin)
        length = self.steps[used, 1]
        scaled = self.series[used, row] * length[:, None] ** np.arange(self.series.shape[2])
        after = np.maximum(begin - self.steps[used, 0], 0.0) / length
        inside = scaled[after == 0, 0]
        low, high = float(np.append(ends, inside).min()), float(np.append(ends, inside).max())
        reach = np.abs(scaled[:, 1:]).sum(axis=1)
        for i in np.flatnonzero((scaled[:, 0] + reach > high) | (scaled[:, 0] - reach < low)):
            roots = np.polynomial.polynomial.polyroots(np.polynomial.polynomial.polyder(scaled[i]))
            turning = roots.real[np.abs(roots.imag) < 1e-6]
            turning = turning[(turning >= after[i]) & (turning <= 1)]
            values = np.polynomial.polynomial.polyval(turning, scaled[i])
            low, high = float(np.append(values, low).min()), float(np.append(values, high).max())
        return low, high

    def __getstate__(self) -> dict[str, Any]:
        names = self.__dataclass_fields__
        return {name: value for name, value in self.__dict__.items() if name in names}

    def __repr__(self) -> str:
        low, high = self.span
        lines = [
            f"Trajectory of {', '.join(self.columns)} for t from {low:.6g} to {high:.6g}",
            f"  {len(self.steps)} steps, {len(self.crossing_table)} crossings, "
            f"{len(self.segments)} segments" + (f", regime {self.regime}" if self.regime else ""),
            f"  {self.outcome}",
        ]
        return "\n".join(lines)
