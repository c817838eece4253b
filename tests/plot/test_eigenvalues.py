"""Eigenvalues drawn in the complex plane."""

import numpy as np
import pytest
import sympy as sp
from matplotlib.figure import Figure

import fastslow as fs


def values(drawn):
    """All points of all paths as complex numbers."""
    parts = [p for path in drawn.paths for p in path.get_segments()]
    xy = np.vstack(parts)
    return xy[:, 0] + 1j * xy[:, 1]


def test_the_path_of_the_gear(gear_overlay):
    """On the flanks −1/2 ± i √(det − 1/4), in the gap 0 and −1."""
    drawn = fs.plot.eigenvalue_path(gear_overlay)
    found = values(drawn)
    x = np.abs(gear_overlay.state[:, 0]).max()
    upper = np.sqrt(3 * x**2 - 0.5 * x + 41.67 - 0.25)
    flank = found[np.abs(found.imag) > 1e-9]
    assert flank.real == pytest.approx(np.full(len(flank), -0.5), abs=1e-12)
    assert np.abs(flank.imag).max() == pytest.approx(upper, rel=5e-3)
    gap = np.sort(np.unique(found[np.abs(found.imag) < 1e-9].real.round(9)))
    assert gap.tolist() == [-1.0, 0.0]


def test_eigenvalues_jump_at_interfaces(gear_overlay):
    drawn = fs.plot.eigenvalue_path(gear_overlay)
    assert len(drawn.jumps) == 4
    for line in drawn.jumps:
        ends = line.get_xdata() + 1j * line.get_ydata()
        inside, outside = sorted(ends, key=lambda z: abs(z.imag))
        assert inside in (0, -1)
        assert abs(outside.imag) == pytest.approx(np.sqrt(41.67 + 0.0625 - 0.25), rel=1e-9)
    assert {t.get_text() for t in drawn.labels} == {"BE1", "BE2"}


def test_hopf_points_are_marked_on_the_imaginary_axis():
    model = fs.systems.van_der_pol()
    diagram = fs.continue_equilibria(model.frozen(), "w", over=(-2, 2))
    drawn = fs.plot.eigenvalue_path(diagram.branches[0])
    (marks,) = drawn.markers
    at = np.sort_complex(marks.get_xdata() + 1j * marks.get_ydata())
    assert at == pytest.approx([-1j, -1j, 1j, 1j], abs=1e-9)
    assert drawn.bar.ax.get_ylabel() == "$w$"
    found = values(drawn)
    # λ² − μ (1 − w²) λ + 1 = 0: on the unit circle while complex
    assert np.abs(found[np.abs(found.imag) > 0.1]) == pytest.approx(1.0, abs=1e-3)


def test_a_pair_that_becomes_real_meets_on_the_axis(folded_overlay):
    """Trace −1 throughout: two real eigenvalues and a pair go over into each other at −1/2."""
    found = values(fs.plot.eigenvalue_path(folded_overlay))
    off = found[(np.abs(found.imag) > 1e-9)]
    assert off.real == pytest.approx(np.full(len(off), -0.5), abs=1e-9)
    assert np.abs(found + 0.5).min() < 1e-9


def test_nothing_followed_is_refused(gear, gear_diagram):
    away = fs.overlay(gear_diagram, fs.simulate(gear, [0, 0], t=(0, 0.1)))
    with pytest.raises(fs.ArgumentError, match="follows no stable branch"):
        fs.plot.eigenvalue_path(away)


@pytest.fixture(scope="module")
def corner():
    """At x = 0 the trace goes from 3/4 to −5/4 and the determinant from 3/4 to −3/4."""
    x, y, w = sp.symbols("x y w")
    right = sp.Piecewise((1, x > 0), (0, True))
    model = fs.Model(
        {x: y + x - 2 * x * right, y: w - x + 2 * x * right - y / 4}, parameters={w: 0}
    )
    (point,) = fs.continue_equilibria(model, "w", over=(-1, 1)).boundary_equilibria
    return point


def test_the_clarke_path(corner):
    path = corner.clarke
    assert (path.q_zero, path.q_hopf) == pytest.approx((0.5, 0.375), abs=1e-12)
    drawn = fs.plot.clarke_path(corner)
    zero, pair = drawn.markers[2:]
    assert zero.get_xdata() == pytest.approx([0], abs=1e-12)
    assert pair.get_xdata() == pytest.approx([0, 0], abs=1e-12)
    # the determinant falls linearly from 3/4 at q = 0 to −3/4 at q = 1
    root = np.sqrt(0.75 - 1.5 * 0.375)
    assert np.sort(pair.get_ydata()) == pytest.approx([-root, root], abs=1e-12)
    texts = [t.get_text() for t in drawn.legend.get_texts()]
    assert texts == [
        "q = 1, S1", "q = 0, S2", "zero eigenvalue, q = 0.5", "pair on the axis, q = 0.375",
    ]  # fmt: skip
    found = values(drawn)
    assert np.abs(found - path.path(0.0)[0]).min() < 1e-12
    assert drawn.ax.get_title() == "BE1: non-smooth fold"


def test_a_clarke_path_that_crosses_nothing(gear_diagram):
    drawn = fs.plot.clarke_path(gear_diagram.boundary_equilibria[0], ax=Figure().add_subplot())
    assert len(drawn.markers) == 2


def test_a_point_without_clarke_path_is_refused(folded_overlay):
    with pytest.raises(fs.ArgumentError, match="LP1 has no Clarke path"):
        fs.plot.clarke_path(folded_overlay.diagram.folds[0])
