"""Delays measured over a range of rates, beside the law."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastslow.results.base.outcome import Outcome
from fastslow.results.base.result import Result
from fastslow.results.overlay.delays import Delay
from fastslow.results.points import SpecialPoint

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class DelayScaling(Result):
    """Delays past one special point at m rates, as simulated and as predicted.

    Parameters
    ----------
    point : SpecialPoint
    parameter : str
        The parameter that drifts.
    direction : int
        +1 where it rises.
    event : str
        What ends the delay, e.g. ``"x = 1"``.
    eps : ndarray, shape (m,)
        Rates without their sign, falling.
    delay : ndarray, shape (m,)
        Measured, in units of the parameter; nan where a run did not get there.
    laws : tuple of Delay
        The prediction at every rate.
    offset : float
        The fitted power is that of delay − offset·eps; zero but for a gap.
    terms : tuple of str
        Of the fit of the delay, e.g. ``("eps^(2/3)", "eps ln eps", "eps")``.
    coefficients, predicted_coefficients : ndarray
        Of those terms, fitted with equal relative weights, and by the law where it
        gives them (nan otherwise). The fit is nan with fewer good runs than terms.
    exponent, uncertainty : float
        Of the power fitted over these rates, and the larger of its standard error and
        the distance of the farthest local exponent: how far it is from being one
        power, not from its limit as eps goes to zero. Nan where the law is no power.
    local_exponents : ndarray, shape (m − 1,)
        d ln(delay − offset·eps) / d ln eps between neighbours.
    law_exponent : float
        The exponent as eps goes to zero; nan where the law is no power.
    outcomes : tuple of Outcome
        How every run ended.
    """

    point: SpecialPoint
    parameter: str
    direction: int
    event: str
    eps: Array
    delay: Array
    laws: tuple[Delay, ...]
    offset: float
    terms: tuple[str, ...]
    coefficients: Array
    predicted_coefficients: Array
    exponent: float
    uncertainty: float
    local_exponents: Array
    law_exponent: float
    outcomes: tuple[Outcome, ...]

    @property
    def predicted(self) -> Array:
        """Delays by the law, shape (m,)."""
        return np.array([law.delay for law in self.laws])

    @property
    def error(self) -> Array:
        """Measured by predicted, minus one, shape (m,)."""
        return self.delay / self.predicted - 1.0

    @property
    def success(self) -> NDArray[np.bool_]:
        """Whether every run got there, shape (m,)."""
        return np.array([outcome.success for outcome in self.outcomes])

    def __repr__(self) -> str:
        way = "rising" if self.direction > 0 else "falling"
        lines = [
            f"DelayScaling past {self.point.label} with {self.parameter} {way}, to {self.event}: "
            f"{len(self.eps)} rates from {self.eps.min():.3g} to {self.eps.max():.3g}"
        ]
        if np.isfinite(self.exponent):
            of = f"delay − {self.offset:.6g} eps" if self.offset else "delay"
            lines.append(
                f"  {of} goes as eps^({self.exponent:.4f} ± {self.uncertainty:.4f}); "
                f"the law has {self.law_exponent:.4f}"
            )
        else:
            lines.append(f"  no power of eps: {self.laws[0].law}")
        for term, value, law in zip(
            self.terms, self.coefficients, self.predicted_coefficients, strict=True
        ):
            known = f", predicted {law:.6g}" if np.isfinite(law) else ""
            lines.append(f"  coefficient of {term}: {value:.6g}{known}")
        good = np.isfinite(self.error)
        if good.any():
            worst = float(np.abs(self.error[good]).max())
            lines.append(f"  measured and predicted differ by at most {worst:.2g} of the delay")
        failed = [str(outcome) for outcome in self.outcomes if not outcome]
        lines += [f"  {len(failed)} runs failed: {failed[0]}"] if failed else []
        return "\n".join(lines)
