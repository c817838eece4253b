"""Codimension-two points against published values."""

import pytest
import sympy as sp

import fastslow as fs

pytestmark = pytest.mark.slow


def test_extended_lorenz_84():
    """GH at F = 2.37636 in Lorenz's model with the fourth state of van Veen."""
    x, y, z, u, f, t = sp.symbols("x y z u F T")
    rates = {
        x: -(y**2) - z**2 - x / 4 + f / 4 - sp.Float("0.987") * u**2,
        y: x * y - x * z - y + sp.Rational(1, 4),
        z: x * y + x * z - z,
        u: -sp.Float("1.04") * u + sp.Float("0.987") * u * x + t,
    }
    model = fs.Model(rates, parameters={f: 1, t: 0.04})
    # the only equilibrium there
    starts = fs.equilibria(model, F=0.5)
    (branch,) = fs.continue_equilibria(model, "F", (0.5, 3.5), from_points=starts)
    (hopf,) = branch.special("HB")
    over = {"F": (0.5, 4), "T": (-0.1, 0.3)}
    found = fs.continue_points(hopf, ("F", "T"), over=over).special("GH")
    assert all(p.converged for p in found)
    assert any(p["F"] == pytest.approx(2.37636, abs=5e-6) for p in found)
