"""The window of a diagram around the equilibria that are known."""

import numpy as np
import pytest

from fastslow.results.branch.windows import state_window


@pytest.mark.parametrize("size", [1.0, 1e6, 1e-6])
def test_the_core_leaves_out_what_is_far_but_not_what_is_near(size):
    """Distances of a tenth of a millionth count, and rounding does not."""
    points = size * np.array([[1 - 1e-7], [1], [1 + 1e-7], [1 + 1e-3]])
    (core,) = state_window(("x",)).around(points).core
    assert core == pytest.approx((size * (1 - 1e-7), size * (1 + 8.5e-7)), rel=1e-12)
    rounded = size * np.array([[1 - 1e-15], [1], [1 + 1e-15], [1 + 1e-3]])
    (core,) = state_window(("x",)).around(rounded).core
    assert core == pytest.approx((size, size * (1 + 1e-3)), rel=1e-12)
