"""The measure of the house: one name for one thing, and functions and calls that can be read."""

import ast
import io
import tokenize
from collections import Counter, defaultdict
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from fastslow.results import point_types
from fastslow.results.point_types import POINT_TYPES
from tests.test_imports import FILES, ROOT, from_imports, tree

#: Lines of code of a function, without its docstring, comments and blank lines.
LINES, COMPILED_LINES = 80, 120
KERNELS = {"kernel", "inlined_kernel", "unfused_kernel"}

#: Values that a call may pass by position.
POSITIONAL = 8

#: Files that may name the constant of a code, besides its registry.
FEW = 4


def named(path: Path) -> str:
    return str(path.relative_to(ROOT))


@cache
def nodes() -> list[tuple[Path, ast.AST]]:
    """Classes, functions and calls of all files."""
    kinds = (ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef, ast.Call)
    return [(path, node) for path in FILES for node in ast.walk(tree(path)) if type(node) in kinds]


def classes() -> Iterator[tuple[str, Path, ast.ClassDef]]:
    return ((node.name, path, node) for path, node in nodes() if isinstance(node, ast.ClassDef))


def calls() -> Iterator[tuple[Path, ast.Call]]:
    return ((path, node) for path, node in nodes() if isinstance(node, ast.Call))


def last(node: ast.AST) -> str:
    """The last part of a dotted name: ``b`` of ``a.b`` and of ``a.b[c]``, "" of other things."""
    if isinstance(node, ast.Subscript):
        return last(node.value)
    return getattr(node, "attr", getattr(node, "id", ""))


def test_a_class_name_stands_for_one_thing():
    homes = defaultdict(set)
    for name, path, _ in classes():
        homes[name].add(named(path))
    assert {name: sorted(where) for name, where in homes.items() if len(where) > 1} == {}


def subclasses_of(roots: set[str]) -> set[str]:
    found = set(roots)
    while True:
        more = {name for name, _, node in classes() if {last(base) for base in node.bases} & found}
        if more <= found:
            return found
        found |= more


def test_no_one_asks_which_delay_law_it_is():
    laws = subclasses_of({"Delay", "DelayLaw"})
    assert {"FoldDelay", "HopfExit", "FoldLaw"} <= laws
    asked = [
        f"{named(path)}: {ast.unparse(one)}"
        for path in FILES
        for node in ast.walk(tree(path))
        for one in compared_by(node)
        if {last(part) for part in ast.walk(one)} & laws
    ]
    assert asked == []


def compared_by(node: ast.AST) -> list[ast.AST]:
    """What a comparison, a question for a class, or a pattern compares with."""
    if isinstance(node, ast.Call) and last(node.func) in {"isinstance", "issubclass"}:
        return [*node.args[1:]]
    if isinstance(node, ast.Compare):
        return [node.left, *node.comparators]
    return [node.pattern] if isinstance(node, ast.match_case) else []


@cache
def codes() -> frozenset[str]:
    """Names of the constants of codes of special points."""
    found = {
        name
        for name, value in vars(point_types).items()
        if isinstance(value, str) and value in POINT_TYPES
    }
    assert {"FOLD", "HOPF", "END_POINT"} <= found
    return frozenset(found)


def constants_of(path: Path) -> dict[str, str]:
    """Constants of codes that a file takes from their registry, by their names in the file."""
    found = {
        alias.asname or alias.name: alias.name
        for node in from_imports(tree(path))
        if node.module == "fastslow.results.point_types"
        for alias in node.names
    }
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.Attribute) and last(node.value) == "point_types":
            found[node.attr] = node.attr
    return {own: name for own, name in found.items() if name in codes()}


def test_no_one_compares_the_code_of_a_special_point():
    compared = {
        named(path)
        for path in FILES
        if (own := {*constants_of(path)})
        for node in ast.walk(tree(path))
        if {last(part) for side in compared_by(node) for part in ast.walk(side)} & own
    }
    assert compared == set()


def test_the_constant_of_a_code_stands_in_few_files():
    files = Counter(name for path in FILES for name in {*constants_of(path).values()})
    many = {name: count for name, count in files.items() if count > FEW}
    assert many == {}


@cache
def lines_of_code(path: Path) -> frozenset[int]:
    """Numbers of the lines of a file that are not blank, comment or docstring."""
    source = path.read_text(encoding="utf-8")
    beside = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT}
    numbers = set()
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type not in beside:
            numbers |= {*range(token.start[0], token.end[0] + 1)}
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            first = node.body[0] if node.body else None
            if isinstance(first, ast.Expr) and ast.get_docstring(node, clean=False) is not None:
                numbers -= {*range(first.lineno, first.end_lineno + 1)}
    return frozenset(numbers)


def length(path: Path, function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    return len(lines_of_code(path) & {*range(function.lineno, function.end_lineno + 1)})


def test_functions_can_be_read():
    long = {}
    for path, node in nodes():
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            compiled = {last(one) for one in node.decorator_list} & KERNELS
            name = f"{named(path)}: {node.name}"
            most = COMPILED_LINES if compiled else LINES
            if node.end_lineno - node.lineno >= most and (lines := length(path, node)) > most:
                long[name] = lines
    assert long == {}


def test_many_values_are_passed_by_keyword():
    many = {(named(path), last(node.func)) for path, node in calls() if len(node.args) > POSITIONAL}
    assert many == set()


def is_number(node: ast.expr) -> bool:
    """Whether an expression is a number, or a sequence of numbers, without names."""
    parts = [part for part in ast.walk(node) if isinstance(part, ast.Constant | ast.Name)]
    return bool(parts) and all(
        isinstance(part, ast.Constant) and type(part.value) in {int, float} for part in parts
    )


def numbers() -> Iterator[tuple[str, Path]]:
    """Names of the numbers that modules define, such as tolerances, with their files."""
    assigned = [(path, n) for path in FILES for n in tree(path).body if isinstance(n, ast.Assign)]
    for path, node in assigned:
        for target in node.targets:
            both = isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple)
            names, values = (target.elts, node.value.elts) if both else ([target], [node.value])
            for name, value in zip(names, values, strict=True):
                if last(name).isupper() and is_number(value):
                    yield last(name), path


def test_a_number_has_one_home_and_its_name_one_meaning():
    homes = defaultdict(set)
    for name, path in numbers():
        homes[name].add(named(path))
    assert {name: sorted(where) for name, where in homes.items() if len(where) > 1} == {}
