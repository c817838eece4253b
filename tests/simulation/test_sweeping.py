"""Bifurcation diagrams by simulation against bifurcations located by exact shooting."""

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

import fastslow as fs
from fastslow.kernels.taylor.series import compile_series

pytestmark = pytest.mark.slow

# folds of the gear pair's orbits and the grazing on the way up, by exact shooting
UP, DOWN, GRAZING = 0.8284639844, 0.7080316187, 0.8206310877

# where Rössler's cycle doubles at a = b = 0.2: multiplier −1 by SciPy's DOP853 and Newton
DOUBLING, CYCLE = 2.8324450278, 5.76982002

x, y, z, a, b, c = sp.symbols("x y z a b c")


@pytest.fixture(scope="module")
def pair():
    return fs.systems.gear_pair()


@pytest.fixture(scope="module")
def roessler():
    return fs.Model(
        {x: -y - z, y: x + a * y, z: b + z * (x - c)}, parameters={a: 0.2, b: 0.2, c: 2.5}
    )


@pytest.fixture(scope="module")
def swept(pair):
    values = np.arange(0.69, 0.8501, 0.004)
    return fs.bifurcation_sweep(
        pair,
        "Omega",
        values,
        [1.1, 0],
        settle=150,
        keep=4,
        observe=fs.Observation("extremes"),
        integration=fs.Integration(rtol=1e-12),
    )


def test_hysteresis_of_the_gear_pair(swept):
    ((low, high),) = swept.hysteresis()
    assert high < UP < high + 0.004
    # a little below its fold the lost orbit still holds the motion for a while
    assert low - 0.004 < DOWN < low + 0.004
    assert not swept.failures


def test_the_teeth_part_where_the_orbit_grazes(swept):
    lowest = np.array([swept.up.points_at(value).min() for value in swept.up.values])
    assert (lowest[swept.up.values < GRAZING] > 1).all()
    assert (lowest[swept.up.values > GRAZING] < 1).all()


def test_a_sweep_in_flat_arrays(swept):
    up, down = swept.up, swept.down
    assert (up.direction, down.direction) == (1, -1)
    assert np.array_equal(up.values, down.values[::-1])
    assert (up.counts == 8).all()
    assert len(swept.swept) == len(swept.x) == len(swept.direction) == 2 * len(up.x)
    assert np.array_equal(swept.x[swept.direction < 0], down.x)
    assert up.ends.shape == (len(up.values), 2)
    assert "pass down: 328 points at 41 values" in repr(swept)


def test_stroboscopic_points_in_closed_form(pair):
    values = [0.3, 0.5, 0.6]
    drawn = fs.bifurcation_sweep(
        pair, "Omega", values, {"x": 1.1, "v": 0}, settle=60, keep=2,
        observe=fs.Observation(column="v", phase=0.25),
        back=False, integration=fs.Integration(rtol=1e-12),
    )  # fmt: skip
    assert drawn.down is None
    for value in values:
        amplitude = 0.05 * value**2 / (1 - value**2 + 0.1j * value)
        # a quarter of a period after phase 0
        speed = (1j * value * amplitude * 1j).imag
        assert drawn.up.points_at(value) == pytest.approx([speed, speed], abs=1e-11)
    with pytest.raises(fs.ArgumentError, match="back=True"):
        drawn.hysteresis()


def test_period_doubling(roessler):
    values = np.arange(2.74, 2.9401, 0.04)
    # the maxima of y: its rate falls through zero
    drawn = fs.bifurcation_sweep(
        roessler, c, values, [1, 1, 0], settle=300, keep=12,
        observe=fs.Observation("section", column=y, section=x + a * y, direction=-1),
        period=6.0, back=False,
    )  # fmt: skip
    apart = np.array([np.ptp(drawn.up.points_at(value)) for value in values])
    assert (apart[values < DOUBLING - 0.02] < 1e-5).all()
    assert (apart[values > DOUBLING + 0.02] > 0.1).all()
    # the multiplier is −0.978 here, so it takes its time
    run = fs.simulate(roessler.with_parameters(c=2.8), drawn.up.ends[1], t=(0, 6000))
    before = run.periodicity()
    assert before.multiple == 1
    assert before.period == pytest.approx(5.76792059, abs=1e-5)


def test_doubled_orbit_closes_in_scipy_too(roessler):
    run = fs.simulate(roessler.with_parameters(c=3.5), [1, 1, 0], t=(0, 900))
    settled = run.periodicity()
    assert settled.multiple == 2
    begin = settled.section.table[:3, -1]
    other = solve_ivp(
        lambda t, u: [-u[1] - u[2], u[0] + 0.2 * u[1], 0.2 + u[2] * (u[0] - 3.5)],
        (0, settled.period),
        begin,
        method="DOP853",
        rtol=1e-11,
        atol=1e-12,
        dense_output=True,
    )
    assert other.y[:, -1] == pytest.approx(begin, abs=1e-6)
    assert np.abs(other.sol(settled.period / 2) - begin).max() > 0.1
    chaos = fs.simulate(roessler.with_parameters(c=5.7), [1, 1, 0], t=(0, 900)).periodicity()
    assert chaos.outcome.code == "not periodic"
    assert chaos.multiple is None


