"""Leavings and landings: where, when, and what is responsible."""

from dataclasses import replace

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.passage.overlay.transitions import OverlaidRun
from fastslow.passage.slow_quantities import slow_quantity

pytestmark = pytest.mark.slow

x, v, w, t, omega = sp.symbols("x v w t omega")


def laid(model, parameter, over, start, **span):
    diagram = fs.continue_equilibria(model.frozen(), parameter, over=over)
    return fs.overlay(diagram, fs.simulate(model, start, **span))


def test_lag_of_a_linear_model():
    """x' = w − x with w = t/100 settles on x = w − 1/100: one time unit behind."""
    model = fs.Model({x: w - x}, forcing={w: t / 100})
    overlay = laid(model, "w", (-1, 5), [-0.01], t=(0, 400), samples=200)
    assert overlay.lag == pytest.approx(np.ones(200), abs=1e-6)
    assert overlay.relaxation == pytest.approx(np.ones(len(overlay.t)), abs=1e-12)
    assert overlay.distance * overlay.extent[0] == pytest.approx(
        np.full(len(overlay.t), 0.01), abs=1e-8
    )
    assert overlay.shares() == {"S1": pytest.approx(1.0)}
    assert "median lag 1" in overlay.summary()


@pytest.fixture(scope="module")
def steep():
    """x = 3w + tanh(20w), followed with relaxation time 1: no fold, slope 23 at w = 0."""
    model = fs.Model(
        {x: 3 * w + sp.tanh(20 * w) - x},
        forcing={w: sp.sin(omega * t)},
        parameters={omega: 0.05},
    )
    return model, fs.continue_equilibria(model.frozen(), "w", over=(-1.1, 1.1))


def test_a_steep_slope_is_no_bifurcation(steep):
    model, diagram = steep
    overlay = fs.overlay(diagram, fs.simulate(model, [0.0], periods=2))
    assert {t_.type for t_ in overlay.transitions} == {"steep"}
    assert len(overlay.transitions) == 3
    assert overlay.bursting is None
    for t_ in overlay.transitions:
        assert t_.special is None
        assert np.isnan(t_.delay)
        assert t_.from_branch == t_.to_branch == "S1"
        # |dX/dw| |dw/dt| / |λ| is 23 · 0.05 at w = 0, between two samples
        assert 0.9 < t_.steepness / (23 * 0.05 / overlay.extent[0]) <= 1
        assert t_.leave.time < t_.time < t_.land.time
        assert abs(t_.value) < 0.1
    assert "no bifurcation: the predicted lag" in overlay.summary()


def test_the_same_slope_taken_slowly_is_followed(steep):
    model, diagram = steep
    slow = model.with_parameters(omega=0.01)
    overlay = fs.overlay(diagram, fs.simulate(slow, [0.0], periods=1))
    assert overlay.transitions == ()
    assert [p.type for p in overlay.phases] == ["quasi-static"]


def test_the_gap_is_crossed_as_the_crossings_say(gear):
    overlay = laid(gear, "w", (-2, 6.5), [0, 0], periods=3)
    p = gear.parameters
    slope = p["omega"] * np.sqrt(p["C"] ** 2 - p["B"] ** 2)
    for t_ in overlay.transitions:
        out, reached = (
            [c for c in overlay.run.crossings if c.time <= t_.time][-1],
            next(c for c in overlay.run.crossings if c.time > t_.time),
        )
        assert (t_.leave.time, t_.land.time) == (out.time, reached.time)
        assert t_.duration == pytest.approx(reached.time - out.time, rel=1e-12)
        load = [p["B"] + p["C"] * np.sin(p["omega"] * c.time) for c in (out, reached)]
        assert t_.width == pytest.approx(abs(load[1] - load[0]), rel=1e-9)
        assert t_.slope == pytest.approx(slope, rel=1e-10)
        # crossing takes √(4D/s) + 1 and 2√(Ds) + s, as the slope goes to zero
        assert t_.duration == pytest.approx(np.sqrt(4 * p["D"] / slope) + 1, rel=0.03)
        assert t_.width == pytest.approx(2 * np.sqrt(p["D"] * slope) + slope, rel=0.06)
    text = overlay.summary()
    assert "the diagram has no fold" in text
    assert "no bifurcation: duration 7.112 (predicted 7.112), Δw = 0.1813 (predicted" in text
    assert overlay.bursting.name == "fast-slow oscillation across the gap, without bifurcation"
    assert {q.type for q in overlay.phases} == {"transient", "quasi-static", "gap crossing"}


