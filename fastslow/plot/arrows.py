"""A sense of direction along a curve."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.text import Annotation
from numpy.typing import NDArray

Values = NDArray[np.float64]

#: Pixels between the two points that give an arrow its direction.
SPAN = 6.0


def draw_arrows(
    ax: Axes, x: Values, y: Values, along: Values, fractions: Sequence[float], colour: str
) -> tuple[Annotation, ...]:
    """Put arrow heads on a curve at fractions of a growing quantity.

    Parameters
    ----------
    ax : Axes
        With its limits final.
    x, y : ndarray, shape (N,)
        The curve.
    along : ndarray, shape (N,)
        Grows along the curve, e.g. its length.
    fractions : sequence of float
        Where, between 0 and 1 of ``along``.
    colour : str
    """
    if len(x) < 2 or not along[-1] > along[0]:
        return ()
    ax.autoscale_view()
    pixels = ax.transData.transform(np.column_stack([x, y]))
    frame = ax.get_window_extent()
    drawn = []
    for fraction in fractions:
        start = int(np.searchsorted(along, along[0] + fraction * (along[-1] - along[0])))
        start = min(start, len(x) - 2)
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
                    "color": colour,
                    "linewidth": 0.0,
                    "mutation_scale": 8.0,
                    "shrinkA": 0.0,
                    "shrinkB": 0.0,
                },
                zorder=4.5,
            )
        )
    return tuple(drawn)


def length_along(ax: Axes, x: Values, y: Values) -> Values:
    """Length of a curve in pixels up to each of its points, shape (N,)."""
    pixels = ax.transData.transform(np.column_stack([x, y]))
    return np.r_[0.0, np.cumsum(np.hypot(*np.diff(pixels, axis=0).T))]
