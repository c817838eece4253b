"""Systems with long closed forms: past the budget they are implicit, and verified."""

import mpmath
import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.model.structure import real
from fastslow.symbolic.signs.signs import Signs
from fastslow.symbolic.solving.linear import NOTE, cramer
from fastslow.symbolic.solving.verification import checked, weakest
from tests.symbolic.symbolic_models import dense_linear, derived, food_chain

pytestmark = pytest.mark.slow

x, y, a = map(real, ("x", "y", "a"))


@pytest.mark.sample(4)
@pytest.mark.parametrize(
    "name",
    [
        "two_responses",
        "food_chain",
        "quadratic",
        "dense_linear",
        "coupled_oscillators",
        "hodgkin_huxley",
    ],
)
def test_every_form_is_verified_and_says_how(name):
    derivation = derived(name)
    assert derivation.verified
    assert derivation.check in ("exact", "50 digits")


def test_a_special_point_found_by_dividing_by_zero_is_left_out():
    # at a2 = b2 d2 the coexisting equilibrium is at infinity
    region = derived("two_responses")["S1"]
    for point in (*region.folds, *region.branch_points, *region.hopf, *region.cusps):
        for value in (*point.state.values(), *point.parameters.values()):
            assert not value.has(sp.zoo, sp.nan, sp.oo)


def test_implicit_forms_say_so():
    region = derived("quadratic")["S1"]
    assert [e.type for e in region.equilibria] == ["implicit"]
    assert any("equations remain" in note for note in region.notes)


def test_conditions_past_the_budget_say_so():
    region = derived("hodgkin_huxley")["S1"]
    assert "the Hopf set is given by its equations" in region.notes
    # 3 with the opening rates written out, which are single functions
    assert any(n.startswith("2 of the 5 Routh-Hurwitz expressions are past") for n in region.notes)
    assert not any("Routh" in note for note in derived("lorenz")["S1"].notes)


def test_gates_are_divided_by_their_rates():
    # steady gates alpha/(alpha + beta) and the steady current, written out by hand in mpmath
    (form,) = derived("hodgkin_huxley")["S1"].equilibria
    assert form.type == "curve"
    values = {real("g_Na"): 120, real("g_K"): 36, real("g_L"): sp.Rational(3, 10)}
    for volts in (-65, -52, 7):
        v, one = mpmath.mpf(volts), mpmath.mpf(1)
        up_m = (v + 40) / 10 / (1 - mpmath.exp(-(v + 40) / 10))
        up_n = (v + 55) / 100 / (1 - mpmath.exp(-(v + 55) / 10))
        up_h, down_h = 0.07 * mpmath.exp(-(v + 65) / 20), one / (1 + mpmath.exp(-(v + 35) / 10))
        m = up_m / (up_m + 4 * mpmath.exp(-(v + 65) / 18))
        n = up_n / (up_n + mpmath.exp(-(v + 65) / 80) / 8)
        h = up_h / (up_h + down_h)
        ionic = 120 * m**3 * h * (v - 50) + 36 * n**4 * (v + 77) + mpmath.mpf(3) / 10 * (v + 54)
        place = {**values, real("v"): volts}
        assert float(form.parameters["I"].subs(place)) == pytest.approx(float(ionic), rel=1e-13)
        mine = [float(form.state[s].subs(place)) for s in "mhn"]
        assert mine == pytest.approx([float(m), float(h), float(n)], rel=1e-13)


def test_sign_of_a_gate_rate():
    signs, rate = Signs({a: 1}), (x + 40) / 10 / (1 - sp.exp(-(x + 40) / 10))
    assert signs.sign(a * rate + sp.exp(-x)) == 1
    assert signs.sign(a * rate - sp.exp(-x)) is None
    assert signs.sign(a * x / (1 - sp.exp(x)) - a) == -1
    # the exponent belongs to another zero than the factor in front
    assert signs.sign((x + 40) / (1 - sp.exp(-(x + 39)))) is None


def test_dense_linear_system_against_numpy():
    values = {real(n): v for n, v in dense_linear().parameters.items()} | {real("w"): 0.5}
    (form,) = derived("dense_linear")["S1"].equilibria
    assert form.type == "explicit"
    mine = [float(e.subs(values)) for e in form.state.values()]
    region = derived("dense_linear")["S1"]
    matrix = np.array(region.jacobian.subs(values), dtype=float)
    assert mine == pytest.approx(np.linalg.solve(matrix, -np.array([0.5, 1, 2, 3])), rel=1e-12)
    signs = [float(e.subs(values)) > 0 for e in form.stability.routh_hurwitz]
    assert all(signs) == bool(np.linalg.eigvals(matrix).real.max() < 0)


def test_linear_system_past_the_budget():
    names = [f"x{k}" for k in range(6)]
    rates = {n: sum(real(f"a{n}{m}") * real(m) for m in names) - 1 for n in names}
    assert cramer(rates, names) == NOTE


@pytest.mark.sample(0)
def test_food_chain_has_no_equilibrium_at_a_pole():
    # x = −1/h clears the denominators but not the rates
    states = [form.state["x"] for form in derived("food_chain")["S1"].equilibria]
    assert -1 / real("h") not in states
    values = {real(n): v for n, v in food_chain().parameters.items()}
    for form in derived("food_chain")["S1"].equilibria:
        place = {real(n): e.subs(values) for n, e in form.state.items()}
        for rate in derived("food_chain")["S1"].rates.values():
            assert abs(complex(rate.subs(values).subs(place))) < 1e-12


def test_verification_says_how():
    assert checked([x**2 - a], {x: sp.sqrt(a)}) == "exact"
    assert checked([sp.sin(x) ** 2 + sp.cos(x) ** 2 - 1], {}) == "50 digits"
    assert checked([x**2 - a], {x: a}) == ""
    # the terms cancel inside a factor
    assert checked([a * (sp.sin(x) ** 2 + sp.cos(x) ** 2 - 1)], {}) == "50 digits"
    # on a circle, where nothing is solved for
    circle = x**2 + y**2 - a
    assert checked([sp.exp(circle) - 1], {}, None, [circle], [x]) == "50 digits"
    assert checked([x - y], {}, None, [circle], [x]) == ""
    assert weakest(["exact", "", "50 digits"]) == ""


def test_folds_with_exponents_that_are_parameters():
    """p x^q/(1 + x^q) - x has its folds at x^q = q - 1, and a further state changes nothing."""
    p, q = sp.symbols("p q")
    hill = p * x**q / (1 + x**q)
    for rates in ({x: hill - x}, {x: hill - x, y: x - y}):
        (fold,) = fs.derive(fs.Model(rates, parameters={q: 4, p: 3}))["S1"].folds
        symbols = {s.name: s for e in fold.equations for s in e.free_symbols}
        for number in (2, 3.5, 8):
            place = {symbols["q"]: number, symbols["x"]: (number - 1) ** (1 / number)}
            assert [abs(e.subs(place)) < 1e-14 for e in fold.equations] == [True]
            at = float(next(iter(fold.parameters.values())).subs(place))
            assert at == pytest.approx(number * (number - 1) ** (1 / number - 1), rel=1e-14)
