"""Kernels take few arguments: what travels together is in a record."""

import ast
from pathlib import Path

import pytest

import fastslow

pytestmark = pytest.mark.slow

ROOT = Path(fastslow.__file__).parent

MOST = 8


def kernels():
    """Functions that are compiled: file, name and number of arguments."""
    for path in sorted(ROOT.rglob("*.py")):
        text = path.read_text("utf-8")
        # parsing the others would take most of the time
        for node in ast.walk(ast.parse(text)) if "kernel" in text else ():
            if isinstance(node, ast.FunctionDef) and any(
                "kernel" in ast.unparse(decorator) for decorator in node.decorator_list
            ):
                yield f"{path.relative_to(ROOT)}: {node.name}", len(node.args.args)


def test_no_kernel_takes_more_than_eight_arguments():
    found = dict(kernels())
    assert len(found) > 100
    assert {name: count for name, count in found.items() if count > MOST} == {}
