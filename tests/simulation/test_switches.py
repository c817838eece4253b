"""Simulation of models with hysteretic switches."""

from itertools import pairwise

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import fastslow as fs

x, y, v, q, p, t, w, k = sp.symbols("x y v q p t w k")
FINE = fs.Integration(rtol=1e-15)


@pytest.fixture(scope="module")
def thermostat():
    return fs.Model({x: -x + 2 * q}, switches={q: (x < 0.5, x > 1.5)})


def times_of(run, *switch, **value):
    return np.array([s.time for s in run.switches(*switch, **value)])


def test_a_thermostat_switches_at_the_times_in_closed_form(thermostat):
    run = fs.simulate(thermostat, {x: 1, q: 0}, t=(0, 20), integration=FINE)
    # 1.5 exp(-t) = 0.5 and 2 - 1.5 exp(-t) = 1.5
    exact = np.log(2) + np.log(3) * np.arange(len(run.switches))
    assert len(run.switches) == 18
    assert np.abs(times_of(run, "q") - exact).max() < 1e-13
    assert [s.value for s in run.switches] == [1, 0] * 9
    states = np.array([s.state[0] for s in run.switches])
    np.testing.assert_allclose(states, [0.5, 1.5] * 9, rtol=1e-15)
    # the column is exact at the events, and right-continuous
    columns = run.dense_columns(times_of(run, "q"))
    np.testing.assert_array_equal(columns[1], [1, 0] * 9)
    assert set(np.unique(run["q"])) == {0.0, 1.0}
    assert "18 changes of switches" in repr(run)
    assert run.final_state == {"x": run.end[1], "q": 0.0}
    assert list(run.switches.to_dict()) == ["t", "switch", "value", "x"]
    with pytest.raises(fs.UnknownNameError, match="unknown switch 'z'"):
        run.switches("z")


def test_the_relation_that_is_true_decides_at_the_start(thermostat):
    span = {"t": (0, 0.1)}
    assert fs.simulate(thermostat, [0.2], **span)["q"][0] == 1.0
    assert fs.simulate(thermostat, {x: 0.2, q: 0}, **span)["q"][0] == 1.0
    assert fs.simulate(thermostat, [1.7], **span)["q"][0] == 0.0
    assert fs.simulate(thermostat, {x: 1, q: 1}, **span)["q"][0] == 1.0
    assert len(fs.simulate(thermostat, [1.7], **span).switches) == 0
    # on a threshold the given value is kept, unless the motion makes the relation true
    run = fs.simulate(thermostat, {x: 0.5, q: 1}, **span)
    assert run["q"][0] == 1.0
    assert len(run.switches) == 0
    run = fs.simulate(thermostat, {x: 0.5, q: 0}, **span)
    assert [(s.time, s.value) for s in run.switches] == [(0.0, 1)]
    with pytest.raises(fs.ArgumentError, match=r'q has no value at the start.*"q": 0 or 1'):
        fs.simulate(thermostat, [1.0], **span)
    with pytest.raises(fs.ArgumentError, match=r"initial q = 0\.5; expected 0 or 1"):
        fs.simulate(thermostat, {x: 1, q: 0.5}, **span)
    with pytest.raises(fs.ArgumentError, match="switch q has no value at the start of a traject"):
        fs.simulate_many(thermostat, {x: [0.2, 1.0]}, **span)
    with pytest.raises(fs.ArgumentError, match=r"initial q = 2\.0; expected 0 or 1"):
        fs.simulate_many(thermostat, {x: [0.2, 1.0], q: [1, 2]}, **span)