def test_a_gap_entered_and_left_on_the_same_side(gear):
    """The load falls below zero for too short a time: the far side is not reached."""
    light = gear.with_parameters(B=0.5, C=0.6, D=0.5, omega=0.2)
    overlay = laid(light, "w", (-2, 2), [0.51, 0], periods=2)
    assert overlay.run.regime == "unilateral upper"
    for t_ in overlay.transitions:
        assert (t_.type, t_.from_branch, t_.to_branch) == ("excursion", "S1", "S1")
        assert t_.special.code == "BE"
        assert t_.note == "past the end of the branch and back"
        assert 0 < t_.delay < 0.1
        inside = overlay.run(np.linspace(t_.leave.time, t_.time + 1, 9))[0]
        assert np.all(np.abs(inside) < 0.5)
    assert [p.type for p in overlay.phases[:3]] == ["quasi-static", "excursion", "quasi-static"]
    assert overlay.bursting is None


def test_negative_stiffness_jumps_late_at_its_folds(folded_gear):
    """A < −D²: the delay falls as the 2/3 power of ε, here between two speeds."""
    delays = []
    diagram = None
    for speed in (0.002, 0.0005):
        model = folded_gear.with_parameters(B=0, C=0.3, omega=speed)
        diagram = diagram or fs.continue_equilibria(model.frozen(), "w", over=(-0.5, 0.5))
        overlay = fs.overlay(diagram, fs.simulate(model, [0.9, 0], periods=1))
        (jump,) = overlay.transitions
        assert jump.type == "jump"
        assert abs(jump.special["w"]) == pytest.approx(0.0894402097712473, abs=1e-13)
        expected = 0.3 * speed * np.sqrt(1 - (0.0894402097712473 / 0.3) ** 2)
        assert jump.slope == pytest.approx(expected, rel=1e-10)
        delays.append(jump.delay)
    assert np.log(delays[0] / delays[1]) / np.log(4) == pytest.approx(2 / 3, abs=0.05)


def test_a_persistent_boundary_equilibrium_is_passed_on():
    """x' = w − x − (x)₊: the slope of the branch changes at x = 0, the lag shows in the delay."""
    model = fs.Model({x: w - x - sp.Max(x, 0)}, forcing={w: sp.sin(t / 50)})
    # a little less than a period, whose end would be at w = 0 again
    overlay = laid(model, "w", (-1.2, 1.2), [-0.02], periods=0.99)
    assert [(t_.type, t_.from_branch, t_.to_branch) for t_ in overlay.transitions] == [
        ("crossing", "S2", "S1"),
        ("crossing", "S1", "S2"),
    ]
    for t_, crossing in zip(overlay.transitions, overlay.run.crossings, strict=True):
        assert t_.time == crossing.time
        assert t_.delay == pytest.approx(abs(np.sin(crossing.time / 50)), abs=1e-12)
        assert 0 < t_.delay < 0.03
    assert [p.type for p in overlay.phases] == ["quasi-static"]
    assert overlay.phases[0].stable_branches == ("S2", "S1")


def test_a_non_smooth_fold():
    """x' = w + |x| − x²/10: stable for x < 0 up to w = 0, where it meets the unstable x > 0."""
    law = (6 * sp.sin(t / 50) - 3) / 10
    model = fs.Model({x: w + sp.Abs(x) - x**2 / 10}, forcing={w: law})
    overlay = laid(model, "w", (-1.2, 1.2), [-0.3], periods=1)
    (jump,) = overlay.transitions
    assert (jump.type, jump.special.type) == ("jump", "non-smooth fold")
    assert 0 < jump.delay == pytest.approx(jump.value, abs=1e-12)
    assert jump.leave.time < jump.time < jump.land.time


