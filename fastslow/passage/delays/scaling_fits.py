"""Fits of exponents and coefficients to measured delays."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fastslow.passage.delays.local_field import LocalField
from fastslow.results.base.outcome import Outcome
from fastslow.results.overlay.delay_scaling import DelayScaling
from fastslow.results.overlay.delays import Delay

Array = NDArray[np.float64]


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
    law = laws[-1]
    terms, power, offset = law.terms, law.exponent, law.offset
    good = np.isfinite(delay) & (delay > 0)
    coefficients = np.full(len(terms), math.nan)
    if good.sum() >= len(terms):
        table = np.column_stack([term.of(eps) for term in terms])[good]
        # equal relative weights: the smallest delays determine the leading term
        weighted = table / delay[good, None]
        coefficients = np.linalg.lstsq(weighted, np.ones(int(good.sum())))[0]
    exponent, uncertainty, exponents = _power(eps, delay - offset * eps)
    if math.isnan(power):
        exponent = uncertainty = math.nan
    return DelayScaling(
        point=local.point,
        parameter=local.field.parameter,
        direction=direction,
        event=event,
        eps=eps,
        delay=delay,
        laws=tuple(laws),
        offset=offset,
        terms=tuple(term.name for term in terms),
        coefficients=coefficients,
        predicted_coefficients=np.array([term.coefficient for term in terms]),
        exponent=exponent,
        uncertainty=uncertainty,
        local_exponents=exponents,
        law_exponent=power,
        outcomes=tuple(outcomes),
    )


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
