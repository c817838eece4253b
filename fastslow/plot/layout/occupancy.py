"""Pixels occupied by curves and markers, which labels and legends must not cover."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backend_bases import RendererBase
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D
from matplotlib.text import Annotation
from matplotlib.transforms import Bbox
from numpy.typing import NDArray

from fastslow.plot.layout.style import root
from fastslow.plot.layout.thinning import LongLine

Points = NDArray[np.float64]

#: A step of the layout; texts are measured with the given renderer.
Step = Callable[[RendererBase], None]

#: Spacing of the samples of a curve, in points (1/72 inch).
SAMPLE_SPACING = 1.5

#: Side of the cells in which one sample is kept, in points.
CELL = 0.5

#: Changes of the axes up to this do not move labels, in points: the layout of a figure at another
#: resolution differs by rounding of the extents of texts.
SHIFT = 1.0

#: Cost of covering a sample of a marker, relative to a sample of a curve.
MARKER_COST = 80.0

#: Half of the size of an arrow head, in points.
ARROW = 3.0

#: Group of artists that may be covered.
FAINT = "fastslow faint"


class LayoutArtist(Artist):
    """Invisible artist that repeats a step of the layout when its axes have changed.

    Labels, legends and names of regions, whose positions depend on other artists, are thus
    placed again after a change of the limits or the size.
    """

    def __init__(self, step: Step) -> None:
        super().__init__()
        self.step = step
        self.seen: tuple[Any, ...] = ()
        self.frame = np.full(4, np.inf)
        self.set_in_layout(False)
        self.set_zorder(-1e9)

    def draw(self, renderer: RendererBase) -> None:
        """Run the step if the axes have changed since it was last run."""
        if self.renewed():
            self.step(renderer)

    def renewed(self) -> bool:
        """Note the present axes; return whether they have changed."""
        ax: Any = self.axes
        # in points: at another resolution everything keeps its place
        frame = np.array(ax.get_window_extent().bounds) * 72.0 / root(ax).dpi
        limits = [ax.get_xlim(), ax.get_ylim(), ax.get_xscale(), ax.get_yscale()]
        if ax.name == "3d":
            limits += [ax.get_zlim(), ax.elev, ax.azim, ax.roll]
        now = (*limits, len(ax.lines), len(ax.collections))
        changed = now != self.seen or bool(np.abs(frame - self.frame).max() > SHIFT)
        if changed:
            self.seen, self.frame = now, frame
        return changed


def on_draw(ax: Axes, step: Step) -> None:
    """Run a step of the layout at each draw before which the axes have changed.

    The step receives the renderer, since a text would otherwise be measured with the last
    one, whose resolution may differ.
    """
    ax.add_artist(LayoutArtist(step))


def run_layout(ax: Axes) -> None:
    """Run the layout of a figure and place the contents of its axes.

    For given axes the layout runs when their figure is drawn.
    """
    root(ax).draw_without_rendering()


def run_engine(ax: Axes) -> None:
    """Run the layout of a figure alone, without drawing its contents."""
    engine = root(ax).get_layout_engine()
    if engine is not None:
        engine.execute(root(ax))


def projected(ax: Any, places: Points) -> Points:
    """Project points in space, shape (N, 3), to the plane of the axes, shape (N, 2)."""
    onto = np.column_stack([places, np.ones(len(places))]) @ ax.get_proj().T
    return np.asarray(onto[:, :2] / onto[:, 3:])


def pixels_of(ax: Axes, places: Points) -> Points:
    """Transform points, shape (N, 2) or in space (N, 3), to pixels."""
    flat = projected(ax, places) if places.shape[1] == 3 else places
    return np.asarray(ax.transData.transform(flat))


def occupied_pixels(ax: Axes, omitted: str = "") -> Points:
    """Sample all curves, markers and arrow heads of the axes, in pixels.

    Parameters
    ----------
    ax : Axes
    omitted : str
        Label of lines that may be covered.

    Returns
    -------
    ndarray, shape (N, 4)
        x, y, the cost of covering the sample (1 on a curve, more on a marker), and the distance
        to which it reaches: half of the line's width, or the radius of the marker.
    """
    frame, scale = ax.get_window_extent(), root(ax).dpi / 72.0
    step = SAMPLE_SPACING * scale
    parts = [np.empty((0, 4))]
    for pixels, width, radius in _shapes(ax, omitted):
        if width is not None:
            parts.append(_weighted(_dense(pixels, frame, step), 1.0, 0.5 * width * scale))
        if radius:
            near = np.isfinite(pixels).all(axis=1)
            parts.append(_weighted(pixels[near], MARKER_COST, radius * scale))
    ink = np.vstack(parts)
    # of several samples in a cell the heaviest counts, and of these the widest
    ink = ink[np.lexsort((-ink[:, 3], -ink[:, 2]))]
    cells = np.floor((ink[:, :2] - (frame.x0, frame.y0)) / (CELL * scale))
    inside = (np.abs(cells) < 100_000).all(axis=1)
    _, first = np.unique(cells[inside] @ np.array([1.0, 1e6]), return_index=True)
    return np.asarray(ink[inside][first])


def _weighted(points: Points, weight: float, reach: float) -> Points:
    return np.column_stack([points, np.full((len(points), 2), (weight, reach))])


def _shapes(ax: Axes, omitted: str) -> Iterator[tuple[Points, float | None, float]]:
    """Yield curves in pixels, the width of their line and the radius of markers, in points.

    The width is None for markers without a line.
    """
    for line in ax.lines:
        if not line.get_visible() or line.get_gid() == FAINT or line.get_label() == omitted:
            continue
        joined = line.get_linestyle() not in ("None", "", " ")
        marked = line.get_marker() not in ("None", "", " ", None)
        width = float(line.get_linewidth()) if joined else None
        yield pixels_of_line(ax, line), width, marked * 0.5 * line.get_markersize()
    for collection in ax.collections:
        if isinstance(collection, LineCollection):
            width = float(np.max(collection.get_linewidth(), initial=0.0))
            for path in collection.get_paths():
                yield ax.transData.transform(path.vertices), width, 0.0
    for head in ax.texts:
        # an arrow head is an annotation without text
        if isinstance(head, Annotation) and head.arrow_patch is not None and not head.get_text():
            yield np.asarray(ax.transData.transform([head.xy])), None, ARROW


def pixels_of_line(ax: Axes, line: Line2D) -> Points:
    """Transform the points that are drawn of a line to pixels."""
    if hasattr(line, "get_data_3d"):
        places = np.column_stack([np.asarray(d, dtype=float) for d in line.get_data_3d()])
        return pixels_of(ax, places)
    places = np.asarray(line.get_xydata(), dtype=float)
    if isinstance(line, LongLine):
        places = line.drawn_data()
    with np.errstate(all="ignore"):  # values that a logarithmic axis cannot show
        return np.asarray(line.get_transform().transform(places))


def clip_segments(pixels: Points, frame: Bbox) -> tuple[Points, Points, Points, Points]:
    """Clip the segments of a polyline to a box (Liang and Barsky 1984).

    Returns
    -------
    start, run : ndarray, shape (K, 2)
        First point and extent of each segment that meets the box.
    enter, leave : ndarray, shape (K,)
        Fractions of the segment between which it is within the box.
    """
    start, run = pixels[:-1], np.diff(pixels, axis=0)
    good = np.isfinite(start).all(axis=1) & np.isfinite(run).all(axis=1)
    start, run = start[good], run[good]
    enter, leave = np.zeros(len(start)), np.ones(len(start))
    for axis, (low, high) in enumerate((frame.intervalx, frame.intervaly)):
        with np.errstate(all="ignore"):
            one, other = ((edge - start[:, axis]) / run[:, axis] for edge in (low, high))
        still = run[:, axis] == 0.0
        within = (start[:, axis] >= low) & (start[:, axis] <= high)
        first = np.where(still, np.where(within, -np.inf, np.inf), np.minimum(one, other))
        last = np.where(still, np.inf, np.maximum(one, other))
        enter, leave = np.maximum(enter, first), np.minimum(leave, last)
    kept = enter <= leave
    return start[kept], run[kept], enter[kept], leave[kept]


def _dense(pixels: Points, frame: Bbox, step: float) -> Points:
    """Sample the portion of a curve within the frame."""
    start, run, enter, leave = clip_segments(pixels, frame)
    counts = np.ceil((leave - enter) * np.hypot(*run.T) / step).astype(np.int64) + 1
    rows = np.repeat(np.arange(len(start)), counts)
    place = np.arange(len(rows)) - np.repeat(np.cumsum(counts) - counts, counts)
    part = enter[rows] + (leave - enter)[rows] * place / np.maximum(counts[rows] - 1, 1)
    return np.asarray(start[rows] + part[:, None] * run[rows])


def overlap_cost(boxes: Points, ink: Points, taken: Points, frame: Bbox) -> Points:
    """Cost of placing boxes, shape (K, 4) as x0, y0, x1, y1.

    Parameters
    ----------
    boxes : ndarray, shape (K, 4)
    ink : ndarray, shape (N, 4)
        Samples from `occupied_pixels`.
    taken : ndarray, shape (M, 4)
        Other boxes, at a cost of 1000 each.
    frame : Bbox
        Frame of the axes; leaving it costs 10 000.

    Returns
    -------
    ndarray, shape (K,)
    """
    left, low, right, high = (edge[:, None] for edge in boxes.T)
    over = _ink_below(boxes, ink)
    x0, y0, x1, y1 = taken.T
    overlaps = ((x0 < right) & (x1 > left) & (y0 < high) & (y1 > low)).sum(axis=1)
    inside = (boxes[:, 0] > frame.x0) & (boxes[:, 2] < frame.x1)
    inside &= (boxes[:, 1] > frame.y0) & (boxes[:, 3] < frame.y1)
    return np.asarray(over + 1e3 * overlaps + 1e4 * ~inside, dtype=float)


def _ink_below(boxes: Points, ink: Points) -> Points:
    """Weight of the samples that each box covers, shape (K,).

    Boxes on a grid have few different sides, whose samples are found once.
    """
    x, y, weight, reach = ink.T
    across, column = np.unique(boxes[:, ::2], axis=0, return_inverse=True)
    along, row = np.unique(boxes[:, 1::2], axis=0, return_inverse=True)
    grid = len(across) * len(along) <= 2 * len(boxes)
    if not grid:
        across, along = boxes[:, ::2], boxes[:, 1::2]
    wide = (x > across[:, :1] - reach) & (x < across[:, 1:] + reach)
    high = (y > along[:, :1] - reach) & (y < along[:, 1:] + reach)
    if not grid:
        return np.asarray((wide & high) @ weight)
    return np.asarray(((wide * weight) @ high.T.astype(float))[column.ravel(), row.ravel()])


def box_of(artist: Artist, renderer: RendererBase, pad: float = 1.0) -> Points:
    """Extent of an artist in pixels with a margin, shape (4,)."""
    return np.asarray(artist.get_window_extent(renderer).padded(pad).extents)


def boxes_of_insets(ax: Axes, renderer: RendererBase | None = None) -> Points:
    """Extents of the insets of axes with their ticks, in pixels, shape (K, 4)."""
    boxes = (inset.get_tightbbox(renderer) for inset in ax.child_axes)
    return np.array([box.extents for box in boxes if box is not None]).reshape(-1, 4)
