"""A trajectory laid over its equilibrium diagram."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs

FOLD_W = 0.0894402097712473


@pytest.fixture(scope="module")
def overlay(gear):
    diagram = fs.continue_equilibria(gear.frozen(), "w", over=(-2, 6.5))
    return fs.overlay(diagram, fs.simulate(gear, [0, 0], periods=3))


def test_a_state_at_rest_along_the_branch_has_the_unit_of_the_mode_there():
    """y = w and x = 0; in the mode of rate −1 that moves y, x is exp(3 w) times as large."""
    x, y, w, t = sp.symbols("x y w t")
    rates = {x: -2 * x + sp.exp(3 * y) * (y - w), y: w - y}
    model = fs.Model(rates, forcing={w: t / 100})
    diagram = fs.continue_equilibria(model.frozen(), "w", over=(0, 2))
    overlay = fs.overlay(diagram, fs.simulate(model, [0, 0], t=(0, 200)))
    value = diagram.branches[0]["w"][len(diagram.branches[0]) // 2]
    assert overlay.extent[0] == pytest.approx(np.exp(3 * value) * overlay.extent[1], rel=1e-9)


def test_the_gear_changes_sides_at_the_gap(overlay):
    assert [(t.from_branch, t.to_branch) for t in overlay.transitions] == [
        ("S1", "S3"),
        ("S3", "S1"),
    ] * 3
    assert {t.type for t in overlay.transitions} == {"gap crossing"}
    assert {t.special.code for t in overlay.transitions} == {"BE"}


def test_the_delay_lies_between_touching_off_and_landing(overlay):
    """Each change of branch falls between the crossings of the two interfaces."""
    for transition in overlay.transitions:
        before = [c for c in overlay.run.crossings if c.time <= transition.time][-1]
        after = next(c for c in overlay.run.crossings if c.time > transition.time)
        assert before.to_region == "S2"
        assert {before.interface, after.interface} == {"x - D", "x + D"}
        assert transition.delay > 0
        assert transition.delay == pytest.approx(abs(transition.value), abs=1e-14)


def test_the_change_is_where_two_thirds_of_the_way_are_done(overlay, gear):
    """Recomputed from the closed form of both branches; v = 0 on both, so x alone counts."""
    for transition in overlay.transitions:
        side = 1 if transition.from_branch == "S1" else -1
        a, load = gear.parameters["A"], side * transition.value
        roots = np.roots([1, 0.25, a, 0.25 * a - load])
        (landing,) = roots[np.abs(roots.imag) < 1e-9].real
        x = side * overlay.run(transition.time)[0]
        assert (0.25 - x) / (0.25 - landing) == pytest.approx(2 / 3, abs=1e-5)


def test_distance_is_that_to_the_closed_form(overlay, gear):
    """On S1, x solves (x² + A)(x − D) = w; rows in between are interpolated to six digits."""
    a = gear.parameters["A"]
    extent = overlay.extent
    on = [
        k
        for k in range(0, len(overlay.t), 40)
        if overlay.stable_branches[overlay.followed[k]].label == "S1"
    ]
    on = [k for k in on if 0 < overlay.slow[k] < 6]
    assert len(on) > 20
    for k in on:
        roots = np.roots([1, -0.25, a, -0.25 * a - overlay.slow[k]])
        (x,) = roots[np.abs(roots.imag) < 1e-9].real
        expected = np.hypot(*((overlay.state[k] - [x, 0]) / extent))
        assert overlay.distance[k] == pytest.approx(expected, abs=1e-6)
    assert overlay.distance.shape == overlay.t.shape == overlay.followed.shape


def test_summary_tells_the_story(overlay):
    text = overlay.summary()
    assert "6 transitions" in text
    assert "S1 → S3" in text
    assert "gap crossing at BE2" in text


def test_jumps_at_both_folds():
    model = fs.Model(**folded_gear_parts(), parameters={"A": -0.6, "D": 0.25, "omega": 0.001})
    diagram = fs.continue_equilibria(model.frozen(), "w", over=(-0.4, 0.4))
    overlay = fs.overlay(diagram, fs.simulate(model, [0.9, 0], periods=2))
    assert {t.type for t in overlay.transitions} == {"jump"}
    assert len(overlay.transitions) == 3
    for transition in overlay.transitions:
        assert abs(transition.special["w"]) == pytest.approx(FOLD_W, abs=1e-14)
        assert 0 < transition.delay < 0.03


def folded_gear_parts():
    x, v, w, t, A, D, omega = sp.symbols("x v w t A D omega")
    gap = sp.Piecewise((x - D, x > D), (x + D, x < -D), (0, True))
    return {
        "rates": {x: v, v: w - v - (x**2 + A) * gap},
        "forcing": {w: sp.Rational(3, 10) * sp.sin(omega * t)},
    }


def test_a_van_der_pol_relaxation_with_a_slow_state():
    """εx' = y − x³/3 + x, y' = −x: the slow state y drives jumps at the folds y = ±2/3."""
    x, y, eps = sp.symbols("x y epsilon")
    model = fs.Model({x: (y - x**3 / 3 + x)}, slow={y: -eps * x}, parameters={eps: 1e-3})
    diagram = fs.continue_equilibria(model.frozen(), "y", over=(-1, 1))
    assert sorted(f["y"] for f in diagram.folds) == pytest.approx([-2 / 3, 2 / 3], abs=1e-14)
    overlay = fs.overlay(diagram, fs.simulate(model, [2, 0], t=(0, 4000)))
    assert len(overlay.transitions) >= 4
    assert {t.type for t in overlay.transitions} == {"jump"}
    # x' = β + ξ² beside the fold, β drifting with ε: reached infinity at 2.338 ε^(2/3)
    delays = overlay.delays
    assert np.ptp(delays) < 1e-6
    assert delays[0] == pytest.approx(2.33810741 * 1e-3 ** (2 / 3), rel=0.2)


def test_wrong_pairs_are_refused(overlay, gear):
    other = fs.simulate(gear.with_parameters(D=0.5), [0, 0], t=(0, 1))
    with pytest.raises(fs.FastSlowError, match=r"D = 0.25, the trajectory 0.5"):
        fs.overlay(overlay.diagram, other)
    frozen = fs.continue_equilibria(gear.frozen().with_parameters(w=1), "A", (1, 2))
    with pytest.raises(fs.FastSlowError, match="unknown slow quantity of the trajectory 'A'"):
        fs.overlay(frozen, overlay.run)
    still = fs.simulate(gear.frozen().with_parameters(w=1), [0, 0], t=(0, 1))
    with pytest.raises(fs.ArgumentError, match=r"no slow quantity.*forcing=\{A: \.\.\.\}"):
        fs.overlay(frozen, still)


def test_at_equal_distances_the_sheet_that_the_motion_turns_to_is_the_first():
    """From x = 0 the branches at ±1 of x' = x − x³ + w are as near; the load goes up."""
    x, w, t = sp.symbols("x w t")
    model = fs.Model({x: x - x**3 + w}, forcing={w: sp.sin(t / 100) / 10})
    diagram = fs.continue_equilibria(model.frozen(), "w", (-0.2, 0.2))
    run = fs.simulate(model, [0], t=(0, 300))
    overlay = fs.overlay(diagram, run)
    assert overlay.transitions == ()
    down = fs.Model({x: x - x**3 + w}, forcing={w: -sp.sin(t / 100) / 10})
    other = fs.overlay(diagram, fs.simulate(down, [0], t=(0, 300)))
    assert other.transitions == ()


