"""Starts on an interface, rest, and runs that cannot go on."""

import math

import numpy as np
import pytest
import sympy as sp
from scipy.linalg import expm

from fastslow.model.model import Model
from fastslow.simulation.one import simulate
from fastslow.simulation.settings import Integration

x, v, y = sp.symbols("x v y")


@pytest.fixture
def unloaded(gear):
    return gear.with_parameters(B=0, C=0)


@pytest.mark.parametrize(
    ("state", "word"),
    [
        ([0.25, -0.1], ("S2",)),
        ([0.25, 0.1], ("S1", "S2")),
        ([-0.25, 0.1], ("S2",)),
        ([-0.25, -0.1], ("S3", "S2")),
    ],
)
def test_start_on_an_interface(unloaded, state, word):
    run = simulate(unloaded, state, t=(0, 5))
    assert run.outcome
    assert run.itinerary == word
    assert len(run.crossings) == len(word) - 1


@pytest.mark.parametrize("start", [0.25, -0.25, 0.0, 0.1])
def test_rest_in_the_closed_gap(unloaded, start):
    run = simulate(unloaded, [start, 0], t=(0, 1e4))
    assert run.outcome
    assert len(run.steps) < 10
    assert not run.crossings
    assert run(1e4) == pytest.approx([start, 0], abs=0)


@pytest.mark.parametrize("load", [1e-12, -1e-12])
def test_tiny_drift_from_a_corner(gear, load):
    run = simulate(
        gear.with_parameters(B=load, C=0), [0.25, 0], t=(0, 20), integration=Integration(rtol=1e-13)
    )
    assert run.itinerary[0] == ("S1" if load > 0 else "S2")
    if load < 0:
        # x = D + w (t - 1 + exp(-t)) in the gap
        expected = 0.25 + load * (20 - 1 + math.exp(-20))
        assert run(20.0)[0] == pytest.approx(expected, abs=1e-14)


@pytest.mark.parametrize("drift", [1e-3, 1e-25, -1e-25, -1e-3])
def test_a_start_on_an_interface_counts_to_the_side_that_it_drifts_to(drift):
    """However slowly: far below the rounding of x = 1."""
    model = Model({x: drift}, interfaces={"one": x - 1})
    run = simulate(model, [1], t=(0, 1))
    assert run.itinerary == simulate(model, [2 if drift > 0 else 0], t=(0, 1)).itinerary
    assert not run.crossings


@pytest.mark.parametrize("load", [1e-13, 1e-14, 1e-15, 1e-16, 1e-18])
def test_a_continuous_model_always_goes_on(gear, load):
    # contacts of the size of rounding: which ones is anyone's guess, but the state keeps to tol
    run = simulate(gear.with_parameters(B=load, C=0), [0.25, 0], t=(0, 1000))
    assert run.outcome
    assert run.end[1] == pytest.approx(0.25, abs=1e-8)


def test_a_corner_left_when_the_load_changes_sign(gear):
    # at rest on the corner; the load is zero at first and then pulls into the gap
    model = gear.with_parameters(B=0, C=-1e-3)
    run = simulate(model, [0.25, 0], t=(0, 300))
    assert run.outcome
    assert run.itinerary == ("S2",)


def test_accumulating_crossings_end_the_run():
    model = Model({x: v, v: -sp.sign(x) - sp.sign(v) / 2})
    run = simulate(model, [1, 0], t=(0, 30))
    assert run.outcome.code in ("accumulation", "not decided")
    # from x = a the force 1/2 brings x to 0 in sqrt(4 a) at speed sqrt(a), the force 3/2
    # stops it after sqrt(4 a / 9) at -a / 3: a geometric series of swings
    limit = (2 + 2 / 3) / (1 - 3**-0.5)
    assert run.span[1] == pytest.approx(limit, abs=1e-9)
    assert np.abs(run.end[1:]).max() < 1e-9


@pytest.mark.parametrize("few", [Integration(max_crossings=5000), Integration(max_steps=5000)])
def test_a_motion_that_winds_towards_a_fused_focus_is_named(few):
    """The energy |x| + v²/2 of x'' = -v - sign(x) decays, and turns take 8 v with v the largest."""
    run = simulate(Model({x: v, v: -v - sp.sign(x)}), [1, 0], t=(0, 400), integration=few)
    assert not run.outcome
    (note,) = run.outcome.notes
    assert "ever more frequent" in note
    assert "fused focus near" in note
    # v² decays by 2 v³/3 · 2 in a turn of four quarters: v = 3/(2 k) after k half turns
    assert np.abs(run.end[1:]).max() == pytest.approx(1.5 / 5000, rel=0.1)
    # as many crossings at a constant frequency
    even = simulate(Model({x: v, v: -sp.sign(x)}), [1, 0], t=(0, 4e4), integration=few)
    assert not even.outcome
    assert not even.outcome.notes


