"""Changes of the number of unstable eigenvalues that no special point of a branch explains."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastslow.results.base.display import Displayed
from fastslow.results.branch.table import BranchTable
from fastslow.results.points import NEUTRAL_REAL_PART


@dataclass(frozen=True)
class UnexplainedChange(Displayed):
    """A change of the number of unstable eigenvalues without a special point that explains it.

    Parameters
    ----------
    branch : int
        Index of the branch in its diagram; 0 for a single branch.
    rows : (int, int)
        The rows of the branch between which the number changes.
    parameter : str
        Name of the parameter.
    interval : (float, float)
        Values of the parameter at these rows, in the order of the branch.
    before, after : int
        Number of eigenvalues with positive real part at the two rows.
    """

    branch: int
    rows: tuple[int, int]
    parameter: str
    interval: tuple[float, float]
    before: int
    after: int

    def __str__(self) -> str:
        first, last = self.interval
        return (
            f"branch {self.branch}: unstable eigenvalues change from {self.before} to "
            f"{self.after} between {self.parameter} = {first:.8g} and {last:.8g}, and no special "
            "point explains it"
        )


def unstable_range(
    eigenvalues: NDArray[np.complex128],
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return bounds of the number of eigenvalues with positive real part, shape (...).

    The bounds differ by the eigenvalues whose real part is zero to rounding or NaN;
    infinite ones count by their sign.

    Parameters
    ----------
    eigenvalues : ndarray of complex, shape (..., n)

    Examples
    --------
    >>> least, largest = unstable_range(np.array([[1.0, -2.0], [1e-17, -2.0]]))
    >>> least.tolist(), largest.tolist()
    ([1, 0], [1, 1])
    """
    # NumPy reduces a short last axis slowly
    values = np.ascontiguousarray(np.moveaxis(np.asarray(eigenvalues), -1, 0))
    size = np.where(np.isfinite(values), np.abs(values), 0.0)
    small = NEUTRAL_REAL_PART * size.max(axis=0, initial=0.0)
    undecided = np.isnan(values) | (np.abs(values.real) <= small)
    certain = (values.real > 0) & ~undecided
    return certain.sum(axis=0), (certain | undecided).sum(axis=0)


def unexplained_changes(table: BranchTable, number: int = 0) -> tuple[UnexplainedChange, ...]:
    """Return the changes along a branch that its special points do not explain.

    The number of unstable eigenvalues changes by one at a fold or branch point, by two
    at a Hopf point, by zero at a neutral saddle and by any number between regions.
    """
    steps: dict[int, list[int | None]] = {}
    for point, row in zip(table.special, table.special_rows, strict=True):
        if point.kind.changes_stability:
            steps.setdefault(row, []).append(point.kind.unstable)
    jumps = set(table.region_changes.tolist())
    low, high = unstable_range(table.eigenvalues)
    return tuple(
        UnexplainedChange(
            number,
            (since, row),
            table.free[0],
            (float(table.values[since]), float(table.values[row])),
            int(low[since]),
            int(low[row]),
        )
        for since, row in unexplained_rows(low, high, steps, jumps)
    )


def unexplained_rows(
    low: NDArray[np.intp],
    high: NDArray[np.intp],
    steps: Mapping[int, Sequence[int | None]],
    jumps: Collection[int] = (),
) -> list[tuple[int, int]]:
    """Return rows between which the number of unstable eigenvalues changes unexplained.

    Parameters
    ----------
    low, high : ndarray of int, shape (N,)
        The least and largest number at every row.
    steps : dict of int to list
        The changes at the special points of some rows, None for any number. The number
        at these rows themselves is undecided.
    jumps : collection of int
        First rows of another region, at which it may change by any number.

    Returns
    -------
    list of (int, int)
        The last row with a known number, and the row at which it differs.

    Examples
    --------
    >>> low = np.array([0, 0, 0, 2, 2])
    >>> unexplained_rows(low, low, {2: [2]}), unexplained_rows(low, low, {2: [1]})
    ([], [(1, 3)])
    """
    most = int(high.max(initial=0))
    found = []
    # the possible numbers at the row, and the last row at which the number was unique
    possible = set(range(most + 1))
    since, done = 0, -1
    for row in _eventful(low, high, [*steps, *jumps]):
        if row - 1 > done and low[row - 1] == high[row - 1]:
            since = row - 1
        done = row
        changes = steps.get(row, ())
        if None in changes or row in jumps:
            possible = set(range(most + 1))
        for step in changes:
            if step is not None:
                possible |= {p + s for p in possible for s in (-step, step)}
        here = set(range(int(low[row]), int(high[row]) + 1))
        if not changes:
            if not possible & here:
                found.append((since, row))
                possible = here
            possible &= here
            if len(here) == 1:
                since = row
    return found


def _eventful(low: NDArray[np.intp], high: NDArray[np.intp], places: Collection[int]) -> list[int]:
    """Return rows that differ from the previous one, given rows, and the row after each."""
    eventful = np.ones(len(low), dtype=bool)
    eventful[1:] = (np.diff(low) != 0) | (np.diff(high) != 0)
    near = np.array([*places, *(place + 1 for place in places)], dtype=np.intp)
    eventful[near[(near >= 0) & (near < len(low))]] = True
    rows: list[int] = np.flatnonzero(eventful).tolist()
    return rows
