"""Fits of exponents and coefficients to measured delays."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fastslow.passage.delays.local_field import LocalField
from fastslow.results.base.outcome import Outcome
from fastslow.results.overlay.delay_scaling import DelayScaling
from fastslow.results.overlay.delays import BoundaryDelay, Delay, FoldDelay, GapCrossing

Array = NDArray[np.float64]

Terms = dict[str, tuple[Array, float]]


def fitted(
    local: LocalField,
    direction: int,
    event: str,
    eps: Array,
    delay: Array,
    laws: Sequence[Delay],
    outcomes: Sequence[Outcome],
) -> DelayScaling:
    """Fit the terms of the law and a power to measured delays."""
    terms, power, offset = _terms(laws[-1], eps)
    good = np.isfinite(delay) & (delay > 0)
    coefficients = np.full(len(terms), math.nan)
    if good.sum() >= len(terms):
        table = np.column_stack([values for values, _ in terms.values()])[good]
        # equal relative weights: the smallest delays determine the leading term
        weighted = table / delay[good, None]
        coefficients = np.linalg.lstsq(weighted, np.ones(int(good.sum())))[0]
    exponent, uncertainty, exponents = _power(eps, delay - offset * eps)
    if math.isnan(power):
        exponent = uncertainty = math.nan
    return DelayScaling(
        local.point,
        local.field.parameter,
        direction,
        event,
        eps,
        delay,
        tuple(laws),
        offset,
        tuple(terms),
        coefficients,
        np.array([known for _, known in terms.values()]),
        exponent,
        uncertainty,
        exponents,
        power,
        tuple(outcomes),
    )


def _terms(law: Delay, eps: Array) -> tuple[Terms, float, float]:
    """Terms of a law with their predicted coefficients, its exponent and its linear part."""
    log = np.log(eps)
    if isinstance(law, FoldDelay):
        first, second, third = law.coefficients
        terms = {
            "eps^(2/3)": (eps ** (2.0 / 3.0), first),
            "eps ln eps": (eps * log, second),
            "eps": (eps, third),
        }
        return terms, 2.0 / 3.0, 0.0
    if isinstance(law, GapCrossing):
        first = math.sqrt(2.0 * law.length / abs(law.slope))
        terms = {"eps^(1/2)": (np.sqrt(eps), first), "eps": (eps, law.relaxation)}
        return terms, 0.5, law.relaxation
    assert isinstance(law, BoundaryDelay)
    if law.type == "persistence":
        return {"eps": (eps, law.lag / abs(law.rate))}, 1.0, 0.0
    terms = {"eps ln(1/eps)": (-eps * log, 1.0 / law.unstable), "eps": (eps, math.nan)}
    return terms, math.nan, 0.0


def _power(eps: Array, size: Array) -> tuple[float, float, Array]:
    """Fitted exponent with its uncertainty, and exponents between neighbours."""
    log = np.log(np.where(size > 0, size, math.nan))
    exponents = np.diff(log) / np.diff(np.log(eps))
    good = np.isfinite(log)
    if good.sum() < 2:
        return math.nan, math.nan, exponents
    x, y = np.log(eps[good]), log[good]
    x, y = x - x.mean(), y - y.mean()
    exponent = float(x @ y / (x @ x))
    left = y - exponent * x
    error = math.sqrt(float(left @ left) / max(len(x) - 2, 1) / float(x @ x))
    farthest = float(np.abs(exponents[np.isfinite(exponents)] - exponent).max(initial=0.0))
    return exponent, max(error, farthest), exponents
