"""Delays measured over ranges of rates, against the laws."""

import math
import pickle

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.results.overlay.delays import GapCrossing

pytestmark = pytest.mark.slow

SLOW = np.logspace(-7, -5, 5)


@pytest.fixture(scope="module")
def folded(folded_gear):
    """The frozen gear with negative stiffness, and its fold in S1."""
    fast = folded_gear.frozen()
    diagram = fs.continue_equilibria(fast, "w", over=(-1, 1))
    return fast, next(f for f in diagram.folds if f["x"] > 0)


@pytest.fixture(scope="module")
def cusp_scaling(cusp, cusp_fold):
    return fs.delay_scaling(cusp, cusp_fold, SLOW, level={"x": 0.5})


@pytest.fixture(scope="module")
def folded_scaling(folded):
    return fs.delay_scaling(*folded, SLOW, level={"x": 0.25})


@pytest.mark.parametrize("which", ["cusp_scaling", "folded_scaling"])
def test_folds_have_the_two_thirds_law(which, request):
    """Local exponents within 0.01 of 2/3 for ε ≤ 1e-5, the constant within 1 % from the fit."""
    scaling = request.getfixturevalue(which)
    assert scaling.success.all()
    assert np.abs(scaling.local_exponents - 2 / 3).max() < 0.01
    assert abs(scaling.exponent - 2 / 3) < 0.01
    assert scaling.uncertainty >= np.abs(scaling.local_exponents - scaling.exponent).max()
    assert scaling.coefficients[0] == pytest.approx(scaling.predicted_coefficients[0], rel=0.01)
    assert scaling.terms == ("eps^(2/3)", "eps ln eps", "eps")
    assert (np.diff(scaling.eps) < 0).all()


@pytest.mark.parametrize("which", ["cusp_scaling", "folded_scaling"])
def test_the_law_is_right_to_the_order_of_the_rate(which, request):
    """What is left is O(ε^(4/3)): 100 times slower, 100^(2/3) = 21.5 times better."""
    error = np.abs(request.getfixturevalue(which).error)
    assert error[0] < 2e-3
    assert 17 < error[0] / error[-1] < 26


def test_the_level_of_the_jump_counts(folded):
    """To x = −D across the gap: later, but for the same leading and logarithmic terms."""
    far = fs.delay_scaling(*folded, SLOW, level={"x": -0.25})
    near = fs.delay_scaling(*folded, SLOW, level={"x": 0.25})
    assert (far.delay > near.delay).all()
    assert far.predicted_coefficients[:2] == pytest.approx(near.predicted_coefficients[:2])
    assert np.abs(far.error).max() < 1e-3
    # both levels lie behind the slow part, so that they differ by a time of the jump
    between = (far.delay - near.delay) / far.eps
    assert between[-1] == pytest.approx(
        far.predicted_coefficients[2] - near.predicted_coefficients[2], rel=0.01
    )


def test_runs_agree_with_the_independent_passages(folded):
    """w at x = ±D from a start at rest, by a Taylor series with 34 digits (tests of simulate)."""
    fast, _ = folded
    known = {
        1e-2: (-0.17676151190771, -0.20640905936503),
        1e-4: (-0.094100921486102, -0.094657783243077),
    }
    for eps, loads in known.items():
        ramp = fast.with_ramp("w", -eps, from_value=0.2)
        run = fs.simulate(
            ramp, [0.9427182380145632, 0], t=(0, 0.42 / eps), integration=fs.Integration(rtol=1e-13)
        )
        for level, load in zip((0.25, -0.25), loads, strict=True):
            assert run.section("x", level=level)["w"][0] == pytest.approx(load, abs=2e-13)


