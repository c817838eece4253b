"""Arrow heads along a curve, in the plane or in space."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.text import Annotation
from numpy.typing import NDArray

from fastslow.plot.layout.occupancy import on_draw, pixels_of, projected
from fastslow.plot.layout.style import root

Values = NDArray[np.float64]

#: Distance of the two points that define the direction of an arrow, in points (1/72 inch).
SPAN = 3.0


def draw_arrows(line: Line2D, along: Values, fractions: Sequence[float]) -> tuple[Annotation, ...]:
    """Draw arrow heads on a curve at fractions of an increasing quantity.

    Parameters
    ----------
    line : Line2D
        The curve, of N points.
    along : ndarray, shape (N,)
        Quantity that increases along the curve, e.g. arclength.
    fractions : sequence of float
        Positions, from 0 to 1 of ``along``.
    """
    if len(along) < 2 or not along[-1] > along[0]:
        return ()
    starts = np.searchsorted(along, along[0] + np.array(fractions) * (along[-1] - along[0]))
    return draw_heads(line, starts.tolist())


def draw_heads(line: Line2D, rows: Sequence[int]) -> tuple[Annotation, ...]:
    """Draw arrow heads on a curve at given rows; those outside the axes are omitted."""
    ax = axes_of(line)
    ax.autoscale_view()
    places = points(line)
    if len(places) < 2:
        return ()
    pixels = pixels_of(ax, places)
    flat = ax.transData.inverted().transform(pixels)
    frame, span = ax.get_window_extent(), SPAN * root(ax).dpi / 72.0
    drawn, ends = [], []
    for row in rows:
        start = min(row, len(flat) - 2)
        away = np.hypot(*(pixels[start:] - pixels[start]).T)
        far = np.flatnonzero(away >= span)
        if not far.size or not frame.contains(*pixels[start]):
            continue
        tip = start + int(far[0])
        ends.append([tip, start])
        head = ax.annotate(
            "",
            xy=tuple(flat[tip]),
            xytext=tuple(flat[start]),
            arrowprops={
                "arrowstyle": "-|>",
                "color": line.get_color(),
                "linewidth": 0.0,
                "mutation_scale": 8.0,
                "shrinkA": 0.0,
                "shrinkB": 0.0,
            },
            zorder=4.5,
        )
        head.set_in_layout(False)
        drawn.append(head)
    if places.shape[1] == 3 and drawn:
        on_draw(ax, lambda _: _turn(ax, drawn, places[ends]))
    return tuple(drawn)


def _turn(ax: Axes, heads: Sequence[Annotation], ends: Values) -> None:
    """Project arrow heads in space; ends of shape (heads, 2, 3)."""
    for head, both in zip(heads, ends, strict=True):
        tip, start = projected(ax, both)
        head.xy = (float(tip[0]), float(tip[1]))
        head.set_position((float(start[0]), float(start[1])))


def length_along(line: Line2D) -> Values:
    """Arclength of a curve in pixels at each of its points, shape (N,)."""
    pixels = pixels_of(axes_of(line), points(line))
    # gaps of a line have no length
    return np.r_[0.0, np.nancumsum(np.hypot(*np.diff(pixels, axis=0).T))]


def points(line: Line2D) -> Values:
    """Data of a line, shape (N, 2), or (N, 3) in space."""
    if hasattr(line, "get_data_3d"):
        return np.column_stack([np.asarray(d, dtype=float) for d in line.get_data_3d()])
    return np.asarray(line.get_xydata(), dtype=float)


def axes_of(line: Line2D) -> Axes:
    """The axes of a line."""
    if not isinstance(line.axes, Axes):
        raise ValueError("this line was removed from its axes")
    return line.axes
