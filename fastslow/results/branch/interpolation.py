"""Interpolation of a branch between its rows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastslow.results.branch.table import BranchTable

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class Cubics:
    """Cubic interpolants of the states on the steps of a branch.

    Parameters
    ----------
    begin, width : ndarray, shape (m,)
        The parameter at the first row of each step, and its change to the next row.
    powers : ndarray, shape (4, n, m)
        Coefficients of 1, s, s² and s³, where s is the fraction of the step.
    """

    begin: Floats
    width: Floats
    powers: Floats

    def at(self, steps: NDArray[np.intp], values: Floats) -> Floats:
        """Return the states on given steps at parameter values, shape (N, n)."""
        s = (values - self.begin[steps]) / self.width[steps]
        zero, one, two, three = self.powers.take(steps, axis=2)
        return np.asarray(zero + s * one + s**2 * two + s**3 * three).T


def cubics(table: BranchTable, rows: NDArray[np.intp]) -> Cubics:
    """Return interpolants of the steps between rows ``rows`` and ``rows + 1``.

    They are cubic Hermite polynomials in the parameter if both end slopes are finite
    and bounded by the chord, and linear otherwise (near a fold dx/dp is unbounded).
    """
    p0, p1 = table.values[rows], table.values[rows + 1]
    x0, x1 = table.state[rows], table.state[rows + 1]
    width = p1 - p0
    chord = x1 - x0
    with np.errstate(divide="ignore", invalid="ignore"):
        m0 = table.tangent[rows, :-1] / table.tangent[rows, -1:] * width[:, None]
        m1 = table.tangent[rows + 1, :-1] / table.tangent[rows + 1, -1:] * width[:, None]
        bound = 3.0 * np.abs(chord) + 1e-12 * np.maximum(np.abs(x0), np.abs(x1))
        mild = (np.abs(m0) <= bound) & (np.abs(m1) <= bound)
        two = np.where(mild, 3 * chord - 2 * m0 - m1, 0.0)
        three = np.where(mild, m0 + m1 - 2 * chord, 0.0)
    powers = np.array([x0, np.where(mild, m0, chord), two, three])
    return Cubics(p0, width, np.ascontiguousarray(powers.transpose(0, 2, 1)))


def hermite(table: BranchTable, rows: NDArray[np.intp], values: Floats) -> Floats:
    """Interpolate states between ``rows`` and ``rows + 1`` at parameter values, shape (m, n)."""
    return cubics(table, rows).at(np.arange(len(rows)), values)
