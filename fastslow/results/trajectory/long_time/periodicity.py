"""Detection of equilibria and periodic orbits at the end of a run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastslow.results.angles import apart, periods_of
from fastslow.results.base.outcome import Outcome, stopped_early
from fastslow.results.base.result import Result
from fastslow.results.trajectory.long_time.section import (
    Section,
    level_section,
    selected,
    stroboscopic_section,
)
from fastslow.results.trajectory.steps.dense import DenseOutput

Array = NDArray[np.float64]

#: Fraction of a run, at its end, that is examined.
LATE = 0.5

#: A state whose range is below this fraction of its size is constant.
CONSTANT_RANGE = 1e-9

#: Changes below this multiple of the relative tolerance are integration errors; on an
#: attracting orbit those of one period add up to some tens of tolerances.
INTEGRATION_ERRORS = 1e3

#: A run has settled if its distance from the limit is at most this many tolerances.
SETTLED_TOLERANCES = 100.0


@dataclass(frozen=True, eq=False, repr=False)
class Periodicity(Result):
    """The period of the motion at the end of a run.

    Parameters
    ----------
    multiple : int or None
        Number of periods of the forcing (without forcing: of returns to the section)
        after which the states repeat: 1, 2 after a period doubling, …; None if they do
        not repeat.
    period : float or None
        The period of the motion.
    since : float or None
        Time from which the motion is periodic.
    distance : float
        Largest change of a state over one period, in units of its range; without a
        period, the smallest among those tried.
    section : Section
        The states that were compared.
    outcome : Outcome
        ``"periodic"``, ``"equilibrium"``, ``"too short"``, ``"not periodic"``, or
        ``"drifting"`` if changes below the tolerance do not decrease, as near a
        fold of periodic solutions.
    left : float
        Estimated distance from the limit, in the same units, by the rate at which the
        changes decrease; infinite if they do not.

    Examples
    --------
    >>> import sympy as sp, fastslow as fs
    >>> x, v, t = sp.symbols("x v t")
    >>> run = fs.simulate(fs.Model({x: v, v: sp.sin(t) - x - v}), [-1, 0], periods=20)
    >>> run.periodicity()
    Periodicity: repeats after 1 period, 6.28318531, from t = 0 on.
    """

    multiple: int | None
    period: float | None
    since: float | None
    distance: float
    section: Section
    outcome: Outcome
    left: float = float("nan")

    def __repr__(self) -> str:
        return f"Periodicity: {self.outcome}"


def periodicity_of(
    dense: DenseOutput, period: float | None, tol: float, max_multiple: int, rtol: float
) -> Periodicity:
    """Detect a period; see `Trajectory.periodicity`."""
    span, early = dense.span, stopped_early(dense.outcome)
    # raises the appropriate error for a run without steps
    dense(span[1])
    late = span[1] - LATE * (span[1] - span[0])
    # both ends of the steps suffice to estimate the range of a state
    everywhere, times = dense.nodes_and_jumps
    settled = everywhere[times >= late]
    periods = periods_of(dense.states, dense.periods)
    most_apart = np.where(periods > 0, periods, np.inf)
    ranges, whole = (
        np.minimum(np.ptp(table, axis=0), most_apart) for table in (settled, everywhere)
    )
    # a constant state is compared with its largest modulus
    size = np.abs(everywhere).max(axis=0)
    least = CONSTANT_RANGE * np.where(size > 0, size, 1.0)
    scale = np.maximum(ranges, least)
    if period is not None:
        section = stroboscopic_section(dense, period, 0.0, span)
        unit = "periods"
    else:
        if (ranges <= tol * np.maximum(whole, least)).all():
            section = Section(
                "", dense.states, np.empty(0), np.empty((len(dense.states), 0)), _NONE
            )
            text = "the run settles on an equilibrium." + early
            still = Outcome("equilibrium", text, True)
            return Periodicity(None, None, late, float(ranges.max()), section, still)
        widest = int(np.argmax(ranges))
        name = dense.states[widest]
        mean = dense.mean(name, late)
        section = selected(level_section(dense, name, mean), 1, span)
        unit = f"returns to {name} = {mean:.6g}"
    states = section.table[: len(dense.states)] / scale[:, None]
    strobed = _Strobed(
        section, states, periods / scale, unit, tol, INTEGRATION_ERRORS * rtol, early
    )
    return strobed.repeats(max_multiple)


@dataclass(frozen=True, eq=False)
class _Strobed:
    """The states at a section, in units of their ranges, and what they are compared by."""

    section: Section
    states: Array
    periods: Array
    unit: str
    tol: float
    noise: float
    early: str

    def repeats(self, max_multiple: int) -> Periodicity:
        """Return the period after which the states repeat, or why there is none."""
        smallest = np.inf
        for multiple in range(1, min(max_multiple + 1, len(self.section))):
            change = self._change(multiple)
            wrong = np.flatnonzero(change > self.tol)
            first = int(wrong[-1]) + 1 if len(wrong) else 0
            smallest = min(smallest, float(change[-max(multiple, 2) :].max()))
            # at least as many repeats as points of the orbit
            if len(change) - first >= max(multiple, 2):
                return self._repeating(multiple, first, float(change[first:].max()))
        if len(self.section) < 3:
            some = _some(len(self.section), self.unit)
            text = f"only {some} within the run; simulate for longer.{self.early}"
            return self._none(smallest, Outcome("too short", text, False))
        text = (
            f"no repeat within {self.tol:g} after up to {max_multiple} {self.unit}: "
            "quasi-periodic, chaotic, or not yet settled; simulate for longer, or raise "
            f"max_multiple= or tol=.{self.early}"
        )
        return self._none(smallest, Outcome("not periodic", text, False))

    def _change(self, multiple: int) -> Array:
        """Largest change of a state over some returns, up to each of the later ones."""
        later, former = self.states[:, multiple:], self.states[:, :-multiple]
        change: Array = np.abs(apart(later, former, self.periods[:, None])).max(axis=0)
        return change

    def _repeating(self, multiple: int, first: int, worst: float) -> Periodicity:
        """The period of states that repeat from a return on, unless they drift."""
        section, some = self.section, _some(multiple, self.unit)
        since = float(section.t[first])
        left, moved = _left(self.states[:, first:], self.periods, multiple, self.noise)
        if left > SETTLED_TOLERANCES * self.tol:
            text = (
                f"the changes over {some}, up to {worst:.2g} of the range, hardly shrink: they add "
                f"up to {moved:.2g} since t = {since:.6g}; a slow passage, as near a fold of "
                "periodic solutions, or not yet settled: simulate for longer."
            )
            return self._none(worst, Outcome("drifting", text, False), left)
        length = float(section.t[-1] - section.t[-1 - multiple])
        text = f"repeats after {some}, {length:.9g}, from t = {since:.6g} on."
        if left > self.tol:
            text = f"{text[:-1]}; the changes shrink, {left:.2g} of the range is left."
        outcome = Outcome("periodic", text + self.early, True)
        return Periodicity(multiple, length, since, worst, section, outcome, left)

    def _none(self, distance: float, outcome: Outcome, left: float = np.nan) -> Periodicity:
        return Periodicity(None, None, None, distance, self.section, outcome, left)


_NONE = np.empty(0, dtype=np.int64)


def _left(states: Array, periods: Array, multiple: int, noise: float) -> tuple[float, float]:
    """Return the distance of states from their limit, and the distance they moved.

    The limit is extrapolated from both halves of a run, assuming geometric convergence.
    """
    same = states[:, (states.shape[1] - 1) % multiple :: multiple]
    middle, extra = divmod(same.shape[1] - 1, 2)
    middle += extra

    def distance(first: int, last: int) -> float:
        return float(np.abs(apart(same[:, last], same[:, first], periods)).max())

    before, after, moved = distance(extra, middle), distance(middle, -1), distance(0, -1)
    left = after**2 / (before - after) if after < before else float("inf")
    return (min(left, after) if after <= noise else left), moved


def _some(count: int, unit: str) -> str:
    return f"{count} {unit if count != 1 else _single(unit)}"


def _single(unit: str) -> str:
    return unit.replace("periods", "period").replace("returns", "return")
