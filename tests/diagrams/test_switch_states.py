"""Equilibria and branches in every state of hysteretic switches."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs

x, v, w, t, q, s, k, sigma, omega = sp.symbols("x v w t q s k sigma omega")


@pytest.fixture(scope="module")
def relay():
    """A state that a relay pulls by −k above x = 1, until it is below x = −1."""
    return fs.Model(
        {x: w - x - k * q},
        forcing={w: 2 * sp.cos(omega * t)},
        parameters={k: 2, omega: 0.01},
        switches={q: (x > 1, x < -1)},
    )


@pytest.fixture(scope="module")
def diagram(relay):
    return fs.continue_equilibria(relay.frozen(), "w", (-2.5, 2.5))


@pytest.mark.parametrize(("load", "free", "pulled"), [(0.5, True, False), (1.5, False, True)])
def test_an_equilibrium_beyond_its_threshold_is_virtual(relay, load, free, pulled):
    found = fs.equilibria(relay.frozen(), w=load, virtual=True)
    assert found.completeness == "complete"
    by_region = {e.region: e for e in found}
    assert by_region["S1 (q = 0)"]["x"] == load
    assert by_region["S1 (q = 0)"].admissible == free
    assert by_region["S1 (q = 1)"]["x"] == load - 2
    assert by_region["S1 (q = 1)"].admissible == pulled
    (one,) = fs.equilibria(relay.frozen(), w=load)
    assert one.region == ("S1 (q = 0)" if free else "S1 (q = 1)")


def test_branches_end_at_the_thresholds(diagram):
    assert diagram.completeness == "complete"
    assert [b.regions for b in diagram] == [("S1 (q = 0)",), ("S1 (q = 1)",)]
    assert [b.range for b in diagram] == [(-2.5, 1.0), (1.0, 2.5)]
    on, off = diagram.special("BE")
    assert (on.label, on.interface, on["x"]) == ("BE1", "x = 1 (q → 1)", 1)
    assert (off.label, off.interface, off["x"]) == ("BE2", "x = -1 (q → 0)", -1)
    assert on.at_switch
    assert not on.at_wall
    assert on.type is None
    assert diagram["BE1"]["w"] == pytest.approx(1, abs=1e-14)
    assert {o.code for b in diagram for o in b.outcomes} == {"end of range", "switch"}
    assert [e.region for e in diagram.at(w=0)] == ["S1 (q = 0)"]
    # no side is beyond a threshold
    assert diagram.interface_values["x = 1 (q → 1)"] == ("x", 1.0)


def test_the_threshold_in_two_parameters(diagram):
    curve = fs.continue_points(diagram["BE2"], ("w", "k"), over={"w": (-1, 3), "k": (1, 3)})
    assert np.abs(curve["w"] - curve["k"] + 1).max() < 1e-13


def test_two_switches_have_four_states():
    model = fs.Model(
        {x: w - x + q + 10 * s},
        parameters={w: 0},
        switches={q: (x > 5, x < 4), s: (x < -5, x > 50)},
    )
    found = fs.equilibria(model)
    assert [(e["x"], e.region) for e in found] == [
        (0, "S1 (q = 0, s = 0)"),
        (11, "S1 (q = 1, s = 1)"),
    ]


def test_a_wall_in_one_state_of_a_switch():
    model = fs.Model(
        {x: v, v: w + 3 * q - x - v},
        parameters={w: 0},
        resets={x >= 1: {v: -v / 2}},
        switches={q: (2 * x > 1, x < -5)},
    )
    found = fs.equilibria(model)
    assert [(e["x"], e.region) for e in found] == [
        (0, "S1 (q = 0)"),
        (1, "S1 (q = 1) at rest on x = 1"),
    ]


def test_a_threshold_of_the_slow_quantity():
    model = fs.Model(
        {x: w - x + q}, forcing={w: sp.sin(t / 100)}, switches={q: (w > 0.5, w < -0.5)}
    )
    diagram = fs.continue_equilibria(model.frozen(), "w", (-1, 1))
    assert [b.range for b in diagram] == [(-1, 0.5), (-0.5, 1)]


def test_an_overlay_follows_the_branches_of_both_states(relay, diagram):
    run = fs.simulate(relay, {"x": 0, "q": 0}, periods=1)
    overlay = fs.overlay(diagram, run)
    off, on = overlay.transitions
    assert [off.special_equilibrium.label, on.special_equilibrium.label] == ["BE2", "BE1"]
    assert (on.from_branch, on.to_branch) == ("S1 (q = 0)", "S1 (q = 1)")
    assert {off.type, on.type} == {"switch"}
    assert "at the threshold x = 1 (q → 1)" in on.note
    assert on.law is None
    assert on.delay > 0
    with pytest.raises(fs.ArgumentError, match="threshold of a switch"):
        fs.predict_delay(diagram["BE1"], 0.01)


def test_points_are_traced_in_a_constant_state(relay):
    point = {"x": 0, "w": 0}
    with pytest.raises(fs.ModelError, match="with_switches"):
        fs.continue_equilibria(relay.frozen(), "w", (-2, 2), from_points=[point])
    fixed = relay.frozen().with_switches(q=0)
    assert len(fs.continue_equilibria(fixed, "w", (-2, 2), from_points=[point])) == 1


def test_diagrams_are_kept_in_files(diagram, tmp_path):
    diagram.save(tmp_path / "relay.npz")
    assert fs.load(tmp_path / "relay.npz") == diagram
