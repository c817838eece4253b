"""Curves of special points in other units, and codimension-two points that are close together."""

from dataclasses import replace

import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

import fastslow as fs
from fastslow.continuation.zeros import brackets
from fastslow.diagrams.field import FrozenField, Source
from fastslow.results.branch.windows import state_window
from fastslow.results.points import SpecialPoint
from tests.samples import WHOLE, examples

pytestmark = pytest.mark.slow

x, y, p, q, e, d, tau = sp.symbols("x y p q e d tau")
X, Y, Z, U, F, T = states = sp.symbols("X Y Z U F T")
sizes = sp.symbols("s1:5")


@pytest.fixture(scope="module")
def swallowtail():
    return fs.Model({x: p + q * x + e * x**2 / 2 - x**4 / 4}, parameters={p: 0, q: 1, e: 0.1})


@pytest.mark.sample(3)
@pytest.mark.parametrize("size", [1e-1, 2e-3, 1e-3, 5e-4, 1e-4, 1e-5, 1e-6, 1e-8])
def test_two_cusps_within_one_step(swallowtail, size):
    """Cusps of x' = p + q x + e x²/2 − x⁴/4 are at 3 x² = e, in closed form."""
    model = swallowtail.with_parameters(e=size)
    fold = fs.continue_equilibria(model, "p", (-1, 1)).folds[0]
    cusps = fs.continue_points(fold, (p, q), over={p: (-1, 1), q: (-1, 1)}).special("CP")
    root = np.sqrt(size / 3)
    assert sorted(cusps["x"]) == pytest.approx([-root, root], rel=1e-8)
    assert np.sort(cusps["q"]) == pytest.approx(
        np.sort([root * (root**2 - size), -root * (root**2 - size)]), abs=1e-14
    )
    assert all(c.converged for c in cusps)


@pytest.mark.parametrize("size", [-1e-6, -1e-3])
def test_no_cusp_where_the_test_turns_before_zero(swallowtail, size):
    model = swallowtail.with_parameters(e=size)
    fold = fs.continue_equilibria(model, "p", (-1, 1)).folds[0]
    curve = fs.continue_points(fold, (p, q), over={p: (-1, 1), q: (-1, 1)})
    assert curve.special("CP") == ()


@pytest.mark.sample(1)
@pytest.mark.parametrize("half", [0.1, 3e-3, 1e-4])
def test_two_generalized_hopf_points_within_one_step(half):
    """l₁ = q² − d² along p = 0."""
    r2 = x**2 + y**2
    growth = p + (q**2 - d**2) * r2 - r2**2
    model = fs.Model(
        {x: growth * x - 2 * y, y: 2 * x + growth * y}, parameters={p: 0, q: 1, d: half}
    )
    (hopf,) = fs.continue_equilibria(model, "p", (-1, 1)).special("HB")
    curve = fs.continue_points(hopf, (p, q), over={p: (-1, 1), q: (-1, 1)})
    assert sorted(curve.special("GH")["q"]) == pytest.approx([-half, half], rel=1e-10)


@settings(max_examples=examples(300), derandomize=True, deadline=None)
@given(
    st.floats(0.3, 8.7),
    st.floats(-5, -0.7),
    st.floats(-0.1, 0.1),
    st.sampled_from([-1.0, 1.0]),
    st.booleans(),
)
def test_brackets_hold_pairs_of_zeros(middle, power, slope, sign, real):
    """Quadratics times an exponential, sampled at 0, 1, …, 9: two zeros, or none."""
    half = 10.0**power

    def test(place):
        apart = (place - middle) ** 2 + (-(half**2) if real else half**2)
        return sign * apart * np.exp(slope * place)

    def between(a, b, part):
        place = a + part * (b - a)
        return place, float(test(place[0]))

    rows = np.arange(10.0)
    found = list(brackets(rows[:, None], test(rows), np.ones(9), between, quartered=True))
    zeros = [z for z in (middle - half, middle + half) if 0 < z < 9] if real else []
    held = [[z for z in zeros if b.points[0][0] < z < b.points[1][0]] for b in found]
    assert [len(h) for h in held] == [1] * len(zeros)


def scaled(point, model, factors, rate):
    """A special point of the same system with states and time in other units."""
    units = np.array([float(f) for f in factors])
    window = point.source.window
    return replace(
        point,
        state=point.state * units,
        parameters={
            **point.parameters,
            "tau": rate,
            **{str(s): float(u) for s, u in zip(sizes, units, strict=True)},
        },
        frequency=None if point.frequency is None else point.frequency * rate,
        source=Source(
            model,
            point.source.unit * units,
            replace(
                window,
                lower=tuple(np.array(window.lower) * units),
                upper=tuple(np.array(window.upper) * units),
            ),
        ),
    )


