"""Interfaces and regions extracted from equations."""

import numpy as np
import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st

from fastslow import Model, ModelError

pytestmark = pytest.mark.slow

x, y, v, t, w, D, k = sp.symbols("x y v t w D k")


def names(model):
    return list(model.interfaces), list(model.regions)


def rate(model, region, state="x"):
    return str(model.regions[region].rates[state])


def dead_zone(z, half):
    return sp.Piecewise((z - half, z > half), (z + half, z < -half), (0, True))


def test_a_smooth_model_is_one_region():
    model = Model({x: -x})
    assert names(model) == ([], ["S1"])
    assert str(model.regions["S1"]) == "S1: everywhere"


def test_piecewise():
    model = Model({x: v, v: -dead_zone(x, D)}, parameters={D: 0.5})
    assert names(model) == (["x - D", "x + D"], ["S1", "S2", "S3"])
    assert [rate(model, r, "v") for r in ("S1", "S2", "S3")] == ["D - x", "0", "-D - x"]
    assert dict(model.regions["S1"].signs) == {"x - D": 1, "x + D": 1}
    assert dict(model.regions["S2"].signs) == {"x - D": -1, "x + D": 1}


@pytest.mark.parametrize(
    ("expression", "interface", "above", "below"),
    [
        (sp.Abs(x - 1), "x - 1", "x - 1", "1 - x"),
        (sp.Max(x, 2), "x - 2", "x", "2"),
        (sp.Min(x, 2), "x - 2", "2", "x"),
        (sp.sign(x), "x", "1", "-1"),
        (sp.Heaviside(x - 3), "x - 3", "1", "0"),
        (sp.Abs(2 - 2 * x), "x - 1", "2*x - 2", "2 - 2*x"),
        (x * sp.Abs(x), "x", "x**2", "-x**2"),
    ],
)
def test_other_ways_to_switch(expression, interface, above, below):
    model = Model({x: expression})
    assert names(model) == ([interface], ["S1", "S2"])
    assert (rate(model, "S1"), rate(model, "S2")) == (above, below)


def test_nested():
    inner = sp.Piecewise((1, y > 0), (-1, True))
    model = Model({x: sp.Piecewise((inner, x > 0), (0, True)), y: -y})
    assert sorted(model.interfaces) == ["x", "y"]
    assert len(model.regions) == 4
    at = {(r.signs["x"], r.signs["y"]): str(r.rates["x"]) for r in model.regions.values()}
    assert at == {(1, 1): "1", (1, -1): "-1", (-1, 1): "0", (-1, -1): "0"}


def test_switching_of_a_switching_expression():
    model = Model({x: -sp.Abs(sp.Abs(x) - 1)})
    for value in (-2.0, -0.5, 0.5, 2.0):
        inside = [
            r
            for r in model.regions.values()
            if all(
                s * i.function.subs(sp.Symbol("x", real=True), value) > 0
                for s, i in zip(r.signs.values(), model.interfaces.values(), strict=True)
            )
        ]
        assert len(inside) == 1
        found = inside[0].rates["x"].subs(sp.Symbol("x", real=True), value)
        assert float(found) == -abs(abs(value) - 1)


@given(
    st.lists(st.integers(-8, 8), min_size=1, max_size=3, unique=True),
    st.floats(-9.9, 9.9).filter(lambda value: abs(value - round(value)) > 1e-3),
)
def test_the_region_of_a_point_has_the_rate_of_the_equation(levels, value):
    written = sum((n + 1) * sp.Max(x - level, 0) for n, level in enumerate(levels))
    model = Model({x: written})
    assert len(model.regions) == len(levels) + 1
    real = sp.Symbol("x", real=True)
    region = next(
        r
        for r in model.regions.values()
        if all(s * model.interfaces[n].function.subs(real, value) > 0 for n, s in r.signs.items())
    )
    expected = sum((n + 1) * max(value - level, 0) for n, level in enumerate(levels))
    assert float(region.rates["x"].subs(real, value)) == pytest.approx(expected, abs=1e-12)


def test_one_interface_for_each_zero_set():
    model = Model({x: sp.Abs(x - D) + sp.sign(2 * D - 2 * x) + sp.Max(D, x)}, parameters={D: 1})
    assert names(model) == (["x - D"], ["S1", "S2"])


def test_a_product_is_two_interfaces():
    model = Model({x: sp.sign(x * y), y: -y})
    assert sorted(model.interfaces) == ["x", "y"]
    assert len(model.regions) == 4


def test_interfaces_that_change_nothing_are_dropped():
    assert names(Model({x: sp.Piecewise((x, x > 0), (x, True))})) == ([], ["S1"])


def test_given_interfaces_come_first_and_keep_their_names():
    model = Model(
        {x: v, v: -dead_zone(x, D)}, parameters={D: 1}, interfaces={"lower": x + D, "upper": x - D}
    )
    assert list(model.interfaces) == ["lower", "upper"]
    assert len(model.regions) == 3


