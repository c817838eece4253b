"""Derivatives of critical rates with respect to other parameters."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fastslow.arguments import Name
from fastslow.errors import ArgumentError, unknown_name
from fastslow.passage.tipping.landings import residual
from fastslow.results.tipping import RateThreshold


def gradient_of_rate(threshold: RateThreshold, name: Name) -> float:
    """Compute the derivative of a critical rate; see `RateThreshold.gradient`."""
    key, own = str(name), threshold.parameter
    if key not in threshold.parameters:
        raise unknown_name("parameter", key, threshold.parameters)
    if key == own:
        raise ArgumentError(f"{key} is the rate itself; expected another parameter")
    if threshold.method == "bisection":
        raise ArgumentError(
            f"the critical rate {own} = {threshold.rate:.6g} was located by bisection, as its edge "
            "is no equilibrium, and has no derivative"
        )
    if threshold.source is None:
        raise ArgumentError(
            "this critical rate has no model (it was read from a file or another process); compute "
            "it again"
        )
    landing, found = threshold.source
    both = replace(landing, names=(own, key))
    unknowns = np.array([threshold.rate, threshold.parameters[key]])
    here = residual(both, unknowns, found.end)
    if here is None or not np.isfinite(here.slopes).all():
        reason = "the run fails" if here is None else here.reason
        raise ArgumentError(f"the critical rate has no derivative with respect to {key}: {reason}")
    by_rate, by_other = here.slopes.tolist()
    return float(-by_other / by_rate)
