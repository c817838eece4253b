"""Branches through given equilibria only."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs

x, y, p = sp.symbols("x y p")


@pytest.fixture(scope="module")
def pitchfork():
    return fs.Model({x: p * x - x**3, y: x**2 - y}, parameters={p: 0.25})


@pytest.fixture(scope="module")
def full(pitchfork):
    return fs.continue_equilibria(pitchfork, p, (-1, 1))


def only(model, *points, **options):
    return fs.continue_equilibria(model, p, (-1, 1), from_points=points, **options)


def test_one_branch_of_two(pitchfork):
    diagram = only(pitchfork, {x: 0.4, y: 0.2, p: 0.2})
    (branch,) = diagram
    np.testing.assert_allclose(branch["x"] ** 2, branch["p"], atol=1e-14)
    assert branch["x"][[0, -1]].tolist() in ([-1, 1], [1, -1])
    assert diagram.completeness == "found"
    assert diagram.outcome.code == "from points"
    assert "only branches through the 1 given point were traced" in repr(diagram)


def test_points_of_the_same_branch_trace_it_once(pitchfork):
    points = [{"x": s, "y": 0.25, "p": 0.25} for s in (0.5, -0.5)]
    assert len(only(pitchfork, *points)) == 1


def test_from_equilibria(pitchfork):
    found = fs.equilibria(pitchfork)
    assert len(only(pitchfork, *found)) == 2
    zero = next(e for e in found if e["x"] == 0)
    (branch,) = only(pitchfork, zero)
    assert np.abs(branch["x"]).max() == 0
    assert len(branch) < 100


def test_every_special_point_leads_to_its_branches(pitchfork, full):
    """Both branches through a branch point, the one of an end point."""
    for branch in full:
        for point in branch.special:
            again = only(pitchfork, point)
            assert len(again) == (2 if point.code == "BP" else 1)
            if point.code == "EP":
                np.testing.assert_allclose(
                    np.sort(again[0]["x"][[0, -1]]), np.sort(branch["x"][[0, -1]]), atol=1e-12
                )


def test_through_interfaces_from_each_point_of_the_gear():
    gear = fs.systems.harmonic_gear(A=-0.6).frozen()
    full = fs.continue_equilibria(gear, "w", (-0.3, 0.3))
    for point in full.special:
        again = fs.continue_equilibria(gear, "w", (-0.3, 0.3), from_points=[point])
        assert [q.code for q in again.special] == [q.code for q in full.special]
        for one, other in zip(again.special, full.special, strict=True):
            np.testing.assert_allclose(one.state, other.state, atol=1e-13)


def test_a_virtual_point():
    model = fs.Model({x: p - sp.Abs(x)}, parameters={p: -0.5})
    point = fs.equilibria(model, virtual=True)[0]
    with pytest.raises(fs.ArgumentError, match="is virtual, outside its region"):
        only(model, point)
    assert not only(model, point, virtual=True)[0].admissible


def test_a_window_that_excludes_the_start(pitchfork):
    with pytest.raises(fs.ArgumentError, match=r"x = 0.5, y = 0.25 is outside the window x in \["):
        only(pitchfork, {x: 0.5, y: 0.25, p: 0.25}, window={x: (-1, 0)})


def test_a_point_of_another_model(pitchfork):
    other = fs.Model({x: p - x}, parameters={p: 0})
    with pytest.raises(fs.ArgumentError, match="is a point of another model"):
        only(pitchfork, fs.equilibria(other)[0])


def test_a_point_that_is_none(pitchfork):
    moved = fs.equilibria(pitchfork.with_parameters(p=0.9))[0]
    wrong = fs.Equilibrium(**{**moved.__dict__, "parameters": {"p": 0.1}})
    with pytest.raises(fs.ArgumentError, match="no equilibrium of the model was found from"):
        only(pitchfork, wrong)
    with pytest.raises(fs.ArgumentError, match="no equilibrium of the model was found from"):
        only(fs.Model({x: 1 + x**2 + p**2}, parameters={p: 0}), {x: 0, p: 0})


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_the_units_of_a_branch_are_measured(unit):
    """From one point where x is small, the circle x² + p² = 1/4 in as many rows as always."""
    model = fs.Model({x: (x / unit) ** 2 + p**2 - sp.Rational(1, 4)}, parameters={p: 0})
    (branch,) = only(model, {x: 1e-3 * unit, p: 0.4999})
    assert branch.closed
    assert len(branch) < 260
    np.testing.assert_allclose(np.hypot(branch["x"] / unit, branch["p"]), 0.5, rtol=1e-13)


def test_a_branch_to_infinity():
    (branch,) = only(fs.Model({x: 1 - p * x}, parameters={p: 0}), {x: 2, p: 0.5})
    assert branch.outcomes[0].code == "left the window"
    assert len(branch) < 300


def test_is_kept_in_a_file(pitchfork, tmp_path):
    diagram = only(pitchfork, {x: 0.4, y: 0.2, p: 0.2})
    diagram.save(tmp_path / "one.npz")
    assert fs.load(tmp_path / "one.npz").outcome == diagram.outcome
