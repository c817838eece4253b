"""Entry and exit of a slow passage through a Hopf point."""

import math
import pickle
from itertools import pairwise

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import quad
from scipy.optimize import brentq

import fastslow as fs
from fastslow.passage.delays.buffer_points import LevelCurve
from fastslow.passage.delays.laws.hopf_delays import hopf_mode

pytestmark = pytest.mark.slow

RADIUS, EPS = 1e-3, 0.05


@pytest.fixture(scope="module")
def turned(turning):
    return fs.continue_equilibria(turning, "p", over=(-2, 2))


@pytest.fixture(scope="module")
def ramped(turning):
    """Entered at p = −1 with |z| = 0.001; the smallest amplitude is 4.5e-8."""
    ramp = turning.with_ramp("p", EPS, from_value=-1.0)
    return fs.simulate(
        ramp, [RADIUS, 0.0], t=(0, 2.6 / EPS), integration=fs.Integration(rtol=1e-16)
    )


def bernoulli(p):
    """|z|² at p in closed form: u = |z|⁻² obeys u' = −2 p u + 2."""
    growth = (p**2 - 1) / EPS
    tail, _ = quad(lambda s: math.exp((s**2 - 1) / EPS), -1, p, epsabs=0, epsrel=1e-12)
    return math.exp(growth) / (RADIUS**-2 + 2 * tail / EPS)


def test_the_exit_mirrors_the_entry(turned, ramped):
    """Measured, in closed form, and as predicted: p = 1 but for the cubic term."""
    law = fs.predict_delay(turned.special("HB")[0], EPS, diagram=turned, entry=-1)
    assert law.value == pytest.approx(1.0, abs=1e-12)
    assert law.decay == pytest.approx(1 / (2 * EPS), rel=1e-12)
    out = ramped.section("x**2 + y**2", level=RADIUS**2, direction=1)
    known = brentq(lambda p: bernoulli(p) - RADIUS**2, 0.5, 1.5, xtol=1e-14)
    assert out["p"][-1] == pytest.approx(known, abs=1e-9)
    assert known == pytest.approx(law.value, abs=1e-6)


def test_a_gain_of_amplitude(turned, ramped):
    """|z| ten times as large: p² = 1 + 2ε ln 10."""
    law = fs.predict_delay(turned.special("HB")[0], EPS, diagram=turned, entry=-1, gain=10)
    assert law.value == pytest.approx(math.sqrt(1 + 2 * EPS * math.log(10)), abs=1e-12)
    out = ramped.section("x**2 + y**2", level=1e2 * RADIUS**2, direction=1)
    assert out["p"][-1] == pytest.approx(law.value, abs=1e-5)


def test_rounding_decides(turned):
    law = fs.predict_delay(turned.special("HB")[0], 0.01, diagram=turned, entry=-1)
    assert law.decay == pytest.approx(50, rel=1e-12)
    assert "limited by rounding" in law.validity
    assert "exp(−50)" in law.validity


def test_growth_that_does_not_suffice(turned):
    law = fs.predict_delay(turned.special("HB")[0], 0.2, diagram=turned, entry=-2, gain=1.1)
    assert math.isnan(law.delay)
    assert law.validity.startswith("none: the branch ends")


def test_a_diagram_from_a_file_interpolates(turned):
    stored = pickle.loads(pickle.dumps(turned))
    law = fs.predict_delay(turned.special("HB")[0], EPS, diagram=stored, entry=-1)
    assert law.value == pytest.approx(1.0, abs=1e-12)
    assert "interpolated" in law.validity


def test_wrong_arguments(turned, cusp_fold):
    hopf = turned.special("HB")[0]
    with pytest.raises(fs.ArgumentError, match="before HB1 is not stable in this direction"):
        fs.predict_delay(hopf, -EPS, diagram=turned, entry=1)
    with pytest.raises(fs.ArgumentError, match=r"entry = 1; expected .* from -2 to 0"):
        fs.predict_delay(hopf, EPS, diagram=turned, entry=1)
    with pytest.raises(fs.ArgumentError, match="gain = 0; expected a positive number"):
        fs.predict_delay(hopf, EPS, diagram=turned, entry=-1, gain=0)
    with pytest.raises(fs.ArgumentError, match="diagram= and entry= go with a Hopf"):
        fs.predict_delay(cusp_fold, EPS, diagram=turned, entry=-1)
    other = fs.continue_equilibria(fs.systems.van_der_pol().frozen(), "w", over=(-2, 2))
    with pytest.raises(fs.ArgumentError, match="is not a point of this diagram"):
        fs.predict_delay(other.special("HB")[0], EPS, diagram=turned, entry=-1)
    with pytest.raises(fs.ArgumentError, match="give diagram= and entry="):
        fs.predict_delay(hopf, EPS)


