"""Equilibria that a diagram has twice: on two branches, or on two passes of one branch."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from fastslow.results.branch.branch import Branch

Array = NDArray[np.float64]

#: Values of the parameter, as fractions of the rows of every branch, and their largest number.
FRACTIONS, VALUES = (0.1, 0.3, 0.45, 0.65, 0.85), 60

#: Number of values at which two passes agree before they are named.
AGREEING_ROWS = 3

#: Distance of interpolated states, in units of the diagram, below which both are solved for.
SOLVED_DISTANCE = 1e-2

#: Largest relative difference of the slopes of two passes along one curve, and the slope below
#: which they are not compared. Beside a fold, where Newton's method may change from one pass to
#: the other, their slopes have different signs.
SLOPES, SLOPE_DIFFERENCE = 0.5, 0.1

#: Distance of solved states that are one: ten times the error of either.
EQUAL_STATES = 1e-9


def repetitions(branches: Sequence[Branch], scale: Array) -> Iterator[str]:
    """Yield a sentence for every two passes over the same equilibria.

    At values of the parameter from all branches, the equilibria of one region that are near each
    other are solved for and compared.

    Parameters
    ----------
    branches : sequence of Branch
        With their corrector.
    scale : ndarray, shape (n,)
        Units of the states.
    """
    places = [
        float(branch.values[int(part * (len(branch) - 1))])
        for branch in branches
        for part in FRACTIONS
    ]
    agreeing: Counter[tuple[int, int]] = Counter()
    span = float(np.ptp(places)) or 1.0 if places else 1.0
    for value in np.unique(places)[:: 1 + len(places) // VALUES].tolist():
        passes = [one for k, branch in enumerate(branches) for one in _passes(branch, k, value)]
        for one, other, units in _near(passes, scale):
            (k, row, _), (j, there, _) = passes[one], passes[other]
            if k == j and there - row < AGREEING_ROWS:
                continue
            tangents = branches[k].tangent[row], branches[j].tangent[there]
            if _same_slopes(*tangents, np.append(units, span)):
                agreeing[k, j] += _one(branches, passes[one], passes[other], value, units)
    for (k, j), count in agreeing.items():
        if count < AGREEING_ROWS:
            continue
        if k == j:
            yield f"branch {k} passes the same equilibria twice."
        else:
            same = f"branches {k} and {j} have the same equilibria"
            yield f"{same}, to within {EQUAL_STATES:g} of the units."


def _near(
    passes: Sequence[tuple[int, int, Array]], scale: Array
) -> Iterator[tuple[int, int, Array]]:
    """Yield the numbers of two passes with states near each other, and the units there."""
    states = np.array([state for _, _, state in passes])
    for one, state in enumerate(states):
        units = np.maximum(scale, np.abs(state))
        away = np.abs((states[one + 1 :] - state) / units).max(axis=1)
        for other in np.flatnonzero(away < SOLVED_DISTANCE).tolist():
            yield one, one + 1 + other, units


def _passes(branch: Branch, number: int, value: float) -> Iterator[tuple[int, int, Array]]:
    """Yield number of the branch, row and interpolated state at every pass of a value."""
    away = branch.values - value
    for row in np.flatnonzero((away[:-1] < 0) != (away[1:] < 0)).tolist():
        part = away[row] / (away[row] - away[row + 1])
        yield number, row, branch.state[row] + part * (branch.state[row + 1] - branch.state[row])


def _same_slopes(one: Array, other: Array, units: Array) -> bool:
    """Compare the slopes of two passes, derivatives of the states, by their tangents."""
    if one[-1] == 0.0 or other[-1] == 0.0:
        return False
    first, second = (tangent / units for tangent in (one, other))
    first, second = first[:-1] / first[-1], second[:-1] / second[-1]
    largest = max(float(np.linalg.norm(first)), float(np.linalg.norm(second)), SLOPE_DIFFERENCE)
    return bool(np.linalg.norm(first - second) <= SLOPES * largest)


def _one(
    branches: Sequence[Branch],
    one: tuple[int, int, Array],
    other: tuple[int, int, Array],
    value: float,
    units: Array,
) -> bool:
    """Check whether two passes are the same solution of the same region."""
    (k, row, state), (j, there, near) = one, other
    branch, beside = branches[k], branches[j]
    region = str(branch.region[row])
    if region != str(beside.region[there]) or branch.admissible != beside.admissible:
        return False
    if branch.corrector is None:
        return False
    solved, again = (branch.corrector(region, start, value) for start in (state, near))
    if solved is None or again is None:
        return False
    return bool(np.abs((solved.state - again.state) / units).max() < EQUAL_STATES)
