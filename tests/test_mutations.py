"""The list of changed lines that tests must notice, and how changes are made."""

import ast
from pathlib import Path

import pytest

from tests.campaigns import mutations
from tests.campaigns.single_changes import changes_of, takes_effect

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[1]
LISTED = mutations.listed()


@pytest.mark.parametrize("entry", LISTED["named"], ids=lambda e: e["what"])
def test_every_listed_change_can_still_be_made(entry):
    source = (ROOT / entry["file"]).read_text(encoding="utf-8")
    assert source.count(entry["original"]) == 1
    changed = source.replace(entry["original"], entry["mutated"])
    assert ast.dump(ast.parse(changed)) != ast.dump(ast.parse(source))
    file, *_, name = entry["test"].split("::")
    assert Path(file).parts[1] == mutations.layer_of(entry["file"])
    assert f"def {name}(" in (ROOT / file).read_text(encoding="utf-8")


def test_every_equivalent_change_can_still_be_made():
    for entry in LISTED["equivalent"]:
        lines = (ROOT / entry["file"]).read_text(encoding="utf-8").splitlines()
        assert entry["original"] in [line.strip() for line in lines]
        assert entry["mutated"] != entry["original"]
        assert entry["reason"].strip()


SOURCE = '''
"""A module, −1 < 2."""


def first(values: list[int], at: int = 0) -> int:
    """Not 5 + 6."""
    if not values or at >= len(values):
        raise ValueError(f"λ = {at + 1}; expected less")
    return abs(min(values[at:], -2e-3))


def __repr__():
    return "7" * 8
'''

EXPECTED = {
    "at: int = 1",
    "if values or at",
    "if not values and at",
    "at > len(values)",
    "at <= len(values)",
    "at < len(values)",
    "if True:",
    "if False:",
    "pass",
    "return None",
    "return (min(",
    "abs(max(",
    "min(-2e-3, values[at:])",
    "values[:]",
    ", 2e-3)",
    "-2e1)",
    "-2e-7)",
}


def test_what_is_changed_and_what_is_left_alone():
    changes = [c for c in changes_of(SOURCE) if takes_effect(c, SOURCE)]
    lines = [change.lines(SOURCE)[1] for change in changes]
    assert len(set(lines)) == len(lines) == len(EXPECTED)
    for part in EXPECTED:
        assert sum(part in line for line in lines) == 1, part


@pytest.mark.parametrize("layer", ["arguments", "systems"])
def test_a_seed_gives_the_same_lines_again(layer):
    mutants, again = (mutations.random_mutants(layer, 5, seed=1) for _ in range(2))
    assert mutants == again
    assert len({(m.file, m.line) for m in mutants}) == 5
    for mutant in mutants:
        assert mutant.layer == layer
        assert mutant.original != mutant.mutated
        ast.parse(mutant.source)
    assert mutants != mutations.random_mutants(layer, 5, seed=2)


def test_every_folder_of_the_package_has_tests():
    folders = {path.name for path in (ROOT / "fastslow").iterdir() if path.is_dir()}
    assert folders - {"__pycache__"} <= set(mutations.layers())
