"""An overlay as data: shares of time, kinds of transitions, delays."""

import numpy as np
import pytest

import fastslow as fs
from fastslow.results.overlays import StableSheet, Transition
from fastslow.results.points import SpecialPoint


def special(code):
    return SpecialPoint(
        code, f"{code}1", ("x",), np.zeros(1), {"w": 0.5}, ("S1",),
        np.zeros(1, dtype=complex), np.zeros(2), 0.0, True,
    )  # fmt: skip


def transition(code, delay=0.1):
    point = special(code) if code else None
    return Transition(3.0, 0.6, np.ones(1), "S1", "S2", point, delay)


@pytest.mark.parametrize(
    ("code", "kind"), [("LP", "jump"), ("BE", "crossing"), ("HB", "change"), (None, "change")]
)
def test_kind(code, kind):
    assert transition(code).kind == kind


def test_summary(gear):
    diagram = fs.continue_equilibria(gear.frozen(), "w", over=(-2, 6))
    sheets = (StableSheet("S3", 0, 0, 5, "S3"), StableSheet("S1", 0, 9, 12, "S1"))
    time = np.linspace(0, 10, 11)
    lay = fs.Overlay(
        diagram,
        None,
        time,
        time / 10,
        np.zeros((11, 2)),
        np.zeros(11),
        sheets,
        np.array([0] * 3 + [1] * 8),
        (transition("BE"), transition(None, np.nan)),
    )
    lines = lay.summary().splitlines()
    assert lines[0] == "2 transitions over t = 0 to 10"
    assert lines[1:3] == ["  on S3: 30.0% of the time", "  on S1: 70.0% of the time"]
    assert "crossing at BE1 (w = 0.5), delay 0.1" in lines[3]
    assert "no special point" in lines[4]
    assert lay.delays == pytest.approx([0.1, np.nan], nan_ok=True)
    assert lay.parameter == "w"
    assert repr(lay).startswith("Overlay on w")
