"""Resultants and discriminants against those of SymPy."""

import random

import pytest
from sympy.polys.domains import ZZ
from sympy.polys.rings import ring

from fastslow.diagrams.solve.resultants import discriminant, resultant

PLANE = ring("x, p", ZZ)[0]


def polynomial(generator, degree, powers):
    """Terms of a random polynomial in x and p, of a degree in x, with sizes over many decades."""
    places = [(i, k) for i in range(degree) for k in range(powers + 1)]
    chosen = [*generator.sample(places, generator.randint(1, len(places))), (degree, 0)]
    return {e: generator.choice((-1, 1)) * generator.randint(1, 10**12) for e in chosen}


def in_plane(terms):
    return PLANE.from_dict({e: ZZ(c) for e, c in terms.items()})


def coefficients(found):
    """Over the parameter, the highest first, with a positive one first: signs are conventions."""
    powers = {e[-1]: int(c) for e, c in found.items()}
    return positive([powers.get(k, 0) for k in range(max(powers, default=-1), -1, -1)])


def positive(numbers):
    return [-c for c in numbers] if numbers and numbers[0] < 0 else numbers


@pytest.mark.parametrize("seed", range(40))
def test_they_are_those_of_sympy_up_to_their_sign(seed):
    generator = random.Random(seed)
    one = polynomial(generator, generator.randint(1, 5), generator.randint(0, 3))
    other = polynomial(generator, generator.randint(1, 4), generator.randint(0, 2))
    expected = coefficients(in_plane(one).resultant(in_plane(other)))
    assert positive(resultant(one, other)) == positive(resultant(other, one)) == expected
    square = polynomial(generator, generator.randint(2, 5), generator.randint(0, 3))
    assert positive(discriminant(square)) == coefficients(in_plane(square).discriminant())


def test_common_and_double_roots_for_every_parameter_give_zero():
    factor = {(1, 0): 1, (0, 1): -1}
    assert resultant(factor, {(2, 0): 1, (0, 2): -1}) == []
    assert discriminant({(2, 0): 1, (1, 1): -2, (0, 2): 1}) == []


def test_a_pivot_that_vanishes_is_exchanged():
    # x³ − p has no lower powers: Bézout's matrix with its slope begins with zeros
    assert positive(discriminant({(3, 0): 1, (0, 1): -1})) == [27, 0, 0]
