"""Sign patterns of the interface functions that are nonempty regions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import ModelError

Pattern = tuple[int, ...]

#: Digits to which the directions of parallel functions agree.
DIRECTION_DIGITS = 12

#: Number of regions from which a model is refused: the rates of each are derived and compiled.
MOST_REGIONS = 1024


def scaled_row(row: Sequence[float]) -> NDArray[np.float64]:
    """Return slopes and constant of an affine function, scaled to a largest slope of one."""
    numbers = np.array(row, dtype=float)
    size = np.abs(numbers[:-1]).max(initial=0.0)
    return numbers / size if size else numbers


def possible_patterns(rows: Sequence[NDArray[np.float64] | None]) -> list[Pattern]:
    """Return the sign patterns not proved empty, in lexicographic order with + before −.

    Exact for affine functions: a pattern is kept when its open set holds a
    point. Functions that are not affine never exclude a pattern. A function that is zero
    everywhere has the sign 0. Patterns grow one interface at a time, so an empty beginning is
    left at once.

    Raises
    ------
    ModelError
        For more than `MOST_REGIONS` patterns.
    """
    groups = [(places, _Lines([rows[j] for j in places])) for places in _independent(rows)]

    def possible(pattern: Pattern) -> bool:
        last = len(pattern) - 1
        # functions of other symbols do not restrict the last one
        places, lines = next(group for group in groups if last in group[0])
        return lines.meet(tuple(pattern[j] for j in places if j <= last))

    patterns: list[Pattern] = [()]
    for _ in rows:
        sides = (1, 0, -1)
        patterns = [grown for p in patterns for side in sides if possible(grown := (*p, side))]
        if len(patterns) > MOST_REGIONS:
            raise ModelError(
                f"the {len(rows)} interfaces divide the states into more than {MOST_REGIONS} "
                "regions, which are formed together where some of them have names, or where it is "
                "unknown that they are so many; leave out the names, or write some of the "
                "switching as smooth functions"
            )
    return patterns


def fewest_patterns(rows: Sequence[NDArray[np.float64] | None]) -> tuple[int, bool]:
    """Return a number of sign patterns that is not too large, and whether it is their number.

    Every combination of the intervals into which parallel functions divide their common direction
    is possible if these directions are linearly independent.

    Examples
    --------
    >>> fewest_patterns([np.array([1.0, -1.0, 0.5]), np.array([1.0, -1.0, -0.5]), None])
    (6, True)
    """
    levels: dict[tuple[float, ...], set[float]] = {}
    count = 1
    for row in rows:
        if row is None:
            count *= 2
        elif row[:-1].any():
            lead = row[np.flatnonzero(row[:-1])[0]]
            direction = tuple((row[:-1] / lead).round(DIRECTION_DIGITS).tolist())
            levels.setdefault(direction, set()).add(float(row[-1] / lead))
    independent: list[tuple[float, ...]] = []
    for direction in levels:
        if np.linalg.matrix_rank(np.array([*independent, direction])) > len(independent):
            independent.append(direction)
            count *= 1 + len(levels[direction])
    return count, len(independent) == len(levels)


def _independent(rows: Sequence[NDArray[np.float64] | None]) -> list[list[int]]:
    """Return the functions in groups without common symbols."""
    groups: list[tuple[list[int], set[int]]] = []
    for number, row in enumerate(rows):
        places, symbols = [number], set() if row is None else {*np.flatnonzero(row[:-1]).tolist()}
        for group in [g for g in groups if g[1] & symbols]:
            groups.remove(group)
            places, symbols = [*group[0], *places], symbols | group[1]
        groups.append((sorted(places), symbols))
    return [places for places, _ in groups]


class _Lines:
    """Affine functions; those that are parallel are compared by their roots."""

    def __init__(self, rows: Sequence[NDArray[np.float64] | None]) -> None:
        self.rows = rows
        self.found: dict[Pattern, bool] = {}
        known = [row for row in rows if row is not None]
        lead = next((row[:-1] for row in known if row[:-1].any()), None)
        #: For every function its constant, its slope along the first one that has a slope
        #: and whether it has no other, and its zero along that direction.
        self.entries: list[tuple[float, float | None, bool, float] | None] = []
        for row in rows:
            if row is None:
                self.entries.append(None)
            elif lead is None or not row[:-1].any():
                self.entries.append((float(row[-1]), None, True, 0.0))
            else:
                along = float(row[:-1] @ lead / (lead @ lead))
                parallel = bool((np.abs(row[:-1] - along * lead) <= 1e-14).all())
                zero = float(-row[-1] / along) if parallel else 0.0
                self.entries.append((float(row[-1]), along, parallel, zero))

    def meet(self, pattern: Pattern) -> bool:
        """Return True if all a_j·z + b_j have the signs s_j of a pattern in an open set."""
        if pattern not in self.found:
            self.found[pattern] = self._meet(pattern)
        return self.found[pattern]

    def _meet(self, pattern: Pattern) -> bool:
        lower, upper, parallel = -np.inf, np.inf, True
        for entry, side in zip(self.entries, pattern, strict=False):
            if entry is None:
                if side == 0:
                    return False
                continue
            constant, along, single, zero = entry
            if along is None:
                if np.sign(constant) != side:
                    return False
            elif side == 0:
                return False
            elif not single:
                parallel = False
            elif along * side > 0:
                lower = max(lower, zero)
            else:
                upper = min(upper, zero)
        if parallel:
            return lower < upper
        pairs = zip(self.rows, pattern, strict=False)
        system = np.array([r * s for r, s in pairs if r is not None and r[:-1].any()])
        return _feasible(system)


def _feasible(system: NDArray[np.float64]) -> bool:
    from scipy.optimize import linprog

    # maximise the common slack of the inequalities, at most 1
    dimension = system.shape[1]
    result = linprog(
        c=np.r_[np.zeros(dimension - 1), -1.0],
        A_ub=np.c_[-system[:, :-1], np.ones(len(system))],
        b_ub=system[:, -1],
        bounds=[(None, None)] * (dimension - 1) + [(None, 1.0)],
        method="highs",
    )
    return bool(result.status == 0 and -result.fun > 1e-12)
