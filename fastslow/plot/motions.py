"""Trajectories on their own: time series and phase portraits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from matplotlib.text import Annotation, Text
from numpy.typing import NDArray

from fastslow.arguments import flag, formula, instance, items, takes, whole
from fastslow.errors import ArgumentError, unknown_name
from fastslow.plot.arguments import levels_of_states, line_colour, line_style
from fastslow.plot.arrows import draw_arrows, length_along
from fastslow.plot.bands import Bands, Values, draw_bands
from fastslow.plot.labels import settle
from fastslow.plot.phases import draw_phases, fit_words
from fastslow.plot.style import MM, MOTION, VERMILION, Drawing, axes_for, typeset
from fastslow.results.trajectories import Trajectory
from fastslow.results.transitions import Phase

Array = NDArray[np.float64]

LINE: dict[str, Any] = {"linewidth": 0.8, "zorder": 3.0}


@dataclass(frozen=True, eq=False)
class MotionDrawing(Drawing):
    """A drawn trajectory.

    Parameters
    ----------
    ax : Axes
    x, y : str
        What the axes show.
    lines : tuple of Line2D
        The trajectory; in a phase portrait earlier periods, if there are any,
        and the last one.
    crossings : Line2D or None
        One dot for each crossing of an interface.
    arrows : tuple of Annotation
        Sense of direction.
    bands : tuple of Bands
        Interfaces and regions.
    phases : tuple of Rectangle
        The strip of phases above a time series.
    words : tuple of Text
        What is written in it.
    """

    x: str
    y: str
    lines: tuple[Line2D, ...]
    crossings: Line2D | None
    arrows: tuple[Annotation, ...]
    bands: tuple[Bands, ...]
    phases: tuple[Rectangle, ...] = ()
    words: tuple[Text, ...] = ()


@takes(
    run=instance(Trajectory),
    x=formula,
    ax=instance(Axes),
    crossings=flag,
    interfaces=levels_of_states,
    phases=items(instance(Phase)),
    color=line_colour,
    style=line_style,
)
def time_series(
    run: Trajectory,
    x: object = None,
    *,
    ax: Axes | None = None,
    crossings: bool = True,
    interfaces: Values | None = None,
    phases: Sequence[Phase] = (),
    color: str = MOTION,
    **style: Any,
) -> MotionDrawing:
    """Draw one quantity of a trajectory over time.

    Parameters
    ----------
    run : Trajectory
    x : str or Symbol, optional
        A state or slow quantity, by default the first state.
    ax : Axes, optional
        Axes to draw into; new ones of a column's width (85 mm) otherwise.
    crossings : bool
        Whether to mark the crossings of interfaces.
    interfaces : mapping, optional
        Interface to (state, value), as a diagram's ``interface_values``: these
        are drawn, with the regions between them.
    phases : sequence of Phase
        Of an overlay, ``lay.phases``: a strip above shows them, and names those with room.
    color : str
        Colour of the trajectory.
    **style
        Properties of the line.

    Returns
    -------
    MotionDrawing

    Raises
    ------
    UnknownNameError
        If ``x`` is no state or slow quantity of the trajectory.
    """
    name = quantity(run, x, 0)
    own, ax = ax is None, axes_for(ax, height=50 * MM)
    look = {"color": color, "label": "trajectory", **LINE, **style}
    lines = tuple(ax.plot(run.t, run[name], **look))
    dots = _dots(ax, run, "t", name) if crossings else None
    ax.set_xlabel(typeset("t"))
    ax.set_ylabel(typeset(name))
    if run.t[-1] > run.t[0]:
        ax.set_xlim(float(run.t[0]), float(run.t[-1]))
    strip = draw_phases(ax, phases) if phases else ((), ())
    bands = _bands(ax, run, (None, name), interfaces)
    if own and phases:
        settle(ax)
        fit_words(*strip)
    return MotionDrawing(ax, "t", name, lines, dots, (), bands, *strip)


@takes(
    run=instance(Trajectory),
    x=formula,
    y=formula,
    ax=instance(Axes),
    crossings=flag,
    interfaces=levels_of_states,
    arrows=whole(0, 1000),
    color=line_colour,
    style=line_style,
)
def phase_portrait(
    run: Trajectory,
    x: object = None,
    y: object = None,
    *,
    ax: Axes | None = None,
    crossings: bool = True,
    interfaces: Values | None = None,
    arrows: int = 3,
    color: str = MOTION,
    **style: Any,
) -> MotionDrawing:
    """Draw a trajectory in the plane of two of its quantities.

    Parameters
    ----------
    run : Trajectory
    x, y : str or Symbol, optional
        States or slow quantities, by default the first two states (for a
        single state, the state over its slow quantity).
    ax : Axes, optional
        Axes to draw into; new ones of a column's width (85 mm) otherwise.
    crossings : bool
        Whether to mark the crossings of interfaces.
    interfaces : mapping, optional
        Interface to (state, value), as a diagram's ``interface_values``: these
        are drawn, with the regions between them.
    arrows : int
        How many arrow heads show the direction.
    color : str
        Colour of the trajectory.
    **style
        Properties of the line.

    Returns
    -------
    MotionDrawing

    Raises
    ------
    UnknownNameError
        If ``x`` or ``y`` is no state or slow quantity of the trajectory.
    ArgumentError
        If there is only one quantity to draw.
    """
    names = run.columns
    if len(names) < 2:
        raise ArgumentError(f"a phase portrait needs two quantities, received {names[0]} alone")
    if len(run.states) == 1 and x is None and y is None:
        x, y = names[1], names[0]
    across, up = quantity(run, x, 0), quantity(run, y, 1)
    ax = axes_for(ax)
    lines = draw_motion(ax, run.t, run[across], run[up], run.period, color, style)
    dots = _dots(ax, run, across, up) if crossings else None
    ax.set_xlabel(typeset(across))
    ax.set_ylabel(typeset(up))
    bands = _bands(ax, run, (across, up), interfaces)
    fractions = (np.arange(arrows) + 0.5) / max(arrows, 1)
    heads = draw_arrows(lines[-1], length_along(lines[-1]), fractions.tolist())
    return MotionDrawing(ax, across, up, lines, dots, heads, bands)


def quantity(run: Trajectory, name: object, default: int) -> str:
    """The name of a state or slow quantity, by default by its position."""
    if name is None:
        return run.columns[default]
    if str(name) not in run.columns:
        raise unknown_name("state or slow quantity", name, run.columns)
    return str(name)


def draw_motion(
    ax: Axes,
    t: Array,
    x: Array,
    y: Array,
    period: float | None,
    color: str,
    style: dict[str, Any],
) -> tuple[Line2D, ...]:
    """Draw a curve in time, what comes before its last period faintly."""
    look = {"color": color, **LINE, **style}
    last = 0
    if period is not None:
        last = max(int(np.searchsorted(t, t[-1] - period, side="right")) - 1, 0)
    earlier = {"label": "earlier periods", **look, "alpha": 0.35, "zorder": 2.9}
    lines = ax.plot(x[: last + 1], y[: last + 1], **earlier) if last > 0 else []
    return (*lines, *ax.plot(x[last:], y[last:], **{"label": "trajectory", **look}))


def at_crossings(run: Trajectory, name: str) -> Array:
    """Time, a state or a slow quantity at every crossing, shape (number of crossings,)."""
    times = np.array([c.time for c in run.crossings])
    if name == "t":
        return times
    if name in run.states:
        index = run.states.index(name)
        return np.array([c.state[index] for c in run.crossings])
    return np.interp(times, run.t, run[name])


def draw_dots(ax: Axes, x: Array, y: Array) -> Line2D | None:
    """Mark crossings of interfaces by small dots."""
    if not len(x):
        return None
    (dots,) = ax.plot(
        x,
        y,
        linestyle="none",
        marker="o",
        markersize=2.4,
        markerfacecolor="white",
        markeredgecolor=VERMILION,
        markeredgewidth=0.6,
        zorder=4,
        label="interface crossing",
    )
    return dots


def _dots(ax: Axes, run: Trajectory, x: str, y: str) -> Line2D | None:
    return draw_dots(ax, at_crossings(run, x), at_crossings(run, y))


def _bands(
    ax: Axes, run: Trajectory, axes: tuple[str | None, str], interfaces: Values | None
) -> tuple[Bands, ...]:
    """Bands across the horizontal and the vertical axis, where these show a state."""
    starts = np.array([segment.start for segment in run.segments])
    names = np.array([segment.region for segment in run.segments])
    if not len(starts):
        return ()
    regions = names[np.maximum(np.searchsorted(starts, run.t, side="right") - 1, 0)]
    return tuple(
        draw_bands(ax, state, interfaces or {}, run[state], regions, vertical=vertical)
        for state, vertical in zip(axes, (True, False), strict=True)
        if state is not None
    )
