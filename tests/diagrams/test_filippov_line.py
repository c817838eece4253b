"""Pseudo-equilibria of one state, where the switch itself is the equilibrium."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs

x, p = sp.symbols("x p")


def regions(branch):
    return list(dict.fromkeys(branch.region.tolist()))


def test_a_line_that_sticks_at_its_switch():
    """x' = p − x − sgn x: x = 0 slides for |p| < 1, reached in finite time."""
    diagram = fs.continue_equilibria(
        fs.Model({x: p - x - sp.sign(x)}, parameters={p: 0}), p, (-2, 2)
    )
    assert diagram.completeness == "complete"
    (branch,) = diagram.branches
    assert regions(branch) == ["S2", "S1|S2", "S1"]
    assert [b.label for b in branch.special] == ["EP1", "BE1", "BE2", "EP2"]
    assert [b["p"] for b in branch.special("BE")] == pytest.approx([-1, 1], abs=1e-15)
    assert [b.regions for b in branch.special("BE")] == [("S2", "S1|S2"), ("S1|S2", "S1")]
    assert all(b.interface == "x" and b.clarke is None for b in branch.special("BE"))
    assert all(b.residual < 1e-15 for b in branch.special("BE"))
    assert np.all(branch.stable)
    sliding = branch.region == "S1|S2"
    assert np.all(branch.eigenvalues[sliding, 0].real == -np.inf)
    assert (
        np.abs(branch["x"] - np.sign(branch["p"]) * np.maximum(np.abs(branch["p"]) - 1, 0)).max()
        < 1e-15
    )
    (point,) = diagram.at(p=0.5, region="S1|S2")
    assert (point.pseudo, point.stability, point.type) == (True, "stable", "pseudo-node")
    assert "stable pseudo-node" in repr(point)
    assert not diagram.at(p=1.5)[0].pseudo
    with pytest.raises(fs.FastSlowError, match=r"unknown region 'S1\|S3'; did you mean 'S1\|S2'"):
        diagram.at(p=0, region="S1|S3")


def test_a_line_that_escapes_from_its_switch():
    """x' = p − x + sgn x: for |p| < 1 x = 0 lies between two nodes, as a saddle would."""
    model = fs.Model({x: p - x + sp.sign(x)}, parameters={p: 0})
    diagram = fs.continue_equilibria(model, p, (-2, 2))
    (branch,) = diagram.branches
    assert regions(branch) == ["S2", "S1|S2 (escaping)", "S1"]
    assert {b.type for b in branch.special("BE")} == {"non-smooth fold"}
    assert [b["p"] for b in branch.special("BE")] == pytest.approx([1, -1], abs=1e-15)
    found = diagram.at(p=0.25)
    assert [e["x"] for e in found] == [-0.75, 0, 1.25]
    assert [e.stability for e in found] == ["stable", "unstable", "stable"]
    assert found[1].eigenvalues.real.tolist() == [np.inf]
    again = fs.equilibria(model, p=0.25)
    assert sorted(e["x"] for e in again) == [-0.75, 0, 1.25]
    assert again.completeness == "complete"


def test_virtual_pseudo_equilibria_are_listed_once():
    model = fs.Model({x: p - x - sp.sign(x)}, parameters={p: 1.5})
    found = fs.equilibria(model, virtual=True)
    assert [(e.region, e.admissible, e["x"]) for e in found] == [
        ("S1", True, 0.5),
        ("S2", False, 2.5),
        ("S1|S2", False, 0.0),
    ]
    diagram = fs.continue_equilibria(model, p, (-2, 2), virtual=True)
    virtual = [b for b in diagram.branches if not b.admissible and regions(b) == ["S1|S2"]]
    ends = sorted((b.values.min(), b.values.max()) for b in virtual)
    assert ends == [(-2, pytest.approx(-1, abs=1e-15)), (pytest.approx(1, abs=1e-15), 2)]


