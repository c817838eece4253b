"""Queries of an overlay: states with the stable branch followed, and sub-intervals."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import word
from fastslow.errors import unknown_name
from fastslow.results.base.intervals import limits_of, runs_of
from fastslow.results.overlay.transitions import PHASES, Phases, Transitions
from fastslow.results.trajectory.lookup import one_value, states_between_samples
from fastslow.results.trajectory.nearest import checked_values, nearest_on_line, units_of
from fastslow.results.trajectory.slicing import slice_bounds
from fastslow.results.trajectory.state_at import StatePoint

if TYPE_CHECKING:
    from fastslow.results.overlay.overlay import Overlay

Array = NDArray[np.float64]


def measured(overlay: Overlay, points: list[StatePoint]) -> list[StatePoint]:
    """Add the stable branch followed and the distance from it to states of the run."""
    times = np.array([point.time for point in points])
    row = np.clip(np.searchsorted(overlay.t, times, side="right") - 1, 0, len(overlay) - 1)
    after = np.minimum(row + 1, len(overlay) - 1)
    step = overlay.t[after] - overlay.t[row]
    part = np.where(step > 0, (times - overlay.t[row]) / np.where(step > 0, step, 1.0), 0.0)
    near, far = overlay.distance[row], overlay.distance[after]
    together = (
        (overlay.followed[row] == overlay.followed[after]) & np.isfinite(near) & np.isfinite(far)
    )
    distance = np.where(together, near + part * np.where(together, far - near, 0.0), near)
    slow = overlay.slow[row] + part * (overlay.slow[after] - overlay.slow[row])
    found, labels = [], overlay.labels
    for k, point in enumerate(points):
        number = int(overlay.followed[row[k]])
        stable_branch = None if number < 0 else overlay.stable_branches[number]
        others = {
            name: point[name]
            for name in (*point.states, *point.slow)
            if name not in overlay.diagram.states
        }
        found.append(
            replace(
                point,
                states=overlay.diagram.states,
                state=np.array([point[name] for name in overlay.diagram.states]),
                # the parameter of a path is no column of the run
                slow={overlay.parameter: float(slow[k]), **others},
                parameters={**overlay.diagram.parameters, **point.parameters},
                parameter=overlay.parameter,
                stable_branch=str(labels[row[k]]),
                branch=None if stable_branch is None else stable_branch.branch,
                distance=float(distance[k]),
            )
        )
    return found


def columns_of(overlay: Overlay) -> tuple[str, ...]:
    """Columns by which states of an overlay can be looked up."""
    return tuple(dict.fromkeys([overlay.parameter, *overlay.run.columns, "t"]))


def states_at(
    overlay: Overlay,
    value: Mapping[str, float],
    direction: int | None,
    stable_branch: str | None,
    region: str | None,
) -> list[StatePoint]:
    """See `Overlay.at`."""
    name, level = one_value(value, columns_of(overlay))
    run = overlay.run
    if name in (*run.columns, "t"):
        found = run.at(region=region, direction=direction, **{name: level})
    else:
        run.check_region(region)
        samples = run.t, overlay.slow
        found = states_between_samples(run.points_at, samples, name, level, direction)
        found = [point for point in found if region in (None, point.region)]
    known_branch(overlay, stable_branch)
    points = measured(overlay, found)
    return [
        point for point in points if stable_branch is None or point.stable_branch == stable_branch
    ]


def known_branch(overlay: Overlay, stable_branch: str | None) -> None:
    """Raise for the label of no stable branch; "" means that none is followed."""
    bands = [name for band in overlay.diagram.bands for name in (band.name, band.edge)]
    labels = dict.fromkeys([*(s.label for s in overlay.stable_branches), *bands])
    if stable_branch and stable_branch not in labels:
        raise unknown_name("stable branch", stable_branch, labels)


def nearest_on(overlay: Overlay, values: Mapping[str, float]) -> StatePoint:
    """See `Overlay.nearest`."""
    checked_values(values, columns_of(overlay))
    if set(values) <= {*overlay.run.columns, "t"}:
        return measured(overlay, [overlay.run.nearest(**values)])[0]
    table = np.column_stack([overlay[name] for name in values])
    scale = units_of(table)
    target = np.array([float(value) for value in values.values()])
    time, _ = nearest_on_line(overlay.t, table / scale, target / scale)
    point = replace(overlay.run.points_at(np.array([time]))[0], interpolated=time not in overlay.t)
    return measured(overlay, [point])[0]


def rows_of(overlay: Overlay, wanted: slice) -> Overlay:
    """Return the overlay of consecutive samples; see `Overlay.__getitem__`."""
    start, stop = slice_bounds(wanted, len(overlay), "an overlay")
    if stop - start == len(overlay):
        return overlay
    rows = slice(start, stop)
    begin, end = float(overlay.t[start]), float(overlay.t[stop - 1])
    return replace(
        overlay,
        run=overlay.run[rows],
        t=overlay.t[rows],
        slow=overlay.slow[rows],
        state=overlay.state[rows],
        followed=overlay.followed[rows],
        distance=overlay.distance[rows],
        lag=overlay.lag[rows],
        relaxation=overlay.relaxation[rows],
        phases=_clipped(overlay.phases, begin, end),
        transitions=Transitions(t for t in overlay.transitions if begin <= t.time <= end),
        # bursting is classified for the whole run only
        bursting=None,
        turning=tuple(m for m in overlay.turning if begin <= m.time <= end),
        band=None if overlay.band is None else overlay.band[rows],
    )


def _clipped(phases: Phases, begin: float, end: float) -> Phases:
    """Restrict phases to a time interval; counts remain those of the whole phase."""
    return Phases(
        replace(phase, start=max(phase.start, begin), end=min(phase.end, end))
        for phase in phases
        if min(phase.end, end) > max(phase.start, begin)
    )


def intervals_of(
    overlay: Overlay,
    stable_branch: str | None,
    region: str | None,
    type: str | None,
    between: tuple[float, float] | None,
) -> tuple[Overlay, ...]:
    """Return the intervals on which conditions hold; see `Overlay.select`."""
    wanted = np.ones(len(overlay), dtype=bool)
    if stable_branch is not None:
        known_branch(overlay, stable_branch)
        wanted &= overlay.labels == stable_branch
    if region is not None:
        overlay.run.check_region(region)
        wanted &= overlay.run.regions_at(overlay.t) == region
    if type is not None:
        word("type of phase", PHASES)("type", type)
        starts = np.array([phase.start for phase in overlay.phases])
        # the last entry is for samples in no phase
        right = np.array([*(phase.type == type for phase in overlay.phases), False])
        wanted &= right[np.searchsorted(starts, overlay.t, side="right") - 1]
    if between is not None:
        low, high = limits_of(between)
        wanted &= (overlay.t >= low) & (overlay.t <= high)
    return tuple(rows_of(overlay, slice(start, stop)) for start, stop in runs_of(wanted))
