"""Events against closed forms, and against an independent program on SciPy's integrator."""

import math

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from tests.simulation.random_events import SHAPES, compared, model_of

pytestmark = pytest.mark.slow

x, y, v, k, n, t = sp.symbols("x y v k n t")
FINE = fs.Integration(rtol=1e-13)


def run_of(rates, start, end, events, parameters=None, **given):
    model = fs.Model(rates, parameters=parameters or {}, events=events, **given)
    return fs.simulate(model, start, t=(0, end), integration=FINE)


def listed(run):
    return [(one.event, round(one.time, 9)) for one in run.events]


@pytest.mark.parametrize("shape", range(len(SHAPES)))
def test_random_runs_agree_with_restarts_of_another_integrator(shape):
    model = model_of(shape)
    assert [compared(shape, seed, model) for seed in range(4)] == [""] * 4


def test_an_integrate_and_fire_neuron():
    # V' = 1 - V from 0 reaches 1/2 after ln 2
    run = run_of({"V": "1 - V"}, [0], 7, {"spike": fs.Event("V > 1/2", {"V": 0})})
    times = np.array([one.time for one in run.events])
    np.testing.assert_allclose(times, math.log(2) * np.arange(1, 11), rtol=1e-13)
    assert run.events[0].before[0] == pytest.approx(0.5, abs=1e-14)
    assert run.events("spike") == run.events
    assert "10 events" in repr(run)


def test_the_condition_may_be_met_in_the_middle_of_the_motion_through_it():
    # x = sin t passes 1/2 upwards at π/6 and goes on
    run = run_of({x: v, v: -x}, [0, 1], 7, {x > sp.S.Half: {n: n + 1}}, {n: 0})
    np.testing.assert_allclose([one.time for one in run.events], [math.pi / 6, 13 * math.pi / 6])
    assert run.states == ("x", "v", "n")
    assert run["n"][-1] == run.final_state["n"] == 2
    assert run(3.0).round(9).tolist() == [0.141120008, -0.989992497, 1]
    assert [part["n"][-1] for part in run.select(between=(1, 2))] == [1]


def test_parameters_select_regions_that_do_not_exist_at_the_start():
    rate = sp.Piecewise((1, k > 1), (-1, True))
    run = run_of({x: rate}, [0], 5, {t > 3: {k: 2}}, {k: 0})
    assert run.final_state["x"] == pytest.approx(-1, abs=1e-12)
    assert run.itinerary == ("S2", "S1")


def test_values_are_those_at_the_trigger_or_at_the_execution():
    swap = fs.Event(x > 1, {x: y, y: x})
    assert run_of({x: 1, y: 2}, [0, 0], 1.5, {"swap": swap}).events[0].after.tolist() == [2, 1]
    late = {"delay": 2}
    kinds = {
        "early": fs.Event(x > 1, {k: x}, **late),
        "late": fs.Event(x > 1, {n: x}, values="execution", **late),
    }
    final = run_of({x: 1}, [0], 5, kinds, {k: 0, n: 0}).final_state
    assert (final["k"], final["n"]) == pytest.approx((1, 3))


def test_a_state_may_be_assigned_its_own_value_at_an_earlier_trigger():
    back = {
        name: fs.Event(x > 1, {x: x}, delay=2, values=name) for name in ("trigger", "execution")
    }
    early, late = (run_of({x: 1}, [0], 4, {"back": one}).final_state["x"] for one in back.values())
    assert (early, late) == pytest.approx((2, 4))


def test_the_highest_priority_is_executed_first_then_the_one_written_first():
    events = {
        "double": fs.Event(t > 1, {x: 2 * x}, values="execution"),
        "add": fs.Event(t > 1, {x: x + 3}, priority=y, values="execution"),
        "add more": fs.Event(t > 1, {x: x + 5}, priority=2 * y, values="execution"),
    }
    first = run_of({x: 0, y: 0}, [1, 1], 2, events)
    assert [name for name, _ in listed(first)] == ["add more", "add", "double"]
    assert first.final_state["x"] == 18
    second = run_of({x: 0, y: 0}, [1, -1], 2, events)
    assert [name for name, _ in listed(second)] == ["add", "add more", "double"]


def test_an_event_that_does_not_persist_is_dropped():
    rates = {x: sp.cos(t)}
    events = {
        "kept": fs.Event("x > 0.5", {k: k + 1}, delay=3),
        "dropped": fs.Event("x > 0.5", {n: n + 1}, delay=3, persistent=False),
        "short": fs.Event("x > 0.5", {y: y + 1}, delay=2, persistent=False),
    }
    final = run_of(rates, [0], 8, events, {k: 0, n: 0, y: 0}).final_state
    assert (final["k"], final["n"], final["y"]) == (1, 0, 1)


def test_a_condition_counts_as_true_or_false_before_the_start():
    for initially, expected in ((True, []), (False, [("begin", 0.0)])):
        event = fs.Event(x < 1, {k: 7}, initially=initially)
        run = run_of({x: 1}, [0], 2, {"begin": event}, {k: 0})
        assert listed(run) == expected
        assert run(1.5).tolist() == [1.5, 7 if expected else 0]
    always = run_of({x: 1}, [0], 2, {"always": fs.Event(sp.true, {x: 5}, initially=False)})
    assert always.final_state["x"] == 7


