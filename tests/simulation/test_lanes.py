"""Many trajectories in lanes: against closed forms and `simulate`, and bit for bit."""

import math

import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from fastslow.kernels.simd import steps
from fastslow.kernels.simd.lanes import WIDTH
from fastslow.model.model import Model
from fastslow.results.trajectory.ensemble import Ensemble
from fastslow.simulation import grouping, many
from fastslow.simulation.many import simulate_many
from fastslow.simulation.one import simulate
from fastslow.simulation.settings import Execution, Integration
from fastslow.simulation.stepper.lanes import IN_PROGRESS

pytestmark = pytest.mark.slow

x, v, y, t = sp.symbols("x v y t")


def assert_same_bits(one: Ensemble, other: Ensemble, chosen=slice(None)) -> None:
    for name in ("minimum", "maximum", "final", "reached", "hits", "n_steps", "codes"):
        first, second = getattr(one, name)[chosen], getattr(other, name)
        assert np.array_equal(first, second, equal_nan=True), name
    if one.sampled is not None:
        assert np.array_equal(one.sampled[1][chosen], other.sampled[1], equal_nan=True)


@pytest.fixture(scope="module")
def table():
    """States and parameters of gears that do many different things."""
    rng = np.random.default_rng(5)
    m = IN_PROGRESS + 2 * WIDTH + 3
    return {
        "states": rng.uniform([-0.6, -2], [0.6, 2], (m, 2)),
        "D": rng.uniform(0.02, 0.5, m),
        "C": rng.uniform(0.0, 6.0, m),
        "omega": rng.choice([0.05, 0.1, 0.3], m),
    }


def many_gears(gear, table, chosen=slice(None), **keywords) -> Ensemble:
    return simulate_many(
        gear,
        table["states"][chosen],
        parameters={name: table[name][chosen] for name in ("D", "C", "omega")},
        **{"t": (0, 60), "settle": 7.0, "samples": [0.0, 0.1, 31.0, 60.0], **keywords},
    )


@pytest.fixture(scope="module")
def gears(gear, table):
    return many_gears(gear, table)


def test_gears_are_those_of_simulate(gear, table):
    # at a tight tolerance both are close to the solution, so that they are close to each other
    many = many_gears(gear, table, slice(0, None, 6), integration=Integration(rtol=1e-13, order=16))
    assert many.hits.sum() > 80
    for k, i in enumerate(range(0, len(table["D"]), 6)):
        one = gear.with_parameters(**{name: table[name][i] for name in ("D", "C", "omega")})
        run = simulate(
            one,
            table["states"][i],
            t=(0, 60),
            integration=Integration(implicit=False, rtol=1e-13, order=16),
        )
        assert many.final[k] == pytest.approx(run.end[1:], abs=1e-11)
        assert many["x"][k] == pytest.approx(run(many.t)[0], abs=1e-11)
        for column, name in enumerate(("x", "v")):
            low, high = run.extremes(name, since=7.0)
            assert many.minimum[k, column] == pytest.approx(low, abs=1e-11)
            assert many.maximum[k, column] == pytest.approx(high, abs=1e-11)
        for j, name in enumerate(many.interfaces):
            for direction in (1, -1):
                times = [
                    c.time
                    for c in run.crossings
                    if c.interface == name and c.direction == direction and c.time >= 7.0
                ]
                assert many.hits[k, j, 0 if direction > 0 else 1] == len(times)


@settings(max_examples=20)
@given(st.data())
def test_neighbours_order_and_threads_change_no_bit(gear, gears, table, data):
    everything = list(range(len(gears)))
    chosen = data.draw(st.lists(st.sampled_from(everything), min_size=1, max_size=40))
    threads = data.draw(st.integers(1, 3))
    again = many_gears(gear, table, np.array(chosen), execution=Execution(threads=threads))
    assert_same_bits(gears, again, chosen)


def test_chunks_change_no_bit(gear, gears, table, monkeypatch):
    for size in (1, WIDTH - 1, IN_PROGRESS + 1):
        monkeypatch.setattr(many, "_CHUNK", size)
        assert_same_bits(gears, many_gears(gear, table, execution=Execution(threads=2)))


def test_blocks_change_no_bit(gear, gears, table, monkeypatch):
    """Of a million, only some thousands are in memory with all that their integration needs."""
    monkeypatch.setattr(many, "IN_MEMORY", 7)
    monkeypatch.setattr(grouping, "COMPARED_AT_ONCE", 5)
    again = many_gears(gear, table)
    assert_same_bits(gears, again)
    assert again.regime.tolist() == gears.regime.tolist()