def test_the_summary_names_a_state_that_the_run_has_lost():
    """With w = t/1000 - 1.3, x decays below exp(-690) before w = 0, beyond which it would grow."""
    x, w, t = sp.symbols("x w t")
    model = fs.Model({x: x * (w - x)}, forcing={w: t / 1000 - sp.Rational(13, 10)})
    diagram = fs.continue_equilibria(model.frozen(), "w", over=(-2, 2))
    overlay = fs.overlay(diagram, fs.simulate(model, [1], t=(0, 3000)))
    assert "\n  the run: x fell below 1e-300, the smallest number kept" in overlay.summary()


def test_a_thermostat_oscillates_between_its_thresholds():
    """The heater is on below 1 and off above 6/5; for -4/5 < w < 1 it changes for ever.

    At a constant w the period is ln((w + 1)/(w + 4/5)) + ln((6/5 - w)/(1 - w)).
    """
    temperature, q, w, t = sp.symbols("temperature q w t")
    model = fs.Model(
        {temperature: w - temperature + 2 * q},
        forcing={w: 2 * sp.cos(t / 100)},
        switches={q: (temperature < 1, temperature > sp.Rational(6, 5))},
    )
    run = fs.simulate(model, {temperature: 2, q: 0}, periods=1)
    diagram = fs.continue_equilibria(model.frozen(), "w", over=(-6, 6))
    overlay = fs.overlay(diagram, run)
    types = [(phase.type, phase.stable_branches) for phase in overlay.phases]
    off, on, cycle = ("S1 (q = 0)",), ("S1 (q = 1)",), ("oscillating", ())
    assert types == [
        ("quasi-static", off),
        cycle,
        ("quasi-static", on),
        cycle,
        ("quasi-static", off),
    ]
    begin, end, again, last = overlay.transitions
    assert "switch at BE" in str(begin)
    assert np.allclose([begin.value, again.value], [1, -0.8], rtol=0, atol=0.03)
    assert np.allclose([end.value, last.value], [-0.8, 1], rtol=0, atol=0.1)
    # the length of one oscillation about w = 0, to first order in the rate
    for phase in (overlay.phases[1], overlay.phases[3]):
        times = phase.start + np.cumsum(phase.intervals)
        near = np.argmin(np.abs(2 * np.cos(times / 100)))
        assert np.isclose(phase.intervals[near], np.log(1.5), rtol=0, atol=0.01)
        assert np.allclose(phase.sizes, 0.2, rtol=0, atol=1e-12)
