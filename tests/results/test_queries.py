"""What branches and diagrams answer, against closed forms and against plain searches."""

import numpy as np
import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st

import fastslow as fs
from fastslow.results.branch import table as rows
from fastslow.results.branch.table import monotone_runs
from fastslow.results.points import SpecialPoints

FOLD = 1 / np.sqrt(3)


@pytest.fixture(scope="module")
def branch(cubic):
    return cubic()


@pytest.fixture(scope="module")
def folded(folded_gear):
    return fs.continue_equilibria(folded_gear.frozen(), "w", over=(-0.5, 0.5))


@pytest.fixture(scope="module")
def pitchfork():
    x, q = sp.symbols("x q")
    model = fs.Model({x: q * x - x**3}, parameters={q: 0})
    return fs.continue_equilibria(model, "q", over=(-1, 1))


def test_expressions(branch, folded):
    assert np.array_equal(branch["x**3 - x"], branch["x"] ** 3 - branch["x"])
    assert branch["p - (x**3 - x)"] == pytest.approx(np.zeros(len(branch)), abs=1e-15)
    assert np.array_equal(branch["q*x"], 2 * branch["x"])
    assert np.array_equal(branch["q"], np.full(len(branch), 2.0))
    x, p = sp.symbols("x p")
    written = sp.Max(sp.Abs(x) - 1, sp.sin(p), -sp.pi)
    expected = np.maximum(np.abs(branch["x"]) - 1, np.sin(branch["p"]))
    assert np.array_equal(branch[written], expected)
    assert np.isnan(branch["sqrt(-1 - x**2)"]).all()
    assert np.isinf(branch["1/(x - x)"]).sum() + np.isnan(branch["1/(x - x)"]).sum() == len(branch)
    assert np.array_equal(folded["w - v"], np.concatenate([b["w"] - b["v"] for b in folded]))
    # a value for every row
    column = branch["3"]
    assert column.strides == (8,)
    assert column.shape == (len(branch),)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("y", "unknown column 'y' .*known: x, p, q"),
        ("x + lst", "unknown column 'lst'"),
        ("sn(x)", "unknown function 'sn'; did you mean 'sin'"),
        ("sin(x, p)", "sin takes 1 argument, received 2"),
        ("max()", "max takes 2 to 12 arguments, received 0"),
        ("max(x)", "max takes 2 to 12 arguments, received 1"),
        ("__import__('os')", "cannot read \"'os'\"|unknown function"),
        ("x.real", "attributes cannot be read"),
        ("x if p else q", "cannot read"),
        ("[x]", "cannot read"),
        ("x[0]", "cannot read"),
        ("x // 2", "cannot read"),
        ("True", "'True' is a condition; expected a value"),
        ("(lambda: x)()", "cannot read"),
        ("x -", "is not an expression in x, p"),
        ("", "is not an expression"),
        ("1e999999**", "is not an expression"),
        ("9" * 5000, "not an expression|too large"),
        ("(" * 500 + "x" + ")" * 500, "not an expression"),
    ],
)
def test_what_is_no_expression(branch, text, message):
    with pytest.raises((fs.ArgumentError, fs.UnknownNameError), match=message):
        branch[text]


@pytest.mark.parametrize("key", [5.0, None, 1j, ["x"], b"x", True])
def test_what_is_no_text_is_no_column(branch, key):
    with pytest.raises(fs.ArgumentError, match="expected a name such as 'x' or an expression") as e:
        branch[key]
    assert ("at(p=5.0)" in str(e.value)) == (key == 5.0)


def test_a_diagram_has_no_slices(branch):
    diagram = fs.continue_equilibria(fs.systems.cusp().frozen(), "p", over=(-1, 1))
    with pytest.raises(fs.ArgumentError, match=r"diagram.branches\[0:2\]"):
        diagram[0:1]


def test_a_value_is_given_by_name(branch):
    with pytest.raises(fs.ArgumentError, match=r"received 0.1 without a name.* at\(p=0.1\)"):
        branch.at(0.1)


