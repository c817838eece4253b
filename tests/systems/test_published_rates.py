"""The rates of the ready-made models with their default values, written down a second time."""

import math

import pytest
import sympy as sp

from fastslow import systems


def dead(x, width):
    """Distance outside of a gap, with its sign."""
    return x - min(max(x, -width), width)


def hindmarsh_rose(t, x, y, z):
    return [y - x**3 + 3 * x**2 - z + 2, 1 - 5 * x**2 - y, 0.006 * (4 * (x + 1.6) - z)]


def stick_slip(t, x, v):
    slip = v - 0.2
    return [v, -x - math.copysign(1 / (1 + 3 * abs(slip)), slip)]


def harmonic_gear(t, x, v):
    load = 2.372 + 3.546 * math.sin(0.01 * t)
    return [v, load - v - (x**2 + 41.67) * dead(x, 0.25)]


def twist(t, theta, v, load):
    return -(3000 + 21000 * theta**2) * dead(theta, 0.0175) - 1.3122204944390221 * v + load


def harmonic_gear_twist(t, theta, v):
    inertia = 1 / (1 / 0.024 + 1 / (100**2 * 0.00068))
    load = 10 + inertia / 0.024 * 15 * math.sin(0.5 * t)
    return [v, twist(t, theta, v, load) / inertia]


def harmonic_gear_two_inertias(t, outer, v_outer, inner, v_inner):
    """Torque T_m drives the input through the ratio of 100, the output bears the load."""
    between = twist(t, outer - inner / 100, v_outer - v_inner / 100, 0.0)
    load = 10 + 15 * math.sin(0.5 * t)
    return [
        v_outer,
        (between + load) / 0.024,
        v_inner,
        (-between - 10) / (100 * 0.00068),
    ]


def buck_converter(t, v, i):
    sawtooth = 3.8 + 4.4 * (t / 4e-4 % 1)
    source = 24 if 8.4 * (v - 11.3) < sawtooth else 0
    return [(i - v / 22) / 47e-6, (source - v) / 0.02]


def hodgkin_huxley(t, V, m, h, n):
    """In the source's variable, the depolarisation v = -65 - V, and with its signs."""
    v = -65 - V
    rates = [
        (m, 0.1 * (v + 25) / (math.exp((v + 25) / 10) - 1), 4 * math.exp(v / 18)),
        (h, 0.07 * math.exp(v / 20), 1 / (math.exp((v + 30) / 10) + 1)),
        (n, 0.01 * (v + 10) / (math.exp((v + 10) / 10) - 1), 0.125 * math.exp(v / 80)),
    ]
    ionic = 120 * m**3 * h * (v + 115) + 36 * n**4 * (v - 12) + 0.3 * (v + 10.6)
    return [10 + ionic, *(a * (1 - z) - b * z for z, a, b in rates)]


def noble(t, E, m, h, n):
    rates = [
        (m, 0.1 * (-E - 48) / math.expm1((-E - 48) / 15), 0.12 * (E + 8) / math.expm1((E + 8) / 5)),
        (h, 0.17 * math.exp((-E - 90) / 20), 1 / (math.exp((-E - 42) / 10) + 1)),
        (n, 1e-4 * (-E - 50) / math.expm1((-E - 50) / 10), 2e-3 * math.exp((-E - 90) / 80)),
    ]
    sodium = (400 * m**3 * h + 0.14) * (E - 40)
    first = 1.2 * math.exp((-E - 90) / 50) + 0.015 * math.exp((E + 90) / 60)
    potassium = (first + 1.2 * n**4) * (E + 100)
    return [-(sodium + potassium) / 12, *(a * (1 - z) - b * z for z, a, b in rates)]


RATES = {
    "bilinear_oscillator": lambda t, x, v: [
        v,
        0.36 * math.cos(0.8 * t) - x - 2 * 0.01 * v - 10 * max(x - 1, 0),
    ],
    "bouncing_ball": lambda t, x, v: [v, -1],
    "buck_converter": buck_converter,
    "cusp": lambda t, x: [math.sin(0.01 * t) + x - x**3],
    "fitzhugh_nagumo": lambda t, v, r: [
        v - v**3 / 3 - r + 0.5 + 0.5 * math.sin(0.001 * t),
        0.08 * (v + 0.7 - 0.8 * r),
    ],
    "gear_pair": lambda t, x, v: [
        v,
        0.1 + 0.05 * 0.7**2 * math.sin(0.7 * t) - 2 * 0.05 * v - dead(x, 1),
    ],
    "harmonic_gear": harmonic_gear,
    "harmonic_gear_twist": harmonic_gear_twist,
    "harmonic_gear_two_inertias": harmonic_gear_two_inertias,
    "hindmarsh_rose": hindmarsh_rose,
    "hodgkin_huxley": hodgkin_huxley,
    "impact_oscillator": lambda t, x, v: [v, 0.6 * math.cos(0.8 * t) - x - 0.1 * v],
    "izhikevich": lambda t, v, u: [
        0.04 * v**2 + 5 * v + 150 - u,
        0.02 * (0.2 * v - u),
    ],
    "moving_wall_oscillator": lambda t, x, v: [v, -x - 0.1 * v],
    "noble": noble,
    "relay_feedback": lambda t, x, y, z: [1 - x, x - y, y - z],
    "rigid_gear": lambda t, x, v: [v, 2.372 + 3.546 * math.sin(t) - v],
    "stick_slip": stick_slip,
    "van_der_pol": lambda t, x, v: [v, (1 - x**2) * v - x + 2 * math.sin(0.01 * t)],
    "van_der_pol_relaxation": lambda t, x, y: [y - x**3 / 3 + x, -0.01 * x],
}

PLACES = [(0.31, -0.7, 1.3, 2.1), (-1.4, 0.6, -0.2, 0.9), (2.2, 1.1, 0.4, -3.0), (0.01, 0.3, 0, 1)]


@pytest.mark.parametrize("name", RATES)
def test_the_rates_are_those_written_down(name):
    model = getattr(systems, name)()
    states = (*model.states, *model.slow_states)
    t = sp.Symbol("t", real=True)
    for time, place in zip((0.0, 0.4, 37.0, 410.0), PLACES, strict=True):
        here = {sp.Symbol(n, real=True): sp.Float(v) for n, v in zip(states, place, strict=False)}
        here |= {t: sp.Float(time)}
        here |= {sp.Symbol(n, real=True): sp.Float(v) for n, v in model.parameters.items()}
        here |= {sp.Symbol(n, real=True): sp.Integer(1) for n in model.switches}
        load = {sp.Symbol(n, real=True): e.subs(here) for n, e in model.forcing.items()}
        found = [float(model.rates[n].subs(load).subs(here)) for n in states]
        expected = RATES[name](time, *place[: len(states)])
        assert found == pytest.approx(expected, rel=1e-12, abs=1e-14)


def test_every_ready_made_model_is_here():
    known = {n for n in systems.__all__ if n.islower()}
    assert known - set(RATES) == {
        "gear_scales",
        "harmonic_gear_from_physical",
        "slow_load_criterion",
        "slow_load_gap",
    }
