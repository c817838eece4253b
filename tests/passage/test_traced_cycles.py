"""Ends of bursts at the ends of traced cycles."""

import pytest
import sympy as sp

import fastslow as fs

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def neuron():
    model = fs.systems.hindmarsh_rose(r=0.001)
    diagram = fs.continue_equilibria(model.frozen(), "z", over=(1.5, 2.5))
    cycle = fs.find_orbit(model.frozen().with_parameters(z=1.9), [1, -5])
    cycles = fs.continue_orbits(cycle, "z", over=(1.6, 2.2))
    return diagram, fs.simulate(model, [-1.5, -10, 1.9], t=(0, 1000)), cycles


def test_a_burst_ends_at_the_traced_homoclinic_orbit(neuron):
    diagram, run, cycles = neuron
    overlay = fs.overlay(diagram, run, cycles=cycles)
    assert str(overlay.bursting) == "fold/homoclinic bursting"
    assert any("end: at HC1" in sentence for sentence in overlay.bursting.evidence)
    ends = overlay.transitions.select(type="end of oscillation")
    assert len(ends) >= 2
    for end in ends:
        assert end.special is not None
        assert end.special.code == "HC"
        # past the point, by less than z drifts in an oscillation
        assert end.delay == pytest.approx(end.value - cycles["HC1"]["z"], abs=1e-12)
        assert abs(end.delay) < 0.04
    assert overlay.cycles == (cycles,)
    drawn = fs.plot.overlay(overlay)
    assert len(drawn.diagram.cycles) == 2
    assert fs.plot.overlay(overlay, "y", x="x").diagram.cycles == ()


def test_cycles_are_saved_with_the_overlay(neuron, tmp_path):
    diagram, run, cycles = neuron
    overlay = fs.overlay(diagram, run, cycles=[cycles])
    overlay.save(tmp_path / "overlay.npz")
    (again,) = fs.load(tmp_path / "overlay.npz").cycles
    assert again["HC1"]["z"] == cycles["HC1"]["z"]


def test_a_run_on_other_cycles_is_classified_without_them(neuron):
    """The cycles of the other Hopf point are none on which the neuron spikes."""
    diagram, run, _ = neuron
    model = fs.systems.hindmarsh_rose().frozen().with_parameters(z=2.9)
    small = fs.continue_orbits(fs.find_orbit(model, [0.3, 0.8]), "z", over=(2.7, 2.92))
    overlay = fs.overlay(diagram, run, cycles=small)
    ends = overlay.transitions.select(type="end of oscillation")
    assert all(end.special is None for end in ends)


def test_wrong_cycles(neuron):
    diagram, run, cycles = neuron
    model = fs.systems.hindmarsh_rose(b=2.9).frozen().with_parameters(z=1.9)
    other = fs.continue_orbits(fs.find_orbit(model, [1, -5]), "z", over=(1.89, 1.91))
    with pytest.raises(fs.ArgumentError, match=r"b = 2\.9"):
        fs.overlay(diagram, run, cycles=other)
    over_b = fs.continue_orbits(fs.find_orbit(model, [1, -5]), "b", over=(2.89, 2.91))
    with pytest.raises(fs.ArgumentError, match="an autonomous model over b; expected cycles"):
        fs.overlay(diagram, run, cycles=over_b)
    with pytest.raises(fs.ArgumentError, match="cycles= belong to a diagram of equilibria"):
        fs.overlay(cycles, run, cycles=cycles)


@pytest.mark.sample(0)
@pytest.mark.slow
def test_the_square_wave_burster_of_morris_and_lecar():
    """Rinzel & Ermentrout 1989; the cycle begins at a subcritical Hopf point and has a fold."""
    V, n, i, eps = sp.symbols("V n I epsilon")
    open_ = (1 + sp.tanh((V + sp.Rational(6, 5)) / 18)) / 2
    rest = (1 + sp.tanh((V - 12) / sp.Rational(87, 5))) / 2
    rate = sp.Rational(23, 100) * sp.cosh((V - 12) / sp.Rational(174, 5))
    current = i - 2 * (V + 60) - 8 * n * (V + 84) - 4 * open_ * (V - 120)
    model = fs.Model(
        {V: current / 20, n: rate * (rest - n)},
        slow={i: eps * (-26 - V)},
        parameters={eps: 0.005},
    )
    diagram = fs.continue_equilibria(model.frozen(), "I", over=(20, 60))
    (cycles,) = fs.continue_cycles(diagram)
    assert [p.code for p in cycles.special] == ["LPC", "HC"]
    assert cycles["LPC1"]["I"] == pytest.approx(40.593351958, abs=1e-8)
    assert cycles["HC1"]["I"] == pytest.approx(35.006734197583, abs=1e-9)
    run = fs.simulate(model, [-30, 0.1, 36], t=(0, 1500))
    alone = fs.overlay(diagram, run)
    assert str(alone.bursting) == "fold/homoclinic bursting"
    assert "they end at HC1, homoclinic, I = 35.0067342" in " ".join(alone.bursting.evidence)
    overlay = fs.overlay(diagram, run, cycles=cycles)
    assert str(overlay.bursting) == "fold/homoclinic bursting"
    assert {t.special.label for t in overlay.transitions if t.type == "end of oscillation"} == {
        "HC1"
    }


@pytest.mark.sample(0)
@pytest.mark.slow
def test_the_relaxation_oscillation_of_a_neuron_ends_at_folds_of_cycles():
    """FitzHugh-Nagumo under a slow current; the folds are symmetric about I = a/b = 0.875."""
    model = fs.systems.fitzhugh_nagumo(I_0=0.875, I_1=0.875, omega=0.001)
    diagram = fs.continue_equilibria(model.frozen(), "I", over=(0, 2))
    # the canard cycles between the folds need no fine steps
    coarse = fs.Continuation(max_step=0.1, max_turn=0.3)
    (cycles,) = fs.continue_cycles(diagram, continuation=coarse)
    folds = [point["I"] for point in cycles.special]
    assert [point.code for point in cycles.special] == ["LPC", "LPC"]
    assert sum(folds) == pytest.approx(1.75, abs=1e-13)
    overlay = fs.overlay(diagram, fs.simulate(model, [-1.2, -0.6], periods=2), cycles=cycles)
    assert str(overlay.bursting) == "symmetric subHopf/fold cycle bursting"
    ends = overlay.transitions.select(type="end of oscillation")
    assert {end.special.label for end in ends} == {"LPC1", "LPC2"}
