"""Basins of attraction in a plane of two initial states, as adaptive maps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import StateLike, instance, mapping, validated
from fastslow.errors import ArgumentError, unknown_name
from fastslow.model.events import refuse_memory
from fastslow.model.model import Model
from fastslow.results.maps.adaptive_map import RefinedMap
from fastslow.results.orbits.attractors import NO_ATTRACTOR, Attractors
from fastslow.simulation.arguments import initial_state, initial_switches, require_values
from fastslow.simulation.settings import (
    EXECUTION,
    Execution,
    Integration,
    integration_settings,
    map_settings,
)
from fastslow.sweeps.attraction import COARSE, attractors
from fastslow.sweeps.refinement import refined_map
from fastslow.sweeps.settings import REFINEMENT, Refinement, refinement_settings
from fastslow.sweeps.survey import Survey, extent_of

Array = NDArray[np.float64]

#: Number of initial states whose runs give the time scale where no attractor is known.
SCALED_BY = 4


@validated(
    model=instance(Model),
    over=mapping,
    known=instance(Attractors),
    refinement=refinement_settings,
    integration=integration_settings,
    execution=map_settings,
)
def basins(
    model: Model,
    over: Mapping[Any, tuple[float, float]],
    *,
    known: Attractors | None = None,
    state: StateLike | None = None,
    refinement: Refinement = REFINEMENT,
    integration: Integration = COARSE,
    execution: Execution = EXECUTION,
) -> RefinedMap:
    """Compute the basins of attraction in a plane of two initial states, refined at boundaries.

    Parameters
    ----------
    model : Model
        With all parameter values.
    over : mapping
        Two states, each with the range (low, high) of its initial values.
    known : Attractors, optional
        The attractors, from `attractors`; by default those that 200 random initial states of the
        plane reach.
    state : sequence or mapping, optional
        Initial values of all states, of which the two of ``over`` are replaced; needed with more
        than two states. By name it may contain switches, needed where no relation decides.
    refinement : Refinement
        Cells of the first level, their refinement, and the resolution of boundaries.
    integration : Integration
        Settings of the trajectories.
    execution : Execution
        As in `refined_map`, with threads of each task.

    Returns
    -------
    RefinedMap
        With the labels ``"A1"`` and so on of the attractors, the code of the outcome of a
        trajectory that ended early, such as ``"not decided"``, and ``"none"`` where another one
        reaches no attractor.

    Raises
    ------
    ArgumentError
        For other than two ranges, or a model with more states without ``state``.
    UnknownNameError
        For a name that is not a state.

    See Also
    --------
    fastslow.attractors, fastslow.edge_state, fastslow.plot.basins

    Examples
    --------
    >>> import sympy as sp, fastslow as fs
    >>> x, v = sp.symbols("x v")
    >>> wells = fs.Model({x: v, v: x - x**3 - v / 2})
    >>> box = {x: (-2, 2), v: (-1, 1.1)}
    >>> found = fs.attractors(wells, box, 20)
    >>> plane = fs.basins(wells, box, known=found, refinement=fs.Refinement(cells=(6, 6), levels=1))
    >>> sorted(plane.labels), plane.at(x=1, v=0) == plane.at(x=-1, v=0)
    (['A1', 'A2'], False)
    """
    require_values(model)
    refuse_memory(model.structure.events, model.assigned, "basins")
    names = (*model.states, *model.slow_states)
    if known is not None and known.states != names:
        raise ArgumentError(
            f"known: attractors of {', '.join(known.states)}; the model has the states "
            f"{', '.join(names)}"
        )
    chosen = [str(key) for key in over]
    for name in chosen:
        if name not in names:
            raise unknown_name("state", name, names)
    if state is None and len(names) > len(chosen):
        raise ArgumentError(
            f"over = {', '.join(chosen)}; the model has the states {', '.join(names)}: give the "
            "values of the others as state="
        )
    base = np.zeros(len(names)) if state is None else initial_state(model, state)
    switches = initial_switches(model, {} if state is None else state)
    if known is None:
        given = {str(key): value for key, value in over.items()}
        fixed = {name: (value, value) for name, value in zip(names, base.tolist(), strict=True)}
        known = attractors(
            model,
            fixed | given,
            integration=integration,
            execution=replace(execution, store=None, progress=False),
        )
    extent = np.maximum(extent_of(known.starts), extent_of(known.ends))
    axes = tuple(names.index(name) for name in chosen)
    start = np.append(base, switches)
    outcome = _Assignment(model, integration, extent, known, start, axes)
    if not known.members:
        some = (np.append(one, switches) for one in known.starts[:SCALED_BY])
        outcome = replace(outcome, scale=Survey(model, integration, extent).scale_from(some))
    return refined_map(outcome, over, refinement=refinement, execution=execution)


@dataclass(frozen=True)
class _Assignment:
    """The attractor reached from points of a plane, a function for other processes too.

    Parameters
    ----------
    model : Model
    integration : Integration
    extent : ndarray, shape (n,)
    known : Attractors
    base : ndarray, shape (n + n_switches,)
        Initial values of all states, and of switches, NaN where a relation decides.
    axes : tuple of int
        The two states of the plane.
    scale : float
        Time scale where no attractor is known, see `Survey`.
    """

    model: Model
    integration: Integration
    extent: Array
    known: Attractors
    base: Array
    axes: tuple[int, ...]
    scale: float = 0.0

    def __call__(self, *columns: Array) -> NDArray[Any]:
        starts = np.tile(self.base, (len(columns[0]), 1))
        starts[:, self.axes] = np.column_stack(columns)
        members = list(self.known.members)
        survey = Survey(self.model, self.integration, self.extent, known=members, scale=self.scale)
        assigned, _, early = survey.assign(starts)
        labels = np.array([*self.known.labels, NO_ATTRACTOR], dtype=object)[assigned]
        return np.where(early == "", labels, early).astype(str)
