"""Points of a trajectory on a section."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from matplotlib.axes import Axes
from matplotlib.legend import Legend
from matplotlib.lines import Line2D

from fastslow.arguments import formula, instance, positive, takes
from fastslow.errors import ArgumentError
from fastslow.plot.arguments import line_style
from fastslow.plot.labels import key
from fastslow.plot.style import BLACK, BLUE, VERMILION, Drawing, axes_for, typeset, widen
from fastslow.results.sections import Section

#: Marker, colour and words by direction.
LOOKS = {
    1: ("^", BLUE, "upwards"),
    -1: ("v", VERMILION, "downwards"),
    0: ("o", BLACK, "touching"),
}


@dataclass(frozen=True, eq=False)
class SectionDrawing(Drawing):
    """A drawn section.

    Parameters
    ----------
    ax : Axes
    x, y : str
        What the axes show.
    points : tuple of Line2D
        The points, by direction.
    legend : Legend or None
        Where there is more than one direction.
    """

    x: str
    y: str
    points: tuple[Line2D, ...]
    legend: Legend | None


@takes(
    section=instance(Section),
    x=formula,
    y=formula,
    ax=instance(Axes),
    size=positive,
    style=line_style,
)
def section(
    section: Section,
    x: object = None,
    y: object = None,
    *,
    ax: Axes | None = None,
    size: float = 2.4,
    **style: Any,
) -> SectionDrawing:
    """Draw the points of a section in the plane of two columns.

    Parameters
    ----------
    section : Section
        From `Trajectory.section` or `Trajectory.stroboscopic`.
    x, y : str or Symbol, optional
        Columns, or ``"t"``; by default the first two.
    ax : Axes, optional
        Axes to draw into; new ones of a column's width (85 mm) otherwise.
    size : float
        Size of the markers in points.
    **style
        Properties of the points.

    Returns
    -------
    SectionDrawing

    Raises
    ------
    UnknownNameError
        If ``x`` or ``y`` is no column of the section.
    ArgumentError
        If there is only one column and none was named.
    """
    if len(section.names) < 2 and (x is None or y is None):
        raise ArgumentError(
            f'a section of {section.names[0]} alone has no plane; draw it over "t", or name x and y'
        )
    across = section.names[0] if x is None else str(x)
    up = section.names[1] if y is None else str(y)
    horizontal, vertical = section[across], section[up]
    own = ax is None
    ax = axes_for(ax)
    points = []
    kinds = [d for d in LOOKS if (section.directions == d).any()]
    for direction in kinds:
        marker, color, words = LOOKS[direction]
        if len(kinds) == 1:
            marker, color, words = "o", BLACK, section.rule
        mine = section.directions == direction
        look: dict[str, Any] = {
            "marker": marker,
            "color": color,
            "markeredgewidth": 0.0,
            "markersize": size,
        }
        look |= {"linestyle": "none", "label": words, **style}
        points += ax.plot(horizontal[mine], vertical[mine], **look)
    widen(ax)
    ax.set_xlabel(typeset(across))
    ax.set_ylabel(typeset(up))
    legend = key(ax, points, own) if len(points) > 1 else None
    return SectionDrawing(ax, across, up, tuple(points), legend)
