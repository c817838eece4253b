"""Branches and trajectories in space."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.text import Annotation

from fastslow.plot.branch_lines import draw_points, marked_points, runs
from fastslow.plot.drawings import Drawing
from fastslow.plot.layout.arrows import draw_arrows, length_along
from fastslow.plot.layout.labels import place
from fastslow.plot.layout.legends import add_legend
from fastslow.plot.layout.marks import draw_crossings, draw_transitions, draw_turning
from fastslow.plot.layout.occupancy import run_layout
from fastslow.plot.layout.style import BRANCH, EQUILIBRIA, MOTION, SMALL_TEXT, TEXT, axes_for
from fastslow.plot.motion_lines import draw_line
from fastslow.plot.quantities import Quantity, along_branch, along_overlay, joined
from fastslow.results.branch.diagram import Diagram
from fastslow.results.overlay.overlay import Overlay

#: Zoom of axes in space, which leaves space for the axis labels.
ZOOM = 0.86

#: Height of a figure in space, in millimetres.
HEIGHT_OF_SPACE = 92.0

#: Positions of arrow heads, as fractions of the length of a trajectory.
ARROWS_IN_SPACE = (0.2, 0.45, 0.7, 0.95)


@dataclass(frozen=True, eq=False, repr=False)
class SpaceDrawing(Drawing):
    """A diagram or an overlay drawn in three dimensions.

    Parameters
    ----------
    ax : Axes
        Axes with the projection "3d".
    x, y : str
        Quantities on the second and the vertical axis.
    branches : tuple of Line2D
        One for each interval of constant stability.
    markers : tuple of Line2D
        One for each code of special points.
    line : Line2D or None
        The trajectory.
    legend : Legend or None
    labels : tuple of Annotation
        LP1, BE1, … beside the points.
    arrows : tuple of Annotation
        Direction of motion.
    along : str
        Quantity on the first axis.
    crossings : Line2D or None
        One dot for each crossing of an interface.
    transitions : tuple of Line2D
        One for each kind of transition.
    turning : Line2D or None
        Turning points of the slow quantity.
    """

    x: str
    y: str
    branches: tuple[Line2D, ...]
    markers: tuple[Line2D, ...]
    line: Line2D | None
    legend: Legend | None
    labels: tuple[Annotation, ...] = ()
    arrows: tuple[Annotation, ...] = ()
    along: str = ""
    crossings: Line2D | None = None
    transitions: tuple[Line2D, ...] = ()
    turning: Line2D | None = None


def draw_space(
    diagram: Diagram,
    shown: tuple[Quantity, Quantity, Quantity],
    ax: Axes | None,
    width: str | float,
    label: bool,
    legend: bool | None,
    *,
    virtual: bool,
    overlay: Overlay | None = None,
    crossings: bool = True,
    turning: bool = True,
    style: dict[str, Any],
) -> SpaceDrawing:
    """Draw a diagram in space, optionally with a trajectory; see `fastslow.plot.diagram`.

    Parameters
    ----------
    shown : tuple of Quantity
        Quantities on the three axes.
    overlay : Overlay, optional
        Overlay with the trajectory.
    style
        Of the trajectory if there is one, otherwise of the branches.
    """
    own, space = ax is None, axes_for(ax, width, HEIGHT_OF_SPACE, space=True)
    of_branches = {"color": BRANCH, **style} if overlay is None else {"color": BRANCH}
    branches: list[Line2D] = []
    drawn = [b for b in diagram.branches if b.admissible or virtual]
    for branch in drawn:
        places = along_branch(diagram, branch, *shown)
        for kind, rows in runs(branch):
            look = {**EQUILIBRIA[kind], "label": kind, **of_branches}
            if overlay is not None and kind == "stable":
                # wide enough to remain visible under a trajectory that follows it
                look["linewidth"] = 2.0
            line_places = joined([p[rows] for p in places], shown, branch.periods)
            branches += space.plot(*line_places, **look)
    line: Line2D | None = None
    dots: Line2D | None = None
    turns: Line2D | None = None
    changes: tuple[Line2D, ...] = ()
    heads: tuple[Annotation, ...] = ()
    if overlay is not None:
        look = {"linewidth": 0.7, "color": MOTION, "label": "trajectory", **style}
        line = draw_line(space, overlay.t, along_overlay(overlay, *shown), shown, overlay.run, look)
        dots = draw_crossings(space, overlay, shown) if crossings else None
        changes = draw_transitions(space, overlay, shown)
        turns = draw_turning(space, overlay, shown) if turning else None
    markers, labels = draw_points(space, marked_points(drawn), shown, label)
    style_space(space, [q.label for q in shown])
    seen: dict[str, Artist] = {str(h.get_label()): h for h in [*branches, *markers]}
    handles = [*seen.values(), *(m for m in (line, dots, turns, *changes) if m is not None)]
    key = add_legend(space, handles, own, label, legend)
    place(space, labels)
    run_layout(space)
    if line is not None:
        heads = draw_arrows(line, length_along(line), ARROWS_IN_SPACE)
    along, x, y = (q.text for q in shown)
    below = tuple(branches), markers, line, key, labels, heads
    return SpaceDrawing(space, x, y, *below, along, dots, changes, turns)


def style_space(space: Any, names: Sequence[str]) -> None:
    """Set axis labels and small ticks in space."""
    setters = (space.set_xlabel, space.set_ylabel, space.set_zlabel)
    for set_label, text in zip(setters, names, strict=True):
        set_label(text, fontsize=TEXT, labelpad=-4)
    space.tick_params(labelsize=SMALL_TEXT, pad=-3)
    space.tick_params(axis="z", pad=1)
    space.locator_params(nbins=5)
    # the layout does not reserve space for the label of the vertical axis
    space.set_box_aspect(None, zoom=ZOOM)
