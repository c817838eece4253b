"""The figure of an explorer, redrawn over a stored background."""

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
from fastslow.plot.layout.labels import Placement
from fastslow.plot.layout.style import SMALL_TEXT, VERMILION, styled_axes
from fastslow.plot.layout.typesetting import plain

#: Size of a new figure in inches, and positions of its axes.
FIGURE_SIZE = (9.0, 5.0)
AXES_PLACES = ((0.065, 0.6, 0.36, 0.34), (0.065, 0.115, 0.36, 0.34), (0.5, 0.235, 0.485, 0.705))

#: While a slider moves the limits are kept if the data fill at least this fraction of them.
FILLED_LIMITS = 0.7

#: Smallest margin between data and limits, as a fraction of the limits, and ...
SMALLEST_MARGIN = 0.04

#: ... margin added where the limits change.
MARGIN_ADDED = 0.15

Limits = tuple[float, float]


def own_figure() -> Figure:
    """Create a figure outside pyplot."""
    figure = Figure(figsize=FIGURE_SIZE, dpi=100)
    FigureCanvasAgg(figure)
    return figure


class Backdrop(Artist):
    """Axes, ticks, labels and legend, stored as pixels until they change.

    Attributes
    ----------
    still : sequence of Artist
        Artists drawn by the backdrop alone.
    state : list
        Everything they depend on except for the size of the figure.
    """

    def __init__(self) -> None:
        super().__init__()
        self.still: Sequence[Artist] = ()
        self.state: list[Any] = []
        self._kept: Any = None
        self._seen: list[Any] = []
        self.set_zorder(-1e9)

    def draw(self, renderer: Any) -> None:
        """Restore the stored pixels, or draw and store them if the renderer has pixels."""
        figure: Any = self.get_figure(root=True)
        limits = [(ax.get_xlim(), ax.get_ylim()) for ax in figure.axes]
        seen = [*self.state, limits, figure.dpi, figure.bbox.extents.tolist()]
        # Matplotlib replaces the methods of the renderer in a draw without output
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
    """A figure in which views are drawn in succession.

    A single view is drawn as into a new figure. While a slider moves, the limits change only
    if necessary, and a backdrop stores the unchanged artists.

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
        """Replace the contents of the figure by a view; visible after the next draw.

        Parameters
        ----------
        view : View
        moving : bool
            Whether a slider is moving.

        Returns
        -------
        tuple of PickCurve
            Curves that can be picked.
        """
        figure = self.figure
        if not self._axes or tuple(figure.axes) != self._axes:
            figure.clear()
            self._axes = tuple(styled_axes(figure.add_axes(place)) for place in AXES_PLACES)
        before, placed = _limits(self._axes), _placements(self._axes)
        for ax in self._axes:
            _empty(ax)
        curves, handles = draw_view(self._axes, view)
        if moving:
            _keep_limits(self._axes, before)
            self._keep_names(placed, _limits(self._axes) == before)
        self._explain(handles, moving)
        for artist in (*figure.texts, *figure.artists):
            artist.remove()
        words = plain("  ".join(str(outcome) for outcome in view.outcomes))
        said = figure.text(0.01, 0.012, words, fontsize=SMALL_TEXT, color=VERMILION, wrap=True)
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

    def _keep_names(self, placed: Sequence[Placement], same_limits: bool) -> None:
        """Keep the places of the names of regions within the same limits.

        While a slider moves, placing them again would take as long as the rest of the drawing.
        """
        new = _placements(self._axes)
        if same_limits and len(new) == len(placed):
            for placement, earlier in zip(new, placed, strict=True):
                placement.keep_from(earlier)

    def _explain(self, handles: Sequence[Any], moving: bool) -> None:
        """Add a legend; while a slider moves an unchanged legend is kept."""
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
                fontsize=SMALL_TEXT,
                frameon=False,
                columnspacing=1.0,
                handlelength=1.8,
            )


def _placements(axes: Sequence[Axes]) -> list[Placement]:
    return [artist for ax in axes for artist in ax.artists if isinstance(artist, Placement)]


def _empty(ax: Axes) -> None:
    """Reset axes to an empty state."""
    for artist in (*ax.lines, *ax.patches, *ax.collections, *ax.texts, *ax.artists):
        artist.remove()
    ax.relim()
    ax.set_autoscale_on(True)
    ax.set_axis_on()


def _keep_limits(axes: Sequence[Axes], before: Sequence[Limits]) -> None:
    """Keep the limits of all axes that contain the data and are not too wide for them.

    Limits that the data have come close to get an additional margin.
    """
    data = [data for ax in axes for data in (ax.dataLim.intervalx, ax.dataLim.intervaly)]
    wanted = _limits(axes)
    seen = [np.clip(near, *limits) for near, limits in zip(data, wanted, strict=True)]
    kept, spans = np.array(before), np.ptp(wanted, axis=1)
    low, high = np.array(seen).T
    held = (kept[:, 0] <= low) & (low < high) & (high <= kept[:, 1])
    if not (held & (spans >= FILLED_LIMITS * np.ptp(kept, axis=1))).all():
        near = (
            np.column_stack([low - kept[:, 0], kept[:, 1] - high])
            < SMALLEST_MARGIN * spans[:, None]
        )
        changed = near & (kept != wanted)
        kept = np.array(wanted) + MARGIN_ADDED * spans[:, None] * changed * np.array([-1.0, 1.0])
    setters = [set_limits for ax in axes for set_limits in (ax.set_xlim, ax.set_ylim)]
    for set_limits, (first, last) in zip(setters, kept.tolist(), strict=True):
        set_limits(first, last, auto=None)


def _limits(axes: Sequence[Axes]) -> list[Limits]:
    """Return the limits of axes, horizontal before vertical."""
    return [limits for ax in axes for limits in (ax.get_xlim(), ax.get_ylim())]
