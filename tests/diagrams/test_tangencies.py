"""Tangency points against closed forms, solved by hand."""

import numpy as np
import pytest
import sympy as sp
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

import fastslow as fs
from fastslow.diagrams.curves.tangency_points import TangencyEquations
from fastslow.diagrams.modes import modes_of
from tests.samples import examples

pytestmark = pytest.mark.slow

x, y, z, p, v, w = sp.symbols("x y z p v w")


def switched(h, above, below, parameters=None, states=(x, y, z)):
    """The model with rates ``above`` where h > 0 and ``below`` elsewhere."""
    rates = {
        s: sp.Piecewise((f, h > 0), (g, True))
        for s, f, g in zip(states, above, below, strict=False)
    }
    return fs.Model(rates, parameters=parameters or {})


def test_visible_invisible_and_degenerate():
    """x' = y ± y³ beside x = 0: ẍ = y'(1 ± 3y²) at y = 0; y' = 1 above, y' = x below."""
    model = switched(x, (y + y**3, 1 + x), (y - 1, x))
    found = fs.tangencies(model)
    assert found.completeness == "complete"
    first, second = found
    assert (first.region, first.interface, first.visible, first.two_fold) == (
        "S1",
        "x",
        True,
        False,
    )
    assert first.state == pytest.approx([0, 0], abs=1e-15)
    assert first.second_derivative == pytest.approx(1, abs=1e-14)
    assert (second.region, second["y"], second.visible) == ("S2", 1.0, None)
    assert second.second_derivative == 0


def test_every_kind_of_two_fold():
    """x' = y above, x' = k y below, y' = c and d: L²h is c above and k d below."""
    for c in (1, -1):
        for d in (1, -1):
            pair = fs.tangencies(switched(x, (y, c), (2 * y, d)))
            assert [t.region for t in pair] == ["S1", "S2"]
            assert all(t.two_fold for t in pair)
            assert [t.second_derivative for t in pair] == [c, 2 * d]
            assert [t.visible for t in pair] == [c > 0, d < 0]


def test_the_edges_of_sticking():
    """v' = −x − F sgn(v − 1): tangent at x = ∓F, where ẍ of h is −v = −1."""
    block = fs.Model({x: v, v: -x - p * sp.sign(v - 1)}, parameters={p: 0.375})
    above, below = fs.tangencies(block)
    assert (above["x"], below["x"]) == (-0.375, 0.375)
    assert (above.visible, below.visible) == (False, True)
    assert fs.tangencies(block, p=2)[1]["x"] == 2.0
    assert above["p"] == 0.375


def test_a_circle_as_interface():
    """A uniform flow x' = 1 touches the circle x² + y² = 1 at its poles, bending outward."""
    circle = x**2 + y**2 - 1
    found = fs.tangencies(switched(circle, (1, 0), (1, 1)))
    assert found.completeness == "complete"
    outer = [t for t in found if t.region == "S1"]
    assert [t.state.tolist() for t in outer] == [[0, -1], [0, 1]]
    assert all(t.visible and t.second_derivative == 2 for t in outer)
    inner = [t.state for t in found if t.region == "S2"]
    assert inner == pytest.approx(np.array([[-1, 1], [1, -1]]) / np.sqrt(2), abs=1e-15)
    assert not any(t.visible or t.two_fold for t in found if t.region == "S2")


def test_an_equation_that_is_no_polynomial():
    """x' = exp(y) − 2 is tangent to x = 0 at y = log 2."""
    found = fs.tangencies(switched(x, (sp.exp(y) - 2, 1), (1, 1)))
    assert found.completeness == "found"
    assert [t["y"] for t in found] == pytest.approx([np.log(2)], abs=1e-15)
    assert found[0].second_derivative == pytest.approx(2, rel=1e-14)


@pytest.mark.parametrize(("degree", "completeness"), [(5, "complete"), (61, "found")])
def test_a_polynomial_of_a_high_degree_is_searched(degree, completeness):
    """yⁿ − y + 1/7 has three real roots for odd n."""
    found = fs.tangencies(switched(x, (y**degree - y + sp.Rational(1, 7), 1), (1, 0)))
    assert found.completeness == completeness
    roots = np.roots([1, *[0] * (degree - 2), -1, 1 / 7])
    real = np.sort(roots[np.abs(roots.imag) < 1e-9].real)
    assert [t["y"] for t in found] == pytest.approx(real, abs=1e-12)


def test_held_states():
    """x' = y z − 2 and y z = 2 on a curve: with z held there is one point."""
    model = switched(x, (y * z - 2, 1, y), (1, 1, 1))
    (point,) = fs.tangencies(model, z=4)
    assert point.state == pytest.approx([0, 0.5, 4], abs=1e-15)
    # ẍ = y' z + y z' = 4 + 1/4
    assert point.second_derivative == pytest.approx(4.25, rel=1e-14)
    (point,) = fs.tangencies(model, {y: 0.5})
    assert point["z"] == pytest.approx(4, rel=1e-14)
    with pytest.raises(fs.FastSlowError, match=r"expected values for 1 of its states x, y, z"):
        fs.tangencies(model)
    with pytest.raises(fs.FastSlowError, match="received y, z"):
        fs.tangencies(model, y=1, z=1)


