"""Polynomial regions in several unknowns: every equilibrium, and what is said about it."""

import itertools
import random
from fractions import Fraction

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.continuation.polynomial_systems import solve_polynomials
from fastslow.diagrams.field import FrozenField
from fastslow.diagrams.solve.critical import _exact_roots, critical_values
from fastslow.diagrams.solve.linear_unknowns import reduced
from fastslow.diagrams.solve.motion_equations import region_equations
from tests.campaigns import polynomial_systems
from tests.campaigns.polynomial_systems import campaign

pytestmark = pytest.mark.slow

x, y, z, p, q = sp.symbols("x y z p q")


def test_a_sample_of_the_campaign_of_random_systems():
    counts = campaign(3, seed=20).counts
    assert sum(c.systems for c in counts.values()) == 3
    for found in counts.values():
        assert (found.missing_claimed, found.false, found.duplicated) == (0, 0, 0), found.faults
    assert counts[2].claimed >= 2


def test_three_states_with_cubic_rates_and_a_corner(monkeypatch):
    """Before the elimination of p, 12 of 19 such diagrams were complete, some after 81 s."""
    monkeypatch.setattr(polynomial_systems, "VALUES", polynomial_systems.VALUES[:1])
    (counts,) = campaign(1, seed=1, states="cubics").counts.values()
    assert (counts.missing_claimed, counts.false, counts.duplicated) == (0, 0, 0), counts.faults
    assert counts.claimed == 1


@pytest.mark.parametrize(
    "system",
    [
        [{(2, 0, 0): 1, (0, 1, 0): 1, (0, 0, 1): -1}, {(1, 0, 0): 1, (0, 1, 0): -1}],
        [{(1, 0, 1): 2, (0, 1, 0): 3, (0, 0, 1): 5}, {(3, 0, 0): 1, (0, 2, 0): -1, (0, 0, 0): 4}],
    ],
)
@pytest.mark.parametrize("bent", [False, True])
def test_elimination_of_linear_unknowns_keeps_the_zero_set(system, bent):
    """Solutions of the reduced equations, with the value of the last unknown, solve the system."""
    u = sp.symbols("u0:3")
    third = {(1, 1, 0): 1, (0, 1, 1): -2, (0, 0, 0): 3}
    whole = [*system, third]
    found = reduced(whole, 3, bent=bent)

    def poly(terms, symbols):
        return sum(
            sp.Rational(c.numerator, c.denominator)
            * sp.prod([s**k for s, k in zip(symbols, e, strict=True)])
            for e, c in terms.items()
        )

    kept = [u[k] for k in found.kept]
    left = sp.groebner([poly(q, kept) for q in found.equations] or [0], *kept, domain="QQ")
    ideal = sp.groebner([poly(q, u) for q in whole], *u, domain="QQ")
    assert all(ideal.contains(g) for g in left.exprs)
    assert ideal.contains(sp.expand(u[2] - poly(found.last, kept)))
    # in (2 x + 5) p + 3 y only y has a number as coefficient, and its value is not affine
    assert len(found.kept) < 3 or (not bent and (1, 0, 1) in system[0])


def test_ranges_of_functions_leave_out_solutions_outside_only():
    """x² + y² = 25 and x y = 12 at (±3, ±4) and (±4, ±3), with the values ±7 of x + y."""
    circle = {(2, 0): 1, (0, 2): 1, (0, 0): -25}
    hyperbola = {(1, 1): 1, (0, 0): -12}
    total = {(1, 0): 1, (0, 1): 1}
    everything = solve_polynomials([circle, hyperbola])
    above = solve_polynomials([circle, hyperbola], within=[(total, 0.0, 100.0)])
    assert everything.complete
    assert above.complete
    assert len(everything.simple) == 4
    inside = [s for s in above.simple.tolist() if sum(s) >= 0]
    assert inside == [[3.0, 4.0], [4.0, 3.0]]


