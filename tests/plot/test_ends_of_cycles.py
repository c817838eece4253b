"""Ends of branches of orbits: marked, and listed in the legend once."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.results.base.outcome import Outcome
from fastslow.results.orbits.orbit_branch import END_CODES, VANISHING, end_points
from fastslow.results.point_types import POINT_TYPES

pytestmark = pytest.mark.slow

REACHED = Outcome("end of range", "", True)


@cache
def hopf():
    """Diagram and cycles of the normal form about x = 1, of radius sqrt(mu)."""
    x, y, mu = sp.symbols("x y mu")
    radial = mu - (x - 1) ** 2 - y**2
    model = fs.Model({x: radial * (x - 1) - y, y: radial * y + x - 1}, parameters={mu: 0.5})
    diagram = fs.continue_equilibria(model, mu, over=(-1, 1))
    (cycles,) = fs.continue_cycles(diagram)
    return diagram, cycles


def entries(drawn):
    return [one.get_label() for one in drawn.handles]


def test_outcomes_are_those_of_branches():
    sources = Path(fs.__file__).parent.joinpath("orbits").rglob("*.py")
    text = "".join(path.read_text(encoding="utf-8") for path in sources)
    assert [code for code in END_CODES if f'"{code}"' not in text] == []


def test_a_hopf_point_is_listed_once_and_marked_at_the_equilibrium():
    diagram, cycles = hopf()
    drawn = fs.plot.diagram(diagram, "x", cycles=cycles)
    assert entries(drawn).count("HB Hopf") == 1
    upper, lower = (part.data["HB Hopf"][0] for part in drawn.cycles)
    assert upper == pytest.approx(np.array([[cycles.values[0], 1.0]]), abs=1e-9)
    assert lower == pytest.approx(upper, abs=0)
    assert cycles.values[0] < 1e-3
    shown = fs.plot.response(cycles, "max(x)")
    assert entries(shown) == ["stable", "HB Hopf"]
    assert shown.data["HB Hopf"][0].tolist() == [[cycles.values[0], cycles["max(x)"][0]]]


@pytest.mark.parametrize("code", END_CODES)
@pytest.mark.parametrize("row", [0, -1])
def test_an_end_has_the_marker_of_its_point(code, row):
    diagram, cycles = hopf()
    outcomes = [REACHED, REACHED]
    outcomes[row] = Outcome(code, "", True)
    branch, title = replace(cycles, outcomes=tuple(outcomes)), POINT_TYPES[END_CODES[code]].title
    drawn = fs.plot.response(branch, "min(y)")
    assert entries(drawn) == ["stable", title]
    assert drawn.data[title][0].tolist() == [[branch.values[row], branch["min(y)"][row]]]
    for part in fs.plot.diagram(diagram, "y", cycles=branch).cycles:
        # where the cycles shrink to a point, both envelopes are marked in the middle
        level = 0.0 if code in VANISHING else branch[part.y][row]
        assert part.data[title][0] == pytest.approx(np.array([[branch.values[row], level]]))
        assert part.labels == ()


def test_ends_that_were_not_reached_have_their_outcome_as_label():
    cycles = hopf()[1]
    failed = Outcome("period unbounded", "", False)
    drawn = fs.plot.response(replace(cycles, outcomes=(REACHED, failed)))
    assert entries(drawn) == ["stable", "EP end point"]
    assert [text.get_text() for text in drawn.labels] == ["period unbounded"]
    assert drawn.data["EP end point"][0][0, 0] == cycles.values[-1]
    whole = replace(cycles, outcomes=(REACHED, REACHED))
    assert entries(fs.plot.response(whole)) == ["stable"]


def test_an_end_that_is_a_special_point_is_marked_once():
    x, v, t, a = sp.symbols("x v t a")
    model = fs.Model({x: v, v: a * sp.sin(t) - x - v}, parameters={a: 1})
    whole = fs.continue_orbits(fs.find_orbit(model, [-1, 0]), a, over=(0.5, 2), marks=(1.5,))
    outcomes = REACHED, Outcome("period doubling", "", True)
    points = type(whole.special)(replace(p, code="PD", label="PD1") for p in whole.special)
    branch = replace(whole, special=points, outcomes=outcomes)
    assert len(fs.plot.response(branch).data["PD period doubling"][0]) == 2
    branch = replace(branch, special_rows=(len(whole) - 1,))
    assert end_points(branch) == ()
    assert len(fs.plot.response(branch).data["PD period doubling"][0]) == 1
