"""Refined maps against sets of known area and boundary; few evaluations, none twice, no loss."""

from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor

import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import trapezoid

import fastslow as fs
from fastslow.errors import ArgumentError, UnknownNameError
from fastslow.results.base.outcome import Outcome
from fastslow.simulation.settings import Execution
from fastslow.sweeps.refinement import refined_map
from fastslow.sweeps.settings import Refinement
from tests.samples import examples

pytestmark = pytest.mark.slow

UNIT = {"x": (0, 1), "y": (0, 1)}
SQUARE = {"x": (-1, 1), "y": (-1, 1)}


def disc(x, y, middle=(0.1, -0.05), radius=0.5**0.5):
    return np.hypot(x - middle[0], y - middle[1]) < radius


class Counted:
    """A function that remembers at which points it was asked."""

    def __init__(self, function):
        self.function, self.points, self.calls = function, [], 0

    def __call__(self, x, y):
        self.points += list(zip(x.tolist(), y.tolist(), strict=True))
        self.calls += 1
        return self.function(x, y)


def covered(found):
    """How often each finest cell is covered."""
    plane = np.zeros(found.shape, dtype=int)
    for i, j, size in found.cells:
        plane[i : i + size, j : j + size] += 1
    return plane


@pytest.mark.parametrize("levels", [0, 1, 4, 6])
def test_disc(levels):
    found = refined_map(disc, SQUARE, refinement=Refinement(levels=levels))
    # the perimeter times half a cell, less than its share where errors of both signs mix
    assert 4 * found.shares[True] == pytest.approx(np.pi / 2, abs=2 * found.steps[0] ** 1.5)
    (line,) = found.boundary(False, True)
    assert line.closed
    radii = np.hypot(line.points[:, 0] - 0.1, line.points[:, 1] + 0.05)
    assert np.abs(radii - np.sqrt(0.5)).max() < found.steps[0]
    assert np.all(line.accuracy.max(axis=1) == 0.5 * found.steps[0])
    assert np.all(covered(found) == 1)


def test_points_of_a_boundary_are_narrowed():
    found = refined_map(disc, SQUARE, refinement=Refinement(levels=3, resolution=1e-12))
    (line,) = found.boundary(False, True)
    radii = np.hypot(line.points[:, 0] - 0.1, line.points[:, 1] + 0.05)
    # the slope at which a side meets the circle only shrinks the distance
    assert np.abs(radii - np.sqrt(0.5)).max() < 2e-12
    assert 0 < line.accuracy.max() <= 1e-12
    assert np.count_nonzero(line.accuracy) == len(line.points)


def test_the_work_grows_with_the_boundary_and_nothing_is_asked_twice():
    counts = []
    for levels in (4, 5, 6, 7):
        asked = Counted(disc)
        found = refined_map(asked, SQUARE, refinement=Refinement(levels=levels))
        assert len(set(asked.points)) == len(asked.points) == found.n_evaluations
        assert asked.calls == levels + 1
        counts.append(found.n_evaluations)
    growth = np.array(counts[1:]) / counts[:-1]
    # a grid would give 4
    assert np.all(growth < 2.1)
    assert counts[-1] < 0.03 * found.n_pixels


def test_a_tongue_is_followed_into_its_tip():
    # 0 < y < (x - 0.1)³ from a tip at x = 0.1, thin for a long way
    def tongue(x, y):
        return np.where((x > 0.1) & (np.abs(y - 0.31) < (x - 0.1) ** 3), "locked", "free")

    found = refined_map(tongue, UNIT, refinement=Refinement(levels=7))
    # ∫ 2 (x - 0.1)³ from 0.1, less the part above y = 1 and below y = 0
    x = np.linspace(0.1, 1, 200_001)
    width = np.minimum((x - 0.1) ** 3, 0.31) + np.minimum((x - 0.1) ** 3, 0.69)
    assert found.shares["locked"] == pytest.approx(trapezoid(width, x), abs=1e-3)
    points = np.concatenate([line.points for line in found.boundary("locked", "free")])
    # followed down to where the tongue is as wide as the finest cells
    assert points[:, 0].min() < 0.1 + (0.5 * found.steps[1]) ** (1 / 3) + 2 * found.steps[0]


