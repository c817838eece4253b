"""The slow manifold to second order in the rate, against exact solutions."""

import math

import matplotlib.pyplot as plt
import numpy as np
import pytest
import sympy as sp
from scipy.special import airy

import fastslow as fs

pytestmark = pytest.mark.slow

x, v, w, t, eps = sp.symbols("x v w t epsilon")
EPS = 0.01


def riccati(value):
    """x(w) of x' = w − x², w' = −ε on the slow manifold, without approximation."""
    inner, slope, *_ = airy(EPS ** (-2 / 3) * value)
    return -(EPS ** (1 / 3)) * slope / inner


@pytest.fixture(scope="module")
def fold():
    model = fs.Model({x: w - x**2}, slow={w: -eps}, parameters={eps: EPS})
    diagram = fs.continue_equilibria(model.frozen(), "w", over=(-0.1, 1.2))
    return fs.overlay(diagram, fs.simulate(model, [riccati(1.0), 1.0], t=(0, 99.5)))


def test_terms_towards_a_fold(fold):
    """x₁ = ε/(4w) and x₂ = −5ε²/(32 w^{5/2})."""
    found, known = fold.freezing, fold.freezing.known
    assert known.sum() > 80
    value = found.slow[known]
    assert found.lag[known, 0] == pytest.approx(EPS / (4 * value), rel=1e-12)
    assert found.second[known, 0] == pytest.approx(-5 * EPS**2 / 32 * value**-2.5, rel=1e-9)


def test_ratio_of_the_terms_predicts_the_error_of_the_lag_against_airys_functions(fold):
    """The ratio is 5ε/(8 w^{3/2}): 0.198 where the lag is wrong by 0.141, 0.020 where by 0.019."""
    for ratio, error in ((0.198, 0.141), (0.020, 0.019)):
        value = (5 * EPS / 8 / ratio) ** (2 / 3)
        lag = riccati(value) - math.sqrt(value)
        assert 1 - lag / (EPS / (4 * value)) == pytest.approx(error, abs=1e-3)
    found = fold.freezing
    small = found.known & (found.ratio < 0.1)
    exact = np.array([riccati(value) for value in found.slow])
    inside = (exact >= found.lower[:, 0]) & (exact <= found.upper[:, 0])
    assert inside[small].all()
    assert found.doubtful[found.known & (found.slow < 0.08)].all()
    assert not found.doubtful[found.slow > 0.3].any()
    assert "not separated" in repr(found)


def test_small_lag_over_extent_does_not_make_freezing_valid(fold):
    """The lag is 0.05 of the extent of the run where it is 28 % wrong (as ε/w^{3/2} = 0.7)."""
    value = (EPS / 0.7) ** (2 / 3)
    lag = EPS / (4 * value)
    true = riccati(value) - math.sqrt(value)
    assert 0.2 < lag / true - 1 < 0.4
    assert lag / fold.extent[0] < 0.06


def test_two_states_under_a_harmonic_load():
    """x' = v, v' = w − x − x³ − 3v: (x*, 0), and both terms by derivatives in closed form."""
    rate = 0.01
    load = sp.Rational(1, 2) + sp.sin(rate * t) / 4
    model = fs.Model({x: v, v: w - x - x**3 - 3 * v}, forcing={w: load})
    diagram = fs.continue_equilibria(model.frozen(), "w", over=(0.1, 0.9))
    start = float(diagram.at(w=0.5)[0]["x"])
    run = fs.simulate(model, [start, 0.0], t=(0, 640))
    found = fs.overlay(diagram, run).freezing
    time, place = found.t, found.equilibrium[:, 0]
    speed, bend = rate / 4 * np.cos(rate * time), -(rate**2) / 4 * np.sin(rate * time)
    stiff = 1 + 3 * place**2
    first = speed / stiff
    # v₁ = x*', x₁ = −3 v₁/(1 + 3x*²); v₂ = x₁', x₂ = −(v₁' + 3x* x₁² + 3 v₂)/(1 + 3x*²)
    lag = -3 * first / stiff
    change = bend / stiff - 6 * place * first**2 / stiff
    moved = -3 * (change / stiff - 6 * place * first**2 / stiff**2)
    second = -(change + 3 * place * lag**2 + 3 * moved) / stiff
    assert found.known.all()
    np.testing.assert_allclose(found.lag, np.column_stack([lag, first]), atol=1e-11)
    np.testing.assert_allclose(found.second, np.column_stack([second, moved]), atol=1e-9)
    # nor is the extremum of the load, where the lag is zero
    assert np.abs(found.lag[:, 0]).min() < 0.01 * np.abs(found.lag[:, 0]).max()
    assert not found.doubtful.any()
    late = time > 20
    error = np.abs(found.state - found.equilibrium - found.lag - found.second)[late].max()
    assert error < 0.1 * np.abs(found.second).max()


def test_band_is_cut_at_an_interface():
    """x' = w − x − x²·[x > 0] under a rising w: the run crosses x = 0 later than x*."""
    slope = sp.Rational(1, 10)
    model = fs.Model({x: w - sp.Piecewise((x + x**2, x > 0), (x, True))}, slow={w: slope})
    diagram = fs.continue_equilibria(model.frozen(), "w", over=(-1.0, 1.0))
    run = fs.simulate(model, [-1.0, -0.9], t=(0, 18), samples=721)
    overlay = fs.overlay(diagram, run)
    found = overlay.freezing
    place, centre = found.equilibrium[:, 0], (found.equilibrium + found.lag)[:, 0]
    behind = found.known & (place > 0) & (centre < 0)
    assert behind.sum() > 10
    assert (found.inside[behind] == 0).all()
    assert np.isnan(found.lower[behind]).all()
    near = found.known & (centre > 0) & (found.inside < 1)
    assert near.any()
    assert found.lower[near, 0] == pytest.approx(0.0, abs=1e-12)
    assert found.doubtful[behind | near].all()
    # below the interface x₂ = 0
    assert np.abs(found.second[place < 0]).max() < 1e-12
    assert "cut by an interface" in repr(found)


def test_band_is_drawn_about_the_equilibrium(fold):
    drawn = fs.plot.freezing(fold.freezing, "x")
    assert [str(one.get_label()) for one in drawn.bands] == ["x₁ ± |x₂|", "freezing doubtful"]
    shown = [text.get_text() for text in drawn.legend.get_texts()]
    assert shown == ["trajectory", "lag x₁", "x₁ ± |x₂|", "freezing doubtful"]
    np.testing.assert_array_equal(drawn.first.get_ydata(), fold.freezing.lag[:, 0])
    # the band grows without bound towards the fold, the axes do not
    assert drawn.ax.get_ylim()[1] < 0.2
    with pytest.raises(fs.UnknownNameError, match="unknown state 'w'"):
        fs.plot.freezing(fold.freezing, "w")
    plt.close("all")


def test_bad_input(fold):
    coarse = fs.overlay(
        fold.diagram,
        fs.simulate(fold.run.symbolic_model, [1.0, 1.0], t=(0, 50), dense=False, samples=60),
    )
    with pytest.raises(fs.ArgumentError, match="dense=True"):
        _ = coarse.freezing
