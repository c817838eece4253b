"""Quotients with a removable singularity are found in what a user may write."""

import random

import mpmath
import pytest
import sympy as sp
from sympy.codegen.cfunctions import expm1, log1p

from fastslow.model.model import Model
from fastslow.model.removable import (
    REMOVABLE,
    ExpQuotient,
    LogQuotient,
    Removable,
    with_removable,
    written_out,
)
from tests.samples import examples

V, x, a, k, V_0 = sp.symbols("V x a k V_0", real=True)
exp, R = sp.exp, sp.Rational

#: Ways to write z/(exp(z) − 1) and its like, with the argument z.
WRITINGS = [
    lambda z: z / (exp(z) - 1),
    lambda z: z / (1 - exp(-z)),
    lambda z: -z / (1 - exp(z)),
    lambda z: 3 * z / (2 * exp(z) - 2),
    lambda z: z * exp(-z) / (1 - exp(-z)),
    lambda z: z * exp(-z / 2) / (exp(z / 2) - exp(-z / 2)),
    lambda z: z / expm1(z),
    lambda z: (z / 2) * (sp.coth(z / 2) - 1),
    lambda z: sp.expand(z * (sp.coth(z) + 1)),
    lambda z: z * sp.coth(z),
    lambda z: z / sp.tanh(z),
    lambda z: sp.tanh(z) / z,
    lambda z: (exp(z) - 1) / z,
    lambda z: sp.sinh(z) / z,
    lambda z: z / sp.sinh(z),
    lambda z: sp.sinc(z),
    lambda z: sp.sin(2 * z) / z,
    lambda z: sp.tan(z) / z,
    lambda z: z * sp.csc(z),
    lambda z: log1p(z) / z,
    lambda z: z / sp.log(1 + z),
    lambda z: sp.log(z) / (z - 1),
    lambda z: (1 - sp.cos(z)) / z**2,
    lambda z: (sp.cosh(z) - 1) / z**2,
    lambda z: z**2 / (exp(z) - 1) ** 2,
]
ARGUMENTS = [
    V,
    (V + 40) / 10,
    -(V + 40) / 10,
    0.1 * (25 - V),
    0.07 * (V + 40.3),
    (V - V_0) / k,
    k * (V - V_0),
    a * V * x,
    sp.sin(x),
    V**2 - x,
]


@pytest.mark.parametrize("number", range(len(WRITINGS)))
def test_every_writing_with_every_argument(number):
    generator = random.Random(number)
    for z in generator.sample(ARGUMENTS, examples(4)):
        written = x * WRITINGS[number](z) + V
        found = with_removable(written)
        assert found.has(Removable), written
        place = {s: R(generator.randint(-40, 40), 17) + R(1, 100) for s in (V, x, a, k, V_0)}
        place |= {x: abs(place[x])}
        expected, value = (sp.N(e.xreplace(place), 25) for e in (written, found))
        if expected.is_real:
            assert abs(expected - value) <= 1e-13 * (1 + abs(expected)), written


@pytest.mark.parametrize(
    "written",
    [
        (V + 40) / (1 - exp(-(V + 40) / 10)),
        0.1 * (25 - V) / (exp((25 - V) / 10) - 1),
        # SymPy evaluates these exponentials to a number times exp(0.1*V)
        0.1 * (V + 40.0) / (1 - exp(-0.1 * (V + 40.0))),
        0.12 * (V + 8) / (exp((V + 8) / 5.0) - 1),
        sp.expand((V + 40) * (1 - x) / (1 - exp(-(V + 40) / 10))),
        a * (V - V_0) / (1 - exp((V_0 - V) / k)),
        (x**2 - 1) / (exp(x - 1) - 1),
    ],
)
def test_rates_of_gates(written):
    found = with_removable(written)
    assert found.has(ExpQuotient)
    assert not found.has(exp)


@pytest.mark.parametrize(
    "pole",
    [
        (V + 39) / (1 - exp(-(V + 40) / 10)),
        (V + 40.001) / (1 - exp(-0.1 * (V + 40.0))),
        x / (exp(V) - 1),
        1 / (exp(V) - 1),
        V / (exp(V) + 1),
        V / (exp(V) - a),
        sp.cos(V) / V,
        (1 - sp.cos(V)) / V**3 * V_0 / V,
    ],
)
def test_poles_are_left(pole):
    found = with_removable(pole)
    left = found.replace(lambda e: isinstance(e, Removable), lambda e: sp.Integer(1))
    assert sp.simplify(sp.denom(sp.together(left))).free_symbols or found == pole


