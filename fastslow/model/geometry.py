"""Which sign patterns of the interfaces are regions, at given parameter values."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import sympy as sp
from numpy.typing import NDArray

Pattern = tuple[int, ...]


def affine_rows(
    functions: Sequence[sp.Expr], moving: Sequence[sp.Symbol]
) -> list[NDArray[np.float64] | None]:
    """Coefficients (a, b) of each function a·z + b of the moving symbols, None if not affine."""
    rows: list[NDArray[np.float64] | None] = []
    for function in functions:
        slopes = [function.diff(z) for z in moving]
        if any(slope.free_symbols for slope in slopes):
            rows.append(None)
            continue
        rest = function.subs(dict.fromkeys(moving, 0))
        rows.append(scaled_row([*map(float, slopes), float(rest)]))
    return rows


def scaled_row(row: Sequence[float]) -> NDArray[np.float64]:
    """Slopes and constant of an affine function, its largest slope one."""
    numbers = np.array(row, dtype=float)
    size = np.abs(numbers[:-1]).max(initial=0.0)
    return numbers / size if size else numbers


def possible_patterns(rows: Sequence[NDArray[np.float64] | None]) -> list[Pattern]:
    """All sign patterns not proved empty, in lexicographic order with + before −.

    Exact for affine functions: a pattern is kept when its open set holds a
    point. Functions that are not affine never exclude a pattern. Patterns grow
    one interface at a time, so an empty beginning is left at once.
    """
    patterns: list[Pattern] = [()]
    for _ in rows:
        patterns = [
            grown for p in patterns for side in (1, -1) if _nonempty(rows, grown := (*p, side))
        ]
    return patterns


def _nonempty(rows: Sequence[NDArray[np.float64] | None], pattern: Pattern) -> bool:
    """Whether s_j (a_j·z + b_j) > 0 has a solution for the affine rows of a pattern."""
    pairs = [(r, s) for r, s in zip(rows, pattern, strict=False) if r is not None]
    if not pairs:
        return True
    system = np.array([row * side for row, side in pairs])
    still = ~system[:, :-1].any(axis=1)
    if np.any(system[still, -1] <= 0):
        return False
    system = system[~still]
    if not len(system):
        return True
    lead = system[0, :-1]
    along = system[:, :-1] @ lead / (lead @ lead)
    if np.allclose(system[:, :-1], along[:, None] * lead, rtol=0, atol=1e-14):
        edge = -system[:, -1] / along
        lower = edge[along > 0].max(initial=-np.inf)
        upper = edge[along < 0].min(initial=np.inf)
        return bool(lower < upper)
    return _feasible(system)


def _feasible(system: NDArray[np.float64]) -> bool:
    from scipy.optimize import linprog

    # maximise the slack, at most 1, that every inequality keeps
    dimension = system.shape[1]
    result = linprog(
        c=np.r_[np.zeros(dimension - 1), -1.0],
        A_ub=np.c_[-system[:, :-1], np.ones(len(system))],
        b_ub=system[:, -1],
        bounds=[(None, None)] * (dimension - 1) + [(None, 1.0)],
        method="highs",
    )
    return bool(result.status == 0 and -result.fun > 1e-12)
