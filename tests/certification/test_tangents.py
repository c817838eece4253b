"""Enclosures of tangents of curves in boxes, against tangents known from the construction."""

import numpy as np
import pytest
import sympy as sp

from fastslow.certification.boxes.linking import IntervalProblem
from fastslow.certification.boxes.pruning import workspace
from fastslow.kernels.intervals.printer import interval_program

pytestmark = pytest.mark.slow

z = sp.symbols("x y p", real=True)


def system(random):
    """Two quadratic functions that vanish at 0, and a tangent there of integers, some zero."""
    while True:
        rows = random.integers(-3, 4, (2, 3))
        tangent = np.cross(*rows)
        if tangent.any():
            break
    bent = random.integers(-4, 5, (2, 3, 3)) / 4
    functions = [
        sum(int(a) * u for a, u in zip(row, z, strict=True))
        + sum(sp.Rational(b) * u * v for b, (u, v) in zip(form.ravel(), pairs(), strict=True))
        for row, form in zip(rows, bent, strict=True)
    ]
    return functions, tangent


def pairs():
    return [(u, v) for u in z for v in z]


def test_tangents_are_enclosed_and_unbounded_where_the_free_unknown_is_level():
    """Boxes of one system in turn, so that each is independent of those before it."""
    random, bounded, level = np.random.default_rng(5), 0, 0
    for _ in range(150):
        functions, tangent = system(random)
        problem = IntervalProblem(interval_program(functions, z), None, (), -np.ones(3), np.ones(3))
        free = random.integers(0, 3, 12)
        radius = 10.0 ** random.uniform(-6, -0.5, (12, 1)) * random.uniform(0.5, 2, (12, 3))
        boxes = problem.enclosed(workspace(problem.program), free, -radius, radius)
        assert ((boxes.low <= 0) & (boxes.high >= 0)).all()
        for k, low, high in zip(free, boxes.tangent_low, boxes.tangent_high, strict=True):
            if tangent[k] == 0:
                level += 1
                assert (low == -np.inf).all()
                assert (high == np.inf).all()
            else:
                bounded += np.isfinite(low).all()
                assert (low <= tangent / tangent[k]).all()
                assert (tangent / tangent[k] <= high).all()
    assert bounded > 500
    assert level > 100
