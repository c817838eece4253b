"""Steps of Radau through stiff phases, against closed forms, mpmath and SciPy."""

import math

import numpy as np
import pytest
import sympy as sp
from numpy.polynomial import polynomial
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from fastslow.model.model import Model
from fastslow.simulation.many import simulate_many
from fastslow.simulation.one import simulate
from fastslow.simulation.settings import Integration
from fastslow.simulation.stepper import radau

pytestmark = pytest.mark.slow

x, y, z, v, w, t = sp.symbols("x y z v w t")
p, mu = sp.symbols("p mu")

LINEAR = Model({x: -p * (x - v), v: -v}, parameters={p: 1e6})
VAN_DER_POL = Model({x: v, v: mu * (1 - x**2) * v - x}, parameters={mu: 10_000})
ROBERTSON = Model(
    {
        x: -x / 25 + 10**4 * y * z,
        y: x / 25 - 10**4 * y * z - 3 * 10**7 * y**2,
        z: 3 * 10**7 * y**2,
    }
)


def test_the_points_integrate_polynomials_to_their_order():
    """Weights b are the last row of the method: sum b c**(k-1) = 1/k up to k = 2 s - 1."""
    powers = np.arange(1, radau.STAGES + 1)
    derivatives = (powers * radau.C[:, None] ** (powers - 1)) @ radau.POWERS
    weights = np.linalg.inv(derivatives)[-1]
    for k in range(1, 2 * radau.STAGES):
        assert weights @ radau.C ** (k - 1) == pytest.approx(1 / k, abs=1e-14)
    assert abs(weights @ radau.C ** (2 * radau.STAGES - 1) - 0.1) > 1e-6


def test_the_modes_put_together_are_the_method():
    powers = np.arange(1, radau.STAGES + 1)
    derivatives = (powers * radau.C[:, None] ** (powers - 1)) @ radau.POWERS
    together = (radau.OUT_OF * radau.VALUES) @ radau.INTO
    assert np.abs(together.real - derivatives).max() < 1e-11 * np.abs(derivatives).max()
    assert radau.VALUES[0].imag == 0
    data = np.array([0.3, -1.0, 2.0, 0.5, 1.0])
    coefficients = np.concatenate([[0.0], radau.POWERS @ data])
    assert polynomial.polyval(radau.C, coefficients) == pytest.approx(data, abs=1e-11)


@pytest.mark.parametrize("stiffness", [1e4, 1e6, 1e8, 1e10, 1e12])
@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-12])
def test_a_stiff_linear_system_of_any_stiffness(stiffness, rtol):
    model = LINEAR.with_parameters(p=stiffness)
    run = simulate(model, [2, 1], t=(0, 5), integration=Integration(rtol=rtol))
    assert run.outcome
    assert len(run.steps) < 250
    times = np.linspace(0.01, 5, 400)
    ratio = stiffness / (stiffness - 1)
    exact = np.array([ratio * np.exp(-times), np.exp(-times)])
    # throughout the steps, and relative to what the state is then
    assert np.abs(run(times) / exact - 1).max() < 10 * rtol


@pytest.mark.parametrize(("rtol", "digits"), [(1e-6, 1e-5), (1e-9, 3e-7), (1e-12, 3e-7)])
def test_the_kinetics_of_robertson(rtol, digits):
    """Test set for initial value problem solvers (Mazzia and Magherini 2008), t = 1e11.

    Rounding of x + y + z = 1 bounds what is known of x = 2e-8 there: 1e-15 / x.
    """
    exact = [2.083340149701255e-08, 8.333360770334713e-14, 0.9999999791665050]
    run = simulate(ROBERTSON, [1, 0, 0], t=(0, 1e11), integration=Integration(rtol=rtol))
    assert run.outcome
    assert len(run.steps) < 2000
    assert run.end[1:] == pytest.approx(exact, rel=digits)


