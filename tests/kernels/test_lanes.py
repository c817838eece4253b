"""Functions of lanes, against the same functions of single numbers."""

import ctypes
import math
from functools import partial

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from llvmlite import ir

from fastslow.kernels.compiler.machine_code import load_object, object_code
from fastslow.kernels.compiler.native import ENTRY
from fastslow.kernels.simd.functions import Mathematics, exp2, log2
from fastslow.kernels.simd.lane_steps import _by_bernstein, _by_moduli, _length
from fastslow.kernels.simd.lanes import WIDTH, Trace, Workspace, evaluated, polynomial

pytestmark = pytest.mark.slow


def compiled(function, count=1):
    """A function of lanes, from an array of shape (count, m) to one of shape (m,)."""

    def build(module):
        entry = ir.Function(module, ir.FunctionType(ir.VoidType(), ENTRY), "entry")
        before, step = (entry.append_basic_block(name) for name in ("before", "step"))
        trace = Trace(ir.IRBuilder(before), ir.IRBuilder(step))
        given, out = entry.args[1], entry.args[3]
        result = function(trace, *(trace.load(given, i) for i in range(count)))
        trace.store(result, out, 0)
        trace.before.branch(step)
        trace.builder.ret_void()

    kind = ctypes.CFUNCTYPE(None, ctypes.c_int64, *[ctypes.c_void_p] * 3)
    call = kind(address := load_object(object_code(build), "entry", {}))
    call.address = address  # the code is loaded as long as this is referenced

    def whole(*numbers):
        rows = np.array(np.broadcast_arrays(*numbers), dtype=float)
        m = rows.shape[1]
        padded = np.concatenate([rows, np.ones((count, -m % WIDTH))], axis=1)
        out = np.empty(padded.shape[1])
        for k in range(0, padded.shape[1], WIDTH):
            given = np.ascontiguousarray(padded[:, k : k + WIDTH])
            call(0, given.ctypes.data, None, out[k : k + WIDTH].ctypes.data)
        return out[:m]

    return whole


@pytest.fixture(scope="module")
def sine():
    return compiled(lambda trace, x: Mathematics(trace).sin(x))


@pytest.fixture(scope="module")
def cosine():
    return compiled(lambda trace, x: Mathematics(trace).cos(x))


@settings(max_examples=200)
@given(st.floats(-1e6, 1e6))
def test_sine_and_cosine_to_three_units_in_the_last_place(sine, cosine, x):
    with mpmath.workdps(40):
        for function, exact in ((sine, mpmath.sin), (cosine, mpmath.cos)):
            value = exact(mpmath.mpf(x))
            error = abs(mpmath.mpf(float(function([x])[0])) - value)
            assert error <= 3 * np.spacing(abs(float(value))) + 1e-21 * abs(x)


def test_sine_and_cosine_near_their_zeros(sine, cosine):
    x = np.arange(-40, 41) * (math.pi / 4)
    assert sine(x) == pytest.approx(np.sin(x), abs=1.2e-16)
    assert cosine(x) == pytest.approx(np.cos(x), abs=1.2e-16)
    assert sine([0.0, -0.0, 1e-300]).tolist() == [0.0, -0.0, 1e-300]
    # odd and even to the last bit
    x = np.linspace(0.1, 1e5, 4001)
    assert np.array_equal(sine(-x), -sine(x))
    assert np.array_equal(cosine(-x), cosine(x))


def test_a_lane_whose_argument_is_too_large_is_not_to_be_used():
    def usable(trace, x):
        Mathematics(trace).sin(x)
        return trace.conditions[0].choose(1.0, 0.0)

    assert compiled(usable)([0.0, -9e5, 2e6, np.inf, np.nan]).tolist() == [1, 1, 0, 0, 0]


@given(st.floats(1e-250, 1e250), st.floats(-900, 900))
def test_logarithm_and_power_to_four_digits(rough, x, y):
    logarithm, power = rough
    assert logarithm([x])[0] == pytest.approx(math.log2(x), abs=2e-5)
    assert power([y])[0] == pytest.approx(2.0**y, rel=2e-5)


@pytest.fixture(scope="module")
def rough():
    return compiled(lambda trace, x: log2(x)), compiled(lambda trace, y: exp2(y))


def test_other_functions_are_called_for_every_lane():
    def mixed(trace, x, y):
        m = Mathematics(trace)
        return m.sqrt(m.atan2(x, y)) + m.pow(x, 1.5) * m.tanh(y) - m.erf(x) / m.exp(0.5)

    x, y = np.array([0.3, 1.0, 2.5]), np.array([2.0, 0.1, 1.0])
    erf = np.array([math.erf(value) for value in x])
    expected = np.sqrt(np.arctan2(x, y)) + x**1.5 * np.tanh(y) - erf / math.exp(0.5)
    assert compiled(mixed, 2)(x, y) == pytest.approx(expected, rel=1e-15)


