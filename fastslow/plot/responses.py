"""Response curves: a property of periodic orbits over a parameter."""

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
from numpy.typing import NDArray

from fastslow.arguments import Expression, flag, formula, instance, validated
from fastslow.plot.arguments import figure_width, line_style
from fastslow.plot.branch_lines import stability_runs
from fastslow.plot.drawings import Drawing
from fastslow.plot.layout.labels import label_of, place, tag
from fastslow.plot.layout.legends import add_legend
from fastslow.plot.layout.style import BRANCH, CYCLES, LINES, axes_for, dot_look
from fastslow.plot.layout.typesetting import plain, typeset
from fastslow.results.orbits.functionals import split
from fastslow.results.orbits.orbit_branch import VANISHING, OrbitBranch, end_points
from fastslow.results.point_types import POINT_TYPES


@dataclass(frozen=True, eq=False, repr=False)
class ResponseDrawing(Drawing):
    """A drawn response curve.

    Parameters
    ----------
    ax : Axes
    y : str
        Quantity on the vertical axis.
    lines : tuple of Line2D
        One for each interval of constant stability.
    markers : tuple of Line2D
        One for each code of special points and ends.
    labels : tuple of Annotation
        LPC1, GR1, … beside the points, and the outcomes of ends where tracing failed.
    legend : Legend or None
    """

    y: str
    lines: tuple[Line2D, ...]
    markers: tuple[Line2D, ...]
    labels: tuple[Annotation, ...]
    legend: Legend | None = None

    @property
    def handles(self) -> list[Artist]:
        """Legend entries: each stability and code once."""
        shown = {str(line.get_label()): line for line in self.lines}
        names = [kind + word for word in ("", " cycles") for kind in LINES]
        return [*(shown[name] for name in names if name in shown), *self.markers]


@validated(
    branch=instance(OrbitBranch),
    y=formula,
    ax=instance(Axes),
    width=figure_width,
    label=flag,
    legend=flag,
    style=line_style,
)
def response(
    branch: OrbitBranch,
    y: Expression | None = None,
    *,
    ax: Axes | None = None,
    width: str | float = "column",
    label: bool = True,
    legend: bool | None = None,
    **style: Any,
) -> ResponseDrawing:
    """Draw a property of the orbits of a branch over its parameter.

    Stable orbits are solid, unstable ones dashed. Special points are marked, and the ends of the
    branch at a Hopf point, an equilibrium on an interface, a saddle-node, a period doubling or a
    homoclinic orbit; an end where tracing failed is labelled with its outcome.

    Parameters
    ----------
    branch : OrbitBranch
    y : str, Symbol or Expr, optional
        Column or expression, such as ``"max(x)"`` or ``"rms(x - 1)"``; by default the maximum
        of the first state.
    ax : Axes, optional
        Axes to draw into; new ones otherwise.
    width : str or float
        Width of a new figure: ``"column"`` (85 mm), ``"page"`` (170 mm), or millimetres.
    label : bool
        Whether to write LPC1, GR1, … beside special points.
    legend : bool, optional
        Whether to draw a legend; by default as ``label``.
    **style
        Properties of every line, overriding those of its stability.

    Returns
    -------
    ResponseDrawing

    See Also
    --------
    fastslow.continue_orbits, fastslow.plot.diagram

    Examples
    --------
    >>> import sympy as sp, fastslow as fs
    >>> x, v, a, t = sp.symbols("x v a t")
    >>> model = fs.Model({x: v, v: a * sp.sin(t) - x - v}, parameters={a: 1})
    >>> branch = fs.continue_orbits(fs.find_orbit(model, [-1, 0]), "a", over=(0.5, 2))
    >>> drawn = fs.plot.response(branch, "max(x)")
    >>> drawn.ax.get_ylabel(), list(drawn.data)
    ('max $x$', ['stable'])
    """
    shown = f"max({branch.states[0]})" if y is None else str(y)
    own, ax = ax is None, axes_for(ax, width)
    drawn = draw_response(ax, branch, shown, label=label, **style)
    drawn = replace(drawn, legend=add_legend(ax, drawn.handles, own, label, legend))
    place(ax, drawn.labels)
    return drawn


def draw_response(
    ax: Axes,
    branch: OrbitBranch,
    shown: str,
    *,
    label: bool = True,
    vanishing: NDArray[np.float64] | None = None,
    **style: Any,
) -> ResponseDrawing:
    """Draw a response curve without legend and without placing its labels.

    Ends at which cycles shrink to a point are marked at the heights ``vanishing`` if given.
    """
    heights = branch[shown]
    levels = heights if vanishing is None else vanishing
    ends = [k for k, o in zip((0, -1), branch.outcomes, strict=True) if o.code in VANISHING]
    lines: list[Line2D] = []
    for kind, rows in stability_runs(branch.stability):
        look = {"color": BRANCH, "zorder": 2.0, "label": kind, **LINES[kind], **style}
        lines += ax.plot(branch.values[rows], heights[rows], **look)
    markers: list[Line2D] = []
    labels: list[Annotation] = []
    spots = np.column_stack([branch.values, heights])
    spots[ends, 1] = levels[ends]
    special = zip(branch.special, branch.special_rows, strict=True)
    points = [(p.code, p.title, row, label_of(p)) for p, row in special]
    points += [(code, POINT_TYPES[code].title, row, text) for code, row, text in end_points(branch)]
    for code in POINT_TYPES:
        # several marks have the same code
        for number, title in enumerate(dict.fromkeys(p[1] for p in points if p[0] == code)):
            same = [
                (row, text) for own, entry, row, text in points if (own, entry) == (code, title)
            ]
            look = {**dot_look(code, number=number), "zorder": 5, "label": title}
            markers += ax.plot(*spots[[row for row, _ in same]].T, **look)
            labels += [tag(ax, plain(text), spots[row]) for row, text in same if label and text]
    ax.set_xlabel(typeset(branch.parameter))
    ax.set_ylabel(_words(shown))
    return ResponseDrawing(ax, shown, tuple(lines), tuple(markers), tuple(labels))


def draw_envelopes(
    ax: Axes, cycles: Sequence[OrbitBranch], y: str, label: bool
) -> tuple[ResponseDrawing, ...]:
    """Draw the maximum and the minimum of an expression along branches of cycles."""
    drawn = []
    for branch in cycles:
        middle = 0.5 * (branch[f"max({y})"] + branch[f"min({y})"])
        for which in ("max", "min"):
            look: dict[str, Any] = {"label": label and which == "max", "color": CYCLES}
            part = draw_response(ax, branch, f"{which}({y})", vanishing=middle, **look)
            for line in part.lines:
                line.set_label(f"{line.get_label()} cycles")
            drawn.append(part)
    return tuple(drawn)


def _words(column: str) -> str:
    """The label of a column: a functional of a name is typeset."""
    written, functionals = split(column)
    if written in functionals:
        which, argument = functionals[written]
        return f"{which} {typeset(argument) if argument.isidentifier() else plain(argument)}"
    return typeset(column) if column.isidentifier() else plain(column)
