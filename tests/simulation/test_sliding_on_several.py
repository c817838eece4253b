"""Sliding along several interfaces at once: blocks, pendulums and relays."""

import math
from itertools import combinations, product

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

import fastslow as fs
from tests.samples import WHOLE

pytestmark = pytest.mark.slow

x1, x2, v1, v2, a, b, V, k = sp.symbols("x1 x2 v1 v2 a b V k")
integration = fs.Integration(rtol=1e-12)


def oscillators():
    rates = {x1: v1, v1: -x1 - a * sp.sign(v1), x2: v2, v2: -2 * x2 - a * sp.sign(v2)}
    return fs.Model(rates, parameters={a: 0.3})


def swings(x, frequency, band, t):
    """A dry oscillator from rest at x: half swings about ±band, until it sticks; at times t."""
    half = math.pi / frequency
    out = np.empty(len(t))
    for i, time in enumerate(t):
        at = x
        while abs(at) > band:
            centre = math.copysign(band, at)
            if time < half:
                at = centre + (at - centre) * math.cos(frequency * time)
                break
            at, time = 2 * centre - at, time - half
        out[i] = at
    return out


def test_two_dry_oscillators_follow_their_closed_forms():
    starts = np.random.default_rng(5).uniform(-3, 3, (20, 2))
    t = np.linspace(0, 40, 101)
    for first, second in starts:
        run = fs.simulate(oscillators(), [first, 0, second, 0], t=(0, 40), integration=integration)
        assert run.outcome
        assert run.itinerary[-1] == "S1|S4"
        root = math.sqrt(2)
        assert np.abs(run(t)[0] - swings(first, 1.0, 0.3, t)).max() < 1e-10
        assert np.abs(run(t)[2] - swings(second, root, 0.15, t)).max() < 1e-10
        # at rest exactly
        assert run(40.0)[[1, 3]].tolist() == [0.0, 0.0]


def test_an_ensemble_slides_on_both_interfaces_too():
    starts = np.random.default_rng(1).uniform(-3, 3, (200, 4))
    many = fs.simulate_many(oscillators(), starts, t=(0, 60))
    assert many.success.all()
    assert (np.array(many.modes)[many.last_mode] == "S1|S4").all()
    assert np.abs(many.final[:, [1, 3]]).max() == 0.0
    assert np.abs(many.final[:, 0]).max() <= 0.3
    assert np.abs(many.final[:, 2]).max() <= 0.15
    one = fs.simulate(oscillators(), starts[7], t=(0, 60))
    assert many.final[7] == pytest.approx(one.end[1:], abs=1e-8)


def belt():
    rates = {
        x1: v1,
        v1: -x1 - k * (x1 - x2) - a * sp.sign(v1 - V),
        x2: v2,
        v2: -2 * x2 + k * (x1 - x2) - b * sp.sign(v2 - V),
    }
    return fs.Model(rates, parameters={a: 0.4, b: 0.8, V: 0.1, k: 0.5})


def test_sticking_blocks_leave_one_after_the_other_when_friction_is_used_up():
    # uncoupled, both stick at V until the springs pull with the full friction
    apart = belt().with_parameters(k=0, b=0.4)
    run = fs.simulate(apart, [0, 0.1, 0, 0.1], t=(0, 4.5), integration=integration)
    assert run.itinerary == ("S1|S4", "S2|S4", "S4")
    assert [c.time for c in run.crossings] == pytest.approx([2.0, 4.0], abs=1e-12)
    # from x = b/2 with speed V it slips about that place
    root = math.sqrt(2)
    assert run(3.9)[2] == pytest.approx(0.2 + 0.1 * math.sin(root * 1.9) / root, abs=1e-12)


def regularised(rates, state, t, widths):
    """End states for smooth friction of several widths, by SciPy's LSODA method."""
    ends = []
    for width in widths:
        found = solve_ivp(
            lambda _, y, width=width: rates(y, lambda u: np.tanh(u / width)),
            t, state, method="LSODA", rtol=1e-8, atol=1e-10,
        )  # fmt: skip
        ends.append(found.y[:, -1])
    return ends


