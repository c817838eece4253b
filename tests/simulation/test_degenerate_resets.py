"""Resets in degenerate cases: flights from the wall, jumps at rest, corners, equal instants."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs

x, v, y, t, r, g, T = sp.symbols("x v y t r g T")
FINE = fs.Integration(rtol=1e-13)
HALF = sp.Rational(1, 2)


@pytest.fixture(scope="module")
def ball():
    return fs.Model({x: v, v: -g}, parameters={r: 0.5, g: 1}, resets={x <= 0: {v: -r * v}})


@pytest.mark.parametrize("losses", [0.3, 0.5, 0.9, 0.99])
@pytest.mark.parametrize("speed", [1e-3, 3.0])
def test_a_ball_thrown_from_the_ground_comes_to_rest(ball, losses, speed):
    """Each flight is one step that begins and ends on the wall; all of them last 2 v / (1 − r)."""
    run = fs.simulate(ball.with_parameters(r=losses), [0.0, speed], t=(0, 1000), integration=FINE)
    assert run.itinerary == ("S1", "S1 at rest on x = 0")
    assert (run.end[1:] == 0).all()
    last = run.resets[-1]
    assert last.time + 2 * losses * -last.before[1] / (1 - losses) == pytest.approx(
        2 * speed / (1 - losses), rel=1e-10
    )


def test_flights_after_a_start_at_rest_do_not_pass_the_wall():
    """v' = 1 − t from rest on the wall: a flight until t = 3, and then a chatter."""
    model = fs.Model({x: v, v: 1 - t}, resets={x <= 0: {v: -v / 2}})
    run = fs.simulate(model, [0.0, 0.0], t=(0, 6), integration=FINE)
    assert run.resets[0].time == pytest.approx(3, abs=1e-13)
    assert run.itinerary == ("S1", "S1 at rest on x = 0")


@pytest.mark.parametrize(
    ("force", "leaves"),
    [((1 - t) ** 2, None), ((1 - t) ** 2 * (sp.Rational(3, 2) - t), 1.5), ((1 - t) ** 3, 1)],
)
def test_multiple_roots_of_the_contact_force(force, leaves):
    """A contact force that touches zero keeps the contact, one that changes sign ends it."""
    model = fs.Model({x: v, v: -force}, resets={x <= 0: {v: -v / 2}})
    run = fs.simulate(model, [0.0, 0.0], t=(0, 2), integration=FINE)
    if leaves is None:
        assert run.itinerary == ("S1 at rest on x = 0",)
        return
    assert run.itinerary == ("S1 at rest on x = 0", "S1")
    s = sp.Symbol("s")
    speed = sp.integrate(-force.subs(t, s), (s, leaves, t))
    exact = float(sp.integrate(speed, (t, leaves, 2)))
    assert run.end[1] == pytest.approx(exact, abs=1e-8)


@pytest.mark.parametrize("kick", [sp.Rational(1, 8), -sp.Rational(1, 4)])
def test_kicks_from_rest(ball, kick):
    """Up, or down and back by half of it: flights of 1/4, 1/8, …, then rest until the next one."""
    kicked = fs.Model(
        {x: v, v: -1},
        resets={x <= 0: {v: -v / 2}, sp.Eq(sp.Mod(t, 1), 0): {v: v + kick}},
    )
    run = fs.simulate(kicked, [0.0, 0.0], t=(0, 3.9), integration=FINE)
    rests = [one for one in run.segments if "at rest" in one.region]
    assert [one.start for one in rests] == pytest.approx([0, 1.5, 2.5, 3.5], abs=1e-6)
    assert [one.end for one in rests] == [1, 2, 3, 3.9]
    assert run([1.125, 2.125])[0] == pytest.approx(np.full(2, 0.125**2 / 2), abs=1e-12)


def test_a_jump_of_the_load_ends_the_rest():
    """The contact force −1/2 + Mod(t, 1) is negative again at every instant."""
    model = fs.Model({x: v, v: -sp.Mod(t + HALF, 1) + HALF}, resets={x <= 0: {v: -v / 4}})
    run = fs.simulate(model, [0.0, 0.0], t=(0, 0.75), integration=FINE)
    assert [one.region for one in run.segments] == ["S1 at rest on x = 0", "S1"]
    assert run.segments[0].end == 0.5
    assert run.end[1] == pytest.approx(0.25**2 / 4 - 0.25**3 / 6, abs=1e-15)


