"""A sample of the campaign of crossings, and the case that began it."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from tests.campaigns.crossings import campaign

pytestmark = pytest.mark.slow


def test_crossings_of_random_piecewise_linear_systems():
    report = campaign(60, seed=14)
    assert report.failures == []
    assert report.crossings >= 60
    assert report.segments > 30
    assert report.worst_h < 1e-13


def test_crossings_just_after_the_start_of_a_long_step_are_found():
    """Between crossings of x + v/5 = 0 the force is constant: steps are as long as the span.

    Every motion ends in sliding along x = -v/5, and decays to the origin.
    """
    x, v = sp.symbols("x v")
    model = fs.Model({x: v, v: -sp.sign(x + v / 5)})
    random = np.random.default_rng(7)
    for _ in range(10):
        start = random.standard_normal(2) * 10.0 ** random.uniform(-2, 1)
        run = fs.simulate(model, start, t=(0, 10.0 ** random.uniform(5, 9)))
        assert run.outcome.success
        assert run.sampled_columns[:2, -1].tolist() == [0.0, 0.0]
