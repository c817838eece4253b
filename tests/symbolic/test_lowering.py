"""Systems of lower degree have the solutions of the systems they replace."""

import itertools

import numpy as np
import pytest
import sympy as sp

from fastslow.model.structure import real
from fastslow.symbolic.solving.lowering import lower_degrees

X, Y, L = map(real, "xyL")

#: Solutions are counted modulo this prime.
PRIME = 31


def polynomial(generator, degree):
    terms = [X**i * Y**j for i in range(degree + 1) for j in range(degree + 1 - i)]
    return sp.Add(*(int(generator.integers(-4, 5)) * t for t in terms))


def solutions(system):
    """All of a system, modulo a prime."""
    each = [sp.Poly(e, X, Y, L, modulus=PRIME) for e in system]
    grids = np.meshgrid(*[np.arange(PRIME)] * 3, indexing="ij")
    zero = np.ones((PRIME,) * 3, dtype=bool)
    for poly in each:
        total = np.zeros_like(grids[0])
        for powers, c in poly.terms():
            term = np.full_like(total, int(c) % PRIME)
            for grid, power in zip(grids, powers, strict=True):
                for _ in range(power):
                    term = term * grid % PRIME
            total = (total + term) % PRIME
        zero &= total == 0
    return zero


@pytest.mark.parametrize("seed", range(12))
def test_the_same_solutions_of_lower_degree(seed):
    generator = np.random.default_rng(seed)
    first = L * polynomial(generator, 2) + polynomial(generator, 1)
    multiple = int(generator.integers(1, 4)) + int(generator.integers(1, 4)) * X + L
    # at one value of the parameter the second equation is a multiple of the first
    factors = [(L - 2) ** (seed % 3) * (X + 1), polynomial(generator, 1) + L * Y]
    second = sp.expand(multiple * first + sp.Mul(*factors[: 1 + seed % 2]))
    lowered = lower_degrees((first, second), (X, Y))
    assert lowered != [(first, second)]
    union = np.zeros((PRIME,) * 3, dtype=bool)
    for system in lowered:
        union |= solutions(system)
    assert np.array_equal(union, solutions((first, second)))

    def degree(system):
        return sum(sp.Poly(e, X, Y).total_degree() for e in system)

    assert max(map(degree, lowered)) < degree((first, second))


def test_systems_without_common_highest_terms_stay():
    for one, two in itertools.permutations((X**2 + Y - L, X * Y - 1, sp.exp(X) - Y), 2):
        assert lower_degrees((one, two), (X, Y)) == [(one, two)]
