"""Every delay within the error that its law states, over models of several fields."""

import math
from dataclasses import replace

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

import fastslow as fs
from fastslow.passage.delays.laws.fold_delays import OMEGA_0
from tests.passage import slow_models
from tests.passage.slow_models import CASES, PRECISE, measured, predicted, special

pytestmark = pytest.mark.slow

#: What the reference leaves in a slow quantity of order one.
REFERENCE = 1e-11

x, p, t = sp.symbols("x p t")


@pytest.mark.sample(3)
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_a_delay_is_within_the_error_of_its_law(case):
    """At the second rate of each case; all of them are in the campaign."""
    eps = case.rates[1]
    law, truth = predicted(case, eps), measured(case, eps)
    apart = abs(law.delay - truth)
    assert apart <= law.error + REFERENCE
    # no more is stated than is needed, and it is small beside the delay
    assert law.error <= max(1.6 * apart, 1e-3 * truth)
    assert law.error < (0.12 if eps > 1e-3 else 0.04) * truth
    assert f" ± {law.error:.2g}" in repr(law)


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    "case",
    [slow_models.cusp(), slow_models.van_der_pol(), slow_models.curved_corner()],
    ids=lambda case: case.name,
)
def test_errors_shrink_with_the_rate(case):
    """A fold's as ε^(4/3), a corner's as ε²: ten times slower, 21.5 and 100 times less."""
    laws = [predicted(case, eps) for eps in case.rates]
    truth = [measured(case, eps) for eps in case.rates]
    assert all(abs(a.delay - b) <= a.error for a, b in zip(laws, truth, strict=True))
    shrunk = laws[-2].error / laws[-1].error
    assert shrunk == pytest.approx(100 if "corner" in case.name else 21.5, rel=0.25)


def test_feedback_is_a_part_of_the_cubic_term():
    """x' = y − x³/3 + x, y' = −ε x at x = 1: a = −1, c = −1/3, κ = −1, and β = (c − κ)/3 = 2/9."""
    frozen = fs.systems.van_der_pol_relaxation().frozen()
    folds = fs.continue_equilibria(frozen, "y", over=(-1, 1)).folds
    drift = fs.Drift(-1e-4, by_state={"x": -1e-4})
    law = fs.predict_delay(max(folds, key=lambda f: f["x"]), drift, level="turn")
    assert (law.quadratic, law.cubic) == pytest.approx((-1, -1 / 3), abs=1e-12)
    assert law.coefficients[:2] == pytest.approx((OMEGA_0, 2 / 9), rel=1e-12)
    assert law.feedback == pytest.approx(-1e-4, rel=1e-12)
    assert (law.level, law.drift) == ("turn", drift)
    assert law.delay_time > law.delay / 1e-4


def test_a_change_of_the_rate_moves_the_delay():
    """(2/5) Ω₀² (c₁/rate) |rate|/δ², against the passage as integrated, to second order in it."""
    frozen = fs.Model({x: p + x**2}, parameters={p: -1})
    fold = fs.continue_equilibria(frozen, "p", over=(-1, 1)).folds[0]
    plain, errors = fs.predict_delay(fold, 1e-3, level={"x": 5000}), []
    for change in (2e-6, 1e-6):
        law = fs.predict_delay(fold, fs.Drift(1e-3, change=change), level={"x": 5000})
        moved = 0.4 * OMEGA_0**2 * (change / 1e-3) * 1e-3 / 1e-2
        assert law.delay - plain.delay == pytest.approx(moved, rel=1e-9)
        errors.append(law.error)
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.05)


def test_a_drift_that_is_not_known_in_full_states_no_error():
    for case in (slow_models.cusp(), slow_models.van_der_pol_linear()):
        point, _ = special(case)
        way = 1.0 if case.slow == "p" else -1.0
        drift = fs.Drift(way * 1e-3, complete=False)
        law = fs.predict_delay(point, drift, level={"x": 0.1})
        assert math.isfinite(law.delay)
        assert math.isnan(law.error)
        assert "known" in law.validity
        assert "±" not in repr(law)


def test_levels_and_drifts_that_do_not_fit():
    point, _ = special(slow_models.cusp())
    with pytest.raises(fs.ArgumentError, match="a constant drift has no extremum"):
        fs.predict_delay(point, 1e-3, level="turn")
    with pytest.raises(fs.ArgumentError, match="expected a mapping of one state"):
        fs.predict_delay(point, 1e-3, level="turns")
    with pytest.raises(fs.UnknownNameError, match="unknown state of the drift 'y'"):
        fs.predict_delay(point, fs.Drift(1e-3, by_state={"y": 1e-3}))
    corner, _ = special(slow_models.van_der_pol_linear())
    with pytest.raises(fs.ArgumentError, match="is not slow compared with the branch"):
        fs.predict_delay(corner, fs.Drift(-1.0, by_state={"x": -9.0}), level="turn")


