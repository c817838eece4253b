"""Generated source that is translated to machine code, against Python's evaluation of it."""

import ast
import ctypes
import math
import textwrap

import mpmath
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from fastslow.kernels import special
from fastslow.kernels.compiler.chains import chosen
from fastslow.kernels.compiler.machine_code import load_object, object_code
from fastslow.kernels.compiler.native import UnknownSourceError, translate
from tests.samples import examples

pytestmark = pytest.mark.slow

KIND = ctypes.CFUNCTYPE(None, ctypes.c_int64, *[ctypes.c_void_p] * 3)


def compiled(source):
    """The function that is made of a source, with arrays as arguments."""
    code = object_code(lambda module: translate(source, module, special.names()))
    function = KIND(address := load_object(code, "entry", special.addresses()))
    function.address = address  # the code is loaded as long as this is referenced
    return function


def entry(body):
    return "def entry(mode, u, p, out):\n" + textwrap.indent(textwrap.dedent(body), "    ")


def run(body, u=(), mode=0, size=1):
    """What a body writes to its output."""
    given, out = np.array([*u, 0.0], dtype=float), np.full(size, 7.0)
    compiled(entry(body))(mode, given.ctypes.data, given.ctypes.data, out.ctypes.data)
    return out if size > 1 else float(out[0])


def same(a, b):
    """Whether two numbers have the same bits, or are no numbers."""
    return np.array_equal(np.float64(a).view(np.int64), np.float64(b).view(np.int64)) or (
        math.isnan(a) and math.isnan(b)
    )


NUMBERS = (0.0, -0.0, 1.5, -2.25, 1e-310, 1e300, math.inf, -math.inf, math.nan)


@pytest.mark.parametrize("sign", ["<", "<=", ">", ">=", "==", "!="])
def test_comparisons_of_all_pairs(sign):
    """What is no number differs from everything, and stands in no other relation."""
    function = compiled(entry(f"out[0] = 1.0 if u[0] {sign} u[1] else 0.0"))
    out = np.empty(1)
    for a in NUMBERS:
        for b in NUMBERS:
            given = np.array([a, b])
            function(0, given.ctypes.data, given.ctypes.data, out.ctypes.data)
            assert out[0] == eval(f"a {sign} b", {"a": a, "b": b}), (a, sign, b)


@pytest.mark.parametrize("sign", ["+", "-", "*", "/"])
def test_operations_of_all_pairs(sign):
    function = compiled(entry(f"out[0] = u[0] {sign} u[1]"))
    out = np.empty(1)
    for a in NUMBERS:
        for b in NUMBERS:
            given = np.array([a, b])
            function(0, given.ctypes.data, given.ctypes.data, out.ctypes.data)
            with np.errstate(all="ignore"):
                exact = eval(f"a {sign} b", {"a": np.float64(a), "b": np.float64(b)})
            assert same(out[0], exact), (a, sign, b)


@pytest.mark.parametrize("exponent", [0, 1, 2, 3, 5, 8, 13, -1, -2, -7])
def test_whole_powers_are_products(exponent):
    function = compiled(entry(f"out[0] = u[0]**{exponent}"))
    out = np.empty(1)
    for a in (*NUMBERS, 0.3, -1.7):
        given = np.array([a])
        function(0, given.ctypes.data, given.ctypes.data, out.ctypes.data)
        with np.errstate(all="ignore"):
            product, square, left = np.float64(1.0), np.float64(a), abs(exponent)
            while left:
                product = product * square if left & 1 else product
                square, left = square * square, left >> 1
            expected = product if exponent >= 0 else 1.0 / product
        assert same(out[0], expected), (a, exponent)


@pytest.mark.parametrize("exponent", ["0.5", "-0.5", "(3/2)", "1.0", "2.0", "u[1]"])
def test_other_powers_are_those_of_c(exponent):
    function = compiled(entry(f"out[0] = u[0]**{exponent}"))
    out = np.empty(1)
    for a in (*NUMBERS, 0.3, -1.7):
        given = np.array([a, -0.7])
        function(0, given.ctypes.data, given.ctypes.data, out.ctypes.data)
        with np.errstate(all="ignore"):
            expected = np.float64(a) ** eval(exponent, {"u": given})
        assert same(out[0], expected) or out[0] == pytest.approx(expected, rel=3e-16), a


