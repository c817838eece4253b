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

from fastslow.plot.arrows import draw_arrows
from fastslow.plot.branches import DiagramDrawing, diagram, state_name
from fastslow.plot.labels import key, place
from fastslow.plot.motions import at_crossings, draw_dots
from fastslow.plot.style import MOTION, TRANSITIONS, Drawing, axes_for
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
    line : Line2D
        The trajectory.
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
    line: Line2D
    crossings: Line2D | None
    transitions: tuple[Line2D, ...]
    arrows: tuple[Annotation, ...]
    legend: Legend | None

    @property
    def handles(self) -> list[Artist]:
        """What a legend shows: branches, special points, trajectory, crossings, transitions."""
        dots = () if self.crossings is None else (self.crossings,)
        return [*self.diagram.handles, self.line, *dots, *self.transitions]


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
    the followed sheet have markers of their own, where the trajectory came
    nearer to the new sheet; dots mark the crossings of interfaces.

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
    own, ax = ax is None, axes_for(ax)
    values = lay.state[:, lay.diagram.states.index(name)]
    look = {"color": color, "linewidth": 0.8, "zorder": 3.0, "label": "trajectory", **style}
    (line,) = ax.plot(lay.slow, values, **look)
    dots = None
    if crossings:
        dots = draw_dots(ax, at_crossings(lay.run, lay.parameter), at_crossings(lay.run, name))
    changes = _transitions(ax, lay, lay.diagram.states.index(name))
    # after the trajectory, so that the limits of the bands take it in
    below = diagram(
        lay.diagram,
        name,
        ax=ax,
        label=label,
        legend=False,
        virtual=virtual,
        interfaces=interfaces,
    )
    last = _last_period(lay)
    travel = np.r_[0.0, np.cumsum(np.abs(np.diff(lay.slow[last])))]
    heads = draw_arrows(ax, lay.slow[last], values[last], travel, ARROWS, color)
    drawn = OverlayDrawing(ax, name, below, line, dots, changes, heads, None)
    if legend:
        drawn = replace(drawn, legend=key(ax, drawn.handles, own))
    place(ax, below.labels, [] if drawn.legend is None else [drawn.legend])
    return drawn


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
                markersize=6.5 if marker == "*" else 4.0,
                markerfacecolor=colour,
                markeredgecolor="black",
                markeredgewidth=0.4,
                zorder=5.5,
                label=text,
            )
    return tuple(drawn)


def _last_period(lay: Overlay) -> slice:
    """Rows of the last period, or all where there is none."""
    period = lay.run.period
    if period is None:
        return slice(0, len(lay.time))
    return slice(int(np.searchsorted(lay.time, lay.time[-1] - period)), len(lay.time))
