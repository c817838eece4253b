"""Guesses of periodic orbits: in any units, on interfaces, and equilibria."""

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

import fastslow as fs
from tests.orbits.models import t, v, x

pytestmark = pytest.mark.slow

w = sp.Symbol("w")


def scaled(name):
    """Models with a unit s of the states and r of the rates."""
    s, r = sp.symbols("s r")
    if name == "oscillator":
        rates = {x: r * v, v: r * ((1 - x**2 / s**2) * v - x)}
    elif name == "block":
        slip = v / s - sp.Rational(1, 5)
        friction = 0.3 * sp.sign(slip) / (1 + 3 * sp.Abs(slip))
        rates = {x: r * v, v: -r * (x + s * friction)}
    else:
        force = sp.Piecewise((x - s, x > s), (x + s, x < -s), (0, True))
        load = s * (2 + sp.Float(0.6084) * sp.sin(sp.Float(0.78) * r * t)) / 20
        rates = {x: r * v, v: r * (load - force - v / 10)}
    return fs.Model(rates, parameters={s: 1, r: 1})


@pytest.mark.sample(4)
@pytest.mark.parametrize("rate", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize(
    ("name", "guess"),
    [
        ("oscillator", [2, 0]),
        ("oscillator", [1e-3, 0]),
        ("block", [1, 0]),
        # on the interface: sticking, and where it ends
        ("block", [0.1, 0.2]),
        ("block", [0.3, 0.2]),
        ("gear", [0, 0]),
    ],
)
def test_units_of_states_and_time(name, guess, size, rate):
    model = scaled(name)
    plain = fs.find_orbit(model, guess)
    found = fs.find_orbit(model.with_parameters(s=size, r=rate), size * np.array(guess))
    assert found.outcome.code == "periodic"
    assert found.period * rate == pytest.approx(plain.period, rel=1e-12)
    assert found.itinerary == plain.itinerary
    assert found.multipliers == pytest.approx(plain.multipliers, rel=1e-9, abs=1e-12)
    assert found["max(x)"] / size == pytest.approx(plain["max(x)"], rel=1e-11)


@pytest.mark.parametrize("rate", [1e-6, 1e6])
@pytest.mark.parametrize("size", [1e-6, 1e6])
def test_equilibria_in_other_units(size, rate):
    model = scaled("oscillator").with_parameters(s=size, r=rate)
    with pytest.raises(fs.ArgumentError, match="the guess is an equilibrium"):
        fs.find_orbit(model, [0, 0])
    wells = fs.Model({x: rate * v, v: rate * (x - x**3 / size**2 - v / 2)})
    # to rounding
    for state in ([size, 0], [size * (1 + 1e-15), 1e-17 * size]):
        with pytest.raises(fs.ArgumentError, match="the guess is an equilibrium"):
            fs.find_orbit(wells, state)
    settling = fs.find_orbit(wells, [2 * size, 0])
    assert settling.outcome.code == "equilibrium"
    assert settling.stability == "unknown"


@pytest.fixture(scope="module")
def stick_slip_period():
    """By SciPy: slip from (1, 0.2), where sticking ends, and then sticking at the speed 0.2."""

    def slip(_, z):
        return [z[1], 1 / (1 + 3 * (0.2 - z[1])) - z[0]]

    def sticks(time, z):
        return z[1] - 0.2 if time > 1 else -1.0

    sticks.terminal = True
    run = solve_ivp(slip, (0, 50), [1, 0.2], "DOP853", events=sticks, rtol=1e-13, atol=1e-14)
    return run.t[-1] + (1 - run.y[0, -1]) / 0.2


@pytest.mark.parametrize("state", [[1, 0.2], [-1, 0.2], [0.5, 0.2], [1.2, 0.2]])
def test_guess_on_the_interface(state, stick_slip_period):
    """The run begins where sticking ends, or within it."""
    found = fs.find_orbit(fs.systems.stick_slip(), state)
    assert found.outcome.code == "periodic"
    assert found.itinerary == ("S2", "S1|S2")
    assert found.period == pytest.approx(stick_slip_period, rel=1e-10)
    assert found.log_multipliers[1] == -np.inf


def test_a_forcing_that_switches_at_phase_zero():
    """x'' + x' + x = sign(sin t): the run of one period begins and ends at an event."""
    model = fs.Model({x: v, v: -x - v + sp.sign(w)}, forcing={w: sp.sin(t)})
    found = fs.find_orbit(model, [0, 0])
    assert found.outcome.code == "periodic"
    assert found.period == pytest.approx(2 * np.pi, rel=1e-14)
    # the response to the Fourier series 4/π sum sin(k t)/k of the square wave
    k = np.arange(1, 200_001, 2)
    answer = 4 / np.pi / k * np.exp(1j * k * 1.0) / (1 - k**2 + 1j * k)
    assert found(1.0)[0] == pytest.approx(answer.imag.sum(), abs=1e-10)


def test_reasons():
    """The reason is that of the runs, with that of an early attempt as a note."""
    relay = fs.Model({x: v, v: -sp.sign(x + v / 5)})
    sliding = fs.find_orbit(relay, [-0.62, 0.04])
    assert sliding.outcome.code == "equilibrium"
    assert "settles on an equilibrium" in str(sliding.outcome)
    growing = fs.find_orbit(fs.Model({x: x**2 + sp.cos(t)}), [-1.18])
    assert growing.outcome.code == "blow-up"
    assert "Newton's method did not converge" in growing.outcome.notes[0]
    # a polynomial in time, in a single step
    moving = fs.find_orbit(fs.Model({x: 1 + 0 * x, v: -v}), [0, 1])
    assert moving.outcome.code == "not settled"


def test_rotation_of_a_single_state():
    """x' = 1 + sin(x)/2 has the period 2 pi / sqrt(3/4)."""
    found = fs.find_orbit(fs.Model({x: 1 + sp.sin(x) / 2}, periodic={x: 2 * sp.pi}), [0])
    assert found.outcome.code == "periodic"
    assert found.period == pytest.approx(2 * np.pi / np.sqrt(0.75), rel=1e-13)
    assert found.multipliers == pytest.approx([1.0], abs=1e-12)
    assert found.stability == "stable"
