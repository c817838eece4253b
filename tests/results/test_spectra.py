"""Amplitudes of spectra: sums of cosines at the centres of bins."""

import math

import numpy as np
import pytest
import sympy as sp

import fastslow as fs

x, v = sp.symbols("x v")


def cosine(frequency):
    """x = cos(frequency t) for two turns of t."""
    model = fs.Model({x: frequency * v, v: -frequency * x})
    fine = fs.Integration(rtol=1e-14)
    return fs.simulate(model, [1, 0], t=(0, 4 * math.pi), integration=fine)


@pytest.mark.parametrize("samples", [16, 17])
@pytest.mark.parametrize("frequency", [1, 3, 4])
def test_every_line_has_its_amplitude(frequency, samples):
    """Also at the Nyquist frequency, half the number of samples, which is its own mirror image."""
    spectrum = cosine(frequency).spectrum("x", taper="rectangular", samples=samples)
    expected = np.zeros(samples // 2 + 1)
    expected[2 * frequency] = 1.0
    np.testing.assert_allclose(spectrum.amplitude, expected, atol=1e-9)
    np.testing.assert_allclose(spectrum.angular, np.arange(samples // 2 + 1) / 2, rtol=1e-14)
