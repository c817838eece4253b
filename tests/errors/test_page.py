"""The page on errors and outcomes lists every class and every outcome, and no others."""

import ast
import re
from functools import cache
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import CodeType

import pytest

import fastslow as fs
from fastslow import errors
from tests.errors.wrong_arguments import BY_FUNCTION
from tests.errors.wrong_by_parameter import BY_PARAMETER
from tests.errors.wrong_values import SAVE

pytestmark = pytest.mark.slow

ROOT = Path(fs.__file__).parent
SOURCES = list(ROOT.rglob("*.py"))
PAGE = (ROOT.parent / "docs" / "errors.md").read_text(encoding="utf-8")

#: Messages of the errors of wrong arguments.
TRIED = {
    words for rows in (*BY_PARAMETER.values(), *BY_FUNCTION.values(), SAVE) for _, _, words in rows
}


def texts_in(constant):
    """The texts in a constant of compiled code, and in the code of functions."""
    if isinstance(constant, str):
        yield constant
    elif isinstance(constant, CodeType):
        for inner in constant.co_consts:
            yield from texts_in(inner)
    elif isinstance(constant, tuple | frozenset):
        for inner in constant:
            yield from texts_in(inner)


@cache
def texts():
    """The texts in the sources, as compiled by an import: parsing takes ten times longer."""
    codes = (SourceFileLoader(path.stem, str(path)).get_code(path.stem) for path in SOURCES)
    return {text for code in codes for text in texts_in(code)}


def outcomes():
    """The code of every Outcome built in the sources, and of those that endings build."""
    for path in SOURCES:
        source = path.read_text(encoding="utf-8")
        lists = path.name == "endings.py" and "results" not in path.parts
        built = "Ending" if lists else "Outcome"
        tree = ast.parse(source) if f"{built}(" in source else ast.Module([])
        assigned = [n for n in tree.body if isinstance(n, ast.Assign)]
        named = {ast.unparse(n.targets[0]): n.value for n in assigned}
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == built:
                if isinstance(node.args[0], ast.Attribute):  # the code of another ending
                    assert node.args[0].attr == "code"
                    continue
                code = named.get(ast.unparse(node.args[0]), node.args[0])
                assert isinstance(code, ast.Constant), "a code is a plain text of its module"
                yield code.value


def first_cells(begin, end):
    """The code spans in the first column of the tables between two headings."""
    part = PAGE[PAGE.index(begin) : PAGE.index(end) if end else len(PAGE)]
    rows = re.findall(r"^\| (`.*?) \|", part, flags=re.M)
    return [text for row in rows for text in re.findall(r"`([^`]+)`", row)]


def test_every_outcome_is_explained():
    assert set(first_cells("## Outcomes of a run", None)) == set(outcomes())


def test_every_class_is_explained():
    classes = {
        name
        for name, value in vars(errors).items()
        if isinstance(value, type) and issubclass(value, fs.FastSlowError)
    }
    assert set(first_cells("## The classes", "## Arguments")) == classes - {"FastSlowError"}
    assert "`fastslow.FastSlowError`" in PAGE
    assert all(name in fs.__all__ for name in classes)
    for name, base in re.findall(r"^\| `(\w+Error)` \| `(\w+)` \|", PAGE, flags=re.M):
        assert base in {kind.__name__ for kind in getattr(errors, name).__mro__}


@pytest.mark.parametrize("message", first_cells("## Arguments", "## Outcomes of a run"))
def test_the_messages_are_real(message):
    if message != "No such file":  # from the operating system
        assert any(message in text for text in texts() | TRIED), message
