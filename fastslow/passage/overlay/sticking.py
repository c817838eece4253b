"""Phases at rest in a band of equilibria (sticking) and slip along its edge."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fastslow.results.base.intervals import runs_of
from fastslow.results.branch.diagram import Diagram
from fastslow.results.overlay.transitions import Phase
from fastslow.results.stored.switch_state_names import without_state
from fastslow.results.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]

#: Tolerance of a band interpolated between its rows, relative to the state or its extent; a
#: state that slides along the same interfaces is in the band or has just left it.
BAND_TOLERANCE = 1e-6


def bands_at(diagram: Diagram, run: Trajectory, slow: Array, extent: Array) -> NDArray[np.intp]:
    """Index of the band in which the run is at rest at each sample, −1 for none.

    The run slides along the band's interfaces, with states within the band's ranges.

    Parameters
    ----------
    diagram : Diagram
    run : Trajectory
    slow : ndarray, shape (N,)
        The diagram's parameter at the samples.
    extent : ndarray, shape (n,)
        Extent of every state.
    """
    found = np.full(len(slow), -1, dtype=np.intp)
    if not diagram.bands:
        return found
    regions = run.regions_at(run.t)
    state = np.column_stack([run[name] for name in diagram.states])
    for number, band in enumerate(diagram.bands):
        if not band.interfaces:
            # a continuum in a region, along which a run may move
            continue
        lower, upper = band.bounds(slow)
        near = BAND_TOLERANCE * np.maximum(extent, np.abs(state))
        with np.errstate(invalid="ignore"):
            inside = ((state >= lower - near) & (state <= upper + near)).all(axis=1)
        found[(regions == without_state(band.region)) & inside & (found < 0)] = number
    return found


def along_edges(
    diagram: Diagram,
    run: Trajectory,
    slow: Array,
    band: NDArray[np.intp],
    extent: Array,
    radius: float,
) -> tuple[NDArray[np.intp], Array]:
    """Add the samples at which the run slips along the edge of a band it has left.

    Returns
    -------
    band : ndarray, shape (N,)
        Index of the band, including these samples.
    distance : ndarray, shape (N,)
        Distance from the band, in units of ``extent``; NaN elsewhere.
    """
    found, distance = band.copy(), np.full(len(slow), np.nan)
    distance[band >= 0] = 0.0
    if not (band >= 0).any():
        return found, distance
    state = np.column_stack([run[name] for name in diagram.states])
    for number, one in enumerate(diagram.bands):
        lower, upper = one.bounds(slow)
        away = np.linalg.norm((state - np.clip(state, lower, upper)) / extent, axis=1)
        for _, stop in runs_of(band == number):
            k = stop
            while k < len(slow) and band[k] < 0 and away[k] < radius:
                found[k], distance[k] = number, away[k]
                k += 1
    return found, distance


def with_sticking(
    phases: Sequence[Phase],
    diagram: Diagram,
    run: Trajectory,
    rests: NDArray[np.intp],
    band: NDArray[np.intp],
) -> tuple[Phase, ...]:
    """Replace parts of the phases by sticking and by slip along the edge of a band."""
    found: list[Phase] = []
    for number, one in enumerate(diagram.bands):
        resting, slipping = rests == number, (band == number) & (rests < 0)
        for rows, kind, name in (
            (resting, "sticking", one.name),
            (slipping, "quasi-static", one.edge),
        ):
            for start, stop in runs_of(rows):
                begin, end = float(run.t[start]), float(run.t[min(stop, len(run.t) - 1)])
                if end > begin:
                    found.append(Phase(begin, end, kind, (name,)))
    found.sort(key=lambda phase: phase.start)
    kept: list[Phase] = []
    for phase in phases:
        left = phase.start
        for other in found:
            if other.end > left and other.start < phase.end:
                if other.start > left:
                    kept.append(replace(phase, start=left, end=other.start))
                left = max(left, other.end)
        if left < phase.end:
            kept.append(replace(phase, start=left))
    return tuple(sorted([*kept, *found], key=lambda phase: phase.start))
