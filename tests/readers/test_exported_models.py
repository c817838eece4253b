"""Models exported to XPPAUT, read again."""

import pytest
import sympy as sp

import fastslow as fs

x, v, w, t, k, D, z = sp.symbols("x v w t k D z")

MODELS = {
    "gear": fs.systems.harmonic_gear(),
    "cusp": fs.systems.cusp(),
    "named regions": fs.Model(
        {x: v, v: -k * sp.Max(x - D, 0) - sp.Abs(v) / 3},
        parameters={k: 2, D: 0.25},
        interfaces={"wall": x - D},
        regions={"contact": (x > D) & (v > 0)},
    ),
    "slow state and long names": fs.Model(
        {"fast_variable": z - x**3 + sp.Symbol("fast_variable") * sp.exp(-x / 2), x: -x},
        slow={z: "small_parameter*(1 - x)"},
        parameters={"small_parameter": 1e-3},
    ),
    "comparison with a sum": fs.Model(
        {x: sp.Piecewise((1, x + v > k + 1), (sp.sqrt(x**2 + 1), True)), v: sp.sign(t - 3)},
        parameters={k: 0.5},
    ),
}


@pytest.mark.parametrize("name", MODELS)
def test_an_exported_model_is_read_as_the_same(name):
    (text,) = fs.export(MODELS[name], "xpp").values()
    file = fs.read_ode(text)
    assert file.model == MODELS[name]
    assert file.notes == ()


def test_the_initial_state_is_kept():
    (text,) = fs.export(MODELS["gear"], "xpp", state={"x": 0.5}).values()
    assert fs.read_ode(text).initial == {"x": 0.5, "v": 0.0}


def test_one_region_is_a_file_of_its_own():
    assert list(fs.export(MODELS["gear"], "xpp", region="S2")) == ["S2.ode"]
    assert list(fs.export(MODELS["gear"], "xpp")) == ["model.ode"]
