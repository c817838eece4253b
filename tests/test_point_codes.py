"""Codes of special points are written once, in their registry."""

import ast
from pathlib import Path

import pytest

import fastslow
from fastslow.results.point_types import POINT_TYPES

pytestmark = pytest.mark.slow

ROOT = Path(fastslow.__file__).parent

#: The registry of the codes.
REGISTRY = "results/point_types.py"


def literals(path):
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Constant) and node.value in POINT_TYPES:
            yield f"{path.relative_to(ROOT)}:{node.lineno}: {node.value}"


def test_no_code_is_a_literal_elsewhere():
    files = (p for p in sorted(ROOT.rglob("*.py")) if str(p.relative_to(ROOT)) != REGISTRY)
    assert [line for path in files for line in literals(path)] == []


def test_the_registry_is_where_the_literals_are():
    assert {line.split(": ")[1] for line in literals(ROOT / REGISTRY)} == set(POINT_TYPES)