def test_a_sum_of_many_terms(branch):
    assert branch["+".join(["x"] * 991)] == pytest.approx(991 * branch["x"], rel=1e-12)


def test_conditions_within_a_piecewise(branch):
    found = branch["Piecewise((-x, x < 0), (x**2, (x >= 0) & (x < 0.5)), (7, x < 0.8))"]
    x = branch["x"]
    expected = np.where(x < 0, -x, np.where(x < 0.5, x**2, np.where(x < 0.8, 7.0, np.nan)))
    np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(branch["Heaviside(x, 1) + Mod(x, 0.25)"], (x >= 0) + x % 0.25)


def test_huge_powers_end(branch):
    assert np.all(np.isinf(branch["9**9**9**9"]))


def test_at_a_value(branch):
    value = 0.2
    roots = np.sort(np.roots([1, 0, -1, -value]).real)
    read = branch.at(p=value)
    # cubic interpolation over steps of 0.05
    assert [e["x"] for e in read] == pytest.approx(roots, abs=2e-4)
    assert [e.stable for e in read] == [True, False, True]
    assert all(e.interpolated for e in read)
    assert [e["q"] for e in read] == [2.0] * 3
    (low, high) = branch.at(p=value, stable=True)
    assert low["x"] < high["x"]
    (exact,) = branch.at(p=float(branch["p"][0]))
    assert exact["x"] == -1.5
    assert not exact.interpolated
    fold = float(branch["p"][branch.special_rows[1]])
    assert [e["x"] for e in branch.at(p=fold)] == pytest.approx([-FOLD, 2 * FOLD], abs=1e-3)
    with pytest.raises(fs.ArgumentError, match=r"p = 7 is outside this branch's range \[-1.875"):
        branch.at(p=7)
    with pytest.raises(fs.ArgumentError, match="p = nan; expected a finite number"):
        branch.at(p=np.nan)
    with pytest.raises(fs.ArgumentError, match="p = 'high'; expected a finite number"):
        branch.at(p="high")
    with pytest.raises(fs.UnknownNameError, match="unknown branch parameter 'w'"):
        branch.at(w=1)
    with pytest.raises(fs.UnknownNameError, match="unknown region 'S2'"):
        branch.at(p=0.1, region="S2")


def test_a_branch_of_a_diagram_is_corrected(folded):
    (branch,) = folded.branches
    for one, other in zip(branch.at(w=0.05), folded.at(w=0.05), strict=True):
        assert one["x"] == other["x"]
        assert not one.interpolated
        assert dict(one.parameters) == dict(other.parameters)


def plain(parameter, where):
    """Rows at a value, and steps over which it is passed, by looking at every row."""
    level = np.flatnonzero(parameter == where)
    runs = np.split(level, np.flatnonzero(np.diff(level) > 1) + 1) if level.size else []
    passed = np.flatnonzero((parameter[:-1] - where) * (parameter[1:] - where) < 0)
    return [(int(r[0]), int(r[-1])) for r in runs], passed.tolist()


@given(
    steps=st.lists(st.integers(-2, 2), min_size=1, max_size=40),
    where=st.integers(-8, 8),
    half=st.booleans(),
)
def test_values_are_found_as_by_looking_at_every_row(steps, where, half):
    parameter = np.cumsum([0.0, *steps])
    value = where + 0.5 * half
    level, passed = monotone_runs(parameter).around(value, 1e-12)
    assert (level, sorted(passed)) == plain(parameter, value)


def test_a_value_costs_a_search_on_the_pieces_that_hold_it(cubic, monkeypatch):
    branch = cubic(1_000_001)
    searches = []
    search = np.searchsorted

    class Counting:
        def __getattr__(self, name):
            return getattr(np, name)

        @staticmethod
        def searchsorted(*args, **more):
            searches.append(len(args[0]))
            return search(*args, **more)

    monkeypatch.setattr(rows, "np", Counting())
    assert len(branch.table.monotone_runs.first) == 3
    known = branch.table.monotone_runs
    assert len(branch.at(p=0.2)) == 3
    assert len(searches) == 6
    assert len(branch.at(p=1.8)) == 1
    assert len(searches) == 8
    assert branch.table.monotone_runs is known


