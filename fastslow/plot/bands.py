"""Interfaces as thin lines and regions as light bands."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon, Rectangle
from matplotlib.text import Text
from numpy.typing import NDArray

from fastslow.plot.style import BANDS, GREY, SMALL

#: Interface to (state, value), for interfaces that are a plain value of one state.
Values = Mapping[str, tuple[str, float]]


@dataclass(frozen=True, eq=False)
class Bands:
    """The interfaces and regions drawn across one axis.

    Parameters
    ----------
    lines : tuple of Line2D
        The interfaces.
    fills : tuple of Polygon or Rectangle
        The regions.
    names : tuple of Text
        The regions' names, to be placed by `fastslow.plot.labels.place`.
    spans : tuple of (float, float)
        Where each named region begins and ends along the axis.
    vertical : bool
        Whether the state is on the horizontal axis.
    """

    lines: tuple[Line2D, ...] = ()
    fills: tuple[Polygon | Rectangle, ...] = ()
    names: tuple[Text, ...] = ()
    spans: tuple[tuple[float, float], ...] = ()
    vertical: bool = False


def draw_bands(
    ax: Axes,
    state: str,
    values: Values,
    heights: NDArray[np.float64],
    regions: NDArray[np.str_],
    *,
    vertical: bool = False,
) -> Bands:
    """Draw the interfaces at values of one state and tint the regions between them.

    A band is named where all results drawn in it lie in one region.

    Parameters
    ----------
    ax : Axes
        With its limits final: they are kept.
    state : str
        The state on the axis.
    values : mapping
        Interface to (state, value).
    heights : ndarray, shape (N,)
        Values of the state in the results drawn.
    regions : ndarray of str, shape (N,)
        The region of each.
    vertical : bool
        Whether the state is on the horizontal axis.
    """
    levels = sorted(value for name, value in values.values() if name == state)
    if not levels:
        return Bands(vertical=vertical)
    low, high = ax.get_xlim() if vertical else ax.get_ylim()
    line, fill = (ax.axvline, ax.axvspan) if vertical else (ax.axhline, ax.axhspan)
    edges = np.clip([low, *levels, high], low, high)
    fills, names, spans = [], [], []
    least = (0.13 if vertical else 0.07) * (high - low)  # for a name to fit in
    margin = 1e-9 * (high - low)
    for number, (start, stop) in enumerate(zip(edges[-2::-1], edges[:0:-1], strict=True)):
        if stop > start:
            fills.append(fill(start, stop, facecolor=BANDS[number % 3], edgecolor="none", zorder=0))
            inside = (heights > start + margin) & (heights < stop - margin)
            met = set(regions[inside].tolist())
            if len(met) == 1 and stop - start > least:
                names.append(_name(ax, met.pop(), (start + stop) / 2, vertical))
                spans.append((float(start), float(stop)))
    lines = tuple(
        line(level, color=GREY, linewidth=0.5, zorder=1) for level in levels if low < level < high
    )
    if vertical:
        ax.set_xlim(low, high)
    else:
        ax.set_ylim(low, high)
    return Bands(lines, tuple(fills), tuple(names), tuple(spans), vertical)


def _name(ax: Axes, text: str, middle: float, vertical: bool) -> Text:
    at = (middle, 0.95) if vertical else (0.95, middle)
    frame = ax.get_xaxis_transform() if vertical else ax.get_yaxis_transform()
    look: dict[str, Any] = {
        "ha": "center",
        "va": "center",
        "fontsize": SMALL,
        "color": GREY,
        "zorder": 1.5,
    }
    return ax.text(*at, text, transform=frame, **look)
