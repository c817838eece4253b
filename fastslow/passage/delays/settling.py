"""What a law of delay cannot know: where the trajectory came from, if it has not forgotten."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from fastslow.passage.delays.drifts import drift_at
from fastslow.passage.delays.local_field import Site, level_of, site_of
from fastslow.passage.delays.local_passages import SAFETY, Event, Place, reached_delay
from fastslow.passage.overlay.transitions import Passage
from fastslow.results.overlay.delays import BoundaryDelay, Delay, FoldDelay, GapTransit
from fastslow.results.overlay.drifts import Drift
from fastslow.results.overlay.transitions import Transition

#: A deviation that has shrunk by exp(−SETTLED) since the branch was reached is forgotten.
SETTLED = 25.0

#: A passage from where the branch was reached may take this many times as long as it took.
LONG = 3.0

#: The memory of the start is told where it is more than this part of the error of the law.
TOLD = 0.1


def with_memory(
    p: Passage, t: Transition, earlier: list[Transition], law: Delay, passed: float
) -> Delay:
    """A law with what the delay owes to the state in which the branch was reached in its error.

    The passage is integrated once more, from that state, at the drift of that time.

    Parameters
    ----------
    p : Passage
    t : Transition
        Whose delay the law is of.
    earlier : list of Transition
        All of the run.
    law : Delay
    passed : float
        When the slow quantity passed the special point.
    """
    if not isinstance(law, FoldDelay | BoundaryDelay | GapTransit) or math.isnan(law.error):
        return law
    landed = [o.land.time for o in earlier if o.land is not None and o.land.time < passed]
    start = max(landed, default=float(p.m.time[0]))
    if start >= passed or _decay(p, t, start, passed) > SETTLED:
        return law
    drift = drift_at(p.slow, law.point, passed)
    if drift is None:
        return law
    site = site_of(law.point, law.parameter, None)
    moment = p.moment(start)
    if moment.region not in site.field.regions:
        return law
    z = np.append(moment.state, p.slow.at(np.array([start]))[0]) - site.u
    if z[-1] * drift.way >= 0.0:
        return law
    place = Place(site.region(moment.region), z, start - passed)
    span = LONG * (t.time - start)
    delay, _ = reached_delay(site, drift, place, _event(site, law, drift), span)
    if math.isnan(delay):
        words = "; no error is stated, as the branch was reached too shortly before"
        return replace(law, error=math.nan, validity=law.validity + words)
    memory = SAFETY * abs(delay - law.delay)
    if memory <= law.error:
        return law
    if memory <= (1.0 + TOLD) * law.error:
        return replace(law, error=memory)
    words = f"; the branch was reached so shortly before that {memory:.2g} may come from it"
    return replace(law, error=law.error + memory, validity=law.validity + words)


def _decay(p: Passage, t: Transition, start: float, stop: float) -> float:
    """∫ |Re λ| dt of the slowest eigenvalue along the branch that is left."""
    number = next(k for k, sheet in enumerate(p.sheets) if sheet.label == t.from_sheet)
    course = next(c for c in p.m.courses if number in c.sheets)
    first = np.searchsorted(p.m.time, start)
    rows = slice(first, np.searchsorted(p.m.time, stop, side="right"))
    if rows.stop - first < 2:
        return 0.0
    rate = np.maximum(-course.relaxation(p.m.slow[rows]), 0.0)
    steps = np.diff(p.m.time[rows])
    return float((steps * (rate[1:] + rate[:-1]) / 2.0).sum())


def _event(site: Site, law: FoldDelay | BoundaryDelay | GapTransit, drift: Drift) -> Event:
    """What ends the passage of a law."""
    interfaces = site.field.interfaces
    if isinstance(law, GapTransit):
        return Event(interface=interfaces.index(law.interfaces[1]))
    if isinstance(law, BoundaryDelay) and law.subtype == "persistence":
        return Event(interface=interfaces.index(str(law.point.interface)))
    return Event(level_of(site, law.level, drift))
