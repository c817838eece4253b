"""Test functions that vanish along whole branches and curves: one sentence, and no points."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs

pytestmark = pytest.mark.slow

a, b = sp.symbols("a b")
X = sp.symbols("x y z")


#: Rotations by Pythagorean triples, whose products are rounded in decimals.
TURNS = [(0.6, 0.8), (0.28, 0.96), (0.96, -0.28)]


def turned(rates, number):
    """Return rates with their last two coordinates turned."""
    cosine, sine = map(sp.Float, TURNS[number])
    first, second = X[len(rates) - 2 : len(rates)]
    new = sp.symbols("v1 v2")
    old = {first: cosine * new[0] + sine * new[1], second: -sine * new[0] + cosine * new[1]}
    one, other = (r.subs(old) for r in rates[-2:])
    others = zip(X, (r.subs(old) for r in rates[:-2]), strict=False)
    return {
        **dict(others),
        new[0]: cosine * one - sine * other,
        new[1]: sine * one + cosine * other,
    }


def codes(diagram):
    return sorted(p.code for p in diagram.special() if p.code != "EP")


def traced(rates, low, high, **more):
    model = fs.Model(rates, parameters={"a": 0.5 * (low + high), **more})
    return fs.continue_equilibria(model, "a", over=(low, high))


def more_pairs_than_usual(point):
    """Return whether a second pair of eigenvalues has the sum zero."""
    values = point.eigenvalues
    sums = np.add.outer(values, values)[np.triu_indices(len(values), 1)]
    return np.count_nonzero(np.abs(sums) < 1e-4) > 1


@pytest.mark.sample(1)
@pytest.mark.parametrize("width", [0.3, 0.7, 1.1])
def test_eigenvalues_of_opposite_sign_all_along(width):
    x, y, z = X
    # on x = −a/w, y = 0, z = x the eigenvalues are a, −a, −1
    rates = {x: -a * x - b * x**2 + y**2 / 3, y: -a * y - x * y**2, z: x - z}
    diagram = traced(rates, -1.0, 2.0, b=width)
    for point in diagram.special():
        if point.code in ("HB", "NSD") and abs(point.state[1]) < 1e-9:
            assert more_pairs_than_usual(point), point
    assert "the sum of two eigenvalues is zero to rounding" in str(diagram.outcome)


@pytest.mark.sample(1)
@pytest.mark.parametrize("number", range(3))
def test_two_eigenvalues_that_vanish_together_are_no_hopf_point(number):
    x, y, _ = X
    rates = turned((-a * x - 0.7 * x**2, -a * y + y**3 + x * y**2), number)
    assert not {"HB", "NSD"} & set(codes(traced(rates, -1.0, 2.0)))


def test_a_hopf_point_beside_an_opposite_pair_is_found():
    x, y, _ = X
    u, v = sp.symbols("u v")
    pair = {u: (2 + u * v) * u, v: -2 * v}
    rates = {x: a * x - y - x**3, y: x + a * y - y**3, **pair}
    diagram = traced(rates, -1.0, 1.0)
    hopf = [p for p in diagram.special("HB") if np.abs(p.state).max() < 1e-9]
    assert len(hopf) == 1
    assert abs(hopf[0]["a"]) < 1e-12
    assert abs(hopf[0].frequency - 1) < 1e-12


@pytest.mark.sample(1)
@pytest.mark.parametrize("number", range(3))
def test_curves_through_one_point_by_symmetry_have_no_hopf_point(number):
    x, y, _ = X
    # z' = a z + conj(z)², symmetric under rotation by 120 degrees: four curves meet at a = 0
    rates = (a * x + x**2 - y**2, a * y - 2 * x * y)
    diagram = traced(turned(rates, number), -1.0, 2.0)
    assert not {"HB", "NSD"} & set(codes(diagram))
    assert "two eigenvalues vanish there" in str(diagram.outcome)


def test_a_circle_of_equilibria_has_no_branch_points():
    x, y, _ = X
    radius = x**2 + y**2
    model = fs.Model({x: a * x - x * radius, y: a * y - y * radius}, parameters={a: 0.5})
    on_circle = {"x": 1.0, "y": 0.0, "a": 1.0}
    diagram = fs.continue_equilibria(model, "a", (0.5, 2), from_points=[on_circle])
    assert "BP" not in codes(diagram)
    assert "equilibria are not isolated" in str(diagram.outcome)


def test_a_curve_of_folds_with_opposite_eigenvalues():
    x, y, z = X
    rates = {x: a - x**2 + b * x, y: (1 + x**2) * y, z: -(1 + x**2) * z + y * z}
    diagram = traced(rates, -1.0, 2.0, b=0.1)
    (fold,) = diagram.special("LP")
    curve = fs.continue_points(fold, ("a", "b"), over={"a": (-1, 2), "b": (-0.5, 0.5)})
    assert [p.code for p in curve.special] == []
    assert "vanishes along the curve" in str(curve.outcomes[0])
