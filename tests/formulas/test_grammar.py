"""The one grammar: what is read, what is refused, and in which words."""

import ast
import random

import pytest

import fastslow as fs
from fastslow.formulas.grammar import DEPTH, LENGTH, names_of, parse, text_of
from tests.campaigns.text import texts


@pytest.mark.parametrize(
    ("text", "written"),
    [
        ("x", "x"),
        (" \n x\t+1", "x + 1"),
        ("-x**2*3/4 - 5 + -+-2", "-x**2*3/4 - 5 + 2"),
        ("2**-x**2", "2**-x**2"),
        ("(x+1)*-(v)", "(x + 1)*-v"),
        ("a/(b*c) - (d - e)", "a/(b*c) - (d - e)"),
        (".5 + 5. + 1E3", ".5 + 5. + 1E3"),
        ("lambda*x", "lambda*x"),
        ("omega_0*θ", "omega_0*θ"),
        ("ℌ + µ", "H + μ"),
        ("max(x, v,)", "max(x, v)"),
        ("0 < x <= D", "0 < x <= D"),
        ("(x > D) & ~(v < 0) | True", "x > D and not v < 0 or True"),
        ("x > D and not v < 0 or True", "x > D and not v < 0 or True"),
        ("And(x > 0, Or(Eq(v, 1), Ne(x, 2)))", "x > 0 and (v == 1 or x != 2)"),
        ("Piecewise((x, x > D), (0, True))", "Piecewise((x, x > D), (0, True))"),
    ],
)
def test_what_is_read(text, written):
    assert text_of(parse(text)) == written
    assert parse(written) == parse(text)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "it is empty"),
        ("x +", "it ends after '\\+', where a value is expected"),
        ("(x", r"it ends after 'x', where '\)' is expected"),
        ("x v", "cannot read 'v' after 'x'; expected an operator"),
        ("x.real", "attributes cannot be read"),
        ("x[0]", "write the name of a column alone"),
        ("'x'", "names stand without quotes"),
        ("f'{x}'", "names stand without quotes"),
        ("x^2", r"a power is written \*\*"),
        ("x²", r"a power is written \*\*2"),
        ("x − 1", "minus is written -"),
        ("x // 2", r"floor\(a/b\)"),
        ("x % 2", r"Mod\(a, b\)"),
        ("x = 2", "an equality is written =="),
        ("sin(x=1)", "an equality is written =="),
        ("(y := x)", "cannot read ':'"),
        ("lambda: x", "cannot read ':'"),
        ("[x for x in v]", "write the name of a column alone"),
        ("x if v else w", "cannot read 'if' after 'x'"),
        ("max(*x)", r"cannot read '\*'"),
        ("x  # one", "cannot read '#'"),
        ("x; v", "cannot read ';'"),
        ("1_000", "numbers are decimal"),
        ("0x10", "numbers are decimal"),
        ("2x", "a product is written"),
        ("1j", "complex"),
        ("1e400", "too large; expected less than 1.8e308"),
        ("1e-400", "too small; expected more than 5e-324"),
        ("1" * 401, "a number of 401 characters; expected at most 400"),
        ("max(x)", "max takes 2 to 12 arguments, received 1"),
        ("sin(x, v)", "sin takes 1 argument, received 2"),
        ("atan2(x)", "atan2 takes 2 arguments, received 1"),
        ("log(x, 2, 3)", "log takes 1 or 2 arguments, received 3"),
        ("sine(x)", "unknown function 'sine'; did you mean 'sin'"),
        ("__import__('os')", "unknown function '__import__'"),
        ("x + (v > 0)", "'v > 0' is a condition; expected a value"),
        ("x and v", "'x' is a value; expected a condition"),
        ("x > 0 & v > 0", "'0' is a value; expected a condition"),
        ("(x, v > 0)", "pairs stand in Piecewise alone"),
        ("x, v", "pairs stand in Piecewise alone"),
        ("Piecewise(x, v)", r"Piecewise takes pairs \(value, condition\)"),
        ("(" * 65 + "x" + ")" * 65, "nested more than 64 levels deep"),
        ("x" + "**x" * 200, "nested more than 64 levels deep"),
        ("x" * 20_001, "20001 characters; expected at most 20000"),
        ("x\ud800", r"cannot read '\\ud800' after 'x'"),
    ],
)
def test_what_is_refused(text, reason):
    with pytest.raises(fs.ArgumentError, match=reason) as caught:
        parse(text)
    assert "is not an expression: " in str(caught.value)
    # the error can be printed, and does not repeat a long text
    assert len(str(caught.value).encode()) < 300


def test_long_sums_and_deep_brackets_within_the_limits_are_read():
    many = LENGTH // 2
    assert len(parse("x+" * (many - 1) + "x").terms) == many
    assert names_of(parse("(" * (DEPTH - 1) + "x" + ")" * (DEPTH - 1))) == ("x",)
    assert names_of(parse("-" * 3000 + "x")) == ("x",)


def _as_python(node):
    """A tree of Python with the names of operators and operands alone."""
    if isinstance(node, ast.Expression):
        return _as_python(node.body)
    if isinstance(node, ast.UnaryOp):
        inside = _as_python(node.operand)
        return inside if isinstance(node.op, ast.UAdd) else ("-", inside)
    if isinstance(node, ast.BinOp):
        return type(node.op).__name__, _as_python(node.left), _as_python(node.right)
    if isinstance(node, ast.Call):
        return node.func.id, *map(_as_python, node.args)
    return node.id if isinstance(node, ast.Name) else float(node.value)


def test_arithmetic_binds_as_in_python():
    generator, compared = random.Random(5), 0
    for text in texts(3000, generator):
        try:
            mine = text_of(parse(text))
        except fs.ArgumentError:
            continue
        if len(text) > 1000 or any(sign in text for sign in "<>=&|~#\n") or "Piecewise" in text:
            continue
        if {"lambda", "and", "or", "not", "True", "False", "None"} & set(text.split()):
            continue
        try:
            theirs = ast.parse(text.strip(), mode="eval")
        except SyntaxError:  # such as a name that Python keeps for itself, or 007
            continue
        # signs in a row become one
        if "--" in text.replace(" ", "") or "-+" in text or "+-" in text:
            continue
        assert _as_python(ast.parse(mine, mode="eval")) == _as_python(theirs), text
        compared += 1
    assert compared > 300
