"""Lyapunov exponents: the largest one of a run of an ensemble, and what exponents mean."""

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
    """The mean rate at which nearby trajectories separate, of a run that `classify_regime` found.

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
    >>> import fastslow as fs
    >>> gear = fs.systems.harmonic_gear_from_physical().with_parameters(D=0.5, omega=1.3)
    >>> fs.classify_regime(gear, [0, 0]).motions[0].exponent.chaotic
    True
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
    bound = abs(value) + max(DECIDED * uncertainty, GROWN / length)
    text = (
        "not decided: the exponent is zero within its uncertainty, as of quasi-periodic "
        f"motion or of chaos weaker than {bound:.2g} per unit of time; simulate for longer."
    )
    return Outcome("not decided", text, False)