@pytest.mark.parametrize("n", [2, 3])
def test_products_of_linear_factors_have_all_their_roots(n):
    """Roots on a grid, moved by a random linear map: known exactly, some of them close."""
    generator = random.Random(n)
    for _ in range(10):
        places = [sorted(generator.sample(range(-40, 40), 3 if n == 2 else 2)) for _ in range(n)]
        matrix = np.array([[generator.randint(-3, 3) for _ in range(n)] for _ in range(n)])
        matrix += 7 * np.eye(n, dtype=int)
        symbols = sp.symbols(f"u:{n}")
        equations = []
        for k in range(n):
            line = sum(int(matrix[k, m]) * symbols[m] for m in range(n))
            poly = sp.Poly(sp.prod([line - r for r in places[k]]), *symbols)
            equations.append({e: Fraction(int(c)) for e, c in poly.terms()})
        found = solve_polynomials(equations)
        expected = [np.linalg.solve(matrix, r) for r in itertools.product(*places)]
        assert found.complete
        assert len(found.simple) == len(expected)
        for point in expected:
            assert np.abs(found.simple - point).max(axis=1).min() < 1e-11


@pytest.mark.parametrize("seed", range(4))
def test_units_over_twelve_decades_change_nothing(seed):
    generator = random.Random(seed)
    equations = [
        {e: Fraction(generator.randint(-9, 9) or 1) for e in itertools.product(range(3), repeat=2)}
        for _ in range(2)
    ]
    plain = solve_polynomials(equations)
    units = [Fraction(10) ** generator.choice((-12, -5, 7, 12)) for _ in range(2)]
    scaled = [
        {e: c / units[0] ** e[0] / units[1] ** e[1] for e, c in terms.items()}
        for terms in equations
    ]
    moved = solve_polynomials(scaled)
    assert plain.complete
    assert moved.complete
    back = moved.simple / np.array([float(u) for u in units])
    order = np.lexsort(back.T[::-1])
    assert np.allclose(back[order], plain.simple, rtol=1e-9, atol=1e-12)


def test_a_double_root_is_a_cluster_and_a_common_factor_is_not_complete():
    circle = {(2, 0): Fraction(1), (0, 2): Fraction(1), (0, 0): Fraction(-1)}
    tangent = {(0, 1): Fraction(1), (0, 0): Fraction(-1)}
    double = solve_polynomials([circle, tangent])
    assert double.complete
    assert len(double.simple) == 0
    assert len(double.clusters) == 1
    assert np.abs(double.clusters[0].mean(axis=0) - [0, 1]).max() < 1e-6
    line = {(1, 1): Fraction(1), (1, 0): Fraction(-1)}
    assert not solve_polynomials([line, {(2, 0): Fraction(1), (1, 1): Fraction(1)}]).complete


def test_a_planar_diagram_with_an_isola_is_complete():
    """x² + (p − 0.3)² = 1e-4, y² = 1 + x: two closed curves 0.02 long in the parameter."""
    rates = {x: 10000 * (x**2 + (p - sp.Rational(3, 10)) ** 2) - 1 + x * (y**2 - 1 - x)}
    model = fs.Model({**rates, y: y**2 - 1 - x}, parameters={p: 0})
    diagram = fs.continue_equilibria(model, "p", (-1, 1))
    assert diagram.completeness == "complete"
    assert len(diagram.branches) == 2
    assert all(branch.closed for branch in diagram.branches)


def test_a_predator_and_its_prey_have_the_same_equilibria_in_any_unit():
    """Saturation and self-limitation (Bazykin 1998), the unit of both species from 1 to 10⁶."""
    first = None
    for unit in (1, 10, 1000, 10**6):
        rates = {
            x: x * (1 - x / (10 * unit)) - x * y / (2 * unit + x),
            y: y * (2 * x / (2 * unit + x) - sp.Rational(1, 2) - y / (100 * unit)),
        }
        found = fs.equilibria(fs.Model(rates, parameters={p: 0}))
        states = np.array([e.state for e in found]) / unit
        first = states if first is None else first
        assert len(first) >= 3
        assert len(states) == len(first)
        for state in first:
            assert np.abs(states - state).max(axis=1).min() < 1e-9


