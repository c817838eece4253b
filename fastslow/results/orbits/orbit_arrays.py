"""Periodic orbits of a branch as arrays, from which an `Orbit` is made when it is used."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastslow.results.base.outcome import Outcome
from fastslow.results.orbits.orbit import Orbit

Array = NDArray[np.float64]


class OrbitArrays(NamedTuple):
    """A periodic orbit of a branch.

    Parameters
    ----------
    template : Orbit
        Another orbit of the branch, for all that they have in common.
    parameter : str
    value : float
        Of the continuation parameter.
    period : float
    multipliers : ndarray of complex128, shape (n,)
    log_multipliers : ndarray, shape (n,)
    trivial : int or None
    errors : (float, float, float)
        Defect, residual and accuracy (see `Orbit`).
    span : (float, float)
    end : ndarray, shape (1 + n,)
    steps, series, crossing_table, reset_table : ndarray
        See `Trajectory`.
    """

    template: Orbit
    parameter: str
    value: float
    period: float
    multipliers: NDArray[np.complex128]
    log_multipliers: Array
    trivial: int | None
    errors: tuple[float, float, float]
    span: tuple[float, float]
    end: Array
    steps: Array
    series: Any
    crossing_table: Array
    reset_table: Array

    @classmethod
    def of(cls, orbit: Orbit, template: Orbit, parameter: str) -> OrbitArrays:
        """The arrays of an orbit."""
        run = orbit.trajectory
        return cls(
            template,
            parameter,
            orbit.parameters[parameter],
            orbit.period,
            orbit.multipliers,
            orbit.log_multipliers,
            orbit.trivial,
            (orbit.defect, orbit.residual, orbit.accuracy),
            run.span,
            run.end,
            run.steps,
            run.series,
            run.crossing_table,
            np.zeros((0, 2 + 2 * len(run.states))) if run.reset_table is None else run.reset_table,
        )

    def orbit(self) -> Orbit:
        """The orbit."""
        shared, multiple = self.template.trajectory, self.template.multiple
        model = shared.model
        if model is not None:
            model = model.with_parameters({self.parameter: self.value})
        run = replace(
            shared,
            parameters={**shared.parameters, self.parameter: self.value},
            period=None if multiple is None else self.period / multiple,
            span=self.span,
            end=self.end,
            steps=self.steps,
            series=self.series,
            crossing_table=self.crossing_table,
            reset_table=None if shared.reset_table is None else self.reset_table,
            model=model,
        )
        return Orbit(
            run,
            self.period,
            multiple,
            self.multipliers,
            self.log_multipliers,
            self.trivial,
            *self.errors,
            outcome_of(self.period),
        )


def outcome_of(period: float) -> Outcome:
    """The outcome of an orbit of a branch."""
    if np.isfinite(period):
        return Outcome("periodic", f"periodic with T = {period:.9g}.", True)
    return Outcome("homoclinic", "a homoclinic orbit, cut off near its saddle.", True)
