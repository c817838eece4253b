"""Hopf and branch points of models with many states and rates over many decades.

The truth is known by construction: linear parts are similar to block-diagonal
ones whose eigenvalues cross the imaginary axis at chosen parameter values.
"""

import numpy as np
import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.optimize import brentq

import fastslow as fs
from fastslow.diagrams.eigenvalue_pairs import pair_sums
from fastslow.diagrams.field import FrozenField
from fastslow.diagrams.segments import BranchSegment, Window
from fastslow.diagrams.trace.detection import special_points
from fastslow.results.branch.windows import state_window
from fastslow.results.points import stability_of
from tests.campaigns.detection import campaign
from tests.diagrams.models import LENGTH, brusselator, chafee_infante, crossing_model

pytestmark = pytest.mark.slow

p = sp.Symbol("p")


def line(model, over, name="p"):
    """The branch through the first start alone."""
    settings = fs.Continuation(max_branches=1)
    return fs.continue_equilibria(model, name, over, continuation=settings).branches[0]


def trivial_line(model, low, high, state=0.0, name="p", rows=101):
    """Special points of a branch whose state is constant: its rows need no tracing."""
    field = FrozenField(model.with_free(name), name)
    u, tangents = np.zeros((rows, field.n + 1)), np.zeros((rows, field.n + 1))
    u[:, :-1] = state
    u[:, -1] = np.linspace(low, high, rows)
    tangents[:, -1] = high - low
    scale = np.append(np.ones(field.n), high - low)
    window = Window(low, high, scale, state_window(field.model.states))
    found, segment, values = special_points(field, BranchSegment(0, u, tangents), window, ())
    return found, segment, values


@pytest.mark.sample(1)
@pytest.mark.parametrize("size", [8, 20, 5, 13, 60])
def test_points_of_random_models_with_rates_over_six_decades(size):
    """Every crossing, no other, to ten digits; one seed for each size."""
    model, hopf, zero = crossing_model(size, seed=size)
    found, _, _ = trivial_line(model, -1.0, 1.03)
    places = {
        code: [d.located.u[-1] for d in found if d.kind.code == code] for code in ("HB", "BP")
    }
    assert places["HB"] == pytest.approx(hopf, abs=1e-10)
    assert places["BP"] == pytest.approx(zero, abs=1e-10)
    assert {d.kind.code for d in found} <= {"HB", "BP", "NSD"}
    assert all(d.located.converged for d in found)


def test_a_sample_of_the_campaign_of_random_block_systems():
    """Among them a branch point on a curve along which one rate has no slope, and a Hopf
    point between two neutral saddles within one step."""
    report = campaign(3, seed=1, largest=12)
    assert not report.failures, str(report)
    assert min(report.expected.values()) >= 3
    assert report.error < 1e-12


@pytest.mark.parametrize("rates", [(1, 2, 1000), (1, 1e5), (1, 2, 3, 100), (1, 2, 3, 4, 5, 10, 20)])
def test_a_hopf_point_beside_fast_passive_states(rates):
    x, y, *passive = sp.symbols(f"x y z1:{len(rates) + 1}")
    growth = p - x**2 - y**2
    model = fs.Model(
        {x: growth * x - y, y: x + growth * y}
        | {z: -rate * z + x**2 for z, rate in zip(passive, rates, strict=True)},
        parameters={p: 0},
    )
    (hopf,) = fs.continue_equilibria(model, "p", (-1, 0.7)).special("HB")
    assert hopf["p"] == pytest.approx(0, abs=1e-14)
    assert hopf.lyapunov == pytest.approx(-2, rel=1e-12)
    assert hopf.frequency == pytest.approx(1, rel=1e-12)


