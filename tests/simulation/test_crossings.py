"""A sample of the campaign of crossings, and the case that began it."""

import pytest

from tests.campaigns.crossings import campaign

pytestmark = pytest.mark.slow


def test_crossings_of_random_piecewise_linear_systems():
    report = campaign(400, seed=14)
    assert report.failures == []
    assert report.crossings >= 400
    assert report.segments > 200
    assert report.worst_h < 1e-13
