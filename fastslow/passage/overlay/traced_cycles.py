"""Ends of oscillations on traced cycles of the frozen model."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastslow.passage.overlay.transitions import Passage
from fastslow.results.angles import apart
from fastslow.results.base.intervals import runs_of
from fastslow.results.orbits.orbit_branch import OrbitBranch
from fastslow.results.orbits.special_orbit import SpecialOrbit
from fastslow.results.point_types import FOLD_OF_CYCLES, HOMOCLINIC

Array = NDArray[np.float64]

#: Names of the ends of cycles in a class of bursting.
NAMES = {HOMOCLINIC: "homoclinic", FOLD_OF_CYCLES: "fold cycle"}

#: Largest distance of an oscillation from a traced cycle, in radii of the overlay.
ON_CYCLE = 2.0


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


def traced_end(p: Passage, turns: Sequence[float]) -> TracedEnd | None:
    """Return the end of the traced cycle on which a run oscillates, None if it is not known.

    Parameters
    ----------
    p : Passage
    turns : sequence of float
        Maxima of the observed state in one oscillating phase.
    """
    points = [p.state_at(time) for time in turns]
    values, states = np.array([q.value for q in points]), np.array([q.state for q in points])
    # a slow state may oscillate with the fast states
    drift = float(np.sign(values[-1] - values[-2] or values[-1] - values[0]))
    nearest, found = ON_CYCLE * p.m.radius, None
    for branch in p.cycles:
        for rows in _stable_rows(branch):
            away = _distance(p, branch, rows, values, states)
            if away <= nearest:
                nearest, found = away, (branch, rows)
    if found is None or drift == 0.0:
        return None
    branch, rows = found
    last = rows[int(np.argmax(drift * branch.values[rows]))]
    beyond = int(last) + (1 if last == rows[-1] else -1)
    near = {int(last), beyond}
    ends = [q for q, row in zip(branch.special, branch.special_rows, strict=True) if row in near]
    point = next((q for q in ends if q.code in NAMES), None)
    words = f"on traced cycles, within {nearest:.2g} of the extent"
    name = branch.parameter
    if point is not None:
        delay = drift * (values[-1] - point[name])
        words += f"; they end at {point.label}, {point.words}, {name} = {point[name]:.10g}"
        return TracedEnd(NAMES[point.code], point, float(delay), words)
    outcome = branch.outcomes[0 if beyond < 0 else 1]
    if outcome.code == "saddle-node on the cycle" and not 0 <= beyond < len(branch):
        return TracedEnd("circle", None, np.nan, f"{words}; {outcome.message.rstrip('.')}")
    return None


def _stable_rows(branch: OrbitBranch) -> Iterator[NDArray[np.int64]]:
    """Rows of the stable slices of a branch."""
    for first, last in runs_of(branch.stable):
        if last - first > 1:
            yield np.arange(first, last)


def _distance(
    p: Passage, branch: OrbitBranch, rows: NDArray[np.int64], values: Array, states: Array
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
