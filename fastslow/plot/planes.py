"""Curves of special points in the plane of two parameters."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import groupby
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.text import Annotation
from numpy.typing import NDArray

from fastslow.arguments import flag, instance, takes
from fastslow.errors import ArgumentError
from fastslow.plot.arguments import line_style
from fastslow.plot.labels import key, place, settle, tag
from fastslow.plot.style import CURVES, MARKERS, Drawing, axes_for, typeset
from fastslow.results.point_branches import PointBranch
from fastslow.results.points import CODE_NAMES


@dataclass(frozen=True, eq=False)
class PlaneDrawing(Drawing):
    """Drawn curves of special points.

    Parameters
    ----------
    ax : Axes
    lines : tuple of Line2D
        One for each run of one kind, admissible or virtual.
    markers : tuple of Line2D
        One for each code of codimension-two points.
    labels : tuple of Annotation
        CP1, BT1, … beside the points.
    legend : Legend or None
    """

    lines: tuple[Line2D, ...]
    markers: tuple[Line2D, ...]
    labels: tuple[Annotation, ...]
    legend: Legend | None


@takes(
    curves=instance(PointBranch),
    ax=instance(Axes),
    label=flag,
    legend=flag,
    virtual=flag,
    style=line_style,
)
def parameter_plane(
    *curves: PointBranch,
    ax: Axes | None = None,
    label: bool = True,
    legend: bool = True,
    virtual: bool = True,
    **style: Any,
) -> PlaneDrawing:
    """Draw curves of folds, Hopf points, boundary equilibria, … over two parameters.

    Each kind has its colour and line style; virtual parts are dotted and faint,
    neutral saddles, which are no bifurcation, thin.

    Parameters
    ----------
    *curves : PointBranch
        Over the same two parameters.
    ax : Axes, optional
        Axes to draw into; new ones of a column's width (85 mm) otherwise.
    label : bool
        Whether to write CP1, BT1, … beside codimension-two points.
    legend : bool
        Whether to draw a legend.
    virtual : bool
        Whether to draw the virtual parts.
    **style
        Properties of every line, over those of its kind.

    Returns
    -------
    PlaneDrawing

    Raises
    ------
    ArgumentError
        If there is no curve, or they are over different parameters.
    """
    names = {curve.parameter_names for curve in curves}
    if len(names) != 1:
        shown = "; ".join(", ".join(n) for n in sorted(names)) or "none"
        raise ArgumentError(f"parameter_plane: expected curves over one plane, received {shown}")
    ((first, second),) = names
    own, ax = ax is None, axes_for(ax)
    lines: list[Line2D] = []
    for curve in curves:
        for code, real, rows in _runs(curve):
            if not (real or virtual):
                continue
            look = {**CURVES[code], "zorder": 2.0, "label": f"{code} {CODE_NAMES[code]}"}
            if not real:
                look |= {**CURVES["virtual"], "label": "virtual"}
            lines += ax.plot(curve[first][rows], curve[second][rows], **{**look, **style})
    markers, labels = _special_points(ax, curves, (first, second), virtual, label)
    ax.set_xlabel(typeset(first))
    ax.set_ylabel(typeset(second))
    handles = {str(line.get_label()): line for line in (*lines, *markers)}
    shown_key = key(ax, list(handles.values()), own) if legend and handles else None
    settle(ax)
    place(ax, labels, [] if shown_key is None else [shown_key])
    return PlaneDrawing(ax, tuple(lines), tuple(markers), tuple(labels), shown_key)


def _runs(curve: PointBranch) -> list[tuple[str, bool, slice]]:
    """Runs of one code, admissible or not; neighbours share their joint row."""
    kinds = list(zip(curve.codes.tolist(), curve.admissible.tolist(), strict=True))
    found, start = [], 0
    for (code, real), group in groupby(kinds):
        stop = start + len(list(group))
        found.append((code, real, slice(max(start - 1, 0), stop)))
        start = stop
    return found


def _special_points(
    ax: Axes,
    curves: tuple[PointBranch, ...],
    names: tuple[str, str],
    virtual: bool,
    label: bool,
) -> tuple[list[Line2D], list[Annotation]]:
    markers: list[Line2D] = []
    labels: list[Annotation] = []
    seen: list[tuple[str, NDArray[np.float64]]] = []
    spans = np.ptp(np.concatenate([c.parameter for c in curves]), axis=0) + 1e-300
    for code in CODE_NAMES:
        points: list[tuple[NDArray[np.float64], str]] = []
        for point in (p for curve in curves for p in curve.special(code)):
            at = np.array([point.parameters[n] for n in names])
            # one point may stand on two of the curves
            again = any(c == code and np.all(np.abs(at - o) < 1e-6 * spans) for c, o in seen)
            if again or not (point.admissible or virtual):
                continue
            seen.append((code, at))
            # numbered over all curves, which number their own points each
            points.append((at, f"{code}{len(points) + 1}"))
        if not points:
            continue
        marker, colour = MARKERS[code]
        markers += ax.plot(
            *np.transpose([at for at, _ in points]),
            linestyle="none",
            marker=marker,
            markersize=5,
            markerfacecolor=colour,
            markeredgecolor="white",
            markeredgewidth=0.5,
            zorder=5,
            label=f"{code} {CODE_NAMES[code]}",
        )
        if label:
            labels += [tag(ax, word, (at[0], at[1])) for at, word in points]
    return markers, labels
