"""Predicted delays of transitions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from fastslow.errors import ArgumentError
from fastslow.passage.delays.delay_law import InvariantMode
from fastslow.passage.delays.drifts import drift_at
from fastslow.passage.delays.local_field import TURN
from fastslow.passage.delays.predicting import law_at, predict_delay
from fastslow.passage.overlay.run_exits import exit_delay
from fastslow.passage.overlay.settling import with_memory
from fastslow.passage.overlay.transitions import OverlaidRun
from fastslow.results.overlay.delays import Delay
from fastslow.results.overlay.drifts import Drift
from fastslow.results.overlay.transitions import OSCILLATING, Transition
from fastslow.results.points import SpecialPoint


def with_laws(p: OverlaidRun, transitions: list[Transition]) -> list[Transition]:
    """Add the predicted delay for its own rate of drift to every transition."""
    # a periodic run passes the same points at the same rates repeatedly
    known: dict[tuple[object, ...], Delay | None] = {}
    modes: dict[tuple[str, int], InvariantMode | None] = {}
    found = []
    for t in transitions:
        point = t.special_equilibrium
        law = None if point is None else law_at(point)
        if point is None or law is None or not t.slope > 0:
            found.append(t)
            continue
        if law.entry_exit is not None and t.from_branch != OSCILLATING:
            found.append(replace(t, law=exit_delay(p, t, point, law.entry_exit, modes)))
            continue
        if t.type not in law.transitions:
            found.append(t)
            continue
        # a lag may bring the state to an interface before the equilibrium
        early = t.type == "crossing" and t.delay < 0.0
        passed = p.reaching(point, t.time) if early else p.passing(point, t.time)
        drift = None if passed is None else drift_at(p.slow, point, passed, with_law=False)
        where: str | dict[str, float] | None = None
        if t.type == "jump":
            where = TURN if t.turned else _level(p, t)
        key = (point.label, t.type, _rounded(drift), _rounded(where))
        if key not in known:
            known[key] = None if passed is None else _predicted(p, point, passed, where)
        delay = known[key]
        if delay is not None and passed is not None:
            delay = with_memory(p, t, transitions, delay, passed)
        found.append(replace(t, law=delay))
    return found


def _predicted(
    p: OverlaidRun, point: SpecialPoint, passed: float, where: str | dict[str, float] | None
) -> Delay | None:
    drift = drift_at(p.slow, point, passed)
    if drift is None:
        return None
    try:
        return predict_delay(point, drift, level=where)
    except ArgumentError:
        # no prediction for this point, or a diagram without its model
        return None


def _rounded(what: str | Mapping[str, float] | Drift | None) -> str:
    if isinstance(what, Mapping):
        return " ".join(f"{name} {value:.6g}" for name, value in what.items())
    # the full law in time differs by the period, its linear terms do not
    return str(replace(what, law="") if isinstance(what, Drift) else what)


def _level(p: OverlaidRun, t: Transition) -> dict[str, float]:
    """Level of the measured delay in the state that changes most."""
    way = (t.state - t.leave.state) / p.m.extent
    number = int(np.argmax(np.abs(way)))
    return {p.diagram.states[number]: float(t.state[number])}
