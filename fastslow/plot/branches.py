"""The equilibrium diagram: branches by stability, with their special points."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.text import Annotation

from fastslow.arguments import flag, formula, instance, takes
from fastslow.plot.arguments import line_colour, line_style
from fastslow.plot.bands import Bands, draw_bands
from fastslow.plot.heights import along, at_point, expression_of, written
from fastslow.plot.labels import key, place, settle, tag
from fastslow.plot.style import BRANCH, LINES, MARKERS, Drawing, axes_for, typeset
from fastslow.results.branches import Branch
from fastslow.results.diagrams import Diagram
from fastslow.results.points import CODE_NAMES


@dataclass(frozen=True, eq=False)
class DiagramDrawing(Drawing):
    """A drawn equilibrium diagram.

    Parameters
    ----------
    ax : Axes
    state : str
        What the vertical axis shows.
    lines : tuple of Line2D
        One for each run of constant stability.
    markers : tuple of Line2D
        One for each code of special points.
    labels : tuple of Annotation
        LP1, BE1, … beside the points.
    bands : Bands
        Interfaces and regions.
    legend : Legend or None
    """

    state: str
    lines: tuple[Line2D, ...]
    markers: tuple[Line2D, ...]
    labels: tuple[Annotation, ...]
    bands: Bands
    legend: Legend | None

    @property
    def handles(self) -> list[Artist]:
        """What a legend shows: each stability and each code once."""
        shown = {str(line.get_label()): line for line in self.lines}
        return [*(shown[kind] for kind in LINES if kind in shown), *self.markers]


@takes(
    diagram=instance(Diagram),
    x=formula,
    ax=instance(Axes),
    label=flag,
    legend=flag,
    virtual=flag,
    interfaces=flag,
    color=line_colour,
    style=line_style,
)
def diagram(
    diagram: Diagram,
    x: object = None,
    *,
    ax: Axes | None = None,
    label: bool = True,
    legend: bool = True,
    virtual: bool = True,
    interfaces: bool = True,
    color: str = BRANCH,
    **style: Any,
) -> DiagramDrawing:
    """Draw the branches of equilibria over their parameter.

    Stable branches are solid, unstable ones dashed, neutral ones dash-dotted
    (a continuum of equilibria, such as a gap), virtual ones dotted and faint.

    Parameters
    ----------
    diagram : Diagram
    x : str, Symbol or Expr, optional
        What the vertical axis shows: a state, by default the first, or an expression
        in states and parameters.
    ax : Axes, optional
        Axes to draw into; new ones of a column's width (85 mm) otherwise.
    label : bool
        Whether to write LP1, BE1, … beside special points.
    legend : bool
        Whether to draw a legend.
    virtual : bool
        Whether to draw virtual branches.
    interfaces : bool
        Whether to draw interfaces and regions.
    color : str
        Colour of the branches.
    **style
        Properties of every branch line, over those of its stability.

    Returns
    -------
    DiagramDrawing

    Raises
    ------
    UnknownNameError
        If ``x`` is no state of the diagram and no expression in them.
    """
    state = expression_of(diagram, x)
    own, ax = ax is None, axes_for(ax)
    drawn = draw_branches(
        ax,
        diagram,
        state,
        label=label,
        virtual=virtual,
        interfaces=interfaces,
        color=color,
        **style,
    )
    if legend and drawn.handles:
        drawn = replace(drawn, legend=key(ax, drawn.handles, own))
    settle(ax)
    place(ax, drawn.labels, [] if drawn.legend is None else [drawn.legend], [drawn.bands])
    return drawn


def draw_branches(
    ax: Axes,
    diagram: Diagram,
    state: str,
    *,
    label: bool,
    virtual: bool,
    interfaces: bool,
    color: str = BRANCH,
    **style: Any,
) -> DiagramDrawing:
    """Draw a diagram without a legend, its labels not placed yet; arguments as for `diagram`."""
    lines: list[Line2D] = []
    for branch in diagram.branches:
        if branch.admissible or virtual:
            heights = along(diagram, branch, state)
            for kind, rows in runs(branch):
                look = {"color": color, "zorder": 2.0, "label": kind, **LINES[kind], **style}
                lines += ax.plot(branch.parameter[rows], heights[rows], **look)
    markers, labels = _special_points(ax, diagram, state, virtual, label)
    ax.set_xlabel(typeset(diagram.parameter))
    ax.set_ylabel(written(state))
    ax.set_xlim(diagram.over)
    bands = Bands()
    met = [b for b in diagram.branches if b.admissible]
    if interfaces and met and state in diagram.states:
        heights = np.concatenate([along(diagram, b, state) for b in met])
        regions = np.concatenate([b.region for b in met])
        bands = draw_bands(ax, state, diagram.interface_values, heights, regions)
    return DiagramDrawing(ax, state, tuple(lines), markers, labels, bands, None)


def runs(branch: Branch) -> Iterator[tuple[str, slice]]:
    """Runs of constant stability, as (kind, rows); neighbours share their joint row."""
    if not branch.admissible:
        yield "virtual", slice(0, len(branch))
        return
    kinds = branch.stability
    # a step beside a single neutral row (a fold, a Hopf point) has the stability of its other end
    steps = np.where(kinds[:-1] == "neutral", kinds[1:], kinds[:-1])
    breaks = np.flatnonzero(steps[1:] != steps[:-1]) + 1
    for start, stop in zip([0, *breaks], [*breaks, len(steps)], strict=True):
        if stop > start:
            yield str(steps[start]), slice(int(start), int(stop) + 1)


def _special_points(
    ax: Axes, diagram: Diagram, state: str, virtual: bool, label: bool
) -> tuple[tuple[Line2D, ...], tuple[Annotation, ...]]:
    markers: list[Line2D] = []
    labels: list[Annotation] = []
    branches = [b for b in diagram.branches if b.admissible or virtual]
    for code in CODE_NAMES:
        points = [p for b in branches for p in _shown(b) if p.code == code]
        if not points:
            continue
        marker, colour = MARKERS[code]
        at = [(p[diagram.parameter], at_point(p, state)) for p in points]
        markers += ax.plot(
            *zip(*at, strict=True),
            linestyle="none",
            marker=marker,
            markersize=4.5,
            markerfacecolor=colour,
            markeredgecolor=colour if marker in "x|" else "white",
            markeredgewidth=0.9 if marker in "x|" else 0.5,
            zorder=5,
            label=f"{code} {CODE_NAMES[code]}",
        )
        if label:
            words = [p.note or p.label if code == "EP" else p.label for p in points]
            labels += [tag(ax, word, spot) for word, spot in zip(words, at, strict=True)]
    return tuple(markers), tuple(labels)


def _shown(branch: Branch) -> list[Any]:
    """Special points worth a marker: an end point only where the tracing could not go on."""
    ends = {0: branch.outcomes[0].success, len(branch) - 1: branch.outcomes[1].success}
    return [
        p
        for p, row in zip(branch.special, branch.special_rows, strict=True)
        if p.code != "EP" or not ends.get(row, True)
    ]
