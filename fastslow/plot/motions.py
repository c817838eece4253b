"""Time series and phase portraits of trajectories."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from matplotlib.text import Annotation, Text

from fastslow.arguments import flag, instance, items, validated, whole
from fastslow.errors import ArgumentError
from fastslow.plot.arguments import (
    Axis,
    axis_quantity,
    figure_width,
    levels_of_states,
    line_style,
)
from fastslow.plot.drawings import Drawing
from fastslow.plot.layout.arrows import draw_arrows, length_along
from fastslow.plot.layout.bands import Bands, Values, draw_bands
from fastslow.plot.layout.interfaces import draw_interfaces
from fastslow.plot.layout.labels import place
from fastslow.plot.layout.legends import add_legend
from fastslow.plot.layout.marks import draw_dots
from fastslow.plot.layout.occupancy import on_draw, run_layout
from fastslow.plot.layout.style import MOTION, axes_for, keep_tick_count, note_early_end, spatial
from fastslow.plot.motion_lines import (
    LINE,
    alone,
    draw_line,
    draw_motion,
    draw_sliding,
    relieve,
    unresolved,
    without_growth,
)
from fastslow.plot.phases import draw_phases, fit_words, strip_height
from fastslow.plot.quantities import Quantity, along_run, at_crossings, of_run
from fastslow.plot.spaces import HEIGHT_OF_SPACE, style_space
from fastslow.plot.switch_states import draw_sheets, draw_strips
from fastslow.results.base.outcome import early_end
from fastslow.results.overlay.transitions import Phase
from fastslow.results.trajectory.trajectory import Trajectory


@dataclass(frozen=True, eq=False, repr=False)
class MotionDrawing(Drawing):
    """A drawn trajectory.

    Parameters
    ----------
    ax : Axes
    x, y : str
        Quantities on the axes.
    lines : tuple of Line2D
        The trajectory, interrupted at jumps; in a phase portrait earlier periods, if any, and
        the last one.
    crossings : Line2D or None
        One dot for each crossing of an interface.
    arrows : tuple of Annotation
        Direction of motion.
    bands : tuple of Bands
        Interfaces and regions.
    phases : tuple of Rectangle
        The strip of phases above a time series.
    words : tuple of Text
        Texts of the strip.
    legend : Legend or None
        None if only the trajectory is drawn.
    z : str
        Quantity on the third axis, in space.
    shown : tuple of Quantity
        Quantities on the axes, the horizontal one first.
    switches : tuple of PolyCollection
        One strip for each switch below a time series, filled where it is 1.
    sliding : Line2D or None
        Sliding segments, as a double line.
    interfaces : tuple of Line2D
        Interfaces in the quantities on the axes, other than those of the bands.
    """

    x: str
    y: str
    lines: tuple[Line2D, ...]
    crossings: Line2D | None
    arrows: tuple[Annotation, ...]
    bands: tuple[Bands, ...]
    phases: tuple[Rectangle, ...] = ()
    words: tuple[Text, ...] = ()
    legend: Legend | None = None
    z: str = ""
    shown: tuple[Quantity, ...] = ()
    switches: tuple[PolyCollection, ...] = ()
    sliding: Line2D | None = None
    interfaces: tuple[Line2D, ...] = ()

    @property
    def handles(self) -> list[Artist]:
        """Legend entries: trajectory, earlier periods, sliding, crossings of interfaces."""
        more = [line for line in (self.sliding, self.crossings) if line is not None]
        return [*self.lines[::-1], *more]


@validated(
    run=instance(Trajectory),
    y=axis_quantity,
    ax=instance(Axes),
    width=figure_width,
    label=flag,
    legend=flag,
    crossings=flag,
    interface_values=levels_of_states,
    phases=items(instance(Phase)),
    style=line_style,
)
def time_series(
    run: Trajectory,
    y: Axis | None = None,
    *,
    ax: Axes | None = None,
    width: str | float = "column",
    label: bool = True,
    legend: bool | None = None,
    crossings: bool = True,
    interface_values: Values | None = None,
    phases: Sequence[Phase] = (),
    **style: Any,
) -> MotionDrawing:
    """Draw one quantity of a trajectory over time, with a strip below it for each switch.

    Oscillations faster than the axes can show are drawn as their envelope, the minimum and the
    maximum in each column of pixels, and dots that would cover each other are thinned; the
    legend says so. The drawing keeps all points.

    Parameters
    ----------
    run : Trajectory
    y : str, Symbol, Expr or callable, optional
        A state or slow quantity, by default the first state, an expression in them and in
        parameters and t, or a function of the columns.
    ax : Axes, optional
        Axes to draw into, in which limits set by hand are kept; new ones otherwise.
    width : str or float
        Width of a new figure: ``"column"`` (85 mm), ``"page"`` (170 mm), or millimetres.
    label : bool
        Whether to write the names of regions and phases.
    legend : bool, optional
        Whether to draw a legend, if more than the trajectory is drawn; by default as
        ``label``.
    crossings : bool
        Whether to mark the crossings of interfaces.
    interface_values : mapping, optional
        Interface to (state, value), such as ``diagram.interface_values``, to be drawn with
        the regions between them.
    phases : sequence of Phase
        Phases of an overlay, ``overlay.phases``, drawn as a strip and named where the names fit.
    **style
        Properties of the line.

    Returns
    -------
    MotionDrawing

    Raises
    ------
    UnknownNameError
        If ``y`` is no state or slow quantity of the trajectory.
    ArgumentError
        For an invalid expression.

    See Also
    --------
    fastslow.simulate, fastslow.plot.phase_portrait

    Examples
    --------
    >>> import fastslow as fs
    >>> run = fs.simulate(fs.systems.van_der_pol(), [0.5, 0], t=(0, 10))
    >>> drawn = fs.plot.time_series(run, "x**2", color="black")
    >>> drawn.y, drawn.ax.get_ylabel(), drawn.legend
    ('x**2', '$x^{2}$', None)
    """
    shown = of_run(run, "t", "t"), of_run(run, y, run.columns[0])
    own, ax = ax is None, axes_for(ax, width, height=50.0)
    earlier = ax.get_xlim() if ax.has_data() else ()
    time, values = along_run(run, *shown)
    name = "trajectory (envelope)" if unresolved(ax, values) else "trajectory"
    look = {"color": MOTION, "label": name, **LINE, **alone(len(time)), **style}
    with without_growth(ax, run, run.t, (time, values)):
        lines = (draw_line(ax, run.t, [time, values], shown, run, look),)
        slid = draw_sliding(ax, run.t, [time, values], shown, run)
        dots = draw_dots(ax, at_crossings(run, *shown)) if crossings else None
    ax.set_xlabel(shown[0].label)
    ax.set_ylabel(shown[1].label)
    if time[-1] > time[0] and ax.get_autoscalex_on():
        ends = (*earlier, float(time[0]), float(time[-1]))
        ax.set_xlim(min(ends), max(ends), auto=None)
        keep_tick_count(ax.xaxis)
    strip = draw_phases(ax, phases, label) if phases else ((), ())
    on = draw_strips(ax, run, label)[0] if run.switch_names else ()
    bands = _bands(ax, run, (None, shown[1]), interface_values, label)
    drawn = MotionDrawing(
        ax, "t", shown[1].text, lines, dots, (), bands, *strip, shown=shown, switches=on
    )
    drawn = replace(drawn, sliding=slid, interfaces=_interfaces(ax, run, shown, interface_values))
    if phases:
        on_draw(ax, lambda renderer: fit_words(*strip, renderer))
    # the note and the legend are below the strip
    top = 1.0 - strip_height(ax) if phases else 1.0
    note_early_end(ax, early_end(run.outcome), top)
    return _explained(drawn, own, label, legend, top)


@validated(
    run=instance(Trajectory),
    x=axis_quantity,
    y=axis_quantity,
    z=axis_quantity,
    ax=instance(Axes),
    width=figure_width,
    label=flag,
    legend=flag,
    crossings=flag,
    interface_values=levels_of_states,
    arrows=whole(0, 1000),
    style=line_style,
)
def phase_portrait(
    run: Trajectory,
    x: Axis | None = None,
    y: Axis | None = None,
    z: Axis | None = None,
    *,
    ax: Axes | None = None,
    width: str | float = "column",
    label: bool = True,
    legend: bool | None = None,
    crossings: bool = True,
    interface_values: Values | None = None,
    arrows: int = 3,
    **style: Any,
) -> MotionDrawing:
    """Draw a trajectory in the plane of two of its quantities, or in the space of three.

    The parts of a trajectory with different states of its switches have different line styles,
    unless a switch is on an axis. Jumps of the state are dotted. Lines that would fill much of the
    axes are thinner.

    Parameters
    ----------
    run : Trajectory
    x, y : str, Symbol, Expr or callable, optional
        States or slow quantities, by default the first two states (for a single state, the
        state over its slow quantity), expressions in them and in parameters and t, or
        functions of the columns.
    z : str, Symbol, Expr or callable, optional
        Quantity on the vertical axis of a view in space; by default the third if ``ax`` is in
        space.
    ax : Axes, optional
        Axes to draw into (with ``projection="3d"`` for a view in space), in which limits set
        by hand are kept; new ones otherwise.
    width : str or float
        Width of a new figure: ``"column"`` (85 mm), ``"page"`` (170 mm), or millimetres.
    label : bool
        Whether to write the names of regions.
    legend : bool, optional
        Whether to draw a legend, if more than the trajectory is drawn; by default as
        ``label``.
    crossings : bool
        Whether to mark the crossings of interfaces.
    interface_values : mapping, optional
        Interface to (state, value), such as ``diagram.interface_values``, to be drawn with
        the regions between them (in the plane).
    arrows : int
        Number of arrow heads.
    **style
        Properties of the line.

    Returns
    -------
    MotionDrawing

    Raises
    ------
    UnknownNameError
        For a name in ``x``, ``y`` or ``z`` that is no state or slow quantity.
    ArgumentError
        If there is only one quantity, for an invalid expression, or for a view in space with
        axes of the plane.

    See Also
    --------
    fastslow.simulate, fastslow.plot.time_series, fastslow.plot.section

    Examples
    --------
    >>> import fastslow as fs
    >>> run = fs.simulate(fs.systems.van_der_pol(), [0.5, 0], t=(0, 10))
    >>> fs.plot.phase_portrait(run, "w", "x").ax.get_xlabel()
    '$w$'
    """
    names = run.columns
    if len(names) < 2 and (x is None or y is None):
        raise ArgumentError(f"a phase portrait needs two quantities, received {names[0]} alone")
    if len(run.states) == 1 and x is None and y is None:
        x, y = names[1], names[0]
    shown = [of_run(run, x, names[0]), of_run(run, y, names[-1 if len(names) < 2 else 1])]
    space = spatial("phase_portrait", ax, z)
    if space:
        third = next((n for n in names if n not in (shown[0].text, shown[1].text)), "t")
        shown.append(of_run(run, z, third))
    own, ax = ax is None, axes_for(ax, width, HEIGHT_OF_SPACE if space else 64.0, space)
    in_sheets = run.switch_names and not {q.column for q in shown} & {*run.switch_names}
    sheets = draw_sheets if in_sheets else None
    places = along_run(run, *shown)
    with without_growth(ax, run, run.t, places):
        lines = draw_motion(ax, run.t, places, shown, run, style, sheets)
        slid = draw_sliding(ax, run.t, places, shown, run)
        dots = draw_dots(ax, at_crossings(run, *shown)) if crossings else None
    bands: tuple[Bands, ...] = ()
    if space:
        style_space(ax, [q.label for q in shown])
        run_layout(ax)
    else:
        ax.set_xlabel(shown[0].label)
        ax.set_ylabel(shown[1].label)
        bands = _bands(ax, run, (shown[0], shown[1]), interface_values, label)
        if not {"linewidth", "lw"} & set(style):
            relieve(lines)
    fractions = (np.arange(arrows) + 0.5) / max(arrows, 1)
    heads = draw_arrows(lines[-1], length_along(lines[-1]), fractions.tolist())
    note_early_end(ax, early_end(run.outcome))
    across, up, *more = (q.text for q in shown)
    drawn = MotionDrawing(
        ax, across, up, lines, dots, heads, bands, z="".join(more), shown=tuple(shown)
    )
    edges = () if space else _interfaces(ax, run, shown, interface_values)
    drawn = replace(drawn, sliding=slid, interfaces=edges)
    return _explained(drawn, own, label, legend)


def _explained(
    drawn: MotionDrawing, own: bool, label: bool, legend: bool | None, top: float = 1.0
) -> MotionDrawing:
    """Add a legend if more than the trajectory is drawn, and place the names of regions."""
    if len(drawn.handles) > 1:
        drawn = replace(drawn, legend=add_legend(drawn.ax, drawn.handles, own, label, legend, top))
    place(drawn.ax, bands=drawn.bands)
    return drawn


def _interfaces(
    ax: Axes, run: Trajectory, shown: Sequence[Quantity], drawn: Values | None
) -> tuple[Line2D, ...]:
    """Draw the interfaces in the quantities on the axes that are not edges of bands."""
    names = [name for name in run.interfaces if name not in (drawn or {})]
    return draw_interfaces(ax, names, [q.column for q in shown], run.parameters)


def _bands(
    ax: Axes,
    run: Trajectory,
    axes: tuple[Quantity | None, Quantity],
    interfaces: Values | None,
    label: bool,
) -> tuple[Bands, ...]:
    """Draw bands across the axes that show a state."""
    starts = np.array([segment.start for segment in run.segments])
    names = np.array([segment.region for segment in run.segments])
    if not len(starts) or not interfaces:
        return ()
    regions = names[np.maximum(np.searchsorted(starts, run.t, side="right") - 1, 0)]
    return tuple(
        draw_bands(ax, q.column, interfaces, run[q.column], regions, vertical=vertical, label=label)
        for q, vertical in zip(axes, (True, False), strict=True)
        if q is not None and q.column in run.columns
    )
