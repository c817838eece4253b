"""Ends of branches of cycles at an infinite period."""

import re

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import fastslow as fs

pytestmark = pytest.mark.slow

x, y, p = sp.symbols("x y p")


def leaf():
    """Sandstede's model: at p = 0 a homoclinic orbit on x²(1 − x) = y².

    B. Sandstede, Journal of Dynamics and Differential Equations 9(2), 269-288, 1997; Kuznetsov
    2004, section 6.2.
    """
    right = (2 - p) * x - y - 3 * x**2 + sp.Rational(3, 2) * x * y
    return fs.Model({x: -x + 2 * y + x**2, y: right}, parameters={p: 0.1})


@pytest.fixture(scope="module")
def cycles():
    orbit = fs.find_orbit(leaf(), [0.8, 0.3])
    return fs.continue_orbits(orbit, "p", over=(-0.5, 0.2))


def test_homoclinic_orbit_in_closed_form(cycles):
    (point,) = cycles.special
    assert (point.code, point.label, point.converged) == ("HC", "HC1", True)
    assert abs(point["p"]) < 1e-14
    assert np.abs(point.saddle).max() < 1e-14
    # eigenvalues 1 and −3
    assert point.saddle_quantity == pytest.approx(-2.0, rel=1e-12)
    assert max(point.residual, point.accuracy) < 1e-9
    assert point.orbit.period == np.inf
    a, b = point.orbit["x"], point.orbit["y"]
    assert np.abs(a**2 * (1 - a) - b**2).max() < 1e-11
    assert a.max() == pytest.approx(1.0, abs=1e-3)
    assert "homoclinic orbit" in {outcome.code for outcome in cycles.outcomes}
    assert "saddle quantity -2" in repr(point)


def test_row_of_the_homoclinic_orbit(cycles):
    (row,) = cycles.special_rows
    assert row in (0, len(cycles) - 1)
    assert cycles.period[row] == np.inf
    assert cycles.stability[row] == "unknown"
    assert cycles[row].outcome.code == "homoclinic"
    assert cycles.stable.sum() == len(cycles) - 1
    assert cycles["max(x)"][row] == pytest.approx(1.0, abs=1e-12)
    (found,) = cycles.at(p=0.05)
    assert found.stable


def test_saved_homoclinic_point(cycles, tmp_path):
    cycles.save(tmp_path / "cycles.npz")
    again = fs.load(tmp_path / "cycles.npz")
    assert again["HC1"]["p"] == cycles["HC1"]["p"]
    assert again["HC1"].saddle_quantity == cycles["HC1"].saddle_quantity
    assert np.array_equal(again["HC1"].saddle, cycles["HC1"].saddle)


def test_homoclinic_orbit_across_an_interface():
    """A saddle with the directions (1, −1) and (1, 2) on the left, circles about (1/2, p) beyond.

    Its unstable direction leaves at y = −1, its stable one enters at y = 2: p = 1/2.
    """
    left = (-y, -2 * (x + 1) - y)
    model = fs.Model(
        {
            x: sp.Piecewise((left[0], x < 0), (p - y, True)),
            y: sp.Piecewise((left[1], x < 0), (x - sp.Rational(1, 2), True)),
        },
        parameters={p: 0.4},
    )
    orbit = fs.find_orbit(model, [0.0, 1.5])
    branch = fs.continue_orbits(orbit, "p", over=(0.35, 0.6))
    (point,) = branch.special("HC")
    assert point["p"] == pytest.approx(0.5, abs=1e-13)
    assert point.saddle == pytest.approx([-1.0, 0.0], abs=1e-13)
    assert point.saddle_quantity == pytest.approx(-1.0, abs=1e-13)
    assert point.orbit.hits() == 2


