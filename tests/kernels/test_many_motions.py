"""One code for the motions of many regions, against a code for each of them."""

import ctypes

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.kernels.taylor import many_motions, series
from fastslow.kernels.taylor.many_motions import shared
from fastslow.kernels.taylor.saturation import saturations

pytestmark = pytest.mark.slow

ORDER = 6
X = sp.symbols("x:6")
w, a, t = sp.symbols("w a t")


def chain(extra=0):
    """Three states, each with a condition of its own."""
    bent = [sp.Max(0, X[2] - a) / 3 + sp.tanh(sp.Abs(X[0]))]
    bent += [sp.Abs(X[k] - 1) ** 3 - sp.exp(-X[k - 1]) for k in (1, 2)]
    return {x: rate - 2 * x + extra for x, rate in zip(X, bent, strict=False)}


MODELS = {
    "continuous": fs.Model(chain(), parameters={a: 0.3}),
    "forced": fs.Model(
        chain(w * X[0]), forcing={w: sp.sin(t) * sp.exp(sp.cos(t))}, parameters={a: 0.3}
    ),
    "Filippov": fs.Model(
        {x: X[1 - k] ** 1.5 - x - (k + 1) * sp.sign(x - a * k) for k, x in enumerate(X[:2])},
        parameters={a: 0.3},
    ),
}


def filled(source, operations, rows, mode, inputs, parameters):
    entry = ctypes.CFUNCTYPE(None, ctypes.c_int64, *[ctypes.c_void_p] * 3)
    W = np.full(rows * (ORDER + 1), 7.0)
    m = operations.sizes[0]
    W[np.arange(m) * (ORDER + 1) + 1] = inputs[1 : 1 + m]
    entry(int(source))(mode, inputs.ctypes.data, parameters.ctypes.data, W.ctypes.data)
    return W.reshape(rows, ORDER + 1)


@pytest.mark.parametrize("name", MODELS)
def test_all_motions_have_the_same_series_to_the_last_bit(name, monkeypatch):
    monkeypatch.setattr(many_motions, "FEWEST_MOTIONS", 2)
    monkeypatch.setattr(many_motions, "SHARED_BY", 0.75)
    model = MODELS[name]
    operations = model.operations
    many = shared(operations)
    assert any(many.own)
    assert many.common
    series._compiled.cache_clear()
    together = series.compile_series(model, ORDER)
    series._compiled.cache_clear()
    for found, motion, new in zip(together.saturating, operations.motions, many.rows, strict=True):
        assert {*found} - {-1} == {new[one.row] for one in saturations(motion)}
    source, rows = series._source(operations, None, ORDER)
    apart = series.load_function(source, "series")
    rows = max(rows, together.n_rows)
    (m, q, p), number = operations.sizes, len(operations.motions) + operations.sizes[2]
    random = np.random.default_rng(3)
    parameters = together.parameter_array(model)
    for mode, motion in enumerate(operations.motions):
        kept = m + len(motion.outputs)
        for form, columns, compared in (
            (0, ORDER + 1, kept),
            (1, 5, m + q + p),
            (2, 2, m),
            (3, 3, m),
        ):
            inputs = np.abs(random.normal(size=1 + m + q))
            given = operations, rows, mode + form * number, inputs, parameters
            one, other = filled(together.address, *given), filled(apart, *given)
            assert np.array_equal(
                one[:compared, :columns], other[:compared, :columns], equal_nan=True
            )


def test_rare_operations_stand_in_their_motions_alone():
    # 5 conditions in one rate: every region has a sum of its own
    rate = sum(sp.Abs(x) for x in X) - X[0] ** 3
    operations = fs.Model({x: (rate if x == X[0] else -x) for x in X}).operations
    many = shared(operations)
    assert {len(own) for own in many.own} == {1}
    assert len(many.common) < 40


def test_few_motions_keep_a_code_for_each():
    assert shared(fs.Model({x: -sp.Abs(x) for x in X[:5]}).operations) is None


def test_a_factor_of_time_that_only_coefficients_above_the_first_contain():
    """Common rows of time: the slope -2/c of the exponential is in no value of a motion."""
    rates = {f"x{k}": f"exp(-2*(t - 1)/c) - x{k} + Max(x{k} - {k}, 0)" for k in range(1, 8)}
    model = fs.Model(rates, parameters={"c": 2})
    run = fs.simulate(model, [0.0] * 7, t=(0, 1))
    # x' = e exp(-t) - x
    assert run(1.0)[0] == pytest.approx(1.0, rel=1e-9)
