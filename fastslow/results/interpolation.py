"""States between the rows of a branch, from its tangents."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from fastslow.results.branches import Branch


def hermite(
    branch: Branch, rows: NDArray[np.intp], values: NDArray[np.float64]
) -> NDArray[np.float64]:
    """States between rows ``rows`` and ``rows + 1`` at parameter values, shape (m, n).

    Cubic Hermite in the parameter where both end slopes are finite and mild,
    linear otherwise (beside a fold the slope dx/dp grows without bound).
    """
    p0, p1 = branch.parameter[rows], branch.parameter[rows + 1]
    x0, x1 = branch.state[rows], branch.state[rows + 1]
    width = p1 - p0
    part = ((values - p0) / width)[:, None]
    chord = x1 - x0
    straight = x0 + part * chord
    with np.errstate(divide="ignore", invalid="ignore"):
        m0 = branch.tangent[rows, :-1] / branch.tangent[rows, -1:] * width[:, None]
        m1 = branch.tangent[rows + 1, :-1] / branch.tangent[rows + 1, -1:] * width[:, None]
        cubic = (
            x0 + part * m0 + part**2 * (3 * chord - 2 * m0 - m1) + part**3 * (m0 + m1 - 2 * chord)
        )
    bound = 3.0 * np.abs(chord) + 1e-12 * np.maximum(np.abs(x0), np.abs(x1))
    mild = (np.abs(m0) <= bound) & (np.abs(m1) <= bound)
    return np.where(mild, cubic, straight)
