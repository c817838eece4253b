"""Markers along a trajectory: crossings of interfaces, transitions, turning points."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.lines import Line2D

from fastslow.plot.layout.style import MOTION, TRANSITIONS, VERMILION, root
from fastslow.plot.layout.thinning import draw_long
from fastslow.plot.layout.typesetting import typeset
from fastslow.plot.quantities import Array, Quantity, at_times
from fastslow.results.overlay.overlay import Overlay

#: Kinds of transition that are marked at the departure from a stable branch.
LEAVING = frozenset(TRANSITIONS) - {"crossing", "gap crossing", "switch", "end of oscillation"}

#: Size of the dot at a crossing, in points.
CROSSING_DOT = 2.4


def draw_dots(ax: Any, places: Sequence[Array]) -> Line2D | None:
    """Draw crossings of interfaces as small dots, thinned if they would cover each other."""
    count = len(places[0])
    if not count:
        return None
    width = ax.get_window_extent().width * 72.0 / root(ax).dpi
    crowded = len(places) == 2 and count * CROSSING_DOT > width
    return draw_long(
        ax,
        *places,
        spacing=2.0 * CROSSING_DOT if crowded else 0.0,
        linestyle="none",
        marker="o",
        markersize=CROSSING_DOT,
        markerfacecolor="white",
        markeredgecolor=VERMILION,
        markeredgewidth=0.6,
        zorder=4,
        label=f"interface crossing ({count}, thinned)" if crowded else "interface crossing",
    )


def draw_crossings(ax: Any, overlay: Overlay, shown: Sequence[Quantity]) -> Line2D | None:
    """Draw the crossings of interfaces by the trajectory of an overlay."""
    crossings = overlay.run.crossings
    times, state = np.array([c.time for c in crossings]), np.array([c.state for c in crossings])
    return (
        draw_dots(ax, at_times(overlay, times, overlay.run.states, state, *shown))
        if crossings
        else None
    )


def at_states(overlay: Overlay, shown: Sequence[Quantity], states: Any) -> list[Array]:
    """Quantities at instants with known fast states and slow quantity."""
    state = np.array([[*s.state, s.value] for s in states])
    names = (*overlay.diagram.states, overlay.parameter)
    return at_times(overlay, np.array([s.time for s in states]), names, state, *shown)


def draw_transitions(ax: Any, overlay: Overlay, shown: Sequence[Quantity]) -> tuple[Line2D, ...]:
    """Draw the transitions, each kind with its own marker.

    A departure is marked where the trajectory leaves the stable branch.
    """
    drawn: list[Line2D] = []
    for kind in TRANSITIONS:
        transitions = [t for t in overlay.transitions if t.type == kind]
        if transitions:
            states = [t.leave if kind in LEAVING else t for t in transitions]
            drawn += draw_kind(ax, kind, at_states(overlay, shown, states))
    return tuple(drawn)


def draw_kind(ax: Any, kind: str, places: Sequence[Array], text: str = "") -> list[Line2D]:
    """Draw transitions of one kind with its marker; ``text`` replaces that of the legend."""
    marker, colour, usual = TRANSITIONS[kind]
    filled = marker in "*PX"
    drawn: list[Line2D] = ax.plot(
        *places,
        linestyle="none",
        marker=marker,
        markersize=7.0 if marker == "*" else 5.5,
        markerfacecolor=colour if filled else "none",
        markeredgecolor="black" if filled else colour,
        markeredgewidth=0.4 if filled else 1.2,
        zorder=5.5,
        label=text or usual,
    )
    return drawn


def draw_turning(ax: Any, overlay: Overlay, shown: Sequence[Quantity]) -> Line2D | None:
    """Draw a bar at each turning point of the slow quantity."""
    if not overlay.turning:
        return None
    (line,) = ax.plot(
        *at_states(overlay, shown, overlay.turning),
        linestyle="none",
        marker="|",
        markersize=9.0,
        markeredgewidth=1.4,
        color=MOTION,
        zorder=4.6,
        label=f"turning point of {typeset(overlay.parameter)}",
    )
    return line
