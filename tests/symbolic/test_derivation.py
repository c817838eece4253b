"""derive() on the harmonic gear: all that is known of its fast subsystem in closed form."""

import numpy as np
import pytest
import sympy as sp

from fastslow.errors import ArgumentError, UnknownNameError
from fastslow.model.model import Model
from fastslow.model.structure import real
from fastslow.symbolic.deriving import derive
from tests.symbolic.symbolic_models import derived, gear, morris_lecar

pytestmark = pytest.mark.slow

A, D, w, x, q = map(real, ("A", "D", "w", "x", "q"))


def number(expression, **values):
    return float(expression.subs({real(n): v for n, v in values.items()}))


def test_outer_curve_is_the_cubic_load():
    form = derived("gear")["S1"].equilibria[0]
    assert form.type == "curve"
    assert sp.expand(form.parameters["w"] - (x**2 + A) * (x - D)) == 0
    assert dict(form.state) == {"x": x, "v": 0}
    assert form.parameter_range == (w > 0)
    assert form.stability.verdict == "stable"
    assert form.verified
    mirror = derived("gear")["S3"].equilibria[0].parameters["w"]
    assert sp.expand(mirror + form.parameters["w"].subs(x, -x)) == 0


@pytest.mark.parametrize("load", [0.1, 1.0, 5.0])
def test_curve_agrees_with_numerical_roots(load):
    # (x² + A)(x − D) = w, solved by numpy's companion matrix: 13 digits
    found = np.roots([1, -0.25, 41.67, -41.67 * 0.25 - load])
    (root,) = found[np.abs(found.imag) < 1e-9].real
    curve = derived("gear")["S1"].equilibria[0].parameters["w"]
    assert number(curve, A=41.67, D=0.25, x=root) == pytest.approx(load, rel=1e-13, abs=1e-13)


def test_jacobian_and_hopf():
    region = derived("gear")["S1"]
    assert region.trace == -1
    assert sp.expand(region.determinant - (3 * x**2 - 2 * D * x + A)) == 0
    assert region.hopf == ()
    assert "trace" in region.no_hopf
    assert region.routh_hurwitz == (1, region.determinant)


def test_gap_is_a_continuum():
    region = derived("gear")["S2"]
    (continuum,) = region.continua
    assert region.equilibria == ()
    assert continuum.free == (x,)
    assert dict(continuum.parameters) == {"w": 0}
    assert continuum.state["v"] == 0
    assert set(continuum.eigenvalues) == {0, -1}
    assert set(continuum.conditions) == {x < D, x > -D}
    assert continuum.verified


def test_corners_are_degenerate_boundary_equilibria():
    points = derived("gear").boundary_equilibria
    assert [(p.interface, p.state["x"], p.parameters["w"]) for p in points] == [
        ("x - D", D, 0),
        ("x + D", -D, 0),
    ]
    for point, outer in zip(points, ("S1", "S3"), strict=True):
        path = point.clarke
        assert point.type == "degenerate"
        assert point.regions == (outer, "S2")
        assert path.determinants == (A + D**2, 0)
        assert sp.expand(path.determinant - q * (A + D**2)) == 0
        assert path.trace == -1
        assert [sp.simplify(c - 1 / (4 * (A + D**2))) for c in path.q_complex] == [0]
        assert point.singular[outer] == sp.Eq(A, -(D**2))
        assert point.verified
    assert derived("gear")["S1"].boundary_equilibria == points[:1]


def test_fold_is_admissible_iff_stiffness_is_below_minus_gap_squared():
    admissible, virtual = derived("gear")["S1"].folds
    assert sp.expand(admissible.state["x"] - (D + sp.sqrt(D**2 - 3 * A)) / 3) == 0
    assert admissible.admissible == (A < -(D**2))
    assert admissible.exists == (A <= D**2 / 3)
    assert admissible.possible is False, "A > 0 is assumed"
    assert virtual.admissible == sp.false
    assert derive(gear(A=-0.6).frozen())["S1"].folds[0].possible is None
    below = derive(gear().frozen(), assume="A < -D**2")["S1"].folds[0]
    assert below.possible is True
    assert all(p.verified for p in (admissible, virtual, below))