def test_a_stiff_stop_takes_few_steps():
    """A stop of stiffness 10⁶ on linear motions, in closed form from crossing to crossing."""
    stiff = 1e6
    model = Model({x: v, v: -v / 20 - x - stiff * sp.Max(0, x - 1)})
    run = simulate(model, [0, 3], t=(0, 60))
    assert run.outcome
    assert len(run.steps) < 400
    time, state, beyond = 0.0, np.array([0.0, 3.0]), False
    for crossing in run.crossings:
        # about the equilibrium of each side
        centre = stiff / (1 + stiff) if beyond else 0.0
        matrix = np.array([[0, 1], [-1 - stiff * beyond, -0.05]])
        moved = expm(matrix * (crossing.time - time)) @ (state - [centre, 0]) + [centre, 0]
        assert moved == pytest.approx(crossing.state, abs=1e-9)
        time, state, beyond = crossing.time, crossing.state, not beyond
    assert len(run.crossings) > 10


def test_blow_up():
    run = simulate(Model({x: x**2}), [1], t=(0, 3))
    assert run.outcome.code == "blow-up"
    assert run.span[1] == pytest.approx(1.0, abs=1e-10)
    assert run(0.5) == pytest.approx([2.0], rel=1e-10)


def test_singular_rates_end_the_run():
    # x = (1 - 3 t / 2)**(2/3)
    run = simulate(Model({x: -1 / sp.sqrt(x)}), [1], t=(0, 3))
    assert run.outcome.code == "singular"
    assert run.span[1] == pytest.approx(2 / 3, abs=1e-8)


def test_a_series_that_ends_does_not_leave_its_domain():
    # x = (1 - t/2)**2 until t = 2, and a polynomial: all later coefficients are zero
    run = simulate(Model({x: -sp.sqrt(x)}), [1], t=(0, 3))
    assert run(1.5) == pytest.approx([0.0625], abs=1e-10)
    assert run.end[1] == pytest.approx(0, abs=1e-7)


def test_not_finite_at_the_start():
    run = simulate(Model({x: -sp.log(x)}), [-1], t=(0, 1))
    assert run.outcome.code == "not finite at start"
    assert run.span == (0.0, 0.0)
    assert not len(run.steps)


def test_limits_return_what_was_computed(gear):
    run = simulate(gear, [0, 0], periods=3, integration=Integration(max_crossings=5), samples=1000)
    assert run.outcome.code == "too many crossings"
    assert len(run.crossings) == 5
    assert run.t[-1] <= run.span[1] < 600 * math.pi
    run = simulate(gear, [0, 0], periods=3, integration=Integration(max_steps=50))
    assert run.outcome.code == "too many steps"
    assert len(run.steps) == 50
    assert np.isfinite(run(run.span[1])).all()


def test_what_began_large_has_not_blown_up():
    """From 10⁵ the state may grow to 10¹¹, whatever the other one is."""
    model = Model({x: x, y: -y})
    few = Integration(max_steps=6)
    run = simulate(model, [1e5, 0], t=(0, 1000), integration=few)
    assert 1e7 < run["x"][-1] < 1e11
    assert run.outcome.code == "too many steps"
    more = simulate(model, [1e5, 0], t=(0, 1000), integration=Integration(max_steps=60))
    assert more.outcome.code == "blow-up"


def test_interface_that_depends_on_the_state_nonlinearly():
    # a rotation leaves the circle |z| < 1 nowhere and meets x y = 1/4 where sin 2 t = 1/2
    model = Model({x: -y, y: x}, interfaces={"hyperbola": x * y - sp.Rational(1, 4)})
    run = simulate(model, [1, 0], t=(0, 3), integration=Integration(rtol=1e-13))
    assert [c.time for c in run.crossings] == pytest.approx(
        [math.pi / 12, 5 * math.pi / 12], abs=1e-13
    )
    assert all(abs(c.state[0] * c.state[1] - 0.25) < 1e-16 for c in run.crossings)


def test_interface_that_depends_on_time():
    t = sp.Symbol("t")
    square = sp.Piecewise((1, sp.sin(t) > 0), (-1, True))
    run = simulate(Model({x: square}), [0], t=(1, 10), integration=Integration(rtol=1e-12))
    assert [c.time for c in run.crossings] == pytest.approx(
        [math.pi, 2 * math.pi, 3 * math.pi], abs=1e-12
    )
    assert run(2 * math.pi) == pytest.approx([-1.0], abs=1e-12)


def test_sliding_into_a_second_interface_slides_on_both():
    field = {x: -sp.sign(x), y: -sp.sign(y)}
    run = simulate(Model(field), [1, 2], t=(0, 5))
    assert run.outcome
    assert run.itinerary == ("S1", "S1|S3", "S1|S4")
    assert run(1.5) == pytest.approx([0.0, 0.5], abs=1e-12)
    assert run(5.0).tolist() == [0.0, 0.0]


def test_a_start_that_every_side_attracts_to_a_corner():
    run = simulate(Model({x: -sp.sign(x), y: -sp.sign(y)}), [0, 0], t=(0, 5))
    assert run.outcome
    assert run.itinerary == ("S1|S4",)
    assert run(5.0).tolist() == [0.0, 0.0]


def test_a_region_without_rates_is_not_passed_over():
    # beyond x = 0 the rates are not defined, and the region before must not go on there
    beyond = 1 + x * sp.log(-1 - x)
    run = simulate(Model({x: sp.Piecewise((beyond, x > 0), (1, True))}), [-1], t=(0, 2))
    assert not run.outcome
    assert run.span[1] == pytest.approx(1.0, abs=1e-9)
