"""A trajectory drawn over branches of periodic orbits of its frozen model."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from fastslow.plot.branch_lines import stability_runs
from fastslow.plot.branches import DiagramDrawing
from fastslow.plot.layout.bands import Bands
from fastslow.plot.layout.marks import LEAVING, draw_kind
from fastslow.plot.layout.style import BRANCH, LINES, MOTION, TRANSITIONS
from fastslow.plot.quantities import Array
from fastslow.plot.responses import ResponseDrawing, draw_response
from fastslow.results.orbits.orbit_branch import OrbitBranch
from fastslow.results.overlay.overlay import Overlay

#: Legend texts of transitions between orbits that differ from those between equilibria.
TEXTS = {
    "crossing": "passage through a contact",
    "branch point": "delayed exit past BPC",
    "grazing": "departure at a contact",
}

#: Phases in which successive strobes are joined by a line.
JOINED = ("quasi-static", "jump", "excursion")


def draw_orbits(ax: Axes, overlay: Overlay, text: str, label: bool) -> DiagramDrawing:
    """Draw the branches of orbits of an overlay, at every period of the forcing."""
    branches = tuple(draw_response(ax, b, text, label=label) for b in overlay.branches)
    repeats = (
        ResponseDrawing(ax, text, tuple(_other_phases(ax, branch, text)), (), ())
        for branch in overlay.branches
        if (branch.multiple or 1) > 1
    )
    drawn = (*branches, *repeats)
    for line in (line for one in drawn for line in one.lines):
        if line.get_label() == "stable":
            # wide enough to remain visible under a trajectory that follows it
            line.set_linewidth(2.2)
    # a branch of doubled orbits begins at the point that the other branch has
    tags = {(tag.get_text(), *np.round(tag.xy, 6)): tag for one in branches for tag in one.labels}
    for tag in (tag for one in branches for tag in one.labels):
        tag.set_visible(tag in tags.values())
    return DiagramDrawing(ax, text, (), (), (), Bands(), None, x=overlay.parameter, cycles=drawn)


def draw_strobed(
    ax: Axes, overlay: Overlay, text: str, style: Mapping[str, Any]
) -> tuple[tuple[Line2D, ...], tuple[Line2D, ...]]:
    """Draw the strobes of an overlay and its transitions.

    Parameters
    ----------
    ax : Axes
    overlay : Overlay
        Of orbits.
    text : str
        Column of the overlay and of the branches.
    style : mapping
        Properties of the trajectory's line.

    Returns
    -------
    tuple of tuple of Line2D
        The trajectory, with a dot for each strobe last, and each kind of transition.
    """
    values = overlay[text]
    lines = _draw_strobes(ax, overlay, values, style)
    marks: list[Line2D] = []
    for kind in TRANSITIONS:
        found = [t for t in overlay.transitions if t.type == kind]
        rows = np.searchsorted(overlay.t, [(t.leave if kind in LEAVING else t).time for t in found])
        rows = np.minimum(rows, len(overlay) - 1)
        if found:
            marks += draw_kind(ax, kind, [overlay.slow[rows], values[rows]], TEXTS.get(kind, ""))
    return lines, tuple(marks)


def _draw_strobes(
    ax: Axes, overlay: Overlay, values: Array, style: Mapping[str, Any]
) -> tuple[Line2D, ...]:
    """Draw the strobes as dots, joined where they follow orbits that repeat after one period."""
    look = {"color": MOTION, "zorder": 3.0, **style}
    dots = {"marker": ".", "markersize": 2.0, **look, "linestyle": "none", "label": "trajectory"}
    drawn: list[Line2D] = ax.plot(overlay.slow, values, **dots)
    joined = np.isin(overlay["phase"], JOINED)
    if joined.any() and all(branch.multiple == 1 for branch in overlay.branches):
        places = [np.where(joined, column, np.nan) for column in (overlay.slow, values)]
        line = {"linewidth": 0.6, **look, "marker": "none", "label": "_strobes"}
        drawn = [*ax.plot(*places, **line), *drawn]
    return tuple(drawn)


def _other_phases(ax: Axes, branch: OrbitBranch, name: str) -> list[Line2D]:
    """Draw a state of orbits of m periods of the forcing after 1 to m − 1 of them."""
    count = branch.multiple or 1
    if name not in branch.states:
        return []
    shares = np.arange(1, count) / count
    row = branch.states.index(name)
    heights = np.array([orbit(shares * orbit.period)[row] for orbit in branch])
    lines: list[Line2D] = []
    for kind, rows in stability_runs(branch.stability):
        look = {"color": BRANCH, "zorder": 2.0, "label": kind, **LINES[kind]}
        lines += ax.plot(branch.values[rows], heights[rows], **look)
    return lines
