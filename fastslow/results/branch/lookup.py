"""Lookup of equilibria by parameter value: a binary search on ranges of monotone parameter.

The ranges are computed once for a branch; each lookup then costs a comparison per
range and a binary search in those that contain the value.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import finite
from fastslow.errors import ArgumentError, unknown_name
from fastslow.results.angles import periods_of, principal
from fastslow.results.base.immutable import Immutable
from fastslow.results.branch.interpolation import hermite
from fastslow.results.points import Corrector, Equilibrium

if TYPE_CHECKING:
    from fastslow.results.branch.branch import Branch

Array = NDArray[np.float64]


#: Relative distance below which a row is at a value of the parameter.
AT = 1e-12

#: Relative change of a state between rows at one value from which they are a continuum.
MOVED = 1e-9


@dataclass(frozen=True, eq=False, repr=False)
class MonotoneRuns(Immutable):
    """Ranges of rows with monotone parameter; each begins at the last row of the previous one.

    Parameters
    ----------
    first, last : ndarray of int, shape (K,)
        Rows.
    low, high : ndarray, shape (K,)
        Smallest and largest parameter value.
    signed : ndarray, shape (2, N)
        The parameter and its negative, one of which increases along each range.
    """

    first: NDArray[np.intp]
    last: NDArray[np.intp]
    low: Array
    high: Array
    signed: Array

    def around(self, value: float, near: float) -> tuple[list[tuple[int, int]], list[int]]:
        """Return ranges of rows at a value, and rows before a crossing of the value."""
        level: list[tuple[int, int]] = []
        passed: list[int] = []
        for k in np.flatnonzero((self.low <= value + near) & (self.high >= value - near)):
            first, last = int(self.first[k]), int(self.last[k])
            falling = int(self.signed[0, last] < self.signed[0, first])
            rising = self.signed[falling, first : last + 1]
            target = -value if falling else value
            begin = int(np.searchsorted(rising, target - near, side="left"))
            end = int(np.searchsorted(rising, target + near, side="right"))
            if end > begin:
                begin, end = first + begin, first + end - 1
                if level and begin <= level[-1][1] + 1:
                    level[-1] = (level[-1][0], end)
                else:
                    level.append((begin, end))
            elif 0 < begin < len(rising):
                passed.append(first + begin - 1)
        return level, passed


def monotone_runs(parameter: Array) -> MonotoneRuns:
    """Split a branch at the extrema of its parameter.

    Examples
    --------
    >>> runs = monotone_runs(np.array([0.0, 1.0, 1.0, 2.0, 1.0, 0.0]))
    >>> runs.first.tolist(), runs.last.tolist()
    ([0, 3], [3, 5])
    >>> runs.around(0.5, 0.0)
    ([], [0, 4])
    """
    way = np.sign(np.diff(parameter))
    moving = np.flatnonzero(way)
    if len(moving):
        # a constant step continues in the direction of the step before it
        source = np.zeros(len(way), dtype=np.intp)
        source[moving] = moving
        source = np.maximum.accumulate(source)
        source[: moving[0]] = moving[0]
        way = way[source]
    turns = np.flatnonzero(way[1:] != way[:-1]) + 1
    first = np.append(0, turns)
    last = np.append(turns, len(parameter) - 1)
    ends = parameter[first], parameter[last]
    return MonotoneRuns(
        first, last, np.minimum(*ends), np.maximum(*ends), np.stack([parameter, -parameter])
    )


def passages(
    branch: Branch, where: float, constants: Mapping[str, float], corrector: Corrector | None
) -> list[Equilibrium]:
    """Return the equilibria of a branch at a parameter value, in order along it."""
    near = AT * float(np.abs(branch.values).max(initial=0.0))
    level, passed = branch.monotone_runs.around(where, near)
    runs = [(begin, begin, end) for begin, end in level]
    if branch.closed and len(runs) > 1 and runs[0][1] == 0 and runs[-1][2] == len(branch) - 1:
        # the last row repeats the first: merge both ranges
        last = runs.pop()
        runs[0] = (0, last[1], runs[0][2])
    found: list[tuple[int, Equilibrium]] = []
    for place, begin, end in runs:
        moved = np.abs(branch.state[end] - branch.state[begin])
        vertical = bool(np.any(moved > MOVED * _unit(branch)))
        for row in (begin, end) if vertical else (begin,):
            found.append((place, stored(branch, row, constants, vertical)))
    found += [(row, between(branch, row, where, constants, corrector)) for row in passed]
    return [point for _, point in sorted(found, key=lambda entry: entry[0])]


def _unit(branch: Branch) -> Array:
    """Return the scale of each state on a branch, at least the unit of the model."""
    unit = np.abs(branch.state).max(axis=0, initial=0.0)
    for point in branch.special[:1]:
        if point.source is not None:
            unit = np.maximum(unit, point.source.unit)
    return unit


def wrapped(branch: Branch, state: Array) -> Array:
    """Return a state of a branch with periodic states in their principal range."""
    return principal(state, periods_of(branch.states, branch.periods))


def stored(
    branch: Branch, row: int, constants: Mapping[str, float], continuum: bool = False
) -> Equilibrium:
    """Return the equilibrium of one row."""
    return Equilibrium(
        branch.states,
        wrapped(branch, branch.state[row]),
        {**constants, branch.parameter: float(branch.values[row])},
        str(branch.region[row]),
        branch.admissible,
        branch.eigenvalues[row].copy(),
        continuum=continuum,
        known_stability=_known(branch, row),
    )


def _known(branch: Branch, row: int) -> str | None:
    return None if branch.known_stability is None else str(branch.known_stability[row])


def between(
    branch: Branch,
    row: int,
    where: float,
    constants: Mapping[str, float],
    corrector: Corrector | None,
) -> Equilibrium:
    """Return the equilibrium at a parameter value between a row and the next one."""
    state = hermite(branch, np.array([row]), np.array([where]))[0]
    region = str(branch.region[row])
    if corrector is not None:
        solved = corrector(region, state, where)
        if solved is not None:
            return solved
    low, high = branch.values[row], branch.values[row + 1]
    part = (where - low) / (high - low)
    return read_off(branch, row, part, state, {**constants, branch.parameter: where})


def read_off(
    branch: Branch, row: int, part: float, state: Array, parameters: Mapping[str, float]
) -> Equilibrium:
    """Return an interpolated equilibrium, with interpolated eigenvalues."""
    pair = branch.eigenvalues[row : row + 2]
    # separately, because a complex number times an infinite one (of sliding) is NaN
    real, imaginary = (np.array([1 - part, part]) @ p for p in (pair.real, pair.imag))
    return Equilibrium(
        branch.states,
        wrapped(branch, state),
        parameters,
        str(branch.region[row]),
        branch.admissible,
        real + 1j * imaginary,
        residual=float("nan"),
        interpolated=True,
        known_stability=_known(branch, row if part < 0.5 else row + 1),
    )


def validate_value(
    parameter: str, over: tuple[float, float], what: str, value: Mapping[str, float]
) -> float:
    """Validate a parameter value given by keyword.

    Raises
    ------
    UnknownNameError
        For the name of another quantity.
    ArgumentError
        For a value outside the range.
    """
    if list(value) != [parameter]:
        wrong = next((name for name in value if name != parameter), "nothing")
        raise unknown_name(f"{what} parameter", wrong, [parameter])
    where = finite(parameter, value[parameter])
    low, high = over
    if not low <= where <= high:
        raise ArgumentError(
            f"{parameter} = {where:g} is outside this {what}'s range [{low:g}, {high:g}]"
        )
    return where


def filter_equilibria(
    found: list[Equilibrium], stable: bool | None, region: str | None, regions: tuple[str, ...]
) -> list[Equilibrium]:
    """Select equilibria by stability and region."""
    if region is not None and region not in regions:
        raise unknown_name("region", region, regions)
    return [
        e
        for e in found
        if (stable is None or e.stable == stable) and (region is None or e.region == region)
    ]