def test_a_run_continues_from_its_final_state(thermostat):
    whole = fs.simulate(thermostat, [0.2], t=(0, 12), integration=FINE)
    first = fs.simulate(thermostat, [0.2], t=(0, 5), integration=FINE)
    rest = fs.simulate(thermostat, first.final_state, t=(5, 12), integration=FINE)
    assert abs(rest.end[1] - whole.end[1]) < 1e-14
    cut = whole.select(between=(0, 5))[0]
    assert cut.final_state["q"] == first.final_state["q"] == 1.0
    np.testing.assert_array_equal(times_of(cut, "q"), times_of(first, "q"))
    stopped = fs.simulate(thermostat, [0.2], t=(0, 12), stop="x - 1 + q/4")
    assert stopped.final_state["q"] == 1.0
    assert stopped.end[1] == pytest.approx(0.75, abs=1e-14)


def tanks(**order):
    """Two tanks; the pump fills the first one, and a valve connects it to the second one."""
    h, g, pump, valve = sp.symbols("h g pump valve")
    switches = {pump: (h < 1, h > 2), valve: (g < sp.Rational(1, 2), g > 1 + pump / 4)}
    rates = {h: pump - valve * h / 3, g: valve * h / 3 - g / 4}
    return fs.Model(rates, switches=dict(sorted(switches.items(), key=str, **order)))


def test_an_automaton_of_two_switches_agrees_with_restarts_of_an_integrator():
    run = fs.simulate(tanks(), [0.3, 0.2], t=(0, 40))
    state, values, time, found = np.array([0.3, 0.2]), [1, 1], 0.0, []

    def heights(z):
        pump, valve = values
        return [z[0] - 2 if pump else 1 - z[0], z[1] - 1 - pump / 4 if valve else 0.5 - z[1]]

    def flow(_, z):
        pump, valve = values
        return [pump - valve * z[0] / 3, valve * z[0] / 3 - z[1] / 4]

    events = [lambda _, z: heights(z)[0], lambda _, z: heights(z)[1]]
    for event in events:
        event.terminal, event.direction = True, 1
    while time < 40:
        part = solve_ivp(flow, (time, 40), state, "DOP853", events=events, rtol=1e-12, atol=1e-13)
        time, state = part.t[-1], part.y[:, -1]
        changed = [k for k in range(2) if len(part.t_events[k])]
        while changed:
            for k in changed:
                values[k] = 1 - values[k]
                found.append((time, k, values[k]))
            changed = [k for k in range(2) if heights(state)[k] > 1e-9]
    assert len(found) == len(run.switches) > 10
    np.testing.assert_allclose(times_of(run, "pump"), [s for s, k, _ in found if k == 0], rtol=1e-9)
    names = {"pump": 0, "valve": 1}
    assert [(names[s.switch], s.value) for s in run.switches] == [(k, v) for _, k, v in found]
    np.testing.assert_allclose(run.end[1:], state, rtol=1e-9)


def test_the_order_of_the_switches_changes_nothing():
    one, other = (fs.simulate(tanks(reverse=r), [0.3, 0.2], t=(0, 40)) for r in (False, True))
    assert list(one.switch_names) == list(other.switch_names)[::-1]
    np.testing.assert_array_equal(one.steps, other.steps)
    np.testing.assert_array_equal(one.end, other.end)
    assert [(s.time, s.switch, s.value) for s in one.switches] == [
        (s.time, s.switch, s.value) for s in other.switches
    ]


def random_relay(seed, n):
    """Matrix, input and output of a linear system with a relay."""
    generator = np.random.default_rng(seed)
    A = generator.normal(size=(n, n))
    A -= (np.linalg.eigvals(A).real.max() + 0.3) * np.eye(n)
    return A, generator.normal(size=n), generator.normal(size=n)


