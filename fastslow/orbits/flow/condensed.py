"""Solution of the linearised equations of multiple shooting from their blocks.

Householder transformations of two blocks at a time eliminate y_1, …, y_{K-1} of
`fastslow.orbits.flow.blocks` (Wright 1992), which is stable where perturbations grow and where they
decay; the closing equations in the first state are solved by their singular value decomposition.
The cost is that of K blocks of n + 2 instead of one matrix of K (n + 1) + 1.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from fastslow.orbits.flow.blocks import Blocks

Array = NDArray[np.float64]

#: Singular values below this fraction of the largest one are zero to rounding.
NULL = 1e-12


class Condensed:
    """Blocks in units of unknowns and rows, condensed to equations of the first state.

    Parameters
    ----------
    blocks : Blocks
    """

    def __init__(self, blocks: Blocks) -> None:
        self.blocks = blocks
        K, n, P = blocks.sizes
        m = n + 2
        width = 1 + P
        self._turned: list[Array] = []
        self._upper: list[tuple[Array, Array]] = []
        own, following, border = self._with_time(0)
        for k in range(1, K):
            ahead, beyond, more = self._with_time(k)
            turn, upper = np.linalg.qr(np.vstack([following, ahead]), mode="complete")
            beside = np.zeros((2 * m, 2 * m + width))
            beside[:m, :m], beside[:m, 2 * m :] = own, border
            beside[m:, m : 2 * m], beside[m:, 2 * m :] = beyond, more
            beside = turn.T @ beside
            self._turned.append(turn)
            self._upper.append((upper[:m], beside[:m]))
            own, following, border = (beside[m:, :m], beside[m:, m : 2 * m], beside[m:, 2 * m :])
        # the first state, the first duration, the last time, the period and the parameters
        closing = np.zeros((m + 1, n + 2 + width))
        closing[:m, :n] = own[:, :n] + following[:, :n]
        closing[:m, n], closing[:m, n + 1] = own[:, n + 1], following[:, n]
        closing[:m, n + 2 :] = border
        closing[m, :n], closing[m, n + 2 :] = blocks.last[:n], blocks.last[n:]
        self._closing = np.linalg.svd(closing)

    def _with_time(self, k: int) -> tuple[Array, Array, Array]:
        """Coefficients of a segment with t_{k+1} = t_k + d_k."""
        blocks, (_, n, P) = self.blocks, self.blocks.sizes
        row = np.zeros((1, n + 2))
        row[0, n:] = -1.0
        beyond = np.zeros((1, n + 2))
        beyond[0, n] = 1.0
        return (
            np.vstack([blocks.own[k], row]),
            np.vstack([blocks.following[k], beyond]),
            np.vstack([blocks.border[k], np.zeros((1, 1 + P))]),
        )

    @property
    def is_regular(self) -> bool:
        """Whether all segments but the first could be eliminated."""
        return all(np.diagonal(upper).all() for upper, _ in self._upper)

    @cached_property
    def rank(self) -> int:
        """Number of independent closing equations."""
        sizes = self._closing[1]
        return int((sizes > NULL * sizes[0]).sum())

    @property
    def is_isolated(self) -> bool:
        """Whether the equations are independent."""
        return self.rank == len(self._closing[1])

    def step(self, residual: Array) -> Array:
        """The solution for a residual; of a family, that of the least change of the first state."""
        blocks = self.blocks
        K, n, _ = blocks.sizes
        m = n + 2
        by_segment = np.column_stack([-blocks.by_segment(residual), np.zeros(K)])
        sides, right = [], by_segment[0]
        for k, turn in enumerate(self._turned, start=1):
            both = turn.T @ np.concatenate([right, by_segment[k]])
            sides.append(both[:m])
            right = both[m:]
        left, sizes, vectors = self._closing
        r = self.rank
        part = left[:, :r].T @ np.append(right, -residual[-1]) / sizes[:r]
        return self._back(vectors[:r].T @ part, sides)

    def tangent(self) -> Array:
        """The null vector of the equations with one parameter."""
        count = len(self._upper)
        m = self.blocks.sizes[1] + 2
        return self._back(self._closing[2][-1], [np.zeros(m)] * count)

    def _back(self, closing: Array, sides: list[Array]) -> Array:
        """All unknowns from those of the closing equations."""
        n = self.blocks.sizes[1]
        m, border = n + 2, closing[n + 2 :]
        first = np.concatenate([closing[:n], [0.0, closing[n]]])
        after = np.concatenate([closing[:n], [closing[n + 1], 0.0]])
        ahead = []
        for (upper, beside), side in zip(self._upper[::-1], sides[::-1], strict=True):
            right = side - beside @ np.concatenate([first, after, border])
            after = np.linalg.solve(upper, right)
            ahead.append(after)
        table = np.array([first, *ahead[::-1]])
        return np.concatenate([table[:, :n].reshape(-1), table[:, m - 1], border])
