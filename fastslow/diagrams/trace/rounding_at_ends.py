"""Ends and rows of branches at which the computed rates are rounding errors."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

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
    found = [
        (name, value, moved)
        for branch in branches
        for row, outcome in zip((0, -1), branch.outcomes, strict=True)
        if outcome.code == "step too small"
        for name, value, moved in _displaced(field, branch, row, sizes, UNTRACED)
    ]
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
    found: list[tuple[str, float, float]] = []
    count = 0
    for branch in branches:
        largest = np.abs(branch.state).max(axis=0)
        sizes = np.where(largest > 0, largest, unit)
        rows = {*np.linspace(0, len(branch) - 1, EXAMINED_ROWS).astype(int).tolist()}
        moved = [_displaced(field, branch, row, sizes, MOVED_BY_ROUNDING) for row in sorted(rows)]
        if 2 * sum(map(bool, moved)) > len(moved):
            count += 1
            found += [one for some in moved for one in some]
    if found:
        name, value, most = max(found, key=lambda one: one[2])
        yield (
            f"Rounding of the rates decides {count} {'branches' if count > 1 else 'branch'}: at "
            f"{field.parameter} = {value:.6g} it moves {name} by {most:.2g}; terms cancel that are "
            "far larger than the rates: rewrite them, or scale the model."
        )


@np.errstate(all="ignore")
def _displaced(
    field: FrozenField, branch: Branch, row: int, sizes: NDArray[np.float64], least: float
) -> list[tuple[str, float, float]]:
    """Return the state that rounding moves most at a row, if far, with the parameter there."""
    if branch.region[row] not in field.regions:
        return []
    region, n = field.regions.index(branch.region[row]), field.n
    u = np.append(branch.state[row], branch.values[row])
    steps = np.zeros((len(NEIGHBOURS), n + 1))
    steps[:, :n] = NEIGHBOURS[:, None] * np.maximum(np.abs(u[:n]), SMALL * sizes)
    rates, slopes, _, _ = field.evaluate(region, u + steps)
    middle, _, _, _ = field.evaluate(region, u)
    noise = np.abs(rates - middle - (slopes @ steps[:, :, None])[:, :, 0]).max(axis=0)
    try:
        moved = np.abs(np.linalg.inv(slopes[0, :, :n])) @ noise
    except np.linalg.LinAlgError:
        return []
    relative = moved / sizes
    k = int(np.argmax(relative))
    far = relative[k] > least
    return [(branch.states[k], float(u[-1]), float(moved[k]))] if far else []
