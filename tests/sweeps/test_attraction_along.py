"""Fractions of initial states along a branch, against basins in closed form."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs

pytestmark = pytest.mark.slow

x, v, w, r = sp.symbols("x v w r")


@pytest.fixture(scope="module")
def moving():
    """Stable equilibria at 5 w − 1 and 5 w + 1, on both sides of an unstable one."""
    y = x - 5 * w
    model = fs.Model({x: y - y**3}, parameters={w: 0})
    diagram = fs.continue_equilibria(model, "w", over=(-0.4, 0.4))
    return model, diagram


def test_attractors_that_change_places_are_matched_by_continuation(moving):
    """At w = 0.4 the lower one is where the upper one was at w = 0."""
    model, diagram = moving
    found = fs.attractors(model, {x: (-6, 6)}, 60, 2, along=diagram, samples=[-0.4, 0, 0.4])
    lower = [k for k, one in enumerate(found.members) if one["x"] == pytest.approx(-3)]
    assert len(found.members) == 2
    assert len(lower) == 1
    below = found.starts[None, :, 0] < 5 * found.values[:, None]
    assert np.array_equal(found.assigned == lower[0], below)
    share = found.fractions[:, lower[0]]
    assert np.array_equal(share, below.mean(axis=1))
    assert found.errors[:, lower[0]] == pytest.approx(np.sqrt(share * (1 - share) / 60), rel=1e-14)
    assert [branch.range for branch in found.branches] == [(-0.4, 0.4)] * 2


def test_a_cycle_exists_from_its_fold_on():
    """The circle ρ² = (1 + sqrt(1 + 4 r))/2 ends at r = −1/4, the focus at its Hopf point."""
    R = x**2 + v**2
    growth = r + R - R**2
    model = fs.Model({x: -v + x * growth, v: x + v * growth}, parameters={"r": -0.1})
    diagram = fs.continue_equilibria(model, "r", over=(-0.4, 0.2))
    box = {x: (-2, 2), v: (-2, 2)}
    found = fs.attractors(model, box, 100, 3, along=diagram, samples=7)
    focus, cycle = found.members
    assert isinstance(focus, fs.Equilibrium)
    assert isinstance(cycle, fs.Orbit)
    assert found.branches[1].range == pytest.approx((-0.25, 0.2), abs=1e-9)
    assert found.exists.tolist() == [[r < -1e-9, r > -0.25] for r in found.values]
    for value, assigned in zip(found.values, found.assigned, strict=True):
        square = (found.starts**2).sum(axis=1)
        if value < -0.25:
            inside = np.full(len(square), True)
        else:
            inside = square < (1 - np.sqrt(1 + 4 * value)) / 2
        assert np.array_equal(assigned == 0, inside)
    assert found.outcome.code == "settled"


def test_branches_of_other_models_and_values_outside_are_refused(moving):
    model, diagram = moving
    with pytest.raises(fs.ArgumentError, match=r"w = 0\.5 is outside the range"):
        fs.attractors(model, {x: (-2, 2)}, along=diagram, samples=[0, 0.5])
    other = fs.Model({x: w - x}, parameters={w: 0})
    with pytest.raises(fs.ArgumentError, match="a branch over w of another model"):
        fs.attractors(other, {x: (-2, 2)}, along=diagram)
    with pytest.raises(fs.UnknownNameError, match="unknown parameter 'w'"):
        fs.attractors(fs.Model({x: -x}), {x: (-2, 2)}, along=diagram)
