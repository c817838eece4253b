"""Models with large expressions: nothing is multiplied out beyond a budget of terms."""

from itertools import product

import numpy as np
import pytest
import sympy as sp

from fastslow.model.expansion import (
    MULTIPLIED,
    cancelled,
    expanded,
    n_terms,
    vanishes,
    without_cancellation,
)
from fastslow.model.model import Model
from fastslow.results.stored.sign_patterns import _Lines, possible_patterns, scaled_row

pytestmark = pytest.mark.slow

x, y, z = sp.symbols("x y z", real=True)


def fluxes(count):
    """A ring of states with fluxes between them, each a rational function of high degree."""
    states, (a, b) = sp.symbols(f"x0:{count}"), sp.symbols("a b")
    found = []
    for i, u in enumerate(states):
        v, w = states[(i + 1) % count], states[(i + 2) % count]
        q = (u**2 + a * v) / (b + u**2 + v * w)
        p = (q + a) ** 3 / (1 + q * w)
        o = p * (v - u) / (1 + p + q)
        j = (o * q + (1 - o) * p) ** 4 / (1 + (o + p) ** 4)
        found.append(j * u * (1 + a * o))
    rates = {
        u: found[i] - found[i - 1] + a * u - (b + found[(i + 2) % count]) * u
        for i, u in enumerate(states)
    }
    return Model(rates, parameters={a: 0.3, b: 1.2})


def test_the_operations_of_a_large_model_are_its_common_subexpressions():
    model = fluxes(7)
    written = sum(sp.count_ops(rate) for rate in model.rates.values())
    assert written > 5000
    assert max(map(n_terms, model.rates.values())) > MULTIPLIED
    assert len(model.operations.motions[0].nodes) < 300
    assert model.traits.vanishing == ()


def test_terms_are_those_of_the_expanded_expression():
    for one in [(x + y) * (x + z), (x + y + z) ** 3, x * (y + z * (x + 1)), 1 + x]:
        assert n_terms(one) >= len(sp.Add.make_args(sp.expand(one)))
    assert n_terms((x + y + z) ** 3) == 10
    assert n_terms(1 / ((x + 1) * (y + 1))) == 4
    large = (x + y + 1) ** 60
    assert expanded(large) is large
    assert not vanishes(large - sp.expand((x + y + 1) ** 2))
    assert vanishes((x + y) ** 3 - x**3 - y**3 - 3 * x * y * (x + y))


def test_sums_in_which_large_terms_cancel_are_multiplied_out():
    large = (x + 10**8) ** 2 - x**2 - 2 * 10**8 * x - 10**16
    run = Model({x: large - x}).operations
    assert len(run.motions[0].nodes) == len(Model({x: -x}).operations.motions[0].nodes)
    assert without_cancellation(large + x - y) == x - y
    assert without_cancellation((x + y) ** 2 - x**2 - y**2) == 2 * x * y
    assert without_cancellation(0.1 * (x - 1e7) ** 2 - 1e13 + y) == x**2 / 10 - 2000000 * x + y
    # nothing of size cancels, or nothing at all
    for written in ((x - 1) ** 3 - x**3, x * (1 - x) + y, (x + y) ** 60 - x**60, 1 / (x + 1) - 1):
        assert without_cancellation(written) == written


def test_a_quotient_with_exponentials_of_long_decimals_remains_as_written():
    # as polynomials in exp(x/2·10¹⁶) these have 10¹⁵ coefficients
    long = sp.Rational("0.05555555555555555")
    one = (sp.exp(x / 5) - 1) / (sp.exp(long * x) + sp.exp(x / 5) + y)
    assert cancelled(one) is one


def test_patterns_of_functions_of_separate_symbols_are_all_combinations():
    lines = [scaled_row(row) for row in ([1, 0, 0, -1], [1, 0, 0, 1], [0, 1, 1, 0], [0, 1, -1, 2])]
    whole = _Lines(lines)
    expected = [p for p in product((1, 0, -1), repeat=4) if whole._meet(p)]
    assert possible_patterns(lines) == expected
    assert len(expected) == 3 * 4
    several = [scaled_row(row) for row in np.c_[np.eye(9), -np.ones(9)]]
    assert len(possible_patterns(several)) == 2**9
