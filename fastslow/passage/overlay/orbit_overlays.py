"""Overlay of a trajectory and branches of periodic orbits, at whole periods of the forcing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import ArgumentError
from fastslow.passage.overlay.agreement import require_same_forcing, require_same_values
from fastslow.passage.overlay.excursions import intervals_between
from fastslow.passage.overlay.following import episodes_of, stable_branches_at
from fastslow.passage.overlay.lags import distances_and_lags
from fastslow.passage.overlay.orbit_arcs import arcs_of_orbits
from fastslow.passage.overlay.orbit_transitions import OverlaidStrobes
from fastslow.passage.overlay.outcomes import outcome_of
from fastslow.passage.overlay.overlaid_arcs import phases_along
from fastslow.passage.overlay.strobed_runs import (
    common_properties,
    measured_strobes,
    strobes_of,
)
from fastslow.passage.slow_quantities import slow_quantity
from fastslow.results.orbits.orbit_branch import OrbitBranch
from fastslow.results.overlay.overlay import Overlay
from fastslow.results.overlay.transitions import Phases, Transitions
from fastslow.results.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]


def overlay_of_orbits(branches: Sequence[OrbitBranch], run: Trajectory, radius: float) -> Overlay:
    """Compare a run with branches of orbits of its frozen model; see `fastslow.overlay`."""
    frozen = common_properties(branches)
    diagram = frozen.diagram
    require_same_values(diagram, run)
    # branches of one model have the same equations
    compared = require_same_forcing(branches[0], run)
    if run.series is None:
        raise ArgumentError(
            "the trajectory has no dense output, from which its states at whole periods of the "
            "forcing are computed; simulate with dense=True"
        )
    slow = slow_quantity(diagram, run)
    strobes = strobes_of(run, frozen.period)
    times = np.clip(strobes * frozen.period, *run.span)
    value, state = slow.at(times)
    stable, arcs = arcs_of_orbits(branches)
    m = measured_strobes(frozen, run, arcs, (times, strobes, value, state), radius)
    episodes = episodes_of(m)
    followed = stable_branches_at(m, episodes)
    p = OverlaidStrobes(diagram, slow, m, stable, followed, tuple(branches), frozen)
    along = phases_along(p, episodes, intervals_between(m, episodes))
    arc_at = np.full(len(times), -1)
    for episode in episodes:
        arc_at[episode.start : episode.stop] = episode.arc
    distance, lag, relaxation = distances_and_lags(m, arc_at)
    return Overlay(
        diagram=diagram,
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
        phases=Phases(phase for phase in along.phases if phase.end > phase.start),
        transitions=Transitions(along.transitions),
        bursting=None,
        turning=(),
        outcome=outcome_of(
            replace(diagram, over=frozen.covered), run, slow.table, compared, "orbits"
        ),
        branches=tuple(branches),
        period=frozen.period,
    )