def test_samples_and_transients_change_no_other_bit(gear, gears, table):
    # but where a step ends: the loop of one trajectory takes those that hold the end of settling
    plain = many_gears(gear, table, samples=None)
    for name in ("minimum", "maximum", "final", "hits", "n_steps"):
        assert np.array_equal(getattr(gears, name), getattr(plain, name))


@pytest.fixture(scope="module")
def oscillator():
    c, k = sp.symbols("c k")
    return Model({x: v, v: -2 * c * v - k * x}, parameters={c: 0.1, k: 1})


@pytest.mark.parametrize("m", [1, WIDTH, WIDTH + 5])
def test_an_oscillator_against_its_closed_form(oscillator, m):
    c, k = np.linspace(0.0, 0.4, m), np.linspace(1.0, 30.0, m)
    times = np.linspace(0, 20, 41)
    many = simulate_many(
        oscillator,
        [1, 0],
        parameters={"c": c, "k": k},
        t=(0, 20),
        samples=times,
        integration=Integration(rtol=1e-13),
    )
    w = np.sqrt(k - c**2)[:, None]
    decay = np.exp(-c[:, None] * times)
    position = decay * (np.cos(w * times) + c[:, None] / w * np.sin(w * times))
    velocity = -decay * k[:, None] / w * np.sin(w * times)
    assert many["x"] == pytest.approx(position, abs=3e-11)
    assert many["v"] == pytest.approx(velocity, abs=2e-10)
    # the first swing to the other side is the widest
    assert many.minimum[:, 0] == pytest.approx(-np.exp(-c * np.pi / w[:, 0]), abs=3e-11)
    assert many.maximum[:, 0] == pytest.approx(np.ones(m), abs=3e-11)
    later = simulate_many(
        oscillator,
        [1, 0],
        parameters={"c": c, "k": k},
        t=(0, 20),
        settle=2.0,
        integration=Integration(rtol=1e-13),
    )
    turns = np.arange(0, 100) * np.pi / w
    heights = np.where(
        turns >= 2.0, np.cos(np.pi * np.arange(100)) * np.exp(-c[:, None] * turns), 0
    )
    begin = np.exp(-c * 2) * (np.cos(2 * w[:, 0]) + c / w[:, 0] * np.sin(2 * w[:, 0]))
    assert later.maximum[:, 0] == pytest.approx(np.maximum(heights.max(1), begin), abs=3e-11)
    assert later.minimum[:, 0] == pytest.approx(np.minimum(heights.min(1), begin), abs=3e-11)


def test_rates_of_all_kinds():
    # x = log(exp(x0) + a t), v = v0 (1 + t), y = (y0 + sin(b t)/b) below and above 1e6
    a, b = sp.symbols("a b")
    model = Model(
        {x: a * sp.exp(-x), v: v / (1 + t), y: sp.cos(b * t) + sp.sin(b) ** 2 + sp.cos(b) ** 2 - 1},
        parameters={a: 1, b: 1},
    )
    start = np.column_stack([np.linspace(-1, 1, 11), np.linspace(0.5, 3, 11), np.zeros(11)])
    rates = {"a": np.linspace(0.1, 2, 11), "b": np.linspace(0.2, 3, 11)}
    many = simulate_many(
        model, start, parameters=rates, t=(0, 5), integration=Integration(rtol=1e-12)
    )
    expected = np.column_stack(
        [
            np.log(np.exp(start[:, 0]) + 5 * rates["a"]),
            6 * start[:, 1],
            np.sin(5 * rates["b"]) / rates["b"],
        ]
    )
    assert many.final == pytest.approx(expected, abs=1e-10)
    late = simulate_many(model, start, parameters={"b": rates["b"]}, t=(9.9e5, 9.9e5 + 5))
    moved = np.sin(rates["b"] * (9.9e5 + 5)) - np.sin(rates["b"] * 9.9e5)
    assert late.final[:, 2] == pytest.approx(moved / rates["b"], abs=1e-8)


def test_a_relay_with_a_threshold_of_its_own():
    # x' = v, v' = -sign(x - d): parabolas, of period 4 sqrt(2 a) about d with amplitude a
    d = sp.Symbol("d")
    relay = Model({x: v, v: -sp.sign(x - d)}, parameters={d: 0})
    amplitude, middle = np.linspace(0.1, 4, 21), np.linspace(-3, 3, 21)
    states = np.column_stack([middle + amplitude, np.zeros(21)])
    many = simulate_many(relay, states, parameters={"d": middle}, t=(0, 50))
    assert many.maximum[:, 0] == pytest.approx(middle + amplitude, abs=1e-8)
    assert many.minimum[:, 0] == pytest.approx(middle - amplitude, abs=1e-8)
    quarters = 50 / np.sqrt(2 * amplitude)
    assert np.array_equal(many.hits[:, 0].sum(axis=1), np.floor((quarters + 1) / 2))
    order = np.arange(21)[::-1]
    again = simulate_many(relay, states[order], parameters={"d": middle[order]}, t=(0, 50))
    assert_same_bits(many, again, order)


