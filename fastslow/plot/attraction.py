"""Basins of attraction, with the attractors in them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.text import Annotation
from numpy.typing import NDArray

from fastslow.arguments import flag, instance, mapping, validated
from fastslow.errors import ArgumentError
from fastslow.plot.areas import samples
from fastslow.plot.arguments import figure_width, line_style
from fastslow.plot.drawings import Drawing
from fastslow.plot.layout.labels import place, tag
from fastslow.plot.layout.legends import add_legend
from fastslow.plot.layout.style import VERMILION, note
from fastslow.plot.maps import MapDrawing, regime_map
from fastslow.plot.motion_lines import JUMPS, interrupted
from fastslow.plot.quantities import Quantity, joined
from fastslow.results.angles import periods_of, principal
from fastslow.results.maps.adaptive_map import RefinedMap
from fastslow.results.orbits.attractors import Attractors
from fastslow.results.orbits.orbit import Orbit
from fastslow.results.points import Equilibrium

Array = NDArray[np.float64]

#: Properties common to all attractors.
LOOK: dict[str, Any] = {
    "color": VERMILION,
    "markeredgecolor": "white",
    "markeredgewidth": 0.7,
    "zorder": 4.0,
}

#: Properties of the attractors by kind.
KINDS: dict[str, dict[str, Any]] = {
    "closed orbit": {"linestyle": "-", "linewidth": 1.5},
    "stroboscopic points": {"linestyle": "none", "marker": "o", "markersize": 5.0},
    "equilibrium": {"linestyle": "none", "marker": "D", "markersize": 5.0},
}


@dataclass(frozen=True, eq=False, repr=False)
class BasinDrawing(Drawing):
    """Drawn basins of attraction.

    Parameters
    ----------
    ax : Axes
    basins : MapDrawing
        Areas and boundaries.
    attractors : tuple of Line2D
        One for each attractor.
    labels : tuple of Annotation
        A1, A2, … beside the attractors.
    legend : Legend or None
    """

    basins: MapDrawing
    attractors: tuple[Line2D, ...]
    labels: tuple[Annotation, ...]
    legend: Legend | None = None

    @property
    def handles(self) -> list[Artist]:
        """Legend entries: the basins, then each kind of attractor once."""
        kinds = {str(line.get_label()): line for line in self.attractors}
        return [*samples(self.basins.fills), *kinds.values()]


@validated(
    result=instance(RefinedMap),
    attractors=instance(Attractors),
    ax=instance(Axes),
    width=figure_width,
    label=flag,
    legend=flag,
    fills=mapping,
    style=line_style,
)
def basins(
    result: RefinedMap,
    attractors: Attractors,
    *,
    ax: Axes | None = None,
    width: str | float = "column",
    label: bool = True,
    legend: bool | None = None,
    fills: Mapping[Any, str] | None = None,
    **style: Any,
) -> BasinDrawing:
    """Draw basins of attraction and the attractors in them.

    Orbits of a forced model are drawn as their stroboscopic points at time 0 of the forcing, at
    which the initial states are taken; orbits of an autonomous model as closed curves. With more
    than two states they are projected onto the plane of the map.

    Parameters
    ----------
    result : RefinedMap
        From `fastslow.basins`.
    attractors : Attractors
        Those of the map, from `fastslow.attractors`.
    ax : Axes, optional
        Axes to draw into, in which limits set by hand are kept; new ones otherwise.
    width : str or float
        Width of a new figure: ``"column"`` (85 mm), ``"page"`` (170 mm), or millimetres.
    label : bool
        Whether to write A1, A2, … beside the attractors, and which are outside the map.
    legend : bool, optional
        Whether to draw a legend; by default as ``label``.
    fills : mapping, optional
        Label to colour, replacing the default.
    **style
        Properties of the boundary lines.

    Returns
    -------
    BasinDrawing

    Raises
    ------
    ArgumentError
        For attractors of other states, or fewer than the map has.

    See Also
    --------
    fastslow.basins, fastslow.attractors

    Examples
    --------
    >>> import sympy as sp, fastslow as fs
    >>> x, v = sp.symbols("x v")
    >>> wells = fs.Model({x: v, v: x - x**3 - v / 2})
    >>> box = {x: (-2, 2), v: (-1, 1.1)}
    >>> found = fs.attractors(wells, box, 20)
    >>> plane = fs.basins(wells, box, known=found, refinement=fs.Refinement(cells=(6, 6), levels=1))
    >>> drawn = fs.plot.basins(plane, found)
    >>> [label.get_text() for label in drawn.labels], len(drawn.data["equilibrium"])
    (['A1', 'A2'], 2)
    """
    _require_match(result, attractors)
    own = ax is None
    under = regime_map(result, ax=ax, width=width, label=False, fills=fills, **style)
    ax = under.ax
    lines: list[Line2D] = []
    labels: list[Annotation] = []
    outside: list[str] = []
    for name, one in zip(attractors.labels, attractors, strict=True):
        kind, points, jumps = _shape(one, result)
        lines += ax.plot(*points.T, label=kind, **LOOK, **KINDS[kind])
        if len(jumps):
            ax.plot(*jumps.T, color=LOOK["color"], zorder=LOOK["zorder"], **JUMPS)
        low, high = np.transpose([ax.get_xlim(), ax.get_ylim()])
        seen = points[((points >= low) & (points <= high)).all(axis=1)]
        if not len(seen):
            outside.append(name)
        elif label:
            spots = seen if kind != "closed orbit" else seen[[np.argmax(seen[:, 1])]]
            labels += [tag(ax, name, spot) for spot in spots]
    if label and outside:
        note(ax, f"outside: {', '.join(outside)}")
    drawn = BasinDrawing(ax, under, tuple(lines), tuple(labels))
    drawn = replace(drawn, legend=add_legend(ax, drawn.handles, own, label, legend))
    place(ax, labels)
    return drawn


def _require_match(result: RefinedMap, attractors: Attractors) -> None:
    lacking = [name for name in result.names if name not in attractors.states]
    if lacking:
        raise ArgumentError(
            f"the map is over {', '.join(result.names)}, the attractors are of "
            f"{', '.join(attractors.states)}; expected a map over two of these states"
        )
    numbered = [f"A{k + 1}" for k in range(len(result.labels) + len(attractors))]
    more = [w for w in result.labels if w in numbered and w not in attractors.labels]
    if more:
        raise ArgumentError(
            f"the map has basins of {', '.join(map(str, more))}; expected the attractors of the "
            f"map, received {len(attractors)}"
        )


def _shape(one: Orbit | Equilibrium, result: RefinedMap) -> tuple[str, Array, Array]:
    """Kind of an attractor, its points in the plane of a map, shape (N, 2), and its jumps.

    A periodic state is within half a period of the middle of the map. A closed orbit is
    interrupted at jumps, whose ends are returned with NaN between them.
    """
    columns = [one.states.index(name) for name in result.names]
    none = np.empty((0, 2))
    if isinstance(one, Equilibrium):
        return "equilibrium", one.state[None, columns], none
    middle = np.mean(result.over, axis=1)
    periods = {name: one.trajectory.periods.get(name, 0.0) for name in result.names}
    times = one.t if one.multiple is None else one.period * np.arange(one.multiple) / one.multiple
    points = principal(one(times)[columns].T - middle, periods_of(result.names, periods))
    if one.multiple is not None:
        return "stroboscopic points", points + middle, none
    whole, ends = interrupted(times, list(points.T))
    curve = joined(whole, [Quantity(name) for name in result.names], periods)
    return "closed orbit", np.column_stack(curve) + middle, np.column_stack(ends) + middle
