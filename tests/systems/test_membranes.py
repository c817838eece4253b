"""Spikes and cycles of the gated membranes against SciPy and AUTO-07p."""

import numpy as np
import pytest

import fastslow as fs

pytestmark = pytest.mark.slow

WINDOW = {"V": (-110, 50), "m": (0, 1), "h": (0, 1), "n": (0, 1)}


@pytest.fixture(scope="module")
def axon():
    return fs.continue_equilibria(fs.systems.hodgkin_huxley(), "I_0", over=(5, 200), window=WINDOW)


def test_the_spike_of_the_axon():
    """The period of SciPy's DOP853, rtol 1e-13, is 14.63832479."""
    model = fs.systems.hodgkin_huxley()
    orbit = fs.find_orbit(model, fs.simulate(model, [-60, 0.1, 0.5, 0.3], t=(0, 300)))
    assert orbit.outcome
    assert orbit.period == pytest.approx(14.63832479, abs=5e-9)
    assert orbit["V"].max() > 30


@pytest.mark.parametrize("V", [-40.0, -55.0, np.nextafter(-40, 0), -40 + 1e-12])
def test_starts_at_the_singular_points_of_the_rates(V):
    model = fs.systems.hodgkin_huxley()
    run = fs.simulate(model, [V, 0.1, 0.5, 0.3], t=(0, 1))
    beside = fs.simulate(model, [V + 1e-5, 0.1, 0.5, 0.3], t=(0, 1))
    assert run.outcome
    assert np.abs(run.end[1:] - beside.end[1:]).max() < 1e-4


def test_cycles_of_the_axon_from_hopf_point_to_hopf_point(axon):
    """Hopf points to 14 digits; folds and a period doubling of AUTO-07p, NTST 150, NCOL 5."""
    first, second = sorted(point["I_0"] for point in axon.special("HB"))
    assert first == pytest.approx(9.77933799539312633, rel=1e-13)
    assert second == pytest.approx(154.526333665808, rel=1e-13)
    (branch,) = fs.continue_cycles(axon)
    assert [outcome.code for outcome in branch.outcomes] == ["Hopf point"] * 2
    assert branch["max(V)"].max() > 20
    current = np.sort(branch["I_0"])
    assert np.diff(current[(current > 9) & (current < 154)]).max() < 20
    assert current[-1] == pytest.approx(second, rel=1e-4)
    folds = sorted(point["I_0"] for point in branch.special("LPC"))
    assert folds == pytest.approx([6.2642212745, 7.8462471202, 7.9216854943], abs=2e-9)
    doublings = [point["I_0"] for point in branch.special("PD")]
    assert min(doublings) == pytest.approx(7.8492373978, abs=2e-9)


@pytest.mark.sample(0)
def test_the_pacemaker():
    """The period of SciPy's DOP853, rtol 3e-14, and the Hopf point by mpmath, 40 digits."""
    model = fs.systems.noble()
    orbit = fs.find_orbit(model, fs.simulate(model, [-80, 0.05, 0.8, 0.5], t=(0, 3000)))
    assert orbit.outcome
    assert orbit.period == pytest.approx(839.50706878, abs=2e-8)
    diagram = fs.continue_equilibria(model, "g_An", over=(0.1, 0.4), window=WINDOW)
    (hopf,) = diagram.special("HB")
    assert hopf["g_An"] == pytest.approx(0.20088297665229985, rel=1e-12)
