"""Runs with events by restarts of SciPy's integrator, with the semantics of SBML Level 3.

An independent program for the tests: conditions are Python functions of the values of the rates
themselves, and nothing of the package is used.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

#: Executions that are followed.
MOST = 1000


@dataclass
class ReferenceEvent:
    """An event: heights, its condition by which of them are positive, and the assignments."""

    heights: Sequence[Callable[[float, Any], float]]
    condition: Callable[..., bool]
    assign: Callable[[float, Any], dict[int, float]]
    delay: float = 0.0
    persistent: bool = True
    initially: bool = True
    at_trigger: bool = True


def run(
    rates: Callable[[float, Any], Any],
    start: Sequence[float],
    end: float,
    events: Sequence[ReferenceEvent],
    priority: Callable[[int, Any], float],
) -> tuple[Any, list[tuple[float, int]]]:
    """Return the final state, and time and number of every execution.

    After more than a thousand executions the run ends at the last of them.

    Raises
    ------
    OverflowError
        For more than a thousand executions at one instant.
    """
    t, y, done = 0.0, np.array(start, dtype=float), []
    truth = [one.initially for one in events]
    queue: list[tuple[float, int, dict[int, float]]] = []

    signs = [[False] * len(one.heights) for one in events]

    def settle(old: Any = None) -> None:
        """Queue the events whose condition has become true, just after this instant.

        Where an execution has not changed a height, which may be zero, its sign is kept.
        """
        beyond = y + ahead * np.asarray(rates(t, y))
        for k, one in enumerate(events):
            for j, height in enumerate(one.heights):
                if old is None or height(t, old) != height(t, y):
                    signs[k][j] = height(t + ahead, beyond) > 0.0
            holds = one.condition(*signs[k])
            if truth[k] and not holds and not one.persistent:
                queue[:] = [entry for entry in queue if entry[1] != k]
            if holds and not truth[k]:
                queue.append((t + one.delay, k, one.assign(t, y)))
            truth[k] = holds

    heights = [h for one in events for h in one.heights]
    ahead = 1e-9
    while True:
        settle()
        while due := [entry for entry in queue if entry[0] <= t + 1e-12]:
            due.sort(key=lambda entry: (-priority(entry[1], y), entry[1], entry[0]))
            entry = due[0]
            queue.remove(entry)
            one, old = events[entry[1]], y.copy()
            for place, value in (entry[2] if one.at_trigger else one.assign(t, y)).items():
                y[place] = value
            done.append((t, entry[1]))
            settle(old)
            if not any(waiting[0] <= t + 1e-12 for waiting in queue):
                # the motion after all executions decides
                settle()
            if len(done) > MOST and done[-1][0] - done[-1 - MOST][0] <= 1e-9:
                raise OverflowError("endless events")
        if t >= end or len(done) > MOST:
            return y, done
        until = min([end, *(entry[0] for entry in queue)])
        located = []
        for height in heights:

            def crossing(s: float, z: Any, height: Any = height) -> float:
                return height(s, z)

            crossing.terminal = True  # type: ignore[attr-defined]
            located.append(crossing)
        # beyond the surface of the last event
        first = min(t + ahead, until)
        y = y + (first - t) * np.asarray(rates(t, y))
        found = solve_ivp(
            rates,
            (first, until),
            y,
            events=located,
            rtol=1e-11,
            atol=1e-12,
            method="DOP853",
            max_step=0.02,
        )
        t, y = float(found.t[-1]), found.y[:, -1].copy()
