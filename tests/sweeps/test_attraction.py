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
