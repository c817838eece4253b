"""Pairs of special points in one step, edges of the domain, continua, offsets and bad scales."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from tests.certification.systems import cubic

pytestmark = pytest.mark.slow

x, y, p, q = sp.symbols("x y p q")


def test_a_fold_curve_is_one_of_folds_from_every_fold():
    """x' = p + q x + x²/2 − x⁴/4: folds on q = x³ − x, cusps at (1/12, ∓2/√27)."""
    model = fs.Model({x: p + q * x - x**4 / 4 + x**2 / 2}, parameters={p: 0, q: 0.1})
    folds = fs.continue_equilibria(model, "p", (-1, 1)).folds
    assert len(folds) == 3
    for fold in folds:
        curve = fs.continue_points(fold, ("p", "q"), over={"p": (-1, 1), "q": (-1, 1)})
        s = curve["x"]
        assert curve["q"] == pytest.approx(s**3 - s, abs=1e-14)
        assert curve["p"] + curve["q"] * s - s**4 / 4 + s**2 / 2 == pytest.approx(0, abs=1e-14)
        assert sorted(c["q"] for c in curve.special("CP")) == pytest.approx(
            [-2 / np.sqrt(27), 2 / np.sqrt(27)], rel=1e-12
        )


def test_two_folds_within_one_step_are_both_found():
    diagram = fs.continue_equilibria(
        fs.Model({x: p + x / 10000 - x**3}, parameters={p: 0}), "p", (-1, 1)
    )
    at = 0.01 / np.sqrt(3)
    assert sorted(f["x"] for f in diagram.folds) == pytest.approx([-at, at], rel=1e-11)
    assert [f["p"] for f in diagram.folds] == pytest.approx([2 * at**3, -2 * at**3], rel=1e-11)
    assert np.all(np.diff(diagram.branches[0]["x"]) > 0)


@pytest.mark.parametrize("gap", ["3e-3", "1e-3", "1e-4", "3e-5"])
def test_two_curves_whose_folds_face_each_other(gap):
    """The hyperbola (x − p)² = (p + s)² − g²: folds at p = −s ± g, from a step to a thousandth."""
    shift = sp.Rational(31, 10000)
    rate = (x - p) ** 2 - (p + shift) ** 2 + sp.Rational(gap) ** 2
    diagram = fs.continue_equilibria(fs.Model({x: rate}, parameters={p: 0}), "p", (-1, 1))
    assert diagram.completeness == "complete"
    expected = [-0.0031 - float(gap), -0.0031 + float(gap)]
    assert sorted(f["p"] for f in diagram.folds) == pytest.approx(expected, rel=1e-11)
    assert [set(np.sign(b["p"] + 0.0031)) for b in diagram.branches] == [{-1}, {1}]


def test_two_curves_of_a_random_system_whose_folds_face_each_other():
    """At p = 0.2559 and 0.2665; certificates prove that there are four curves."""
    rates, (*states, parameter), _ = cubic(2, 1344604275)
    model = fs.Model(dict(zip(states, rates, strict=True)), parameters={parameter: 0})
    window = dict.fromkeys(states, (-2, 2))
    diagram = fs.continue_equilibria(model, parameter, (-2, 2), window=window)
    assert (len(diagram), diagram.completeness) == (4, "complete")


def test_two_hopf_points_within_one_step_are_both_found():
    """Growth p² − 10⁻⁶: stable only for |p| < 10⁻³."""
    growth = p**2 - sp.Rational(1, 10**6) - x**2 - y**2
    model = fs.Model({x: growth * x - y, y: x + growth * y}, parameters={p: 0})
    diagram = fs.continue_equilibria(model, "p", (-1, 1.1))
    assert [h["p"] for h in diagram.special("HB")] == pytest.approx([-1e-3, 1e-3], rel=1e-10)
    assert diagram.at(p=0)[0].stable


def test_a_fold_far_from_zero():
    diagram = fs.continue_equilibria(
        fs.Model({x: p - (x - 10**6) ** 2}, parameters={p: 0}), "p", (-1, 1)
    )
    (fold,) = diagram.folds
    assert [fold["x"], fold["p"]] == pytest.approx([1e6, 0], abs=1e-9)
    assert diagram.branches[0].outcome.code == "end of range"


def test_where_the_rates_end_the_branch_says_so():
    """Logistic growth to the capacity q, which must not be zero."""
    diagram = fs.continue_equilibria(fs.Model({x: x * (1 - x / q)}, parameters={q: 1}), "q", (0, 5))
    assert len(diagram.branches) == 2
    for branch in diagram.branches:
        assert branch.values.min() < 1e-7
        assert branch.outcomes[0].code == "edge of domain"
        assert not branch.outcomes[0].success
        assert "may not be defined" in branch.outcomes[0].message


