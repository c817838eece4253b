"""Models with many equilibria and no elimination: a chain of masses in double wells."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs

pytestmark = pytest.mark.slow


def chain(masses, coupling):
    """x'' + x'/10 = x − x³ + coupling · (neighbours), with free ends."""
    xs, vs = sp.symbols(f"x1:{masses + 1}"), sp.symbols(f"v1:{masses + 1}")
    c = sp.Symbol("c")
    rates = {}
    for k, (x, v) in enumerate(zip(xs, vs, strict=True)):
        springs = sum(c * (xs[m] - x) for m in (k - 1, k + 1) if 0 <= m < masses)
        rates[x], rates[v] = v, x - x**3 + springs - v / 10
    return fs.Model(rates, parameters={c: coupling})


def shooting(masses, coupling):
    """The number of equilibria: roots of the last equation over the position of the first mass."""
    first = np.linspace(-1.7, 1.7, 400_001) + 1e-7
    before, here = first, first - (first - first**3) / coupling
    with np.errstate(all="ignore"):
        for _ in range(masses - 2):
            before, here = here, here - (here - here**3) / coupling + (here - before)
        last = here - here**3 + coupling * (before - here)
    known = np.sign(last)
    return int(np.count_nonzero(known[1:] * known[:-1] < 0))


@pytest.mark.sample(1)
@pytest.mark.parametrize(("masses", "coupling", "count"), [(10, 1.0, 21), (5, 0.05, 3**5)])
def test_every_equilibrium_of_a_chain_of_masses_is_found(masses, coupling, count):
    """Weakly coupled each mass is in one of its three places, whatever the others do."""
    found = fs.equilibria(chain(masses, coupling))
    assert len(found) == count
    assert found.completeness == "found"
    if masses == 10:
        assert shooting(masses, coupling) == count
    states = np.array([e.state for e in found])
    apart = np.abs(states[:, None] - states[None]).max(axis=2) + np.eye(count)
    assert apart.min() > 1e-3
    assert max(e.residual for e in found) < 1e-12
    # with every equilibrium its mirror image
    assert all(np.abs(states + s).max(axis=1).min() < 1e-9 for s in states)
