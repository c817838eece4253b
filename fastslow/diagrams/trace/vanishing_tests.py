"""Test functions that vanish along a branch, so that their zeros are not special points."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from fastslow.diagrams.field import FrozenField
from fastslow.diagrams.trace.row_tests import FLAT, mostly, vanishing_sums
from fastslow.results.branch.branch import Branch

#: On fewer rows a test may be small by chance.
ROWS = 8

#: Number of branches that a sentence lists.
LISTED = 6

#: What is said of branches whose test for branch points, or for pairs of eigenvalues, vanishes.
FLAT_BRANCH = "equilibria are not isolated, to rounding: no branch points are reported there."
ALIKE_PAIR = (
    "the sum of two eigenvalues is zero to rounding: no Hopf points and neutral saddles of this "
    "pair are reported there."
)


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
            if len(rows) < ROWS:
                continue
            values = branch.eigenvalues[rows]
            finite = values[:, np.isfinite(values).all(axis=0)]
            points = np.column_stack([branch.state, branch.values])[rows]
            distance = field.branching(region, points, branch.tangent[rows], scale)
            if mostly(np.abs(distance) < FLAT):
                found.setdefault((name, FLAT_BRANCH), []).append(number)
            elif mostly(vanishing_sums(finite)):
                found.setdefault((name, ALIKE_PAIR), []).append(number)
    for (name, what), numbers in found.items():
        listed = ", ".join(map(str, numbers[:LISTED]))
        more = f" and {len(numbers) - LISTED} more" if len(numbers) > LISTED else ""
        plural = "es" if len(numbers) > 1 else ""
        yield f"Along branch{plural} {listed}{more} in {name} {what}"
