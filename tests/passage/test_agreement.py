"""A diagram and a run belong to one model, or are refused."""

import re
from dataclasses import replace

import numpy as np
import pytest
import sympy as sp

import fastslow as fs

pytestmark = pytest.mark.slow

x, y, w, q, t = sp.symbols("x y w q t")
LOAD = {w: sp.sin(t / 100)}


def diagram_of(model):
    return fs.continue_equilibria(model.frozen(), "w", over=(-1.1, 1.1))


@pytest.fixture(scope="module")
def linear():
    model = fs.Model({x: w - x}, forcing=LOAD)
    return model, fs.simulate(model, [0.0], t=(0, 300))


@pytest.mark.parametrize(
    "rate",
    [w - 2 * x + x**3 / 9, 2 * w - 2 * x, sp.sin(w) - x, -w - x],
    ids=["other equilibria", "other eigenvalues", "close", "mirrored"],
)
def test_another_model_is_refused(linear, rate):
    other = fs.Model({x: rate}, forcing=LOAD)
    with pytest.raises(fs.ArgumentError, match="the diagram is of another model: it has x' = "):
        fs.overlay(diagram_of(other), linear[1])


def test_the_same_rates_written_in_another_way_are_accepted(linear):
    model = fs.Model({x: (w**2 - x**2) / (w + x)}, forcing={w: 2 + sp.sin(t / 100)})
    run = fs.simulate(model, [2.0], t=(0, 300))
    written = fs.Model({x: w - x}, forcing=LOAD)
    diagram = fs.continue_equilibria(written.frozen(), "w", over=(0.9, 3.1))
    overlay = fs.overlay(diagram, run)
    assert overlay.outcome
    assert overlay.shares() == {"S1": pytest.approx(1.0)}


def test_a_forcing_and_a_slow_state_share_their_diagram(linear):
    """What is slow moves in another way; the fast rates are the same."""
    other = fs.Model({x: w - x}, slow={w: (x - w) / 50 + 1e-3})
    overlay = fs.overlay(diagram_of(other), linear[1])
    assert overlay.outcome


def test_a_run_from_a_file_is_compared_by_its_text(linear, tmp_path):
    kept = linear[1].save(tmp_path / "run.npz") or tmp_path / "run.npz"
    run = fs.load(kept)
    assert fs.overlay(diagram_of(linear[0]), run).outcome
    other = fs.Model({x: 2 * w - 2 * x}, forcing=LOAD)
    with pytest.raises(fs.ArgumentError, match="another model"):
        fs.overlay(diagram_of(other), run)


def test_along_a_path_equilibria_are_compared():
    rates = {x: w + q - x - x**3}
    model = fs.Model(rates, forcing={w: sp.sin(t / 100), q: 2 * sp.sin(t / 100)})
    s = sp.Symbol("s")
    path = {w: s, q: 2 * s}
    run = fs.simulate(model, [0.0], t=(0, 300))
    diagram = fs.continue_equilibria(model.frozen(slow=path), "s", over=(-1.1, 1.1))
    assert fs.overlay(diagram, run).outcome
    other = fs.Model({x: w + q - x + x**3 / 40}, forcing=model.forcing)
    wrong = fs.continue_equilibria(other.frozen(slow=path), "s", over=(-1.1, 1.1))
    with pytest.raises(fs.ArgumentError, match="another model"):
        fs.overlay(wrong, run)


def test_a_filippov_model_belongs_to_itself_in_any_writing():
    plain = fs.Model({x: w - x - sp.sign(x) / 2, y: x - y}, forcing=LOAD)
    run = fs.simulate(plain, [0.1, 0.0], t=(0, 300))
    relay = sp.Piecewise((1, x > 0), (-1, True)) / 2
    written = fs.Model({x: w - x - relay, y: x - y}, forcing=LOAD)
    assert fs.overlay(diagram_of(written), run).outcome


def test_what_cannot_be_compared_is_said(linear, tmp_path):
    run = replace(linear[1], model=None, equations="")
    overlay = fs.overlay(diagram_of(linear[0]), run)
    assert not overlay.outcome
    assert "could not be compared" in overlay.summary()


def test_a_slow_quantity_at_rest_is_said():
    model = fs.Model({x: w - x}, forcing={w: sp.Integer(0) * t + sp.Rational(1, 2)})
    overlay = fs.overlay(diagram_of(model), fs.simulate(model, [0.4], t=(0, 10)))
    assert "w = 0.5 is constant in the run" in overlay.summary()
    assert np.isnan(overlay.lag).all()


def test_the_fraction_of_time_outside_the_diagram_is_given(linear):
    model, _ = linear
    run = fs.simulate(model, [0.0], t=(0, 100 * 2 * np.pi))
    diagram = fs.continue_equilibria(model.frozen(), "w", over=(-0.5, 0.5))
    overlay = fs.overlay(diagram, run)
    # |sin| > 1/2 on two thirds of a period; the samples are coarse
    share = re.search(r"([0-9.]+)% of the time is not measured", overlay.summary())
    assert float(share.group(1)) == pytest.approx(66.7, abs=2)


def test_where_the_diagram_holds_another_slow_quantity_no_delay_is_given():
    model = fs.Model({x: w + q + x - x**3}, forcing={w: t / 500 - 1, q: -t / 5000})
    run = fs.simulate(model, [-1.3], t=(0, 1000))
    diagram = fs.continue_equilibria(model.frozen().with_parameters(q=0), "w", over=(-1.1, 1.1))
    overlay = fs.overlay(diagram, run)
    assert "q = 0 in the diagram" in overlay.summary()
    assert [t_.type for t_ in overlay.transitions] == ["jump"]
    assert np.isnan(overlay.delays).all()
    assert overlay.transitions[0].law is None


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    ("damping", "path"),
    [(0.5, {w: "0.8*g", q: "1.5*(2*g**2 - 1)"}), (1.5, {w: "1.1*(4*g**3 - 3*g)", q: "0.9*g"})],
)
def test_rounding_at_folds_and_of_states_that_are_zero_is_accepted(damping, path):
    """At a fold the Jacobian has a row of zeros; v is zero but for rounding on the branch."""
    v, g = sp.symbols("v g")
    path = {slow: sp.sympify(law) for slow, law in path.items()}
    laws = {slow: law.subs(g, sp.cos(t / 500)) for slow, law in path.items()}
    model = fs.Model({x: v, v: -damping * v + (1 + q) * x - x**3 + w}, forcing=laws)
    diagram = fs.continue_equilibria(model.frozen(slow=path), "g", over=(-1.1, 1.1))
    run = fs.simulate(model, [1, 0], t=(0, 500))
    assert fs.overlay(diagram, run).outcome
