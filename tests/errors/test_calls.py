"""Calls whose arguments do not fit, or that lack a step before: what is written instead is said."""

import re

import pytest
import sympy as sp

import fastslow as fs
from tests.errors.subjects import results

pytestmark = pytest.mark.slow

x, w, u, t = sp.symbols("x w u t")


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda r: r["gap"].section("x", lvel=0), "Trajectory.section() got an unexpected"),
        (lambda r: r["gap"].section("x", lvel=0), "did you mean 'level'?"),
        (lambda r: r["gap"].spectrum(), "its arguments are name, taper, samples, since"),
        (lambda r: fs.simulate(r["gear"]), "simulate() missing a required argument: 'state'"),
        (lambda r: fs.Model(), "Model() missing a required argument: 'rates'"),
        (lambda r: fs.Integration(rtoll=1e-3), "Integration() got an unexpected keyword argument"),
        (lambda r: fs.Integration(rtoll=1e-3), "did you mean 'rtol'?"),
        (lambda r: fs.Continuation(stepsize=1), "did you mean 'step'?"),
        (lambda r: fs.Continuation(rtol=1), "its arguments are step, min_step, max_step"),
    ],
)
def test_arguments_that_do_not_fit(call, message):
    with pytest.raises(TypeError, match=re.escape(message)):
        call(results())


def test_settings_without_a_name():
    with pytest.raises(
        fs.ArgumentError, match=r"^Integration received 0.001 without a name; .* rt"
    ):
        fs.Integration(1e-3)
    with pytest.raises(fs.ArgumentError, match=r"^Continuation received 0.001 without a name"):
        fs.Continuation(1e-3)


def test_an_error_inside_a_function_is_not_taken_for_a_misfit():
    def fails(a, b):
        raise TypeError("from inside")

    with pytest.raises(Exception, match="from inside"):
        fs.refined_map(
            fails, {"a": (0, 1), "b": (0, 1)}, refinement=fs.Refinement(cells=(2, 2), levels=1)
        )


@pytest.mark.parametrize("verb", [fs.equilibria, fs.tangencies])
def test_a_model_that_is_not_frozen(verb):
    model = fs.Model({x: w - x}, forcing={w: sp.sin(t)}, interfaces={"x": x})
    with pytest.raises(fs.ModelError, match=r"'w' still varies in time; .* model\.frozen\(\)"):
        verb(model)
    with pytest.raises(fs.ModelError, match=r"no value; give one, as in .*w=…"):
        verb(model.frozen())


def test_singular_and_plural():
    one = fs.Model({x: w - x}, forcing={w: sp.sin(t)})
    two = fs.Model({x: w - x + u}, forcing={w: sp.sin(t), u: sp.cos(t)})
    with pytest.raises(fs.ArgumentError, match="derive: w still varies in time"):
        fs.derive(one)
    with pytest.raises(fs.ArgumentError, match="derive: w, u still vary in time"):
        fs.derive(two)


def test_articles():
    with pytest.raises(fs.ArgumentError, match="expected a Diagram, received an Overlay"):
        fs.plot.diagram(results()["overlay"], x="p", y="x")
    with pytest.raises(fs.ArgumentError, match="cannot pick in an Overlay of an Overlay"):
        fs.pick(results()["overlay"], results()["overlay"])


def test_a_sweep_of_a_ramp_at_rest_needs_a_period():
    ramp = fs.Model({x: w - x}, forcing={w: sp.sin(t)}).frozen().with_ramp("w", 0.0)
    message = "nothing in this model has a common period at w_start = 1; .* as period="
    with pytest.raises(fs.ArgumentError, match=message) as caught:
        fs.bifurcation_sweep(ramp, "w_start", [1.0, 2.0], [0.0])
    assert "t=" not in str(caught.value)