def test_rows_of_a_branch(branch):
    assert branch[3]["x"] == branch["x"][3]
    assert branch[-1]["p"] == branch["p"][-1]
    assert branch[np.int64(2)].stable == branch.stable[2]
    with pytest.raises(IndexError):
        branch[len(branch)]
    assert [e["x"] for e in branch] == branch["x"].tolist()
    assert len(list(branch)) == len(branch)


@given(start=st.integers(0, 62), length=st.integers(1, 63))
def test_slices_keep_their_special_points(branch, start, length):
    part = branch[start : start + length]
    stop = min(start + length, len(branch))
    assert np.array_equal(part["x"], branch["x"][start:stop])
    assert [p.label for p in part.special] == [
        p.label
        for p, row in zip(branch.special, branch.special_rows, strict=True)
        if start <= row < stop
    ]
    for p, row in zip(part.special, part.special_rows, strict=True):
        assert part["x"][row] == p["x"]
    assert (part.outcomes[0].code == "cut") == (start > 0)
    assert (part.outcomes[1].code == "cut") == (stop < len(branch))


def test_slices_that_are_none(branch):
    assert branch[:] is branch
    with pytest.raises(
        fs.ArgumentError, match="rows 5 to 5 contain none of the 63 points of the branch"
    ):
        branch[5:5]
    with pytest.raises(fs.ArgumentError, match="step of 1, received 2"):
        branch[::2]


def test_a_slice_that_begins_on_a_corner_keeps_it(folded):
    (branch,) = folded.branches
    corner = branch.special_rows[2]
    assert branch.special[2].code == "BE"
    part = branch[corner + 1 : corner + 20]
    assert part.special[0].label == branch.special[2].label
    assert part.special_rows[0] == 0


def test_parts(branch, folded):
    stable = branch.select(stable=True)
    assert [len(part.special) for part in stable] == [1, 1]
    assert all(part.stable.all() for part in stable)
    others = branch.select(stable=False)
    assert sum(map(len, (*stable, *others))) == len(branch)
    (middle,) = others
    assert [p.label for p in middle.special] == ["LP1", "LP2"]
    assert [len(b.select(code="LP")) for b in (branch, middle, stable[0])] == [1, 1, 0]
    for part in branch.select(between=(-0.1, 0.1)):
        assert np.abs(part["p"]).max() <= 0.1
    assert len(branch.select(between=(-0.1, 0.1))) == 3
    assert branch.select(between=(5, 6)) == ()
    inside = folded.select(region="S1", stable=True)
    assert isinstance(inside, fs.Diagram)
    assert {r for b in inside for r in b.region} == {"S1"}
    assert all(b.stable.all() for b in inside)
    near = folded.select(between=(-0.01, 0.01))
    assert near.over == (-0.01, 0.01)
    assert [p.code for p in near.special] == ["BE", "BE"]
    with pytest.raises(fs.ArgumentError, match="outside this diagram's range"):
        near.at(w=0.3)
    with pytest.raises(fs.ArgumentError, match="between=\\(3, 4\\) is outside"):
        folded.select(between=(3, 4))
    for wrong in ((1, 0), (1,), "ab", (np.nan, 1)):
        with pytest.raises(fs.ArgumentError, match="expected two numbers, the lower one first"):
            branch.select(between=wrong)
    with pytest.raises(fs.UnknownNameError, match="unknown region 'S9'"):
        folded.select(region="S9")
    with pytest.raises(fs.UnknownNameError, match="unknown special point code 'XX'"):
        folded.select(code="XX")


