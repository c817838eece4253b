"""Implicit steps through settled phases, against closed forms and the series alone."""

from fractions import Fraction
from math import factorial

import mpmath
import numpy as np
import pytest
import sympy as sp
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from fastslow.model.model import Model
from fastslow.simulation.one import simulate
from fastslow.simulation.settings import Integration
from fastslow.simulation.stepper.implicit import DEGREE, P, Q, join, weights
from fastslow.simulation.stepper.matrices import (
    contracts,
    eigenvalues_of,
    factorise_in_place,
    solve_in_place,
    spectrum_for,
)
from tests.samples import examples

pytestmark = pytest.mark.slow

x, y, z, v, t, w = sp.symbols("x y z v t w")
a, b, c, k, omega = sp.symbols("a b c k omega")


def _solve(matrix, right):
    n = right.shape[0]
    solution = np.empty(n)
    regular = factorise_in_place(matrix, n)
    if regular:
        solve_in_place(matrix, right, solution, n)
    return regular, solution


@pytest.fixture(scope="module")
def relaxing():
    """A damped linear oscillator that a slow force drives; forced response in closed form."""
    return Model(
        {x: v, v: w - b * v - k * x},
        forcing={w: a + c * sp.sin(omega * t)},
        parameters={a: 1, b: 1, c: 0.5, k: 40, omega: 0.01},
    )


def forced(model, times):
    """The motion of `relaxing` that nothing transient is part of, shape (2, N)."""
    A, B, C, K, W = (model.parameters[n] for n in ("a", "b", "c", "k", "omega"))
    response = C * np.exp(1j * W * times) / (K - W**2 + 1j * B * W)
    return np.array([A / K + response.imag, (1j * W * response).imag])


def test_the_weights_are_those_of_pade():
    """Both sides as polynomials in z: N(z) - D(z) exp(z) begins at z**(P + Q + 1)."""
    left, right = weights(P, Q), weights(Q, P)
    numerator = [Fraction(c).limit_denominator(10**6) / factorial(j) for j, c in enumerate(left)]
    denominator = [
        (-1) ** j * Fraction(c).limit_denominator(10**6) / factorial(j) for j, c in enumerate(right)
    ]
    for power in range(P + Q + 2):
        product = sum(d / factorial(power - j) for j, d in enumerate(denominator) if j <= power) - (
            numerator[power] if power <= P else 0
        )
        assert (product == 0) == (power <= P + Q)


@given(st.lists(st.floats(-2, 2), min_size=DEGREE + 1, max_size=DEGREE + 1), st.floats(0.1, 50))
@settings(max_examples=50, deadline=None)
def test_a_polynomial_is_joined_from_its_ends(coefficients, h):
    whole = np.polynomial.Polynomial(np.array(coefficients) / h ** np.arange(DEGREE + 1))
    ends = []
    for at in (0.0, h):
        values = [whole.deriv(j)(at) / factorial(j) for j in range(Q + 1)]
        ends.append(np.array(values))
    poly = np.empty(DEGREE + 1)
    join(*ends, 0, h, poly, np.empty(DEGREE + 1))
    s = np.linspace(0, h, 11)
    assert np.abs(np.polynomial.Polynomial(poly)(s) - whole(s)).max() < 1e-11


@given(
    st.integers(1, 5).flatmap(lambda n: st.lists(st.floats(-3, 3), min_size=n * n, max_size=n * n)),
    st.floats(0, 2),
)
@settings(max_examples=examples(200), deadline=None)
def test_contraction_is_that_of_the_eigenvalues(entries, rate):
    n = int(len(entries) ** 0.5)
    matrix = np.array(entries).reshape(n, n)
    largest = np.linalg.eigvals(matrix).real.max()
    assume(abs(largest + rate) > 1e-6)
    padded = np.zeros((n, n + 1))
    padded[:, :n] = matrix
    assert contracts(padded, n, rate, spectrum_for(n)) == (largest < -rate)


@given(st.integers(1, 6), st.integers(0, 2**32 - 1))
@settings(max_examples=examples(50), deadline=None)
def test_systems_are_solved(n, seed):
    generator = np.random.default_rng(seed)
    matrix, right = generator.normal(size=(n, n)), generator.normal(size=n)
    padded = np.hstack([matrix, np.zeros((n, 1))])
    regular, solution = _solve(padded, right)
    assert regular
    assert np.abs(matrix @ solution - right).max() < 1e-11 * max(1, np.abs(solution).max())
    assert not _solve(np.zeros((n, n + 1)), right)[0]


