"""Contribution of transients to the error of a predicted delay."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from fastslow.passage.delays.drifts import drift_at
from fastslow.passage.delays.local_field import TURN, LocalField, level_of, local_field_at
from fastslow.passage.delays.local_passages import (
    LAW_SAFETY,
    EndOfPassage,
    PassagePlace,
    reached_delay,
)
from fastslow.passage.overlay.transitions import OverlaidRun
from fastslow.results.overlay.delays import Delay, PassageEnd
from fastslow.results.overlay.drifts import Drift
from fastslow.results.overlay.transitions import Transition

#: Decay exponent since the branch was reached above which transients are negligible.
SETTLED_EXPONENT = 25.0

#: Largest duration of the passage since the branch was reached, relative to that of the run.
LONGEST_APPROACH = 3.0

#: Contribution of transients, relative to the error of the law, above which it is reported.
REPORTED_TRANSIENT = 0.1


def with_memory(
    p: OverlaidRun, t: Transition, earlier: list[Transition], law: Delay, passed: float
) -> Delay:
    """Add the effect of the state in which the branch was reached to the error of a law.

    The passage is integrated again from that state, with the drift of that time.

    Parameters
    ----------
    p : OverlaidRun
    t : Transition
        Transition of the law.
    earlier : list of Transition
        All transitions of the run.
    law : Delay
    passed : float
        Time at which the slow quantity passed the special point.
    """
    if law.end is None or math.isnan(law.error):
        return law
    landed = [o.land.time for o in earlier if o.land is not None and o.land.time < passed]
    start = max(landed, default=float(p.m.t[0]))
    if start >= passed or _decay(p, t, start, passed) > SETTLED_EXPONENT:
        return law
    drift = drift_at(p.slow, law.point, passed)
    if drift is None:
        return law
    local = local_field_at(law.point, law.parameter, None)
    here = p.state_at(start)
    if here.region not in local.field.regions:
        return law
    z = np.append(here.state, p.slow.at(np.array([start]))[0]) - local.u
    if z[-1] * drift.way >= 0.0:
        return law
    place = PassagePlace(local.region(here.region), z, start - passed)
    span = LONGEST_APPROACH * (t.time - start)
    delay, _ = reached_delay(local, drift, place, _event(local, law.end, drift), span)
    if math.isnan(delay):
        words = "; no error bound, as the branch was reached too shortly before"
        return replace(law, error=math.nan, validity=law.validity + words)
    memory = LAW_SAFETY * abs(delay - law.delay)
    if memory <= law.error:
        return law
    if memory <= (1.0 + REPORTED_TRANSIENT) * law.error:
        return replace(law, error=memory)
    words = f"; the branch was reached so shortly before that transients may add {memory:.2g}"
    return replace(law, error=law.error + memory, validity=law.validity + words)


def _decay(p: OverlaidRun, t: Transition, start: float, stop: float) -> float:
    """∫ |Re λ| dt of the slowest eigenvalue along the old branch."""
    number = next(k for k, s in enumerate(p.stable_branches) if s.label == t.from_branch)
    arc = next(c for c in p.m.arcs if number in c.stable_branches)
    first = np.searchsorted(p.m.t, start)
    rows = slice(first, np.searchsorted(p.m.t, stop, side="right"))
    if rows.stop - first < 2:
        return 0.0
    rate = np.maximum(-arc.relaxation(p.m.slow[rows]), 0.0)
    steps = np.diff(p.m.t[rows])
    return float((steps * (rate[1:] + rate[:-1]) / 2.0).sum())


def _event(local: LocalField, end: PassageEnd, drift: Drift) -> EndOfPassage:
    """The event that ends the passage, for the integration."""
    if end.interface:
        return EndOfPassage(interface=local.field.interfaces.index(end.interface))
    level = {end.state: end.level} if end.state else TURN
    return EndOfPassage(level_of(local, level, drift))