def test_jumps_make_relations_true():
    """A counter that reaches 3, and a kicked neuron that passes its threshold."""
    counting = fs.Model({x: 1, y: 0}, resets={x >= 1: {x: 0, y: y + 1}, y >= 3: {y: 0}})
    run = fs.simulate(counting, [0.0, 0.0], t=(0, 6.5), integration=FINE)
    assert run.end[1:] == pytest.approx([0.5, 0.0], abs=1e-14)
    assert [e.time for e in run.resets("y >= 3")] == pytest.approx([3, 6], abs=1e-14)
    every = sp.Eq(sp.Mod(t, 1), 0)
    neuron = fs.Model({x: -x / 10}, resets={every: {x: x + HALF}, x >= 1: {x: 0}})
    run = fs.simulate(neuron, [0.2], t=(0, 8.5), integration=FINE)
    state, fired = 0.2, []
    for k in range(1, 9):
        state = state * np.exp(-0.1) + 0.5
        if state >= 1:
            state = 0.0
            fired.append(float(k))
    assert [e.time for e in run.resets("x >= 1")] == fired
    assert run.end[1] == pytest.approx(state * np.exp(-0.05), abs=1e-14)


def test_jumps_beyond_a_wall_that_the_reset_does_not_undo():
    model = fs.Model({x: 0, v: 0}, resets={sp.Eq(sp.Mod(t, 1), 0): {x: x + 1}, x >= 2: {v: v + 1}})
    run = fs.simulate(model, [1.5, 0.0], t=(0, 3))
    assert (run.outcome.code, run.end[0]) == ("beyond a wall", 1.0)
    assert [e.reset for e in run.resets] == ["Eq(Mod(t, 1), 0)", "x >= 2"]


def test_resets_onto_each_other_without_end():
    model = fs.Model({x: 1, y: 1}, resets={x >= 1: {x: 0, y: 2}, y >= 2: {y: 0, x: 1}})
    run = fs.simulate(model, [0.0, 0.0], t=(0, 3))
    assert (run.outcome.code, run.end[0]) == ("accumulation", 1.0)


def test_two_walls_at_the_same_instant():
    """Into the corner of a square and back, exactly and nearly; a corner of 60 degrees turns it."""
    u = sp.Symbol("u")
    square = fs.Model(
        {x: u, y: v, u: 0, v: 0},
        resets={x >= 1: {u: -u}, y >= 1: {v: -v}, x <= 0: {u: -u}, y <= 0: {v: -v}},
    )
    for offset in (0.0, 1e-15, 1e-10):
        run = fs.simulate(square, [0.0, offset, 1.0, 1.0], t=(0, 7.5), integration=FINE)
        assert len(run.resets) == 14
        assert run.end[1:] == pytest.approx([0.5, 0.5, -1, -1], abs=2 * offset + 1e-13)
    normal = sp.Matrix([-sp.sqrt(3) / 2, HALF])
    speed = normal.dot(sp.Matrix([u, v]))
    wedge = fs.Model(
        {x: u, y: v, u: 0, v: 0},
        resets={
            y <= 0: {v: -v},
            normal.dot(sp.Matrix([x, y])) >= 0: {
                u: u - 2 * speed * normal[0],
                v: v - 2 * speed * normal[1],
            },
        },
    )
    towards = np.array([np.cos(0.5), np.sin(0.5)])
    run = fs.simulate(wedge, [*(2 * towards), *-towards], t=(0, 4), integration=FINE)
    # three reflections of a wedge of pi / 3 are one about its bisector
    assert len(run.resets) == 3
    mirrored = [np.cos(np.pi / 3 - 0.5), np.sin(np.pi / 3 - 0.5)]
    assert run.end[1:] == pytest.approx([*np.multiply(2, mirrored), *mirrored], abs=1e-13)


@pytest.fixture(scope="module")
def circle():
    u = sp.Symbol("u")
    inward = (u * x + v * y) / (x**2 + y**2)
    change = {u: u - (1 + r) * inward * x, v: v - (1 + r) * inward * y}
    return fs.Model(
        {x: u, y: v, u: 0, v: -g}, parameters={r: 1, g: 0}, resets={x**2 + y**2 >= 1: change}
    )


