"""Models with impacts, spikes, clocks and relays against closed forms."""

import math
from itertools import pairwise

import numpy as np
import pytest
import sympy as sp
from scipy.linalg import expm
from scipy.optimize import brentq

import fastslow as fs
from fastslow import systems


def test_the_impact_oscillator_between_impacts_is_linear():
    model = systems.impact_oscillator(zeta=0, f=0, sigma=0.6, r=0.8)
    run = fs.simulate(model, [0, 1], t=(0, 6))
    first, second = run.resets
    assert first.time == pytest.approx(math.asin(0.6), rel=1e-12)
    assert first.after[1] == pytest.approx(-0.8 * 0.8, rel=1e-12)
    # from (0.6, −0.64) the circle is passed back to x = 0.6
    assert second.time - first.time == pytest.approx(2 * math.pi - 2 * math.atan2(0.64, 0.6))


def test_the_impact_oscillator_begins_to_hit_its_stop():
    zeta, sigma, omega = 0.05, 0.7, 0.8
    limit = sigma * math.hypot(1 - omega**2, 2 * zeta * omega)
    for factor, impacts in ((0.999, 0), (1.001, 1)):
        model = systems.impact_oscillator(zeta=zeta, f=factor * limit, sigma=sigma, omega=omega)
        # the periodic motion without impacts
        amplitude = factor * limit / complex(1 - omega**2, 2 * zeta * omega)
        state = [amplitude.real, -omega * amplitude.imag]
        assert len(fs.simulate(model, state, periods=1).resets) == impacts


def test_a_moving_wall_is_a_fixed_one_in_relative_coordinates():
    a, omega, given = 0.3, 2.6, {"sigma": 0.2, "r": 0.8, "omega": 2.6, "zeta": 0}
    moving = fs.simulate(systems.moving_wall_oscillator(a=a, **given), [0, 0], t=(0, 20))
    fixed = systems.impact_oscillator(f=-a * (1 - omega**2), **given)
    fixed = fs.simulate(fixed, [-a, 0], t=(0, 20))
    assert len(moving.resets) == len(fixed.resets) > 5
    for one, other in zip(moving.resets, fixed.resets, strict=True):
        assert one.time == pytest.approx(other.time, rel=1e-10)
        speed = -a * omega * math.sin(omega * one.time)
        assert one.after[1] - speed == pytest.approx(other.after[1], rel=1e-8)


@pytest.mark.parametrize("periods", [1, 2])
def test_the_ball_bounces_at_the_phase_of_the_source(periods):
    r, A = 0.8, 0.8
    phase = math.acos((1 - r) / (1 + r) * math.pi * periods / A)
    run = fs.simulate(
        systems.bouncing_ball(A=A, r=r), [A * math.sin(phase), math.pi * periods], t=(phase, 50)
    )
    times = np.array([phase, *(reset.time for reset in run.resets)])
    assert np.diff(times) == pytest.approx(2 * math.pi * periods, rel=1e-9)
    assert len(times) > 3


def test_the_rigid_gear_flies_and_rests_on_a_flank():
    B, D, r = 2.0, 0.25, 0.6
    run = fs.simulate(systems.rigid_gear(B=B, C=0, D=D, r=r), [0, 0], t=(0, 5))
    first = run.resets[0]
    assert B * (first.time - 1 + math.exp(-first.time)) == pytest.approx(D, rel=1e-12)
    assert first.after == pytest.approx([D, -r * B * (1 - math.exp(-first.time))], rel=1e-12)
    assert "at rest" in run.segments[-1].region
    assert run(5.0).tolist() == [D, 0.0]


def test_the_stiff_gear_rebounds_as_the_rigid_one():
    A = 1e6
    run = fs.simulate(systems.harmonic_gear(A=A, B=0, C=0), [0.25, 1], t=(0, 0.01))
    (back,) = run.crossings
    assert back.time == pytest.approx(math.pi / math.sqrt(A), rel=1e-3)
    assert -back.state[1] == pytest.approx(math.exp(-math.pi / 2 / math.sqrt(A)), abs=1 / A)


