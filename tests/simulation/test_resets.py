"""Resets: impacts against closed forms and matrix exponentials, rest on walls, bad input."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from tests.campaigns.impacts import campaign, impacting, random_cases

pytestmark = pytest.mark.slow

x, v, y, t, r, g, A, omega = sp.symbols("x v y t r g A omega")
FINE = fs.Integration(rtol=1e-13)


@pytest.fixture(scope="module")
def ball():
    """A ball that bounces on the ground."""
    return fs.Model({x: v, v: -g}, parameters={r: 0.8, g: 1}, resets={x <= 0: {v: -r * v}})


@pytest.fixture(scope="module")
def table():
    """A ball on a table that oscillates."""
    height = A * sp.sin(omega * t)
    speed = height.diff(t)
    return fs.Model(
        {x: v, v: -g},
        parameters={r: 0.5, g: 1, A: 0.35, omega: 2},
        resets={x <= height: {v: speed - r * (v - speed)}},
    )


def test_bouncing_ball_in_closed_form(ball):
    """Dropped from 1/2, it meets the ground at 1, then after 2 r**k, and rests from 9 on."""
    run = fs.simulate(ball, [0.5, 0.0], t=(0, 20), integration=FINE)
    impacts = run.resets
    count = len(impacts)
    assert count > 40
    times = 1 + np.cumsum(np.r_[0.0, 2 * 0.8 ** np.arange(1, count)])
    assert np.array([e.time for e in impacts]) == pytest.approx(times, abs=1e-12)
    speeds = np.array([-e.before[1] for e in impacts])
    assert speeds == pytest.approx(0.8 ** np.arange(count), abs=1e-12)
    tops = 0.5 * (times[:-1] + times[1:])
    assert run(tops)[0] == pytest.approx(0.5 * 0.64 ** np.arange(1, count), abs=1e-12)
    last = impacts[-1]
    end = last.time + 2 * 0.8 * -last.before[1] / 0.2
    assert end == pytest.approx(9, abs=1e-11)
    # the flights that are not computed are lower than the tolerance
    assert 0.5 * (0.8 * last.before[1]) ** 2 < 1e-13
    assert (last.after == 0).all()
    assert (run.end[1:] == 0).all()
    assert run.itinerary == ("S1", "S1 at rest on x = 0")
    assert run.outcome.success


def test_energy_is_kept_without_losses():
    one = impacting().with_parameters(k=1, c=0, f=0, w=1, s=0.3, r=1)
    run = fs.simulate(one, [-1.0, 0.5], t=(0, 300), integration=FINE)
    assert len(run.resets) > 60
    states = np.array([e.after for e in run.resets])
    assert (states**2).sum(axis=1) == pytest.approx(1.25, abs=1e-11)
    assert (states[:, 0] == 0.3).all()


def test_flights_of_random_oscillators_agree_with_matrix_exponentials():
    report = campaign(40, seed=5)
    assert report.failures == []
    assert report.flights >= 200
    assert report.rests > 0


def test_ensembles_have_the_same_impacts_over_threads():
    cases = random_cases(40, seed=6)
    values = {n: np.array([one.values[n] for one in cases]) for n in cases[0].values}
    starts = np.array([one.state for one in cases])
    one, two = (
        fs.simulate_many(
            impacting(),
            starts,
            parameters=values,
            t=(0, 20),
            integration=FINE,
            execution=fs.Execution(threads=n),
        )
        for n in (1, 2)
    )
    assert one.final.tobytes() == two.final.tobytes()
    assert (one.resets == two.resets).all()
    assert one.resets.sum() > 200
    for k in (0, 7, 21):
        model = impacting().with_parameters({n: v[k] for n, v in values.items()})
        run = fs.simulate(model, starts[k], t=(0, 20), integration=FINE)
        assert one.resets[k].sum() == len(run.resets)
        assert one.final[k] == pytest.approx(run.end[1:], abs=1e-9)


def test_a_ball_leaves_the_table_when_its_acceleration_is_gravity(table):
    run = fs.simulate(table, [1.0, 0.0], t=(0, 30), integration=FINE)
    rests = [s for s in run.segments if "at rest" in s.region]
    assert len(rests) >= 8
    for rest in rests[:-1]:
        # A omega**2 sin(omega t) = g, while the table rises
        assert np.sin(2 * rest.end) == pytest.approx(1 / 1.4, abs=1e-12)
        assert np.cos(2 * rest.end) > 0
        inside = np.linspace(rest.start, rest.end, 7)
        assert run(inside)[0] == pytest.approx(0.35 * np.sin(2 * inside), abs=1e-14)
        assert run(inside[1:])[1] == pytest.approx(0.7 * np.cos(2 * inside[1:]), abs=1e-13)
    # after a rest the motion forgets: each one leaves at the same phase
    assert run.end[0] >= 0.35 * np.sin(60) - 1e-14


def test_a_table_with_less_acceleration_is_not_left(table):
    run = fs.simulate(table.with_parameters(A=0.1), [1.0, 0.0], t=(0, 50))
    assert run.itinerary == ("S1", "S1 at rest on x = A*sin(omega*t)")
    assert run.end[1] == pytest.approx(0.1 * np.sin(100), abs=1e-15)


def test_integrate_and_fire_has_its_period():
    """v' = I − v, reset from 1 to 0, fires with the period log(I/(I − 1))."""
    v1, count, current = sp.symbols("v count I")
    model = fs.Model(
        {v1: current - v1, count: 0},
        parameters={current: 1.5},
        resets={v1 >= 1: {v1: 0, count: count + 1}},
    )
    run = fs.simulate(model, [0.0, 0.0], t=(0, 20), integration=FINE)
    times = np.array([e.time for e in run.resets])
    assert times == pytest.approx(np.log(3) * np.arange(1, len(times) + 1), abs=1e-12)
    assert run.end[2] == len(times) == 18
    assert all((e.before == [1, k]).all() for k, e in enumerate(run.resets))
    assert all((e.after == [0, k + 1]).all() for k, e in enumerate(run.resets))