def test_nothing_is_lost_where_values_fail(roessler):
    # for a = 0.6 the motion escapes
    drawn = fs.bifurcation_sweep(
        roessler, "a", [0.1, 0.2, 2.0], [1, 1, 0], settle=20, keep=5, period=6.0
    )
    assert [value for value, _ in drawn.failures] == [2.0, 2.0]
    assert drawn.up.counts.tolist() == drawn.down.counts[::-1].tolist() == [5, 5, 0]
    assert np.isnan(drawn.up.ends[2]).all()
    assert np.isfinite(drawn.down.ends[1:]).all()
    assert "1 of them failed" in repr(drawn)


def test_a_pass_says_where_noise_decides():
    """x falls by a factor exp(−80) in every period."""
    t = sp.Symbol("t")
    model = fs.Model({x: x * (a + 40 * sp.cos(t)) - x**3}, parameters={a: 0.1})
    given = {"period": 2 * sp.pi, "observe": fs.Observation("extremes"), "settle": 1, "keep": 1}
    rough = fs.Integration(atol=1e-12)
    sweep = fs.bifurcation_sweep(model, "a", [0.1, 0.2], [1], integration=rough, **given)
    assert all(
        "x fell below its atol = 1e-12" in note for o in sweep.up.outcomes for note in o.notes
    )
    assert all(o.notes and o for o in sweep.up.outcomes)
    assert "noise may decide at 2 of them, first: x fell below its atol" in repr(sweep)
    relative = fs.bifurcation_sweep(model, "a", [0.1, 0.2], [1], **given)
    assert "noise" not in repr(relative)


def test_falling_values_and_progress(pair, capsys):
    drawn = fs.bifurcation_sweep(
        pair,
        "Omega",
        [0.6, 0.5],
        [1.1, 0],
        settle=1,
        keep=1,
        integration=fs.Integration(rtol=1e-12),
        execution=fs.Execution(progress=True),
    )
    assert drawn.passes[0] is drawn.down
    assert drawn.values.tolist() == [0.5, 0.6]
    assert "4/4" in capsys.readouterr().err


def test_values_are_not_compiled(pair):
    one = compile_series(pair, 24)
    other = compile_series(pair.with_parameters(Omega=0.123), 24)
    assert one.address == other.address


def test_the_slow_quantity_of_a_frozen_model_is_swept():
    """x' = w − x − x³ settles at w = x + x³."""
    w, t = sp.symbols("w t")
    fast = fs.Model({x: w - x - x**3}, forcing={w: sp.sin(t)}).frozen()
    values = [0.0, 2.0, 10.0]
    swept = fs.bifurcation_sweep(fast, w, values, [1.0], settle=40, keep=1, period=1.0, back=False)
    np.testing.assert_allclose(swept.x, [0, 1, 2], atol=1e-9)
    with pytest.raises(fs.UnknownNameError, match="known: w"):
        fs.bifurcation_sweep(fast, "u", values, [1.0], period=1.0)


@pytest.mark.parametrize(
    ("changes", "error", "text"),
    [
        ({"parameter": "Omga"}, fs.UnknownNameError, "did you mean 'Omega'"),
        (
            {"values": [0.5, 0.4, 0.6]},
            fs.ArgumentError,
            "strictly increasing or strictly decreasing",
        ),
        ({"values": []}, fs.ArgumentError, "one-dimensional array"),
        ({"values": "abc"}, fs.ArgumentError, "expected numbers"),
        ({"values": [np.nan]}, fs.ArgumentError, "finite"),
        ({"observe": fs.Observation(column="z")}, fs.UnknownNameError, "unknown column 'z'"),
        ({"state": [1]}, fs.ArgumentError, "expected 2 values"),
        ({"keep": 0}, fs.ArgumentError, "keep = 0"),
        ({"settle": 1.5}, fs.ArgumentError, "integer"),
        (
            {"observe": fs.Observation("section", section="vv")},
            fs.UnknownNameError,
            "column or parameter 'vv'",
        ),
    ],
)
def test_wrong_arguments(pair, changes, error, text):
    given = {"parameter": "Omega", "values": [0.5], "state": [1.1, 0], **changes}
    with pytest.raises(error, match=text):
        fs.bifurcation_sweep(pair, **given)


@pytest.mark.parametrize(
    ("given", "error", "text"),
    [
        ({"what": "extreme"}, fs.UnknownNameError, "did you mean 'extremes'"),
        ({"what": "section"}, fs.ArgumentError, "needs section="),
        ({"section": "v"}, fs.ArgumentError, "goes with"),
        ({"what": "section", "section": "v", "direction": 3}, fs.ArgumentError, "direction = 3"),
        ({"phase": 2}, fs.ArgumentError, "a number from 0 to 1"),
    ],
)
def test_wrong_observations(given, error, text):
    with pytest.raises(error, match=text):
        fs.Observation(**given)


def test_a_model_without_forcing_needs_a_unit_of_time(roessler):
    with pytest.raises(fs.ArgumentError, match="period="):
        fs.bifurcation_sweep(roessler, "c", [2.5], [1, 1, 0])
