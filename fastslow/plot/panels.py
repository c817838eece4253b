"""The figure of a paper: time series, phase portrait and overlay, side by side."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.patches import Patch

from fastslow.arguments import formula, instance, path, takes, text, within
from fastslow.errors import unknown_name
from fastslow.plot.labels import legend_below, place, settle
from fastslow.plot.motions import MotionDrawing, phase_portrait, time_series
from fastslow.plot.passages import OverlayDrawing, draw_passage
from fastslow.plot.phases import fit_words
from fastslow.plot.style import FULL, MM, PHASES, TEXT, dressed, new_figure, save
from fastslow.results.overlays import Overlay

#: Figures narrower than this have their three parts one below the other.
NARROW = 120 * MM


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

    @takes(path=path, dpi=within(10.0, 10_000.0))
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


@takes(lay=instance(Overlay), state=formula, title=text, width=within(2.0, 40.0))
def panel(
    lay: Overlay, state: object = None, *, title: str = "", width: float = FULL
) -> PanelDrawing:
    """Draw time series, phase portrait and overlay as one figure, 170 mm wide.

    A strip above the time series shows the phases of the motion: the sheet that is
    followed, spikes, jumps. In a figure of a column's width the three stand one
    below the other.

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
    name = lay.diagram.states[0] if state is None else str(state)
    if name not in lay.diagram.states:
        raise unknown_name("state", name, lay.diagram.states)
    narrow = width < NARROW
    figure = new_figure(width, (168 if narrow else 68) * MM)
    if narrow:
        grid = figure.subplots(3, 1, height_ratios=[1.0, 1.0, 1.3])
    else:
        grid = figure.subplots(1, 3, width_ratios=[1.0, 1.0, 1.3])
    axes = [dressed(ax) for ax in grid]
    for ax, letter in zip(axes, "abc", strict=True):
        ax.set_title(f"({letter})", loc="left", fontsize=TEXT)
    if title:
        figure.suptitle(title, fontsize=TEXT)
    values = lay.diagram.interface_values
    series = time_series(lay.run, name, ax=axes[0], interfaces=values, phases=lay.phases)
    portrait = phase_portrait(lay.run, ax=axes[1], interfaces=values)
    laid = draw_passage(axes[2], lay, name)
    kinds = {phase.kind for phase in lay.phases}
    shown = [Patch(label=f"{kind} phase", **PHASES[kind]) for kind in PHASES if kind in kinds]
    handles = [*laid.handles, *shown]
    columns = 2 if narrow else 4 if len(handles) <= 8 else 5
    legend = legend_below(laid.ax, handles, columns)
    settle(laid.ax)
    fit_words(series.phases, series.words)
    place(axes[0], bands=series.bands)
    place(axes[1], bands=portrait.bands)
    place(axes[2], laid.diagram.labels, bands=[laid.diagram.bands])
    return PanelDrawing(figure, series, portrait, laid, legend)
