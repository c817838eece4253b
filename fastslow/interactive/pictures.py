"""The figure of an explorer: its axes stay, and what moves in them is drawn over them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backend_bases import Event
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from fastslow.interactive.drawing import draw_view
from fastslow.interactive.picking import Curve
from fastslow.interactive.views import View
from fastslow.plot.style import SMALL, VERMILION, dressed
from fastslow.plot.typesetting import plain

#: Size of a figure of our own, in inches, and places of its axes in it.
SIZE = (9.0, 5.0)
PLACES = ((0.065, 0.6, 0.36, 0.34), (0.065, 0.115, 0.36, 0.34), (0.5, 0.235, 0.485, 0.705))

#: Limits stay while a slider moves as long as what is drawn fills this part of them.
FILLED = 0.7

#: Nearer to a limit than this, in parts of the limits, there is no margin left, and ...
NEAR = 0.04

#: ... this is added where limits have to change.
ROOM = 0.15

Limits = tuple[float, float]


def own_figure() -> Figure:
    """A figure of our own, outside pyplot."""
    figure = Figure(figsize=SIZE, dpi=100)
    FigureCanvasAgg(figure)
    return figure


class Picture:
    """A figure in which views are drawn one after the other.

    At rest a view is drawn as a whole, as into a new figure. While a slider moves, axes,
    ticks, names and legend are drawn only when they change; the rest is drawn over them.

    Parameters
    ----------
    figure : Figure
    """

    def __init__(self, figure: Figure) -> None:
        self.figure = figure
        self._axes: tuple[Axes, ...] = ()
        self._moving: list[Artist] = []
        self._explained: list[Any] = []
        self._fixed: list[Any] = []
        self._beneath: Any = None
        figure.canvas.mpl_connect("draw_event", self._drawn)

    def draw(self, view: View, *, moving: bool = False) -> tuple[Curve, ...]:
        """Draw a view in place of what the figure shows, to be seen after `show`.

        Parameters
        ----------
        view : View
        moving : bool
            Whether the next one will follow at once.

        Returns
        -------
        tuple of Curve
            What can be picked.
        """
        if not self._axes or tuple(self.figure.axes) != self._axes:
            self.figure.clear()
            self._axes = tuple(dressed(self.figure.add_axes(place)) for place in PLACES)
        before = _limits(self._axes)
        for ax in self._axes:
            _empty(ax)
        curves, handles = draw_view(self._axes, view)
        moving = moving and bool(self.figure.canvas.supports_blit)
        if moving:
            _hold(self._axes, before)
        self._explain(handles, moving)
        for text in list(self.figure.texts):
            text.remove()
        words = "  ".join(str(outcome) for outcome in view.outcomes)
        self.figure.text(0.01, 0.012, plain(words), fontsize=SMALL, color=VERMILION, wrap=True)
        self._moving = [artist for ax in self._axes for artist in _in_frame(ax)] if moving else []
        for ax in self._axes:
            for artist in _in_frame(ax):
                artist.set_animated(moving)
        return curves

    def show(self) -> bool:
        """Bring what was drawn to the screen; whether that was done without a draw event."""
        canvas: Any = self.figure.canvas
        if not self._moving or self._beneath is None or self._fixed != self._furniture():
            canvas.draw_idle()
            return False
        canvas.restore_region(self._beneath)
        self._draw_moving()
        canvas.blit(self.figure.bbox)
        return True

    def _drawn(self, _: Event) -> None:
        """Keep the axes as they were drawn, and draw over them what moves."""
        canvas: Any = self.figure.canvas
        if canvas.is_saving():
            return
        self._beneath = None
        if self._moving:
            self._beneath, self._fixed = canvas.copy_from_bbox(self.figure.bbox), self._furniture()
            self._draw_moving()

    def _draw_moving(self) -> None:
        for artist in self._moving:
            self.figure.draw_artist(artist)

    def _furniture(self) -> list[Any]:
        """All that is drawn beneath what moves depends on."""
        figure = self.figure
        drawn: list[Any] = [figure.canvas, *figure.get_size_inches().tolist(), figure.dpi]
        for ax in self._axes:
            drawn += [ax.axison, ax.get_xlabel(), ax.get_ylabel(), ax.get_xlim(), ax.get_ylim()]
        return [*drawn, self._explained, [text.get_text() for text in figure.texts]]

    def _explain(self, handles: Sequence[Any], moving: bool) -> None:
        """A legend of handles; one that explains the same serves on while a slider moves."""
        explained = [(str(h.get_label()), np.ravel(h.get_linewidth()).tolist()) for h in handles]
        if moving and explained == self._explained:
            return
        self._explained = explained
        for legend in list(self.figure.legends):
            legend.remove()
        if handles:
            self.figure.legend(
                handles=handles,
                loc="lower center",
                bbox_to_anchor=(0.74, 0.05),
                ncols=4,
                fontsize=SMALL,
                frameon=False,
                columnspacing=1.0,
                handlelength=1.8,
            )


def _empty(ax: Axes) -> None:
    """Take everything out of axes, which are then as new ones are."""
    for artist in _content(ax):
        artist.remove()
    ax.relim()
    ax.set_autoscale_on(True)
    ax.set_axis_on()


def _content(ax: Axes) -> list[Artist]:
    """What was drawn into axes."""
    return [*ax.lines, *ax.patches, *ax.collections, *ax.texts, *ax.artists]


def _in_frame(ax: Axes) -> list[Artist]:
    """What is drawn anew in every frame, in its order: the content and the frame about it."""
    known = {*_content(ax), *(ax.spines.values() if ax.axison else ())}
    return sorted((a for a in ax.get_children() if a in known), key=Artist.get_zorder)


def _hold(axes: Sequence[Axes], before: Sequence[Limits]) -> None:
    """Keep the limits of all axes if they hold what is drawn and are not too wide for it.

    Otherwise those that what is drawn has come near to, and would soon leave again, get room.
    """
    data = [data for ax in axes for data in (ax.dataLim.intervalx, ax.dataLim.intervaly)]
    wanted = _limits(axes)
    seen = [np.clip(near, *limits) for near, limits in zip(data, wanted, strict=True)]
    kept, spans = np.array(before), np.ptp(wanted, axis=1)
    low, high = np.array(seen).T
    held = (kept[:, 0] <= low) & (low < high) & (high <= kept[:, 1])
    if not (held & (spans >= FILLED * np.ptp(kept, axis=1))).all():
        near = np.column_stack([low - kept[:, 0], kept[:, 1] - high]) < NEAR * spans[:, None]
        changed = near & (kept != wanted)
        kept = np.array(wanted) + ROOM * spans[:, None] * changed * np.array([-1.0, 1.0])
    setters = [set_limits for ax in axes for set_limits in (ax.set_xlim, ax.set_ylim)]
    for set_limits, (first, last) in zip(setters, kept.tolist(), strict=True):
        set_limits(first, last, auto=None)


def _limits(axes: Sequence[Axes]) -> list[Limits]:
    """Limits of axes, the horizontal ones of each first."""
    return [limits for ax in axes for limits in (ax.get_xlim(), ax.get_ylim())]
