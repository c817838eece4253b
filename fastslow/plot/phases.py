"""The phases of a motion as a strip above its time series."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.patches import Rectangle
from matplotlib.text import Text

from fastslow.plot.labels import settle
from fastslow.plot.style import BLACK, PHASES, root
from fastslow.results.transitions import Phase

#: Height of the strip and size of its words, in points.
HEIGHT, WORDS = 9.0, 6.0


def draw_phases(
    ax: Axes, phases: Sequence[Phase]
) -> tuple[tuple[Rectangle, ...], tuple[Text, ...]]:
    """Draw phases as a strip along the upper edge of a time series, and name those with room.

    A quiescent phase bears the sheets that it follows, a spiking one its number of spikes.

    Parameters
    ----------
    ax : Axes
        With time on the horizontal axis; room is made above what is drawn.
    phases : sequence of Phase

    Returns
    -------
    tuple of Rectangle
    tuple of Text
    """
    settle(ax)
    whole = ax.get_window_extent().height * 72.0 / root(ax).dpi
    height = min(HEIGHT / whole, 0.5)
    low, high = ax.get_ylim()
    ax.set_ylim(low, high + height / (1.0 - height) * (high - low))
    frame = ax.get_xaxis_transform()
    boxes, words = [], []
    for phase in phases:
        box = Rectangle(
            (phase.start, 1.0 - height),
            phase.duration,
            height,
            transform=frame,
            zorder=4.8,
            linewidth=0.0,
            **PHASES[phase.kind],
        )
        ax.add_patch(box)
        boxes.append(box)
        text = _text(phase)
        if text:
            words.append(
                ax.text(
                    0.5 * (phase.start + phase.end),
                    1.0 - 0.5 * height,
                    text,
                    transform=frame,
                    ha="center",
                    va="center",
                    fontsize=WORDS,
                    color=BLACK,
                    zorder=4.9,
                    clip_on=True,
                )
            )
            words[-1].set_gid(str(len(boxes) - 1))
    settle(ax)
    for word in words:
        room = boxes[int(word.get_gid() or 0)].get_window_extent()
        if word.get_window_extent().width > room.width:
            word.set_visible(False)
    return tuple(boxes), tuple(words)


def _text(phase: Phase) -> str:
    if phase.kind == "quiescent":
        return " ".join(phase.sheets)
    if phase.kind == "spiking":
        return f"{phase.spikes} spikes"
    return "outside" if phase.kind == "outside" else ""
