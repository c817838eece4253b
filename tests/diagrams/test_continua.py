"""Continua of equilibria in regions: objects of a diagram, with their dimension and stability."""

from itertools import pairwise

import numpy as np
import pytest
import sympy as sp

import fastslow as fs

pytestmark = pytest.mark.slow

R = sp.Rational
x, v, z, y, w = sp.symbols("x v z y w")


def unstable(rates, state, values):
    """Number of eigenvalues with positive real part, by NumPy, of the rates on one side."""
    symbols = list(rates)
    at = {**dict(zip(symbols, state, strict=True)), **values}
    jacobian = sp.Matrix(list(rates.values())).jacobian(symbols).subs(at)
    eigenvalues = np.linalg.eigvals(np.array(jacobian, dtype=float))
    return int(np.count_nonzero(eigenvalues.real > 1e-9))


def test_lines_under_hysteresis():
    """v = 0, x + z = w is a line for every w; λ² + λ + 2 − z of the first is unstable at z > 2."""
    borders = {
        v * (1 - z): [2],
        sp.Abs(v) * (1 - z): [0, 2],
        # Bouc (1967) and Wen (1976)
        v - sp.Abs(v) * z: [-2, 2],
    }
    for rate, places in borders.items():
        model = fs.Model({x: v, v: w - v - x - z, z: rate}, parameters={w: 0.3})
        found = fs.equilibria(model)
        assert found.completeness == "complete"
        ends = [-np.inf, *places, np.inf]
        assert [one["z"] for one in found.sets] == list(pairwise(ends))
        assert {one.dimension for one in found.sets} == {1}
        diagram = fs.continue_equilibria(model, "w", over=(-1, 1))
        assert diagram.completeness == "complete"
        assert len(diagram.bands) == len(places) + 1
        assert [b.is_stable for b in diagram.bands] == [one.stable for one in found.sets]
        assert "continuum" in repr(diagram)
        (one,) = [b.at(w=0.5) for b in diagram.bands if b.is_stable]
        expected = 0.5 - np.array(one["z"])[::-1]
        assert one["x"] == pytest.approx(tuple(expected), abs=1e-12)


@pytest.mark.sample(3)
@pytest.mark.parametrize("seed", range(6))
def test_stability_along_random_lines(seed):
    """Pieces join without gaps, and inside each the eigenvalues of all sides agree with it."""
    random = np.random.default_rng(seed)
    a, b, c, d = (R(int(n), 10) for n in random.integers(-20, 20, 4))
    bend = sp.Abs(v) if seed % 2 else v
    fast = w - v - x - z - b * z**2
    rates = {x: v, v: fast, z: v * (a + c * z) + d * bend * z**2}
    model = fs.Model(rates, parameters={w: 0.3})
    sets = sorted(fs.equilibria(model).sets, key=lambda one: one["z"][0])
    assert sets[0]["z"][0] == -np.inf
    assert sets[-1]["z"][1] == np.inf
    for before, after in pairwise(sets):
        assert before["z"][1] == after["z"][0]
    for one in sets:
        low, high = np.clip(one["z"], -50, 50)
        for share in (0.02, 0.37, 0.98):
            place = low + share * (high - low)
            state = [0.3 - place - float(b) * place**2, 0.0, place]
            sides = [{s: r.subs(bend, side * v) for s, r in rates.items()} for side in (1, -1)]
            counts = [unstable(side, state, {w: 0.3}) for side in sides[: 1 + seed % 2]]
            assert one.stable == (max(counts) == 0), (one, place)


def test_products_of_rates_and_dimensions():
    """x = 0 is a line where x is a factor of both rates, stable below y = 1."""
    model = fs.Model({x: x * (y - 1), y: x * (y - w)}, parameters={w: 0.3})
    diagram = fs.continue_equilibria(model, "w", over=(-1, 2))
    assert [(b.at(w=0)["y"], b.is_stable) for b in diagram.bands] == [
        ((-np.inf, 1.0), True),
        ((1.0, np.inf), False),
    ]
    plane = {x: v, v: w - v - x - z - y, z: v * (1 - z), y: v * (2 - y)}
    (one,) = fs.equilibria(fs.Model(plane, parameters={w: 0.3})).sets
    # its stability changes across it, and is not claimed
    assert (one.dimension, one.stable, one.attracting) == (2, False, None)


def test_continua_that_are_not_traced_are_named():
    model = fs.Model({x: v, v: w - x**3 - z**3 - v, z: v * (1 - z)}, parameters={w: 0.3})
    words = "the equilibria of S1 form a continuum that is not traced: 1 equation for x, z"
    found = fs.equilibria(model)
    assert found.completeness == "found"
    assert words in repr(found)
    diagram = fs.continue_equilibria(model, "w", over=(-1, 1))
    assert diagram.completeness == "found"
    assert words in repr(diagram)
    assert words in str(diagram.outcome)


def test_continua_are_saved_and_drawn(tmp_path):
    model = fs.Model({x: v, v: w - v - x - z, z: v * (1 - z)}, parameters={w: 0.3})
    diagram = fs.continue_equilibria(model, "w", over=(-1, 1))
    diagram.save(tmp_path / "line.npz")
    again = fs.load(tmp_path / "line.npz")
    assert [repr(b) for b in again.bands] == [repr(b) for b in diagram.bands]
    drawn = fs.plot.diagram(diagram, "x")
    assert drawn is not None


def test_a_line_that_moves_with_the_parameter_where_both_rates_share_a_factor():
    """The factor 1 + w x is that of both rates: a line x = −1/w, without one at w = 0."""
    model = fs.Model({x: -x - w * x**2, y: y + w * x * y}, parameters={w: R(1, 2)})
    found = fs.equilibria(model)
    assert found.completeness == "complete"
    assert [one["x"] for one in found.sets] == [(-2.0, -2.0)]
    window = {"x": (-5, 5), "y": (-3, 3)}
    diagram = fs.continue_equilibria(model, "w", over=(-2, 2), window=window)
    # the origin alone is isolated
    assert len(diagram) == 1
    assert not np.any(diagram[0].state)
    left, right = diagram.bands
    np.testing.assert_allclose(left.values[[0, -1]], (-2, -1 / 5), rtol=1e-9)
    np.testing.assert_allclose(right.values[[0, -1]], (1 / 5, 2), rtol=1e-9)
    for band in (left, right):
        np.testing.assert_allclose(band.lower[:, 0], -1 / band.values, rtol=1e-15)
        assert np.all(band.upper[:, 1] == np.inf)
