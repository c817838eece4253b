"""Overlays do not depend on the units of states, slow quantity and time."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from tests.unit_systems import PARAMETER, SYSTEMS, TIME, drawn

pytestmark = pytest.mark.slow

#: Ramps of the parameter: range and rate.
RAMPS = {"FitzHugh-Nagumo": (0.0, 1.2, 0.002), "folded gear": (-1.5, 1.5, 0.004)}


def passage(system, units):
    """Words and numbers of a slow passage in some units; numbers in the original ones."""
    low, high, rate = RAMPS[system.name]
    factor, time = units.get(PARAMETER, 1.0), units.get(TIME, 1.0)
    model = system.measured().with_parameters(units)
    diagram = fs.continue_equilibria(model, system.parameter, system.range(units))
    ramp = model.with_ramp(system.parameter, rate * time / factor, low / factor)
    (start,) = fs.equilibria(model, {system.parameter: low / factor})
    fine = fs.Integration(rtol=1e-11)
    span = (0, (high - low) / rate / time)
    run = fs.simulate(ramp, start.state, t=span, integration=fine)
    overlay = fs.overlay(diagram, run)
    words = [(t.type, t.from_branch, t.to_branch) for t in overlay.transitions]
    delays = [t.delay * factor for t in overlay.transitions if np.isfinite(t.delay)]
    delays += [t.law.delay * factor for t in overlay.transitions if t.law is not None]
    return (run.itinerary, words), [*delays, *overlay.shares().values()]


@pytest.mark.sample(1)
@pytest.mark.parametrize("name", RAMPS)
def test_units_change_no_overlay(name):
    (system,) = (s for s in SYSTEMS if s.name == name)
    words, numbers = passage(system, {})
    assert words[1]
    one = f"unit_{system.model.states[1]}"
    for units in (drawn(system, 4, decades=4), {one: 1e-6}, {TIME: 1e6, PARAMETER: 1e-6}):
        found = passage(system, units)
        assert found[0] == words, units
        # what the integration's error of 1e-11 grows to behind a Hopf point
        assert found[1] == pytest.approx(numbers, rel=1e-7), units


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
    assert hopf.type == "Hopf"
    assert hopf.delay > 0


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_exit_after_a_hopf_point_in_any_unit_of_the_parameter(unit):
    """Re λ = p/unit: the exit is as far behind p = 0 as the entry is before it."""
    x, y, p, u = sp.symbols("x y p u")
    grow, square = p / u, x**2 + y**2
    rates = {x: grow * x - y - x * square, y: x + grow * y - y * square}
    model = fs.Model(rates, parameters={p: 0, u: unit})
    diagram = fs.continue_equilibria(model, "p", over=(-2 * unit, 2 * unit))
    law = fs.predict_delay(diagram.special("HB")[0], 0.05 * unit, diagram=diagram, entry=-unit)
    assert law.value == pytest.approx(unit, rel=1e-12)
    assert law.decay == pytest.approx(10, rel=1e-12)


@pytest.mark.parametrize("unit", [1e-9, 1e9])
def test_a_point_of_another_diagram_is_refused_in_any_unit(unit):
    """Two Hopf points that are as far apart as they are from zero."""
    x, y, p, u = sp.symbols("x y p u")
    square, diagrams = x**2 + y**2, []
    for a in (1, sp.Rational(121, 100)):
        grow = a - (p / u) ** 2
        rates = {x: grow * x - y - x * square, y: x + grow * y - y * square}
        model = fs.Model(rates, parameters={p: 0, u: unit})
        diagrams.append(fs.continue_equilibria(model, "p", (-2 * unit, 2 * unit)))
    one, other = diagrams
    with pytest.raises(fs.ArgumentError, match="not a point of this diagram"):
        fs.predict_delay(one.special("HB")[1], -0.1 * unit, diagram=other, entry=-0.5 * unit)
