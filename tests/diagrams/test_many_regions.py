"""Models with many regions: rows that stand once, few values, a search across all regions."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.diagrams.curves import tangency_points
from fastslow.diagrams.field import FrozenField
from fastslow.diagrams.modes import modes_of
from fastslow.diagrams.solve import many_regions
from fastslow.diagrams.solve.starts import Starts
from fastslow.kernels import fields
from fastslow.results.branch.windows import state_window

pytestmark = pytest.mark.slow

X = sp.symbols("x:8")
p, a = sp.symbols("p a")


def ring(count):
    """A term with a condition in every state: affine in each of 2^count regions."""
    rates = {
        X[k]: p - X[k] + sp.Max(0, X[(k - 1) % count] - sp.Rational(k + 1, 20)) / 2
        for k in range(count)
    }
    return fs.Model(rates, parameters={p: 0.3})


def bent(count):
    """Equilibria with 2 x = -1 + sqrt(1 + 4 p) and the like, in 2^count regions."""
    rates = {
        x: (p if k == 0 else sp.Rational(k, 5) * (-1) ** k) - x - x * sp.Abs(x)
        for k, x in enumerate(X[:count])
    }
    return fs.Model(rates, parameters={p: 0.3})


def test_rows_that_stand_once_give_the_same_numbers(monkeypatch):
    model = fs.Model(
        {
            X[0]: a * sp.Abs(X[0]) - X[1] ** 3 + sp.exp(-sp.Abs(X[1])),
            X[1]: X[0] * X[1] - sp.sign(X[0] - a) * sp.sqrt(1 + X[1] ** 2),
        },
        parameters={a: 0.3},
    )
    field = FrozenField(model, "a")
    random = np.random.default_rng(2)
    points = random.normal(size=(20, 3))
    separate = [[*field.evaluate(k, points)] for k in range(len(field.modes))]
    monkeypatch.setattr(fields, "are_many", lambda *_: True)
    fields.field_address.cache_clear()
    shared = FrozenField(fs.Model(model.rates, parameters={a: 0.4}), "a")
    for k, one in enumerate(separate):
        for mine, theirs in zip(shared.evaluate(k, points), one, strict=True):
            assert mine == pytest.approx(theirs, rel=1e-14, abs=1e-14)
    fields.field_address.cache_clear()


def test_few_values_separate_the_branches_of_many_regions():
    model = ring(7)
    field = FrozenField(model, "p")
    assert len(field.modes) == 128
    starts = Starts(field, 0.0, 1.0, 5, state_window(model.states, None), False)
    assert starts.complete
    # one interface after the other is crossed
    assert len(starts._first) <= 2 + 8
    diagram = fs.continue_equilibria(model, "p", over=(0, 1))
    assert diagram.completeness == "complete"
    (branch,) = diagram.branches
    crossings = [q["p"] for q in branch.special if q.code == "BE"]
    states = [[q[f"x{k}"] for k in range(7)] for q in branch.special if q.code == "BE"]
    assert len(crossings) == 7
    for at, x in zip(crossings, np.array(states), strict=True):
        level = np.roll(x, 1) - np.arange(1, 8) / 20
        assert x == pytest.approx(at + np.maximum(0, level) / 2, abs=1e-14)
        assert np.abs(level).min() < 1e-14


def test_equilibria_of_many_nonlinear_regions_are_found():
    found = fs.equilibria(bent(8))
    assert found.completeness == "found"
    assert "256 regions are too many" in repr(found)
    (one,) = found
    values = [0.3, *(k / 5 * (-1) ** k for k in range(1, 8))]
    exact = [np.sign(v) * (-1 + np.sqrt(1 + 4 * abs(v))) / 2 for v in values]
    assert one.state == pytest.approx(exact, rel=1e-14)


def test_branches_across_many_nonlinear_regions():
    diagram = fs.continue_equilibria(bent(8), "p", over=(-1, 2))
    assert diagram.completeness == "found"
    assert "256 regions are too many" in str(diagram.outcome)
    (branch,) = diagram.branches
    (crossing,) = (q for q in branch.special if q.code == "BE")
    assert crossing["p"] == pytest.approx(0.0, abs=1e-14)
    x = branch["x0"]
    assert x + x * np.abs(x) == pytest.approx(branch["p"], rel=1e-12, abs=1e-13)


def test_more_interfaces_than_an_integer_has_bits(monkeypatch):
    # 66 steps of a staircase in the first of two states
    stairs = sum(sp.Heaviside(X[0] - k) for k in range(1, 67))
    model = fs.Model({X[0]: p - X[0] ** 3 / 99 - stairs / 4, X[1]: X[0] - X[1]}, parameters={p: 9})
    field = FrozenField(model, "p")
    value = 64.5**3 / 99 + 64 / 4
    monkeypatch.setattr(many_regions, "DECADES_ACROSS", (0.0, 3.0))
    found = many_regions.found_across(field, value, None)
    assert [state for _, state in found] == [pytest.approx([64.5, 64.5], rel=1e-13)]


def test_few_nonlinear_regions_are_solved_one_by_one(monkeypatch):
    model = bent(3)
    every = fs.equilibria(model)
    assert every.completeness == "complete"
    monkeypatch.setattr(many_regions, "EQUATIONS_SOLVED", 4)
    many_regions.solved_one_by_one.cache_clear()
    across = fs.equilibria(model.with_parameters(p=0.30001))
    assert across.completeness == "found"
    assert across[0].state == pytest.approx(every[0].state, abs=1e-4)
    many_regions.solved_one_by_one.cache_clear()


def test_sliding_motions_that_are_not_examined_are_named():
    rates = {x: p - x**3 - sp.sign(x - k) / 3 for k, x in enumerate(X[:6])}
    found = fs.equilibria(fs.Model(rates, parameters={p: 0.3}))
    assert "sliding and held motions are not computed" in repr(found)


def test_a_conserved_quantity_of_many_regions_is_found():
    # the total of the first two states; some rows decide for no other model
    exchange = sp.Max(0, X[0] - 1) - sum(sp.Max(0, X[k] - k) for k in range(2, 8))
    rates = {X[0]: -exchange, X[1]: exchange} | {x: 1 - x for x in X[2:]}
    diagram = fs.continue_equilibria(
        fs.Model({**rates, X[2]: a - X[2]}, parameters={a: 1}), "a", over=(0, 1)
    )
    assert diagram.outcome.code == "conserved quantity"


def test_multipliers_of_a_forced_orbit_in_one_of_many_regions():
    t, f = sp.symbols("t f")
    rates = {x: -(k + 1) * x / 4 + sp.Max(0, X[k - 1]) / 2 for k, x in enumerate(X[:6]) if k}
    model = fs.Model(
        {X[0]: f - X[0] / 4 - sp.Max(0, -X[5]), **rates}, forcing={f: 1 + sp.cos(t) / 9}
    )
    assert len(model.regions) == 64
    orbit = fs.find_orbit(model, fs.simulate(model, [1.0] * 6, t=(0, 40 * np.pi)))
    wanted = np.exp(-2 * np.pi * np.arange(1, 7) / 4)
    assert np.sort(np.abs(orbit.multipliers))[::-1] == pytest.approx(wanted, rel=1e-8)


def test_many_steps_of_one_state_are_solved_one_by_one():
    # a staircase, with sliding and escaping motions between its steps
    stairs = sum(sp.Heaviside(X[0] - k) for k in range(1, 45))
    field = FrozenField(fs.Model({X[0]: p - X[0] ** 3 - stairs / 2}, parameters={p: 30.2}), "p")
    assert len(field.modes) > 128
    assert many_regions.unexamined(field) == []


def test_fixed_states_exclude_regions_without_tangencies():
    rates = {x: 1 - x * sp.Abs(x) for x in X[2:]} | {X[0]: X[1], X[1]: -X[0] + sp.Abs(X[1] - 1)}
    rates[X[0]] = X[1] - sp.Abs(X[0] - 1)
    model = fs.Model({x: rates[x] for x in X})
    fixed = {f"x{k}": (-1) ** k for k in range(2, 8)}
    modes = [mode for mode in modes_of(model) if mode.sides is None]
    assert len(modes) == 256
    assert len(tangency_points._possible(model, modes, fixed)) == 4
    found = fs.tangencies(model, fixed)
    # on x0 = 1, where x0' = x1 vanishes, and on x1 = 1, where x1' = -x0 does
    places = {(round(one.state[0], 12), round(one.state[1], 12)) for one in found}
    assert places == {(1.0, 0.0), (0.0, 1.0)}
