"""Known equilibria, bifurcations and periods of the ready-made models."""

import math

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

from fastslow import systems

OTHERS = {"gear_scales", "slow_load_criterion", "slow_load_gap"}
ALL = [name for name in systems.__all__ if name.islower() and name not in OTHERS]


def field_of(model, region, extra=None):
    """Rates of the fast states of one region, and their Jacobian, as functions of the state."""
    names = [sp.Symbol(s, real=True) for s in model.states]
    values = {**model.values, **{sp.Symbol(k, real=True): v for k, v in (extra or {}).items()}}
    rates = sp.Matrix([model.regions[region].rates[s] for s in model.states]).subs(values)
    return sp.lambdify([names], rates), sp.lambdify([names], rates.jacobian(names))


def at(model, region, state, **extra):
    rates, jacobian = field_of(model, region, extra)
    return np.ravel(rates(state)), np.linalg.eigvals(np.asarray(jacobian(state), dtype=float))


@pytest.mark.parametrize("name", ALL)
def test_every_model_has_regions_and_values(name):
    model = getattr(systems, name)()
    assert model.regions
    assert model.free == ()
    assert "References" in getattr(systems, name).__doc__


@pytest.mark.parametrize("sign", [1, -1])
def test_cusp_folds(sign):
    rates, eigenvalues = at(
        systems.cusp(), "S1", [-sign / math.sqrt(3)], p=sign * 2 / (3 * math.sqrt(3))
    )
    assert abs(rates[0]) < 1e-15
    assert abs(eigenvalues[0]) < 1e-15


def test_van_der_pol_hopf_and_period():
    model = systems.van_der_pol()
    rates, eigenvalues = at(model, "S1", [1.0, 0.0], w=1.0)
    assert np.all(rates == 0)
    assert sorted(eigenvalues.imag) == pytest.approx([-1, 1])
    assert np.all(np.abs(eigenvalues.real) < 1e-15)
    free, _ = field_of(model, "S1", {"w": 0.0})

    def upwards(t, z):
        return z[0]

    upwards.direction = 1.0
    done = solve_ivp(
        lambda t, z: np.ravel(free(z)), (0, 100), [2, 0], "DOP853", rtol=1e-11, atol=1e-12,
        events=upwards,
    )  # fmt: skip
    # period at μ = 1 by high-precision integration
    assert np.diff(done.t_events[0])[-1] == pytest.approx(6.66328685932, abs=1e-8)


def test_relaxation_oscillator_folds():
    for x, y in [(1, -2 / 3), (-1, 2 / 3)]:
        rates, eigenvalues = at(systems.van_der_pol_relaxation(), "S1", [x], y=y)
        assert abs(rates[0]) < 1e-15
        assert eigenvalues[0] == 0


def test_fitzhugh_nagumo_hopf():
    v = -math.sqrt(1 - 0.08 * 0.8)
    current = (v + 0.7) / 0.8 - v + v**3 / 3
    assert current == pytest.approx(0.3312, abs=1e-4)
    rates, eigenvalues = at(systems.fitzhugh_nagumo(), "S1", [v, (v + 0.7) / 0.8], I=current)
    assert np.abs(rates).max() < 1e-15
    assert np.abs(eigenvalues.real).max() < 1e-15
    assert np.abs(eigenvalues.imag).min() > 0.2


def test_hindmarsh_rose_folds():
    for x in (0.0, -4 / 3):
        y = 1 - 5 * x**2
        z = y - x**3 + 3 * x**2 + 2
        rates, eigenvalues = at(systems.hindmarsh_rose(), "S1", [x, y], z=z)
        assert np.abs(rates).max() < 1e-14
        assert np.abs(eigenvalues).min() < 1e-14


def test_stick_slip_equilibrium():
    model = systems.stick_slip()
    region = next(n for n, r in model.regions.items() if r.signs["v - v_b"] < 0)
    rates, eigenvalues = at(model, region, [0.625, 0.0])
    assert np.abs(rates).max() < 1e-15
    assert eigenvalues.sum().real == pytest.approx(3 / 1.6**2)
    assert dict(model.continuous) == {"v - v_b": False}


def test_bilinear_oscillator_grazes():
    f, omega, zeta = 0.36035538014576, 0.8, 0.01
    model = systems.bilinear_oscillator(f=f, omega=omega, zeta=zeta)
    away = next(n for n, r in model.regions.items() if r.signs["x - 1"] < 0)
    _, eigenvalues = at(model, away, [0, 0], w=0)
    response = f / abs(np.prod(eigenvalues - 1j * omega))
    assert response == pytest.approx(1.0, rel=1e-12)


def test_gear_pair_loses_contact():
    # contact is lost first where Fa Ω² = Fm √((1 − Ω²)² + 4 ζ² Ω²)
    for omega in (0.8206310877, 1.4070884660):
        model = systems.gear_pair(Omega=omega)
        _, eigenvalues = at(model, "S1", [1.1, 0], w=0.1)
        swing = 0.05 * omega**2 / abs(np.prod(eigenvalues - 1j * omega))
        assert swing == pytest.approx(0.1, rel=1e-8)
