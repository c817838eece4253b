"""How an oscillating phase ends: what the fast cycle does before it, and what lies there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fastslow.passage.overlay.attracting_branches import ends_of
from fastslow.passage.overlay.excursions import Excursion
from fastslow.passage.overlay.frozen_cycles import FrozenEnd, frozen_end
from fastslow.passage.overlay.spikes import turns_of
from fastslow.passage.overlay.transitions import Passage
from fastslow.results.angles import apart
from fastslow.results.overlay.transitions import OSCILLATING, Transition
from fastslow.results.point_types import POINT_TYPES
from fastslow.results.points import SpecialPoint
from fastslow.results.trajectory.crossings import Crossing

#: Amplitudes that sink below this part of their largest say that the cycle shrinks to a point.
SHRUNK = 0.5

#: Intervals that grow to this many times their median say that the cycle's period grows.
SLOWED = 1.5

#: A forcing turns round by more than this fraction of its range.
WIGGLE = 0.02

#: A slow forcing turns round no more often than once in so many oscillations.
OSCILLATIONS = 2

#: A saddle is met when the last oscillation passes it within this many radii.
MET = 1.0


@dataclass(frozen=True, eq=False)
class CycleEnd:
    """The end of an oscillating phase on a cycle.

    Parameters
    ----------
    name : str
        ``"Hopf"``, ``"homoclinic"``, ``"circle"``, ``"grazing (candidate)"``,
        ``"fold cycle (candidate)"``, ``"homoclinic (candidate)"`` or ``"unclassified"``.
    special : SpecialPoint or None
        The Hopf point, where there is one.
    evidence : str
    """

    name: str
    special: SpecialPoint | None
    evidence: str


def cycle_end(p: Passage, e: Excursion, known: dict[tuple[str, str], FrozenEnd | None]) -> CycleEnd:
    """What ends the fast cycle of an excursion that lands on a sheet.

    A supercritical Hopf point ends it where the sheet landed on begins there and the amplitude
    shrinks; else it is a bifurcation of the cycle itself, which equilibria do not
    show. It is named by the cycle of the frozen fast subsystem, followed towards its end
    (`frozen_end`), once for each pair of sheets. Where the frozen model is not known, it is
    named by the run alone, and is a candidate: its period grows towards a saddle
    (homoclinic), it reaches an interface (grazing), or neither (fold of cycles).

    Parameters
    ----------
    p : Passage
    e : Excursion
    known : dict
        Ends of the frozen cycle by the sheets left and landed on; what is found is added.
    """
    assert e.new is not None
    name = p.diagram.parameter
    entered = p.sheets[p.followed[e.new.start]]
    sizes, intervals = np.array(e.sizes), np.diff(e.turns)
    last = p.moment(e.turns[-1])
    size = float(sizes[-1] / sizes.max())
    words = [f"the last oscillation has {size:.0%} of the largest amplitude"]
    growth = float(intervals[-1] / np.median(intervals)) if len(intervals) > 2 else float("nan")
    if np.isfinite(growth):
        words.append(f"the last interval is {growth:.2g} times the median")
    hopf = [
        point
        for point in ends_of(p.diagram, entered)
        if point.code == "HB" and point.criticality != "subcritical"
    ]
    landing = float(p.m.slow[e.new.start])
    begun = [h for h in hopf if (h[name] - p.slow.table[e.rows(p.m)[0]]) * (landing - h[name]) >= 0]
    if begun and size < SHRUNK:
        return CycleEnd("Hopf", begun[0], "; ".join(words))
    words.insert(0, "a bifurcation of the cycle, not of equilibria")
    near = [q for q in p.diagram.special if POINT_TYPES[q.code].changes_stability]
    if near:
        closest = min(near, key=lambda q: abs(q[name] - last.value))
        away = abs(closest[name] - last.value)
        words.append(f"nearest special point {closest.label}, {away:.3g} away")
    distance = _saddle(p, e, last.value)
    if distance is not None:
        words.append(f"the last oscillation passes a saddle at {distance:.2g} of the extent")
    reached = _first_reached(p, e)
    if reached is not None:
        words.append(f"{reached.interface} is reached for the first time at t = {reached.time:.6g}")
    frozen = None
    if e.old is not None and slowly(p, e):
        sheets = p.sheets[p.followed[e.old.stop - 1]].label, entered.label
        if sheets not in known:
            known[sheets] = frozen_end(p, e.turns)
        frozen = known[sheets]
    if frozen is not None:
        words.append(frozen.evidence)
        ended = "grazing" if reached is not None else "fold cycle"
        cause = f"{ended} (candidate)" if frozen.name == "fold cycle (candidate)" else frozen.name
        return CycleEnd(cause, None, "; ".join(words))
    steady = not growth > SLOWED and size >= SHRUNK and np.isfinite(growth)
    if growth > SLOWED and size >= SHRUNK and distance is not None and distance < MET * p.m.radius:
        return CycleEnd("homoclinic (candidate)", None, "; ".join(words))
    if steady:
        cause = "fold cycle" if reached is None else "grazing"
        return CycleEnd(f"{cause} (candidate)", None, "; ".join(words))
    return CycleEnd("unclassified", None, "; ".join(words))


def slowly(p: Passage, e: Excursion) -> bool:
    """Whether the slow quantity is slow beside an oscillation: it turns round more rarely."""
    if not p.slow.laws and p.slow.name not in p.slow.run.forcing:
        return True
    start, stop = e.rows(p.m)
    turns = turns_of(p.m.slow[start:stop], WIGGLE * p.m.span)
    return OSCILLATIONS * len(turns.rows) <= len(e.turns)


def _first_reached(p: Passage, e: Excursion) -> Crossing | None:
    """A crossing at the end of the last oscillations of an interface that no earlier one met."""
    start, _ = e.rows(p.m)
    crossings = [c for c in p.slow.run.crossings if p.m.time[start] <= c.time]
    before = {c.interface for c in crossings if c.time < e.turns[-2]}
    # the one after the last maximum is where the cycle is left
    end = 2.0 * e.turns[-1] - e.turns[-2]
    last = (c for c in crossings if e.turns[-2] <= c.time <= end)
    return next((c for c in last if c.interface not in before), None)


def _saddle(p: Passage, e: Excursion, value: float) -> float | None:
    """Scaled distance at which the last oscillation passes a saddle."""
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
    rows = slice(int(np.searchsorted(p.m.time, since)), stop)
    states, periods = p.m.scaled[rows], p.m.periods
    away = [np.linalg.norm(apart(states, s / p.m.extent, periods), axis=1).min() for s in saddles]
    return float(min(away))


def ending(p: Passage, e: Excursion, end: CycleEnd) -> Transition:
    """The transition from an oscillating phase to the sheet that is followed after it."""
    assert e.new is not None
    last = p.moment(e.turns[-1])
    entered = p.sheets[p.followed[e.new.start]]
    delay = float("nan")
    if end.special is not None:
        # past the Hopf point in the sense of the drift, into the sheet
        delay = -p.delay(entered, end.special, last.value)
    return Transition(
        last.time,
        last.value,
        last.state,
        OSCILLATING,
        entered.label,
        end.special,
        delay,
        "end of oscillation",
        last,
        p.landed(e.new, last.time),
        p.slope(end.special, last.time),
        note=end.evidence,
    )
