"""Linear conserved quantities: found for random networks, named, and removed by reduction."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.errors import ArgumentError, ModelError
from fastslow.model.structure import real
from fastslow.symbolic.closed_forms.conserved import conserved_quantities

pytestmark = pytest.mark.slow

t = sp.Symbol("t")


def network(generator, *, open_one=False):
    """Random reactions among four to six species, with the matrix of their stoichiometry."""
    count = int(generator.integers(4, 7))
    xs = sp.symbols(f"x1:{count + 1}")
    rates = dict.fromkeys(xs, sp.S.Zero)
    parameters, columns = {}, []
    for k in range(int(generator.integers(2, 5))):
        sources = generator.choice(count, size=2, replace=False)
        targets = generator.choice(count, size=int(generator.integers(1, 3)), replace=False)
        rate, half = sp.symbols(f"k{k + 1} h{k + 1}")
        parameters |= {rate: 0.5 + k / 3, half: 1.5}
        flux = rate * sp.Mul(*(xs[s] for s in sources))
        if k == 0:
            # one reaction that saturates, so that rates are no polynomials
            flux /= half + xs[sources[0]]
        column = np.zeros(count, dtype=int)
        for s in sources:
            column[s] -= 1
        for s in targets:
            column[s] += 1
        columns.append(column)
        for x, c in zip(xs, column, strict=True):
            rates[x] += int(c) * flux
    if open_one:
        for x in xs:
            rates[x] += 1 - x
    return fs.Model(rates, parameters=parameters), np.array(columns).T


@pytest.mark.parametrize("seed", range(8))
def test_random_networks_have_those_of_their_stoichiometry(seed):
    model, matrix = network(np.random.default_rng(seed))
    found = conserved_quantities(model)
    states = [real(n) for n in model.states]
    assert len(found) == len(model.states) - np.linalg.matrix_rank(matrix)
    for one in found:
        weights = np.array([float(one.expression.coeff(s)) for s in states])
        assert np.all(weights @ matrix == 0)
    if found:
        (first, *_) = found
        rates = fs.reduce_states(model.rates, first.combinations, conserved=first.totals)
        place = {s: sp.Rational(k + 2, 7) for k, s in enumerate(states)}
        totals = {real(n): e.subs(place) for n, e in first.totals.items()}
        for name, rate in rates.items():
            assert sp.simplify((rate - model.rates[name]).subs({**totals, **place})) == 0


@pytest.mark.parametrize("seed", range(3))
def test_networks_with_inflow_have_none(seed):
    model, _ = network(np.random.default_rng(seed), open_one=True)
    assert conserved_quantities(model) == ()


def epidemic():
    s, i, r, b, g, d, w = sp.symbols("S I R beta gamma delta w")
    capped = sp.Min(i, sp.Rational(1, 4))
    return fs.Model(
        {s: d * r - b * w * s * i, i: b * w * s * i - g * capped, r: g * capped - d * r},
        forcing={w: 1 + sp.sin(t) / 2},
        parameters={b: 2, g: 1, d: 0.5},
    ).frozen()


def test_a_total_population_is_named_everywhere_with_its_reduction():
    model = epidemic()
    (total,) = fs.derive(model).conserved_quantities
    assert total.expression == sum(map(real, "SIR"))
    text = str(total)
    assert 'fs.reduce_states(model.rates, {"S": S, "I": I}, conserved={"N": I + R + S})' in text
    printed = fs.derive(model).summary()
    assert "N = I + R + S is constant" in printed
    assert max(map(len, printed.splitlines())) <= 200
    assert "Conserved" in fs.derive(model).to_latex()
    with pytest.raises(ModelError, match="N = I \\+ R \\+ S is constant"):
        fs.equilibria(model, w=1)
    diagram = fs.continue_equilibria(model, "w", over=(0.5, 2))
    assert not diagram.branches
    assert diagram.outcome.code == "conserved quantity"
    assert not diagram.outcome


def test_the_reduction_has_isolated_equilibria():
    model = epidemic()
    (total,) = conserved_quantities(model)
    rates = fs.reduce_states(model.rates, total.combinations, conserved=total.totals)
    values = {**model.parameters, "N": 1, "w": 1}
    reduced = fs.Model(rates, parameters=values)
    assert conserved_quantities(reduced) == ()
    found = {tuple(np.round(e.state, 9)) for e in fs.equilibria(reduced)}
    # no infection, or S = γ/β with d R = γ I, where I is below its cap
    expected = (0.5, round(0.5 * 0.5 / (1 + 0.5), 9))
    assert (1.0, 0.0) in found
    assert expected in found


def test_what_is_not_conserved_is_refused():
    a, b, k = sp.symbols("a b k")
    with pytest.raises(ArgumentError, match="N = a \\+ b is not conserved; its rate is -a\\*k"):
        fs.reduce_states({a: -k * a, b: sp.S.Zero}, {a: a}, conserved={"N": a + b})
    with pytest.raises(ArgumentError, match="b is a state; expected a new name"):
        fs.reduce_states({a: -k * a, b: k * a}, {a: a}, conserved={"b": a + b})
    with pytest.raises(ArgumentError, match="linearly dependent"):
        fs.reduce_states({a: -k * a, b: k * a}, {"u": a + b}, conserved={"N": a + b})
