"""Powers beyond the range of floating point: no equilibrium is dropped from a complete list."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.continuation.polynomial_systems import solve_polynomials

pytestmark = pytest.mark.slow

P, M, level, m, q = sp.symbols("P M l m q")
x, y, a = sp.symbols("x y a")


def lake(exponent, half, load, inline):
    """Phosphorus in water and sediment (Carpenter 2005), and the sum of its rates without M."""
    values = {level: load, m: half, q: exponent}
    recycled = sp.Rational(19, 1000) * M * P**q / (P**q + m**q)
    rates = {P: level - 17 * P / 20 + recycled, M: 7 * P / 10 - M / 1000 - recycled}
    if inline:
        exact = {s: sp.Rational(str(v)) for s, v in values.items()}
        return fs.Model({s: rate.subs(exact) for s, rate in rates.items()})
    return fs.Model(rates, parameters=values)


def counted(exponent, half, load):
    """Changes of sign of the one equation that remains, for even powers, which need P > 0."""
    p = np.linspace(1e-3, load / 0.15 * 1.01, 40001)
    share = 1.0 / (1.0 + np.exp(np.minimum(exponent * np.log(half / p), 700.0)))
    left = load - 0.85 * p + 19 * (load - 0.15 * p) * share
    return int(np.count_nonzero(left[1:] * left[:-1] < 0))


def test_all_equilibria_or_not_complete():
    random = np.random.default_rng(11)
    complete = 0
    for exponent in (4, 8, 16, 20, 30, 50):
        half, load = round(random.uniform(0.1, 12), 1), round(random.uniform(0.3, 1.5), 1)
        found = fs.equilibria(lake(exponent, half, load, inline=False))
        expected = counted(exponent, half, load)
        if found.completeness == "complete":
            complete += 1
            assert len(found) == expected, (exponent, half, load)
        else:
            assert len(found) <= expected
    assert complete >= 3


@pytest.mark.sample(2)
@pytest.mark.parametrize("half", [2.4, 0.24, 0.1, 7.3])
def test_decimals_as_parameters_and_inline_are_the_same(half):
    by_value, inline = (fs.equilibria(lake(20, half, 1.0, inline=k)) for k in (False, True))
    assert by_value.completeness == inline.completeness == "complete"
    assert len(by_value) == counted(20, half, 1.0)
    for one, other in zip(by_value, inline, strict=True):
        assert one.state == pytest.approx(other.state, rel=1e-13)


def test_states_that_cannot_be_represented():
    """The equilibrium x = 1e400 is not complete in any order of elimination."""
    for rates in ({x: a * x - 1e200}, {x: y - 1, y: a * x - 1e200 * y}):
        found = fs.equilibria(fs.Model(rates, parameters={a: 1e-200}))
        assert (len(found), found.completeness) == (0, "found")


def test_coefficients_that_cannot_be_represented():
    large = {(0,): 10**400, (1,): -1, (2,): 10**400, (9,): 1}
    assert not solve_polynomials([large]).complete


def test_poles_and_complex_states_take_nothing_away():
    """A root of the equations at a pole, or of a state that is complex, is no equilibrium."""
    pole = fs.equilibria(fs.Model({x: (x - 1) * (x - 2) / (x - 1) ** 2, y: x - y}))
    assert (len(pole), pole.completeness) == (1, "complete")
    beyond = fs.equilibria(fs.Model({x: x**2 - 3 * x + 2, y: sp.sqrt(x - sp.Rational(3, 2)) - y}))
    assert [e.state[0] for e in beyond] == [2.0]
