"""Sobol indices of an output, over the parameters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.legend import Legend
from matplotlib.lines import Line2D

from fastslow.arguments import Name, flag, formula, instance, validated
from fastslow.errors import ArgumentError, unknown_name
from fastslow.plot.arguments import figure_width, line_style
from fastslow.plot.drawings import Drawing
from fastslow.plot.layout.legends import add_legend
from fastslow.plot.layout.style import BLUE, GREY, VERMILION, axes_for
from fastslow.plot.layout.typesetting import typeset
from fastslow.results.maps.sobol_indices import SobolIndices

#: Distance of the points of first and total order from the place of their parameter.
POINT_OFFSET = 0.12


@dataclass(frozen=True, eq=False, repr=False)
class SobolDrawing(Drawing):
    """Drawn Sobol indices.

    Parameters
    ----------
    ax : Axes
    output : str
    first, total : Line2D
        The indices of first and of total order.
    errors : tuple of LineCollection
        The confidence intervals of both.
    legend : Legend or None
    """

    output: str
    first: Line2D
    total: Line2D
    errors: tuple[LineCollection, ...]
    legend: Legend | None = None


@validated(
    indices=instance(SobolIndices),
    output=formula,
    ax=instance(Axes),
    width=figure_width,
    label=flag,
    legend=flag,
    style=line_style,
)
def sobol(
    indices: SobolIndices,
    output: Name | None = None,
    *,
    ax: Axes | None = None,
    width: str | float = "column",
    label: bool = True,
    legend: bool | None = None,
    **style: Any,
) -> SobolDrawing:
    """Draw the Sobol indices of one output, with their confidence intervals.

    Parameters
    ----------
    indices : SobolIndices
    output : str or Symbol, optional
        By default the first one.
    ax : Axes, optional
        Axes to draw into; new ones otherwise.
    width : str or float
        Width of a new figure: ``"column"`` (85 mm), ``"page"`` (170 mm), or millimetres.
    label, legend : bool, optional
        Whether to draw a legend; ``legend`` takes precedence and is by default as ``label``.
    **style
        Properties of the points.

    Returns
    -------
    SobolDrawing

    Raises
    ------
    UnknownNameError
        For another output.
    ArgumentError
        For an output without indices; see its ``outcome``.

    See Also
    --------
    fastslow.sobol

    Examples
    --------
    >>> import fastslow as fs
    >>> found = fs.sobol(lambda a, b: {"y": a + b}, {"a": (0, 1), "b": (0, 2)}, 64)
    >>> drawn = fs.plot.sobol(found)
    >>> drawn.ax.get_ylabel().splitlines()
    ['share of the variance', 'of $y$']
    >>> [text.get_text() for text in drawn.ax.get_xticklabels()]
    ['$a$', '$b$']
    """
    if not indices.outputs:
        raise ArgumentError(f"there are no outputs to draw: {indices.outcome}")
    name = indices.outputs[0] if output is None else str(output)
    if name not in indices.outputs:
        raise unknown_name("output", name, indices.outputs)
    row = indices.outputs.index(name)
    if not np.isfinite(indices.first[row]).all():
        raise ArgumentError(f"{name} has no indices to draw: {indices.outcome}")
    own, ax = ax is None, axes_for(ax, width, height=54.0)
    places = np.arange(len(indices.parameters), dtype=float)
    kinds = (
        (
            places - POINT_OFFSET,
            indices.first[row],
            indices.first_error[row],
            "o",
            BLUE,
            "first order",
        ),
        (
            places + POINT_OFFSET,
            indices.total[row],
            indices.total_error[row],
            "s",
            VERMILION,
            "total",
        ),
    )
    ax.axhline(0.0, color=GREY, linewidth=0.6, zorder=1)
    points: list[Line2D] = []
    errors: list[LineCollection] = []
    for x, values, error, marker, colour, words in kinds:
        errors.append(ax.vlines(x, values - error, values + error, colors=colour, linewidth=0.9))
        look = {
            "linestyle": "none",
            "marker": marker,
            "markersize": 4.0,
            "color": colour,
            "markerfacecolor": colour if marker == "o" else "white",
            "label": words,
            "zorder": 4,
        }
        points += ax.plot(x, values, **{**look, **style})
    ax.set_xticks(places, [typeset(n) for n in indices.parameters])
    if own:
        ax.set_xlim(-0.5, len(places) - 0.5)
    ax.set_xlabel("parameter")
    ax.set_ylabel(f"share of the variance\nof {typeset(name)}")
    first, total = points
    shown = add_legend(ax, points, own, label, legend)
    return SobolDrawing(ax, name, first, total, tuple(errors), shown)
