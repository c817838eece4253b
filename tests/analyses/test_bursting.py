"""Ends of the cycles of bursting neurons: a homoclinic orbit, and a reset on a saddle."""

import re

import pytest

from analyses import bursting, spiking

pytestmark = pytest.mark.slow


@pytest.mark.sample(0)
def test_the_gap_between_the_manifolds_vanishes_at_the_located_point():
    point = bursting.spiking()["HC1"]
    assert point["z"] == pytest.approx(bursting.checked(), abs=1e-12)
    assert point["z"] == pytest.approx(2.0856008819949, abs=1e-12)
    # the trace of the Jacobian at the saddle
    x = point.saddle[0]
    assert point.saddle_quantity == pytest.approx(-3 * x**2 + 6 * x - 1, abs=1e-11)


@pytest.mark.sample(0)
def test_the_period_grows_logarithmically():
    slope, expected = bursting.growth()
    assert slope == pytest.approx(expected, rel=0.1)


@pytest.mark.sample(0)
def test_every_burst_ends_at_the_homoclinic_orbit():
    overlay = bursting.burst()
    assert str(overlay.bursting) == "fold/homoclinic bursting"
    ends = overlay.transitions.select(type="end of oscillation")
    assert len(ends) >= 2
    assert {end.special.label for end in ends} == {"HC1"}


def test_the_spiking_of_the_neuron_with_a_reset_ends_at_its_saddle():
    overlay = spiking.passage()
    assert str(overlay.bursting) == "fold/homoclinic bursting"
    # the reset is on the saddle at u = 0, up to which the period grows logarithmically
    assert "the period grows as −ln|u − u*|" in overlay.summary()
    (end,) = re.findall(r"u\* ≈ (\S+),", overlay.summary())
    # extrapolated from the last cycle
    assert float(end) == pytest.approx(spiking.end(), abs=1e-6)