def test_pseudo_equilibria_are_sheets():
    """x' = w − x/4 − sign x slides on x = 0 for |w| < 1."""
    model = fs.Model({x: w - sp.sign(x) - x / 4}, forcing={w: 3 * sp.sin(t / 100)})
    overlay = laid(model, "w", (-3.2, 3.2), [0.5], periods=2)
    order = ["S1|S2", "S1", "S1|S2", "S2", "S1|S2", "S1", "S1|S2", "S2", "S1|S2"]
    assert [
        overlay.transitions[0].from_branch,
        *(t_.to_branch for t_ in overlay.transitions),
    ] == order
    assert {t_.type for t_ in overlay.transitions} == {"crossing"}
    off = [t_ for t_ in overlay.transitions if t_.from_branch == "S1|S2"]
    assert all(t_.delay == 0.0 for t_ in off)
    sliding = overlay.followed == next(
        k for k, s in enumerate(overlay.stable_branches) if s.label == "S1|S2"
    )
    assert np.abs(overlay.state[sliding & (overlay.t > 2)]).max() < 1e-12


def test_a_pitchfork_is_left_late():
    """x' = w x − x³: past w = 0 the zero is left where ∫ w dt since the entry is made up for."""
    model = fs.Model({x: w * x - x**3}, forcing={w: sp.sin(t / 50)})
    overlay = laid(model, "w", (-1.2, 1.2), [0.1], periods=2)
    late = [t_ for t_ in overlay.transitions if t_.delay > 0.1]
    assert late
    assert {t_.special.code for t_ in late} == {"BP"}
    assert overlay.bursting is None


def test_a_short_unstable_stretch_is_followed_all_along():
    """Hopf points at w = ±1, passed too quickly for the oscillation to grow."""
    law = {x: v, v: (1 - x**2) * v / 10 - x + w}
    model = fs.Model(law, forcing={w: t / 20 - 2})
    overlay = laid(model, "w", (-2.1, 2.1), [-2, 0.05], t=(0, 80))
    (passage,) = overlay.transitions
    assert (passage.type, passage.special.code) == ("Hopf", "HB")
    assert "along its entire unstable part" in passage.note
    assert passage.special["w"] == pytest.approx(-1, abs=1e-9)
    assert passage.delay == pytest.approx(2, abs=1e-6)
    assert [p.type for p in overlay.phases] == ["quasi-static"]


def test_a_transition_is_where_two_thirds_of_the_way_are_done_even_after_landing():
    # a soft contact: the radius about the new branch is wider than the last third of the gap
    gear = fs.systems.harmonic_gear(A=13.8889, B=2.372, C=3.5455, D=0.1, omega=0.01)
    diagram = fs.continue_equilibria(gear.frozen(), "w", over=(-2, 6))
    overlay = fs.overlay(diagram, fs.simulate(gear, [0, 0], periods=1))
    down, up = (t for t in overlay.transitions if t.type == "gap crossing")
    for width, corner in ((down, 0.1), (up, -0.1)):
        (new,) = diagram.at(w=width.value, stable=True)
        way = (width.state[0] - corner) / (new["x"] - corner)
        assert way == pytest.approx(2 / 3, abs=1e-6)


def test_two_clearances_are_crossed_each_by_its_law():
    """Two bodies, one in a gap of half width 1/4 at w = 0, one in 1/2 at w = 1."""
    y, u = sp.symbols("y u")

    def contact(z, half):
        return 20 * sp.Piecewise((z - half, z > half), (z + half, z < -half), (0, True))

    rates = {
        x: v,
        v: w - v - contact(x, sp.Rational(1, 4)),
        y: u,
        u: w - 1 - u - contact(y, sp.Rational(1, 2)),
    }
    model = fs.Model(rates, forcing={w: 3 * sp.sin(t / 200)})
    overlay = laid(model, "w", (-3.2, 3.2), [0.2, 0, -0.5, 0], t=(0, 1500))
    # once the start is forgotten: the wide gap downwards, the narrow one twice, the wide one
    assert [(t_.from_branch, t_.to_branch) for t_ in overlay.transitions] == [
        ("S3", "S1"),
        ("S1", "S3"),
        ("S3", "S9"),
        ("S9", "S3"),
        ("S3", "S1"),
    ]
    for t_ in overlay.transitions:
        assert t_.type == "gap crossing"
        half = 0.5 if "S1" in (t_.from_branch, t_.to_branch) else 0.25
        speed = 3 / 200 * np.sqrt(1 - (t_.special["w"] / 3) ** 2)
        assert t_.slope == pytest.approx(speed, rel=1e-10)
        assert t_.duration == pytest.approx(np.sqrt(4 * half / speed) + 1, rel=0.03)
        assert t_.duration == pytest.approx(t_.law.duration, rel=1e-4)
    words = " ".join(overlay.bursting.evidence)
    assert "symmetric" not in words


