"""A view drawn into a figure: time series, phase portrait and overlay."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Annotation

from fastslow.interactive.picking import Curve, curves_of, run_curve
from fastslow.interactive.views import View
from fastslow.plot.branches import draw_branches
from fastslow.plot.motions import draw_motion, phase_portrait, time_series
from fastslow.plot.passages import draw_passage
from fastslow.plot.quantities import Quantity, along_run
from fastslow.plot.style import GREY, MOTION, SMALL, TEXT, VERMILION, dressed
from fastslow.plot.typesetting import paragraph, plain, typeset

#: Size of a figure of our own, in inches, and places of its axes in it.
SIZE = (9.0, 5.0)
PLACES = ((0.065, 0.6, 0.36, 0.34), (0.065, 0.115, 0.36, 0.34), (0.5, 0.235, 0.485, 0.705))

#: Where the label of a special point stands, in points from it.
BESIDE = (13.0, 7.0)


def own_figure() -> Figure:
    """A figure of our own, outside pyplot."""
    figure = Figure(figsize=SIZE, dpi=100)
    FigureCanvasAgg(figure)
    return figure


def draw_view(figure: Figure, view: View) -> tuple[Curve, ...]:
    """Draw a view in place of what the figure shows.

    Returns
    -------
    tuple of Curve
        What can be picked.
    """
    figure.clear()
    name, run, lay = view.setup.state, view.run, view.overlay
    values: Mapping[str, Any] = {} if view.diagram is None else view.diagram.interface_values
    curves: list[Curve] = []
    series, portrait, main = (dressed(figure.add_axes(place)) for place in PLACES)
    handles: list[Any] = []
    labels: tuple[Annotation, ...] = ()
    if lay is not None:
        laid = draw_passage(main, lay, (Quantity(lay.parameter), Quantity(name)))
        handles, labels = laid.handles, laid.diagram.labels
        curves += curves_of(laid, lay)
    elif view.diagram is not None:
        shown = Quantity(view.diagram.parameter), Quantity(name)
        below = draw_branches(main, view.diagram, shown, label=True, virtual=True, interfaces=True)
        handles, labels = [*below.handles], below.labels
        curves += curves_of(below, view.diagram)
        slow = view.diagram.parameter
        if run is not None and slow in run.columns:
            axes = Quantity(slow), Quantity(name)
            handles += draw_motion(main, run.t, along_run(run, *axes), axes, run, MOTION, {})
            curves.append(run_curve(main, run, Quantity(slow), Quantity(name)))
        handles += _mark_value(main, view)
    else:
        _empty(main, "no diagram")
    if run is not None:
        phases = () if lay is None else lay.phases
        over_time = time_series(
            run, name, ax=series, interfaces=values, phases=phases, legend=False
        )
        curves += curves_of(over_time, run)
        if len(run.columns) > 1:
            other = None if len(run.states) == 1 else _other(run.states, name)
            plane = phase_portrait(
                run,
                None if other is None else name,
                other,
                ax=portrait,
                interfaces=values,
                legend=False,
            )
            curves += curves_of(plane, run)
        else:
            portrait.set_axis_off()
    else:
        _empty(series, "no trajectory")
        _empty(portrait, "no trajectory")
    for label in labels:
        # to place them freely would take as long as all the rest
        label.set_position(BESIDE)
    if handles:
        figure.legend(
            handles=handles,
            loc="lower center",
            bbox_to_anchor=(0.74, 0.05),
            ncols=4,
            fontsize=SMALL,
            frameon=False,
            columnspacing=1.0,
            handlelength=1.8,
        )
    words = "  ".join(str(outcome) for outcome in view.outcomes)
    figure.text(0.01, 0.012, plain(words), fontsize=SMALL, color=VERMILION, wrap=True)
    return tuple(curves)


def _other(states: tuple[str, ...], name: str) -> str:
    return next(s for s in states if s != name)


def _empty(ax: Axes, words: str) -> None:
    ax.set_axis_off()
    ax.text(
        0.5,
        0.5,
        paragraph(words),
        ha="center",
        va="center",
        fontsize=TEXT,
        color=GREY,
    )


def _mark_value(ax: Axes, view: View) -> list[Any]:
    """Where the run stands on a diagram over a parameter of its own."""
    assert view.diagram is not None
    name = view.diagram.parameter
    value = view.model.parameters.get(name)
    if value is None:
        return []
    label = f"{typeset(name)} of the run"
    return [ax.axvline(value, color=MOTION, linewidth=0.8, zorder=1.8, label=label)]
