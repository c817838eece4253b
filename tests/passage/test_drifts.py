"""The drift of the slow quantity at a special point, against derivatives by hand."""

import copy
import math
import pickle

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.passage.delays.drift_laws import drift_law
from fastslow.passage.delays.drifts import _rate, drift_at, drift_of_law
from fastslow.passage.slow_quantities import slow_quantity

x, v, w, z, t = sp.symbols("x v w z t")


def slow_and_folds(model, name, over, state, span):
    diagram = fs.continue_equilibria(model.frozen(), name, over=over)
    run = fs.simulate(model, state, t=span)
    return slow_quantity(diagram, run), diagram.folds


def test_a_forcing_gives_its_two_derivatives():
    model = fs.systems.cusp(omega=0.01)
    slow, folds = slow_and_folds(model, "p", (-1.2, 1.2), [-1.0], (0, 600))
    fold = max(folds, key=lambda f: f["p"])
    time = math.asin(fold["p"]) / 0.01
    drift = drift_at(slow, fold, time)
    assert drift.rate == pytest.approx(0.01 * math.cos(0.01 * time), rel=1e-9)
    assert drift.change == pytest.approx(-1e-4 * math.sin(0.01 * time), rel=1e-6)
    assert (drift.by_value, drift.by_state, drift.complete) == (0.0, {}, True)
    # more derivatives are in its law
    later = sp.lambdify(t, drift.law)(7.0)
    assert later == pytest.approx(0.01 * math.cos(0.01 * (time + 7)), rel=1e-12)


def test_a_slow_state_feeds_back():
    """y' = ε (a − x) at the fold x = 1: ε (a − 1), by x −ε."""
    model = fs.systems.van_der_pol_relaxation(a=0.25, epsilon=0.01)
    slow, folds = slow_and_folds(model, "y", (-1, 1), [2.0, 0.0], (0, 200))
    fold = max(folds, key=lambda f: f["x"])
    drift = drift_at(slow, fold, 50.0)
    assert drift.rate == pytest.approx(-0.0075, rel=1e-14)
    assert drift.by_state == pytest.approx({"x": -0.01}, rel=1e-14)
    assert (drift.change, drift.by_value, drift.law) == (0.0, 0.0, "")


def test_a_law_that_is_not_linear_and_what_else_moves():
    """w' = ε (x² − w z + sin v), z' = ε z, v a forcing: partial derivatives in closed form."""
    e = 0.001
    model = fs.Model(
        {x: w + x - x**3 / 3},
        slow={w: e * (x**2 - w * z + sp.sin(v)), z: e * z},
        forcing={v: t / 50},
    )
    slow = slow_quantity(
        fs.continue_equilibria(model.frozen().with_parameters(z=1, v=0), "w", over=(-1, 1)),
        fs.simulate(model, [-2.0, 0.0, 1.0], t=(0, 100)),
    )
    fold = fs.continue_equilibria(
        model.frozen().with_parameters(z=1, v=0), "w", over=(-1, 1)
    ).folds[0]
    drift = drift_at(slow, fold, 40.0)
    here, at, grown = fold["x"], fold["w"], math.exp(0.04)
    assert drift.rate == pytest.approx(e * (here**2 - at * grown + math.sin(0.8)), rel=1e-9)
    assert drift.by_state["x"] == pytest.approx(2 * e * here, rel=1e-9)
    assert drift.by_value == pytest.approx(-e * grown, rel=1e-9)
    assert drift.change == pytest.approx(e * (-at * e * grown + math.cos(0.8) / 50), rel=1e-9)
    later = sp.lambdify((x, w, t), drift.law)(0.3, 0.2, 5.0)
    known = e * (0.09 - 0.2 * grown * (1 + 5 * e) + math.sin(0.9))
    assert later == pytest.approx(known, rel=1e-9)


def test_the_parameter_of_a_path_drifts_by_the_chain_rule():
    """With a = g, b = 1 + g²/10 and g = sin(t/100), and for slow states the same."""
    a, b, g = sp.symbols("a b g")
    model = fs.Model(
        {x: a + b * x - x**3}, forcing={a: sp.sin(t / 100), b: 1 + sp.sin(t / 100) ** 2 / 10}
    )
    frozen = model.frozen(slow={a: g, b: 1 + g**2 / 10})
    diagram = fs.continue_equilibria(frozen, "g", over=(-0.9, 0.9))
    run = fs.simulate(model, [-1.0], t=(0, 100))
    drift = drift_at(slow_quantity(diagram, run), diagram.folds[0], 60.0)
    assert drift.rate == pytest.approx(0.01 * math.cos(0.6), rel=1e-12)
    assert drift.change == pytest.approx(-1e-4 * math.sin(0.6), rel=1e-12)
    assert drift.complete
    run = pickle.loads(pickle.dumps(run))
    plain = drift_at(slow_quantity(diagram, run), diagram.folds[0], 60.0)
    assert plain.rate == pytest.approx(0.01 * math.cos(0.6), rel=1e-6)
    assert plain.change == pytest.approx(-1e-4 * math.sin(0.6), rel=1e-3)
    assert not plain.complete


