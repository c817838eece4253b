"""What cannot go on ends with a sentence, and what was computed stays."""

import numpy as np
import pytest
import sympy as sp
from scipy.optimize import brentq

import fastslow as fs

pytestmark = pytest.mark.slow

x, y, p, w, t = sp.symbols("x y p w t")


@pytest.fixture(scope="module")
def line():
    return fs.Model({x: p - x}, parameters={p: 0})


@pytest.mark.parametrize(
    ("over", "message"),
    [
        ((1, 1), r"over = \(1, 1\); expected two finite numbers"),
        ((2, -1), r"did you mean \(-1, 2\)"),
        ((0, np.inf), "expected two finite numbers"),
        ((0, "a"), "expected two finite numbers"),
        (3, "expected two finite numbers"),
    ],
)
def test_range(line, over, message):
    with pytest.raises(fs.FastSlowError, match=message):
        fs.continue_equilibria(line, "p", over)


def test_unknown_parameter(line):
    with pytest.raises(fs.FastSlowError, match="unknown parameter 'pp'; did you mean 'p'"):
        fs.continue_equilibria(line, "pp", (0, 1))


def test_a_model_that_is_not_frozen(gear):
    with pytest.raises(fs.FastSlowError, match=r"'w' still varies in time.*frozen"):
        fs.continue_equilibria(gear, "A", (0, 1))


def test_a_slow_quantity_without_value(gear):
    with pytest.raises(fs.FastSlowError, match=r"'w' has no value"):
        fs.continue_equilibria(gear.frozen(), "A", (0, 1))
    with pytest.raises(fs.FastSlowError, match=r"'w' has no value"):
        fs.equilibria(gear.frozen())


def test_no_equilibrium_at_all():
    diagram = fs.continue_equilibria(fs.Model({x: 1 + x**2 + p**2}, parameters={p: 0}), p, (0, 1))
    assert diagram.branches == ()
    assert diagram.at(p=0.5) == []


def test_the_edge_of_a_logarithm():
    """log p = x: the branch runs off to −∞ as p → 0."""
    diagram = fs.continue_equilibria(fs.Model({x: sp.log(p) - x}, parameters={p: 1}), p, (-1, 2))
    (branch,) = diagram.branches
    assert branch.values.min() > 0
    sure = branch.values > 1e-2
    assert np.abs(np.log(branch.values) - branch["x"])[sure].max() < 1e-12
    assert not branch.outcome.success
    assert branch.outcome.code in ("left the window", "step too small", "too many points")
    assert (
        "try" in branch.outcome.message
        or "singular" in branch.outcome.message
        or ("raise" in branch.outcome.message)
    )


def test_a_pole():
    """x = 1/p has two branches, each leaving at p = 0."""
    model = fs.Model({x: 1 - p * x}, parameters={p: 1})
    diagram = fs.continue_equilibria(model, p, (-1, 1))
    assert len(diagram.branches) == 2
    for branch in diagram.branches:
        assert branch.outcome.code == "left the window"
        assert "window=" in branch.outcome.message


def test_too_many_points_are_said(line):
    diagram = fs.continue_equilibria(line, p, (0, 1), continuation=fs.Continuation(max_points=10))
    assert diagram.branches[0].outcome.code == "too many points"
    assert "Continuation(max_points" in diagram.branches[0].outcome.message


def test_an_equilibrium_where_two_interfaces_meet():
    bend = sp.Abs(x) + sp.Abs(y)
    model = fs.Model({x: p - x - bend / 4, y: p - y + bend / 4}, parameters={p: 0})
    diagram = fs.continue_equilibria(model, p, (-1, 1))
    assert any(o.code == "interfaces meet" for b in diagram.branches for o in b.outcomes)
    assert all(
        "meet at the equilibrium" in o.message
        for b in diagram.branches
        for o in b.outcomes
        if o.code == "interfaces meet"
    )


def test_a_start_exactly_on_an_interface():
    """At p = 0, an end of the range, the equilibrium of x' = p − x − |x|/2 is on x = 0."""
    diagram = fs.continue_equilibria(
        fs.Model({x: p - x - sp.Abs(x) / 2}, parameters={p: 0}), p, (0, 1)
    )
    assert [e["x"] for e in diagram.at(p=0.75)] == pytest.approx([0.5], abs=1e-14)
    assert len(diagram.branches) == 1


def test_equilibria_of_a_model_without_parameters():
    found = fs.equilibria(fs.Model({x: 1 - x**2}))
    assert [(e["x"], e.stable) for e in found] == [(-1.0, False), (1.0, True)]
    assert found.completeness == "complete"


def test_a_double_root_is_one_equilibrium():
    found = fs.equilibria(fs.Model({x: (x - 1) ** 2}))
    assert [e["x"] for e in found] == pytest.approx([1.0], abs=1e-7)
    assert found[0].stability == "neutral"


def test_too_many_branches_are_said():
    """Six lines x = p + k, of which five are traced."""
    model = fs.Model({x: sp.prod(x - p - k for k in range(6))}, parameters={p: 0})
    diagram = fs.continue_equilibria(
        model, p, (-0.5, 0.5), continuation=fs.Continuation(max_branches=5)
    )
    assert len(diagram.branches) == 5
    assert diagram.completeness == "found"
    assert diagram.outcome.code == "too many branches"
    assert "Continuation(max_branches" in repr(diagram)


@pytest.mark.parametrize("function", [fs.equilibria, fs.tangencies])
def test_points_of_a_model_that_is_not_frozen(gear, function):
    with pytest.raises(fs.FastSlowError, match=r"'w' still varies in time; .*model\.frozen\(\)"):
        function(gear)


def test_a_range_whose_squares_overflow(gear):
    with pytest.raises(fs.FastSlowError, match=r"over = .*of at most 1e\+100 in size"):
        fs.continue_equilibria(gear.frozen(), "w", over=(-1e300, 1e300))


def test_steps_do_not_pass_waves():
    """Far from the origin the waves of (sin(x)/10 - 1)/x are shorter than a tenth of x."""
    model = fs.Model({x: 1 + p * x - sp.sin(x) / 10}, parameters={p: 0.3})
    diagram = fs.continue_equilibria(model, "p", over=(-1.5, 1.5), window={"x": (0.5, 300)})

    def slope(x):
        return x * np.cos(x) - np.sin(x) + 10

    grid = np.linspace(0.5, 300, 30_000)
    places = np.flatnonzero(np.diff(np.sign(slope(grid))))
    exact = [brentq(slope, grid[k], grid[k + 1], xtol=1e-13) for k in places]
    assert len(exact) == 92
    assert np.sort([fold["x"] for fold in diagram.folds]) == pytest.approx(exact, abs=1e-10)


def test_folds_without_end_are_cut_short():
    model = fs.Model({x: 1 + p * x - sp.sin(x) / 10}, parameters={p: 0.3})
    diagram = fs.continue_equilibria(
        model, "p", over=(-1.5, 1.5), from_points=[{"x": 1, "p": np.sin(1) / 10 - 1}]
    )
    (branch,) = diagram
    codes = {outcome.code: outcome.message for outcome in branch.outcomes}
    assert "folded 200 times" in codes["too many folds"]
    assert len(branch.special("LP")) == 200
    assert "too many folds" in repr(diagram)
