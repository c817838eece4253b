"""Named definitions: what they are in equations, results, marks, files and figures."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs

pytestmark = pytest.mark.slow

VALUES = {"C": 20, "gCa": 4.4, "gK": 8, "gL": 2, "phi": 0.04}
DEFINITIONS = {
    "i_ion": "i_Ca + i_K + gL*(V + 60)",
    "i_Ca": "gCa*m_inf*(V - 120)",
    "i_K": "gK*n*(V + 84)",
    "m_inf": "(1 + tanh((V + 1.2)/18))/2",
}
N_INF = "((1 + tanh((V - 2)/30))/2 - n)*cosh((V - 2)/60)"


def morris_lecar():
    rates = {"V": "(w - i_ion)/C", "n": f"phi*{N_INF}"}
    return fs.Model(rates, parameters=VALUES, forcing={"w": "90 + t/100"}, definitions=DEFINITIONS)


def current(V):
    return 4.4 * (1 + np.tanh((V + 1.2) / 18)) / 2 * (V - 120)


def test_a_model_is_that_of_the_equations_written_out():
    model = morris_lecar()
    ion = "4.4*(1 + tanh((V + 1.2)/18))/2*(V - 120) + 8*n*(V + 84) + 2*(V + 60)"
    plain = fs.Model({"V": f"(90 + t/100 - ({ion}))/20", "n": f"0.04*{N_INF}"})
    one, two = (fs.simulate(m, [-40, 0.1], t=(0, 300)) for m in (model, plain))
    np.testing.assert_allclose(one.end[1:], two.end[1:], rtol=1e-7)
    assert [*model.definitions] == [*DEFINITIONS]
    assert model.definitions["i_ion"].free_symbols <= {
        sp.Symbol(n, real=True) for n in ("V", "n", "gCa", "gK", "gL")
    }
    assert "i_K = gK*n*(V + 84)" in repr(model)
    assert model != fs.Model(model.rates, parameters=VALUES, forcing=model.forcing)


def test_columns_of_runs_and_branches_conditions_marks_and_files(tmp_path):
    model = morris_lecar()
    run = fs.simulate(model, [-40, 0.1], t=(0, 300), stop=["i_K > 5000"])
    np.testing.assert_allclose(run["i_Ca"], current(run["V"]), rtol=1e-12)
    np.testing.assert_allclose(run["i_Ca/C + 1"], current(run["V"]) / 20 + 1, rtol=1e-12)
    crossed = run.section("i_K", level=100.0)
    assert len(crossed) > 0
    inside = run.select("i_K > 100")
    assert all((part["i_K"][1:-1] > 100).all() for part in inside)
    frozen = model.frozen()
    diagram = fs.continue_equilibria(frozen, "w", over=(0, 250), marks={"level": "i_Ca + 100"})
    (branch,) = diagram.branches
    np.testing.assert_allclose(branch["i_Ca"], current(branch["V"]), rtol=1e-12)
    (mark,) = (point for point in diagram.special if point.code == "UZ")
    assert current(mark["V"]) == pytest.approx(-100, rel=1e-9)
    run.save(tmp_path / "run.npz")
    diagram.save(tmp_path / "diagram.npz")
    again, other = fs.load(tmp_path / "run.npz"), fs.load(tmp_path / "diagram.npz")
    assert (again, other) == (run, diagram)
    assert np.array_equal(again["i_ion"], run["i_ion"])
    assert np.array_equal(other["i_ion"], diagram["i_ion"])
    stored = fs.simulate(again.model, [-40, 0.1], t=(0, 300), stop=["i_K > 5000"])
    assert np.array_equal(stored["i_ion"], run["i_ion"])
    drawn = fs.plot.time_series(run, y="i_Ca")
    assert "Ca" in drawn.lines[0].axes.get_ylabel()
    assert np.array_equal(drawn.lines[0].get_ydata(), run["i_Ca"])


def test_cycles_have_functionals_of_definitions():
    model = fs.Model(
        {"x": "y", "y": "w*y - x - y**3"}, forcing={"w": "t"}, definitions={"energy": "x**2 + y**2"}
    )
    diagram = fs.continue_equilibria(model.frozen(), "w", over=(-1, 0.3))
    marks = {"level": "max(energy) - 1/4"}
    (cycles,) = fs.continue_cycles(diagram, marks=marks, continuation=fs.Continuation(max_step=0.1))
    (mark,) = (point for point in cycles.special if point.code == "UZ")
    assert mark.orbit["max(energy)"] == pytest.approx(0.25, rel=1e-9)
    np.testing.assert_allclose(cycles["max(energy)"], cycles["max(x**2 + y**2)"], rtol=1e-12)


def test_conditions_events_and_pieces_may_contain_definitions():
    model = fs.Model(
        {"x": "Piecewise((k, beyond > 0), (1, True))"},
        parameters={"k": 2},
        definitions={"beyond": "x - 1"},
        events={"back": fs.Event("beyond > 2", {"x": "beyond - 2"})},
    )
    assert [*model.interfaces] == ["x - 1"]
    run = fs.simulate(model, [0], t=(0, 3))
    # one unit of time to x = 1, one to x = 3, and from 0 again
    np.testing.assert_allclose([one.time for one in run.events], [2])
    assert run.final_state["x"] == pytest.approx(1)
    relay = fs.Model({"x": "-a"}, definitions={"a": "sign(x)"})
    assert relay.with_parameters().frozen().definitions == relay.definitions


@pytest.mark.parametrize(
    ("definitions", "message"),
    [
        ({"a": "b", "b": "2*c", "c": "a + x"}, "contain each other: a → b → c → a"),
        ({"a": "a + 1"}, "contain each other: a → a"),
        ({"x": "2"}, "'x' is both a state and a definition"),
        ({"t": "2"}, "'t' is time"),
        ({"a": "z"}, "definition a: unknown symbol 'z'"),
        ({"two words": "x"}, "definition 'two words': expected an identifier"),
        ({"not": "x"}, "definition 'not': expected an identifier"),
        ({"a": "x > 1"}, "definition a: expected an expression"),
        ({"a": "f(x)"}, "definition a: "),
    ],
)
def test_definitions_that_mean_nothing_are_named(definitions, message):
    with pytest.raises(fs.ModelError, match=message):
        fs.Model({"x": "-x"}, definitions=definitions)
