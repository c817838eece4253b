"""What an overlay is asked: moments with the sheet followed then, and parts of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import word
from fastslow.errors import unknown_name
from fastslow.results.branch.slicing import limits_of, runs_of
from fastslow.results.overlay.transitions import PHASES, Phase
from fastslow.results.trajectory.crossings import regions_at
from fastslow.results.trajectory.lookup import (
    between_samples,
    in_region,
    known_region,
    one_value,
    states_at_level,
)
from fastslow.results.trajectory.nearest import (
    checked_values,
    nearest_state,
    nearest_time,
    units_of,
)
from fastslow.results.trajectory.slicing import samples_of, slice_bounds
from fastslow.results.trajectory.state_at import StatePoint, state_points_at

if TYPE_CHECKING:
    from fastslow.results.overlay.overlay import Overlay

Array = NDArray[np.float64]


def measured(lay: Overlay, moments: list[StatePoint]) -> list[StatePoint]:
    """Moments of the run as those of the overlay: the sheet followed then, and its distance."""
    times = np.array([moment.time for moment in moments])
    row = np.clip(np.searchsorted(lay.time, times, side="right") - 1, 0, len(lay) - 1)
    after = np.minimum(row + 1, len(lay) - 1)
    step = lay.time[after] - lay.time[row]
    part = np.where(step > 0, (times - lay.time[row]) / np.where(step > 0, step, 1.0), 0.0)
    near, far = lay.distance[row], lay.distance[after]
    together = (lay.followed[row] == lay.followed[after]) & np.isfinite(near) & np.isfinite(far)
    distance = np.where(together, near + part * np.where(together, far - near, 0.0), near)
    slow = lay.slow[row] + part * (lay.slow[after] - lay.slow[row])
    found, labels = [], lay.labels
    for k, moment in enumerate(moments):
        number = int(lay.followed[row[k]])
        sheet = None if number < 0 else lay.sheets[number]
        others = {
            name: moment[name]
            for name in (*moment.states, *moment.slow)
            if name not in lay.diagram.states
        }
        found.append(
            replace(
                moment,
                states=lay.diagram.states,
                state=np.array([moment[name] for name in lay.diagram.states]),
                # of a path, the parameter is no column of the run
                slow={lay.parameter: float(slow[k]), **others},
                parameters={**lay.diagram.parameters, **moment.parameters},
                parameter=lay.parameter,
                sheet=str(labels[row[k]]),
                branch=None if sheet is None else sheet.branch,
                distance=float(distance[k]),
            )
        )
    return found


def columns_of(lay: Overlay) -> tuple[str, ...]:
    """The columns that moments of an overlay can be asked for by."""
    return tuple(dict.fromkeys([lay.parameter, *lay.run.columns, "t"]))


def moments_of(
    lay: Overlay,
    value: Mapping[str, float],
    direction: int | None,
    sheet: str | None,
    region: str | None,
) -> list[StatePoint]:
    """See `Overlay.at`."""
    name, level = one_value(value, columns_of(lay))
    if name in (*lay.run.columns, "t"):
        found = states_at_level(lay.run, name, level, direction)
    else:
        found = between_samples(lay.run, name, lay.slow, level, direction)
    known_sheet(lay, sheet)
    moments = measured(lay, in_region(lay.run, found, region))
    return [moment for moment in moments if sheet is None or moment.sheet == sheet]


def known_sheet(lay: Overlay, sheet: str | None) -> None:
    """Refuse a label that no sheet has; "" is for none followed."""
    bands = [name for band in lay.diagram.bands for name in (band.name, band.edge)]
    labels = dict.fromkeys([*(s.label for s in lay.sheets), *bands])
    if sheet and sheet not in labels:
        raise unknown_name("sheet", sheet, labels)


def nearest_on(lay: Overlay, values: Mapping[str, float]) -> StatePoint:
    """See `Overlay.nearest`."""
    checked_values(values, columns_of(lay))
    if set(values) <= {*lay.run.columns, "t"}:
        return measured(lay, [nearest_state(lay.run, values)])[0]
    table = np.column_stack([lay[name] for name in values])
    scale = units_of(table)
    target = np.array([float(value) for value in values.values()])
    time, _ = nearest_time(lay.time, table / scale, target / scale)
    moment = replace(
        state_points_at(lay.run, np.array([time]))[0], interpolated=time not in lay.time
    )
    return measured(lay, [moment])[0]


def rows_of(lay: Overlay, wanted: slice) -> Overlay:
    """The overlay of some consecutive samples; see `Overlay.__getitem__`."""
    start, stop = slice_bounds(wanted, len(lay), "an overlay")
    if stop - start == len(lay):
        return lay
    rows = slice(start, stop)
    begin, end = float(lay.time[start]), float(lay.time[stop - 1])
    return replace(
        lay,
        run=samples_of(lay.run, rows),
        time=lay.time[rows],
        slow=lay.slow[rows],
        state=lay.state[rows],
        followed=lay.followed[rows],
        distance=lay.distance[rows],
        lag=lay.lag[rows],
        relaxation=lay.relaxation[rows],
        phases=tuple(_clipped(lay.phases, begin, end)),
        transitions=tuple(t for t in lay.transitions if begin <= t.time <= end),
        # a rhythm is that of the whole
        bursting=None,
        turning=tuple(m for m in lay.turning if begin <= m.time <= end),
        band=None if lay.band is None else lay.band[rows],
    )


def _clipped(phases: tuple[Phase, ...], begin: float, end: float) -> list[Phase]:
    """Phases as far as they lie between two times; counts stay those of the whole phase."""
    return [
        replace(phase, start=max(phase.start, begin), end=min(phase.end, end))
        for phase in phases
        if min(phase.end, end) > max(phase.start, begin)
    ]


def parts_of(
    lay: Overlay,
    sheet: str | None,
    region: str | None,
    kind: str | None,
    between: tuple[float, float] | None,
) -> tuple[Overlay, ...]:
    """Runs of samples that fulfil conditions; see `Overlay.select`."""
    wanted = np.ones(len(lay), dtype=bool)
    if sheet is not None:
        known_sheet(lay, sheet)
        wanted &= lay.labels == sheet
    if region is not None:
        known_region(lay.run, region)
        wanted &= regions_at(lay.run, lay.time) == region
    if kind is not None:
        word("kind of phase", PHASES)("kind", kind)
        starts = np.array([phase.start for phase in lay.phases])
        # the last entry stands for no phase: one sample has none
        right = np.array([*(phase.kind == kind for phase in lay.phases), False])
        wanted &= right[np.searchsorted(starts, lay.time, side="right") - 1]
    if between is not None:
        low, high = limits_of(between)
        wanted &= (lay.time >= low) & (lay.time <= high)
    return tuple(rows_of(lay, slice(start, stop)) for start, stop in runs_of(wanted))
