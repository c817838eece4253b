"""Compiled rates and derivatives against SymPy's own numbers."""

import mpmath
import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.diagrams.field import FrozenField
from fastslow.kernels.field_code import parameter_array
from fastslow.kernels.fields import compile_field

pytestmark = pytest.mark.slow


def test_field_equals_sympy_to_rounding(gear):
    fast = gear.frozen()
    field = FrozenField(fast, "w")
    generator = np.random.default_rng(1)
    for number, region in enumerate(fast.regions.values()):
        u = generator.normal(size=3)
        names = sp.symbols("x v w", real=True)
        at = {**fast.values, **dict(zip(names, u, strict=True))}
        rates = sp.Matrix([region.rates["x"], region.rates["v"]])
        interfaces = sp.Matrix([i.function for i in fast.interfaces.values()])
        value, slopes, h, gradients = field.evaluate(number, u)
        for found, expected in (
            (value, rates),
            (slopes, rates.jacobian(names)),
            (h, interfaces),
            (gradients, interfaces.jacobian(names)),
        ):
            exact = np.array(expected.subs(at), dtype=float).reshape(found.shape)
            np.testing.assert_allclose(found, exact, rtol=1e-13, atol=1e-13)


def test_zeros_of_a_large_field_are_written_in_every_region():
    """Rates of 16 states that differ on both sides of x1 = 0, into an array that is not empty."""
    states = sp.symbols("x1:17")
    p = sp.Symbol("p")
    ahead, behind = (*states[1:], states[0]), (states[-1], *states[:-1])
    kink = sp.Max(states[0], 0)
    rates = {
        x: p * x * a - x**3 / 2 + kink * b for x, a, b in zip(states, ahead, behind, strict=True)
    }
    field = FrozenField(fs.Model(rates, parameters={p: 1}), "p")
    names = [sp.Symbol(n, real=True) for n in (*field.model.states, "p")]
    generator = np.random.default_rng(4)
    for number in (0, 1, 0):
        rows = generator.normal(size=(2, 17))
        expected = sp.Matrix(field.rates(number))
        for u, value, slopes in zip(rows, *field.evaluate(number, rows)[:2], strict=True):
            at = dict(zip(names, u, strict=True))
            for found, exact in ((value, expected), (slopes, expected.jacobian(names))):
                exact = np.array(exact.subs(at), dtype=float).reshape(found.shape)
                np.testing.assert_allclose(found, exact, rtol=1e-13, atol=1e-13)
                assert np.array_equal(found == 0, exact == 0)


def test_new_parameter_values_compile_nothing(gear):
    fast = gear.frozen()
    one = compile_field(fast.with_free("w"), "w")
    other = compile_field(fast.with_parameters(D=0.4, A=3).with_free("w"), "w")
    assert one.address == other.address


def test_a_name_that_python_reserves():
    x, lam = sp.symbols("x lambda")
    model = fs.Model({x: lam - x}, parameters={lam: 2})
    assert fs.equilibria(model)[0].state == pytest.approx([2])


def test_a_slow_quantity_without_value_is_named(gear):
    fast = gear.frozen()
    with pytest.raises(fs.FastSlowError, match=r"'w' has no value"):
        parameter_array(fast, compile_field(fast, "A").parameters)


def test_a_function_that_cannot_be_compiled_is_named():
    x = sp.Symbol("x")
    with pytest.raises(fs.FastSlowError, match=r"contain the derivative of zeta, .* compiled"):
        fs.equilibria(fs.Model({x: sp.zeta(x) - 2}))
    with pytest.raises(fs.FastSlowError, match=r"contain .*mathieuc.* cannot be compiled"):
        fs.equilibria(fs.Model({x: sp.mathieuc(1, 2, x) - x}))


def test_special_functions_are_continued():
    # J0(x) = a folds where J1 vanishes; there J0'' = -J0
    x, a = sp.symbols("x a")
    model = fs.Model({x: sp.besselj(0, x) - a}, parameters={a: -0.35})
    folds = fs.continue_equilibria(model, a, (-0.5, -0.31)).special("LP")
    zero = float(mpmath.besseljzero(1, 1))
    least = float(mpmath.j0(zero))
    assert sorted(p.state[0] for p in folds) == pytest.approx([-zero, zero], abs=1e-8)
    for point in folds:
        assert point.parameters["a"] == pytest.approx(least, abs=1e-13)
        assert point.coefficient == pytest.approx(-least / 2, abs=1e-9)
