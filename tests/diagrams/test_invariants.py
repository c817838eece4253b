"""A sample of the campaign of invariants, and what the invariants notice."""

from dataclasses import replace

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.results.points import SpecialPoints
from tests.campaigns import invariants
from tests.invariants import violations

pytestmark = pytest.mark.slow

x, y, p = sp.symbols("x y p")


@pytest.mark.sample(0)
def test_a_sample_of_the_campaign_of_random_systems():
    report = invariants.campaign(1, 5)
    assert not report.failures, str(report)
    assert report.equilibria > 3


def test_lyapunov_coefficients_by_differences_have_the_closed_form():
    """x' = p x − y + a x³, y' = x + p y with a unit eigenvector has l₁ = 6a |q₁|⁴/2 = 3a/4."""
    rates = {x: p * x - y + 2 * x**3, y: x + p * y}
    (hopf,) = fs.continue_equilibria(fs.Model(rates, parameters={p: 0}), "p", (-1, 1)).special("HB")
    exact = invariants.lyapunov_by_differences(rates, hopf, hopf["p"])
    assert exact == pytest.approx(hopf.lyapunov, rel=1e-12)
    assert exact == pytest.approx(3 * 2 / 4, rel=1e-12)


@pytest.fixture(scope="module")
def diagram():
    """A fold, a Hopf point and a neutral saddle."""
    model = fs.Model({x: y - x**3 + x, y: p - x - y / 2}, parameters={p: 0})
    return fs.continue_equilibria(model, "p", (-1, 1))


def changed(diagram, code, **entries):
    (branch,) = diagram.branches
    points = [replace(q, **entries) if q.code == code else q for q in branch.special]
    return replace(diagram, branches=(replace(branch, special=SpecialPoints(points)),))


def test_what_a_point_says_is_compared_with_its_eigenvalues(diagram):
    assert not violations(diagram)
    (first, *_) = diagram.special("HB")
    wrong = changed(diagram, "HB", frequency=first.frequency * (1 + 1e-5))
    assert any("has the frequency" in one for one in violations(wrong))
    moved = changed(diagram, "HB", eigenvalues=first.eigenvalues + 1e-4)
    assert any("has no imaginary pair" in one for one in violations(moved))


def test_missing_points_take_completeness_away(diagram):
    (branch,) = diagram.branches
    nothing = replace(branch, special=SpecialPoints(), special_rows=())
    found = violations(replace(diagram, branches=(nothing,), completeness="complete"))
    assert any("no special point explains it" in one for one in found)


def test_rows_that_are_not_finite_are_noticed(diagram):
    (branch,) = diagram.branches
    state = np.where(np.arange(len(branch))[:, None] == 5, np.nan, branch.state)
    (found,) = violations(replace(diagram, branches=(replace(branch, state=state),)))
    assert found == "branch 0 has rows that are not finite"
