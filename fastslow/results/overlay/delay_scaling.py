"""Measured and predicted delays over a range of rates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastslow.results.base.display import Summarized
from fastslow.results.base.html import Cells
from fastslow.results.base.outcome import Outcome
from fastslow.results.base.result import Result
from fastslow.results.overlay.delays import Delay
from fastslow.results.points import SpecialPoint

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class DelayScaling(Summarized, Result):
    """Simulated and predicted delays past one special point at m rates.

    Parameters
    ----------
    point : SpecialPoint
    parameter : str
        Name of the drifting parameter.
    direction : int
        +1 if it increases, −1 if it decreases.
    event : str
        Event that ends the delay, e.g. ``"x = 1"``.
    eps : ndarray, shape (m,)
        Absolute rates in descending order.
    delay : ndarray, shape (m,)
        Measured delays, in units of the parameter; nan if a run did not reach the event.
    laws : tuple of Delay
        Predicted delay at every rate.
    offset : float
        The power is fitted to delay − offset·eps; zero except for a gap crossing.
    terms : tuple of str
        Basis functions of the fit, e.g. ``("eps^(2/3)", "eps ln eps", "eps")``.
    coefficients, predicted_coefficients : ndarray
        Coefficients of those terms, fitted with equal relative weights, and as predicted
        (nan if the law does not give them). The fit is nan with fewer successful runs than
        terms.
    exponent, uncertainty : float
        Exponent of the power fitted over these rates, and the larger of its standard error
        and the largest deviation of a local exponent: a measure of the departure from a
        single power, not from the limit eps → 0. nan if the law is not a power.
    local_exponents : ndarray, shape (m − 1,)
        d ln(delay − offset·eps) / d ln eps between neighbouring rates.
    law_exponent : float
        Exponent in the limit eps → 0; nan if the law is not a power.
    outcomes : tuple of Outcome
        Outcome of every run.
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
        """Predicted delays, shape (m,)."""
        return np.array([law.delay for law in self.laws])

    @property
    def error(self) -> Array:
        """Relative error of the prediction, measured/predicted − 1, shape (m,)."""
        return self.delay / self.predicted - 1.0

    @property
    def success(self) -> NDArray[np.bool_]:
        """Whether each run reached the event, shape (m,)."""
        return np.array([outcome.success for outcome in self.outcomes])

    def _groups(self) -> list[list[str]]:
        way = "rising" if self.direction > 0 else "falling"
        lines = [
            f"DelayScaling past {self.point.label} with {self.parameter} {way}, to {self.event}: "
            f"{len(self.eps)} rates from {self.eps.min():.3g} to {self.eps.max():.3g}"
        ]
        if np.isfinite(self.exponent):
            of = f"delay − {self.offset:.6g} eps" if self.offset else "delay"
            lines.append(
                f"  {of} scales as eps^({self.exponent:.4f} ± {self.uncertainty:.4f}), "
                f"predicted exponent {self.law_exponent:.4f}"
            )
        else:
            lines.append(f"  not a power of eps: {self.laws[0].law}")
        for term, value, law in zip(
            self.terms, self.coefficients, self.predicted_coefficients, strict=True
        ):
            known = f", predicted {law:.6g}" if np.isfinite(law) else ""
            lines.append(f"  coefficient of {term}: {value:.6g}{known}")
        good = np.isfinite(self.error)
        if good.any():
            worst = float(np.abs(self.error[good]).max())
            lines.append(f"  measured and predicted delays agree within a relative {worst:.2g}")
        failed = [str(outcome) for outcome in self.outcomes if not outcome]
        lines += [f"  {len(failed)} runs failed: {failed[0]}"] if failed else []
        return [lines]

    def _cells(self) -> Cells:
        columns = (self.eps, self.delay, self.predicted, self.error)
        rows = [[f"{value:.6g}" for value in row] for row in zip(*columns, strict=True)]
        return Cells(("eps", "delay", "predicted", "relative error"), rows)
