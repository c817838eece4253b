"""Long numbers are rounded in print and stored exactly."""

import re

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.model.model import Model
from fastslow.model.structure import real
from fastslow.symbolic.decimals import readable, without_scale
from fastslow.symbolic.report.wording import ROUNDED

X, Y = real("x"), real("y")


def long_number(generator):
    digits = generator.integers(1, 10**9, 3)
    return sp.Rational(int(digits[0]) * 10**9 + int(digits[1]), int(digits[2]))


def random_sum(generator):
    powers = generator.integers(0, 3, (4, 2))
    return sp.Add(*(long_number(generator) * X ** int(i) * Y ** int(j) for i, j in powers))


@pytest.mark.parametrize("seed", range(10))
def test_printed_formulas_have_the_values_of_the_exact_ones(seed):
    generator = np.random.default_rng(seed)
    one, two, three = (random_sum(generator) for _ in range(3))
    exact = one * sp.sqrt(two) / three + sp.exp(-X / long_number(generator)) * two**2
    shown = readable(exact)
    place = {X: sp.Rational(7, 5), Y: sp.Rational(3, 4)}
    assert max(len(d) for d in re.findall(r"\d+", str(shown))) <= 9
    ratio = complex(sp.N(shown.subs(place) / exact.subs(place)))
    assert abs(ratio - 1) < 1e-4
    # a zero stays where it is, and a sign what it is
    free = without_scale(one - two)
    factor = complex(sp.N(free.subs(place) / (one - two).subs(place))).real
    again = complex(sp.N(free.subs(X, 2) / (one - two).subs(X, 2)).subs(Y, 1)).real
    assert factor == pytest.approx(again, rel=1e-3)
    assert factor > 0


def test_relations_keep_their_direction():
    generator = np.random.default_rng(3)
    for _ in range(4):
        relation = random_sum(generator) - random_sum(generator) > 0
        shown = readable(relation)
        for x, y in ((1, 2), (-3, 2), (2, -5), (-1, -1)):
            place = {X: sp.Integer(x), Y: sp.Integer(y)}
            assert relation.subs(place) == shown.subs(place)


def test_short_numbers_stay_and_rounding_is_said():
    assert readable(sp.Rational(653, 2000) * X) == sp.Rational(653, 2000) * X
    t, w = sp.symbols("t w")
    x = sp.Symbol("x")
    derivation = fs.derive(
        Model({x: w - 1.234567890123 * x + 2.5}, forcing={w: sp.sin(t)}).frozen()
    )
    assert ROUNDED in derivation.summary()
    assert "x = 0.81*w + 2.025" in derivation.summary()
    assert not re.search(r"\d{10}", derivation.to_latex())
    slope = -derivation["S1"].jacobian[0, 0]
    assert slope == sp.Rational("1.234567890123")
    plain = fs.derive(Model({x: w - 1.25 * x}, forcing={w: sp.sin(t)}).frozen())
    assert ROUNDED not in plain.summary()
