"""Equilibria and diagrams do not depend on the units of states, parameter and time."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.continuation.location import branch_point
from fastslow.continuation.ordering import in_order
from fastslow.diagrams.field import FrozenField
from fastslow.diagrams.solve.exact_polynomials import real_roots
from fastslow.model.units import natural_units
from fastslow.results.points import stability_of
from tests.samples import WHOLE
from tests.unit_systems import PARAMETER, SYSTEMS, TIME, drawn, single

pytestmark = pytest.mark.slow

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
        words.append(found.completeness)
        for e in found:
            words.append((e.region, e.stability, e.type, e.admissible, e.continuum))
            numbers.append(place(e))
    diagram = fs.continue_equilibria(model, system.parameter, (low, high))
    words.append(diagram.completeness)
    for branch in diagram.branches:
        words.append([o.code for o in branch.outcomes])
        for p in branch.special:
            words.append((p.label, p.regions, p.type, p.criticality, p.converged))
            numbers.append(place(p))
    return words, np.array(numbers)


def compare(system, units, reference):
    words, numbers = read(system, units)
    assert words == reference[0], units
    size = np.abs(reference[1]).max(axis=0)
    assert np.all(np.abs(numbers - reference[1]) <= ACCURACY * size), units


@pytest.mark.sample(1)
@pytest.mark.parametrize("system", SYSTEMS, ids=lambda s: s.name)
def test_units_change_nothing(system):
    """All units at once, six decades to each side, and one of the factors alone."""
    reference = read(system, {})
    alone = single(system)
    generator = np.random.default_rng(7)
    several = drawn(system, 1), alone[generator.integers(len(alone))]
    for units in several if WHOLE else several[:1]:
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
            model = system.measured(factors).with_free(system.parameter)
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


@pytest.mark.sample(1)
@pytest.mark.parametrize("seed", range(2, 6))
def test_what_rounding_cannot_decide_is_no_equilibrium(seed):
    """At x = 1 to rounding, y < −20, the factor exp(100) hides that no rate vanishes."""
    (system,) = (s for s in SYSTEMS if s.name == "stirred tank")
    low, high = system.range()
    units = drawn(system, seed)
    model = system.measured(units)
    for part in PLACES:
        value = (low + part * (high - low)) / units[PARAMETER]
        assert len(fs.equilibria(model, {"p": value})) == 1


@pytest.mark.parametrize("unit", [1e-12, 1.0, 1e12])
def test_roots_are_real_in_any_unit(unit):
    """A double root, a simple one and a pair that is clearly complex."""
    roots = np.array([1.0, 1.0, -2.0, 0.5 + 0.1j, 0.5 - 0.1j])
    found = real_roots(np.real(np.poly(unit * roots)))
    assert found == pytest.approx([-2 * unit, unit, unit], rel=1e-6)
    # what is far away is a root too
    assert real_roots(np.array([1e-18, 1.0, 1.0])) == pytest.approx([-1e18, -1.0])


def test_points_are_in_order_up_to_rounding():
    generator = np.random.default_rng(5)
    points = generator.integers(0, 3, (40, 3)).astype(float)
    points = np.unique(points, axis=0)[generator.permutation(len(np.unique(points, axis=0)))]
    for unit in 10.0 ** generator.uniform(-9, 9, (5, 3)):
        noisy = points * (1 + 1e-14 * generator.standard_normal(points.shape))
        noisy += 1e-14 * generator.standard_normal(points.shape)
        found = points[in_order(noisy * unit, unit)]
        assert found.tolist() == sorted(points.tolist())


@pytest.mark.parametrize("speed", [1e-12, 1.0, 1e12])
def test_no_branch_point_where_branches_do_not_meet(speed):
    """x' = p x − x³ + e has one where e = 0 only, however slow it is."""

    def curve(e):
        def rates(u):
            x, p = u
            value, slopes = p * x - x**3 + e, [p - 3 * x**2, x]
            return speed * np.array([value]), speed * np.array([slopes])

        return rates

    start, scale = np.array([0.01, 0.02]), np.ones(2)
    met = branch_point(curve(0.0), start, scale)
    assert met.converged
    assert np.abs(met.u).max() < 1e-14
    assert not branch_point(curve(1e-2), start, scale).converged


