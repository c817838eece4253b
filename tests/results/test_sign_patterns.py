"""Which sign patterns of affine functions have room: arrangements of lines, counted."""

from itertools import product

import numpy as np
import pytest

from fastslow.errors import ModelError
from fastslow.results.stored.sign_patterns import MOST_REGIONS, possible_patterns

#: a x + b y + c, in general position.
LINES = np.array([[1, 0, 0], [0, 1, 0], [1, 1, -1], [1, -2, 3], [3, 1, 5]], dtype=float)


def room(rows):
    """Sign patterns found at points of the plane, next to all corners and far away."""
    corners = [np.zeros(2)]
    for j, one in enumerate(rows):
        for other in rows[:j]:
            corners.append(np.linalg.solve([one[:2], other[:2]], [-one[2], -other[2]]))
    directions = [(np.cos(a), np.sin(a)) for a in np.linspace(0, 2 * np.pi, 360, endpoint=False)]
    places = [c + r * np.array(d) for c, r, d in product(corners, (1e-3, 1e3), directions)]
    signs = np.sign(np.array([row[:2] @ np.array(places).T + row[2] for row in rows]))
    return {tuple(map(int, column)) for column in signs.T if column.all()}


@pytest.mark.parametrize("count", [2, 3, 4, 5])
def test_lines_in_general_position(count):
    """N of them part the plane into 1 + N (N + 1)/2."""
    rows = list(LINES[:count])
    patterns = possible_patterns(rows)
    assert len(patterns) == 1 + count * (count + 1) // 2
    assert set(patterns) == room(rows)
    assert patterns == sorted(patterns, reverse=True)


def test_parallel_lines_and_functions_that_are_not_affine():
    """x > 1 and x > −1 leave out one pattern; of what is no line nothing is known."""
    rows = [np.array([1.0, 0.0, -1.0]), np.array([-2.0, 0.0, -2.0])]
    assert possible_patterns(rows) == [(1, -1), (-1, 1), (-1, -1)]
    assert len(possible_patterns([*rows, None])) == 6


def test_a_region_without_room_is_none():
    """x > 0, y > 0 and x + y < 0 meet in a corner only, and just so with x + y < 1e-6."""
    corner = [np.array([1.0, 0, 0]), np.array([0, 1.0, 0]), np.array([1.0, 1.0, 0])]
    assert (1, 1, -1) not in possible_patterns(corner)
    assert (-1, -1, 1) not in possible_patterns(corner)
    assert len(possible_patterns(corner)) == 6
    beside = [*corner[:2], np.array([1.0, 1.0, -1e-6])]
    assert (1, 1, -1) in possible_patterns(beside)
    assert len(possible_patterns(beside)) == 7


def test_more_regions_than_can_be_compiled():
    """Ten contacts with friction have 1024 regions; of a chain of sixty none is begun."""
    assert len(possible_patterns([None] * 10)) == MOST_REGIONS
    with pytest.raises(ModelError, match="the 60 interfaces divide the states into more than"):
        possible_patterns([None] * 60)
