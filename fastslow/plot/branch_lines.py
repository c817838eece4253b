"""Stability intervals of a branch and its special points, in the plane or in space."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.text import Annotation
from numpy.typing import NDArray

from fastslow.plot.layout.labels import label_of, tag
from fastslow.plot.layout.style import PSEUDO, SLIDING_SIGN, dot_look
from fastslow.plot.layout.typesetting import plain
from fastslow.plot.quantities import Quantity, at_points
from fastslow.results.branch.branch import Branch
from fastslow.results.branch.windows import LEFT
from fastslow.results.points import UNDECIDED, SpecialPoint, by_title

#: Longest text beside an end point; longer ones are shown on hover only.
LONGEST_NOTE = 24


def runs(branch: Branch) -> Iterator[tuple[str, slice]]:
    """Yield intervals of constant stability as (kind, rows); neighbours share a row.

    Pseudo-equilibria are kinds of their own.
    """
    kinds = branch.stability
    if not branch.admissible or len(kinds) < 2:
        yield str(kinds[0]) if branch.admissible and len(kinds) else "virtual", slice(0, len(kinds))
        return
    sliding = np.array([SLIDING_SIGN in region for region in branch.region])
    for kind, rows in stability_runs(kinds):
        # a boundary equilibrium belongs to the region beside the sliding motion
        steps = sliding[rows][:-1] | sliding[rows][1:]
        edges = np.flatnonzero(steps[1:] != steps[:-1]) + 1
        for start, stop in zip([0, *edges], [*edges, len(steps)], strict=True):
            name = kind + PSEUDO if steps[start] else kind
            part = slice(rows.start + int(start), rows.start + int(stop) + 1)
            # the two rows of a boundary equilibrium bound no line
            if np.ptp(branch.state[part], axis=0).any() or np.ptp(branch.values[part]):
                yield name, part


def stability_runs(kinds: NDArray[np.str_]) -> Iterator[tuple[str, slice]]:
    """Yield intervals of constant stability as (kind, rows); neighbours share a row."""
    if len(kinds) < 2:
        yield from ((str(kind), slice(0, 1)) for kind in kinds)
        return
    # a grazing orbit has no multipliers: its row is drawn as the next one with multipliers
    known = np.flatnonzero(kinds != "unknown")
    if len(known):
        following = np.searchsorted(known, np.arange(len(kinds)))
        kinds = kinds[known[np.minimum(following, len(known) - 1)]]
    # a step from a single neutral row (a fold, a Hopf point) has the stability of its other end,
    # and so has one from a row on a two-fold, where the sliding vector field is 0/0
    open_ = (kinds[:-1] == "neutral") | (kinds[:-1] == UNDECIDED)
    steps = np.where(open_, kinds[1:], kinds[:-1])
    breaks = np.flatnonzero(steps[1:] != steps[:-1]) + 1
    for start, stop in zip([0, *breaks], [*breaks, len(steps)], strict=True):
        if stop > start:
            yield str(steps[start]), slice(int(start), int(stop) + 1)


def draw_points(
    ax: Any, points: Sequence[SpecialPoint], shown: Sequence[Quantity], label: bool
) -> tuple[tuple[Line2D, ...], tuple[Annotation, ...]]:
    """Draw and label special points in the plane or in space, one marker for each kind."""
    markers: list[Line2D] = []
    labels: list[Annotation] = []
    entries = Counter[str]()
    for title, same in by_title(points).items():
        at, code = np.column_stack(at_points(same, *shown)), same[0].code
        markers += ax.plot(*at.T, **dot_look(code, number=entries[code]), zorder=5, label=title)
        entries[code] += 1
        if label:
            # a branch point is on both branches: it is labelled once
            spots = {(_words(p), *np.round(s, 9)): s for p, s in zip(same, at, strict=True)}
            labels += [tag(ax, plain(word), spot) for (word, *_), spot in spots.items()]
    return tuple(markers), tuple(labels)


def _words(point: SpecialPoint) -> str:
    if not point.kind.end:
        return label_of(point)
    if 0 < len(point.note) <= LONGEST_NOTE:
        return point.note
    # the reason for an early end
    return point.type or point.label


def marked_points(branches: Sequence[Branch]) -> list[SpecialPoint]:
    """Return the special points to be marked; an end point only where tracing failed."""
    return [p for branch in branches for p in _shown(branch)]


def _shown(branch: Branch) -> list[SpecialPoint]:
    # an end at infinity is outside of the figure
    usual = [o.success or o.code == LEFT for o in branch.outcomes]
    ends = {0: usual[0], len(branch) - 1: usual[1]}
    return [
        p
        for p, row in zip(branch.special, branch.special_rows, strict=True)
        if not p.kind.end or not ends.get(row, True)
    ]
