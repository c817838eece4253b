"""Entry and exit of a slow passage through a branch point, along an invariant branch."""

import math
import re

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp, trapezoid

import fastslow as fs

pytestmark = pytest.mark.slow

x, y, w, t, p = sp.symbols("x y w t p")
EPS = 0.01


@pytest.fixture(scope="module")
def pitchfork():
    return fs.Model({x: w * x - x**3}, forcing={w: -1 + EPS * t})


def bernoulli(time, start=1e-3):
    """x at a time in closed form: u = x⁻² obeys u' = −2 w u + 2, along the exponent A."""

    def exponent(s):
        return -s + EPS * s * s / 2

    s, step = np.linspace(0, time, 400_001, retstep=True)
    tail = trapezoid(np.exp(2 * (exponent(s) - exponent(time))), s, dx=step)
    # log u, as u itself reaches 1e50
    decayed = -2 * math.log(start) - 2 * exponent(time)
    return 1 / math.sqrt(math.exp(decayed) + 2 * tail)


@pytest.fixture(scope="module")
def off(pitchfork):
    return fs.continue_equilibria(pitchfork.frozen(), "w", over=(-2, 2))


def test_the_exit_mirrors_the_entry(pitchfork, off):
    law = fs.predict_delay(off.special("BP")[0], EPS, diagram=off, entry=-1)
    assert law.value == pytest.approx(1.0, abs=1e-12)
    assert law.decay == pytest.approx(1 / (2 * EPS), rel=1e-12)
    assert "x is a factor of its rate" in law.validity
    run = fs.simulate(pitchfork, [1e-3], t=(0, 205))
    assert run(100.0)[0] == pytest.approx(bernoulli(100.0), rel=1e-6)
    out = run.section("x", level=1e-3, direction=1)
    assert out["w"][-1] == pytest.approx(law.value, abs=2e-8)


def test_a_gain(off):
    law = fs.predict_delay(off.special("BP")[0], EPS, diagram=off, entry=-1, gain=10)
    assert law.value == pytest.approx(math.sqrt(1 + 2 * EPS * math.log(10)), abs=1e-12)


def test_a_predator_that_its_prey_lets_in():
    """y' = y (x − 1/2 − y) beside x' = 1 − p x: λ = 1/p − 1/2, zero at p = 2, p falling."""
    model = fs.Model({x: 1 - p * x, y: y * (x - sp.Rational(1, 2) - y)}, parameters={p: 3})
    diagram = fs.continue_equilibria(model, "p", over=(1, 4))
    (point,) = {round(b["p"], 9): b for b in diagram.special("BP")}.values()
    law = fs.predict_delay(point, -1e-3, diagram=diagram, entry=3.0)

    # ln p − p/2 is the integral of 1/p − 1/2
    def lacking(q):
        return math.log(q) - q / 2 - math.log(3) + 1.5

    assert abs(lacking(law.value)) < 1e-10
    assert law.value < 2
    ramp = model.with_ramp("p", -1e-3, from_value=3.0)
    run = fs.simulate(ramp, [1 / 3, 1e-2], t=(0, 2000))
    out = run.section("y", level=1e-2, direction=1)
    assert out["p"][-1] == pytest.approx(law.value, abs=5e-3)


def test_a_branch_that_does_not_move():
    """x = 1 for every p, which no state has as a factor."""
    model = fs.Model({x: p * (x - 1) - (x - 1) ** 3}, parameters={p: -1})
    diagram = fs.continue_equilibria(model, "p", over=(-2, 2))
    law = fs.predict_delay(diagram.special("BP")[0], 0.05, diagram=diagram, entry=-1)
    assert law.value == pytest.approx(1.0, abs=1e-9)
    assert "does not depend on p" in law.validity
    far = fs.predict_delay(diagram.special("BP")[0], 0.01, diagram=diagram, entry=-1)
    assert "limited by rounding" in far.validity


