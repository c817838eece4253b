"""Normal forms of codimension-two points, from systems built of them and seen in other ways."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.diagrams.field import FrozenField
from fastslow.diagrams.points.center_manifolds import (
    bogdanov_takens,
    double_hopf,
    double_hopf_case,
    generalized_hopf,
    zero_hopf,
    zero_hopf_case,
)
from fastslow.diagrams.points.codimension_two import _form
from fastslow.diagrams.points.jets import JetSpace

pytestmark = pytest.mark.slow

u = sp.symbols("u0:5", real=True)
p, q = sp.symbols("p q", real=True)


def hidden(rates):
    """A system seen through a nonlinear change of states and a linear map, with one more state.

    The states are L y with y = x but for y₀ = x₀ + x₁ x₂/2, where x₂ is the last state,
    stable and driven. Time runs 1 + p times as fast. Returns the field and L.
    """
    m = len(rates)
    rates = [*rates, -3 * u[m] + u[0] ** 2]
    bend = u[1] * u[m] / 2
    forward = [u[0] + bend, *u[1 : m + 1]]
    matrix = sp.eye(m + 1)
    matrix[0, m], matrix[m, 1], matrix[1, 1] = 1, -1, 2
    inside = dict(zip(u, matrix.inv() * sp.Matrix(u[: m + 1]), strict=False))
    slopes = sp.Matrix(forward).jacobian(u[: m + 1]) * sp.Matrix(rates)
    seen = (matrix * slopes.subs({u[0]: u[0] - bend})).subs(inside, simultaneous=True)
    states = [sp.Symbol(str(s)) for s in u[: m + 1]]
    table = {k: (1 + p) * e for k, e in zip(states, seen, strict=True)}
    model = fs.Model(table, parameters={"p": 0, "q": 0})
    return FrozenField(model, "p", "q"), np.array(matrix, dtype=float)


def origin(field, rate=1.0):
    return np.append(np.zeros(field.n), [rate - 1.0, 0.0])


def size(matrix, *columns):
    """Length of the image of e_j, or of e_j − i e_k."""
    vector = np.zeros(len(matrix), dtype=complex)
    vector[columns[0]] = 1.0
    if len(columns) > 1:
        vector[columns[1]] = -1j
    return float(np.linalg.norm(matrix @ vector))


def test_bogdanov_takens():
    field, matrix = hidden([u[1], 2 * u[0] ** 2 - 3 * u[0] * u[1]])
    form = bogdanov_takens(field, 0, origin(field))
    image = matrix[:, 0] / size(matrix, 0)
    side = np.sign(image[np.argmax(np.abs(image))])
    assert form["a"] == pytest.approx(2 * side / size(matrix, 0), rel=1e-10)
    assert form["b"] == pytest.approx(-3 * side / size(matrix, 0), rel=1e-10)


def test_generalized_hopf():
    """ẇ = 2i w + 0.3i w|w|² + (−1.7 + 0.4i) w|w|⁴ with w = x + iy."""
    x, y = u[:2]
    r2 = x**2 + y**2
    turn = 2 + sp.Rational(3, 10) * r2 + sp.Rational(2, 5) * r2**2
    damp = -sp.Rational(17, 10) * r2**2
    field, matrix = hidden([damp * x - turn * y, turn * x + damp * y])
    form = generalized_hopf(field, 0, origin(field), 2.0)
    assert form["l2"] == pytest.approx(-1.7 * (2 / size(matrix, 0, 1)) ** 4 / 2, rel=1e-9)


def test_zero_hopf():
    """x' = x² − 2 r² + cubic terms: E = f + e (g/b + d/(2b) − 3c/(2a)) − a g/b."""
    x, y, z = u[:3]
    a, b, c, d, e, f, g = 1, -2, sp.Rational(1, 2), 3, sp.Rational(-3, 2), 2, sp.Rational(1, 4)
    r2 = y**2 + z**2
    growth = e * x + f * x**2 + g * r2
    rates = [
        a * x**2 + b * r2 + c * x**3 + d * x * r2,
        growth * y - 3 * z,
        3 * y + growth * z,
    ]
    field, matrix = hidden(rates)
    effect = f + e * (g / b + sp.Rational(d, 2 * b) - 3 * c / (2 * a)) - a * g / b
    for rate in (1.0, 1e-3, 1e4):
        form = zero_hopf(field, 0, origin(field, rate), 3.0 * rate)
        assert form["s"] == -1
        assert form["theta"] == pytest.approx(float(e) / (2 * a), rel=1e-9)
        assert form["E"] == pytest.approx(float(effect) * rate / size(matrix, 0) ** 2, rel=1e-8)
        assert zero_hopf_case(form) == "s = -1, θ < 0"


def test_double_hopf():
    x, y, z = u[:3]
    v = u[3]
    one, two = x**2 + y**2, z**2 + v**2
    first, second = -one - two / 2, -two - sp.Rational(1, 3) * one
    rates = [
        first * x - 5 * y,
        5 * x + first * y,
        second * z - 2 * v,
        2 * z + second * v,
    ]
    field, length = hidden(rates)
    form = double_hopf(field, 0, origin(field), (2.0, 5.0))
    fast, slow = ((2 / size(length, *pair)) ** 2 for pair in ((0, 1), (2, 3)))
    assert form["p11"] == pytest.approx(-fast, rel=1e-9)
    assert form["p12"] == pytest.approx(-slow / 2, rel=1e-9)
    assert form["p21"] == pytest.approx(-fast / 3, rel=1e-9)
    assert form["p22"] == pytest.approx(-slow, rel=1e-9)
    assert form["theta"] == pytest.approx(0.5, rel=1e-9)
    assert form["delta"] == pytest.approx(1 / 3, rel=1e-9)
    assert double_hopf_case(form) == "simple, case II"


