"""Queries of an overlay: at a value, in an interval, and near a point."""

from itertools import pairwise

import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

import fastslow as fs
from fastslow.results.overlay.transitions import Transitions

x, t, g, w, omega = sp.symbols("x t g w omega")

#: x' = w + x − x³ with w = cos(ωt): jumps at both folds, four times in two periods.
MODEL = fs.Model({x: w + x - x**3}, forcing={w: sp.cos(omega * t)}, parameters={omega: 0.002})


@pytest.fixture(scope="module")
def run():
    return fs.simulate(MODEL, [1.3], periods=2)


@pytest.fixture(scope="module")
def overlay(run):
    return fs.overlay(fs.continue_equilibria(MODEL.frozen(), "w", over=(-1.2, 1.2)), run)


@pytest.fixture(scope="module")
def on_path(run):
    """The same over g = −w, along a path."""
    fast = MODEL.frozen(slow={w: -g})
    return fs.overlay(fs.continue_equilibria(fast, "g", over=(-1.2, 1.2)), run)


def test_the_slow_quantity_is_passed_at_known_times(overlay):
    found = overlay.at(w=0.5)
    angles = np.array([1, 5, 7, 11]) * np.pi / 3
    assert [m.time for m in found] == pytest.approx(angles / 0.002, rel=1e-11)
    assert [m.value for m in found] == pytest.approx([0.5] * 4, abs=1e-12)
    falling, rising = overlay.at(w=0.0)[:2]
    assert falling["x"] > 0 > rising["x"]
    assert falling.stable_branch != rising.stable_branch
    assert [m.stable_branch for m in overlay.at(w=0.0)] == [
        falling.stable_branch,
        rising.stable_branch,
    ] * 2
    on_lower = overlay.at(w=0.0, stable_branch=rising.stable_branch)
    assert [m.time for m in on_lower] == [m.time for m in overlay.at(w=0.0, direction=1)]


def test_a_state_carries_the_stable_branch_followed(overlay):
    (point,) = overlay.at(t=100.0)
    row = int(np.argmin(np.abs(overlay.t - 100)))
    stable_branch = overlay.stable_branches[overlay.followed[row]]
    assert (point.stable_branch, point.branch) == (
        stable_branch.label,
        stable_branch.branch,
    )
    assert point.distance == pytest.approx(overlay.distance[row], rel=0.1)
    assert point.value == point["w"] == pytest.approx(np.cos(0.2), abs=1e-12)
    assert point["omega"] == 0.002
    assert point["t"] == 100.0
    assert f"on {stable_branch.label}" in repr(point)


@settings(max_examples=30, deadline=None)
@given(part=st.floats(0, 1))
def test_a_moment_of_the_overlay_is_that_of_the_run(overlay, part):
    when = part * overlay.run.span[1]
    (point,) = overlay.at(t=when)
    assert np.array_equal(point.state, overlay.run(when))
    row = np.searchsorted(overlay.t, when, side="right") - 1
    number = overlay.followed[row]
    assert point.stable_branch == ("" if number < 0 else overlay.stable_branches[number].label)


def test_samples_by_number(overlay):
    points = list(overlay)
    assert len(points) == len(overlay)
    assert [m.distance for m in points] == overlay.distance.tolist()
    assert [m.value for m in points] == pytest.approx(overlay.slow, abs=1e-15)
    assert overlay[-1].time == overlay.t[-1]
    with pytest.raises(fs.OutOfRangeError, match="no row"):
        overlay[len(overlay)]
    with pytest.raises(fs.ArgumentError, match="an overlay is sliced with a step of 1"):
        overlay[::-1]


@settings(max_examples=30, deadline=None)
@given(data=st.data())
def test_slices_joined_are_the_whole(overlay, data):
    middle = data.draw(st.integers(1, len(overlay) - 1))
    parts = overlay[:middle], overlay[middle:]
    for name in ("t", "x", "w", "distance"):
        assert np.array_equal(np.concatenate([p[name] for p in parts]), overlay[name])
    for part in parts:
        assert len(part.run) == len(part)
        assert part.phases[0].start >= part.t[0] if part.phases else len(part) == 1
    # what happens between the two samples is in neither
    between = [q for q in overlay.transitions if overlay.t[middle - 1] < q.time < overlay.t[middle]]
    assert sum(len(p.transitions) for p in parts) + len(between) == len(overlay.transitions)


