"""Lines of trajectories, interrupted at jumps."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from fastslow.plot.layout.arrows import axes_of, length_along
from fastslow.plot.layout.style import MOTION, SLIDING, SLIDING_SIGN, root
from fastslow.plot.layout.thinning import draw_long
from fastslow.plot.quantities import Array, Quantity, joined
from fastslow.results.trajectory.steps.dense import rows_before_jumps
from fastslow.results.trajectory.steps.step_roots import STEP_JUMP
from fastslow.results.trajectory.trajectory import Trajectory

LINE: dict[str, Any] = {"linewidth": 0.8, "zorder": 3.0}

#: Fraction of the axes that a line may cover before it is made thinner, and the finest width.
COVERED_AXES, FINEST_LINE = 0.3, 0.3

#: Width of the usual range of a quantity beyond its middle half, and the number of times at which
#: that is determined.
FENCE, RANGE_TIMES = 3.0, 513

#: Largest difference of a motion that repeats, in units of each range, and the number of periods of
#: a run that is too short for a chaotic one.
REPEATS, FEW_PERIODS = 1e-2, 20

#: Look of jumps.
JUMPS: dict[str, Any] = {"linewidth": 0.5, "linestyle": ":", "label": "_jumps"}


def draw_motion(
    ax: Axes,
    t: Array,
    places: Sequence[Array],
    shown: Sequence[Quantity],
    run: Trajectory,
    style: dict[str, Any],
    sheets: Callable[..., tuple[Line2D, ...]] | None = None,
) -> tuple[Line2D, ...]:
    """Draw a trajectory, faint before the motion that repeats at its end, if any does.

    ``sheets`` draws this in several lines.
    """
    look = {"color": MOTION, **LINE, **alone(len(t)), **style}
    last, repeated = 0, repeating(run)
    if repeated is not None:
        last = max(int(np.searchsorted(t, t[-1] - repeated, side="right")) - 1, 0)
    earlier = {"label": "earlier periods", **look, "alpha": 0.35, "zorder": 2.9}
    parts = [(slice(last + 1), earlier)] if last > 0 else []
    lines = tuple(
        draw_line(ax, t[rows], [p[rows] for p in places], shown, run, its_look)
        for rows, its_look in parts
    )
    rest = t[last:], [p[last:] for p in places], shown, run
    if sheets is not None:
        return lines + sheets(ax, *rest, look)
    return (*lines, draw_line(ax, *rest, {"label": "trajectory", **look}))


def repeating(run: Trajectory) -> float | None:
    """Return the time after which the motion at the end of a forced run repeats, if it does.

    It is the period of the forcing for a run that is too short to tell.
    """
    if run.period is None or run.span[1] - run.span[0] < FEW_PERIODS * run.period:
        return run.period
    multiple = run.periodicity(tol=REPEATS).multiple
    return None if multiple is None else multiple * run.period


@contextmanager
def without_growth(ax: Any, run: Trajectory, t: Array, places: Sequence[Array]) -> Iterator[None]:
    """Scale axes to a trajectory that ended in a blow-up without its final growth.

    Of what is drawn, only samples within the usual range of each coordinate count: at equidistant
    times, the range of the middle half, and `FENCE` times as much on either side.
    """
    before = ax.dataLim.frozen()
    yield
    if run.outcome.code != "blow-up" or len(places) != 2:
        return
    even = np.minimum(np.searchsorted(t, np.linspace(t[0], t[-1], RANGE_TIMES)), len(t) - 1)
    near = np.ones(len(t), dtype=bool)
    for place in places:
        low, high = np.nanquantile(place[even], (0.25, 0.75))
        around = FENCE * (high - low)
        near &= (place >= low - around) & (place <= high + around)
    ax.dataLim.set(before)
    ax.update_datalim(np.column_stack([place[near] for place in places]))
    ax.autoscale_view()


def interrupted(t: Array, places: Sequence[Array]) -> tuple[list[Array], list[Array]]:
    """Interrupt a line at jumps by NaN; return it with the ends of the jumps, NaN between them.

    At a jump times differ by rounding alone, and a quantity does not.
    """
    close = rows_before_jumps(t)
    moved = [np.abs(np.diff(p)) > STEP_JUMP * np.nanmax(np.abs(p), initial=0.0) for p in places]
    rows = close[np.any(moved, axis=0)[close]]
    gaps = np.full(len(rows), np.nan)
    return (
        [np.insert(p, rows + 1, np.nan) for p in places],
        [np.column_stack([p[rows], p[rows + 1], gaps]).ravel() for p in places],
    )


def draw_line(
    ax: Axes,
    t: Array,
    places: Sequence[Array],
    shown: Sequence[Quantity],
    run: Trajectory,
    look: dict[str, Any],
) -> Line2D:
    """Draw part of a trajectory, interrupted at jumps, which are dotted."""
    whole, ends = interrupted(t, places)
    line = draw_long(ax, *joined(whole, shown, run.periods), **look)
    if len(ends[0]):
        same: dict[str, Any] = {
            "color": line.get_color(),
            "alpha": line.get_alpha(),
            "zorder": line.get_zorder(),
        }
        ax.plot(*ends, **same, **JUMPS)
    return line


def alone(count: int) -> dict[str, Any]:
    """Return properties that draw a single sample as a dot."""
    return {"marker": ".", "markersize": 4.0} if count == 1 else {}


def draw_sliding(
    ax: Any, t: Array, places: Sequence[Array], shown: Sequence[Quantity], run: Trajectory
) -> Line2D | None:
    """Draw the sliding segments of a trajectory as a double line, None without any.

    Parameters
    ----------
    ax : Axes
    t : ndarray, shape (N,)
        Times of the samples.
    places : sequence of ndarray, shape (N,)
        The quantities on the axes at those times.
    shown : sequence of Quantity
    run : Trajectory
    """
    inside = np.zeros(len(t), dtype=bool)
    for segment in run.segments:
        if SLIDING_SIGN in segment.region:
            first = np.searchsorted(t, segment.start, side="left")
            inside[first : np.searchsorted(t, segment.end, side="right")] = True
    if not inside.any():
        return None
    parts = [np.where(inside, place, np.nan) for place in places]
    look: dict[str, Any] = {"color": MOTION, "zorder": 3.1, "label": "sliding", **SLIDING}
    return draw_long(ax, *joined(parts, shown, run.periods), **look)


def unresolved(ax: Axes, values: Array) -> bool:
    """Return whether values over the width of axes have more extrema than one in a point."""
    changes = np.diff(values)
    turns = np.count_nonzero(changes[1:] * changes[:-1] < 0.0)
    return bool(turns > ax.get_window_extent().width * 72.0 / root(ax).dpi)


def relieve(lines: Sequence[Line2D]) -> None:
    """Make lines thinner that would cover more than a fraction of their axes."""
    for line in lines:
        ax = axes_of(line)
        frame, width = ax.get_window_extent(), line.get_linewidth()
        length = float(length_along(line)[-1]) if np.size(line.get_xdata()) else 0.0
        share = length * width * root(ax).dpi / 72.0 / (frame.width * frame.height)
        if share > COVERED_AXES:
            line.set_linewidth(max(FINEST_LINE, width * COVERED_AXES / share))