EDGE = 0.05


@pytest.fixture(scope="module")
def neuron():
    fast = fs.systems.fitzhugh_nagumo().frozen()
    return fast, fs.continue_equilibria(fast, "I", over=(-0.5, 2))


def test_the_integral_on_fitzhugh_nagumo(neuron):
    """∫ Re λ dI from the closed form of the trace, while the pair is complex: Re λ = trace/2."""
    _, diagram = neuron
    hopf = diagram.special("HB")[0]
    law = fs.predict_delay(hopf, 0.001, diagram=diagram, entry=hopf["I"] - EDGE)

    def real_part(current):
        # v − v³/3 − (v + a)/b + I = 0
        roots = np.roots([-1 / 3, 0, 1 - 1 / 0.8, current - 0.7 / 0.8])
        (v,) = roots[np.abs(roots.imag) < 1e-12].real
        return 0.5 * (1 - v**2 - 0.08 * 0.8)

    decay, _ = quad(real_part, hopf["I"] - EDGE, hopf["I"], epsabs=1e-14)
    assert law.decay == pytest.approx(-decay / 0.001, rel=1e-9)
    left, _ = quad(real_part, hopf["I"] - EDGE, law.value, epsabs=1e-14)
    assert left == pytest.approx(0.0, abs=1e-11)


def part_at(fast, diagram, law):
    """Where the difference of two runs from both sides of the branch is as large as at the entry.

    For the linear motion r'' − T r' + Δ r = 0 beside the branch, T the trace, the
    amplitude that WKB conserves is √Ω |(r, (r' − T r/2)/Ω)|, Ω² = Δ − T²/4.
    """
    entry, rate = law.entry, law.rate
    (rest,) = diagram.at(I=entry)
    slopes = np.array([[1 - rest["v"] ** 2, -1], [0.08, -0.064]])
    start = rest.state - np.linalg.solve(slopes, np.linalg.solve(slopes, [1, 0])) * rate
    span = (0, (law.value - entry) / rate)
    times = np.linspace(*span, 20_001)
    ramp = fast.with_ramp("I", rate, from_value=entry)
    push = np.array([1e-6, 0])
    one, other = (
        fs.simulate(ramp, start + s * push, t=span, integration=fs.Integration(rtol=1e-16))(times)
        for s in (1, -1)
    )
    v, r = one - other
    bend = 1 - one[0] ** 2
    trace, slope = bend - 0.064, 0.08 * (v - 0.8 * r)
    turning = np.sqrt(0.08 - 0.064 * bend - trace**2 / 4)
    size = np.sqrt(turning) * np.hypot(r, (slope - trace * r / 2) / turning)
    back = np.flatnonzero((size >= size[0]) & (times > EDGE / rate))[0]
    return entry + rate * times[back]


def test_two_runs_of_fitzhugh_nagumo_part_at_the_exit(neuron):
    """What the law leaves out, the lag behind the branch, is of the order of the rate."""
    fast, diagram = neuron
    hopf = diagram.special("HB")[0]
    late = []
    for rate in (2e-4, 1e-4):
        law = fs.predict_delay(hopf, rate, diagram=diagram, entry=hopf["I"] - EDGE)
        assert 2 < law.decay < 30
        late.append(part_at(fast, diagram, law) - law.value)
    assert abs(late[0]) < 0.01
    assert late[1] / late[0] == pytest.approx(0.5, abs=0.05)


def neuron_at(current):
    """Half the trace and the discriminant (of λ) of FitzHugh and Nagumo's neuron."""
    roots = np.roots([-1 / 3, 0, 1 - 1 / 0.8, current - 0.7 / 0.8])
    (v,) = roots[np.abs(roots.imag) < 1e-12].real
    half = 0.5 * (1 - v**2 - 0.064)
    return half, half**2 + 0.064 * (1 - v**2) - 0.08


def growth_of_neuron(current):
    """Re λ in closed form, of a pair and of the slower of two real eigenvalues."""
    half, square = neuron_at(current)
    return half + math.sqrt(max(square, 0.0))


