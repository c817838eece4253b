"""Eliminating states from equilibrium equations."""

import numpy as np
import pytest
import sympy as sp

from fastslow.errors import ArgumentError, UnknownNameError
from fastslow.model.structure import real
from fastslow.symbolic.signs.signs import Signs
from fastslow.symbolic.solving.elimination import eliminate

x, y, z, v, w, A, D = map(real, ["x", "y", "z", "v", "w", "A", "D"])


def test_gear_leaves_one_cubic():
    result = eliminate({"x": v, "v": w - v - (x**2 + A) * (x - D)}, ["x", "v"])
    assert result.is_univariate
    assert result.is_polynomial
    assert result.unknowns == (x,)
    assert dict(result.solved) == {"v": 0}
    assert sp.expand(result.remaining[0] - (w - (x**2 + A) * (x - D))) == 0


def test_singular_region_leaves_a_condition_without_unknown():
    result = eliminate({"x": v, "v": w - v}, ["x", "v"])
    assert (result.remaining, result.unknowns) == ((w,), (x,))


def test_only_known_nonzero_coefficients_are_divided_by():
    sigma = real("sigma")
    rates = {"x": sigma * (y - x), "y": x - y**3}
    assert eliminate(rates, ["x", "y"]).solved == {"x": y**3}
    positive = Signs({sigma: 1})
    assert eliminate(rates, ["x", "y"], nonzero=positive.nonzero).is_univariate


def test_definite_coefficients_with_states_count_as_nonzero():
    result = eliminate({"x": y - x**3 + w, "y": x - (1 + x**2) * y}, ["x", "y"])
    assert result.is_univariate
    assert result.is_polynomial


def test_shared_nonlinear_terms_are_combined():
    # u1' and u2' share (1 − u1) e^u2: one exponential equation is left
    u1, u2, p1 = map(real, ["u1", "u2", "p1"])
    hot = p1 * (1 - u1) * sp.exp(u2)
    result = eliminate({"u1": -u1 + hot, "u2": -3 * u2 + 14 * hot}, ["u1", "u2"])
    assert result.is_univariate
    assert not result.is_polynomial
    assert result.solved["u2"] == 14 * u1 / 3


def test_solutions_agree_with_numerical_roots():
    # Lorenz at ρ = 28: roots of the eliminated cubic are 0, ±√72
    rates = {"x": 10 * (y - x), "y": x * (28 - z) - y, "z": x * y - sp.Rational(8, 3) * z}
    result = eliminate(rates, ["x", "y", "z"])
    found = np.roots([float(c) for c in sp.Poly(result.remaining[0], x).all_coeffs()])
    assert np.sort(found) == pytest.approx([-(72**0.5), 0, 72**0.5], rel=1e-14, abs=1e-14)
    state = result.state({x: sp.sqrt(72)}, ["x", "y", "z"])
    assert state == (6 * sp.sqrt(2), 6 * sp.sqrt(2), 27)


def test_bad_input():
    with pytest.raises(UnknownNameError, match="did you mean 'velocity'"):
        eliminate({"velocity": v}, ["velocty"])
    with pytest.raises(ArgumentError, match="smooth"):
        eliminate({"x": sp.Piecewise((x, x > 0), (0, True))}, ["x"])
