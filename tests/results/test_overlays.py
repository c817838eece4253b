"""An overlay as data: shares of time, its story, expressions."""

from dataclasses import replace

import numpy as np
import pytest

import fastslow as fs
from fastslow.results.overlay.transitions import Phase, StableBranch, Transition
from fastslow.results.points import SpecialPoint
from fastslow.results.trajectory.queries.state_at import StatePoint


def special(code):
    return SpecialPoint(
        code, f"{code}1", ("x",), np.zeros(1), {"w": 0.5}, ("S1",),
        np.zeros(1, dtype=complex), np.zeros(2), 0.0, True,
    )  # fmt: skip


def state_at(time, value):
    return StatePoint(time, ("x",), np.ones(1), {"w": value}, parameter="w")


def transition(code, kind, **more):
    point = special(code) if code else None
    leave = state_at(2.5, 0.55)
    return Transition(
        3.0, 0.6, np.ones(1), "S1", "S2", point, 0.1 if code else np.nan, kind, leave, **more
    )


@pytest.fixture(scope="module")
def overlay(gear):
    diagram = fs.continue_equilibria(gear.frozen(), "w", over=(-2, 6))
    run = fs.simulate(gear, [0, 0], periods=1)
    return fs.overlay(diagram, run)


def test_duration_and_width():
    landed = transition("LP", "jump", land=state_at(4.0, 0.7))
    assert (landed.duration, landed.width) == pytest.approx((1.5, 0.15))
    assert np.isnan(transition("LP", "jump").duration)


def test_sentences():
    text = transition("LP", "jump", land=state_at(4.0, 0.7)).description
    assert text == (
        "t = 3, w = 0.6: S1 → S2, jump at LP1, w = 0.5; delay 0.1; lands at w = 0.7, t = 4"
    )
    assert "no bifurcation nearby" in transition(None, "loss of tracking").description
    steep = transition(None, "steep", steepness=0.234).description
    assert "no bifurcation: the predicted lag |dX/dw| |dw/dt| / |λ| reaches 0.23" in steep


def test_shares_and_summary(overlay):
    stable_branches = (StableBranch("S3", 0, 0, 5, "S3"), StableBranch("S1", 0, 9, 12, "S1"))
    time = np.linspace(0, 10, 11)
    made = replace(
        overlay,
        t=time,
        slow=time / 10,
        stable_branches=stable_branches,
        followed=np.array([0] * 3 + [1] * 6 + [-1] * 2),
        lag=np.full(11, -0.5),
        phases=(
            Phase(0, 8, "quasi-static", ("S3", "S1")),
            Phase(8, 10, "oscillating", (), 4, "cycle"),
        ),
        transitions=(transition("BE", "crossing"),) * 14,
        bursting=None,
    )
    assert made.shares() == pytest.approx({"": 0.1, "S3": 0.3, "S1": 0.6})
    lines = made.summary().splitlines()
    assert lines[0] == "Overlay on w: 14 transitions over t = 0 to 10, w from 0 to 1"
    assert "  on no stable branch: 10.0% of the time" in lines
    assert "  on S3: 30.0% of the time, median lag -0.5" in lines
    assert "  1 oscillating phase on a cycle: 4 oscillations, duration 2" in lines
    assert lines[-1] == "  … 2 more, see transitions"
    assert made.delays == pytest.approx([0.1] * 14)


def test_expressions(overlay):
    assert overlay["x"] == pytest.approx(overlay.state[:, 0], abs=0)
    expected = overlay.state[:, 0] ** 2 + overlay.state[:, 1] - 41.67 * overlay.slow
    assert overlay["x**2 + v - A*w"] == pytest.approx(expected, abs=1e-12)
    assert overlay["1"].shape == overlay.t.shape
    with pytest.raises(fs.UnknownNameError, match="unknown column 'y'"):
        overlay["y"]


def test_repr(overlay):
    assert repr(overlay).startswith("Overlay on w: 2 transitions over t = 0 to 628.319")
