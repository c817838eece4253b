"""The law of delay beside the transitions of an overlay."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs

x, y, p, t = sp.symbols("x y p t")


def laid(model, name, over, start, **span):
    diagram = fs.continue_equilibria(model.frozen(), name, over=over)
    return fs.overlay(
        diagram, fs.simulate(model, start, integration=fs.Integration(rtol=1e-11), **span)
    )


@pytest.fixture(scope="module")
def gear():
    return fs.systems.harmonic_gear(A=41.67, B=2.372, C=3.546, D=0.25, omega=0.002)


def test_the_gap_is_crossed_as_its_law_says(gear):
    """Within 2 %, as much as the load's rate of change differs over the gap."""
    lay = laid(gear, "w", (-2, 6), [0, 0], periods=1)
    transits = [t_ for t_ in lay.transitions if t_.kind == "transit"]
    assert len(transits) == 2
    for t_ in transits:
        assert t_.predicted == t_.law.transit
        assert t_.width == pytest.approx(t_.predicted, rel=0.02)
        assert t_.duration == pytest.approx(t_.law.transit_time, rel=0.02)
        assert t_.law.asymptotic == pytest.approx(2 * np.sqrt(0.25 * t_.slope) + t_.slope, rel=1e-9)
        assert "law: " in t_.describe("w")


def test_jumps_are_as_late_as_the_law_of_the_fold_says(gear):
    """Within 3 % at the very state at which the measured delay is taken."""
    folded = gear.with_parameters(A=-0.6, B=0, C=0.4, omega=0.001)
    lay = laid(folded, "w", (-1, 1), [0.9, 0], periods=2)
    jumps = [t_ for t_ in lay.transitions if t_.kind == "jump"]
    assert len(jumps) == 3
    for t_ in jumps:
        assert t_.delay == pytest.approx(t_.predicted, rel=0.03)
    # the second period repeats the first: one law, computed once
    assert jumps[0].law is jumps[2].law


def test_a_slow_hopf_point_is_left_where_growth_makes_up_for_decay():
    rates = {x: p * x - 8 * y - x * (x**2 + y**2), y: 8 * x + p * y - y * (x**2 + y**2)}
    model = fs.Model(rates, forcing={p: t / 20 - 1})
    lay = laid(model, "p", (-2, 2), [0.3, 0], t=(0, 60))
    (leave,) = [t_ for t_ in lay.transitions if t_.kind == "Hopf"]
    # entry at p = -1, decay exp(-10): the same way beyond, less what the amplitude needs not grow
    assert leave.predicted == pytest.approx(1, abs=0.1)
    assert 0.6 < leave.delay < leave.predicted + 0.05


def test_without_a_model_there_is_no_law(gear, tmp_path):
    diagram = fs.continue_equilibria(gear.frozen(), "w", over=(-2, 6))
    diagram.save(tmp_path / "gear.npz")
    lay = fs.overlay(fs.load(tmp_path / "gear.npz"), fs.simulate(gear, [0, 0], periods=1))
    assert [t_.kind for t_ in lay.transitions] == ["transit", "transit"]
    assert all(t_.law is None and np.isnan(t_.predicted) for t_ in lay.transitions)
    assert "law" not in lay.summary()
