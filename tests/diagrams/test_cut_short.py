"""What was cut short, and what no special point explains, is said wherever it can mislead."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.errors import IncompleteWarning
from fastslow.results.points import SpecialPoints

pytestmark = pytest.mark.slow

x, y, p = sp.symbols("x y p")
SPIRAL = {x: (p - x**2 - y**2) * x - y, y: x + (p - x**2 - y**2) * y}


@pytest.fixture(scope="module")
def cusp():
    return fs.Model({x: p + x - x**3}, parameters={p: 0})


@pytest.fixture(scope="module")
def whole(cusp):
    return fs.continue_equilibria(cusp, "p", (-1, 1))


@pytest.fixture(scope="module")
def short(cusp):
    return fs.continue_equilibria(cusp, "p", (-1, 1), continuation=fs.Continuation(max_points=5))


def test_a_whole_diagram_says_nothing(whole):
    assert whole.outcome
    assert whole.completeness == "complete"
    assert "too many" not in repr(whole)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert len(whole.at(p=0)) == 3
        assert whole.bistable().shape == (1, 2)


def test_a_diagram_cut_short_says_so(short):
    assert not short.outcome
    assert short.outcome.code == "cut short"
    count = sum(any(not o.success for o in b.outcomes) for b in short.branches)
    assert f"{count} of {len(short)} branches ended unsuccessfully" in str(short.outcome)
    assert short.completeness == "found"
    assert str(short.outcome) in repr(short)
    assert "too many points at p =" in repr(short)
    assert str(short.outcome).split(" (")[0] in short._repr_html_()
    for branch in short.branches:
        failed = any(not o.success for o in branch.outcomes)
        assert ("too many points" in repr(branch)) == failed


def test_figures_name_the_reason_at_an_end_that_was_cut_short(whole, short):
    words = [tag.get_text() for tag in fs.plot.diagram(short).labels]
    assert "too many points" in words
    assert "too many points" not in [tag.get_text() for tag in fs.plot.diagram(whole).labels]


@pytest.mark.parametrize(
    "query",
    [lambda d: d.at(p=0.0), lambda d: d.bistable(), lambda d: d.nearest(p=0.0, x=0.0)],
    ids=["at", "bistable", "nearest"],
)
def test_queries_that_it_can_make_wrong_warn(short, query):
    with pytest.warns(IncompleteWarning, match="branches were cut short"):
        query(short)


def test_too_many_branches_warn(cusp):
    settings = fs.Continuation(max_branches=1)
    diagram = fs.continue_equilibria(cusp, "p", (-1, 1), continuation=settings)
    assert diagram.outcome.code == "too many branches"
    with pytest.warns(IncompleteWarning, match="there may be more branches"):
        diagram.at(p=0)


@pytest.fixture(scope="module")
def hopf():
    return fs.continue_equilibria(fs.Model(SPIRAL, parameters={p: 0}), "p", (-1, 0.7))


def without(diagram, code):
    """The diagram with the labels of one code taken away."""
    branches = []
    for branch in diagram.branches:
        kept = [
            (q, r)
            for q, r in zip(branch.special, branch.special_rows, strict=True)
            if q.code != code
        ]
        special, rows = SpecialPoints(q for q, _ in kept), tuple(r for _, r in kept)
        branches.append(replace(branch, special=special, special_rows=rows))
    return replace(diagram, branches=tuple(branches))


def test_a_change_without_a_point_is_an_entry(hopf, tmp_path):
    assert hopf.unexplained == ()
    bare = without(hopf, "HB")
    (change,) = bare.unexplained
    low, high = sorted(change.interval)
    assert low <= 0 <= high
    assert high - low < 0.1
    assert sorted((change.before, change.after)) == [0, 2]
    assert str(change) in repr(bare)
    assert str(change) in bare._repr_html_()
    with pytest.warns(IncompleteWarning, match="unexplained"):
        bare.at(p=0.5)
    bare.save(tmp_path / "bare.npz")
    assert fs.load(tmp_path / "bare.npz").unexplained == bare.unexplained
    assert bare.select(between=(0.2, 0.7)).unexplained == ()
    assert len(bare.select(between=(-0.3, 0.3)).unexplained) == 1


@pytest.mark.parametrize("code", ["LP", "EP"])
def test_folds_explain_their_changes(whole, code):
    assert len(without(whole, code).unexplained) == (2 if code == "LP" else 0)


def test_shared_branch_points_are_listed_once():
    """x (p − x²)(p − 1/2 − x): a pitchfork and two transcritical points."""
    model = fs.Model({x: x * (p - x**2) * (p - sp.Rational(3, 4) - x)}, parameters={p: 0})
    diagram = fs.continue_equilibria(model, "p", (-1, 1))
    points = diagram.special("BP")
    assert len({q.label for q in points}) == len(points)
    places = sorted((q["p"], q["x"]) for q in points)
    # x² = x + 3/4 at x = 3/2 (outside) and x = −1/2
    np.testing.assert_allclose(places, [(0, 0), (0.25, -0.5), (0.75, 0)], atol=1e-9)
    assert sum(len(b.special("BP")) for b in diagram.branches) > 3
    assert diagram.special() == diagram.special


def test_the_two_fold_of_welanders_ocean_box():
    """Convection with a jump in the exchange: both fields are tangent at T = 3/4, S = 3/5.

    T' = 1 − T − k T, S' = β (1 − S) − k S with k = 0 or 1 where S − α T is below or
    above ε, α = 4/5, β = 1/2 (Welander 1982; Leifeld 2018). On ρ = ε the drifts of ρ
    differ by ε, so both vanish at ε = 0 only, where T = (α − β)/(α (1 − β)).
    """
    T, S, e = sp.symbols("T S e")
    alpha, beta = sp.Rational(4, 5), sp.Rational(1, 2)
    k = sp.Piecewise((1, S - alpha * T > e), (0, True))
    model = fs.Model({T: 1 - T - k * T, S: beta * (1 - S) - k * S}, parameters={e: 0})
    diagram = fs.continue_equilibria(model, "e", (-0.1, 0.1))
    points = diagram.special("TF")
    assert points
    for point in points:
        assert [point["T"], point["S"]] == pytest.approx([0.75, 0.6], abs=1e-12)
        assert point["e"] == pytest.approx(0, abs=1e-13)
        assert point.residual < 1e-13
        assert point.words == "two-fold"
        assert point.interface in diagram.interfaces
    assert "TF1" in repr(diagram)


def test_random_polynomials_leave_nothing_unexplained():
    rng = np.random.default_rng(7)
    a, b, c, d = sp.symbols("a b c d")
    model = fs.Model(
        {x: p + a * x + y - x**3, y: b * x + c * y + d * x * y - y**3},
        parameters={p: 0, a: 1, b: 1, c: 1, d: 1},
    )
    for _ in range(12):
        values = dict(zip("abcd", rng.uniform(-2, 2, 4), strict=True))
        diagram = fs.continue_equilibria(model.with_parameters(values), "p", (-2, 2))
        assert diagram.unexplained == (), values


@pytest.mark.parametrize("half", [1e-2, 1e-4, 1e-6])
def test_two_hopf_points_are_told_apart_however_near(half):
    """Growth (p − 1/7)² − d²: a pair of Hopf points at 1/7 ± d."""
    d = sp.Symbol("d")
    growth = (p - sp.Rational(1, 7)) ** 2 - d**2 - x**2 - y**2
    model = fs.Model({x: growth * x - y, y: x + growth * y}, parameters={p: 0, d: half})
    points = fs.continue_equilibria(model, "p", (-1, 1.1)).special("HB")
    assert [h["p"] - 1 / 7 for h in points] == pytest.approx([-half, half], abs=1e-9)
