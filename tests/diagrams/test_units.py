"""Equilibria and diagrams do not depend on the units of states, parameter and time."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.model.units import natural_units
from fastslow.results.points import stability_of
from tests.unit_systems import PARAMETER, SOLVED, SYSTEMS, drawn, single

#: Relative to the largest value of the same quantity at the points compared.
ACCURACY = 1e-9

#: Values of the parameter, as fractions of the range, at which equilibria are compared.
PLACES = (0.13, 0.5, 0.81)


def read(system, units):
    """What is reported in some units, as words and as numbers in the original units."""
    model = system.measured().with_parameters(units)
    sizes = np.array([units.get(f"unit_{s}", 1.0) for s in model.states])
    factor = units.get(PARAMETER, 1.0)
    low, high = system.range(units)
    words, numbers = [], []

    def place(point):
        return np.append(point.state * sizes, point.parameters[system.parameter] * factor)

    for part in PLACES:
        found = fs.equilibria(model, {system.parameter: low + part * (high - low)})
        words.append(found.coverage)
        for e in found:
            words.append((e.region, e.stability, e.type, e.admissible, e.continuum))
            numbers.append(place(e))
    diagram = fs.continue_equilibria(model, system.parameter, (low, high))
    words.append(diagram.coverage)
    for branch in diagram.branches:
        words.append([o.code for o in branch.outcomes])
        for p in branch.special:
            words.append((p.label, p.regions, p.subtype, p.criticality, p.converged))
            numbers.append(place(p))
    return words, np.array(numbers)


def compare(system, units, reference):
    words, numbers = read(system, units)
    assert words == reference[0], units
    size = np.abs(reference[1]).max(axis=0)
    assert np.all(np.abs(numbers - reference[1]) <= ACCURACY * size), units


@pytest.mark.parametrize("system", SOLVED, ids=lambda s: s.name)
def test_units_change_nothing(system):
    """All units at once, six decades to each side, and one of the factors alone."""
    reference = read(system, {})
    alone = single(system)
    generator = np.random.default_rng(7)
    for units in (drawn(system, 1), alone[generator.integers(len(alone))]):
        compare(system, units, reference)


@pytest.mark.parametrize("s", [1e-4, 1.0, 10.0, 1e4])
def test_predator_and_prey_in_any_unit(s):
    """Zero, prey alone at K, and coexistence at x = d h/(c − d), y = r (1 − x/K)(h + x)/a."""
    x, y, k, h, d = sp.symbols("x y K h d")
    model = fs.Model(
        {x: x * (1 - x / k) - x * y / (h + x), y: x * y / (h + x) / s - d * y},
        parameters={k: 10 * s, h: 2 * s, d: 0.5 / s},
    )
    found = sorted(tuple(e.state / s) for e in fs.equilibria(model))
    assert np.allclose(found, [(0, 0), (2, 3.2), (10, 0)], rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("speed", [1e-12, 1.0, 1e12])
def test_stability_does_not_depend_on_the_unit_of_time(speed):
    x, v = sp.symbols("x v")
    model = fs.Model({x: speed * (x - x**3)})
    assert [e.stability for e in fs.equilibria(model)] == ["stable", "unstable", "stable"]
    planar = fs.Model({x: speed * v, v: speed * (-x - v)})
    assert [e.type for e in fs.equilibria(planar)] == ["focus"]


@pytest.mark.parametrize("speed", [1e-12, 1.0, 1e12])
def test_a_fold_is_neutral_in_any_unit_of_time(speed):
    x, p = sp.symbols("x p")
    diagram = fs.continue_equilibria(
        fs.Model({x: speed * (p + x - x**3)}, parameters={p: 0}), "p", (-1, 1)
    )
    branch = diagram.branches[0]
    assert [f["p"] for f in diagram.folds] == pytest.approx([2 / 27**0.5, -2 / 27**0.5], rel=1e-14)
    assert [str(stability_of(f.eigenvalues)) for f in diagram.folds] == ["neutral"] * 2
    assert set(branch.stability.tolist()) == {"stable", "unstable", "neutral"}


def test_natural_units_follow_a_change_of_units():
    generator = np.random.default_rng(3)
    for system in SYSTEMS:
        units = drawn(system, int(generator.integers(1000)))
        found = []
        for factors in ({}, units):
            model = system.measured(factors).freed(system.parameter)
            names = (*model.states, system.parameter)
            functions = [i.function for i in model.interfaces.values()]
            found.append(natural_units(names, model.regions.values(), functions, model.values))
        for name, unit in found[0].items():
            factor = units[PARAMETER if name == system.parameter else f"unit_{name}"]
            ratio = found[1][name] * factor / unit
            # a quantity that the equations leave open has no unit of its own
            assert 0.49 < ratio < 2.01 or found[0][name] == found[1][name] == 1.0, (
                system.name,
                name,
            )


def test_natural_units_of_a_saturated_rate():
    x = sp.Symbol("x")
    model = fs.Model({x: 1e3 * sp.tanh(x / 50) - x})
    # least of (log x − log 1000)²/2 + (log x − log 50)²
    expected = 1000 ** (1 / 3) * 50 ** (2 / 3)
    found = natural_units(["x"], model.regions.values(), [], {})
    assert found["x"] == 2.0 ** round(np.log2(expected)) == 128.0
