"""Equilibria that are twice in a diagram are named, in the product and by the invariants."""

from dataclasses import replace

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.diagrams.trace import tracing
from fastslow.diagrams.trace.repeated_equilibria import repetitions
from fastslow.results.points import SpecialPoints
from tests.invariants import violations

x, y, p = sp.symbols("x y p")

MODELS = {
    "fold": {x: p + x - x**3},
    "corner": {x: p + sp.Abs(x) - x**3},
    "pitchfork": {x: p * x - x**3, y: x - y},
    "two states": {x: y - x**3 + x, y: p - x - y / 2},
}


@pytest.fixture(params=MODELS, scope="module")
def model(request):
    return fs.Model(MODELS[request.param], parameters={p: 0})


def doubled(branch):
    """The branch, followed by its rows in the opposite order."""
    both = {"special": SpecialPoints(), "special_rows": ()}
    for name in ("state", "values", "tangent", "eigenvalues", "region"):
        rows = getattr(branch, name)
        both[name] = np.concatenate([rows, rows[-2::-1]])
    return replace(branch, **both)


def test_branches_are_traced_once(model):
    diagram = fs.continue_equilibria(model, "p", (-1, 1))
    assert not list(repetitions(diagram.branches, np.ones(len(model.states))))
    assert not violations(diagram)


def test_a_diagram_without_branches_repeats_nothing():
    diagram = fs.continue_equilibria(fs.Model({x: p**2 + x**2 + 1}, parameters={p: 0}), "p", (0, 1))
    assert len(diagram) == 0
    assert not violations(diagram)


def test_two_branches_with_the_same_equilibria_are_named(monkeypatch):
    model = fs.Model(MODELS["corner"], parameters={p: 0})
    # every start is traced, also those on a branch
    monkeypatch.setattr(tracing, "_contains_equilibrium", lambda *_: False)
    traced = tracing.continue_equilibria.__wrapped__  # without the examination
    diagram = traced(model, "p", (-1, 1))
    assert diagram.completeness == "found"
    assert "have the same equilibria" in str(diagram.outcome)
    assert any("two branches have the same equilibria" in one for one in violations(diagram))


def test_a_branch_that_returns_along_itself_is_named(model):
    diagram = fs.continue_equilibria(model, "p", (-1, 1))
    longest = max(diagram.branches, key=len)
    back = doubled(longest)
    (sentence,) = repetitions([back], np.ones(len(model.states)))
    assert sentence == "branch 0 passes the same equilibria twice."
    found = violations(replace(diagram, branches=(back,)))
    assert any("rows" in one and "follow rows" in one for one in found)
