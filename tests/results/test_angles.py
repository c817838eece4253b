"""Values modulo a period."""

import numpy as np
import pytest

from fastslow.results.angles import principal


@pytest.mark.parametrize("period", [0.3, 2 * np.pi, 360.0])
def test_the_principal_range_holds_one_copy_and_its_upper_end(period):
    values = period * np.array([-1.75, -0.5, -0.25, 0.0, 0.25, 0.5, 1.75])
    found = principal(values, period)
    expected = period * np.array([0.25, 0.5, -0.25, 0.0, 0.25, 0.5, -0.25])
    np.testing.assert_allclose(found, expected, atol=1e-15 * period)
    np.testing.assert_array_equal(principal(values, 0.0), values)
