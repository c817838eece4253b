"""Adaptive maps over two parameters: labelled areas and their boundaries."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backend_bases import RendererBase
from matplotlib.collections import PolyCollection
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.text import Annotation, Text
from numpy.typing import ArrayLike

from fastslow.arguments import flag, instance, mapping, validated
from fastslow.plot.areas import WITHOUT_EDGES, draw_areas, samples
from fastslow.plot.arguments import figure_width, line_style, lines_in_plane, points_in_plane
from fastslow.plot.drawings import Drawing
from fastslow.plot.layout.labels import place, tag
from fastslow.plot.layout.legends import add_legend
from fastslow.plot.layout.occupancy import occupied_pixels, on_draw, run_layout
from fastslow.plot.layout.style import BLACK, GREY, SMALL_TEXT, VERMILION, axes_for
from fastslow.plot.layout.typesetting import as_given, typeset
from fastslow.results.maps.adaptive_map import RefinedMap

#: Hatches of areas too small for their names, cyclically.
HATCHES = ("////", "\\\\\\\\", "....", "xxxx", "----", "||||")


@dataclass(frozen=True, eq=False, repr=False)
class MapDrawing(Drawing):
    """A drawn map.

    Parameters
    ----------
    ax : Axes
    fills : dict of PolyCollection
        The area of each label.
    lines : tuple of Line2D
        The boundaries that are curves.
    curves : tuple of Line2D
        Curves drawn over the map.
    names : dict of Text
        Names of the areas in which they fit.
    marks : tuple of Annotation
        Labels of the marked points.
    legend : Legend or None
    points : tuple of Line2D
        The marked points.
    """

    fills: dict[Any, PolyCollection]
    lines: tuple[Line2D, ...]
    curves: tuple[Line2D, ...]
    names: dict[Any, Text]
    marks: tuple[Annotation, ...]
    legend: Legend | None
    points: tuple[Line2D, ...] = ()


@validated(
    result=instance(RefinedMap),
    ax=instance(Axes),
    width=figure_width,
    label=flag,
    legend=flag,
    curves=lines_in_plane,
    annotate=points_in_plane,
    fills=mapping,
    style=line_style,
)
def regime_map(
    result: RefinedMap,
    *,
    ax: Axes | None = None,
    width: str | float = "column",
    label: bool = True,
    legend: bool | None = None,
    curves: Mapping[str, tuple[ArrayLike, ArrayLike]] | None = None,
    annotate: Mapping[str, tuple[float, float]] | None = None,
    fills: Mapping[Any, str] | None = None,
    **style: Any,
) -> MapDrawing:
    """Draw an adaptive map: coloured, named areas and their boundaries.

    Areas too small for their names are hatched. Chaotic and unsettled areas have no boundary lines:
    the cells of the map are drawn, in the colours of their corners.

    Parameters
    ----------
    result : RefinedMap
        Map of regimes or of other labels.
    ax : Axes, optional
        Axes to draw into, in which limits set by hand are kept; new ones otherwise.
    width : str or float
        Width of a new figure: ``"column"`` (85 mm), ``"page"`` (170 mm), or millimetres.
    label : bool
        Whether to name the areas and the marked points.
    legend : bool, optional
        Whether to draw a legend; by default as ``label``, and without the areas that are named
        in the map.
    curves : mapping, optional
        Curves over the map, e.g. a criterion: name to values along both axes; NaN
        interrupts a curve.
    annotate : mapping, optional
        Points to mark: name to values along both axes.
    fills : mapping, optional
        Label to colour, replacing the default.
    **style
        Properties of the boundary lines.

    Returns
    -------
    MapDrawing

    See Also
    --------
    fastslow.regime_map, fastslow.refined_map, fastslow.plot.grid

    Examples
    --------
    >>> import fastslow as fs
    >>> disc = fs.refined_map(lambda x, y: x**2 + y**2 < 1, {"x": (0, 2), "y": (0, 2)})
    >>> drawn = fs.plot.regime_map(disc, annotate={"here": (0.3, 1.5)}, linewidth=1.2)
    >>> [text.get_text() for text in drawn.names.values()]
    ['False', 'True']
    """
    own, ax = ax is None, axes_for(ax, width)
    (left, right), (low, high) = result.over
    if ax.get_autoscalex_on():
        ax.set_xlim(left, right)
    if ax.get_autoscaley_on():
        ax.set_ylim(low, high)
    ax.set_xlabel(typeset(result.names[0]))
    ax.set_ylabel(typeset(result.names[1]))
    drawn = draw_areas(ax, result, fills)
    look: dict[str, Any] = {"color": BLACK, "linewidth": 0.8, "zorder": 2.0}
    look |= {"solid_joinstyle": "round", "label": "boundary", **style}
    curved = [b for b in result.boundaries if not WITHOUT_EDGES & set(b.labels)]
    lines = [line for b in curved for line in ax.plot(*b.points.T, **look)]
    over: list[Line2D] = []
    for number, (name, (x, y)) in enumerate((curves or {}).items()):
        dashes = (0, (4, 2)) if number == 0 else (0, (1 + number, 1.5, 4, 1.5))
        dressing: dict[str, Any] = {"linestyle": dashes, "linewidth": 1.3, "zorder": 3.0}
        dressing |= {"color": VERMILION, "label": as_given(str(name))}
        over += ax.plot(np.asarray(x), np.asarray(y), **dressing)
    points: list[Line2D] = []
    tags: list[Annotation] = []
    for name, at in (annotate or {}).items():
        dot: dict[str, Any] = {
            "color": BLACK,
            "markersize": 4,
            "markeredgecolor": "white",
            "zorder": 4,
        }
        points += ax.plot(*at, "o", label=as_given(str(name)), **dot)
        if label:
            tags.append(tag(ax, as_given(str(name)), at))
    run_layout(ax)
    names = _names(ax, result, list((annotate or {}).values())) if label else {}
    patches = dict(zip(drawn, samples(drawn), strict=True))
    unnamed = [word for word in result.labels if word not in names] if label else []
    for number, word in enumerate(unnamed):
        hatch = HATCHES[number % len(HATCHES)]
        drawn[word].set(hatch=hatch, edgecolor=GREY, linewidth=0.0)
        patches[word].set(hatch=hatch)
    # areas named in the map are not named again
    entries = unnamed if label and legend is None else result.labels
    shown_key = add_legend(ax, [*(patches[word] for word in entries), *over], own, label, legend)
    run_layout(ax)
    place(ax, tags)
    return MapDrawing(
        ax, drawn, tuple(lines), tuple(over), names, tuple(tags), shown_key, tuple(points)
    )


def _names(ax: Axes, result: RefinedMap, marks: list[tuple[float, float]]) -> dict[Any, Text]:
    """Write the name of each area at its widest position, if it fits.

    The names are placed again when the axes have changed, or curves were added to them.
    """
    look: dict[str, Any] = {"fontsize": SMALL_TEXT, "zorder": 3.5, "clip_on": True}
    look |= {"ha": "center", "va": "center"}
    names = {word: ax.text(0.0, 0.0, as_given(str(word)), **look) for word in result.labels}

    fitting = _spots(ax, result, names, marks)
    for word in [word for word in names if word not in fitting]:
        names.pop(word).remove()
    for word, spot in fitting.items():
        names[word].set_position(spot)

    def move(_: RendererBase) -> None:
        for word, spot in _spots(ax, result, names, marks).items():
            names[word].set_position(spot)

    if names:
        on_draw(ax, move)
    return names


def _spots(
    ax: Axes, result: RefinedMap, names: Mapping[Any, Text], marks: list[tuple[float, float]]
) -> dict[Any, tuple[float, float]]:
    """Return the widest position of each area for its name, omitting areas without one."""
    frame = ax.get_window_extent()
    # space for the name of a mark, at any side of it
    margins = 0.08 * frame.width * np.array([[0, 0], [1, 0], [-1, 0], [0, 0.5], [0, -0.5]])
    points = [ax.transData.transform(at) + margins for at in marks]
    points.append(frame.corners())
    # names keep clear of edges without a line
    edges = [b.points for b in result.boundaries if WITHOUT_EDGES & set(b.labels)]
    points += [ax.transData.transform(edge) for edge in edges]
    legend: Any = ax.get_legend()
    if legend is not None:
        box = legend.get_window_extent()
        raster = np.meshgrid(np.linspace(box.x0, box.x1, 20), np.linspace(box.y0, box.y1, 20))
        points.append(np.column_stack([part.ravel() for part in raster]))
    ink = occupied_pixels(ax)
    occupied = np.vstack([ink[:, :2], *points])
    reach = np.r_[ink[:, 3], np.zeros(len(occupied) - len(ink))]
    # a coarse raster of positions, for speed
    across, up = np.meshgrid(np.linspace(0.02, 0.98, 41), np.linspace(0.02, 0.98, 41))
    low, high = np.transpose(result.over)
    places = low + (high - low) * np.column_stack([across.ravel(), up.ravel()])
    found = result.at(places[:, 0], places[:, 1])
    pixels = ax.transData.transform(places)
    spots = {}
    for word, text in names.items():
        box = Text.get_window_extent(text).padded(3.0)
        half = np.array([box.width, box.height]) / 2.0
        room = 1.0
        for k in np.flatnonzero(found == word).tolist():
            # factor by which the box may grow before it touches a line or the frame
            gaps = (np.abs(occupied - pixels[k]) - reach[:, None]) / half
            walls = np.abs(np.array([frame.x0, frame.x1]) - pixels[k, 0]).min() / half[0]
            floors = np.abs(np.array([frame.y0, frame.y1]) - pixels[k, 1]).min() / half[1]
            free = min(float(gaps.max(axis=1).min()), float(walls), float(floors))
            if free > room:
                spots[word], room = (float(places[k, 0]), float(places[k, 1])), free
    return spots
