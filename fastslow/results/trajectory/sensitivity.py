"""Sensitivities: derivatives of a trajectory with respect to parameters and initial states."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import Name, class_of, shown
from fastslow.errors import ArgumentError, unknown_name
from fastslow.results.base.framed import Framed
from fastslow.results.base.outcome import Outcome
from fastslow.results.base.result import Result

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class Sensitivity(Framed, Result):
    """Derivatives of a trajectory with respect to parameters and initial states.

    ``found["x", "k"]`` is the derivative of x by k at the times ``found.t``.

    Parameters
    ----------
    states, parameters : tuple of str
        The states; the names by which they are differentiated.
    t : ndarray, shape (N,)
        Times of the samples of the run.
    values : ndarray, shape (n, p, N)
        Derivatives at fixed times, at an event those after it; NaN from the time on at which
        there is no derivative.
    final : ndarray, shape (n, p)
        Derivatives of the final state. If the length of the run was given in periods, the final
        time depends on the parameters of the forcing, and so does this derivative.
    final_rate : ndarray, shape (n,)
        Rates of the states at the end.
    crossing_times : ndarray, shape (n_crossings, p)
        Derivatives of the times of ``run.crossings``.
    reset_times : ndarray, shape (n_resets, p)
        Derivatives of the times of ``run.resets``.
    switch_times : ndarray, shape (n_changes, p)
        Derivatives of the times of ``run.switches``.
    period : ndarray, shape (p,)
        Derivatives of the period of the forcing; NaN without one.
    stroboscopic : ndarray, shape (n, p, K)
        Derivatives of ``run.stroboscopic()``, whose instants depend on the period; empty without
        forcing.
    extremes : mapping
        State to the derivatives of its minimum and maximum, shape (2, p).
    outcome : Outcome
        ``"tangential crossing"`` and others where the run has no derivative from some time on.
    equations : str
        The model as text.
    event_times : ndarray, shape (n_executions, p)
        Derivatives of the times of ``run.events``.
    """

    states: tuple[str, ...]
    parameters: tuple[str, ...]
    t: Array
    values: Array
    final: Array
    final_rate: Array
    crossing_times: Array
    reset_times: Array
    switch_times: Array
    period: Array
    stroboscopic: Array
    extremes: Mapping[str, Array]
    outcome: Outcome
    equations: str = ""
    settings: Mapping[str, Any] = field(default_factory=dict)
    event_times: Array = field(default_factory=partial(np.zeros, (0, 0)))

    def __getitem__(self, key: tuple[Name, Name]) -> Array:
        if class_of(key) != "a tuple" or len(key) != 2:
            raise ArgumentError(
                f"received {shown(key)}; expected a state and a parameter, as in "
                f'found["{self.states[0]}", "{self.parameters[0]}"]'
            )
        state, parameter = map(str, key)
        if state not in self.states:
            raise unknown_name("state", state, self.states)
        if parameter not in self.parameters:
            raise unknown_name("parameter", parameter, self.parameters)
        return self.values[self.states.index(state), self.parameters.index(parameter)]

    def to_dict(self) -> dict[str, Array]:
        """Return time t and all derivatives, as ``dx/dk``."""
        return {
            "t": self.t,
            **{f"d{s}/d{p}": self[s, p] for s in self.states for p in self.parameters},
        }

    def __repr__(self) -> str:
        by = ", ".join(self.parameters)
        lines = [f"Sensitivity of {', '.join(self.states)} to {by} at {len(self.t)} times"]
        for name, column in zip(self.parameters, self.final.T, strict=True):
            shown = ", ".join(
                f"d{s}/d{name} = {v:.6g}" for s, v in zip(self.states, column, strict=True)
            )
            lines.append(f"  at the end {shown}")
        return "\n".join([*lines, f"  {self.outcome}"])