def test_stable_and_bistable_intervals_end_at_special_points(branch, folded):
    top = 2 / 3 * FOLD
    assert branch.stable_intervals() == pytest.approx(
        np.array([[-1.875, top], [-top, 1.875]]), abs=1e-15
    )
    (gear,) = folded.branches
    low, high = sorted(folded.folds["w"])
    assert sorted(map(tuple, gear.stable_intervals())) == [(-0.5, high), (low, 0.5)]
    assert folded.bistable().tolist() == [[low, high]]
    assert folded.bistable(1).tolist() == [[-0.5, 0.5]]
    assert folded.bistable(3).shape == (0, 2)
    with pytest.raises(fs.ArgumentError, match="min_count = 0"):
        folded.bistable(0)


def test_bistable_beyond_a_pitchfork(pitchfork):
    assert pitchfork.bistable() == pytest.approx(np.array([[0, 1]]), abs=1e-12)


def test_nothing_is_bistable_where_one_sheet_takes_over_from_another(gear):
    diagram = fs.continue_equilibria(gear.frozen(), "w", over=(-2, 6))
    assert diagram.bistable().shape == (0, 2)


def test_nearest(branch, folded):
    # onto the line x = 0.3: the nearest point of the curve is where x is 0.3
    found = branch.nearest(x=0.3)
    assert found["x"] == pytest.approx(0.3, abs=1e-3)
    for wanted in folded[0]:
        if not wanted.continuum:
            again = folded.nearest(w=wanted["w"], x=wanted["x"])
            assert again["x"] == pytest.approx(wanted["x"], abs=1e-12)
    far = branch.nearest(p=-100, x=-1.5)
    assert far["p"] == branch["p"][0]
    with pytest.raises(fs.ArgumentError, match="expected values of some of x, p"):
        branch.nearest()
    with pytest.raises(fs.UnknownNameError, match="unknown state or parameter 'q'"):
        branch.nearest(q=1)
    with pytest.raises(fs.ArgumentError, match="x = inf"):
        branch.nearest(x=np.inf)


def test_nearest_on_a_vertical_segment(gear):
    diagram = fs.continue_equilibria(gear.frozen(), "w", over=(-2, 6))
    found = diagram.nearest(w=0.0, x=0.1)
    assert found["x"] == pytest.approx(0.1, abs=1e-12)
    assert (found["w"], found.region) == (pytest.approx(0, abs=1e-14), "S2")
    assert found.interpolated


def test_branches_of_a_diagram(pitchfork):
    assert len(pitchfork) == len(pitchfork.branches) == len(list(pitchfork))
    assert pitchfork[0] is pitchfork.branches[0]
    assert len(pitchfork["x"]) == sum(map(len, pitchfork))
    assert np.abs(pitchfork["q*x - x**3"]).max() < 1e-12
    with pytest.raises(IndexError):
        pitchfork[9]


def test_sheets_of_a_long_branch_are_those_of_every_row(branch):
    assert [(s.start, s.stop) for s in branch.monotone_pieces()] == [
        (0, branch.special_rows[1] + 1),
        (branch.special_rows[1], branch.special_rows[2] + 1),
        (branch.special_rows[2], len(branch)),
    ]


def test_special_points_as_columns(folded):
    points = folded.special
    assert points["w"].tolist() == [p["w"] for p in points]
    assert isinstance(points[1:3], SpecialPoints)
    assert points[0].label == points[:1][0].label
    with pytest.raises(fs.UnknownNameError, match="unknown column 'ww'"):
        points["ww"]


def test_runs_answer_expressions(gear):
    run = fs.simulate(gear, [0, 0], periods=1)
    assert np.array_equal(run["x**2 + v"], run["x"] ** 2 + run["v"])
    assert np.array_equal(run["D*t"], 0.25 * run.t)
    overlay = fs.overlay(fs.continue_equilibria(gear.frozen(), "w", over=(-2, 6)), run)
    assert np.array_equal(overlay["x - D"], overlay.state[:, 0] - 0.25)
    assert np.array_equal(overlay["distance*w"], overlay.distance * overlay.slow)
    section = run.section(interface="x - D")
    assert set(section["x"]) == {0.25}
    assert np.array_equal(section["v**2"], section["v"] ** 2)
    for result in (run, overlay, section):
        with pytest.raises(fs.UnknownNameError, match=r"unknown .* 'zz'"):
            result["zz"]
