"""A parameter that drifts at a constant rate."""

import pytest
import sympy as sp

import fastslow as fs

x, y, w, D, t = sp.symbols("x y w D t")


def test_a_frozen_slow_quantity_drifts():
    fast = fs.Model({x: w - D * x}, forcing={w: sp.sin(t)}, parameters={D: 2}).frozen()
    ramp = fast.with_ramp(w, 0.5, from_value=-1)
    assert ramp.free == ()
    assert dict(ramp.parameters) == {"D": 2.0, "w_start": -1.0, "w_rate": 0.5}
    # x = (w − rate/D)/D is the motion that stays bounded backwards in time
    run = fs.simulate(ramp, [(-1 - 0.25) / 2], t=(0, 4), integration=fs.Integration(rtol=1e-13))
    assert run["w"][-1] == pytest.approx(1.0, abs=1e-14)
    assert run["x"][-1] == pytest.approx((1.0 - 0.25) / 2, abs=1e-12)
    assert ramp.frozen().free == ("w",)
    assert set(ramp.frozen().parameters) == {"D"}


def test_a_parameter_with_a_value_drifts_and_may_rest():
    model = fs.Model({x: -sp.Max(x - D, 0)}, parameters={D: 1})
    ramp = model.with_ramp("D", 0.0, from_value=3)
    assert list(ramp.interfaces) == list(model.interfaces)
    assert fs.simulate(ramp, [2], t=(0, 5))["x"][-1] == 2.0


def test_a_parameter_is_freed_by_symbol_or_name():
    model = fs.Model({x: w - D * x}, parameters={D: 2, w: 1})
    for name in ("D", D, sp.Symbol("D", real=True)):
        freed = model.with_free(name)
        assert (freed.free, dict(freed.parameters)) == (("D",), {"w": 1.0})
        assert freed.with_free(name) is freed
    for wrong in (sp.Symbol("d"), D + w):
        with pytest.raises(fs.UnknownNameError, match="unknown parameter"):
            model.with_free(wrong)


def test_what_cannot_drift():
    model = fs.Model({x: w - D * x}, forcing={w: sp.sin(t)}, parameters={D: 2})
    with pytest.raises(fs.ModelError, match="'w' already varies in time; ramp it in"):
        model.with_ramp("w", 1)
    with pytest.raises(fs.ModelError, match="'y' already varies"):
        fs.Model({x: y - x}, slow={y: -x}).with_ramp("y", 1)
    with pytest.raises(fs.UnknownNameError, match="unknown parameter 'E'"):
        model.with_ramp("E", 1)
    with pytest.raises(fs.ModelError, match="parameter D_rate: expected a finite number"):
        model.with_ramp("D", float("nan"))
    with pytest.raises(fs.ModelError, match="needs the name D_start, which the model already"):
        fs.Model({x: w - x}, parameters={D: 1, w: 0, "D_start": 1}).with_ramp("D", 1)