def test_the_corner_to_all_digits(corner):
    """The non-smooth fold: 0.0497000894 and 0.0072227973 at x = 1, and no power fitted."""
    point = fs.continue_equilibria(corner, "p", over=(-1, 1)).boundary_equilibria[0]
    scaling = fs.delay_scaling(corner, point, [0.001, 0.01, 1e-4], level={"x": 1}, parameter="p")
    assert scaling.delay[:2].round(10).tolist() == [0.0497000894, 0.0072227973]
    assert np.abs(scaling.error).max() < 2e-12
    assert math.isnan(scaling.exponent)
    assert math.isnan(scaling.law_exponent)
    assert scaling.predicted_coefficients[0] == pytest.approx(1.0)
    assert "not a power of eps: non-smooth fold" in repr(scaling)
    # the logarithm shows: exponents that creep up to one
    assert 0.8 < scaling.local_exponents[0] < scaling.local_exponents[1] < 1
    backwards = corner.with_parameters(b=-1)
    mirrored = fs.continue_equilibria(backwards, "p", over=(-1, 1)).boundary_equilibria[0]
    down = fs.delay_scaling(backwards, mirrored, [0.01, 0.001], level={"x": 1}, parameter="p")
    assert down.direction == -1
    assert down.delay == pytest.approx(scaling.delay[:2], rel=1e-10)


def test_persistence_lags_by_the_rate(corner):
    both = corner.with_parameters(u=-3)
    point = fs.continue_equilibria(both, "p", over=(-1, 1)).boundary_equilibria[0]
    scaling = fs.delay_scaling(both, point, [1e-2, 1e-3, 1e-4], parameter="p")
    assert scaling.delay == pytest.approx(scaling.eps, rel=1e-9)
    assert scaling.exponent == pytest.approx(1.0, abs=1e-9)
    assert scaling.event == "x = 0"


def test_the_gap_of_the_gear(gear):
    """Δw within 1 % of 2√(Ds) + s, and Δt − 1 as s^(−1/2), which is Δw − s as s^(1/2)."""
    fast = gear.frozen()
    diagram = fs.continue_equilibria(fast, "w", over=(-1, 1))
    upper = next(p for p in diagram.boundary_equilibria if p["x"] > 0)
    speeds = 2.6 * np.array([0.005, 0.002, 0.001, 0.0005])
    scaling = fs.delay_scaling(gear, upper, speeds)
    assert scaling.event == "x + D = 0"
    assert scaling.offset == pytest.approx(1.0, rel=1e-12)
    assert scaling.exponent == pytest.approx(0.5, abs=0.005)
    assert scaling.local_exponents == pytest.approx(0.5, abs=0.005)
    laws = [law for law in scaling.laws if isinstance(law, GapCrossing)]
    transits = scaling.delay - [law.lag for law in laws]
    assert transits == pytest.approx(2 * np.sqrt(0.25 * scaling.eps) + scaling.eps, rel=0.01)
    assert scaling.delay == pytest.approx([law.asymptotic for law in laws], rel=0.01)
    assert scaling.error == pytest.approx(0.0, abs=1e-9)
    assert scaling.predicted_coefficients == pytest.approx([1.0, 1.0])


def test_a_start_that_is_given(cusp, cusp_fold, cusp_scaling):
    given = fs.delay_scaling(cusp, cusp_fold, [1e-5, 1e-6], level={"x": 0.5}, from_value=-0.5)
    assert given.delay == pytest.approx(cusp_scaling.delay[[0, 2]], rel=1e-8)
    wrong = r"from_value = 0.5; expected a value below p = 0.3849"
    with pytest.raises(fs.ArgumentError, match=wrong):
        fs.delay_scaling(cusp, cusp_fold, [1e-5, 1e-6], level={"x": 0.5}, from_value=0.5)


def test_a_sheet_that_is_too_short(corner):
    """With q x² the branch before the fold ends at another one."""
    x, p = sp.symbols("x p")
    model = fs.Model({x: p + x**2 - x**4 / 4 + x**3}, parameters={p: 0})
    diagram = fs.continue_equilibria(model, "p", over=(-5, 1))
    fold = next(f for f in diagram.folds if abs(f["x"]) < 1e-9)
    with pytest.raises(fs.ArgumentError, match=r"stable branch before .* extends from"):
        fs.delay_scaling(model, fold, [1.0, 0.1], level={"x": 0.5}, parameter="p")


