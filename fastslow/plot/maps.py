"""Maps over two parameters: areas by label, boundaries as lines, names within the areas."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.text import Annotation, Text
from numpy.typing import ArrayLike, NDArray

from fastslow.arguments import flag, instance, mapping, takes
from fastslow.errors import unknown_name
from fastslow.plot.arguments import line_colour, line_style, lines_in_plane, points_in_plane
from fastslow.plot.labels import key, place, settle, tag
from fastslow.plot.style import BLACK, GREY, SMALL, VERMILION, Drawing, axes_for, typeset
from fastslow.results.refined_maps import FAILED, RefinedMap

Floats = NDArray[np.float64]

#: Fills of the regimes of a gap; tints of the Okabe-Ito colours, apart in lightness too.
FILLS: dict[Any, str] = {
    "bilateral": "#8FC3E6",
    "unilateral upper": "#F7DFA8",
    "unilateral lower": "#EBC5DA",
    "meshed upper": "#F4F4F4",
    "meshed lower": "#BFE3D5",
    "free": "#FFFFFF",
    "no gap": "#D0D0D0",
    FAILED: "#6E6E6E",
}

#: Fills of other labels, in turn.
OTHERS = ("#F4F4F4", "#8FC3E6", "#F7DFA8", "#BFE3D5", "#EBC5DA", "#C9B79C", "#7FA7A0", "#B0A8D9")

#: Hatches of areas too small for their names, in turn.
HATCHES = ("////", "\\\\\\\\", "....", "xxxx", "----", "||||")


@dataclass(frozen=True, eq=False)
class MapDrawing(Drawing):
    """A drawn map.

    Parameters
    ----------
    ax : Axes
    fills : dict of PolyCollection
        The area of each label.
    lines : tuple of Line2D
        The boundaries.
    curves : tuple of Line2D
        What was drawn over the map.
    names : dict of Text
        Labels written into their areas, where they fit.
    marks : tuple of Annotation
        Labels of the points marked.
    legend : Legend or None
    """

    fills: dict[Any, PolyCollection]
    lines: tuple[Line2D, ...]
    curves: tuple[Line2D, ...]
    names: dict[Any, Text]
    marks: tuple[Annotation, ...]
    legend: Legend | None


@takes(
    result=instance(RefinedMap),
    ax=instance(Axes),
    curves=lines_in_plane,
    marks=points_in_plane,
    fills=mapping,
    label=flag,
    legend=flag,
    style=line_style,
)
def regime_map(
    result: RefinedMap,
    *,
    ax: Axes | None = None,
    curves: Mapping[str, tuple[ArrayLike, ArrayLike]] | None = None,
    marks: Mapping[str, tuple[float, float]] | None = None,
    fills: Mapping[Any, str] | None = None,
    label: bool = True,
    legend: bool = True,
    **style: Any,
) -> MapDrawing:
    """Draw a refined map: each area in its colour and with its name, boundaries as lines.

    An area too small for its name is hatched.

    Parameters
    ----------
    result : RefinedMap
        Of regimes, or of any other labels.
    ax : Axes, optional
        Axes to draw into; new ones of a column's width (85 mm) otherwise.
    curves : mapping, optional
        What to lay over it, e.g. a criterion: name to values along both axes;
        NaN interrupts a curve.
    marks : mapping, optional
        Points to mark: name to values along both axes.
    fills : mapping, optional
        Label to colour, where another than the default is wanted.
    label : bool
        Whether to write names into the areas.
    legend : bool
        Whether to draw a legend.
    **style
        Properties of the boundary lines.

    Returns
    -------
    MapDrawing
    """
    own, ax = ax is None, axes_for(ax)
    (left, right), (low, high) = result.over
    ax.set_xlim(left, right)
    ax.set_ylim(low, high)
    ax.set_xlabel(typeset(result.names[0]))
    ax.set_ylabel(typeset(result.names[1]))
    colours = _colours(result, fills or {})
    shapes = _polygons(result)
    drawn = {
        word: PolyCollection(
            shapes[code],
            facecolor=colours[word],
            edgecolor=colours[word],
            linewidth=0.3,
            zorder=0.5,
        )
        for code, word in enumerate(result.labels)
    }
    for collection in drawn.values():
        ax.add_collection(collection, autolim=False)
    look = {"color": BLACK, "linewidth": 0.8, "solid_joinstyle": "round", "zorder": 2.0, **style}
    lines = [line for b in result.boundaries for line in ax.plot(*b.points.T, **look)]
    over = []
    for number, (name, (x, y)) in enumerate((curves or {}).items()):
        dashes = (0, (4, 2)) if number == 0 else (0, (1 + number, 1.5, 4, 1.5))
        dressing: dict[str, Any] = {"linestyle": dashes, "linewidth": 1.3, "zorder": 3.0}
        over += ax.plot(np.asarray(x), np.asarray(y), color=VERMILION, label=name, **dressing)
    tags = []
    for name, at in (marks or {}).items():
        ax.plot(*at, "o", markersize=4, color=BLACK, markeredgecolor="white", zorder=4)
        tags.append(tag(ax, name, at))
    handles = [
        Patch(facecolor=colours[word], edgecolor=GREY, linewidth=0.5, label=str(word))
        for word in result.labels
    ]
    shown_key = key(ax, [*handles, *over], own) if legend else None
    settle(ax)
    names = _names(ax, result, (*lines, *over), list((marks or {}).values())) if label else {}
    unnamed = [word for word in result.labels if word not in names] if label else []
    for number, word in enumerate(unnamed):
        hatch = HATCHES[number % len(HATCHES)]
        drawn[word].set(hatch=hatch, edgecolor=GREY, linewidth=0.0)
        if shown_key is not None:
            patch = shown_key.get_patches()[result.labels.index(word)]
            patch.set(hatch=hatch)
    taken = [*names.values(), *([] if shown_key is None else [shown_key])]
    place(ax, tags, taken)
    return MapDrawing(ax, drawn, tuple(lines), tuple(over), names, tuple(tags), shown_key)


def _colours(result: RefinedMap, fills: Mapping[Any, str]) -> dict[Any, str]:
    for word, fill in fills.items():
        if word not in result.labels:
            raise unknown_name("label", word, result.labels)
        line_colour(f"fills[{word!r}]", fill)
    known = {**FILLS, **fills}
    others = [word for word in result.labels if word not in known]
    turn = {word: OTHERS[k % len(OTHERS)] for k, word in enumerate(others)}
    return {word: known.get(word, turn.get(word, "")) for word in result.labels}


def _polygons(result: RefinedMap) -> list[list[Floats]]:
    """The area of each label: whole cells, and the parts of those that a boundary cuts."""
    found: list[list[Floats]] = [[] for _ in result.labels]
    low = np.array([r[0] for r in result.over])
    steps, mixed = result.steps, result.mixed
    crossings = {
        tuple(place): float(np.mean(bracket))
        for place, bracket in zip(result.edges.places.tolist(), result.edges.brackets, strict=True)
    }
    for cell, codes, cut in zip(result.cells, result.corner_codes, mixed, strict=True):
        i, j, size = cell.tolist()
        corners = [(i, j), (i + size, j), (i + size, j + size), (i, j + size)]
        if not cut:
            found[codes[0, 0]].append(low + steps * np.array(corners))
            continue
        around = [int(codes[a, b]) for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))]
        sides = [(i, j, 0), (i + 1, j, 1), (i, j + 1, 0), (i, j, 1)]
        points = [_crossing(side, crossings) for side in sides]
        for code, outline in _parts(corners, around, points, (i + 0.5, j + 0.5)):
            found[code].append(low + steps * np.array(outline))
    return found


Point = tuple[float, float]


def _crossing(side: tuple[int, int, int], crossings: Mapping[Any, float]) -> Point:
    i, j, axis = side
    along = crossings.get(side, 0.5)
    return (i + along, float(j)) if axis == 0 else (float(i), j + along)


def _parts(
    corners: list[tuple[int, int]], around: list[int], points: list[Point], middle: Point
) -> list[tuple[int, list[Point]]]:
    """Outlines of the labels within a cell that a boundary cuts."""
    changes = [k for k in range(4) if around[k] != around[(k + 1) % 4]]
    if len(changes) == 2:
        first, second = changes
        one: list[Point] = [points[first], *corners[first + 1 : second + 1], points[second]]
        rest = [corners[k % 4] for k in range(second + 1, first + 5)]
        return [(around[second], one), (around[first], [points[second], *rest, points[first]])]
    for k in (0, 1):
        # equal labels at opposite corners are joined, of two such pairs the earlier one
        mine, others = around[k], (around[k + 1], around[k - 1])
        if len(changes) == 4 and mine == around[k + 2] and not others[0] == others[1] < mine:
            joined: list[Point] = []
            for corner in (k, k + 2):
                joined += [points[corner - 1], corners[corner], points[corner]]
            cut = [(around[j], [points[j - 1], corners[j], points[j]]) for j in (k - 1, k + 1)]
            return [(mine, joined), *cut]
    return [(around[k], [corners[k], points[k], middle, points[k - 1]]) for k in range(4)]


def _names(
    ax: Axes, result: RefinedMap, lines: tuple[Line2D, ...], marks: list[Point]
) -> dict[Any, Text]:
    """Write each label where its area is widest, if it fits there."""
    frame = ax.get_window_extent()
    # a mark needs room for its own name, at any side of it
    room_around = 0.08 * frame.width * np.array([[0, 0], [1, 0], [-1, 0], [0, 0.5], [0, -0.5]])
    ink = [ax.transData.transform(at) + room_around for at in marks]
    for line in lines:
        pixels = line.get_transform().transform(np.asarray(line.get_xydata(), dtype=float))
        pixels = pixels[np.isfinite(pixels).all(axis=1)]
        if len(pixels) > 1:
            along = np.r_[0.0, np.cumsum(np.hypot(*np.diff(pixels, axis=0).T))]
            where = np.linspace(0.0, along[-1], int(np.clip(along[-1] / 3.0, 2, 5000)))
            ink.append(np.column_stack([np.interp(where, along, p) for p in pixels.T]))
    covered = np.vstack([*ink, frame.corners()])
    # a raster of places, coarse enough to be quick
    across, up = np.meshgrid(np.linspace(0.02, 0.98, 41), np.linspace(0.02, 0.98, 41))
    low, high = np.transpose(result.over)
    places = low + (high - low) * np.column_stack([across.ravel(), up.ravel()])
    found = result.at(places[:, 0], places[:, 1])
    pixels = ax.transData.transform(places)
    names = {}
    for word in result.labels:
        mine = np.flatnonzero(found == word)
        text = ax.text(0, 0, str(word), ha="center", va="center", fontsize=SMALL, zorder=3.5)
        text.set_transform(None)
        box = text.get_window_extent().padded(3.0)
        half = np.array([box.width, box.height]) / 2.0
        best, room = None, 1.0
        for k in mine.tolist():
            # how far the box may grow until it meets a line or the frame
            gaps = np.abs(covered - pixels[k]) / half
            walls = np.abs(np.array([frame.x0, frame.x1]) - pixels[k, 0]).min() / half[0]
            floors = np.abs(np.array([frame.y0, frame.y1]) - pixels[k, 1]).min() / half[1]
            free = min(float(gaps.max(axis=1).min()), float(walls), float(floors))
            if free > room:
                best, room = k, free
        if best is None:
            text.remove()
            continue
        text.set_transform(ax.transData)
        text.set_position((float(places[best, 0]), float(places[best, 1])))
        names[word] = text
    return names
