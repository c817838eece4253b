"""Lyapunov exponents of a motion with their uncertainties, and what their signs mean."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.results.base.outcome import Outcome
from fastslow.results.base.result import Result

Floats = NDArray[np.float64]

#: Distance from zero, in standard errors, at which a sign is significant: with ten blocks,
#: Student's t exceeds it with a probability of 0.2 %.
DECIDED = 4.0

#: Smallest growth and decay over the measurement, as exponents of e, for a significant sign:
#: without chaos separations grow by a bounded factor, or as a power of time.
SIGNIFICANT_GROWTH, SIGNIFICANT_DECAY = 10.0, 1.0

#: Exponents in a repr, of a motion with many states.
SHOWN = 6


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class LyapunovExponents(Result):
    """The mean rates at which perturbations of a motion grow, the largest first.

    `fastslow.lyapunov` computes all of them, `fastslow.classify_regime` the largest one.

    Parameters
    ----------
    states : tuple of str
        The n states and slow states.
    values : ndarray, shape (j,)
        The j = n or j = 1 largest exponents, per unit of time; minus infinity for directions that
        sliding collapses or in which nearby trajectories merge, NaN if nothing was measured.
        Without forcing one of n is 0 on an attractor that is no equilibrium, for perturbations
        along the motion.
    uncertainties : ndarray, shape (j,)
        Standard errors, from the spread over the blocks.
    blocks : ndarray, shape (k, j)
        The exponents of k successive intervals of equal length, per unit of time.
    divergence : float
        Mean of the trace of the Jacobian and of log |det S| at crossings, with the saltation
        matrices S: the sum of n exponents by Liouville's formula. NaN for the largest alone.
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
    >>> gear = fs.systems.harmonic_gear_from_physical().with_parameters(D=0.5, omega=1.3)
    >>> fs.classify_regime(gear, [0, 0]).motions[0].exponents.chaotic
    True
    """

    states: tuple[str, ...]
    values: Floats
    uncertainties: Floats
    blocks: Floats
    divergence: float
    span: tuple[float, float]
    period: float | None
    outcome: Outcome
    state: Floats
    parameters: Mapping[str, float] = field(default_factory=dict)
    equations: str = ""
    settings: Mapping[str, Any] = field(default_factory=dict)

    @property
    def complete(self) -> bool:
        """True if all exponents were computed, False for the largest alone."""
        return len(self.values) == len(self.states)

    @property
    def largest(self) -> float:
        """The largest exponent."""
        return float(self.values[0])

    @property
    def per_period(self) -> Floats:
        """The exponents per period of the forcing, NaN without one."""
        return self.values * (float("nan") if self.period is None else self.period)

    @property
    def chaotic(self) -> bool:
        """True if the exponents are evidence of chaos: positive, on a bounded recurrent motion."""
        return self.outcome.code == "chaotic"

    @property
    def defect(self) -> float:
        """Difference of the sum of the exponents from Liouville's formula; 0 with sliding.

        NaN for the largest alone.
        """
        if np.isneginf(self.divergence):
            return 0.0
        return abs(float(self.values.sum()) - self.divergence)

    @property
    def dimension(self) -> float:
        """Lyapunov dimension of the attractor (Kaplan and Yorke 1979).

        j + (λ₁ + … + λⱼ)/|λⱼ₊₁| with the largest j for which the sum is not negative, where
        exponents within four standard errors of 0 count as 0; NaN for the largest alone, and if
        nothing was measured.
        """
        if not self.complete or np.isnan(self.values).any():
            return float("nan")
        zero = np.abs(self.values) <= DECIDED * self.uncertainties
        sums = np.cumsum(np.where(zero, 0.0, self.values))
        j = int((sums >= 0).sum())
        if j in (0, len(sums)):
            return float(j)
        return float(j + sums[j - 1] / abs(self.values[j]))

    @property
    def words(self) -> str:
        """The largest exponent with its uncertainty, per unit of time and per period."""
        error = float(self.uncertainties[0])
        text = f"{self.largest:.4g} ± {error:.2g} per unit of time"
        if self.period is not None:
            text += f" ({self.per_period[0]:.4g} ± {error * self.period:.2g} per period)"
        return text

    def __repr__(self) -> str:
        of, during = ", ".join(self.states), f"t = {self.span[0]:.6g} to {self.span[1]:.6g}"
        if not self.complete:
            lines = [f"LyapunovExponents of {of}: the largest is {self.words}, over {during}"]
            return "\n".join([*lines, f"  {self.outcome}"])
        pairs = [*zip(self.values, self.uncertainties, strict=True)]
        shown = ", ".join(f"{value:.4g} ± {error:.2g}" for value, error in pairs[:SHOWN])
        more = f", and {len(pairs) - SHOWN} smaller" * (len(pairs) > SHOWN)
        lines = [f"LyapunovExponents of {of}: {shown}{more} per unit of time"]
        if self.period is not None:
            lines.append(f"  largest {self.words}")
        total, dimension = self.values.sum(), self.dimension
        lines.append(f"  sum {total:.6g}, Lyapunov dimension {dimension:.4g}, over {during}")
        return "\n".join([*lines, f"  {self.outcome}"])


def sign_of(value: float, uncertainty: float, length: float) -> int:
    """Return the sign of an exponent, 0 if it is not significant.

    Parameters
    ----------
    value, uncertainty : float
        Per unit of time.
    length : float
        Length of the measurement.

    Examples
    --------
    >>> sign_of(0.9, 0.01, 1e3), sign_of(-0.5, 0.0, 1e3), sign_of(1e-3, 0.0, 1e3)
    (1, -1, 0)
    """
    if not abs(value) > DECIDED * uncertainty:
        return 0
    return int(value * length > SIGNIFICANT_GROWTH) - int(value * length < -SIGNIFICANT_DECAY)


def motion_outcome(
    value: float, uncertainty: float, length: float, leaves: bool, again: Outcome
) -> Outcome:
    """Classify a motion by its largest exponent.

    Parameters
    ----------
    value, uncertainty : float
        Per unit of time.
    length : float
        Length of the measurement.
    leaves : bool
        Whether the states grow throughout.
    again : Outcome
        Whether the motion repeats.

    Examples
    --------
    >>> motion_outcome(0.9, 0.01, 1e3, False, Outcome("not periodic", "", False)).code
    'chaotic'
    """
    if leaves:
        text = "not decided: the states grow throughout, and the run may diverge."
        return Outcome("not decided", text, False)
    sign = sign_of(value, uncertainty, length)
    if sign < 0:
        text = "not chaotic: nearby trajectories approach each other."
        return Outcome("not chaotic", text, True)
    if again:
        grow = "; it is unstable, as nearby trajectories separate" if sign > 0 else ""
        return Outcome("not chaotic", f"not chaotic: {again.message[:-1]}{grow}.", True)
    if sign > 0:
        text = "chaotic: nearby trajectories separate exponentially, and the motion is bounded "
        return Outcome("chaotic", text + "and does not repeat.", True)
    bound = abs(value) + max(DECIDED * uncertainty, SIGNIFICANT_GROWTH / length)
    text = (
        "not decided: the exponent is zero within its uncertainty, as of quasi-periodic "
        f"motion or of chaos weaker than {bound:.2g} per unit of time; simulate for longer."
    )
    return Outcome("not decided", text, False)
