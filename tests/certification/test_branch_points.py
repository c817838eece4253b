"""Branch points, proved on invariant subspaces and by factors."""

from dataclasses import replace

import mpmath
import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.certification.boxes.missing import completed

pytestmark = pytest.mark.slow

pytest.importorskip("flint")

R = sp.Rational
w, x, y, z, p = sp.symbols("w x y z p")

#: Rates, range of p, window, where the branch point is, and words.
CASES = {
    "pitchfork": ({x: x * (p - x**2)}, (-1, 1), {}, {"x": 0, "p": 0}, "invariant subspace x = 0"),
    "transcritical": (
        {x: x * (p - R(1, 3) - x)}, (-1, 1), {}, {"x": 0, "p": R(1, 3)}, "invariant subspace x = 0",
    ),
    # a trivial branch at a Python float
    "shifted": (
        {x: (x - 0.1) * (p - x)}, (-1, 1), {}, {"x": R(1, 10), "p": R(1, 10)},
        "invariant subspace x = 0.1",
    ),
    "factors": (
        {x: (x - p) * (x + p**2 - R(1, 2))}, (-1, 1), {},
        {"x": (sp.sqrt(3) - 1) / 2, "p": (sp.sqrt(3) - 1) / 2}, "the factors -p + x and",
    ),
    # Rosenzweig and MacArthur (1963): the predator y invades at p = ½
    "predator and prey": (
        {x: x * (1 - x) - x * y / (1 + x), y: y * (x / (1 + x) - p)}, (0.3, 0.9),
        {x: (-0.5, 3), y: (-1, 4)}, {"x": 1, "y": 0, "p": R(1, 2)}, "invariant subspace y = 0",
    ),
    # rate equations of a laser of class B: intensity x, inversion y, pump p
    "laser": (
        {x: x * (y - 1), y: p - y - x * y}, (0, 3), {}, {"x": 0, "y": 1, "p": 1},
        "invariant subspace x = 0",
    ),
    # Lorenz (1963), which are those of a laser in other units (Haken 1975)
    "Lorenz": (
        {x: 10 * (y - x), y: p * x - y - x * z, z: x * y - R(8, 3) * z}, (0, 20), {},
        {"x": 0, "y": 0, "z": 0, "p": 1}, "invariant subspace x = 0, y = 0",
    ),
    # the infected states vanish together
    "epidemic": (
        {x: R(1, 10) * (1 - x) - p * x * z, y: p * x * z - y * R(11, 10), z: y - z * R(6, 10)},
        (0.1, 3), {x: (-1, 2), y: (-1, 2), z: (-1, 2)},
        {"x": 1, "y": 0, "z": 0, "p": R(66, 100)}, "invariant subspace y = 0, z = 0",
    ),
    "pendulum": (
        {x: y, y: sp.sin(x) * (p * sp.cos(x) - 1) - y / 5}, (-2, 0), {},
        {"x": sp.pi, "y": 0, "p": -1}, "invariant subspace x = pi, y = 0",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_branch_points(name):
    rates, over, window, exact, words = CASES[name]
    periodic = {x: 2 * sp.pi} if name == "pendulum" else {}
    model = fs.Model(rates, parameters={p: 0}, periodic=periodic)
    diagram = fs.continue_equilibria(model, "p", over, window=window)
    found = fs.prove(model, diagram["BP1"], digits=25).enclosure
    assert words in found.regular
    assert found.digits == 25
    assert found.unique_within > 0.05
    for key, value in exact.items():
        with mpmath.workdps(40):
            number = mpmath.mpf(sp.N(value, 35))
            assert abs(mpmath.mpf(found[key]) - number) < 1e-24
            assert found.low[key] <= number <= found.high[key]


def test_two_identical_systems():
    # in x = y the transversal eigenvalue is p − 3 x² − 2, on p x − x³ + 1 = 0: 2 x³ + 2 x + 1 = 0
    rates = {a: p * a - a**3 + 1 + (b - a) for a, b in ((x, y), (y, x))}
    model = fs.Model(rates, parameters={p: 0})
    diagram = fs.continue_equilibria(model, "p", (-3, 3))
    found = fs.prove(model, diagram["BP1"], digits=30).enclosure
    assert found.regular.endswith("invariant subspace y = x")
    with mpmath.workdps(40):
        at = mpmath.findroot(lambda t: 2 * t**3 + 2 * t + 1, -0.5)
        assert abs(mpmath.mpf(found["x"]) - at) < 1e-30
        assert abs(mpmath.mpf(found["p"]) - (3 * at**2 + 2)) < 1e-29


def test_what_is_not_proved_is_unresolved():
    # the branches of the second model pass at a distance of 1e-7
    model = fs.Model({x: x * (p - x**2)}, parameters={p: 0})
    point = fs.continue_equilibria(model, "p", (-1, 1))["BP1"]
    apart = fs.Model({x: x * (p - x**2) + 1e-14}, parameters={p: 1})
    with pytest.raises(fs.ArgumentError, match=r"do not intersect: .* changed by -1e-14"):
        fs.prove(apart, replace(point, source=None))
    # X (p − X) = 0 and Y = 0 in other coordinates, and the rates mixed
    first, second = x + y / 3 - p**2, y + x**2 - p
    crossing = first * (p - first)
    rates = {x: crossing + sp.exp(second) - 1, y: crossing - 2 * second}
    mixed = fs.Model(rates, parameters={p: 0})
    hidden = fs.continue_equilibria(mixed, "p", (-0.3, 0.3), window={x: (-1, 1), y: (-1, 1)})
    with pytest.raises(fs.ArgumentError, match="unresolved within a change of the rates by"):
        fs.prove(mixed, hidden["BP1"])


def test_touching_branches_are_singular():
    model = fs.Model({x: x * (p - x**2)}, parameters={p: 0})
    point = fs.continue_equilibria(model, "p", (-1, 1))["BP1"]
    touching = fs.Model({x: x * (p**2 - x)}, parameters={p: 1})
    with pytest.raises(fs.ArgumentError, match="the branches touch, or more than two intersect"):
        fs.prove(touching, replace(point, source=None))


def test_pieces_of_one_curve_beside_a_branch_point():
    # ends of pieces are ill-conditioned there: a piece of 1e-9 is not proved to be one of others
    model = fs.Model({x: p * x - x**2 + sp.exp(x) - 1 - x}, parameters={p: 0})
    found = fs.certify(model, fs.continue_equilibria(model, "p", (-1, 1)), window={x: (-2, 2)})
    assert not found.complete
    assert [found.count(p=value) for value in (-0.9, -0.1, 0.1, 0.25, 0.9)] == [2, 3, 3, 3, 1]


def test_certificates_use_them():
    model = fs.Model({x: x * (p - R(1, 3) - x**2)}, parameters={p: 0})
    found = fs.certify(model, fs.continue_equilibria(model, "p", (-1, 1)), window={x: (-2, 2)})
    (point,) = found.points
    assert point.enclosure["p"] == "0.333333333333333"
    assert found.notes == ("all of these boxes are around BP1, where two branches intersect",)
    # a second singular point is none of these
    rate = x * (p - R(1, 3) - x**2) * ((x - 1) ** 2 + (p + R(1, 2)) ** 2)
    model = fs.Model({x: rate}, parameters={p: 0})
    found = fs.certify(model, fs.continue_equilibria(model, "p", (-1, 1)), window={x: (-2, 2)})
    assert "BP1" in [point.label for point in found.points]
    assert not any("all of these boxes" in note for note in found.notes)
    assert np.isclose(found.diagram["BP1"].enclosure.high["p"], 1 / 3)


def test_curves_that_newton_does_not_reach_are_named():
    window = {"x": (-3, 3)}
    line = fs.Model({x: p - x}, parameters={p: 0.5})
    diagram = fs.continue_equilibria(line, "p", over=(-1, 1), window=window)
    curves = fs.certify(line, diagram, window=window).curves
    # another model, without equilibria near the curve
    model = fs.Model({x: 1 + x**2 + p**2}, parameters={p: 0.5})
    empty = fs.continue_equilibria(model, "p", over=(-1, 1), window=window)
    found = completed(model, empty, curves, {"x": (-3, 3), "p": (-1, 1)})
    assert len(found.branches) == 0
    assert "1 of 1 proved curves are not branches: Newton's method" in str(found.outcome)