def test_selections_on_a_stable_branch(overlay):
    labels = [stable_branch.label for stable_branch in overlay.stable_branches]
    episodes = [overlay.select(stable_branch=label) for label in labels]
    assert [len(part) for part in episodes] == [2, 3]
    for label, parts in zip(labels, episodes, strict=True):
        assert all(part.shares() == {label: 1.0} for part in parts)
        assert sum(map(len, parts)) == np.isin(overlay.followed, labels.index(label)).sum()
    assert overlay.select() == (overlay,)
    assert overlay.select(stable_branch="") == ()


def test_phases_of_a_kind(overlay):
    jumps = overlay.select(type="jump")
    assert len(jumps) == len(overlay.transitions.select(type="jump")) == 4
    for part, transition in zip(jumps, overlay.transitions.select(type="jump"), strict=True):
        assert part.transitions == (transition,)
        assert transition.leave.time <= part.t[0] < part.t[-1] <= transition.land.time
        assert [phase.type for phase in part.phases] == ["jump"]
        assert part.bursting is None
    assert overlay.select(type="oscillating") == ()


def test_one_sample(overlay):
    one = overlay[7:8]
    assert (len(one), one.phases, one.transitions) == (1, (), ())
    assert one.select(type="jump") == ()
    assert one.select(stable_branch=overlay[7].stable_branch) == (one,)
    assert (
        one.at(t=overlay.t[7])[0].stable_branch
        == one.nearest(x=3).stable_branch
        == overlay[7].stable_branch
    )


def test_between_times(overlay):
    (part,) = overlay.select(between=(1000, 2000), region="S1")
    assert 1000 <= part.t[0] < part.t[-1] <= 2000
    for one, other in pairwise(part.phases):
        assert one.end == other.start
    assert overlay.select(between=(1e6, 2e6)) == ()


def test_a_part_is_kept_in_a_file(overlay, tmp_path, same):
    part = overlay.select(type="jump")[0]
    part.save(tmp_path / "part.npz")
    again = fs.load(tmp_path / "part.npz")
    assert same(again, part)
    assert again.at(t=part.t[1])[0].stable_branch == part.at(t=part.t[1])[0].stable_branch


def test_transitions_of_a_kind(overlay):
    assert isinstance(overlay.transitions, Transitions)
    assert overlay.transitions.select(type="Hopf") == ()
    with pytest.raises(fs.UnknownNameError, match="did you mean 'jump'"):
        overlay.transitions.select(type="jmp")


def test_the_parameter_of_a_path(overlay, on_path):
    found = on_path.at(g=-0.5)
    assert [m.time for m in found] == pytest.approx([m.time for m in overlay.at(w=0.5)], rel=1e-3)
    assert all(m.interpolated for m in found)
    assert [m.value for m in found] == pytest.approx([-0.5] * 4, abs=1e-12)
    assert found[0]["w"] == pytest.approx(0.5, abs=1e-3)
    assert [m.time for m in on_path.at(w=0.5)] == [m.time for m in overlay.at(w=0.5)]
    near = on_path.nearest(g=-0.5, x=found[0]["x"], t=found[0].time)
    assert near.time == pytest.approx(found[0].time, rel=1e-6)
    with pytest.raises(fs.ArgumentError, match="g = 3 is outside this run's range"):
        on_path.at(g=3)


def test_nearest(overlay):
    found = overlay.nearest(w=0.0, x=1.0)
    assert found["x"] == pytest.approx(1.0, abs=1e-2)
    assert found.stable_branch == overlay.at(w=0.0)[0].stable_branch
    with pytest.raises(fs.UnknownNameError, match="unknown column 'q'"):
        overlay.nearest(q=0)
