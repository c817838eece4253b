"""Models other than the gear, from derivation and diagram to run, overlay and figure."""

import math

import numpy as np
import pytest

import fastslow as fs

pytestmark = pytest.mark.slow


def whole_path(model, parameter, over, start, **span):
    fast = model.frozen()
    derivation = fs.derive(fast)
    diagram = fs.continue_equilibria(fast, parameter, over=over)
    run = fs.simulate(model, start, **span)
    overlay = fs.overlay(diagram, run)
    drawn = fs.plot.panel(overlay)
    assert drawn.overlay.handles
    assert run.outcome.success
    return derivation, diagram, run, overlay


def test_van_der_pol():
    model = fs.systems.van_der_pol(C=1.5)
    derivation, diagram, run, overlay = whole_path(model, "w", (-2, 2), [0.1, 0], periods=1)
    assert list(derivation) == ["S1"]
    hopf = diagram.special("HB")
    assert sorted(p["w"] for p in hopf) == pytest.approx([-1, 1], abs=1e-12)
    assert [p.frequency for p in hopf] == pytest.approx([1, 1], abs=1e-9)
    # between the Hopf points the motion is the cycle, of amplitude near 2
    inside = np.abs(run["w"]) < 0.3
    assert np.abs(run["x"][inside & (run.t > 100)]).max() == pytest.approx(2.0, abs=0.2)
    assert overlay.distance.max() > 0.1


def test_a_piecewise_linear_gear_pair():
    omega = 0.002
    model = fs.systems.gear_pair(zeta=0.5, Fm=0.1, Fa=0.4 / omega**2, Omega=omega)
    derivation, diagram, run, overlay = whole_path(model, "w", (-0.5, 0.7), [1.1, 0], periods=2)
    assert list(derivation) == ["S1", "S2", "S3"]
    corners = diagram.boundary_equilibria
    assert sorted(p["x"] for p in corners) == pytest.approx([-1, 1], abs=1e-12)
    assert [p.type for p in corners] == ["degenerate", "degenerate"]
    (point,) = diagram.at(w=0.3)
    assert point["x"] == pytest.approx(1.3, abs=1e-12)
    assert np.sort_complex(point.eigenvalues) == pytest.approx(
        [-0.5 - 1j * math.sqrt(0.75), -0.5 + 1j * math.sqrt(0.75)], abs=1e-10
    )
    assert run.regime == "bilateral"
    assert [t.type for t in overlay.transitions] == ["gap crossing"] * 4
    # far from the gap the trajectory lies on the branch, x = w + 1
    late = (run["w"] > 0.3) & (run.t > 100)
    assert np.abs(run["x"] - run["w"] - 1)[late].max() < 0.01


def test_a_model_with_a_slow_state():
    model = fs.systems.van_der_pol_relaxation(epsilon=0.002)
    _, diagram, _, overlay = whole_path(model, "y", (-1.2, 1.2), [2.0, 0.0], t=(0, 2000))
    folds = sorted((p["y"], p["x"]) for p in diagram.folds)
    assert np.array(folds) == pytest.approx(np.array([[-2 / 3, 1], [2 / 3, -1]]), abs=1e-12)
    assert len(overlay.transitions) >= 2
    assert {t.type for t in overlay.transitions} == {"jump"}
    assert all(0 < t.delay < 0.2 for t in overlay.transitions)
    # the period tends to (3 − 2 ln 2)/ε as ε → 0, from above
    times = [t.time for t in overlay.transitions]
    assert 2 * np.diff(times).mean() == pytest.approx((3 - 2 * math.log(2)) / 0.002, rel=0.12)


def test_a_model_with_one_state_and_a_fold():
    model = fs.systems.cusp(omega=0.005)
    _, diagram, _, overlay = whole_path(model, "p", (-1.2, 1.2), [-1.0], periods=2)
    edge = 2 / (3 * math.sqrt(3))
    assert sorted(p["p"] for p in diagram.folds) == pytest.approx([-edge, edge], abs=1e-13)
    assert {t.type for t in overlay.transitions} == {"jump"}
