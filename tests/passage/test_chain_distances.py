"""Distances from a polygonal curve, against the nearest of all its chords."""

import numpy as np
import pytest

from fastslow.passage.overlay import chain_distances
from fastslow.passage.overlay.chain_distances import beside_chain, nearness_to_chain
from fastslow.passage.overlay.following import resampled

pytestmark = pytest.mark.slow


@pytest.mark.sample(1)
@pytest.mark.parametrize("radius", [0.02, 0.1, 0.5])
def test_the_nearest_of_all_chords_counts(radius):
    draw = np.random.default_rng(7)
    slow = np.linspace(0.0, 1.0, 200)
    # with a corner and a vertical part
    height = np.where(slow < 0.7, np.abs(slow - 0.4), 0.9)
    chain = resampled(np.column_stack([np.sin(5 * slow), height, np.minimum(slow, 0.9)]))
    points = chain[draw.integers(0, 257, 400)] + draw.normal(0.0, radius, (400, 3))
    near = np.empty(400)
    nearness_to_chain(np.ascontiguousarray(points.T), chain, radius, near)
    begin, chord = chain[:-1], np.diff(chain, axis=0)
    length = (chord**2).sum(axis=1)
    part = ((points[:, None] - begin) * chord).sum(axis=2) / np.where(length > 0, length, 1.0)
    foot = begin + np.clip(part, 0.0, 1.0)[:, :, None] * chord
    exact = radius - np.sqrt(((points[:, None] - foot) ** 2).sum(axis=2).min(axis=1))
    beside = exact > 0.0
    assert 40 < beside.sum() < 360
    assert near[beside] == pytest.approx(exact[beside], abs=1e-13)
    assert (near[~beside] <= 0.0).all()


@pytest.mark.sample(1)
@pytest.mark.parametrize("radius", [0.02, 0.1, 0.5])
@pytest.mark.parametrize("pace", [1e-3, 0.02, 0.3])
def test_along_a_path_the_same_points_are_beside(radius, pace):
    """Far away, along the curve and through it, with parts at the same place in slow quantity."""
    draw = np.random.default_rng(11)
    slow = np.linspace(0.0, 1.0, 200)
    chain = resampled(np.column_stack([np.sin(5 * slow), np.minimum(slow, 0.9)]))
    path = np.cumsum(draw.normal(0.0, pace, (3000, 2)), axis=0)
    path = [np.sin(2.5), 0.5] + 1.2 * np.sin(path)
    path[1500:1600] = path[1500]
    path[1700] = np.nan
    points, near, beside = np.ascontiguousarray(path.T), np.empty(3000), np.empty(3000, dtype=bool)
    nearness_to_chain(points, chain, radius, near)
    beside_chain(points, chain, radius, beside)
    assert beside.any()
    assert np.array_equal(beside, near > 0.0)


def test_of_a_fine_path_most_points_are_not_looked_at(monkeypatch):
    chain = np.column_stack([np.zeros(257), np.linspace(0.0, 1.0, 257)])
    way = np.linspace(0.0, 1.0, 5000)
    points, beside = np.vstack([2.0 * way - 1.0, way]), np.empty(5000, dtype=bool)
    looked = []
    count = chain_distances.nearest_vertex
    monkeypatch.setattr(
        chain_distances, "nearest_vertex", lambda *given: looked.append(given[1]) or count(*given)
    )
    beside_chain(points, chain, 0.1, beside)
    assert len(looked) < 500
    assert np.array_equal(beside, np.abs(points[0]) < 0.1)
