"""Overlaps of the texts of a figure with its curves, markers, axes and other texts."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.text import Text
from matplotlib.transforms import Bbox

from fastslow.plot.layout.occupancy import FAINT, Points, clip_segments, pixels_of_line

#: Overlaps below this are not visible, in points (1/72 inch).
VISIBLE = 0.5


@dataclass(frozen=True)
class Overlap:
    """A text over a curve, a marker, other axes or another text.

    Parameters
    ----------
    text : str
        The text; of a legend its first entry.
    over : str
        ``"curve"``, ``"marker"``, ``"text"``, ``"axes"`` or ``"edge"`` (of the figure), followed
        by the legend entry or text, if it has one.
    size : float
        In points: length of the curve within the box of the text, depth of the overlap
        otherwise.

    Examples
    --------
    >>> print(Overlap("LP1", "curve stable", 12.34))
    LP1 over curve stable (12.3 pt)
    """

    text: str
    over: str
    size: float

    def __str__(self) -> str:
        return f"{self.text} over {self.over} ({self.size:.1f} pt)"


def overlaps(figure: Figure, *, drawn: bool = False) -> tuple[Overlap, ...]:
    """Measure the overlaps of all texts of a figure, as it is drawn at its own resolution.

    A legend is one text. Leader lines and the bands of regions may be covered.

    Parameters
    ----------
    figure : Figure
    drawn : bool
        Whether it has just been drawn at this resolution, so that all texts are in place.

    Returns
    -------
    tuple of Overlap

    Examples
    --------
    >>> figure = Figure()
    >>> ax = figure.add_subplot()
    >>> (line,) = ax.plot([0, 1], [0, 1], label="diagonal")
    >>> text = ax.text(0.5, 0.5, "middle", va="center")
    >>> [one.over for one in overlaps(figure)]
    ['curve diagonal']
    """
    if not drawn:
        figure.draw_without_rendering()
    point = figure.dpi / 72.0
    texts = list(_texts(figure))
    found = [
        Overlap(name, f"{kind} {label}".strip(), size / point)
        for name, box, owner in texts
        for kind, label, size in _beneath(box, owner, figure, point)
    ]
    boxes = np.reshape([box.extents for _, box, _ in texts], (-1, 4))
    low, high = boxes[:, :2], boxes[:, 2:]
    sides = np.minimum(high[:, None], high) - np.maximum(low[:, None], low)
    depths = sides.min(axis=2) / point
    for k, other in zip(*np.nonzero(np.tril(depths > VISIBLE, -1)), strict=True):
        found.append(Overlap(texts[k][0], f"text {texts[other][0]}", float(depths[k, other])))
    return tuple(one for one in found if one.size > VISIBLE)


def _all_axes(figure: Figure) -> list[Axes]:
    """The axes of a figure and their insets."""
    return [one for ax in figure.axes for one in (ax, *ax.child_axes) if isinstance(one, Axes)]


def _texts(figure: Figure) -> Iterator[tuple[str, Bbox, Axes | None]]:
    """Yield the visible texts and legends with their boxes and the axes that they belong to."""
    legends = [one for one in figure.findobj(Legend) if one.get_visible()]
    done = {id(text) for legend in legends for text in legend.findobj(Text)}
    for legend in legends:
        words: list[Any] = [text.get_text() for text in legend.get_texts()]
        name = f"legend ({words[0] if words else ''} …)"
        yield name, legend.get_window_extent(), _axes_of(legend)
    for ax in _all_axes(figure):
        axes = [getattr(ax, f"{name}axis") for name in ("xyz" if ax.name == "3d" else "xy")]
        for axis in axes:
            done |= {id(text) for text in axis.findobj(Text)}
            if ax.name != "3d":
                for text in (axis.label, axis.get_offset_text(), *_tick_labels(axis)):
                    yield from _shown(text, ax)
    for text in figure.findobj(Text):
        if id(text) not in done:
            yield from _shown(text, _axes_of(text))


def _tick_labels(axis: Any) -> Iterator[Any]:
    low, high = sorted(axis.get_view_interval())
    margin = 1e-9 * (high - low)
    for tick in (*axis.get_major_ticks(), *axis.get_minor_ticks()):
        if low - margin <= tick.get_loc() <= high + margin:
            yield tick.label1


def _axes_of(artist: Artist) -> Axes | None:
    return artist.axes if isinstance(artist.axes, Axes) else None


def _shown(text: Any, ax: Axes | None) -> Iterator[tuple[str, Bbox, Axes | None]]:
    words = " ".join(text.get_text().split())
    # the extent of an annotation with its arrow is infinite if its point is outside the axes
    if not words or not text.get_visible() or not np.isfinite(text.get_window_extent().x0):
        return
    box = Text.get_window_extent(text)
    if text.get_clip_on() and text.get_clip_box() is not None:
        clipped = Bbox.intersection(box, text.get_clip_box())
        if clipped is None:
            return
        box = clipped
    yield words, box, ax


def _beneath(
    box: Bbox, owner: Axes | None, figure: Figure, point: float
) -> Iterator[tuple[str, str, float]]:
    """Yield what is beneath the box of a text, with the size of the overlap in pixels.

    ``owner`` are the axes of the text, None for a text of the figure.
    """
    whole = figure.bbox
    edges = (whole.x0 - box.x0, box.x1 - whole.x1, whole.y0 - box.y0, box.y1 - whole.y1)
    yield "edge", "", max(edges)
    for ax in _all_axes(figure):
        if not ax.get_visible() or not ax.axison:
            continue
        if owner is not ax and not _nested(ax, owner):
            yield "axes", ax.get_ylabel(), _depth(box, ax.bbox)
        part = Bbox.intersection(box, ax.bbox)
        if part is None:
            continue
        for line in ax.lines:
            if line.get_visible() and line.get_gid() != FAINT:
                yield from _of_line(part, ax, line, point)
        for collection in ax.collections:
            yield from _of_collection(part, ax, collection, point)


def _of_line(box: Bbox, ax: Axes, line: Any, point: float) -> Iterator[tuple[str, str, float]]:
    pixels, name = pixels_of_line(ax, line), _named(line)
    if line.get_linestyle() not in ("None", "", " "):
        yield "curve", name, _length(pixels, box, 0.5 * line.get_linewidth() * point)
    if line.get_marker() not in ("None", "", " ", None):
        radius = 0.5 * line.get_markersize() * point
        yield "marker", name, _depth_of_discs(pixels, box, radius)


def _of_collection(
    box: Bbox, ax: Axes, collection: Any, point: float
) -> Iterator[tuple[str, str, float]]:
    name = _named(collection)
    if isinstance(collection, LineCollection) and collection.get_visible():
        half = 0.5 * float(np.max(collection.get_linewidth(), initial=0.0)) * point
        paths = [ax.transData.transform(path.vertices) for path in collection.get_paths()]
        yield "curve", name, sum(_length(path, box, half) for path in paths)
    if isinstance(collection, PathCollection) and collection.get_visible():
        pixels = ax.transData.transform(np.ma.filled(collection.get_offsets(), np.nan))
        sizes = collection.get_sizes()
        radius = 0.5 * float(np.sqrt(max(sizes, default=0.0))) * point
        yield "marker", name, _depth_of_discs(pixels, box, radius)


def _length(pixels: Points, box: Bbox, half: float) -> float:
    """Length of a polyline of a given half-width within a box."""
    _, run, enter, leave = clip_segments(pixels, box.padded(half))
    return float(((leave - enter) * np.hypot(*run.T)).sum())


def _depth_of_discs(pixels: Points, box: Bbox, radius: float) -> float:
    """Largest depth to which discs of a radius reach into a box."""
    centres = pixels[np.isfinite(pixels).all(axis=1)]
    if not len(centres):
        return 0.0
    nearest = np.clip(centres, box.min, box.max)
    return max(radius - float(np.hypot(*(centres - nearest).T).min()), 0.0)


def _depth(one: Bbox, other: Bbox) -> float:
    """Shorter side of the intersection of two boxes, 0 without one."""
    common = Bbox.intersection(one, other)
    return 0.0 if common is None else min(common.width, common.height)


def _nested(ax: Any, other: Any) -> bool:
    """Return whether one of two axes is an inset of the other, or on the same position."""
    if other is None:
        return False
    both = {id(one) for one in (*ax.child_axes, *other.child_axes)}
    return id(ax) in both or id(other) in both or ax.bbox.bounds == other.bbox.bounds


def _named(artist: Artist) -> str:
    label = str(artist.get_label())
    return "" if label.startswith("_") else label
