"""The gear's equilibrium diagram against its closed form.

In S1 (x² + A)(x − D) = w, v = 0; S3 is its mirror image; the gap holds a
vertical segment at w = 0 (Ding 2023, with the third region put right).
"""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import fastslow as fs
from fastslow.diagrams.solve import starts
from fastslow.diagrams.solve.solving import solve_at
from tests.samples import examples

FOLD_W = 0.0894402097712473068105567770438  # closed form, mpmath at 40 digits
FOLD_X = 0.538244802131872687595973447891
VIRTUAL_W = 0.287125394956432491995740862229
VIRTUAL_X = 0.371578135465206020929306781224


@pytest.fixture(scope="module")
def diagram(gear):
    return fs.continue_equilibria(gear.frozen(), "w", over=(-2, 6))


@pytest.fixture(scope="module")
def folded(folded_gear):
    return fs.continue_equilibria(folded_gear.frozen(), "w", over=(-0.3, 0.3), virtual=True)


def residuals(branch, parameters):
    """Closed-form load minus the parameter, row by row."""
    a, d = parameters["A"], parameters["D"]
    x = branch["x"]
    load = np.select(
        [branch.region == "S1", branch.region == "S3"],
        [(x**2 + a) * (x - d), (x**2 + a) * (x + d)],
        0.0,
    )
    return load - branch["w"]


def test_one_branch_through_all_three_regions(diagram):
    (branch,) = diagram.branches
    assert list(dict.fromkeys(branch.region.tolist())) == ["S3", "S2", "S1"]
    assert [p.code for p in branch.special] == ["EP", "BE", "BE", "EP"]
    assert (branch["w"][0], branch["w"][-1]) == (-2, 6)
    assert branch.outcome.code == "end of range"


def test_every_row_is_on_the_closed_form(diagram, gear):
    (branch,) = diagram.branches
    assert np.abs(residuals(branch, gear.parameters)).max() < 5e-15 * 42
    assert np.abs(branch["v"]).max() == 0


def test_the_gap_is_a_vertical_segment(diagram, gear):
    (branch,) = diagram.branches
    gap = branch.region == "S2"
    assert np.abs(branch["w"][gap]).max() < 1e-15
    assert branch["x"][gap][[0, -1]] == pytest.approx([-0.25, 0.25], abs=1e-15)
    assert np.all(np.diff(branch["x"][gap]) > 0)
    assert set(branch.stability[gap]) == {"neutral"}


def test_both_corners_are_degenerate_boundary_equilibria(diagram, gear):
    lower, upper = diagram.boundary_equilibria
    assert (lower.label, upper.label) == ("BE1", "BE2")
    stiffness = gear.parameters["A"] + gear.parameters["D"] ** 2
    for point, x, interface in ((lower, -0.25, "x + D"), (upper, 0.25, "x - D")):
        assert point.type == "degenerate"
        assert point.interface == interface
        assert point.state == pytest.approx([x, 0], abs=1e-15)
        assert abs(point["w"]) < 1e-15
        assert point.residual < 1e-15
    assert lower.regions == ("S3", "S2")
    assert lower.clarke.determinants == pytest.approx((stiffness, 0), abs=1e-13)
    # the path's determinant is q(A + D²), its trace −1
    path = lower.clarke.path(np.array([0.3]))[0]
    assert np.prod(path).real == pytest.approx(0.3 * stiffness, rel=1e-13)
    assert np.sum(path).real == pytest.approx(-1, abs=1e-13)
    assert lower.clarke.q_zero is None


def test_no_fold_for_positive_stiffness(diagram):
    assert diagram.folds == ()


def test_both_folds_to_fifteen_digits(folded):
    real = [p for p in folded.folds if abs(p["w"]) < 0.2]
    assert sorted(p["w"] for p in real) == pytest.approx([-FOLD_W, FOLD_W], abs=2e-16)
    assert sorted(p["x"] for p in real) == pytest.approx([-FOLD_X, FOLD_X], abs=1e-14)
    # a = −(3x − D) in S1, with q = (1, 0) and p = (1, 1)
    upper = next(p for p in real if p["x"] > 0)
    assert upper.coefficient == pytest.approx(-(3 * FOLD_X - 0.25), rel=1e-10)


def test_virtual_folds(folded):
    unreal = [p for b in folded.branches if not b.admissible for p in b.special if p.code == "LP"]
    assert sorted(p["w"] for p in unreal) == pytest.approx([-VIRTUAL_W, VIRTUAL_W], abs=1e-14)
    assert sorted(p["x"] for p in unreal) == pytest.approx([-VIRTUAL_X, VIRTUAL_X], abs=1e-12)


