"""A sense of direction along a curve."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.text import Annotation
from numpy.typing import NDArray

Values = NDArray[np.float64]

#: Pixels between the two points that give an arrow its direction.
SPAN = 6.0


def draw_arrows(line: Line2D, along: Values, fractions: Sequence[float]) -> tuple[Annotation, ...]:
    """Put arrow heads on a curve at fractions of a growing quantity.

    Parameters
    ----------
    line : Line2D
        The curve, of N points.
    along : ndarray, shape (N,)
        Grows along the curve, e.g. its length.
    fractions : sequence of float
        Where, between 0 and 1 of ``along``.
    """
    if len(along) < 2 or not along[-1] > along[0]:
        return ()
    starts = np.searchsorted(along, along[0] + np.array(fractions) * (along[-1] - along[0]))
    return draw_heads(line, starts.tolist())


def draw_heads(line: Line2D, rows: Sequence[int]) -> tuple[Annotation, ...]:
    """Put arrow heads on a curve at given points of it; those outside the axes are left out."""
    ax = axes_of(line)
    ax.autoscale_view()
    x, y = points(line).T
    if len(x) < 2:
        return ()
    pixels = ax.transData.transform(np.column_stack([x, y]))
    frame = ax.get_window_extent()
    drawn = []
    for row in rows:
        start = min(row, len(x) - 2)
        away = np.hypot(*(pixels[start:] - pixels[start]).T)
        far = np.flatnonzero(away >= SPAN)
        if not far.size or not frame.contains(*pixels[start]):
            continue
        tip = start + int(far[0])
        drawn.append(
            ax.annotate(
                "",
                xy=(x[tip], y[tip]),
                xytext=(x[start], y[start]),
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
        )
    return tuple(drawn)


def length_along(line: Line2D) -> Values:
    """Length of a curve in pixels up to each of its points, shape (N,)."""
    pixels = axes_of(line).transData.transform(points(line))
    return np.r_[0.0, np.cumsum(np.hypot(*np.diff(pixels, axis=0).T))]


def points(line: Line2D) -> Values:
    """Data of a line, shape (N, 2)."""
    return np.asarray(line.get_xydata(), dtype=float)


def axes_of(line: Line2D) -> Axes:
    """The axes that a line was drawn into."""
    if not isinstance(line.axes, Axes):
        raise ValueError("this line was removed from its axes")
    return line.axes
