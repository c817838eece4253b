"""Derivatives across events: orbits, multipliers, branches, exponents and sensitivities."""

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

import fastslow as fs

pytestmark = pytest.mark.slow

x, v, k, t, a, r, V, u, current = sp.symbols("x v k t a r V u I")

FORCED = {x: v, v: -x - v / 5 + a * sp.cos(2 * t)}
VALUES = {a: 4.5, r: 0.5}
RESET = fs.Model(FORCED, parameters=VALUES, resets={x >= 1: {v: -r * v}})
BOUNCE = fs.Event((x > 1) & (v > 0), {v: -r * v})
EVENT = fs.Model(FORCED, parameters=VALUES, events={"bounce": BOUNCE})
SPIKE = {"spike": fs.Event(V > 1, {V: 0, u: u + sp.Rational(3, 10)})}
NEURON = fs.Model({V: current - V - u, u: -u / 2}, parameters={current: 2}, events=SPIKE)
RELAY = fs.Model(
    {x: k - x}, parameters={k: 2}, events={"off": fs.Event(x > 1, {k: -2}), x < -1: {k: 2}}
)


def test_an_orbit_that_bounces_by_event_is_that_by_reset():
    one, two = (fs.find_orbit(model, [0, 0]) for model in (RESET, EVENT))
    np.testing.assert_allclose(two.multipliers, one.multipliers, rtol=0, atol=1e-12)
    np.testing.assert_allclose(two(0.3), one(0.3), rtol=0, atol=1e-12)
    assert two.trajectory.events[0].time == pytest.approx(one.trajectory.resets[0].time, abs=1e-12)
    assert two.gradient("r") == pytest.approx(one.gradient("r"), abs=1e-10)
    assert "1 events" in repr(two)


def test_a_run_that_bounces_by_event_has_the_derivatives_of_that_by_reset():
    names = ["a", "r", "x"]
    one, two = (
        fs.simulate(
            model, [0.25, 0], t=(0, 12), integration=fs.Integration(rtol=1e-13)
        ).sensitivity(names)
        for model in (RESET, EVENT)
    )
    assert two.outcome
    np.testing.assert_allclose(two.final, one.final, rtol=1e-10)
    np.testing.assert_allclose(two.event_times, one.reset_times, atol=1e-10)
    assert len(two.event_times) > 2


def test_the_branch_ends_where_the_orbit_touches_the_condition():
    # at the amplitude 1 of the linear motion
    for start in (4.5, 2.0):
        orbit = fs.find_orbit(EVENT.with_parameters(a=start), [0, 0])
        branch = fs.continue_orbits(orbit, "a", over=(1.5, 5))
        (point,) = branch.special
        assert point.code == "GR"
        assert point["a"] == pytest.approx(abs(-3 + 0.4j), rel=1e-10)


def neuron_return(start, current=2.0):
    """The state u after the next spike, and its time, by SciPy."""

    def crossing(_, z):
        return z[0] - 1

    crossing.terminal = True
    found = solve_ivp(
        lambda _, z: [current - z[0] - z[1], -z[1] / 2],
        (0, 50),
        [0, start],
        events=crossing,
        rtol=1e-12,
        atol=1e-13,
        method="DOP853",
    )
    return found.y[1, -1] + 0.3, found.t[-1]


def test_a_spiking_orbit_agrees_with_restarts_of_another_integrator(tmp_path):
    orbit = fs.find_orbit(NEURON, [0, 0])
    start = orbit.trajectory.events[0].after[1]
    assert neuron_return(start) == pytest.approx((start, orbit.period), abs=1e-10)
    step = 1e-4
    slope = (neuron_return(start + step)[0] - neuron_return(start - step)[0]) / (2 * step)
    np.testing.assert_allclose(orbit.multipliers, [1, slope], atol=1e-8)
    branch = fs.continue_orbits(orbit, "I", over=(1.2, 3))
    assert [outcome.code for outcome in branch.outcomes] == ["end of range"] * 2
    (row,) = branch.at(I=1.5)
    start = row.trajectory.events[0].after[1]
    assert neuron_return(start, 1.5) == pytest.approx((start, row.period), abs=1e-10)
    # files keep the events of every row
    branch.save(tmp_path / "branch.npz")
    again = fs.load(tmp_path / "branch.npz")
    assert again == branch
    assert again[3].trajectory.events == branch[3].trajectory.events
    assert len(again.at(I=1.5)[0].trajectory.events) == 1


