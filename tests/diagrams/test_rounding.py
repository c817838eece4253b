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