@pytest.mark.parametrize("unit", [1e-6, 1e6])
@pytest.mark.parametrize("level", [1e-6, 1e6])
def test_floats_of_any_size_in_equations_with_an_interface(unit, level):
    a, b = x / sp.Float(unit), p / sp.Float(level)
    rate = sp.Float(unit) * (b + a - a**3 + sp.Abs(a - sp.Rational(1, 5)) / 4)
    diagram = fs.continue_equilibria(fs.Model({x: rate}, parameters={p: 0}), "p", (-level, level))
    assert diagram.completeness == "complete"
    # slopes 1 ± 1/4 − 3a²
    folds = sorted(f["x"] / unit for f in diagram.folds)
    assert folds == pytest.approx([-0.5, np.sqrt(5 / 12)], rel=1e-12)
    (corner,) = diagram.boundary_equilibria
    assert corner["x"] / unit == pytest.approx(0.2, rel=1e-13)


@pytest.mark.parametrize(("rate", "value"), [(p, 0), ((3 * p - 1) * (x**2 + 1), 1 / 3)])
def test_a_continuum_that_is_no_branch_is_said(rate, value):
    diagram = fs.continue_equilibria(fs.Model({x: rate}, parameters={p: 0}), "p", (-1, 1.2))
    assert diagram.completeness == "found"
    assert diagram.outcome.code == "continuum"
    assert f"p = {value:.6g}" in diagram.outcome.message


def test_a_vertical_branch_is_reached_from_a_branch_point():
    """p (1 − x): the line x = 1 and every x at p = 0, which has no end."""
    model = fs.Model({x: p * (1 - x)}, parameters={p: 0})
    diagram = fs.continue_equilibria(
        model, "p", (-1, 1.2), continuation=fs.Continuation(max_points=200)
    )
    line, vertical = diagram.branches
    assert np.abs(line["x"] - 1).max() < 1e-14
    assert np.abs(vertical.values).max() < 1e-14
    assert np.ptp(vertical["x"]) > 1
    assert vertical.outcome.code == "too many points"
    assert diagram.completeness == "found"


def test_a_line_of_double_roots_is_one_branch():
    diagram = fs.continue_equilibria(fs.Model({x: x**2}, parameters={p: 0}), "p", (-1, 1))
    assert len(diagram.branches) == 1


def test_virtual_folds_are_called_virtual():
    model = fs.Model({x: p - sp.Abs(x) - x**2 / 4}, parameters={p: 0})
    diagram = fs.continue_equilibria(model, "p", (-2, 1), virtual=True)
    assert {(f["x"], f.admissible) for f in diagram.folds} == {(-2.0, False), (2.0, False)}
    assert all("virtual" in f.description for f in diagram.folds)
    (corner,) = [c for c in diagram.boundary_equilibria if c.admissible]
    assert corner.type == "non-smooth fold"


def test_curves_end_exactly_on_interfaces():
    both = fs.Model({x: p - x - sp.Abs(x) / 2, y: q - y - sp.Abs(y) / 2}, parameters={p: 0, q: 0.5})
    corner = fs.continue_equilibria(both, "p", (-1, 1)).boundary_equilibria[0]
    curve = fs.continue_points(corner, ("p", "q"), over={"p": (-1, 1), "q": (-1, 1)})
    assert {o.code for o in curve.outcomes} == {"interfaces meet", "end of range"}
    assert sorted(curve["q"][[0, -1]]) == pytest.approx([0, 1], abs=1e-15)
    bent = fs.Model({x: sp.Max(x - q, 0) + p - x**2}, parameters={p: 0, q: 0.5})
    fold = fs.continue_equilibria(bent, "p", (-1, 1)).folds[0]
    over = {"p": (-1, 1), "q": (-1, 1)}
    curve = fs.continue_points(fold, ("p", "q"), over=over, virtual=False)
    assert curve.admissible.all()
    (point,) = curve.special("BF")
    assert curve.special_rows[0] in (0, len(curve) - 1)
    assert [point["p"], point["q"]] == pytest.approx([0, 0], abs=1e-14)


def test_interfaces_that_coincide_are_crossed_together():
    # a dead zone of no width: x³ + A x = w, one smooth curve with its folds at x = ±√(−A/3)
    gear = fs.systems.harmonic_gear(D=0.0, A=-0.6)
    diagram = fs.continue_equilibria(gear.frozen(), "w", over=(-2, 2))
    assert (diagram.completeness, len(diagram.branches)) == ("complete", 1)
    height = 0.4 * np.sqrt(0.2)
    assert sorted(f["w"] for f in diagram.folds) == pytest.approx([-height, height], abs=1e-15)
    (corner,) = diagram.boundary_equilibria
    assert (corner.type, corner.state.tolist()) == ("persistence", [0.0, 0.0])
    assert sorted(e["x"] for e in diagram.at(w=0.0)) == pytest.approx(
        [-np.sqrt(0.6), 0.0, np.sqrt(0.6)], abs=1e-15
    )
    # next to it the gap is there, and so is its edge
    narrow = fs.continue_equilibria(gear.with_parameters(D=1e-9).frozen(), "w", over=(-2, 2))
    assert len(narrow.boundary_equilibria) == 2


