"""A trajectory over its branches in space: the slow quantity and two states."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from matplotlib.axes import Axes
from matplotlib.legend import Legend
from matplotlib.lines import Line2D

from fastslow.plot.branches import runs
from fastslow.plot.heights import along, at_point, written
from fastslow.plot.labels import legend_below
from fastslow.plot.style import (
    BRANCH,
    COLUMN,
    LINES,
    MARKERS,
    MM,
    SMALL,
    TEXT,
    Drawing,
    new_figure,
    typeset,
)
from fastslow.results.overlays import Overlay
from fastslow.results.points import CODE_NAMES


@dataclass(frozen=True, eq=False)
class SpaceDrawing(Drawing):
    """An overlay drawn in space.

    Parameters
    ----------
    ax : Axes
        With the projection "3d".
    x, y : str
        What stands over the slow quantity, along the second and the vertical axis.
    branches : tuple of Line2D
        One for each run of constant stability.
    markers : tuple of Line2D
        One for each code of special points.
    line : Line2D
        The trajectory.
    legend : Legend or None
    """

    x: str
    y: str
    branches: tuple[Line2D, ...]
    markers: tuple[Line2D, ...]
    line: Line2D
    legend: Legend | None


def draw_space(
    lay: Overlay,
    x: str,
    y: str,
    ax: Axes | None = None,
    *,
    label: bool = True,
    legend: bool = True,
    **style: Any,
) -> SpaceDrawing:
    """Draw an overlay in space; see `fastslow.plot.overlay`."""
    own = ax is None
    if ax is None:
        ax = new_figure(COLUMN, 84 * MM).add_subplot(projection="3d")
    return _drawn(lay, x, y, ax, own, label, legend, style)


def _drawn(
    lay: Overlay,
    x: str,
    y: str,
    ax: Any,  # axes in space, which Matplotlib does not type
    own: bool,
    label: bool,
    legend: bool,
    style: dict[str, Any],
) -> SpaceDrawing:
    diagram = lay.diagram
    branches: list[Any] = []
    for branch in diagram.branches:
        if branch.admissible:
            across, up = along(diagram, branch, x), along(diagram, branch, y)
            for kind, rows in runs(branch):
                look = {**LINES[kind], "color": BRANCH, "label": kind}
                look["linewidth"] = 2.0 if kind == "stable" else look["linewidth"]
                branches += ax.plot(branch.parameter[rows], across[rows], up[rows], **look)
    (line,) = ax.plot(
        lay.slow, lay[x], lay[y], **{"linewidth": 0.6, "label": "trajectory", **style}
    )
    markers: list[Any] = []
    for code in CODE_NAMES:
        met = [p for p in diagram.special if p.code == code and p.admissible and code != "EP"]
        if met:
            marker, colour = MARKERS[code]
            places = [(p[lay.parameter], at_point(p, x), at_point(p, y)) for p in met]
            markers += ax.plot(
                *zip(*places, strict=True),
                linestyle="none",
                marker=marker,
                markersize=4.5,
                markerfacecolor=colour,
                markeredgecolor="white",
                markeredgewidth=0.5,
                label=f"{code} {CODE_NAMES[code]}",
            )
            if label:
                for point, at in zip(met, places, strict=True):
                    ax.text(*at, f"  {point.label}", fontsize=SMALL)
    for set_label, text in (
        (ax.set_xlabel, typeset(lay.parameter)),
        (ax.set_ylabel, written(x)),
        (ax.set_zlabel, written(y)),
    ):
        set_label(text, fontsize=TEXT, labelpad=-4)
    ax.tick_params(labelsize=SMALL, pad=-3)
    ax.tick_params(axis="z", pad=1)
    ax.locator_params(nbins=5)
    key = None
    if legend:
        shown: dict[str, Line2D] = {str(h.get_label()): h for h in [*branches, *markers, line]}
        handles = list(shown.values())
        key = legend_below(ax, handles, 2) if own else ax.legend(handles=handles, fontsize=SMALL)
    return SpaceDrawing(ax, x, y, tuple(branches), tuple(markers), line, key)
