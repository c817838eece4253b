"""Phases of a motion, drawn as a strip above its time series."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.backend_bases import RendererBase
from matplotlib.patches import Rectangle
from matplotlib.text import Text

from fastslow.plot.layout.style import BLACK, PHASES, WHITE_WORDS, root
from fastslow.plot.layout.typesetting import plain
from fastslow.results.overlay.transitions import Phase

#: Height of the strip and font size of its text, in points.
PHASE_HEIGHT, PHASE_FONT = 10.0, 6.0


def draw_phases(
    ax: Axes, phases: Sequence[Phase], label: bool = True
) -> tuple[tuple[Rectangle, ...], tuple[Text, ...]]:
    """Draw the phases of a motion as a strip along the upper edge of a time series.

    Parameters
    ----------
    ax : Axes
        Axes with time on the horizontal axis; the upper limit is raised for the strip.
    phases : sequence of Phase
    label : bool
        Whether to name the phases.

    Returns
    -------
    tuple of Rectangle
        One for each phase.
    tuple of Text
        Name of each: "on" and the stable branches followed in a quasi-static phase, the number of
        oscillations. `fit_words` hides names that do not fit.
    """
    height = strip_height(ax)
    low, high = ax.get_ylim()
    ax.set_ylim(low, high + height / (1.0 - height) * (high - low), auto=None)
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
            **PHASES[phase.type],
        )
        ax.add_patch(box)
        boxes.append(box)
        if not label:
            continue
        words.append(
            ax.text(
                0.5 * (phase.start + phase.end),
                1.0 - 0.5 * height,
                _text(phase),
                transform=frame,
                ha="center",
                va="center",
                fontsize=PHASE_FONT,
                color="white" if phase.type in WHITE_WORDS else BLACK,
                zorder=4.9,
                clip_on=True,
            )
        )
    return tuple(boxes), tuple(words)


def strip_height(ax: Axes) -> float:
    """Height of the strip as a fraction of the axes."""
    whole = ax.get_window_extent().height * 72.0 / root(ax).dpi
    return min(PHASE_HEIGHT / whole, 0.5)


def fit_words(boxes: Sequence[Rectangle], words: Sequence[Text], renderer: RendererBase) -> None:
    """Hide names that are wider than their boxes, once the layout is final."""
    # no names without labels
    for box, word in zip(boxes, words, strict=False):
        # a hidden text has no extent, and an earlier draw may have hidden it
        word.set_visible(True)
        width = word.get_window_extent(renderer).width
        word.set_visible(width <= box.get_window_extent().width)


def _text(phase: Phase) -> str:
    if phase.type == "quasi-static":
        names = phase.stable_branches
        # along the edge of a band of equilibria; a stable branch alone in its region has its name
        if any(name.startswith("edge of ") for name in names):
            return plain(" ".join("edge" if n.startswith("edge of ") else n for n in names))
        return plain(f"on {' '.join(names)}")
    if phase.type == "oscillating":
        return f"{phase.oscillations} oscillations"
    return phase.type if phase.type in ("outside", "sticking") else ""