@pytest.fixture(scope="module")
def circulation():
    """The extended Lorenz-84 model of Kuznetsov, Meijer and van Veen (2004), in any units."""
    a, b, g, damping = sp.Rational(1, 4), 1, sp.Rational(987, 1000), sp.Rational(104, 100)
    own = [s / size for s, size in zip((X, Y, Z, U), sizes, strict=True)]
    u, v, w, h = own
    rates = [
        -(v**2) - w**2 - a * u + a * F - g * h**2,
        u * v - b * u * w - v + sp.Rational(1, 5),
        b * u * v + u * w - w,
        -damping * h + g * h * u + T,
    ]
    model = fs.Model(
        {s: tau * size * r for s, size, r in zip((X, Y, Z, U), sizes, rates, strict=True)},
        parameters={F: 3, T: 0.04, tau: 1, **dict.fromkeys(sizes, 1)},
    )
    # some of them on each of the two branches
    starts = fs.equilibria(model, F=2)
    diagram = fs.continue_equilibria(model, "F", (0, 4), from_points=starts)
    hopf = diagram.special("HB")[::3]
    points = (*hopf[: None if WHOLE else 1], diagram.folds[0])
    curves = [fs.continue_points(point, (F, T), over=PLANE) for point in points]
    return model, points, curves


PLANE = {F: (0, 4), T: (-1, 1)} if WHOLE else {F: (1, 3.2), T: (-0.05, 0.1)}


def listed(curve):
    return {(c.label, round(c["F"], 9), round(c["T"], 9)) for c in curve.special}


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    ("factors", "rate"),
    [
        ((1, 1, 1, 1), 1e-6),
        ((1e-3, 1e5, 1e-6, 1e2), 1e-3),
        ((1, 1, 1, 1), 1e6),
    ],
)
def test_units_of_time_and_states_do_not_matter(circulation, factors, rate):
    model, points, curves = circulation
    other = model.with_parameters(
        tau=rate, **{str(s): f for s, f in zip(sizes, factors, strict=True)}
    )
    for point, curve in zip(points, curves, strict=True):
        again = fs.continue_points(scaled(point, other, factors, rate), (F, T), over=PLANE)
        assert listed(curve) == listed(again)
        assert len(curve.special) > 1
        assert all(c.converged for c in again.special)
        for one in curve.special("HH"):
            other_point = next(c for c in again.special("HH") if c.label == one.label)
            assert one.type == other_point.type
            for name in ("theta", "delta"):
                value = one.normal_form[name]
                assert other_point.normal_form[name] == pytest.approx(value, rel=1e-6)


def test_points_have_the_eigenvalues_that_define_them(circulation):
    _, _, curves = circulation
    for point in (c for curve in curves for c in curve.special("HH")):
        pairs = point.eigenvalues[point.eigenvalues.imag > 0]
        assert np.abs(pairs.real).max() < 1e-11
        assert len(pairs) == 2
    for point in (c for curve in curves for c in curve.special("BT")):
        assert np.sort(np.abs(point.eigenvalues))[1] < 1e-6


@pytest.mark.parametrize("fast", [1.0, 1e3, 1e6])
def test_fast_passive_states_hide_no_point(fast):
    """A double Hopf point at p = q = 0, beside two states that follow at any rate."""
    z, v, s1, s2, k = sp.symbols("z v s1 s2 k")
    a, b = x**2 + y**2, z**2 + v**2
    model = fs.Model(
        {
            x: (p - a - b / 2) * x - y,
            y: x + (p - a - b / 2) * y,
            z: (q - b - a / 3) * z - sp.sqrt(7) * v,
            v: sp.sqrt(7) * z + (q - b - a / 3) * v,
            s1: k * (x - s1),
            s2: 2 * k * (x * z - s2),
        },
        parameters={p: 0, q: -1, k: fast},
    )
    over = {p: (-1, 1), q: (-1.5, 1)}
    field = FrozenField(model, "p", "q")
    point = SpecialPoint(
        code="HB",
        label="HB1",
        states=model.states,
        state=np.zeros(6),
        parameters=dict(model.parameters),
        regions=tuple(field.regions),
        eigenvalues=field.eigenvalues(0, np.zeros(8)),
        tangent=np.zeros(7),
        residual=0.0,
        converged=True,
        frequency=1.0,
        source=Source(model, np.ones(6), state_window(model.states)),
    )
    curve = fs.continue_points(point, (p, q), over=over)
    (double,) = curve.special("HH")
    assert np.abs([double["p"], double["q"]]).max() < 1e-11
    assert double.normal_form["theta"] == pytest.approx(1 / 3, rel=1e-8)
    assert double.normal_form["delta"] == pytest.approx(1 / 2, rel=1e-8)
    assert curve["p"] == pytest.approx(np.zeros(len(curve)), abs=1e-11)
