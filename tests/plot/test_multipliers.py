"""Floquet multipliers in the complex plane."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs

from .cases import folded_orbits

pytestmark = pytest.mark.slow

x, v, t = sp.symbols("x v t")


def texts(drawn):
    return [label.get_text() for label in drawn.labels]


def test_sides_of_the_unit_circle():
    """A saddle orbit of a linear model: μ = exp(±2π·0.1)."""
    model = fs.Model({x: x / 10 + sp.cos(t), v: -v / 10 + sp.cos(t)})
    drawn = fs.plot.multipliers(fs.find_orbit(model, [0, 0]))
    data = drawn.data
    assert data["outside the unit circle"][0] == pytest.approx(
        np.array([[np.exp(0.2 * np.pi), 0.0]]), rel=1e-10
    )
    assert data["inside the unit circle"][0] == pytest.approx(
        np.array([[np.exp(-0.2 * np.pi), 0.0]]), rel=1e-10
    )
    assert "trivial multiplier" not in data
    assert texts(drawn) == []


def test_multiplier_below_the_smallest_number():
    """μ = exp(−2000π) underflows; its logarithm does not."""
    orbit = fs.find_orbit(fs.Model({x: -x + sp.sin(t / 1000)}), [0])
    assert orbit.multipliers[0] == 0
    drawn = fs.plot.multipliers(orbit)
    assert texts(drawn) == [r"$1.8\times 10^{-2729}$"]
    assert "exactly 0" not in drawn.data
    (place,) = fs.plot.multipliers(orbit, log=True).data["inside the unit circle"][0]
    assert place == pytest.approx([0.0, -2000 * np.pi / np.log(10)], rel=1e-10)


@pytest.mark.parametrize("log", [False, True])
def test_exactly_zero_and_trivial(log):
    """A relay with sliding has the multiplier 0, and one for perturbations along the orbit."""
    slip = sp.Symbol("u")
    friction = sp.Piecewise((-1, v > slip), (1, True)) / (1 + 3 * sp.Abs(v - slip))
    block = fs.Model({x: v, v: -x + friction}, parameters={slip: sp.Rational(1, 5)})
    orbit = fs.find_orbit(block, [0.5, 0.0])
    assert np.isneginf(orbit.log_multipliers[1])
    drawn = fs.plot.multipliers(orbit, log=log)
    assert drawn.data["trivial multiplier"][0].tolist() == [[0, 0] if log else [1, 0]]
    assert drawn.data["exactly 0"][0].tolist() == [[0, -1] if log else [0, 0]]
    assert texts(drawn) == ([] if log else ["0"])
    if log:
        assert drawn.ax.get_ylim()[0] == -1


def test_branch():
    """The fold is drawn at 1, and the paths are interrupted where the itinerary changes."""
    branch = folded_orbits()
    drawn = fs.plot.multipliers(branch)
    assert drawn.data["LPC fold of cycles"][0] == pytest.approx(np.array([[1.0, 0.0]]), abs=1e-8)
    assert len(drawn.paths) == 2
    assert sorted(texts(drawn)) == ["GR1", "LPC1"]
    points = np.vstack([p for path in drawn.paths for p in path.get_segments()])
    largest = np.abs(branch.multipliers).max()
    assert np.hypot(*points.T).max() == pytest.approx(largest, rel=1e-12)
    log = fs.plot.multipliers(branch, log=True)
    heights = np.vstack([p for path in log.paths for p in path.get_segments()])[:, 1]
    assert heights.max() == pytest.approx(np.log10(largest), rel=1e-12)


def test_no_orbit():
    model = fs.Model({x: x, v: -v})
    with pytest.raises(fs.ArgumentError):
        fs.plot.multipliers(fs.find_orbit(model, [1, 1]))
