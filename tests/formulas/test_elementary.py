"""Elementary functions: what their records state, against SymPy and mpmath."""

import ast
import math
import re
from pathlib import Path

import mpmath
import numpy as np
import pytest
import sympy as sp

import fastslow
from fastslow.formulas.elementary import ELEMENTARY
from fastslow.formulas.functions import FUNCTIONS
from fastslow.model.known_functions import ELEMENTARY as BY_CLASS
from fastslow.model.known_functions import IN_MPMATH, formula_at

PACKAGE = Path(fastslow.__file__).parent
x = sp.Symbol("x", real=True)
SINGLE = [f for f, one in BY_CLASS.items() if one.arguments == 1]

#: Points on both sides of every pole and of every edge of a domain.
POINTS = np.array([-3.5, -2.2, -1.3, -0.7, -0.2, 0.15, 0.6, 0.9, 1.1, 1.7, 2.6, 3.3])


def exact(function, point):
    """Value of a function at a number, to 25 digits."""
    with mpmath.workdps(25):
        value = sp.lambdify(x, function(x), [IN_MPMATH, "mpmath"])(mpmath.mpf(point))
        return mpmath.mpc(value)


def positive(text, point):
    """Whether a formula of a record is positive, or empty."""
    return not text or bool(formula_at(text, sp.Float(point)) > 0)


@pytest.mark.parametrize("function", SINGLE, ids=str)
def test_values_and_domain(function):
    one = BY_CLASS[function]
    with np.errstate(all="ignore"):
        found = np.asarray(one.values(POINTS), dtype=float)
    for point, value in zip(POINTS, found, strict=True):
        reference = exact(function, point)
        if reference.imag:
            assert math.isnan(value), point
            assert not positive(one.domain, point)
        else:
            assert value == pytest.approx(float(reference.real), rel=4e-15, abs=1e-16), point
            # functions of 1/u may be real on both sides of their singular point
            assert positive(one.domain, point) or one.domain == "u", point


@pytest.mark.parametrize("function", [f for f in SINGLE if BY_CLASS[f].poles], ids=str)
def test_poles(function):
    vanishing = sp.lambdify(x, formula_at(BY_CLASS[function].poles, x), "mpmath")
    for start in (0.1, 1.4):
        pole = mpmath.findroot(vanishing, start)
        assert abs(exact(function, pole + 1e-9)) > 1e8


@pytest.mark.parametrize("function", [f for f in SINGLE if BY_CLASS[f].written], ids=str)
def test_written_in_other_functions(function):
    written = sp.lambdify(x, formula_at(BY_CLASS[function].written, x), "mpmath")
    for point in POINTS:
        reference = exact(function, point)
        if not reference.imag:
            assert complex(written(point)) == pytest.approx(complex(reference), rel=1e-13)


@pytest.mark.parametrize("function", [f for f in SINGLE if BY_CLASS[f].inverse], ids=str)
def test_inverses(function):
    one, count = BY_CLASS[function], 0
    undo = getattr(sp, one.inverse)
    text = one.image or (BY_CLASS[undo].domain if undo in BY_CLASS else "")
    for level in POINTS:
        try:
            back = exact(undo, level)
        except ValueError:
            back = mpmath.mpc(1j)
        solved = not back.imag and abs(exact(function, back.real) - level) < 1e-12
        assert positive(text, level) == solved, level
        count += solved
    assert count >= 3


def named_in(path, names):
    """Those of some names that stand in a module, not counting docstrings and comments."""
    text = path.read_text(encoding="utf-8")
    if not names & set(re.findall(r"\w+", text)):
        return set()
    tree = ast.parse(text)
    described = {
        id(node.body[0].value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef)
        and node.body
        and isinstance(node.body[0], ast.Expr)
    }
    words = set()
    for node in ast.walk(tree):
        match node:
            case ast.Name(id=word) | ast.Attribute(attr=word):
                words.add(word)
            case ast.Constant(value=str() as text) if id(node) not in described:
                words.update(re.findall(r"\w+", text))
    return names & words


#: Functions that the project uses for its own computations.
USED = {"exp", "log", "sin", "cos", "atan2"}

#: Quotients with a removable singularity and the solution of trigonometric equations have files
#: of their own, models use functions, and the compiler knows the C library.
APART = {
    "model/removable.py", "quotients.py", "symbolic/solving/trigonometric.py",
    "kernels/compiler/native.py", "readers/sbml_formulas.py",
}  # fmt: skip


def test_a_function_is_known_in_few_files():
    places = {name: set() for name in ELEMENTARY.keys() - USED}
    for path in sorted(PACKAGE.rglob("*.py")):
        where = path.relative_to(PACKAGE).as_posix()
        if where not in APART and not where.startswith("systems/"):
            for name in named_in(path, places.keys()):
                places[name].add(where)
    assert {name: files for name, files in places.items() if len(files) > 4} == {}


def test_names_of_numpy_are_aliases():
    assert FUNCTIONS["arctanh"] is FUNCTIONS["atanh"]
    assert FUNCTIONS["exp"].symbolic == "exp"
