"""A trajectory drawn over branches of periodic orbits of its frozen model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.legend import Legend
from matplotlib.lines import Line2D

from fastslow.plot.branch_lines import stability_runs
from fastslow.plot.drawings import Drawing
from fastslow.plot.layout.labels import place
from fastslow.plot.layout.legends import add_legend, each_once
from fastslow.plot.layout.marks import LEAVING, draw_kind
from fastslow.plot.layout.style import BRANCH, LINES, MOTION, TRANSITIONS, axes_for
from fastslow.plot.quantities import Array
from fastslow.plot.responses import ResponseDrawing, draw_response
from fastslow.results.orbits.orbit_branch import OrbitBranch
from fastslow.results.overlay.orbit_overlay import OrbitOverlay

#: Legend texts of transitions between orbits that differ from those between equilibria.
TEXTS = {
    "crossing": "passage through a contact",
    "branch point": "delayed exit past BPC",
    "grazing": "departure at a contact",
}


#: Phases in which successive strobes are joined by a line.
JOINED = ("quasi-static", "jump", "excursion")


@dataclass(frozen=True, eq=False, repr=False)
class OrbitOverlayDrawing(Drawing):
    """A drawn overlay of orbits.

    Parameters
    ----------
    ax : Axes
    y : str
        Quantity on the vertical axis.
    branches : tuple of ResponseDrawing
    repeats : tuple of Line2D
        States of orbits of several periods of the forcing at its other periods.
    lines : tuple of Line2D
        The trajectory: a dot for each strobe, and a thin line along branches and in jumps.
    transitions : tuple of Line2D
        One for each kind of transition.
    legend : Legend or None
    """

    y: str
    branches: tuple[ResponseDrawing, ...]
    repeats: tuple[Line2D, ...]
    lines: tuple[Line2D, ...]
    transitions: tuple[Line2D, ...]
    legend: Legend | None = None

    @property
    def handles(self) -> list[Artist]:
        """Legend entries: orbits and special points once each, trajectory, transitions."""
        shown = each_once(artist for branch in self.branches for artist in branch.handles)
        return [*shown, self.lines[0], *self.transitions]


def draw_strobed(
    overlay: OrbitOverlay,
    y: Any,
    ax: Axes | None,
    width: str | float,
    shown: tuple[bool, bool | None],
    **style: Any,
) -> OrbitOverlayDrawing:
    """Draw an overlay of orbits.

    Parameters
    ----------
    overlay : OrbitOverlay
    y : str, Symbol or Expr, optional
        Column of the overlay and of the branches; by default the first state.
    ax, width
        As of `fastslow.plot.overlay`.
    shown : tuple of bool
        Whether to draw labels and a legend.
    **style
        Properties of the trajectory's line.
    """
    label, legend = shown
    text = overlay.states[0] if y is None else str(y)
    values = overlay[text]
    own, ax = ax is None, axes_for(ax, width, height=78.0)
    branches = tuple(draw_response(ax, b, text, label=label) for b in overlay.branches)
    repeats = [line for one in overlay.branches for line in _other_phases(ax, one, text)]
    for line in (*(line for drawn in branches for line in drawn.lines), *repeats):
        if line.get_label() == "stable":
            # wide enough to remain visible under a trajectory that follows it
            line.set_linewidth(2.2)
    lines = _draw_strobes(ax, overlay, values, style)
    marks: list[Line2D] = []
    for kind in TRANSITIONS:
        found = [t for t in overlay.transitions if t.type == kind]
        rows = np.searchsorted(overlay.t, [(t.leave if kind in LEAVING else t).time for t in found])
        rows = np.minimum(rows, len(overlay) - 1)
        if found:
            marks += draw_kind(ax, kind, [overlay.slow[rows], values[rows]], TEXTS.get(kind, ""))
    drawing = OrbitOverlayDrawing(ax, text, branches, tuple(repeats), lines, tuple(marks))
    drawing = replace(drawing, legend=add_legend(ax, drawing.handles, own, label, legend))
    # a branch of doubled orbits begins at the point that the other branch has
    tags = {(tag.get_text(), *np.round(tag.xy, 6)): tag for one in branches for tag in one.labels}
    for tag in (tag for one in branches for tag in one.labels):
        tag.set_visible(tag in tags.values())
    place(ax, list(tags.values()))
    return drawing


def _draw_strobes(
    ax: Axes, overlay: OrbitOverlay, values: Array, style: Mapping[str, Any]
) -> tuple[Line2D, ...]:
    """Draw the strobes as dots, joined where they follow orbits that repeat after one period."""
    look = {"color": MOTION, "zorder": 3.0, **style}
    dots = {"marker": ".", "markersize": 2.0, **look, "linestyle": "none", "label": "trajectory"}
    drawn: list[Line2D] = ax.plot(overlay.slow, values, **dots)
    joined = np.isin(overlay["phase"], JOINED)
    if not joined.any() or any(branch.multiple != 1 for branch in overlay.branches):
        return tuple(drawn)
    # no line across strobes that are left out
    gaps = np.flatnonzero(np.diff(overlay.t) > 1.5 * overlay.period) + 1
    places = [
        np.insert(np.where(joined, column, np.nan), gaps, np.nan)
        for column in (overlay.slow, values)
    ]
    return (*drawn, *ax.plot(*places, **{"linewidth": 0.6, **look, "marker": "none"}))


def _other_phases(ax: Axes, branch: OrbitBranch, name: str) -> list[Line2D]:
    """Draw a state of orbits of m periods of the forcing after 1 to m − 1 of them."""
    count = branch.multiple or 1
    if count == 1 or name not in branch.states:
        return []
    shares = np.arange(1, count) / count
    row = branch.states.index(name)
    heights = np.array([orbit(shares * orbit.period)[row] for orbit in branch])
    lines: list[Line2D] = []
    for kind, rows in stability_runs(branch.stability):
        look = {"color": BRANCH, "zorder": 2.0, "label": kind, **LINES[kind]}
        lines += ax.plot(branch.values[rows], heights[rows], **look)
    return lines
