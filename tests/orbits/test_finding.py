"""Periodic orbits from guesses, compared with closed forms and with other integrators."""

import mpmath as mp
import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

import fastslow as fs
from fastslow.orbits.find import finding
from fastslow.orbits.flow.problem import OrbitProblem
from tests.orbits.models import (
    block_on_belt,
    gap_force,
    gear_pair,
    smooth_gear,
    t,
    two_sided,
    v,
    van_der_pol,
    x,
)

pytestmark = pytest.mark.slow


def test_period_of_van_der_pol():
    orbit = fs.find_orbit(van_der_pol(), [2, 0])
    assert abs(orbit.period - 6.66328685932) < 5e-12
    # Liouville: the transverse multiplier is exp of the integrated divergence 1 - x**2
    assert orbit.log_multipliers[1] == pytest.approx(
        orbit.period * orbit["mean(1 - x**2)"], abs=1e-11
    )
    assert orbit.stable


def test_any_state_leads_to_an_attracting_orbit():
    orbit = fs.find_orbit(van_der_pol(), {"x": 0.01, "v": 0})
    assert abs(orbit.period - 6.66328685932) < 5e-12


def test_mean_square_of_the_smooth_gear():
    orbit = fs.find_orbit(smooth_gear(), [0, 0])
    assert orbit["rms(sqrt(x**2 + v**2))"] == pytest.approx(0.96367265583, abs=5e-12)
    # det M = exp(-T) with unit damping
    assert orbit.log_multipliers.sum() == pytest.approx(-orbit.period, rel=1e-12)


def test_free_oscillator_with_a_gap():
    half = 0.3
    free = fs.Model({x: v, v: -gap_force(half)})
    orbit = fs.find_orbit(free, [1.0, 0.0])
    reach = orbit["max(x)"]
    assert orbit.period == pytest.approx(2 * np.pi + 4 * half / (reach - half), rel=1e-13)
    assert "one of a family" in str(orbit.outcome)
    assert orbit.itinerary == ("S1", "S2", "S3", "S2")


def test_stick_slip_cycle_has_a_multiplier_zero():
    orbit = fs.find_orbit(block_on_belt(), [0.5, 0.0])
    assert orbit.itinerary == ("S2", "S1|S2")
    assert orbit.stable
    assert orbit.log_multipliers[-1] == -np.inf
    assert orbit.multipliers[-1] == 0
    # sticking ends where the spring overcomes the static friction
    assert orbit.extremes("x")[1] > 0.3
    assert orbit.crossings("5*v - 1", direction=-1)[0].state[0] == pytest.approx(0.3, abs=1e-13)


def contact_orbit(W, guess):
    """Crossing times and states of an orbit with one contact, from closed forms in mpmath."""
    mp.mp.dps = 30
    W, z, Fm, Fa = map(mp.mpf, (W, "0.05", "0.1", "0.05"))
    c = 2 * z

    def solution(stiff, state, since, time):
        """x'' + c x' + stiff (x − 1) = Fm + Fa W² sin(W t)."""
        s = 1 if stiff else 0
        force = Fa * W**2
        # particular response to the sine: Im (P exp(i W t))
        P = force / (s - W**2 + mp.mpc(0, c * W))

        def special(at):
            wave = P * mp.expj(W * at)
            speed = mp.mpc(0, W) * wave
            if s:
                return mp.matrix([1 + Fm + wave.imag, speed.imag])
            return mp.matrix([Fm / c * at + wave.imag, Fm / c + speed.imag])

        d = state - special(since)
        tau = time - since
        if s:
            a, b = -c / 2, mp.sqrt(1 - c**2 / 4)
            k = (d[1] - a * d[0]) / b
            decay = mp.exp(a * tau)
            first = decay * (d[0] * mp.cos(b * tau) + k * mp.sin(b * tau))
            second = a * first + decay * b * (k * mp.cos(b * tau) - d[0] * mp.sin(b * tau))
            return special(time) + mp.matrix([first, second])
        decay = mp.exp(-c * tau)
        return special(time) + mp.matrix([d[0] + d[1] * (1 - decay) / c, d[1] * decay])

    T = 2 * mp.pi / W

    def equations(enter, leave, speed_in, speed_out):
        inside = solution(1, mp.matrix([1, speed_in]), enter, leave)
        outside = solution(0, mp.matrix([1, speed_out]), leave, enter + T)
        return inside[0] - 1, inside[1] - speed_out, outside[0] - 1, outside[1] - speed_in

    return mp.findroot(equations, tuple(map(mp.mpf, guess)))


