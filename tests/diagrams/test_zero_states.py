"""Equilibria with a state that is zero, computed to rounding only: units, branches and points."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs

pytestmark = pytest.mark.slow

R = sp.Rational
x, y, z, k = sp.symbols("x y z k")


def family(seed, at=0):
    """Rates with one equilibrium, x = at, and a Hopf point at k = 0, with its frequency.

    The difference exp(x - at) - 1 is 0 or 1e-16 near the equilibrium, whatever x is.
    """
    random = np.random.default_rng(seed)
    c, g, e = (R(int(v), 10) for v in random.integers(1, 30, 3))
    d = R(1, int(random.integers(20, 200)))
    u = sp.exp(x - at) - 1
    inside = y - c - d * (x - at) + (k + d) * u - u**3
    rates = {x: inside * g * sp.exp(at - x), y: -e * u}
    if seed % 2:
        rates[z] = -z * R(7, 5) + (x - at) * R(3, 10)
    return fs.Model(rates, parameters={k: 0.1}), float(sp.sqrt(e * g))


@pytest.mark.sample(1)
@pytest.mark.parametrize("seed", [0, 5, 7, 1, 9, 13])
def test_zero_to_rounding_is_no_unit(seed):
    """Before, 16 of 24 had 2 to 11 branches, and frequencies with errors up to 4 %."""
    model, frequency = family(seed)
    diagram = fs.continue_equilibria(model, "k", over=(-0.3, 0.4))
    assert len(diagram.branches) == 1
    (point,) = diagram.special("HB")
    assert point.frequency == pytest.approx(frequency, rel=1e-14)
    assert point.eigenvalues.imag.max() == pytest.approx(frequency, rel=1e-14)
    assert abs(point["k"]) < 1e-15
    if seed < 2:
        # the same equilibria, with x = 1
        shifted = fs.continue_equilibria(family(seed, 1)[0], "k", over=(-0.3, 0.4))
        (other,) = shifted.special("HB")
        assert point.lyapunov == pytest.approx(other.lyapunov, rel=1e-10)
