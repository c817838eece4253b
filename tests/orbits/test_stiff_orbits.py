"""Orbits of stiff models, against the explicit flow, closed forms and an asymptotic period."""

import time

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.orbits.find import finding, stiff_orbits
from tests.orbits.models import t, v, x

e = sp.Symbol("e")


def relaxation(ratio):
    return fs.Model({x: (v - x**3 / 3 + x) / e, v: -x}, parameters={e: ratio})


@pytest.mark.sample(2)
@pytest.mark.parametrize("ratio", [1e-5, 1e-6, 1e-8])
def test_relaxation_cycles_from_runs_and_states(ratio):
    model = relaxation(ratio)
    run = fs.simulate(model, [2, 0], t=(0, 20))
    found = fs.find_orbit(model, run)
    begun = time.process_time()
    again = fs.find_orbit(model, run)
    assert time.process_time() - begun < 1
    assert again.period == found.period
    for orbit in (found, fs.find_orbit(model, [2, 0])):
        assert orbit.outcome
        assert not orbit.outcome.notes
        assert orbit.stability == "stable"
        # with the first zero of the Airy function Ai (Grasman 1987, section 2.2)
        leading = 3 - 2 * np.log(2) + 3 * 2.338107410459767 * ratio ** (2 / 3)
        assert abs(orbit.period - leading) < -ratio * np.log(ratio)
        assert orbit.period == pytest.approx(found.period, rel=1e-13)
        assert orbit.log_multipliers[0] == pytest.approx(0, abs=1e-9)
        assert orbit.trivial == 0
        assert max(orbit.residual, orbit.accuracy) < 1e-12


def test_both_methods_have_the_same_orbit(monkeypatch):
    model = relaxation(1e-3)
    run = fs.simulate(model, [2, 0], t=(0, 20))
    explicit = fs.find_orbit(model, run)
    monkeypatch.setattr(finding, "is_stiff", lambda *_: True)
    implicit = fs.find_orbit(model, run)
    assert implicit.period == pytest.approx(explicit.period, rel=1e-13)
    assert implicit.log_multipliers[1] == pytest.approx(explicit.log_multipliers[1], rel=1e-9)
    assert implicit.defect < 1e-9


@pytest.mark.parametrize("ratio", [1e-2, 1e-5, 1e-7])
def test_a_forced_linear_model_in_closed_form(ratio, monkeypatch):
    """The state x = (cos t + e sin t)/(1 + e**2), exponents -1/e, -1 and -1/2."""
    y, z = sp.symbols("y z")
    rates = {x: (sp.cos(t) - x) / e, y: x - y, z: y - z / 2}
    model = fs.Model(rates, parameters={e: ratio})
    monkeypatch.setattr(stiff_orbits, "STIFF", 10)
    orbit = fs.find_orbit(model, [1, 0, 0])
    assert orbit.outcome
    times = np.linspace(0, 2 * np.pi, 50)
    exact = (np.cos(times) + ratio * np.sin(times)) / (1 + ratio**2)
    assert orbit(times)[0] == pytest.approx(exact, abs=1e-12)
    logs = -2 * np.pi * np.array([0.5, 1, 1 / ratio])
    assert orbit.log_multipliers == pytest.approx(logs, rel=1e-10)
    assert orbit.multipliers[:2].real == pytest.approx(np.exp(logs[:2]), rel=1e-10)


def test_multipliers_of_a_plane_that_turns_by_half_are_negative(monkeypatch):
    """u' = A(t) u with A = R B R⁻¹ + R'R⁻¹ and R = rotation by t/2: the multipliers -exp(2πB)."""
    y, z = sp.symbols("y z")
    half = sp.Rational(1, 2)
    # B = diag(-1/10, -1/5)
    mean, swing = -sp.Rational(3, 20), sp.Rational(1, 20)
    rates = {
        y: (mean + swing * sp.cos(t)) * y + (swing * sp.sin(t) - half) * z,
        z: (swing * sp.sin(t) + half) * y + (mean - swing * sp.cos(t)) * z,
        x: (sp.cos(t) - x) / e,
    }
    monkeypatch.setattr(stiff_orbits, "STIFF", 10)
    orbit = fs.find_orbit(fs.Model(rates, parameters={e: 1e-2}), [0, 0, 1])
    assert orbit.outcome
    exact = -np.exp(-2 * np.pi * np.array([0.1, 0.2]))
    assert orbit.multipliers[:2].real == pytest.approx(exact, rel=1e-9)
    # the smallest follows from the others and the trace: the determinant is positive
    assert orbit.multipliers[2].real > 0
    assert orbit.log_multipliers[2] == pytest.approx(-200 * np.pi, rel=1e-9)


def test_radau_nodes_integrate_polynomials():
    nodes, matrix = stiff_orbits._radau()
    powers = nodes[:, None] ** np.arange(stiff_orbits.COLLOCATION_POINTS)
    exact = nodes[:, None] ** np.arange(1, stiff_orbits.COLLOCATION_POINTS + 1)
    exact = exact / np.arange(1, stiff_orbits.COLLOCATION_POINTS + 1)
    assert np.abs(matrix @ powers - exact).max() < 1e-13
    # the last row has twice the order: 2 s - 1
    for power in range(2 * stiff_orbits.COLLOCATION_POINTS - 1):
        assert matrix[-1] @ nodes**power == pytest.approx(1 / (power + 1), abs=1e-14)
