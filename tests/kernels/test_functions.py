"""Values of functions without a Taylor recurrence against mpmath."""

import mpmath
import numpy as np
import pytest
import sympy as sp

from fastslow.kernels.taylor.series import compile_series
from fastslow.model.known_functions import IN_MPMATH, OPEN, without_recurrence
from fastslow.model.model import Model
from tests.kernels.test_recurrences import call

pytestmark = pytest.mark.slow

t, x, a = sp.symbols("t x a", real=True)
HALF = sp.Rational(1, 2)
TIMES = (0.05, 0.3, 0.8, 2.5)
LAWS = {
    sp.gamma: [sp.gamma(t)],
    sp.loggamma: [sp.loggamma(t)],
    sp.polygamma: [sp.polygamma(n, t) for n in (0, 1, 2, 5)] + [sp.polygamma(3, t - 4)],
    sp.beta: [sp.beta(t, 1 + t**2)],
    sp.factorial: [sp.factorial(t)],
    sp.zeta: [sp.zeta(t + 2), sp.zeta(-t)],
    sp.besselj: [sp.besselj(0, t), sp.besselj(2, 5 * t), sp.besselj(HALF, t), sp.besselj(a, t)],
    sp.bessely: [sp.bessely(1, t)],
    sp.besseli: [sp.besseli(a, t)],
    sp.besselk: [sp.besselk(0, t)],
    sp.elliptic_k: [sp.elliptic_k(t / 3), sp.elliptic_k(-t)],
    sp.elliptic_f: [sp.elliptic_f(t / 2, HALF)],
    sp.elliptic_e: [sp.elliptic_e(t / 3), sp.elliptic_e(t / 2, HALF)],
    sp.Si: [sp.Si(t)],
    sp.Shi: [sp.Shi(t)],
    # with a recurrence only in other arguments
    sp.uppergamma: [sp.uppergamma(t, 1 + t)],
    sp.lowergamma: [sp.lowergamma(t, a)],
}


def test_every_function_is_tried():
    assert set(OPEN) <= set(LAWS)


def test_values():
    laws = [law for group in LAWS.values() for law in group]
    model = Model({x: 1}, forcing={f"q{i}": law for i, law in enumerate(laws)}, parameters={a: 0.7})
    compiled = compile_series(model, 16)
    assert set(compiled.values_only) == {f.__name__ for f in LAWS}
    columns = compiled.order + 1
    out = np.empty(compiled.n_rows * columns)
    for time in TIMES:
        call(compiled.address, 0, np.array([time, 0.0]), compiled.parameter_array(model), out)
        found = out[columns : columns * (1 + len(laws)) : columns]
        for law, value in zip(laws, found, strict=True):
            function = sp.lambdify(t, law.subs(a, sp.Rational(7, 10)), [IN_MPMATH, "mpmath"])
            with mpmath.workdps(30):
                exact = float(mpmath.re(function(mpmath.mpf(time))))
            assert value == pytest.approx(exact, rel=3e-13, abs=3e-14), (law, time)


@pytest.mark.parametrize(
    ("argument", "branch", "exact"),
    [(-1 / np.e, 0, -1.0), (0.0, 0, 0.0), (np.e, 0, 1.0), (-2 * np.exp(-2), -1, -2.0)],
)
def test_the_branch_point_and_other_known_values_of_lambert(argument, branch, exact):
    compiled = compile_series(Model({x: sp.LambertW(a, branch)}, parameters={a: 1}), 4)
    out = np.empty(compiled.n_rows * 5)
    call(compiled.address, 0, np.zeros(2), np.array([argument]), out)
    # 1 ulp of the argument is worth its root at the branch point
    assert out[1] == pytest.approx(exact, abs=3e-8 if exact == -1.0 else 1e-15)


def test_functions_of_parameters_need_no_recurrence():
    assert without_recurrence(sp.gamma(a) * sp.sin(x), {x}) == set()
    assert without_recurrence(sp.uppergamma(a, x), {x}) == set()
    assert without_recurrence(sp.uppergamma(x, a), {x}) == {"uppergamma"}
    compiled = compile_series(Model({x: -sp.gamma(a) * x}, parameters={a: 3}), 16)
    assert compiled.values_only == ()
    assert compiled.order == 16
