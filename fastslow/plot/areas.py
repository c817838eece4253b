"""Areas of an adaptive map: polygons along its boundaries, and the cells where there are none."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.patches import Patch
from numpy.typing import NDArray

from fastslow.errors import unknown_name
from fastslow.plot.arguments import line_colour
from fastslow.plot.layout.style import GREY
from fastslow.plot.layout.typesetting import as_given
from fastslow.results.maps.adaptive_map import FAILED, RefinedMap
from fastslow.results.orbits.attractors import NO_ATTRACTOR

Floats = NDArray[np.float64]

#: Fills of the gap regimes: tints of the Okabe-Ito colours that differ in lightness too.
FILLS: dict[Any, str] = {
    "bilateral": "#85C0E6",
    "unilateral upper": "#F8E0A9",
    "unilateral lower": "#E7BAD3",
    "meshed upper": "#F1F1F1",
    "meshed lower": "#B5DDCE",
    "free": "#FFFFFF",
    "chaotic": "#B09671",
    "not settled": "#8179B0",
    "no gap": "#A8A8A8",
    FAILED: "#6E6E6E",
}

#: Labels of points next to which others are found at any distance: their areas have no curves as
#: edges, and are drawn as cells.
WITHOUT_EDGES = frozenset({"chaotic", "not settled", FAILED})

#: Fill of the states that reach no attractor; no map of regimes has them.
UNASSIGNED = {NO_ATTRACTOR: FILLS["no gap"]}

#: Fills of other labels, cyclically; lightness differs too, so that a print in grey is readable.
OTHERS = ("#F3F3F3", "#85C0E6", "#F8E0A9", "#B5DDCE", "#E7BAD3", "#BBA583", "#71A29A", "#8A82BA")


def draw_areas(
    ax: Axes, result: RefinedMap, fills: Mapping[Any, str] | None = None
) -> dict[Any, PolyCollection]:
    """Draw the area of each label, without changing the limits of the axes.

    A cell of which a corner is chaotic, not settled or failed is divided into four quarters, each
    in the colour of its corner.

    Parameters
    ----------
    ax : Axes
    result : RefinedMap
    fills : mapping, optional
        Label to colour, replacing the default.

    Returns
    -------
    dict
        Label to the polygons of its area.
    """
    colours, shapes = _colours(result, fills or {}), _polygons(result)
    drawn = {}
    for code, word in enumerate(result.labels):
        colour = colours[word]
        look: dict[str, Any] = {"facecolor": colour, "edgecolor": colour}
        look["label"] = as_given(str(word))
        drawn[word] = PolyCollection(shapes[code], linewidth=0.3, zorder=0.5, **look)
        ax.add_collection(drawn[word], autolim=False)
    return drawn


def samples(fills: Mapping[Any, PolyCollection]) -> list[Patch]:
    """Return legend entries for areas."""
    found = []
    for word, area in fills.items():
        colour: Any = area.get_facecolor()
        look: dict[str, Any] = {"facecolor": colour[0], "edgecolor": GREY, "linewidth": 0.5}
        found.append(Patch(label=as_given(str(word)), **look))
    return found


def _colours(result: RefinedMap, fills: Mapping[Any, str]) -> dict[Any, str]:
    for word, fill in fills.items():
        if word not in result.labels:
            raise unknown_name("label", word, result.labels)
        line_colour(f"fills[{word!r}]", fill)
    known = {**FILLS, **UNASSIGNED, **fills}
    others = [word for word in result.labels if word not in known]
    turn = {word: OTHERS[k % len(OTHERS)] for k, word in enumerate(others)}
    return {word: known.get(word, turn.get(word, "")) for word in result.labels}


def _polygons(result: RefinedMap) -> list[list[Floats]]:
    """Return the polygons of each label: whole cells, and fragments of cells cut by a boundary."""
    without_edges = {k for k, label in enumerate(result.labels) if label in WITHOUT_EDGES}
    found: list[list[Floats]] = [[] for _ in result.labels]
    low = np.array([r[0] for r in result.over])
    steps, mixed = result.steps, result.mixed
    crossings = {
        tuple(place): float(np.mean(bracket))
        for place, bracket in zip(result.edges.places.tolist(), result.edges.brackets, strict=True)
    }
    for cell, codes, cut in zip(result.cells, result.corner_codes, mixed, strict=True):
        i, j, size = cell.tolist()
        corners = [(i, j), (i + size, j), (i + size, j + size), (i, j + size)]
        if not cut:
            found[codes[0, 0]].append(low + steps * np.array(corners))
            continue
        if without_edges & set(codes.ravel().tolist()):
            half = 0.5 * size
            for a, b in np.ndindex(2, 2):
                x, y = i + a * half, j + b * half
                quarter = [(x, y), (x + half, y), (x + half, y + half), (x, y + half)]
                found[codes[a, b]].append(low + steps * np.array(quarter))
            continue
        around = [int(codes[a, b]) for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))]
        sides = [(i, j, 0), (i + 1, j, 1), (i, j + 1, 0), (i, j, 1)]
        points = [_crossing(side, crossings) for side in sides]
        for code, outline in _parts(corners, around, points, (i + 0.5, j + 0.5)):
            found[code].append(low + steps * np.array(outline))
    return found


Point = tuple[float, float]


def _crossing(side: tuple[int, int, int], crossings: Mapping[Any, float]) -> Point:
    i, j, axis = side
    along = crossings.get(side, 0.5)
    return (i + along, float(j)) if axis == 0 else (float(i), j + along)


def _parts(
    corners: list[tuple[int, int]], around: list[int], points: list[Point], middle: Point
) -> list[tuple[int, list[Point]]]:
    """Return the outline of each label within a cell that is cut by a boundary."""
    changes = [k for k in range(4) if around[k] != around[(k + 1) % 4]]
    if len(changes) == 2:
        first, second = changes
        one: list[Point] = [points[first], *corners[first + 1 : second + 1], points[second]]
        rest = [corners[k % 4] for k in range(second + 1, first + 5)]
        return [(around[second], one), (around[first], [points[second], *rest, points[first]])]
    for k in (0, 1):
        # saddle: equal labels at opposite corners are joined, for two such pairs the first one
        mine, others = around[k], (around[k + 1], around[k - 1])
        if len(changes) == 4 and mine == around[k + 2] and not others[0] == others[1] < mine:
            joined: list[Point] = []
            for corner in (k, k + 2):
                joined += [points[corner - 1], corners[corner], points[corner]]
            cut = [(around[j], [points[j - 1], corners[j], points[j]]) for j in (k - 1, k + 1)]
            return [(mine, joined), *cut]
    return [(around[k], [corners[k], points[k], middle, points[k - 1]]) for k in range(4)]
