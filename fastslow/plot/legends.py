"""Legends, put where they cover nothing."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, get_args

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.legend import Legend

from fastslow.plot.covering import Points, at_draw, covered, overlaid, settle
from fastslow.plot.style import SMALL, root

Corner = Literal[
    "upper left", "lower right", "upper right", "lower left", "center left", "center right"
]
CORNERS: tuple[Corner, ...] = get_args(Corner)

#: Part of the axes that a legend may take at their top where the curves leave no room for it.
MOST = 0.6

LOOK: dict[str, Any] = {"fontsize": SMALL, "handlelength": 2.2, "columnspacing": 1.0}


def explained(
    ax: Axes, handles: Sequence[Artist], own: bool, label: bool, legend: bool | None
) -> Legend | None:
    """A legend if one is wanted: below the axes of our own figure, inside axes that were given.

    Parameters
    ----------
    ax : Axes
    handles : sequence of Artist
    own : bool
        Whether the figure is our own.
    label, legend : bool, bool or None
        As given to the plot function: without a word about the legend labels decide.
    """
    if not handles or not (label if legend is None else legend):
        return None
    return legend_below(ax, handles) if own else legend_inside(ax, handles)


def legend_below(ax: Axes, handles: Sequence[Artist]) -> Legend:
    """A legend for the whole figure, below its axes, in as many columns as have room."""
    figure = root(ax)
    columns = min(len(handles), 6)
    while True:
        legend = figure.legend(
            handles=list(handles),
            loc="outside lower center",
            ncols=columns,
            frameon=False,
            **LOOK,
        )
        if columns == 1 or legend.get_window_extent().width <= 0.98 * figure.bbox.width:
            return legend
        legend.remove()
        # as many rows, or one more, in columns that are filled
        rows = -(-len(handles) // columns)
        fewer = -(-len(handles) // rows)
        columns = fewer if fewer < columns else columns - 1


def legend_inside(ax: Axes, handles: Sequence[Artist]) -> Legend:
    """A legend inside the axes where it covers least; room is made above if it would cover some.

    Limits that were set by hand are kept.
    """
    settle(ax)
    found: list[tuple[float, int, float]] = []
    width = ax.get_window_extent().width
    for columns in (1, 2, 3):
        if columns > len(handles):
            break
        legend = _inside(ax, handles, columns)
        box = legend.get_window_extent()
        if columns == 1 or box.width <= 0.96 * width:
            found.append((float(_costs(ax, legend).min()), columns, box.height))
    least = min(found)
    if least[0] > 0.0 and ax.get_autoscaley_on() and ax.name != "3d":
        flat = min(found, key=lambda one: one[2])
        if _made_room(ax, flat[2]):
            least = flat
    legend = _inside(ax, handles, least[1])
    _choose(ax, legend)
    at_draw(ax, lambda: _choose(ax, legend))
    return legend


def _inside(ax: Axes, handles: Sequence[Artist], columns: int) -> Legend:
    return ax.legend(handles=list(handles), framealpha=0.85, ncols=columns, loc=CORNERS[0], **LOOK)


def _pad(ax: Axes) -> float:
    """Distance of a legend from the edges of the axes, in pixels."""
    return 0.5 * SMALL * root(ax).dpi / 72.0


def _costs(ax: Axes, legend: Legend) -> Points:
    """How much the legend would cover at each corner and side, shape (corners,)."""
    frame, box, pad = ax.get_window_extent(), legend.get_window_extent(), _pad(ax)
    places = []
    for corner in CORNERS:
        upright, side = corner.split()
        x0 = frame.x0 + pad if side == "left" else frame.x1 - pad - box.width
        middle = (frame.y0 + frame.y1 - box.height) / 2.0
        y0 = {"upper": frame.y1 - pad - box.height, "lower": frame.y0 + pad}.get(upright, middle)
        places.append([x0, y0, x0 + box.width, y0 + box.height])
    return overlaid(np.array(places), covered(ax), np.empty((0, 4)), frame.padded(1.0))


def _choose(ax: Axes, legend: Legend) -> None:
    """Move a legend to the best corner, unless it was removed or replaced."""
    if ax.get_legend() is legend:
        legend.set_loc(CORNERS[int(np.argmin(_costs(ax, legend)))])


def _made_room(ax: Axes, height: float) -> bool:
    """Raise the upper limit by the height of a legend, if it is not too high for that."""
    part = (height + 2.0 * _pad(ax)) / ax.get_window_extent().height
    if part > MOST:
        return False
    scale = ax.yaxis.get_transform()
    low, high = scale.transform(ax.get_ylim())
    top = float(scale.inverted().transform([low + (high - low) / (1.0 - part)])[0])
    ax.set_ylim(ax.get_ylim()[0], top, auto=None)
    return True
