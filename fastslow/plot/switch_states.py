"""Switch states: strips below time series, and sheets of phase portraits."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.lines import Line2D
from matplotlib.text import Text

from fastslow.plot.layout.style import BLACK, GREY, root
from fastslow.plot.layout.typesetting import typeset
from fastslow.plot.motion_lines import draw_line
from fastslow.plot.quantities import Array, Quantity
from fastslow.results.trajectory.trajectory import Trajectory

#: Height of a strip, the space between two of them, and font size of their names, in points.
STATE_HEIGHT, SPACE, STATE_FONT = 5.0, 2.0, 7.0

#: Line styles of the combinations of states, the first one for all switches at 1.
STYLES = ("-", (0, (4, 1.5)), (0, (6, 1.5, 1, 1.5)), (0, (1.5, 1)))


def draw_strips(
    ax: Axes, run: Trajectory, label: bool = True
) -> tuple[tuple[PolyCollection, ...], tuple[Text, ...]]:
    """Draw every switch as a strip along the lower edge of a time series, filled where it is 1.

    Parameters
    ----------
    ax : Axes
        Axes with time on the horizontal axis. The lower limit is lowered for the strips, unless
        it was set by hand.
    run : Trajectory
    label : bool
        Whether to write the names of the switches at the right edge.
    """
    whole = ax.get_window_extent().height * 72.0 / root(ax).dpi
    height, space = STATE_HEIGHT / whole, SPACE / whole
    share = min(len(run.switch_names) * (height + space) + space, 0.5)
    if ax.get_autoscaley_on():
        low, high = ax.get_ylim()
        ax.set_ylim(low - share / (1.0 - share) * (high - low), high, auto=None)
    frame, strips, words = ax.get_xaxis_transform(), [], []
    for k, name in enumerate(run.switch_names):
        bottom = share - (k + 1) * (height + space)
        top = bottom + height
        look: dict[str, Any] = {"linewidth": 0.5, "label": "_switch", "zorder": 4.7}
        ax.add_artist(Line2D(run.span, [bottom] * 2, transform=frame, color=GREY, **look))
        corners = [
            [(s.start, bottom), (s.start, top), (s.end, top), (s.end, bottom)]
            for s in run.segments
            if f"{name} = 1" in s.switches.split(", ")
        ]
        strip = PolyCollection(corners, transform=frame, facecolor=BLACK, linewidth=0, zorder=4.8)
        # collections that request new limits would raise the strips into the curve
        ax.add_collection(strip, autolim=False)
        strips.append(strip)
        if label:
            words.append(
                ax.text(
                    1.01,
                    bottom + 0.5 * height,
                    typeset(name),
                    transform=ax.transAxes,
                    ha="left",
                    va="center",
                    fontsize=STATE_FONT,
                )
            )
    return tuple(strips), tuple(words)


def draw_sheets(
    ax: Axes,
    t: Array,
    places: Sequence[Array],
    shown: Sequence[Quantity],
    run: Trajectory,
    look: dict[str, Any],
) -> tuple[Line2D, ...]:
    """Draw part of a trajectory with one line for each combination of switch states.

    Lines of different combinations meet where a switch changes.
    """
    values = run.dense_columns(t)[-len(run.switch_names) :] if run.is_dense else None
    if values is None:
        values = np.array([run[name] for name in run.switch_names])[:, np.isin(run.t, t)]
    combinations = np.unique(values, axis=1).T[::-1]
    lines = []
    for number, states in enumerate(combinations):
        inside = (values == states[:, None]).all(axis=0)
        # to the first point in the next states
        inside[1:] |= inside[:-1].copy()
        parts = [np.where(inside, place, np.nan) for place in places]
        name = ", ".join(
            f"{typeset(n)} = {v:g}" for n, v in zip(run.switch_names, states, strict=True)
        )
        style = {"linestyle": STYLES[number % len(STYLES)], **look, "label": name}
        lines.append(draw_line(ax, t, parts, shown, run, style))
    return tuple(lines)
