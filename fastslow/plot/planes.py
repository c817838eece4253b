"""Two-parameter bifurcation diagrams: curves of special points, in the plane or in space."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import groupby
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.text import Annotation
from numpy.typing import NDArray

from fastslow.arguments import flag, instance, validated
from fastslow.errors import ArgumentError
from fastslow.plot.areas import draw_areas, samples
from fastslow.plot.arguments import Axis, axis_quantity, figure_width, line_style
from fastslow.plot.drawings import Drawing
from fastslow.plot.layout.labels import place, tag
from fastslow.plot.layout.legends import add_legend
from fastslow.plot.layout.style import (
    HOPF_CURVES,
    VIRTUAL_CURVE,
    axes_for,
    curve_look,
    dot_look,
    point_colour,
    spatial,
)
from fastslow.plot.quantities import Quantity, at_points, quantity_of
from fastslow.plot.spaces import HEIGHT_OF_SPACE, style_space
from fastslow.results.branch.point_branch import PointBranch
from fastslow.results.maps.adaptive_map import RefinedMap
from fastslow.results.point_types import kind_of
from fastslow.results.points import SpecialPoint, by_title


@dataclass(frozen=True, eq=False, repr=False)
class PlaneDrawing(Drawing):
    """Drawn curves of special points.

    Parameters
    ----------
    ax : Axes
    lines : tuple of Line2D
        One for each arc of one kind, admissible or virtual.
    markers : tuple of Line2D
        One for each code of codimension-two points.
    labels : tuple of Annotation
        CP1, BT1, … beside the points.
    legend : Legend or None
    x, y, z : str
        Quantities on the axes; ``z`` is empty in the plane.
    fills : dict of PolyCollection
        The area of each label of ``background``.
    """

    lines: tuple[Line2D, ...]
    markers: tuple[Line2D, ...]
    labels: tuple[Annotation, ...]
    legend: Legend | None
    x: str = ""
    y: str = ""
    z: str = ""
    fills: dict[Any, PolyCollection] = field(default_factory=dict)


@validated(
    curves=instance(PointBranch),
    x=axis_quantity,
    y=axis_quantity,
    z=axis_quantity,
    background=instance(RefinedMap),
    ax=instance(Axes),
    width=figure_width,
    label=flag,
    legend=flag,
    virtual=flag,
    style=line_style,
)
def parameter_plane(
    *curves: PointBranch,
    x: Axis | None = None,
    y: Axis | None = None,
    z: Axis | None = None,
    background: RefinedMap | None = None,
    ax: Axes | None = None,
    width: str | float = "column",
    label: bool = True,
    legend: bool | None = None,
    virtual: bool = True,
    **style: Any,
) -> PlaneDrawing:
    """Draw curves of folds, Hopf points, boundary equilibria, … over two parameters.

    Each kind has its own colour and line style. Virtual arcs are dotted and faint; neutral
    saddles, which are not bifurcations, are thin. Supercritical Hopf points are solid and
    subcritical ones dashed, separated by generalized Hopf points GH. Points that did not
    converge have hollow markers.

    Parameters
    ----------
    *curves : PointBranch
        Curves over the same two parameters.
    x, y : str, Symbol, Expr or callable, optional
        Quantities on the axes, by default the two parameters: parameters, states, expressions
        in them, or functions of the columns.
    z : str, Symbol, Expr or callable, optional
        Quantity on the vertical axis of a view in space, e.g. a state over the parameter
        plane; by default the first state if ``ax`` is in space.
    background : RefinedMap, optional
        Map over the same two parameters, drawn under the curves in light colours.
    ax : Axes, optional
        Axes to draw into (with ``projection="3d"`` for a view in space); new ones otherwise.
    width : str or float
        Width of a new figure: ``"column"`` (85 mm), ``"page"`` (170 mm), or millimetres.
    label : bool
        Whether to write CP1, BT1, … beside codimension-two points.
    legend : bool, optional
        Whether to draw a legend; by default as ``label``.
    virtual : bool
        Whether to draw virtual arcs.
    **style
        Properties of every line, over those of its kind.

    Returns
    -------
    PlaneDrawing

    Raises
    ------
    UnknownNameError
        For a name in ``x``, ``y`` or ``z`` that is no state and no parameter.
    ArgumentError
        Without a curve; for curves or regions over different parameters; for an invalid
        expression; for a view in space with axes of the plane.

    See Also
    --------
    fastslow.continue_points, fastslow.plot.diagram

    Examples
    --------
    >>> import fastslow as fs
    >>> import sympy as sp
    >>> x, p, q = sp.symbols("x p q")
    >>> model = fs.Model({x: p + q * x - x**3}, parameters={p: 0, q: 1})
    >>> fold = fs.continue_equilibria(model, "p", over=(-1, 1)).folds[0]
    >>> curve = fs.continue_points(fold, ("p", "q"), over={"p": (-1, 1), "q": (-1, 2)})
    >>> [text.get_text() for text in fs.plot.parameter_plane(curve).labels]
    ['CP1']
    >>> fs.plot.parameter_plane(curve, z=x).ax.get_zlabel()
    '$x$'
    """
    names = {curve.parameter_names for curve in curves}
    if len(names) != 1:
        shown = "; ".join(", ".join(n) for n in sorted(names)) or "none"
        raise ArgumentError(
            f"parameter_plane: expected curves over the same two parameters, received {shown}"
        )
    space = spatial("parameter_plane", ax, z)
    quantities = _axes(curves[0], (x, y, z) if space else (x, y))
    shown_names = tuple(q.column for q in quantities)
    if background is not None and shown_names != background.names:
        raise ArgumentError(
            f"background over {', '.join(background.names)} cannot be drawn in axes "
            f"of {', '.join(q.text for q in quantities)}"
        )
    own, ax = ax is None, axes_for(ax, width, HEIGHT_OF_SPACE if space else 64.0, space)
    fills = {} if background is None else draw_areas(ax, background)
    if background is not None and ax.get_autoscalex_on() and ax.get_autoscaley_on():
        ax.set(xlim=background.over[0], ylim=background.over[1])
    lines: list[Line2D] = []
    for curve in curves:
        places = [q.of(_columns(curve), len(curve)) for q in quantities]
        for code, real, kind, rows in _runs(curve):
            if not (real or virtual):
                continue
            # a curve of Hopf points goes on as one of neutral saddles
            name = curve.title if curve.mark else kind_of(code).title
            title = ", ".join(filter(None, (name, kind)))
            look = {**curve_look(code), **HOPF_CURVES.get(kind, {}), "zorder": 2.0, "label": title}
            if not real:
                look |= {**VIRTUAL_CURVE, "label": "virtual"}
            lines += ax.plot(*(place[rows] for place in places), **{**look, **style})
    markers, labels = _special_points(ax, curves, quantities, virtual, label)
    if space:
        style_space(ax, [q.label for q in quantities])
    else:
        ax.set_xlabel(quantities[0].label)
        ax.set_ylabel(quantities[1].label)
    seen: dict[str, Artist] = {str(line.get_label()): line for line in (*lines, *markers)}
    key = add_legend(ax, [*seen.values(), *samples(fills)], own, label, legend)
    place(ax, labels)
    across, up, *above = (q.text for q in quantities)
    drawn = tuple(lines), tuple(markers), tuple(labels), key
    return PlaneDrawing(ax, *drawn, across, up, "".join(above), fills)


def _axes(curve: PointBranch, given: tuple[object, ...]) -> list[Quantity]:
    """Return the quantities on the axes, by default the parameters and the first state."""
    defaults = (*curve.parameter_names, curve.states[0])
    names = curve.point_names
    return [
        quantity_of(one, default, names, curve.parameters, "parameter or state")
        for one, default in zip(given, defaults, strict=False)
    ]


def _columns(curve: PointBranch) -> dict[str, Any]:
    return {**curve.parameters, **{name: curve[name] for name in curve.point_names}}


def _runs(curve: PointBranch) -> list[tuple[str, bool, str, slice]]:
    """Return arcs of one code, criticality and admissibility; neighbours share a row."""
    criticality = curve.criticality.copy()
    known = np.flatnonzero((criticality != "") & (criticality != "degenerate"))
    if known.size:
        # a generalized Hopf point separates both criticalities
        for row in np.flatnonzero(criticality == "degenerate"):
            before = known[known < row]
            criticality[row] = criticality[before[-1] if before.size else known[0]]
    kinds = list(
        zip(curve.codes.tolist(), curve.admissible.tolist(), criticality.tolist(), strict=True)
    )
    found, start = [], 0
    for (code, real, kind), group in groupby(kinds):
        stop = start + len(list(group))
        found.append((code, real, kind, slice(max(start - 1, 0), stop)))
        start = stop
    return found


def _special_points(
    ax: Any,
    curves: Sequence[PointBranch],
    shown: Sequence[Quantity],
    virtual: bool,
    label: bool,
) -> tuple[list[Line2D], list[Annotation]]:
    markers: list[Line2D] = []
    labels: list[Annotation] = []
    names = curves[0].parameter_names
    spans = np.ptp(np.concatenate([c.values for c in curves]), axis=0) + 1e-300
    entries = Counter[str]()
    for title, alike in by_title(p for curve in curves for p in curve.special).items():
        code, stem = alike[0].code, alike[0].stem
        points: list[SpecialPoint] = []
        seen: list[NDArray[np.float64]] = []
        for point in alike:
            at = np.array([point.parameters[n] for n in names])
            # two curves may share a point
            again = any(np.all(np.abs(at - other) < 1e-6 * spans) for other in seen)
            if again or not (point.admissible or virtual):
                continue
            seen.append(at)
            points.append(point)
        if not points:
            continue
        places = np.column_stack(at_points(points, *shown))
        solved = np.array([point.converged for point in points])
        look = {"zorder": 5, **dot_look(code, 5.0, number=entries[code]), "label": title}
        entries[code] += 1
        hollow = {
            "markerfacecolor": "white",
            "markeredgecolor": point_colour(code),
            "label": f"{title}, not converged",
        }
        for rows, own in ((solved, look), (~solved, {**look, **hollow})):
            if rows.any():
                markers += ax.plot(*places[rows].T, **own)
        if label:
            # numbered over all curves, each of which has its own numbers
            labels += [tag(ax, f"{stem}{k}", at) for k, at in enumerate(places, start=1)]
    return markers, labels