def test_neighbours_are_divided_too():
    # an island half a coarse cell wide beside a straight boundary
    def island(x, y):
        near = (np.abs(x - 0.56) < 0.02) & (np.abs(y - 0.53) < 0.02)
        return (x < 0.4999) | near

    with_guard = refined_map(island, UNIT, refinement=Refinement(levels=6, guard=2))
    assert with_guard.at(0.56, 0.53)
    assert len(with_guard.boundary(True, False)) == 2
    without = refined_map(island, UNIT, refinement=Refinement(levels=6, guard=0))
    assert not without.at(0.56, 0.53)
    assert without.n_evaluations < with_guard.n_evaluations


def test_a_boundary_that_enters_a_cell_between_its_corners():
    # a corner of the set pokes into coarse cells whose own corners agree
    def wedge(x, y):
        return np.abs(y - 0.5625) < 0.05 * (x - 0.1)

    found = refined_map(wedge, UNIT, refinement=Refinement(cells=(4, 8), levels=5, guard=0))
    for (i, j, size), corner in zip(found.cells, found.corner_codes, strict=True):
        if size > 1:
            inside = (found.corners >= (i, j)) & (found.corners <= (i + size, j + size))
            assert set(found.codes[inside.all(axis=1)]) == {corner[0, 0]}
    assert np.all(covered(found) == 1)


def test_a_single_label():
    asked = Counted(lambda x, y: np.full(len(x), 7))
    found = refined_map(asked, SQUARE, refinement=Refinement(cells=(3, 2)))
    assert asked.calls == 1
    assert found.labels == (7,)
    assert found.shares == {7: 1.0}
    assert found.boundaries == ()
    assert (len(found.cells), len(found.corners)) == (6, 12)
    assert found.at(0.3, y=-1) == 7
    assert found.bounds[0] == pytest.approx([-1, -1 / 3, -1, 0])
    assert found.bounds[-1] == pytest.approx([1 / 3, 1, 0, 1])
    assert "7: 100.00% of the area" in repr(found)


def test_three_labels_meet_in_a_point():
    def sectors(x, y):
        return np.floor(np.arctan2(y - 0.013, x + 0.021) % (2 * np.pi) / (2 * np.pi / 3))

    found = refined_map(sectors, SQUARE, refinement=Refinement(levels=6, resolution=1e-6))
    assert found.labels == (0, 1, 2)
    ends = []
    for pair in ((0, 1), (1, 2), (0, 2)):
        (line,) = found.boundary(*pair)
        assert not line.closed
        place = line.points - (-0.021, 0.013)
        ends.append(np.hypot(*place[[0, -1]].T).min())
    assert max(ends) < 2 * found.steps[0]


def test_labels_at_opposite_corners():
    # a chequered cell: True at two opposite corners of the only one
    found = refined_map(
        lambda x, y: (x < 0.5) == (y < 0.5), UNIT, refinement=Refinement(cells=(1, 1), levels=0)
    )
    lines = found.boundary(False, True)
    assert [len(line.points) for line in lines] == [2, 2]
    # each cuts off one corner that is True, the label later in order
    assert sorted(np.min(line.points, axis=0).tolist() for line in lines) == [[0, 0], [0.5, 0.5]]