def test_contact_loss_of_the_gear_pair_agrees_with_closed_forms():
    orbit = fs.find_orbit(gear_pair(W=0.82), [1.1, 0.9])
    enter, leave = orbit.crossings
    exact = contact_orbit("0.82", (enter.time, leave.time, enter.state[1], leave.state[1]))
    found = [enter.time, leave.time, enter.state[1], leave.state[1]]
    assert np.abs(np.array(found) - np.array([float(value) for value in exact])).max() < 2e-13
    # det M = exp(−2 z T), also across interfaces with continuous rates
    assert orbit.log_multipliers.sum() == pytest.approx(-0.1 * orbit.period, rel=1e-12)


def test_orbit_agrees_with_an_integration_that_restarts_at_crossings():
    orbit = fs.find_orbit(two_sided(F=2.5, omega=0.7), [0, 0])
    assert orbit.outcome
    assert len(orbit.crossings) >= 4

    def rates(time, state):
        place, speed = state
        contact = 10 * max(place - 1, 0) + 10 * min(place + 1, 0)
        return [speed, 2.5 * np.cos(0.7 * time) - speed / 5 - place - contact]

    events = [lambda time, state, side=side: state[0] - side for side in (1.0, -1.0)]
    for event in events:
        event.terminal = True
    time, state, end = 0.0, orbit(0.0), orbit.period
    while time < end:
        # away from the crossing at which the last integration ended
        time, state = time + 1e-7, state + 1e-7 * np.array(rates(time, state))
        run = solve_ivp(rates, (time, end), state, "DOP853", rtol=1e-13, atol=1e-13, events=events)
        time, state = run.t[-1], run.y[:, -1]
    assert np.abs(state - orbit(0.0)).max() < 1e-10


def test_orbits_of_the_mirrored_model_are_mirrored():
    one = fs.find_orbit(two_sided(F=2.5, omega=0.7), [0.3, 0.1])
    other = fs.find_orbit(two_sided(F=-2.5, omega=0.7), [-0.3, -0.1])
    times = np.linspace(0, one.period, 50)
    assert np.abs(one(times) + other(times)).max() < 1e-12
    assert np.abs(one.multipliers - other.multipliers).max() < 1e-11


def test_doubled_period_has_squared_multipliers():
    model = gear_pair(W=0.82)
    single, double = (fs.find_orbit(model, [1.1, 0.9], multiple=k) for k in (1, 2))
    assert double.period == pytest.approx(2 * single.period, rel=1e-15)
    squares = np.sort_complex(single.multipliers**2)
    assert np.abs(np.sort_complex(double.multipliers) - squares).max() < 1e-12
    assert "repeats after 1 of 2 periods" in repr(double)
    assert double.itinerary == single.itinerary * 2


def test_guesses():
    model = gear_pair(W=0.82)
    orbit = fs.find_orbit(model, [1.1, 0.9])
    again = fs.find_orbit(model, orbit)
    assert np.abs(again(0.0) - orbit(0.0)).max() < 1e-13
    run = fs.simulate(model, [1.1, 0.9], periods=60)
    assert np.abs(fs.find_orbit(model, run)(0.0) - orbit(0.0)).max() < 1e-13
    moved = fs.find_orbit(model.with_parameters(W=0.815), orbit)
    assert moved.outcome
    assert moved.period == pytest.approx(2 * np.pi / 0.815, rel=1e-15)
    assert fs.find_orbit(model, [1.1, 0.9], period=2 * orbit.period).multiple == 2


def test_an_unstable_orbit_is_found_from_a_state_near_it():
    orbit, reverse = (fs.find_orbit(van_der_pol(0.2, sign), [2, 0]) for sign in (1, -1))
    assert reverse.stability == "unstable"
    assert reverse.period == pytest.approx(orbit.period, rel=1e-13)
    assert reverse.log_multipliers[0] == pytest.approx(-orbit.log_multipliers[1], rel=1e-11)