def test_runs_that_do_not_get_there(cusp, cusp_fold):
    beyond = fs.delay_scaling(cusp, cusp_fold, [1e-3, 1e-4], level={"x": 5})
    assert not beyond.success.any()
    assert np.isnan(beyond.delay).all()
    assert np.isnan(beyond.coefficients).all()
    assert math.isnan(beyond.exponent)
    assert "x = 5: not reached by p =" in str(beyond.outcomes[0])
    assert "2 runs failed" in repr(beyond)
    stopped = fs.delay_scaling(
        cusp, cusp_fold, [1e-3, 1e-4], level={"x": 0.5}, integration=fs.Integration(max_steps=3)
    )
    assert "steps" in str(stopped.outcomes[0])


def test_wrong_arguments(cusp, cusp_fold, turning):
    for rates in ([1e-3], [1e-3, -1e-3], [1e-3, 0], [[1e-3, 1e-4]], "fast", [1e-3, math.nan]):
        with pytest.raises(fs.ArgumentError, match="expected"):
            fs.delay_scaling(cusp, cusp_fold, rates, level={"x": 0.5})
    with pytest.raises(fs.ArgumentError, match="expected speeds that differ"):
        fs.delay_scaling(cusp, cusp_fold, [1e-3, 1e-3], level={"x": 0.5})
    with pytest.raises(fs.ArgumentError, match="give level="):
        fs.delay_scaling(cusp, cusp_fold, [1e-3, 1e-4])
    hopf = fs.continue_equilibria(turning, "p", over=(-2, 2)).special("HB")[0]
    with pytest.raises(fs.ArgumentError, match="depends on the entry: see predict_delay"):
        fs.delay_scaling(turning, hopf, [1e-3, 1e-4], parameter="p")


def test_a_scaling_reads_well_and_pickles(cusp_scaling):
    text = repr(pickle.loads(pickle.dumps(cusp_scaling)))
    assert text.startswith("DelayScaling past LP1 with p rising, to x = 0.5: 5 rates from 1e-07")
    assert "predicted exponent 0.6667" in text
    assert "coefficient of eps^(2/3): 1.94" in text
    assert "predicted 1.9469\n" in text
    law = repr(cusp_scaling.laws[0])
    assert law.startswith("FoldDelay: smooth fold")
    assert "to the order of the rate" in law


def test_progress_is_shown_on_request(cusp, cusp_fold, capsys):
    fs.delay_scaling(cusp, cusp_fold, [1e-4, 1e-5], level={"x": 0.5})
    assert capsys.readouterr().err == ""
    fs.delay_scaling(
        cusp, cusp_fold, [1e-4, 1e-5], level={"x": 0.5}, execution=fs.Execution(progress=True)
    )
    assert "2/2" in capsys.readouterr().err


def test_the_only_parameter_of_a_model_drifts_without_being_named():
    x, p, q = sp.symbols("x p q")
    one = fs.Model({x: x**2 - p}, parameters={p: 1})
    (fold,) = fs.continue_equilibria(one, "p", over=(-1, 1)).folds
    unnamed = fs.delay_scaling(one, fold, [1e-2, 1e-3], level={"x": 1})
    assert unnamed == fs.delay_scaling(one, fold, [1e-2, 1e-3], level={"x": 1}, parameter="p")
    two = fs.Model({x: x**2 - p * q}, parameters={p: 1, q: 1})
    (fold,) = fs.continue_equilibria(two, "p", over=(-1, 1)).folds
    with pytest.raises(fs.ArgumentError, match="is ambiguous; give parameter=, one of p, q"):
        fs.delay_scaling(two, fold, [1e-2, 1e-3], level={"x": 1})
