"""Panels for papers: time series, phase portrait and overlay in one figure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from matplotlib.axes import Axes
from matplotlib.legend import Legend
from matplotlib.patches import Patch

from fastslow.arguments import Name, flag, formula, instance, items, text, validated
from fastslow.errors import ArgumentError, unknown_name
from fastslow.plot.arguments import figure_width, line_style
from fastslow.plot.drawings import Drawing
from fastslow.plot.layout.labels import place
from fastslow.plot.layout.legends import legend_below, legend_inside
from fastslow.plot.layout.style import MM, PHASES, TEXT, inches, new_figure, styled_axes
from fastslow.plot.layout.typesetting import as_given
from fastslow.plot.motions import MotionDrawing, phase_portrait, time_series
from fastslow.plot.passages import OverlayDrawing, draw_magnified
from fastslow.plot.quantities import of_diagram
from fastslow.results.overlay.overlay import Overlay, require_equilibria

#: Narrower figures have their three axes in one column.
NARROW = 120 * MM


@dataclass(frozen=True, eq=False, repr=False)
class PanelDrawing(Drawing):
    """A drawn panel.

    Parameters
    ----------
    ax : Axes
        Axes of the overlay.
    time_series, phase_portrait : MotionDrawing
    overlay : OverlayDrawing
    legend : Legend or None
        Common legend: below the axes, or inside those of the overlay if axes were given.
    """

    time_series: MotionDrawing
    phase_portrait: MotionDrawing
    overlay: OverlayDrawing
    legend: Legend | None

    def __repr__(self) -> str:
        return f"PanelDrawing({self.time_series}, {self.phase_portrait}, {self.overlay})"


@validated(
    overlay=instance(Overlay),
    y=formula,
    ax=items(instance(Axes)),
    title=text,
    width=figure_width,
    label=flag,
    legend=flag,
    style=line_style,
)
def panel(
    overlay: Overlay,
    y: Name | None = None,
    *,
    ax: Sequence[Axes] | None = None,
    title: str = "",
    width: str | float = "page",
    label: bool = True,
    legend: bool | None = None,
    **style: Any,
) -> PanelDrawing:
    """Draw time series, phase portrait and overlay as one figure, by default 170 mm wide.

    A strip above the time series shows the phases of the motion: the stable branch followed,
    oscillations, jumps. In a figure as wide as a column the three are arranged vertically.

    Parameters
    ----------
    overlay : Overlay
    y : str or Symbol, optional
        State drawn over time and over the slow quantity, by default the first.
    ax : sequence of three Axes, optional
        Axes of the three plots; a new figure otherwise.
    title : str
        Title of a new figure, e.g. the parameter values.
    width : str or float
        Width of a new figure: ``"page"`` (170 mm), ``"column"`` (85 mm), or millimetres.
    label : bool
        Whether to write labels, and the letters (a), (b), (c).
    legend : bool, optional
        Whether to draw a legend; by default as ``label``.
    **style
        Properties of the trajectory's lines.

    Returns
    -------
    PanelDrawing

    Raises
    ------
    UnknownNameError
        If ``y`` is no state of the diagram.
    ArgumentError
        If ``ax`` is not three axes, or for an overlay of periodic orbits.

    See Also
    --------
    fastslow.overlay, fastslow.plot.overlay, fastslow.plot.axes

    Examples
    --------
    >>> import fastslow as fs
    >>> gear = fs.systems.harmonic_gear()
    >>> diagram = fs.continue_equilibria(gear.frozen(), "w", over=(-2, 6))
    >>> overlay = fs.overlay(diagram, fs.simulate(gear, [0, 0], periods=2))
    >>> drawn = fs.plot.panel(overlay, width="column", linewidth=0.6)
    >>> [round(25.4 * length) for length in drawn.figure.get_size_inches()]
    [85, 168]
    """
    require_equilibria(overlay, "panel")
    name = overlay.diagram.states[0] if y is None else str(y)
    if name not in overlay.diagram.states:
        raise unknown_name("state", name, overlay.diagram.states)
    axes = _new_axes(inches(width), title) if ax is None else list(ax)
    if len(axes) != 3:
        raise ArgumentError(f"panel: expected three axes, received {len(axes)}")
    if label:
        for one, letter in zip(axes, "abc", strict=True):
            one.set_title(f"({letter})", loc="left", fontsize=TEXT)
    values = overlay.diagram.interface_values
    look: dict[str, Any] = {"interface_values": values, "label": label, "legend": False, **style}
    series = time_series(overlay.run, name, ax=axes[0], phases=overlay.phases, **look)
    portrait = phase_portrait(overlay.run, ax=axes[1], **look)
    shown = (
        of_diagram(overlay.diagram, None, overlay.parameter),
        of_diagram(overlay.diagram, name, name),
    )
    laid = draw_magnified(axes[2], overlay, shown, inset="auto", label=label, **style)
    kinds = {phase.type for phase in overlay.phases}
    strips = [Patch(label=f"{kind} phase", **PHASES[kind]) for kind in PHASES if kind in kinds]
    key = None
    if label if legend is None else legend:
        draw = legend_below if ax is None else legend_inside
        key = draw(laid.ax, [*laid.handles, *strips])
    place(axes[2], laid.diagram.texts, bands=[laid.diagram.bands])
    return PanelDrawing(laid.ax, series, portrait, laid, key)


def _new_axes(width: float, title: str) -> list[Axes]:
    """Create three axes, side by side or, in a narrow figure, in one column."""
    narrow = width < NARROW
    figure = new_figure(width, (168 if narrow else 68) * MM)
    if narrow:
        grid = figure.subplots(3, 1, height_ratios=[1.0, 1.0, 1.3])
    else:
        grid = figure.subplots(1, 3, width_ratios=[1.0, 1.0, 1.3])
    if title:
        figure.suptitle(as_given(title), fontsize=TEXT)
    return [styled_axes(ax) for ax in grid]
