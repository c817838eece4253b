"""Initial states of attractors: their number, and those of switches."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs

pytestmark = pytest.mark.slow


def test_switches_begin_in_both_states_and_in_no_other():
    """In the band of a relay that never changes, each of its states has its own equilibrium."""
    x, q = sp.symbols("x q")
    relay = fs.Model({x: 2 * q - 1 - x}, switches={q: (x > 10, x < -10)})
    found = fs.attractors(relay, {x: (-2, 2)}, 24)
    assert found.outcome.code == "settled"
    assert sorted(set(np.round(found.ends[:, 0], 6))) == [-1, 1]
    assert len(found) == 2


def test_the_number_of_initial_states():
    x = sp.Symbol("x")
    assert fs.attractors(fs.Model({x: -x}), {x: (-2, 2)}).starts.shape == (200, 1)


def test_runs_to_equilibria_that_are_not_isolated_are_named():
    """Every point of the line x = 0 is an equilibrium."""
    x, y = sp.symbols("x y")
    found = fs.attractors(fs.Model({x: -x, y: 0 * y}), {x: (-2, 2), y: (-2, 2)}, 4)
    assert found.outcome.code == "not settled"
    assert len(found) == 0
    assert "an equilibrium that is not isolated" in str(found.outcome)


def test_trajectories_that_end_early_say_why():
    """Where two discontinuities meet that do not add up, no sliding motion is defined."""
    x, y = sp.symbols("x y")
    a, b = sp.sign(x), sp.sign(y)
    relays = fs.Model({x: 1 - 2 * a + a * b, y: sp.Rational(3, 10) - 2 * b - a * b / 2})
    box = {x: (-1, 1), y: (-1, 1)}
    found = fs.attractors(relays, box, 4)
    why = "at x = 0 and y = 0 the rates are not a sum of one jump for each interface"
    assert why in str(found.outcome)
    assert found.early.tolist() == ["not decided"] * 4
    assert "none of these: 100.0%, ended early: not decided 100.0%" in repr(found)
    coarse = fs.Refinement(cells=(2, 2), levels=1)
    assert fs.basins(relays, box, known=found, refinement=coarse).labels == ("not decided",)


def test_the_basin_of_a_blow_up():
    """x' = x² − x attracts to 0 below 1, and grows without bound above."""
    x, y = sp.symbols("x y")
    model = fs.Model({x: x**2 - x, y: -y})
    found = fs.attractors(model, {x: (-1, 3), y: (-1, 1)}, 12)
    above = found.starts[:, 0] > 1
    assert 0 < above.sum() < 12
    assert ((found.early != "") == above).all()
    assert ((found.assigned == -1) == above).all()
    (code,) = {*found.early[above]}
    assert f"{code}: " in str(found.outcome)
    coarse = fs.Refinement(cells=(2, 2), levels=1)
    plane = fs.basins(model, {x: (-1, 3.2), y: (-1, 1)}, known=found, refinement=coarse)
    assert (plane.at(0.1, 0.1), plane.at(3.2, 1)) == ("A1", code)
