"""Bad input: each an error that names the value and what was expected."""

import math

import numpy as np
import pytest
import sympy as sp

from fastslow.errors import ArgumentError, UnknownNameError
from fastslow.model.model import Model
from fastslow.simulation.many import simulate_many
from fastslow.simulation.one import simulate
from fastslow.simulation.settings import Integration


@pytest.mark.parametrize(
    ("state", "message"),
    [
        ([0], r"shape \(1,\); expected 2 values, for x, v"),
        ([0, 0, 0], r"shape \(3,\)"),
        ([[0, 0]], r"shape \(1, 2\)"),
        ([0, math.nan], "initial v = nan; expected a finite number"),
        ([math.inf, 0], "initial x = inf"),
        (["a", 0], "expected numbers"),
        ({"x": 1}, "no value for v"),
    ],
)
def test_initial_state(gear, state, message):
    with pytest.raises(ArgumentError, match=message):
        simulate(gear, state, t=(0, 1))


def test_initial_state_by_unknown_name(gear):
    with pytest.raises(UnknownNameError, match="unknown state 'w'"):
        simulate(gear, {"x": 0, "w": 0}, t=(0, 1))


@pytest.mark.parametrize(
    ("keywords", "message"),
    [
        ({}, "received neither"),
        ({"t": (0, 1), "periods": 2}, "received both"),
        ({"t": (0, 0)}, r"t = \(0, 0\); expected two different finite times"),
        ({"t": (0, math.inf)}, "finite times"),
        ({"t": 5}, r"expected a pair \(start, end\)"),
        ({"t": (0, 1), "t0": 2}, "t0= goes with periods="),
        ({"periods": 0}, "periods = 0; expected a positive number"),
        ({"periods": 1, "period": -1}, "period = -1; expected a positive"),
        ({"periods": 1, "t0": math.nan}, "t0 = nan"),
        ({"t": (0, 1), "integration": 1e-9}, "integration: expected an Integration"),
        ({"t": (0, 1), "samples": 1}, "samples = 1"),
        ({"t": (0, 1), "samples": [0.5, 0.2]}, "increasing"),
        ({"t": (0, 1), "samples": [0.5, 2.0]}, r"are outside the run, \[0, 1\]"),
    ],
)
def test_span_and_settings(gear, keywords, message):
    with pytest.raises(ArgumentError, match=message):
        simulate(gear, [0, 0], **keywords)


@pytest.mark.parametrize(
    ("keywords", "message"),
    [
        ({"rtol": 0}, "rtol = 0; expected a positive number"),
        ({"rtol": 1}, "rtol = 1; expected a number from 1e-16 to 0.1"),
        ({"order": 2}, "order = 2; expected an integer from 4 to 40"),
        ({"order": 8.5}, "order = 8.5; expected an integer"),
        ({"implicit": 1}, "implicit = 1; expected True or False"),
        ({"max_steps": 0}, "max_steps = 0"),
        ({"max_crossings": None}, "max_crossings = None; expected an integer"),
    ],
)
def test_settings(keywords, message):
    with pytest.raises(ArgumentError, match=message):
        Integration(**keywords)


@pytest.mark.parametrize(
    ("atol", "error", "message"),
    [
        ({"y": 1e-9}, UnknownNameError, "unknown state 'y'"),
        ({"w": 1e-9}, UnknownNameError, "unknown state 'w'"),
        ([1e-9], ArgumentError, "atol: received 1 values; expected 2, for x, v"),
    ],
)
def test_absolute_tolerances_are_of_the_states(gear, atol, error, message):
    settings = Integration(atol=atol)
    for call in (simulate, simulate_many):
        with pytest.raises(error, match=message):
            call(gear, [0, 0], t=(0, 1), integration=settings)


def test_absolute_tolerances_by_name_and_in_order(gear):
    by_name = simulate(gear, [0, 0], t=(0, 9), integration=Integration(atol={"v": 1e-3, "x": 0}))
    in_order = simulate(gear, [0, 0], t=(0, 9), integration=Integration(atol=[0, 1e-3]))
    assert np.array_equal(by_name.steps, in_order.steps)
    assert by_name.settings["atol"] == {"x": 0.0, "v": 1e-3}
    some = simulate(gear, [0, 0], t=(0, 9), integration=Integration(atol={sp.Symbol("v"): 1e-3}))
    assert some.settings["atol"] == {"v": 1e-3}
    coarse = simulate(gear, [0, 0], t=(0, 9), integration=Integration(atol=1e-3))
    assert len(coarse.steps) < len(simulate(gear, [0, 0], t=(0, 9)).steps)


def test_a_run_keeps_its_settings(gear):
    run = simulate(gear, [0, 0], t=(0, 1), integration=Integration(rtol=1e-12, max_steps=9))
    expected = {"rtol": 1e-12, "atol": None, "order": 24, "implicit": True, "max_steps": 9}
    assert run.settings == {**expected, "max_crossings": 1_000_000}
    many = simulate_many(gear, [0, 0], t=(0, 1))
    expected = {"rtol": 1e-9, "atol": None, "order": 16, "implicit": False, "max_steps": 1_000_000}
    assert many.settings == {**expected, "max_crossings": 1_000_000}


def test_no_common_period():
    x, w, t = sp.symbols("x w t")
    model = Model({x: w - x}, forcing={w: sp.sin(t) + sp.sin(sp.sqrt(2) * t)})
    with pytest.raises(ArgumentError, match=r"give t=\(start, end\), or the period as period="):
        simulate(model, [0], periods=2)
    run = simulate(model, [0], periods=2, period=3.0, t0=1.0)
    assert run.span == (1.0, 7.0)


def test_frozen_model_without_a_value(gear):
    with pytest.raises(ArgumentError, match="w of this frozen model has no value"):
        simulate(gear.frozen(), [0, 0], t=(0, 1))


def test_symbols_and_arrays_are_welcome(gear):
    x, v = sp.symbols("x v")
    one = simulate(gear, {x: 0.1, v: 0}, t=(0, sp.pi))
    other = simulate(gear, np.array([0.1, 0]), t=np.array([0, math.pi]))
    assert np.array_equal(one.end, other.end)


@pytest.mark.parametrize("span", [{"t": (1e17, 1e17 + 100)}, {"periods": 1, "t0": 1e16}])
def test_a_span_in_which_times_cannot_be_told_apart(span):
    x, v, t = sp.symbols("x v t")
    model = Model({x: v, v: sp.sin(t) - x})
    with pytest.raises(ArgumentError, match=r"in double precision times here are .* apart"):
        simulate(model, [1, 0], **span)
