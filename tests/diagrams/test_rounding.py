"""Which states of equilibria are more than rounding, one by one and many at once."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.diagrams.field import FrozenField

x, y, w = sp.symbols("x y w")


def test_equilibria_of_several_regions_are_judged_as_each_by_itself():
    model = fs.Model({x: w - sp.Abs(x - 1) * x, y: x - y}, parameters={w: 0.3})
    field = FrozenField(model, "w")
    points = [
        (number, np.append(e.state, e.parameters["w"]))
        for value in (0.0, 0.1, 0.3)
        for e in fs.equilibria(model, w=value, virtual=True)
        for number in (field.regions.index(e.region),)
    ]
    assert len({number for number, _ in points}) == 2
    together = field.certain(points)
    assert together.shape == (len(points), 2)
    for one, found in zip(points, together, strict=True):
        assert field.certain([one]).tolist() == [found.tolist()]
    assert not together.all()
    assert together.any()


def test_nothing_is_certain_where_the_jacobian_is_singular():
    field = FrozenField(fs.Model({x: w - x**2, y: x - y}, parameters={w: 0.0}), "w")
    singular, regular = np.array([0.0, 0.0, 0.0]), np.array([1.0, 1.0, 1.0])
    assert field.certain([(0, singular), (0, regular)]).tolist() == [[False] * 2, [True] * 2]
    assert field.certain([]).shape == (0, 2)


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_the_tail_of_an_asymptote_is_no_equilibrium(unit):
    """1 - erf(x) > 0, but 0 in double precision for x > 5.9."""
    tail = fs.Model({x: 1 - sp.erf(x / unit)}, parameters={})
    assert len(fs.equilibria(tail)) == 0
    flat = fs.Model({x: sp.erf(x / unit) ** 3}, parameters={})
    (triple,) = fs.equilibria(flat)
    assert abs(triple["x"]) < 1e-5 * unit


def test_ends_that_rounding_decides_are_named():
    """Terms of 10¹⁶ that cancel to x - w: multiplied out, or named if parameters hide it."""
    c, d = sp.symbols("c d")
    square = (x + c) ** 2 - x**2 - 2 * c * x + x - w
    hidden = fs.Model({x: square - d}, parameters={w: 0.3, c: 1e8, d: 1e16})
    few = fs.Continuation(max_branches=1)
    diagram = fs.continue_equilibria(hidden, "w", (-1, 1), continuation=few)
    assert not diagram.outcome
    assert "decided by rounding: at w = " in str(diagram.outcome)
    for seen in (square - c**2, (square - d).subs({c: 10**8, d: 10**16})):
        model = fs.Model({x: seen}, parameters={w: 0.3, c: 1e8})
        (branch,) = fs.continue_equilibria(model, "w", (-1, 1)).branches
        assert branch["x"] == pytest.approx(branch.values, abs=1e-15)
    # an end without such terms is not decided by rounding
    few = fs.Continuation(min_step=5e-3, step=5e-3)
    root = fs.Model({x: w - sp.sqrt(x)}, parameters={w: 0.3})
    assert "rounding" not in str(
        fs.continue_equilibria(root, "w", (-1, 1), continuation=few).outcome
    )


@pytest.mark.parametrize(("size", "branches"), [(10.0, 0), (1e4, 3)], ids=["resolved", "cancelled"])
def test_branches_that_rounding_decides_are_named(size, branches):
    """c (√(x² + c²) − c) is x²/2 to first order, a difference of terms c²."""
    c, p = sp.symbols("c p")
    model = fs.Model({x: 1 - p * x - c * (sp.sqrt(x**2 + c**2) - c)}, parameters={c: size, p: 0.3})
    few = fs.Continuation(max_branches=3)
    found = fs.continue_equilibria(model, "p", over=(0.1, 1), continuation=few)
    said = [note for note in found.outcome.notes if "Rounding of the rates decides" in note]
    assert len(said) == bool(branches)
    # half a unit in the last place of c², over a slope of about 1.5
    for note in said:
        moved = float(note.split("moves x by ")[1].split(";")[0])
        assert 1e-9 < moved < 1e-7
        assert note.startswith(f"Rounding of the rates decides {branches} branches: at p = ")
