"""Frames of a page: a view at one set of values, as plain data."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Any
from unicodedata import lookup

import numpy as np
from numpy.typing import NDArray

from fastslow.interactive.tooltips import text_of
from fastslow.interactive.views import View
from fastslow.plot.branch_lines import marked_points, runs
from fastslow.plot.layout.style import (
    BANDS,
    BRANCH,
    GREY,
    LINES,
    MOTION,
    TRANSITIONS,
    VERMILION,
    point_colour,
)
from fastslow.plot.layout.typesetting import GREEK
from fastslow.plot.quantities import Quantity, at_crossings
from fastslow.results.branch.branch import Branch
from fastslow.results.point_types import POINT_TYPES
from fastslow.results.points import linear_words, type_of
from fastslow.results.trajectory.steps.dense import rows_before_jumps
from fastslow.results.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]

#: Approximate number of samples of a run in a page, in addition to all turning points.
PAGE_SAMPLES = 2500


class Store:
    """Store of arrays as text, without duplicates.

    Examples
    --------
    >>> store = Store()
    >>> store.add(np.eye(2)), store.add(np.zeros((2, 2))), store.add(np.eye(2))
    (0, 1, 0)
    """

    def __init__(self) -> None:
        self.arrays: list[dict[str, Any]] = []
        self._known: dict[tuple[int, tuple[float, ...], str], int] = {}

    def add(self, table: Array) -> int:
        """Store a table (N, k) by columns in 32 bits and return its number.

        A column with small variation relative to its size is stored relative to its first value.
        """
        with np.errstate(over="ignore", invalid="ignore"):
            first = np.where(np.ptp(table, axis=0) < 0.5 * np.abs(table[0]), table[0], 0.0)
            small = np.ascontiguousarray((table - first).T, dtype="<f4")
        text = b64encode(small.tobytes()).decode()
        key = (len(table), tuple(first.tolist()), text)
        if key not in self._known:
            self._known[key] = len(self.arrays)
            self.arrays.append({"first": first.tolist(), "rows": len(table), "text": text})
        return self._known[key]


def looks() -> dict[str, dict[str, Any]]:
    """Return the style of all lines and markers of a page, that of the figures.

    Examples
    --------
    >>> looks()["LP"]["label"], looks()["unstable"]["dash"]
    ('LP fold', [3.5, 1.8])
    """
    made: dict[str, dict[str, Any]] = {}
    for kind, look in LINES.items():
        dash = [] if look["linestyle"] == "-" else list(look["linestyle"][1])
        opacity = look.get("alpha", 1.0)
        made[kind] = {"color": BRANCH, "width": look["linewidth"], "dash": dash, "opacity": opacity}
        made[kind]["label"] = kind
    # wide enough to remain visible under a trajectory that follows it
    made["followed"] = {**made["stable"], "width": 2.2}
    motion = {"color": MOTION, "width": 0.9, "dash": [], "opacity": 1.0}
    made["earlier"] = {**motion, "opacity": 0.4, "label": "earlier periods"}
    made["trajectory"] = {**motion, "label": "trajectory"}
    # the line between the two sides of a jump
    made["reset"] = {"width": 0.5, "dash": [1.0, 1.65]}
    made["now"] = {**motion, "label": "value of the run"}
    for code, known in POINT_TYPES.items():
        look = {"marker": known.marker, "color": point_colour(code), "filled": True, "size": 4.5}
        made[code] = {**look, "label": known.title}
    for kind, (marker, colour, label) in TRANSITIONS.items():
        filled = marker in "*PX"
        made[kind] = {"marker": marker, "color": colour, "filled": filled, "size": 6.0}
        made[kind]["label"] = label
    made["contact"] = {"marker": "o", "color": VERMILION, "filled": False, "size": 2.4}
    made["contact"]["label"] = "interface crossing"
    made["bands"] = {"fills": list(BANDS), "color": GREY}
    return made


def frame_of(view: View, store: Store) -> dict[str, Any]:
    """Convert a view to plain data: its call, its tables, and three panels.

    Parameters
    ----------
    view : View
    store : Store
        Store of the arrays.
    """
    tables: list[dict[str, Any]] = []
    panels: list[dict[str, Any]] = []
    run, diagram, overlay = view.run, view.diagram, view.overlay
    names = [] if run is None else list(run.columns)
    state = view.setup.y
    if run is not None:
        rows = kept_rows(run)
        columns = np.column_stack([run.t, *(run[name] for name in names)])[rows]
        tables.append(_run_table(run, columns, store))
        planes = [("t", state)]
        if len(names) > 1:
            other = names[1] if len(run.states) == 1 else next(s for s in names if s != state)
            planes.append((other, state) if len(run.states) == 1 else (state, other))
        for x, y in planes:
            panels.append(_panel(x, y, _bands(view, x, y)))
            last = _last_period(run, columns[:, 0]) if x != "t" else 0
            panels[-1]["lines"] = _motion_lines(names, x, y, last, len(columns))
            points = np.column_stack(at_crossings(run, Quantity(x), Quantity(y)))
            panels[-1]["marks"] = [_contacts(run, points)]
    if diagram is not None:
        main = _panel(diagram.parameter, state, _bands(view, diagram.parameter, state))
        main["over"] = list(diagram.over)
        for branch in diagram.branches:
            if branch.admissible:
                tables.append(_branch_table(branch, store))
                index = 1 + branch.states.index(state)
                main["lines"] += [
                    _line(kind, len(tables) - 1, 0, index, rows.start, rows.stop)
                    for kind, rows in runs(branch)
                ]
        if overlay is not None and run is not None:
            last = _last_period(run, columns[:, 0])
            main["lines"] += _motion_lines(names, diagram.parameter, state, last, len(columns))
            crossings = at_crossings(run, Quantity(diagram.parameter), Quantity(state))
            main["marks"].append(_contacts(run, np.column_stack(crossings)))
            main["marks"] += _transition_marks(view)
            for line in main["lines"]:
                if line["look"] == "stable":
                    line["look"] = "followed"
        elif diagram.parameter in view.model.parameters:
            main["now"] = view.model.parameters[diagram.parameter]
        main["marks"] += _special_marks(view)
        panels.append(main)
    for panel in panels:
        panel["marks"] = [mark for mark in panel["marks"] if mark["points"]]
    return {
        "call": view.call(),
        "outcomes": [str(outcome) for outcome in view.outcomes],
        "tables": tables,
        "panels": panels,
    }


def kept_rows(run: Trajectory) -> NDArray[np.intp]:
    """Rows of a run kept in a page: equidistant ones, turning points, changes of region, jumps."""
    count = len(run.t)
    every = np.arange(0, count, max(count // PAGE_SAMPLES, 1))
    region = run.regions_at(run.t)
    kept = [every, np.array([count - 1]), np.flatnonzero(region[1:] != region[:-1]) + 1]
    jumps = rows_before_jumps(run.t)
    kept += [jumps, jumps + 1]
    for name in run.columns:
        step = np.sign(np.diff(run[name]))
        kept.append(np.flatnonzero(step[1:] * step[:-1] < 0) + 1)
    return np.unique(np.concatenate(kept)).astype(np.intp)


def _run_table(run: Trajectory, columns: Array, store: Store) -> dict[str, Any]:
    states = list(range(1, 1 + len(run.states)))
    slow = list(range(1 + len(run.states), 1 + len(run.columns)))
    return {
        "kind": "run",
        "array": store.add(columns),
        "names": ["t", *run.columns],
        "lines": [group for group in ([0], states, slow) if group],
        "eigenvalues": 0,
        "words": _changes(run.regions_at(columns[:, 0])),
        "jumps": (rows_before_jumps(columns[:, 0]) + 1).tolist(),
    }


def _branch_table(branch: Branch, store: Store) -> dict[str, Any]:
    n = len(branch.states)
    values = branch.eigenvalues
    table = np.column_stack([branch.values, branch.state, values.real, values.imag])
    kinds = zip(branch.region, branch.stability, map(type_of, values), strict=True)
    words = [f"{region}, {linear_words(stability, type_)}" for region, stability, type_ in kinds]
    names = [branch.parameter, *branch.states]
    return {
        "kind": "branch",
        "array": store.add(table),
        "names": names,
        "quoted": [repr(name) for name in names],
        "lines": [[0], list(range(1, 1 + n))],
        "eigenvalues": n,
        "words": _changes(words),
    }


def _changes(words: Iterable[Any]) -> list[tuple[int, str]]:
    """Return the rows at which a text changes, each with the new text.

    Examples
    --------
    >>> _changes(["S1", "S1", "S2"])
    [(0, 'S1'), (2, 'S2')]
    """
    found: list[tuple[int, str]] = []
    for row, word in enumerate(words):
        if not found or found[-1][1] != word:
            found.append((row, str(word)))
    return found


def _panel(x: str, y: str, bands: list[dict[str, Any]]) -> dict[str, Any]:
    names = [greek(x), greek(y)]
    return {"x": x, "y": y, "names": names, "lines": [], "marks": [], "bands": bands}


def greek(name: str) -> str:
    """Replace the name of a Greek letter by the letter.

    Examples
    --------
    >>> greek("omega"), greek("Omega_1"), greek("x")
    ('ω', 'Ω_1', 'x')
    """
    head, *below = name.split("_")
    if head in GREEK:
        size = "CAPITAL" if head[0].isupper() else "SMALL"
        # the Unicode name of lambda
        word = head.upper().replace("LAMBDA", "LAMDA")
        head = lookup(f"GREEK {size} LETTER {word}")
    return "_".join([head, *below])


def _line(look: str, table: int, x: int, y: int, start: int, stop: int) -> dict[str, Any]:
    return {"look": look, "table": table, "x": x, "y": y, "start": start, "stop": stop}


def _motion_lines(
    names: Sequence[str], x: str, y: str, last: int, count: int
) -> list[dict[str, Any]]:
    """Return the lines of the run, the first table, faint before its last period."""
    across, up = (["t", *names].index(name) for name in (x, y))
    lines = [_line("earlier", 0, across, up, 0, last + 1)] if last else []
    return [*lines, _line("trajectory", 0, across, up, last, count)]


def _last_period(run: Trajectory, times: Array) -> int:
    if run.period is None:
        return 0
    return max(int(np.searchsorted(times, times[-1] - run.period, side="right")) - 1, 0)


def _contacts(run: Trajectory, points: Array) -> dict[str, Any]:
    return {
        "look": "contact",
        "points": [
            [*map(float, at), text_of(crossing), f"run.crossings[{k}]"]
            for k, (at, crossing) in enumerate(zip(points, run.crossings, strict=True))
        ],
    }


def _special_marks(view: View) -> list[dict[str, Any]]:
    assert view.diagram is not None
    diagram = view.diagram
    found: dict[str, list[list[Any]]] = {}
    numbers = {point.label: k for k, point in enumerate(diagram.special)}
    named = set()
    for branch in diagram.branches:
        for point in marked_points([branch]) if branch.admissible else ():
            k = numbers[point.label]
            # a branch point is on both branches: it is labelled once
            name = point.label, *np.round([point[diagram.parameter], *point.state], 9)
            found.setdefault(point.code, []).append(
                [
                    point[diagram.parameter],
                    point[view.setup.y],
                    text_of(point, diagram.parameter),
                    f"diagram.special[{k}]",
                    "" if name in named else point.label,
                ]
            )
            named.add(name)
    return [{"look": code, "points": points} for code, points in found.items()]


def _transition_marks(view: View) -> list[dict[str, Any]]:
    assert view.overlay is not None
    overlay = view.overlay
    found: dict[str, list[list[Any]]] = {}
    place = overlay.diagram.states.index(view.setup.y)
    for k, change in enumerate(overlay.transitions):
        at = [change.value, float(change.state[place])]
        found.setdefault(change.type, []).append(
            [*at, text_of(change, overlay.parameter), f"overlay.transitions[{k}]"]
        )
    return [{"look": kind, "points": points} for kind, points in found.items()]


def _bands(view: View, x: str, y: str) -> list[dict[str, Any]]:
    """Return interfaces at a constant value of a state on an axis, and the regions between them."""
    made = []
    values = {} if view.diagram is None else dict(view.diagram.interface_values)
    for axis, name in (("x", x), ("y", y)):
        levels = sorted(value for state, value, *_ in values.values() if state == name)
        if levels:
            made.append({"axis": axis, "levels": levels, "names": _regions(view, name, levels)})
    return made


def _regions(view: View, state: str, levels: list[float]) -> list[str]:
    """Return the region between each two levels if it is unique in the data, else ""."""
    heights, regions = [], []
    if view.run is not None and state in view.run.columns:
        heights.append(view.run[state])
        regions.append(view.run.regions_at(view.run.t))
    for branch in () if view.diagram is None else view.diagram.branches:
        heights.append(branch[state])
        regions.append(branch.region)
    if not heights:
        return [""] * (len(levels) + 1)
    along, names = np.concatenate(heights), np.concatenate(regions)
    edges = np.array([-np.inf, *levels, np.inf])
    margin = 1e-9 * (1.0 + np.ptp(levels))
    named = [
        set(names[(along > low + margin) & (along < high - margin)].tolist())
        for low, high in pairwise(edges)
    ]
    return [str(next(iter(found))) if len(found) == 1 else "" for found in named]
