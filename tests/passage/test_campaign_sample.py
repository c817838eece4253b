"""A sample of the campaign of overlays: every run against SciPy."""

from dataclasses import replace

import pytest

from tests.campaigns import overlays

pytestmark = pytest.mark.slow

SAMPLE = (
    "cusp, ω = 0.005",
    "van der Pol, Liénard, ε = 0.01",
    "gear, D = 0.25, ω = 0.01",
    "van der Pol, piecewise linear, ε = 0.01",
    "moving wells, rate-induced (Ashwin et al. 2012)",
)


@pytest.fixture(scope="module")
def known():
    return {case.name: case for case in overlays.cases()}


def test_the_campaign_has_thirty_runs_and_more(known):
    assert len(known) >= 30


@pytest.mark.sample(2)
@pytest.mark.parametrize("name", SAMPLE)
def test_what_is_named_is_there_and_nothing_is_missing(known, name):
    report = overlays.Report()
    overlays.check(report, known[name])
    assert report.failures == []
    assert len(report.rows) == 1


def test_a_wrong_name_is_found(known):
    """The campaign fails where it should: another rhythm and other kinds are expected."""
    report = overlays.Report()
    case = replace(known["cusp, ω = 0.005"], kinds={"Hopf"}, rhythm="Hopf/Hopf bursting")
    overlays.check(report, case)
    assert len(report.failures) == 2