def test_only_points_of_the_region_count():
    """Tangent at y = ±1 of x = 0, of which y > 0 keeps one."""
    rate = sp.Piecewise((y**2 - 1, y > 0), (2 + y, True))
    found = fs.tangencies(switched(x, (rate, 1), (3, 1)))
    assert [(t["x"], t["y"]) for t in found if t.interface == "x"] == [(0, 1), (0, -2)]


def test_a_continuous_interface(gear):
    """The gear's x' = v touches both ends of the backlash at v = 0, from both sides."""
    found = fs.tangencies(gear.frozen(), w=0.1)
    assert {(t["x"], t["v"]) for t in found} == {(0.25, 0.0), (-0.25, 0.0)}
    assert len(found) == 4
    assert not any(t.two_fold for t in found)
    # ẍ = w on both sides of x = D: visible where it leads outward
    assert {t.region: t.visible for t in found if t.interface == "x - D"} == {
        "S1": True,
        "S2": False,
    }


def test_trouble():
    with pytest.raises(fs.FastSlowError, match="tangency points need two states"):
        fs.tangencies(fs.Model({x: -sp.sign(x)}))
    t = sp.Symbol("t")
    forced = fs.Model({x: w - sp.sign(x) + y, y: -x}, forcing={w: sp.sin(t)}).frozen()
    with pytest.raises(fs.FastSlowError, match="'w' has no value; give one, as in tangencies"):
        fs.tangencies(forced)
    with pytest.raises(fs.FastSlowError, match="unknown parameter 'q'"):
        fs.tangencies(forced, q=1)
    assert [t["y"] for t in fs.tangencies(forced, w=0.5)] == [0.5, -1.5]


def test_rounding_is_judged_alike_on_both_sides_of_zero():
    contact = _contact(switched(x, (y**2 - 2, 1), (1, 0)))
    for place in ([3.0, 4e6], [1e-3, 7.0]):
        state = np.array(place)
        sizes = [contact._terms(lambda a, b: [a * b, b**2], sign * state) for sign in (1, -1)]
        np.testing.assert_allclose(*sizes, rtol=1e-6)


def _contact(model):
    region, across = (mode for mode in modes_of(model) if mode.sides is None)
    return TangencyEquations(model, region, across, 0, {})


def test_no_interface_and_an_invariant_one():
    assert fs.tangencies(fs.Model({x: y, y: -x})) == ()
    invariant = switched(x, (x, 1), (x, -1))
    assert fs.tangencies(invariant) == ()


@settings(max_examples=examples(25), deadline=None)
@given(st.lists(st.floats(-2, 2), min_size=4, max_size=4), st.floats(-2, 2))
@example([1.0, 1.7363832928175665e-301, -1.0, 1.175494351e-38], 1.0)
@example([1.0, 0.0, -1.0, 3.900367125318735e-271], 1.0)
def test_cubic_tangencies_agree_with_companion_roots(coefficients, rate):
    """x' = c(y): tangent where the cubic vanishes, ẍ = c'(y) y'."""
    assume(abs(coefficients[0]) > 0.1 and abs(rate) > 0.1)
    roots = np.roots(coefficients)
    apart = np.abs(roots[:, None] - roots[None, :])[np.triu_indices(3, 1)]
    assume(apart.min() > 1e-2)
    assume(all(abs(r.imag) > 1e-2 or abs(r.imag) < 1e-9 for r in roots))
    exact = [sp.Rational(c) for c in coefficients]
    cubic = sum(c * y**k for c, k in zip(exact, (3, 2, 1, 0), strict=True))
    model = switched(x, (cubic, sp.Rational(rate)), (1, 1))
    real = np.sort(roots.real[np.abs(roots.imag) < 1e-9])
    found = fs.tangencies(model)
    if found.completeness == "found":
        # only coefficients over hundreds of decades
        assert min(abs(c) for c in coefficients if c) < 1e-60
        real = np.array([real[np.argmin(np.abs(real - t["y"]))] for t in found])
    assert [t["y"] for t in found] == pytest.approx(real.tolist(), abs=1e-11)
    slopes = np.polyval(np.polyder(coefficients), real) * rate
    assert [t.second_derivative for t in found] == pytest.approx(slopes.tolist(), rel=1e-8)
    assert [t.visible for t in found] == [bool(s > 0) for s in slopes]


def test_tangencies_whose_powers_overflow_are_complete_or_not_called_so():
    """On x = 0 the field x' = 1 − (y/c)^q is tangent at y = ±c, at +c alone for an odd q."""
    a, q = sp.symbols("a q")
    for power, c in ((3, 2.4), (20, 2.4), (20, 0.1), (45, 7.3), (60, 1e-6), (60, 1e6), (80, 123.4)):
        rates = {x: 1 - (y / a) ** q, y: -x + sp.sign(x)}
        found = fs.tangencies(fs.Model(rates, parameters={a: c, q: power}))
        places = sorted({float(f"{t['y']:.9g}") for t in found})
        expected = [c] if power % 2 else [-c, c]
        if found.completeness == "complete":
            assert places == pytest.approx(expected, rel=1e-9)
        assert set(places) <= set(expected)
        assert power > 45 or found.completeness == "complete"
