"""Overlays under loads given by tables and clocks."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs

x, w, t = sp.symbols("x w t")
PERIOD = 200 * np.pi


def cubic(law):
    """x' = w + x − x³, which jumps at w = ±2/√27."""
    return fs.Model({x: w + x - x**3}, forcing={w: law})


def table(count, interpolation):
    times = np.linspace(0, 1.02 * PERIOD, count)
    return fs.Tabulated(times, 0.6 * np.sin(times / 100), interpolation=interpolation)


@pytest.fixture(scope="module")
def diagram():
    return fs.continue_equilibria(cubic(sp.sin(t)).frozen(), "w", (-0.7, 0.7))


def transitions(diagram, law, until=PERIOD):
    return fs.overlay(diagram, fs.simulate(cubic(law), [-1.0], t=(0, until))).transitions


@pytest.fixture(scope="module")
def closed(diagram):
    return transitions(diagram, sp.Rational(3, 5) * sp.sin(t / 100))


@pytest.mark.parametrize(("count", "error"), [(100, 1e-5), (400, 4e-8)])
def test_a_cubic_table_agrees_with_the_closed_form(diagram, closed, count, error):
    """The error of the interpolation decreases with the fourth power of the step."""
    found = transitions(diagram, table(count, "cubic"))
    assert [f.special_equilibrium.label for f in found] == ["LP1", "LP2"]
    for one, other in zip(found, closed, strict=True):
        assert one.time == pytest.approx(other.time, abs=error)
        assert one.delay == pytest.approx(other.delay, abs=error)
        assert one.slope == pytest.approx(other.slope, abs=error)
        # with rate and change of the rate only
        assert one.predicted == pytest.approx(other.predicted, rel=1e-4)


def test_the_slope_of_a_table_gives_no_error_bound(diagram, closed):
    found = transitions(diagram, table(400, "linear"))
    assert found[0].predicted == pytest.approx(closed[0].predicted, rel=0.06)
    assert np.isnan(found[0].law.error)
    assert np.isfinite(closed[0].law.error)


def test_a_slow_sawtooth_jumps_back_at_its_instants(diagram):
    saw = sp.Rational(6, 5) * sp.Mod(t, 400) / 400 - sp.Rational(3, 5)
    up, back = transitions(diagram, saw, until=700)
    assert up.predicted == pytest.approx(up.delay, abs=up.law.error)
    assert back.time == pytest.approx(400)
    assert back.value == pytest.approx(-0.6)


def test_a_fast_clock_is_frozen_by_name_only():
    model = fs.Model({x: w - x + sp.Mod(t, 1)}, forcing={w: sp.sin(t / 100)})
    with pytest.raises(fs.ModelError, match=r'contains the clock floor.*fast=\["t"\]'):
        model.frozen()
    fast = model.frozen(fast=["t"])
    assert (fast.free, fast.period()) == (("w",), 1.0)


@pytest.mark.parametrize("seed", [0, 1])
def test_a_load_that_jumps_has_no_rate_at_its_jumps(seed):
    """Relaxation after a jump of the load is no lag along a steep branch."""
    x, w = sp.symbols("x w")
    times = np.linspace(0, 100, 101)
    noise = 0.4 * np.random.default_rng(seed).normal(size=101)
    load = fs.Tabulated(times, np.sin(times / 20) + noise, interpolation="previous")
    model = fs.Model({x: 2 * (w - x)}, forcing={w: load})
    diagram = fs.continue_equilibria(model.frozen(), "w", over=(-3, 3))
    overlay = fs.overlay(diagram, fs.simulate(model, [0.0], t=(0, 100)))
    assert not {"steep", "excursion"} & {t.type for t in overlay.transitions}
    assert all(not t.steepness > 1e-9 for t in overlay.transitions)
    assert "w jumps 99 times" in str(overlay.outcome)
