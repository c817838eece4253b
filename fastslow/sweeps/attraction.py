"""Coexisting attractors from an ensemble of initial states."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, overload

import numpy as np

from fastslow.arguments import (
    either,
    finite,
    instance,
    interval,
    items,
    mapping,
    real_number,
    validated,
    whole,
)
from fastslow.errors import ArgumentError, unknown_name
from fastslow.model.events import refuse_memory
from fastslow.model.model import Model
from fastslow.results.branch.diagram import Diagram
from fastslow.results.orbits.attractors import Attractors
from fastslow.results.orbits.basin_fractions import BasinFractions
from fastslow.results.orbits.orbit_branch import OrbitBranch
from fastslow.simulation.arguments import require_values
from fastslow.simulation.settings import (
    EXECUTION,
    Execution,
    Integration,
    integration_settings,
    map_settings,
    progress_bar,
)
from fastslow.sweeps.attraction_along import AlongBranch, model_along
from fastslow.sweeps.batch_stores import BatchStores
from fastslow.sweeps.survey import Survey, extent_of

#: Trajectories are integrated to this tolerance unless another one is given.
COARSE = Integration(rtol=1e-9)

#: Values of a parameter along a branch, by default.
VALUES_ALONG = 11


@overload
def attractors(
    model: Model,
    over: Mapping[Any, tuple[float, float]],
    n: int = 200,
    seed: int = 0,
    *,
    integration: Integration = COARSE,
    execution: Execution = EXECUTION,
    along: None = None,
    samples: int | Sequence[float] = VALUES_ALONG,
) -> Attractors: ...


@overload
def attractors(
    model: Model,
    over: Mapping[Any, tuple[float, float]],
    n: int = 200,
    seed: int = 0,
    *,
    integration: Integration = COARSE,
    execution: Execution = EXECUTION,
    along: Diagram | OrbitBranch,
    samples: int | Sequence[float] = VALUES_ALONG,
) -> BasinFractions: ...


@validated(
    model=instance(Model),
    over=mapping,
    n=whole(1, 10_000_000),
    seed=whole(0, 2**63),
    integration=integration_settings,
    execution=map_settings,
    along=instance(Diagram, OrbitBranch),
    samples=either(whole(1, 100_000), items(finite)),
)
def attractors(
    model: Model,
    over: Mapping[Any, tuple[float, float]],
    n: int = 200,
    seed: int = 0,
    *,
    integration: Integration = COARSE,
    execution: Execution = EXECUTION,
    along: Diagram | OrbitBranch | None = None,
    samples: int | Sequence[float] = VALUES_ALONG,
) -> Attractors | BasinFractions:
    """Compute the attractors that random initial states reach, and the fraction of each.

    Transients decay in an ensemble of trajectories; their repetition after up to 16 periods of
    the forcing is detected, and each candidate is confirmed by `find_orbit`. Trajectories
    are assigned to the attractor that they come within 0.1 % of its range to, so that an
    attractor with a thin basin is missed with probability (1 − p)ⁿ, where p is the fraction of
    the basin.

    Parameters
    ----------
    model : Model
        With all parameter values; forced or autonomous. Switches are 0 or 1 at random where no
        relation decides.
    over : mapping
        Every state and slow state to the range (low, high) of its initial values, uniform; equal
        bounds fix a state.
    n : int
        Number of initial states.
    seed : int
        Of the random numbers.
    integration : Integration
        Settings of the trajectories.
    execution : Execution
        Executor and number of trajectories of its tasks, or threads of this process. A store has
        a group for each length of the trajectories, and the same call resumes inside it. Progress
        bar.
    along : Diagram or OrbitBranch, optional
        Of the model over one parameter: the fractions are computed at values of it, from the same
        initial states. Attractors at two values are one if they are on one stable part of a
        branch of the diagram, or of the branch continued from them.
    samples : int or sequence of float
        Number of values over the range of ``along``, evenly spaced, or the values.

    Returns
    -------
    Attractors or BasinFractions
        The latter with ``along``.

    Raises
    ------
    ArgumentError
        For a state without a range, or a range that is reversed or not finite; for a branch of
        another model, and values outside its range.
    UnknownNameError
        For a name that is not a state.

    See Also
    --------
    fastslow.basins, fastslow.find_orbit, fastslow.plot.basins

    Examples
    --------
    >>> import sympy as sp, fastslow as fs
    >>> x, y = sp.symbols("x y")
    >>> oscillator = fs.Model({x: y, y: (1 - x**2) * y - x})
    >>> found = fs.attractors(oscillator, {x: (-1, 1), y: (-1, 1)}, 20)
    >>> found
    Attractors: 1 from 20 initial states
      A1 orbit of period 6.66329, 0 crossings: 100.0% ± 0.0%
    """
    if along is not None:
        model, chosen = model_along(model, along, samples)
    require_values(model)
    ranges = _box(model, over)
    low, high = np.array(list(ranges.values())).T
    random = np.random.default_rng(seed)
    refuse_memory(model.structure.events, model.assigned, "attractors")
    starts = low + (high - low) * random.random((n, len(ranges)))
    switches = random.integers(0, 2, (n, len(model.switches))).astype(float)
    rows = np.hstack([starts, switches])
    if along is not None:
        ensemble = AlongBranch(model, along, rows, integration)
        return ensemble.fractions(chosen, ranges, seed, execution)
    with progress_bar(execution, "initial state", n) as bar, BatchStores(execution) as batches:
        survey = Survey(model, integration, extent_of(starts), bar.update, batches=batches)
        assigned, ends, early = survey.assign(rows, solve=True)
        ends = ends[:, : starts.shape[1]]
    counts = np.bincount(assigned[assigned >= 0], minlength=len(survey.known))
    order = np.argsort(-counts, kind="stable")
    place = np.append(np.argsort(order), -1)
    return Attractors(
        members=tuple(survey.known[k] for k in order),
        states=(*model.states, *model.slow_states),
        over=ranges,
        starts=starts,
        ends=ends,
        assigned=place[assigned],
        seed=seed,
        outcome=survey.outcome(assigned),
        early=early,
    )


def _box(model: Model, over: Mapping[Any, tuple[float, float]]) -> dict[str, tuple[float, float]]:
    """Validate the ranges of initial states, in the order of the states."""
    names = (*model.states, *model.slow_states)
    given = {str(key): value for key, value in over.items()}
    for name in given:
        if name not in names:
            raise unknown_name("state", name, names)
    missing = [name for name in names if name not in given]
    if missing:
        raise ArgumentError(
            f"over: no range of the initial values of {', '.join(missing)}; expected one for every "
            "state, for instance (0, 0) for a fixed value"
        )
    return {name: _range(name, given[name]) for name in names}


def _range(name: str, value: Any) -> tuple[float, float]:
    if isinstance(value, tuple | list):
        ends = [real_number(end) for end in value]
        if len(ends) == 2 and ends[0] is not None and ends[0] == ends[1]:
            return finite(f"over[{name}]", ends[0]), ends[0]
    return interval(f"over[{name}]", value)
