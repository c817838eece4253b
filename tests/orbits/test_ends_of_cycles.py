"""How branches of cycles end: outcomes, and words that the orbits support."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs

pytestmark = pytest.mark.slow

x, y, a, c = sp.symbols("x y a c")


def codes(branch):
    return [outcome.code for outcome in branch.outcomes]


class TestFamilyAtAHopfPoint:
    """Goodwin's business cycle: a linear centre at κ = 9/10, and cycles with limits beyond."""

    kappa = sp.Symbol("kappa")

    def model(self):
        R = sp.Rational
        accelerator = sp.Max(-3, sp.Min(9, self.kappa * y))
        rates = {x: y, y: 2 * (accelerator + 2 - R(9, 10) * y - R(2, 5) * x)}
        return fs.Model(rates, parameters={self.kappa: 2})

    def test_from_the_hopf_point(self):
        diagram = fs.continue_equilibria(self.model(), "kappa", over=(0.5, 3))
        (cycles,) = fs.continue_cycles(diagram)
        assert codes(cycles) == ["Hopf point", "end of range"]
        self.check(cycles)

    def test_towards_the_hopf_point(self):
        """The family is passed to its end, not taken for it at its largest cycle."""
        cycles = fs.continue_orbits(fs.find_orbit(self.model(), [0, 1]), "kappa", over=(0.5, 3))
        assert codes(cycles) == ["Hopf point", "end of range"]
        assert "at kappa = 0.9." in str(cycles.outcomes[0])
        self.check(cycles)

    def check(self, cycles):
        size = cycles["max(x) - min(x)"]
        assert np.diff(size[[0, -1]]) > 10
        assert size.min() < 2
        level = np.abs(cycles.values - 0.9) < 1e-12
        # the centre has the frequency 2/√5, and the cycles in it touch y = -3/κ at the largest
        np.testing.assert_allclose(cycles.period[level], np.pi * np.sqrt(5), rtol=1e-9)
        assert size[level].max() == pytest.approx(2 * 10 / 3 * np.sqrt(5) / 2, abs=1e-3)
        # a contact on the family has no direction of the parameter
        assert [point.type for point in cycles.special("GR")] == ["", "transition"]


@pytest.mark.parametrize("offset", [0, 1e4])
def test_a_hopf_point_far_from_the_origin(offset):
    """Cycles of radius √μ about (offset, 0) are no point where they are small beside it."""
    mu, (u, w) = sp.Symbol("mu"), (x - offset, y)
    square = u**2 + w**2
    rates = {x: mu * u - w - u * square, y: u + mu * w - w * square}
    model = fs.Model(rates, parameters={mu: 0.04})
    orbit = fs.find_orbit(model, [offset + 0.2, 0])
    branch = fs.continue_orbits(orbit, "mu", over=(-1, 1))
    assert codes(branch) == ["Hopf point", "end of range"]
    assert branch["max(y)"].min() < 0.05
    assert float(str(branch.outcomes[0]).split("=")[1].rstrip(".")) == pytest.approx(0, abs=1e-7)


@pytest.mark.sample(1)
@pytest.mark.parametrize("scale", [1.0, 1e-3, 2.5])
def test_the_period_grows_until_the_parameter_is_reached(scale):
    """The cycle approaches the point near a* = scale with one rate and leaves with another."""
    f = sp.Piecewise((x + 2 * scale, x < -scale), (-x, x < scale), (x - 2 * scale, True))
    model = fs.Model({x: y - f, y: (a - x) / 10}, parameters={a: scale / 2})
    orbit = fs.find_orbit(model, [2 * scale, 0])
    branch = fs.continue_orbits(orbit, "a", over=(0, 2 * scale))
    assert codes(branch) == ["end of range", "boundary equilibrium on the cycle"]
    away = 1 - branch.values / scale
    assert 0 < away[-1] < 1e-5
    # the smaller modulus of λ² + λ + 1/10 = 0, and the larger root of λ² - λ + 1/10 = 0
    slow, fast = sorted(np.abs(np.roots([1, 1, 0.1])))
    late = away < 1e-2
    growth = np.diff(branch.period[late]) / np.diff(-np.log(away[late]))
    assert growth[-1] == pytest.approx(1 / slow + 1 / fast, rel=1e-4)


def test_a_saddle_node_on_the_cycle_is_reached():
    """θ' = a - sin θ has the period 2π/√(a² - 1)."""
    theta = sp.Symbol("theta")
    model = fs.Model({theta: a - sp.sin(theta)}, parameters={a: 2}, periodic={theta: 2 * sp.pi})
    branch = fs.continue_orbits(fs.find_orbit(model, [0]), "a", over=(0, 2))
    assert codes(branch) == ["saddle-node on the cycle", "end of range"]
    assert 0 < branch.values[0] - 1 < 2.5e-4
    expected = 2 * np.pi / np.sqrt(branch.values**2 - 1)
    np.testing.assert_allclose(branch.period, expected, rtol=1e-8)


def test_an_equilibrium_that_remains_where_its_interface_moves():
    """The state of the boundary equilibrium is no start for the cycle beside it."""
    rate = sp.Piecewise((x / 2 - y, x < a), (-x - y + sp.Rational(3, 2) * a, True))
    diagram = fs.continue_equilibria(
        fs.Model({x: rate, y: x}, parameters={a: 1}), "a", over=(-1, 1)
    )
    (cycles,) = fs.continue_cycles(diagram)
    assert codes(cycles) == ["boundary equilibrium", "end of range"]
    assert "at a = 0." in str(cycles.outcomes[0]) or abs(cycles.values[0]) < 1e-3
    # the motion is homogeneous
    assert np.ptp(cycles.period) < 1e-9
    sizes = cycles["max(x) - min(x)"] / cycles.values
    np.testing.assert_allclose(sizes, sizes[0], rtol=1e-9)


def test_an_orbit_that_was_not_found():
    """Its branch is one row with the same outcome."""
    model = fs.Model({x: y, y: -x - c * y}, parameters={c: 0.1})
    orbit = fs.find_orbit(model, [1, 0])
    assert not orbit.outcome
    branch = fs.continue_orbits(orbit, "c", over=(0, 1))
    assert len(branch) == 1
    assert [outcome.code for outcome in branch.outcomes] == [orbit.outcome.code] * 2
