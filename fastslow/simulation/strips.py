"""Passes of a bifurcation sweep in strips: consecutive values that run at once as an ensemble.

All strips begin with the same state, and take their first values together, then their second
ones, and so on. A strip that did not begin with the final state of the previous one is run again
from there, value by value, until the new motion agrees with that of the former run; the rest of
the former run is kept. An orbit of several periods may agree up to its phase: then the former
states are advanced along their orbits, and one ensemble of all these values confirms them. If a
motion never agrees, as after a jump to a coexisting attractor, the strip is replaced up to its
end, and the next one follows. A pass thus ends as a chain in which every strip begins on the
motion with which the previous one ends, as in a pass in order.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import FastSlowError
from fastslow.kernels.simd.lanes import WIDTH
from fastslow.model.model import Model
from fastslow.results.angles import periods_of
from fastslow.results.base.outcome import Outcome
from fastslow.results.trajectory.endings import outcome_of
from fastslow.results.trajectory.long_time.regimes import repeats
from fastslow.results.trajectory.long_time.sweep import SweepPass
from fastslow.results.trajectory.trajectory import Trajectory
from fastslow.simulation.many import final_states
from fastslow.simulation.many_arguments import periods_of_trajectories
from fastslow.simulation.settings import resolve
from fastslow.simulation.sweep_runs import (
    Array,
    Start,
    ValueRun,
    ValueSettings,
    extremes_of,
    pass_of,
    recorded_run,
    run_at,
)

Rows = NDArray[np.intp]

#: Largest difference of motions that agree, in units of their size: a tenth of what periodic
#: values of different strips may differ by.
AGREEING_MOTIONS = 1e-10

#: Change over its period up to which a recorded motion repeats.
PERIODIC_CHANGE = 1e-9

#: Size of a state below which its differences count in units of this fraction of its extent over
#: all values: a state that decays to 0 differs from 0 by rounding.
FLOOR = 1e-2

#: Difference of the ends of the ranges of chaotic motions that agree, in units of the range.
RANGE = 0.25

#: Difference of states from which motions are compared by their ranges: closer ones converge.
APART = 1e-3

#: A disturbance, and the growth of it from which motions are compared by their ranges.
DISTURBANCE, COMPARED_GROWTH = 1e-6, 100.0


class SweptMotion(NamedTuple):
    """The motion at one value.

    Parameters
    ----------
    points : ndarray
        What the sweep records.
    outcome : Outcome
    state : ndarray, shape (n + n_switches,)
        Final state, with those of switches; after a failure that at the start.
    marks : ndarray, shape (k, n)
        States once in every period; for an autonomous model those on the section, or the
        smallest and largest ones of every period.
    """

    points: Array
    outcome: Outcome
    state: Array
    marks: Array


#: A value without a motion yet.
_NONE = SweptMotion(np.empty(0), Outcome("error", "", False), np.empty(0), np.empty((0, 0)))


def pass_in_strips(
    model: Model,
    values: Array,
    begin: Start,
    settings: ValueSettings,
    strips: int,
    advance: Callable[[], Any],
) -> tuple[SweepPass, Start]:
    """Run all values in strips; return the pass with the last successful state."""
    found = _Strips(model, values, settings, strips, advance)
    found.run(state_of(model, begin))
    motions, n = found.motions, len(found.turns)
    ends = np.array([m.state[:n] if m.outcome else np.full(n, np.nan) for m in motions])
    irregular = np.array([bool(m.outcome) for m in motions]) & (found.multiples(motions) == 0)
    one = pass_of(
        values, [m.points for m in motions], ends, [m.outcome for m in motions], irregular
    )
    return one, start_of(model, motions[-1].state)


@dataclass
class _Strips:
    """Motions at all values, and the state with which each strip began.

    Parameters
    ----------
    model : Model
    values : ndarray, shape (m,)
    settings : ValueSettings
    strips : int
    advance : callable
        Called once for each value.
    motions : list of SweptMotion
    """

    model: Model
    values: Array
    settings: ValueSettings
    strips: int
    advance: Callable[[], Any]
    motions: list[SweptMotion] = field(default_factory=list)

    def __post_init__(self) -> None:
        names = (*self.model.states, *self.model.slow_states)
        self._n = len(names)
        # of a state that is a factor of its own rate every size counts
        traits = self.model.traits
        invariant = {*traits.vanishing, *(name for some in traits.together for name in some)}
        self._alone = bool(invariant)
        self._least = np.array([0.0 if name in invariant else FLOOR for name in names])
        self.turns = periods_of(names, dict(self.model.periodic))
        self.resolved = resolve(self.settings.integration, self.model, implicit=True)
        given = {self.settings.parameter: self.values}
        self.periods = periods_of_trajectories(
            self.model, self.settings.period, len(self.values), given
        )
        # a thread has enough strips for its lanes
        execution = self.settings.execution
        threads = max(1, min(execution.workers, self.strips // WIDTH))
        self.execution = replace(execution, threads=threads)

    def run(self, begin: Array) -> None:
        """Run all strips from one state, then again from each other's ends until they agree."""
        edges = np.linspace(0, len(self.values), self.strips + 1).astype(int)
        firsts, lasts = edges[:-1], edges[1:] - 1
        self.motions = [_NONE._replace(state=begin)] * len(self.values)
        everything = np.arange(self.strips)
        self._follow(firsts, lasts, np.tile(begin, (self.strips, 1)), first=True)
        reached = [np.abs([m.state[: self._n], *m.marks]) for m in self.motions]
        extent = self._least * np.concatenate(reached).max(axis=0)
        self._least = np.maximum(extent, np.finfo(float).tiny)
        began = np.tile(begin, (self.strips, 1))
        while True:
            ends = np.array([began[0], *(self.motions[row].state for row in lasts[:-1])])
            again = everything[~np.all(_equal(began, ends), axis=1)]
            if not len(again):
                return
            began = ends
            self._follow(firsts[again], lasts[again], ends[again])

    def _follow(self, rows: Rows, lasts: Rows, states: Array, *, first: bool = False) -> None:
        """Run strips from their first rows to their ends, or until they agree with the former."""
        while len(rows):
            rows = rows.copy()
            for k, motion in enumerate(self._motions_at(rows, states)):
                row, old = int(rows[k]), self.motions[rows[k]]
                shift = None if first else self._shift(row, old, motion)
                if first:
                    self.advance()
                if shift == 0:
                    # the former run continues from its own state
                    motion, rows[k] = motion._replace(state=old.state), lasts[k]
                self.motions[row], states[k] = motion, motion.state
                if shift:
                    rows[k] = self._shifted(row, int(lasts[k]), shift)
                    states[k] = self.motions[rows[k]].state
            moving = rows < lasts
            rows, states, lasts = rows[moving] + 1, states[moving], lasts[moving]

    def _shifted(self, row: int, last: int, shift: int) -> int:
        """Advance the motions after a row by some periods, as long as its orbit lasts.

        All run at once from states that are advanced along their orbits.

        Returns
        -------
        int
            The last row that was run from the state with which the previous one ends.
        """
        period, *others = self.multiples(self.motions[row : last + 1]).tolist()
        states = [self.motions[row].state]
        for multiple, motion in zip(others, self.motions[row + 1 : last + 1], strict=True):
            if not multiple or period % multiple:
                break
            states.append(motion.marks[-1 - -shift % multiple])
        rows = np.arange(row + 1, row + len(states))
        if len(rows):
            for motion, expected in zip(
                self._motions_at(rows, np.array(states[:-1])), states[1:], strict=True
            ):
                row += 1
                self.motions[row] = motion
                allowed = max(PERIODIC_CHANGE, self.resolved.rtol)
                if not _near(motion.state, expected, self._size(expected[None]), allowed):
                    break
        return row

    def multiples(self, motions: Sequence[SweptMotion]) -> NDArray[np.int64]:
        """Number of marks after which each motion repeats, 0 if it does not."""
        found = np.zeros(len(motions), dtype=np.int64)
        counts = np.array([len(m.marks) for m in motions])
        allowed = max(PERIODIC_CHANGE, self.resolved.rtol)
        for count in np.unique(counts[counts > 1]):
            rows = counts == count
            marks = np.array([m.marks for m in motions if len(m.marks) == count])
            size = np.maximum(np.abs(marks).max(axis=1), self._least)
            found[rows] = repeats(marks, size, self.turns, allowed)[0]
        return found

    def _shift(self, row: int, old: SweptMotion, new: SweptMotion) -> int | None:
        """Number of periods by which two motions at a value are shifted, None for other motions.

        0 is for motions after which the same follows.
        """
        if bool(old.outcome) != bool(new.outcome):
            return None
        n = self._n
        size = self._size(np.array([old.state, new.state])[:, :n])
        switched = bool((old.state[n:] != new.state[n:]).any())
        if not switched and _near(old.state[:n], new.state[:n], size):
            return 0
        multiple, other = self.multiples([old, new])
        if multiple != other or not (len(old.marks) and len(new.marks)):
            return None
        if multiple:
            return self._shift_of_orbit(old.marks[-multiple:], new.marks[-multiple:])
        converging = _near(old.state[:n], new.state[:n], size, APART)
        same = not converging and _same_range(old.marks, new.marks) and self._sensitive(row, new)
        return 0 if same else None

    def _shift_of_orbit(self, old: Array, new: Array) -> int | None:
        """Shift of two periodic orbits, None for different ones."""
        size, allowed = self._size(old), max(AGREEING_MOTIONS, self.resolved.rtol)
        for k in range(len(new)):
            if _near(np.roll(old, -k, axis=0), new, size, allowed):
                # the time of an autonomous model has no phase; marks do not contain switches
                return 0 if self._autonomous else None if k and self.model.switches else k
        return None

    def _sensitive(self, row: int, motion: SweptMotion) -> bool:
        """Return whether a small disturbance of a motion grows, as in chaos."""
        size = self._size(motion.marks)
        states = np.array([motion.state, motion.state])
        states[1, : self._n] += DISTURBANCE * size
        length = self.settings.settle + self.settings.keep
        ends, codes, _ = self._final(np.array([row, row]), states, (0, length))
        return not codes.any() and not _near(
            *ends[:, : self._n], size, COMPARED_GROWTH * DISTURBANCE
        )

    def _size(self, states: Array) -> Array:
        """Sizes of states, at least a fraction of their extent over all values."""
        return np.maximum(np.abs(states).max(axis=0), self._least)

    def _motions_at(self, rows: Rows, states: Array) -> list[SweptMotion]:
        """Motions at some values from given states; failed ones are run alone for the reason."""
        found: Sequence[SweptMotion | None] = [None] * len(rows)
        # the notes of such models are those of single runs
        if not self._alone and np.isfinite(self.periods[rows]).all():
            with suppress(FastSlowError):
                found = (self._sampled if self._samples else self._recorded)(rows, states)
        motions = []
        for motion, value, state in zip(found, self.values[rows].tolist(), states, strict=True):
            if motion is None:
                begin = start_of(self.model, state)
                motion = self._motion(run_at(self.model, value, begin, self.settings), state)
            motions.append(motion)
        return motions

    @cached_property
    def _autonomous(self) -> bool:
        return self.model.period() is None

    @cached_property
    def _samples(self) -> bool:
        """Whether the ensemble gives the recorded points: samples, or extremes of periods."""
        model, settings = self.model, self.settings
        if settings.observe.what == "extremes":
            return not (model.resets or model.switches) and settings.column < self._n
        return settings.sampled(model)

    def _sampled(self, rows: Rows, states: Array) -> list[SweptMotion | None]:
        """Motions recorded from ensembles; None for those that fail."""
        settle, keep, column = self.settings.settle, self.settings.keep, self.settings.column
        phases = [0.0, self.settings.observe.phase] if self.settings.observe.phase else [0.0]
        times = np.add.outer(settle + np.arange(keep), phases).reshape(-1)
        ends, codes, samples = self._final(rows, states, (0, settle + keep), times)
        samples = samples.swapaxes(1, 2)
        begins = samples[:, :: len(phases)]
        points = samples[:, len(phases) - 1 :: len(phases), column]
        marks = np.concatenate([begins, ends[:, None, : self._n]], axis=1)
        if self.settings.observe.what == "extremes":
            extremes, failed = self._extremes(rows, begins)
            codes |= failed
            points = extremes[..., column]
            marks = extremes if self._autonomous else marks
        lasts = np.column_stack([(settle + keep) * self.periods[rows], ends])
        return [
            None
            if codes[k]
            else SweptMotion(
                points[k], outcome_of(0, 0, lasts[k], 0, states[k], (), (0, 0)), ends[k], marks[k]
            )
            for k in range(len(rows))
        ]

    def _extremes(self, rows: Rows, begins: Array) -> tuple[Array, NDArray[np.int64]]:
        """Smallest and largest states of every period, (m, 2 keep, n), from its first states."""
        m, keep, n = begins.shape
        first = self.settings.settle + np.tile(np.arange(keep), m)
        found = np.empty((m * keep, 2, n))
        span = first, first + 1
        states = begins.reshape(-1, n)
        _, codes, _ = self._final(np.repeat(rows, keep), states, span, extremes=found)
        return found.reshape(m, 2 * keep, n), codes.reshape(m, keep).max(axis=1)

    def _recorded(self, rows: Rows, states: Array) -> list[SweptMotion | None]:
        """Motions whose transients are an ensemble, recorded one by one; None for failed ones."""
        settings = self.settings
        ends, codes = states, np.zeros(len(rows), dtype=np.int64)
        if settings.settle:
            ends, codes, _ = self._final(rows, states, (0, settings.settle))
        firsts = settings.settle * self.periods[rows]
        found: list[SweptMotion | None] = []
        values = self.values[rows].tolist()
        for value, first, end, code in zip(values, firsts.tolist(), ends, codes, strict=True):
            here = self.model.with_parameters({settings.parameter: value})
            begin = start_of(self.model, end)
            run = None if code else recorded_run(here, begin, first, settings)
            found.append(self._motion(run, end) if run is not None and run.run else None)
        return found

    def _motion(self, found: ValueRun, state: Array) -> SweptMotion:
        """Return the motion of a run at one value from a state."""
        points, outcome, run = found
        if run is None:
            return SweptMotion(points, outcome, state, np.empty((0, self._n)))
        return SweptMotion(points, outcome, state_of(self.model, run.final_state), self._marks(run))

    def _marks(self, run: Trajectory) -> Array:
        """Marks of a recorded run, see `SweptMotion`."""
        observe, names = self.settings.observe, (*self.model.states, *self.model.slow_states)
        if not self._autonomous or observe.what == "stroboscopic":
            table = run.stroboscopic().table
        elif observe.what == "section":
            found = run.section(observe.section, level=observe.level, direction=observe.direction)
            table = found.table
        else:
            pairs = [extremes_of(run, name, self.settings.keep) for name in names]
            table = np.array(pairs).reshape(len(names), -1)
        return np.ascontiguousarray(table[: self._n].T)

    def _final(
        self,
        rows: Rows,
        states: Array,
        span: tuple[Any, Any],
        samples: Array | None = None,
        extremes: Array | None = None,
    ) -> tuple[Array, NDArray[np.int64], Array]:
        """Final states, codes and samples of an ensemble, with times in periods."""
        n, own = self._n, self.periods[rows]
        ends, codes, sampled, switched = final_states(
            self.model,
            np.ascontiguousarray(states[:, :n]),
            {self.settings.parameter: self.values[rows]},
            np.stack([edge * own for edge in span], axis=1),
            self.resolved,
            self.execution,
            None if samples is None else np.outer(own, samples),
            switches=states[:, n:] if self.model.switches else None,
            extremes=extremes,
        )
        return np.hstack([ends, switched]), codes, sampled


def state_of(model: Model, begin: Start) -> Array:
    """States followed by those of switches, NaN for none."""
    names = (*model.states, *model.slow_states, *model.switches)
    return np.array([begin.get(name, np.nan) for name in names])


def start_of(model: Model, state: Array) -> Start:
    """Return the inverse of `state_of`."""
    names = (*model.states, *model.slow_states, *model.switches)
    return {name: x for name, x in zip(names, state.tolist(), strict=True) if not math.isnan(x)}


def _equal(one: Array, other: Array) -> NDArray[np.bool_]:
    """Elements that are equal or both NaN."""
    return (one == other) | (np.isnan(one) & np.isnan(other))


def _near(one: Array, other: Array, size: Array, allowed: float = AGREEING_MOTIONS) -> bool:
    return bool((np.abs(one - other) <= allowed * size).all())


def _same_range(old: Array, new: Array) -> bool:
    """Return whether the ranges of two motions agree."""
    low, high = (np.array([end(x, axis=0) for x in (old, new)]) for end in (np.min, np.max))
    allowed = RANGE * (high.max(axis=0) - low.min(axis=0))
    return bool((np.ptp(low, axis=0) <= allowed).all() and (np.ptp(high, axis=0) <= allowed).all())
