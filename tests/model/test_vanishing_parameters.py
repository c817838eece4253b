"""Models at parameter values at which a switching function vanishes everywhere or has no value."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.errors import ModelError

x, k = sp.symbols("x k", real=True)

SWITCHING = [
    sp.Max(k * x, 0),
    sp.sign(k * (x - 1)),
    sp.sign(k * x - k),
    sp.sign(k),
    sp.Abs(k * (x - 1)),
    sp.Heaviside(k * x),
    sp.Piecewise((1, k * x >= 0), (2, True)),
    sp.Piecewise((1, k * x < 0), (2, True)),
    sp.Piecewise((1, k > 0), (2, True)),
    sp.Piecewise((1, k >= 0), (2, True)),
    sp.Piecewise((1, sp.And(k > 0, x > 0)), (2, True)),
    sp.Piecewise((1, sp.Eq(k, 0)), (2, True)),
    sp.Piecewise((1, sp.Ne(k, 0)), (2, True)),
    sp.Piecewise((sp.sign(x - 1 / k), k > 0), (3, True)),
]


@pytest.mark.parametrize("written", SWITCHING, ids=str)
@pytest.mark.parametrize("value", [1, 0, -1])
def test_the_rates_are_those_of_the_written_expression(written, value):
    model = fs.Model({x: written - x}, parameters={k: value})
    assert model.regions
    for state in (-0.7, 0.4, 2.3):
        there = {x: state, k: value}
        (region,) = (
            r for r in model.regions.values() if all(c.subs(there) is sp.true for c in r.conditions)
        )
        expected = float((written - x).subs({k: value}).subs({x: state}))
        assert float(region.rates["x"].subs(there)) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("written", "value", "named"),
    [
        (sp.sign(x - 1 / k), 0, "1/k"),
        (sp.sign((x - 1) / k), 0, "1/k"),
        (sp.Max(x, 1 / k), 0, "1/k"),
        (sp.sign(x**2 - 1 / k), 0, "1/k"),
        (sp.sign(x - sp.log(k)), -1, r"log\(k\)"),
        (sp.sign(x - sp.sqrt(k)), -1, r"sqrt\(k\)"),
    ],
)
def test_an_interface_without_a_value_is_refused(written, value, named):
    model = fs.Model({x: -written}, parameters={k: 1})
    message = f"{named}, on which the regions depend, is not finite and real at k = {value}"
    with pytest.raises(ModelError, match=message):
        fs.Model({x: -written}, parameters={k: value})
    with pytest.raises(ModelError, match=message):
        model.with_parameters(k=value)


def test_a_factor_of_an_interface_is_continued_through_zero():
    # x = 1 + max(k x, 0): x = 1/(1 - k) for 0 < k < 1, and 1 for k < 0
    model = fs.Model({x: 1 - x + sp.Max(k * x, 0)}, parameters={k: 0.5})
    diagram = fs.continue_equilibria(model, "k", over=(-1, 0.9))
    (branch,) = diagram.branches
    parameter = branch["k"]
    exact = np.where(parameter > 0, 1 / (1 - parameter), 1.0)
    np.testing.assert_allclose(branch["x"], exact, rtol=1e-13)
    (kink,) = diagram.special("BE")
    assert kink["k"] == pytest.approx(0, abs=1e-15)
    # the names of regions at the old value are kept
    assert list(model.regions) == ["S1", "S2"]
    assert branch.regions[-1] == "S1"
