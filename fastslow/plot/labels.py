"""Small texts and legends, put where they cover nothing."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, get_args

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.legend import Legend
from matplotlib.text import Annotation, Text
from matplotlib.transforms import Bbox
from numpy.typing import NDArray

from fastslow.plot.bands import Bands
from fastslow.plot.style import BLACK, SMALL, root

Points = NDArray[np.float64]

Corner = Literal[
    "upper left", "lower right", "upper right", "lower left", "center left", "center right"
]
CORNERS: tuple[Corner, ...] = get_args(Corner)
TURNS = np.deg2rad([45, 135, -45, -135, 90, -90, 0, 180, 22, 158, -22, -158])

#: Where the name of a region may stand: across its band, and along it in parts of the axes.
DEPTHS = (0.5, 0.25, 0.75)
SIDES = (0.95, 0.05, 0.8, 0.2, 0.65, 0.35, 0.5)
REACH = (7.0, 10.0, 14.0, 19.0, 25.0)


def tag(ax: Axes, text: str, at: tuple[float, float]) -> Annotation:
    """A label for a point, to be placed by `place`."""
    return ax.annotate(
        text,
        at,
        xytext=(6, 6),
        textcoords="offset points",
        ha="center",
        va="center",
        fontsize=SMALL,
        color=BLACK,
        zorder=6,
    )


def settle(ax: Axes) -> None:
    """Give the axes of a figure their final places."""
    root(ax).draw_without_rendering()


def place(
    ax: Axes,
    tags: Sequence[Annotation] = (),
    taken: Sequence[Artist] = (),
    bands: Sequence[Bands] = (),
) -> None:
    """Move labels off the curves, off each other, into the axes, and nearest to their own points.

    Parameters
    ----------
    ax : Axes
        With everything drawn, its limits and its layout final.
    tags : sequence of Annotation
        Labels with offsets in points.
    taken : sequence of Artist
        What else must not be covered, e.g. a legend.
    bands : sequence of Bands
        Whose names are moved too, along and within their regions.
    """
    frame = ax.get_window_extent()
    ink = covered(ax)
    boxes = [artist.get_window_extent() for artist in taken]
    anchors = ax.transData.transform(np.reshape([label.xy for label in tags], (-1, 2)))
    pixels = root(ax).dpi / 72.0
    for label, anchor in zip(tags, anchors, strict=True):
        label.set_position((0.0, 0.0))
        centred = label.get_window_extent().padded(1.0)
        best: tuple[float, tuple[float, float]] = (np.inf, (6.0, 6.0))
        for reach in REACH:
            for turn in TURNS:
                # an ellipse, since a label is wider than high
                offset = (float(1.3 * reach * np.cos(turn)), float(reach * np.sin(turn)))
                box = centred.translated(offset[0] * pixels, offset[1] * pixels)
                cost = _cost(box, frame, ink, boxes) + 0.5 * reach
                cost += 20.0 * _nearer_to_another(box, anchor, anchors)
                if cost < best[0]:
                    best = cost, offset
        label.set_position(best[1])
        boxes.append(centred.translated(best[1][0] * pixels, best[1][1] * pixels))
    for drawn in bands:
        for name, span in zip(drawn.names, drawn.spans, strict=True):
            _move(name, span, drawn.vertical, frame, ink, boxes)


def _move(
    name: Text,
    span: tuple[float, float],
    vertical: bool,
    frame: Bbox,
    ink: Points,
    boxes: list[Bbox],
) -> None:
    """Move the name of a region to a free place in its band, at an edge of the axes if it can."""
    best: tuple[float, tuple[float, float]] = (np.inf, name.get_position())
    for depth in DEPTHS:
        for side in SIDES:
            inside = span[0] + depth * (span[1] - span[0])
            at = (inside, side) if vertical else (side, inside)
            name.set_position(at)
            cost = _cost(name.get_window_extent().padded(1.0), frame, ink, boxes)
            if cost < best[0]:
                best = cost, at
    name.set_position(best[1])
    boxes.append(name.get_window_extent().padded(1.0))


def _nearer_to_another(box: Bbox, anchor: Points, anchors: Points) -> int:
    """How many other points are nearer to a label than its own."""
    middle = np.array([box.x0 + box.x1, box.y0 + box.y1]) / 2.0
    own = np.hypot(*(anchor - middle))
    return int((np.hypot(*(anchors - middle).T) < 0.999 * own).sum())


def key(ax: Axes, handles: Sequence[Artist], own: bool) -> Legend:
    """A legend below the axes of a figure of our own, inside axes that were given."""
    return legend_below(ax, handles, 2) if own else legend_inside(ax, handles)


def legend_below(ax: Axes, handles: Sequence[Artist], columns: int) -> Legend:
    """A legend for the whole figure, below its axes."""
    return root(ax).legend(
        handles=list(handles),
        loc="outside lower center",
        ncols=columns,
        fontsize=SMALL,
        frameon=False,
        handlelength=2.2,
        columnspacing=1.0,
    )


def legend_inside(ax: Axes, handles: Sequence[Artist]) -> Legend:
    """A legend inside the axes, at the corner or side where it covers least."""
    legend = ax.legend(handles=list(handles), fontsize=SMALL, framealpha=0.85, loc=CORNERS[0])
    settle(ax)
    frame, box, ink = ax.get_window_extent(), legend.get_window_extent(), covered(ax)
    pad = box.x0 - frame.x0
    costs = []
    for corner in CORNERS:
        upright, side = corner.split()
        x0 = frame.x0 + pad if side == "left" else frame.x1 - pad - box.width
        middle = (frame.y0 + frame.y1 - box.height) / 2.0
        y0 = {"upper": frame.y1 - pad - box.height, "lower": frame.y0 + pad}.get(upright, middle)
        there = Bbox.from_bounds(x0, y0, box.width, box.height)
        costs.append(_cost(there, frame.padded(1.0), ink, []))
    legend.set_loc(CORNERS[int(np.argmin(costs))])
    return legend


def covered(ax: Axes) -> Points:
    """Points in pixels, at most 3 apart, along every line of the axes, shape (N, 2)."""
    parts: list[Points] = []
    for line in ax.lines:
        pixels = line.get_transform().transform(np.asarray(line.get_xydata(), dtype=float))
        pixels = pixels[np.isfinite(pixels).all(axis=1)]
        drawn = line.get_linestyle() not in ("None", "", " ")
        radius = line.get_markersize() * root(ax).dpi / 144.0
        parts.append(_dense(pixels) if drawn else _rounded(pixels, radius))
    return np.vstack(parts) if parts else np.empty((0, 2))


def _dense(pixels: Points) -> Points:
    if len(pixels) < 2:
        return pixels
    along = np.r_[0.0, np.cumsum(np.hypot(*np.diff(pixels, axis=0).T))]
    count = int(np.clip(along[-1] / 3.0, 2, 200_000))
    where = np.linspace(0.0, along[-1], count)
    return np.column_stack([np.interp(where, along, pixels[:, k]) for k in range(2)])


def _rounded(pixels: Points, radius: float) -> Points:
    """Markers as their centre and eight points around it."""
    turns = np.linspace(0, 2 * np.pi, 8, endpoint=False)
    around = radius * np.column_stack([np.cos(turns), np.sin(turns)])
    return (pixels[:, None] + np.vstack([[0.0, 0.0], around])).reshape(-1, 2)


def _cost(box: Bbox, frame: Bbox, ink: Points, boxes: Sequence[Bbox]) -> float:
    inside = (ink > (box.x0, box.y0)).all(axis=1) & (ink < (box.x1, box.y1)).all(axis=1)
    outside = not (
        frame.x0 < box.x0 and box.x1 < frame.x1 and frame.y0 < box.y0 and box.y1 < frame.y1
    )
    return float(inside.sum()) + 1e3 * sum(box.overlaps(b) for b in boxes) + 1e4 * outside
