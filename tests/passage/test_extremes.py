"""Delays of relaxation oscillators, read where the slow state turns; tracking that is lost."""

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

import fastslow as fs

pytestmark = pytest.mark.slow

x, y, z, v, w, t = sp.symbols("x y z v w t")


def extremes(rates, state, until, slow, skip):
    """Smallest and largest value of a slow state over a cycle, where it turns, by SciPy."""

    def turns(t, state):
        return rates(t, state)[slow]

    run = solve_ivp(rates, (0, until), state, "LSODA", rtol=1e-10, atol=1e-13, events=turns)
    late = run.y_events[0][run.t_events[0] > skip, slow]
    return late.min(), late.max()


def test_the_oregonator_turns_past_both_folds():
    """Tyson and Fife 1980, epsilon = 0.04: left before the lower fold, and turned past it."""
    eps, q = 0.04, 8e-4
    fast = (x * (1 - x) - z * (x - q) / (x + q)) / eps
    model = fs.Model({x: fast}, slow={z: x - z})
    diagram = fs.continue_equilibria(model.frozen(), "z", over=(1e-3, 0.6), window={"x": (q, 2)})
    overlay = fs.overlay(diagram, fs.simulate(model, {"x": 0.01, "z": 0.3}, t=(0, 20)))
    jumps = overlay.transitions.select(type="jump")
    assert len(jumps) >= 6
    assert all(jump.turned and jump.delay > 0 for jump in jumps)

    def rates(_, u):
        return [(u[0] * (1 - u[0]) - u[1] * (u[0] - q) / (u[0] + q)) / eps, u[0] - u[1]]

    low, high = extremes(rates, [0.01, 0.3], 20, 1, 10)
    folds = sorted(p["z"] for p in diagram.folds)
    assert [j.delay for j in jumps[-2:]] == pytest.approx(
        [d for j in jumps[-2:] for d in [folds[0] - low if j.value < 0.1 else high - folds[1]]],
        rel=1e-5,
    )


def test_mckean_turns_past_both_corners():
    """A piecewise-linear cubic: exact extremes from the linear motion, by SciPy."""
    half = sp.Rational(1, 2)
    cubic = sp.Piecewise((-v, v < half / 2), (v - half, v < 3 * half / 2), (1 - v, True))
    model = fs.Model({v: cubic - w + half}, slow={w: (v - half) / 100})
    diagram = fs.continue_equilibria(model.frozen(), "w", over=(-0.5, 1.5))
    overlay = fs.overlay(diagram, fs.simulate(model, {"v": 0.1, "w": 0.3}, t=(0, 800)))

    def rates(_, u):
        bent = -u[0] if u[0] < 0.25 else u[0] - 0.5 if u[0] < 0.75 else 1 - u[0]
        return [bent - u[1] + 0.5, (u[0] - 0.5) / 100]

    low, high = extremes(rates, [0.1, 0.3], 800, 1, 300)
    jumps = overlay.transitions.select(type="jump")
    assert all(jump.turned for jump in jumps)
    for jump in jumps[-2:]:
        expected = 0.25 - low if jump.value < 0.5 else high - 0.75
        assert jump.delay == pytest.approx(expected, rel=1e-6)


def test_tracking_lost_to_a_fast_drift_is_named():
    """x' = (x − w) − (x − w)³: with y = x − w, y' = y − y³ − w' has no equilibrium above zero
    while w' > 2/(3√3); the upper branch itself stays stable."""
    r = sp.Symbol("r")
    model = fs.Model(
        {x: (x - w) - (x - w) ** 3}, forcing={w: 5 * (1 + sp.tanh(r * t)) / 2}, parameters={r: 0.3}
    )
    diagram = fs.continue_equilibria(model.frozen(), "w", over=(-1, 6))
    lost = fs.overlay(diagram, fs.simulate(model, [1.0], t=(-20, 20)))
    (tipping,) = lost.transitions
    assert tipping.type == "rate-induced"
    assert tipping.special is None
    assert np.isnan(tipping.delay)
    assert tipping.leave.time <= tipping.time <= tipping.land.time
    assert "remains stable" in tipping.note
    kept = fs.overlay(diagram, fs.simulate(model.with_parameters(r=0.1), [1.0], t=(-60, 60)))
    assert kept.transitions == ()
    assert fs.overlay(diagram, fs.simulate(model, [-1.0], t=(-20, 20))).transitions == ()


