"""Folds as tipping points: whether an attractor remains near, and where runs go."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import Name, finite, formula, instance, validated
from fastslow.diagrams.solve.solving import equilibria
from fastslow.errors import ArgumentError, refuse_events, refuse_switches, unknown_name
from fastslow.model.model import Model
from fastslow.passage.tipping.ends_of_shifts import UNBOUNDED, UNDECIDED_END, FutureSystem
from fastslow.results.base.outcome import Outcome
from fastslow.results.fold_departures import BeyondFold
from fastslow.results.orbits.orbit import Orbit
from fastslow.results.orbits.special_orbit import SpecialOrbit
from fastslow.results.points import Equilibrium, SpecialPoint
from fastslow.simulation.arguments import require_values
from fastslow.simulation.settings import Integration
from fastslow.sweeps.survey import extent_of

Array = NDArray[np.float64]

#: Error control of the runs.
DEPARTING = Integration(rtol=1e-11)

#: Distances from the fold at which runs are made, in units of the given one.
FOLD_DISTANCES = (1.0, 0.1, 0.01, 0.001)

#: Fraction to which the distance of an attractor, or of the branch, from the fold decreases over
#: these distances if it tends to the fold: ∛0.001 at least.
TENDS_TO_FOLD = 0.15

#: Relative difference of the periods of one orbit near a fold.
FOLD_PERIOD = 0.05

#: States up to which no bounded motion remains without an equilibrium: a closed orbit of a
#: continuous planar field surrounds one.
PLANAR = 2


@validated(
    model=instance(Model),
    point=instance(SpecialPoint, SpecialOrbit),
    parameter=formula,
    distance=finite,
)
def beyond_fold(
    model: Model, point: SpecialPoint | SpecialOrbit, parameter: Name, distance: float
) -> BeyondFold:
    """Determine whether an attractor remains near a fold, and to which one a run goes.

    Runs start at the fold, with the parameter at four ever smaller distances beyond it. If the
    attractor that they reach tends to the fold with the distance, it remains near, as may be the
    case at non-smooth folds (Simpson 2024: generically none does); else the fold is a tipping
    point.

    Parameters
    ----------
    model : Model
        Whose equilibria or orbits were continued, with values of all other parameters.
    point : SpecialPoint or SpecialOrbit
        A fold, smooth or not, of equilibria or of periodic orbits.
    parameter : str or Symbol
        Of the branch.
    distance : float
        The first distance beyond the fold, with its sign; on this side there is no branch.

    Returns
    -------
    BeyondFold
        ``proved`` at a smooth fold of equilibria, whose normal form leaves no attractor, and at a
        non-smooth one of a continuous field with one or two states, in which bounded motion needs
        an equilibrium; otherwise what the runs show is a candidate.

    Raises
    ------
    UnknownNameError
        For a name that is no parameter.
    ArgumentError
        For a point at which the branch does not turn, a distance of 0, or of the side on which the
        branch is.

    See Also
    --------
    fastslow.critical_rate, fastslow.minimal_shock, fastslow.continue_equilibria

    Examples
    --------
    >>> import sympy as sp, fastslow as fs
    >>> x, p = sp.symbols("x p")
    >>> model = fs.Model({x: p + sp.Abs(x) - x**2}, parameters={p: 0})
    >>> (fold,) = fs.continue_equilibria(model, "p", over=(-0.2, 1)).special("BE")
    >>> fs.beyond_fold(model, fold, "p", 0.01)
    BeyondFold(BE1 at p = 0: no attractor remains near, proved; the run goes to x = 1.00001)
    """
    name = str(parameter)
    refuse_switches(model.switches, "beyond_fold")
    refuse_events(model.events, "beyond_fold")
    if name not in (*model.parameters, *model.free):
        raise unknown_name("parameter", name, (*model.parameters, *model.free))
    if not point.turns:
        raise ArgumentError(
            f"point: {point.label} is a {point.words}, at which the branch does not turn; expected "
            "a fold, smooth or not"
        )
    if not distance:
        raise ArgumentError("distance = 0; expected one beyond the fold, with its sign")
    found = _Departure(model, point, name, distance)
    require_values(found.system(distance).model)
    return found.result()


@dataclass(frozen=True, eq=False)
class _Departure:
    """Runs from a fold at ever smaller distances of the parameter beyond it."""

    model: Model
    point: SpecialPoint | SpecialOrbit
    name: str
    distance: float

    @property
    def value(self) -> float:
        return float(self.point.parameters[self.name])

    @property
    def places(self) -> Array:
        """States of the fold, shape (m, n)."""
        if isinstance(self.point, SpecialPoint):
            return self.point.state[None]
        return _rows(self.point.orbit)

    def system(self, distance: float) -> FutureSystem:
        known = (*self.model.parameters, *self.model.free)
        given = {n: float(v) for n, v in self.point.parameters.items() if n in known}
        model = self.model.with_parameters({**given, self.name: self.value + distance})
        if model.period() is not None:
            return FutureSystem(model, (), DEPARTING)
        return FutureSystem.of(model, DEPARTING)

    def away(self, states: Array, size: Array) -> float:
        """Largest distance of some states from the nearest of the fold."""
        apart = np.abs((states[:, None] - self.places[None]) / size).max(axis=2)
        return float(apart.min(axis=1).max())

    def result(self) -> BeyondFold:
        distances = self.distance * np.array(FOLD_DISTANCES)
        systems = [self.system(one) for one in distances.tolist()]
        start = self.places[:1]
        ends = [int(s.reached(start, np.zeros(1, dtype=np.int64))[0]) for s in systems]
        attractors = [s.known[k] if k >= 0 else None for s, k in zip(systems, ends, strict=True)]
        known = [self.places, *(_states(one) for one in attractors if one is not None)]
        size = extent_of(np.vstack(known))
        self._require_absence(systems, size)
        without = [np.inf if k == UNBOUNDED else np.nan for k in ends]
        away = np.array(
            [
                none if one is None else self.away(_states(one), size)
                for one, none in zip(attractors, without, strict=True)
            ]
        )
        remains = None if np.isnan(away[-1]) else _tends(away)
        proved = self._proved()
        if proved:
            remains = False
        exponent = float(np.log10(away[-2] / away[-1])) if remains else 0.0
        words = systems[-1].words(ends[-1], None).removeprefix("tips ").removeprefix("to ")
        words = words.removeprefix("tips, ")
        return BeyondFold(
            point=self.point.label,
            type=self.point.words,
            parameter=self.name,
            value=self.value,
            distances=distances,
            away=away,
            exponent=exponent,
            reached=attractors[-1],
            where="no known attractor" if ends[-1] == UNDECIDED_END else words,
            remains=remains,
            proved=proved,
            parameters=dict(self.point.parameters),
            outcome=_outcome(remains, proved),
        )

    def _proved(self) -> bool:
        """Whether no attractor can remain near."""
        point = self.point
        if not isinstance(point, SpecialPoint):
            return False
        if point.interface is None:
            return bool(point.coefficient)
        continuous = self.model.continuous.get(point.interface, False)
        return bool(continuous) and not self.model.resets and len(self.model.states) <= PLANAR

    def _require_absence(self, systems: list[FutureSystem], size: Array) -> None:
        """Raise if the branch is on the side of the distance."""
        at = f"distance = {self.distance:g}: the branch exists on this side of {self.point.label}"
        if isinstance(self.point, SpecialPoint):
            near = []
            for system in (systems[0], systems[-1]):
                states = [e.state for e in equilibria(system.model) if e.admissible]
                near.append(min((self.away(s[None], size) for s in states), default=np.inf))
            if _tends(np.array(near)):
                raise ArgumentError(f"{at}; expected the other sign")
            return
        last = systems[-1].known
        for one in last:
            same = isinstance(one, Orbit) and one.multiple == self.point.orbit.multiple
            if same and isinstance(one, Orbit):
                apart = abs(one.period / self.point.orbit.period - 1.0)
                if apart < FOLD_PERIOD and self.away(_rows(one), size) < FOLD_PERIOD:
                    raise ArgumentError(f"{at}; expected the other sign")


def _tends(away: Array) -> bool:
    """Whether distances tend to 0 with that of the parameter."""
    return bool(np.isfinite(away).all() and away[-1] <= TENDS_TO_FOLD * away[0])


def _rows(orbit: Orbit) -> Array:
    return np.asarray(orbit(orbit.trajectory.t)).T


def _states(one: Equilibrium | Orbit) -> Array:
    return one.state[None] if isinstance(one, Equilibrium) else _rows(one)


def _outcome(remains: bool | None, proved: bool) -> Outcome:
    if remains is None:
        return Outcome("undecided", "the attractor that the run reaches is not known.", False)
    if remains:
        return Outcome("remains near", "the attractor that runs reach tends to the fold.", True)
    how = "" if proved else ", as the runs show"
    return Outcome("tipping point", f"no attractor remains near the fold{how}.", True)
