"""Basins of attraction with their attractors."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs

from .cases import focus_and_cycle

pytestmark = pytest.mark.slow

x, v, t = sp.symbols("x v t")
COARSE = fs.Refinement(cells=(2, 2), levels=0)


def texts(drawn):
    return [label.get_text() for label in drawn.labels]


def test_closed_orbit_and_equilibrium():
    """The stable circle has the radius ρ² = (1 + sqrt(0.6))/2."""
    found, plane = focus_and_cycle()
    drawn = fs.plot.basins(plane, found)
    (circle,), (focus,) = drawn.data["closed orbit"], drawn.data["equilibrium"]
    assert np.hypot(*circle.T) == pytest.approx(np.sqrt((1 + np.sqrt(0.6)) / 2), rel=1e-8)
    assert circle[0] == pytest.approx(circle[-1], abs=1e-8)
    assert focus.tolist() == [[0, 0]]
    assert texts(drawn) == ["A1", "A2"]
    assert {"A1", "A2"} <= drawn.data.keys()


def test_stroboscopic_points_of_a_forced_orbit():
    """x = sin t − cos t, at the phase 0 of the forcing."""
    model = fs.Model({x: v, v: sp.sin(t) + sp.cos(t) - x - v})
    box = {"x": (-2, 2), "v": (-2, 2)}
    found = fs.attractors(model, box, 4)
    plane = fs.basins(model, box, known=found, refinement=COARSE)
    drawn = fs.plot.basins(plane, found)
    assert drawn.data["stroboscopic points"][0] == pytest.approx(np.array([[-1.0, 1.0]]), abs=1e-9)
    beside = fs.basins(model, {"x": (0, 2), "v": (-2, 2)}, known=found, refinement=COARSE)
    drawn = fs.plot.basins(beside, found)
    assert texts(drawn) == []
    assert [text.get_text() for text in drawn.ax.texts] == ["outside: A1"]


def test_attractors_that_are_not_of_the_map():
    found, plane = focus_and_cycle()
    with pytest.raises(fs.ArgumentError, match="the map has basins of A2; expected"):
        fs.plot.basins(plane, found[:1])
    other = fs.refined_map(lambda a, b: a > b, {"a": (0, 1), "b": (0, 1)}, refinement=COARSE)
    with pytest.raises(fs.ArgumentError, match="the map is over a, b, the attractors are of x, v"):
        fs.plot.basins(other, found)


def test_jumps_of_a_closed_orbit_are_dotted():
    neuron = fs.Model({x: 1, v: 1 - v}, resets={x >= 1: {x: 0, v: v + 1}})
    box = {x: (0, 0.9), v: (0.5, 4)}
    found = fs.attractors(neuron, box, 2)
    plane = fs.basins(neuron, box, known=found, refinement=COARSE)
    drawn = fs.plot.basins(plane, found)
    (closed,) = drawn.data["closed orbit"]
    (dotted,) = (one for one in drawn.ax.lines if one.get_linestyle() == ":")
    # v = 1 + e^(1 − t)/(e − 1) from the reset on
    low, high = 1 + 1 / (np.e - 1), 1 + np.e / (np.e - 1)
    assert np.isnan(closed).any()
    assert dotted.get_xydata()[:2] == pytest.approx(np.array([[1, low], [0, high]]))
