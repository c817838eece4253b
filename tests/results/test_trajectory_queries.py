"""What a trajectory answers at a value, in a part, and near a point: against closed forms."""

import pickle
import time
from itertools import pairwise

import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

import fastslow as fs

pytestmark = pytest.mark.slow

x, v, w, t = sp.symbols("x v w t")

#: x = cos t, v = −sin t.
SWING = fs.Model({x: v, v: -x}, interfaces={"right": x - sp.Rational(1, 2)})


@pytest.fixture(scope="module")
def swing():
    return fs.simulate(SWING, [1, 0], t=(0, 10), integration=fs.Integration(rtol=1e-14))


@pytest.fixture(scope="module")
def few():
    """The same without dense output, on samples a twentieth apart."""
    return fs.simulate(SWING, [1, 0], t=(0, 10), dense=False, samples=np.linspace(0, 10, 201))


@pytest.fixture(scope="module")
def forced():
    """Three periods of a forced dead zone: crossings of two interfaces, a slow quantity."""
    D = sp.Symbol("D")
    zone = sp.Piecewise((x - D, x > D), (x + D, x < -D), (0, True))
    model = fs.Model(
        {x: v, v: w - v - 40 * zone},
        forcing={w: 3 * sp.sin(t / 10)},
        parameters={D: 0.25},
    )
    return fs.simulate(model, [0, 0], periods=3)


def times_of(moments):
    return [moment.time for moment in moments]


def test_a_value_is_passed_at_known_times(swing):
    expected = [np.pi / 3, 5 * np.pi / 3, 7 * np.pi / 3]
    found = swing.at(x=0.5)
    assert times_of(found) == pytest.approx(expected, abs=1e-12)
    assert [m["x"] for m in found] == pytest.approx([0.5] * 3, abs=1e-14)
    assert [m["v"] for m in found] == pytest.approx(-np.sin(expected), abs=1e-12)
    assert not any(m.interpolated or m.resting for m in found)
    assert times_of(swing.at(x=0.5, direction=1)) == times_of(found)[1:2]
    assert swing.at(x=0.5, direction=0) == []


def test_a_region_is_asked_for(swing):
    assert swing.regions == ("S1", "S2")
    right = swing.at(v=0.0, region=swing[0].region)
    assert times_of(right) == pytest.approx([0, 2 * np.pi], abs=1e-12)
    with pytest.raises(fs.UnknownNameError, match="unknown region 'S9'"):
        swing.at(v=0.0, region="S9")


def test_a_touch_and_the_start_count_once(swing):
    # the top is known to the root of rounding only
    assert times_of(swing.at(x=1.0)) == pytest.approx([0, 2 * np.pi], abs=1e-6)
    assert times_of(swing.at(x=-1.0, direction=0)) == pytest.approx([np.pi, 3 * np.pi], abs=1e-6)
    assert times_of(swing.at(v=0.0)) == pytest.approx(np.pi * np.arange(4), abs=1e-12)


def test_the_end_counts_though_it_misses_by_rounding():
    run = fs.simulate(SWING, [1, 0], t=(0, 1.5 * np.pi), integration=fs.Integration(rtol=1e-14))
    assert times_of(run.at(x=0.0)) == pytest.approx([np.pi / 2, 1.5 * np.pi], abs=1e-12)
    value = run[-1]["x"]
    assert times_of(run.at(x=value))[-1] == pytest.approx(run.span[1], abs=1e-12)
    # 1e-9 before the zero is no rounding
    short = fs.simulate(
        SWING, [1, 0], t=(0, 1.5 * np.pi - 1e-9), integration=fs.Integration(rtol=1e-14)
    )
    assert times_of(short.at(x=0.0)) == pytest.approx([np.pi / 2], abs=1e-12)


def test_what_decays_is_never_zero():
    run = fs.simulate(fs.Model({x: -x}), [1e-14], t=(0, 1))
    assert 0 < run.end[1] < 1e-14
    with pytest.raises(fs.ArgumentError, match="x = 0 is outside this run's range"):
        run.at(x=0.0)


def test_a_level_at_a_step_counts_once(swing):
    for start in swing.steps[1:-1, 0]:
        level = swing(start)[0]
        same = np.abs(np.array(times_of(swing.at(x=level))) - start) < 1e-9
        assert same.sum() == 1