def test_fold_digits():
    # closed form, 30 digits, of the reference values for A = −0.6, D = 0.25
    first, second = derived("gear")["S1"].folds
    at = {"A": -0.6, "D": 0.25}
    assert number(first.state["x"], **at) == pytest.approx(0.538244802131872687596, rel=1e-15)
    assert number(first.parameters["w"], **at) == pytest.approx(-0.0894402097712473068, rel=1e-13)
    assert number(second.state["x"], **at) == pytest.approx(-0.371578135465206020929, rel=1e-15)
    assert number(second.parameters["w"], **at) == pytest.approx(0.287125394956432492, rel=1e-13)


def test_cusp_is_virtual():
    (cusp,) = derived("gear")["S1"].cusps
    assert (cusp.parameters["A"], cusp.state["x"]) == (D**2 / 3, D / 3)
    assert cusp.admissible == sp.false


def test_cusps_are_where_bounded_functions_can_be():
    # tanh(x) = ±1 at no state; its only inflection is at x = 0, with slope a
    x, a, b = sp.symbols("x a b")
    model = Model({x: b - a * sp.tanh(x) + x}, parameters={a: 1, b: sp.Rational(1, 10)})
    region = derive(model)["S1"]
    (cusp,) = region.cusps
    place = {e.subs({real("a"): 1, real("x"): 0}) for e in cusp.equations}
    assert place == {0}


def test_assumptions_are_listed_and_overridden():
    assert set(derived("gear").assumptions) == {A > 0, D > 0}
    other = derive(gear().frozen(), assume={"A": "real"})
    assert other.assumptions == (D > 0,)
    assert other["S1"].equilibria[0].stability.verdict == "depends"


def test_everything_is_verified():
    assert derived("gear").verified


def test_latex_holds_the_formulas():
    text = derived("gear").to_latex()
    assert text.count(r"\begin{align*}") == text.count(r"\end{align*}") == 6
    assert r"q \left(A + D^{2}\right)" in text
    assert r"A < - D^{2}" in text
    shown = derived("gear")._repr_latex_()
    assert shown.startswith("$")
    assert shown.endswith("$")
    assert shown.count("{") == shown.count("}")


def test_text_shows_assumptions_and_folds():
    text = derived("gear").summary()
    assert "A > 0, D > 0" in text
    assert "admissible iff A < -D**2" in text


def test_a_moving_model_is_refused():
    with pytest.raises(ArgumentError, match=r"frozen"):
        derive(gear())


@pytest.mark.parametrize(
    ("assume", "error"),
    [
        ({"Q": "positive"}, UnknownNameError),
        ({"A": "large"}, ArgumentError),
        ("A >= 0", ArgumentError),
        ("Q > 0", UnknownNameError),
        ("A >", ArgumentError),
    ],
)
def test_bad_assumptions(assume, error):
    with pytest.raises(error):
        derive(gear().frozen(), assume=assume)


def test_past_the_budget_the_form_is_implicit_and_says_so():
    region = derived("morris_lecar")["S1"]
    assert region.folds[0].equations
    assert morris_lecar().frozen().free == ("I",)
    x9 = sp.Symbol("x9")
    from fastslow.model.model import Model

    long = Model(
        {x9: sp.Symbol("a") * x9**19 - sp.cos(sp.Symbol("a")) * x9 + sp.Symbol("a") ** 2},
        parameters={"a": 2},
    )
    (form,) = derive(long)["S1"].equilibria
    assert form.type == "implicit"
    assert "past the budget" in form.note


def test_a_power_with_a_symbol_as_exponent_has_no_cusp():
    """Where x**(q - 2) vanishes, so does x**(q - 1), and the slope is 1."""
    x, a, q = sp.symbols("x a q")
    region = derive(Model({x: a + x**q - x}, parameters={a: 0.1, q: 3}))["S1"]
    assert region.cusps == ()
    assert len(region.folds) == 1
