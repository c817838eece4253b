"""Gaps between two curves, down to rounding: avoided branch points and true ones.

Closed forms: with X = (x - a)/s and P = p - b, X² - P² + δ = 0 has folds at P = ±√δ for δ > 0 and
none for δ < 0; X (P - X²) + δ = 0 has one at P = 3 (δ/2)^(2/3); X (P - X) + δ = 0 has none for
δ > 0.
"""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.continuation.location import branch_point
from fastslow.diagrams.field import FrozenField

pytestmark = pytest.mark.slow

x, p, q = sp.symbols("x p q")
FORMS = {
    "two lines": lambda u, v: u**2 - v**2,
    "transcritical": lambda u, v: u * (v - u),
    "pitchfork": lambda u, v: u * (v - u**2),
}


def traced(form, delta, a=0, s=1, b=0):
    rate = sp.expand(FORMS[form]((x - a) / sp.sympify(s), p - b) + delta)
    return fs.continue_equilibria(fs.Model({x: rate}, parameters={p: 0.5}), "p", (-1, 1))


PLACES = [(0, 1, 0), (0.25, 1, 0.125), (sp.Rational(1000, 3), 1000, sp.Rational(1, 3))]


@pytest.mark.parametrize(("a", "s", "b"), PLACES)
@pytest.mark.parametrize("delta", [1e-9, 1e-12, 1e-13])
def test_folds_that_face_each_other_across_a_gap_are_no_branch_point(delta, a, s, b):
    facing = traced("two lines", delta, a, s, b)
    assert facing.completeness == "complete"
    # rounding of the rates changes δ by 1e-16 of their terms
    expected = float(b) + np.sqrt(delta) * np.array([-1.0, 1.0])
    assert np.sort(facing.folds["p"]) == pytest.approx(expected, abs=3e-16 / np.sqrt(delta))
    assert len(facing.special("BP")) == 0
    assert len(traced("two lines", -delta, a, s, b).special("BP")) == 0


@pytest.mark.parametrize(("a", "s", "b"), PLACES)
def test_unfoldings_of_a_transcritical_point_and_a_pitchfork_are_no_branch_points(a, s, b):
    apart = traced("transcritical", 1e-12, a, s, b)
    assert (apart.completeness, len(apart.branches)) == ("complete", 2)
    assert set(apart.special["code"]) == {"EP"}
    bent = traced("pitchfork", 1e-14, a, s, b)
    assert bent.completeness == "complete"
    assert bent.special("BP")["p"].size == 0
    # rounding of 1e-15 over the slope there, (δ/2)^(1/3) = 1.7e-5
    assert bent.folds["p"] == pytest.approx([float(b) + 3 * (1e-14 / 2) ** (2 / 3)], abs=6e-11)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(("a", "s", "b"), PLACES)
def test_true_branch_points_are_decided(form, a, s, b):
    found = traced(form, 0, a, s, b)
    assert (found.completeness, len(found.folds)) == ("complete", 0)
    (point,) = found.special("BP")
    assert point.type is None
    assert (point["x"], point["p"]) == pytest.approx((float(a), float(b)), abs=1e-7 * float(s))


@pytest.mark.parametrize("delta", [1e-16, -1e-16])
def test_a_gap_below_the_smallest_steps_is_a_candidate_with_its_width(delta):
    found = traced("two lines", delta)
    (point,) = found.special("BP")
    assert point.type == "candidate"
    # the curves pass at 2 √δ, and the window is two units long
    assert "at 1e-08 of the window" in point.note
    assert (found.completeness, bool(found.outcome)) == ("found", True)
    assert found.outcome.notes == (f"BP1 is not decided: {point.note}.",)
    assert "branch point, candidate" in repr(found)
    assert "BP1 is not decided" in repr(found)


def test_a_branch_point_that_rounding_leaves_open_is_a_candidate():
    # the last term is zero, and rounded to 1e-10
    rate = (x - p) * (x + p) + q * (sp.cos(p + 1) ** 2 + sp.sin(p + 1) ** 2 - 1)
    model = fs.Model({x: rate}, parameters={p: 0.5, q: 1e6})
    found = fs.continue_equilibria(model, "p", (-1, 1))
    (point,) = found.special("BP")
    assert (point.type, found.completeness) == ("candidate", "found")
    assert "which rounding of the rates does not decide" in point.note


@pytest.mark.parametrize("delta", [1e-14, -1e-14, 1e-12])
def test_the_distance_of_two_curves_is_that_of_the_unfolding(delta):
    # x²/4 - p² = ∓δ: the nearest points are at x = ±2 √δ, or p = ±√δ
    model = fs.Model({x: x**2 / 4 - p**2 + delta}, parameters={p: 0.5})
    field = FrozenField(model.with_free("p"), "p")
    found = branch_point(
        lambda u: field.residual_and_jacobian(0, u), np.array([0.01, 0.02]), np.ones(2)
    )
    width = 2 * np.sqrt(abs(delta)) * (1 if delta > 0 else 2)
    assert found.extra[0] == pytest.approx(width, rel=1e-6)