def test_a_rest_gives_its_two_ends():
    run = fs.simulate(fs.Model({x: -sp.sign(x)}), [1.0], t=(0, 3))
    first, last = run.at(x=0.0)
    assert (first.time, last.time) == pytest.approx((1, 3), abs=1e-12)
    assert first.resting
    assert last.resting
    assert first.region == "S1|S2"
    still = fs.simulate(fs.Model({x: 0 * x}), [2.0], t=(0, 3))
    assert times_of(still.at(x=2.0)) == [0.0, 3.0]


@pytest.mark.parametrize(("name", "value"), [("x", 1.5), ("t", 11), ("t", -0.1)])
def test_outside_the_range(swing, few, name, value):
    for run in (swing, few):
        with pytest.raises(fs.ArgumentError, match="is outside this run's range"):
            run.at(**{name: value})


def test_one_column_at_a_time(swing):
    with pytest.raises(fs.ArgumentError, match="a value of one of x, v, t, received x, v"):
        swing.at(x=0, v=0)
    with pytest.raises(fs.ArgumentError, match="received none"):
        swing.at()


def test_without_dense_output_it_is_interpolated(few):
    found = few.at(x=0.5)
    # chords of a circle, a twentieth apart, are off by h²/8
    assert times_of(found) == pytest.approx(np.pi / 3 * np.array([1, 5, 7]), abs=4e-4)
    assert all(m.interpolated for m in found)
    (sample,) = few.at(t=few.t[40])
    assert not sample.interpolated
    assert np.array_equal(sample.state, [few["x"][40], few["v"][40]])
    (between,) = few.at(t=2.03)
    assert between.interpolated
    assert between["x"] == pytest.approx(np.cos(2.03), abs=4e-4)
    assert times_of(few.at(x=1.0)) == [0.0]


def test_a_moment_has_names(forced):
    (moment,) = forced.at(t=30)
    assert moment["w"] == moment.slow["w"] == pytest.approx(3 * np.sin(3), abs=1e-9)
    assert (moment["t"], moment["D"]) == (30, 0.25)
    assert np.array_equal(moment.state, forced(30))
    assert np.isnan(moment.value)
    with pytest.raises(fs.UnknownNameError, match="unknown state, slow quantity or parameter 'q'"):
        moment["q"]
    again = fs.simulate(SWING, [0.3, 0.4], t=(moment.time, 31))
    assert again.span[0] == 30


def test_a_moment_is_kept_in_a_file(forced, tmp_path, same):
    forced[7].save(tmp_path / "moment.npz")
    assert same(fs.load(tmp_path / "moment.npz"), forced[7])


@settings(max_examples=40, deadline=None)
@given(part=st.floats(0, 1))
def test_a_moment_is_the_run_then(forced, part):
    when = part * forced.span[1]
    (moment,) = forced.at(t=when)
    assert moment.time == when
    assert np.array_equal(moment.state, forced(when))
    assert moment.region in {s.region for s in forced.segments if s.start <= when <= s.end}


@settings(max_examples=40, deadline=None)
@given(level=st.floats(-3, 3))
def test_a_slow_quantity_is_passed_as_often_as_its_law(forced, level):
    found = times_of(forced.at(w=level))
    rise = 10 * np.arcsin(level / 3)
    period = 20 * np.pi
    near = np.concatenate(
        [rise + period * np.arange(-1, 5), 10 * np.pi - rise + period * np.arange(-1, 5)]
    )
    # at the top two passages are one, and an end is on the level to rounding
    for when in found:
        assert np.abs(near - when).min() < 1e-5
    inside = near[(near > 1e-4) & (near < forced.span[1] - 1e-4)]
    for when in inside:
        assert np.abs(np.array(found) - when).min() < 1e-5
    assert np.all(np.diff(found) > 0)


@settings(max_examples=40, deadline=None)
@given(cuts=st.lists(st.floats(0.01, 0.99), min_size=1, max_size=4))
def test_parts_joined_are_the_whole(forced, cuts):
    edges = sorted({0.0, *(c * forced.span[1] for c in cuts), forced.span[1]})
    parts = [forced.select(between=pair)[0] for pair in pairwise(edges)]
    assert [p.span for p in parts] == list(pairwise(edges))
    for part in parts:
        times = np.linspace(*part.span, 23)
        assert part.dense_columns(times) == pytest.approx(forced.dense_columns(times), abs=1e-12)
        assert part.end == pytest.approx([part.span[1], *forced(part.span[1])], abs=1e-12)
        assert part.segments[0].start == part.span[0]
        assert part.segments[-1].end == part.span[1]
    crossed = {c.time for part in parts for c in part.crossings}
    assert crossed == {c.time for c in forced.crossings}
    assert parts[-1].outcome == forced.outcome
    assert parts[0].outcome.code == "cut"
    for name, whole in forced.time_fractions.items():
        joined = sum(p.time_fractions[name] * (p.span[1] - p.span[0]) for p in parts)
        assert joined == pytest.approx(whole * forced.span[1], abs=1e-9)