@settings(max_examples=examples(30))
@given(
    st.floats(-0.6, 0.6),
    st.floats(-0.6, 0.6),
    st.floats(0.3, 0.9),
    st.floats(0, np.pi),
    st.integers(0, 2),
    st.sampled_from([(2, 3), (4, 4), (5, 2)]),
)
def test_laws(a, b, radius, turn, guard, cells):
    def label(x, y):
        inside = disc(x, y, (a, b), radius)
        return inside + 2 * (np.cos(turn) * x + np.sin(turn) * y > 0.1)

    found = refined_map(label, SQUARE, refinement=Refinement(cells=cells, levels=4, guard=guard))
    again = refined_map(label, SQUARE, refinement=Refinement(cells=cells, levels=4, guard=guard))
    for name in ("corners", "codes", "cells"):
        assert np.array_equal(getattr(found, name), getattr(again, name))
    assert found.labels == again.labels
    assert sum(found.shares.values()) == pytest.approx(1, abs=1e-12)
    assert np.all(covered(found) == 1)
    # the two axes exchanged
    swapped = refined_map(
        lambda x, y: label(y, x),
        {"y": (-1, 1), "x": (-1, 1)},
        refinement=Refinement(cells=cells[::-1], levels=4, guard=guard),
    )
    assert swapped.shares == pytest.approx(found.shares)
    for one, other in zip(found.boundaries, swapped.boundaries, strict=True):
        assert one.labels == other.labels
    flipped = {tuple(row) for row in swapped.cells[:, [1, 0, 2]].tolist()}
    assert flipped == {tuple(row) for row in found.cells.tolist()}
    joined, turned = (
        sorted(map(tuple, np.concatenate([line.points[:, way] for line in m.boundaries]).tolist()))
        if m.boundaries
        else []
        for m, way in ((found, [0, 1]), (swapped, [1, 0]))
    )
    assert set(joined) == set(turned)
    # at the points evaluated the map says what the function says
    points = found.points
    assert np.array_equal(found.at(points[:, 0], points[:, 1]), label(points[:, 0], points[:, 1]))
    # every boundary point lies between points of the two labels
    for line in found.boundaries:
        assert np.all(line.points >= -1)
        assert np.all(line.points <= 1)


def test_looking_up():
    found = refined_map(disc, SQUARE, refinement=Refinement(levels=5))
    x, y = np.random.default_rng(1).uniform(-1, 1, (2, 4000))
    answers = found.at(x, y)
    far = np.abs(np.hypot(x - 0.1, y + 0.05) - np.sqrt(0.5)) > 1.5 * found.steps[0]
    assert np.array_equal(answers[far], disc(x, y)[far])
    assert answers.dtype == bool
    assert found.at(x=[0.1, 0.9], y=0.0).tolist() == [True, False]
    assert found.at(1, 1) is False
    with pytest.raises(ArgumentError, match=r"y = 1.5; the map covers \[-1, 1\]"):
        found.at(0, 1.5)
    with pytest.raises(ArgumentError, match="x = nan; the map covers"):
        found.at(np.nan, 0)
    with pytest.raises(UnknownNameError, match="unknown axis 'z'"):
        found.at(z=1, x=0)
    for given_values, named in (((1,), {}), ((0, 0), {"x": 0}), ((0,), {"x": 0}), ((0, 0, 0), {})):
        with pytest.raises(ArgumentError, match="a value for each of x, y"):
            found.at(*given_values, **named)
    with pytest.raises(UnknownNameError, match="unknown label 'inside'"):
        found.boundary("inside", True)


def test_failures_lose_nothing_else():
    def fragile(x, y):
        if np.any((x == 0.5) & (y > 0.5)):
            raise ZeroDivisionError("x is one half")
        return np.where(x > 0.3, "right", "left")

    found = refined_map(fragile, UNIT, refinement=Refinement(cells=(4, 4), levels=3))
    assert found.labels == ("left", "right", "failed")
    assert {point[0] for point, _ in found.failures} == {0.5}
    assert {reason for _, reason in found.failures} == {"x is one half"}
    assert found.at(0.5, 1) == "failed"
    assert found.shares["left"] == pytest.approx(0.3, abs=found.steps[0])
    assert "failed; at x = 0.5, y = 0.75: x is one half" in repr(found)


def test_every_kind_of_failure_in_the_place_of_a_label():
    no = Outcome("blow-up", "the state grew without bound.", False)
    yes = Outcome("end", "reached the end.", True)
    values = iter([1, None, float("nan"), ValueError("wrong"), no, yes])
    found = refined_map(
        lambda x, y: [next(values) for _ in x], UNIT, refinement=Refinement(cells=(1, 2), levels=0)
    )
    assert found.labels == (1, "end", "failed")
    reasons = [reason for _, reason in found.failures]
    assert reasons == ["no outcome", "no outcome", "wrong", "the state grew without bound."]


def test_what_fails_everywhere_is_raised():
    def wrong(x, y):
        raise KeyError("omga")

    with pytest.raises(KeyError, match="omga"):
        refined_map(wrong, UNIT)


