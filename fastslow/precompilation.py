"""Compiling ahead of use."""

from __future__ import annotations

from pathlib import Path

import sympy as sp

from fastslow.arguments import instance, validated
from fastslow.continuation.settings import Continuation
from fastslow.diagrams.trace.tracing import continue_equilibria
from fastslow.errors import FileError
from fastslow.kernels.compiler.store import writable_directory
from fastslow.model.model import Model
from fastslow.simulation.many import simulate_many
from fastslow.simulation.one import simulate
from fastslow.simulation.settings import Integration


@validated(models=instance(Model))
def precompile(*models: Model) -> Path:
    """Compile what simulation and continuation need, and keep it on disk.

    For a cluster, a container image or a class: run it once where the
    directory can be written; all later processes of the same processor and
    versions start fast, also where the directory is read-only. Other users load what
    root has compiled, and nobody loads what anybody else has.

    Parameters
    ----------
    *models : Model
        Whose equations to compile; the parts common to all models are compiled
        in any case. Parameter values play no part.

    Returns
    -------
    Path
        The directory: that of the environment variable ``FASTSLOW_CACHE``, or the user's own.

    Raises
    ------
    FileError
        If there is no directory that can be written.

    See Also
    --------
    fastslow.simulate

    Examples
    --------
    >>> precompile().is_dir()
    True
    """
    directory = writable_directory()
    if directory is None:
        raise FileError(
            "there is no directory for compiled code that can be written; "
            "name one by the environment variable FASTSLOW_CACHE"
        )
    x, v, w = sp.symbols("x v w")
    # planar, with an interface, a fold and no polynomial: every common loop has its turn
    common = Model({x: v, v: w - v - sp.sin(x) - sp.Abs(x)}, forcing={w: sp.sin(sp.Symbol("t"))})
    simulate(
        Model({x: -sp.gamma(2 + x)}), [0.0], t=(0.0, 1e-6), integration=Integration(max_steps=1)
    )
    for model in (common, *models):
        _use(model)
    return directory


def _use(model: Model) -> None:
    free = [name for name in model.free if name not in model.parameters]
    whole = model.with_parameters(dict.fromkeys(free, 0.0)) if free else model
    state = dict.fromkeys((*model.states, *model.slow_states, *model.switches), 0.0)
    simulate(whole, state, t=(0.0, 1e-6), integration=Integration(max_steps=1))
    simulate_many(whole, state, t=(0.0, 1e-6), integration=Integration(max_steps=1))
    timed = any("t" in {s.name for s in rate.free_symbols} for rate in model.rates.values())
    if timed or model.switches:
        return
    fast = model.frozen()
    names = [*fast.free, *fast.parameters]
    if not names:
        return
    slow = {name: 0.0 for name in fast.free[1:] if name not in fast.parameters}
    value = fast.parameters.get(names[0]) or 0.0
    few = Continuation(max_branches=2)
    continue_equilibria(
        fast.with_parameters(slow), names[0], (value - 1.0, value + 1.0), continuation=few
    )
