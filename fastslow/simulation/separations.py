"""Largest Lyapunov exponents of many runs from the separation of nearby trajectories.

Every run is divided into intervals. From the state at the beginning of each, trajectories
displaced in both directions of every state are integrated to its end, all of them as one
ensemble; their central differences are the derivative of the flow over the interval. The product
of the derivatives is applied to one vector. For the signs of the exponents of hundreds of runs
this takes less time than `fastslow.lyapunov`, which compiles and integrates the derivatives.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastslow.model.model import Model
from fastslow.results.base.outcome import Outcome
from fastslow.results.trajectory.long_time.lyapunov_exponents import (
    LyapunovExponents,
    motion_outcome,
    sign_of,
)
from fastslow.results.trajectory.long_time.periodicity import CONSTANT_RANGE
from fastslow.simulation.many import final_states
from fastslow.simulation.settings import Execution, Integration, Resolved, resolve

Floats = NDArray[np.float64]

#: Tighter than for a run, because separations are differences of states.
FINE = Integration(rtol=1e-11)

#: Separation in units of the root of the tolerance: the error of a central difference is then a
#: few roots from rounding, and of the order of the tolerance from curvature.
SEPARATION = 3.0

#: Limits of the growth of a separation within one interval, from rounding and from curvature.
LEAST_SEPARATION, LARGEST_SEPARATION = 1e-2, 1e2

#: Maximum number of blocks, whose spread gives the uncertainty.
BLOCKS = 10

#: Initial and maximum number of intervals.
INITIAL_INTERVALS, COUNTLESS = 60, 200_000

#: Fraction of the measurement in which the tangent vector aligns before averaging.
ALIGNED = 0.1

#: Trajectories integrated in one call.
TOGETHER = 100_000

#: Growth of the states over the measurement from which a run counts as unbounded.
LEAVING = 10.0

#: Shift of the intervals as a fraction of the longest, by the golden section.
OFF = 0.381966

#: Points of a run that give the range of each state.
RANGING = 256


@dataclass(frozen=True, eq=False)
class Exponents:
    """Largest Lyapunov exponents of m runs.

    Parameters
    ----------
    value, uncertainty : ndarray, shape (m,)
        NaN for a run that ended early.
    blocks : ndarray, shape (m, k)
    final : ndarray, shape (m, n)
    largest : ndarray, shape (m, 2)
        Largest size of a state without a period, in the first and in the last quarter of the
        measurement, in units of its size over all of it.
    spans : ndarray, shape (m, 2)
        First and last time of the measurements.
    ended : dict
        Outcomes of runs that ended early.
    """

    value: Floats
    uncertainty: Floats
    blocks: Floats
    final: Floats
    largest: Floats
    spans: Floats
    ended: dict[int, Outcome]

    def sign(self, row: int) -> int:
        """Sign of an exponent, 0 if undecided or if the run diverges."""
        if self.leaves(row) or row in self.ended:
            return 0
        length = float(self.spans[row, 1] - self.spans[row, 0])
        return sign_of(float(self.value[row]), float(self.uncertainty[row]), length)

    def leaves(self, row: int) -> bool:
        """Whether the states of a run grow throughout the measurement."""
        before, after = self.largest[row]
        return bool(after > LEAVING * before)

    def of(
        self,
        row: int,
        model: Model,
        period: float | None,
        integration: Integration,
        again: Outcome,
    ) -> LyapunovExponents:
        """The largest exponent of one run.

        Parameters
        ----------
        row : int
        model : Model
            At the parameters of the run.
        period : float or None
        integration : Integration
        again : Outcome
            Whether the run repeats.
        """
        first, last = self.spans[row]
        return LyapunovExponents(
            states=(*model.states, *model.slow_states),
            values=self.value[row : row + 1],
            uncertainties=self.uncertainty[row : row + 1],
            blocks=self.blocks[row, :, None],
            divergence=float("nan"),
            span=(float(first), float(last)),
            period=period,
            outcome=self._outcome(row, again),
            state=self.final[row],
            parameters=dict(model.parameters),
            equations=model.equations,
            settings=resolve(integration, model, implicit=False).recorded(),
        )

    def _outcome(self, row: int, again: Outcome) -> Outcome:
        """Classify the motion of a run by its exponent."""
        if row in self.ended:
            return self.ended[row]
        length = float(self.spans[row, 1] - self.spans[row, 0])
        value, uncertainty = float(self.value[row]), float(self.uncertainty[row])
        return motion_outcome(value, uncertainty, length, self.leaves(row), again)


def exponents(
    model: Model,
    starts: Floats,
    swept: dict[str, Floats],
    times: Floats,
    integration: Integration,
    execution: Execution,
    units: int = 0,
    finest: int = COUNTLESS,
    report: Callable[[int], object] = lambda _: None,
) -> Exponents:
    """Measure the exponents of many runs.

    Parameters
    ----------
    model : Model
    starts : ndarray, shape (m, n)
    swept : dict
        Parameter to its values, shape (m,).
    times : ndarray, shape (m, 3)
        Start of each run, and first and last time of its measurement.
    integration : Integration
    execution : Execution
    units : int
        Equal subdivisions of the measurement that are not split between blocks; by default
        the initial number of intervals.
    finest : int
        Maximum number of intervals in a measurement.
    report : callable, optional
        Called with numbers of finished trajectories.
    """
    resolved = resolve(integration, model, implicit=False)
    m, n = starts.shape
    begin, first, last = times.T
    length = last - first
    units = units if units > 1 else INITIAL_INTERVALS
    lead = ALIGNED if ((first - begin) >= 2 * ALIGNED * length).all() else 0.0
    states, codes = starts, np.zeros(m, dtype=np.int64)
    # a forcing switches at simple fractions of its period: no interval starts there
    shift = OFF * length / (INITIAL_INTERVALS if lead else np.inf)
    first, last = first - shift, last - shift
    opening = first - lead * length
    if (opening > begin).all():
        spans = np.stack([begin, opening], axis=1)
        states, codes = final_states(model, starts, swept, spans, resolved, execution)[:2]
    followed = _Followed(model, resolved, execution, starts, states, report)
    followed.measure(swept, np.linspace(opening, last, RANGING, axis=1))
    each = np.full(m, max(1, -(-INITIAL_INTERVALS // units)))
    grid = np.linspace(opening, last, 9, axis=1)
    coarse = np.arange(m)
    while len(coarse):
        growth = followed.trial(swept, grid, length / (each * units), coarse)
        with np.errstate(invalid="ignore"):
            wrong = (growth > LARGEST_SEPARATION).any(axis=1) | (growth < LEAST_SEPARATION).any(
                axis=1
            )
        coarse = coarse[wrong & (2 * each[coarse] * units <= finest)]
        each[coarse] *= 2
    sums, final, largest = np.empty((m, units)), np.empty((m, n)), np.empty((m, 2))
    free = np.array([name not in model.periodic for name in (*model.states, *model.slow_states)])
    step = length / (each * units)
    for pieces in np.unique(each) * units:
        alike = np.flatnonzero(each * units == pieces)
        before = round(lead * pieces)
        together = max(1, TOGETHER // (2 * n * (pieces + before)))
        for low in range(0, len(alike), together):
            rows = alike[low : low + together]
            grid = last[rows, None] - step[rows, None] * np.arange(pieces + before, -1, -1.0)
            grid[:, 0] = opening[rows]
            edges, derivatives = followed.over(swept, grid, rows)
            logs = _growth(derivatives)[:, before:]
            sums[rows] = logs.reshape(len(rows), units, -1).sum(axis=2)
            final[rows] = edges[:, -1]
            scaled = np.where(free, np.abs(edges / followed.size[rows, None]), 0.0).max(axis=2)
            quarter = max(1, pieces // 4)
            largest[rows, 0] = scaled[:, before : before + quarter].max(axis=1)
            largest[rows, 1] = scaled[:, -quarter:].max(axis=1)
    value = sums.sum(axis=1) / length
    parts = np.array_split(np.arange(units), min(BLOCKS, units))
    blocks = np.stack(
        [sums[:, part].sum(axis=1) / (len(part) * length / units) for part in parts], axis=1
    )
    with np.errstate(invalid="ignore"):
        spread = blocks.std(axis=1, ddof=1) / np.sqrt(len(parts))
    uncertainty = np.where(np.isneginf(value), 0.0, spread)
    ended: dict[int, Outcome] = {}
    for row in np.flatnonzero((codes != 0) | np.isnan(value)):
        text = "a run ended before the measurement did; simulate() says why."
        ended[int(row)] = Outcome("stopped early", text, False)
        value[row] = uncertainty[row] = np.nan
    measured = np.stack([first, last], axis=1)
    return Exponents(value, uncertainty, blocks, final, largest, measured, ended)


class _Followed:
    """Runs and the derivatives of their flow map, in units of the size of each state."""

    def __init__(
        self,
        model: Model,
        resolved: Resolved,
        execution: Execution,
        starts: Floats,
        states: Floats,
        report: Callable[[int], object],
    ) -> None:
        self.model, self.resolved, self.execution = model, resolved, execution
        self.report = report
        self.starts, self.states = starts, states
        self.size = np.empty(0)

    def final_states(
        self, states: Floats, swept: dict[str, Floats], spans: Floats, times: Floats | None = None
    ) -> Floats:
        """Where runs arrive, or what they are at some times; NaN where they ended early."""
        good = np.isfinite(states).all(axis=1)
        shape = states.shape if times is None else (len(states), times.shape[1], states.shape[1])
        found = np.full(shape, np.nan)
        if good.any():
            given = {name: np.ascontiguousarray(values[good]) for name, values in swept.items()}
            ends, codes, samples, _ = final_states(
                self.model,
                np.ascontiguousarray(states[good]),
                given,
                np.ascontiguousarray(spans[good]),
                self.resolved,
                self.execution,
                None if times is None else np.ascontiguousarray(times[good]),
                self.report,
            )
            if times is None:
                found[good] = np.where((codes == 0)[:, None], ends, np.nan)
            else:
                found[good] = np.swapaxes(samples, 1, 2)
        return found

    def references(self, swept: dict[str, Floats], grid: Floats, rows: NDArray[np.intp]) -> Floats:
        """States of some runs at the times of a grid (m, k), shape (m, k, n)."""
        states = self.states[rows]
        found = self.final_states(
            states, {n: v[rows] for n, v in swept.items()}, grid[:, [0, -1]], grid
        )
        found[:, 0] = states
        return found

    def measure(self, swept: dict[str, Floats], grid: Floats) -> None:
        """Find the size of each state, shape (m, n): its range, else what it was, else 1."""
        found = self.references(swept, grid, np.arange(len(grid)))
        with np.errstate(invalid="ignore"):
            largest = np.maximum(np.abs(found).max(axis=1), np.abs(self.starts))
            ranges = np.ptp(found, axis=1)
        size = np.where(ranges > CONSTANT_RANGE * largest, ranges, largest)
        self.size = np.where(np.isfinite(size) & (size > 0), size, 1.0)

    def trial(
        self, swept: dict[str, Floats], grid: Floats, step: Floats, rows: NDArray[np.intp]
    ) -> Floats:
        """Norms of derivatives over intervals of some length that begin along the runs, (m, k)."""
        edges = self.references(swept, grid[rows], rows)
        begins = grid[rows, :-1]
        spans = np.stack([begins, begins + step[rows, None]], axis=2)
        derivatives = self.derivatives(edges[:, :-1], swept, spans, rows)
        return np.asarray(np.linalg.norm(derivatives, axis=(2, 3)))

    def over(
        self, swept: dict[str, Floats], grid: Floats, rows: NDArray[np.intp]
    ) -> tuple[Floats, Floats]:
        """States at the times of a grid, and the derivatives between them."""
        edges = self.references(swept, grid, rows)
        spans = np.stack([grid[:, :-1], grid[:, 1:]], axis=2)
        return edges, self.derivatives(edges[:, :-1], swept, spans, rows)

    def derivatives(
        self, states: Floats, swept: dict[str, Floats], spans: Floats, rows: NDArray[np.intp]
    ) -> Floats:
        """Derivatives of the flow over intervals, shape (m, k, n, n).

        Parameters
        ----------
        states : ndarray, shape (m, k, n)
            At the beginning of each interval.
        spans : ndarray, shape (m, k, 2)
        rows : ndarray of int, shape (m,)
            Indices of the runs.
        """
        m, k, n = states.shape
        size = self.size[rows]
        # axes: run, interval, state displaced, direction, state
        begin = np.broadcast_to(states[:, :, None, None, :], (m, k, n, 2, n)).copy()
        displaced = SEPARATION * np.sqrt(self.resolved.rtol) * size
        for j in range(n):
            begin[:, :, j, 0, j] += displaced[:, None, j]
            begin[:, :, j, 1, j] -= displaced[:, None, j]
        own = {name: np.repeat(values[rows], k * n * 2) for name, values in swept.items()}
        spread = np.broadcast_to(spans[:, :, None, None, :], (m, k, n, 2, 2)).reshape(-1, 2)
        ends = self.final_states(begin.reshape(-1, n), own, spread).reshape(m, k, n, 2, n)
        # the displacement as it was rounded
        width = np.einsum("mkjj->mkj", begin[:, :, :, 0] - begin[:, :, :, 1])
        with np.errstate(invalid="ignore"):
            columns = (ends[:, :, :, 0] - ends[:, :, :, 1]) / width[..., None]
        scaled = columns * size[:, None, :, None] / size[:, None, None, :]
        return np.asarray(np.swapaxes(scaled, 2, 3))


def _growth(derivatives: Floats) -> Floats:
    """Logarithms of the growth of a vector over each interval, shape (m, k)."""
    m, k, n, _ = derivatives.shape
    vector = np.random.default_rng(1).normal(size=n)
    vectors = np.tile(vector / np.linalg.norm(vector), (m, 1))
    logs = np.empty((m, k))
    for step in range(k):
        vectors = np.einsum("mij,mj->mi", derivatives[:, step], vectors)
        lengths = np.linalg.norm(vectors, axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            logs[:, step] = np.log(lengths)
            vectors = np.where(lengths[:, None] > 0, vectors / lengths[:, None], 0.0)
    return logs