@pytest.mark.parametrize("value", [-1, 1])
def test_exactly_at_the_boundary_there_is_one_equilibrium(value):
    """α = 0 and α = 1: equilibrium and pseudo-equilibrium are the same point."""
    model = fs.Model({x: p - x - sp.sign(x)}, parameters={p: 0})
    (point,) = fs.equilibria(model, p=value)
    assert point["x"] == 0
    assert not point.pseudo
    diagram = fs.continue_equilibria(model, p, tuple(sorted((value, 3 * value))))
    assert len(diagram.branches) == 1
    inward = fs.continue_equilibria(model, p, tuple(sorted((value, 0))))
    assert len(inward.branches) == 1
    assert [e.region for e in inward.at(p=value / 2)] == ["S1|S2"]


def test_a_staircase_of_two_discontinuities():
    """x' = p − x − 2 sgn over |x| > 1: sticks at −1 for p in (−3, −1), at 1 for (1, 3)."""
    step = sp.Piecewise((2, x > 1), (-2, x < -1), (0, True))
    diagram = fs.continue_equilibria(fs.Model({x: p - x - step}, parameters={p: 0}), p, (-6, 6))
    (branch,) = diagram.branches
    assert regions(branch) == ["S3", "S2|S3", "S2", "S1|S2", "S1"]
    assert [b["p"] for b in branch.special("BE")] == pytest.approx([-3, -1, 1, 3], abs=1e-14)
    assert {b.type for b in branch.special("BE")} == {"persistence"}
    assert diagram.completeness == "complete"


def test_a_discontinuous_and_a_continuous_interface_in_line():
    """x' = p − x − sgn(x − 1) − |x|/2: corner at p = −1, sticking for p in (1/2, 5/2)."""
    rate = p - x - sp.sign(x - 1) - sp.Abs(x) / 2
    model = fs.Model({x: rate}, parameters={p: 0})
    (branch,) = fs.continue_equilibria(model, p, (-4, 4)).branches
    assert regions(branch) == ["S3", "S2", "S1|S2", "S1"]
    assert [b["p"] for b in branch.special("BE")] == pytest.approx([-1, 0.5, 2.5], abs=1e-14)
    assert [b.clarke is None for b in branch.special("BE")] == [False, True, True]


def test_sliding_turns_to_escaping_at_a_two_fold():
    """x' = p sgn x: a = p, b = −p at x = 0."""
    model = fs.Model({x: p * sp.sign(x)}, parameters={p: 0})
    sliding, escaping = fs.continue_equilibria(model, p, (-1, 1)).branches
    assert (regions(sliding), regions(escaping)) == (["S1|S2"], ["S1|S2 (escaping)"])
    assert [o.code for o in sliding.outcomes] == ["end of range", "two-fold"]
    assert abs(sliding["p"][-1]) < 1e-14
    assert np.all(sliding.stable[:-1])
    assert set(escaping.stability[1:]) == {"unstable"}


def test_a_closed_branch_of_an_arc_and_a_sliding_segment():
    """(x − 1)² + p² = 4 for x > 0, closed by x = 0, where a = p² − 3 < 0 < b = 1."""
    arc = p**2 + (x - 1) ** 2 - 4
    model = fs.Model({x: sp.Piecewise((arc, x > 0), (1, True))}, parameters={p: 0})
    diagram = fs.continue_equilibria(model, p, (-3, 3))
    (branch,) = diagram.branches
    assert branch.closed
    assert branch.outcome.code == "closed loop"
    assert diagram.completeness == "complete"
    assert sorted(b["p"] for b in branch.special("BE")) == pytest.approx(
        [-np.sqrt(3), np.sqrt(3)], rel=1e-14
    )
    assert {b.type for b in branch.special("BE")} == {"persistence"}
    assert sorted(f["p"] for f in branch.special("LP")) == pytest.approx([-2, 2], rel=1e-14)
    outside = branch.region == "S1"
    left = branch["p"] ** 2 + (branch["x"] - 1) ** 2 - 4
    assert np.abs(left[outside]).max() < 1e-13
    assert np.abs(branch["x"][~outside]).max() < 1e-15
