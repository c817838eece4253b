"""Models of very many regions, restricted to some of these for what considers all regions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from fastslow.errors import ArgumentError, unknown_name
from fastslow.formulas.grammar import normalised
from fastslow.model.model import Model
from fastslow.model.structure import interned
from fastslow.results.stored.sign_names import signs_at_rest


def restricted(model: Model, regions: Sequence[object]) -> Model:
    """Return a model with some of its regions, and with sliding motions by their names.

    Runs of it are those of the whole model; their first modes are the motions given here, regions
    before sliding.

    Parameters
    ----------
    model : Model
        With more regions than are formed at once.
    regions : sequence of str
        Names by signs, such as those of a run, ``run.modes``.

    Raises
    ------
    UnknownNameError
        For a name that is none.
    ArgumentError
        For no names, and for a model whose regions are all formed.

    Examples
    --------
    >>> import sympy as sp
    >>> x = sp.symbols("x:11")
    >>> model = Model({one: -1 - 2 * sp.sign(one) for one in x})
    >>> list(restricted(model, ["+" * 11, "-" * 11]).regions)
    ['+++++++++++', '-----------']
    """
    partition, count = model.partition, len(model.interfaces)
    walls = [reset.wall for reset in model.structure.walls]
    if partition.pieces is None:
        raise ArgumentError(
            f"regions: the {len(model.regions)} regions of the model are all considered; expected "
            "None"
        )
    if not regions:
        raise ArgumentError("regions: expected at least one region, received none")
    formed = []
    for given in regions:
        signs = signs_at_rest(normalised(str(given)), count, walls)
        if signs is None or not partition.pieces.possible(signs[:count]):
            raise unknown_name("region", given, ["+" * count, "-" * count])
        formed.append(signs)
    # rest is in a region, or along a sliding motion, and sliding along one interface between two
    formed += [one[:count] for one in formed if len(one) > count]
    for signs in [one for one in formed if one.count(0) == 1 and len(one) == count]:
        j = signs.index(0)
        formed += [(*signs[:j], side, *signs[j + 1 :]) for side in (1, -1)]
    ordered = sorted(dict.fromkeys(formed), key=lambda signs: (len(signs) > count, 0 in signs))
    structure = interned(replace(model.structure, formed=tuple(ordered)))
    return Model._from(structure, model.parameters)


def whole(model: Model) -> Model:
    """Return a model with all its regions."""
    if not model.structure.formed:
        return model
    return Model._from(interned(replace(model.structure, formed=())), model.parameters)
