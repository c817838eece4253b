"""Linear equations for the natural units of a model."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastslow.results.base.immutable import Immutable

#: Weight, relative to the equations, that sets undetermined units to one.
_UNDETERMINED = 1e-9

#: Coefficients below this size count as zero; no choice of units makes such a term relevant.
NEGLIGIBLE = 1e-60


def negligible(value: complex) -> bool:
    """Return True if a value is too small or too large to be relevant."""
    return not NEGLIGIBLE < abs(value) < 1.0 / NEGLIGIBLE


@dataclass(frozen=True, eq=False, repr=False)
class UnitEquations(Immutable):
    """Linear equations for the logarithms of units, from those of parameter values.

    Parameters
    ----------
    columns : tuple of str
        What is solved for: unknowns, and magnitudes of sums.
    parameters : tuple of str
        The P parameters with values.
    gone : tuple of str
        Those that are too small or too large to count.
    fixed : tuple of str
        Those in exponents, for the values of which alone the equations hold.
    matrix : ndarray, shape (E, columns)
    right : ndarray, shape (E, 1 + P)
        Constants, and coefficients of the logarithms of P parameters.
    """

    columns: tuple[str, ...]
    parameters: tuple[str, ...]
    gone: tuple[str, ...]
    fixed: tuple[str, ...]
    matrix: NDArray[np.float64]
    right: NDArray[np.float64]

    def units(self, names: Sequence[str], values: Mapping[str, float]) -> dict[str, float]:
        """Return the unit of each name, a power of two, at given parameter values."""
        known = {n: math.log2(abs(v)) for n, v in values.items() if v}
        given = [0.0 if n in self.gone else known[n] for n in self.parameters]
        logs = self._solved(np.array(given))
        return {n: _power(logs.get(n, known.get(n, 0.0))) for n in names}

    def _solved(self, logs: NDArray[np.float64]) -> dict[str, float]:
        """Return the least-squares solution of minimal norm."""
        if not self.columns:
            return {}
        normal = self.matrix.T @ self.matrix
        normal[np.diag_indices_from(normal)] += _UNDETERMINED * len(self.matrix)
        right = -(self.right[:, 0] + self.right[:, 1:] @ logs)
        found = np.linalg.solve(normal, self.matrix.T @ right)
        return dict(zip(self.columns, found.tolist(), strict=True))


def _power(log: float) -> float:
    """Return the nearest power of two, well within the range of normal numbers."""
    return float(2.0 ** round(min(max(log, -500.0), 500.0)))
