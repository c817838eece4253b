"""Interfaces as thin lines and regions as light bands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon, Rectangle
from matplotlib.text import Text

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
    ax: Axes, state: str, values: Values, regions: Sequence[str], *, vertical: bool = False
) -> Bands:
    """Draw the interfaces at values of one state and tint the regions between them.

    Regions are named only where every region is one band: where all interfaces
    are values of this state. They are then in descending order of the state,
    as lexicographic order of the sign patterns, + before −, makes them.

    Parameters
    ----------
    ax : Axes
        With its limits final: they are kept.
    state : str
        The state on the axis.
    values : mapping
        Interface to (state, value).
    regions : sequence of str
        Names of the model's regions, in its order.
    vertical : bool
        Whether the state is on the horizontal axis.
    """
    levels = sorted(value for name, value in values.values() if name == state)
    if not levels:
        return Bands(vertical=vertical)
    low, high = ax.get_xlim() if vertical else ax.get_ylim()
    line, fill = (ax.axvline, ax.axvspan) if vertical else (ax.axhline, ax.axhspan)
    edges = np.clip([low, *levels, high], low, high)
    shown = len(levels) == len(values) and len(regions) == len(levels) + 1
    fills, names, spans = [], [], []
    least = 0.13 if vertical else 0.07  # of the axis, for a name to fit in
    for number, (start, stop) in enumerate(zip(edges[-2::-1], edges[:0:-1], strict=True)):
        if stop > start:
            fills.append(fill(start, stop, facecolor=BANDS[number % 3], edgecolor="none", zorder=0))
            if shown and (stop - start) > least * (high - low):
                names.append(_name(ax, regions[number], (start + stop) / 2, vertical))
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
