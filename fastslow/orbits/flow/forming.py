"""Orbits of models of very many regions: derivatives are compiled for the motions of their runs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np

from fastslow.errors import ModelError
from fastslow.model.model import Model
from fastslow.model.restriction import restricted, whole
from fastslow.results.stored.sign_names import name_of_signs, signs_of_name
from fastslow.results.trajectory.trajectory import Trajectory

R = TypeVar("R")

#: Largest number of times that motions are added.
MOST_ADDED = 20


class UnformedMotionsError(Exception):
    """A run has reached motions whose derivatives are not compiled.

    Parameters
    ----------
    names : tuple of str
        The motions of the run.
    """

    def __init__(self, names: tuple[str, ...]) -> None:
        super().__init__(", ".join(names))
        self.names = names


def motions_beside(model: Model, run: Trajectory) -> list[str]:
    """Motions of a run, and those that it meets if two events that follow each other are exchanged.

    Along a branch of orbits through many regions this happens again and again.
    """
    partition, passed = whole(model).partition, run.steps[:, 2].astype(int)
    passed = passed[np.append(True, passed[1:] != passed[:-1])]
    signs = [signs_of_name(run.modes[k], len(model.interfaces)) for k in passed.tolist()]
    ordered = np.array([one for one in signs if one is not None])
    exchanged = ordered[:-2] + ordered[2:] - ordered[1:-1]
    regions = exchanged[(np.abs(exchanged) == 1).all(axis=1)].tolist()
    assert partition.pieces is not None
    names = [name_of_signs(tuple(one)) for one in regions if partition.pieces.possible(one)]
    return [*dict.fromkeys([*run.modes, *names])]


def with_formed_motions(model: Model, names: Sequence[str], computed: Callable[[Model], R]) -> R:
    """Compute something with the motions that its runs need, of a model of very many regions.

    Parameters
    ----------
    model : Model
    names : sequence of str
        Motions to begin with.
    computed : callable
        Of the model restricted to some motions; it is called again with those that its runs
        have reached besides.

    Raises
    ------
    ModelError
        If its runs reach new motions again and again.
    """
    known = dict.fromkeys(names)
    for _ in range(MOST_ADDED):
        try:
            return computed(restricted(whole(model), [*known]))
        except UnformedMotionsError as error:
            known |= dict.fromkeys(error.names)
    raise ModelError(
        f"the runs near the orbit have reached {len(known)} motions, and new ones every time; give "
        "a guess nearer to an orbit"
    )
