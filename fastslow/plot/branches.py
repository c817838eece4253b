"""Bifurcation diagrams of equilibria: branches by stability, with special points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.text import Annotation

from fastslow.arguments import flag, instance, validated
from fastslow.errors import ArgumentError
from fastslow.plot.arguments import Axis, axis_quantity, figure_width, line_style
from fastslow.plot.branch_lines import draw_points, marked_points, runs
from fastslow.plot.drawings import Drawing
from fastslow.plot.equilibrium_sets import draw_sets
from fastslow.plot.layout.bands import Bands, draw_bands
from fastslow.plot.layout.interfaces import draw_interfaces
from fastslow.plot.layout.labels import place
from fastslow.plot.layout.legends import add_legend, each_once
from fastslow.plot.layout.style import BRANCH, EQUILIBRIA, axes_for, spatial, widen_limits
from fastslow.plot.quantities import Quantity, along_branch, joined, of_diagram
from fastslow.plot.responses import ResponseDrawing, draw_envelopes
from fastslow.plot.spaces import SpaceDrawing, draw_space
from fastslow.results.branch.branch import Branch
from fastslow.results.branch.diagram import Diagram
from fastslow.results.branch.windows import LEFT
from fastslow.results.orbits.orbit_branch import OrbitBranch, branches_of_orbits


@dataclass(frozen=True, eq=False, repr=False)
class DiagramDrawing(Drawing):
    """A drawn bifurcation diagram of equilibria.

    Parameters
    ----------
    ax : Axes
    y : str
        Quantity on the vertical axis.
    lines : tuple of Line2D
        One for each interval of constant stability.
    markers : tuple of Line2D
        One for each code of special points.
    labels : tuple of Annotation
        LP1, BE1, … beside the points.
    bands : Bands
        Interfaces and regions.
    legend : Legend or None
    x : str
        Quantity on the horizontal axis.
    shown : tuple of Quantity
        Quantities on the axes, the horizontal one first.
    sets : tuple of Artist
        Equilibrium sets within discontinuities: filled bands and their edges.
    cycles : tuple of ResponseDrawing
        Upper and lower envelope of each branch of cycles.
    """

    y: str
    lines: tuple[Line2D, ...]
    markers: tuple[Line2D, ...]
    labels: tuple[Annotation, ...]
    bands: Bands
    legend: Legend | None
    x: str = ""
    shown: tuple[Quantity, ...] = ()
    sets: tuple[Artist, ...] = ()
    cycles: tuple[ResponseDrawing, ...] = ()

    @property
    def handles(self) -> list[Artist]:
        """Legend entries: each stability, kind of equilibrium set and code once."""
        shown = {str(line.get_label()): line for line in self.lines}
        sets = {str(one.get_label()): one for one in self.sets}
        named = [one for label, one in sets.items() if not label.startswith("_")]
        lines = [shown[kind] for kind in EQUILIBRIA if kind in shown]
        # cycles end at points that equilibria have as well
        cycles = (one for part in self.cycles for one in part.handles)
        return [*lines, *named, *each_once((*self.markers, *cycles))]

    @property
    def texts(self) -> tuple[Annotation, ...]:
        """Labels of all special points, those of cycles included."""
        return (*self.labels, *(text for part in self.cycles for text in part.labels))


@validated(
    diagram=instance(Diagram),
    y=axis_quantity,
    z=axis_quantity,
    x=axis_quantity,
    ax=instance(Axes),
    width=figure_width,
    label=flag,
    legend=flag,
    virtual=flag,
    interfaces=flag,
    cycles=branches_of_orbits,
    style=line_style,
)
def diagram(
    diagram: Diagram,
    y: Axis | None = None,
    z: Axis | None = None,
    *,
    x: Axis | None = None,
    ax: Axes | None = None,
    width: str | float = "column",
    label: bool = True,
    legend: bool | None = None,
    virtual: bool = True,
    interfaces: bool = True,
    cycles: OrbitBranch | Sequence[OrbitBranch] = (),
    **style: Any,
) -> DiagramDrawing | SpaceDrawing:
    """Draw the branches of equilibria over their parameter.

    Stable branches are solid, unstable ones dashed, neutral ones dash-dotted (a continuum of
    equilibria, such as a gap), virtual ones dotted and faint; pseudo-equilibria, of a sliding
    motion, are double lines. A set of equilibria within a discontinuity, such as the sticking
    states of a block under dry friction, is filled between its edges.

    Parameters
    ----------
    diagram : Diagram
    y : str, Symbol, Expr or callable, optional
        Quantity on the vertical axis: a state, by default the first, the parameter, an
        expression in states and parameters, or a function of the columns.
    z : str, Symbol, Expr or callable, optional
        Quantity on the vertical axis of a view in space.
    x : str, Symbol, Expr or callable, optional
        Quantity on the horizontal axis, by default the parameter.
    ax : Axes, optional
        Axes to draw into (with ``projection="3d"`` for a view in space), in which limits set
        by hand are kept; new ones otherwise.
    width : str or float
        Width of a new figure: ``"column"`` (85 mm), ``"page"`` (170 mm), or millimetres.
    label : bool
        Whether to write LP1, BE1, … beside special points and the names of the regions.
    legend : bool, optional
        Whether to draw a legend; by default as ``label``.
    virtual : bool
        Whether to draw virtual branches.
    interfaces : bool
        Whether to draw interfaces and regions.
    cycles : OrbitBranch or sequence of OrbitBranch, optional
        Cycles from `fastslow.continue_cycles`, drawn by their envelope: maximum and minimum of
        the quantity on the vertical axis, which is a name or an expression, over the parameter.
    **style
        Properties of every branch line, overriding those of its stability.

    Returns
    -------
    DiagramDrawing
        In space a SpaceDrawing.

    Raises
    ------
    UnknownNameError
        For a name that is neither a state nor a parameter; for an expression that contains
        neither a state nor the parameter of the diagram.
    ArgumentError
        For an invalid expression, or a view in space with axes of the plane; for ``cycles`` with
        other axes.

    See Also
    --------
    fastslow.continue_equilibria, fastslow.plot.overlay, fastslow.plot.response

    Examples
    --------
    >>> import fastslow as fs
    >>> model = fs.systems.van_der_pol()
    >>> found = fs.continue_equilibria(model.frozen(), "w", over=(-2, 2))
    >>> drawn = fs.plot.diagram(found, "x**2 + v", width="page", legend=False)
    >>> drawn.ax.get_ylabel(), [text.get_text() for text in drawn.labels]
    ('$x^{2} + v$', ['HB1', 'HB2'])
    >>> sorted(drawn.data)
    ['HB Hopf', 'stable', 'unstable']
    >>> def energy(columns):
    ...     return columns["x"] ** 2 / 2
    >>> fs.plot.diagram(found, energy, x="v").ax.get_ylabel()
    'energy'
    """
    across, up = (
        of_diagram(diagram, x, diagram.parameter),
        of_diagram(diagram, y, diagram.states[0]),
    )
    in_space = spatial("diagram", ax, z)
    if cycles and (in_space or not over_parameter(diagram, (across, up))):
        raise ArgumentError(
            f"cycles are drawn over {diagram.parameter}, as the maximum and minimum of a name or "
            "an expression; expected no x or z, and no function as y"
        )
    if in_space:
        third = next((s for s in diagram.states if s not in (across.text, up.text)), up.text)
        shown = across, up, of_diagram(diagram, z, third)
        return draw_space(diagram, shown, ax, width, label, legend, virtual=virtual, style=style)
    own, ax = ax is None, axes_for(ax, width)
    drawn = draw_branches(
        ax,
        diagram,
        (across, up),
        label=label,
        virtual=virtual,
        interfaces=interfaces,
        cycles=tuple(cycles),
        **style,
    )
    drawn = replace(drawn, legend=add_legend(ax, drawn.handles, own, label, legend))
    place(ax, drawn.texts, [], [drawn.bands])
    return drawn


def draw_branches(
    ax: Axes,
    diagram: Diagram,
    shown: tuple[Quantity, Quantity],
    *,
    label: bool,
    virtual: bool,
    interfaces: bool,
    cycles: Sequence[Any] = (),
    **style: Any,
) -> DiagramDrawing:
    """Draw a diagram without legend and without placing its labels; arguments as for `diagram`."""
    envelopes = draw_envelopes(ax, cycles, shown[1].text, label)
    lines: list[Line2D] = []
    branches = [b for b in diagram.branches if b.admissible or virtual]
    for branch in branches:
        x, y = along_branch(diagram, branch, *shown)
        for kind, rows in runs(branch):
            look = {"color": BRANCH, "zorder": 2.0, "label": kind, **EQUILIBRIA[kind], **style}
            line = joined([x[rows], y[rows]], shown, branch.periods)
            if diagram.window is None or not _goes_to_infinity(branch):
                lines += ax.plot(*line, **look)
                continue
            # drawn whole, but the axes are not scaled to distant points
            near = diagram.window.near(branch.state[rows])
            lines.append(Line2D(*line, **look))
            ax.add_artist(lines[-1])
            ax.update_datalim(np.column_stack([x[rows], y[rows]])[near])
            ax.autoscale_view()
    sets = draw_sets(ax, diagram, shown, style.get("color", BRANCH))
    markers, labels = draw_points(ax, marked_points(branches), shown, label)
    widen_limits(ax)
    across, up = shown
    ax.set_xlabel(across.label)
    ax.set_ylabel(up.label)
    if across.column == diagram.parameter and ax.get_autoscalex_on():
        ax.set_xlim(diagram.over, auto=None)
    if up.column == diagram.parameter and ax.get_autoscaley_on():
        ax.set_ylim(diagram.over, auto=None)
    bands = Bands()
    if interfaces:
        named = [name for name in diagram.interfaces if name not in diagram.interface_values]
        draw_interfaces(ax, named, [q.column for q in shown], diagram.parameters)
    admissible = [b for b in diagram.branches if b.admissible]
    levelled = {state for state, *_ in diagram.interface_values.values()}
    for quantity, vertical in ((across, True), (up, False)):
        if interfaces and (admissible or diagram.bands) and quantity.column in levelled:
            heights = np.concatenate([np.empty(0), *(b[quantity.column] for b in admissible)])
            regions = np.concatenate([np.empty(0, dtype=str), *(b.region for b in admissible)])
            values = diagram.interface_values
            bands = draw_bands(
                ax, quantity.column, values, heights, regions, vertical=vertical, label=label
            )
    return DiagramDrawing(
        *(ax, up.text, tuple(lines), markers, labels, bands, None, across.text, shown, sets),
        envelopes,
    )


def over_parameter(diagram: Diagram, shown: tuple[Quantity, Quantity]) -> bool:
    """Check whether envelopes of cycles can be drawn: over the parameter, of an expression."""
    return shown[0].column == diagram.parameter and shown[1].column != ""


def _goes_to_infinity(branch: Branch) -> bool:
    """Return whether an end of a branch is on a default bound of the window."""
    return any(o.code == LEFT and not o.success for o in branch.outcomes)