def test_conditions_of_time_alone_that_are_met_between_floating_point_numbers():
    wave = {"down": fs.Event("sin(10*t) < 0", {n: n + 1})}
    times = [time for _, time in listed(run_of({x: 0}, [0], 4, wave, {n: 0}))]
    np.testing.assert_allclose(times, math.pi / 10 * np.arange(1, 13, 2), atol=1e-9)
    # at k = t the motion of time decides
    once = run_of({x: 1}, [0], 4, {"later": fs.Event(t > k, {k: 2})}, {k: 1})
    assert [time for _, time in listed(once)] == [1, 2]


def test_equality_is_decided_as_written():
    # x >= 1 stays true after the assignment, x > 1 becomes true again at once
    closed = run_of({x: 1}, [0], 2, {"set": fs.Event(x >= 1, {x: 1})})
    assert listed(closed) == [("set", 1.0)]
    assert closed.final_state["x"] == pytest.approx(2)
    endless = run_of({x: 1}, [0], 2, {"set": fs.Event(x > 1, {x: 1})})
    assert endless.outcome.code == "endless events"
    assert endless.span[1] == pytest.approx(1)


def test_events_that_trigger_each_other_without_end_are_named():
    events = {
        "up": fs.Event((x > 1) & (y < sp.S.Half), {y: 1}),
        "down": fs.Event(y > sp.S.Half, {y: 0}),
        "other": fs.Event(x > 5, {y: 0}),
    }
    outcome = run_of({x: 1, y: 0}, [0, 0], 2, events).outcome
    assert str(outcome).startswith("at t = 1 events trigger each other without end: up, down;")


def test_pieces_clocks_and_switches_in_conditions():
    dose = run_of({x: -x}, [1], 4.5, {"dose": fs.Event(sp.Eq(sp.Mod(t, 1), 0), {x: x + 1})})
    assert [time for _, time in listed(dose)] == [1, 2, 3, 4]
    level = sum(math.exp(-(4.5 - s)) for s in range(5))
    assert dose.final_state["x"] == pytest.approx(level, rel=1e-12)
    both = run_of({x: 1}, [-2], 4, {"outside": fs.Event("Abs(x) > 1", {n: n + 1})}, {n: 0})
    assert listed(both) == [("outside", 3.0)]
    q = sp.Symbol("q")
    relay = {q: (x < -1, x > 1)}
    event = fs.Event(sp.Eq(q, 0), {n: n + 1})
    back = run_of({x: 2 * q - 1}, {x: 0, q: 1}, 6, {"turn": event}, {n: 0}, switches=relay)
    assert [time for _, time in listed(back)] == [1, 5]


def test_a_block_with_static_and_kinetic_friction():
    # on a belt of speed 1: at rest until the spring reaches 3/2, then against a friction of 1
    static = sp.Rational(3, 2)
    events = {
        "slip": fs.Event(sp.Abs(x) > static, {k: 1}),
        "stick": fs.Event((v >= 1) & (sp.Abs(x) < 1), {k: static}),
    }
    run = run_of({x: v, v: -x - k * sp.sign(v - 1)}, [0, 1], 20, events, {k: 1.5})
    slip, stick = 2 * (math.pi - math.atan(0.5)), 1
    times = [1.5, 1.5 + slip, 1.5 + slip + stick, 1.5 + 2 * slip + stick]
    assert [one.event for one in run.events[:4]] == ["slip", "stick"] * 2
    np.testing.assert_allclose([one.time for one in run.events[:4]], times, rtol=1e-13)


def test_a_ball_bounces_by_event_as_by_reset():
    def drop(**given):
        ball = fs.Model({x: v, v: -1}, **given)
        return fs.simulate(ball, [1, 0], t=(0, 20), integration=FINE)

    reset = drop(resets={x <= 0: {v: -v / 2}})
    event = drop(events={"bounce": fs.Event((x <= 0) & (v < 0), {v: -v / 2})})
    count = 15
    for one, other in zip(reset.resets[:count], event.events[:count], strict=True):
        assert one.time == pytest.approx(other.time, abs=1e-12)
        np.testing.assert_allclose(one.after, other.after, atol=1e-12)
    assert reset.outcome.code == "end of time"
    # infinitely many bounces until 3 √2
    assert event.outcome.code == "endless events"
    assert event.span[1] == pytest.approx(3 * math.sqrt(2), abs=1e-5)
    assert "bounce" in str(event.outcome)


def test_a_reset_and_an_event_at_one_time():
    model = {x: v, v: -1}
    given = {"resets": {x <= 0: {v: -v}}, "parameters": {n: 0}}
    event = {"up": fs.Event(v > 0, {n: n + 1})}
    run = fs.simulate(fs.Model(model, events=event, **given), [0.5, 0], t=(0, 6))
    assert [round(one.time, 9) for one in run.events] == [1, 3, 5]
    assert len(run.resets) == 3