def test_equilibria_that_lie_in_an_interface_all_along():
    # prey x, predator y; the prey is harvested above the very level at which the predator rests
    x, y, w = sp.symbols("x y w")
    harvest = sp.Piecewise((0.5 * x, x > 1), (0, True))
    model = fs.Model({x: x * (w - x - y) - harvest, y: y * (x - 1)}, parameters={w: 2})
    diagram = fs.continue_equilibria(model, "w", over=(1.6, 4))
    # they are the edges of a set: between them the level is kept by some of the harvest
    assert not any(np.abs(b["x"] - 1).max() < 1e-9 and b["y"].max() > 0.1 for b in diagram)
    (band,) = diagram.bands
    assert band.range == (1.6, 4.0)
    assert band.attracting
    assert np.abs(band.corners[:, :, 0] - 1).max() == 0.0
    np.testing.assert_allclose(band.corners[:, 0, 1], band.values - 1.5, atol=1e-12)
    np.testing.assert_allclose(band.corners[:, 1, 1], band.values - 1.0, atol=1e-12)
    # beside them: no prey, no predator above and at the level
    assert len(diagram) == 2


@pytest.fixture(scope="module")
def oregonator():
    """Tyson and Fife 1980, with z frozen."""
    q = sp.Symbol("q")
    z = sp.Symbol("z")
    fast = {x: 25 * (x * (1 - x) - z * (x - q) / (x + q))}
    return fs.Model(fast, slow={z: x - z}, parameters={q: 1e-3}).frozen()


@pytest.mark.parametrize(
    ("share", "lower"),
    [(1e-2, 1e-1), (1e-2, 1e-3), (8e-4, 1e-1), (8e-4, 1e-3), (1e-4, 1e-1), (1e-5, 1e-1)],
)
def test_a_fold_much_smaller_than_the_range_is_not_stepped_over(oregonator, share, lower):
    """z = x(1 − x)(x + q)/(x − q) has a fold of size q beside a pole and another branch.

    Its folds are the zeros of dz/dx, by NumPy.
    """
    p = np.polynomial.Polynomial
    above, below = p([0, 1]) * p([1, -1]) * p([share, 1]), p([-share, 1])
    roots = (above.deriv() * below - above * below.deriv()).roots()
    heights = {float(r.real): float((above(r) / below(r)).real) for r in roots if r.real > share}
    low = lower * min(heights.values())
    diagram = fs.continue_equilibria(
        oregonator.with_parameters(q=share), "z", over=(low, 0.6), window={"x": (share, 2)}
    )
    assert diagram.completeness == "complete"
    assert len(diagram) == 1
    found = sorted((fold["x"], fold["z"]) for fold in diagram.folds)
    assert np.array(found) == pytest.approx(np.array(sorted(heights.items())), rel=1e-9)


def test_a_zero_state_under_a_power_with_a_parameter_as_exponent():
    # Hill kinetics: x = 0 for all b, and a fold at b = 4/27**(1/4), x = 3**(1/4)
    rates, values = {x: p * x**q / (1 + x**q) - x}, {q: 4, p: 3}
    model = fs.Model(rates, parameters=values)
    states = [e["x"] for e in fs.equilibria(model)]
    assert states == pytest.approx([0, *np.roots([1, -3, 0, 0, 1])[[1, 0]].real], abs=1e-12)
    diagram = fs.continue_equilibria(model, "p", (0.5, 3))
    assert [len(diagram.at(p=value)) for value in (1, 2)] == [1, 3]
    (fold,) = diagram.folds
    assert [fold["p"], fold["x"]] == pytest.approx([4 / 27**0.25, 3**0.25], rel=1e-12)


def test_a_branch_that_meets_equilibria_within_an_interface_ends_at_their_branch_point() -> None:
    # x is a factor of its rate, so that x = 0 is within the interface of |x| at every a; beside
    # it a = |x| / (1 + x²)
    x, y, a = sp.symbols("x y a")
    rates = {x: x * (a - sp.Abs(x) / (1 + x**2)), y: -y + x}
    diagram = fs.continue_equilibria(
        fs.Model(rates, parameters={a: 0.2}), "a", over=(-1, 0.4), window={"x": (-3, 3)}
    )
    assert len(diagram.special("BE")) == 2
    for point in diagram.special("BE"):
        assert point.type == "degenerate"
        np.testing.assert_allclose([*point.state, point["a"]], 0, atol=1e-12)
    assert not diagram.special("LP")
    met = [b for b in diagram if np.any(b["x"] != 0) and np.abs(b["x"]).max() < 1]
    assert len(met) == 2
    for branch in met:
        size = np.abs(branch["x"])
        np.testing.assert_allclose(branch["a"], size / (1 + size**2), atol=1e-12)
        assert branch["a"].min() == pytest.approx(0, abs=1e-12)
