"""Long curves and many markers: what the axes can show of them."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.artist import allow_rasterization
from matplotlib.axes import Axes
from matplotlib.backend_bases import RendererBase
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from fastslow.plot.layout.style import root

#: Points of a line up to which it is drawn as given.
DRAWN_AS_GIVEN = 5_000

#: Drawn points above which a line is rasterized, in vector formats too.
RASTERIZED = 20_000

#: Width of a pixel in print, in points (1/72 inch).
DOT = 0.12

#: Side of the squares that a curve covers, relative to its width.
COVER = 0.35

Array = NDArray[np.float64]


class LongLine(Line2D):
    """A line that keeps all of its points and draws those that differ in print.

    A curve that advances along the horizontal axis is drawn by the first, lowest, highest and
    last point in each column of pixels (its envelope). Any other curve is drawn without the
    points that remain within one pixel and, if it covers the axes many times, without the
    segments whose ends and middle are on earlier ones. Markers are drawn unless they are
    covered by others. The selection follows the limits and the size of the axes.

    Parameters
    ----------
    *places : array_like, shape (N,)
        Both coordinates.
    spacing : float
        Side of the square in which one marker is drawn, in points.
    **look
        Properties of the line.
    """

    def __init__(self, *places: Any, spacing: float = DOT, **look: Any) -> None:
        super().__init__(*places, **look)
        self.spacing = spacing
        self._selected: tuple[Any, Array] | None = None

    def drawn_data(self) -> Array:
        """Points that are drawn, in data coordinates, shape (K, 2)."""
        places = np.asarray(self.get_xydata(), dtype=float)
        ax = self.axes
        if not isinstance(ax, Axes):
            return places
        scale = 72.0 / root(ax).dpi
        frame = ax.get_window_extent()
        size = np.array([frame.width, frame.height]) * scale
        limits = (*ax.get_xlim(), *ax.get_ylim(), ax.get_xscale(), ax.get_yscale())
        key = (id(self.get_xydata()), *np.round(size, 1).tolist(), *limits)
        if self._selected is None or self._selected[0] != key:
            with np.errstate(all="ignore"):  # values that a logarithmic axis cannot show
                points = (self.get_transform().transform(places) - frame.min) * scale
            points = np.clip(points, -1.0, size + 1.0)
            if self.get_linestyle() in ("None", "", " "):
                drawn = places[marker_rows(points, self.spacing)]
            else:
                rows = curve_rows(points)
                drawn = places[rows]
                if len(rows) > RASTERIZED and not advances(points):
                    drawn = _uncovered(drawn, points[rows], COVER * self.get_linewidth())
            self._selected = key, drawn
        return self._selected[1]

    @allow_rasterization
    def draw(self, renderer: RendererBase) -> None:
        """Draw the selected points."""
        if not self.get_visible():
            return
        places = self.drawn_data()
        drawn = Line2D(*places.T)
        drawn.update_from(self)
        if isinstance(self.axes, Axes):
            drawn.set_figure(root(self.axes))
            drawn.axes = self.axes
        drawn.set_rasterized(len(places) > RASTERIZED)
        drawn.draw(renderer)
        self.stale = False


def draw_long(ax: Any, *places: Any, spacing: float = 0.0, **look: Any) -> Line2D:
    """Draw a line, in the plane as a `LongLine` if it has many points.

    Parameters
    ----------
    ax : Axes
    *places : array_like, shape (N,)
        Coordinates.
    spacing : float
        Side of the square in which one marker is drawn, in points; by default markers are left
        out where others cover them.
    **look
        Properties of the line.
    """
    if len(places) != 2 or (len(places[0]) <= DRAWN_AS_GIVEN and not spacing):
        (line,) = ax.plot(*places, **look)
        return line
    line = LongLine(*places, spacing=spacing or DOT, **look)
    ax.add_line(line)
    ax.autoscale_view()
    return line


def advances(points: Array) -> bool:
    """Return whether a curve never turns back along the horizontal axis."""
    # NaN compares false
    return not (np.diff(points[:, 0]) < 0.0).any()


def curve_rows(points: Array, dot: float = DOT) -> NDArray[np.intp]:
    """Select points of a curve that is the same in print.

    Parameters
    ----------
    points : ndarray, shape (N, 2)
        The curve in points (1/72 inch), with NaN where it is interrupted.
    dot : float
        Width of a pixel.

    Returns
    -------
    ndarray, shape (K,)
        Rows in increasing order: if the curve advances along the first axis, at most four for
        each column of pixels and interruption.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.linspace(0, 10, 100_001)
    >>> len(curve_rows(np.column_stack([t, np.sin(1000 * t)]), dot=0.1)) <= 4 * 101
    True
    """
    finite: NDArray[np.bool_] = np.asarray(np.isfinite(points).all(axis=1))
    cells = np.floor(np.where(finite[:, None], points, 0.0) / dot).astype(np.int64)
    envelope = advances(points)
    changed: NDArray[np.bool_] = np.asarray(cells[1:, 0] != cells[:-1, 0])
    if not envelope:
        changed |= cells[1:, 1] != cells[:-1, 1]
    changed |= finite[1:] != finite[:-1]
    starts = np.r_[0, np.flatnonzero(changed) + 1]
    stops = np.r_[starts[1:], len(points)]
    kept = np.zeros(len(points), dtype=bool)
    kept[starts] = kept[stops - 1] = True
    if envelope:
        heights = np.where(finite, points[:, 1], 0.0)
        for extreme in (np.minimum, np.maximum):
            # the first row of each column with its extreme value
            highest = np.repeat(extreme.reduceat(heights, starts), stops - starts)
            rows = np.flatnonzero(heights == highest)
            column = np.searchsorted(starts, rows, side="right")
            kept[rows[np.r_[True, column[1:] != column[:-1]]]] = True
    return np.flatnonzero(kept)


def marker_rows(points: Array, spacing: float) -> NDArray[np.intp]:
    """Select one marker in each square of a given side, in increasing order.

    Examples
    --------
    >>> import numpy as np
    >>> marker_rows(np.array([[0.1, 0.1], [0.2, 0.3], [1.2, 0.1]]), 1.0).tolist()
    [0, 2]
    """
    rows = np.flatnonzero(np.isfinite(points).all(axis=1))
    return rows[_first_in_cell(points[rows], spacing)]


def _first_in_cell(points: Array, side: float) -> NDArray[np.bool_]:
    """Return for each point whether it is the first in its square of a given side."""
    if not len(points):
        return np.zeros(0, dtype=np.bool_)
    cells = np.floor((points - points.min(axis=0)) / side).astype(np.int64)
    across = int(cells[:, 0].max()) + 1
    flat = cells[:, 0] + across * cells[:, 1]
    numbers = np.arange(len(points))
    first = np.empty(int(flat.max()) + 1, dtype=np.int64)
    # of repeated indices the last assignment remains
    first[flat[::-1]] = numbers[::-1]
    return np.asarray(first[flat] == numbers)


def _uncovered(places: Array, points: Array, side: float) -> Array:
    """Return a curve without the segments of which both ends and the middle are covered.

    Parameters
    ----------
    places, points : ndarray, shape (N, 2)
        The curve in data coordinates and in points.
    side : float
        Side of the squares that a segment covers, in points.
    """
    middles = 0.5 * (points[:-1] + points[1:])
    both = np.empty((2 * len(points) - 1, 2))
    both[::2], both[1::2] = points, middles
    rows = np.flatnonzero(np.isfinite(both).all(axis=1))
    new = np.zeros(len(both), dtype=bool)
    new[rows] = _first_in_cell(both[rows], max(side, DOT))
    segments = new[:-2:2] | new[1::2] | new[2::2]
    kept = np.r_[segments, False] | np.r_[False, segments]
    rows = np.flatnonzero(kept)
    # interrupted where segments are left out
    gaps = np.flatnonzero(~segments[rows[:-1]] | (np.diff(rows) > 1)) + 1
    return np.insert(places[rows], gaps, np.nan, axis=0)
