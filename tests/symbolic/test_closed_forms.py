"""Every complete closed form satisfies its equations, at random parameters, to 25 digits."""

import mpmath
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from fastslow.model.structure import real
from tests.symbolic.symbolic_models import derived

pytestmark = pytest.mark.slow

MODELS = [
    "gear",
    "cusp",
    "duffing",
    "van_der_pol",
    "fitzhugh_nagumo",
    "lorenz",
    "hindmarsh_rose",
    "chua",
    "two_interfaces",
    "relay",
    "auto_ab",
    "four_states",
]

#: Parameters are drawn from a grid, so that no draw is close to a pole by accident.
magnitudes = st.lists(st.integers(101, 499), min_size=14, max_size=14, unique=True)


def assert_zero(expressions, place):
    for expression in expressions:
        terms = [
            mpmath.mpmathify(t.xreplace(place).evalf(40)) for t in sp.Add.make_args(expression)
        ]
        if not all(mpmath.isfinite(term) for term in terms):
            continue
        size = max([abs(term) for term in terms] + [mpmath.mpf(1)])
        assert abs(mpmath.fsum(terms)) <= size * mpmath.mpf(10) ** -25


def drawn(derivation, sizes):
    symbols = set()
    for region in derivation.regions.values():
        for rate in region.rates.values():
            symbols |= rate.free_symbols
        for condition in region.conditions:
            symbols |= condition.free_symbols
    signs = {c.lhs: (1 if isinstance(c, sp.Gt) else -1) for c in derivation.assumptions}
    return {
        s: signs.get(s, 1) * sp.Rational(size, 233)
        for s, size in zip(sorted(symbols, key=lambda s: s.name), sizes, strict=False)
    }


def full(values, located, state):
    """Parameters with the located ones in place, and the state there (a complex one counts too)."""
    place = dict(values)
    for name, expression in located.items():
        place[real(name)] = sp.sympify(expression).xreplace(values)
    for name, expression in state.items():
        place[real(name)] = sp.sympify(expression).xreplace(place)
    return place


@pytest.mark.sample(6)
@pytest.mark.parametrize("name", MODELS)
@settings(max_examples=4, deadline=None, derandomize=True)
@given(sizes=magnitudes)
def test_closed_forms(name, sizes):
    with mpmath.workdps(40):
        derivation = derived(name)
        values = drawn(derivation, sizes)
        for region in derivation.regions.values():
            rates = list(region.rates.values())
            for form in region.equilibria:
                assert_zero(rates, full(values, form.parameters, form.state))
            for continuum in region.continua:
                assert_zero(rates, full(values, continuum.parameters, continuum.state))
            for point in (*region.folds, *region.branch_points, *region.cusps, *region.hopf):
                if point.equations:
                    continue
                place = full(values, point.parameters, point.state)
                test = region.determinant
                if point.code == "HB":
                    test = sp.Mul(*(t.test for t in region.stability.hopf_tests))
                assert_zero([*rates, test], place)
        for point in derivation.boundary_equilibria:
            place = full(values, point.parameters, point.state)
            assert_zero(derivation[point.regions[0]].rates.values(), place)