def test_a_constant_orbit_of_a_wall_that_is_not_reached():
    stop = sp.Max(x - 2 - sp.cos(t), 0)
    model = fs.Model({x: v, v: 1 - x - v / 5 - stop - sp.Heaviside(x - 5) * sp.cos(t)})
    orbit = fs.find_orbit(model, [0, 0])
    assert orbit.outcome
    assert orbit.period == pytest.approx(2 * np.pi, rel=1e-15)
    assert orbit(0.0) == pytest.approx([1, 0], abs=1e-13)
    # Liouville: the divergence is -1/5
    assert orbit.log_multipliers.sum() == pytest.approx(-2 * np.pi / 5, rel=1e-11)


def test_strong_expansion_is_divided_by_nodes():
    orbit = fs.find_orbit(van_der_pol(0.2, -1), [2, 0])
    for mu in np.arange(0.4, 4.1, 0.4):
        orbit = fs.find_orbit(van_der_pol(mu, -1), orbit)
        assert orbit.outcome
    attracting = fs.find_orbit(van_der_pol(4), [2, 0])
    assert orbit.period == pytest.approx(attracting.period, rel=1e-12)
    assert orbit.log_multipliers[0] == pytest.approx(-attracting.log_multipliers[1], rel=1e-9)
    assert orbit.log_multipliers[0] > 20


def rotor():
    """A damped pendulum under a constant torque."""
    phi = sp.Symbol("phi")
    return fs.Model({phi: v, v: 1.2 - sp.sin(phi) - v / 4}, periodic={phi: 2 * sp.pi})


def test_rotation_of_a_periodic_state():
    orbit = fs.find_orbit(rotor(), [0, 4])
    assert orbit.outcome
    assert orbit.stable
    assert orbit.trajectory["phi"][-1] - orbit.trajectory["phi"][0] == pytest.approx(2 * np.pi)
    # the work of the constant torque is dissipated: mean(1.2 v − v²/4) = 0
    assert orbit["mean(1.2*v - v**2/4)"] == pytest.approx(0, abs=1e-12)


def test_what_was_found_is_returned_with_the_reason():
    damped = fs.Model({x: v, v: -x - v})
    settled = fs.find_orbit(damped, [1, 0])
    assert settled.outcome.code == "equilibrium"
    assert not settled.outcome
    assert settled.stability == "unknown"
    assert "equilibrium" in repr(settled)
    growing = fs.find_orbit(fs.Model({x: v, v: sp.cos(t) + x**3}), [1, 1])
    assert growing.outcome.code == "blow-up"
    doubled = fs.find_orbit(duffing(), [1, 0])
    assert doubled.outcome.code in ("other multiple", "periodic")
    chaos = fs.find_orbit(duffing(F=0.5), [0, 0])
    assert chaos.outcome.code in ("not settled", "periodic")


def duffing(F=0.35):
    """The double-well oscillator of Holmes (1979)."""
    return fs.Model({x: v, v: x - x**3 - 0.3 * v + F * sp.cos(1.2 * t)})