def test_two_equal_masses_are_two_independent_ones():
    """Elastic collisions exchange velocities, so that the positions are those without them."""
    one, two, a, b = sp.symbols("x1 x2 v1 v2")
    chain = fs.Model(
        {one: a, a: 0, two: b, b: 0},
        resets={one <= 0: {a: -a}, two >= 1: {b: -b}, one >= two: {a: b, b: a}},
    )
    run = fs.simulate(chain, [0.2, 0.7, 0.6, -0.43], t=(0, 30), integration=FINE)
    at = np.linspace(0, 30, 500)

    def reflected(start, speed):
        place = np.mod(start + speed * at, 2)
        return np.minimum(place, 2 - place)

    free = np.sort([reflected(0.2, 0.7), reflected(0.6, -0.43)], axis=0)
    assert run(at)[[0, 2]] == pytest.approx(free, abs=1e-12)
    assert {e.reset for e in run.resets} == {"x1 <= 0", "x2 >= 1", "x1 >= x2"}


def test_two_masses_come_to_rest_on_each_other():
    """Two balls, one above the other, end at rest on the ground, with their exact heights."""
    one, two, a, b = sp.symbols("x1 x2 v1 v2")
    pile = fs.Model(
        {one: a, a: -g, two: b, b: -g},
        parameters={g: 1},
        resets={
            one <= 0: {a: -a / 2},
            two <= one + 1: {a: a / 4 + 3 * b / 4, b: 3 * a / 4 + b / 4},
        },
    )
    run = fs.simulate(pile, [0.5, 0.0, 2.0, 0.0], t=(0, 30))
    assert run.outcome.success
    assert run.itinerary[-1] == "S1 at rest on x1 = 0 and x2 = x1 + 1"
    assert run.end[1:].tolist() == [0.0, 0.0, 1.0, 0.0]


