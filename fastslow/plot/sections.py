"""Poincaré and stroboscopic sections."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.legend import Legend
from matplotlib.lines import Line2D

from fastslow.arguments import flag, instance, positive, validated
from fastslow.errors import ArgumentError
from fastslow.plot.arguments import Axis, axis_quantity, figure_width, line_style
from fastslow.plot.drawings import Drawing
from fastslow.plot.layout.legends import add_legend
from fastslow.plot.layout.style import (
    BLACK,
    BLUE,
    VERMILION,
    axes_for,
    note,
    note_early_end,
    widen_limits,
)
from fastslow.plot.layout.thinning import draw_long
from fastslow.plot.quantities import quantity_of
from fastslow.results.trajectory.long_time.section import Section

#: Marker, colour and legend text by direction.
LOOKS = {
    1: ("^", BLUE, "upwards"),
    -1: ("v", VERMILION, "downwards"),
    0: ("o", BLACK, "touching"),
}


#: Relative extent below which a column is constant.
CONSTANT_COLUMN = 1e-9


@dataclass(frozen=True, eq=False, repr=False)
class SectionDrawing(Drawing):
    """A drawn section.

    Parameters
    ----------
    ax : Axes
    x, y : str
        Quantities on the axes.
    points : tuple of Line2D
        The points, by direction.
    legend : Legend or None
        None for a single direction.
    """

    x: str
    y: str
    points: tuple[Line2D, ...]
    legend: Legend | None


@validated(
    section=instance(Section),
    x=axis_quantity,
    y=axis_quantity,
    ax=instance(Axes),
    width=figure_width,
    label=flag,
    legend=flag,
    size=positive,
    style=line_style,
)
def section(
    section: Section,
    x: Axis | None = None,
    y: Axis | None = None,
    *,
    ax: Axes | None = None,
    width: str | float = "column",
    label: bool = True,
    legend: bool | None = None,
    size: float = 2.4,
    **style: Any,
) -> SectionDrawing:
    """Draw the points of a Poincaré or stroboscopic section in the plane of two columns.

    Parameters
    ----------
    section : Section
        From `Trajectory.section` or `Trajectory.stroboscopic`.
    x, y : str, Symbol, Expr or callable, optional
        Columns or ``"t"``, by default the first two that vary in the section, expressions in
        them, or functions of the columns.
    ax : Axes, optional
        Axes to draw into; new ones otherwise.
    width : str or float
        Width of a new figure: ``"column"`` (85 mm), ``"page"`` (170 mm), or millimetres.
    label, legend : bool, optional
        Whether to draw a legend, if there is more than one direction; ``legend`` takes
        precedence and is by default as ``label``.
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
        If ``x`` or ``y`` is not a column of the section.
    ArgumentError
        If there is only one column and none is named; for an invalid expression.

    See Also
    --------
    fastslow.simulate, fastslow.plot.phase_portrait

    Examples
    --------
    >>> import fastslow as fs
    >>> run = fs.simulate(fs.systems.van_der_pol(), [0.5, 0], t=(0, 60))
    >>> found = run.section("v", direction=1)
    >>> fs.plot.section(found, "t", "x**2").ax.get_ylabel()
    '$x^{2}$'
    """
    if len(section.names) < 2 and (x is None or y is None):
        raise ArgumentError(
            f'a section with the single column {section.names[0]}; give x and y, such as x="t"'
        )
    names = (*section.names, "t")
    usual = (*_varying(section), "t")
    across = quantity_of(x, usual[0], names, (), "column")
    up = quantity_of(y, usual[1], names, (), "column")
    columns = {name: section[name] for name in names}
    horizontal, vertical = (q.of(columns, len(section)) for q in (across, up))
    own, ax = ax is None, axes_for(ax, width)
    points: list[Line2D] = []
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
        points.append(draw_long(ax, horizontal[mine], vertical[mine], **look))
    widen_limits(ax)
    note_early_end(ax, section.ended)
    if not len(section):
        note(ax, f"no points: {section.rule}")
    ax.set_xlabel(across.label)
    ax.set_ylabel(up.label)
    key = add_legend(ax, points, own, label, legend) if len(points) > 1 else None
    return SectionDrawing(ax, across.text, up.text, tuple(points), key)


def _varying(section: Section) -> Sequence[str]:
    """Return the columns that vary by more than rounding errors, all if fewer than two do."""
    if len(section) < 2:
        return section.names
    extents, sizes = np.ptp(section.table, axis=1), np.abs(section.table).max(axis=1)
    moving = [n for n, v in zip(section.names, extents > CONSTANT_COLUMN * sizes, strict=True) if v]
    return moving if len(moving) > 1 else section.names
