"""Overlay of a trajectory and branches of periodic orbits, at whole periods of the forcing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import ArgumentError
from fastslow.passage.overlay.agreement import require_same_forcing, require_same_values
from fastslow.passage.overlay.following import Episode, episodes_of, stable_branches_at
from fastslow.passage.overlay.lags import explained, lag_behind, mean_speed
from fastslow.passage.overlay.orbit_arcs import arcs_of_orbits
from fastslow.passage.overlay.orbit_transitions import OrbitPassage, phases_of, transitions_of
from fastslow.passage.overlay.outcomes import outcome_of
from fastslow.passage.overlay.strobed_runs import (
    Strobed,
    common_properties,
    measured_strobes,
    strobes_of,
)
from fastslow.passage.slow_quantities import slow_quantity
from fastslow.results.angles import apart
from fastslow.results.orbits.orbit_branch import OrbitBranch
from fastslow.results.overlay.orbit_overlay import OrbitOverlay
from fastslow.results.overlay.transitions import Transitions
from fastslow.results.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]


def overlay_of_orbits(
    branches: Sequence[OrbitBranch], run: Trajectory, radius: float
) -> OrbitOverlay:
    """Compare a run with branches of orbits of its frozen model; see `fastslow.overlay`."""
    frozen = common_properties(branches)
    require_same_values(frozen, run)
    # branches of one model have the same equations
    compared = require_same_forcing(branches[0], run)
    if run.series is None:
        raise ArgumentError(
            "the trajectory has no dense output, from which its states at whole periods of the "
            "forcing are computed; simulate with dense=True"
        )
    slow = slow_quantity(frozen, run)
    strobes = strobes_of(run, frozen.period)
    times = np.clip(strobes * frozen.period, *run.span)
    value, state = slow.at(times)
    stable, arcs = arcs_of_orbits(branches)
    m = measured_strobes(frozen, run, arcs, (times, strobes, value, state), radius)
    episodes = episodes_of(m)
    followed = stable_branches_at(m, episodes)
    passage = OrbitPassage(tuple(branches), run, m, stable, followed, frozen)
    distance, lag, relaxation = _distances(m, episodes)
    return OrbitOverlay(
        branches=tuple(branches),
        run=run,
        t=times,
        slow=value,
        state=state,
        extent=m.extent,
        radius=radius,
        stable_branches=stable,
        followed=followed,
        distance=distance,
        lag=lag,
        relaxation=relaxation,
        phases=phases_of(passage, episodes),
        transitions=Transitions(transitions_of(passage, episodes)),
        period=frozen.period,
        outcome=outcome_of(
            replace(frozen, over=frozen.covered), run, slow.table, compared, "orbits"
        ),
    )


def _distances(m: Strobed, episodes: Sequence[Episode]) -> tuple[Array, Array, Array]:
    """Distance from the followed, else the nearest, orbit; lag; and relaxation time."""
    every = np.array([m.apart(k) for k in range(len(m.arcs))]).reshape(-1, len(m.t))
    distance = np.where(m.present.T, every, np.inf).min(axis=0, initial=np.inf)
    lag, relaxation = np.full((2, len(m.t)), np.nan)
    mean = mean_speed(m.t, m.slow)
    for episode in episodes:
        rows, arc = np.arange(episode.start, episode.stop), m.arcs[episode.arc]
        distance[rows] = every[episode.arc, rows]
        slow, strobes, drift = m.slow[rows], m.strobes[rows], m.drift[rows]
        rate = -arc.relaxation(slow)
        slope = arc.slope(strobes, slow) / m.extent
        deviation = m.deviation(episode.arc)[rows]
        found = lag_behind(deviation, slope, drift, rate, span=m.span, mean=mean)
        relaxation[rows] = found.relaxation
        behind = np.where(found.exists, found.behind, 0.0)
        earlier = arc.at(strobes, slow - drift * behind) / m.extent
        rest = apart(m.scaled[rows], earlier, m.periods)
        lag[rows] = np.where(found.exists & explained(rest, deviation), behind, np.nan)
    return distance, lag, relaxation
