"""Eigenvalues in the complex plane: along a branch, and along the Clarke path at an interface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import Collection, LineCollection
from matplotlib.colorbar import Colorbar
from matplotlib.colors import Normalize
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.text import Annotation
from numpy.typing import NDArray

from fastslow.arguments import flag, instance, validated
from fastslow.errors import ArgumentError
from fastslow.plot.arguments import figure_width, line_style
from fastslow.plot.drawings import Drawing
from fastslow.plot.layout.labels import place, tag
from fastslow.plot.layout.legends import add_legend
from fastslow.plot.layout.style import (
    GREY,
    SMALL_TEXT,
    TEXT,
    VERMILION,
    axes_for,
    point_colour,
    root,
)
from fastslow.plot.layout.typesetting import plain, typeset
from fastslow.results.branch.branch import Branch
from fastslow.results.overlay.overlay import Overlay, require_equilibria
from fastslow.results.points import SpecialPoint, by_title

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

#: A perceptually uniform colour map.
COLOURS = "viridis"

#: Points along a Clarke path.
PATH_POINTS = 801


@dataclass(frozen=True, eq=False, repr=False)
class EigenvalueDrawing(Drawing):
    """Eigenvalues drawn in the complex plane.

    Parameters
    ----------
    ax : Axes
    paths : tuple of LineCollection
        One for each region on the path, coloured by the parameter.
    jumps : tuple of Line2D
        Segments from the eigenvalues on one side of an interface to those on the other.
    markers : tuple of Line2D
        Special points, at which an eigenvalue crosses the imaginary axis or jumps.
    labels : tuple of Annotation
    bar : Colorbar
    legend : Legend or None
    """

    paths: tuple[LineCollection, ...]
    jumps: tuple[Line2D, ...]
    markers: tuple[Line2D, ...]
    labels: tuple[Annotation, ...]
    bar: Colorbar
    legend: Legend | None


@validated(
    source=instance(Overlay, Branch),
    ax=instance(Axes),
    width=figure_width,
    label=flag,
    legend=flag,
    style=line_style,
)
def eigenvalue_path(
    source: Overlay | Branch,
    *,
    ax: Axes | None = None,
    width: str | float = "column",
    label: bool = True,
    legend: bool | None = None,
    **style: Any,
) -> EigenvalueDrawing:
    """Draw the eigenvalues along a branch, coloured by its parameter.

    Jumps of the eigenvalues at an interface are dashed grey lines. Folds and Hopf points are
    marked at the crossings of the imaginary axis. Infinite eigenvalues (of sliding) are omitted.

    Parameters
    ----------
    source : Overlay or Branch
        For an overlay, the branches between the stable branches followed, over the range of
        the slow quantity.
    ax : Axes, optional
        Axes to draw into; new ones otherwise.
    width : str or float
        Width of a new figure: ``"column"`` (85 mm), ``"page"`` (170 mm), or millimetres.
    label : bool
        Whether to write LP1, BE1, … beside the marks.
    legend : bool, optional
        Whether to draw a legend; by default as ``label``.
    **style
        Properties of the paths, e.g. ``linewidth`` or ``cmap``.

    Returns
    -------
    EigenvalueDrawing

    Raises
    ------
    ArgumentError
        For an overlay whose trajectory follows no stable branch, or of periodic orbits.

    See Also
    --------
    fastslow.plot.clarke_path, fastslow.plot.multipliers
    """
    if isinstance(source, Overlay):
        require_equilibria(source, "eigenvalue_path")
    parts = [(source, slice(0, len(source)))] if isinstance(source, Branch) else _followed(source)
    own, ax = ax is None, axes_for(ax, width, height=78.0)
    values = np.concatenate([branch.values[rows] for branch, rows in parts])
    scale = Normalize(float(values.min()), float(values.max()))
    paths: list[LineCollection] = []
    jumps: list[Line2D] = []
    points: list[SpecialPoint] = []
    for branch, rows in parts:
        path = matched(branch.eigenvalues[rows])
        region, parameter = branch.region[rows], branch.values[rows]
        edges = np.flatnonzero(region[1:] != region[:-1]) + 1
        for start, stop in zip([0, *edges], [*edges, len(path)], strict=True):
            part = through_collisions(path[start:stop], parameter[start:stop])
            paths.append(coloured(ax, *part, scale, style))
        for edge in edges:
            for one, other in zip(path[edge - 1], path[edge], strict=True):
                jumps += ax.plot(
                    [one.real, other.real],
                    [one.imag, other.imag],
                    color=GREY,
                    linestyle=(0, (3, 2)),
                    linewidth=0.8,
                    zorder=2.0,
                    label="jump at an interface",
                )
        points += [
            point
            for point, row in zip(branch.special, branch.special_rows, strict=True)
            if not point.kind.end and rows.start <= row < rows.stop
        ]
    markers, labels = _marks(ax, points, label)
    name = parts[0][0].parameter
    bar = _framed(ax, paths, typeset(name))
    handles: list[Artist] = [*markers, *jumps[:1]]
    shown = add_legend(ax, handles, own, label, legend)
    place(ax, labels)
    return EigenvalueDrawing(ax, tuple(paths), tuple(jumps), markers, labels, bar, shown)


@validated(
    point=instance(SpecialPoint),
    ax=instance(Axes),
    width=figure_width,
    label=flag,
    legend=flag,
    style=line_style,
)
def clarke_path(
    point: SpecialPoint,
    *,
    ax: Axes | None = None,
    width: str | float = "column",
    label: bool = True,
    legend: bool | None = None,
    **style: Any,
) -> EigenvalueDrawing:
    """Draw the eigenvalues of q J₁ + (1 − q) J₂ at a boundary equilibrium for 0 ≤ q ≤ 1.

    If the path crosses zero the boundary equilibrium is a non-smooth fold; if, in the plane,
    a pair crosses the imaginary axis, it is a Clarke-Hopf point (Leine and Nijmeijer 2004).

    Parameters
    ----------
    point : SpecialPoint
        A boundary equilibrium of a continuous model.
    ax : Axes, optional
        Axes to draw into; new ones otherwise.
    width : str or float
        Width of a new figure: ``"column"`` (85 mm), ``"page"`` (170 mm), or millimetres.
    label : bool
        Whether to write the point and its type above the axes.
    legend : bool, optional
        Whether to draw a legend; by default as ``label``.
    **style
        Properties of the path, e.g. ``linewidth`` or ``cmap``.

    Returns
    -------
    EigenvalueDrawing

    Raises
    ------
    ArgumentError
        If the point has no Clarke path.

    See Also
    --------
    fastslow.continue_equilibria, fastslow.plot.eigenvalue_path
    """
    if point.clarke is None:
        raise ArgumentError(
            f"{point.label} has no Clarke path; expected a boundary equilibrium of a model "
            "that is continuous across its interface"
        )
    own, ax = ax is None, axes_for(ax, width, height=78.0)
    q = np.linspace(0.0, 1.0, PATH_POINTS)
    path = matched(point.clarke.path(q))
    paths = (coloured(ax, *through_collisions(path, q), Normalize(0.0, 1.0), style),)
    markers: list[Line2D] = []
    first, second = point.clarke.regions
    for at, marker, text in ((1.0, "o", f"q = 1, {first}"), (0.0, "s", f"q = 0, {second}")):
        markers += _dots(ax, point.clarke.path(at), marker, "white", "black", text)
    for found, marker, text in (
        (point.clarke.q_zero, "*", "zero eigenvalue"),
        (point.clarke.q_hopf, "P", "pair on the axis"),
    ):
        if found is not None:
            size = np.abs(point.clarke.path(found))
            roots = point.clarke.path(found)
            on = roots[np.abs(roots.real) <= 1e-6 * max(float(size.max()), 1e-300)]
            markers += _dots(ax, on, marker, VERMILION, "black", f"{text}, q = {found:.4g}")
    bar = _framed(ax, paths, typeset("q"))
    if label:
        ax.set_title(plain(f"{point.label}: {point.type}"), fontsize=TEXT)
    shown = add_legend(ax, markers, own, label, legend)
    return EigenvalueDrawing(ax, paths, (), tuple(markers), (), bar, shown)


def _followed(overlay: Overlay) -> list[tuple[Branch, slice]]:
    """Return the rows of each branch from the first to the last row that is followed."""
    used = [overlay.stable_branches[k] for k in np.unique(overlay.followed) if k >= 0]
    if not used:
        raise ArgumentError(
            "this trajectory follows no stable branch: there are no eigenvalues to draw"
        )
    low, high = float(overlay.slow.min()), float(overlay.slow.max())
    parts = []
    for number in dict.fromkeys(s.branch for s in used):
        branch = overlay.diagram.branches[number]
        own = [s for s in used if s.branch == number]
        start, stop = min(s.start for s in own), max(s.stop for s in own)
        inside = (branch.values >= low) & (branch.values <= high)
        rows = start + np.flatnonzero(inside[start:stop])
        if len(rows) > 1:
            parts.append((branch, slice(int(rows[0]), int(rows[-1]) + 1)))
    if not parts:
        raise ArgumentError(
            "the range of the slow quantity contains fewer than two points of the branches"
        )
    return parts


def matched(values: Complex) -> Complex:
    """Order the eigenvalues of each row by continuity, nearest to nearest."""
    path = np.where(np.isfinite(values.real), values, np.nan + 0j)
    for row in range(1, len(path)):
        left = list(range(path.shape[1]))
        order = []
        for before in path[row - 1]:
            gaps = [abs(path[row, k] - before) for k in left]
            order.append(left.pop(int(np.argmin(np.nan_to_num(gaps, nan=np.inf)))))
        path[row] = path[row, order]
    return path


def coloured(
    ax: Axes, path: Complex, parameter: Array, scale: Normalize, style: dict[str, Any]
) -> LineCollection:
    """Draw lines of all eigenvalues on one interval, coloured by the parameter."""
    places = np.stack([path.real, path.imag], axis=-1)
    pieces = np.stack([places[:-1], places[1:]], axis=2).reshape(-1, 2, 2)
    middle = np.repeat(0.5 * (parameter[1:] + parameter[:-1]), path.shape[1])
    good = np.isfinite(pieces).all(axis=(1, 2))
    look = {"cmap": COLOURS, "linewidth": 2.0, "zorder": 3.0, "label": "eigenvalues", **style}
    lines = LineCollection(list(pieces[good]), norm=scale, **look)
    lines.set_capstyle("round")
    lines.set_array(middle[good])
    ax.add_collection(lines)
    return lines


def through_collisions(path: Complex, parameter: Array) -> tuple[Complex, Array]:
    """Insert a row at each collision of two real eigenvalues into a complex pair or back.

    The collision is on the real axis; without it a line would cut the corner.
    """
    real = np.abs(path.imag) <= 1e-9 * np.maximum(np.abs(path).max(axis=1, keepdims=True), 1e-300)
    changed = real[1:] != real[:-1]
    at = np.flatnonzero(changed.sum(axis=1) == 2)
    between = 0.5 * (path[at] + path[at + 1])
    for row, moved in zip(between, changed[at], strict=True):
        row[moved] = row[moved].real.mean()
    middle = 0.5 * (parameter[at] + parameter[at + 1])
    return np.insert(path, at + 1, between, axis=0), np.insert(parameter, at + 1, middle)


def _dots(ax: Axes, roots: Complex, marker: str, face: str, edge: str, text: str) -> list[Line2D]:
    return ax.plot(
        roots.real,
        roots.imag,
        linestyle="none",
        marker=marker,
        markersize=8.0 if marker == "*" else 4.5,
        markerfacecolor=face,
        markeredgecolor=edge,
        markeredgewidth=0.7,
        zorder=4.0,
        label=text,
    )


def _marks(
    ax: Axes, points: Sequence[SpecialPoint], label: bool
) -> tuple[tuple[Line2D, ...], tuple[Annotation, ...]]:
    """Mark special points: eigenvalues on the imaginary axis, or all of the point."""
    markers: list[Line2D] = []
    labels: list[Annotation] = []
    for title, alike in by_title(points).items():
        known = alike[0].kind
        roots: list[complex] = []
        for point in alike:
            values = point.eigenvalues[np.isfinite(point.eigenvalues.real)]
            if known.event and len(values):
                near = np.abs(values.real)
                values = values[near <= near.min() + 1e-9 * max(float(np.abs(values).max()), 1e-9)]
            roots += values.tolist()
            if label and len(values):
                top = max(values, key=lambda z: z.imag)
                labels.append(tag(ax, plain(point.label), (float(top.real), float(top.imag))))
        if roots:
            marker, colour = known.marker, point_colour(known.code)
            at = np.array(roots)
            # open if the point has a row, and eigenvalues, on each side
            face, edge = ("none", colour) if known.two_rows else (colour, "white")
            markers += _dots(ax, at, marker, face, edge, title)
    return tuple(markers), tuple(labels)


def _framed(ax: Axes, paths: Sequence[LineCollection], name: str) -> Colorbar:
    """Add axis labels, both axes of the complex plane, and the colour bar."""
    ax.autoscale_view()
    ax.margins(0.08)
    ax.axvline(0.0, color="black", linewidth=0.8, zorder=1.0)
    ax.axhline(0.0, color=GREY, linewidth=0.5, zorder=1.0)
    ax.set_xlabel(r"$\mathrm{Re}\,\lambda$")
    ax.set_ylabel(r"$\mathrm{Im}\,\lambda$")
    return colour_bar(ax, paths[0], name)


def colour_bar(ax: Axes, path: Collection, name: str) -> Colorbar:
    """Add the colour bar of what is coloured by a quantity."""
    bar = root(ax).colorbar(path, ax=ax, pad=0.02, aspect=30)
    bar.set_label(name, fontsize=TEXT)
    bar.ax.tick_params(labelsize=SMALL_TEXT, width=0.6, length=2.5)
    return bar
