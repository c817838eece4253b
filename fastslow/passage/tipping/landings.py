"""Runs that land on the stable manifold of an edge: one condition, solved by Newton's method."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastslow.model.model import Model
from fastslow.orbits.derivatives.run_sensitivities import path_through
from fastslow.results.trajectory.trajectory import Trajectory
from fastslow.simulation.one import simulate
from fastslow.simulation.settings import Integration

Array = NDArray[np.float64]

#: Error control of runs to which Newton's method is applied.
FINE = Integration(rtol=1e-14)

#: Steps of Newton's method for one length of the run, the correction in units of the unknowns at
#: which they end, and the least decrease of a correction.
LANDING_STEPS, LANDING_TOLERANCE, LANDING_DECREASE = 12, 2e-15, 0.5

#: A correction that no longer decreases is rounding below this size.
LANDING_ROUNDING = 1e-10

#: Logarithm by which the distance from the edge grows while the run is prolonged once, at first and
#: at most.
PROLONGATION, LONGEST_PROLONGATION = 2.0, 8.0

#: Steps of Newton's method up to which the next prolongation is longer, and the factor.
FEW_STEPS, LENGTHENED = 4, 1.6

#: Least prolongation, and number of prolongations.
LEAST_PROLONGATION, MOST_PROLONGATIONS = 0.03, 80

#: Change of the unknowns, in their units, between two lengths of the run, that is rounding.
LANDED_CHANGE = 1e-14


@dataclass(frozen=True, eq=False)
class Target:
    """The edge at the end of a run; of a moving sheet, the state of it beside that end.

    Parameters
    ----------
    state : ndarray, shape (n,)
    adjoint : ndarray, shape (n,)
        Left eigenvector ψ of the unstable eigenvalue.
    growth : float
        The eigenvalue.
    slopes : ndarray, shape (n, k)
        Derivatives of the state with respect to the unknowns.
    """

    state: Array
    adjoint: Array
    growth: float
    slopes: Array


class EdgeLanding(ABC):
    """Condition ψᵀ(x(T) − x_e(T)) = 0 in k unknowns: a run lands on the manifold of an edge.

    The stable manifold of an edge has codimension one; ψ is the left eigenvector of its unstable
    eigenvalue.
    """

    #: Time at which runs begin.
    begin: float

    @property
    @abstractmethod
    def parameters(self) -> tuple[tuple[int, str], ...]:
        """Unknowns that are parameters of the run, each with its number."""

    @abstractmethod
    def model(self, unknowns: Array) -> Model:
        """The model of the run."""

    @abstractmethod
    def start(self, unknowns: Array) -> tuple[Array, Array] | None:
        """Initial state (n,) and its derivatives with respect to the unknowns (n, k)."""

    @abstractmethod
    def target(self, unknowns: Array, end: float, state: Array) -> Target | None:
        """The edge at the end of the run, at which its state is given."""


@dataclass(frozen=True, eq=False)
class Residual:
    """The condition at values of the unknowns.

    Parameters
    ----------
    value : float
    slopes : ndarray, shape (k,)
    run : Trajectory
    growth : float
        Rate at which the distance from the edge grows at the end.
    reason : str
        Why the run has no derivatives, empty if it has.
    """

    value: float
    slopes: Array
    run: Trajectory
    growth: float
    reason: str = ""


@dataclass(frozen=True, eq=False)
class Landed:
    """Unknowns for which a run lands on the stable manifold of an edge.

    Parameters
    ----------
    unknowns : ndarray, shape (k,)
    end : float
        Time at the end of the run.
    change : float
        Largest change of an unknown by the last prolongation of the run.
    residual : Residual
    steps : int
        Steps of Newton's method for the first length of the run.
    """

    unknowns: Array
    end: float
    change: float
    residual: Residual
    steps: int


@dataclass(frozen=True, eq=False)
class Constraint:
    """Equations normal·(z − point) = 0 beside the condition, and the range of the unknowns.

    Parameters
    ----------
    normals : ndarray, shape (k − 1, k)
    point : ndarray, shape (k,)
    scale, lower, upper : ndarray, shape (k,)
        Unit and range of every unknown.
    """

    normals: Array
    point: Array
    scale: Array
    lower: Array
    upper: Array

    @classmethod
    def of_one(cls, value: float, low: float, high: float) -> Constraint:
        """No equation beside the condition, in one unknown."""
        scale = max(abs(value), np.finfo(float).tiny)
        return cls(
            np.empty((0, 1)),
            np.array([value]),
            np.array([scale]),
            np.array([low]),
            np.array([high]),
        )


def residual(landing: EdgeLanding, unknowns: Array, end: float) -> Residual | None:
    """Evaluate the condition with its derivatives, None if the run fails."""
    begun = landing.start(unknowns)
    if begun is None:
        return None
    start, moved = begun
    if not np.isfinite(start).all():
        return None
    run = simulate(landing.model(unknowns), start, t=(landing.begin, end), integration=FINE)
    if not run.outcome:
        return None
    n = len(run.states)
    ending = run.end[1 : n + 1]
    target = landing.target(unknowns, end, ending)
    if target is None:
        return None
    miss = float(target.adjoint @ (ending - target.state))
    names = [*run.states, *(name for _, name in landing.parameters)]
    path = path_through(run, names, np.array([end]))
    final = path.values[-1]
    if not np.isfinite(final).all():
        none = np.full(len(unknowns), np.nan)
        return Residual(miss, none, run, target.growth, str(path.outcome))
    slopes = final[:, :n] @ moved - target.slopes
    for column, (number, _) in enumerate(landing.parameters):
        slopes[:, number] += final[:, n + column]
    return Residual(miss, target.adjoint @ slopes, run, target.growth)


def solved(
    landing: EdgeLanding, guess: Array, end: float, constraint: Constraint
) -> tuple[Array, int, float] | None:
    """Solve for the unknowns at one length of the run.

    With them, the number of Newton steps, and the rate at which the distance from the edge grows.
    """
    last, z, scale = np.inf, guess.copy(), constraint.scale
    for used in range(1, LANDING_STEPS + 1):
        here = residual(landing, z, end)
        if here is None or not np.isfinite(here.slopes).all():
            return None
        matrix = np.vstack([here.slopes, constraint.normals]) * scale
        right = -np.append(here.value, constraint.normals @ (z - constraint.point))
        rows = np.abs(matrix).max(axis=1)
        if not rows.all():
            return None
        try:
            step = np.linalg.solve(matrix / rows[:, None], right / rows)
        except np.linalg.LinAlgError:
            return None
        size = float(np.abs(step).max())
        if size > LANDING_DECREASE * last:
            return (z, used, here.growth) if size < LANDING_ROUNDING else None
        last, z = size, z + step * scale
        if not (np.all(z >= constraint.lower) and np.all(z <= constraint.upper)):
            return None
        if size <= LANDING_TOLERANCE:
            return z, used, here.growth
    return None


def landed(landing: EdgeLanding, guess: Array, end: float, constraint: Constraint) -> Landed | None:
    """Solve for the unknowns with ever longer runs, until they no longer change."""
    begun = solved(landing, guess, end, constraint)
    if begun is None:
        return None
    (z, steps, growth), change, length = begun, np.inf, PROLONGATION
    for _ in range(MOST_PROLONGATIONS):
        if not growth > 0.0:
            return None
        later = end + length / growth
        found = solved(landing, z, later, constraint)
        if found is None:
            length *= 0.5
            if length < LEAST_PROLONGATION:
                break
            continue
        change, (z, used, growth), end = float(np.abs(found[0] - z).max()), found, later
        if change <= LANDED_CHANGE * float(constraint.scale.max()):
            break
        if used <= FEW_STEPS:
            length = min(length * LENGTHENED, LONGEST_PROLONGATION)
    here = residual(landing, z, end)
    if here is None or not np.isfinite(change):
        return None
    return Landed(z, end, change, here, steps)
