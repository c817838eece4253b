"""Events at which two runs from nearby states part."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastslow.model.functions import function_of
from fastslow.model.model import Model
from fastslow.results.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]

#: Distance of two runs before an event of one of them, in units of the attractors, up to which the
#: event parts them; a saddle parts them before.
STILL_TOGETHER = 1e-5

#: Differences of the times of the same event on two runs, relative to their length.
EVENT_TOGETHER = 1e-4

#: Time before an event, relative to it, at which the distance of the runs is measured.
TIME_BEFORE = 1e-7

#: Fraction of a run after which it has left an interface at its start, and the share of its height
#: there with which it began.
LEFT_AFTER, LEFT_AT_ONCE = 1e-5, 1e-3


@dataclass(frozen=True, eq=False)
class Parting:
    """The event at which two runs part that were together before.

    Parameters
    ----------
    type : str
        ``"grazing"`` of the wall of a reset, ``"visible tangency"`` with an interface across which
        the rates jump, ``"escaping"`` from a repelling sliding region.
    interface : str
    state : ndarray, shape (n,)
    time : float
    """

    type: str
    interface: str
    state: Array
    time: float

    @property
    def words(self) -> str:
        """What the boundary is."""
        if self.type == "escaping":
            return (
                f"the boundary is a repelling sliding region on {self.interface}, from which runs "
                "leave to both sides at any time: it is not unique."
            )
        what = "touch the wall" if self.type == "grazing" else "are tangent to"
        return f"the boundary consists of the states whose runs {what} {self.interface}."


def parting_of(model: Model, runs: Sequence[Trajectory], size: Array) -> Parting | None:
    """Return the event at which two runs part, None if they part without one.

    Parameters
    ----------
    model : Model
    runs : two Trajectory
        From states on both sides of a boundary, together to rounding.
    size : ndarray, shape (n,)
        Unit of each state.
    """
    escaping = _escaping(model, runs)
    if escaping is not None:
        return escaping
    events, end = [_events(model, run) for run in runs], min(run.span[1] for run in runs)
    for k in range(max(map(len, events))):
        here = [some[k] for some in events if k < len(some)]
        together = len(here) == 2 and abs(here[0][0] - here[1][0]) <= EVENT_TOGETHER * end
        if together and here[0][1] == here[1][1]:
            continue
        time, name, is_wall = min(here)
        if time >= end:
            return None
        before = max(time * (1.0 - TIME_BEFORE), 0.0)
        states = np.array([run(before) for run in runs])
        if float(np.abs((states[1] - states[0]) / size).max()) > STILL_TOGETHER:
            return None
        kind = "grazing" if is_wall else "visible tangency"
        return Parting(kind, name, states.mean(axis=0), time)
    return None


def event_of_one(model: Model, runs: Sequence[Trajectory]) -> str:
    """An event that one of two runs has, and the other has not, in words; empty without one.

    Parameters
    ----------
    model : Model
    runs : two Trajectory
        Over nearly the same time.
    """
    first, second = ([event[1:] for event in _events(model, run)] for run in runs)
    if len(first) == len(second):
        return ""
    more, less = (first, second) if len(first) > len(second) else (second, first)
    k = next((k for k, (a, b) in enumerate(zip(more, less, strict=False)) if a != b), len(less))
    name, is_wall = more[k]
    return f"an impact at {name}" if is_wall else f"a crossing of {name}"


def _escaping(model: Model, runs: Sequence[Trajectory]) -> Parting | None:
    """A start on an interface that runs leave on both sides at once."""
    for name, interface in model.interfaces.items():
        if model.continuous[name]:
            continue
        symbols, function = function_of(interface.function)
        sides = []
        for run in runs:
            begin, end = run.span
            columns = run.dense_columns(np.array([begin, begin + LEFT_AFTER * (end - begin)]))
            known = {**run.parameters, **dict(zip(run.columns, columns, strict=True))}
            height = np.broadcast_to(function(*(known[s.name] for s in symbols)), (2,))
            at_once = abs(height[0]) < LEFT_AT_ONCE * abs(height[1])
            sides.append(float(np.sign(height[1])) if at_once else 0.0)
        if sides[0] * sides[1] < 0:
            return Parting("escaping", name, np.asarray(runs[0](runs[0].span[0])), 0.0)
    return None


def _events(model: Model, run: Trajectory) -> list[tuple[float, str, bool]]:
    """Time, name, and whether it is a wall, of the events at which states or rates jump."""
    found = [
        (c.time, c.interface, False) for c in run.crossings if not model.continuous[c.interface]
    ]
    found += [(r.time, r.reset, True) for r in run.resets]
    return sorted(found)
