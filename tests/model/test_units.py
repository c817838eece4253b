"""Natural units of equations whose terms have known sizes."""

import pytest
import sympy as sp

from fastslow.model.interfaces import Region
from fastslow.model.structure import real
from fastslow.model.units import natural_units

x, y, w = real("x"), real("y"), real("w")


def units_of(*rates, functions=(), values=None):
    region = Region("S1", {}, (), dict(zip("xy", rates, strict=False)), {})
    return natural_units(["x", "y", "w"], [region], functions, values or {})


@pytest.mark.parametrize("decade", [-9, -3, 0, 3, 9])
@pytest.mark.parametrize(
    "rate",
    [
        lambda u: u**3 - u + 1,
        lambda u: 2 - sp.Abs(u),
        lambda u: 1 - sp.Max(u, -u),
        lambda u: sp.sin(u) - u / 2,
        lambda u: 1 - sp.exp(-u),
        lambda u: sp.Pow(2, u) - 3,
        lambda u: sp.sqrt(u) - 1,
    ],
)
def test_a_unit_is_measured_in_the_unit_of_its_state(rate, decade):
    plain = units_of(rate(x))["x"]
    assert 0.25 <= plain <= 4
    scaled = units_of(rate(x / sp.Integer(10) ** decade))["x"]
    assert scaled / plain / 10.0**decade == pytest.approx(1, rel=0.42)


def test_the_terms_of_a_sum_are_alike():
    # 2^20 x − 2^-20 x³ has terms alike at x = 2^20, where both are 2^40
    large, small = sp.Integer(2) ** 20, sp.Rational(1, 2**20)
    assert units_of(w + large * x - small * x**3) == {"x": 2.0**20, "y": 1.0, "w": 2.0**40}
    # y is 8 x, and 4 x is w = 64
    found = units_of(w - 4 * x, 8 * x - y, values={w: 64.0})
    assert found == {"x": 16.0, "y": 128.0, "w": 64.0}
    assert units_of(sp.sign(x) - y / 1024)["y"] == 1024.0
    assert units_of(0 * x, functions=[x - 256])["x"] == 256.0


def test_what_the_equations_leave_open_is_one():
    assert units_of(-1000 * x, 7 * y) == {"x": 1.0, "y": 1.0, "w": 1.0}
