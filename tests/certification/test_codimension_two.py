"""Points of codimension two, proved: closed forms to 30 and 50 digits, and mpmath."""

from dataclasses import replace

import mpmath
import pytest
import sympy as sp

import fastslow as fs

pytestmark = pytest.mark.slow

pytest.importorskip("flint")

R = sp.Rational
v, w, x, y, z, p, q = sp.symbols("v w x y z p q")
P, Q = p - R(1, 3), q - R(1, 5)
PLANE = {"p": (-1, 2), "q": (-1, 2)}


def points(rates, label, *codes, over=PLANE, values=(0, 1)):
    """Model, and points of the curve through the first point of that label."""
    names = tuple(over)
    model = fs.Model(rates, parameters=dict(zip(names, values, strict=True)))
    diagram = fs.continue_equilibria(model, names[0], over[names[0]])
    curve = fs.continue_points(diagram[label], names, over=over)
    return model, [point for point in curve.special() if point.code in codes]


def agrees(enclosure, digits, **exact):
    """All values to that many digits, within their bounds."""
    assert enclosure.digits == digits
    with mpmath.workdps(digits + 10):
        for name, value in exact.items():
            value = mpmath.mpf(sp.N(value, digits + 10))
            assert abs(mpmath.mpf(enclosure[name]) - value) < mpmath.mpf(10) ** (1 - digits)
            assert enclosure.low[name] <= value <= enclosure.high[name]


@pytest.fixture(scope="module")
def fitzhugh():
    """FitzHugh-Nagumo over current p and recovery q, in a time scale of 4."""
    rates = {v: v - v**3 / 3 - w + p, w: R(1, 4) * (v + R(7, 10) - q * w)}
    plane = {"p": (-3, 3), "q": (0.5, 4)}
    return points(rates, "LP1", "BT", "CP", over=plane, values=(0, 2.5))


@pytest.mark.parametrize("digits", [30, 50])
def test_bogdanov_takens_points_and_the_cusp_of_fitzhugh(fitzhugh, digits):
    # trace 1 − v² − q/4 and determinant (1 − q (1 − v²))/4 vanish at q = 2, v = ±√½; cusp at v = 0
    model, found = fitzhugh
    assert [point.code for point in found] == ["BT", "CP", "BT"]
    for point, at in zip(found, (sp.sqrt(2) / 2, sp.S.Zero, -sp.sqrt(2) / 2), strict=True):
        proof = fs.prove(model, point, digits=digits).enclosure
        slope = R(2) if at else R(1)
        second = (at + R(7, 10)) / slope
        exact = {"v": at, "w": second, "q": slope, "p": second - at + at**3 / 3}
        agrees(proof, digits, **exact)
        assert proof.unique_within > 0.01
        assert proof.regular.endswith("unfolded by both parameters")
        assert proof["v"] != "0" or point.code == "CP"


def test_a_cusp_without_closed_form():
    model, (cusp,) = points({x: p + q * x - x**3 + sp.exp(x) / 10}, "LP1", "CP")
    found = fs.prove(model, cusp, digits=30).enclosure
    with mpmath.workdps(40):
        # the third equation alone, −6 x + eˣ/10 = 0
        at = mpmath.findroot(lambda t: mpmath.exp(t) / 10 - 6 * t, 0.017)
        slope = 3 * at**2 - mpmath.exp(at) / 10
        exact = {"x": at, "q": slope, "p": at**3 - slope * at - mpmath.exp(at) / 10}
        for name, value in exact.items():
            assert abs(mpmath.mpf(found[name]) - value) < 1e-30


def test_a_bogdanov_takens_point_on_a_curve_of_hopf_points():
    # the Jacobian there is [[0, 1], [3e-17, 0]], of which a row is rounding error
    rates = {x: y, y: p + q * y + x**2 + x * y + sp.exp(x) / 10}
    plane = {"p": (-1, 1), "q": (-2, 2)}
    model, (point,) = points(rates, "HB1", "BT", over=plane, values=(-0.5, 0.5))
    found = fs.prove(model, point, digits=30).enclosure
    with mpmath.workdps(40):
        at = mpmath.findroot(lambda t: 2 * t + mpmath.exp(t) / 10, -0.05)
        assert abs(mpmath.mpf(found["x"]) - at) < 1e-30
        assert abs(mpmath.mpf(found["q"]) + at) < 1e-30
    assert found["y"] == "0"


SIZE = y**2 + z**2
#: Models, points from which the curve is traced, and the point at P = Q = 0 by code.
NORMAL_FORMS = {
    "GH": (
        {
            y: P * y - 2 * z + Q * y * SIZE - y * SIZE**2,
            z: 2 * y + P * z + Q * z * SIZE - z * SIZE**2,
        },
        "HB1",
    ),
    "ZH": (
        {x: P - x**2 + SIZE / 3, y: (Q + x) * y - 2 * z, z: 2 * y + (Q + x) * z - z * SIZE},
        "LP1",
    ),
    "HH": (
        {
            v: P * v - 2 * w - v**3,
            w: 2 * v + P * w - w**3,
            y: Q * y - 3 * z - y**3 + v**2 / 4,
            z: 3 * y + Q * z - z**3,
        },
        "HB1",
    ),
    "BH": ({x: P - x - sp.Abs(x - Q) / 3, y: x * y - 2 * z - y**3, z: 2 * y + x * z}, "BE1"),
}


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    "code",
    [pytest.param(c, marks=pytest.mark.slow if c in ("GH", "HH") else ()) for c in NORMAL_FORMS],
)
def test_normal_forms(code):
    rates, label = NORMAL_FORMS[code]
    model, found = points(rates, label, code)
    assert found
    for point in found:
        proof = fs.prove(model, point, digits=30).enclosure
        agrees(proof, 30, **{state.name: 0 for state in rates}, p=R(1, 3), q=R(1, 5))
        assert proof.unique_within > 1e-3


def test_a_fold_on_an_interface():
    # P − x² ∓ (x − Q)/3 at x = q
    model, found = points({x: P - x**2 + sp.Abs(x - q) / 3}, "BE1", "BF")
    for point, sign in zip(found, (-1, 1), strict=True):
        proof = fs.prove(model, point, digits=30).enclosure
        agrees(proof, 30, x=R(sign, 6), q=R(sign, 6), p=R(1, 3) + R(1, 36))


def test_points_of_another_codimension_name_what_is_free(fitzhugh):
    model, (point, *_) = fitzhugh
    with pytest.raises(fs.ArgumentError, match="expected a point LP of a diagram over one"):
        fs.prove(model, replace(point, code="LP"))
