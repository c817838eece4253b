"""Ends of oscillations on cycles of the frozen model, by continuation."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation.settings import Continuation
from fastslow.errors import FastSlowError
from fastslow.model.model import Model
from fastslow.orbits.find.finding import find_orbit
from fastslow.orbits.trace.branches import continue_orbits
from fastslow.passage.overlay.transitions import OverlaidRun
from fastslow.results.angles import apart
from fastslow.results.base.intervals import runs_of
from fastslow.results.orbits.orbit import Orbit
from fastslow.results.orbits.orbit_branch import OrbitBranch
from fastslow.results.orbits.special_orbit import SpecialOrbit

Array = NDArray[np.float64]

#: Names of the ends of cycles in a class of bursting, by the outcome of a branch that ends at no
#: special point.
ENDINGS = {
    "saddle-node on the cycle": "circle",
    "Hopf point": "Hopf",
    "homoclinic to a pseudo-saddle": "homoclinic",
    "homoclinic with resets": "homoclinic",
    "period unbounded": "homoclinic (candidate)",
}

#: Name of an end that is none of these.
UNKNOWN = "unclassified"

#: Largest distance of an oscillation from a traced cycle, in radii of the overlay.
ON_CYCLE = 2.0

#: Steps of the continuation of a run's own cycle, of which only the end is used.
STEPS = Continuation(step=0.05, max_step=0.2, max_turn=0.5, max_points=400)


class TracedEnd(NamedTuple):
    """End of a traced cycle in the direction of the drift.

    Parameters
    ----------
    name : str
    point : SpecialOrbit or None
    delay : float
        Distance of the last oscillation past the point.
    evidence : str
    """

    name: str
    point: SpecialOrbit | None
    delay: float
    evidence: str


def traced_end(p: OverlaidRun, turns: Sequence[float]) -> TracedEnd | None:
    """Return the end of the given cycles on which a run oscillates, None if it is not known.

    Parameters
    ----------
    p : OverlaidRun
    turns : sequence of float
        Maxima of the observed state in one oscillating phase.
    """
    points = [p.state_at(time) for time in turns]
    values, states = np.array([q.value for q in points]), np.array([q.state for q in points])
    drift = _drift(values)
    nearest, found = ON_CYCLE * p.m.radius, None
    for branch in p.cycles:
        for rows in _stable_rows(branch):
            away = _distance(p, branch, rows, values, states)
            if away <= nearest:
                nearest, found = away, (branch, rows)
    if found is None or drift == 0.0:
        return None
    branch, rows = found
    name, point, words = _end_of(branch, rows, drift)
    if name == UNKNOWN:
        return None
    delay = np.nan if point is None else drift * (values[-1] - point[branch.parameter])
    evidence = f"on traced cycles, within {nearest:.2g} of the extent; {words}"
    return TracedEnd(name, point, float(delay), evidence)


def own_end(p: OverlaidRun, turns: Sequence[float]) -> TracedEnd | None:
    """Trace the frozen cycle on which a run oscillates to its end in the direction of the drift.

    None without a frozen model, or if the cycle is not solved for.

    Parameters
    ----------
    p : OverlaidRun
    turns : sequence of float
        Maxima of the observed state in one oscillating phase.
    """
    model, name = _frozen(p), p.diagram.parameter
    if model is None or len(turns) < 2:
        return None
    drift = _drift(np.array([p.state_at(time).value for time in turns]))
    if drift == 0.0:
        return None
    orbit = _last_cycle(p, model, turns)
    if orbit is None:
        return TracedEnd(UNKNOWN, None, np.nan, "the frozen fast subsystem has no stable cycle")
    value, (low, high) = orbit.parameters[name], p.diagram.over
    over = (value, high) if drift > 0.0 else (low, value)
    try:
        branch = continue_orbits(orbit, name, over, continuation=STEPS)
    except FastSlowError:
        return None
    begun = [
        rows for rows in _stable_rows(branch) if (0 if drift > 0.0 else len(branch) - 1) in rows
    ]
    if not begun:
        return None
    cause, _, words = _end_of(branch, begun[0], drift)
    return TracedEnd(cause, None, np.nan, f"the frozen cycle is traced: {words}")


def _drift(values: Array) -> float:
    """Direction of the slow quantity at the last maximum; it may oscillate with the fast states."""
    return float(np.sign(values[-1] - values[-2] or values[-1] - values[0]))


def _end_of(
    branch: OrbitBranch, rows: NDArray[np.int64], drift: float
) -> tuple[str, SpecialOrbit | None, str]:
    """End of stable rows in the direction of a drift: name in a class of bursting, point, words."""
    last = rows[int(np.argmax(drift * branch.values[rows]))]
    beyond = int(last) + (1 if last == rows[-1] else -1)
    near = {int(last), beyond}
    ends = [q for q, row in zip(branch.special, branch.special_rows, strict=True) if row in near]
    point = next((q for q in ends if q.kind.bursting), None)
    name = branch.parameter
    if point is not None:
        words = f"they end at {point.label}, {point.words}, {name} = {point[name]:.10g}"
        return point.kind.bursting, point, words
    if 0 <= beyond < len(branch):
        changed = next((q for q in ends if q.kind.changes_stability), None)
        at = f"{name} = {branch.values[last]:.6g}"
        if changed is not None:
            at = f"{changed.label}, {changed.words}, {name} = {changed[name]:.10g}"
        return UNKNOWN, None, f"they lose stability at {at}"
    outcome = branch.outcomes[0 if beyond < 0 else 1]
    return ENDINGS.get(outcome.code, UNKNOWN), None, outcome.message.rstrip(".")


def _frozen(p: OverlaidRun) -> Model | None:
    """The frozen fast subsystem with one free parameter; None if it is not known."""
    run, diagram = p.slow.run, p.diagram
    if run.symbolic_model is None or diagram.path:
        return None
    fast: Model = run.symbolic_model.frozen()
    held = {n: v for n, v in diagram.parameters.items() if n in (*fast.parameters, *fast.free)}
    fast = fast.with_parameters(held)
    known = fast.states == diagram.states and fast.free == (diagram.parameter,)
    return fast if known else None


def _last_cycle(p: OverlaidRun, model: Model, turns: Sequence[float]) -> Orbit | None:
    """The stable cycle of the frozen model at the last maxima at which it has one.

    Of the maxima the last, the one before it, and the fourth, eighth, … from the end are tried.
    """
    back = 1
    low, high = p.diagram.over
    while back <= len(turns):
        last = p.state_at(turns[-back])
        if low <= last.value <= high:
            at = model.with_parameters({p.diagram.parameter: last.value})
            try:
                orbit = find_orbit(at, last.state.tolist())
            except FastSlowError:
                orbit = None
            if orbit is not None and orbit.outcome and orbit.stable:
                return orbit
        back *= 2
    return None


def _stable_rows(branch: OrbitBranch) -> Iterator[NDArray[np.int64]]:
    """Rows of the stable slices of a branch."""
    for first, last in runs_of(branch.stable):
        if last - first > 1:
            yield np.arange(first, last)


def _distance(
    p: OverlaidRun, branch: OrbitBranch, rows: NDArray[np.int64], values: Array, states: Array
) -> float:
    """Smallest distance of states from the cycles of a slice, infinite outside its range."""
    known = branch.values[rows]
    inside = np.flatnonzero((values >= known.min()) & (values <= known.max()))
    away = np.inf
    for k in inside:
        cycle = branch[int(rows[np.argmin(np.abs(known - values[k]))])].trajectory
        along = cycle.sampled_columns[: states.shape[1]].T / p.m.extent
        gaps = apart(along, states[k] / p.m.extent, p.m.periods)
        away = min(away, float(np.linalg.norm(gaps, axis=1).min()))
    return away
