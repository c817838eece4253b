"""Pseudo-arclength continuation of curves whose tangents are null vectors."""

import numpy as np
import pytest

from fastslow.continuation import curves
from fastslow.continuation.settings import Continuation


class Circle(curves.System):
    """x² + y² = 1, whose derivative is computed by differences."""

    def residual(self, z, guide):
        return z[..., :1] ** 2 + z[..., 1:2] ** 2 - 1.0


@pytest.mark.parametrize("seed", range(3))
def test_steps_do_not_depend_on_the_signs_of_null_vectors(monkeypatch, seed):
    """Their signs depend on the build of LAPACK; the curve is traced in the direction given."""
    frame = curves.Frame(2, np.ones(2), np.full(2, -2.0), np.full(2, 2.0))
    start, direction = np.array([1.0, 0.0]), np.array([0.0, 1.0])
    traced = curves.follow(Circle(), start, direction, frame, Continuation())
    random, null_vector = np.random.default_rng(seed), curves.tangent
    monkeypatch.setattr(
        curves, "tangent", lambda *given: random.choice([-1.0, 1.0]) * null_vector(*given)
    )
    again = curves.follow(Circle(), start, direction, frame, Continuation())
    for one, other in zip(traced, again, strict=True):
        np.testing.assert_array_equal(one, other)
    rows, tangents, status = traced
    assert status == curves.CLOSED
    assert np.abs(np.hypot(*rows.T) - 1).max() < 1e-14
    turned = np.column_stack([-rows[:, 1], rows[:, 0]])
    assert np.abs(tangents - turned).max() < 1e-8
    # steps of 0.01 that grow to 0.02
    assert len(rows) < 330