def neuron():
    """Hodgkin and Huxley's axon with a slow calcium, a fast sensor and outer potassium.

    Time constants: 500 ms (calcium), 0.05 ms (its sensor, which opens a further potassium
    current) and 5 s (potassium outside, which shifts the reversal voltage).

    Returns
    -------
    rates : dict
    rest : dict
        Every state at rest as a formula in the voltage.
    """
    v, m, h, n, calcium, sensor, outer, current = sp.symbols("v m h n Ca s K I")
    exp, half = sp.exp, sp.Rational(1, 2)
    opening = {
        m: (v + 40) / 10 / (1 - exp(-(v + 40) / 10)),
        h: exp(-(v + 65) / 20) * 7 / 100,
        n: (v + 55) / 100 / (1 - exp(-(v + 55) / 10)),
    }
    closing = {
        m: 4 * exp(-(v + 65) / 18),
        h: 1 / (1 + exp(-(v + 35) / 10)),
        n: exp(-(v + 65) / 80) / 8,
    }
    inflow = 1 / (1 + exp(-(v + 20) / 5))
    ionic = (
        120 * m**3 * h * (v - 50)
        + 36 * n**4 * (v + 77 - 2 * (outer - 4))
        + sp.Rational(3, 10) * (v + 54)
        + half * sensor * (v + 77)
    )
    rates = {v: current - ionic}
    rates |= {gate: opening[gate] * (1 - gate) - closing[gate] * gate for gate in opening}
    rates[calcium] = (inflow - calcium) / 500
    rates[sensor] = 20 * (calcium / (1 + calcium) - sensor)
    rates[outer] = (4 + n**4 - outer) / 5000
    rest = {gate: opening[gate] / (opening[gate] + closing[gate]) for gate in opening}
    rest |= {calcium: inflow, sensor: inflow / (1 + inflow), outer: 4 + rest[n] ** 4}
    return rates, rest


@pytest.mark.sample(0)
def test_both_hopf_points_of_a_neuron_with_rates_over_five_decades():
    """Against the eigenvalues along the branch in closed form, by NumPy and brentq."""
    rates, rest = neuron()
    v, current = sp.symbols("v I")
    matrix = sp.Matrix(list(rates.values())).jacobian(list(rates)).subs(rest)
    jacobian = sp.lambdify(v, matrix)
    needed = sp.lambdify(v, (current - rates[v]).subs(rest))

    def growth(voltage):
        values = np.linalg.eigvals(np.array(jacobian(voltage), dtype=float))
        return values[np.abs(values.imag) > 0.1].real.max()

    voltages = [brentq(growth, *ends, xtol=1e-13) for ends in ((-62, -58), (-45, -41))]
    diagram = fs.continue_equilibria(fs.Model(rates, parameters={current: 0}), "I", (0, 250))
    (branch,) = diagram
    first, second = branch.special("HB")
    assert [first["I"], second["I"]] == pytest.approx([needed(x) for x in voltages], rel=1e-10)
    assert [first["v"], second["v"]] == pytest.approx(voltages, rel=1e-10)
    assert (first.criticality, second.criticality) == ("subcritical", "supercritical")
    # the fastest and the slowest rate are 1e5 apart there
    size = np.abs(first.eigenvalues)
    assert size.max() / size.min() > 9e4
    assert diagram.unexplained == ()


@pytest.mark.sample(1)
@pytest.mark.parametrize("cells", [15, 5])
def test_hopf_points_of_the_discretized_brusselator(cells):
    model, hopf = brusselator(cells)
    branch = line(model, (0.2, 2), LENGTH)
    expected = [value for value in hopf if 0.2 < value < 2]
    assert [h[LENGTH] for h in branch.special("HB")] == pytest.approx(expected, rel=1e-10)
    assert branch.unexplained == ()


def test_hopf_points_of_the_brusselator_with_sixty_states():
    model, hopf = brusselator(30)
    found, _, _ = trivial_line(model, 0.2, 2, [2.0] * 30 + [5.45 / 2] * 30, LENGTH)
    expected = [value for value in hopf if 0.2 < value < 2]
    places = [d.located.u[-1] for d in found if d.kind.code == "HB"]
    assert places == pytest.approx(expected, rel=1e-10)


def test_branch_points_of_the_discretized_chafee_infante_equation():
    """u' = u_xx + p (u − u³), 30 interior points: the trivial branch crosses at the modes."""
    model, modes = chafee_infante(30)
    found, _, _ = trivial_line(model, 1, 60)
    expected = [value for value in modes if 1 < value < 60]
    assert len(expected) == 2
    places = [d.located.u[-1] for d in found if d.kind.code == "BP"]
    assert places == pytest.approx(expected, rel=1e-10)
    # all eigenvalues are real: no Hopf point
    assert {d.kind.code for d in found} == {"BP", "NSD"}