def test_hindmarsh_rose_against_dop853():
    """The gap between the manifolds of the saddle, integrated by SciPy: 12 digits of z."""

    def rates(t, s, z):
        a, b = s
        return b - a**3 + 3 * a**2 - z + 2, 1 - 5 * a**2 - b

    def gap(z):
        a = np.sort(np.roots([1, 2, 0, z - 3]).real)[1]
        rest = np.array([a, 1 - 5 * a**2])
        values, vectors = np.linalg.eig([[-3 * a**2 + 6 * a, 1], [-10 * a, -1]])
        stable, unstable = np.linalg.inv(vectors)[np.argsort(values)]
        way = vectors[:, np.argmax(values)]

        def back(t, s, z):
            return abs(stable @ (s - rest)) - 1e-6

        back.terminal, back.direction = True, -1
        start = rest + 1e-6 * way * np.sign(way[0])
        run = solve_ivp(
            *(rates, (0, 400), start, "DOP853"), args=(z,), events=back, rtol=1e-13, atol=1e-15
        )
        return unstable @ (run.y_events[0][0] - rest)

    model = fs.systems.hindmarsh_rose().frozen().with_parameters(z=2.05)
    branch = fs.continue_orbits(fs.find_orbit(model, [1, -5]), "z", over=(2.0, 2.2))
    (point,) = branch.special("HC")
    assert point["z"] == pytest.approx(brentq(gap, 2.0855, 2.0857, xtol=1e-14), abs=1e-12)


def test_rotations_of_the_pendulum():
    """The homoclinic orbit encircles the cylinder; by Melnikov's method p = 4c/π + O(c³)."""
    damping = 0.1
    model = fs.Model(
        {x: y, y: p - sp.sin(x) - damping * y}, parameters={p: 0.15}, periodic={x: 2 * sp.pi}
    )
    branch = fs.continue_orbits(fs.find_orbit(model, [0.0, 2.0]), "p", over=(0.1, 0.2))
    # the start of the orbit is far from x = 0, and does not move along it to a fold of the phase
    assert branch.range[1] == 0.2
    (point,) = branch.special
    assert point.code == "HC"
    assert point["p"] == pytest.approx(4 * damping / np.pi, abs=damping**3)
    assert point.saddle_quantity == pytest.approx(-damping, abs=1e-12)


@pytest.mark.sample(0)
def test_a_saddle_node_on_the_cycle_is_not_homoclinic():
    """On the unit circle θ' = 1 + p − cos θ: the period 2π/√(p (2 + p))."""
    radial, turn = 1 - x**2 - y**2, 1 + p - x
    model = fs.Model({x: x * radial - y * turn, y: y * radial + x * turn}, parameters={p: 0.5})
    branch = fs.continue_orbits(fs.find_orbit(model, [1.0, 0.0]), "p", over=(-0.5, 0.6))
    assert len(branch.special) == 0
    (end,) = (o for o in branch.outcomes if o.code != "end of range")
    assert end.code == "saddle-node on the cycle"
    assert abs(float(str(end).split("p* = ")[1].rstrip("."))) < 1e-10


def test_an_equilibrium_on_the_interface_is_not_homoclinic():
    """On the left a stable node at (p, 0), virtual for p > 0, with the period about −2 ln p."""
    half = sp.Rational(1, 2)
    model = fs.Model(
        {
            x: sp.Piecewise((p - x - 2 * y, x < 0), (1 - y, True)),
            y: sp.Piecewise((-half * y, x < 0), (x - half, True)),
        },
        parameters={p: 0.5},
    )
    branch = fs.continue_orbits(fs.find_orbit(model, [-0.5, 1.0]), "p", over=(-0.5, 0.6))
    assert len(branch.special) == 0
    (end,) = (o for o in branch.outcomes if o.code != "end of range")
    assert end.code == "boundary equilibrium on the cycle"
    assert "p = 0" in str(end) or "e-" in str(end)


@pytest.mark.sample(0)
def test_two_passages_of_a_saddle_are_a_candidate():
    """A cycle around both wells ends at a figure eight, with twice the growth of the period."""
    model = fs.Model({x: y, y: x - x**3 + y * (p - x**2)}, parameters={p: 0.82})
    branch = fs.continue_orbits(fs.find_orbit(model, [2.0, 0.0]), "p", over=(0.77, 0.83))
    assert [point.code for point in branch.special] == ["LPC"]
    assert branch.outcome.code == "period unbounded"
    assert "a candidate for a homoclinic orbit" in str(branch.outcome)