def test_a_path_of_slow_states():
    """w1' = ε (1 + x), w2' = 2 g w1' on the path w1 = g, w2 = g²: by x as w1 itself."""
    w1, w2, g = sp.symbols("w1 w2 g")
    e = 0.001
    model = fs.Model(
        {x: w1 + w2 / 10 + x - x**3},
        slow={w1: e * (1 + x), w2: 2 * e * w1 * (1 + x)},
    )
    frozen = model.frozen(slow={w1: g, w2: g**2})
    diagram = fs.continue_equilibria(frozen, "g", over=(-0.9, 0.9))
    run = fs.simulate(model, [0.9, 0.0, 0.0], t=(0, 100))
    fold = max(diagram.folds, key=lambda f: f["x"])
    drift = drift_at(slow_quantity(diagram, run), fold, 60.0)
    assert drift.rate == pytest.approx(e * (1 + fold["x"]), rel=1e-12)
    assert drift.by_state == pytest.approx({"x": e}, rel=1e-12)


def test_a_quadratic_forcing_is_all_in_its_terms():
    model = fs.systems.cusp().frozen()
    forced = fs.Model(
        dict(model.rates), forcing={"p": t / 100 + t**2 / 10**6 - 1}, parameters=model.parameters
    )
    slow, folds = slow_and_folds(forced, "p", (-1.2, 1.2), [-1.3], (0, 50))
    drift = drift_at(slow, folds[0], 50.0)
    assert drift == fs.Drift(0.0101, change=2e-6)


def test_without_equations_only_the_rate_of_a_slow_state_is_known(tmp_path):
    model = fs.systems.van_der_pol_relaxation()
    diagram = fs.continue_equilibria(model.frozen(), "y", over=(-1, 1))
    run = fs.simulate(model, [2.0, 0.0], t=(0, 50))
    assert run.model == model
    run.save(tmp_path / "run.npz")
    loaded = fs.load(tmp_path / "run.npz")
    assert loaded.symbolic_model is None
    assert copy.deepcopy(run).model is run.model
    drift = drift_at(slow_quantity(diagram, loaded), diagram.folds[0], 20.0)
    assert drift.rate == pytest.approx(-0.01 * float(run(20.0)[0]), rel=1e-9)
    assert not drift.complete
    assert repr(drift).endswith("the rest unknown)")


def test_a_slow_quantity_at_rest_has_no_drift():
    model = fs.Model({x: w + x - x**3 / 3}, slow={w: 0 * x})
    slow, folds = slow_and_folds(model, "w", (-1, 1), [2.0, 0.0], (0, 5))
    assert drift_at(slow, folds[0], 2.0) is None


def test_parts_of_a_run_keep_its_model():
    run = fs.simulate(fs.systems.cusp(), [-1.0], t=(0, 10))
    assert run.select(between=(2, 5))[0].model is run.model
    assert np.isfinite(run[1:4]["x"]).all()


def test_drifts_are_read():
    drift = fs.Drift(0.01, change=-2e-4, by_value=3, by_state={x: -0.5, v: 0})
    assert drift.by_state == {"x": -0.5}
    assert repr(drift) == "Drift(w' = 0.01 − 0.0002 t + 3 (w − w*) − 0.5 (x − x*))"
    assert not drift.constant
    assert fs.Drift(1).constant
    assert fs.Drift(-2).way == -1.0


@pytest.mark.parametrize(
    "law",
    [
        sp.cos(t / 50) / 3,
        t / 100 - t**2 / 20000,
        sp.Piecewise((t / 100, t < 30), (sp.Rational(3, 10) + (t - 30) / 200, True)),
        sp.exp(-t / 40) * sp.Symbol("a"),
    ],
)
def test_functions_that_are_made_once_give_the_drift_that_sympy_gives(law):
    model = fs.Model({x: w - x}, forcing={w: law}, parameters={"a": 2})
    slow = slow_quantity(
        fs.continue_equilibria(model.frozen(), "w", over=(-1, 3)),
        fs.simulate(model, [0.0], t=(0, 40)),
    )
    for time in (7.3, 33.1):
        found = drift_at(slow, None, time)
        exact = drift_of_law(_rate(model, "w", time), {})
        assert (found.rate, found.change) == pytest.approx((exact.rate, exact.change), rel=1e-15)
        assert (bool(found.law), found.by_value, found.by_state) == (bool(exact.law), 0.0, {})
        if found.law:
            # measured from the passage, in another form of the same formula
            after = np.linspace(-3.0, 6.0, 5)
            one, other = (
                drift_law(drift.law, ("x", "w")).along(np.zeros((5, 2)), after)
                for drift in (found, exact)
            )
            assert one == pytest.approx(other, rel=1e-13)