def test_relay_systems_follow_matrix_exponentials():
    # more of them in the campaign
    A, b, c = random_relay(1, 3)
    z = sp.symbols("z:3")
    output = sum(float(a) * s for a, s in zip(c, z, strict=True))
    rates = {
        s: sum(float(a) * r for a, r in zip(row, z, strict=True)) + float(u) * (2 * q - 1)
        for s, row, u in zip(z, A, b, strict=True)
    }
    width = 0.05
    # negative feedback switches for ever
    sign = -1 if c @ np.linalg.solve(A, b) > 0 else 1
    relay = fs.Model(rates, switches={q: (sign * output < -width, sign * output > width)})
    run = fs.simulate(relay, {**dict(zip(z, b, strict=True)), q: 1}, t=(0, 30))
    assert len(run.switches) > 10
    events = [(0.0, np.array(b), int(run["q"][0]))]
    events += [(s.time, s.state, s.value) for s in run.switches]
    for (begin, first, value), (end, last, _) in pairwise(events):
        rest = -np.linalg.solve(A, b) * (2 * value - 1)
        flow = [expm(A * s) @ (first - rest) + rest for s in np.linspace(0, end - begin, 9)]
        np.testing.assert_allclose(flow[-1], last, atol=1e-11 * np.abs(b).max())
        level = sign * c @ last
        assert level == pytest.approx(width if value else -width, abs=1e-13)
        # none is missed
        heights = np.array([sign * c @ s for s in flow[1:-1]])
        assert (heights < width if value else heights > -width).all()


def test_a_change_of_one_switch_may_change_another_one():
    switches = {q: (x < -1, x > 1), p: (x + 5 * q > 3, x + 5 * q < 0)}
    model = fs.Model({x: 2 * q - 1}, switches=switches)
    run = fs.simulate(model, {x: 0.5, q: 0, p: 0}, t=(0, 5))
    found = [(round(s.time, 12), s.switch, s.value) for s in run.switches]
    assert found == [(1.5, "q", 1), (1.5, "p", 1), (3.5, "q", 0), (4.5, "p", 0)]


def test_each_of_several_switches_begins_in_the_state_given_for_it():
    three = sp.symbols("s1:4")
    rate = sum(2**k * s for k, s in enumerate(three))
    model = fs.Model({x: rate}, switches={s: (x > 10 + k, x < -10) for k, s in enumerate(three)})
    for number in range(8):
        given = {s: number >> k & 1 for k, s in enumerate(three)}
        run = fs.simulate(model, {x: 0, **given}, t=(0, 1))
        assert run.end[1] == number
        assert not run.switches


def test_relations_that_become_true_together_change_their_switches_together():
    # each change makes the relation of the other switch false
    switches = {q: (x - 2 * p > 1, x < -1), p: (x - 2 * q > 1, x < -1)}
    model = fs.Model({x: 1 - 2 * q * p}, switches=switches)
    run = fs.simulate(model, {x: 0, q: 0, p: 0}, t=(0, 2))
    assert [(s.time, s.switch, s.value) for s in run.switches] == [(1, "q", 1), (1, "p", 1)]


def test_a_cascade_without_end_is_an_outcome():
    switches = {q: (x + 10 * p > 5, x + 10 * p < 4), p: (x - 10 * q > -5, x - 10 * q < -6)}
    model = fs.Model({x: 1}, switches=switches)
    run = fs.simulate(model, {x: -7, q: 0, p: 0}, t=(0, 5))
    assert run.outcome.code == "accumulation"
    assert run.end[0] == pytest.approx(2, abs=1e-12)
    assert len(run.switches) == 41


def test_a_reset_may_make_a_relation_true():
    model = fs.Model(
        {x: 1 + q},
        resets={x >= 1: {x: -2 + q}},
        switches={q: (x < -1.5, x > 0)},
    )
    run = fs.simulate(model, {x: 0.5}, t=(0, 4))
    # x = 1 at 0.5, reset to -2: q = 1, x = 0 at 1.5: q = 0, x = 1 at 2.5
    assert [s.time for s in run.resets] == pytest.approx([0.5, 2.5], abs=1e-14)
    assert times_of(run, "q") == pytest.approx([0.5, 1.5, 2.5, 3.5], abs=1e-14)
    assert [s.value for s in run.switches] == [1, 0, 1, 0]
    # the switch is changed after the reset
    assert run.switches[0].state[0] == -2.0
    assert run.resets[0].after[0] == -2.0


