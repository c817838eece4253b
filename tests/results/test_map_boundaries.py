"""Lines between the areas of a map, from labels at the corners of cells made by hand."""

import numpy as np
import pytest

from fastslow.results.maps.boundaries import MapEdges, boundaries_of


def lines(labels, width=0.0):
    """Boundaries of a grid of labels, first index across; every crossing in the middle."""
    labels = np.array(labels)
    cells = [(i, j) for i in range(labels.shape[0] - 1) for j in range(labels.shape[1] - 1)]
    codes = [labels[i : i + 2, j : j + 2] for i, j in cells]
    places = [
        (i, j, axis)
        for (i, j), here in np.ndenumerate(labels)
        for axis, other in ((0, (i + 1, j)), (1, (i, j + 1)))
        if other[0] < labels.shape[0] and other[1] < labels.shape[1] and here != labels[other]
    ]
    bracket = (0.5 - width, 0.5 + width)
    edges = MapEdges(
        np.array(places).reshape(-1, 3), np.array([bracket] * len(places)).reshape(-1, 2)
    )
    return boundaries_of(np.array(cells), np.array(codes), ("a", "b", "c"), edges, lambda p: 2 * p)


def test_a_straight_line_across_three_cells():
    """Left b, right a: from below to above at half a cell, in units of two."""
    (line,) = lines([[1, 1, 1, 1], [0, 0, 0, 0]], width=0.25)
    assert line.labels == ("a", "b")
    points = line.points[np.argsort(line.points[:, 1])]
    assert points.tolist() == [[1, 0], [1, 2], [1, 4], [1, 6]]
    assert line.accuracy.tolist() == [[0.5, 0.0]] * 4
    assert not line.closed


def test_a_line_up_the_other_way():
    (line,) = lines([[0, 1], [0, 1], [0, 1]])
    points = line.points[np.argsort(line.points[:, 0])]
    assert points.tolist() == [[0, 1], [2, 1], [4, 1]]


def test_an_island_is_a_closed_line():
    (line,) = lines([[0, 0, 0], [0, 2, 0], [0, 0, 0]])
    assert line.labels == ("a", "c")
    assert line.closed
    assert {tuple(p) for p in line.points.tolist()} == {(1, 2), (2, 1), (3, 2), (2, 3)}


def test_three_labels_meet_in_the_middle_of_a_cell():
    found = lines([[0, 1], [2, 2]])
    assert [line.labels for line in found] == [("a", "b"), ("a", "c"), ("b", "c")]
    for line, side in zip(found, [(0, 1), (1, 0), (1, 2)], strict=True):
        assert {tuple(p) for p in line.points.tolist()} == {side, (1, 1)}


@pytest.mark.parametrize("turned", [False, True])
def test_of_two_labels_at_opposite_corners_the_later_is_cut_off(turned):
    """b at two opposite corners: each is cut off, a stays joined across the cell."""
    corners = [[0, 1], [1, 0]] if turned else [[1, 0], [0, 1]]
    found = lines(corners)
    assert [line.labels for line in found] == [("a", "b")] * 2
    pairs = {frozenset(map(tuple, line.points.tolist())) for line in found}
    cut = [((0, 1), (1, 0)), ((2, 1), (1, 2))]
    if turned:
        cut = [((0, 1), (1, 2)), ((2, 1), (1, 0))]
    assert pairs == {frozenset(pair) for pair in cut}
