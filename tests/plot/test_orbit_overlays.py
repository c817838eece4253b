"""Figures of a trajectory over branches of forced orbits."""

from functools import cache

import numpy as np
import pytest
import sympy as sp

import fastslow as fs

pytestmark = pytest.mark.slow

x, w, t = sp.symbols("x w t")


@cache
def overlay():
    """Relaxation oscillation of a cubic under fast forcing, with two folds of orbits."""
    full = fs.Model({x: x - x**3 / 3 - w + sp.cos(5 * t) / 2}, slow={w: x / 100})
    start = fs.find_orbit(full.frozen(fast=["t"]).with_parameters(w=-0.9), [2.0])
    branch = fs.continue_orbits(start, "w", over=(-1.0, 1.0))
    return fs.overlay(branch, fs.simulate(full, [2.0, -0.2], t=(0.0, 250.0)))


@pytest.mark.sample(3)
@pytest.mark.parametrize("y", [None, "x", "max(x)", "min(x)", "x**2 - w"])
def test_strobes_over_the_curve_of_orbits(y):
    drawn = fs.plot.overlay(overlay(), y)
    text = y or "x"
    assert (drawn.y, drawn.ax.get_xlabel()) == (text, "$w$")
    joined, line = drawn.lines
    assert (line.get_linestyle(), joined.get_marker()) == ("None", "none")
    assert np.isnan(joined.get_ydata()).sum() < 10
    points = np.asarray(line.get_xydata())
    assert points[:, 0] == pytest.approx(overlay().slow, abs=0)
    assert points[:, 1] == pytest.approx(overlay()[text], abs=0, nan_ok=True)
    curve = np.vstack([one.get_xydata() for one in drawn.diagram.cycles[0].lines])
    branch = overlay().branches[0]
    assert set(curve[:, 1]) == set(branch[text])
    entries = [handle.get_label() for handle in drawn.handles]
    assert entries == ["stable", "unstable", "LPC fold of cycles", "trajectory", "jump at a fold"]
    assert [tag.get_text() for tag in drawn.diagram.cycles[0].labels] == ["LPC1", "LPC2"]
    (jumps,) = drawn.transitions
    assert len(jumps.get_xdata()) == len(overlay().transitions)


def test_a_style_is_that_of_the_line():
    part = overlay().select("x > 0")[0]
    line, _ = fs.plot.overlay(part, linewidth=2.0).lines
    assert line.get_linewidth() == 2.0


def test_what_has_no_meaning_is_refused():
    for wrong in ({"x": "x"}, {"z": "x"}, {"y": lambda columns: columns["x"]}):
        with pytest.raises(fs.ArgumentError, match="an overlay of orbits is drawn over the slow"):
            fs.plot.overlay(overlay(), **wrong)
    for task, call in (
        ("pick", lambda: fs.pick(fs.plot.overlay(overlay()), overlay())),
        ("panel", lambda: fs.plot.panel(overlay())),
        ("eigenvalue_path", lambda: fs.plot.eigenvalue_path(overlay())),
    ):
        with pytest.raises(fs.ArgumentError, match=f"{task} takes an overlay of equilibria; rec"):
            call()


def test_an_incomplete_overlay_has_a_note():
    branch = overlay().branches[0].select(between=(-1.0, 0.3))[0]
    drawn = fs.plot.overlay(fs.overlay(branch, overlay().run))
    notes = [" ".join(text.get_text().split()) for text in drawn.ax.texts]
    assert "the trajectory leaves the range of the diagram" in notes


def test_orbits_of_two_periods_are_drawn_at_both():
    v = sp.Symbol("v")
    rate = -0.3 * v + x - x**3 + w * sp.cos(1.2 * t)
    frozen = fs.Model({x: v, v: rate}, forcing={w: t}).frozen(fast=["t"])
    over = (0.24, 0.285)
    start = fs.find_orbit(frozen.with_parameters(w=over[0]), [1.0, 0.0])
    single = fs.continue_orbits(start, "w", over=over)
    (point,) = single.special("PD")
    twice = fs.continue_orbits(fs.find_orbit(frozen, point), "w", over=over)
    run = fs.simulate(frozen.with_ramp("w", 1e-4, from_value=0.26), [0.4, 0.2], t=(0.0, 240.0))
    drawn = fs.plot.overlay(fs.overlay([single, twice], run))
    heights = np.concatenate([line.get_ydata() for line in drawn.diagram.cycles[-1].lines])
    orbit = twice[-1]
    assert orbit(orbit.period / 2)[0] in heights
    assert len(drawn.lines) == 1
    visible = [
        tag.get_text() for one in drawn.diagram.cycles for tag in one.labels if tag.get_visible()
    ]
    assert visible == ["PD1"]
