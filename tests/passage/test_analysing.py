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
    assert found.outcome.code == "no slow state"
    assert "no state is proposed as slow" in found.evidence[-1]
    with pytest.raises(fs.ArgumentError, match="there is no overlay to draw"):
        found.plot()


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
    with pytest.raises(fs.ArgumentError, match="several slow quantities, w, x"):
        fs.analyse(model, {"x": 0, "y": 0, "w": 0}, t=(0, 1), slow="x")
    with pytest.raises(fs.ArgumentError, match="expected an initial state"):
        fs.analyse(model)


def test_a_run_that_ends_early_is_kept():
    found = fs.analyse(fs.Model({"x": "x**2", "z": "-z/100"}), [1, 1], t=(0, 3))
    assert not found.outcome
    assert found.overlay is None
    assert np.isclose(found.run.span[1], 1)
    assert len(found.calls) == 1