def test_billiard_in_a_circle(circle):
    """Chords of equal length: the angle of the bounces advances by the same amount each time."""
    begin, direction = np.array([0.3, 0.1]), np.array([0.7, 0.4])
    run = fs.simulate(circle, [*begin, *direction], t=(0, 250), integration=FINE)
    speed = np.hypot(*direction)
    along, across = begin @ direction / speed, (0.7 * 0.1 - 0.4 * 0.3) / speed
    half = np.sqrt(1 - across**2)
    count = np.arange(100)
    times = (half - along) / speed + 2 * half / speed * count
    first = begin + direction * times[0]
    counterclockwise = np.sign(first[0] * direction[1] - first[1] * direction[0])
    turn = counterclockwise * 2 * np.arccos(np.abs(across))
    angles = np.arctan2(first[1], first[0]) + turn * count
    found = np.array([[e.time, *e.before[:2]] for e in run.resets[:100]])
    assert found[:, 0] == pytest.approx(times, abs=1e-12 * times[-1])
    assert found[:, 1:] == pytest.approx(
        np.column_stack([np.cos(angles), np.sin(angles)]), abs=1e-12
    )


def test_rest_on_a_circle_is_a_pendulum(circle):
    """From the bottom with v² = 3.61 the contact ends at the height 1.61/3."""
    bowl = circle.with_parameters(g=1, r=0)
    run = fs.simulate(bowl, [0.0, -1.0, 1.9, 0.0], t=(0, 10), integration=FINE)
    assert "at rest" in run.segments[0].region
    leaving = run(run.segments[0].end)
    assert leaving[1] == pytest.approx(1.61 / 3, abs=1e-12)
    assert np.hypot(*leaving[:2]) == pytest.approx(1, abs=1e-13)
    losing = bowl.with_parameters(r=0.5)
    bouncing = fs.simulate(losing, [0.0, -1.0, 1.9, 0.0], t=(0, 10), integration=FINE)
    assert "at rest" in bouncing.segments[-1].region
    assert (np.hypot(*bouncing(np.linspace(0, 10, 500))[:2]) < 1 + 1e-12).all()


def test_kicks_at_the_ends_of_runs_are_applied_once():
    """k T and the ends of the spans differ by rounding; a kick at an end belongs to that run."""
    model = fs.Model({x: 0}, parameters={T: 0.1}, resets={sp.Eq(sp.Mod(t, T), 0): {x: x + 1}})
    for k in range(60):
        assert fs.simulate(model, [k], t=(k / 10, (k + 1) / 10)).end[1] == k + 1
        assert fs.simulate(model, [0], periods=3, t0=k * 0.1).end[1] == 3
    begins = np.cumsum(np.full(60, 0.7))
    for k in range(59):
        span = (begins[k], begins[k + 1])
        assert fs.simulate(model.with_parameters(T=0.7), [0], t=span).end[1] == 1


def test_instants_of_two_clocks_are_the_same_up_to_rounding():
    """3 k T is an instant of both: the first clock is at its beginning when the second kicks."""
    other = sp.Eq(sp.Mod(t, 3 * T), 0)
    model = fs.Model({x: 0, y: 1}, parameters={T: 0.1}, resets={other: {x: x + sp.Mod(t, T)}})
    assert fs.simulate(model, [0, 0], t=(0, 30)).end[1] == 0


def test_ensembles_count_kicks():
    kicks = {x <= 0: {v: -v / 2}, sp.Eq(sp.Mod(t, 1), 0): {v: v + sp.Rational(1, 8)}}
    kicked = fs.Model({x: v, v: -1}, resets=kicks)
    run = fs.simulate(kicked, [0.0, 0.0], t=(0, 4.9), integration=FINE)
    many = fs.simulate_many(kicked, [0.0, 0.0], t=(0, 4.9), integration=FINE)
    assert many.resets[0].tolist() == [len(run.resets("x <= 0")), 4]
    assert (many.final[0] == run.end[1:]).all()
    late = fs.simulate_many(kicked, [0.0, 0.0], t=(0, 4.9), settle=2)
    assert late.resets[0, 1] == 3


def test_a_run_may_begin_at_rest_where_the_wall_passes_zero():
    """The error of the state is that of its range, and not of its value 0 there."""
    moving = fs.systems.bouncing_ball().with_parameters(A=0.5)
    run = fs.simulate(moving, [1.0, 0.0], t=(0, 60), integration=FINE)
    for k in range(12, 19):
        begin = k * np.pi
        again = fs.simulate(moving, run(begin), t=(begin, begin + 1))
        assert again.itinerary == ("S1 at rest on x = A*sin(omega*t)",)
    with pytest.raises(fs.ArgumentError, match="beyond a wall"):
        fs.simulate(moving, run(begin) - [1e-12, 0.0], t=(begin, begin + 1))


