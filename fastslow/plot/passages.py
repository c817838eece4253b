"""A trajectory laid over the equilibrium diagram of its frozen model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.text import Annotation
from numpy.typing import NDArray

from fastslow.arguments import flag, formula, instance, takes
from fastslow.errors import ArgumentError
from fastslow.plot.arguments import line_colour, line_style
from fastslow.plot.arrows import draw_heads, points
from fastslow.plot.branches import DiagramDrawing, draw_branches
from fastslow.plot.heights import expression_of
from fastslow.plot.labels import key, place, settle
from fastslow.plot.motions import draw_dots, draw_motion
from fastslow.plot.spaces import SpaceDrawing, draw_space
from fastslow.plot.style import MM, MOTION, TRANSITIONS, Drawing, axes_for, typeset
from fastslow.results.formulas import evaluated
from fastslow.results.overlays import Overlay

Array = NDArray[np.float64]

#: Shares of the slow quantity's travel over a period at which an arrow head sits: uneven, so that
#: the way up and the way down of a harmonic load do not meet.
ARROWS = (0.08, 0.36, 0.58, 0.86)


@dataclass(frozen=True, eq=False)
class OverlayDrawing(Drawing):
    """A drawn overlay.

    Parameters
    ----------
    ax : Axes
    state : str
        What the vertical axis shows.
    diagram : DiagramDrawing
        The branches beneath.
    lines : tuple of Line2D
        The trajectory: earlier periods, if there are any, and the last one.
    crossings : Line2D or None
        One dot for each crossing of an interface.
    transitions : tuple of Line2D
        One for each kind of transition.
    turning : Line2D or None
        Where the slow quantity turns back.
    arrows : tuple of Annotation
        Sense of direction, along the sheets and in the jumps.
    legend : Legend or None
    """

    state: str
    diagram: DiagramDrawing
    lines: tuple[Line2D, ...]
    crossings: Line2D | None
    transitions: tuple[Line2D, ...]
    turning: Line2D | None
    arrows: tuple[Annotation, ...]
    legend: Legend | None

    @property
    def handles(self) -> list[Artist]:
        """What a legend shows: branches, special points, trajectory, crossings, transitions."""
        extra = [line for line in (self.crossings, self.turning) if line is not None]
        return [*self.diagram.handles, *self.lines[::-1], *extra, *self.transitions]


@takes(
    lay=instance(Overlay),
    x=formula,
    y=formula,
    ax=instance(Axes),
    label=flag,
    legend=flag,
    crossings=flag,
    turning=flag,
    interfaces=flag,
    virtual=flag,
    color=line_colour,
    style=line_style,
)
def overlay(
    lay: Overlay,
    x: object = None,
    y: object = None,
    *,
    ax: Axes | None = None,
    label: bool = True,
    legend: bool = True,
    crossings: bool = True,
    turning: bool = True,
    interfaces: bool = True,
    virtual: bool = False,
    color: str = MOTION,
    **style: Any,
) -> OverlayDrawing | SpaceDrawing:
    """Draw a trajectory over the branches of equilibria that it passes.

    Every kind of transition has a marker of its own, where it happened: a jump
    at a fold is not to be taken for a passage of an interface, whose crossings are
    small dots. Where the slow quantity turns back there is a bar.

    Parameters
    ----------
    lay : Overlay
    x : str, Symbol or Expr, optional
        What the vertical axis shows: a state, by default the first, or an expression in
        states and parameters such as ``"x**2 + v"``.
    y : str, Symbol or Expr, optional
        With this the view is in space, over the plane of the slow quantity and ``x``.
    ax : Axes, optional
        Axes to draw into (with ``projection="3d"`` for a view in space); new ones of a
        column's width (85 mm) otherwise.
    label : bool
        Whether to write LP1, BE1, … beside special points.
    legend : bool
        Whether to draw a legend.
    crossings : bool
        Whether to mark the crossings of interfaces.
    turning : bool
        Whether to mark where the slow quantity turns back.
    interfaces : bool
        Whether to draw interfaces and regions.
    virtual : bool
        Whether to draw virtual branches.
    color : str
        Colour of the trajectory.
    **style
        Properties of the trajectory's line.

    Returns
    -------
    OverlayDrawing
        In space a SpaceDrawing.

    Raises
    ------
    UnknownNameError
        For a name in ``x`` or ``y`` that is no state, slow quantity or parameter.
    ArgumentError
        For what is no expression, or for a view in space with plane axes.
    """
    name = expression_of(lay.diagram, x)
    spatial = ax is not None and ax.name == "3d"
    if y is not None or spatial:
        if ax is not None and not spatial:
            raise ArgumentError('a view in space needs axes with projection="3d"')
        other = y if y is not None else next((s for s in lay.diagram.states if s != name), None)
        if other is None:
            raise ArgumentError(f"a view in space needs two states, received {name} alone")
        up = expression_of(lay.diagram, other)
        return draw_space(lay, name, up, ax, label=label, legend=legend, color=color, **style)
    own, ax = ax is None, axes_for(ax, height=78 * MM)
    drawn = draw_passage(
        ax,
        lay,
        name,
        label=label,
        crossings=crossings,
        turning=turning,
        interfaces=interfaces,
        virtual=virtual,
        color=color,
        **style,
    )
    if legend:
        drawn = replace(drawn, legend=key(ax, drawn.handles, own))
    below, taken = drawn.diagram, [] if drawn.legend is None else [drawn.legend]
    settle(ax)
    place(ax, below.labels, taken, [below.bands])
    return drawn


def draw_passage(
    ax: Axes,
    lay: Overlay,
    name: str,
    *,
    label: bool = True,
    crossings: bool = True,
    turning: bool = True,
    interfaces: bool = True,
    virtual: bool = False,
    color: str = MOTION,
    **style: Any,
) -> OverlayDrawing:
    """Draw an overlay without a legend, its labels not placed yet; arguments as for `overlay`."""
    values = lay[name]
    lines = draw_motion(ax, lay.time, lay.slow, values, lay.run.period, color, style)
    dots = None
    met = lay.run.crossings
    if crossings and met:
        times, state = np.array([c.time for c in met]), np.array([c.state for c in met])
        slow = np.interp(times, lay.time, lay.slow)
        dots = draw_dots(ax, slow, _heights(lay, name, times, slow, lay.run.states, state))
    changes = _transitions(ax, lay, name)
    turns = _turning(ax, lay, name) if turning else None
    # after the trajectory, so that the bands take its limits in
    below = draw_branches(
        ax, lay.diagram, name, label=label, virtual=virtual, interfaces=interfaces
    )
    for line in below.lines:
        if line.get_label() == "stable":
            # wide enough to be seen beneath a trajectory that follows it
            line.set_linewidth(2.2)
        elif any(phase.kind == "spiking" for phase in lay.phases):
            # spikes would cover it
            line.set_zorder(3.5)
    heads = draw_heads(lines[-1], _heads(lay, values, points(lines[-1])[:, 0]))
    return OverlayDrawing(ax, name, below, lines, dots, changes, turns, heads, None)


def _heights(
    lay: Overlay, expression: str, times: Array, slow: Array, names: Sequence[str], state: Array
) -> Array:
    """An expression at times between samples, where some states are known, shape (N, states)."""
    columns = {n: np.interp(times, lay.time, lay.run[n]) for n in lay.run.columns}
    columns |= {name: state[:, k] for k, name in enumerate(names)}
    known = {**lay.run.parameters, **lay.diagram.parameters, **columns, lay.parameter: slow}
    return np.broadcast_to(evaluated(expression, known), times.shape)


def _at_moments(lay: Overlay, expression: str, moments: Sequence[Any]) -> tuple[Array, Array]:
    """The slow quantity and an expression at moments that know their fast states."""
    times, slow = (np.array([getattr(m, n) for m in moments]) for n in ("time", "value"))
    state = np.array([m.state for m in moments])
    return slow, _heights(lay, expression, times, slow, lay.diagram.states, state)


def _transitions(ax: Axes, lay: Overlay, name: str) -> tuple[Line2D, ...]:
    drawn: list[Line2D] = []
    for kind, (marker, colour, text) in TRANSITIONS.items():
        met = [t for t in lay.transitions if t.kind == kind]
        if met:
            filled = marker in "*PX"
            drawn += ax.plot(
                *_at_moments(lay, name, met),
                linestyle="none",
                marker=marker,
                markersize=7.0 if marker == "*" else 5.5,
                markerfacecolor=colour if filled else "none",
                markeredgecolor="black" if filled else colour,
                markeredgewidth=0.4 if filled else 1.2,
                zorder=5.5,
                label=text,
            )
    return tuple(drawn)


def _turning(ax: Axes, lay: Overlay, name: str) -> Line2D | None:
    """Bars where the slow quantity turns back."""
    if not lay.turning:
        return None
    (line,) = ax.plot(
        *_at_moments(lay, name, lay.turning),
        linestyle="none",
        marker="|",
        markersize=9.0,
        markeredgewidth=1.4,
        color=MOTION,
        zorder=4.6,
        label=f"{typeset(lay.parameter)} turns back",
    )
    return line


def _heads(lay: Overlay, values: Array, drawn: Array) -> list[int]:
    """Where arrow heads sit, as points of the last period: along the sheets, and halfway in jumps.

    Parameters
    ----------
    lay : Overlay
    values : ndarray, shape (N,)
        What the vertical axis shows.
    drawn : ndarray, shape (M,)
        The slow quantity of the last period, the last M samples.
    """
    travel = np.r_[0.0, np.cumsum(np.abs(np.diff(drawn)))]
    rows = np.searchsorted(travel, np.array(ARROWS) * travel[-1]).tolist() if travel[-1] else []
    earlier = len(lay.time) - len(drawn)
    for t in lay.transitions:
        if t.land is None or t.kind in ("crossing", "end of spiking"):
            continue
        start, stop = np.searchsorted(lay.time, (t.leave.time, t.land.time)) - earlier
        inside = values[earlier:][max(start, 0) : max(stop, 0)]
        if start >= 0 and len(inside) > 2:
            middle = 0.5 * (inside[0] + inside[-1])
            rows = [row for row in rows if not start <= row <= stop]
            rows.append(int(start) + int(np.argmin(np.abs(inside - middle))))
    return rows
