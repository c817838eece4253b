"""Derivatives of equilibria and special points, against closed forms and differences."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs

pytestmark = pytest.mark.slow

x, v, p, q, r, k, F, s = sp.symbols("x v p q r k F s")


def test_an_equilibrium_in_closed_form():
    model = fs.Model({x: p - q * x**3}, parameters={p: 2, q: 3})
    (point,) = fs.equilibria(model)
    root = (2 / 3) ** (1 / 3)
    assert point["x"] == pytest.approx(root, rel=1e-14)
    assert point.gradient("p")["x"] == pytest.approx(1 / (9 * root**2), rel=1e-13)
    assert point.gradient(q)["x"] == pytest.approx(-root / 9, rel=1e-13)


def test_rates_over_six_decades():
    model = fs.Model({x: 1e6 * (p - x), v: 1e-6 * (x - q * v)}, parameters={p: 1, q: 4})
    (point,) = fs.equilibria(model)
    np.testing.assert_allclose([*point.gradient("p").values()], [1, 1 / 4], rtol=1e-14)
    np.testing.assert_allclose([*point.gradient("q").values()], [0, -1 / 16], atol=1e-15)


def test_a_fold_a_cusp_and_their_neighbours():
    # folds at x = ±√(q/3), p = ∓2 (q/3)^(3/2) for x' = p + q x − x³
    model = fs.Model({x: p + q * x - x**3}, parameters={p: 0, q: 3})
    diagram = fs.continue_equilibria(model, "p", (-3, 3))
    for fold in diagram.folds:
        found = fold.gradient("q")
        assert found["x"] == pytest.approx(np.sign(fold["x"]) / 6, abs=1e-8)
        assert found["p"] == pytest.approx(-fold["x"], abs=1e-8)
        (same,) = (e for e in fs.equilibria(model, p=2.0) if abs(e["x"] + 1) > 0.1)
        assert same.gradient("q")["x"] == pytest.approx(2 / 9, rel=1e-12)
    curve = fs.continue_points(diagram.folds[0], ("p", "q"), over={"p": (-3, 3), "q": (-1, 4)})
    with pytest.raises(fs.errors.ArgumentError, match=r"CP1 .* has no derivative by one parameter"):
        curve.special("CP")[0].gradient("q")
    singular = [e for e in fs.equilibria(model, p=2.0) if abs(e["x"] + 1) < 0.1]
    for point in singular:
        with pytest.raises(fs.errors.ArgumentError, match="Jacobian is singular"):
            point.gradient("q")


def test_a_hopf_point_of_the_brusselator():
    # B = 1 + A² at x = A
    y, A, B = sp.symbols("y A B")
    rates = {x: A - (B + 1) * x + x**2 * y, y: B * x - x**2 * y}
    diagram = fs.continue_equilibria(fs.Model(rates, parameters={A: 1.3, B: 2}), "B", (1, 4))
    found = diagram.special("HB")[0].gradient("A")
    assert found["B"] == pytest.approx(2.6, rel=1e-8)
    assert found["x"] == pytest.approx(1, rel=1e-8)
    # y = B/A = 1/A + A
    assert found["y"] == pytest.approx(1 - 1 / 1.69, rel=1e-8)


def test_the_boundary_equilibria_and_folds_of_the_gear():
    def labelled(**changes):
        model = fs.systems.harmonic_gear(**{"A": -0.6, **changes})
        diagram = fs.continue_equilibria(model.frozen(), "w", (-6, 6))
        return {point.label: point for b in diagram.branches for point in b.special}

    points, D = labelled(), fs.systems.harmonic_gear().parameters["D"]
    near, far = labelled(D=D + 1e-4), labelled(D=D - 1e-4)
    for label in ("LP1", "LP2", "BE1", "BE2"):
        expected = (near[label]["w"] - far[label]["w"]) / 2e-4
        assert points[label].gradient("D")["w"] == pytest.approx(expected, abs=1e-7)


def test_held_at_a_wall():
    # held for F > k s; x = s
    rates = {x: v, v: F - k * x - v}
    model = fs.Model(rates, parameters={k: 2, s: 0.4, F: 1.5}, resets={x >= s: {v: -v / 2}})
    (held,) = fs.equilibria(model)
    assert held.gradient("s")["x"] == pytest.approx(1, rel=1e-14)
    assert held.gradient("F")["x"] == 0
    diagram = fs.continue_equilibria(model, "F", (0, 2))
    (lift_off,) = diagram.special("BE")
    assert lift_off.gradient("s")["F"] == pytest.approx(2, rel=1e-9)
    assert lift_off.gradient("k")["F"] == pytest.approx(0.4, rel=1e-9)


def test_an_isolated_branch_point_does_not_persist():
    # the transcritical point of q = 0 is split by q
    model = fs.Model({x: p * x - x**2 + q}, parameters={p: 1, q: 0})
    diagram = fs.continue_equilibria(model, "p", (-1, 1))
    (point,) = diagram.special("BP")
    with pytest.raises(fs.errors.ArgumentError, match="isolated: it does not persist"):
        point.gradient("q")
    shifted = fs.Model({x: (p - r) * x - x**2}, parameters={p: 1, r: 0.25})
    (point,) = fs.continue_equilibria(shifted, "p", (-1, 1)).special("BP")
    assert point.gradient("r")["p"] == pytest.approx(1, rel=1e-8)


def test_points_without_a_model(tmp_path):
    model = fs.Model({x: p + q * x - x**3}, parameters={p: 0, q: 3})
    diagram = fs.continue_equilibria(model, "p", (-3, 3))
    diagram.save(tmp_path / "d.npz")
    with pytest.raises(fs.errors.ArgumentError, match="no model"):
        fs.load(tmp_path / "d.npz").folds[0].gradient("q")
    with pytest.raises(fs.errors.ArgumentError, match="which is determined"):
        diagram.folds[0].gradient("p")
    with pytest.raises(fs.errors.UnknownNameError):
        diagram.folds[0].gradient("z")
