"""Distinction of Hopf points and neutral saddles in any number of states."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.model.structure import real
from fastslow.symbolic.closed_forms.stability import (
    frequency_squared,
    hurwitz,
    irreducible_blocks,
    stability_of_matrix,
)

pytestmark = pytest.mark.slow


@pytest.mark.sample(4)
@pytest.mark.parametrize("count", range(2, 11))
def test_the_frequency_of_a_pair_with_sum_zero(count):
    generator = np.random.default_rng(count)
    root = sp.Symbol("s")
    for square in (sp.Rational(7, 3), -sp.Rational(5, 2)):
        others = [
            sp.Rational(10 * k + int(generator.integers(1, 9)), 7) * (-1) ** k
            for k in range(count - 2)
        ]
        factors = [root**2 + square, *(root + a for a in others)]
        coefficients = sp.Poly(sp.prod(factors), root).all_coeffs()
        assert hurwitz(coefficients, count - 1) == 0
        assert frequency_squared(coefficients) == square


def test_a_neutral_saddle_of_five_states_is_no_hopf_point():
    # companion form of (λ² + q)(λ + 1)(λ + 2)(λ + 3) at a = 0, with trace −6 + a
    xs = sp.symbols("x1:6")
    a, q, s = sp.symbols("a q s")
    wanted = sp.Poly((s**2 + a * s + q) * (s + 1) * (s + 2) * (s + 3), s).all_coeffs()
    rates = {xs[k]: xs[k + 1] for k in range(4)}
    rates[xs[4]] = -sum(c * x for c, x in zip(wanted[:0:-1], xs, strict=True))
    for sign in (1, -1):
        model = fs.Model(rates, parameters={a: 0.25, q: sign * 2})
        region = fs.derive(model, assume={"a": "real", "q": "real"}, parameter="a")["S1"]
        points = [h for h in region.hopf if h.parameters.get("a") == 0]
        assert [sp.simplify(h.frequency_squared - real("q")) for h in points] == [0]
        assert points[0].exists == (real("q") > 0)
    # with q known to be negative there is none
    known = {"a": "real", "q": "negative"}
    negative = fs.derive(model, assume=known, parameter="a")["S1"]
    assert not any(h.parameters.get("a") == 0 and h.possible for h in negative.hopf)


@pytest.mark.sample(2)
@pytest.mark.parametrize("seed", range(5))
def test_conditions_by_blocks_agree_with_eigenvalues(seed):
    generator = np.random.default_rng(seed)
    count = int(generator.integers(3, 8))
    pattern = generator.random((count, count)) < 0.25
    numbers = generator.integers(-9, 10, size=(count, count)) * pattern
    numbers -= np.diag(generator.integers(1, 25, size=count))
    symbols = sp.Matrix(count, count, lambda i, j: real(f"m{i}{j}") if numbers[i, j] else sp.S.Zero)
    place = {real(f"m{i}{j}"): int(numbers[i, j]) for i in range(count) for j in range(count)}
    found = stability_of_matrix(symbols, lambda e: None, lambda e: e > 0)
    blocks = irreducible_blocks(symbols)
    assert sorted(k for b in blocks for k in b) == list(range(count))
    polynomial = [float(c.subs(place)) for c in found.coefficients]
    assert polynomial == pytest.approx(np.poly(numbers), rel=1e-9, abs=1e-6)
    stable = all(e.subs(place).doit() > 0 for e in found.routh_hurwitz)
    assert stable == bool(np.linalg.eigvals(numbers).real.max() < 0)


def test_a_chain_of_eight_decays_is_stable_and_a_ring_of_eight_comes_back():
    xs = sp.symbols("x1:9")
    ks = sp.symbols("k1:9")
    w, t = sp.symbols("w t")
    values = {k: 1 + j / 10 for j, k in enumerate(ks)}

    def chain(first):
        rates = {xs[0]: first - ks[0] * xs[0]}
        for j in range(1, 8):
            rates[xs[j]] = ks[j - 1] * xs[j - 1] - ks[j] * xs[j]
        return fs.Model(rates, forcing={w: 1 + sp.sin(t)}, parameters=values).frozen()

    region = fs.derive(chain(w))["S1"]
    assert region.equilibria[0].stability.verdict == "stable"
    assert region.no_hopf == "all eigenvalues are real"
    derivation = fs.derive(chain(w / (1 + xs[7] ** 4)))
    (ring,) = derivation["S1"].equilibria
    assert ring.type == "curve"
    assert ring.verified
    printed = derivation.summary()
    assert "long conditions" in printed
    assert max(map(len, printed.splitlines())) <= 200


def test_gates_with_symbols_are_divided_by_what_never_vanishes():
    v, n, current, t = sp.symbols("V n I t")
    g, e, half, slope, tau = sp.symbols("g E V_n k tau")
    opened = 1 / (1 + sp.exp(-(v - half) / slope))
    model = fs.Model(
        {v: current - g * n**4 * (v - e), n: (opened - n) / tau},
        forcing={current: sp.sin(t)},
        parameters={g: 36, e: -77, half: -40, slope: 10, tau: 4},
    ).frozen()
    assert not any("≠" in note for note in fs.derive(model)["S1"].notes)


def test_what_was_divided_by_is_named_without_what_is_known():
    x, y, a, b, w, t = sp.symbols("x y a b w t")
    model = fs.Model(
        {x: w - 6 * a * (1 - b) * x - 6 * a * (1 - b), y: x - y},
        forcing={w: sp.sin(t)},
        parameters={a: 1, b: 0.5},
    ).frozen()
    (note,) = fs.derive(model)["S1"].notes
    assert note == "valid where b - 1 ≠ 0"