def test_a_blow_up_that_the_drift_causes_is_named():
    """x' = (x + w)² − 1, w from 0 to 8: y = x + w passes the unstable y = 1 where w' > 1."""
    model = fs.Model({x: (x + w) ** 2 - 1}, forcing={w: 4 * (1 + sp.tanh(t))})
    diagram = fs.continue_equilibria(model.frozen(), "w", over=(-1, 9))
    run = fs.simulate(model, [-1.0], t=(-10, 20))
    overlay = fs.overlay(diagram, run)
    (tipping,) = overlay.transitions
    assert tipping.type == "rate-induced"
    assert tipping.to_branch == ""
    assert not overlay.outcome
    assert "the run ended early" in overlay.summary()


def test_a_landing_that_overshoots_is_one_transition():
    """Stommel's box (1961) settles on a focus after the fold: no excursion of its own."""
    model = fs.Model(
        {x: 3 - x * (1 + sp.Abs(x - y)), y: w - y * (sp.Rational(3, 10) + sp.Abs(x - y))},
        forcing={w: 1 + sp.Rational(35, 100) * sp.sin(t / 500)},
    )
    diagram = fs.continue_equilibria(model.frozen(), "w", over=(0.3, 2))
    start = diagram.at(w=1.0)[0].state
    overlay = fs.overlay(diagram, fs.simulate(model, start, t=(0, 4000)))
    assert [t_.type for t_ in overlay.transitions] == ["jump"] * 3
    assert {t_.to_branch for t_ in overlay.transitions} == {"S1", "S2"}


def test_a_state_that_is_constant_along_the_branch_hides_nothing():
    """The Brusselator has x = A on its branch: a slow B moves x by its lag alone."""
    b = sp.Symbol("B")
    model = fs.Model(
        {x: 1 - (b + 1) * x + x**2 * y, y: b * x - x**2 * y}, forcing={b: 1.2 + t / 100}
    )
    diagram = fs.continue_equilibria(model.frozen(), "B", over=(1.0, 3.5))
    for until in (20, 60, 150):
        overlay = fs.overlay(diagram, fs.simulate(model, [1.0, 1.2], t=(0, until)))
        assert overlay.shares() == {"S1": pytest.approx(1.0)}
        assert overlay.distance.max() < 0.1


def test_no_lag_is_given_in_a_jump_or_an_oscillation():
    model = fs.systems.cusp(omega=0.002)
    diagram = fs.continue_equilibria(model.frozen(), "p", over=(-1.2, 1.2))
    overlay = fs.overlay(diagram, fs.simulate(model, [-1.0], periods=2))
    for jump in overlay.transitions.select(type="jump"):
        inside = (overlay.t > jump.leave.time) & (overlay.t < jump.land.time)
        assert np.isnan(overlay.lag[inside]).all()
    # to first order the lag is the relaxation time of the frozen state
    known = np.isfinite(overlay.lag) & (overlay.relaxation < 1) & (overlay.t > 10)
    assert known.mean() > 0.6
    near = np.abs(overlay.lag[known] / overlay.relaxation[known] - 1) < 0.2
    assert near.mean() > 0.99
    fast = fs.systems.harmonic_gear(omega=3.0)
    ringing = fs.continue_equilibria(fast.frozen(), "w", over=(-2, 7))
    overlay = fs.overlay(ringing, fs.simulate(fast, [0.5, 0.0], periods=10))
    assert "ahead" not in overlay.summary()
    assert "behind in time" not in overlay.summary()