WRONG = {
    "equilibrium": (lambda: fs.find_orbit(van_der_pol(), [0, 0]), "the guess is an equilibrium"),
    "period": (
        lambda: fs.find_orbit(gear_pair(), [1, 0], period=5.0),
        "expected a whole multiple of the period of the forcing, 8.37758",
    ),
    "multiple and period": (
        lambda: fs.find_orbit(gear_pair(W=1), [1, 0], period=4 * np.pi, multiple=3),
        "is 2 periods of the forcing, but multiple = 3",
    ),
    "multiple": (lambda: fs.find_orbit(gear_pair(), [1, 0], multiple=0), "an integer from 1"),
    "states": (lambda: fs.find_orbit(gear_pair(), [1, 0, 0]), "expected 2 values"),
    "orbit of another model": (
        lambda: fs.find_orbit(smooth_gear(), fs.find_orbit(rotor(), [0, 4])),
        "guess: an Orbit of phi, v; the model has the states x, v",
    ),
    "values": (
        lambda: fs.find_orbit(smooth_gear().frozen(), [1, 0]),
        "w of this frozen model has no value",
    ),
    "model": (lambda: fs.find_orbit({}, [1, 0]), "model"),
    "not periodic": (
        lambda: fs.find_orbit(fs.Model({x: t - x}), [1]),
        "no common period; give it as period=",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_arguments(case):
    call, words = WRONG[case]
    with pytest.raises(fs.ArgumentError, match=words):
        call()


def test_files_and_words(tmp_path):
    orbit = fs.find_orbit(gear_pair(W=0.82), [1.1, 0.9])
    orbit.save(tmp_path / "orbit.npz")
    again = fs.load(tmp_path / "orbit.npz")
    assert again == orbit
    assert again["max(x) - min(x)"] == orbit["max(x) - min(x)"]
    assert again.itinerary == orbit.itinerary
    assert repr(again) == repr(orbit)
    assert len(repr(orbit).splitlines()) <= 10
    assert "<table>" in orbit._repr_html_()
    assert orbit.to_dict().keys() == {"t", "x", "v", "region"}
    assert orbit["x**2 + v"].shape == orbit.t.shape
    assert orbit.hits("x - 1") == orbit.hits() == 2
    assert np.abs(orbit(100 * orbit.period) - orbit(0.0)).max() < 1e-12


@pytest.mark.parametrize(
    ("rates", "start", "code", "words"),
    [
        (["cos(t) - x - Abs(x)/3", "cos(t) - y - Abs(y)/3"], [0.5, 0.5], "corner", "at once"),
        (["x**2 + 1 + cos(t)/2"], [5.0], "blow-up", "grew"),
        (["sign(x) + cos(t)/2"], [0.0], "not unique", "start slightly off"),
        (["y", "1 + cos(t)"], [0.0, 0.0], "not settled", "does not repeat"),
    ],
    ids=["corner", "blow-up", "not unique", "drift"],
)
def test_without_an_orbit_the_outcome_gives_the_reason(rates, start, code, words):
    model = fs.Model(dict(zip("xy", rates, strict=False)))
    orbit = fs.find_orbit(model, start)
    assert (orbit.outcome.success, orbit.outcome.code) == (False, code)
    assert words in orbit.outcome.message
    assert np.isnan(orbit.multipliers).all()


def test_a_cycle_far_longer_than_its_first_steps_is_found():
    # a relaxation oscillator of Terman and Wang (1995), from a state where its steps are short
    gate = 6 * (1 + sp.tanh(10 * x))
    model = fs.Model({x: 3 * x - x**3 + sp.Rational(5, 2) - v, v: (gate - v) / 50})
    orbit = fs.find_orbit(model, [-1, 0])
    run = fs.simulate(model, [-1, 0], t=(0, 500))
    assert orbit.period == pytest.approx(run.periodicity().period, rel=1e-9)


#: A gear with an orbit that grazes the interface of contact, to 16 digits.
GRAZING = 1.93942571678430574707


@pytest.mark.sample(6)
@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("scatter", [0, 1e-16, 1e-15, 1e-14, 1e-13, 1e-10])
@pytest.mark.parametrize("rtol", [1e-13, 1e-12, 1e-10, 1e-8])
def test_a_grazing_orbit_is_found_from_itself(rtol, scatter, seed):
    """Another unstable orbit is 9e-3 away."""
    gear = fs.systems.harmonic_gear(A=41.67, D=0.25, B=2.372, C=3.546, omega=GRAZING)
    settings, end = fs.Integration(rtol=rtol), 2 * np.pi / GRAZING
    rng = np.random.default_rng(seed)
    run = fs.simulate(gear, [-0.25, 0], t=(0.02808308382286608, end), integration=settings)
    first = run.end[1:3] * (1 + scatter * rng.standard_normal(2))
    orbit = fs.find_orbit(gear, first)
    assert orbit.outcome
    assert np.abs(orbit(0.0)[:2] - first).max() < 1e-8
    touches = any("touches an interface" in note for note in orbit.outcome.notes)
    # without its touch it crosses four times
    assert (orbit.hits(), touches) in ((4, False), (6, True))


def test_an_orbit_that_is_not_the_guess_says_how_far_it_is():
    model = gear_pair(W=0.75)
    low, high = (fs.find_orbit(model, first) for first in ([1.1, 0.0], [1.7, 0.3]))
    away = finding._distance(problem_of(model), low, high.trajectory, high.t0)
    assert away > 0.1
    known = high.trajectory, high.t0, high.period
    (note,) = finding._moved(low, problem_of(model), *known).outcome.notes
    assert "The guess repeats after 8.37758" in note
    assert f"{away:.2g} of them away from this orbit" in note
    assert not finding._moved(high, problem_of(model), *known).outcome.notes


def problem_of(model):
    return OrbitProblem.of(model, 1, None, None)
