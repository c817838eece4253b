"""Overlay of a trajectory and branches of periodic orbits, at whole periods of the forcing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import ArgumentError
from fastslow.passage.overlay.agreement import require_same_forcing, require_same_values
from fastslow.passage.overlay.following import episodes_of, stable_branches_at
from fastslow.passage.overlay.lags import distances_and_lags
from fastslow.passage.overlay.orbit_arcs import arcs_of_orbits
from fastslow.passage.overlay.orbit_transitions import OrbitPassage, phases_of, transitions_of
from fastslow.passage.overlay.outcomes import outcome_of
from fastslow.passage.overlay.strobed_runs import (
    common_properties,
    measured_strobes,
    strobes_of,
)
from fastslow.passage.slow_quantities import slow_quantity
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
    arc_at = np.full(len(times), -1)
    for episode in episodes:
        arc_at[episode.start : episode.stop] = episode.arc
    distance, lag, relaxation = distances_and_lags(m, arc_at)
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
