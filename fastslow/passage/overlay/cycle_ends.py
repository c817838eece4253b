"""Classification of the ends of oscillating phases."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fastslow.passage.overlay.attracting_branches import ends_of
from fastslow.passage.overlay.excursions import Excursion
from fastslow.passage.overlay.spikes import extrema_of
from fastslow.passage.overlay.traced_cycles import TracedEnd, own_end, traced_end
from fastslow.passage.overlay.transitions import OverlaidRun
from fastslow.results.angles import apart
from fastslow.results.orbits.special_orbit import SpecialOrbit
from fastslow.results.overlay.transitions import OSCILLATING, Transition
from fastslow.results.points import SpecialPoint
from fastslow.results.trajectory.events.crossings import Crossing

#: Relative amplitude below which the cycle is taken to shrink to a point.
SHRUNK_AMPLITUDE = 0.5

#: Ratio of the last interval to the median above which the period is taken to increase.
SLOWED = 1.5

#: Relative prominence of an extremum of a forcing.
FORCING_WIGGLE = 0.02

#: Smallest number of oscillations per extremum of a slow forcing.
OSCILLATIONS = 2

#: Largest distance of the last oscillation from a saddle of a homoclinic candidate, in radii.
SADDLE_DISTANCE = 1.0


@dataclass(frozen=True, eq=False)
class CycleEnd:
    """End of an oscillating phase on a cycle.

    Parameters
    ----------
    name : str
        ``"Hopf"``, ``"homoclinic"``, ``"circle"``, ``"fold cycle"``, ``"grazing (candidate)"``,
        ``"fold cycle (candidate)"``, ``"homoclinic (candidate)"`` or ``"unclassified"``.
    special : SpecialPoint, SpecialOrbit or None
        The Hopf point, or the end of the traced cycles, if any.
    evidence : str
    delay : float
        Distance of the last oscillation past the end of the traced cycles.
    """

    name: str
    special: SpecialPoint | SpecialOrbit | None
    evidence: str
    delay: float = float("nan")


def cycle_end(
    p: OverlaidRun, e: Excursion, known: dict[tuple[str, str], TracedEnd | None]
) -> CycleEnd:
    """Classify the end of the fast cycle of an excursion that lands on a stable branch.

    The cycle ends at a supercritical Hopf point if the stable branch of the landing begins
    there and the amplitude decreases; otherwise at a bifurcation of the cycle itself, which the
    equilibria do not show. It is the end of the traced cycles on which the run oscillates, if
    there are any. Else it is identified by simulation of the cycle of the frozen fast
    subsystem towards its end (`frozen_end`), once for each pair of stable branches. Without
    the frozen model it is a candidate identified from the run alone: the period increases
    towards a saddle (homoclinic), the cycle reaches an interface (grazing), or neither (fold of
    cycles).

    Parameters
    ----------
    p : OverlaidRun
    e : Excursion
    known : dict
        Cache of ends of the frozen cycle by the labels of the old and the new stable branch.
    """
    assert e.new is not None
    name = p.diagram.parameter
    entered = p.stable_branches[p.followed[e.new.start]]
    sizes, intervals = np.array(e.sizes), np.diff(e.turns)
    last = p.state_at(e.turns[-1])
    size = float(sizes[-1] / sizes.max())
    words = [f"the last oscillation has {size:.0%} of the largest amplitude"]
    growth = float(intervals[-1] / np.median(intervals)) if len(intervals) > 2 else float("nan")
    if np.isfinite(growth):
        words.append(f"the last interval is {growth:.2g} times the median")
    hopf = [
        point
        for point in ends_of(p.diagram, entered)
        if point.kind.starts_cycles and point.criticality != "subcritical"
    ]
    landing = float(p.m.slow[e.new.start])
    begun = [h for h in hopf if (h[name] - p.slow.table[e.rows(p.m)[0]]) * (landing - h[name]) >= 0]
    if begun and size < SHRUNK_AMPLITUDE:
        return CycleEnd("Hopf", begun[0], "; ".join(words))
    words.insert(0, "a bifurcation of the cycle, not of equilibria")
    traced = traced_end(p, e.turns) if p.cycles and len(e.turns) > 1 else None
    if traced is not None:
        words.append(traced.evidence)
        return CycleEnd(traced.name, traced.point, "; ".join(words), traced.delay)
    near = [q for q in p.diagram.special if q.kind.changes_stability]
    if near:
        closest = min(near, key=lambda q: abs(q[name] - last.value))
        away = abs(closest[name] - last.value)
        words.append(f"nearest special point {closest.label}, {away:.3g} away")
    distance = _saddle(p, e, last.value)
    if distance is not None:
        words.append(f"the last oscillation passes a saddle within {distance:.2g} of the extent")
    reached = _first_reached(p, e)
    if reached is not None:
        words.append(f"{reached.interface} is reached for the first time at t = {reached.time:.6g}")
    frozen = None
    if e.old is not None and slowly(p, e):
        stable_branches = p.stable_branches[p.followed[e.old.stop - 1]].label, entered.label
        if stable_branches not in known:
            known[stable_branches] = own_end(p, e.turns)
        frozen = known[stable_branches]
    if frozen is not None:
        words.append(frozen.evidence)
        return CycleEnd(frozen.name, None, "; ".join(words))
    steady = not growth > SLOWED and size >= SHRUNK_AMPLITUDE and np.isfinite(growth)
    if (
        growth > SLOWED
        and size >= SHRUNK_AMPLITUDE
        and distance is not None
        and distance < SADDLE_DISTANCE * p.m.radius
    ):
        return CycleEnd("homoclinic (candidate)", None, "; ".join(words))
    if steady:
        cause = "fold cycle" if reached is None else "grazing"
        return CycleEnd(f"{cause} (candidate)", None, "; ".join(words))
    return CycleEnd("unclassified", None, "; ".join(words))


def slowly(p: OverlaidRun, e: Excursion) -> bool:
    """Whether the slow quantity has fewer extrema than the oscillation."""
    if not p.slow.laws and p.slow.name not in p.slow.run.forcing:
        return True
    start, stop = e.rows(p.m)
    turns = extrema_of(p.m.slow[start:stop], FORCING_WIGGLE * p.m.span)
    return OSCILLATIONS * len(turns.rows) <= len(e.turns)


def _first_reached(p: OverlaidRun, e: Excursion) -> Crossing | None:
    """Crossing in the last oscillation of an interface that no earlier oscillation reaches."""
    start, _ = e.rows(p.m)
    crossings = [c for c in p.slow.run.crossings if p.m.t[start] <= c.time]
    before = {c.interface for c in crossings if c.time < e.turns[-2]}
    # crossings after the last maximum belong to the last oscillation
    end = 2.0 * e.turns[-1] - e.turns[-2]
    last = (c for c in crossings if e.turns[-2] <= c.time <= end)
    return next((c for c in last if c.interface not in before), None)


def _saddle(p: OverlaidRun, e: Excursion, value: float) -> float | None:
    """Scaled distance of the last oscillation from the nearest saddle."""
    low, high = p.diagram.over
    if not low <= value <= high:
        return None
    at: dict[str, Any] = {p.diagram.parameter: value}
    found = p.diagram.at(**at)
    saddles = [q.state for q in found if q.type.startswith("saddle") and q.admissible]
    if not saddles:
        return None
    since = e.turns[-2] if len(e.turns) > 1 else e.turns[-1]
    _, stop = e.rows(p.m)
    rows = slice(int(np.searchsorted(p.m.t, since)), stop)
    states, periods = p.m.scaled[rows], p.m.periods
    away = [np.linalg.norm(apart(states, s / p.m.extent, periods), axis=1).min() for s in saddles]
    return float(min(away))


def ending(p: OverlaidRun, e: Excursion, end: CycleEnd) -> Transition:
    """Transition from an oscillating phase to the stable branch followed afterwards."""
    assert e.new is not None
    last = p.state_at(e.turns[-1])
    entered = p.stable_branches[p.followed[e.new.start]]
    delay, hopf = end.delay, None
    if isinstance(end.special, SpecialPoint):
        # past the Hopf point in the direction of the drift, onto the stable branch
        hopf = end.special
        delay = -p.delay(entered, hopf, last.value)
    return Transition(
        time=last.time,
        value=last.value,
        state=last.state,
        from_branch=OSCILLATING,
        to_branch=entered.label,
        special=end.special,
        delay=delay,
        type="end of oscillation",
        leave=last,
        land=p.landed(e.new, last.time),
        slope=p.slope(hopf, last.time),
        note=end.evidence,
    )
