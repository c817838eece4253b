"""Short closed forms of roots, and the budget."""

import mpmath
import pytest
import sympy as sp

from fastslow.model.structure import real
from fastslow.symbolic.algebra import expanded_form, growth, rational_form, within_budget
from fastslow.symbolic.closed_forms.stability import hurwitz
from fastslow.symbolic.signs.signs import Signs
from fastslow.symbolic.solving.isolation import isolate
from fastslow.symbolic.solving.univariate import roots, solved_for, squares_out
from fastslow.symbolic.solving.verification import vanishes

a, b, x, w = map(real, ["a", "b", "x", "w"])


@pytest.mark.parametrize(
    "equation", [a * x + b, a * x**2 + b * x - 1, x**5 - 3 * x + 1, x**3 - 7, x**4 - 2]
)
def test_roots_satisfy_their_equation(equation):
    found = roots(equation, x, Signs({a: 1, b: 1}))
    assert found
    for root in found:
        assert vanishes(equation.subs(x, root.value))


def test_quintic_roots_agree_with_mpmath():
    found = sorted(float(r.value) for r in roots(x**5 - 3 * x + 1, x, Signs({})))
    exact = [float(r.real) for r in mpmath.polyroots([1, 0, 0, 0, -3, 1]) if abs(r.imag) < 1e-20]
    assert found == pytest.approx(sorted(exact), rel=1e-14)


def test_a_general_cubic_has_no_short_form():
    assert roots(x**3 + a * x + b, x, Signs({})) is None


def test_squares_leave_the_root():
    outer, inner = squares_out(12 * a**3 * b**2, Signs({}))
    assert sp.expand(outer**2 * inner - 12 * a**3 * b**2) == 0
    assert inner == 3 * a


def test_a_known_slope_goes_first():
    assert solved_for(a * b + x * w, [b, w], Signs({x: 1}))[0] == w


def test_hurwitz_determinant_of_a_cubic():
    assert hurwitz([1, 2, 3, 4], 2) == 2 * 3 - 4
    assert hurwitz([1, 2, 3, 4, 5], 3) == sp.Matrix([[2, 4, 0], [1, 3, 5], [0, 2, 4]]).det()


def test_the_budget_is_structural():
    assert growth((a + b + x) ** 30) > 400
    long = sp.Add(*((a + k) ** 9 * sp.sin(k * x) for k in range(5)))
    assert not within_budget(long)
    huge = (a + b + x + w) ** 40
    assert expanded_form(huge) == huge
    assert rational_form(huge) == huge


def test_vanishing():
    root = sp.sqrt(2 + sp.sqrt(3)) - (sp.sqrt(6) + sp.sqrt(2)) / 2
    assert vanishes(root)
    assert vanishes(sp.sin(a) ** 2 + sp.cos(a) ** 2 - 1)
    assert not vanishes(sp.sin(a) - a + a**3 / 6)


def test_functions_are_inverted_on_their_range():
    (root,) = isolate(sp.atan(x) - a, x, Signs({}))
    assert root.value == sp.tan(a)
    assert sp.expand(sum(root.radicands) - (sp.pi**2 / 4 - a**2)) == 0
    assert isolate(sp.atan(2 * x + 1) - 3, x, Signs({})) == []
    assert isolate(sp.erf(x) + 2, x, Signs({})) == []
    assert [r.value for r in isolate(sp.acosh(x) - 2, x, Signs({}))] == [sp.cosh(2)]