def test_sliding(friction):
    # it sticks where |x| <= mu; from rest at x0 it swings to x0 - 2 mu, then -x0 + 4 mu, ...
    mu = np.linspace(0.15, 0.9, 17)
    many = simulate_many(friction, [2, 0], parameters={"mu": mu, "a": 0.0}, t=(0, 40))
    swings = np.ceil((2 - mu) / (2 * mu))
    assert np.abs(many.final[:, 0]) == pytest.approx(np.abs(2 - 2 * mu * swings), abs=1e-8)
    assert np.abs(many.final[:, 1]).max() < 1e-12
    assert {many.modes[i] for i in many.last_mode} == {friction_stuck(many)}


def friction_stuck(many: Ensemble) -> str:
    (name,) = (name for name in many.modes if "|" in name)
    return name


@pytest.mark.parametrize(
    ("keywords", "code"),
    [({"max_steps": 1}, "too many steps"), ({"max_steps": 37}, "too many steps")],
)
def test_limits(gear, table, keywords, code):
    settings = Integration(implicit=False, **keywords)
    many = many_gears(gear, table, slice(0, 20), samples=None, settle=0.0, integration=settings)
    assert (many.n_steps <= keywords["max_steps"]).all()
    some = many.n_steps == keywords["max_steps"]
    assert some.sum() >= 15
    for i in np.flatnonzero(some):
        one = gear.with_parameters(**{name: table[name][i] for name in ("D", "C", "omega")})
        run = simulate(one, table["states"][i], t=(0, 60), integration=settings)
        assert many.outcomes[i].code == run.outcome.code == code
        assert many.reached[i] == pytest.approx(run.span[1], rel=0.05)


def test_ends_of_all_kinds():
    # x' = x**2 from x0 grows without bound at t = 1 / x0
    model = Model({x: x**2, y: sp.log(y)})
    first = np.array([1.0, -1.0, 0.0, 4.0, 0.2, 0.5, 0.19, -3.0, 0.1, 2.0])
    second = np.array([1.0, 1.0, -1.0, 1.0, 0.0, 1.0, 1.0, 1.0, 0.9, 1.0])
    many = simulate_many(model, np.column_stack([first, second]), t=(0, 5))
    codes = [outcome.code for outcome in many.outcomes]
    assert [codes[i] for i in (0, 3, 5, 9)] == ["blow-up"] * 4
    assert many.reached[[0, 3, 5, 9]] == pytest.approx([1, 0.25, 2, 0.5], abs=1e-9)
    assert [codes[i] for i in (2, 4)] == ["not finite at start"] * 2
    assert many.success[[1, 6, 7]].all()
    assert many.final[[1, 6, 7], 0] == pytest.approx([-1 / 6, 0.19 / 0.05, -3 / 16], abs=1e-7)
    alone = simulate_many(model, [[0.1, 0.9]], t=(0, 5))
    assert_same_bits(many, alone, [8])


def test_an_end_at_once(gear):
    many = simulate_many(gear, [[0, 0], [0.4, 1]], t=(0, 1e-300))
    assert many.success.all()
    assert many.final == pytest.approx(np.array([[0, 0], [0.4, 1]]), abs=1e-290)
    assert math.isclose(many.reached[0], 1e-300)


def test_a_model_too_large_for_lanes_is_that_of_simulate(gear, table, monkeypatch):
    monkeypatch.setattr(steps, "_LARGEST_MODEL", 0)
    # nothing that is kept
    monkeypatch.setattr(steps, "_compiled", steps._compiled.__wrapped__)
    ensemble = many_gears(gear, table, slice(0, 9))
    for i in range(9):
        one = gear.with_parameters(**{name: table[name][i] for name in ("D", "C", "omega")})
        run = simulate(one, table["states"][i], t=(0, 60), integration=Integration(implicit=False))
        if 2 * np.pi / table["omega"][i] > 60:
            assert np.array_equal(ensemble.final[i], run.end[1:])
            assert ensemble.n_steps[i] == len(run.steps)
        else:
            # an ensemble stops at the ends of the last periods, to see what is done in each
            assert ensemble.final[i] == pytest.approx(run.end[1:], abs=1e-11)
            assert abs(ensemble.n_steps[i] - len(run.steps)) <= 3
