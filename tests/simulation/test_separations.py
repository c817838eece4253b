"""Exponents of many runs at once, from the derivatives of their flow maps."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.simulation.separations import exponents

pytestmark = pytest.mark.slow


def test_linear_models_have_the_exponents_of_their_matrices():
    x, v, k, w, t = sp.symbols("x v k w t")
    model = fs.Model({x: -k * x + w, v: w - 3 * v}, forcing={w: sp.cos(t)}, parameters={k: 1})
    rates = np.array([0.25, 0.5, 2.0])
    times = np.array([[0.0, 10.0, 60.0], [0.0, 12.0, 50.0], [5.0, 10.0, 40.0]])
    found = exponents(
        model, np.zeros((3, 2)), {"k": rates}, times, fs.Integration(rtol=1e-10), fs.Execution()
    )
    # the norm of the first interval counts once
    assert found.value == pytest.approx(-rates, abs=0.04)
    assert found.spans[:, 1] - found.spans[:, 0] == pytest.approx(times[:, 2] - times[:, 1])
    assert found.final.shape == (3, 2)
    assert not found.ended
    assert found.sign(0) == -1
