"""Periodic orbits of a branch as arrays, from which an `Orbit` is made when it is used."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastslow.results.base.outcome import Outcome
from fastslow.results.orbits.orbit import Orbit
from fastslow.results.trajectory.events.jumps import all_events, tables_of_kinds

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
    steps, series, crossing_table : ndarray
        See `Trajectory`.
    reset_table : ndarray, shape (m, 2 + 2 n)
        Resets, events, and changes of switches, as of `all_events`.
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
            template=template,
            parameter=parameter,
            value=orbit.parameters[parameter],
            period=orbit.period,
            multipliers=orbit.multipliers,
            log_multipliers=orbit.log_multipliers,
            trivial=orbit.trivial,
            errors=(orbit.defect, orbit.residual, orbit.accuracy),
            span=run.span,
            end=run.end,
            steps=run.steps,
            series=run.series,
            crossing_table=run.crossing_table,
            reset_table=all_events(run),
        )

    @property
    def _tables(self) -> dict[str, Any]:
        """Tables of resets, events and changes of switches, and the last values of switches."""
        shared = self.template.trajectory
        counts = map(len, (shared.reset_names, shared.event_names, shared.switch_names))
        found: dict[str, Any] = tables_of_kinds(self.reset_table, *counts)
        if shared.switch_names:
            found["end_switches"] = self.series[-1, -len(shared.switch_names) :, 0].copy()
        return found

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
            model=model,
            **self._tables,
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
