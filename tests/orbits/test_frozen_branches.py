"""Cycles of frozen models, traced from the Hopf points of their diagrams."""

import numpy as np
import pytest

import fastslow as fs


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