@pytest.mark.parametrize("unit", [1e-12, 1.0, 1e12])
def test_a_gap_is_listed_with_both_ends_in_any_unit(unit):
    """x' = p − (|x| − 1)₊ sign x: every |x| ≤ 1 is an equilibrium at p = 0."""
    x, p, u, r = sp.symbols("x p u r")
    contact = sp.Max(x - 1 / u, 0) + sp.Min(x + 1 / u, 0)
    model = fs.Model({x: (r * p - u * contact) / u}, parameters={p: 0, u: unit, r: 1 / unit})
    over = (-unit, 2 * unit)
    diagram = fs.continue_equilibria(model, "p", over)
    ends = diagram.at(p=0)
    assert [e.continuum for e in ends] == [True, True]
    assert [e["x"] * unit for e in ends] == pytest.approx([-1, 1], rel=1e-12)
    (only,) = diagram.at(p=unit)
    assert only["x"] * unit == pytest.approx(2, rel=1e-12)
    found = fs.equilibria(model, p=0)
    assert sorted(e["x"] * unit for e in found) == pytest.approx([-1, 1], rel=1e-12)


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_sticking_band_in_any_unit(unit):
    """A pendulum-like spring sinh(x) with dry friction 1/2 sticks where |sinh x − p| ≤ 1/2."""
    x, v, p, u = sp.symbols("x v p u")
    model = fs.Model(
        {x: v, v: (-sp.sinh(x * u) - sp.sign(v) / 2 + p) / u}, parameters={p: 0.3, u: unit}
    )
    (one,) = fs.equilibria(model).sets
    assert [one.lower[0] * unit, one.upper[0] * unit] == pytest.approx(
        [np.arcsinh(-0.2), np.arcsinh(0.8)], rel=1e-12
    )


@pytest.mark.sample(2)
@pytest.mark.parametrize("system", SYSTEMS, ids=lambda s: s.name)
def test_normal_forms_in_other_units(system):
    """Of eigenvectors of length one: a is measured in 1/(length · time), l₁ in 1/length²."""
    model = system.measured()
    # in a small unit rounding in the slopes of a state is no longer small
    units = dict.fromkeys(system.factors(), 1.0)
    units |= {f"unit_{model.states[-1]}": 1e-6, TIME: 1e3}
    sizes = np.array([units[f"unit_{s}"] for s in model.states])
    first, second = (
        fs.continue_equilibria(
            model.with_parameters(u), system.parameter, system.range(u)
        ).special()
        for u in ({}, units)
    )
    field = FrozenField(model.with_free(system.parameter), system.parameter)
    for one, other in zip(first, second, strict=True):
        if one.code not in ("LP", "HB"):
            continue
        u = np.append(one.state, one[system.parameter])
        region = field.regions.index(one.regions[0])
        values, vectors = np.linalg.eig(field.residual_and_jacobian(region, u)[1][:, : len(u) - 1])
        wanted = 1j * one.frequency if one.code == "HB" else 0.0
        vector = vectors[:, np.argmin(np.abs(values - wanted))]
        length = np.linalg.norm(vector / sizes) / np.linalg.norm(vector)
        if one.code == "LP":
            expected = abs(one.coefficient) * units[TIME] / length
            assert abs(other.coefficient) == pytest.approx(expected, rel=1e-6)
        else:
            assert other.frequency == pytest.approx(one.frequency * units[TIME], rel=1e-8)
            assert other.lyapunov == pytest.approx(one.lyapunov / length**2, rel=1e-6)
