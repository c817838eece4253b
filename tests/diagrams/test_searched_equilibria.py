"""Equilibria that are searched for, in models of many states, against other solutions."""

import numpy as np
import pytest
import sympy as sp
from scipy.optimize import brentq, root

import fastslow as fs

pytestmark = pytest.mark.slow

SEED = 20261123


def repressilator(exponent, level, leak):
    """Elowitz and Leibler (2000), with the exponent as a parameter."""
    m, p = sp.symbols("m1:4"), sp.symbols("p1:4")
    n, alpha = sp.symbols("n alpha")
    rates = {m[i]: -m[i] + alpha / (1 + p[i - 1] ** n) + leak for i in range(3)}
    rates |= {p[i]: (m[i] - p[i]) / 5 for i in range(3)}
    return fs.Model(rates, parameters={alpha: level, n: exponent})


@pytest.mark.sample(0)
@pytest.mark.parametrize("n", [7.5, 10, 20])
def test_steep_repressilators_of_random_levels_have_their_equilibrium(n):
    """All six states are equal to the root of a/(1 + s**n) + b − s: 1e-10."""
    model = repressilator(10, 216, 0.216)
    level = float(10 ** np.random.default_rng(SEED).uniform(1, 3.5))
    found = fs.equilibria(model, n=n, alpha=level)
    known = brentq(lambda s: level / (1 + s**n) + 0.216 - s, 0.2, 2 * level, xtol=1e-14)
    positive = [e.state for e in found if (e.state > 0).all()]
    assert len(positive) == 1
    np.testing.assert_allclose(positive[0], known, rtol=1e-10)


def switches(exponent):
    """Three genetic toggle switches, each driven weakly by the one before."""
    u, v, a = sp.symbols("u1:4"), sp.symbols("v1:4"), sp.Symbol("a")
    rates = {u[i]: a / (1 + v[i] ** exponent) - u[i] + u[i - 1] / 20 for i in range(3)}
    rates |= {v[i]: a / (1 + u[i] ** exponent) - v[i] for i in range(3)}
    return fs.Model(rates, parameters={a: 5})


@pytest.mark.sample(1)
@pytest.mark.parametrize("exponent", [9, 10])
def test_coupled_switches_have_all_equilibria_that_random_starts_find(exponent):
    """27 positive equilibria; SciPy's hybrid method from 400 random starts finds no other."""
    model = switches(exponent)
    found = fs.equilibria(model)
    assert found.completeness == "found"
    states = np.array([e.state for e in found if (e.state > 0).all()])
    assert len(states) == 27

    def rates(z):
        u, v = z[:3], z[3:]
        one = 5 / (1 + v**exponent) - u + np.roll(u, 1) / 20
        return np.concatenate([one, 5 / (1 + u**exponent) - v])

    assert list(model.states) == ["u1", "u2", "u3", "v1", "v2", "v3"]
    assert max(np.abs(rates(s)).max() for s in states) < 1e-12
    generator = np.random.default_rng(SEED)
    seen = set()
    with np.errstate(all="ignore"):
        for start in 10.0 ** generator.uniform(-3, 1, (400, 6)):
            solved = root(rates, start, tol=1e-12)
            if solved.success and (solved.x > 0).all() and np.abs(rates(solved.x)).max() < 1e-10:
                gap = np.abs(states - solved.x).max(axis=1)
                assert gap.min() < 1e-7
                seen.add(int(gap.argmin()))
    assert len(seen) > 10


def test_a_branch_of_a_steep_repressilator():
    """Along the branch a = (s − b) (1 + s**n), in closed form: 1e-10."""
    model = repressilator(20, 216, 0.216)
    diagram = fs.continue_equilibria(model, "alpha", over=(20, 400), window={"p1": (0, None)})
    (branch,) = diagram.branches
    s = branch["p1"]
    np.testing.assert_allclose((s - 0.216) * (1 + s**20), branch.values, rtol=1e-10)
    assert branch.values.min() == 20
    assert branch.values.max() == 400
