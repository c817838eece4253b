"""All Lyapunov exponents of a motion, with their uncertainties."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.results.base.outcome import Outcome
from fastslow.results.base.result import Result
from fastslow.results.trajectory.long_time.lyapunov_exponent import DECIDED

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class LyapunovSpectrum(Result):
    """The mean rates at which perturbations of a motion grow, the largest first.

    Parameters
    ----------
    states : tuple of str
        States and slow states.
    values : ndarray, shape (n,)
        Per unit of time; minus infinity for directions that sliding collapses, NaN if nothing
        was measured. Without forcing one of them is 0 on an attractor that is no equilibrium,
        for perturbations along the motion.
    uncertainties : ndarray, shape (n,)
        Standard errors, from the spread over the blocks.
    blocks : ndarray, shape (k, n)
        The exponents of k successive intervals of time, per unit of time.
    divergence : float
        Mean of the trace of the Jacobian and of log |det S| at crossings, with the saltation
        matrices S: the sum of all exponents by Liouville's formula.
    span : tuple of float
        First and last time of the measurement.
    period : float or None
        Of the forcing.
    outcome : Outcome
        ``"chaotic"``, ``"not chaotic"``, ``"not decided"``, or ``"stopped early"``.
    state : ndarray, shape (n,)
        The state at the end of the measurement.
    parameters : mapping
    equations : str
        The model as text.
    settings : mapping
        The settings of the integration.

    Examples
    --------
    >>> import sympy as sp, fastslow as fs
    >>> x, t = sp.symbols("x t")
    >>> found = fs.lyapunov(fs.Model({x: sp.sin(t) - x / 2}), [0], periods=20)
    >>> print(f"{found.outcome.code}, {found.largest:.9f}, {found.per_period[0]:.9f}")
    not chaotic, -0.500000000, -3.141592654
    """

    states: tuple[str, ...]
    values: Array
    uncertainties: Array
    blocks: Array
    divergence: float
    span: tuple[float, float]
    period: float | None
    outcome: Outcome
    state: Array
    parameters: Mapping[str, float] = field(default_factory=dict)
    equations: str = ""
    settings: Mapping[str, Any] = field(default_factory=dict)

    @property
    def largest(self) -> float:
        """The largest exponent."""
        return float(self.values[0])

    @property
    def per_period(self) -> Array:
        """The exponents per period of the forcing, NaN without one."""
        return self.values * (float("nan") if self.period is None else self.period)

    @property
    def chaotic(self) -> bool:
        """True if the exponents are evidence of chaos: positive, on a bounded recurrent motion."""
        return self.outcome.code == "chaotic"

    @property
    def defect(self) -> float:
        """Difference of the sum of the exponents from Liouville's formula; 0 with sliding."""
        if np.isneginf(self.divergence):
            return 0.0
        return abs(float(self.values.sum()) - self.divergence)

    @property
    def dimension(self) -> float:
        """Lyapunov dimension of the attractor (Kaplan and Yorke 1979).

        j + (λ₁ + … + λⱼ)/|λⱼ₊₁| with the largest j for which the sum is not negative, where
        exponents within four standard errors of 0 count as 0; NaN if nothing was measured.
        """
        if np.isnan(self.values).any():
            return float("nan")
        zero = np.abs(self.values) <= DECIDED * self.uncertainties
        sums = np.cumsum(np.where(zero, 0.0, self.values))
        j = int((sums >= 0).sum())
        if j in (0, len(sums)):
            return float(j)
        return float(j + sums[j - 1] / abs(self.values[j]))

    def __repr__(self) -> str:
        pairs = [*zip(self.values, self.uncertainties, strict=True)]
        shown = ", ".join(f"{value:.4g} ± {error:.2g}" for value, error in pairs[:6])
        more = f", and {len(pairs) - 6} smaller" * (len(pairs) > 6)
        lines = [f"LyapunovSpectrum of {', '.join(self.states)}: {shown}{more} per unit of time"]
        if self.period is not None:
            error = self.uncertainties[0] * self.period
            lines.append(
                f"  largest {self.largest:.4g} ± {self.uncertainties[0]:.2g} per unit of time "
                f"({self.per_period[0]:.4g} ± {error:.2g} per period)"
            )
        lines.append(
            f"  sum {self.values.sum():.6g}, Lyapunov dimension {self.dimension:.4g}, over "
            f"t = {self.span[0]:.6g} to {self.span[1]:.6g}"
        )
        return "\n".join([*lines, f"  {self.outcome}"])
