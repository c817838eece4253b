"""A maximal canard: a trajectory from the attracting to the repelling slow manifold."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.results.base.display import Summarized
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.results.base.outcome import Outcome
from fastslow.results.base.result import Result
from fastslow.results.base.table import Row, Table
from fastslow.results.trajectory.trajectory import Trajectory


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Canard(Summarized, Table[Row], Result):
    """The connection of the attracting to the repelling slow manifold past a fold.

    As a table it is the trajectory in order of time, which is 0 on the section.

    Parameters
    ----------
    parameter : str
    value : float
        Value of the parameter at which the manifolds meet; NaN if they do not.
    accuracy : float
        Bound on the error of ``value``: rounding on the section divided by ``slope``, exp(−K),
        and the change of ``value`` if the starts are not corrected to first order.
    contraction : float
        K, the smaller ∫|Re λ| dt between a start and the section: deviations of the starts decay
        by exp(−K).
    slope : float
        Derivative of the gap with respect to the parameter.
    gap : float
        Difference of the slow state between the manifolds on the section, at ``value``.
    evaluations : int
        Number of pairs of trajectories.
    section : str
        Expression that vanishes on the section.
    states : tuple of str
        Fast and slow state.
    fold : NamedMapping of float
        The fold at ``value``.
    attracting, repelling : Trajectory
        From the start on the attracting sheet to the section, and from the section to the start
        on the repelling sheet.
    parameters : mapping
        All values, at ``value``.
    outcome : Outcome
        ``"connected"``, or the reason why there is no canard.
    """

    parameter: str
    value: float
    accuracy: float
    contraction: float
    slope: float
    gap: float
    evaluations: int
    section: str
    states: tuple[str, ...]
    fold: NamedMapping[float]
    attracting: Trajectory
    repelling: Trajectory
    parameters: Mapping[str, float]
    outcome: Outcome

    _row = "t"
    _places = ("t",)

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Columns: t, which is 0 on the section, the states, and the side of the fold."""
        before, after = self.attracting, self.repelling
        one, other = before.t - before.t[-1], after.t - after.t[0]
        side = np.array(["attracting"] * len(one) + ["repelling"] * len(other))
        states = {n: np.concatenate([before[n], after[n]]) for n in self.states}
        return {"t": np.concatenate([one, other]), **states, "sheet": side}

    def _groups(self) -> list[list[str]]:
        if not self.outcome:
            return [[f"Canard: {self.outcome}"]]
        at = ", ".join(f"{n} = {v:.6g}" for n, v in self.fold.items())
        return [
            [
                f"Canard at {self.parameter} = {self.value:.16g}, past the fold at {at}",
                f"  error below {self.accuracy:.2g}: gap of {self.gap:.2g} on {self.section} = 0 "
                f"with slope {self.slope:.6g}; contraction exp(−{self.contraction:.3g})",
            ]
        ]