def test_coupled_blocks_on_a_belt_against_smooth_friction():
    state = [-0.2, 0.3, -0.1, 0.1]
    run = fs.simulate(belt(), state, t=(0, 6), integration=integration)
    assert run.outcome
    assert "S1|S4" in run.itinerary

    def smooth(y, sign):
        pull = 0.5 * (y[0] - y[2])
        return [
            y[1],
            -y[0] - pull - 0.4 * sign(y[1] - 0.1),
            y[3],
            -2 * y[2] + pull - 0.8 * sign(y[3] - 0.1),
        ]

    wide, narrow = regularised(smooth, state, (0, 6), (1e-3, 1e-4))
    errors = [np.abs(end - run(6.0)).max() for end in (wide, narrow)]
    assert errors[1] < 0.2 * errors[0] < 1e-3


def test_two_uncoupled_oscillators_against_smooth_friction():
    state = [1.0, 0.0, -0.7, 0.4]
    run = fs.simulate(oscillators(), state, t=(0, 6), integration=integration)

    def smooth(y, sign):
        return [y[1], -y[0] - 0.3 * sign(y[1]), y[3], -2 * y[2] - 0.3 * sign(y[3])]

    wide, narrow = regularised(smooth, state, (0, 6), (1e-3, 1e-4))
    errors = [np.abs(end - run(6.0)).max() for end in (wide, narrow)]
    assert errors[1] < 0.2 * errors[0] < 1e-3


def test_a_relay_with_two_switches_against_smooth_ones():
    """Sliding along x2 = 0 or x1 = 0, then along both; a third state is driven by the weights.

    The coefficients are decimal numbers, whose sums are not exact.
    """
    z = sp.Symbol("z")
    base, jumps = np.array([0.3, -0.2, 0.1]), np.array([[-1, 0.4], [-0.3, -0.9], [0.5, 0.7]])
    signs = sp.Matrix([sp.sign(x1), sp.sign(x2)])
    field = sp.Matrix(base) + sp.Matrix(jumps) * signs - sp.Matrix([0, 0, z])
    run = fs.simulate(
        fs.Model(dict(zip((x1, x2, z), field, strict=True))),
        [0.2, -1.0, 0.0],
        t=(0, 3),
        integration=integration,
    )
    assert run.itinerary[-1] == "S1|S4"
    assert len(run.itinerary) == 3

    def smooth(y, sign):
        return base + jumps @ sign(y[:2]) - np.array([0, 0, y[2]])

    wide, narrow = regularised(smooth, [0.2, -1.0, 0.0], (0, 3), (1e-3, 1e-4))
    errors = [np.abs(end - run(3.0)).max() for end in (wide, narrow)]
    assert errors[1] < 0.2 * errors[0] < 1e-2


@pytest.mark.sample(0)
def test_a_double_pendulum_with_dry_joints_against_smooth_friction():
    one, two, p, q, g, mu1, mu2 = sp.symbols("theta1 theta2 omega1 omega2 g mu1 mu2")

    def accelerations(one, two, p, q, g, first, second, functions):
        cos, sin = functions.cos(one - two), functions.sin(one - two)
        pulls = (
            -sin * q**2 - 2 * g * functions.sin(one) - first + second,
            sin * p**2 - g * functions.sin(two) - second,
        )
        over = 2 - cos**2
        return (pulls[0] - cos * pulls[1]) / over, (2 * pulls[1] - cos * pulls[0]) / over

    first, second = mu1 * sp.sign(p), mu2 * sp.sign(q - p)
    upper, lower = accelerations(one, two, p, q, g, first, second, sp)
    pendulum = fs.Model({one: p, two: q, p: upper, q: lower}, parameters={g: 1, mu1: 0.9, mu2: 0.4})
    state = [1.2, 0.4, 0.0, 0.6]
    run = fs.simulate(pendulum, state, t=(0, 30), integration=integration)
    assert run.outcome
    assert run.itinerary[-1] == "S1|S4"
    # zero but for products of roundings in the series between projections (4e-34 measured)
    assert np.abs(run(30.0)[2:]).max() < 1e-30
    # while one joint sticks it turns with nothing between
    stuck = next(s for s in run.segments if s.region in ("S1|S2", "S3|S4", "S1|S3", "S2|S4"))
    middle = run(0.5 * (stuck.start + stuck.end))
    assert min(abs(middle[2]), abs(middle[3] - middle[2])) == 0.0

    def smooth(y, sign):
        rubbing = 0.9 * sign(y[2]), 0.4 * sign(y[3] - y[2])
        return [y[2], y[3], *accelerations(*y, 1.0, *rubbing, np)]

    t = 0.8 * run.segments[-1].start
    wide, narrow = regularised(smooth, state, (0, t), (1e-3, 1e-4))
    errors = [np.abs(end - run(t)).max() for end in (wide, narrow)]
    assert errors[1] < 0.2 * errors[0] < 1e-3


