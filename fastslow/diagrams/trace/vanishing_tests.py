"""Test functions that vanish along a branch, so that their zeros are not special points."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation.curve_points import VANISHING_ROWS
from fastslow.continuation.marks import Mark, beyond_rounding, size_of
from fastslow.diagrams.field import FrozenField
from fastslow.diagrams.points.kinds import ON_BRANCHES
from fastslow.diagrams.points.on_branches import SurveyedRows
from fastslow.results.branch.branch import Branch

#: Number of branches that a sentence lists.
LISTED = 6


def identical_zeros(
    field: FrozenField, branches: Sequence[Branch], scale: NDArray[np.float64]
) -> Iterator[str]:
    """Yield a sentence for each test that is zero to rounding at most rows of some branches.

    Parameters
    ----------
    scale : ndarray, shape (n + 1,)
        Unit of each state and of the parameter.
    """
    found: dict[tuple[str, str], list[int]] = {}
    for number, branch in enumerate(branches):
        for region, name in enumerate(field.regions):
            rows = np.flatnonzero(branch.region == name)
            if len(rows) < VANISHING_ROWS:
                continue
            values = branch.eigenvalues[rows]
            finite = values[:, np.isfinite(values).all(axis=0)]
            points = np.column_stack([branch.state, branch.values])[rows]
            distance = field.branching(region, points, branch.tangent[rows], scale)
            surveyed = SurveyedRows(
                branch.tangent[rows, -1], distance, finite, np.zeros(len(rows), dtype=bool)
            )
            kind = next((kind for kind in ON_BRANCHES if kind.vanishes(surveyed)), None)
            if kind is not None:
                found.setdefault((name, kind.identical), []).append(number)
    yield from (
        f"Along {_listed(numbers)} in {name} {what}" for (name, what), numbers in found.items()
    )


def unlocated_marks(
    branches: Sequence[Branch], scale: NDArray[np.float64], marks: Sequence[Mark]
) -> Iterator[str]:
    """Yield a sentence for each expression that vanishes, or is not finite, on part of a branch.

    Parameters
    ----------
    scale : ndarray, shape (n + 1,)
        Unit of each state and of the parameter.
    """
    for mark in marks:
        flat: list[int] = []
        undefined: list[int] = []
        for number, branch in enumerate(branches):
            test = mark.test((*branch.states, branch.parameter), branch.parameters)
            # rows at special points may be zeros of the expression
            rows = np.delete(np.arange(len(branch)), branch.special_rows)
            points = np.column_stack([branch.state, branch.values])[rows]
            values = beyond_rounding(test, points, scale, size_of(test, points))
            if np.any((values[1:] == 0) & (values[:-1] == 0)):
                flat.append(number)
            if not np.isfinite(values).all():
                undefined.append(number)
        if flat:
            yield (
                f"Along {_listed(flat)} {mark.words} holds, to rounding: no points of it are "
                "reported where it does."
            )
        if undefined:
            yield (
                f"Along {_listed(undefined)} {mark.words} is not finite at some rows: zeros beside "
                "them may be missing."
            )


def _listed(numbers: Sequence[int]) -> str:
    """Return the numbers of branches as text."""
    listed = ", ".join(map(str, numbers[:LISTED]))
    more = f" and {len(numbers) - LISTED} more" if len(numbers) > LISTED else ""
    return f"branch{'es' if len(numbers) > 1 else ''} {listed}{more}"
