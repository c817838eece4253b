"""Taylor coefficients against mpmath's numerical differentiation of the same functions."""

import mpmath
import numpy as np
import pytest
import sympy as sp

from fastslow.errors import ModelError
from fastslow.kernels.compiler.model_code import load_function
from fastslow.kernels.taylor.recurrences import FUNCTIONS as SUMS
from fastslow.kernels.taylor.series import compile_series, motion_source
from fastslow.model.known_functions import CLOSED, ELEMENTARY, IN_MPMATH
from fastslow.model.model import Model
from fastslow.model.recurrences import scalar_code

pytestmark = pytest.mark.slow

t, x, a = sp.symbols("t x a", real=True)
ORDER = 12

# u(t) stays inside every function's domain near t = 0.3
U = sp.Rational(2, 5) + t / 3 + t**2 / 7
ARGUMENTS = {
    **{f: (U, 1 + t**2) for f, one in ELEMENTARY.items() if one.arguments == 2},
    sp.LambertW: (-U / 3, -1),
    sp.expint: (2, U),
    sp.uppergamma: (a + 1, U),
    sp.lowergamma: (a + 1, U),
}
LARGE = {sp.acosh, sp.acoth, sp.asec, sp.acsc, sp.li}
FUNCTIONS = sorted(ELEMENTARY | CLOSED, key=lambda f: f.__name__)
EXPRESSIONS = {
    "real power": (1 + U) ** sp.Rational(7, 3),
    "root": sp.sqrt(2 + U),
    "inverse root": 1 / sp.sqrt(2 + U),
    "seventh power": U**7,
    "negative power": (1 + U) ** -3,
    "quotient": (1 + t**3) / (2 + U**2),
    "product of three": U * (1 + t) * sp.exp(-U),
    "variable power": (1 + U) ** (a * t),
    "parameter power": (2 + a) ** U,
    "steady phase": sp.sin(a * t + 1) * sp.cos(3 * t),
    "nested": sp.exp(sp.sin(U) ** 2) / (1 + sp.tanh(U)),
    "constant": 3 * a + t * 0,
    "powers of t": t**3 - 2 * t + sp.Rational(1, 3),
}


def coefficients(laws):
    """Compiled coefficients at t = 0.3 of several slow quantities."""
    names = [f"q{i}" for i in range(len(laws))]
    model = Model({x: 1}, forcing=dict(zip(names, laws, strict=True)), parameters={a: 0.7})
    compiled = compile_series(model, ORDER)
    out = np.empty(compiled.n_rows * (ORDER + 1))
    call(compiled.address, 0, np.array([0.3, 0.0]), compiled.parameter_array(model), out)
    return out.reshape(-1, ORDER + 1)[1 : 1 + len(laws)]


def call(address, mode, inputs, parameters, out):
    import ctypes

    pointer = ctypes.POINTER(ctypes.c_double)
    function = ctypes.CFUNCTYPE(None, ctypes.c_int64, pointer, pointer, pointer)(address)
    function(mode, *(array.ctypes.data_as(pointer) for array in (inputs, parameters, out)))


def expected(law):
    function = sp.lambdify(t, law.subs(a, sp.Rational(7, 10)), [IN_MPMATH, "mpmath"])
    with mpmath.workdps(20):
        return [float(c) for c in mpmath.taylor(function, mpmath.mpf("0.3"), ORDER)]


def test_every_function():
    laws = [f(*ARGUMENTS.get(f, (U + 2 if f in LARGE else U,))) for f in FUNCTIONS]
    for law, found in zip(laws, coefficients(laws), strict=True):
        reference = np.array(expected(law))
        scale = 2.0 ** -np.arange(ORDER + 1)
        assert np.abs((found - reference) * scale).max() < 2e-13 * (1 + abs(reference[0])), law


def test_every_operation():
    for law, found in zip(
        EXPRESSIONS.values(), coefficients(list(EXPRESSIONS.values())), strict=True
    ):
        reference = np.array(expected(law))
        scale = 2.0 ** -np.arange(ORDER + 1)
        assert np.abs((found - reference) * scale).max() < 1e-13 * (1 + abs(reference[0])), law


def test_called_sums_have_the_bits_of_loops_in_place():
    laws = {f"q{k}": law for k, law in enumerate(EXPRESSIONS.values())}
    model = Model({x: -sp.sqrt(2 + x**2) * x}, forcing=laws, parameters={a: 0.7})
    (motion,) = model.operations.motions
    found = []
    for called in (False, True):
        body, n_rows = motion_source(model.operations, motion, ORDER, called=called)
        names = [f"p{k} = parameters[{k}]" for k in range(model.operations.n_values)]
        lines = [f"n = {ORDER}", *names, *body]
        source = "def terms(mode, inputs, parameters, W):\n    " + "\n    ".join(lines) + "\n"
        address = load_function(f"{SUMS}\n\n{source}" if called else source, "terms")
        out = np.zeros(n_rows * (ORDER + 1))
        call(address, 0, np.array([0.3, 0.2]), np.array([0.7]), out)
        found.append(out)
    assert "product(W, s, k, " in source
    assert np.isfinite(found[0]).all()
    assert found[0].tobytes() == found[1].tobytes()


@pytest.mark.parametrize(
    ("rate", "said"),
    [
        (sp.mathieuc(1, 2, x), r"contain mathieuc, which cannot be .*; expected one of .*gamma"),
        (sp.gamma(x) - sp.mathieuc(1, 2, x), r"contain mathieuc, which cannot be compiled"),
        (sp.LambertW(x, 2), r"LambertW cannot be compiled .* branch must be 0 or -1"),
        (sp.expint(x, 2), r"expint cannot be compiled .* whole number"),
        (sp.zeta(x, 2), r"zeta cannot be compiled .* number of arguments"),
        (sp.gamma(x) + sp.Derivative(sp.zeta(x), x), r"contain the derivative of zeta"),
    ],
)
def test_what_cannot_be_compiled_is_named(rate, said):
    with pytest.raises(ModelError, match=said):
        compile_series(Model({x: rate}), 12)


def test_new_values_compile_nothing(tmp_path, monkeypatch):
    model = Model({x: -a * x}, parameters={a: 1})
    compiled = compile_series(model, ORDER)
    monkeypatch.setattr("fastslow.kernels.taylor.series.load_function", None)
    assert compile_series(model.with_parameters(a=2), ORDER) is compiled


def test_names_do_not_reach_the_source():
    # names that are Python keywords, or the generated source's own
    lam, W, mode = sp.symbols("lambda W mode", real=True)
    compiled = compile_series(Model({W: -lam * W + mode}, parameters={lam: 2, mode: 1}), ORDER)
    assert compiled.parameters == ("lambda", "mode")


@pytest.mark.parametrize("number", [sp.Integer(10) ** 30, sp.Rational(1, 3), sp.pi, sp.E])
def test_numbers_are_floats(number):
    import math

    assert eval(scalar_code(number), {"math": math}) == float(number)
