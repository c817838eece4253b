"""Outputs of a sweep over its axes: coloured cells over two, points over one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection, PolyCollection, QuadMesh
from matplotlib.colorbar import Colorbar
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from fastslow.arguments import Expression, flag, formula, instance, mapping, validated
from fastslow.errors import ArgumentError, unknown_name
from fastslow.plot.areas import FILLS, OTHERS, samples
from fastslow.plot.arguments import figure_width, line_colour, line_style
from fastslow.plot.drawings import Drawing
from fastslow.plot.eigenvalues import colour_bar
from fastslow.plot.layout.legends import add_legend
from fastslow.plot.layout.style import BLUE, GREY, axes_for
from fastslow.plot.layout.thinning import RASTERIZED
from fastslow.plot.layout.typesetting import as_given, typeset
from fastslow.results.maps.adaptive_map import FAILED
from fastslow.results.maps.grid import Grid, described

Array = NDArray[Any]

#: Draws the legend of some artists if one is requested.
Explain = Callable[[Sequence[Artist]], Legend | None]

#: The legend entries of points that are not computed and of those whose output is NaN or infinite,
#: with their hatches and markers.
MISSING, NO_NUMBER = "missing", "no number"
HATCHES = {MISSING: "////", NO_NUMBER: "...."}
MARKERS = {FAILED: "x", MISSING: "|", NO_NUMBER: "+"}


@dataclass(frozen=True, eq=False, repr=False)
class GridDrawing(Drawing):
    """A drawn output of a grid.

    Parameters
    ----------
    ax : Axes
    output : str
    fills : dict of PolyCollection
        The cells of each label, of the points that failed and of those that are missing.
    lines : tuple of Line2D
        Points over one axis, or of each label of paired axes.
    mesh : QuadMesh, PathCollection or None
        Cells, or paired points, coloured by numbers.
    bar : Colorbar or None
    legend : Legend or None
    """

    output: str
    fills: dict[Any, PolyCollection] = field(default_factory=dict)
    lines: tuple[Line2D, ...] = ()
    mesh: QuadMesh | PathCollection | None = None
    bar: Colorbar | None = None
    legend: Legend | None = None


@validated(
    result=instance(Grid),
    output=formula,
    ax=instance(Axes),
    width=figure_width,
    label=flag,
    legend=flag,
    fills=mapping,
    style=line_style,
)
def grid(
    result: Grid,
    output: Expression | None = None,
    *,
    ax: Axes | None = None,
    width: str | float = "column",
    label: bool = True,
    legend: bool | None = None,
    fills: Mapping[Any, str] | None = None,
    **style: Any,
) -> GridDrawing:
    """Draw an output of a sweep over one or two axes.

    Text and bools over two axes are coloured cells, and numbers have a colour bar. Points that
    failed or are missing, or whose number is not finite, are marked; a line over one axis is
    interrupted there. Axes with a single value are not drawn.

    Parameters
    ----------
    result : Grid
        With one or two axes of more than one value; see `Grid.select`.
    output : str or Expr, optional
        Output, or expression in outputs of numbers; by default the first output of text or
        bools, else the first number.
    ax : Axes, optional
        Axes to draw into; new ones otherwise.
    width : str or float
        Width of a new figure: ``"column"`` (85 mm), ``"page"`` (170 mm), or millimetres.
    label, legend : bool, optional
        Whether to draw a legend of the labels; ``legend`` takes precedence and is by default as
        ``label``.
    fills : mapping, optional
        Label to colour, replacing the default.
    **style
        Properties of the points, or of the outlines of the cells.

    Returns
    -------
    GridDrawing

    Raises
    ------
    ArgumentError
        For a grid over more than two axes, or an output of arrays or complex numbers.

    See Also
    --------
    fastslow.sweep, fastslow.plot.regime_map

    Examples
    --------
    >>> import fastslow as fs
    >>> sweep = fs.sweep(lambda a, b: {"above": a > b}, {"a": [0, 1, 2], "b": [0.5, 1.5]})
    >>> drawn = fs.plot.grid(sweep)
    >>> drawn.output, sorted(drawn.data)
    ('above', ['False', 'True'])
    """
    names = [name for name, values in result.axes.items() if len(values) > 1]
    names = names or list(result.axes)[:1]
    if len(names) > 2:
        raise ArgumentError(
            f"this grid has the axes {', '.join(names)}; draw two of them, after "
            f"select({names[-1]}=…)"
        )
    name, values = _output(result, output)
    own, ax = ax is None, axes_for(ax, width)
    ax.set_xlabel(_with_unit(result, names[0]))
    ax.set_ylabel(_with_unit(result, names[1] if len(names) == 2 else name))

    def explain(handles: Sequence[Artist]) -> Legend | None:
        return add_legend(ax, handles, own, label, legend)

    draw = _cells if len(names) == 2 and not result.paired else _points
    return draw(ax, result, names, name, values, fills or {}, style, explain)


def _output(result: Grid, output: Any) -> tuple[str, Array]:
    """Return the name and the values of the output to draw, shape (N,)."""
    scalars = {
        name: "fbU".index(values.dtype.kind)
        for name, values in result.outputs.items()
        if values.shape == result.shape and values.dtype.kind in "fbU"
    }
    if output is None:
        if not scalars:
            raise ArgumentError("this grid has no output of numbers, bools or text to draw")
        output = max(scalars, key=lambda name: scalars[name] > 0)
    values = result[output]
    if values.shape != result.shape or values.dtype.kind not in "fbU":
        raise ArgumentError(
            f"{output} is {described(values, len(result.shape))}; expected an output of numbers, "
            "bools or text, one for each point"
        )
    return str(output), values.reshape(-1)


def _with_unit(result: Grid, name: str) -> str:
    """Return the label of an axis or an output, with its unit in parentheses."""
    unit = result.units.get(name)
    return typeset(name) if unit is None else f"{typeset(name)} ({as_given(unit)})"


def _undrawn(result: Grid, values: Array) -> dict[str, NDArray[np.bool_]]:
    """Return the points that failed, are missing or have no finite number, each of shape (N,)."""
    failed = np.zeros(len(result), dtype=bool)
    failed[result.failed] = True
    found = {FAILED: failed, MISSING: ~result.done & ~failed}
    if values.dtype.kind == "f":
        found[NO_NUMBER] = ~np.isfinite(values) & result.done & ~failed
    return {word: flags for word, flags in found.items() if flags.any()}


def _colours(labels: list[Any], fills: Mapping[Any, str]) -> dict[Any, str]:
    for word, fill in fills.items():
        if word not in labels:
            raise unknown_name("label", word, labels)
        line_colour(f"fills[{word!r}]", fill)
    known = {**FILLS, **dict.fromkeys(HATCHES, "#FFFFFF"), **fills}
    others = [word for word in labels if word not in known]
    turn = {word: OTHERS[k % len(OTHERS)] for k, word in enumerate(others)}
    return {word: known.get(word, turn.get(word, "")) for word in labels}


def _place(ax: Axes, values: Array, axis: str) -> Array:
    """Return the positions of the values of an axis; text has ticks."""
    if values.dtype.kind not in "Ub":
        return values.astype(float)
    words, places = np.unique(values, return_inverse=True)
    given = ax.xaxis if axis == "x" else ax.yaxis
    given.set_ticks(range(len(words)), labels=[as_given(str(word)) for word in words])
    return places.astype(float)


def _edges(places: Array) -> Array:
    """Return the edges of the cells around increasing positions, shape (n + 1,)."""
    if len(places) == 1:
        return places[0] + np.array([-0.5, 0.5])
    middle = 0.5 * (places[1:] + places[:-1])
    ends = (2 * places[0] - middle[0], 2 * places[-1] - middle[-1])
    return np.concatenate([ends[:1], middle, ends[1:]])


def _cells(
    ax: Axes,
    result: Grid,
    names: list[str],
    name: str,
    values: Array,
    fills: Mapping[Any, str],
    style: Mapping[str, Any],
    explain: Explain,
) -> GridDrawing:
    """Draw coloured cells over two axes."""
    places = [_place(ax, result.axes[n], axis) for n, axis in zip(names, "xy", strict=True)]
    orders = [np.argsort(p) for p in places]
    edges = [_edges(p[order]) for p, order in zip(places, orders, strict=True)]
    inside = np.ix_(*orders)
    undrawn = {
        word: flags.reshape([len(p) for p in places])[inside]
        for word, flags in _undrawn(result, values).items()
    }
    table = values.reshape([len(p) for p in places])[inside]
    ax.set_xlim(edges[0][0], edges[0][-1])
    ax.set_ylim(edges[1][0], edges[1][-1])
    regions: dict[Any, NDArray[np.bool_]] = {}
    mesh = bar = None
    if table.dtype.kind == "f":
        look: dict[str, Any] = {
            "cmap": "viridis",
            "rasterized": table.size > RASTERIZED,
            "zorder": 0.5,
        }
        mesh = ax.pcolormesh(*edges, np.ma.masked_invalid(table.T), **look)
        bar = colour_bar(ax, mesh, _with_unit(result, name))
    else:
        good = ~np.logical_or.reduce([*undrawn.values(), np.zeros_like(table, dtype=bool)])
        regions = {word: (table == word) & good for word in np.unique(table[good]).tolist()}
    # a label may be one of these words
    regions |= {word: flags | regions.get(word, False) for word, flags in undrawn.items()}
    colours = _colours(list(regions), fills)
    drawn = {}
    for word, flags in regions.items():
        outline: dict[str, Any] = {"facecolor": colours[word], "edgecolor": colours[word]}
        if word in HATCHES:
            outline |= {"hatch": HATCHES[word], "edgecolor": GREY}
        outline |= {"linewidth": 0.3, "zorder": 0.6, "label": as_given(str(word)), **style}
        drawn[word] = PolyCollection(_boxes(flags, edges), **outline)
        drawn[word].set_rasterized(table.size > RASTERIZED)
        ax.add_collection(drawn[word], autolim=False)
    entries = dict(zip(drawn, samples(drawn), strict=True))
    for word in HATCHES.keys() & entries:
        entries[word].set(hatch=HATCHES[word])
    key = explain([*entries.values()]) if drawn else None
    return GridDrawing(ax, name, fills=drawn, mesh=mesh, bar=bar, legend=key)


def _boxes(flags: NDArray[np.bool_], edges: list[Array]) -> list[Array]:
    """Return boxes that cover the cells with a flag, one for each run of cells upwards."""
    x, y = edges
    found = []
    for i, column in enumerate(flags):
        changes = np.flatnonzero(np.diff(np.r_[False, column, False].astype(int)))
        for low, high in changes.reshape(-1, 2):
            corners = [(i, low), (i + 1, low), (i + 1, high), (i, high)]
            found.append(np.array([(x[a], y[b]) for a, b in corners]))
    return found


def _points(
    ax: Axes,
    result: Grid,
    names: list[str],
    name: str,
    values: Array,
    fills: Mapping[Any, str],
    style: Mapping[str, Any],
    explain: Explain,
) -> GridDrawing:
    """Draw points over one axis, or over two paired ones."""
    undrawn = _undrawn(result, values)
    good = ~np.logical_or.reduce([*undrawn.values(), np.zeros(len(result), dtype=bool)])
    x = _place(ax, result.axes[names[0]], "x")
    groups: dict[Any, NDArray[np.bool_]] = {name: good}
    y = _place(ax, values, "y") if len(names) == 1 else _place(ax, result.axes[names[1]], "y")
    mesh = bar = None
    if len(names) == 2 and values.dtype.kind == "f":
        mesh = ax.scatter(x[good], y[good], c=values[good], s=9.0, cmap="viridis", zorder=2)
        bar, groups = colour_bar(ax, mesh, _with_unit(result, name)), {}
    elif len(names) == 2:
        groups = {word: good & (values == word) for word in np.unique(values[good]).tolist()}
    colours = _colours(list(groups), fills) if len(names) == 2 else {name: BLUE}
    lines: list[Line2D] = []
    for word, flags in groups.items():
        look: dict[str, Any] = {"marker": "o", "markersize": 3.0, "color": colours[word]}
        look |= {"linestyle": "-" if len(names) == 1 and values.dtype.kind == "f" else "none"}
        if len(names) == 2:
            look |= {"markeredgecolor": GREY, "markeredgewidth": 0.4}
        look |= {"linewidth": 0.8, "label": as_given(str(word)), **style}
        order = np.argsort(x, kind="stable")
        if look["linestyle"] == "none":
            order = order[flags[order]]
        # a line is interrupted where there is no number
        lines += ax.plot(x[order], np.where(flags, y, np.nan)[order], **look)
    for word, flags in undrawn.items():
        # over one axis they have no height: along the lower edge
        line: dict[str, Any] = {"linestyle": "none", "marker": MARKERS[word], "markersize": 3.0}
        line |= {"color": GREY, "markeredgewidth": 0.7, "label": word}
        if len(names) == 1:
            line |= {"transform": ax.get_xaxis_transform()}
        heights = np.full(np.count_nonzero(flags), 0.02) if len(names) == 1 else y[flags]
        lines += ax.plot(x[flags], heights, **line)
    key = explain(lines) if len(lines) + (mesh is not None) > 1 else None
    return GridDrawing(ax, name, lines=tuple(lines), mesh=mesh, bar=bar, legend=key)
