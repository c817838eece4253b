"""Regimes of a gap over two parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastslow.arguments import (
    either,
    flag,
    function,
    instance,
    mapping,
    positive,
    takes,
    text,
)
from fastslow.errors import ArgumentError, unknown_name
from fastslow.model.model import Model
from fastslow.results.formulas import evaluated, names_in
from fastslow.results.refined_maps import RefinedMap
from fastslow.results.slow_loads import NO_GAP
from fastslow.simulation.arguments import initial_state
from fastslow.simulation.ensembles import simulate_many
from fastslow.simulation.settings import DEFAULT, Integration, integration_settings
from fastslow.sweeps.refinement import refined_map

Floats = NDArray[np.float64]
Parameters = Mapping[Any, Any] | Callable[[Floats, Floats], Mapping[Any, Any]]


@takes(
    model=instance(Model),
    over=mapping,
    parameters=either(function, mapping),
    integration=integration_settings,
    tol=positive,
    gap=text,
    period=positive,
    periods=positive,
    progress=flag,
)
def regime_map(
    model: Model,
    over: Mapping[Any, tuple[float, float]],
    state: Sequence[float] | Mapping[Any, float] | Floats,
    *,
    parameters: Parameters | None = None,
    cells: tuple[int, int] = (8, 8),
    levels: int = 5,
    guard: int = 1,
    tol: float | None = None,
    periods: float = 3,
    period: float | None = None,
    gap: str | None = None,
    integration: Integration = DEFAULT,
    threads: int | None = None,
    progress: bool = False,
) -> RefinedMap:
    """How the sides of a gap are touched, over two parameters, with refined boundaries.

    The label of each point is the `Trajectory.regime` of a run from the same
    initial state: what its last period shows. ``"no gap"`` is where there is no
    gap, and ``"failed"`` where the run could not go on.

    Parameters
    ----------
    model : Model
        With a gap and a period.
    over : mapping
        Two names, each with its range: parameters of the model, or names that
        ``parameters`` turns into them.
    state : sequence of float, shape (n,), or mapping
        Initial states of every run.
    parameters : mapping or callable, optional
        What the axes mean: parameter to an expression in the names of the axes
        and the other parameters, ``{"C": "B*ratio"}``; or a function of two
        arrays that returns the values of parameters.
    cells, levels, guard, tol
        As in `refined_map`; all new points of a level are simulated together.
    periods : float
        Length of every run in periods of the forcing.
    period, gap, integration, threads
        As in `simulate_many`.
    progress : bool
        Whether to show a progress bar.

    Returns
    -------
    RefinedMap

    Raises
    ------
    UnknownNameError
        For a name that is no parameter and is turned into none.
    ArgumentError
        For a model without a gap or period at any point, or what `refined_map`
        and `simulate_many` refuse.

    Examples
    --------
    >>> import fastslow as fs
    >>> gear = fs.systems.harmonic_gear(omega=0.1)
    >>> over = {"D": (0.02, 0.3), "ratio": (0.95, 1.1)}
    >>> found = regime_map(
    ...     gear, over, [0, 0], parameters={"C": "B*ratio"}, cells=(4, 4), levels=2, periods=2
    ... )
    >>> found.labels
    ('bilateral', 'meshed upper', 'unilateral upper')
    >>> found.at(D=0.05, ratio=1.05), found.at(D=0.29, ratio=1.05), found.at(D=0.1, ratio=0.96)
    ('bilateral', 'unilateral upper', 'meshed upper')
    """
    begin = initial_state(model, state)
    values_at = _values(model, [str(name) for name in over], parameters)

    def labels(first: Floats, second: Floats) -> list[Any]:
        many = simulate_many(
            model,
            begin,
            parameters=values_at(first, second),
            periods=periods,
            period=period,
            gap=gap,
            integration=integration,
            threads=threads,
        )
        words = [str(word) or NO_GAP for word in many.regime]
        if many.success.all():
            return words
        return [
            word if outcome else outcome for word, outcome in zip(words, many.outcomes, strict=True)
        ]

    found = refined_map(
        labels, over, cells=cells, levels=levels, guard=guard, tol=tol, progress=progress
    )
    if found.labels == (NO_GAP,):
        raise ArgumentError(
            "this model has no gap anywhere in the map: no three regions between two parallel "
            "interfaces; name the region inside as gap="
        )
    return found


def _values(
    model: Model, axes: list[str], parameters: Parameters | None
) -> Callable[[Floats, Floats], dict[str, Any]]:
    """A function from values along the axes to values of the model's parameters."""
    if callable(parameters):

        def given(*arrays: Floats) -> dict[str, Any]:
            returned = mapping("what parameters returns", parameters(*arrays))
            return {str(name): values for name, values in returned.items()}

        return given
    laws = {str(name): str(law) for name, law in (parameters or {}).items()}
    for name in laws:
        if name not in model.parameters:
            raise unknown_name("parameter", name, model.parameters)
    valid = dict.fromkeys([*model.parameters, *axes])
    used = {name for law in laws.values() for name in names_in(law, valid)}
    for name in axes:
        if name not in model.parameters and name not in used:
            raise unknown_name("parameter", name, model.parameters)

    def values_at(*arrays: Floats) -> dict[str, Any]:
        own = dict(zip(axes, arrays, strict=True))
        known: dict[str, ArrayLike] = {**dict(model.parameters), **own}
        direct = {name: values for name, values in own.items() if name in model.parameters}
        turned = {
            name: np.broadcast_to(evaluated(law, known), arrays[0].shape)
            for name, law in laws.items()
        }
        return {**direct, **turned}

    return values_at
