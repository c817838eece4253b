"""Equilibria on intersections of discontinuities, excluded by the hull of the adjacent fields."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations

import numpy as np
import sympy as sp

from fastslow.certification.boxes.linking import enclosed
from fastslow.certification.equations import exact_rates
from fastslow.kernels.intervals.printer import interval_program
from fastslow.model.model import Model
from fastslow.model.motions import continuity

#: Largest number of boxes, from which on an intersection remains open.
BOXES = 4096


def open_intersections(
    model: Model, parameter: str, ranges: Mapping[str, tuple[float, float]]
) -> list[tuple[str, str]]:
    """Return pairs of discontinuities whose intersection may contain equilibria in a window.

    At an equilibrium on the intersection zero is in the convex hull of the fields of the regions
    (Filippov 1988). The window is bisected, and boxes are dropped that do not meet both
    interfaces, or in which a rate has one sign in all regions.
    """
    states, last, functions, rates = exact_rates(model, parameter)
    jumps = continuity(model.partition)
    names = [name for name in model.interfaces if not jumps[name]]
    heights = dict(zip(model.interfaces, functions, strict=True))
    window = np.array([ranges[s.name] for s in (*states, *last)])
    return [
        (one, other)
        for one, other in combinations(names, 2)
        if not _excluded([heights[one], heights[other]], rates, (*states, *last), window)
    ]


def _excluded(
    heights: Sequence[sp.Expr],
    rates: Sequence[Sequence[sp.Expr]],
    unknowns: Sequence[sp.Symbol],
    window: np.ndarray,
) -> bool:
    count, n = len(heights), len(rates[0])
    program = interval_program([*heights, *(r for region in rates for r in region)], unknowns)
    low, high = window[:, 0][None, :].copy(), window[:, 1][None, :].copy()
    unit = np.where(high > low, high - low, 1.0)
    while 0 < len(low) <= BOXES:
        below, above = enclosed(program, low, high)
        first, last = below[:, :count], above[:, :count]
        # a bound that is not a number excludes nothing
        kept = ~((first > 0.0) | (last < 0.0)).any(axis=1)
        fields = slice(count, count + n * len(rates))
        first = below[:, fields].reshape(len(low), len(rates), n).min(axis=1)
        last = above[:, fields].reshape(len(low), len(rates), n).max(axis=1)
        kept &= ~((first > 0.0) | (last < 0.0)).any(axis=1)
        low, high = np.repeat(low[kept], 2, axis=0), np.repeat(high[kept], 2, axis=0)
        rows = np.arange(len(low))
        widest = np.argmax((high - low) / unit, axis=1)
        middle = 0.5 * low[rows, widest] + 0.5 * high[rows, widest]
        lower = rows % 2 == 0
        high[rows[lower], widest[lower]] = middle[lower]
        low[rows[~lower], widest[~lower]] = middle[~lower]
    return not len(low)