def test_a_whole_number_to_a_real_power():
    assert run("out[0] = 2**u[0]", [0.5]) == pytest.approx(math.sqrt(2), rel=1e-15)
    assert run("out[0] = (-3)**u[0]", [2.0]) == 9.0


def test_literals_are_python_s():
    body = """
    out[0] = 2/3
    out[1] = 7//2 + 7%4 - -2
    out[2] = 2**-2
    out[3] = 9007199254740993 + 0*u[0]
    out[4] = -1/3*u[0]
    out[5] = math.pi + math.e
    out[6] = math.inf
    out[7] = +u[0]
    """
    expected = [2 / 3, 8.0, 0.25, 9007199254740992.0, -1 / 3 * 1.1, math.pi + math.e, math.inf, 1.1]
    assert run(body, [1.1], size=8).tolist() == expected


def test_whole_numbers():
    body = """
    for k in range(8):
        out[k] = (k + 1) // 2 + 10 * (k % 2) - (k - 3) // 4 + (k - 5) % 4 + -k
    """
    expected = [(k + 1) // 2 + 10 * (k % 2) - (k - 3) // 4 + (k - 5) % 4 - k for k in range(8)]
    assert run(body, size=8).tolist() == expected


def test_loops():
    body = """
    out[0] = 0.0
    for i in range(mode):
        s = 0.0
        for j in range(i, mode):
            if j == 5:
                break
            s += j * u[0]
        out[0] += s
        i = 100
    """
    expected = sum(2.0 * j for i in range(7) for j in range(i, 7) if not i <= 5 <= j)
    assert run(body, [2.0], mode=7) == expected
    assert run(body, [2.0], mode=-3) == 0.0


def test_a_loop_with_a_condition():
    body = """
    x = u[0]
    n = 0
    while x > 1.0 and n < 100:
        x *= 0.5
        n += 1
    out[0] = n
    out[1] = x
    """
    assert run(body, [40.0], size=2).tolist() == [6.0, 0.625]
    assert run(body, [math.inf], size=2).tolist() == [100.0, math.inf]
    assert run(body, [math.nan], size=2)[0] == 0.0


@pytest.mark.parametrize("mode", range(4))
def test_branches(mode):
    body = """
    if mode == 0 or mode == 3:
        s = u[0]
        k = 2.0
    elif not mode != 1:
        s = u[1]
        k = -s
    else:
        s = 5.0
        k = s
        pass
    out[0] = s * k
    """
    assert run(body, [3.0, 4.0], mode=mode) == [6.0, -16.0, 25.0, 6.0][mode]


def test_a_choice_computes_one_side_only():
    body = "out[0] = (1 if u[0] > 0 else math.log(u[1])) if True else None"
    assert run(body, [1.0, -1.0]) == 1.0
    assert math.isnan(run(body, [0.0, -1.0]))


def test_the_larger_and_the_smaller_as_in_python():
    body = "out[0] = max(u[0], 2, u[1])\nout[1] = min(u[0], u[1])\nout[2] = abs(u[0])"
    for a in NUMBERS:
        for b in NUMBERS:
            found = run(body, [a, b], size=3)
            assert all(map(same, found, (max(a, 2, b), min(a, b), abs(a)))), (a, b)


UNARY = ["sin", "cos", "tan", "exp", "log", "asin", "acos", "atan", "sinh", "cosh", "tanh"]
UNARY += ["asinh", "acosh", "atanh", "erf", "erfc", "sqrt", "log1p", "expm1"]


def test_elementary_functions_to_two_units_in_the_last_place():
    body = "\n".join(f"out[{k}] = math.{name}(u[0])" for k, name in enumerate(UNARY))
    for x in (0.3, -0.7, 1.25, 3.7):
        for name, value in zip(UNARY, run(body, [x], size=len(UNARY)), strict=True):
            with mpmath.workdps(30):
                exact = getattr(mpmath, name)(mpmath.mpf(x))
            if isinstance(exact, mpmath.mpc):
                assert math.isnan(value)
            else:
                assert value == pytest.approx(float(exact), rel=4.5e-16), (name, x)


def test_functions_of_two_numbers():
    body = """
    out[0] = math.atan2(u[0], u[1])
    out[1] = math.pow(u[1], u[0])
    out[2] = math.copysign(1, u[0])
    out[3] = math.floor(u[0])
    out[4] = 1.0 if math.isnan(u[0]) or math.isinf(u[1]) else 0.0
    """
    expected = [math.atan2(-0.0, -2.0), 1.0, -1.0, -0.0, 0.0]
    assert run(body, [-0.0, -2.0], size=5).tolist() == expected
    assert run(body, [math.nan, 1.0], size=5)[4] == run(body, [0.5, -math.inf], size=5)[4] == 1.0


# special functions


def test_written_special_functions_are_what_python_makes_of_them():
    cases = {
        "lambertw": [(x, 0.0) for x in (-0.36, -0.1, 0.0, 1e-9, 0.4, 3.0, 1e12, -1.0, math.nan)]
        + [(x, -1.0) for x in (-0.3678, -0.36, -0.3, -0.1, -1e-8, 0.0)],
        "polygamma": [(n, x) for n in (0, 1, 2, 7) for x in (0.2, 3.5, 25.0, -1.5, -2.0)],
    }
    for name, arguments in cases.items():
        given = ", ".join(f"u[{k}]" for k in range(len(arguments[0])))
        for values in arguments:
            found = run(f"out[0] = special.{name}({given})", values)
            expected = getattr(special, name)(*values)
            assert found == pytest.approx(expected, rel=1e-14, nan_ok=True), (name, values)


def test_one_of_several_results():
    body = "\n".join(f"out[{k}] = special.airy(u[0], {k})" for k in range(4))
    exact = [mpmath.airyai(0.4), mpmath.airyai(0.4, derivative=1)]
    exact += [mpmath.airybi(0.4), mpmath.airybi(0.4, derivative=1)]
    assert run(body, [0.4], size=4) == pytest.approx([float(x) for x in exact], rel=1e-14)


def test_an_address_that_is_not_given_is_an_error():
    source = entry("out[0] = special.gamma(u[0])")
    code = object_code(lambda module: translate(source, module, special.names()))
    with pytest.raises(RuntimeError, match="symbols"):
        load_object(code, "entry", {})


# what is refused

UNKNOWN = {
    "x = y": "'y' is not assigned",
    "if mode == 1:\n    s = 1.0\nout[0] = s": "'s' is not assigned on every path",
    "for k in range(mode):\n    s = 1.0\nout[0] = s": "'s' is not assigned on every path",
    "s = 0\nfor k in range(mode):\n    s = s + 0.5\nout[0] = s": "'s' changes its type",
    "if mode == 1:\n    s = 1\nelse:\n    s = 1.0\nout[0] = s": "'s' is not assigned on every path",
    "out[0] = math.gamma(u[0])": "math has no 'gamma'",
    "out[0] = special.hyp(u[0])": "the function is unknown",
    "out[0] = special.gamma(u[0], 1.0)": "expected 1 arguments",
    "out[0] = special.airy(u[0], mode)": "expected one of 4 results",
    "out[0] = special.airy(u[0], 4)": "expected one of 4 results",
    "out[0] = print(u[0])": "the function is unknown",
    "out[0] = u[0] % 2.0": "no translation",
    "out[0] = mode // 3": "a power of two",
    "out[0] = mode % -2": "a power of two",
    "out[0] = mode**2": "a constant exponent",
    "out[0] = u[0]**mode": "a constant exponent",
    "out[0] = 0 < u[0] < 1": "no translation",
    "out[0] = u[0] > 1": "expected a number",
    "out[0] = 1.0 if u[0] else 2.0": "expected a comparison",
    "out[0] = 1.0 if u[0] > 1 else None": "no translation",
    "out[0] = u[0] and 1.0": "expected a comparison",
    "out[0] = 1j * u[0]": "expected a real number",
    "out[0] = (-8.0)**(1/3)": "expected a real number",
    "out[0] = 'a'": "expected a real number",
    "out[0] = 2**63": "64 bits",
    "out[u[0]] = 1.0": "expected an integer",
    "out[0] = u[0:1]": "no translation",
    "out[0] = v[0]": "'v' is not an array",
    "u = 1.0": "it is an array",
    "x, y = 1.0, 2.0": "no translation",
    "x = y = 1.0": "no translation",
    "x: float = 1.0": "no translation",
    "out[0] = [1.0][0]": "'' is not an array",
    "out[0] = lambda: 1": "no translation",
    "out[0] = ~mode": "no translation",
    "out[0] = mode << 1": "no translation",
    "for k in u:\n    pass": "a loop over a range",
    "for k in range(0, 4, 2):\n    pass": "a loop over a range",
    "for k in range(4):\n    pass\nelse:\n    pass": "a loop over a range",
    "while mode > 1:\n    break\nelse:\n    pass": "no translation",
    "for k in range(4):\n    break\n    out[0] = 1.0": "unreachable",
    "break": "no translation",
    "continue": "no translation",
    "return": "no translation",
    "import os": "no translation",
    "assert mode": "no translation",
    "with u:\n    pass": "no translation",
}


@pytest.mark.parametrize("body", UNKNOWN)
def test_source_without_a_translation_is_refused(body):
    with pytest.raises(UnknownSourceError) as caught:
        compiled(entry(body))
    assert UNKNOWN[body] in str(caught.value)


CALLED = """
def weighted(values, shift: float, k: int):
    s = shift
    for j in range(k):
        s += j * values[j]
    return s


"""


def test_functions_of_the_source_itself():
    """An integer is passed where a real number is expected, as in Python."""
    source = CALLED + entry("out[0] = weighted(u, 2, mode)\nout[1] = weighted(u, u[0], 1) + 0.5")
    given, out = np.array([0.25, 1.5, 3.0]), np.zeros(2)
    compiled(source)(3, given.ctypes.data, given.ctypes.data, out.ctypes.data)
    assert out.tolist() == [2 + 1.5 + 2 * 3.0, 0.75]


@pytest.mark.parametrize(
    ("call", "said"),
    [
        ("weighted(mode, 1.0, 2)", "expected an array"),
        ("weighted(u[0], 1.0, 2)", "expected an array"),
        ("weighted(u, 1.0, 2.0)", "expected an integer"),
        ("weighted(u, 1.0)", "expected 3 arguments"),
    ],
)
def test_wrong_arguments_of_functions_of_the_source(call, said):
    with pytest.raises(UnknownSourceError, match=said):
        compiled(CALLED + entry(f"out[0] = {call}"))


def test_a_source_ends_with_a_function_of_four_arguments():
    for source in ("x", "def f(a, b, c, d):\n    pass\nx", ""):
        with pytest.raises(UnknownSourceError, match="source of functions"):
            compiled(source)
    for table in ("x = 1", "x = (1, 2.5)", "x = (y, 1)"):
        with pytest.raises(UnknownSourceError, match="tuple of integers"):
            compiled(table + "\n" + entry("out[0] = 1.0"))
    with pytest.raises(UnknownSourceError, match="expected 4 arguments"):
        compiled("def entry(a, b):\n    pass")


# random expressions


def expressions():
    """Source of expressions of u[0], u[1] and a whole number."""
    leaf = st.one_of(
        st.sampled_from(["u[0]", "u[1]", "math.pi"]),
        st.floats(-4, 4).map(lambda x: f"({x!r})"),
    )

    def larger(part):
        test = st.tuples(part, st.sampled_from(["<", "<=", ">", ">=", "==", "!="]), part).map(
            lambda c: f"({c[0]} {c[1]} {c[2]})"
        )
        both = st.tuples(test, st.sampled_from(["and", "or"]), test).map(
            lambda c: f"({c[0]} {c[1]} not {c[2]})"
        )
        return st.one_of(
            st.tuples(part, st.sampled_from("+-*/"), part).map(lambda c: f"({' '.join(c)})"),
            st.tuples(part, st.integers(-4, 5)).map(lambda c: f"(({c[0]})**{c[1]})"),
            st.tuples(st.sampled_from(["mode", "7", "-2"]), part).map(
                lambda c: f"({c[0]} * {c[1]})"
            ),
            part.map(lambda a: f"(-{a})"),
            st.tuples(st.sampled_from(["sqrt", "sin", "exp", "tanh", "atan"]), part).map(
                lambda c: f"math.{c[0]}({c[1]})"
            ),
            part.map(lambda a: f"abs({a})"),
            st.tuples(st.sampled_from(["max", "min"]), part, part).map(
                lambda c: f"{c[0]}({c[1]}, {c[2]})"
            ),
            st.tuples(part, st.one_of(test, both), part).map(
                lambda c: f"({c[0]} if {c[1]} else {c[2]})"
            ),
        )

    return st.recursive(leaf, larger, max_leaves=12)


class Functions:
    """What the source calls math, in NumPy's numbers."""

    pi = math.pi

    def __getattr__(self, name):
        return getattr(np, {"atan": "arctan"}.get(name, name))


def literal(node):
    """The number that literals alone make, by Python's own powers; None for other expressions."""
    if any(isinstance(n, ast.Name | ast.Call | ast.Compare | ast.IfExp) for n in ast.walk(node)):
        return None
    try:
        return eval(compile(ast.fix_missing_locations(ast.Expression(node)), "", "eval"))
    except ArithmeticError:
        return None


def evaluated(text, u, mode):
    """An expression as Python evaluates it with NumPy's numbers."""

    class Real(ast.NodeTransformer):
        def visit_Constant(self, node):
            whole = isinstance(node.value, int)
            return node if whole else ast.Call(ast.Name("real", ast.Load()), [node], [])

        def visit_Subscript(self, node):
            return node

        def visit_BinOp(self, node):
            number = literal(node)
            if number is not None:
                return ast.Call(ast.Name("real", ast.Load()), [ast.Constant(number)], [])
            node.left = self.visit(node.left)
            # whole powers stay what they are
            if isinstance(node.op, ast.Pow):
                return ast.Call(ast.Name("power", ast.Load()), [node.left, node.right], [])
            node.right = self.visit(node.right)
            return node

    def power(x, n):
        product, square, left = np.float64(1.0), np.float64(x), abs(n)
        while left:
            product = product * square if left & 1 else product
            square, left = square * square, left >> 1
        return product if n >= 0 else 1.0 / product

    tree = ast.fix_missing_locations(Real().visit(ast.parse(text, mode="eval")))
    known = {"u": np.array(u), "mode": mode, "math": Functions(), "real": np.float64}
    with np.errstate(all="ignore"):
        return float(eval(compile(tree, "", "eval"), known | {"power": power}))


@settings(max_examples=examples(150), deadline=None)
@example("(((1.0019550323486328))**4)", (0.0, 0.0), 0)
@given(
    expressions(),
    st.tuples(*[st.floats(width=64) | st.floats(-3, 3)] * 2),
    st.integers(-3, 9),
)
def test_random_expressions_are_numpy_s(text, u, mode):
    found, expected = run(f"out[0] = {text}", u, mode), evaluated(text, u, mode)
    # NumPy has functions of its own, a unit or two in the last place apart, which grow
    if "math" in text:
        with np.errstate(all="ignore"):
            close = np.isclose(found, expected, rtol=1e-6, atol=1e-12, equal_nan=True)
        assert close or not (math.isfinite(found) and math.isfinite(expected)), text
    else:
        assert same(found, expected), text


def test_a_choice_of_more_branches_than_python_recurses():
    lines = chosen((f"mode == {k}", [f"out[0] = {k * k}.0"]) for k in range(700))
    function, out = compiled("\n".join(["def entry(mode, u, p, out):", *lines])), np.full(1, 7.0)
    for mode in (0, 1, 63, 64, 399, 699):
        function(mode, out.ctypes.data, out.ctypes.data, out.ctypes.data)
        assert out[0] == mode**2
    function(700, out.ctypes.data, out.ctypes.data, out.ctypes.data)
    assert out[0] == 699**2