@pytest.mark.sample(1)
@pytest.mark.parametrize("largest", [0.005, 0.02, 0.3])
def test_an_entry_on_a_node_does_not_depend_on_the_rows_of_the_branch(neuron, largest):
    """The pair is real at the entry: a square root where it splits, and 25 to 365 rows."""
    settings = fs.Continuation(step=min(0.01, largest), max_step=largest)
    diagram = fs.continue_equilibria(neuron[0], "I", over=(-0.5, 2), continuation=settings)
    hopf = diagram.special("HB")[0]
    entry = hopf["I"] - 0.6
    law = fs.predict_delay(hopf, 0.1, diagram=diagram, entry=entry)
    grid = np.linspace(entry, law.value, 501)
    real = np.array([neuron_at(current)[1] > 0 for current in grid])
    assert real[0]
    splits = [
        brentq(lambda s: neuron_at(s)[1], grid[k], grid[k + 1], xtol=1e-15)
        for k in np.flatnonzero(np.diff(real))
    ]
    edges = [entry, *splits, law.value]
    parts = [quad(growth_of_neuron, a, b, epsabs=1e-12, limit=200)[0] for a, b in pairwise(edges)]
    assert sum(parts) == pytest.approx(0.0, abs=1e-9)


@pytest.fixture(scope="module")
def moving():
    """Shishkova's z' = (p + i ω)(z − p), ω = 1: λ = 0 at p = −i ω, at the level ω²/2."""
    x, y, p = sp.symbols("x y p")
    return fs.Model({x: p * (x - p) - y, y: x - p + p * y}, parameters={p: 0})


def test_the_buffer_point_bounds_the_delay(moving):
    """M. A. Shishkova, Doklady Akademii Nauk SSSR 209, 576-579, 1973: no exit beyond p = ω."""
    diagram = fs.continue_equilibria(moving, "p", over=(-3, 3))
    hopf = diagram.special("HB")[0]
    late = fs.predict_delay(hopf, 0.1, diagram=diagram, entry=-2)
    assert late.value == pytest.approx(1.0, abs=1e-5)
    assert late.buffer == late.value
    assert "limited by the buffer point" in late.validity
    early = fs.predict_delay(hopf, 0.1, diagram=diagram, entry=-0.9)
    assert early.value == pytest.approx(0.9, abs=1e-9)
    assert math.isnan(early.buffer)
    assert "is beyond" in early.validity


def test_runs_leave_at_the_buffer_point(moving):
    """From p = −2 and −2.5 they grow by the same factor from p = 1 on, not from 2 and 2.5."""
    grown = []
    for entry in (-2.0, -2.5):
        ramp = moving.with_ramp("p", 0.05, from_value=entry)
        run = fs.simulate(
            ramp, [entry, 0.0], t=(0, (1.9 - entry) / 0.05), integration=fs.Integration(rtol=1e-15)
        )
        late = np.array([1.4, 1.9])
        px, py = run((late - entry) / 0.05)
        grown.append(np.hypot(px - late, py))
    np.testing.assert_allclose(grown[0], grown[1], rtol=2e-3)
    # from p = 1 on exp((p² − 1)/2ε): 1.5e11 at 1.9, of the size √ε/ε of its forcing
    assert math.log(grown[0][1] / grown[0][0]) == pytest.approx((1.9**2 - 1.4**2) / 0.1, rel=0.02)
    assert 0.05 < grown[0][1] / math.exp((1.9**2 - 1) / 0.1) < 5


def test_no_buffer_point_is_told_where_none_is_known(turned):
    law = fs.predict_delay(turned.special("HB")[0], EPS, diagram=turned, entry=-1.5)
    assert "does not move" in law.validity
    assert law.value == pytest.approx(1.5, abs=1e-12)


def test_a_drift_that_changes_takes_the_error_away(turned):
    """An overlay integrates along its path; beside a point alone the rate is taken as constant."""
    hopf = turned.special("HB")[0]
    plain = fs.predict_delay(hopf, EPS, diagram=turned, entry=-1)
    law = fs.predict_delay(hopf, fs.Drift(EPS, change=1e-4), diagram=turned, entry=-1)
    assert law.value == plain.value
    assert plain.error < 1e-6
    assert math.isnan(law.error)
    assert "the change of the drift is neglected" in law.validity


def test_a_level_that_the_branch_does_not_reach_is_nowhere(turned):
    """∫ Re λ dp over −2 ≤ p ≤ 0 is 2: a decay by more has no entry."""
    mode = hopf_mode(turned, turned.special("HB")[0], 1)
    curves = LevelCurve(mode, lambda *_: np.zeros((2, 3)))
    enter, leave = curves.ends(0.5)
    assert (enter, leave) == pytest.approx((-1, 1), abs=1e-12)
    assert curves.focal(0.5)
    assert all(map(math.isnan, curves.ends(2.5)))
    assert not curves.focal(2.5)
    assert not curves.connects(2.5)
