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
        for name, value, moved in _displaced(field, branch, [row], sizes, UNTRACED)
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
        rows = sorted({*np.linspace(0, len(branch) - 1, EXAMINED_ROWS).astype(int).tolist()})
        moved = _displaced(field, branch, rows, sizes, MOVED_BY_ROUNDING)
        if 2 * len(moved) > len(rows):
            count += 1
            found += moved
    if found:
        name, value, most = max(found, key=lambda one: one[2])
        yield (
            f"Rounding of the rates decides {count} {'branches' if count > 1 else 'branch'}: at "
            f"{field.parameter} = {value:.6g} it moves {name} by {most:.2g}; terms cancel that are "
            "far larger than the rates: rewrite them, or scale the model."
        )


@np.errstate(all="ignore")
def _displaced(
    field: FrozenField,
    branch: Branch,
    rows: Sequence[int],
    sizes: NDArray[np.float64],
    least: float,
) -> list[tuple[str, float, float]]:
    """Return the state that rounding moves most, with the parameter, at each row where it is far.

    Rows at which J is singular are left out.
    """
    found, n = [], field.n
    for region in dict.fromkeys(branch.region[k] for k in rows):
        if region not in field.regions:
            continue
        own = [k for k in rows if branch.region[k] == region]
        u = np.column_stack([branch.state[own], branch.values[own]])[:, None]
        steps = np.zeros((len(own), 1 + len(NEIGHBOURS), n + 1))
        steps[:, 1:, :n] = NEIGHBOURS[:, None] * np.maximum(np.abs(u[..., :n]), SMALL * sizes)
        place = field.regions.index(region)
        rates, slopes, _, _ = field.evaluate(place, (u + steps).reshape(-1, n + 1))
        rates = rates.reshape(len(own), -1, n)
        slopes = slopes.reshape(*rates.shape, -1)[..., : n + 1]
        linear = (slopes @ steps[..., None])[..., 0]
        noise = np.abs(rates - rates[:, :1] - linear).max(axis=1)
        jacobians = slopes[:, 0, :, :n].copy()
        jacobians[np.linalg.det(jacobians) == 0] = np.nan
        moved = (np.abs(np.linalg.inv(jacobians)) @ noise[:, :, None])[..., 0]
        most = np.argmax(moved / sizes, axis=1)
        for row, k, distances in zip(own, most.tolist(), moved, strict=True):
            if distances[k] > least * sizes[k]:
                found.append((branch.states[k], float(branch.values[row]), float(distances[k])))
    return found
