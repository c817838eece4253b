"""First analyses: the slow state, the calls, and what is kept where a step is not possible."""

import matplotlib
import numpy as np
import pytest

import fastslow as fs

pytestmark = pytest.mark.slow

matplotlib.use("Agg")

BURSTER = """
x'=y-a*x^3+b*x^2-z+i
y'=c-d*x^2-y
z'=r*(s*(x-x0)-z)
par a=1,b=3,c=1,d=5,i=2,r=0.005,s=4,x0=-1.6
init x=-1.5,y=-8,z=2
@ total=600
done"""


def test_a_file_of_a_burster_is_analysed_without_another_word():
    file = fs.read_ode(BURSTER)
    found = fs.analyse(file)
    assert found.slow == "z"
    assert "times as slow as y: proposed as slow" in found.evidence[1]
    # fold/homoclinic, or square-wave, bursting: Hindmarsh and Rose 1984, Izhikevich 2000
    assert str(found.overlay.bursting) == "fold/homoclinic bursting"
    assert "fold/homoclinic bursting" in repr(found)
    # the calls give the same objects
    names = {"fs": fs, "file": file}
    exec("\n".join(found.calls[:-1]), names)
    assert names["overlay"] == found.overlay
    assert names["diagram"] == found.diagram
    assert names["model"] == found.model == file.model.with_slow(["z"])
    assert found.calls[-1] == "fs.plot.overlay(overlay)"
    assert found.plot().lines


def test_time_scales_are_those_of_the_equations():
    # x' = -x + sin t, and z' = cos(εt)·ε: range over largest rate is 2 for each cycle, 2/ε for z
    eps = 0.01
    rates = {"x": "y", "y": "-x", "z": "eps*u", "u": "-eps*z"}
    model = fs.Model(rates, parameters={"eps": eps})
    found = fs.analyse(model, [1, 0, 1, 0], t=(0, 1000))
    assert found.time_scales["x"] == pytest.approx(2, rel=0.02)
    assert found.time_scales["z"] == pytest.approx(2 / eps, rel=0.02)
    # z and u are as slow as each other
    assert "z and u are proposed as slow" in found.evidence[1]
    assert found.model.slow_states == ("z", "u")
    found = fs.analyse(fs.Model({"x": "y", "y": "-x"}), [1, 0], t=(0, 20))
    assert found.outcome.code == "no slow state"
    assert "no state is proposed as slow" in found.evidence[-1]
    with pytest.raises(fs.ArgumentError, match="there is no overlay to draw"):
        found.plot()


def test_of_several_slow_quantities_the_others_are_held_and_said():
    rates = {"x": "x - x**3/3 - z + w/10", "z": "0.02*x", "w": "0.004*(0.5 - w)"}
    found = fs.analyse(fs.Model(rates).with_slow(["z", "w"]), [2, 0, 0], t=(0, 300))
    assert found.slow == "z"
    middle = (found.run["w"].min() + found.run["w"].max()) / 2
    assert found.held == {"w": middle}
    assert found.diagram.parameters["w"] == middle
    assert "The diagram is over z, with w = " in found.evidence[-1]
    assert found.outcome.code == "another slow quantity"
    names = {"fs": fs, "model": fs.Model(rates).with_slow(["z", "w"])}
    exec("\n".join(found.calls[:-1]), names)
    assert names["overlay"] == found.overlay
    other = fs.analyse(found.model, [2, 0, 0], t=(0, 300), slow="w")
    assert other.slow == "w"


def test_what_was_computed_before_an_error_is_kept(monkeypatch):
    def broken(*_, **__):
        raise fs.ModelError("a reason")

    model = fs.Model({"x": "y", "y": "w*y - x - y**3"}, slow={"w": "(0.5 - x**2)/50"})
    state = {"x": 0.1, "y": 0, "w": -0.3}
    monkeypatch.setattr("fastslow.analysing.continue_cycles", broken)
    found = fs.analyse(model, state, t=(0, 100))
    assert str(found.outcome) == "no branch of cycles: a reason"
    assert not found.outcome
    assert len(found.diagram.special("HB")) == 1
    assert found.overlay is not None
    monkeypatch.setattr("fastslow.analysing.overlay", broken)
    found = fs.analyse(model, state, t=(0, 100))
    assert found.overlay is None
    assert len(found.plot().lines) > 0
    monkeypatch.setattr("fastslow.analysing.continue_equilibria", broken)
    found = fs.analyse(model, state, t=(0, 100))
    assert str(found.outcome) == "no diagram: a reason"
    assert found.run.outcome


def test_a_slow_quantity_that_is_given_and_a_hopf_point_with_cycles():
    model = fs.Model({"x": "y", "y": "w*y - x - y**3"}, slow={"w": "(0.5 - x**2)/50"})
    found = fs.analyse(model, {"x": 0.1, "y": 0, "w": -0.3}, t=(0, 200))
    assert found.slow == "w"
    assert found.evidence == ("w is slow as given.",)
    assert len(found.cycles) == 1
    assert "cycles = fs.continue_cycles(diagram)" in found.calls
    assert found.overlay.cycles == found.cycles
    named = fs.analyse(
        fs.Model({"x": "y", "y": "w*y - x - y**3", "w": "(0.5 - x**2)/50"}),
        [0.1, 0, -0.3],
        t=(0, 200),
        slow="w",
    )
    assert named.overlay == found.overlay
    with pytest.raises(fs.UnknownNameError, match="unknown slow quantity 'x'"):
        fs.analyse(model, {"x": 0, "y": 0, "w": 0}, t=(0, 1), slow="x")
    with pytest.raises(fs.ArgumentError, match="expected an initial state"):
        fs.analyse(model)


def test_a_run_that_ends_early_is_kept():
    found = fs.analyse(fs.Model({"x": "x**2", "z": "-z/100"}), [1, 1], t=(0, 3))
    assert not found.outcome
    assert found.overlay is None
    assert np.isclose(found.run.span[1], 1)
    assert len(found.calls) == 1