def test_a_change_of_a_switch_may_make_the_relation_of_a_reset_true():
    model = fs.Model({x: 1}, resets={x >= 2 - 2 * q: {x: x - 3}}, switches={q: (x > 1, x < -1)})
    run = fs.simulate(model, {x: 0.5, q: 0}, t=(0, 4))
    # at x = 1 the wall jumps to 0, and the reset to -2 changes the switch back
    assert [(s.time, s.value) for s in run.switches] == [(0.5, 1), (0.5, 0), (3.5, 1), (3.5, 0)]
    assert [(s.time, *s.before, *s.after) for s in run.resets] == [(0.5, 1, -2), (3.5, 1, -2)]


def test_a_switch_set_by_a_clock_is_a_latch():
    model = fs.Model({x: 2 * q - 1}, switches={q: (sp.Eq(sp.Mod(t, 1), 0), x > 1)})
    run = fs.simulate(model, {x: 0.5, q: 0}, t=(0, 4))
    assert times_of(run, "q", value=1).tolist() == [1, 3, 4]
    # x(1) = -0.5, so that 1 is reached at 2.5; at t = 2 the switch is 1 already
    assert times_of(run, "q", value=0) == pytest.approx([2.5, 3.5], abs=1e-14)
    always = fs.simulate(
        fs.Model({x: q}, switches={q: (sp.Eq(sp.Mod(t, 1), 0), x > 9)}), {x: 0, q: 1}, t=(0, 4)
    )
    assert len(always.switches) == 0


def test_a_threshold_may_jump_at_an_instant():
    saw = sp.Mod(t, 1)
    model = fs.Model({x: q - (1 - q)}, switches={q: (x < -saw, x > 1 - saw)})
    run = fs.simulate(model, {x: 0.25, q: 1}, t=(0, 2.5))
    # x = 0.25 + t meets 1 - t, then 1 - t + 0.25 meets -saw; at t = 1 the threshold jumps
    assert run.switches[0].time == pytest.approx(0.375, abs=1e-14)
    assert run.switches[0].value == 0
    heights = [-s.time % 1 for s in run.switches("q", value=1)]
    assert len(heights) > 0
    for s in run.switches("q", value=1):
        at_instant = s.time == round(s.time)
        assert at_instant or s.state[0] == pytest.approx(-(s.time % 1), abs=1e-14)


def test_a_switch_may_change_the_region():
    model = fs.Model(
        {x: sp.Piecewise((2 - x, q > 0.5), (-x, True)), y: -sp.sign(y - q)},
        switches={q: (x < 0.5, x > 1.5)},
    )
    run = fs.simulate(model, [0.2, 3.0], t=(0, 8), integration=FINE)
    assert np.diff(times_of(run, "q")) == pytest.approx(np.log(3), abs=1e-13)
    # y slides on q: after a change it moves to the other value, and slides again
    assert run.at(t=float(run.switches[3].time) - 1e-3)[0]["y"] == 0.0
    assert any("|" in region for region in run.itinerary)


@pytest.mark.sample(1)
@pytest.mark.parametrize("factor", [1, 3, 0.1])
def test_a_threshold_may_be_an_interface(factor):
    # with q = 0 the state would slide on x = 1: the motion up to there decides
    rates = {x: sp.Piecewise((1, x < 1), (2 * q - 1, True))}
    model = fs.Model(rates, switches={q: (factor * x > factor, x < -1)})
    run = fs.simulate(model, {x: 0, q: 0}, t=(0, 3))
    assert [(s.time, s.value) for s in run.switches] == [(pytest.approx(1, abs=1e-14), 1)]
    assert run.end[1] == pytest.approx(3, abs=1e-14)
    assert run.itinerary == ("S2 (q = 0)", "S1 (q = 1)")