def test_the_upstroke_of_a_spike_may_be_shorter_than_rounding_of_the_time():
    # AdEx (Brette and Gerstner, Journal of Neurophysiology 94, 3637, 2005): at V = 20 the potential
    # doubles its rate in 7e-15; from 0 to 20 it takes (2 * 281 / 60) exp(-50.4 / 2) = 1.1e-10
    def spikes(peak, rtol=1e-9):
        potential, w = sp.symbols("V w")
        rate = (-30 * (potential + 70.6) + 60 * sp.exp((potential + 50.4) / 2) - w + 1000) / 281
        model = fs.Model(
            {potential: rate, w: (4 * (potential + 70.6) - w) / 144},
            resets={potential >= peak: {potential: -70.6, w: w + 80.5}},
        )
        return fs.simulate(model, [-70.6, 0], t=(0, 400), integration=fs.Integration(rtol=rtol))

    low, high = spikes(0), spikes(20)
    assert low.outcome
    assert high.outcome
    assert len(high.resets) == len(low.resets) == 14
    later = [b.time - a.time for a, b in zip(low.resets, high.resets, strict=True)]
    # each interval is longer, and of its delay half remains in the next
    assert np.all(np.abs(later) < 3e-9)
    assert later[0] == pytest.approx(281 / 30 * np.exp(-25.2), rel=1e-3)
    assert high.end[1:] == pytest.approx(low.end[1:], rel=1e-8)
    # coefficients of order 24 would overflow
    fine = spikes(20, rtol=1e-13)
    assert fine.outcome
    assert fine.end[1:] == pytest.approx(high.end[1:], rel=1e-8)
    stored = fs.simulate(
        fine.model.stored, [-70.6, 0], t=(0, 400), integration=fs.Integration(rtol=1e-13)
    )
    assert np.array_equal(stored.end, fine.end)


@pytest.mark.parametrize(
    ("value", "start"),
    [
        (y**2, 1e200),
        (1 / (y - 3), 3.0),
        (sp.exp(y), 1e4),
        (sp.log(y), 0.0),
        (sp.sqrt(y), -1.0),
    ],
)
@pytest.mark.parametrize("relation", [x >= 1, sp.Eq(sp.Mod(t, 1), 0)])
def test_a_reset_to_a_value_that_is_not_finite_ends_its_run_alone(value, start, relation):
    model = fs.Model({x: 1, y: 0}, resets={relation: {x: 0, y: value}})
    run = fs.simulate(model, [0.0, start], t=(0, 3))
    assert run.outcome.code == "reset not finite"
    assert ("x >= 1" if isinstance(relation, sp.Ge) else "Mod(t, 1)") in run.outcome.message
    assert not run.outcome.success
    assert run.end == pytest.approx([1.0, 1.0, start])
    assert len(run.resets) == 0
    many = fs.simulate_many(model, [[0.0, start], [0.0, 0.5]], t=(0, 0.9))
    assert many.success.all()
    many = fs.simulate_many(model, [[0.0, start], [0.5, start], [-3.0, start]], t=(0, 2.5))
    assert [o.code for o in many.outcomes][:2] == ["reset not finite"] * 2


def test_one_member_with_an_overflow_does_not_end_the_others():
    model = fs.Model({x: 1, y: 0}, resets={x >= 1: {x: 0, y: y**2}})
    many = fs.simulate_many(model, [[0.0, 1e200], [0.0, 0.5], [0.0, 1e100]], t=(0, 2.5))
    assert [o.code for o in many.outcomes] == [
        "reset not finite",
        "end of time",
        "reset not finite",
    ]
    assert many.final[1] == pytest.approx([0.5, 0.0625])
    assert many.final[2] == pytest.approx([1.0, 1e200])


def test_relations_that_are_not_finite_at_parameter_values():
    k = sp.Symbol("k")
    for relation, jump in ((x <= 1 / k, -v), (x <= 0, -v / k), (x <= sp.log(k), -v)):
        with pytest.raises(fs.ModelError, match="not finite at k = 0"):
            fs.Model({x: v, v: -1}, parameters={k: 0}, resets={relation: {v: jump}})
        model = fs.Model({x: v, v: -1}, parameters={k: 1}, resets={relation: {v: jump * HALF}})
        run = fs.simulate(model.with_parameters(k=0), [2.0, 0.0], t=(0, 3))
        assert run.outcome.code in ("not finite at start", "reset not finite")
        many = fs.simulate_many(model, [[2.0, 0.0]] * 2, parameters={k: [1, 0]}, t=(0, 2.5))
        assert many.success.tolist() == [True, False]
