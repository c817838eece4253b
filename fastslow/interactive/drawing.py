"""Drawing of a view: time series, phase portrait and overlay."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.artist import Artist
from matplotlib.axes import Axes

from fastslow.interactive.picking import PickCurve, curves_of, run_curve
from fastslow.interactive.views import View
from fastslow.plot.branches import DiagramDrawing, draw_branches
from fastslow.plot.layout.labels import place
from fastslow.plot.layout.style import GREY, MOTION, TEXT, note
from fastslow.plot.layout.typesetting import paragraph, typeset
from fastslow.plot.motion_lines import draw_motion
from fastslow.plot.motions import phase_portrait, time_series
from fastslow.plot.passages import caveat, draw_passage
from fastslow.plot.quantities import Quantity, along_run

#: Offset of the label of a special point, in points (1/72 inch).
LABEL_OFFSET = (13.0, 7.0)


def draw_view(axes: Sequence[Axes], view: View) -> tuple[tuple[PickCurve, ...], list[Artist]]:
    """Draw a view into three empty axes.

    Returns
    -------
    tuple of PickCurve
        Curves that can be picked.
    list of Artist
        Legend entries.
    """
    series, portrait, main = axes
    name, run, overlay = view.setup.y, view.run, view.overlay
    values: Mapping[str, Any] = {} if view.diagram is None else view.diagram.interface_values
    curves: list[PickCurve] = []
    handles: list[Any] = []
    below: DiagramDrawing | None = None
    if overlay is not None:
        laid = draw_passage(main, overlay, (Quantity(overlay.parameter), Quantity(name)))
        note(main, caveat(overlay))
        handles, below = laid.handles, laid.diagram
        curves += curves_of(laid, overlay)
    elif view.diagram is not None:
        shown = Quantity(view.diagram.parameter), Quantity(name)
        below = draw_branches(main, view.diagram, shown, label=True, virtual=True, interfaces=True)
        handles = [*below.handles]
        curves += curves_of(below, view.diagram)
        slow = view.diagram.parameter
        if run is not None and slow in run.columns:
            shown = Quantity(slow), Quantity(name)
            handles += draw_motion(main, run.t, along_run(run, *shown), shown, run, {})
            curves.append(run_curve(main, run, *shown))
        handles += _mark_value(main, view)
    else:
        _empty(main, "no diagram")
    if run is not None:
        phases = () if overlay is None else overlay.phases
        over_time = time_series(
            run, name, ax=series, interface_values=values, phases=phases, legend=False
        )
        curves += curves_of(over_time, run)
        if len(run.columns) > 1:
            other = None if len(run.states) == 1 else _other(run.states, name)
            plane = phase_portrait(
                run,
                None if other is None else name,
                other,
                ax=portrait,
                interface_values=values,
                legend=False,
            )
            curves += curves_of(plane, run)
        else:
            portrait.set_axis_off()
    else:
        _empty(series, "no trajectory")
        _empty(portrait, "no trajectory")
    if below is not None:
        place(main, bands=[below.bands])
        for label in below.labels:
            # placing them without overlap would double the time
            label.set_position(LABEL_OFFSET)
    return tuple(curves), handles


def _other(states: tuple[str, ...], name: str) -> str:
    return next(s for s in states if s != name)


def _empty(ax: Axes, words: str) -> None:
    ax.set_axis_off()
    ax.text(
        0.5,
        0.5,
        paragraph(words),
        transform=ax.transAxes,
        ha="center",
        va="center",
        fontsize=TEXT,
        color=GREY,
    )


def _mark_value(ax: Axes, view: View) -> list[Any]:
    """Mark the value of the diagram's parameter in the run."""
    assert view.diagram is not None
    name = view.diagram.parameter
    value = view.model.parameters.get(name)
    if value is None:
        return []
    label = f"{typeset(name)} of the run"
    return [ax.axvline(value, color=MOTION, linewidth=0.8, zorder=1.8, label=label)]