def test_a_touched_threshold_changes_nothing():
    rates = {x: v, v: -x}
    model = fs.Model({**rates, y: q}, switches={q: (x > 1, x < -2)})
    run = fs.simulate(model, {x: 1, v: 0, y: 0, q: 0}, t=(0, 20))
    assert len(run.switches) == 0
    # a relation that changes nothing is no event: no step ends there
    wide = fs.simulate(model, {x: 1.5, v: 0, y: 0}, t=(0, 20))
    plain = fs.simulate(fs.Model({**rates, y: 1}), [1.5, 0, 0], t=(0, 20))
    assert len(wide.switches) == 0
    assert len(wide.steps) == len(plain.steps)


def test_a_narrow_hysteresis_approaches_sliding():
    model = fs.Model({x: 1 - 4 * q, y: q}, parameters={k: 1e-3}, switches={q: (x > k, x < -k)})
    for width in (1e-3, 1e-6):
        run = fs.simulate(model.with_parameters(k=width), [-1, 0], t=(0, 1 + 5000 * width))
        # q = 1 for a quarter of the time
        assert run.end[2] == pytest.approx(1250 * width, abs=2 * width)
        assert np.diff(times_of(run, "q", value=1)) == pytest.approx(8 * width / 3, rel=1e-6)
    narrow = model.with_parameters(k=1e-17)
    run = fs.simulate(narrow, [-1, 0], t=(0, 2), integration=fs.Integration(max_crossings=10**4))
    assert run.outcome.code == "accumulation"
    assert "changes of switches accumulate" in str(run.outcome)


def test_a_switch_at_rest_on_a_wall_changes_the_contact_force():
    model = fs.Model(
        {x: v, v: q * k - 1, y: 1 - 2 * q},
        parameters={k: 3},
        resets={x <= 0: {v: -v / 2}},
        switches={q: (y > 2, y < -5)},
    )
    run = fs.simulate(model, {x: 0, v: 0, y: 0, q: 0}, t=(0, 3))
    assert run.itinerary == ("S1 (q = 0) at rest on x = 0", "S1 (q = 1)")
    assert run.end[1:3] == pytest.approx([1, 2], abs=1e-14)
    # a smaller force keeps the contact
    run = fs.simulate(model.with_parameters(k=0.5), {x: 0, v: 0, y: 0, q: 0}, t=(0, 3))
    assert run.itinerary == ("S1 (q = 0) at rest on x = 0", "S1 (q = 1) at rest on x = 0")


def test_a_jump_of_the_load_ends_the_rest_on_a_wall():
    load = fs.Tabulated([0, 1, 4], [-1, 2, 2], interpolation="previous")
    model = fs.Model({x: v, v: w}, forcing={w: load}, resets={x <= 0: {v: -v / 2}})
    run = fs.simulate(model, [0, 0], t=(0, 3))
    assert run.itinerary == ("S1 at rest on x = 0", "S1")
    assert run.end[1:] == pytest.approx([4, 4], abs=1e-14)


def test_ensembles_are_those_of_single_runs(thermostat):
    starts = np.linspace(-1, 3, 41)
    many = fs.simulate_many(thermostat, {x: starts, q: 1}, t=(0, 12), samples=20)
    again = fs.simulate_many(
        thermostat,
        {x: starts, q: 1},
        t=(0, 12),
        samples=20,
        execution=fs.Execution(threads=2),
    )
    assert many == again
    for i in range(0, 41, 8):
        one = fs.simulate(thermostat, {x: starts[i], q: 1}, t=(0, 12), samples=20)
        np.testing.assert_array_equal(one.end[1:], many.final[i])
        np.testing.assert_array_equal(one["q"], many["q"][i])
        assert one.final_state["q"] == many.end_switches[i, 0]
        counts = [len(one.switches("q", value=value)) for value in (1, 0)]
        np.testing.assert_array_equal(counts, many.switches[i, 0])
    assert many.to_dict()["final q"].tolist() == many.end_switches[:, 0].tolist()
    assert many["changes of q to 1"].tolist() == many.switches[:, 0, 0].tolist()
    both = fs.simulate_many(tanks(), {"h": np.linspace(0, 3, 9), "g": 0.2, "pump": 0}, t=(0, 20))
    one = fs.simulate(tanks(), {"h": 1.5, "g": 0.2, "pump": 0}, t=(0, 20))
    np.testing.assert_array_equal(one.end[1:], both.final[4])
    assert both.switches[4].sum() == len(one.switches)


