"""What a run does beyond a fold: whether an attractor remains near, and where it goes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastslow.results.base.outcome import Outcome
from fastslow.results.base.result import Result
from fastslow.results.orbits.orbit import Orbit
from fastslow.results.points import Equilibrium


@dataclass(frozen=True, eq=False, repr=False)
class BeyondFold(Result):
    """Whether an attractor remains near a fold of equilibria or cycles, and where runs go.

    Parameters
    ----------
    point : str
        Label of the fold.
    type : str
        Its description, such as ``"non-smooth fold (boundary equilibrium)"``.
    parameter : str
    value : float
        Of the parameter at the fold.
    distances : ndarray, shape (m,)
        Of the parameter from the fold, decreasing in size, at which a run was made.
    away : ndarray, shape (m,)
        Distance of the attractor that it reached from the fold, in units of the states; infinite
        for an unbounded run, NaN if none is known.
    exponent : float
        Power of the distance to which ``away`` is proportional between the last two; 0 if no
        attractor remains near.
    reached : Equilibrium or Orbit, optional
        The attractor at the smallest distance; None if the run is unbounded, or none is known.
    where : str
        The same in words.
    remains : bool, optional
        Whether an attractor remains near the fold; None if it is not known.
    proved : bool
        Whether that follows from the normal form, or from the dimension; else it is what the runs
        show, a candidate.
    parameters : mapping
    outcome : Outcome
    """

    point: str
    type: str
    parameter: str
    value: float
    distances: NDArray[np.float64]
    away: NDArray[np.float64]
    exponent: float
    reached: Equilibrium | Orbit | None
    where: str
    remains: bool | None
    proved: bool
    parameters: Mapping[str, float]
    outcome: Outcome

    def __repr__(self) -> str:
        if self.remains is None:
            what = "not known whether an attractor remains near"
        else:
            what = "an attractor remains near" if self.remains else "no attractor remains near"
        sure = "proved" if self.proved else "candidate"
        at = f"{self.parameter} = {self.value:.6g}"
        return f"BeyondFold({self.point} at {at}: {what}, {sure}; the run goes to {self.where})"
