"""Ends and rows of branches at which the computed rates are rounding errors."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from fastslow.diagrams.field import FrozenField
from fastslow.results.branch.branch import Branch

#: Distances at which rates are compared with their slopes, relative to the states: so small that
#: the curvature of rates does not count.
NEIGHBOURS = np.outer([-1.0, 0.7], 10.0 ** np.arange(-15.0, -5.0)).ravel()

#: Fraction of the size of a state below which its value does not limit these distances.
SMALL = 1e-3

#: Displacement of an equilibrium by rounding of its rates, relative to the largest state of all
#: branches, from which no branch through it can be traced.
UNTRACED = 1e-6

#: The same displacement from which a branch is said to be decided by rounding, if it is so at most
#: of its rows that are examined, and their number: near a fold, or where J is singular, rounding
#: moves any equilibrium far.
MOVED_BY_ROUNDING, EXAMINED_ROWS = 1e-9, 7


def rounded_ends(
    field: FrozenField, branches: Sequence[Branch], unit: NDArray[np.float64]
) -> Iterator[str]:
    """Yield a sentence if rounding of the rates ends branches, with an example.

    Parameters
    ----------
    field : FrozenField
    branches : sequence of Branch
    unit : ndarray, shape (n,)
        Unit of each state, its size if all equilibria are zero.
    """
    if not branches:
        return
    sizes = np.max([np.abs(branch.state).max(axis=0) for branch in branches], axis=0)
    sizes = np.where(sizes > 0, sizes, unit)
    ends = [
        (branch, row)
        for branch in branches
        for row, outcome in zip((0, -1), branch.outcomes, strict=True)
        if outcome.code == "step too small"
    ]
    displaced = _displaced(field, ends, [sizes] * len(ends), UNTRACED)
    found = [one for one in displaced if one is not None]
    if found:
        (name, value, moved), count = found[0], len(found)
        yield (
            f"{count} of these ends {'are' if count > 1 else 'is'} decided by rounding: at "
            f"{field.parameter} = {value:.6g} rounding of the rates moves {name} by {moved:.2g}; "
            "terms cancel that are far larger than the rates: rewrite them, or scale the model."
        )


def rounded_rows(
    field: FrozenField, branches: Sequence[Branch], unit: NDArray[np.float64]
) -> Iterator[str]:
    """Yield a sentence if rounding of the rates limits the accuracy of branches, with an example.

    Parameters are those of `rounded_ends`.
    """
    examined: list[tuple[Branch, int]] = []
    units: list[NDArray[np.float64]] = []
    for branch in branches:
        rows = {*np.linspace(0, len(branch) - 1, EXAMINED_ROWS).astype(int).tolist()}
        examined += [(branch, row) for row in sorted(rows)]
        largest = np.abs(branch.state).max(axis=0)
        units += [np.where(largest > 0, largest, unit)] * len(rows)
    moved = _displaced(field, examined, units, MOVED_BY_ROUNDING)
    decided: list[tuple[str, float, float]] = []
    count = place = 0
    for _, group in groupby(examined, key=lambda one: id(one[0])):
        length = len(list(group))
        own = [one for one in moved[place : place + length] if one is not None]
        place += length
        if 2 * len(own) > length:
            count += 1
            decided += own
    if decided:
        name, value, most = max(decided, key=lambda one: one[2])
        yield (
            f"Rounding of the rates decides {count} {'branches' if count > 1 else 'branch'}: at "
            f"{field.parameter} = {value:.6g} it moves {name} by {most:.2g}; terms cancel that are "
            "far larger than the rates: rewrite them, or scale the model."
        )


@np.errstate(all="ignore")
def _displaced(
    field: FrozenField,
    examined: Sequence[tuple[Branch, int]],
    sizes: Sequence[NDArray[np.float64]],
    least: float,
) -> list[tuple[str, float, float] | None]:
    """Return the state that rounding moves most at each row of a branch, with the parameter there.

    None where it is not far, or J is singular, or the motion is none of the field.
    """
    found: list[tuple[str, float, float] | None] = [None] * len(examined)
    number = {region: k for k, region in enumerate(field.regions)}
    known = [k for k, (branch, row) in enumerate(examined) if branch.region[row] in number]
    if not known:
        return found
    n, rows = field.n, [examined[k] for k in known]
    u = np.array([[*branch.state[row], branch.values[row]] for branch, row in rows])
    scale = np.array([sizes[k] for k in known])
    steps = np.zeros((len(rows), 1 + len(NEIGHBOURS), n + 1))
    reach = np.maximum(np.abs(u[:, :n]), SMALL * scale)
    steps[:, 1:, :n] = NEIGHBOURS[:, None] * reach[:, None]
    regions = np.repeat([number[branch.region[row]] for branch, row in rows], steps.shape[1])
    rates, slopes, _, _ = field.evaluate(regions, (u[:, None] + steps).reshape(-1, n + 1))
    rates = rates.reshape(len(rows), -1, n)
    slopes = slopes.reshape(*rates.shape, -1)[..., : n + 1]
    linear = (slopes @ steps[..., None])[..., 0]
    noise = np.abs(rates - rates[:, :1] - linear).max(axis=1)
    jacobians = slopes[:, 0, :, :n].copy()
    jacobians[np.linalg.det(jacobians) == 0] = np.nan
    moved = (np.abs(np.linalg.inv(jacobians)) @ noise[:, :, None])[..., 0]
    most = np.argmax(moved / scale, axis=1).tolist()
    for place, (branch, row), k, distances, size in zip(
        known, rows, most, moved, scale, strict=True
    ):
        if distances[k] > least * size[k]:
            found[place] = branch.states[k], float(branch.values[row]), float(distances[k])
    return found
