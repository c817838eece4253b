"""Quotients with a removable singularity in compiled series and fields, against mpmath."""

import mpmath
import numpy as np
import pytest
import sympy as sp

from fastslow.diagrams.points.jets import JetSpace
from fastslow.kernels.field_code import parameter_array
from fastslow.kernels.fields import compile_field
from fastslow.kernels.taylor.series import compile_series
from fastslow.model.model import Model
from fastslow.model.removable import REMOVABLE
from fastslow.results.io.files import load
from fastslow.simulation.one import simulate
from fastslow.simulation.settings import Integration
from tests.kernels.test_recurrences import call
from tests.removable_reference import derivatives

pytestmark = pytest.mark.slow

x, y, t = sp.symbols("x y t", real=True)
ORDER = 30
STARTS = (0.0, 1e-300, -1e-16, 1e-8, -1e-3, 1.0, -3.3, 50.0, 700.0)
WRITTEN = {
    "exp_quotient": x / (sp.exp(x) - 1),
    "sinh_quotient": sp.sinh(x) / x,
    "sin_quotient": sp.sin(x) / x,
    "log_quotient": sp.log(1 + x) / x,
}


def compiled_rows(model, state, order):
    compiled = compile_series(model, order)
    out = np.empty(compiled.n_rows * (order + 1))
    call(compiled.address, 0, np.array([0.0, *state]), compiled.parameter_array(model), out)
    return out.reshape(-1, order + 1)


@pytest.mark.sample(2)
@pytest.mark.parametrize("name", WRITTEN)
def test_every_coefficient_along_a_line(name):
    """x = x0 + t: the coefficients are f^(k)(x0)/k!, to 3e-15 of the largest near x0."""
    model = Model({x: 1, y: WRITTEN[name]})
    shift = 1 if name == "log_quotient" else 0
    starts = [s for s in STARTS if s > -1] if shift else STARTS
    for start in starts:
        rows = compiled_rows(model, (start, 0.0), ORDER)
        exact = derivatives(name, mpmath.mpf(start) + shift, ORDER)
        beside = [z for z in (start - 1, start + 1) if not shift or z > -0.999]
        near = [derivatives(name, mpmath.mpf(z) + shift, ORDER) for z in beside]
        for k in range(ORDER):
            largest = max(abs(d[k]) for d in (exact, *near)) / mpmath.factorial(k + 1)
            error = abs(mpmath.mpf(rows[1, k + 1]) - exact[k] / mpmath.factorial(k + 1))
            # the coefficient of y is that of the quotient, divided by k + 1; rows near 1e-300
            # have an argument that is rounded
            assert error <= 3e-15 * largest + 1e-300, (start, k)


@pytest.mark.parametrize("name", WRITTEN)
def test_composed_with_a_curved_argument(name):
    """x = x0 + sin t, against the product of power series in mpmath."""
    order = 16
    model = Model({x: sp.cos(t), y: WRITTEN[name]})
    shift = 1 if name == "log_quotient" else 0
    for start in (0.0, 1e-9, 0.3):
        rows = compiled_rows(model, (start, 0.0), order)
        outer = derivatives(name, mpmath.mpf(start) + shift, order)
        inner = mpmath.taylor(mpmath.sin, 0, order)
        power, total = [mpmath.mpf(1)] + [mpmath.mpf(0)] * order, [mpmath.mpf(0)] * (order + 1)
        for k in range(order + 1):
            for j in range(order + 1):
                total[j] += outer[k] / mpmath.factorial(k) * power[j]
            power = [
                mpmath.fsum(power[i] * inner[j - i] for i in range(j + 1)) for j in range(order + 1)
            ]
        for k in range(order):
            assert rows[1, k + 1] == pytest.approx(float(total[k] / (k + 1)), rel=0, abs=2e-15)


def test_compiled_fields_and_jets_at_the_singular_point():
    a = sp.Symbol("a", real=True)
    model = Model({x: WRITTEN["exp_quotient"] - a * WRITTEN["sin_quotient"]}, parameters={a: 2})
    compiled = compile_field(model, "a")
    for value in (0.0, 1e-17, -1e-9, 1e-5, 0.4):
        u, out = np.array([value, 2.0]), np.empty(compiled.size)
        call(compiled.address, 0, u, parameter_array(model, (*compiled.parameters, "a")), out)
        one, other = (derivatives(n, value, 3) for n in ("exp_quotient", "sin_quotient"))
        expected = [one[0] - 2 * other[0], one[1] - 2 * other[1], -other[0]]
        assert out[:3] == pytest.approx([float(e) for e in expected], rel=0, abs=4e-16)
        space = JetSpace(1, 3)
        rate = model.regions["S1"].rates["x"]
        jet = space.evaluate(
            rate, {x: space.constant(value) + space.variable(0), a: space.constant(2)}
        )
        expected = [(one[k] - 2 * other[k]) / mpmath.factorial(k) for k in range(4)]
        assert jet.real == pytest.approx([float(e) for e in expected], rel=0, abs=4e-16)


def test_a_run_through_the_singular_point():
    """x' = x/(exp(x) - 1) from x = -3, and from 0; the time is the integral of the inverse."""
    model = Model({x: WRITTEN["exp_quotient"]})
    for start in (-3.0, 0.0):
        run = simulate(model, [start], t=(0, 6), integration=Integration(rtol=1e-14))
        for time in (2.0, 6.0):
            end = run(time)[0]
            elapsed = mpmath.quad(lambda s: mpmath.expm1(s) / s if s else 1, [start, 0, end])
            assert float(elapsed) == pytest.approx(time, rel=1e-13)


def test_stored_runs_go_on_and_back(tmp_path):
    model = Model({x: 1 - x * x / (sp.exp(x) - 1), y: sp.log(2 + x) / (1 + x) - y})
    run = simulate(model, [-0.5, 0.2], t=(0, 2))
    run.save(tmp_path / "run.npz")
    stored = load(tmp_path / "run.npz").model
    again = simulate(stored, [-0.5, 0.2], t=(0, 2))
    assert np.array_equal(again.end, run.end)
    back = simulate(stored, run.end[1:], t=(2, 0))
    assert back(0.0) == pytest.approx([-0.5, 0.2], abs=1e-10)


def test_every_quotient_is_tried():
    assert {quotient.stored for quotient in REMOVABLE} == set(WRITTEN)