#: Planar systems of the campaign, each with its difficulty.
PLANAR = {
    "equilibria beyond the window next to a pole": (
        "3*p*x*y/4 - 5*x*y/4 - 2*x - 1/2",
        "8*p**2*x/9 - p**2*y**2/3 + 8*p**2*y/5 - 2*p*x + 9*p*y**2/7 + 2*p*y + 3*x/4 + 3*y**2/5"
        " - 8*y/3 - 1/2",
    ),
    "a fold at 5000 times the size of the other equilibria": (
        "-8*p**2*y**2 - 2*p**2*y/9 - p*x**2/3 - p*x*y - 3*p*x + 3*p*y**2/5 + 3*p*y/7 + 3*p/7"
        " - x**2/8 + 7*x*y/5 + 3*x/8 + 9*y**2/4 + y/3 + 13/3",
        "7*p*x*y/6 + 3*x*y/5 + 20/9",
    ),
    "equations of different size at an interface": (
        "-p**2/4 - 10**-5*p*y/3 + p/6 - 6*10**5*x - 10**-5*y/8 + 4/9 + 2*Abs(10**5*x - 6/7)",
        "4*10**5*p**2*x + 5*10**-5*p**2*y/3 - 9*10**5*p*x/7 + 8*10**-5*p*y/3 + 8*p/3"
        " + 2*10**5*x/3 - 10**-5*y/4 + 23/8",
    ),
}


@pytest.mark.sample(2)
@pytest.mark.parametrize("rates", PLANAR.values(), ids=PLANAR.keys())
def test_planar_diagrams_with_poles_are_complete_and_have_each_branch_once(rates):
    first, second = (sp.sympify(r, locals={"y": y, "x": x, "p": p}, rational=True) for r in rates)
    scales = (sp.Rational(1, 10**5), 10**5) if first.has(sp.Abs) else (1, 1)
    model = fs.Model({x: scales[0] * first, y: scales[1] * second}, parameters={p: 0})
    diagram = fs.continue_equilibria(model, "p", (-2, 2))
    assert diagram.completeness == "complete"
    assert not diagram.unexplained
    for value in (-1.6180339, -0.4142135, 0.3183098, 1.259921):
        listed = np.array([e.state for e in fs.equilibria(model, p=value)])
        drawn = np.array([e.state for e in diagram.at(p=value)])
        assert len(drawn) == len(listed)
        size = np.abs(listed).max(axis=0)
        for state in listed:
            assert (np.abs(drawn - state) / size).max(axis=1).min() < 1e-9


def test_a_hyperbola_and_a_circle_meet_between_two_critical_values():
    """x y = p touches x² + y² = 4 at p = ±2, and meets it in four points between."""
    model = fs.Model({x: x**2 + y**2 - 4, y: x * y - p}, parameters={p: 0})
    (equations,) = region_equations(FrozenField(model, "p"))
    assert critical_values(equations, -3, 3) == pytest.approx([-2, 2], abs=1e-12)
    assert critical_values(equations, -3, 1) == pytest.approx([-2], abs=1e-12)
    assert critical_values(equations, -1, 1) == []


def test_exact_roots_that_nearly_meet_are_in_different_intervals():
    near = sp.Rational(1, 3) + sp.Rational(1, 10**6)
    polynomial = sp.expand((p - 1) * (p + 1) ** 2 * (3 * p - 1) * (p - near))
    ends = np.array(_exact_roots([polynomial], p, -2.0, 2.0))
    for root in (-1.0, 1.0 / 3.0, float(near), 1.0):
        assert np.abs(ends - root).min() < 4e-9
    assert np.any((ends > 1.0 / 3.0 + 1e-8) & (ends < float(near)))
    # an exact root in the middle of the range, one at its end, and none
    assert _exact_roots([p * (p - 2)], p, -2.0, 2.0) == [0.0, 2.0]
    assert _exact_roots([p**2 + 1], p, -2.0, 2.0) == []