def test_named_regions():
    model = Model(
        {x: v, v: -dead_zone(x, D)},
        parameters={D: 1},
        regions={"forward": x > D, "gap": sp.And(x < D, x > -D)},
    )
    assert list(model.regions) == ["forward", "gap", "S1"]


def test_empty_patterns_are_no_regions():
    assert len(Model({x: sp.Abs(x - y), y: sp.Abs(x + y - 3) + sp.Abs(x - y)}).regions) == 4
    # x > 1, y > 1, x + y < 0 have no point in common
    plane = Model({x: sp.sign(x - 1) + sp.sign(y - 1) + sp.sign(x + y), y: 0 * y})
    assert len(plane.regions) == 7


def test_regions_follow_the_parameters_and_keep_their_names():
    model = Model({x: v, v: -dead_zone(x, D)}, parameters={D: 0.5})
    wide = model.with_parameters(D=2)
    assert list(wide.regions) == ["S1", "S2", "S3"]
    assert wide.regions["S2"].rates["v"] == 0
    assert model.parameters["D"] == 0.5
    two = Model({x: sp.Abs(x - 1) + sp.Abs(x - k)}, parameters={k: 2.0})
    moved = two.with_parameters(k=0.0)
    first = {r: dict(two.regions[r].signs) for r in two.regions}
    for name, region in moved.regions.items():
        if name in first:
            assert dict(region.signs) == first[name]
    assert len(moved.regions) == 3


def test_a_region_that_vanishes_is_noticed_and_comes_back():
    model = Model({x: v, v: -dead_zone(x, D)}, parameters={D: 0.5})
    assert model.empty_regions == ()
    shut = model.with_parameters(D=0)
    assert (list(shut.regions), shut.empty_regions) == (["S1", "S3"], ("S2",))
    assert "empty at these parameter values: S2" in repr(shut)
    again = shut.with_parameters(D=1)
    assert (list(again.regions), again.empty_regions) == (["S1", "S2", "S3"], ())


@pytest.mark.parametrize(
    ("expression", "expected"),
    [
        (-sp.Abs(x), True),
        (sp.sign(x), False),
        (sp.Max(x - 1, 0) * k, True),
        (sp.Piecewise((k * x, x > 0), (x, True)), True),
        (sp.Piecewise((k * x + 1, x > 0), (x, True)), False),
    ],
)
def test_continuity(expression, expected):
    model = Model({x: expression}, parameters={k: 2})
    assert list(model.continuous.values()) == [expected]


def test_symbols_match_by_name():
    a, b = sp.Symbol("x"), sp.Symbol("x", real=True)
    assert a != b
    assert Model({a: -(b**2)}).states == ("x",)
    assert Model({"x": -a * k}, parameters={"k": 1}).parameters[k] == 1.0


def test_numbers_of_numpy_are_numbers():
    assert Model({x: -k * x}, parameters={k: np.float64(2)}).parameters["k"] == 2.0


def test_a_piecewise_without_a_branch():
    with pytest.raises(ModelError, match=r"no branch where x < 0.*; end it with \(value, True\)"):
        Model({x: sp.Piecewise((1, x > 0))})


def test_repr_shows_regions_and_values():
    text = repr(Model({x: w - sp.Abs(x)}, forcing={w: k * sp.sin(t)}, parameters={k: 2}))
    assert text.splitlines() == [
        "Model of x",
        "  S1: x > 0:  x' = w - x",
        "  S2: x < 0:  x' = w + x",
        "  w = k*sin(t)",
        "  k = 2",
    ]
    assert "with w frozen" in repr(Model({x: w - x}, forcing={w: sp.sin(t)}).frozen())


def test_latex_has_the_order_of_papers():
    """Positive terms first, ascending powers, coefficients before states (Welander 1982)."""
    T, S, k, beta = sp.symbols("T S k_0 beta")
    rates = {T: 1 - T - k * T, S: beta * (1 - S) - k * S}
    text = Model(rates, parameters={k: 1, beta: 0.5}).to_latex()
    assert r"\dot{T} = 1 - T - k_{0} T," in text
    assert r"\dot{S} = \beta \left(1 - S\right) - k_{0} S" in text


def test_long_rates_are_typeset_in_rows_of_their_own():
    long = sum(sp.Symbol(f"k_{j}") * x**j for j in range(12))
    values = {f"k_{j}": 1.0 for j in range(12)}
    short = Model({x: w * sp.Abs(x), v: -v}, parameters={w: 1.0}).to_latex()
    assert len(short.splitlines()) == 2 + 2
    model = Model({x: long + sp.sign(v), v: -v + long}, parameters=values)
    rows = model.to_latex().splitlines()[1:-1]
    assert len(rows) == 4
    assert [r"\text{S" in row for row in rows] == [True, False, True, False]