def test_the_first_time_of_a_condition_is_found_to_rounding_in_few_evaluations():
    """x' = w − x passes 1/2 once, twice or at a jump of the condition."""
    model = fs.Model({x: w - x}, forcing={w: sp.sin(t / 10)})
    diagram = fs.continue_equilibria(model.frozen(), "w", over=(-1, 1))
    run = fs.simulate(model, [0.0], t=(0, 60))
    p = OverlaidRun(diagram, slow_quantity(diagram, run), None, (), None)
    count = 0

    def counted(condition):
        def over(slow, state):
            nonlocal count
            count += 1
            return condition(slow, state)

        return over

    found = p.first(0.0, 15.0, counted(lambda w, _: w - 0.5))
    assert found == pytest.approx(10 * np.arcsin(0.5), rel=1e-15)
    assert count <= 5
    # the first of three passages, and a condition that jumps
    assert p.first(0.0, 35.0, lambda w, _: np.abs(w) - 0.5) == pytest.approx(found, rel=1e-15)
    count = 0
    stepped = p.first(0.0, 15.0, counted(lambda w, _: np.where(w > 0.5, 1.0, -1.0)))
    assert stepped == pytest.approx(found, rel=1e-15)
    assert count <= 16


def test_a_branch_with_a_row_on_the_interface_is_followed_through_it():
    # a step of the branch ends at w = 1/2, where the equilibrium meets the interface
    y = sp.Symbol("y")
    on = sp.Piecewise((0, x > w), (1, True))
    model = fs.Model(
        {x: 5 - (1 - on) * y, y: 10 * ((1 - on) * x - y / 10)},
        forcing={w: 2 - sp.Rational(19, 10) * sp.cos(t / 200)},
    )
    diagram = fs.continue_equilibria(model.frozen(), "w", over=(0, 4))
    rows = np.column_stack([diagram[0].state, diagram[0].values])
    assert (np.abs(np.diff(rows, axis=0)).max(axis=1) == 0).sum() == 1
    overlay = fs.overlay(diagram, fs.simulate(model, [0.5, 5], periods=1))
    assert [one.type for one in overlay.transitions] == ["crossing"] * 2


def test_a_run_that_blows_up_is_measured_by_the_branches():
    """With u = x + w, u' = u² − 1 + 3/2 from u = −1 passes the unstable branch u = 1 at 2.702.

    The branch u = −1 is left before, and not shortly before the pole.
    """
    model = fs.Model({x: (x + w) ** 2 - 1}, forcing={w: 3 * t / 2})
    overlay = laid(model, "w", (-1, 30), [-1], t=(0, 25))
    assert overlay.run.outcome.code == "blow-up"
    (left,) = overlay.transitions
    assert left.type == "rate-induced"
    assert left.leave.time < 2 * np.arctan(2**0.5) * 2**0.5 == pytest.approx(2.702, abs=1e-3)
    assert overlay.shares()["S1"] < 0.7


def test_a_run_that_is_stopped_far_away_is_measured_by_the_branches():
    diagram, found = None, []
    model = fs.Model({x: x**2 + w}, forcing={w: t / 100 - 1})
    for height in (30, 3000):
        run = fs.simulate(model, [-1], t=(0, 300), stop=x - height)
        diagram = diagram or fs.continue_equilibria(model.frozen(), "w", (-2, 1))
        overlay = fs.overlay(diagram, run)
        found.append((overlay.extent[0], overlay.transitions[0].leave.time))
    assert found[0] == pytest.approx(found[1], rel=1e-5)
    assert found[0][0] < 4.0  # of the branches, x = ±(1 - w)**0.5 to w = -2


def test_a_non_smooth_fold_is_a_fold_in_the_summary():
    model = fs.Model({x: w - sp.Abs(x)}, forcing={w: sp.Rational(1, 5) - t / 100})
    overlay = laid(model, "w", (-0.2, 0.3), [0.2], t=(0, 24))
    assert "jump at BE1 (non-smooth fold)" in overlay.summary()
    assert "no fold" not in overlay.summary()
    (jump,) = overlay.transitions
    assert "delay 0 (" in replace(jump, delay=-0.0).description
