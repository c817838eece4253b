"""Cycles that slide along an interface, all the time or until the sliding set ends."""

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

import fastslow as fs

pytestmark = pytest.mark.slow

x, y, z = sp.symbols("x y z")
A, k, mu, t, w = sp.symbols("A k mu t w")


def relay(force=0, damping=mu - x**2, **values):
    """Oscillator on z = 0 with sliding where |x| < A, and where z' = x -+ A is its relay."""
    rates = {x: y, y: damping * y - x + z + force, z: x - A * sp.sign(z)}
    return fs.Model(rates, parameters={"A": 3, **values})


@pytest.fixture(scope="module")
def converter():
    """Boost converter with a washout filter under sliding-mode control."""
    u = sp.Piecewise((0, y - 2 + k * (x - z) > 0), (1, True))
    rates = {x: 1 - x / 20 - (1 - u) * y, y: (1 - u) * x - y / 2, z: 2 * (x - z)}
    model = fs.Model(rates, parameters={k: 1.9})
    diagram = fs.continue_equilibria(model, "k", over=(1, 4))
    (cycles,) = fs.continue_cycles(diagram)
    return diagram, cycles


def test_branch_from_the_hopf_point_of_a_sliding_field(converter):
    diagram, cycles = converter
    (hopf,) = (point for point in diagram.special if point.code == "HB")
    assert cycles.values[0] == pytest.approx(hopf["k"], abs=2e-4)
    assert cycles.outcomes[0].code == "Hopf point"
    # the critical multiplier, that along the orbit, and zero across the interface
    logs = cycles.log_multipliers
    assert np.isneginf(logs[:, 2]).all()
    assert (np.abs(cycles.multipliers - 1).min(axis=1) < 1e-6).all()
    assert (logs[:, 0] > 0).all()
    # the cycles end where they reach the two-fold x = k y on the interface
    assert cycles.outcomes[1].code == "two-fold"
    last = cycles.orbits[-1]
    samples = last.trajectory.sampled_columns
    assert np.abs(samples[0] - last.parameters["k"] * samples[1]).min() < 0.02


def test_cycles_of_the_equivalent_control(converter):
    """The planar motion with y = 2 - k (x - z) and the control for which this remains so."""
    _, cycles = converter

    def rates(_, s, value):
        one, other = s[:2]
        height = 2 - value * (one - other)
        # h' = y' + k (x' - z') = 0 for c = 1 - u
        washed = 2 * (one - other)
        c = (height / 2 - value * (1 - one / 20 - washed)) / (one - value * height)
        return [1 - one / 20 - c * height, washed]

    (orbit,) = cycles.at(k=2.0)
    start = orbit(orbit.t0)[[0, 2]]
    settings = {"rtol": 1e-12, "atol": 1e-13, "method": "DOP853", "args": (2.0,)}
    ends = [
        solve_ivp(rates, (0, orbit.period), start + shift, **settings).y[:, -1]
        for shift in ([0, 0], [1e-6, 0], [-1e-6, 0], [0, 1e-6], [0, -1e-6])
    ]
    np.testing.assert_allclose(ends[0], start, rtol=0, atol=2e-10)
    product = np.column_stack([ends[1] - ends[2], ends[3] - ends[4]]) / 2e-6
    found = np.sort(np.linalg.eigvals(product).real)
    np.testing.assert_allclose(np.sort(orbit.multipliers.real)[1:], found, atol=1e-5)


def test_adding_sliding_of_a_cycle_that_slides_all_the_time():
    """The van der Pol cycle leaves the sliding set where A is its amplitude."""
    orbit = fs.find_orbit(relay(mu=1), [2, 0, 0])
    assert orbit.outcome.notes == ()
    assert orbit.multipliers[2] == 0
    branch = fs.continue_orbits(orbit, "A", over=(1, 4))
    assert [outcome.code for outcome in branch.outcomes] == ["end of range"] * 2
    (point,) = branch.special("AS")
    assert point.type == "transition"
    assert point["A"] == pytest.approx(2.00861986087484313650940188, abs=1e-11)
    # beyond it the cycle slides and crosses; a run of regions and sliding by SciPy
    orbit = branch.orbits[0]
    (start,) = (c for c in orbit.trajectory.crossings if c.to_region == "S1")
    end, time = half_a_turn(start.state, orbit.parameters["A"])
    np.testing.assert_allclose(end, -start.state, rtol=0, atol=1e-9)
    assert 2 * time == pytest.approx(orbit.period, abs=1e-9)


def half_a_turn(start, level):
    """Motion with z > 0 until it returns, then sliding until x = -level, by SciPy."""

    def free(_, s):
        return [s[1], (1 - s[0] ** 2) * s[1] - s[0] + s[2], s[0] - level]

    def sliding(_, s):
        return [s[1], (1 - s[0] ** 2) * s[1] - s[0], 0.0]

    def returns(time, s):
        return s[2] if time > 0.1 else 1.0

    def leaves(_, s):
        return s[0] + level

    returns.terminal = leaves.terminal = True
    settings = {"rtol": 1e-12, "atol": 1e-13, "method": "DOP853"}
    first = solve_ivp(free, (0, 20), start, events=returns, **settings)
    state = np.append(first.y[:2, -1], 0.0)
    second = solve_ivp(sliding, (0, 20), state, events=leaves, **settings)
    return second.y[:, -1], first.t[-1] + second.t[-1]


def test_forced_orbit_that_slides_all_the_time():
    """With z = 0 it is the linear oscillator; sliding ends where its amplitude is A."""
    model = relay(force=sp.cos(w * t), damping=sp.Rational(-1, 5), w=2)
    branch = fs.continue_orbits(fs.find_orbit(model, [0, 0, 0]), "w", over=(0.5, 3))
    assert [outcome.code for outcome in branch.outcomes] == ["end of range"] * 2
    amplitude = 1 / np.hypot(1 - branch.values**2, 0.2 * branch.values)
    slides = amplitude < 3 - 1e-9
    assert slides.sum() > 100
    np.testing.assert_allclose(branch["max(x)"][slides], amplitude[slides], rtol=1e-12)
    # (1 - w²)² + w²/25 = 1/9
    edges = np.sqrt(np.roots([1, 1 / 25 - 2, 1 - 1 / 9]))
    found = [point["w"] for point in branch.special]
    assert [point.code for point in branch.special] == ["AS", "AS"]
    np.testing.assert_allclose(np.sort(found), np.sort(edges), rtol=0, atol=1e-12)


def test_begins_elsewhere_than_at_its_touch():
    """From the Hopf point the cycle begins at its largest x, where it leaves the sliding set."""
    diagram = fs.continue_equilibria(relay(mu=1), "mu", over=(-1, 3))
    (cycles,) = fs.continue_cycles(diagram)
    assert cycles.outcomes[1].code == "end of range"
    (point,) = cycles.special
    assert point.code == "AS"
    assert point.orbit["max(x)"] == pytest.approx(3, abs=1e-11)
