"""Fractions of initial states that attractors attract, along a branch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import ArgumentError, unknown_name
from fastslow.model.model import Model
from fastslow.results.base.outcome import Outcome
from fastslow.results.branch.diagram import Diagram
from fastslow.results.orbits.basin_fractions import BasinFractions
from fastslow.results.orbits.orbit import Orbit
from fastslow.results.orbits.orbit_branch import OrbitBranch
from fastslow.results.points import Equilibrium
from fastslow.simulation.settings import Execution, Integration, progress_bar
from fastslow.sweeps.attractor_arcs import AttractorArc, arc_of, range_of
from fastslow.sweeps.batch_stores import BatchStores
from fastslow.sweeps.survey import Survey, extent_of, in_words

Array = NDArray[np.float64]


def model_along(
    model: Model, along: Diagram | OrbitBranch, samples: int | Sequence[float]
) -> tuple[Model, Array]:
    """Return the model at the lowest value of the parameter of a branch, and all values.

    Raises
    ------
    UnknownNameError
        For a branch over no parameter of the model.
    ArgumentError
        For a branch of another model, and values outside its range.
    """
    name, (low, high) = along.parameter, range_of(along)
    if name not in (*model.parameters, *model.free):
        raise unknown_name("parameter", name, (*model.parameters, *model.free))
    at_end = model.with_parameters({name: low})
    others = {k: v for k, v in at_end.parameters.items() if k != name}
    if along.equations != model.equations or dict(along.parameters) != others:
        raise ArgumentError(
            f"along: a branch over {name} of another model, or at other values of its parameters; "
            "expected one of this model"
        )
    if isinstance(samples, int):
        return at_end, np.linspace(low, high, samples)
    chosen = np.unique(np.array(samples, dtype=float))
    outside = chosen[(chosen < low) | (chosen > high)]
    if len(outside) or not len(chosen):
        which = f"{name} = {outside[0]:.6g} is outside" if len(outside) else "none is given of"
        raise ArgumentError(f"samples: {which} the range of the branch, {low:.6g} to {high:.6g}")
    return at_end, chosen


@dataclass(eq=False)
class AlongBranch:
    """An ensemble of initial states at values of a parameter.

    Parameters
    ----------
    model : Model
    along : Diagram or OrbitBranch
    starts : ndarray, shape (m, n + n_switches)
        Initial states with those of switches.
    integration : Integration
    arcs : list of AttractorArc
        Attractors found so far.
    reasons : list of str
        Why initial states were not assigned, in a word.
    explained : dict of str to str
        In a sentence, for the first trajectory that ended early for such a reason.
    """

    model: Model
    along: Diagram | OrbitBranch
    starts: Array
    integration: Integration
    arcs: list[AttractorArc] = field(default_factory=list)
    reasons: list[str] = field(default_factory=list)
    explained: dict[str, str] = field(default_factory=dict)

    def fractions(
        self,
        values: Array,
        over: Mapping[str, tuple[float, float]],
        seed: int,
        execution: Execution,
    ) -> BasinFractions:
        """Assign all initial states at all values."""
        assigned = np.empty((len(values), len(self.starts)), dtype=np.int64)
        existing: list[list[int]] = []
        total = assigned.size
        with progress_bar(execution, "initial state", total) as bar, BatchStores(execution) as some:
            for k, value in enumerate(values.tolist()):
                survey, numbers = self._survey(value)
                survey.report, survey.batches = bar.update, some
                found = survey.assign(self.starts, solve=True)[0]
                numbers += self._continued(survey, value, len(numbers))
                assigned[k] = np.append(numbers, -1)[found].astype(np.int64)
                existing.append(numbers)
                self.reasons += survey.reasons
                self.explained = survey.explained | self.explained
        names = (*self.model.states, *self.model.slow_states)
        parameters = {k: v for k, v in self.model.parameters.items() if k != self.along.parameter}
        exists = np.zeros((len(values), len(self.arcs)), dtype=bool)
        for k, numbers in enumerate(existing):
            exists[k, numbers] = True
        return BasinFractions(
            parameter=self.along.parameter,
            values=values,
            members=tuple(arc.first for arc in self.arcs),
            branches=tuple(arc.branch for arc in self.arcs),
            states=names,
            over=over,
            starts=self.starts[:, : len(names)],
            assigned=assigned,
            exists=exists,
            seed=seed,
            parameters=parameters,
            outcome=self._outcome(assigned),
        )

    def _survey(self, value: float) -> tuple[Survey, list[int]]:
        """The attractors that are known at a value, with their numbers."""
        model = self.model.with_parameters({self.along.parameter: value})
        known: list[Orbit | Equilibrium] = []
        numbers = []
        for number, arc in enumerate(self.arcs):
            one = arc.at(value)
            if one is not None:
                known.append(one)
                numbers.append(number)
        n = len((*model.states, *model.slow_states))
        survey = Survey(model, self.integration, extent_of(self.starts[:, :n]), known=known)
        return survey, numbers

    def _continued(self, survey: Survey, value: float, before: int) -> list[int]:
        """Continue the attractors that were not known before; return their numbers."""
        numbers = []
        for one in survey.known[before:]:
            self.arcs.append(arc_of(one, survey.model, self.along, value, survey.same))
            numbers.append(len(self.arcs) - 1)
        return numbers

    def _outcome(self, assigned: NDArray[np.int64]) -> Outcome:
        left, alone = int((assigned < 0).sum()), [a for a in self.arcs if a.branch is None]
        name = self.along.parameter
        if not left and not alone:
            words = "every initial state reached an attractor, and each attractor was continued."
            return Outcome("settled", words, True)
        parts = []
        if left:
            parts.append(
                f"{left} of {assigned.size} trajectories reached no periodic orbit or equilibrium: "
                "chaotic or quasi-periodic motion, a slow transient, or a trajectory that ended "
                f"early{in_words(self.reasons, self.explained)}"
            )
        if alone:
            at = ", ".join(f"{arc.value:.6g}" for arc in alone)
            parts.append(
                f"{len(alone)} attractors, found at {name} = {at}, could not be continued and are "
                "known there alone"
            )
        return Outcome("not settled", "; ".join(parts) + ".", False)
