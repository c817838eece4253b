"""Curves of special points in a parameter plane, as figures."""

from dataclasses import replace

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.results.points import SpecialPoints

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def curves():
    gear = fs.systems.harmonic_gear(A=-0.6).frozen()
    diagram = fs.continue_equilibria(gear, "w", (-0.3, 0.3))
    over = {"w": (-1, 1), "A": (-2, 0.5)}
    points = (*diagram.folds, diagram.boundary_equilibria[0])
    return [fs.continue_points(p, ("w", "A"), over=over) for p in points]


def test_every_kind_has_its_line_and_virtual_parts_are_faint(curves):
    drawn = fs.plot.parameter_plane(*curves)
    kinds = [str(line.get_label()) for line in drawn.lines]
    assert set(kinds) == {"LP fold", "virtual", "BE boundary equilibrium"}
    solid = next(k for k in drawn.lines if k.get_label() == "LP fold")
    faint = next(k for k in drawn.lines if k.get_label() == "virtual")
    assert faint.get_alpha() < 1
    assert solid.get_alpha() is None
    rows = sum(len(c) for c in curves)
    # runs share their joint row
    assert sum(len(k.get_xdata()) for k in drawn.lines) == rows + len(kinds) - len(curves)
    assert [t.get_text() for t in drawn.labels] == ["CP1", "CP2", "BF1"]
    assert drawn.ax.get_xlabel() == "$w$"
    assert drawn.legend is not None


def test_without_virtual_parts_labels_and_legend(curves):
    drawn = fs.plot.parameter_plane(*curves, virtual=False, label=False, legend=False)
    assert all(k.get_label() != "virtual" for k in drawn.lines)
    assert drawn.labels == ()
    assert drawn.legend is None
    points = [m.get_label() for m in drawn.markers]
    assert points == ["BF fold on an interface"]


def test_given_axes_and_style_are_used(curves):
    other = fs.plot.parameter_plane(curves[0]).ax
    drawn = fs.plot.parameter_plane(curves[1], ax=other, color="red")
    assert drawn.ax is other
    assert {k.get_color() for k in drawn.lines} == {"red"}


def test_curves_over_different_planes_are_refused(curves):
    x, p, q = sp.symbols("x p q")
    model = fs.Model({x: p + q * x - x**3}, parameters={p: 0, q: 1})
    fold = fs.continue_equilibria(model, "p", (-1, 1)).folds[0]
    curve = fs.continue_points(fold, ("p", "q"), over={"p": (-1, 1), "q": (-1, 1)})
    with pytest.raises(fs.FastSlowError, match="the same two parameters, received p, q; w, A"):
        fs.plot.parameter_plane(curves[0], curve)
    with pytest.raises(fs.FastSlowError, match="received none"):
        fs.plot.parameter_plane()
    assert np.isfinite(curve.values).all()


def test_sub_and_supercritical_parts_of_a_hopf_curve_differ():
    """l₁ = q along p = 0: GH at q = 0 divides them."""
    x, y, p, q = sp.symbols("x y p q")
    r2 = x**2 + y**2
    growth = p + q * r2 - r2**2
    model = fs.Model({x: growth * x - 2 * y, y: 2 * x + growth * y}, parameters={p: 0, q: 1})
    (hopf,) = fs.continue_equilibria(model, "p", (-1, 1)).special("HB")
    curve = fs.continue_points(hopf, ("p", "q"), over={"p": (-1, 1), "q": (-1, 1)})
    drawn = fs.plot.parameter_plane(curve)
    lines = {str(k.get_label()): k for k in drawn.lines}
    assert set(lines) == {"HB Hopf, subcritical", "HB Hopf, supercritical"}
    assert lines["HB Hopf, subcritical"].get_ydata().min() == pytest.approx(0, abs=1e-12)
    assert lines["HB Hopf, supercritical"].get_ydata().max() < 0.05
    assert len({k.get_linestyle() for k in drawn.lines}) == 2
    texts = [t.get_text() for t in drawn.legend.get_texts()]
    assert [t for t in texts if t.startswith("HB")] == list(lines)
    assert not [m for m in drawn.markers if "not converged" in str(m.get_label())]


def test_points_that_did_not_converge_are_hollow(curves):
    special = SpecialPoints(replace(p, converged=p.code != "CP") for p in curves[0].special)
    drawn = fs.plot.parameter_plane(replace(curves[0], special=special))
    (hollow,) = [m for m in drawn.markers if m.get_label() == "CP cusp, not converged"]
    assert hollow.get_markerfacecolor() == "white"
    assert "not converged" in repr(special("CP")[0])