@pytest.mark.sample(1)
@pytest.mark.parametrize("rtol", [1e-6, 1e-9])
def test_two_periods_of_van_der_pol(rtol):
    """mu = 1e4 against LSODA of SciPy: x on the second slow part, and the time of the jump."""
    end = 32_000.0
    run = simulate(VAN_DER_POL, [2, 0], t=(0, end), integration=Integration(rtol=rtol))
    assert run.outcome
    assert len(run.steps) < 3000
    times = np.array([1000.0, 7000.0, 9000.0, 15_000.0, 20_000.0, 30_000.0])
    reference = solve_ivp(
        lambda s, u: [u[1], 1e4 * (1 - u[0] ** 2) * u[1] - u[0]],
        (0, end),
        [2, 0],
        "LSODA",
        times,
        jac=lambda s, u: [[0, 1], [-2e4 * u[0] * u[1] - 1, 1e4 * (1 - u[0] ** 2)]],
        rtol=1e-10,
        atol=[1e-12, 1e-16],
    )
    assert run(times)[0] == pytest.approx(reference.y[0], rel=max(100 * rtol, 1e-6))


@pytest.mark.sample(1)
@pytest.mark.parametrize("rtol", [1e-6, 1e-9])
def test_a_chain_of_thirty_states_over_six_decades(rtol):
    """Diffusion between 30 cells, rates 1 to 1e6 in random order, by the matrix exponential."""
    n = 30
    rates = np.random.default_rng(0).permutation(np.logspace(0, 6, n + 1))
    matrix = np.diag(-rates[:-1] - rates[1:]) + np.diag(rates[1:-1], 1) + np.diag(rates[1:-1], -1)
    cells = sp.symbols(f"u1:{n + 1}")
    model = Model(
        {
            cells[i]: sum(sp.Float(matrix[i, j]) * cells[j] for j in np.flatnonzero(matrix[i]))
            for i in range(n)
        }
    )
    run = simulate(model, np.ones(n), t=(0, 10), integration=Integration(rtol=rtol))
    assert run.outcome
    assert len(run.steps) < 2000
    for time in (0.1, 1.0, 10.0):
        assert run(time) == pytest.approx(expm(matrix * time) @ np.ones(n), rel=100 * rtol)


def test_a_crossing_in_a_stiff_phase_is_exact():
    """x follows v = exp(−t) and switches its target where v = 1/2, at t = ln 2."""
    target = sp.Piecewise((v, v > sp.Rational(1, 2)), (2 * v, True))
    model = Model({x: -p * (x - target), v: -v}, parameters={p: 1e10})
    run = simulate(model, [1, 1], t=(0, 3))
    (crossing,) = run.crossings
    assert crossing.time == pytest.approx(math.log(2), abs=1e-9)
    assert crossing.state[1] == 0.5
    assert "Radau" in run.method
    times = np.array([0.3, 0.6, 0.8, 2.0])
    assert run(times)[0] == pytest.approx(np.where(times < 0.69, 1, 2) * np.exp(-times), rel=1e-8)


def test_a_slow_passage_beside_a_stiff_state_keeps_its_memory():
    """z' = w z about z = 1, w = −2/5 + t/50: enters at −0.4, leaves where the integral is 0."""
    stiff = Model(
        {x: -p * (x - w), z: w * (z - 1)},
        forcing={w: -sp.Rational(2, 5) + t / 50},
        parameters={p: 1e8},
    )
    run = simulate(stiff, [-0.4, 1 + 1e-9], t=(0, 60), integration=Integration(rtol=1e-7))
    # the deviation, never above the tolerance on its way, is 1e-9 again at t = 40
    exact = 1e-9 * np.exp(-0.4 * 60 + 60**2 / 100)
    assert run.end[2] - 1 == pytest.approx(exact, rel=0.02)
    assert run.outcome


def test_many_and_a_single_run_without_its_series():
    one = simulate(LINEAR.with_parameters(p=1e9), [2, 1], t=(0, 5), dense=False)
    implicit = Integration(implicit=True)
    many = simulate_many(LINEAR, [2, 1], parameters={p: [1e7, 1e9]}, t=(0, 5), integration=implicit)
    assert many.final[1] == pytest.approx(one.end[1:], rel=1e-8)
    assert many.n_steps.max() < 250
    alone = simulate_many(LINEAR, [2, 1], parameters={p: [1e9]}, t=(0, 5), integration=implicit)
    assert many.final[1].tolist() == alone.final[0].tolist()