@pytest.mark.parametrize("tol", [1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("stiffness", [40, 4e4, 4e8])
def test_a_settled_oscillator_is_its_forced_response(relaxing, tol, stiffness):
    """Within 10 tol at every time, in few steps."""
    model = relaxing.with_parameters(k=stiffness, b=max(1, 0.2 * stiffness**0.5))
    start = forced(model, np.array([0.0]))[:, 0]
    run = simulate(model, start, t=(0, 1000), integration=Integration(rtol=tol))
    # the series alone would take a step of about 9 / frequency
    assert len(run.steps) < max(1000, 1000 * stiffness**0.5 / 9 / 50)
    times = np.linspace(0, 1000, 4001)
    assert np.abs(run(times) - forced(model, times)).max() < 10 * tol


def test_steps_are_saved_and_nothing_else_changes(gear):
    explicit = simulate(gear, [0, 0], periods=3, integration=Integration(implicit=False))
    mixed = simulate(gear, [0, 0], periods=3)
    assert 2 * len(mixed.steps) < len(explicit.steps)
    times = np.linspace(0, mixed.span[1], 20_001)
    assert np.abs(mixed(times) - explicit(times)).max() < 1e-8
    for one, other in zip(mixed.crossings, explicit.crossings, strict=True):
        # nearly tangential exits have |v| of 1e-4: times are as good as tol / |v|
        assert abs(one.time - other.time) < 2e-9 / abs(one.state[1])
        assert (one.interface, one.to_region) == (other.interface, other.to_region)


def test_crossings_end_steps_of_the_series(gear):
    """No crossing is located on the polynomial of an implicit step."""
    run = simulate(gear, [0, 0], periods=3)
    at = np.searchsorted(run.steps[:, 0], [c.time for c in run.crossings], side="right") - 1
    for row in at:
        before = run.series[row - 1]
        assert np.abs(before[:2, DEGREE + 1 :]).max() > 0


def test_a_focus_that_turns_unstable_is_not_damped():
    """Slow passage through a Hopf point: |z|² = exp(∫ 2 p dt), entry and exit alike."""
    p = sp.Symbol("p")
    model = Model(
        {x: p * x - 8 * y, y: 8 * x + p * y}, forcing={p: k * t}, parameters={k: sp.Rational(1, 50)}
    )
    # the integral of p from -30 to 0 is 9: the amplitude falls by exp(-9), far above tol
    run = simulate(model, [1e-3, 0], t=(-30, 32), integration=Integration(rtol=1e-13))
    radius = np.hypot(*run(np.array([0.0, 30.0, 32.0])))
    assert radius == pytest.approx(1e-3 * np.exp([-9, 0, 0.01 * (32**2 - 30**2)]), rel=1e-6)


def test_three_fast_states_and_a_slow_one():
    """x' = -500 (x - y), y' = -30 (y - z), z' = -80 (z - s), s' = -s / 100."""
    s = sp.Symbol("s")
    rates = {x: -500 * (x - y), y: -30 * (y - z), z: -80 * (z - s)}
    model = Model(rates, slow={s: -s / 100})
    run = simulate(model, [1, 1, 1, 1], t=(0, 300), integration=Integration(rtol=1e-10))
    assert len(run.steps) < 600
    # on the slow manifold each one is the next times a ratio
    times = np.linspace(1, 300, 500)
    slow = np.exp(-times / 100)
    ratios = np.cumprod([1 / (1 - 0.01 / rate) for rate in (80, 30, 500)])
    exact = np.array([ratios[2] * slow, ratios[1] * slow, ratios[0] * slow, slow])
    assert np.abs(run(times) - exact).max() < 1e-9


def test_equilibrium_is_one_long_step():
    model = Model({x: -1000 * x}, parameters={})
    run = simulate(model, [0], t=(0, 1e9))
    assert run.outcome.success
    assert len(run.steps) < 60
    assert run([1e9])[0] == 0


def test_an_unstable_equilibrium_is_left():
    """x' = x from 1e-12: exp(t) until it is 1, where an implicit method would stay at 0."""
    model = Model({x: x, y: -800 * y})
    run = simulate(model, [1e-12, 0.5], t=(0, 12 * np.log(10)), integration=Integration(rtol=1e-14))
    assert run([run.span[1]])[0] == pytest.approx(1, rel=1e-8)


@pytest.mark.parametrize("stiffness", [1e2, 1e4, 1e6, 1e8])
def test_a_stiff_linear_system_beside_a_slow_one(stiffness):
    """x' = −p (x − v), v' = −v: v does not decay within a step of the series, but is followed."""
    p = sp.Symbol("p")
    model = Model({x: -p * (x - v), v: -v}, parameters={p: stiffness})
    run = simulate(model, [1, 1], t=(0, 10))
    assert run.outcome
    assert len(run.steps) < 200
    assert "implicit steps" in run.method
    times = np.linspace(0, 10, 1001)
    ratio = stiffness / (stiffness - 1)
    slow, fast = np.exp(-times), np.exp(-stiffness * times)
    exact = np.array([ratio * slow + (1 - ratio) * fast, slow])
    assert np.abs(run(times) - exact).max() < 2e-9


def test_a_stiff_van_der_pol_oscillator():
    """mu = 1e4, whose slow motion expands: two jumps, at the times of a tighter run."""
    model = Model({x: v, v: k * (1 - x**2) * v - x}, parameters={k: 10_000})
    run = simulate(model, [2, 0], t=(0, 9000), integration=Integration(rtol=1e-7))
    finer = simulate(model, [2, 0], t=(0, 9000), integration=Integration(rtol=1e-9))
    assert run.outcome
    assert finer.outcome
    (jump,), (exact,) = (r.section("x", level=0.0, direction=-1).t for r in (run, finer))
    # (3/2 − ln 2) mu from the first fold to the other one, and half of it more from x = 2
    assert exact == pytest.approx(8070, rel=2e-3)
    assert jump == pytest.approx(exact, rel=1e-6)


@pytest.mark.parametrize("n", [2, 3, 5])
def test_eigenvalues_of_graded_matrices_are_those_of_mpmath(n):
    """Real eigenvalues over ten decades, where the smaller root of a quadratic would cancel."""
    random = np.random.default_rng(n)
    sizes = -np.logspace(0, 10, n)
    for _ in range(20):
        matrix = np.diag(sizes) + 0.1 * random.normal(size=(n, n))
        space = spectrum_for(n)
        assert eigenvalues_of(matrix, n, space)
        found = np.sort(space.values[:n].real)
        with mpmath.workdps(40):
            values, _ = mpmath.eig(mpmath.matrix(matrix.tolist()))
            exact = np.sort([float(value.real) for value in values])
        assert not space.values.imag.any()
        np.testing.assert_allclose(found[1:], exact[1:], atol=1e-5)
        np.testing.assert_allclose(found[0], exact[0], rtol=1e-14)
