"""Overlays do not depend on the units of states, slow quantity and time."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from tests.unit_systems import PARAMETER, SYSTEMS, TIME, drawn

#: Ramps of the parameter: range and rate.
RAMPS = {"folded gear": (-1.5, 1.5, 0.004), "FitzHugh-Nagumo": (0.0, 1.2, 0.002)}


def passage(system, units):
    """Words and numbers of a slow passage in some units; numbers in the original ones."""
    low, high, rate = RAMPS[system.name]
    factor, time = units.get(PARAMETER, 1.0), units.get(TIME, 1.0)
    model = system.measured().with_parameters(units)
    diagram = fs.continue_equilibria(model, system.parameter, system.range(units))
    ramp = model.ramped(system.parameter, rate * time / factor, low / factor)
    (start,) = fs.equilibria(model, {system.parameter: low / factor})
    fine = fs.Integration(rtol=1e-11)
    span = (0, (high - low) / rate / time)
    run = fs.simulate(ramp, start.state, t=span, integration=fine)
    overlay = fs.overlay(diagram, run)
    words = [(t.kind, t.from_sheet, t.to_sheet) for t in overlay.transitions]
    delays = [t.delay * factor for t in overlay.transitions if np.isfinite(t.delay)]
    return (run.word, words), [*delays, *overlay.shares().values()]


@pytest.mark.parametrize("name", RAMPS)
def test_units_change_no_overlay(name):
    (system,) = (s for s in SYSTEMS if s.name == name)
    words, numbers = passage(system, {})
    assert words[1]
    one = f"unit_{system.model.states[1]}"
    for units in (drawn(system, 4, decades=4), {one: 1e-6}, {TIME: 1e6, PARAMETER: 1e-6}):
        found = passage(system, units)
        assert found[0] == words, units
        assert found[1] == pytest.approx(numbers, rel=2e-3), units


def test_a_state_that_is_constant_along_the_branch_has_its_extent_from_the_run():
    """x = 1 along the Brusselator's branch: its range there is rounding."""
    x, y, b, t = sp.symbols("x y B t")
    model = fs.Model(
        {x: 1 - (b + 1) * x + x**2 * y, y: b * x - x**2 * y}, forcing={b: 1.2 + t / 100}
    )
    diagram = fs.continue_equilibria(model.frozen(), "B", (1, 4))
    overlay = fs.overlay(diagram, fs.simulate(model, [1, 1.2], t=(0, 200)))
    assert min(overlay.extent) > 1
    (hopf,) = overlay.transitions
    assert hopf.kind == "Hopf"
    assert hopf.delay > 0
