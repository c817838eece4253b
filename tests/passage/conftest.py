"""Diagrams with the special points that are passed slowly, traced once."""

import pytest
import sympy as sp

import fastslow as fs


@pytest.fixture(scope="session")
def cusp():
    """Frozen x' = p + q x − x³ at q = 1."""
    return fs.systems.cusp().frozen()


@pytest.fixture(scope="session")
def cusp_fold(cusp):
    """Its fold at x = −1/√3, where p rises off the lower branch."""
    diagram = fs.continue_equilibria(cusp, "p", over=(-1, 1))
    return next(f for f in diagram.folds if f["x"] < 0)


@pytest.fixture(scope="session")
def corner():
    """x' = b p + h x with slopes k < 0 on x < 0 and u > 0 on x > 0."""
    x, p, b, k, u = sp.symbols("x p b k u")
    slope = sp.Piecewise((u * x, x > 0), (k * x, True))
    return fs.Model({x: b * p + slope}, parameters={p: -1, b: 1, k: -1, u: 1})


@pytest.fixture(scope="session")
def gap():
    """A body with damping c that is pushed through a gap between linear contacts."""
    x, v, w, b, c, k, D = sp.symbols("x v w b c k D")
    contact = sp.Piecewise((x - D, x > D), (x + D, x < -D), (0, True))
    values = {w: 0, b: 1, c: 1, k: 4, D: 0.25}
    return fs.Model({x: v, v: b * w - c * v - k * contact}, parameters=values)


@pytest.fixture(scope="session")
def turning():
    """The Hopf normal form (p + i) z − |z|² z."""
    x, y, p = sp.symbols("x y p")
    size = x**2 + y**2
    return fs.Model({x: p * x - y - x * size, y: x + p * y - y * size}, parameters={p: 0})
