"""Sets of equilibria within discontinuities, as filled bands with their edges."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from numpy.typing import NDArray

from fastslow.plot.layout.style import LINES
from fastslow.plot.quantities import Quantity
from fastslow.results.branch.diagram import Diagram
from fastslow.results.branch.equilibrium_sets import EquilibriumBand, attraction_word

Array = NDArray[np.float64]

#: Opacity of filled bands.
FILL = 0.25


def draw_sets(
    ax: Axes, diagram: Diagram, shown: tuple[Quantity, Quantity], color: str
) -> tuple[Artist, ...]:
    """Draw the bands of a diagram; arguments as for `draw_branches`.

    Over the parameter the range of the quantity is filled between its edges; in other views
    the corners are drawn as curves. Lines of sets that do not attract are dashed. Unbounded
    ranges are not drawn.
    """
    across, up = shown
    drawn: list[Artist] = []
    for band in diagram.bands:
        kind = attraction_word(band)
        look: dict[str, Any] = {"color": color, "label": f"equilibrium set ({kind})"}
        line = {} if _attracts(band) else {"linestyle": LINES["unstable"]["linestyle"]}
        over = across.column == diagram.parameter
        if band.dimension and (over or up.column == diagram.parameter):
            low, high = _range(diagram, band, up if over else across)
            fill = ax.fill_between if over else ax.fill_betweenx
            drawn.append(
                fill(band.values, low, high, alpha=FILL, linewidth=0.0, zorder=1.6, **look)
            )
            look.update(label="_edge of a set", linewidth=0.8, zorder=1.9)
            for edge in (low, high):
                points = (band.values, edge) if over else (edge, band.values)
                drawn += ax.plot(*points, **line, **look)
            continue
        for j in range(band.corners.shape[1]):
            x, y = (_along(diagram, band, band.corners[:, j], q) for q in shown)
            drawn += ax.plot(x, y, linewidth=1.2, zorder=1.9, **line, **look)
    return tuple(drawn)


def _attracts(band: EquilibriumBand) -> bool:
    return band.is_stable if not band.interfaces else bool(band.attracting)


def _along(diagram: Diagram, band: EquilibriumBand, states: Array, quantity: Quantity) -> Array:
    """Return a quantity along states of shape (N, n)."""
    columns: dict[str, Any] = dict(zip(band.states, states.T, strict=True))
    columns = {**diagram.parameters, **columns, band.parameter: band.values}
    return quantity.of(columns, len(band.values))


def _range(diagram: Diagram, band: EquilibriumBand, quantity: Quantity) -> tuple[Array, Array]:
    """Return the range of a quantity: exact for a state, otherwise between the corners."""
    if quantity.column in band.states:
        k = band.states.index(quantity.column)
        low, high = band.lower[:, k], band.upper[:, k]
    else:
        count = band.corners.shape[1]
        table = [_along(diagram, band, band.corners[:, j], quantity) for j in range(count)]
        low, high = np.min(table, axis=0), np.max(table, axis=0)
    ended = np.isfinite(low) & np.isfinite(high)
    return np.where(ended, low, np.nan), np.where(ended, high, np.nan)