def test_sums_of_all_kinds():
    def mixed(trace, x, y):
        W = Workspace()
        W[0] = 2.0 - x
        s = 0.0
        s -= x * y
        s += 3.0 * x
        s += s
        W[1] = s + W[0] - 0.0 + 0.0 * y
        W[2] = -W[1] - x * y + (-1.0) * y
        return evaluated(1.0 / W[2]) + 0.0 / x + polynomial([x, 1.0, y], x) + abs(-x)

    x, y = np.linspace(-2, 2, 11) + 0.01, np.linspace(1, 3, 11)
    one = 6 * x - 2 * x * y + 2 - x
    expected = 1 / (-one - x * y - y) + x + x + y * x**2 + np.abs(x)
    assert compiled(mixed, 2)(x, y) == pytest.approx(expected, rel=1e-14)


def test_masks():
    def between(trace, x, y):
        inside = (x > 0.0) & (x <= y)
        edge = ~inside & ((x >= y) | (x < -1.0))
        return edge.choose(2.0, inside.choose(1.0, 0.0))

    x = np.array([-2.0, -1.0, 0.0, 0.5, 1.0, 1.5, np.nan])
    assert compiled(between, 2)(x, 1.0).tolist() == [2, 0, 0, 1, 1, 2, 0]


def test_a_closer_look_adds_where_one_lane_is_not_clear():
    def looked(trace, x):
        near = x < 5.0
        (result,) = trace.refined(near, [near], lambda: [x > 7.0])
        return result.choose(1.0, 0.0)

    look = compiled(looked)
    for first in (0.0, 5.0, 8.0):
        lanes = np.array([first, *np.linspace(0, 4, WIDTH - 1)])
        assert look(lanes).tolist() == [first != 5.0, *[True] * (WIDTH - 1)]


def test_invariants_are_computed_before_the_steps():
    def constant(trace, x):
        value = trace.lanes(2.0) * 3.0 + 1.0
        assert value.invariant
        assert not (value * x).invariant
        assert Mathematics(trace).sin(0.5).invariant
        return value * x + Mathematics(trace).cos(0.0)

    assert compiled(constant)([1.0, -2.0]).tolist() == [8, -13]


@pytest.mark.parametrize("rule", [_by_moduli, _by_bernstein])
def test_what_bounds_the_change_of_a_polynomial(rule):
    """Its values are within; of Bernstein coefficients the bounds are the extreme ones."""
    generator = np.random.default_rng(3)
    rows = generator.normal(size=(4, 400)) * np.array([[1.0], [2.0], [1.0], [0.5]])
    h = generator.uniform(0.1, 1.5, 400)
    least, most, single, one_sided = (
        compiled(lambda trace, *r, part=part: part(rule(r[:-1], r[-1])), 5)(*rows, h)
        for part in (
            lambda found: found[0],
            lambda found: found[1],
            lambda found: found[2].choose(1.0, 0.0),
            lambda found: found[3].choose(1.0, 0.0),
        )
    )
    places = h * np.linspace(0, 1, 201)[:, None]
    change = sum(rows[k] * places**k for k in (1, 2, 3))
    assert (change >= least - 1e-12).all()
    assert (change <= most + 1e-12).all()
    one_way = (np.diff(change, axis=0) > 0).all(axis=0) | (np.diff(change, axis=0) < 0).all(axis=0)
    assert 20 < single.sum() <= one_way.sum() < 400
    assert one_way[single == 1].all()
    # values after the beginning are on one side of it
    aside = (change[1:] > 0).all(axis=0) | (change[1:] < 0).all(axis=0)
    assert single.sum() < one_sided.sum() <= aside.sum() < 400
    assert aside[one_sided == 1].all()
    if rule is _by_bernstein:
        shares = [[math.comb(j, k) / math.comb(3, k) for k in (1, 2, 3)] for j in range(4)]
        values = np.array(shares) @ np.array([rows[k] * h**k for k in (1, 2, 3)])
        np.testing.assert_allclose(least, values.min(axis=0), atol=1e-13)
        np.testing.assert_allclose(most, values.max(axis=0), atol=1e-13)


def test_rows_that_differ_in_their_values_alone_are_judged_once():
    """By the smallest of their sizes: the length is that of all of them, with one division."""

    def length(trace, c, a, b, *, apart):
        rows = [[a, c, c, c, c], [b, *((c + 1.0) - 1.0 if apart else c for _ in range(4))]]
        tolerance = trace.lanes(-20.0)
        return _length(rows, [abs(a), abs(b)], tolerance, 4)[0]

    numbers = np.random.default_rng(1).integers(1, 2**20, (3, 200)) / 2.0**16
    together, apart = (
        compiled(partial(length, apart=apart), count=3)(*numbers) for apart in (False, True)
    )
    np.testing.assert_array_equal(together, apart)

    made = []

    def count(trace, c, a, b):
        divide = trace.operation
        trace.operation = lambda name, *given: made.append(name) or divide(name, *given)
        return length(trace, c, a, b, apart=False)

    compiled(count, count=3)
    assert made.count("fdiv") == 1
