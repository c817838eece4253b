"""The budget of work of a derivation: what is past it is named and can be derived on request."""

import pytest
import sympy as sp

import fastslow as fs
from fastslow.errors import UnknownNameError
from fastslow.model.work import Budget, PastWorkError, cached, spend, spend_traversal
from fastslow.symbolic import deriving
from fastslow.symbolic.closed_forms import equilibrium_sets
from fastslow.symbolic.closed_forms.regions import RegionForms

x, y, F, D, k = sp.symbols("x y F D k", real=True)


def coupled():
    def backlash(u):
        return sp.Piecewise((u - D, u > D), (u + D, u < -D), (0, True))

    rates = {x: F - backlash(x) - k * backlash(x - y), y: backlash(x - y) - y}
    return fs.Model(rates, parameters={F: 1, D: 0.5, k: 2})


@pytest.fixture(scope="module")
def whole():
    return fs.derive(coupled())


def equilibria(forms: RegionForms) -> list[dict[str, sp.Expr]]:
    return [dict(one.state) for one in forms.equilibria]


def test_nothing_is_omitted_within_the_budget(whole):
    assert whole.omitted == () == whole.omitted_pairs
    assert "past the budget" not in whole.summary()


def test_what_is_past_the_budget_is_named_and_the_same_each_time(whole, monkeypatch):
    monkeypatch.setattr(deriving, "REGION_WORK", 10_000)
    monkeypatch.setattr(deriving, "BOUNDARIES", 20_000)
    short = fs.derive(coupled())
    assert 0 < len(short.regions) < len(whole.regions)
    assert {*short.regions, *short.omitted} == {*whole.regions}
    assert 0 < len(short.omitted_pairs) < 12
    one, other = short.omitted_pairs[0]
    assert f"boundary equilibria between {one} and {other}" in short.summary()
    assert f"past the budget of work: regions {short.omitted[0]}" in short.summary()
    # cached results spend what they took the first time
    again = fs.derive(coupled())
    assert (again.omitted, again.omitted_pairs) == (short.omitted, short.omitted_pairs)
    monkeypatch.undo()
    chosen = fs.derive(coupled(), regions=short.omitted[-1:])
    assert list(chosen.regions) == [short.omitted[-1]]
    assert equilibria(chosen[short.omitted[-1]]) == equilibria(whole[short.omitted[-1]])


def test_an_unknown_region_is_refused():
    with pytest.raises(UnknownNameError, match="S1"):
        fs.derive(coupled(), regions=["s1"])


def test_a_cached_function_spends_what_its_first_call_did():
    @cached(4)
    def square(number):
        spend(number)
        return number**2

    budget = Budget(25)
    with budget.spending():
        assert [square(10), square(10)] == [100, 100]
        assert budget.spent == 20
        with pytest.raises(PastWorkError):
            square(10)
    assert square(10) == 100


def test_budgets_nest():
    outer, inner = Budget(10), Budget(3)
    with outer.spending():
        with pytest.raises(PastWorkError), inner.spending():
            spend(4)
        spend(6)
        with pytest.raises(PastWorkError):
            spend(1)


def test_sets_past_the_budget_are_named(monkeypatch):
    friction = sp.sign(y) / 2 + k * sp.sign(y - 1) + k * sp.sign(y + 1)
    relays = fs.Model({x: y, y: F - x - friction}, parameters={F: 0.1, k: 0.1})
    whole = fs.derive(relays)
    assert whole.omitted_sets == ()
    monkeypatch.setattr(equilibrium_sets, "SETS_WORK", 2)
    short = fs.derive(relays)
    assert len(short.omitted_sets) > 2
    assert len(short.equilibrium_sets) < len(whole.equilibrium_sets)
    assert f"sets of equilibria of {short.omitted_sets[0]}" in short.summary()


def test_an_exhausted_budget_ends_at_once():
    budget = Budget(10)
    with pytest.raises(PastWorkError), budget.spending():
        spend(11)
    reached = []
    with pytest.raises(PastWorkError), budget.spending():
        reached.append(1)
    assert not reached


def test_traversals_of_long_expressions_are_work():
    budget = Budget(100_000)
    with budget.spending():
        spend_traversal(x + 1)
        assert budget.spent == 0
        spend_traversal(sp.Add(*(x**k for k in range(2, 1500))))
        assert budget.spent > 2000
        spend_traversal(sp.Add(*(x**k for k in range(2, 1500))), most=2500)
        assert budget.spent < 100_000
