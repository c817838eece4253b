"""Cycles of frozen models, traced from the Hopf points of their diagrams."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def oscillator():
    diagram = fs.continue_equilibria(fs.systems.van_der_pol().frozen(), "w", over=(-2, 2))
    return diagram, fs.continue_cycles(diagram)


def test_cycles_between_two_hopf_points(oscillator):
    """Van der Pol under a load: one branch, from HB1 to HB2, symmetric in w."""
    _, (cycles,) = oscillator
    assert [o.code for o in cycles.outcomes] == ["Hopf point", "Hopf point"]
    assert "HB1" in str(cycles.outcomes[0])
    assert cycles.values[0] == pytest.approx(-1, abs=1e-3)
    (middle,) = cycles.at(w=0.0)
    assert middle.period == pytest.approx(6.66328685932, abs=1e-11)


@pytest.mark.sample(0)
def test_hindmarsh_rose_with_library_defaults():
    """Both branches end at homoclinic orbits; their labels are unique."""
    diagram = fs.continue_equilibria(fs.systems.hindmarsh_rose().frozen(), "z", over=(-12, 4))
    spiking, small = fs.continue_cycles(diagram)
    assert [p.label for b in (spiking, small) for p in b.special] == ["HC1", "HC2"]
    assert spiking["HC1"]["z"] == pytest.approx(2.0856008819949, abs=1e-12)
    assert small["HC2"]["z"] == pytest.approx(2.8161469598897, abs=1e-12)
    assert spiking.outcome
    for branch, point in ((spiking, "HC1"), (small, "HC2")):
        # the saddle is on the middle branch of x³ + 2x² + z = 3
        x = branch[point].saddle[0]
        assert x**3 + 2 * x**2 + branch[point]["z"] == pytest.approx(3, abs=1e-12)
        assert -4 / 3 < x < 0


def test_without_hopf_points():
    diagram = fs.continue_equilibria(fs.systems.cusp().frozen(), "p", over=(-1, 1))
    assert fs.continue_cycles(diagram) == ()


def test_a_diagram_without_its_model(oscillator, tmp_path):
    diagram, _ = oscillator
    diagram.save(tmp_path / "diagram.npz")
    with pytest.raises(fs.ArgumentError, match="HB1 of the diagram has no model"):
        fs.continue_cycles(fs.load(tmp_path / "diagram.npz"))


def test_envelope_in_the_diagram(oscillator):
    diagram, cycles = oscillator
    drawn = fs.plot.diagram(diagram, "v", cycles=cycles)
    upper, lower = drawn.cycles
    heights = [part.lines[0].get_ydata() for part in (upper, lower)]
    assert np.array_equal(heights[0], cycles[0]["max(v)"])
    assert np.array_equal(heights[1], cycles[0]["min(v)"])
    assert "stable cycles" in {h.get_label() for h in drawn.handles}
    assert drawn.ax.get_ylabel() == "$v$"
    with pytest.raises(fs.ArgumentError, match="cycles are drawn over w"):
        fs.plot.diagram(diagram, "v", x="x", cycles=cycles)


def test_cycles_from_boundary_equilibria_where_a_focus_changes_its_stability():
    """A piecewise-linear oscillator, symmetric about x = μ = 1/2.

    Near μ = 0 the cycle is in two regions: its period does not depend on μ, and its size is
    proportional to it.
    """
    x, y, mu = sp.symbols("x y mu")
    rate = sp.Piecewise((-x, x < 0), (x / 2, x < 1), (sp.Rational(3, 2) - x, True))
    model = fs.Model({x: rate - y, y: x - mu}, parameters={mu: 0.5})
    diagram = fs.continue_equilibria(model, "mu", over=(-0.2, 1.2))
    (cycles,) = fs.continue_cycles(diagram)  # from BE1 to BE2
    assert [outcome.code for outcome in cycles.outcomes] == ["boundary equilibrium"] * 2
    assert "at mu = 1." in str(cycles.outcomes[1])
    small = cycles["mu"] < cycles["GR1"]["mu"]
    assert np.ptp(cycles.period[small]) < 1e-11
    size = (cycles["max(x)"] - cycles["min(x)"])[small] / cycles["mu"][small]
    assert np.allclose(size, size[0], rtol=1e-9, atol=0)
    assert np.isclose(cycles["GR1"]["mu"] + cycles["GR2"]["mu"], 1, rtol=0, atol=1e-12)


def test_a_super_explosion_has_one_branch_of_cycles():
    # McKean's neuron: at v = 1/8 and 5/8 a stable node becomes an unstable one
    v, w, current = sp.symbols("v w I")
    rate = sp.Piecewise((-v, v < 0.125), (v - 0.25, v < 0.625), (1 - v, True))
    model = fs.Model({v: rate - w + current, w: 0.1 * (v - w / 2)}, parameters={current: 0.5})
    diagram = fs.continue_equilibria(model, "I", over=(0, 1.25))
    (cycles,) = fs.continue_cycles(diagram)
    for outcome, value in zip(cycles.outcomes, (0.375, 0.875), strict=True):
        assert outcome.code == "boundary equilibrium on the cycle"
        assert f"towards I = {value}," in str(outcome)