def test_a_saddle_with_a_stable_plane():
    """A third state, z' = −2 z + x y, changes neither the homoclinic orbit nor the leading pair."""
    z = sp.Symbol("z")
    right = (2 - p) * x - y - 3 * x**2 + sp.Rational(3, 2) * x * y
    rates = {x: -x + 2 * y + x**2, y: right, z: -2 * z + x * y}
    model = fs.Model(rates, parameters={p: 0.1})
    branch = fs.continue_orbits(fs.find_orbit(model, [0.8, 0.3, 0.1]), "p", over=(-0.5, 0.11))
    (point,) = branch.special
    assert abs(point["p"]) < 1e-14
    assert point.saddle_quantity == pytest.approx(1 - 2, abs=1e-12)


def landing(stable=()):
    """Below y = 0 an unstable focus at (0, −1), above it a flow downwards: sliding for x > −1/10.

    The focus flow leaves the interface at x = −1/10 and lands where r sin θ = 1. The
    pseudo-equilibrium satisfies (x + 1/10) (x − p) = 1 − x/10.
    """
    below = (-(y + 1) + x / 10, x + (y + 1) / 10)
    rates = {
        x: sp.Piecewise((below[0], y < 0), (x - p, True)),
        y: sp.Piecewise((below[1], y < 0), (-1, True)),
    }
    return fs.Model(rates | {state: -2 * state + x for state in stable}, parameters={p: 1.5})


def test_homoclinic_to_a_pseudo_saddle():
    """The parameter at which the focus flow lands on the pseudo-saddle: 10 digits."""

    def radius(angle):
        return np.sqrt(1.01) * np.exp(0.1 * (1.5 * np.pi + angle - np.arctan(0.1)))

    angle = brentq(lambda a: radius(a) * np.sin(a) - 1, 0.1, 1.5, xtol=1e-15)
    landed = radius(angle) * np.cos(angle)
    expected = landed - (1 - landed / 10) / (landed + 0.1)
    branch = fs.continue_orbits(fs.find_orbit(landing(), [0.0, -0.1]), "p", over=(0, 1.6))
    end, other = sorted(branch.outcomes, key=lambda outcome: outcome.code == "end of range")
    assert other.code == "end of range"
    assert end.code == "homoclinic to a pseudo-saddle"
    assert str(end) in repr(branch)
    assert str(other) not in repr(branch)
    found = float(str(end).split("p* = ")[1].split(",")[0])
    assert found == pytest.approx(expected, rel=1e-9)
    assert branch.stable.all()
    assert not branch.special


def test_a_pseudo_saddle_in_a_sliding_plane_is_a_candidate():
    model = landing((sp.Symbol("z"),))
    branch = fs.continue_orbits(fs.find_orbit(model, [0.0, -0.1, 0.0]), "p", over=(0, 1.51))
    (end,) = (o for o in branch.outcomes if o.code != "end of range")
    assert end.code == "period unbounded"
    assert "passes a pseudo-saddle within" in str(end)
    assert not end


def test_a_saddle_node_of_pseudo_equilibria_on_a_sliding_cycle():
    """For x < 1 the motion slides along y = 0 with x' = a + x**2, past a ghost at a = 0.

    The period is pi/sqrt(a) for a -> 0. Nodes of the orbit are on the interface to rounding; runs
    that begin there slide.
    """
    x, y, a = sp.symbols("x y a")
    rate = sp.Piecewise((x - 1, y > 0), (1, True))
    model = fs.Model({x: a + x**2 - 8 * y, y: rate}, parameters={a: 0.2})
    orbit = fs.find_orbit(model, [1.3, 0.2])
    assert orbit.itinerary == ("S1", "S1|S2")
    branch = fs.continue_orbits(orbit, "a", over=(-0.2, 0.25))
    end = branch.outcomes[0]
    assert end.code == "saddle-node on the cycle"
    assert "pseudo-equilibria" in str(end)
    assert abs(float(re.search(r"a\* = (.*?)\.$", str(end))[1])) < 1e-12
    assert np.isclose(branch.period[0] * np.sqrt(branch["a"][0]), np.pi, rtol=0.02)
    assert branch.stable.all()