Z = V / (1 - exp(-V))
U = (V + 40) / 10


@pytest.mark.parametrize(
    "guarded",
    [
        sp.Piecewise((1 + V / 2, sp.Abs(V) < 1e-4), (Z, True)),
        sp.Piecewise((Z, sp.Abs(V) > 1e-6), (1 + V / 2, True)),
        sp.Piecewise((1, sp.Eq(V, 0)), (Z, True)),
        sp.Piecewise((Z, sp.Ne(V, 0)), (1, True)),
        sp.Piecewise((1 + V / 2, (V > -1e-4) & (V < 1e-4)), (Z, True)),
        sp.Piecewise((1 + V / 2, V**2 < 1e-8), (Z, True)),
        sp.Piecewise((1 + U / 2, sp.Abs(V + 40) < 1e-3), (U / (1 - exp(-U)), True)),
        sp.Piecewise(
            (a * k, sp.Abs(V - V_0) < 1e-6), (a * (V - V_0) / (1 - exp((V_0 - V) / k)), 1)
        ),
    ],
)
def test_guards_make_no_interfaces(guarded):
    model = Model({V: 1 - guarded - V}, parameters={a: 2, k: 10, V_0: -40})
    assert not model.interfaces
    assert model.regions["S1"].rates["V"].has(ExpQuotient)


@pytest.mark.parametrize(
    "kept",
    [
        sp.Piecewise((2 + V / 2, sp.Abs(V) < 1e-4), (Z, True)),
        sp.Piecewise((1 + V / 2, V < 1e-4), (Z, True)),
        sp.Piecewise((1 + V / 2, sp.Abs(V) < 2), (Z, True)),
        sp.Piecewise((0, x < 0), (Z, True)),
        sp.Piecewise((1 + V / 2, sp.Abs(V - 1) < 1e-4), (Z, True)),
    ],
)
def test_other_pieces_are_kept(kept):
    assert with_removable(kept).has(sp.Piecewise)


def test_precise_values_and_printing():
    assert str(ExpQuotient(-V / 10 - 4, 0)) == "(V/10 + 4)/(1 - exp(-V/10 - 4))"
    assert str(2 * ExpQuotient(V, 0) + x) == "x + 2*(V/(exp(V) - 1))"
    assert written_out(x * LogQuotient(V, 0)) == x * sp.log(V) / (V - 1)
    assert sp.latex(ExpQuotient(V, 0)) == sp.latex(V / (exp(V) - 1))
    for quotient in REMOVABLE:
        for order in range(3):
            for y in (R(1, 10**30), R(1, 1000), R(7, 3)):
                point = quotient.point + y
                form = written_out(quotient(V, order)).xreplace({V: sp.Float(point, 150)})
                found = quotient(sp.Float(point, 60), order)
                scale = max(abs(sp.N(form, 40)), R(1, 10**29))
                assert abs(found - sp.N(form, 50)) < 1e-28 * scale, (quotient, order, y)
    function = sp.lambdify(V, ExpQuotient(V, 1), "mpmath")
    with mpmath.workdps(40):
        assert abs(function(mpmath.mpf("1e-25")) + mpmath.mpf(1) / 2) < 1e-25


def test_values_at_complex_numbers_have_the_digits_of_the_formula():
    """40 digits, near the singular point as well, where the formula at 140 digits is exact."""
    y = sp.Symbol("y")
    for quotient in REMOVABLE:
        for shift in (sp.Rational(3, 10) + sp.I / 5, sp.I * 2, (1 + sp.I) * sp.Rational(1, 10**20)):
            place = quotient.point + shift
            for order in (0, 1, 3):
                found = quotient(place, sp.Integer(order)).evalf(40)
                formula = quotient.formula(y).diff(y, order).subs(y, place)
                exact = sp.N(formula, 40, maxn=1000)
                assert abs(found - exact) <= abs(exact) * sp.Float(10) ** -38
