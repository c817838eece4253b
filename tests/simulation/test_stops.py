"""Events that end a run: closed forms, edges at the start and at jumps, bad input."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs

x, v, t, w = sp.symbols("x v t w")
FINE = fs.Integration(rtol=1e-12)


@pytest.fixture(scope="module")
def oscillator():
    return fs.Model({x: v, v: -x})


@pytest.fixture(scope="module")
def ball():
    return fs.Model({x: v, v: -1}, resets={x <= 0: {v: -v / 2}})


@pytest.fixture(scope="module")
def kicked():
    return fs.Model({x: -x}, resets={sp.Eq(sp.Mod(t, 1), 0): {x: x + 1}})


@pytest.fixture(scope="module")
def friction():
    return fs.Model({x: v, v: sp.sin(t) / 2 - sp.sign(v)})


@pytest.mark.parametrize(
    ("stop", "expected"),
    [
        (x <= 0, np.pi / 2),
        ("x", np.pi / 2),
        # true at the start: it has to become false first
        ("x >= 0", 1.5 * np.pi),
        # zero at the start: the next zero
        ("v", np.pi),
        ("exp(x) - exp(-1/2)", 2 * np.pi / 3),
        ("Abs(x) < 1/2", np.pi / 3),
        ([v <= -0.999999, "x**2 - v**2"], np.pi / 4),
        ("t >= 7.25", 7.25),
        ("Mod(t, 3) > 5/2", 2.5),
        # two zeros within one step
        ("v + 0.9999999", np.pi / 2 - np.arccos(0.9999999)),
    ],
)
def test_events_of_an_oscillator(oscillator, stop, expected):
    run = fs.simulate(oscillator, [1, 0], t=(0, 1000), stop=stop, integration=FINE)
    assert run.outcome.code == "stopped"
    assert run.outcome
    # a shallow zero amplifies the error of the run
    assert run.span[1] == pytest.approx(expected, abs=1e-8 if "9999" in str(stop) else 1e-13)
    assert run.end[1:] == pytest.approx([np.cos(expected), -np.sin(expected)], abs=1e-11)
    assert run(run.span[1]) == pytest.approx(run.end[1:], abs=1e-14)


def test_outcome_names_the_event(oscillator):
    run = fs.simulate(oscillator, [1, 0], t=(0, 1000), stop=[x <= -2, x <= -0.5])
    assert str(run.outcome) == "stopped at t = 2.094395102, where x <= -0.5 became true."
    run = fs.simulate(oscillator, [1, 0], t=(0, 1000), stop=["x + 1/2"])
    assert str(run.outcome) == "stopped at t = 2.094395102, where x + 1/2 reached zero."


def test_the_run_is_the_one_without_events(oscillator):
    whole = fs.simulate(oscillator, [1, 0], t=(0, 1000))
    same = fs.simulate(oscillator, [1, 0], t=(0, 1000), stop="x + 2")
    assert same == whole
    cut = fs.simulate(oscillator, [1, 0], t=(0, 1000), stop="t - 700")
    count = len(cut.steps)
    assert count > 100
    assert (cut.steps[:-1] == whole.steps[: count - 1]).all()
    assert (cut.series == whole.series[:count]).all()
    assert cut(699.5) == pytest.approx(whole(699.5), abs=0)


def test_samples_without_dense_output(oscillator):
    run = fs.simulate(
        oscillator, [1, 0], t=(0, 9), stop="x + 1/2", dense=False, samples=[0, 1, 2, 5]
    )
    assert run.t.tolist() == [0, 1, 2]
    assert not run.is_dense
    assert run.end[1] == pytest.approx(-0.5, abs=1e-15)


def test_events_at_resets(ball, kicked):
    """The reset at the time of the event is included, and a continued run does not repeat it."""
    run = fs.simulate(ball, [0.5, 0.0], t=(0, 10), stop=x <= 0)
    assert run.span[1] == pytest.approx(1, abs=1e-14)
    assert len(run.resets) == 1
    assert run.end[1:] == pytest.approx([0, 0.5], abs=1e-12)
    after = fs.simulate(ball, run.end[1:], t=(run.end[0], 10), stop=x <= 0)
    assert after.span[1] == pytest.approx(2, abs=1e-12)
    # true by a jump
    for stop in ("v >= 0.2", "v - 0.2"):
        run = fs.simulate(ball, [0.5, 0.0], t=(0, 10), stop=stop)
        assert run.end == pytest.approx([1, 0, 0.5], abs=1e-12)
    run = fs.simulate(ball, [0.5, 0.0], t=(0, 10), stop="t - 5")
    assert run.itinerary[-1] == "S1 at rest on x = 0"
    run = fs.simulate(kicked, [0.5], t=(0, 10), stop="x >= 1")
    assert run.end == pytest.approx([1, 1 + 0.5 * np.exp(-1)], abs=1e-12)
    run = fs.simulate(kicked, [0.5], t=(0, 10), stop="t - 2")
    assert run.span == (0, 2)
    assert len(run.resets) == 2
    # at the end of the time span, by its last jump
    run = fs.simulate(kicked, [0.5], t=(0, 1), stop="x >= 1")
    assert run.outcome.code == "stopped"


def test_events_while_sliding(friction):
    run = fs.simulate(friction, [0.0, 1.0], t=(0, 30), stop="t*x > 3")
    assert run.outcome.code == "stopped"
    assert run.itinerary[-1] == "S1|S2"
    assert run.end[0] * run.end[1] == pytest.approx(3, abs=1e-14)


def test_slow_quantities_tables_and_stored_models():
    load = fs.Tabulated([0.0, 1.0, 3.0], [0.0, 2.0, 0.0])
    model = fs.Model({x: w - x}, forcing={w: load})
    run = fs.simulate(model, [0.0], t=(0, 3), stop="w < 1/2")
    assert run.span[1] == pytest.approx(2.5, abs=1e-14)
    stored = fs.simulate(model.stored, [0.0], t=(0, 3), stop="w < 1/2")
    assert stored == run


def test_an_expression_is_finite_until_the_event(oscillator):
    run = fs.simulate(oscillator, [1, 0], t=(0, 9), stop=["log(x)", x <= 0.5])
    assert run.span[1] == pytest.approx(np.pi / 3, abs=1e-9)
    with pytest.raises(fs.ArgumentError, match=r"stop 'log\(x\)': log\(x\) is not finite at t ="):
        fs.simulate(oscillator, [1, 0], t=(0, 9), stop=["log(x)", x <= -0.5])


@pytest.mark.parametrize(
    ("stop", "message"),
    [
        ("x == 2", "expected one inequality such as x >= 2, or x - 2"),
        ("0 < x < 2", "expected one inequality; give each as an item of stop="),
        (sp.And(x > 1, v > 2), "expected one inequality"),
        ("2 > 1", "nothing in it changes with time"),
        (5, "stop = 5; expected a sequence"),
        ([5], r"stop\[0\] = 5; expected a name or an expression"),
        ("y > 2", "unknown column or parameter 'y'"),
    ],
)
def test_bad_input(oscillator, stop, message):
    with pytest.raises(fs.FastSlowError, match=message):
        fs.simulate(oscillator, [1, 0], t=(0, 1), stop=stop)


def test_switches_are_columns():
    q = sp.Symbol("q")
    heater = fs.Model({x: -x + 2 * (1 - q)}, switches={q: (x > 1.5, x < 0.5)})
    run = fs.simulate(heater, {"x": 1, "q": 0}, t=(0, 50), stop="q >= 1")
    assert run.end == pytest.approx([np.log(2), 1.5], abs=1e-12)
    assert run.final_state["q"] == 1
    again = fs.simulate(heater, run.final_state, t=(run.end[0], 50), stop=["q >= 1"])
    assert again.end[0] == pytest.approx(np.log(2) + 2 * np.log(3), abs=1e-9)


#: Jumps at the start of a run, twice at one instant, of a parameter, and to equality.
JUMPS = [
    # before the first step
    ({"e": fs.Event("x < 1", {"y": 5}, initially=False)}, "y >= 3", 0, 5),
    ({"e": fs.Event("x < 1", {"y": 5}, initially=False)}, "y - 4", 0, 5),
    # true between the first event and the second only
    ({"a": fs.Event("x > 1", {"y": 5}), "b": fs.Event("y > 4", {"y": 0})}, "y >= 3", 1, 0),
    ({"a": fs.Event("x > 1", {"y": 5}), "b": fs.Event("y > 4", {"y": 0})}, "3 - y", 1, 0),
    ({"a": fs.Event("x > 1", {"y": 5}, delay=1)}, "x*y > 7", 2, 5),
    ({"a": fs.Event("x > 1", {"k": 5})}, "k >= 3", 1, 0),
    ({"a": fs.Event("x > 1", {"k": 5})}, "k - y - 3", 1, 0),
    # equality is not more
    ({"a": fs.Event("x > 1", {"y": 3})}, "y > 3", None, 3),
    ({"a": fs.Event("x > 1", {"y": 3})}, "y >= 3", 1, 3),
    ({"a": fs.Event("x > 1", {"y": "3 - x"})}, "x + y > 3", 1, 2),
    ({"a": fs.Event("x > 1", {"y": "x/2"})}, "2*y - x > 0", None, 0.5),
    ({"a": fs.Event("x > 1", {"y": 5}), "b": fs.Event("y > 4", {"y": 0})}, "y > 5", None, 0),
]


@pytest.mark.parametrize(("events", "stop", "time", "value"), JUMPS)
@pytest.mark.parametrize("dense", [True, False])
def test_a_jump_makes_a_relation_true_or_passes_a_zero(events, stop, time, value, dense):
    model = fs.Model({x: 1, "y": 0}, parameters={"k": 1}, events=events)
    run = fs.simulate(model, [0, 0], t=(0, 4), stop=stop, dense=dense)
    assert run.outcome.code == ("end of time" if time is None else "stopped")
    assert run.span[1] == pytest.approx(4 if time is None else time, abs=1e-14)
    assert run.final_state["y"] == value
