"""Intervals between two episodes of following: jumps, oscillations, decaying oscillations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastslow.passage.overlay.following import Distances, Episode, Measured
from fastslow.passage.overlay.spikes import PROMINENT, extrema_of, refined
from fastslow.results.overlay.transitions import Phase
from fastslow.results.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]

#: Smallest number of oscillations in an oscillating phase.
OSCILLATIONS_OF_PHASE = 2

#: An oscillation decays if its last rise is below this fraction of the largest.
DECAYED = 0.5


@dataclass(frozen=True, eq=False)
class Excursion:
    """Samples between two episodes.

    Parameters
    ----------
    old, new : Episode or None
        Episodes before and after; None at the start and at the end of the run.
    turns : tuple of float
        Times of the maxima in between.
    sizes : tuple of float
        Rise to each of them, in units of the state.
    cycle : bool
        Whether it is an oscillating phase that does not decay onto a stable branch.
    """

    old: Episode | None
    new: Episode | None
    turns: tuple[float, ...] = ()
    sizes: tuple[float, ...] = ()
    cycle: bool = False

    @property
    def oscillating(self) -> bool:
        return len(self.turns) >= OSCILLATIONS_OF_PHASE

    def rows(self, m: Distances) -> tuple[int, int]:
        """First sample of the excursion, and the first after it."""
        return (
            0 if self.old is None else self.old.stop,
            len(m.t) if self.new is None else self.new.start,
        )


@dataclass(frozen=True, eq=False)
class Oscillation:
    """Prominent maxima and minima of the observed state.

    Parameters
    ----------
    times, sizes : ndarray, shape (K,)
        Times of the extrema, and the change of the state since the previous extremum.
    upper : ndarray of bool, shape (K,)
        Whether it is a maximum.
    """

    t: Array
    sizes: Array
    upper: NDArray[np.bool_]


def oscillation_of(m: Measured, observed: int) -> Oscillation:
    """Extrema of the observed state over the whole run; of an angle those of its sine."""
    values = m.scaled[:, observed] * m.extent[observed]
    if m.periods[observed] > 0:
        values = np.sin(2.0 * np.pi * m.scaled[:, observed] / m.periods[observed])
    reach = float(np.ptp(values))
    # variations by rounding have no extrema
    least = PROMINENT * reach if reach > 1e-9 * float(np.abs(values).max(initial=0.0)) else 0.0
    turns = extrema_of(values, least)
    if not len(turns.rows):
        return Oscillation(np.empty(0), np.empty(0), turns.upper)
    first = values[: turns.rows[0] + 1]
    before = first.min() if turns.upper[0] else first.max()
    sizes = np.abs(np.diff(np.r_[before, values[turns.rows]]))
    return Oscillation(refined(m.t, values, turns.rows), sizes, turns.upper)


def switching_of(run: Trajectory, observed: str) -> Oscillation:
    """Changes of the switch that changes most often, as extrema of the observed state.

    A relay oscillates between its thresholds however small their distance is.
    """
    table = np.empty((0, 3 + len(run.states))) if run.switch_table is None else run.switch_table
    if not len(table):
        return Oscillation(np.empty(0), np.empty(0), np.empty(0, dtype=bool))
    rows = table[table[:, 1] == np.bincount(table[:, 1].astype(int)).argmax()]
    values = rows[:, 3 + run.states.index(observed)]
    to_one = rows[:, 2] == 1
    higher = values[to_one].sum() * (~to_one).sum() > values[~to_one].sum() * to_one.sum()
    before = values[min(1, len(values) - 1)]
    sizes = np.abs(np.diff(values, prepend=before))
    return Oscillation(rows[:, 0], sizes, to_one if higher else ~to_one)


def excursions_of(
    m: Measured, episodes: list[Episode], swing: Oscillation, switching: Oscillation
) -> list[Excursion]:
    """Excursions between the episodes, before the first and after the last.

    Parameters
    ----------
    m : Measured
    episodes : list of Episode
    swing : Oscillation
        Of the observed state.
    switching : Oscillation
        Of a switch; used where it has more periods.
    """
    return [_excursion(m, e, swing, switching) for e in intervals_between(m, episodes)]


def intervals_between(m: Distances, episodes: Sequence[Episode]) -> list[Excursion]:
    """Excursions without oscillations; each has rows, or separates two episodes."""
    pairs = zip([None, *episodes], [*episodes, None], strict=True)
    found = [Excursion(old, new) for old, new in pairs]
    return [e for e in found if np.diff(e.rows(m))[0] > 0 or (e.old and e.new)]


def _excursion(
    m: Measured, between: Excursion, swing: Oscillation, switching: Oscillation
) -> Excursion:
    new, (start, stop) = between.new, between.rows(m)
    since, until = m.t[min(start, len(m.t) - 1)], m.t[min(stop, len(m.t) - 1)]
    many = ((one.upper & (one.t >= since) & (one.t <= until)).sum() for one in (swing, switching))
    swing = swing if next(many) >= next(many) else switching
    inside = (swing.t >= since) & (swing.t <= until)
    upper, lower = inside & swing.upper, inside & ~swing.upper
    if new is not None and upper.sum() + lower.sum() >= 2:
        rows = slice(start, stop)
        weight = np.diff(m.t[start : stop + 1])
        there = float(weight @ m.present[rows, new.arc]) > 0.5 * float(weight.sum())
        sizes = swing.sizes[inside]
        settling = there and sizes[-1] < DECAYED * sizes.max()
    else:
        settling = False
    # maxima are counted, or minima where a decaying oscillation begins downwards
    counted = lower if settling and lower.sum() > upper.sum() else upper
    oscillating = counted.sum() >= OSCILLATIONS_OF_PHASE
    return Excursion(
        between.old,
        new,
        tuple(swing.t[counted].tolist()),
        tuple(swing.sizes[counted].tolist()),
        bool(oscillating and not settling),
    )


def phase_of(
    m: Distances, e: Excursion, start: float, end: float, stable_branch: str, away: str
) -> Phase:
    """Phase between departure and landing.

    Parameters
    ----------
    m : Distances
    e : Excursion
    start, end : float
        Times of departure and landing.
    stable_branch : str
        Stable branch of the landing, "" for none.
    away : str
        Kind of phase if it does not oscillate.
    """
    first, _ = e.rows(m)
    if first < len(m.t) and not m.within[first]:
        return Phase(start, end, "outside")
    if e.oscillating and (e.cycle or e.old is not None):
        return Phase(
            start,
            end,
            "oscillating",
            () if e.cycle else (stable_branch,),
            len(e.turns),
            "cycle" if e.cycle else "equilibrium",
            tuple(np.diff(e.turns).tolist()),
            e.sizes,
        )
    if e.old is None or e.new is None:
        return Phase(start, end, "transient", oscillations=len(e.turns))
    return Phase(start, end, away, (stable_branch,), len(e.turns))