def test_virtual_branches_end_on_the_interface_exactly(folded):
    ends = [p for b in folded.branches if not b.admissible for p in b.special if p.code == "EP"]
    on_interface = [p for p in ends if "is admissible beyond" in p.note]
    assert sorted(p["x"] for p in on_interface) == pytest.approx([-0.25, 0.25], abs=1e-15)
    assert [p["w"] for p in on_interface] == pytest.approx([0, 0], abs=1e-15)


def test_at_agrees_with_companion_roots(folded):
    """NumPy's roots of the closed-form cubic, kept where they are admissible."""
    for w in np.linspace(-0.29, 0.29, 24):
        upper = np.roots([1, -0.25, -0.6, 0.15 - w])
        lower = np.roots([1, 0.25, -0.6, -0.15 - w])
        expected = [r.real for r in upper if abs(r.imag) < 1e-12 and r.real > 0.25]
        expected += [r.real for r in lower if abs(r.imag) < 1e-12 and r.real < -0.25]
        found = [e["x"] for e in folded.at(w=w) if e.admissible]
        assert sorted(found) == pytest.approx(sorted(expected), abs=1e-13)
        again = [e["x"] for e in fs.equilibria(folded_model(), w=w)]
        assert sorted(again) == pytest.approx(sorted(expected), abs=1e-13)


def folded_model():
    return fs.systems.harmonic_gear(A=-0.6).frozen()


def test_at_zero_load_the_two_ends_of_the_continuum(diagram):
    found = diagram.at(w=0)
    assert sorted(e["x"] for e in found) == pytest.approx([-0.25, 0.25], abs=1e-15)
    assert all(e.continuum for e in found)


def test_at_filters_and_refuses(diagram):
    (point,) = diagram.at(w=1.0, stable=True)
    assert point.region == "S1"
    assert point.type == "focus"
    assert diagram.at(w=1.0, stable=False) == []
    with pytest.raises(fs.FastSlowError, match=r"w = 7 is outside .* \[-2, 6\]"):
        diagram.at(w=7)
    with pytest.raises(fs.FastSlowError, match="did you mean 'w'"):
        diagram.at(ww=1)


def test_marks_are_hit_exactly(gear):
    diagram = fs.continue_equilibria(gear.frozen(), "w", (-1, 1), marks=[0.1, 0.2])
    assert [p["w"] for p in diagram.special("UZ")] == pytest.approx([0.1, 0.2], abs=1e-15)
    with pytest.raises(fs.FastSlowError, match=r"mark w = 3 is outside the range \[-1, 1\]"):
        fs.continue_equilibria(gear.frozen(), "w", (-1, 1), marks=[3])


@settings(max_examples=examples(12), deadline=None)
@given(st.floats(-3, 3), st.floats(0.05, 1))
def test_symmetry(a, d):
    """x → −x, w → −w maps the diagram to itself; two folds exist exactly for A < −D²."""
    fold_x = (d + np.sqrt(max(d**2 - 3 * a, 0))) / 3
    fold_w = abs((fold_x**2 + a) * (fold_x - d))
    assume(abs(a + d**2) > 1e-3)
    assume(abs(fold_w - 1.5) > 1e-3)
    model = fs.systems.harmonic_gear(A=a, D=d).frozen()
    diagram = fs.continue_equilibria(model, "w", (-1.5, 1.5))
    codes = [p.code for p in diagram.special]
    assert codes.count("BE") == 2
    assert codes.count("LP") == (2 if a < -(d**2) and fold_w < 1.5 else 0)
    for point in diagram.special:
        mirrored = [
            max(abs(p["w"] + point["w"]), abs(p["x"] + point["x"]))
            for p in diagram.special
            if p.code == point.code
        ]
        assert min(mirrored) < 1e-11
    for branch in diagram.branches:
        assert np.abs(residuals(branch, model.parameters)).max() < 1e-12


def test_other_parameters(gear):
    """Over A at fixed load the branches of S1 and S3, with the fold where dw/dx = 0."""
    model = gear.frozen().with_parameters(w=0.5)
    diagram = fs.continue_equilibria(model, "A", (-2, 2))
    (fold,) = diagram.folds
    x = fold["x"]
    assert 3 * x**2 + 2 * 0.25 * x + fold["A"] == pytest.approx(0, abs=1e-13)
    assert (x**2 + fold["A"]) * (x + 0.25) == pytest.approx(0.5, abs=1e-13)


def test_a_continuum_on_a_branch_is_not_solved_for(monkeypatch):
    """The gap of the gear at w = 0 is seen to be a part of the branch."""
    values = []

    def solved(field, value, *args, **kwargs):
        values.append(value)
        return solve_at(field, value, *args, **kwargs)

    monkeypatch.setattr(starts, "solve_at", solved)
    gear = fs.systems.harmonic_gear(D=0.2345).frozen()
    diagram = fs.continue_equilibria(gear, "w", over=(-2, 6))
    assert diagram.completeness == "complete"
    assert 0.0 not in values
    assert len(values) == len(set(values)) == 4
