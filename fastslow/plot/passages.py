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

from fastslow.plot.arrows import draw_arrows, points
from fastslow.plot.branches import DiagramDrawing, draw_branches, state_name
from fastslow.plot.labels import key, place, settle
from fastslow.plot.motions import at_crossings, draw_dots, draw_motion
from fastslow.plot.style import MM, MOTION, TRANSITIONS, Drawing, axes_for
from fastslow.results.overlays import Overlay

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
        The state on the vertical axis.
    diagram : DiagramDrawing
        The branches beneath.
    lines : tuple of Line2D
        The trajectory: earlier periods, if there are any, and the last one.
    crossings : Line2D or None
        One dot for each crossing of an interface.
    transitions : tuple of Line2D
        One for each kind of transition.
    arrows : tuple of Annotation
        Sense of direction.
    legend : Legend or None
    """

    state: str
    diagram: DiagramDrawing
    lines: tuple[Line2D, ...]
    crossings: Line2D | None
    transitions: tuple[Line2D, ...]
    arrows: tuple[Annotation, ...]
    legend: Legend | None

    @property
    def handles(self) -> list[Artist]:
        """What a legend shows: branches, special points, trajectory, crossings, transitions."""
        dots = () if self.crossings is None else (self.crossings,)
        return [*self.diagram.handles, *self.lines[::-1], *dots, *self.transitions]


def overlay(
    lay: Overlay,
    state: object = None,
    *,
    ax: Axes | None = None,
    label: bool = True,
    legend: bool = True,
    crossings: bool = True,
    interfaces: bool = True,
    virtual: bool = False,
    color: str = MOTION,
    **style: Any,
) -> OverlayDrawing:
    """Draw a trajectory over the branches of equilibria that it passes.

    Jumps at a fold, passages of a boundary equilibrium and other changes of
    the followed sheet have markers of their own, where two thirds of the way
    to the new sheet are done; dots mark the crossings of interfaces.

    Parameters
    ----------
    lay : Overlay
    state : str or Symbol, optional
        The state on the vertical axis, by default the first.
    ax : Axes, optional
        Axes to draw into; new ones of a column's width (85 mm) otherwise.
    label : bool
        Whether to write LP1, BE1, … beside special points.
    legend : bool
        Whether to draw a legend.
    crossings : bool
        Whether to mark the crossings of interfaces.
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

    Raises
    ------
    UnknownNameError
        If ``state`` is no state of the diagram.
    """
    name = state_name(lay.diagram.states, state)
    own, ax = ax is None, axes_for(ax, height=78 * MM)
    drawn = draw_passage(
        ax,
        lay,
        name,
        label=label,
        crossings=crossings,
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
    interfaces: bool = True,
    virtual: bool = False,
    color: str = MOTION,
    **style: Any,
) -> OverlayDrawing:
    """Draw an overlay without a legend, its labels not placed yet; arguments as for `overlay`."""
    values = lay.state[:, lay.diagram.states.index(name)]
    lines = draw_motion(ax, lay.time, lay.slow, values, lay.run.period, color, style)
    dots = None
    if crossings:
        dots = draw_dots(ax, at_crossings(lay.run, lay.parameter), at_crossings(lay.run, name))
    changes = _transitions(ax, lay, lay.diagram.states.index(name))
    # after the trajectory, so that the bands take its limits in
    below = draw_branches(
        ax, lay.diagram, name, label=label, virtual=virtual, interfaces=interfaces
    )
    for line in below.lines:
        if line.get_label() == "stable":
            # wide enough to be seen beneath a trajectory that follows it
            line.set_linewidth(2.2)
    travel = np.r_[0.0, np.cumsum(np.abs(np.diff(points(lines[-1])[:, 0])))]
    heads = draw_arrows(lines[-1], travel, ARROWS)
    return OverlayDrawing(ax, name, below, lines, dots, changes, heads, None)


def _transitions(ax: Axes, lay: Overlay, index: int) -> tuple[Line2D, ...]:
    drawn: list[Line2D] = []
    for kind, (marker, colour, text) in TRANSITIONS.items():
        met: Sequence[Any] = [t for t in lay.transitions if t.kind == kind]
        if met:
            drawn += ax.plot(
                [t.value for t in met],
                [t.state[index] for t in met],
                linestyle="none",
                marker=marker,
                markersize=7.0 if marker == "*" else 5.5,
                markerfacecolor=colour if marker == "*" else "none",
                markeredgecolor="black" if marker == "*" else colour,
                markeredgewidth=0.4 if marker == "*" else 1.2,
                zorder=5.5,
                label=text,
            )
    return tuple(drawn)
