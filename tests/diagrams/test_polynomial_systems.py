"""Polynomial regions in several unknowns: every equilibrium, and what is said about it."""

import itertools
import random
from fractions import Fraction

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.continuation.polynomial_systems import solve_polynomials
from tests.campaigns.polynomial_systems import campaign

x, y, z, p, q = sp.symbols("x y z p q")


def test_a_sample_of_the_campaign_of_random_systems():
    counts = campaign(8, seed=20).counts
    assert sum(c.systems for c in counts.values()) == 8
    for found in counts.values():
        assert (found.missing_claimed, found.false, found.duplicated) == (0, 0, 0), found.faults
    assert counts[2].claimed >= 3


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
    assert diagram.coverage == "complete"
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
