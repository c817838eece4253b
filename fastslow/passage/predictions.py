"""The law of delay beside every transition that has one."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from fastslow.errors import ArgumentError
from fastslow.passage.delay_laws import predict_delay
from fastslow.passage.hopf_delays import hopf_exit
from fastslow.passage.transitions import Passage
from fastslow.results.delays import Delay, HopfExit
from fastslow.results.points import SpecialPoint
from fastslow.results.transitions import Transition

#: Kinds of transition that a law is known for.
LAWFUL = ("jump", "transit", "crossing", "Hopf")


def with_laws(p: Passage, transitions: list[Transition]) -> list[Transition]:
    """The same transitions, each with what its law predicts for its own rate of drift."""
    # a periodic run passes the same points at the same rates over and over
    known: dict[tuple[object, ...], Delay | None] = {}
    found = []
    for t in transitions:
        point = t.special
        if t.kind not in LAWFUL or point is None or not t.slope > 0:
            found.append(t)
            continue
        left = next(sheet for sheet in p.sheets if sheet.label == t.from_sheet)
        rate = p.outward(left, point) * t.slope
        where: float | dict[str, float] | None = None
        if t.kind == "Hopf":
            where = _entry(p, t, transitions)
        elif t.kind == "jump":
            where = _level(p, t)
        key = (point.label, t.kind, f"{rate:.6g}", _rounded(where))
        if key not in known:
            known[key] = _law(p, point, rate, where)
        found.append(replace(t, law=known[key]))
    return found


def _law(
    p: Passage, point: SpecialPoint, rate: float, where: float | dict[str, float] | None
) -> Delay | None:
    try:
        if isinstance(where, float):
            return _as_integrated(p, hopf_exit(p.diagram, point, where, rate))
        return predict_delay(point, rate, level=where)
    except ArgumentError:
        # a law that does not hold there, or a diagram without its model
        return None


def _as_integrated(p: Passage, law: HopfExit) -> HopfExit:
    """The law, which says so where the tolerance of the run forgets the entry."""
    rtol = float(p.slow.run.settings.get("rtol", 0.0))
    if law.forgotten or not rtol > 0.0 or law.decay <= -math.log(rtol):
        return law
    words = (
        f"the tolerance decides: the amplitude falls by exp(−{law.decay:.0f}), below rtol = "
        f"{rtol:g} of the run, and the exit comes at another place than this"
    )
    return replace(law, validity=words, forgotten=True)


def _rounded(where: float | dict[str, float] | None) -> str:
    if where is None:
        return ""
    if isinstance(where, float):
        return f"{where:.6g}"
    return " ".join(f"{name} {value:.6g}" for name, value in where.items())


def _level(p: Passage, t: Transition) -> dict[str, float]:
    """Where the measured delay is taken, in the state that moves most."""
    way = (t.state - t.leave.state) / p.m.extent
    number = int(np.argmax(np.abs(way)))
    return {p.diagram.states[number]: float(t.state[number])}


def _entry(p: Passage, t: Transition, others: list[Transition]) -> float:
    """The slow quantity where the motion came to the sheet, or last turned back on it."""
    landed = [o.land.time for o in others if o.land is not None and o.land.time < t.time]
    rows = np.flatnonzero((p.m.time >= max(landed, default=-np.inf)) & (p.m.time <= t.leave.time))
    drift = np.sign(np.diff(p.m.slow[rows]))
    turned = np.flatnonzero(drift != drift[-1]) if len(drift) else drift
    return float(p.m.slow[rows[int(turned[-1]) + 1 if len(turned) else 0]])
