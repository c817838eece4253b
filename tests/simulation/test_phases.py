"""The phases of the stepping loop: numbered once, entered by the loop, and drawn in the docs."""

import ast
import inspect
from pathlib import Path

from fastslow.simulation.stepper import driver, event_phases, phases, queued_events, steps

PAGE = Path(driver.__file__).parents[3] / "docs" / "architecture.md"
NUMBERS = {name: k for name, k in vars(phases).items() if isinstance(k, int) and name != "CROWD"}
PHASES = {name for name, number in NUMBERS.items() if number >= phases.BEGIN}


def names_in(node):
    return {one.id for one in ast.walk(node) if isinstance(one, ast.Name)}


def functions(module):
    tree = ast.parse(inspect.getsource(module))
    return {one.name: one for one in tree.body if isinstance(one, ast.FunctionDef)}


def test_phases_outcomes_and_pauses_have_different_numbers():
    assert len(set(NUMBERS.values())) == len(NUMBERS)
    assert {"BEGIN", "SELECT", "EXPAND", "LOCATE", "APPLY", "ADVANCE"} <= PHASES
    assert len(PHASES) == 11


def test_every_phase_is_entered_and_described():
    loop = functions(driver)["integrate"]
    tested = set()
    for node in ast.walk(loop):
        if isinstance(node, ast.If) and "phase" in names_in(node.test):
            tested |= names_in(node.test) & PHASES
    assert tested == PHASES
    page = PAGE.read_text(encoding="utf-8")
    drawing = page.split("## The phases of a step")[1].split("\n## ")[0]
    drawn, table = drawing.split("| phase |")
    for name in PHASES:
        assert name in drawn
        assert f"| `{name}` |" in table


def test_what_follows_a_phase_is_a_phase_an_outcome_or_a_pause():
    """Every number that a phase returns is one of them, and all of them are returned by one."""
    returned = set()
    for module in (driver, queued_events, event_phases, steps):
        for function in functions(module).values():
            for node in ast.walk(function):
                if isinstance(node, ast.Return) and node.value is not None:
                    returned |= names_in(node.value) & NUMBERS.keys()
    assert returned == NUMBERS.keys()
