"""States at the times of jumps: those after them."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.results.trajectory.steps.dense import rows_before_jumps

x, v, t = sp.symbols("x v t")


@pytest.fixture(scope="module")
def kicked():
    model = fs.Model({x: -x}, resets={sp.Eq(sp.Mod(t, sp.Rational(1, 10)), 0): {x: x + 1}})
    return fs.simulate(model, [0.5], t=(0, 1))


def test_times_that_are_jumps_to_rounding(kicked):
    times = np.array([event.time for event in kicked.resets])
    after = np.array([event.after[0] for event in kicked.resets])
    assert len(times) == 10
    for some in (times, np.nextafter(times, -1), np.arange(1, 11) / 10, times * (1 - 1e-15)):
        inside = np.minimum(some, 1)
        assert kicked(inside)[0] == pytest.approx(after, rel=1e-12)
        assert [kicked(time)[0] for time in inside] == pytest.approx(after, rel=1e-12)
        assert [kicked.at(t=time)[0].state[0] for time in inside] == pytest.approx(after, rel=1e-12)
    # many ascending times
    many = np.sort(np.append(np.linspace(0, 1, 500), np.nextafter(times, -1)))
    met = np.isin(many, np.nextafter(times, -1))
    assert kicked(many)[0, met] == pytest.approx(after, rel=1e-12)
    before = np.array([event.before[0] for event in kicked.resets])
    assert kicked(times * (1 - 1e-13))[0] == pytest.approx(before, rel=1e-9)


def test_samples_for_plots_keep_both_sides(kicked):
    rows = rows_before_jumps(kicked.t)
    events = kicked.resets
    assert kicked["x"][rows] == pytest.approx([e.before[0] for e in events], rel=1e-12)
    assert kicked["x"][rows + 1] == pytest.approx([e.after[0] for e in events], rel=1e-12)
    assert kicked(kicked.t)[0] == pytest.approx(kicked["x"], rel=1e-9)


def test_a_jump_at_the_last_time(kicked):
    highest = max(event.after[0] for event in kicked.resets)
    assert kicked.extremes("x")[1] == pytest.approx(highest, rel=1e-12)
    assert kicked(1.0) == pytest.approx(kicked.end[1:], abs=0)
    ball = fs.Model({x: v, v: -1}, resets={x <= 0: {v: -v / 2}})
    run = fs.simulate(ball, [0.5, 0], t=(0, 9), stop=x <= 0)
    assert run(run.span[1]) == pytest.approx([0, 0.5], abs=1e-12)
    assert run.extremes("v") == pytest.approx((-1, 0.5), abs=1e-12)
    whole = fs.simulate(ball, [0.5, 0], t=(0, 9))
    (part,) = whole.select(between=(0, run.span[1]))
    assert part.end == pytest.approx(run.end, abs=0)
    assert part(run.span[1]) == pytest.approx([0, 0.5], abs=1e-12)
    assert run.dense_columns(run.span[1]) == pytest.approx([0, 0.5], abs=1e-12)