def solutions(constant, matrix):
    """All s in [−1, 1]^m that satisfy the complementarity conditions of ḣ = a + B s."""
    found = []
    for pattern in product((-1, 0, 1), repeat=len(constant)):
        signs = np.array(pattern)
        inside, s = signs == 0, signs.astype(float)
        if inside.any():
            s[inside] = np.linalg.solve(
                matrix[np.ix_(inside, inside)], -(constant + matrix @ s)[inside]
            )
        speed = constant + matrix @ s
        if (np.abs(s[inside]) < 1).all() and (speed * signs >= 0)[~inside].all():
            found.append(np.where(inside, 0.0, speed))
    return found


@pytest.mark.sample(1)
@pytest.mark.parametrize("m", [3, 2])
def test_random_relays_go_on_just_where_the_complementarity_problem_has_one_solution(m):
    states, base, jumps = sp.symbols(f"x:{m}"), sp.symbols(f"a:{m}"), sp.symbols(f"b:{m * m}")
    field = sp.Matrix(base) + sp.Matrix(m, m, jumps) * sp.Matrix([sp.sign(s) for s in states])
    relay = fs.Model(dict(zip(states, field, strict=True)), parameters=dict.fromkeys(
        [*base, *jumps], 0.5))  # fmt: skip
    random, count = np.random.default_rng(7), 80 if WHOLE else 24
    constants, matrices = random.normal(size=(count, m)), random.normal(size=(count, m, m))
    values = np.column_stack([constants, matrices.reshape(count, -1)])
    given = dict(zip((*base, *jumps), values.T, strict=True))
    many = fs.simulate_many(relay, [0.0] * m, parameters=given, t=(0, 0.1))
    single = 0
    for k, (constant, matrix) in enumerate(zip(constants, matrices, strict=True)):
        ways, outcome = solutions(constant, matrix), many.outcomes[k]
        minors = [
            np.linalg.det(-matrix[np.ix_(i, i)])
            for r in range(1, m + 1)
            for i in combinations(range(m), r)
        ]
        if min(minors) > 0:
            assert len(ways) == 1
        if len(ways) == 1:
            single += 1
            assert outcome
            assert many.final[k] == pytest.approx(0.1 * ways[0], abs=1e-9)
        else:
            assert outcome.code == "not unique"
            assert "forward motion is not unique" in str(outcome)
    assert count // 4 < single < count - count // 4


def test_the_next_derivative_decides_where_friction_is_just_used_up():
    # both springs pull with the full friction at the start, the second one on the way down
    t = sp.Symbol("t")
    rates = {v1: 1 + t - sp.sign(v1), v2: 1 - t - sp.sign(v2)}
    run = fs.simulate(fs.Model(rates), [0, 0], t=(0, 1), integration=integration)
    assert run.itinerary == ("S1|S2",)
    assert run(1.0) == pytest.approx([0.5, 0.0], abs=1e-13)


def test_rates_that_are_no_sum_of_jumps_end_the_run_with_the_reason():
    rates = {x1: -sp.sign(x1) * (2 + sp.sign(x2)), x2: -sp.sign(x2)}
    run = fs.simulate(fs.Model(rates), [1, 2], t=(0, 5))
    assert run.outcome.code == "not decided"
    assert "not a sum of one jump" in str(run.outcome)
    assert "smooth one of the signs" in str(run.outcome)
    assert run.span[1] == pytest.approx(2.0)
    at_start = fs.simulate(fs.Model(rates), [0, 0], t=(0, 5)).outcome
    assert at_start.code == "not decided"
    assert "at t = 0 the initial state is at several discontinuities" in str(at_start)
    many = fs.simulate_many(fs.Model(rates), [[1, 2], [1, 3]], t=(0, 2.5))
    assert [o.code for o in many.outcomes] == ["not decided", "end of time"]


def test_interfaces_at_an_angle_are_both_kept_to_rounding():
    # h = (x, x + y/2) with a drift along both: the state is put on both at once
    z = sp.Symbol("z")
    h = x1 + x2 / 2
    rates = {x1: sp.sin(z) / 2 - sp.sign(x1), x2: sp.cos(3 * z) - 3 * sp.sign(h), z: 1}
    run = fs.simulate(fs.Model(rates), [0.4, -1.0, 0], t=(0, 20))
    assert run.outcome
    assert run.itinerary[-1] == "S1|S4"
    assert np.abs(run(np.linspace(15, 20, 31))[:2]).max() == 0.0