def test_ensembles_and_stored_models_have_the_same_events(tmp_path):
    model = fs.Model(
        {x: k}, parameters={k: 1}, events={x > 1: {k: -2}, "back": fs.Event(x < -1, {k: 1})}
    )
    speeds = np.array([1.0, 2.0, 3.0])
    many = fs.simulate_many(model, [0.25], parameters={k: speeds}, t=(0, 7))
    runs = [fs.simulate(model.with_parameters(k=s), [0.25], t=(0, 7)) for s in speeds]
    np.testing.assert_allclose(many.final, [run.end[1:] for run in runs], rtol=1e-12)
    counts = [[len(run.events(name)) for name in model.events] for run in runs]
    assert many.events.tolist() == counts
    assert many.to_dict()["events back"].tolist() == [row[1] for row in counts]
    run = runs[0]
    run.save(tmp_path / "run.npz")
    again = fs.load(tmp_path / "run.npz")
    assert again == run
    assert again.events[0].event == "x > 1"
    assert fs.simulate(again.model.with_parameters(k=1), [0.25], t=(0, 7)) == run
    # a run goes on from the state of another one, parameters included
    half = fs.simulate(model, [0.25], t=(0, 3.5))
    rest = fs.simulate(model, half.final_state, t=(3.5, 7))
    np.testing.assert_allclose(rest.end, run.end, rtol=1e-12)


def test_values_that_are_not_finite_and_too_many_waiting_events():
    outcome = run_of({x: 1, y: 0}, [-1, 1], 2, {"ratio": fs.Event(x > 0, {y: 1 / (y - y**2)})})
    assert outcome.outcome.code == "reset not finite"
    assert "the event ratio" in str(outcome.outcome)
    waiting = run_of(
        {x: v, v: -x}, [0, 1], 500, {"late": fs.Event(x > 0, {n: 1}, delay=400)}, {n: 0}
    )
    assert waiting.outcome.code == "many pending events"
    assert "the event late" in str(waiting.outcome)


def test_equilibria_of_a_model_with_events():
    model = fs.Model({x: k - x}, parameters={k: 2}, events={x > 1: {x: 0, k: 3}})
    (found,) = fs.equilibria(model)
    assert found.state == pytest.approx([2])
    diagram = fs.continue_equilibria(model, "k", over=(0, 4))
    assert diagram.branches[0].at(k=1)[0]["x"] == pytest.approx(1)


def test_sweeps_attractors_and_basins_by_event_as_by_reset():
    rates = {x: v, v: -x - v / 5 + k * sp.cos(2 * t)}
    bounce = fs.Event((x > 1) & (v > 0), {v: -v / 2})
    both = [
        fs.Model(rates, parameters={k: 3.5}, resets={x >= 1: {v: -v / 2}}),
        fs.Model(rates, parameters={k: 3.5}, events={"bounce": bounce}),
    ]
    for strips in (1, 3):
        one, two = (
            fs.bifurcation_sweep(
                m, "k", np.linspace(2, 5, 7), [0, 0], settle=40, keep=2, strips=strips
            )
            for m in both
        )
        np.testing.assert_allclose(two.x, one.x, atol=1e-10)
    box = {x: (-2, 0.9), v: (-2, 2)}
    one, two = (fs.attractors(m, box, 8) for m in both)
    assert len(one) == len(two) == 1
    assert "1 events" in repr(two)
    small = fs.Refinement(cells=(2, 2), levels=0)
    assert fs.basins(both[1], box, known=two, refinement=small).labels == ("A1",)


@pytest.mark.parametrize(
    ("event", "why"),
    [
        (fs.Event(x > 1, {x: 0}, delay=1), "the waiting event late, which has a delay"),
        (fs.Event(x < 1, {x: 0}, initially=False), "condition of the event late, which is false"),
        (fs.Event(x > 1, {k: 0}), "value of k, a parameter that an event assigns"),
    ],
)
def test_sweeps_refuse_what_states_do_not_know(event, why):
    model = fs.Model({x: v, v: -x}, parameters={k: 1}, events={"late": event})
    for call in (
        lambda: fs.bifurcation_sweep(model, "k", [1, 2], [0, 0], settle=5, keep=1, period=1),
        lambda: fs.attractors(model, {x: (0, 1), v: (0, 1)}, 5),
        lambda: fs.basins(model, {x: (0, 1), v: (0, 1)}),
        lambda: fs.classify_regime(model, [0, 0], period=1),
        lambda: fs.regime_map(model, {"k": (1, 2), "q": (0, 1)}, [0, 0], period=1),
    ):
        with pytest.raises(fs.ModelError, match=why):
            call()


@pytest.mark.parametrize(
    "verb",
    [
        lambda m: fs.export(m, "auto"),
        lambda m: fs.simulate(m, [0, 0], t=(0, -1)),
        lambda m: fs.nondimensionalise(m, [("x", "x"), ("x", "x**2")]),
    ],
)
def test_functions_that_do_not_know_events_say_so(verb):
    model = fs.Model({x: v, v: -x}, parameters={k: 1}, events={x > 1: {k: 2}})
    with pytest.raises(fs.ModelError, match="would ignore the events of this model"):
        verb(model)
