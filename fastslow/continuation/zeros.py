"""Brackets of the zeros of a test function along a sampled curve, including double crossings.

Between two rows with equal signs a smooth test function may vanish twice. Its modulus then
has a minimum there, so that one of the adjacent rows is a local minimum of the samples. The
minimum near each such row is computed by parabolic interpolation; if the test changes its
sign there, the step is divided.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Values below this fraction of the size of the test are rounding and count as zero.
TEST_ROUNDING = 1e-12

#: Maximum evaluations for one minimum.
MINIMUM_EVALUATIONS = 30

#: A minimum is reached if this many evaluations do not halve the value.
STALLED_EVALUATIONS = 5

#: Relative change of a test from row to row that is rounding.
FLAT_TEST = 1e-9

#: Smallest fraction of a step that is divided.
NARROWEST_BRACKET = 1e-9

#: Fractions of a step with a change of sign that are sampled to separate three zeros from one.
QUARTERS = (0.25, 0.5, 0.75)

P = TypeVar("P")

#: The test function at a row and a fraction of the step after it.
Between = Callable[[int, float], float | None]


@dataclass(frozen=True, eq=False)
class Node:
    """A point of the curve: its row, the fraction of the step after it, the value of the test."""

    row: int
    part: float
    value: float

    @property
    def place(self) -> float:
        return self.row + self.part


@dataclass(frozen=True, eq=False)
class Bracket:
    """Two points with tests of opposite sign that enclose one zero."""

    before: Node
    after: Node


def brackets(values: Array, between: Between) -> Iterator[Bracket]:
    """Bracket all changes of sign of a test function, in order along the curve.

    Parameters
    ----------
    values : ndarray, shape (N,)
        Values at the rows in units of the size of the test; not finite if undefined.
    between : callable
        Maps a row and a fraction of the step after it to the test there, None if the curve
        cannot be evaluated.

    Examples
    --------
    >>> def between(row, part):
    ...     return (row + part - 1.5) ** 2 - 0.01
    >>> values = np.array([between(row, 0.0) for row in range(4)])
    >>> [[round(n.place, 6) for n in (b.before, b.after)] for b in brackets(values, between)]
    [[1.0, 1.5], [1.5, 2.0]]
    """
    for run in _runs(values):
        nodes = [Node(int(row), 0.0, float(values[row])) for row in run]
        nodes = _quartered(nodes, between)
        lowest = [n for k in range(len(nodes)) if (n := _beyond(nodes, k, between)) is not None]
        nodes = sorted({n.place: n for n in (*nodes, *lowest)}.values(), key=lambda n: n.place)
        for one, other in itertools.pairwise(nodes):
            if one.value * other.value < 0:
                yield Bracket(one, other)


def _runs(values: Array) -> Iterator[NDArray[np.intp]]:
    """Runs of rows with values above rounding; a single row on a zero is skipped."""
    finite = np.isfinite(values)
    known = np.flatnonzero(finite & (np.abs(np.where(finite, values, 0.0)) > TEST_ROUNDING))
    start = 0
    for k in range(1, len(known) + 1):
        joined = k < len(known) and (
            known[k] - known[k - 1] == 1 or (known[k] - known[k - 1] == 2 and finite[known[k] - 1])
        )
        if not joined:
            if k - start > 1:
                yield known[start:k]
            start = k


def _quartered(nodes: list[Node], between: Between) -> list[Node]:
    """Add three nodes in every step with a change of sign."""
    result = [nodes[0]]
    for one, other in itertools.pairwise(nodes):
        if one.value * other.value < 0 and other.row == one.row + 1:
            for part in QUARTERS:
                found = between(one.row, part)
                if found is not None and np.isfinite(found) and found != 0:
                    result.append(Node(one.row, part, found))
        result.append(other)
    return result


def _beyond(nodes: list[Node], k: int, between: Between) -> Node | None:
    """Find a point of opposite sign near a node that is a local minimum of the modulus."""
    here = nodes[k]
    sign = np.sign(here.value)
    # a neighbour of opposite sign bounds the search, as an end of the curve does
    near = [n for n in nodes[max(k - 1, 0) : k + 2] if n is not here and n.value * sign > 0]
    if not near or any(abs(n.value) < abs(here.value) for n in near):
        return None
    if all(abs(n.value - here.value) <= FLAT_TEST * abs(here.value) for n in near):
        # constant to rounding
        return None

    def at(place: float) -> Node | None:
        row = min(int(np.floor(place)), nodes[-1].row - (nodes[-1].part == 0.0))
        found = between(row, place - row)
        return None if found is None or not np.isfinite(found) else Node(row, place - row, found)

    if len(near) == 2:
        low, high = near
    else:
        # a probe near an end gives the direction of change
        low, high = here, near[0]
        probe = at(here.place + 0.1 * (high.place - here.place))
        if probe is None or probe.value * sign < 0:
            return probe
        if probe.value * sign >= here.value * sign:
            return None
        low, here = here, probe
        if low.place > high.place:
            low, high = high, low
    return _lowest(low, here, high, float(sign), at)


def _lowest(
    low: Node, middle: Node, high: Node, sign: float, at: Callable[[float], Node | None]
) -> Node | None:
    """Find a point of opposite sign by minimising the modulus within three points."""
    best: list[float] = []
    for count in range(MINIMUM_EVALUATIONS):
        a, b, c = (n.place for n in (low, middle, high))
        fa, fb, fc = (n.value * sign for n in (low, middle, high))
        # the parabola through the three
        left, right = (b - a) * (fb - fc), (b - c) * (fb - fa)
        bend = ((fc - fb) / (c - b) - (fb - fa) / (b - a)) / (c - a)
        slope = (fb - fa) / (b - a) + bend * (b - a)
        promised = fb - slope**2 / (4.0 * bend) if bend > 0 else fb
        best.append(fb)
        # near a zero the values decrease by large factors, near a positive minimum they do not
        settled = len(best) > STALLED_EVALUATIONS and fb > 0.5 * best[-1 - STALLED_EVALUATIONS]
        if (settled and promised > 0.5 * fb) or c - a < NARROWEST_BRACKET:
            return None
        place = b - 0.5 * ((b - a) * left - (b - c) * right) / (left - right) if bend > 0 else b
        wide = max(b - a, c - b)
        if not a < place < c or abs(place - b) < 1e-3 * wide or count % 4 == 3:
            # a step into the longer part
            place = b - 0.4 * (b - a) if b - a > c - b else b + 0.4 * (c - b)
        found = at(place)
        if found is None or found.value * sign < 0:
            return found
        if found.value * sign < fb:
            low, middle, high = (low, found, middle) if place < b else (middle, found, high)
        elif place < b:
            low = found
        else:
            high = found
    return None


def by_halving(solve: Callable[[], P | None], halve: Callable[[], bool], most: int) -> P | None:
    """Solve for a zero in an interval; without success halve the interval and try again.

    Parameters
    ----------
    solve : callable
        Returns the zero if it is in the interval, else None.
    halve : callable
        Keeps the half of the interval that contains the zero; False where that fails.
    most : int
        Number of trials.
    """
    for _ in range(most):
        found = solve()
        if found is not None:
            return found
        if not halve():
            break
    return None
