"""Interfaces drawn as thin lines, regions as light bands, and walls hatched beyond."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from matplotlib.text import Text
from numpy.typing import NDArray

from fastslow.plot.layout.style import BANDS, DARK, INTERFACE, SMALL_TEXT
from fastslow.plot.layout.typesetting import plain

#: State and value of an interface at a constant value of one state; for a wall also the side
#: beyond it, 1 above and −1 below.
Level = tuple[str, float] | tuple[str, float, int]

#: Interface or wall to its level.
Values = Mapping[str, Level]


#: Look of the band beyond a wall.
WALL: dict[str, Any] = {"facecolor": "#FFFFFF", "edgecolor": "#BBBBBB", "hatch": "////"}


@dataclass(frozen=True, eq=False)
class Bands:
    """The interfaces and regions drawn across one axis.

    Parameters
    ----------
    lines : tuple of Line2D
        The interfaces.
    fills : tuple of Rectangle
        The regions.
    names : tuple of Text
        Names of the regions, to be placed by `fastslow.plot.layout.labels.place`.
    spans : tuple of (float, float)
        Interval of each named region along the axis, infinite beyond the outermost interfaces.
    vertical : bool
        Whether the state is on the horizontal axis.
    parts : tuple of (float, float)
        Interval of each fill.
    """

    lines: tuple[Line2D, ...] = ()
    fills: tuple[Rectangle, ...] = ()
    names: tuple[Text, ...] = ()
    spans: tuple[tuple[float, float], ...] = ()
    vertical: bool = False
    parts: tuple[tuple[float, float], ...] = ()


def draw_bands(
    ax: Axes,
    state: str,
    values: Values,
    heights: NDArray[np.float64],
    regions: NDArray[np.str_],
    *,
    vertical: bool = False,
    label: bool = True,
) -> Bands:
    """Draw the interfaces at values of one state and fill the regions between them.

    A band is named if all results drawn in it are in one region.

    Parameters
    ----------
    ax : Axes
        Axes, whose limits are kept; bands extend to the limits, also after these change.
    state : str
        The state on the axis.
    values : mapping
        Interface to (state, value), wall to (state, value, side beyond it).
    heights : ndarray, shape (N,)
        Values of the state in the results drawn.
    regions : ndarray of str, shape (N,)
        Region of each value.
    vertical : bool
        Whether the state is on the horizontal axis.
    label : bool
        Whether to name the regions.
    """
    levels = sorted({value for at, value, *_ in values.values() if at == state})
    if not levels:
        return Bands(vertical=vertical)
    edges = np.array([-np.inf, *levels, np.inf])
    frame = ax.get_xaxis_transform() if vertical else ax.get_yaxis_transform()
    fills, names, parts, spans = [], [], [], []
    look: dict[str, Any]
    beyond = [(value, side[0]) for at, value, *side in values.values() if at == state and side]
    margin = 1e-9 * max(float(np.ptp(heights)) if heights.size else 0.0, 1e-300)
    for number, (start, stop) in enumerate(zip(edges[-2::-1], edges[:0:-1], strict=True)):
        solid = any(start >= value if side > 0 else stop <= value for value, side in beyond)
        look = WALL if solid else {"facecolor": BANDS[number % 3]}
        fill = Rectangle((0.0, 0.0), 1.0, 1.0, transform=frame, linewidth=0.0, **look)
        fill.set(zorder=0, in_layout=False)
        # as an artist, which does not change the limits
        ax.add_artist(fill)
        fills.append(fill)
        parts.append((float(start), float(stop)))
        inside = (heights > start + margin) & (heights < stop - margin)
        named = set(regions[inside].tolist())
        if label and len(named) == 1:
            names.append(_name(ax, named.pop(), vertical))
            spans.append((float(start), float(stop)))
    lines = []
    for level in levels:
        ends = ([level, level], [0.0, 1.0])
        line = Line2D(*(ends if vertical else ends[::-1]), transform=frame, **INTERFACE)
        ax.add_artist(line)
        lines.append(line)
    drawn = Bands(tuple(lines), tuple(fills), tuple(names), tuple(spans), vertical, tuple(parts))
    fit_bands(ax, drawn)
    return drawn


def fit_bands(ax: Axes, drawn: Bands) -> None:
    """Extend bands to the limits of the axes; hide names that do not fit."""
    low, high = sorted(ax.get_xlim() if drawn.vertical else ax.get_ylim())
    for fill, (start, stop) in zip(drawn.fills, drawn.parts, strict=True):
        first, last = np.clip([start, stop], low, high).tolist()
        if drawn.vertical:
            fill.set_bounds(first, 0.0, last - first, 1.0)
        else:
            fill.set_bounds(0.0, first, 1.0, last - first)
    axis = (ax.xaxis if drawn.vertical else ax.yaxis).get_transform()
    bottom, top = axis.transform([low, high])
    for name, span in zip(drawn.names, drawn.spans, strict=True):
        first, last = axis.transform(np.clip(span, low, high))
        name.set_visible(bool(last - first > (0.13 if drawn.vertical else 0.07) * (top - bottom)))
        middle = float(axis.inverted().transform([0.5 * (first + last)])[0])
        name.set_position((middle, SIDE) if drawn.vertical else (SIDE, middle))


#: Initial position of a name along its band, as a fraction of the axes.
SIDE = 0.95


def _name(ax: Axes, text: str, vertical: bool) -> Text:
    frame = ax.get_xaxis_transform() if vertical else ax.get_yaxis_transform()
    look: dict[str, Any] = {"fontsize": SMALL_TEXT, "color": DARK, "zorder": 1.5}
    name = ax.text(0.5, 0.5, plain(text), transform=frame, ha="center", va="center", **look)
    name.set_in_layout(False)
    return name
