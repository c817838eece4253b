"""Whether a run has settled, and after how many periods it repeats."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import ArgumentError
from fastslow.results.angles import apart, periods_of
from fastslow.results.outcome import Outcome
from fastslow.results.result import Result
from fastslow.results.sections import Section, poincare_section, stroboscopic_section

if TYPE_CHECKING:
    from fastslow.results.trajectories import Trajectory

Array = NDArray[np.float64]

#: Only the last half of a run says what it settles on.
LATE = 0.5


@dataclass(frozen=True, eq=False)
class SteadyState(Result):
    """What a run settles on.

    Parameters
    ----------
    multiple : int or None
        After how many periods of the forcing (without forcing: after how many
        returns to the section) the states repeat: 1, 2 for a doubled period, …;
        None when they do not.
    period : float or None
        Length of time after which they repeat.
    since : float or None
        Time from which they do.
    distance : float
        Largest change over that time, in units of each state's range; without
        a period, the smallest among those tried.
    section : Section
        The states compared.
    outcome : Outcome
        ``"periodic"``, ``"equilibrium"``, ``"too short"`` or ``"not periodic"``.

    Examples
    --------
    >>> import sympy as sp, fastslow as fs
    >>> x, v, t = sp.symbols("x v t")
    >>> run = fs.simulate(fs.Model({x: v, v: sp.sin(t) - x - v}), [-1, 0], periods=20)
    >>> run.steady()
    SteadyState: repeats after 1 period, 6.28318531, from t = 0 on.
    """

    multiple: int | None
    period: float | None
    since: float | None
    distance: float
    section: Section
    outcome: Outcome

    def __repr__(self) -> str:
        return f"SteadyState: {self.outcome}"


def steady_state(run: Trajectory, period: float | None, tol: float, most: int) -> SteadyState:
    """Look for a period; see `Trajectory.steady`."""
    if not tol > 0:
        raise ArgumentError(f"tol = {tol!r}; expected a positive number")
    if most < 1:
        raise ArgumentError(f"most = {most!r}; expected at least 1")
    # says what is wrong with a run that kept nothing, or made no step
    run.dense_columns(run.span[1])
    assert run.series is not None
    late = run.span[1] - LATE * (run.span[1] - run.span[0])
    # the ends of steps are close enough to each other to tell how far a state ranges
    everywhere = np.vstack([run.series[:, : len(run.states), 0], run.end[1:]])
    settled = everywhere[np.append(run.steps[:, 0] >= late, True)]
    periods = periods_of(run.states, run.periods)
    most_apart = np.where(periods > 0, periods, np.inf)
    ranges, whole = (
        np.minimum(np.ptp(table, axis=0), most_apart) for table in (settled, everywhere)
    )
    # a state that does not move is compared with its own size
    least = 1e-9 * (1.0 + np.abs(settled).max(axis=0))
    scale = np.maximum(ranges, least)
    if period is not None or run.period is not None:
        section = stroboscopic_section(run, period, 0.0, None)
        unit = "periods"
    else:
        if (ranges <= tol * np.maximum(whole, least)).all():
            section = Section("", run.states, np.empty(0), np.empty((len(run.states), 0)), _NONE)
            still = Outcome("equilibrium", "the run settles on an equilibrium.", True)
            return SteadyState(None, None, late, float(ranges.max()), section, still)
        widest = int(np.argmax(ranges))
        mean = _mean(run, widest, late)
        name = run.states[widest]
        section = poincare_section(run, name, mean, 1, None, run.span)
        unit = f"returns to {name} = {mean:.6g}"
    states = section.table[: len(run.states)] / scale[:, None]
    smallest = np.inf
    for multiple in range(1, most + 1):
        if multiple >= len(section):
            break
        later, former = states[:, multiple:], states[:, :-multiple]
        change = np.abs(apart(later, former, (periods / scale)[:, None])).max(axis=0)
        wrong = np.flatnonzero(change > tol)
        first = int(wrong[-1]) + 1 if len(wrong) else 0
        agreeing = change[first:]
        smallest = min(smallest, float(change[-max(multiple, 2) :].max()))
        # as many repeats as there are points, or the next point might still differ
        if len(agreeing) >= max(multiple, 2):
            length = float(section.times[-1] - section.times[-1 - multiple])
            text = f"repeats after {multiple} {unit if multiple > 1 else _single(unit)}"
            text += f", {length:.9g}, from t = {section.times[first]:.6g} on."
            return SteadyState(
                multiple,
                length,
                float(section.times[first]),
                float(agreeing.max()),
                section,
                Outcome("periodic", text, True),
            )
    if len(section) < 3:
        count = f"{len(section)} {unit if len(section) != 1 else _single(unit)}"
        text = f"only {count} within the run; simulate for longer."
        return SteadyState(None, None, None, smallest, section, Outcome("too short", text, False))
    text = (
        f"no repeat within {tol:g} after up to {most} {unit}: quasi-periodic, chaotic, or not "
        "yet settled; simulate for longer, or raise most= or tol=."
    )
    return SteadyState(None, None, None, smallest, section, Outcome("not periodic", text, False))


_NONE = np.empty(0, dtype=np.int64)


def _single(unit: str) -> str:
    return unit.replace("periods", "period").replace("returns", "return")


def _mean(run: Trajectory, row: int, since: float) -> float:
    """Time average of a state over the steps that begin after a time."""
    assert run.series is not None
    late = run.steps[:, 0] >= since
    if not late.any():
        late = np.ones(len(run.steps), dtype=bool)
    length = run.steps[late, 1]
    k = np.arange(run.series.shape[2])
    area = run.series[late, row] * length[:, None] ** (k + 1) / (k + 1)
    return float(area.sum() / length.sum())