@pytest.mark.parametrize("unit", [1e-6, 1e6])
def test_whether_a_branch_moves_does_not_depend_on_its_unit(unit):
    """x = unit rests, x = ±w unit moves."""
    s = x / unit - 1
    still = fs.Model({x: unit * (p * s - s**3)}, parameters={p: -1})
    diagram = fs.continue_equilibria(still, "p", over=(-2, 2))
    law = fs.predict_delay(diagram.special("BP")[0], 0.05, diagram=diagram, entry=-1)
    assert law.value == pytest.approx(1.0, abs=1e-9)
    model = fs.Model({x: unit * (x / unit - w) * (x / unit + w)}, parameters={w: -1})
    moving = fs.continue_equilibria(model, "w", over=(-2, 2))
    with pytest.raises(fs.ArgumentError, match="not invariant while w drifts"):
        fs.predict_delay(moving.special("BP")[0], 0.05, diagram=moving, entry=-1)


def test_a_factor_remembers_down_to_the_smallest_number(off):
    point = off.special("BP")[0]
    assert "limited" not in fs.predict_delay(point, 1e-3, diagram=off, entry=-1).validity
    assert (
        "limited by the smallest number, 1e-300"
        in fs.predict_delay(point, 5e-4, diagram=off, entry=-1).validity
    )


def test_what_is_refused(off):
    point = off.special("BP")[0]
    with pytest.raises(fs.ArgumentError, match="give diagram= and entry="):
        fs.predict_delay(point, EPS)
    with pytest.raises(fs.ArgumentError, match="not invariant while w drifts"):
        fs.predict_delay(point, -EPS, diagram=off, entry=1)
    with pytest.raises(
        fs.ArgumentError, match=r"entry = 0\.5; expected a value of w on the branch"
    ):
        fs.predict_delay(point, EPS, diagram=off, entry=0.5)
    # both branches of a transcritical point in p = x² − w² move with w
    model = fs.Model({x: (x - w) * (x + w)}, parameters={w: -1})
    moving = fs.continue_equilibria(model, "w", over=(-2, 2))
    with pytest.raises(fs.ArgumentError, match="not invariant while w drifts"):
        fs.predict_delay(moving.special("BP")[0], EPS, diagram=moving, entry=-1)


@pytest.mark.parametrize(
    ("rates", "start", "jumps"),
    [
        (w**2 - x**2, 1.0, False),
        ((x - w) * (x - 3 * w), -3.0, False),
        ((x + w) * (x + 3 * w), 1.0, True),
    ],
)
def test_an_algebraic_passage_is_said_to_jump_or_not(rates, start, jumps):
    """Krupa and Szmolyan's λ is −(m₁ + m₂)/|m₁ − m₂| = 0, −2, 2 for slopes m: jumps above 1."""
    model = fs.Model({x: rates}, parameters={w: -1})
    diagram = fs.continue_equilibria(model, "w", over=(-2, 2))
    point = diagram.special("BP")[0]
    with pytest.raises(fs.ArgumentError, match="the entry-exit integral does not apply") as told:
        fs.predict_delay(point, 1e-4, diagram=diagram, entry=-1)
    assert ("by a jump" in str(told.value)) is jumps
    # by SciPy from w = −1, to where x is far away
    rate = sp.lambdify((x, w), rates)
    found = solve_ivp(
        lambda s, z: [rate(z[0], -1 + 1e-2 * s)], (0, 160), [start], events=_far, rtol=1e-8
    )
    assert bool(len(found.t_events[0])) is jumps
    if jumps:
        said = float(re.search(r"rate \(([0-9.e-]+) in", str(told.value))[1])
        # √(1e-2/1e-4) times as late, less what the jump ends at |x| = 10³
        assert -1 + 1e-2 * found.t_events[0][0] == pytest.approx(10 * said, rel=0.02)


def _far(time, z):
    return abs(z[0]) - 1e3


_far.terminal = True


def test_an_overlay_prints_no_integral_where_the_drift_pushes():
    model = fs.Model({x: w**2 - x**2}, forcing={w: -1 + t / 1000})
    diagram = fs.continue_equilibria(model.frozen(), "w", over=(-1.5, 1.5))
    overlay = fs.overlay(diagram, fs.simulate(model, [1.0], t=(0, 2000)))
    assert overlay.transitions
    assert all(q.law is None for q in overlay.transitions)
