"""Reading of switches, and models with switches in constant states."""

import pickle

import pytest
import sympy as sp

import fastslow as fs

x, v, q, p, a, t, T, w = sp.symbols("x v q p a t T w")


def automaton(**changes):
    given = {
        "parameters": {a: 1},
        "forcing": {w: sp.sin(t)},
        "switches": {q: (x < -a, x > a), p: (v < -1 - q, v > 1 + w / 3)},
        **changes,
    }
    return fs.Model({x: v, v: -sp.sign(x - q) - 2 * q * v + p}, **given)


def test_a_model_shows_its_switches():
    model = automaton()
    assert list(model.switches) == ["q", "p"]
    assert str(model.switches["q"]) == "q: 1 when x < -a, 0 when x > a"
    assert "p: 1 when v < -q - 1, 0 when v > w/3 + 1" in model.equations
    assert "q: 1 when x < -a" in repr(model)
    assert r"q \mapsto 1&&\text{when}\ - x - a \geq 0" in model.to_latex()
    assert [str(model.switches["q"].watched(value)) for value in (0, 1)] == ["-a - x", "-a + x"]


def test_models_with_other_switches_differ():
    model = automaton()
    assert model == automaton()
    assert pickle.loads(pickle.dumps(model)) == model
    assert model != automaton(switches={q: (x < -a, x > 2 * a), p: (v < -1 - q, v > 1 + w / 3)})
    assert model.frozen().switches == model.switches
    assert model.with_parameters(a=2) == automaton(parameters={a: 2})


def test_switches_in_constant_states_are_replaced_by_their_values():
    model = automaton()
    fixed = model.with_switches({q: 1}, p=0)
    assert not fixed.switches
    assert list(fixed.regions) == list(model.regions) == ["S1", "S2"]
    assert [str(r) for r in fixed.regions.values()] == ["S1: x > 1", "S2: x < 1"]
    assert fixed.regions["S1"].rates["v"].equals(-2 * sp.Symbol("v", real=True) - 1)
    # the relations of the other switch
    one = model.with_switches(q=1)
    assert str(one.switches["p"].watched(0)) == "-v - 2"


def test_a_switch_may_divide_the_state_space():
    model = fs.Model(
        {x: sp.Piecewise((1 - x, q > 0.5), (-x - sp.sign(x), True))},
        switches={q: (x < -0.2, x > 0.8)},
    )
    assert len(model.regions) == 4
    assert str(model.with_switches(q=1).regions["S1"].rates["x"]) == "1 - x"
    assert len(model.with_switches(q=0).regions) == 2
    assert str(model.regions["S4"]).startswith("S4: q = 0, x < 0")


@pytest.mark.parametrize("condition", [sp.Eq(q, 1), sp.Eq(1, q), sp.Ne(q, 0), q > 0.5])
def test_conditions_on_switches_are_decided(condition):
    switches = {q: (x < 0, x > 1)}
    model = fs.Model({x: sp.Piecewise((v, condition), (-x, True)), v: 0}, switches=switches)
    assert str(model.with_switches(q=1).rates["x"]) == "v"
    assert str(model.with_switches(q=0).rates["x"]) == "-x"
    named = fs.Model(
        {x: sp.Piecewise((v, condition), (-x, True)), v: 0},
        switches=switches,
        regions={"on": condition},
    )
    assert list(named.regions) == ["on", "S1"]


@pytest.mark.parametrize(
    ("relations", "message"),
    [
        ((x < 0, x > 0), r"touch, so that it has no hysteresis; write Piecewise\(\(1, x < 0\)"),
        ((2 * x - w < 0, x > w / 2), "touch"),
        ((x < 0, x > -1), "may be true at the same time"),
        ((x < a, x > 0), "may be true at the same time"),
        ((x > 0, x > 1), "may be true at the same time"),
        ((x < 0, v > 1), "may be true at the same time"),
        ((x < 0,), "expected two relations"),
        ("x<0", "expected two relations"),
        ((x < q, x > 2), "contains the switch itself"),
        ((a < 2, x > 1), "a < 2 contains no state"),
        ((sp.Eq(x, 1), x > 2), "expected one inequality"),
        ((sp.Abs(x) > 1, x < 0), "is not smooth; .* or two events, which accept And"),
        ((x < 0, "y > 1"), "unknown symbol 'y'"),
    ],
)
def test_a_switch_without_two_separate_relations_is_refused(relations, message):
    with pytest.raises(fs.ModelError, match=message):
        fs.Model({x: v, v: q - x}, forcing={w: t}, parameters={a: 1}, switches={q: relations})


def test_relations_are_compared_at_the_parameter_values():
    with pytest.raises(fs.ModelError, match="may be true at the same time"):
        automaton().with_parameters(a=-1)
    # undecided: the distance of the thresholds changes with time
    fs.Model({x: q}, forcing={w: t}, switches={q: (x < w, x > 1)})
    fs.Model({x: q}, switches={q: (sp.Eq(sp.Mod(t, 1), 0), x > sp.Mod(t, 1))})


def test_wrong_names_and_values_of_switches_are_refused():
    with pytest.raises(fs.UnknownNameError, match=r"unknown switch 'z' \(known: q, p\)"):
        automaton().with_switches(z=1)
    with pytest.raises(fs.ModelError, match="switch q: expected 0 or 1, received 2"):
        automaton().with_switches(q=2)
    with pytest.raises(fs.ModelError, match="'x' is both a state and a switch"):
        fs.Model({x: -x}, switches={x: (x < 0, x > 1)})


def test_analyses_refuse_switches():
    frozen = fs.Model({x: a - x - q}, parameters={a: 0}, switches={q: (x < 0, x > 1)})
    with pytest.raises(fs.ModelError, match=r"model.with_switches\(q=0\)"):
        fs.tangencies(frozen)
    found = fs.continue_equilibria(frozen.with_free("a").with_switches(q=1), "a", (-1, 1))
    assert len(found.branches) == 1
