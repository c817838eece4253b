"""Legends at free positions."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any, Literal, get_args

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.transforms import ScaledTranslation

from fastslow.plot.layout.occupancy import (
    Points,
    boxes_of_insets,
    occupied_pixels,
    on_draw,
    overlap_cost,
    run_layout,
)
from fastslow.plot.layout.style import SMALL_TEXT, OwnFigure, root
from fastslow.results.point_types import POINT_TYPES

Corner = Literal[
    "upper left", "lower right", "upper right", "lower left", "center left", "center right"
]
CORNERS: tuple[Corner, ...] = get_args(Corner)

#: Each corner and side as fractions of the free width and height.
SIDES: dict[Corner, tuple[float, float]] = {
    corner: (float(corner.endswith("right")), {"u": 1.0, "l": 0.0, "c": 0.5}[corner[0]])
    for corner in CORNERS
}

#: Number of further places across and along the axes.
GRID_PLACES = 9

#: Largest fraction of the axes that is added at the top for a legend without a free position: in
#: a figure of the package, which can have a legend below all axes, and in others.
ADDED_IN_OWN, ADDED_AT_TOP = 0.2, 0.5

LOOK: dict[str, Any] = {"fontsize": SMALL_TEXT, "handlelength": 2.2, "columnspacing": 1.0}

#: Largest height of a legend below the axes relative to its figure, before it is made compact.
HIGHEST_LEGEND = 0.15

COMPACT: dict[str, Any] = {
    "fontsize": 6.5,
    "handlelength": 1.8,
    "handletextpad": 0.5,
    "columnspacing": 0.8,
    "labelspacing": 0.3,
    "borderpad": 0.2,
}


def each_once(artists: Iterable[Artist]) -> list[Artist]:
    """Return the first artist of each label, in order."""
    found: dict[str, Artist] = {}
    for artist in artists:
        found.setdefault(str(artist.get_label()), artist)
    return list(found.values())


def add_legend(
    ax: Axes,
    handles: Sequence[Artist],
    own: bool,
    label: bool,
    legend: bool | None,
    top: float = 1.0,
) -> Legend | None:
    """Add a legend if requested: below the axes of a new figure, inside given axes.

    Parameters
    ----------
    ax : Axes
    handles : sequence of Artist
    own : bool
        Whether the figure was created by the plot function.
    label, legend : bool, bool or None
        Arguments of the plot function; ``legend=None`` stands for ``label``.
    top : float
        Upper bound of a legend inside the axes, as a fraction of their height.
    """
    if not handles or not (label if legend is None else legend):
        return None
    return legend_below(ax, handles) if own else legend_inside(ax, handles, top)


def legend_below(ax: Axes, handles: Sequence[Artist]) -> Legend:
    """Add a legend of the figure below its axes, in as many columns as fit.

    A legend that takes more than `HIGHEST_LEGEND` of the height is made compact: smaller, with its
    entries sorted by length so that the columns are narrow, and finally without the special
    points that are labelled in the axes.
    """
    figure = root(ax)
    # columns of similar entries need less width
    short = sorted(handles, key=lambda handle: -len(str(handle.get_label())))
    unlabelled = [handle for handle in short if not _labelled(ax, handle)]
    attempts = ((handles, LOOK), (handles, COMPACT), (short, COMPACT), (unlabelled, COMPACT))
    found: list[tuple[float, int]] = []
    for number, (entries, size) in enumerate(attempts):
        if not entries:
            continue
        legend = _below(figure, entries, size)
        found.append((legend.get_window_extent().height, number))
        if found[-1][0] <= HIGHEST_LEGEND * figure.bbox.height:
            return legend
        legend.remove()
    return _below(figure, *attempts[min(found)[1]])


def _below(figure: Figure, handles: Sequence[Artist], size: dict[str, Any]) -> Legend:
    def draw(columns: int) -> Legend:
        look: dict[str, Any] = {"loc": "outside lower center", "frameon": False, **size}
        return figure.legend(handles=list(handles), ncols=columns, **look)

    return _fitting(draw, len(handles), 0.98 * figure.bbox.width)


def _labelled(ax: Axes, handle: Artist) -> bool:
    """Return whether special points of an entry are labelled in the axes, such as LP1."""
    code = str(handle.get_label()).partition(" ")[0]
    texts = (text.get_text() for text in ax.texts)
    return code in POINT_TYPES and any(text.rstrip("0123456789") == code for text in texts)


def _fitting(draw: Callable[[int], Legend], count: int, width: float) -> Legend:
    """Draw a legend in as many columns as fit into a width in pixels."""
    columns = min(count, 6)
    while True:
        legend = draw(columns)
        if columns == 1 or legend.get_window_extent().width <= width:
            return legend
        legend.remove()
        # balance the columns at the same number of rows, or one more
        rows = -(-count // columns)
        fewer = -(-count // rows)
        columns = fewer if fewer < columns else columns - 1


def legend_inside(ax: Axes, handles: Sequence[Artist], top: float = 1.0) -> Legend | None:
    """Add a legend at a free position inside the axes, raising their upper limit if needed.

    Limits set by hand are kept. Without a free position the entries are added to one legend below
    all axes of a figure of the package. In another figure the legend is placed below the axes if a
    layout engine reserves space there; otherwise it is omitted.
    """
    run_layout(ax)
    legend = _free(ax, handles, top)
    figure = root(ax)
    if legend is None and isinstance(figure, OwnFigure):
        return _shared(ax, figure, handles)
    if legend is None and root(ax).get_layout_engine() is not None:
        return _outside(ax, handles)
    if legend is None:
        return None
    _choose(ax, legend, top)
    on_draw(ax, lambda _: _choose(ax, legend, top))
    return legend


def _free(ax: Axes, handles: Sequence[Artist], top: float) -> Legend | None:
    """Add a legend in as few columns as have a free position, else flat below a raised limit."""
    frame = ax.get_window_extent()
    flat: list[tuple[float, int]] = []
    for columns in range(1, min(len(handles), 3) + 1):
        legend = _inside(ax, handles, columns, top)
        box = legend.get_window_extent()
        if box.width <= 0.96 * frame.width:
            if _costs(ax, legend, top).min() == 0.0:
                return legend
            flat.append((box.height, columns))
        legend.remove()
    if ax.name == "3d" or not flat or not _raised_limit(ax, min(flat)[0], top):
        return None
    return _inside(ax, handles, min(flat)[1], top)


def _inside(ax: Axes, handles: Sequence[Artist], columns: int, top: float) -> Legend:
    look: dict[str, Any] = {"framealpha": 0.85, "loc": CORNERS[0], **LOOK}
    look |= {"bbox_to_anchor": (0.0, 0.0, 1.0, top), "borderaxespad": 0.5}
    return ax.legend(handles=list(handles), ncols=columns, **look)


def _shared(ax: Axes, figure: OwnFigure, handles: Sequence[Artist]) -> Legend:
    """Add entries to the legend below all axes of the figure."""
    if figure.shared_legend is not None:
        figure.shared_legend.remove()
    figure.shared = tuple(each_once([*figure.shared, *handles]))
    figure.shared_legend = legend_below(ax, figure.shared)
    return figure.shared_legend


def _outside(ax: Axes, handles: Sequence[Artist]) -> Legend:
    """Add a legend below the axes, their ticks and their label."""
    figure = root(ax)
    frame, all_of_it = ax.get_window_extent(), ax.get_tightbbox()
    depth = 0.0 if all_of_it is None else (frame.y0 - all_of_it.y0) / figure.dpi
    below = ax.transAxes + ScaledTranslation(0.0, -depth, figure.dpi_scale_trans)
    look: dict[str, Any] = {"loc": "upper center", "bbox_to_anchor": (0.5, 0.0), "frameon": False}

    def draw(columns: int) -> Legend:
        more = {"bbox_transform": below, "ncols": columns, **LOOK}
        return ax.legend(handles=list(handles), **look, **more)

    middle = 0.5 * (frame.x0 + frame.x1)
    widest = 2.0 * min(middle, figure.bbox.width - middle)  # within the figure
    return _fitting(draw, len(handles), min(1.1 * frame.width, widest))


def _pad(ax: Axes) -> float:
    """Distance of a legend from the edges of the axes, in pixels."""
    return 0.5 * SMALL_TEXT * root(ax).dpi / 72.0


def _places(ax: Axes, legend: Legend, top: float) -> Points:
    """Boxes of the legend at each corner and side, and on a grid between them, shape (K, 4)."""
    frame, box, pad = ax.get_window_extent(), legend.get_window_extent(), _pad(ax)
    highest = frame.y0 + top * frame.height
    first = np.array([frame.x0 + pad, frame.y0 + pad])
    last = np.array([frame.x1 - pad - box.width, highest - pad - box.height])
    shares = np.linspace(0.0, 1.0, GRID_PLACES)
    between = np.reshape(np.meshgrid(shares, shares, indexing="ij"), (2, -1)).T
    starts = first + np.vstack([[SIDES[corner] for corner in CORNERS], between]) * (last - first)
    return np.hstack([starts, starts + np.array([box.width, box.height])])


def _costs(ax: Axes, legend: Legend, top: float) -> Points:
    """Cost of the legend at each of its places, shape (K,)."""
    frame = ax.get_window_extent().padded(1.0)
    taken = boxes_of_insets(ax)
    return overlap_cost(_places(ax, legend, top), occupied_pixels(ax), taken, frame)


def _choose(ax: Axes, legend: Legend, top: float) -> None:
    """Move a legend to the best place, unless it was removed or replaced."""
    if ax.get_legend() is not legend:
        return
    costs = _costs(ax, legend, top)
    # other axes of the figure may have taken space since the legend was added
    if costs.min() > 0.0 and _raised_limit(ax, legend.get_window_extent().height, top):
        costs = _costs(ax, legend, top)
    best = int(np.argmin(costs))
    if best < len(CORNERS):
        legend.set_loc(CORNERS[best])
        return
    frame, place = ax.get_window_extent(), _places(ax, legend, top)[best]
    # as fractions of the box that a legend is anchored in
    size = np.array([frame.width, top * frame.height])
    x, y = (place[:2] - frame.min) / size
    legend.set_loc((float(x), float(y)))


def _raised_limit(ax: Axes, height: float, top: float) -> bool:
    """Raise the upper limit by the height of a legend; False if fixed or too much is needed."""
    part = (height + 2.0 * _pad(ax)) / ax.get_window_extent().height
    most = ADDED_IN_OWN if isinstance(root(ax), OwnFigure) else ADDED_AT_TOP
    if part > most * top or not ax.get_autoscaley_on():
        return False
    scale = ax.yaxis.get_transform()
    low, high = scale.transform(ax.get_ylim())
    rise = (high - low) * top / (top - part)
    ax.set_ylim(ax.get_ylim()[0], float(scale.inverted().transform([low + rise])[0]), auto=None)
    return True
