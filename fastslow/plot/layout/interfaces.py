"""Interfaces that are expressions in the quantities on both axes, drawn as their zero sets."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backend_bases import RendererBase
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from fastslow.errors import FastSlowError
from fastslow.formulas.columns import evaluated, names_in
from fastslow.plot.layout.occupancy import on_draw
from fastslow.plot.layout.style import INTERFACE

Array = NDArray[np.float64]

#: Points of the grid across and along the axes.
GRID_POINTS = 201


def draw_interfaces(
    ax: Axes,
    names: Iterable[str],
    shown: Sequence[str],
    fixed: Mapping[str, float],
) -> tuple[Line2D, ...]:
    """Draw the interfaces named by their function that depend on the axes alone.

    Interfaces with a name of their own, and those in other quantities, are omitted.

    Parameters
    ----------
    ax : Axes
        Axes in the plane; the lines extend to the limits, also after these change.
    names : iterable of str
        Names of interfaces, such as ``"T - S"``.
    shown : sequence of str
        Names or expressions on both axes, empty for functions.
    fixed : mapping
        Parameter values.

    Examples
    --------
    >>> import numpy as np
    >>> from matplotlib.figure import Figure
    >>> ax = Figure().add_subplot()
    >>> (line,) = draw_interfaces(ax, ["T - S", "p - 1", "upper"], ("T", "S"), {"p": 2.0})
    >>> ax.figure.draw_without_rendering()
    >>> bool(np.nanmax(abs(line.get_xdata() - line.get_ydata())) < 1e-12)
    True
    """
    drawn = []
    for name in names:
        if name in shown:
            look = {**INTERFACE, "transform": _across(ax, shown.index(name))}
            ends = ([0.0, 0.0], [0.0, 1.0])
            line = Line2D(*(ends if shown.index(name) == 0 else ends[::-1]), **look)
        elif _depends_on(name, shown, fixed):
            line = Line2D([], [], **INTERFACE)
            on_draw(ax, partial(_trace, ax, line, name, shown, fixed))
        else:
            continue
        # as an artist, which does not change the limits
        ax.add_artist(line)
        drawn.append(line)
    return tuple(drawn)


def _across(ax: Axes, axis: int) -> Any:
    return ax.get_yaxis_transform() if axis else ax.get_xaxis_transform()


def _depends_on(name: str, shown: Sequence[str], fixed: Mapping[str, float]) -> bool:
    """Check whether an interface is a function of the axes and of parameters, and of an axis."""
    columns = {axis for axis in shown if axis.isidentifier()}
    try:
        used = names_in(name, dict.fromkeys((*fixed, *columns), 0.0))
        value = evaluated(name, {**fixed, **dict.fromkeys(columns, 0.5)})
    except FastSlowError:
        return False
    return bool(used & columns) and value.dtype.kind == "f"


def _trace(
    ax: Axes,
    line: Line2D,
    name: str,
    shown: Sequence[str],
    fixed: Mapping[str, float],
    _: RendererBase,
) -> None:
    """Set the points of a line to the zeros of an interface within the limits."""
    grids: list[Array] = []
    for axis, limits in ((ax.xaxis, ax.get_xlim()), (ax.yaxis, ax.get_ylim())):
        scale = axis.get_transform()
        first, last = (float(end) for end in np.ravel(scale.transform(np.array(limits))))
        grids.append(np.asarray(scale.inverted().transform(np.linspace(first, last, GRID_POINTS))))
    x, y = np.meshgrid(*grids)
    heights = evaluated(name, {**fixed, **dict(zip(shown, (x, y), strict=True))})
    line.set_data(*_zeros(x, y, np.broadcast_to(heights, x.shape)).T)


def _zeros(x: Array, y: Array, heights: Array) -> Array:
    """Return the zeros of a function on a grid as segments across its cells.

    Returns
    -------
    ndarray, shape (3 K, 2)
        Both ends of each segment and NaN.
    """
    places = np.stack([x, y], axis=-1)

    def between(one: Any, other: Any) -> Array:
        """Zeros on edges of the grid, NaN without a change of sign."""
        h, k = heights[one], heights[other]
        with np.errstate(all="ignore"):
            part = np.where((h > 0.0) != (k > 0.0), h / (h - k), np.nan)[..., None]
        return np.asarray(places[one] + part * (places[other] - places[one]))

    whole, first, last = slice(None), slice(None, -1), slice(1, None)
    across = between((whole, first), (whole, last))
    along = between((first, whole), (last, whole))
    edges = np.stack([across[:-1], across[1:], along[:, :-1], along[:, 1:]], axis=2)
    found = np.isfinite(edges).all(axis=-1)
    order = np.argsort(~found, axis=2, kind="stable")[..., :2]
    ends = np.take_along_axis(edges, order[..., None], axis=2)[found.sum(axis=2) >= 2]
    return np.concatenate([ends, np.full((len(ends), 1, 2), np.nan)], axis=1).reshape(-1, 2)
