"""What a trajectory answers."""

import pickle

import numpy as np
import pytest
import sympy as sp

from fastslow.errors import ArgumentError, UnknownNameError
from fastslow.model.model import Model
from fastslow.simulation.one import simulate
from fastslow.simulation.settings import Integration


@pytest.fixture(scope="module")
def run():
    x, v, w, t = sp.symbols("x v w t")
    D, b, c = sp.symbols("D b c")
    dead_zone = sp.Piecewise((x - D, x > D), (x + D, x < -D), (0, True))
    model = Model(
        {x: v, v: w - v - 40 * dead_zone},
        forcing={w: b + c * sp.sin(t / 10)},
        parameters={D: 0.25, b: 1, c: 3},
    )
    return simulate(model, [0, 0], periods=2)


def test_columns_by_name_and_symbol(run):
    assert run.columns == ("x", "v", "w")
    assert np.array_equal(run["x"], run[sp.Symbol("x")])
    assert run["x"].shape == run["w"].shape == run.t.shape
    assert np.abs(run["w"] - (1 + 3 * np.sin(run.t / 10))).max() < 1e-9
    with pytest.raises(UnknownNameError, match="unknown column 'q'"):
        run["q"]


def test_dense_output_shapes(run):
    times = np.linspace(*run.span, 7)
    assert run(times).shape == (2, 7)
    assert run(1.0).shape == (2,)
    assert run(times.reshape(7, 1)).shape == (2, 7, 1)
    assert run.dense_columns(times).shape == (3, 7)
    assert run(run.span[1]) == pytest.approx(run.end[1:], abs=1e-12)


@pytest.mark.parametrize("time", [-0.1, 1e6, np.nan])
def test_times_outside_the_run(run, time):
    with pytest.raises(ArgumentError, match="outside the run"):
        run(time)


def test_segments_cover_the_run(run):
    assert run.segments[0].start == run.span[0]
    assert run.segments[-1].end == run.span[1]
    for one, other in zip(run.segments[:-1], run.segments[1:], strict=True):
        assert one.end == other.start
        assert one.region != other.region
    assert len(run.segments) == len(run.crossings) + 1
    assert run.itinerary == tuple(s.region for s in run.segments)
    for crossing, segment in zip(run.crossings, run.segments[1:], strict=True):
        assert crossing.time == segment.start
        assert crossing.to_region == segment.region
        assert run(crossing.time) == pytest.approx(crossing.state, abs=1e-12)


def test_times_are_fine_enough_to_plot(run):
    assert np.all(np.diff(run.t) >= 0)
    assert run.t[0] == run.span[0]
    assert run.t[-1] == run.span[1]
    middle = 0.5 * (run.t[1:] + run.t[:-1])
    straight = 0.5 * (run["x"][1:] + run["x"][:-1])
    assert np.abs(run(middle)[0] - straight).max() < 5e-4 * np.ptp(run["x"])
    assert {c.time for c in run.crossings} <= set(run.t)


def test_regime_is_that_of_the_last_period(run):
    assert run.gap == ("S3", "S2", "S1")
    assert run.regime == "bilateral"


def test_pickle(run):
    assert len(run.t) > len(run.crossings)  # fills what is computed once
    again = pickle.loads(pickle.dumps(run))
    assert np.array_equal(again.t, run.t)
    assert again.itinerary == run.itinerary
    assert again.outcome == run.outcome
    assert [c.time for c in again.crossings] == [c.time for c in run.crossings]


def test_repr(run):
    text = repr(run)
    assert "Trajectory of x, v, w for t from 0 to 125.664" in text
    assert "regime bilateral" in text
    assert "end of the time" in text
    assert "x - D upwards, S2 → S1" in repr(run.crossings[0])


def test_without_dense_output():
    x = sp.Symbol("x")
    light = simulate(Model({x: -x}), [1], t=(0, 1), dense=False, samples=[0, 0.5, 1])
    assert light["x"] == pytest.approx(np.exp([0, -0.5, -1]), abs=1e-9)
    with pytest.raises(ArgumentError, match="has no dense output"):
        light(0.5)


def test_contact_statistics(run):
    assert sum(run.time_fractions.values()) == pytest.approx(1.0, abs=1e-12)
    assert set(run.time_fractions) == {"S1", "S2", "S3"}
    both = run.hits("x - D") + run.hits("x + D")
    assert both == len(run.crossings)
    assert run.hits("x - D", direction=1) + run.hits("x - D", direction=-1) == run.hits("x - D")
    with pytest.raises(UnknownNameError, match="unknown interface 'x-D'; did you mean 'x - D'"):
        run.hits("x-D")


def test_extremes_are_exact():
    x, v = sp.symbols("x v")
    swing = simulate(
        Model({x: v, v: -x}), [0.3, 0.4], t=(0, 7), integration=Integration(rtol=1e-13)
    )
    assert swing.extremes("x") == pytest.approx((-0.5, 0.5), abs=1e-12)
    assert swing.extremes("v") == pytest.approx((-0.5, 0.5), abs=1e-12)
    # from the last downward zero of x on: the minimum is not passed by again
    assert swing.extremes("x", since=6.9)[1] == pytest.approx(
        max(0.5 * np.cos([6.9 - np.arctan2(4, 3), 7 - np.arctan2(4, 3)])), abs=1e-12
    )
    with pytest.raises(UnknownNameError, match="unknown column"):
        swing.extremes("z")


def test_extremes_match_a_fine_table(run):
    table = run(np.linspace(*run.span, 200001))
    for name, values in zip("xv", table, strict=True):
        low, high = run.extremes(name)
        assert low <= values.min() + 1e-14
        assert high >= values.max() - 1e-14
        assert (low, high) == pytest.approx((values.min(), values.max()), abs=1e-6)
