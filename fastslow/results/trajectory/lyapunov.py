"""The largest Lyapunov exponent of a motion, with its uncertainty."""

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
GROWN, SHRUNK = 10.0, 1.0


@dataclass(frozen=True, eq=False, repr=False)
class LyapunovExponent(Result):
    """The mean rate at which nearby trajectories separate.

    Parameters
    ----------
    value : float
        Per unit of time; minus infinity if nearby trajectories merge, NaN if nothing
        was measured.
    uncertainty : float
        Standard error of the value, from the spread over the blocks.
    blocks : ndarray, shape (k,)
        The exponent of each of k successive intervals of equal length, per unit of time.
    span : tuple of float
        First and last time of the measurement.
    period : float or None
        Of the forcing.
    interval : float
        Time between renormalisations of the separation.
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
    >>> found = fs.lyapunov_exponent(fs.Model({x: sp.sin(t) - x / 2}), [0], periods=20)
    >>> print(f"{found.outcome.code}, {found.value:.6f}, per period {found.per_period:.6f}")
    not chaotic, -0.500000, per period -3.141593
    """

    value: float
    uncertainty: float
    blocks: Floats
    span: tuple[float, float]
    period: float | None
    interval: float
    outcome: Outcome
    state: Floats
    parameters: Mapping[str, float] = field(default_factory=dict)
    equations: str = ""
    settings: Mapping[str, Any] = field(default_factory=dict)

    @property
    def per_period(self) -> float:
        """The exponent per period of the forcing, NaN without one."""
        return self.value * self.period if self.period is not None else float("nan")

    @property
    def chaotic(self) -> bool:
        """True if the exponent is evidence of chaos: positive, on a bounded recurrent motion."""
        return self.outcome.code == "chaotic"

    def __repr__(self) -> str:
        return f"LyapunovExponent {self.words}: {self.outcome}"

    @property
    def words(self) -> str:
        """The value with its uncertainty, per unit of time and per period."""
        text = f"{self.value:.4g} ± {self.uncertainty:.2g} per unit of time"
        if self.period is not None:
            each = self.uncertainty * self.period
            text += f" ({self.per_period:.4g} ± {each:.2g} per period)"
        return text


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
    return int(value * length > GROWN) - int(value * length < -SHRUNK)