def test_integrate_and_fire_has_the_period_of_its_closed_form():
    model = fs.Model({V: current - V}, parameters={current: 1.5}, events={V > 1: {V: 0}})
    orbit = fs.find_orbit(model, [0.2])
    assert orbit.period == pytest.approx(np.log(3), rel=1e-14)
    assert orbit.gradient("I")["period"] == pytest.approx(1 / 1.5 - 1 / 0.5, rel=1e-12)
    found = fs.simulate(model, [0], t=(0, 2)).sensitivity(["I"])
    assert found.event_times.tolist() == [[pytest.approx(-4 / 3, rel=1e-9)]]
    end = fs.continue_orbits(orbit, "I", over=(0.5, 2)).outcomes[0]
    assert end.code == "boundary equilibrium on the cycle"
    assert "I = 1, where the cycle meets an equilibrium on V - 1 = 0" in end.message


def test_parameters_that_events_assign_are_states_of_the_orbit():
    orbit = fs.find_orbit(RELAY, [0])
    assert orbit.states == ("x", "k")
    assert orbit.period == pytest.approx(2 * np.log(3), rel=1e-13)
    np.testing.assert_allclose(orbit.multipliers, [1, 0], atol=1e-12)
    found = fs.lyapunov(RELAY, [0], t=(0, 60))
    assert found.values[0] == pytest.approx(0, abs=0.1)
    assert np.isneginf(found.values[1])
    assert fs.find_orbit(RELAY, orbit).period == orbit.period
    with pytest.raises(fs.ModelError, match="k is assigned by an event and so a state"):
        fs.continue_orbits(orbit, "k", over=(1, 3))


def test_doses_at_instants_and_conditions_that_are_false_before_the_start():
    event = fs.Event(sp.Eq(sp.Mod(t, 1), 0), {x: x + 1})
    orbit = fs.find_orbit(fs.Model({x: -x}, events={"dose": event}), [1])
    np.testing.assert_allclose(orbit.multipliers, [np.exp(-1)], rtol=1e-13)
    begun = {"spike": fs.Event(V > 1, {V: 0}), "once": fs.Event(V < 2, {V: 0.5}, initially=False)}
    found = fs.find_orbit(fs.Model({V: 1.5 - V}, events=begun), [0])
    assert found.period == pytest.approx(np.log(3), rel=1e-13)


def test_exponents_are_the_logarithms_of_the_multipliers():
    orbit = fs.find_orbit(NEURON, [0, 0])
    found = fs.lyapunov(NEURON, [0, 0], t=(0, 300))
    assert found.values[1] == pytest.approx(orbit.log_multipliers[1] / orbit.period, rel=1e-2)
    assert found.values[0] == pytest.approx(0, abs=0.02)


def test_what_has_no_derivative_is_named():
    late = fs.Model(
        {V: 1.5 - V}, events={"spike": fs.Event(V > 1, {V: 0}, delay=sp.Rational(1, 10))}
    )
    for call in (
        lambda: fs.find_orbit(late, [0]),
        lambda: fs.lyapunov(late, [0], t=(0, 9)),
        lambda: fs.simulate(late, [0.2], t=(0, 1)).sensitivity(["V"]),
    ):
        with pytest.raises(fs.ModelError, match="the event spike, which is executed with a delay"):
            call()
    swap = {"one": fs.Event(x > 1, {x: 0}), "two": fs.Event(x > 1, {v: 0})}
    both = fs.Model({x: 1, v: 1}, events=swap)
    assert "several events, one and two, at once" in fs.find_orbit(both, [0, 0]).outcome.message
    assert "several events" in fs.lyapunov(both, [0, 0], t=(0, 9)).outcome.message
    found = fs.simulate(both, [0, 0], t=(0, 3)).sensitivity(["x"]).outcome
    assert "several events, one and two, at once" in found.message
    turns = fs.Model({x: v, v: -x}, parameters={k: 0}, events={x > 0: {k: k + 1}})
    outcome = fs.find_orbit(turns, [1, 0]).outcome
    assert "k, which events assign, has another value after every return" in outcome.message
    # x = sin t touches 1 from below, which matters unless the rest of the condition is false
    for also, noted in ((x > -2, True), (v < -2, False)):
        touched = fs.Model({x: v, v: -x}, events={"top": fs.Event((x > 1) & also, {x: 0})})
        found = fs.simulate(touched, [0, 1], t=(0, 3)).sensitivity(["x"]).outcome.message
        assert ("x - 1 = 0 (event) is met within the error of the run" in found) == noted
