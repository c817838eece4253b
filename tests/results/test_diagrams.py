"""Branches and diagrams as tables that answer questions."""

import pickle

import numpy as np
import pytest

import fastslow as fs


@pytest.fixture(scope="module")
def gear_diagram(gear):
    return fs.continue_equilibria(gear.frozen(), "w", over=(-2, 6))


@pytest.fixture(scope="module")
def folded(folded_gear):
    return fs.continue_equilibria(folded_gear.frozen(), "w", over=(-0.5, 0.5))


def test_columns(gear_diagram):
    (branch,) = gear_diagram.branches
    assert len(branch) == len(branch["x"]) == len(branch["w"]) == len(branch.stability)
    assert np.array_equal(branch["w"], branch.values)
    with pytest.raises(fs.UnknownNameError, match=r"unknown column 'y'.*known: x, v, w"):
        branch["y"]


def test_stability_goes_by_region(gear_diagram):
    (branch,) = gear_diagram.branches
    assert set(branch.stability[branch.region == "S2"]) == {"neutral"}
    assert np.all(branch.stable == (branch.region != "S2"))


def test_monotone_pieces(gear_diagram, folded):
    (branch,) = gear_diagram.branches
    assert [s.region for s in branch.monotone_pieces()] == ["S3", "S1"]
    (branch,) = folded.branches
    monotone_pieces = list(branch.monotone_pieces())
    assert [s.region for s in monotone_pieces] == ["S3", "S3", "S1", "S1"]
    for piece in monotone_pieces:
        steps = np.diff(branch.values[piece.start : piece.stop])
        assert np.all(steps > 0) or np.all(steps < 0)


def test_special_points_by_code(folded):
    assert [p.label for p in folded.folds] == ["LP1", "LP2"]
    loads = sorted(p["w"] for p in folded.folds)
    assert loads == pytest.approx([-0.0894402097712473, 0.0894402097712473], abs=1e-13)
    assert {p.interface for p in folded.boundary_equilibria} == {"x - D", "x + D"}
    assert folded.special("HB") == ()
    with pytest.raises(fs.UnknownNameError, match="unknown special point code 'LPP'; did you"):
        folded.special("LPP")


def test_equilibria_at_a_value(gear_diagram):
    (point,) = gear_diagram.at(w=1.0)
    x = point["x"]
    assert (x**2 + 41.67) * (x - 0.25) == pytest.approx(1.0, abs=1e-12)
    assert point.region == "S1"
    assert point.stable
    assert gear_diagram.at(w=1.0, stable=False) == []


def test_every_passage_at_a_value(folded):
    assert len(folded.at(w=0.05)) == 3
    assert [e.region for e in folded.at(w=0.05, stable=True)] == ["S3", "S1"]
    assert [e.region for e in folded.at(w=0.05, region="S1")] == ["S1"]


def test_a_vertical_segment_gives_its_ends(gear_diagram):
    points = gear_diagram.at(w=0.0)
    ends = [p for p in points if p.continuum]
    assert sorted(p["x"] for p in ends) == pytest.approx([-0.25, 0.25], abs=1e-14)


def test_values_that_are_not_there(gear_diagram):
    message = r"w = 7 is outside this diagram's range \[-2, 6\]"
    with pytest.raises(fs.ArgumentError, match=message):
        gear_diagram.at(w=7)
    with pytest.raises(fs.UnknownNameError, match="unknown diagram parameter 'ww'; did you mean"):
        gear_diagram.at(ww=1)
    with pytest.raises(fs.UnknownNameError, match="unknown region 'S4'"):
        gear_diagram.at(w=1, region="S4")


def test_without_its_model_a_diagram_interpolates_and_says_so(gear_diagram):
    again = pickle.loads(pickle.dumps(gear_diagram))
    assert again.corrector is None
    (read,), (solved,) = again.at(w=1.23), gear_diagram.at(w=1.23)
    assert read.interpolated
    assert not solved.interpolated
    assert read["x"] == pytest.approx(solved["x"], abs=1e-8)


def test_a_diagram_prints_as_a_small_tree(folded):
    lines = repr(folded).splitlines()
    assert lines[0].startswith("Diagram of x, v over w in [-0.5, 0.5]")
    assert "EP1 LP1 BE1 BE2 LP2 EP2" in lines[1]
    assert len(lines) == 6


def test_outcomes(gear_diagram):
    (branch,) = gear_diagram.branches
    assert branch.outcome.success
    assert bool(branch.outcome)
    assert "6" in str(branch.outcomes[1])


def test_stability_is_computed_once(gear_diagram, monkeypatch):
    branch = gear_diagram.branches[0]
    assert branch.stable is branch.stable
    assert branch.stability is branch.stability
    known, intervals = gear_diagram.bistable(1), branch.stable_intervals()

    def again(*_):
        raise AssertionError("computed again")

    monkeypatch.setattr("fastslow.results.branch.stability_intervals.multistable", again)
    monkeypatch.setattr("fastslow.results.branch.stability_intervals.stable_intervals", again)
    assert np.array_equal(gear_diagram.bistable(1), known)
    assert np.array_equal(branch.stable_intervals(), intervals)