def test_the_neuron_fires_regularly_without_recovery():
    c, current = -50.0, 10.0
    model = systems.izhikevich(a=0, c=c, d=0, I_0=current)
    run = fs.simulate(model, [c, -10], t=(0, 50))
    # ∫ dv/(0.04 v² + 5 v + 160) from c to 30: 0.04 (v + 62.5)² + 3.75
    q = math.sqrt(0.04 / (current - 16.25 + 10))
    period = (math.atan(q * 92.5) - math.atan(q * 12.5)) * q / 0.04
    assert [b.time - a.time for a, b in pairwise(run.resets)] == pytest.approx(
        [period] * (len(run.resets) - 1), rel=1e-10
    )
    assert len(run.resets) == int(50 / period)


def test_the_frozen_neuron_has_its_fold():
    rate = systems.izhikevich(I_0=10).regions["S1"].rates["v"]
    names = {symbol.name: symbol for symbol in rate.free_symbols}
    place = {names["v"]: sp.Rational(-125, 2), names["u"]: sp.Rational(-25, 4), names["I_0"]: 10}
    assert rate.subs(place) == rate.diff(names["v"]).subs(place) == 0


def converter(V_in, p):
    """Closing time of the switch and multipliers of the output of one period."""
    A = np.array([[-1 / (p["R"] * p["C"]), 1 / p["C"]], [-1 / p["L"], 0]])
    source = np.array([0, V_in / p["L"]])

    def start(closing):
        on = expm(A * (p["T"] - closing))
        forced = np.linalg.solve(A, (on - np.eye(2)) @ source)
        return np.linalg.solve(np.eye(2) - expm(A * p["T"]), forced)

    def above(closing):
        v = (expm(A * closing) @ start(closing))[0]
        sawtooth = p["V_L"] + (p["V_U"] - p["V_L"]) * closing / p["T"]
        return p["a"] * (v - p["V_ref"]) - sawtooth

    closing = brentq(above, 0, p["T"], xtol=1e-18)
    normal, before = np.array([-p["a"], 0]), A @ expm(A * closing) @ start(closing)
    rate = normal @ before + (p["V_U"] - p["V_L"]) / p["T"]
    saltation = np.eye(2) + np.outer(source, normal) / rate
    whole = expm(A * (p["T"] - closing)) @ saltation @ expm(A * closing)
    return start(closing), np.linalg.eigvals(whole)


def test_the_converter_doubles_its_period_where_the_source_says():
    p = systems.buck_converter().parameters
    doubled = brentq(lambda V: converter(V, p)[1].real.min() + 1, 23, 26)
    assert doubled == pytest.approx(24.516, abs=1e-3)
    for V, same in ((24, True), (25, False)):
        state, _ = converter(V, p)
        # the periodic output persists where it is stable
        run = fs.simulate(systems.buck_converter(V_in=V), state + np.array([1e-4, 0]), periods=300)
        away = np.abs(run(run.t[-1]) - state).max()
        assert (away < 1e-6) == same


@pytest.mark.parametrize("epsilon", [0.02, 0.3])
def test_the_relay_oscillates_with_the_half_period_of_the_source(epsilon):
    A, b = np.array([[-1.0, 0, 0], [1, -1, 0], [0, 1, -1]]), np.array([2.0, 0, 0])

    def start(half):
        """State at which the relay switches on, from which the opposite one is reached."""
        grown = expm(A * half)
        return -np.linalg.solve(np.eye(3) + grown, np.linalg.solve(A, (grown - np.eye(3)) @ b))

    half = brentq(lambda h: start(h)[2] + epsilon, 1, 20, xtol=1e-14)
    run = fs.simulate(
        systems.relay_feedback(epsilon=epsilon, K=2),
        {**dict(zip("xyz", start(half), strict=True)), "q": 1},
        t=(0, 4.5 * half),
    )
    times = [0.0, *(switch.time for switch in run.switches)]
    assert np.diff(times) == pytest.approx([half] * 4, rel=1e-9)