def test_a_turn_that_never_comes_is_none():
    """The drift grows with the state: no extreme, and the delay says so."""
    corner, _ = special(slow_models.van_der_pol_linear())
    law = fs.predict_delay(corner, fs.Drift(-1e-3, by_state={"x": 1e-3}), level="turn")
    assert math.isnan(law.delay)
    assert law.validity.startswith("none: ")


@pytest.fixture(scope="module")
def any_fold():
    """x' = w + x² + c x³ + g w x + h x⁴, whose fold is at the origin."""
    c, g, h, w = sp.symbols("c g h w")
    model = fs.Model(
        {x: w + x**2 + c * x**3 + g * w * x + h * x**4}, parameters={w: -0.1, c: 0, g: 0, h: 0}
    )
    diagram = fs.continue_equilibria(model, "w", over=(-0.2, 0.1))
    return model, min(diagram.folds, key=lambda f: abs(f["x"]))


@pytest.mark.sample(3)
@pytest.mark.parametrize("seed", range(20))
def test_any_fold_with_any_linear_drift(any_fold, seed):
    """w' = ε (1 + k x + m w), to x = 0.6 or, where it turns before, to the extreme."""
    draw = np.random.default_rng(seed).uniform
    c, g, feedback, by_value = draw(-1, 1), draw(-1, 1), draw(-2, 2), draw(-2, 2)
    h, speed = draw(0, 1), draw(-6, -3)
    model, fold = any_fold
    eps = 10**speed
    fold = replace(fold, parameters={**fold.parameters, "c": c, "g": g, "h": h})
    drift = fs.Drift(eps, by_value=eps * by_value, by_state={"x": eps * feedback})
    turns = 1.0 + 0.8 * feedback < 0.0
    level = "turn" if turns else {"x": 0.6}
    law = fs.predict_delay(fold, drift, level=level, parameter="w", model=model)

    def flow(time, z):
        x, w = z
        rate = w + x**2 + c * x**3 + g * w * x + h * x**4
        return [rate, eps * (1 + feedback * x + by_value * w)]

    def end(time, z):
        return flow(time, z)[1] if turns else z[0] - 0.6

    end.terminal = True
    start = -10 * eps ** (2 / 3)
    run = solve_ivp(flow, (0, 1e7), [-((-start) ** 0.5), start], events=end, **PRECISE)
    assert run.status == 1
    assert abs(run.y[1, -1] - law.delay) <= law.error + REFERENCE
    assert law.error <= max(2.0 * abs(run.y[1, -1] - law.delay), 1e-4 * abs(law.delay))


@pytest.fixture(scope="module")
def any_corner():
    """x' = w + k x + m x² on x < 0, w + u x + n x² on x > 0."""
    k, m, u, n, w = sp.symbols("k m u n w")
    force = sp.Piecewise((u * x + n * x**2, x > 0), (k * x + m * x**2, True))
    model = fs.Model({x: w + force}, parameters={w: -0.1, k: -1, m: 0, u: 1, n: 0})
    return model, fs.continue_equilibria(model, "w", over=(-0.1, 0.1)).boundary_equilibria[0]


@pytest.mark.sample(3)
@pytest.mark.parametrize("seed", range(20))
def test_any_corner_with_any_drift(any_corner, seed):
    """w' = ε (1 + f x + ε c t), to x = 0.5 or, where it turns before, to the extreme."""
    draw = np.random.default_rng(seed).uniform
    k, u, feedback = draw(-3, -0.5), draw(0.3, 3), draw(-2, 2)
    m, n, change, speed = draw(-0.3, 0.3), draw(-0.3, 0.3), draw(-0.05, 0.05), draw(-5, -2.5)
    model, point = any_corner
    eps = 10**speed
    model = model.with_parameters(k=k, m=m, u=u, n=n)
    point = fs.continue_equilibria(model, "w", over=(-0.1, 0.1)).boundary_equilibria[0]
    drift = fs.Drift(eps, change=eps**2 * change, by_state={"x": eps * feedback})
    turns = 1.0 + 0.7 * feedback < 0.0
    law = fs.predict_delay(point, drift, level="turn" if turns else {"x": 0.5})

    def flow(time, z):
        x, w = z
        force = u * x + n * x**2 if x > 0 else k * x + m * x**2
        return [w + force, eps * (1 + feedback * x + eps * change * time)]

    def end(time, z):
        return flow(time, z)[1] if turns else z[0] - 0.5

    def passes(time, z):
        return z[1]

    end.terminal = passes.terminal = True
    # the time that the drift counts is zero where w passes the point
    start = max(40 * eps / k, -0.15)
    first = solve_ivp(flow, (start / eps, 1e7), [-start / k, start], events=passes, **PRECISE)
    run = solve_ivp(flow, (0, 1e7), first.y[:, -1], events=end, **PRECISE)
    assert run.status == 1
    assert abs(run.y[1, -1] - law.delay) <= law.error + REFERENCE
