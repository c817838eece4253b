"""Small results for figures: a hand-made S-shaped branch, and the gears."""

import numpy as np
import pytest

import fastslow as fs
from fastslow.results.base.outcome import Outcome
from fastslow.results.branch.branch import Branch
from fastslow.results.points import SpecialPoint


def special(code, label, x, eigenvalue, note=""):
    return SpecialPoint(
        code,
        label,
        ("x",),
        np.array([x]),
        {"p": x**3 - x, "q": 1.0},
        ("S1",),
        np.array([eigenvalue], dtype=complex),
        np.array([1.0, 0.0]),
        0.0,
        True,
        note=note,
    )


def cubic(outcomes=None, admissible=True):
    """The equilibria of x' = p + x − x³ for |x| ≤ 1.5, with both folds on rows of their own."""
    fold = 1 / np.sqrt(3)
    x = np.union1d(np.linspace(-1.5, 1.5, 61), [-fold, fold])
    eigenvalues = 1 - 3 * x**2
    eigenvalues[np.isclose(np.abs(x), fold, atol=1e-12, rtol=0)] = 0.0
    rows = [int(np.argmin(np.abs(x - at))) for at in (-fold, fold)]
    end = Outcome("end of range", "reached the end of the range.", True)
    slope = 3 * x**2 - 1
    return Branch(
        ("x",),
        "p",
        x[:, None],
        x**3 - x,
        np.column_stack([np.ones_like(x), slope]) / np.hypot(1, slope)[:, None],
        eigenvalues[:, None].astype(complex),
        np.full(len(x), "S1"),
        (
            special("EP", "EP1", -1.5, -5.75),
            special("LP", "LP1", -fold, 0.0),
            special("LP", "LP2", fold, 0.0),
            special("EP", "EP2", 1.5, -5.75, "step too small"),
        ),
        (0, rows[0], rows[1], len(x) - 1),
        outcomes or (end, end),
        admissible=admissible,
    )


def diagram_of(*branches):
    return fs.Diagram(
        ("x",), "p", (-1.875, 1.875), {"q": 1.0}, branches, "found", (), ("S1",), {}, "x' = …"
    )


@pytest.fixture(scope="session")
def s_curve():
    return diagram_of(cubic())


@pytest.fixture(scope="session")
def gear_diagram(gear):
    return fs.continue_equilibria(gear.frozen(), "w", over=(-2, 6))


@pytest.fixture(scope="session")
def gear_run(gear):
    return fs.simulate(gear, [0, 0], periods=2)


@pytest.fixture(scope="session")
def gear_overlay(gear_diagram, gear_run):
    return fs.overlay(gear_diagram, gear_run)


@pytest.fixture(scope="session")
def folded_overlay(folded_gear):
    load = folded_gear.with_parameters(B=0, C=0.4)
    diagram = fs.continue_equilibria(load.frozen(), "w", over=(-0.5, 0.5))
    return fs.overlay(diagram, fs.simulate(load, [0, 0], periods=2))
