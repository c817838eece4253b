"""Labels of points and regions, placed without overlap."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backend_bases import RendererBase
from matplotlib.lines import Line2D
from matplotlib.text import Annotation, Text
from matplotlib.transforms import Bbox

from fastslow.plot.layout.bands import Bands, fit_bands
from fastslow.plot.layout.occupancy import (
    FAINT,
    LayoutArtist,
    Points,
    Step,
    box_of,
    boxes_of_insets,
    occupied_pixels,
    overlap_cost,
    projected,
)
from fastslow.plot.layout.style import BLACK, GREY, SMALL_TEXT, root
from fastslow.results.orbits.special_orbit import SpecialOrbit
from fastslow.results.point_types import CANDIDATE
from fastslow.results.points import SpecialPoint

#: Directions of a label from its point in order of preference, and distances in points.
TURNS = np.deg2rad([45, 135, -45, -135, 90, -90, 0, 180, 22, 158, -22, -158])
LABEL_DISTANCES = (7.0, 10.0, 14.0, 19.0)

#: Labels farther away than this are connected to their points by a leader line; directions and
#: distances of those.
LEADER_FROM = 20.0
FAR_TURNS = np.deg2rad(np.arange(15.0, 375.0, 15.0))
FAR_REACH = (25.0, 33.0, 43.0, 55.0, 70.0)

#: Margin between texts and the edges of the axes, in points.
AIR = 1.5

#: Positions of the name of a region, the best first: across its band, and along it as fractions
#: of the axes. The finer grid is for names between the curves.
DEPTHS, SIDES = (0.5, 0.25, 0.75), (0.95, 0.05, 0.9, 0.1, 0.8, 0.2, 0.65, 0.35, 0.5)
FINE_DEPTHS, FINE_SIDES = np.linspace(0.15, 0.85, 15), np.linspace(0.97, 0.03, 95)
SPOTS = np.vstack(
    [
        np.reshape(np.meshgrid(depths, sides, indexing="ij"), (2, -1)).T
        for depths, sides in ((DEPTHS, SIDES), (FINE_DEPTHS, FINE_SIDES))
    ]
)
COARSE = len(DEPTHS) * len(SIDES)

#: Cost from which a position is excluded: over another text, or outside the axes.
TAKEN_COST = 1e3

#: Weight of covering curves and markers relative to the distance from the point.
COVERING = 30.0

#: Cost from which the name of a region is hidden: over a curve.
COVERED_COST = 0.5


def label_of(point: SpecialPoint | SpecialOrbit) -> str:
    """The label of a special point in figures, which says if it is a candidate."""
    return f"{point.label} ({CANDIDATE})" if point.type == CANDIDATE else point.label


def tag(ax: Axes, text: str, at: Sequence[float]) -> Annotation:
    """Create a label for a point of the plane or in space, to be placed by `place`."""
    label = ax.annotate(
        text,
        (float(at[0]), float(at[1])),
        xytext=(6, 6),
        textcoords="offset points",
        ha="center",
        va="center",
        fontsize=SMALL_TEXT,
        color=BLACK,
        zorder=6,
    )
    # within the axes, whose size must not depend on it
    label.set_in_layout(False)
    if len(at) == 3:
        label._point_in_space = np.array(at, dtype=float)  # type: ignore[attr-defined]
    return label


def place(
    ax: Axes,
    tags: Sequence[Annotation] = (),
    taken: Sequence[Artist] = (),
    bands: Sequence[Bands] = (),
) -> None:
    """Place labels near their points, inside the axes and without overlap.

    The labels are placed when the axes are drawn, and again after a change of their limits or
    size. A label without a free position is hidden, and
    a region without one is not named.

    Parameters
    ----------
    ax : Axes
    tags : sequence of Annotation
        From `tag`.
    taken : sequence of Artist
        Further artists that must not be covered, e.g. a legend of the figure.
    bands : sequence of Bands
        Bands, whose names are placed too, within their regions.
    """
    if not tags and not any(drawn.fills or drawn.lines for drawn in bands):
        return
    leaders = Line2D(
        [], [], color=GREY, linewidth=0.5, zorder=1.8, transform=root(ax).dpi_scale_trans, gid=FAINT
    )
    leaders.set_in_layout(False)
    if tags:
        ax.add_artist(leaders)

    def step(renderer: RendererBase) -> None:
        _place(ax, tags, taken, bands, leaders, renderer)

    ax.add_artist(Placement(step, bands))


class Placement(LayoutArtist):
    """The placement of the labels and of the names of regions in axes.

    Parameters
    ----------
    step : callable
        The placement.
    bands : sequence of Bands
    """

    def __init__(self, step: Step, bands: Sequence[Bands]) -> None:
        super().__init__(step)
        self.bands = bands

    def keep_from(self, earlier: Placement) -> None:
        """Give the names of regions the places of an earlier placement, if they are the same.

        Each is at the same fraction of its band; limits and size of the axes are unchanged.
        """
        ax: Any = self.axes
        one, other = (_names(p.bands) for p in (self, earlier))
        if not earlier.seen or [n.get_text() for n, *_ in one] != [n.get_text() for n, *_ in other]:
            return
        places = [(n.get_position(), n.get_visible(), span) for n, span, _ in other]
        for drawn in self.bands:
            fit_bands(ax, drawn)
        for (name, span, vertical), (place, shown, before) in zip(one, places, strict=True):
            low, high = sorted(ax.get_xlim() if vertical else ax.get_ylim())
            first, last = np.clip(before, low, high)
            part = (place[not vertical] - first) / (last - first)
            start, stop = np.clip(span, low, high)
            across = float(start + part * (stop - start))
            name.set_position((across, place[1]) if vertical else (place[0], across))
            name.set_visible(shown)
        self.renewed()


def _names(bands: Sequence[Bands]) -> list[tuple[Text, tuple[float, float], bool]]:
    """Names of regions, each with the interval of its band and the direction of the band."""
    return [
        (name, span, drawn.vertical)
        for drawn in bands
        for name, span in zip(drawn.names, drawn.spans, strict=True)
    ]


def _place(
    ax: Axes,
    tags: Sequence[Annotation],
    taken: Sequence[Artist],
    bands: Sequence[Bands],
    leaders: Line2D,
    renderer: RendererBase,
) -> None:
    for drawn in bands:
        fit_bands(ax, drawn)
    ink, scale = occupied_pixels(ax), root(ax).dpi / 72.0
    whole = ax.get_window_extent()
    frame = whole.padded(-AIR * scale)
    own = [*tags, *(name for drawn in bands for name in drawn.names)]
    boxes = _others(ax, own, taken, renderer)
    anchors = _anchors(ax, tags)
    reach = np.r_[np.repeat(LABEL_DISTANCES, len(TURNS)), np.repeat(FAR_REACH, len(FAR_TURNS))]
    turns = np.r_[np.tile(TURNS, len(LABEL_DISTANCES)), np.tile(FAR_TURNS, len(FAR_REACH))]
    # on an ellipse, since a label is wider than high
    offsets = np.column_stack([1.3 * reach * np.cos(turns), reach * np.sin(turns)])
    joined: list[Points] = []
    for label, anchor in zip(tags, anchors, strict=True):
        shown = bool(whole.padded(1.0).contains(*anchor))
        label.set_visible(shown)
        if not shown:
            continue
        label.set_position((0.0, 0.0))
        centred = box_of(label, renderer)
        places = centred + np.tile(scale * offsets, 2)
        over = overlap_cost(places, ink, boxes, frame)
        cost = COVERING * over + 0.5 * reach
        middles = 0.5 * (places[:, :2] + places[:, 2:])
        gaps = np.hypot(*np.moveaxis(anchors - middles[:, None], 2, 0))
        away = np.hypot(*(anchor - middles).T)
        nearer = (gaps < 0.999 * away[:, None]).sum(axis=1)
        cost += np.where(reach > LEADER_FROM, 6.0, 20.0 * nearer)
        best = int(np.argmin(cost))
        label.set_position((float(offsets[best, 0]), float(offsets[best, 1])))
        if over[best] >= TAKEN_COST:
            label.set_visible(False)
            continue
        boxes = np.vstack([boxes, places[best]])
        if reach[best] > LEADER_FROM:
            joined += [anchor, _nearest_in(places[best], anchor), np.full(2, np.nan)]
    leaders.set_data(*(np.array(joined).T / root(ax).dpi if joined else ([], [])))
    for drawn in bands:
        for name, span in zip(drawn.names, drawn.spans, strict=True):
            if name.get_visible():
                boxes = _move(ax, name, span, drawn.vertical, frame, ink, boxes, renderer)


def _nearest_in(box: Points, point: Points) -> Points:
    return np.clip(point, box[:2], box[2:])


def _others(
    ax: Axes, own: Sequence[Artist], taken: Sequence[Artist], renderer: RendererBase
) -> Points:
    """Boxes of existing texts and legends, shape (M, 4)."""
    texts = [t for t in ax.texts if t.get_visible() and t.get_text() and t not in own]
    legend: Any = ax.get_legend()
    artists = dict.fromkeys([*texts, *([legend] if legend is not None else []), *taken])
    boxes = np.array([box_of(artist, renderer) for artist in artists]).reshape(-1, 4)
    return np.vstack([boxes, boxes_of_insets(ax, renderer)])


def _anchors(ax: Axes, tags: Sequence[Annotation]) -> Points:
    """Return the points of labels in pixels, projecting those in space."""
    for label in tags:
        spot = getattr(label, "_point_in_space", None)
        if spot is not None:
            ((x, y),) = projected(ax, spot[None])
            label.xy = (float(x), float(y))
    return np.asarray(ax.transData.transform(np.reshape([label.xy for label in tags], (-1, 2))))


def _move(
    ax: Axes,
    name: Text,
    span: tuple[float, float],
    vertical: bool,
    frame: Bbox,
    ink: Points,
    boxes: Points,
    renderer: RendererBase,
) -> Points:
    """Move the name of a region to a free position in its band, preferably at an edge."""
    low, high = sorted(ax.get_xlim() if vertical else ax.get_ylim())
    start, stop = max(span[0], low), min(span[1], high)
    axis = (ax.xaxis if vertical else ax.yaxis).get_transform()
    ends = axis.transform([start, stop])
    air = AIR * root(ax).dpi / 72.0 * np.array([-1.0, -1.0, 1.0, 1.0])
    across = axis.inverted().transform(ends[0] + SPOTS[:, 0] * (ends[1] - ends[0]))
    along = SPOTS[:, 1]
    spots = np.column_stack([across, along] if vertical else [along, across])
    seat = name.get_transform()
    around = box_of(name, renderer) - np.tile(seat.transform(name.get_position()), 2)
    places = around + np.tile(seat.transform(spots), 2)
    # the finer grid, of fifty times as many positions, only if the others all cover something
    costs = overlap_cost(places[:COARSE] + air, ink, boxes, frame)
    if costs.min() > 0.0:
        costs = overlap_cost(places + air, ink, boxes, frame)
    best = int(np.argmin(costs))
    name.set_position((float(spots[best, 0]), float(spots[best, 1])))
    name.set_visible(bool(costs[best] < COVERED_COST))
    return np.vstack([boxes, places[best]]) if costs[best] < COVERED_COST else boxes