@settings(max_examples=40, deadline=None)
@given(data=st.data())
def test_slices_joined_are_the_samples(forced, data):
    middle = data.draw(st.integers(1, len(forced) - 1))
    one, other = forced[:middle], forced[middle:]
    for name in ("t", "x", "w"):
        assert np.array_equal(np.append(one[name], other[name]), forced[name])
    for part in (one, other):
        assert part.span == (part.t[0], part.t[-1])
        near = 0.3 * part.span[0] + 0.7 * part.span[1]
        assert part(near) == pytest.approx(forced(near), abs=1e-12)


def test_stays_in_a_region(forced):
    stays = forced.select(region="S2")
    assert [s.span for s in stays] == [
        (s.start, s.end) for s in forced.segments if s.region == "S2"
    ]
    for stay in stays:
        assert stay.itinerary == ("S2",)
        # those that begin and end it
        inner = {forced.span[0], forced.span[1]}
        assert {c.time for c in stay.crossings} == set(stay.span) - inner
    assert forced.select() == (forced,)
    assert forced.select(between=(1e6, 2e6)) == ()
    half = forced.select(region="S2", between=(0, forced.span[1] / 2))
    assert half[-1].span[1] <= forced.span[1] / 2


def test_a_part_is_saved_drawn_and_asked(forced, tmp_path, same):
    (part,) = forced.select(between=(7.5, 81.25))
    part.save(tmp_path / "part.npz")
    assert same(fs.load(tmp_path / "part.npz"), part)
    assert same(pickle.loads(pickle.dumps(part)), part)
    assert part.hits("x - D") == forced.hits("x - D", since=7.5, until=81.25)
    assert part.extremes("x") == pytest.approx(
        forced.extremes("x", since=7.5, until=81.25), abs=1e-12
    )
    assert times_of(part.at(x=0.1)) == pytest.approx(
        [s for s in times_of(forced.at(x=0.1)) if 7.5 <= s <= 81.25], abs=1e-12
    )
    assert "cut to t from 7.5 to 81.25 of a run from 0 to 188.496" in repr(part)


def test_parts_of_samples(few):
    (part,) = few.select(between=(1.02, 2.98))
    assert part.span == (few.t[21], few.t[59])
    assert np.array_equal(part["x"], few["x"][21:60])
    assert few.select(between=(1.01, 1.02)) == ()
    assert few[3:5].at(t=few.t[3])[0]["x"] == few["x"][3]


def test_samples_of_a_dense_run_are_kept():
    run = fs.simulate(SWING, [1, 0], t=(0, 10), samples=[0, 2, 4, 8])
    (part,) = run.select(between=(1, 8))
    assert part.t.tolist() == [1, 2, 4, 8]
    assert part["x"] == pytest.approx(np.cos(part.t), abs=1e-9)
    assert part(5.0) == pytest.approx(run(5.0), abs=1e-12)
    # the samples are few, the series is looked at
    assert run.nearest(x=0, v=1).time == pytest.approx(1.5 * np.pi, abs=1e-9)


def test_one_sample(swing):
    one = swing[5:6]
    assert (len(one), one.span[0]) == (1, one.span[1])
    assert one(one.span[0]) == pytest.approx(swing[5].state)
    assert one.itinerary == (swing[5].region,)
    assert times_of(one.at(x=one["x"][0])) == times_of(one.at(t=one.span[0])) == [one.span[0]]
    assert one.nearest(x=3).time == one.span[0]
    assert list(one.to_dict()["region"]) == [swing[5].region]


@pytest.mark.parametrize("dense", [True, False])
def test_no_samples(dense):
    none = fs.simulate(SWING, [1, 0], t=(0, 10), dense=dense, samples=[])
    assert list(none) == []
    with pytest.raises(fs.ArgumentError, match="contain none of the 0 samples"):
        none[0:1]
    if dense:
        assert none.at(t=1.0)[0]["x"] == pytest.approx(np.cos(1), abs=1e-9)
        return
    assert none.select(between=(1, 2)) == ()
    for question in (lambda: none.at(x=0.5), lambda: none.at(t=1), lambda: none.nearest(x=0)):
        with pytest.raises(fs.ArgumentError, match="has no samples and no dense output"):
            question()