def test_a_conservative_oscillator_hides_no_hopf_point():
    """The sum of the oscillator's own pair is zero at every row."""
    x, y, q, v, u, w = sp.symbols("x y q v u w")
    growth = p - x**2 - y**2
    rates = {x: growth * x - y, y: x + growth * y, q: v + x, v: -4 * sp.sin(q) - y}
    slaved = {u: -3 * u + q + x, w: -100 * w + v + y}
    (hopf,), _, values = trivial_line(fs.Model(rates | slaved, parameters={p: 0}), -1, 0.7)
    assert (np.abs(values.real) < 1e-13).sum(axis=1).min() == 2
    assert hopf.kind.code == "HB"
    assert hopf.located.u[-1] == pytest.approx(0, abs=1e-13)


def product_sign(values):
    """Sign of the product of all pair sums, term by term."""
    n = len(values)
    sums = [values[i] + values[j] for i in range(n) for j in range(i + 1, n)]
    return np.sign(np.prod([s / abs(s) for s in sums]).real)


@given(arrays(float, (6, 6), elements=st.floats(-10, 10, width=16)), st.integers(-150, 150))
def test_the_sign_is_that_of_the_product_in_any_unit_of_time(matrix, exponent):
    values = np.linalg.eigvals(matrix)
    first, second = np.triu_indices(6, 1)
    sums, size = np.abs(values[first] + values[second]), np.abs(values).max()
    if sums.min() <= 1e-9 * size:
        return
    test = float(pair_sums(values))
    assert np.sign(test) == product_sign(values)
    assert 0 < abs(test) <= 1
    assert float(pair_sums(values * 2.0**exponent)) == pytest.approx(test, rel=1e-12)


@pytest.mark.parametrize(("sign", "code"), [(-1, "HB"), (1, "NSD")])
@pytest.mark.parametrize("decades", [2, 3, 4])
def test_points_beside_a_fold_of_a_fast_state(sign, code, decades):
    """Newton's method also converges to a single eigenvector, which is no pair."""
    x, y = sp.symbols("x y")
    fast, slow = 10.0**decades, 10.0**-decades
    rates = {x: fast * (p + x - x**3) + sign * y, y: slow * (x - y)}
    found = line(fs.Model(rates, parameters={p: 0}), (-3, 3))
    # the trace fast (1 − 3x²) − slow and the determinant −slow (fast (1 − 3x²) + sign)
    at = {code: np.sqrt((1 - slow / fast) / 3), "LP": np.sqrt((1 + sign / fast) / 3)}
    assert sorted(point.code for point in found.special) == sorted([*at, *at, "EP", "EP"])
    for kind, value in at.items():
        states = sorted(point["x"] for point in found.special(kind))
        assert states == pytest.approx([-value, value], abs=1e-12)
    for point in found.special(code):
        assert abs(point.eigenvalues.sum()) < 1e-8 * abs(point.eigenvalues).max()


def test_pair_sums_of_two_hundred_eigenvalues_do_not_underflow():
    rng = np.random.default_rng(0)
    values = -(10.0 ** rng.uniform(-6, 6, 200)).astype(complex)
    values[:2] = 1e-3 + 1j, 1e-3 - 1j
    assert float(pair_sums(values)) == pytest.approx(
        1e-3 / abs(values[0]) * (-1) ** (198 * 197 // 2), rel=1e-12
    )
    assert str(stability_of(values)) == "unstable"


def test_pair_sums_are_smooth_at_zero_where_nothing_is_left_out():
    """Through a Hopf point and a neutral saddle, beside an eigenvalue of −1e12."""
    real = np.array([-1e-3, -1e-9, -1e-15, 0.0, 1e-15, 1e-9, 1e-3])
    zero, fast = np.zeros(7), np.full(7, -1e12)
    hopf = np.stack([real + 2j, real - 2j, fast + 0j], axis=-1)
    saddle = np.stack([1.0 + 2 * real, zero - 1.0, fast], axis=-1)
    passive = pair_sums(hopf, rounding=0.0)
    np.testing.assert_allclose(passive, real / np.hypot(real, 2.0), rtol=1e-12)
    # of the two further sums both are negative
    np.testing.assert_allclose(pair_sums(saddle, rounding=0.0), real / (1 + real), atol=1e-15)
    # by default the sums that are lost in rounding are left out
    assert np.all(pair_sums(hopf) == 0)


def test_pair_sums_of_what_is_not_finite_or_alone():
    assert pair_sums(np.array([[np.nan, 1.0], [-1.0, -2.0]])).tolist() == [0.0, -1.0]
    assert float(pair_sums(np.array([2.0]))) == 0.0
    assert float(pair_sums(np.array([1j, -1j]))) == 0.0