def test_starts_at_a_wall(ball):
    with pytest.raises(fs.ArgumentError, match="beyond a wall: at t = 0 x <= 0 is true"):
        fs.simulate(ball, [-0.1, 1.0], t=(0, 1))
    moving_in = fs.simulate(ball, [0.0, -1.0], t=(0, 1), integration=FINE)
    assert [(e.time, e.after[1]) for e in moving_in.resets] == [(0.0, 0.8)]
    moving_away = fs.simulate(ball, [0.0, 1.0], t=(0, 1), integration=FINE)
    assert len(moving_away.resets) == 0
    assert moving_away.end[1:] == pytest.approx([0.5, 0.0], abs=1e-14)
    at_rest = fs.simulate(ball, [0.0, 0.0], t=(0, 1))
    assert at_rest.itinerary == ("S1 at rest on x = 0",)
    many = fs.simulate_many(ball, [[-0.1, 1.0], [0.0, -1.0]], t=(0, 1))
    assert [o.code for o in many.outcomes] == ["beyond a wall", "end of time"]
    assert many.resets[:, 0].tolist() == [0, 1]


def test_plastic_impacts_stop_at_once(ball):
    run = fs.simulate(ball.with_parameters(r=0), [0.5, 0.0], t=(0, 2))
    assert len(run.resets) == 1
    assert (run.resets[0].after == 0).all()
    assert (run.end[1:] == 0).all()


def test_resets_without_rest_accumulate():
    """The counter keeps the reset from being the identity at zero speed."""
    model = fs.Model({x: v, v: -1, y: 0}, resets={x <= 0: {v: -v / 2, y: y + 1}})
    run = fs.simulate(model, [0.5, 0.0, 0.0], t=(0, 10))
    assert run.outcome.code == "accumulation"
    assert run.end[0] == pytest.approx(1 + 2, abs=1e-9)


def test_zero_speed_contact_is_grazing_and_no_reset():
    """x = cos t − 1 touches the wall x = 0 at multiples of 2 pi."""
    model = fs.Model({x: v, v: -x - 1}, resets={x >= 0: {v: -v / 2}})
    run = fs.simulate(model, [-1.0, 1.0], t=(0, 20), integration=FINE)
    assert np.abs(run.end[1:] - [np.sin(20) - 1, np.cos(20)]).max() < 1e-6


def test_the_reset_comes_before_the_region():
    """At the stop x = 1 the spring also changes; after the reset x is on the inner side."""
    model = fs.Model({x: v, v: -sp.Piecewise((5 * x, x > 1), (x, True))}, resets={x >= 1: {v: -v}})
    run = fs.simulate(model, [0.0, 2.0], t=(0, 10), integration=FINE)
    assert set(run.itinerary) == {"S2"}
    assert len(run.crossings) == 0
    assert (np.array([e.after for e in run.resets]) ** 2).sum(axis=1) == pytest.approx(4)


def test_a_reset_may_change_the_region():
    """A jump across an interface continues in the other region."""
    model = fs.Model({x: sp.Piecewise((1, x > 0), (2, True))}, resets={x >= 1: {x: -1}})
    run = fs.simulate(model, [0.5], t=(0, 2.25), integration=FINE)
    # 1/2 to the wall, 1/2 from -1 to 0, 1 to the wall
    assert [e.time for e in run.resets] == pytest.approx([0.5, 2.0], abs=1e-13)


