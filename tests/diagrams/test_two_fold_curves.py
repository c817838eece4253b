"""Curves of two-folds in the plane of two parameters, against closed forms."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def ocean():
    """Convection with a jump in the exchange (Welander 1982; Leifeld 2018).

    T' = 1 − T − k T, S' = β (1 − S) − k S with k = 0 or 1 where S − α T is below or above ε,
    α = 4/5. On S − α T = ε the drifts differ by ε: the two-fold has ε = 0,
    T = (α − β)/(α (1 − β)), S = α T, and k = β (1 − α)/(α − β) between both fields.
    """
    T, S, e, beta = sp.symbols("T S e beta")
    k = sp.Piecewise((1, S - sp.Rational(4, 5) * T > e), (0, True))
    model = fs.Model({T: 1 - T - k * T, S: beta * (1 - S) - k * S}, parameters={e: 0, beta: 0.5})
    return fs.continue_equilibria(model, "e", (-0.1, 0.1))


@pytest.fixture(scope="module")
def curve(ocean):
    over = {"e": (-0.1, 0.1), "beta": (0.2, 0.75)}
    return fs.continue_points(ocean.special("TF")[0], ("e", "beta"), over)


def test_the_two_folds_of_welanders_ocean_box(curve):
    assert curve.code == "TF"
    assert [o.code for o in curve.outcomes] == ["end of range"] * 2
    beta = curve["beta"]
    assert [beta.min(), beta.max()] == [0.2, 0.75]
    np.testing.assert_allclose(curve["e"], 0.0, atol=1e-13)
    T = (0.8 - beta) / (0.8 * (1.0 - beta))
    np.testing.assert_allclose(curve["T"], T, atol=1e-11)
    np.testing.assert_allclose(curve["S"], 0.8 * T, atol=1e-11)


@pytest.mark.parametrize("sign", [1, -1])
def test_a_diagram_does_not_depend_on_the_sign_of_a_named_interface(sign):
    """Nothing is detected at the two-fold, where the sliding vector field is 0/0."""
    T, S, e = sp.symbols("T S e")
    h = S - sp.Rational(4, 5) * T - e
    k = sp.Piecewise((5, h > 0), (0, True))
    model = fs.Model(
        {T: 1 - T - k * T, S: sp.Rational(1, 2) * (1 - S) - k * S},
        parameters={e: 0},
        interfaces={"convection": sign * h},
    )
    diagram = fs.continue_equilibria(model, "e", (-0.1, 0.3))
    codes = [[point.code for point in branch.special] for branch in diagram]
    assert codes == [["EP", "BE", "LP", "TF", "EP"], ["EP", "TF", "BE", "EP"]]
    # no rows between the two-fold and the first step
    assert [len(branch) for branch in diagram] == [40, 46]


def test_fields_in_one_direction_make_the_two_fold_virtual(ocean, curve):
    """k = β (1 − α)/(α − β) is between 0 and 1 up to β = α/(2 − α) = 2/3."""
    assert 0 < np.count_nonzero(curve.admissible) < len(curve.admissible)
    np.testing.assert_array_equal(curve.admissible, curve["beta"] <= 2 / 3)
    over = {"e": (-0.1, 0.1), "beta": (0.2, 0.75)}
    kept = fs.continue_points(ocean.special("TF")[0], ("e", "beta"), over, virtual=False)
    assert kept["beta"].max() == pytest.approx(2 / 3, abs=1e-12)
    assert [o.code for o in kept.outcomes] == ["end of range", "left the region"]
    # at k = 1 the field above is zero
    assert "an equilibrium of region" in str(kept.outcomes[1])
    assert kept.admissible.all()


def test_a_diagram_has_each_curve_of_two_folds_once(ocean):
    curves = fs.continue_points(
        ocean, ("e", "beta"), {"e": (-0.1, 0.1), "beta": (0.2, 0.75)}, code="TF"
    )
    assert [c.code for c in curves] == ["TF"]
    # ε is zero to rounding along the curve, which counts for nothing in the cubics between rows
    for beta in (0.3, 0.4, 0.55, 0.7):
        (point,) = curves[0].at(beta=beta)
        assert point["T"] == pytest.approx((0.8 - beta) / (0.8 * (1 - beta)), abs=1e-12)


@pytest.mark.sample(0)
@pytest.mark.parametrize("unit", [1, 10**6])
def test_the_two_fold_of_a_boost_converter(unit):
    """Sliding-mode control with a washout filter (Cristiano, Ponce, Pagano & Granzotto 2019).

    x' = 1 − b x − u y, y' = u x − a y, z' = ω (x − z), u = 1 or 0 as y − y_r + k (x − z)
    is negative or positive. The pseudo-equilibrium has y = y_r, x = z, b x² − x + a y_r² = 0,
    for all k; it is a two-fold at k = x/y_r.
    """
    x, y, z, k, r = sp.symbols("x y z k r")
    a, b, omega = sp.Rational(1, 2), sp.Rational(1, 10), sp.Rational(3, 10)
    u = sp.Piecewise((0, y / unit - r + k * (x - z) > 0), (1, True))
    model = fs.Model(
        {x: 1 - b * x - u * y / unit, y: unit * (u * x - a * y / unit), z: omega * (x - z)},
        parameters={k: 0.5, r: sp.Rational(3, 2)},
    )

    def current(r):
        return (1 - np.sqrt(1 - 0.2 * r**2)) / 0.2

    diagram = fs.continue_equilibria(model, "k", (0.2, 1.5))
    points = diagram.special("TF")
    assert points
    for point in points:
        assert point["k"] == pytest.approx(current(1.5) / 1.5, rel=1e-11)
        assert point["x"] == pytest.approx(current(1.5), rel=1e-11)
        assert point["y"] == pytest.approx(1.5 * unit, rel=1e-11)
    curve = fs.continue_points(points[0], ("k", "r"), {"k": (0.2, 1.5), "r": (0.5, 2.0)})
    assert [o.code for o in curve.outcomes] == ["end of range"] * 2
    np.testing.assert_allclose(curve["k"], current(curve["r"]) / curve["r"], rtol=1e-10)
    np.testing.assert_allclose(curve["x"], current(curve["r"]), rtol=1e-10)
    # u = a r/x is below 1 where the converter raises the voltage: r (1 + a b) > 1
    np.testing.assert_array_equal(curve.admissible, curve["r"] >= 20 / 21)
    assert 0 < np.count_nonzero(curve.admissible) < len(curve.admissible)
