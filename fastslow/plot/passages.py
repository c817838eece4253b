"""A trajectory drawn over the equilibria, or the periodic orbits, of its frozen model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.text import Annotation

from fastslow.arguments import among, flag, instance, validated
from fastslow.errors import ArgumentError
from fastslow.plot.arguments import Axis, axis_quantity, figure_width, line_style
from fastslow.plot.branches import DiagramDrawing, draw_branches, over_parameter
from fastslow.plot.drawings import Drawing
from fastslow.plot.insets import Inset, add_inset
from fastslow.plot.layout.arrows import draw_heads, points
from fastslow.plot.layout.labels import place
from fastslow.plot.layout.legends import add_legend
from fastslow.plot.layout.marks import draw_crossings, draw_transitions, draw_turning
from fastslow.plot.layout.style import axes_for, note, spatial
from fastslow.plot.motion_lines import draw_motion, without_growth
from fastslow.plot.orbit_overlays import draw_orbits, draw_strobed
from fastslow.plot.quantities import Array, Quantity, along_overlay, of_diagram
from fastslow.plot.spaces import SpaceDrawing, draw_space
from fastslow.results.base.outcome import early_end
from fastslow.results.overlay.overlay import Overlay

#: Note in the figure of an incomplete overlay, by the code of its outcome.
CAVEATS = {
    "outside the diagram": "the trajectory leaves the range of the diagram",
    "another slow quantity": "another slow quantity is frozen in the diagram",
    "at rest": "the slow quantity is constant",
    "not compared": "diagram and trajectory were not compared",
}

#: Positions of arrow heads, as fractions of the path length of the slow quantity over a period:
#: uneven, so that the heads of rising and falling halves of a harmonic load do not coincide.
ARROWS_OF_PERIOD = (0.08, 0.36, 0.58, 0.86)


@dataclass(frozen=True, eq=False, repr=False)
class OverlayDrawing(Drawing):
    """A drawn overlay.

    Parameters
    ----------
    ax : Axes
    y : str
        Quantity on the vertical axis.
    diagram : DiagramDrawing
        The branches, those of forced orbits as ``cycles``.
    lines : tuple of Line2D
        The trajectory: earlier periods, if there are any, and the last one. Over orbits a thin
        line along branches and in jumps, and a dot for each strobe.
    crossings : Line2D or None
        One dot for each crossing of an interface.
    transitions : tuple of Line2D
        One for each kind of transition.
    turning : Line2D or None
        Turning points of the slow quantity.
    arrows : tuple of Annotation
        Direction of motion, along stable branches and in jumps.
    legend : Legend or None
    x : str
        Quantity on the horizontal axis.
    shown : tuple of Quantity
        Quantities on the axes, the horizontal one first.
    inset : Inset or None
        Delays smaller than their marker, magnified.
    """

    y: str
    diagram: DiagramDrawing
    lines: tuple[Line2D, ...]
    crossings: Line2D | None
    transitions: tuple[Line2D, ...]
    turning: Line2D | None
    arrows: tuple[Annotation, ...]
    legend: Legend | None
    x: str = ""
    shown: tuple[Quantity, ...] = ()
    inset: Inset | None = None

    @property
    def handles(self) -> list[Artist]:
        """Legend entries: branches, special points, trajectory, crossings, transitions, laws."""
        laws = () if self.inset is None else self.inset.laws[:1]
        extra = [line for line in (self.crossings, self.turning) if line is not None]
        lines = [line for line in self.lines[::-1] if not str(line.get_label()).startswith("_")]
        return [*self.diagram.handles, *lines, *extra, *self.transitions, *laws]


@validated(
    overlay=instance(Overlay),
    y=axis_quantity,
    z=axis_quantity,
    x=axis_quantity,
    ax=instance(Axes),
    width=figure_width,
    label=flag,
    legend=flag,
    crossings=flag,
    turning=flag,
    virtual=flag,
    inset=among("auto", None),
    style=line_style,
)
def overlay(
    overlay: Overlay,
    y: Axis | None = None,
    z: Axis | None = None,
    *,
    x: Axis | None = None,
    ax: Axes | None = None,
    width: str | float = "column",
    label: bool = True,
    legend: bool | None = None,
    crossings: bool = True,
    turning: bool = True,
    virtual: bool = True,
    inset: str | None = "auto",
    **style: Any,
) -> OverlayDrawing | SpaceDrawing:
    """Draw a trajectory over the branches of equilibria, or of orbits, of its frozen model.

    Each kind of transition has its own marker, so that a jump at a fold is distinguished from
    a crossing of an interface (a small dot). A bar marks a turning point of the slow quantity.
    Traced cycles of the overlay are drawn by their envelope where an expression is drawn over the
    slow quantity.

    An overlay of orbits is drawn over the slow quantity: ``"x"`` is the state at whole periods of
    the fast forcing, ``"max(x)"`` and ``"min(x)"`` are the envelope of the run and of the orbits.

    Parameters
    ----------
    overlay : Overlay
    y : str, Symbol, Expr or callable, optional
        Quantity on the vertical axis: a state, by default the first, the slow quantity, an
        expression in states and parameters such as ``"x**2 + v"``, or a function of the
        columns.
    z : str, Symbol, Expr or callable, optional
        Quantity on the vertical axis of a view in space.
    x : str, Symbol, Expr or callable, optional
        Quantity on the horizontal axis, by default the slow quantity.
    ax : Axes, optional
        Axes to draw into (with ``projection="3d"`` for a view in space), in which limits set
        by hand are kept; new ones otherwise.
    width : str or float
        Width of a new figure: ``"column"`` (85 mm), ``"page"`` (170 mm), or millimetres.
    label : bool
        Whether to write LP1, BE1, … beside special points and the names of the regions.
    legend : bool, optional
        Whether to draw a legend; by default as ``label``.
    crossings : bool
        Whether to mark the crossings of interfaces.
    turning : bool
        Whether to mark the turning points of the slow quantity.
    virtual : bool
        Whether to draw virtual branches.
    inset : "auto" or None
        Whether to magnify delays smaller than their marker in an inset, with the predicted
        delay drawn in it: the value of a jump, or the path of a gap crossing. The inset is
        omitted if the axes have no free position for it.
    **style
        Properties of the trajectory's line.

    Returns
    -------
    OverlayDrawing
        In space a SpaceDrawing.

    Raises
    ------
    UnknownNameError
        For a name in ``x``, ``y`` or ``z`` that is no state, slow quantity or parameter.
    ArgumentError
        For an invalid expression, a view in space with axes of the plane, or ``x`` or ``z`` of
        an overlay of orbits.

    See Also
    --------
    fastslow.overlay, fastslow.plot.panel, fastslow.plot.diagram

    Examples
    --------
    >>> import fastslow as fs
    >>> gear = fs.systems.harmonic_gear()
    >>> diagram = fs.continue_equilibria(gear.frozen(), "w", over=(-2, 6))
    >>> overlay = fs.overlay(diagram, fs.simulate(gear, [0, 0], periods=2))
    >>> drawn = fs.plot.overlay(overlay, "v", linewidth=0.5)
    >>> drawn.x, drawn.y, len(drawn.crossings.get_xdata()) == len(overlay.run.crossings)
    ('w', 'v', True)
    """
    own = ax is None
    if overlay.branches:
        if x is not None or z is not None or callable(y):
            raise ArgumentError(
                "an overlay of orbits is drawn over the slow quantity; expected a column as y, "
                "such as 'x' or 'max(x)', without x or z"
            )
        ax = axes_for(ax, width, height=78.0)
        drawn = _over_orbits(ax, overlay, overlay.states[0] if y is None else str(y), label, style)
        return _finished(ax, drawn, own, label, legend)
    diagram = overlay.diagram
    across, up = (
        of_diagram(diagram, x, diagram.parameter),
        of_diagram(diagram, y, diagram.states[0]),
    )
    if spatial("overlay", ax, z):
        third = next((s for s in diagram.states if s not in (across.text, up.text)), up.text)
        shown = across, up, of_diagram(diagram, z, third)
        return draw_space(
            diagram,
            shown,
            ax,
            width,
            label,
            legend,
            virtual=virtual,
            overlay=overlay,
            crossings=crossings,
            turning=turning,
            style=style,
        )
    ax = axes_for(ax, width, height=78.0)
    drawn = draw_magnified(
        ax,
        overlay,
        (across, up),
        inset=inset,
        label=label,
        crossings=crossings,
        turning=turning,
        virtual=virtual,
        **style,
    )
    return _finished(ax, drawn, own, label, legend)


def _finished(
    ax: Axes, drawn: OverlayDrawing, own: bool, label: bool, legend: bool | None
) -> OverlayDrawing:
    """Add the legend and place the labels."""
    drawn = replace(drawn, legend=add_legend(ax, drawn.handles, own, label, legend))
    shown = [text for text in drawn.diagram.texts if text.get_visible()]
    place(ax, shown, [], [drawn.diagram.bands])
    return drawn


def _over_orbits(
    ax: Axes, overlay: Overlay, text: str, label: bool, style: Mapping[str, Any]
) -> OverlayDrawing:
    """Draw an overlay of orbits without legend and without placing its labels."""
    below = draw_orbits(ax, overlay, text, label)
    lines, transitions = draw_strobed(ax, overlay, text, style)
    note(ax, caveat(overlay))
    return OverlayDrawing(
        ax=ax,
        y=text,
        diagram=below,
        lines=lines,
        crossings=None,
        transitions=transitions,
        turning=None,
        arrows=(),
        legend=None,
        x=overlay.parameter,
    )


def draw_magnified(
    ax: Axes,
    overlay: Overlay,
    shown: tuple[Quantity, Quantity],
    *,
    inset: str | None,
    label: bool,
    **look: Any,
) -> OverlayDrawing:
    """Draw an overlay as `draw_passage` does, and its inset."""
    drawn = draw_passage(ax, overlay, shown, label=label, **look)
    note(ax, caveat(overlay))
    if inset is None:
        return drawn

    def draw(within: Axes) -> None:
        draw_passage(within, overlay, shown, label=False, **look)

    return replace(drawn, inset=add_inset(ax, overlay, shown, draw))


def draw_passage(
    ax: Axes,
    overlay: Overlay,
    shown: tuple[Quantity, Quantity],
    *,
    label: bool = True,
    crossings: bool = True,
    turning: bool = True,
    virtual: bool = True,
    **style: Any,
) -> OverlayDrawing:
    """Draw an overlay without legend and without placing its labels; arguments as for `overlay`."""
    across, up = along_overlay(overlay, *shown)
    with without_growth(ax, overlay.run, overlay.t, (across, up)):
        lines = draw_motion(ax, overlay.t, (across, up), shown, overlay.run, style)
        dots = draw_crossings(ax, overlay, shown) if crossings else None
        changes = draw_transitions(ax, overlay, shown)
        turns = draw_turning(ax, overlay, shown) if turning else None
    # after the trajectory, so that the bands extend to its limits
    cycles = overlay.cycles if over_parameter(overlay.diagram, shown) else ()
    below = draw_branches(
        *(ax, overlay.diagram, shown),
        label=label,
        virtual=virtual,
        interfaces=True,
        cycles=cycles,
    )
    for line in below.lines:
        if line.get_label() == "stable":
            # wide enough to remain visible under a trajectory that follows it
            line.set_linewidth(2.2)
        elif any(phase.type == "oscillating" for phase in overlay.phases):
            # otherwise hidden by oscillations
            line.set_zorder(3.5)
    for line in (line for part in below.cycles for line in part.lines):
        line.set_zorder(3.5)
    # rows of the line without those at which it is interrupted
    kept = np.flatnonzero(np.isfinite(points(lines[-1])).all(axis=1))
    # a line broken at a period has more points than the samples
    round_ = any(q.column in overlay.run.periods for q in shown)
    last = overlay.slow[len(overlay) - len(kept) :]
    rows = [] if round_ else kept[_arrow_rows(overlay, up, last)].tolist()
    heads = draw_heads(lines[-1], rows) if rows else ()
    text = shown[1].text
    return OverlayDrawing(
        ax=ax,
        y=text,
        diagram=below,
        lines=lines,
        crossings=dots,
        transitions=changes,
        turning=turns,
        arrows=heads,
        legend=None,
        x=shown[0].text,
        shown=shown,
    )


def caveat(overlay: Overlay) -> str:
    """Return the note of an incomplete overlay, or an empty text."""
    ended = early_end(overlay.run.outcome)
    if ended:
        return f"run ended early: {ended}"
    return "" if overlay.outcome else CAVEATS.get(overlay.outcome.code, overlay.outcome.code)


def _arrow_rows(overlay: Overlay, values: Array, drawn: Array) -> list[int]:
    """Return rows of arrow heads in the last period: along branches, and midway in jumps.

    Parameters
    ----------
    overlay : Overlay
    values : ndarray, shape (N,)
        Quantity on the vertical axis.
    drawn : ndarray, shape (M,)
        The slow quantity of the last period, the last M samples.
    """
    travel = np.r_[0.0, np.cumsum(np.abs(np.diff(drawn)))]
    rows = (
        np.searchsorted(travel, np.array(ARROWS_OF_PERIOD) * travel[-1]).tolist()
        if travel[-1]
        else []
    )
    earlier = len(overlay.t) - len(drawn)
    for t in overlay.transitions:
        if t.land is None or t.type in ("crossing", "end of oscillation"):
            continue
        start, stop = np.searchsorted(overlay.t, (t.leave.time, t.land.time)) - earlier
        inside = values[earlier:][max(start, 0) : max(stop, 0)]
        if start >= 0 and len(inside) > 2:
            middle = 0.5 * (inside[0] + inside[-1])
            rows = [row for row in rows if not start <= row <= stop]
            rows.append(int(start) + int(np.argmin(np.abs(inside - middle))))
    return rows
