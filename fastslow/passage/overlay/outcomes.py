"""Outcome of an overlay: what of the run the diagram does not cover."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastslow.passage.slow_quantities import FrozenResult
from fastslow.results.base.outcome import Outcome
from fastslow.results.overlay.overlay import MEASURED
from fastslow.results.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]

#: Relative variation below which a quantity is constant.
HELD_CONSTANT = 1e-9


def held_quantity(diagram: FrozenResult, run: Trajectory) -> str | None:
    """Name of a slow quantity of the run that is constant in the diagram, if any."""
    for name, value in diagram.parameters.items():
        if (
            name in run.columns
            and np.abs(run[name] - value).max() > HELD_CONSTANT * np.abs(run[name]).max()
        ):
            return name
    return None


def outcome_of(
    diagram: FrozenResult, run: Trajectory, values: Array, compared: bool, what: str
) -> Outcome:
    """Outcome: the interval of the run that the diagram does not cover, or other limitations."""
    name, (low, high) = diagram.parameter, diagram.over
    held = held_quantity(diagram, run)
    if held is not None:
        return Outcome(
            "another slow quantity",
            f"{held} = {diagram.parameters[held]:.6g} in the diagram, but varies from "
            f"{run[held].min():.6g} to {run[held].max():.6g} in the run, which moves the special "
            "points; delays are not computed.",
            False,
        )
    outside = (values < low) | (values > high)
    if outside.any():
        weight = np.diff(run.t)
        total = float(weight.sum()) or 1.0
        share = float(weight[outside[:-1]].sum()) / total
        return Outcome(
            "outside the diagram",
            f"{name} varies from {values.min():.6g} to {values.max():.6g}, the diagram covers "
            f"{low:.6g} to {high:.6g}: {share:.1%} of the time is not measured; "
            f"continue the {what} over the whole range.",
            False,
        )
    if not run.outcome:
        return Outcome("cut short", f"the run ended early: {run.outcome}", False)
    if not np.ptp(values) > HELD_CONSTANT * np.abs(values).max():
        return Outcome(
            "at rest",
            f"{name} = {values[0]:.6g} is constant in the run: there are no passages and no lags.",
            False,
        )
    if not compared:
        return Outcome(
            "not compared",
            "the models of diagram and run could not be compared: their equations are not both "
            "known, or are written differently.",
            False,
        )
    return MEASURED