def test_a_run_without_a_step():
    none = fs.simulate(fs.Model({x: 1 / x}), [0.0], t=(0, 1))
    assert times_of(none.at(x=0.0)) == times_of(none.at(t=0.0)) == times_of(none) == [0.0]
    assert none.select(region="S1") == ()


def test_samples_by_number(swing):
    assert swing[0].time == 0
    assert swing[-1].time == 10
    moments = list(swing)
    assert times_of(moments) == swing.t.tolist()
    assert [m["v"] for m in moments] == swing["v"].tolist()
    assert len(np.array(swing[:40])) == 40
    with pytest.raises(fs.OutOfRangeError, match="no sample 100000"):
        swing[100000]
    with pytest.raises(
        fs.ArgumentError, match="a trajectory is sliced with a step of 1, received 2"
    ):
        swing[::2]
    with pytest.raises(fs.ArgumentError, match="contain none of the"):
        swing[5:5]


@settings(max_examples=40, deadline=None)
@given(angle=st.floats(0.1, 6.1))
def test_a_point_of_the_run_is_its_own_nearest(swing, angle):
    (whole,) = swing.select(between=(0, 2 * np.pi))
    found = whole.nearest(x=np.cos(angle), v=-np.sin(angle))
    assert found.time == pytest.approx(angle, abs=1e-9)


@settings(max_examples=40, deadline=None)
@given(place=st.tuples(st.floats(-1, 1), st.floats(-3, 3)))
def test_no_moment_is_nearer(forced, place):
    found = forced.nearest(x=place[0], w=place[1])
    scale = np.ptp(forced["x"]), np.ptp(forced["w"])

    def distance(one, other):
        return np.hypot((one - place[0]) / scale[0], (other - place[1]) / scale[1])

    columns = forced.dense_columns(np.linspace(*forced.span, 200_001))
    nearest = distance(columns[0], columns[2]).min()
    assert distance(found["x"], found["w"]) <= nearest + 1e-12


def test_nearest_in_one_column(swing):
    assert swing.nearest(t=4.4).time == pytest.approx(4.4, abs=1e-14)
    assert swing.nearest(x=7)["x"] == pytest.approx(1, abs=1e-12)
    with pytest.raises(fs.ArgumentError, match="expected values of some of x, v, t"):
        swing.nearest()


def test_the_nearest_copy_of_an_angle():
    """Turned by t and asked modulo a turn: at every turn, and at one time where t is asked too."""
    turning = fs.simulate(fs.Model({x: 1, v: -v}, periodic={x: 2}), [0, 1], t=(0, 9.3))
    assert turning.nearest(x=-1.6)["x"] % 2 == pytest.approx(0.4, abs=1e-12)
    assert turning.nearest(x=0.4, t=6.5).time == pytest.approx(6.4, abs=0.05)
    assert turning.nearest(x=0.4, v=0).time == pytest.approx(8.4, abs=1e-2)


def test_nearest_without_dense_output(few):
    found = few.nearest(x=np.cos(2.02), v=-np.sin(2.02), t=2)
    assert found.time == pytest.approx(2.02, abs=1e-2)
    assert found.interpolated


def test_crossings_of_an_interface(forced):
    up = forced.crossings("x - D", direction=1)
    assert [c.time for c in up] == [
        c.time for c in forced.crossings if c.interface == "x - D" and c.direction == 1
    ]
    assert len(up) == forced.hits("x - D", direction=1) > 0
    assert forced.crossings(direction=1)("x - D") == up
    assert isinstance(forced.crossings, tuple)
    assert pickle.loads(pickle.dumps(up)).interfaces == forced.interfaces
    with pytest.raises(fs.UnknownNameError, match="did you mean 'x - D'"):
        forced.crossings("x-D")
    with pytest.raises(fs.ArgumentError, match="direction = 2; expected -1, 0, 1 or None"):
        forced.crossings(direction=2)


def test_a_million_samples_answer_at_once():
    many = fs.simulate(SWING, [1, 0], t=(0, 1e5), integration=fs.Integration(rtol=1e-9))
    assert len(many) > 1_000_000
    many.at(t=1.0)
    begin = time.process_time()
    for k in range(100):
        many.at(t=1000.0 * k)
    # a tenth of this on an idle machine
    assert (time.process_time() - begin) / 100 < 1e-2
    assert len(many.at(x=0.25)) == 2 * int(1e5 / (2 * np.pi)) + 1
