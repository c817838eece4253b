"""The models of these tests: few structures, so that little is compiled."""

import pytest
import sympy as sp

from fastslow.model.model import Model

x, v, t, w = sp.symbols("x v t w")
A, B, C, D, omega = sp.symbols("A B C D omega")


@pytest.fixture(scope="session")
def gear():
    """The harmonic gear at the parameters of the reference trajectory P1."""
    dead_zone = sp.Piecewise((x - D, x > D), (x + D, x < -D), (0, True))
    return Model(
        {x: v, v: w - v - (x**2 + A) * dead_zone},
        forcing={w: B + C * sp.sin(omega * t)},
        parameters={A: 41.67, B: 2.372, C: 3.546, D: 0.25, omega: 0.01},
    )


@pytest.fixture(scope="session")
def linear():
    """x'' + k x = 0 with another k on each side of two interfaces, damped by c."""
    k1, k2, k3, c = sp.symbols("k1 k2 k3 c")
    force = sp.Piecewise((k1 * (x - D), x > D), (k3 * (x + D), x < -D), (k2 * x, True))
    return Model({x: v, v: -c * v - force}, parameters={k1: 1, k2: 0, k3: 1, c: 0, D: 0.25})


@pytest.fixture(scope="session")
def friction():
    """A driven oscillator with dry friction: x'' + x = a sin t - mu sign x'."""
    a, mu = sp.symbols("a mu")
    return Model({x: v, v: a * sp.sin(t) - x - mu * sp.sign(v)}, parameters={a: 0, mu: 0.3})
