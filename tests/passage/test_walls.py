"""Overlays of runs with impacts: contact, lift-off and jumps at walls."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs

x, v, w, t, k, c, r, sigma, a, omega = sp.symbols("x v w t k c r sigma a omega")


@pytest.fixture(scope="module")
def pushed():
    """A mass on a spring pushed slowly against a stop at kσ = 2, and off again."""
    model = fs.Model(
        {x: v, v: w - k * x - c * v},
        forcing={w: 1.5 - 1.5 * sp.cos(omega * t)},
        parameters={k: 2, c: 0.8, r: 0.5, sigma: 1, omega: 0.01},
        resets={x >= sigma: {v: -r * v}},
    )
    diagram = fs.continue_equilibria(model.frozen(), "w", (-0.5, 3.5))
    return fs.overlay(diagram, fs.simulate(model, [0, 0], periods=1))


@pytest.fixture(scope="module")
def snapping():
    """A mass on a spring of negative stiffness that jumps to a stop and off again."""
    model = fs.Model(
        {x: v, v: a * x - x**3 - c * v - w},
        forcing={w: sp.cos(omega * t) / 2},
        parameters={c: 0.6, r: 0.6, sigma: 0.5, a: 1, omega: 0.003},
        resets={x >= sigma: {v: -r * v}},
    )
    diagram = fs.continue_equilibria(model.frozen(), "w", (-0.6, 0.6))
    return fs.overlay(diagram, fs.simulate(model, [-1.2, 0], periods=1))


def test_contact_and_lift_off_are_named(pushed):
    made, lost = pushed.transitions
    held = "S1 at rest on x = sigma"
    assert (made.from_branch, made.to_branch) == ("S1", held)
    assert (lost.from_branch, lost.to_branch) == (held, "S1")
    assert {made.type, lost.type} == {"crossing"}
    assert made.special_equilibrium.label == lost.special_equilibrium.label == "BE1"
    # at rest after the lag and the impacts
    assert made.time == pushed.run.segments[1].start
    assert 0 < made.delay < 0.05
    # no delay of the lift-off, at λ = 0
    assert lost.value == pytest.approx(2, abs=1e-9)
    assert lost.time == pushed.run.segments[2].start
    assert made.law is None
    assert lost.law is None
    assert [p.type for p in pushed.phases] == ["quasi-static"]


def test_the_state_on_the_wall_has_no_distance(pushed):
    resting = np.array(["at rest" in name for name in pushed.run.regions_at(pushed.t)])
    assert resting.any()
    assert pushed.distance[resting].max() < 1e-12


def test_a_jump_at_a_non_smooth_fold_begins_at_zero_contact_force(snapping):
    # impacts on landing are no excursions
    up, down = snapping.transitions
    assert (up.type, up.special_equilibrium.code) == ("jump", "LP")
    assert (down.type, down.special_equilibrium.type) == ("jump", "non-smooth fold")
    assert down.leave.value == pytest.approx(0.375, abs=1e-9)
    assert down.delay > 0
    assert down.law is None


def test_no_delay_is_predicted_at_a_wall(pushed):
    (point,) = pushed.diagram.special("BE")
    with pytest.raises(fs.ArgumentError, match="as soon as the contact force vanishes"):
        fs.predict_delay(point, 0.01)


def test_walls_of_diagram_and_run_must_agree(pushed):
    model = fs.Model({x: v, v: w - 2 * x - 0.8 * v}, forcing={w: sp.sin(t / 100)})
    free = fs.continue_equilibria(model.frozen(), "w", (-2, 4))
    with pytest.raises(fs.ArgumentError, match=r"walls of the diagram are none.*x = sigma"):
        fs.overlay(free, pushed.run)


def test_kicked_runs_are_refused():
    model = fs.Model(
        {x: w - x}, forcing={w: sp.sin(t / 100)}, resets={sp.Eq(sp.Mod(t, 5), 0): {x: x + 1}}
    )
    run = fs.simulate(model, [0], t=(0, 20))
    free = fs.Model({x: w - x}, forcing={w: sp.sin(t / 100)})
    diagram = fs.continue_equilibria(free.frozen(), "w", (-1, 1))
    with pytest.raises(fs.ArgumentError, match="kicked at instants"):
        fs.overlay(diagram, run)


def test_walls_are_hatched(snapping):
    drawn = fs.plot.overlay(snapping, "x")
    hatched = [f for f in drawn.diagram.bands.fills if f.get_hatch()]
    assert len(hatched) == 1
    assert hatched[0].get_y() == 0.5


def test_a_gap_between_walls_is_crossed_without_bifurcation():
    gear = fs.systems.rigid_gear(omega=0.01)
    diagram = fs.continue_equilibria(gear.frozen(), "w", (-2, 7))
    run = fs.simulate(gear, [0.25, 0], periods=1)
    overlay = fs.overlay(diagram, run)
    assert [t.type for t in overlay.transitions] == ["gap crossing", "gap crossing"]
    first = overlay.transitions[0]
    free = run.segments[1]
    assert (first.leave.time, first.land.time) == (free.start, free.end)
    # it lifts off at zero torque
    assert first.leave.value == pytest.approx(0, abs=1e-9)
    assert first.law is None