@pytest.mark.parametrize(
    ("theta", "delta", "p22", "case"),
    [
        (2, 1, 1, "simple, case I"),
        (-1, 0.5, 1, "simple, case III"),
        (-0.5, -0.5, 1, "simple, case IV"),
        (-2, -1, 1, "simple, case V"),
        (2, 3, -1, "difficult, case I"),
        (4, 0.5, -1, "difficult, case II"),
        (1.5, 0.5, -1, "difficult, case III"),
        (-1.5, 0.5, -1, "difficult, case IV"),
        (-0.5, -0.5, -1, "difficult, case V"),
        (-2, -1, -1, "difficult, case VI"),
    ],
)
def test_cases_of_double_hopf_points(theta, delta, p22, case):
    form = {"theta": theta, "delta": delta, "p11": 1.0, "p22": p22}
    assert double_hopf_case(form) == case


def test_jets_are_the_derivatives_of_sympy():
    s, t = sp.symbols("s t", real=True)
    expression = sp.exp(s * t) * sp.sin(s) / (1 + t**2) + sp.sqrt(2 + s) * sp.log(3 + t) + 2**s
    space = JetSpace(2, 4)
    at = {s: 0.3, t: -0.7}
    jets = {k: space.constant(v) + space.variable(j) for j, (k, v) in enumerate(at.items())}
    found = space.evaluate(expression, jets)
    for (i, j), value in zip(space.powers, found, strict=True):
        exact = expression.diff(s, i, t, j) if i + j else expression
        exact = exact.subs(at) / (sp.factorial(i) * sp.factorial(j))
        assert value == pytest.approx(complex(sp.N(exact, 20)), rel=1e-12, abs=1e-14)


def _field(rates):
    states = [sp.Symbol(str(s)) for s in u[: len(rates)]]
    model = fs.Model(dict(zip(states, rates, strict=True)), parameters={"p": 0, "q": 0})
    return FrozenField(model, "p", "q")


def _pair(x, y, frequency, cubic=0):
    square = x**2 + y**2
    return [-frequency * y + cubic * x * square, frequency * x + cubic * y * square]


def test_a_resonance_leaves_no_second_lyapunov_coefficient_and_says_so():
    """Another pair ±2iω, driven by the first: w² has no bounded response."""
    driven = _pair(u[2], u[3], 2)
    driven[0] += u[0] ** 2
    field = _field([*_pair(u[0], u[1], 1), *driven])
    found = _form(("l2",), generalized_hopf, field, 0, origin(field), 1.0)
    assert found["normal_form"] == {}
    assert found["degeneracy"].startswith("l2 undefined because of a resonance: ")
    assert "2j" in found["degeneracy"]
    off = _field([*_pair(u[0], u[1], 1), *_pair(u[2], u[3], sp.Rational(21, 10))])
    sound = _form(("l2",), generalized_hopf, off, 0, origin(off), 1.0)
    assert list(sound["normal_form"]) == ["l2"]
    assert not sound["degeneracy"]


@pytest.mark.parametrize("ratio", [2, 3])
def test_a_double_hopf_point_in_resonance_says_so(ratio):
    field = _field([*_pair(u[0], u[1], ratio, -1), *_pair(u[2], u[3], 1, -1)])
    names = ("p11", "p12", "p21", "p22", "theta", "delta")
    found = _form(names, double_hopf, field, 0, origin(field), (float(ratio), 1.0))
    assert found["normal_form"] == {}
    assert found["degeneracy"].startswith("p11, p12, p21, p22, theta and delta undefined")
    assert double_hopf_case(found["normal_form"]) == "resonant or degenerate"


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_a_linear_oscillator_leaves_theta_and_delta_undefined(unit):
    root = 5**0.5
    field = _field([*_pair(u[0], u[1], root), *_pair(u[2], u[3], 1, -(unit**2))])
    names = ("p11", "p12", "p21", "p22", "theta", "delta")
    units = np.array([1, 1, 1 / unit, 1 / unit])
    found = _form(names, double_hopf, field, 0, origin(field), (root, 1.0), units)
    assert found["normal_form"]["p22"] == pytest.approx(-2 * unit**2, rel=1e-12)
    assert set(found["normal_form"]) == {"p11", "p12", "p21", "p22"}
    assert found["degeneracy"] == "theta and delta undefined because p11 or p22 vanishes"


def test_a_hopf_pitchfork_point_says_what_is_undefined():
    """z = 0 is invariant: the quadratic terms of the zero-Hopf form vanish by symmetry."""
    x, y, z = sp.symbols("x y z")
    square = x**2 + y**2
    model = fs.Model(
        {
            x: q * x - y - x * (square + z**2),
            y: x + q * y - y * (square + z**2),
            z: p * z - z**3 - z * square,
        },
        parameters={"p": -0.5, "q": 0},
    )
    (hopf,) = fs.continue_equilibria(model, "q", (-1, 1)).special("HB")
    (point,) = fs.continue_points(hopf, ("q", "p"), over={"q": (-1, 1), "p": (-1, 1)}).special("ZH")
    assert (point["p"], point["q"]) == pytest.approx((0, 0), abs=1e-12)
    assert point.type == "resonant or degenerate"
    assert "degenerate: s, theta and E undefined because a = 0" in repr(point)
