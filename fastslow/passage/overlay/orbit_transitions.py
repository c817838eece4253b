"""Transitions of a run along branches of periodic orbits: departures and passages of contacts."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastslow.passage.overlay.excursions import Excursion
from fastslow.passage.overlay.following import WAY, Episode
from fastslow.passage.overlay.orbit_arcs import ends_branch
from fastslow.passage.overlay.overlaid_arcs import OverlaidArcs
from fastslow.passage.overlay.strobed_runs import FrozenOrbits, Strobed
from fastslow.passage.overlay.transitions import BEFORE_END
from fastslow.results.orbits.orbit import Orbit
from fastslow.results.orbits.orbit_branch import OrbitBranch
from fastslow.results.orbits.special_orbit import SpecialOrbit
from fastslow.results.overlay.transitions import StableBranch, Transition
from fastslow.results.trajectory.queries.state_at import StatePoint
from fastslow.results.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]

#: Time before a corner collision in which crossings are counted, in units of the period; and the
#: difference of phases that is rounding.
COUNTED_BEFORE, PHASE_ROUNDING = 1 / 3, 1e-9


@dataclass(frozen=True, eq=False)
class OverlaidStrobes(OverlaidArcs):
    """The strobes of a run over periodic orbits.

    Parameters
    ----------
    m : Strobed
    branches : tuple of OrbitBranch
    frozen : FrozenOrbits
    """

    m: Strobed
    branches: tuple[OrbitBranch, ...]
    frozen: FrozenOrbits

    def within(self, episode: Episode) -> Iterator[Transition]:
        return _contacts(self, episode)

    def departure(self, excursion: Excursion) -> Transition:
        assert excursion.old is not None
        return _departure(self, excursion.old, excursion.new)

    def landed(self, episode: Episode, not_before: float) -> StatePoint:
        return self.strobe(episode.start)

    def away(self, excursion: Excursion, first: Transition) -> str:
        old, new = excursion.old, excursion.new
        return "excursion" if old is not None and new is not None and old.arc == new.arc else "jump"

    def strobe(self, row: int) -> StatePoint:
        """State and slow quantity at a strobe."""
        return self.state_at(float(self.m.t[row]))


@dataclass(frozen=True)
class StableEnd:
    """An end of a stable branch.

    Parameters
    ----------
    value : float
        Of the parameter.
    direction : int
        +1 for the upper end, −1 for the lower one.
    point : SpecialOrbit or None
    note : str
        Why there is none.
    """

    value: float
    direction: int
    point: SpecialOrbit | None
    note: str = ""


def _departure(p: OverlaidStrobes, old: Episode, new: Episode | None) -> Transition:
    """The departure from a stable branch: special point, delay and landing."""
    m, label = p.m, p.label(old.stop - 1)
    row = old.stop
    if new is not None and new.arc != old.arc:
        rows = np.arange(old.stop, new.start + 1)
        done = (m.way(old.arc, new.arc)[rows] > WAY) & m.present[rows, new.arc]
        row = int(rows[np.argmax(done)]) if done.any() else new.start
    value = float(m.slow[row])
    ends = _ends(p, int(p.followed[old.stop - 1]))
    end = max(ends, key=lambda e: e.direction * (value - e.value))
    delay = end.direction * (value - end.value)
    reached = delay >= -BEFORE_END * m.span
    point = end.point if reached else None
    if point is not None:
        kind = "jump" if point.turns else point.kind.transition or "grazing"
    elif new is not None and new.arc == old.arc:
        kind = "excursion"
    else:
        kind = "loss of tracking"
    return Transition(
        time=float(m.t[row]),
        value=value,
        state=p.strobe(row).state,
        from_branch=label,
        to_branch="" if new is None else p.label(new.start),
        special=point,
        delay=delay if point is not None else float("nan"),
        type=kind,
        leave=p.strobe(old.stop),
        land=None if new is None else p.strobe(new.start),
        slope=abs(float(m.drift[row])),
        note=end.note if reached else "",
    )


def _ends(p: OverlaidStrobes, number: int) -> list[StableEnd]:
    """Both ends of a stable branch."""
    one = p.stable_branches[number]
    branch = p.branches[one.branch]
    rows = one.start, one.stop - 1
    low = min(rows, key=lambda row: float(branch.values[row]))
    found = []
    for row in rows:
        point = next(
            (
                q
                for q, at in zip(branch.special, branch.special_rows, strict=True)
                if at == row and ends_branch(q)
            ),
            None,
        )
        note = ""
        if point is None and row in (0, len(branch) - 1):
            outcome = branch.outcomes[0 if row == 0 else 1]
            note = f"the branch ends there: {outcome.code}"
        found.append(StableEnd(float(branch.values[row]), -1 if row == low else 1, point, note))
    return found


def _contacts(p: OverlaidStrobes, episode: Episode) -> Iterator[Transition]:
    """Yield the passages of contacts with interfaces at which a followed branch persists."""
    m, found = p.m, []
    rows = np.arange(episode.start, episode.stop)
    for number in np.unique(p.followed[rows]):
        one = p.stable_branches[number]
        branch = p.branches[one.branch]
        inner = rows[p.followed[rows] == number]
        for point, row in zip(branch.special, branch.special_rows, strict=True):
            if not point.interface or not one.start < row < one.stop - 1:
                continue
            gap = m.slow[inner] - branch.values[row]
            passed = np.flatnonzero((gap[:-1] < 0) != (gap[1:] < 0))
            change = _change(p, branch, point, int(row)) if len(passed) else None
            if change is not None:
                found += [
                    _contact(p, one, change, inner[at : at + 2], inner) for at in passed.tolist()
                ]
    yield from sorted(found, key=lambda transition: transition.time)


class Change(NamedTuple):
    """How the crossings of an interface per period change at a contact of orbits.

    Parameters
    ----------
    point : SpecialOrbit
    row : int
        Of its branch.
    hits : ndarray of int64, shape (N,)
        Crossings by the run, from each strobe.
    below, above : int
        Those of the orbits, at smaller and at larger values of the parameter.
    words : str
        What is counted.
    """

    point: SpecialOrbit
    row: int
    hits: NDArray[np.int64]
    below: int
    above: int
    words: str


def _change(
    p: OverlaidStrobes, branch: OrbitBranch, point: SpecialOrbit, row: int
) -> Change | None:
    """The change at a contact; None if no crossings change.

    At a corner collision the number of crossings before it changes, in a part of the period.
    """
    count, length = p.frozen.multiple // (branch.multiple or 1), p.frozen.period * p.frozen.multiple
    near = sorted((_other(branch, row, -1), _other(branch, row, 1)), key=branch.values.__getitem__)
    if not point.kind.exchanging:
        name = point.interface
        below, above = (count * branch[k].hits(name) for k in near)
        hits = _hits(p.slow.run, name, p.m.t, length)
        return Change(point, row, hits, below, above, f"the crossings of {name} per period")
    period = p.frozen.period * (branch.multiple or 1)
    phase, window = point.time % period, COUNTED_BEFORE * period
    for name in point.interface.split(" and "):
        if name not in p.slow.run.interfaces:
            continue
        gaps = [_before(branch[k], name, phase) for k in near]
        below, above = (int((gap < window).sum()) for gap in gaps)
        # an interface in time is always crossed there
        timed = all((np.minimum(gap, period - gap) < PHASE_ROUNDING * period).any() for gap in gaps)
        if below != above and not timed:
            hits = _hits(p.slow.run, name, p.m.t + phase - window, window)
            words = f"the crossings of {name} shortly before phase {phase:.6g}"
            return Change(point, row, hits, below, above, words)
    return None


def _hits(run: Trajectory, interface: str, since: Array, length: float) -> NDArray[np.int64]:
    """Crossings of an interface by a run within some time after each of several times."""
    times = np.array([c.time for c in run.crossings(interface) if c.direction != 0])
    return np.searchsorted(times, since + length) - np.searchsorted(times, since)


def _other(branch: OrbitBranch, row: int, step: int) -> int:
    """The next row with another value of the parameter than that of a point."""
    k = row + step
    while 0 < k < len(branch) - 1 and branch.values[k] == branch.values[row]:
        k += step
    return k


def _before(orbit: Orbit, interface: str, phase: float) -> Array:
    """Times from the crossings of an interface by an orbit to a phase of the forcing."""
    times = [c.time for c in orbit.trajectory.crossings(interface) if c.direction != 0]
    return (phase - np.array(times)) % orbit.period


def _contact(
    p: OverlaidStrobes,
    one: StableBranch,
    change: Change,
    passed: NDArray[np.intp],
    inside: NDArray[np.intp],
) -> Transition:
    """The strobe at which the run's crossings become those of the orbits beyond a contact."""
    m, point, hits = p.m, change.point, change.hits
    direction = 1 if m.slow[passed[1]] > m.slow[passed[0]] else -1
    before, after = (change.below, change.above)[::direction]
    changes = [
        k
        for j, k in pairwise(inside.tolist())
        if hits[j] == before != after == hits[k] and k == j + 1
    ]
    at = min(changes, key=lambda k: abs(k - int(passed[1])), default=None)
    time = int(passed[1]) if at is None else at
    value = float(m.slow[time])
    return Transition(
        time=float(m.t[time]),
        value=value,
        state=p.strobe(time).state,
        from_branch=one.label,
        to_branch=one.label,
        special=point,
        delay=float("nan") if at is None else direction * (value - float(point[point.parameter])),
        type="crossing",
        leave=p.strobe(time),
        slope=abs(float(m.drift[time])),
        note=""
        if at is not None
        else f"{change.words} do not change from {before} to {after} near it",
    )