def test_comparing():
    found = refined_map(disc, SQUARE, refinement=Refinement(levels=5))
    same = found.compare(disc)
    assert same.share == 1
    assert same.disagreements == {}
    other = found.compare(lambda x, y: disc(x, y, radius=0.6))
    # points stand for a ring of area π (0.5 − 0.36) in a square of area 4
    assert 1 - other.share == pytest.approx(np.pi * 0.14 / 4, rel=0.05)
    ((pair, points),) = other.disagreements.items()
    assert pair == (True, False)
    radii = np.hypot(points[:, 0] - 0.1, points[:, 1] + 0.05)
    assert radii.min() >= 0.6
    assert radii.max() < np.sqrt(0.5)
    assert f"{len(points)} found True, predicted False" in repr(other)
    with pytest.raises(ArgumentError, match="1 labels for"):
        found.compare(lambda x, y: [True])


def test_progress(capsys):
    refined_map(disc, SQUARE, refinement=Refinement(levels=2), execution=Execution(progress=True))
    assert "point" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"over": {"x": (0, 1)}}, "ranges of two parameters, received x"),
        ({"over": {}}, "received none"),
        ({"over": {"x": (0, 1), "y": (1, 1)}}, r"over y = \(1, 1\); expected two finite"),
        ({"over": {"x": (0, np.inf), "y": (0, 1)}}, "over x"),
        ({"over": {"x": 3, "y": (0, 1)}}, "over x = 3; expected two finite numbers"),
        ({"refinement": Refinement(levels=40)}, "levels = 40; expected fewer"),
        ({"function": lambda x, y: x}, "0.125 is not a label of a map"),
        (
            {
                "function": lambda x, y: [k % 2 or False for k, _ in enumerate(x)],
                "refinement": Refinement(levels=0),
            },
            "some labels are",
        ),
        ({"function": lambda x, y: [1]}, "returned 1 labels for 81 points"),
    ],
)
def test_wrong_arguments(changes, message):
    arguments = {"function": disc, "over": UNIT, **changes}
    with pytest.raises(ArgumentError, match=message):
        refined_map(**arguments)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"cells": (0, 4)}, "cells = 0; expected an integer from 1"),
        ({"cells": 8}, "cells = 8; expected two integers"),
        ({"levels": -1}, "levels = -1"),
        ({"guard": 0.5}, "guard = 0.5"),
        ({"resolution": 0}, "resolution = 0; expected a positive number"),
    ],
)
def test_wrong_settings(changes, message):
    with pytest.raises(ArgumentError, match=message):
        Refinement(**changes)


def below(a, b):
    """Labels of a plane, for worker processes."""
    if (b > 0.95).any():
        raise ValueError("too high")
    return a**2 > b


def test_the_points_of_a_level_are_shared_among_workers():
    refinement = Refinement(levels=3, resolution=1e-4)
    alone = refined_map(below, SQUARE, refinement=refinement)
    with ThreadPoolExecutor(2) as threads, ProcessPoolExecutor(2) as processes:
        for executor in (threads, processes):
            given = Execution(executor=executor, chunk=16)
            assert refined_map(below, SQUARE, refinement=refinement, execution=given) == alone


def test_maps_of_regimes_and_basins_are_shared_among_processes():
    gear = fs.systems.harmonic_gear(omega=0.1)
    over, once = {"D": (0.02, 0.3), "ratio": (0.95, 1.1)}, Refinement(cells=(2, 2), levels=1)
    given = {"parameters": {"C": "B*ratio"}, "refinement": once, "periods": 2}
    x, v = sp.symbols("x v")
    wells = fs.Model({x: v, v: x - x**3 - v / 2})
    box = {x: (-2, 2), v: (-1, 1.1)}
    found = fs.attractors(wells, box, 8)
    with ProcessPoolExecutor(2) as pool:
        shared = Execution(executor=pool, chunk=4)
        alone = fs.regime_map(gear, over, [0, 0], **given)
        assert fs.regime_map(gear, over, [0, 0], execution=shared, **given) == alone
        plane = {"known": found, "refinement": once}
        assert fs.basins(wells, box, execution=shared, **plane) == fs.basins(wells, box, **plane)
