"""The figure of a paper: time series, phase portrait and overlay, side by side."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure
from matplotlib.legend import Legend

from fastslow.plot.branches import state_name
from fastslow.plot.labels import legend_below, place, settle
from fastslow.plot.motions import MotionDrawing, phase_portrait, time_series
from fastslow.plot.passages import OverlayDrawing, draw_passage
from fastslow.plot.style import FULL, MM, TEXT, dressed, new_figure, save
from fastslow.results.overlays import Overlay


@dataclass(frozen=True, eq=False)
class PanelDrawing:
    """A drawn panel.

    Parameters
    ----------
    figure : Figure
    time_series, phase_portrait : MotionDrawing
    overlay : OverlayDrawing
    legend : Legend
        Below the three, for all.
    """

    figure: Figure
    time_series: MotionDrawing
    phase_portrait: MotionDrawing
    overlay: OverlayDrawing
    legend: Legend

    def save(self, path: str | Path, dpi: float = 300) -> Path:
        """Write the figure, in the format of the suffix, with text kept as text.

        Parameters
        ----------
        path : str or Path
            Where to, e.g. ``"panel.pdf"``; its folder must exist.
        dpi : float
            Dots per inch of pixel formats.

        Returns
        -------
        Path
        """
        return save(self.figure, path, dpi)

    def _repr_png_(self) -> bytes:
        return self.overlay._repr_png_()


def panel(
    lay: Overlay, state: object = None, *, title: str = "", width: float = FULL
) -> PanelDrawing:
    """Draw time series, phase portrait and overlay as one figure, 170 mm wide.

    Parameters
    ----------
    lay : Overlay
    state : str or Symbol, optional
        The state shown over time and over the slow quantity, by default the first.
    title : str
        Written above, e.g. the parameter values.
    width : float
        Width of the figure in inches.

    Returns
    -------
    PanelDrawing

    Raises
    ------
    UnknownNameError
        If ``state`` is no state of the diagram.
    """
    name = state_name(lay.diagram.states, state)
    figure = new_figure(width, 68 * MM)
    axes = [dressed(ax) for ax in figure.subplots(1, 3, width_ratios=[1.0, 1.0, 1.3])]
    for ax, letter in zip(axes, "abc", strict=True):
        ax.set_title(f"({letter})", loc="left", fontsize=TEXT)
    if title:
        figure.suptitle(title, fontsize=TEXT)
    values = lay.diagram.interface_values
    series = time_series(lay.run, name, ax=axes[0], interfaces=values)
    portrait = phase_portrait(lay.run, ax=axes[1], interfaces=values)
    laid = draw_passage(axes[2], lay, name)
    legend = legend_below(laid.ax, laid.handles, 4 if len(laid.handles) <= 8 else 5)
    settle(laid.ax)
    place(axes[0], bands=series.bands)
    place(axes[1], bands=portrait.bands)
    place(axes[2], laid.diagram.labels, bands=[laid.diagram.bands])
    return PanelDrawing(figure, series, portrait, laid, legend)
