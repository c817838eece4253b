"""Combinations of inequalities are simplified without changing their truth values."""

import itertools

import numpy as np
import pytest
import sympy as sp

from fastslow.model.structure import real
from fastslow.symbolic.signs.conditions import simplified

A, B, C = map(real, "ABC")
EXPRESSIONS = (A - B, B - A, 2 * A - 2 * B, C, -C + 1, C - 2, A * C - B, B - A * C, A**2 - 1)
VALUES = [sp.Rational(k, 2) for k in range(-3, 7)]


def random_condition(generator, depth):
    if depth == 0 or generator.random() < 0.3:
        expression = EXPRESSIONS[generator.integers(len(EXPRESSIONS))]
        relation = (sp.Gt, sp.Lt, sp.Ge, sp.Le, sp.Ne)[generator.integers(5)]
        return relation(expression, 0, evaluate=False)
    parts = [random_condition(generator, depth - 1) for _ in range(generator.integers(2, 4))]
    return (sp.And, sp.Or)[generator.integers(2)](*parts)


@pytest.mark.parametrize("seed", range(12))
def test_simplified_conditions_hold_at_the_same_points(seed):
    generator = np.random.default_rng(seed)
    condition = random_condition(generator, 3)
    short = simplified(condition)
    whole, shown = (sp.lambdify((A, B, C), c, "math") for c in (condition, short))
    for place in itertools.product(map(float, VALUES), repeat=3):
        assert bool(whole(*place)) == bool(shown(*place)), (condition, short, place)
    assert sp.count_ops(short) <= sp.count_ops(condition)


def test_contradictions_and_what_always_holds_are_decided():
    p = real("P")
    inner = (p > 0) | ((p > 0) & (A < B)) | (-p > 0)
    assert simplified((A > B) & (p > 0) & (B > A)) is sp.false
    assert simplified((A > B) & ((A < B) | (p > 0))) == (A > B) & (p > 0)
    assert simplified((A < B) | ((A >= B) & inner)) in (
        (A < B) | (p > 0) | (-p > 0),
        (A < B) | (p > 0) | (p < 0),
    )
