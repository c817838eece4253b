"""The smooth motions of a model: regions, and sliding along its discontinuities."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.diagrams.modes import modes_of
from fastslow.kernels.taylor.series import compile_series
from fastslow.model.interfaces import vanishes_on
from fastslow.model.motions import _vanishes, motions_of

pytestmark = pytest.mark.slow

x, y, z, v, p = sp.symbols("x y z v p", real=True)


def names(model, **options):
    return [motion.name for motion in motions_of(model.partition, **options).sliding]


def test_an_interface_crossed_at_one_speed_has_no_sliding_motion_anywhere():
    # y' jumps across x = 0, but x' does not there
    model = fs.Model({x: sp.Piecewise((1 + x, x > 0), (1, True)), y: sp.sign(x) - y})
    assert not model.continuous["x"]
    assert names(model) == []
    assert compile_series(model, 16).modes == ("S1", "S2")
    assert [mode.name for mode in modes_of(model)] == ["S1", "S2"]
    run = fs.simulate(model, [-1.0, 0.0], t=(0, 2))
    assert run.itinerary == run.modes[::-1] == ("S2", "S1")


def test_a_continuous_model_slides_nowhere():
    f = sp.Max(x - y, 0) / (1 + sp.Max(x + y, 2 * x))
    assert names(fs.Model({x: -f, y: f - y})) == []


def test_runs_and_diagrams_have_the_same_sliding_motions():
    model = fs.Model({x: v, v: -x - sp.sign(v) / 2 - sp.sign(x) + p}, parameters={p: 0})
    compiled = compile_series(model, 16).modes
    sliding = [m.name for m in modes_of(model) if m.sides is not None and not m.sides.escaping]
    assert sliding == list(compiled[4:6])
    # along x = 0 nothing slides: x' = v does not jump there, but does along both at v = 0
    assert len(compiled) == 6


def test_weights_of_sliding_along_two_interfaces():
    # with the weights s in place of the signs both functions keep still
    rates = {x: p - 2 * sp.sign(x) - sp.sign(y), y: x + sp.sign(x) - 3 * sp.sign(y)}
    model = fs.Model(rates, parameters={p: 1}, interfaces={"x": x, "y": y})
    both = motions_of(model.partition).sliding[-1]
    assert both.signs == (0, 0)
    assert both.rates == (0, 0)
    first, second = both.weights
    left = [p - 2 * first - second, x + first - 3 * second]
    assert [sp.simplify(e) for e in left] == [0, 0]
    # each bound is the drift of one function while the other is slid along
    one = {m.signs: m for m in motions_of(model.partition, max_sliding=1).sliding}
    at = {x: 0, y: 0}
    assert sp.simplify((both.bounds[0] - one[1, 0].rates[0]).subs(at)) == 0
    assert sp.simplify((both.bounds[3] - one[0, -1].rates[1]).subs(at)) == 0


def test_products_of_signs_are_left_undecided():
    rates = {x: -sp.sign(x) * (2 + sp.sign(y)), y: -sp.sign(y)}
    model = fs.Model(rates, interfaces={"x": x, "y": y})
    motions = motions_of(model.partition)
    assert [m.signs.count(0) for m in motions.sliding] == [1, 1, 1, 1]
    assert motions.undecided == (
        ("x = 0 and y = 0", "the rates are not a sum of one jump for each interface"),
    )


def test_parallel_interfaces_are_not_slid_along_together():
    rates = {x: -sp.sign(x - 1) - sp.sign(x + 1) + y, y: -y}
    assert all(m.signs.count(0) == 1 for m in motions_of(fs.Model(rates).partition).sliding)


def test_the_number_of_motions_has_a_limit():
    states = sp.symbols("x1:5")
    chain = fs.Model({s: -sp.sign(s) + sum(states) for s in states})
    assert len(motions_of(chain.partition).sliding) == 3**4 - 2**4
    few = motions_of(chain.partition, max_motions=60)
    assert np.unique([m.signs.count(0) for m in few.sliding]).tolist() == [1]
    assert "more than 60" in few.undecided[0][1]


def test_sliding_that_the_first_derivatives_do_not_determine_is_left_undecided():
    # x' = v does not depend on the signs: nothing keeps both x and v
    model = fs.Model({x: v, v: -sp.sign(x) - sp.sign(v) / 2})
    ((where, why),) = motions_of(model.partition).undecided
    assert "= 0 and " in where
    assert "singular" in why


def test_continuity_with_decimal_numbers_and_interfaces_of_high_degree():
    # a growth rate is zero where a temperature, a rational function, leaves its range
    heat = 100 * p * (1 - (x + y) / 4) / (1 + (x + y) / 4)
    for share in (0.75, 0.25):
        growth = sp.Max(0, 1 - 0.003265 * (22.5 - heat + 20 * (x / 2 - share)) ** 2)
        model = fs.Model({x: x * (growth - 0.3), y: -y}, parameters={p: 0.8})
        assert all(model.continuous.values())
        assert motions_of(model.partition).sliding == ()


def test_vanishing_on_a_surface_is_decided_at_its_points():
    h = 3.7 * x**2 * y + 0.1 * y**2 * x - 1.3
    multiple = sp.expand(h * (x + 2 * y)) / (1 + x**2)
    assert vanishes_on(multiple, h)
    assert not vanishes_on(multiple + sp.Rational(1, 10**12), h)
    assert vanishes_on(sp.exp(x) - sp.exp(y + 1), x - y - 1)
    assert not vanishes_on(sp.exp(x) - sp.exp(y), x - y - 1)
    assert vanishes_on(sp.sqrt(x) - y, x - y**2)


@pytest.mark.parametrize("count", [2, 3])
def test_decimal_numbers_make_sums_of_jumps(count):
    """Sums such as 0.3 - 1 + 0.4 are rounded in every region; the parts of a jump are not."""
    random = np.random.default_rng(2)
    states = sp.symbols(f"x:{count}")
    for _ in range(5):
        base = random.integers(-30, 30, count) / 10
        jumps = random.integers(-30, 30, (count, count)) / 10 - 4 * np.eye(count)
        signs = sp.Matrix([sp.sign(s) for s in states])
        rates = sp.Matrix(base) + sp.Matrix(jumps) * signs
        model = fs.Model(dict(zip(states, rates, strict=True)))
        found = motions_of(model.partition)
        assert found.undecided == ()
        last, names = found.sliding[-1], list(model.interfaces)
        assert len(last.slides) == count
        weights = {
            names[j]: float(w) for j, w in zip(last.slides, last.weights, strict=True)
        }  # fmt: skip
        expected = dict(zip(map(str, states), np.linalg.solve(jumps, -base), strict=True))
        assert weights == pytest.approx(expected, rel=1e-13, abs=1e-15)


def test_what_vanishes_where_several_functions_do():
    """x² − 4 where x = y and y² = 4; the order in which they are given does not matter."""
    heights = [x - y, y**2 - 4]
    for given in (heights, heights[::-1]):
        assert _vanishes(x**2 - 4, given)
        assert _vanishes(x * y - 4, given)
        assert not _vanishes(x**2 - 3, given)
