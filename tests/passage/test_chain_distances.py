"""Distances from a polygonal curve, against the nearest of all its chords."""

import numpy as np
import pytest

from fastslow.passage.chain_distances import nearness_to_chain
from fastslow.passage.stays import _resampled


@pytest.mark.parametrize("radius", [0.02, 0.1, 0.5])
def test_the_nearest_of_all_chords_counts(radius):
    draw = np.random.default_rng(7)
    slow = np.linspace(0.0, 1.0, 200)
    # with a corner and a vertical part
    height = np.where(slow < 0.7, np.abs(slow - 0.4), 0.9)
    chain = _resampled(np.column_stack([np.sin(5 * slow), height, np.minimum(slow, 0.9)]))
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