def test_resets_are_saved(ball, tmp_path):
    run = fs.simulate(ball, [0.5, 0.0], t=(0, 4))
    run.save(tmp_path / "run.npz")
    loaded = fs.load(tmp_path / "run.npz")
    assert loaded == run
    assert loaded.resets == run.resets
    assert fs.simulate(loaded.model, [0.5, 0.0], t=(0, 4)) == run
    assert run.resets("x <= 0") == run.resets
    free = fs.simulate(fs.Model({x: v, v: -x}), [1.0, 0.0], t=(0, 1))
    # as in files without this field
    assert free.reset_table is None
    assert len(free.resets) == 0
    table = run.resets.to_dict()
    assert list(table) == ["t", "x_before", "v_before", "x_after", "v_after", "reset"]
    assert len(run[: len(run) // 2].resets) < len(run.resets)


def test_jumps_through_a_level_are_not_roots():
    """Of x'' = −x between stops at ±0.6, with v from √0.64 to the opposite at each impact."""
    model = fs.Model({x: v, v: -x}, resets={x >= 0.6: {v: -v}})
    run = fs.simulate(model, [-1.0, 0.0], t=(0, 30), integration=FINE)
    assert len(run.resets) > 4
    assert all(abs(point["v"]) < 1e-12 for point in run.at(v=0.0))
    flights = np.array([run.resets[0].time, *np.diff([e.time for e in run.resets])])
    turns = [e.time - 0.5 * f for e, f in zip(run.resets[1:], flights[1:], strict=True)]
    at_turns = [point.time for point in run.at(v=0.0)][1 : len(turns) + 1]
    assert at_turns == pytest.approx(turns, abs=1e-12)
    section = run.section("v", level=0.0)
    assert len(section) in (len(turns), len(turns) + 1)
    assert [point["x"] for point in run.at(x=0.6)] == [0.6] * len(run.resets)


def test_extremes_include_the_state_before_a_jump():
    fire = fs.Model({v: 1.3 - v}, resets={v >= 1: {v: 0}})
    run = fs.simulate(fire, [0.2], t=(0, 20), integration=FINE)
    assert run.extremes("v") == pytest.approx((0.0, 1.0), abs=1e-13)
    # one period from a reset on, without the jump at its end
    begin, end = (event.time for event in run.resets[:2])
    almost = run.extremes("v", since=begin + 0.1, until=end - 0.1)
    expected = [1.3 * (1 - np.exp(-0.1)), 1.3 - 0.3 * np.exp(0.1)]
    assert almost == pytest.approx(expected, abs=1e-11)


def test_plots_have_both_sides_of_a_jump():
    model = fs.Model({x: v, v: -x}, resets={x >= 0.6: {v: -v}})
    run = fs.simulate(model, [-1.0, 0.0], t=(0, 30), integration=FINE)
    assert (np.diff(run.t) > 0).all()
    for event in run.resets:
        row = np.searchsorted(run.t, event.time)
        assert run.t[row] == event.time
        assert run["v"][row] == pytest.approx(event.after[1], abs=1e-12)
        assert run["v"][row - 1] == pytest.approx(event.before[1], abs=1e-12)
        assert run.t[row] - run.t[row - 1] < 5e-15 * event.time


def test_states_that_a_reset_moves_from_zero_are_not_invariant():
    model = fs.Model({x: -x, y: 1}, resets={y >= 1: {y: 0, x: x + 1}})
    assert model.traits.vanishing == ()
    assert fs.Model({x: -x, y: 1}, resets={y >= 1: {y: 0}}).traits.vanishing == ("x",)


def test_models_with_resets_compare_print_and_freeze(ball):
    other = fs.Model({x: v, v: -g}, parameters={r: 0.8, g: 1}, resets={x <= 0: {v: -v}})
    assert ball != other
    assert ball.equations == "x' = v\nv' = -g\nx <= 0: v → -r*v"
    assert "x <= 0: v → -r*v" in repr(ball)
    assert r"v \mapsto - r v&&\text{when}\ - x \geq 0" in ball.to_latex()
    assert list(ball.resets) == ["x <= 0"]
    w = sp.Symbol("w")
    driven = fs.Model({x: v, v: w - x}, forcing={w: sp.sin(t)}, resets={x >= w: {x: w - 1}})
    assert str(driven.frozen().resets["x >= w"].function) == "-w + x"
    assert driven.period() == pytest.approx(2 * np.pi)


def test_rest_in_a_region_counts_as_contact():
    """A load that presses on the upper stop all the time: contact with the upper side only."""
    w = sp.Symbol("w")
    gap = sp.Piecewise((x - 0.25, x > 0.25), (x + 0.25, x < -0.25), (0, True))
    model = fs.Model(
        {x: v, v: w - v / 5 - 2 * gap},
        forcing={w: 4 + sp.sin(t)},
        resets={x >= 1: {v: -v / 2}},
    )
    run = fs.simulate(model, [0.9, 0.0], periods=8)
    assert run.itinerary[-1] == "S1 at rest on x = 1"
    assert run.regime == "meshed upper"
    assert fs.simulate_many(model, [0.9, 0.0], periods=8).regime[0] == "meshed upper"


def test_unusual_resets_warn(table):
    height = A * sp.sin(omega * t)
    with pytest.warns(UserWarning, match="reverses the absolute velocity"):
        fs.Model(
            {x: v, v: -g},
            parameters={r: 0.5, g: 1, A: 0.35, omega: 2},
            resets={x <= height: {v: -r * v}},
        )
    with pytest.warns(UserWarning, match="2 times faster than before"):
        fs.Model({x: v, v: -1}, resets={x <= 0: {v: -2 * v}})


@pytest.mark.parametrize(
    ("resets", "words"),
    [
        ({x <= 0: {v: v}}, "the motion into the wall continues after it"),
        ({x <= 0: {x: -1}}, "the state after it is beyond the wall"),
        ({v <= 0: {v: 0}}, "the state after it is on the wall, and moves into it"),
        ({x <= 0: {y: 0}}, "y is no state; a reset changes states: x, v"),
        ({x <= 0: {v: -y * v}}, "unknown symbol 'y'"),
        ({y <= 0: {v: -v}}, "unknown symbol 'y'"),
        ({sp.Eq(x, 0): {v: -v}}, "expected one inequality such as x >= sigma"),
        ({t > 1: {v: -v}}, "the relation contains no state"),
        ({x <= 0: -v}, "expected a mapping of states to their values"),
        ({x <= 0: {}}, "expected a mapping of states to their values"),
        ({x <= 0: {v: -sp.Abs(v)}}, "is not smooth"),
        ({"x <= 0": {"v": "-v/2"}, x <= 0: {v: -v}}, "is given twice"),
        ({"x <": {"v": "-v"}}, "reset x <"),
    ],
)
def test_bad_input(resets, words):
    with pytest.raises(fs.ModelError, match=words):
        fs.Model({x: v, v: -1}, resets=resets)


def test_a_reset_may_turn_the_motion_by_the_region():
    """A relay: x' = −sign y, and y changes its sign at x = ±1."""
    relay = fs.Model({x: -sp.sign(y), y: 0}, resets={x >= 1: {y: 1}, x <= -1: {y: -1}})
    run = fs.simulate(relay, [0.0, -1.0], t=(0, 8.5), integration=FINE)
    assert [e.time for e in run.resets] == pytest.approx([1, 3, 5, 7], abs=1e-13)
    assert run.end[1:] == pytest.approx([0.5, -1], abs=1e-13)


def test_resets_of_an_angle_are_periodic():
    with pytest.raises(fs.ModelError, match="the reset x >= 1, x - 1, is not periodic in x"):
        fs.Model({x: v, v: -sp.sin(x)}, periodic={x: 2 * sp.pi}, resets={x >= 1: {v: -v}})
    stop = sp.sin(x) >= sp.Rational(1, 2)
    fs.Model({x: v, v: -sp.sin(x)}, periodic={x: 2 * sp.pi}, resets={stop: {v: -v}})


@pytest.mark.parametrize(
    "call",
    [
        lambda m: fs.tangencies(m),
        lambda m: fs.export(m, "numpy"),
        lambda m: fs.classify_regime(m, [[1, 0]], period=1.0),
        lambda m: fs.regime_map(m, {"r": (0.5, 0.8), "g": (1, 2)}, [1, 0], period=1.0),
    ],
)
def test_functions_that_do_not_know_resets_refuse(call, ball):
    with pytest.raises(fs.ModelError, match=r"reset of this model \(x <= 0\).*accepted by simul"):
        call(ball)
