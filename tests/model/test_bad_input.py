"""Errors name what was received, what was expected, and the nearest valid name."""

import math

import pytest
import sympy as sp

import fastslow as fs
from fastslow import ArgumentError, FastSlowError, Model, ModelError, UnknownNameError

x, v, w, t, omga, omega, D = sp.symbols("x v w t omga omega D")
X = sp.Function("x")(t)


@pytest.fixture(scope="module")
def fast(gear):
    return gear.frozen()


def test_unknown_symbol():
    message = "rate of x: unknown symbol 'omga'; did you mean 'omega'"
    with pytest.raises(ModelError, match=message):
        Model({x: -omga * x}, parameters={omega: 1})


def test_symbol_without_value():
    with pytest.raises(ModelError, match=r"rate of x: unknown symbol 'omega'.*parameter with a"):
        Model({x: -omega * x})
    with pytest.raises(ModelError, match="law of w: unknown symbol 'omega'"):
        Model({x: w}, forcing={w: sp.sin(omega * t)})


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, "a", None, 1j])
def test_values_that_are_no_finite_numbers(value):
    with pytest.raises(ModelError, match="parameter D: expected a finite number, received") as e:
        Model({x: -D * x}, parameters={D: value})
    assert repr(value) in str(e.value)
    with pytest.raises(ModelError, match="parameter D: expected a finite number, received"):
        Model({x: -D * x}, parameters={D: 1}).with_parameters(D=value)


@pytest.mark.parametrize("rate", [sp.oo * x, sp.nan, sp.I * x, sp.zoo])
def test_rates_that_are_not_finite(rate):
    with pytest.raises(ModelError, match="rate of x: expected a finite real expression"):
        Model({x: rate})


@pytest.mark.parametrize("number", [sp.Integer(10) ** 400, -sp.Rational(1, 10**400)])
def test_numbers_out_of_the_range_of_floating_point(number):
    with pytest.raises(ModelError, match=r"rate of x: the number -?1.00E.400 is not in the range"):
        Model({x: number * x - 1})


def test_other_things_that_are_no_model():
    with pytest.raises(ModelError, match="at least one state"):
        Model({})
    with pytest.raises(ModelError, match="'t' is time"):
        Model({t: 1})
    with pytest.raises(ModelError, match="'x' is both a state and a parameter"):
        Model({x: -x}, parameters={x: 1})
    with pytest.raises(ModelError, match="rate of x: expected an expression"):
        Model({x: x > 0})
    with pytest.raises(ModelError, match="region r: expected a condition such as x > D"):
        Model({x: sp.Abs(x)}, regions={"r": x + 1})


@pytest.mark.parametrize(
    "rates", [{X: -X}, {x: -X}, {x: -sp.Function("f")(x)}], ids=["x(t)", "mixed", "f(x)"]
)
def test_functions_without_a_definition(rates):
    with pytest.raises(ModelError, match=r"[xf]\([tx]\) is a function without a definition"):
        Model(rates)


def test_unknown_parameter(gear):
    message = r"unknown parameter 'omga'; did you mean 'omega'\? \(known: A, B, C, D, omega\)"
    with pytest.raises(UnknownNameError, match=message):
        gear.with_parameters(omga=1)
    with pytest.raises(UnknownNameError, match="did you mean 'omega'"):
        gear.parameters["omga"]


def test_regions_that_contradict():
    with pytest.raises(ModelError, match="regions 'a' and 'b' overlap"):
        Model({x: sp.Abs(x)}, regions={"a": x > 0, "b": x > 0})
    message = r"region 'far' \(x > 5\): x - 5 = 0 decides a branch but is not one of .*: x$"
    with pytest.raises(ModelError, match=message):
        Model({x: sp.Abs(x)}, regions={"far": x > 5})
    with pytest.raises(ModelError, match=r"region 'far' .* is empty or unknown"):
        Model({x: sp.Abs(x)}, regions={"far": sp.And(x > 0, x < 0)})


def test_errors_have_one_base():
    for error in (ArgumentError, ModelError, UnknownNameError):
        assert issubclass(error, FastSlowError)
    assert issubclass(UnknownNameError, KeyError)
    assert issubclass(ModelError, ValueError)


@pytest.mark.parametrize("over", [(1, 1), (2, -1), (0, math.inf), (math.nan, 1), (0, 1, 2), 3])
def test_ranges(fast, over):
    with pytest.raises(ArgumentError, match=r"over|range"):
        fs.continue_equilibria(fast, "w", over=over)


def test_continuation_parameter(fast):
    with pytest.raises(UnknownNameError, match="unknown parameter 'ww'; did you mean 'w'"):
        fs.continue_equilibria(fast, "ww", over=(-1, 1))


def test_a_model_that_is_not_frozen(gear):
    with pytest.raises(ModelError, match=r"'w' still varies in time.*frozen\(\)"):
        fs.continue_equilibria(gear, "w", over=(-1, 1))


@pytest.mark.parametrize("start", [[0.0], [0.0, 0.0, 0.0], 1.0])
def test_state_of_the_wrong_length(gear, start):
    with pytest.raises(ArgumentError, match=r"2|x, v"):
        fs.simulate(gear, start, t=(0, 1))


def test_a_start_that_is_not_finite(gear):
    with pytest.raises(ArgumentError, match="nan"):
        fs.simulate(gear, [0.0, math.nan], t=(0, 1))


def test_periods_without_a_period():
    with pytest.raises(ArgumentError, match=r"period.*t="):
        fs.simulate(Model({x: -x}), [1.0], periods=3)


@pytest.mark.parametrize("span", [(1, 1), (0, -math.inf), (0, math.inf)])
def test_time_spans(gear, span):
    with pytest.raises(ArgumentError):
        fs.simulate(gear, [0, 0], t=span)


def test_values_of_the_frozen_parameter(fast):
    with pytest.raises(FastSlowError, match=r"unknown parameter 'ww'; did you mean 'w'"):
        fs.equilibria(fast, ww=1)
    with pytest.raises(FastSlowError, match="w"):
        fs.equilibria(fast)
    with pytest.raises(FastSlowError, match="finite"):
        fs.equilibria(fast, w=math.nan)


@pytest.mark.parametrize("function", [sp.floor, sp.ceiling, sp.frac, lambda z: sp.Mod(z, 1)])
def test_functions_with_infinitely_many_jumps(function):
    state, rate = sp.symbols("x k")
    with pytest.raises(ModelError, match=r"rate of x: .* jumps at infinitely many values"):
        fs.Model({state: -function(state)})
    # of a parameter it is a number
    assert fs.Model({state: -function(rate) * state}, parameters={rate: 2.5}).states == ("x",)


@pytest.mark.parametrize(
    "condition", [sp.Contains(x, sp.Interval(0, 1)), ~sp.Contains(x, sp.S.Naturals)]
)
def test_a_condition_that_is_no_inequality(condition):
    with pytest.raises(fs.ModelError, match="cannot read the condition Contains"):
        fs.Model({x: sp.Piecewise((x, condition), (-x, True))})
