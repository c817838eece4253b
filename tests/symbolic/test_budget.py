"""Models past the budget: closed forms are correct, remaining equations are reported."""

import re
from functools import cache

import pytest
import sympy as sp

import fastslow as fs
from fastslow.model import polynomials
from fastslow.model.polynomials import factor
from fastslow.model.structure import real
from fastslow.symbolic.algebra import within_budget
from fastslow.symbolic.naming import named
from fastslow.symbolic.signs.signs import Signs
from fastslow.symbolic.solving.candidates import Candidates
from fastslow.symbolic.solving.solution_families import OPEN, PAST, families
from tests.symbolic.field_models import daisyworld

pytestmark = pytest.mark.slow


@cache
def world(black):
    return fs.derive(daisyworld(numbers=True, root=True, black=black))


#: Both kinds of daisies, which take seconds, and white ones alone.
kinds = pytest.mark.parametrize("black", [True, False])


@pytest.mark.sample(1)
@kinds
def test_daisyworld_with_a_fourth_root_has_its_bare_ground_in_every_region(black):
    derivation = world(black)
    assert len(derivation) == (8 if black else 4)
    for region in derivation.regions.values():
        bare = [e for e in region.equilibria if set(e.state.values()) == {sp.S.Zero}]
        assert len(bare) == 1
        assert bare[0].check == "exact"


@pytest.mark.sample(1)
@kinds
def test_what_is_left_implicit_is_counted_and_said(black):
    left = []
    for name, region in world(black).regions.items():
        for form in region.equilibria:
            if form.type == "implicit":
                left.append((name, {n for n, e in form.state.items() if e == 0}))
                assert form.check == "exact"
                assert form.note.startswith(OPEN)
                assert form.note in region.notes
    # one kind of daisies where it grows, both where both grow
    both = [
        ("S4", {"a_w"}),
        ("S7", {"a_b"}),
        ("S8", {"a_w"}),
        ("S8", {"a_b"}),
        ("S8", set()),
    ]
    assert left == (both if black else [("S4", set())])


@pytest.mark.sample(1)
@kinds
def test_no_line_and_no_number_of_it_is_long(black):
    printed = world(black).summary()
    assert max(map(len, printed.splitlines())) <= 200
    assert printed.count(f"note: {OPEN}") == (5 if black else 1)
    assert not re.search(r"\d{10}|e[+-]?\d\d", printed)


@pytest.mark.sample(0)
def test_rates_past_the_budget_are_taken_apart_by_their_factors():
    model = daisyworld()
    rates = {n: sp.nsimplify(e, rational=True) for n, e in model.regions["S8"].rates.items()}
    signs = Signs({real(n): 1 for n in model.parameters if n != "L"})
    found = families(rates, model.states, signs, Candidates((real("L"),), ()))
    zeros = [{n for n, e in f.elimination.solved.items() if e == 0} for f in found]
    assert zeros.count({"a_w", "a_b"}) == 1, "bare ground"
    assert {"a_w"} in zeros
    assert {"a_b"} in zeros
    (both,) = [f for f, none in zip(found, zeros, strict=True) if not none]
    assert both.note == PAST
    for family, zero in zip(found, zeros, strict=True):
        if len(zero) == 1:
            assert family.elimination.is_univariate, "one kind of daisies alone"
            assert family.note.startswith(OPEN)


@pytest.mark.parametrize("count", [3, 4])
def test_more_choices_of_factors_than_the_budget_stay_whole(count):
    states = [f"x{k}" for k in range(3 * count)]
    symbols = list(map(real, states))
    inner = (sum(symbols) + 1) ** 4
    rates = {n: x * (inner - k) for k, (n, x) in enumerate(zip(states, symbols, strict=True))}
    (whole,) = families(rates, states, Signs({}), Candidates())
    assert whole.note == PAST
    assert whole.equations == tuple(rates.values())


def test_roots_of_numbers_are_printed_whole():
    z, a = sp.symbols("z a")
    number = sp.rootof(z**5 - 3 * z**2 + 7 * z - 12345678, 0)
    short, defined = named([a * number + 1, a * number - 1], "a")
    place = dict(defined)
    assert [e.xreplace(place) for e in short] == [a * number + 1, a * number - 1]


@pytest.mark.sample(0)
def test_both_kinds_of_daisies_together_are_closed_once_degrees_are_lowered():
    model = daisyworld(numbers=True)
    rates = {n: sp.nsimplify(e, rational=True) for n, e in model.regions["S8"].rates.items()}
    found = families(rates, model.states, Signs({}), Candidates((real("L"),), ()))
    (both,) = [f for f in found if sp.S.Zero not in f.elimination.solved.values()]
    assert not both.equations
    light = sp.Rational(21, 20)
    state = {real(n): e.subs(real("L"), light) for n, e in both.elimination.solved.items()}
    assert all(e.subs(state).subs(real("L"), light) == 0 for e in rates.values())
    equilibria = fs.equilibria(model, L=float(light))
    assert equilibria.completeness == "complete"
    (point,) = [e for e in equilibria if e.region == "S8" and min(e.state) > 1e-6]
    assert point.state == pytest.approx([float(v) for v in state.values()], rel=1e-12)


def test_a_root_of_high_index_is_no_polynomial():
    x, a = real("x"), real("a")
    exponent = sp.Rational(7656119366529843, 4503599627370496)
    assert not within_budget(x**exponent / (x**exponent + sp.Rational(439, 10) ** exponent) + a)


def test_past_the_budget_a_polynomial_stays_whole(monkeypatch):
    _, x, a = sp.ring("x a", sp.ZZ)
    whole = (x**2 + a**2 + 1) * (x**2 - 2 * a**2 + 3)
    assert len(factor(whole)[1]) == 2
    monkeypatch.setattr(polynomials, "FACTORED_WORK", 10)
    assert factor(whole) == (1, [(whole, 1)])