def test_a_sweep_carries_the_switches_from_value_to_value():
    model = fs.Model(
        {x: k + q - x}, parameters={k: 0}, forcing={w: sp.sin(t)}, switches={q: (x > 1, x < 0)}
    )
    swept = fs.bifurcation_sweep(
        model, "k", np.linspace(0.2, 1.4, 7), {x: 0.2, q: 0}, settle=5, keep=1
    )
    # x = k until k > 1; then x = k + 1 until k < -1, which is not reached
    assert swept.passes[0].x == pytest.approx([0.2, 0.4, 0.6, 0.8, 1.0, 2.2, 2.4], abs=1e-6)
    assert swept.passes[1].x == pytest.approx(np.linspace(2.4, 1.2, 7), abs=1e-6)


def test_runs_and_models_with_switches_are_stored(thermostat, tmp_path):
    run = fs.simulate(tanks(), [0.3, 0.2], t=(0, 20), samples=30)
    for name in ("run.npz", "run.nc"):
        run.save(tmp_path / name)
        again = fs.load(tmp_path / name)
        assert again == run
        assert again.switches == run.switches
        np.testing.assert_array_equal(again["pump"], run["pump"])
        assert again.final_state == run.final_state
    # the stored model has no SymPy equations
    stored = again.model
    assert stored.switches == ("pump", "valve")
    assert fs.simulate(stored, [0.3, 0.2], t=(0, 20), samples=30) == run
    assert fs.simulate(stored, run.final_state, t=(20, 25)) == fs.simulate(
        tanks(), run.final_state, t=(20, 25)
    )
    frame = run.to_frame()
    assert set(frame["pump"]) == {0.0, 1.0}
    assert "pump" in run.to_xarray()
    many = fs.simulate_many(thermostat, {x: [0.2, 2.0]}, t=(0, 5))
    many.save(tmp_path / "many.npz")
    assert fs.load(tmp_path / "many.npz") == many


def test_regions_are_named_with_the_states_of_the_switches(thermostat):
    run = fs.simulate(thermostat, [0.2], t=(0, 4), integration=FINE)
    assert run.itinerary == ("S1 (q = 1)", "S1 (q = 0)", "S1 (q = 1)", "S1 (q = 0)")
    assert [s.start for s in run.segments] == [0.0, *times_of(run, "q")]
    on = np.log(1.8 / 0.5) + np.log(3)
    assert run.time_fractions == pytest.approx({"S1 (q = 1)": on / 4, "S1 (q = 0)": 1 - on / 4})
    assert [part.span for part in run.select(region="S1")] == [(0.0, 4.0)]


def test_conditions_are_decided_at_jumps(thermostat):
    run = fs.simulate(thermostat, [0.2], t=(0, 4))
    first, second, third = times_of(run, "q")
    assert [part.span for part in run.select("q > 1/2")] == [(0.0, first), (second, third)]
    fired = fs.simulate(fs.Model({x: 1}, resets={x >= 1: {x: -1}}), [0], t=(0, 4))
    assert [part.span for part in fired.select("x > 0")] == [(0.0, 1.0), (2.0, 3.0)]


def test_functions_without_a_series_are_refused_beside_switches():
    model = fs.Model({x: sp.gamma(2 + x) * (q - 1)}, switches={q: (x < 0, x > 1)})
    with pytest.raises(fs.ModelError, match="models with resets, switches or events need"):
        fs.simulate(model, [0.5], t=(0, 1))
