"""Bands of equilibria in figures."""

import numpy as np
import sympy as sp
from matplotlib.collections import PolyCollection

import fastslow as fs

x, v, w, t = sp.symbols("x v w t")


def test_a_band_is_filled_between_its_edges_and_named():
    model = fs.Model({x: v, v: -x - sp.sign(v) / 2 + w}, parameters={w: 0})
    diagram = fs.continue_equilibria(model, "w", over=(-1, 1))
    drawn = fs.plot.diagram(diagram)
    (shape,) = (one for one in drawn.sets if isinstance(one, PolyCollection))
    points = drawn.data["equilibrium set (sticking)"][0]
    assert np.abs(np.abs(points[:, 1] - points[:, 0]) - 0.5).max() < 1e-12
    assert [text.get_text() for text in drawn.legend.get_texts()] == ["equilibrium set (sticking)"]
    assert shape.get_alpha() < 1
    # the other way round, of an expression, and with states on both axes
    turned = fs.plot.diagram(diagram, "w", x="x").data["equilibrium set (sticking)"][0]
    assert np.abs(np.abs(turned[:, 0] - turned[:, 1]) - 0.5).max() < 1e-12
    shifted = fs.plot.diagram(diagram, "x - w").data["equilibrium set (sticking)"][0]
    assert np.abs(np.abs(shifted[:, 1]) - 0.5).max() < 1e-12
    curves = fs.plot.diagram(diagram, "v", x="x").data["equilibrium set (sticking)"]
    assert len(curves) == 2


def test_sticking_has_its_own_phase_in_the_strip():
    model = fs.Model({x: v, v: -x - sp.sign(v) / 2 + w}, forcing={w: 2 * sp.sin(t / 50)})
    diagram = fs.continue_equilibria(model.frozen(), "w", over=(-2.1, 2.1))
    overlay = fs.overlay(diagram, fs.simulate(model, [0, 0], t=(0, 300)))
    panel = fs.plot.panel(overlay)
    assert panel.figure is not None
    assert "equilibrium set (sticking)" in fs.plot.overlay(overlay).diagram.data
