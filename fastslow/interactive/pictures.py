"""The figure of an explorer: its axes stay, and what moves in them is drawn over them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg, RendererAgg
from matplotlib.figure import Figure

from fastslow.interactive.drawing import draw_view
from fastslow.interactive.picking import PickCurve
from fastslow.interactive.views import View
from fastslow.plot.layout.style import SMALL, VERMILION, styled_axes
from fastslow.plot.layout.typesetting import plain

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


class Backdrop(Artist):
    """Axes, ticks, names and legend beneath what moves: kept as pixels until they change.

    Attributes
    ----------
    still : sequence of Artist
        What is drawn by the backdrop alone, and hidden otherwise.
    state : list
        All that they depend on, but for the size of the figure.
    """

    def __init__(self) -> None:
        super().__init__()
        self.still: Sequence[Artist] = ()
        self.state: list[Any] = []
        self._kept: Any = None
        self._seen: list[Any] = []
        self.set_zorder(-1e9)

    def draw(self, renderer: Any) -> None:
        """Lay down what was kept, or draw it and keep it, if the renderer keeps pixels."""
        figure: Any = self.get_figure(root=True)
        limits = [(ax.get_xlim(), ax.get_ylim()) for ax in figure.axes]
        seen = [*self.state, limits, figure.dpi, figure.bbox.extents.tolist()]
        # to draw without output, Matplotlib replaces the methods of the renderer
        keeps = isinstance(renderer, RendererAgg) and "draw_path" not in vars(renderer)
        if keeps and seen == self._seen:
            renderer.restore_region(self._kept)
            return
        for artist in self.still:
            artist.set_visible(True)
            artist.draw(renderer)
            artist.set_visible(False)
        if keeps:
            self._kept, self._seen = renderer.copy_from_bbox(figure.bbox), seen


class Picture:
    """A figure in which views are drawn one after the other.

    At rest a view is drawn as a whole, as into a new figure. While a slider moves, limits
    change only when they must, and a backdrop keeps what depends on nothing else.

    Parameters
    ----------
    figure : Figure
    """

    def __init__(self, figure: Figure) -> None:
        self.figure = figure
        self._axes: tuple[Axes, ...] = ()
        self._backdrop = Backdrop()
        self._explained: list[Any] = []

    def draw(self, view: View, *, moving: bool = False) -> tuple[PickCurve, ...]:
        """Draw a view in place of what the figure shows, to be seen when that is drawn.

        Parameters
        ----------
        view : View
        moving : bool
            Whether the next one will follow at once.

        Returns
        -------
        tuple of PickCurve
            What can be picked.
        """
        figure = self.figure
        if not self._axes or tuple(figure.axes) != self._axes:
            figure.clear()
            self._axes = tuple(styled_axes(figure.add_axes(place)) for place in PLACES)
        before = _limits(self._axes)
        for ax in self._axes:
            _empty(ax)
        curves, handles = draw_view(self._axes, view)
        if moving:
            _hold(self._axes, before)
        self._explain(handles, moving)
        for artist in (*figure.texts, *figure.artists):
            artist.remove()
        words = plain("  ".join(str(outcome) for outcome in view.outcomes))
        said = figure.text(0.01, 0.012, words, fontsize=SMALL, color=VERMILION, wrap=True)
        shown = [ax for ax in self._axes if ax.axison]
        framing = [part for ax in shown for part in (ax.patch, ax.xaxis, ax.yaxis)]
        still: list[Artist] = [*framing, *figure.legends, said]
        for part in still:
            part.set_visible(not moving)
        if moving:
            names = [(ax.axison, ax.get_xlabel(), ax.get_ylabel()) for ax in self._axes]
            self._backdrop.still = still
            self._backdrop.state = [names, self._explained, words]
            figure.add_artist(self._backdrop)
        return curves

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
    for artist in (*ax.lines, *ax.patches, *ax.collections, *ax.texts, *ax.artists):
        artist.remove()
    ax.relim()
    ax.set_autoscale_on(True)
    ax.set_axis_on()


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
