"""Bifurcation sweeps in strips: what they find is what a sweep in order finds."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.simulation import strips as strips_module

pytestmark = pytest.mark.slow

x, y, z, v, a, b, c, t, q, w = sp.symbols("x y z v a b c t q w")
FINE = fs.Integration(rtol=1e-12)


@pytest.fixture(scope="module")
def pair():
    return fs.systems.gear_pair()


@pytest.fixture(scope="module")
def roessler():
    return fs.Model(
        {x: -y - z, y: x + a * y, z: b + z * (x - c)}, parameters={a: 0.2, b: 0.2, c: 2.5}
    )


@pytest.fixture(scope="module")
def cubic():
    """Two stable equilibria for a² < 4/27."""
    return fs.Model({x: a + x - x**3}, parameters={a: 0.0})


@pytest.fixture
def rows_run(monkeypatch):
    """The rows of every ensemble that was run."""
    rows = []
    own = strips_module._Strips._motions_at
    monkeypatch.setattr(
        strips_module._Strips,
        "_motions_at",
        lambda self, some, states: rows.append(some.tolist()) or own(self, some, states),
    )
    return rows


def apart(one, other, values):
    """Largest distance of the points of two passes as sets, at each value."""
    found = []
    for value in values:
        gaps = np.abs(one.points_at(value)[:, None] - other.points_at(value))
        found.append(max(gaps.min(axis=0).max(initial=0.0), gaps.min(axis=1).max(initial=0.0)))
    return np.array(found)


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    ("strips", "what"), [(4, "stroboscopic"), (12, "extremes"), (24, "stroboscopic")]
)
def test_hysteresis_of_the_gear_pair(pair, strips, what, rows_run):
    """The upper branch from the graze to its fold, with strips that begin on both branches."""
    values = np.linspace(0.69, 0.85, 24)
    given = {"settle": 60, "keep": 2, "integration": FINE, "observe": fs.Observation(what)}
    plain = fs.bifurcation_sweep(pair, "Omega", values, [1.1, 0], **given)
    swept = fs.bifurcation_sweep(pair, "Omega", values, [1.1, 0], strips=strips, **given)
    assert len(plain.hysteresis()) == 1
    np.testing.assert_array_equal(swept.hysteresis(), plain.hysteresis())
    for one, other in zip(plain.passes, swept.passes, strict=True):
        np.testing.assert_allclose(other.x, one.x, rtol=0, atol=1e-9)
        np.testing.assert_allclose(other.ends, one.ends, rtol=0, atol=1e-9)
        assert [o.message for o in other.outcomes] == [o.message for o in one.outcomes]
    # a strip in the interval of hysteresis begins on the other branch, and runs again to the jump
    assert [19] in rows_run or strips > 4


@pytest.mark.sample(2)
@pytest.mark.parametrize("strips", [2, 5, 41])
@pytest.mark.parametrize("begin", [1.2, -1.2])
def test_coexisting_equilibria_in_closed_form(cubic, strips, begin, rows_run):
    """A state on the other branch at all values: the lower one up to a fold, then the upper one."""
    values = np.linspace(-1.0, 1.0, 41)
    given = {"settle": 60, "keep": 2, "period": 1.0, "integration": FINE}
    swept = fs.bifurcation_sweep(cubic, a, values, [begin], strips=strips, **given)
    fold = np.sqrt(4.0 / 27.0)
    for one, jump in ((swept.up, fold), (swept.down, -fold)):
        for value, end in zip(one.values, one.ends[:, 0], strict=True):
            roots = np.roots([-1.0, 0.0, 1.0, value])
            real = np.sort(roots[np.abs(roots.imag) < 1e-9].real)
            assert end == pytest.approx(real[0 if value < jump else -1], abs=1e-9)
    np.testing.assert_allclose(swept.hysteresis(), [[-0.35, 0.35]], atol=1e-12)
    # no more than in order, with all strips beside each other
    assert len(rows_run) <= 2 * 41 + 2


def test_a_strip_that_agrees_is_not_run_again(cubic, rows_run):
    values = np.linspace(1.0, 2.0, 20)
    given = {"settle": 30, "keep": 1, "period": 1.0, "back": False}
    fs.bifurcation_sweep(cubic, a, values, [1.0], strips=4, **given)
    assert rows_run == [[0, 5, 10, 15], [1, 6, 11, 16], [2, 7, 12, 17], [3, 8, 13, 18],
                        [4, 9, 14, 19], [5, 10, 15]]  # fmt: skip


def test_chaos_is_marked_and_the_rest_agrees():
    """The gear at a fast load: periodic windows between chaotic values."""
    gear = fs.systems.harmonic_gear(omega=1.0)
    values = np.linspace(2.5, 3.3, 40)
    given = {"settle": 60, "keep": 16}
    plain = fs.bifurcation_sweep(gear, "C", values, [0.3, 0], **given)
    swept = fs.bifurcation_sweep(gear, "C", values, [0.3, 0], strips=5, **given)
    for one, other in zip(plain.passes, swept.passes, strict=True):
        gaps = apart(one, other, one.values)
        assert one.irregular is None
        assert 3 < np.count_nonzero(other.irregular) < 30
        assert gaps[~other.irregular].max() < 1e-9
        assert gaps[other.irregular].max() < 0.25 * np.ptp(one.x)
    count = np.count_nonzero(swept.up.irregular)
    assert f"the motion does not repeat at {count} of them" in repr(swept)
    assert len(swept.select("irregular > 0")) == np.count_nonzero(swept.irregular)
    assert swept.to_dict()["irregular"].dtype == bool
    assert plain.irregular is None
    assert "irregular" not in plain.to_dict()


@pytest.fixture(scope="module")
def wells():
    """Duffing's oscillator in two wells."""
    return fs.Model({x: v, v: x - x**3 - 0.2 * v + a * sp.cos(t)}, parameters={a: 0.3})


def test_the_phase_of_a_longer_orbit_is_that_of_a_sweep_in_order(wells, rows_run):
    """Orbits of three periods, reached at other phases by other strips."""
    values = np.linspace(0.2855, 0.288, 12)
    given = {"settle": 100, "keep": 9, "back": False, "integration": fs.Integration(rtol=1e-11)}
    plain, swept = (
        fs.bifurcation_sweep(wells, a, values, [1, 0.5], strips=k, **given) for k in (1, 4)
    )
    regular = ~swept.up.irregular
    assert len(np.unique(swept.up.points_at(0.286).round(6))) == 3
    assert regular.sum() > 8
    np.testing.assert_allclose(swept.up.ends, plain.up.ends, rtol=0, atol=1e-9)
    # the later values of a strip at once, from states that are advanced along their orbits
    assert [7, 8] in rows_run


def test_a_jump_may_depend_on_the_phase():
    """Three periods at 0.849; the same orbit attracts at 0.875, but not from each of its phases."""
    impacts = fs.systems.impact_oscillator(f=0.3095944059193804)
    values, begin = [0.8239545670305247, 0.8492541233170506, 0.8745536796930292], [0.14458431, 0]
    given = {"settle": 139, "keep": 9, "back": False, "integration": fs.Integration(rtol=1e-11)}
    plain, swept = (
        fs.bifurcation_sweep(impacts, "omega", values, begin, strips=k, **given) for k in (1, 2)
    )
    np.testing.assert_allclose(swept.up.ends[:2], plain.up.ends[:2], rtol=0, atol=1e-9)
    assert swept.up.irregular.tolist() == [False, False, True]
    assert np.ptp(plain.up.points_at(values[2])) > 0.1


def test_ranges_of_chaos_end_a_strip(wells, rows_run):
    """A chaotic state never agrees with another one."""
    values = np.linspace(0.33, 0.34, 8)
    given = {"settle": 60, "keep": 24, "back": False}
    swept = fs.bifurcation_sweep(wells, a, values, [1, 0], strips=4, **given)
    assert swept.up.irregular.any()
    assert sum(map(len, rows_run)) < 2 * len(values)


def test_cycles_on_a_section_agree_up_to_their_phase(roessler, rows_run):
    """The doubled cycle: time and the order of its points are not those of a sweep in order."""
    values = np.linspace(3.1, 3.3, 6)
    given = {
        "settle": 120, "keep": 8, "period": 6.0, "back": False, "integration": FINE,
        "observe": fs.Observation("section", column=y, section=x + a * y, direction=-1),
    }  # fmt: skip
    plain = fs.bifurcation_sweep(roessler, c, values, [1, 1, 0], **given)
    swept = fs.bifurcation_sweep(roessler, c, values, [1, 1, 0], strips=2, **given)
    assert not swept.up.irregular.any()
    assert np.ptp(swept.up.points_at(3.2)) > 0.1
    assert apart(plain.up, swept.up, values).max() < 1e-9
    assert rows_run == [[0, 3], [1, 4], [2, 5], [3]]


def test_failures_and_notes_are_those_of_single_runs():
    escape = fs.Model({x: a + x**2}, parameters={a: -1.0})
    given = {"settle": 20, "keep": 2, "period": 1.0}
    plain, swept = (
        fs.bifurcation_sweep(escape, a, [-1.0, -0.5, 0.5, 1.0], [0], strips=k, **given)
        for k in (1, 4)
    )
    assert [value for value, _ in swept.failures] == [0.5, 1.0, 1.0, 0.5]
    for one, other in zip(plain.passes, swept.passes, strict=True):
        assert [o.code for o in other.outcomes] == [o.code for o in one.outcomes]
        np.testing.assert_array_equal(other.counts, one.counts)
        np.testing.assert_allclose(other.ends, one.ends, rtol=0, atol=1e-9)
        assert not other.irregular[np.isnan(other.ends[:, 0])].any()
    # x falls by a factor exp(−80) in every period
    falling = fs.Model({x: x * (a + 40 * sp.cos(t)) - x**3}, parameters={a: 0.1})
    noisy = {
        "period": 2 * sp.pi, "settle": 1, "keep": 1, "integration": fs.Integration(atol=1e-12),
    }  # fmt: skip
    plain, swept = (
        fs.bifurcation_sweep(falling, "a", [0.1, 0.2], [1], strips=k, **noisy) for k in (1, 2)
    )
    assert all("x fell below its atol" in o.notes[0] for o in swept.up.outcomes)
    # what is recorded at a value where two runs meet is that of the new one
    assert swept.up.x == pytest.approx(plain.up.x, rel=1e-9)


def test_a_vanishing_state_agrees_in_its_own_size():
    """x falls to exp(−404) and returns with the delay of a slow passage, as log x at a < 0 says."""
    growth = fs.Model({x: x * (a - x)}, parameters={a: 0.0})
    values = np.linspace(-2, 2, 12)
    given = {"settle": 60, "keep": 2, "period": 1.0, "back": False, "integration": FINE}
    plain, swept = (
        fs.bifurcation_sweep(growth, a, values, [1.0], strips=k, **given) for k in (1, 4)
    )
    assert plain.up.ends.min() < 1e-100
    np.testing.assert_allclose(swept.up.ends, plain.up.ends, rtol=1e-8, atol=0)


def test_a_state_that_remains_zero_repeats():
    decaying = fs.Model({x: -a * x * (2 + sp.cos(t))}, parameters={a: 1})
    found = fs.bifurcation_sweep(decaying, "a", [1, 2, 3, 4], [0], settle=1, keep=4, strips=2)
    assert not found.irregular.any()


def test_the_states_of_switches_go_with_a_strip(monkeypatch):
    """A relay with hysteresis, switched on and off by its load; no run fails in the ensemble."""
    monkeypatch.delattr(strips_module, "run_at")
    relay = fs.Model(
        {x: 2 * q - 1 - x + a * sp.cos(t)}, parameters={a: 3.0}, switches={q: (x < -1, x > 1)}
    )
    given = {"settle": 10, "keep": 3, "observe": fs.Observation(phase=0.25)}
    values, begin = np.linspace(2, 4, 12), {"x": 0.0, "q": 1}
    plain = fs.bifurcation_sweep(relay, "a", values, begin, **given)
    swept = fs.bifurcation_sweep(relay, "a", values, begin, strips=4, **given)
    np.testing.assert_allclose(swept.x, plain.x, rtol=0, atol=1e-9)
    np.testing.assert_allclose(swept.up.ends, plain.up.ends, rtol=0, atol=1e-9)


def test_impacts_and_kicks():
    """Impacts are samples of an ensemble; at the instants of kicks the state after them counts."""
    impacts = fs.systems.impact_oscillator()
    kicked = fs.Model({x: a - x}, parameters={a: 1.0}, resets={sp.Eq(sp.Mod(t, 1), 0): {x: x + a}})
    for model, name, values, period in (
        (impacts, "omega", np.linspace(2.4, 2.6, 8), None),
        (kicked, "a", np.linspace(1, 2, 4), 1.0),
    ):
        given = {"settle": 60, "keep": 4, "period": period, "back": False}
        start = dict.fromkeys(model.states, 0.0)
        plain = fs.bifurcation_sweep(model, name, values, start, **given)
        swept = fs.bifurcation_sweep(model, name, values, start, strips=4, **given)
        np.testing.assert_allclose(swept.x, plain.x, rtol=0, atol=1e-9)
    # x falls to a + (x₀ − a)/e in a period, then jumps by a
    fixed = values + values / (1 - np.exp(-1.0))
    assert swept.up.ends[:, 0] == pytest.approx(fixed, abs=1e-9)


def test_extremes_of_a_cycle(roessler):
    """Extremes of an autonomous cycle do not depend on its phase."""
    values = np.linspace(2.4, 2.55, 4)
    given = {
        "settle": 80, "keep": 4, "period": 8.0, "back": False, "integration": FINE,
        "observe": fs.Observation("extremes", column=y),
    }  # fmt: skip
    plain = fs.bifurcation_sweep(roessler, c, values, [1, 1, 0], **given)
    swept = fs.bifurcation_sweep(roessler, c, values, [1, 1, 0], strips=2, **given)
    regular = ~swept.up.irregular
    assert regular.any()
    assert apart(plain.up, swept.up, values)[regular].max() < 1e-9


def test_values_without_a_period_fail_alone():
    two = fs.Model({x: sp.cos(t) + sp.cos(a * t) - x}, parameters={a: 2.0})
    swept = fs.bifurcation_sweep(two, "a", [2.0, np.sqrt(5), 3.0], [0], strips=3, settle=2, keep=1)
    assert [outcome.code for outcome in swept.up.outcomes] == [
        "end of time",
        "error",
        "end of time",
    ]
    assert "common period" in swept.failures[0][1].message


def test_progress_counts_every_value_once(pair, capsys):
    fs.bifurcation_sweep(
        pair, "Omega", [0.6, 0.5], [1.1, 0], settle=1, keep=1, strips=2, integration=FINE,
        execution=fs.Execution(progress=True),
    )  # fmt: skip
    assert "4/4" in capsys.readouterr().err


def test_results_do_not_depend_on_threads(cubic):
    given = {"settle": 3, "keep": 2, "period": 1.0, "strips": 16}
    one, two = (
        fs.bifurcation_sweep(
            cubic, a, np.linspace(-1, 1, 16), [1.2], execution=fs.Execution(threads=k), **given
        )
        for k in (1, 2)
    )
    assert one == two
    assert one.settings["strips"] == 16


@pytest.mark.parametrize(
    ("strips", "text"),
    [
        (0, "strips = 0; expected an integer from 1"),
        (2.5, "strips = 2.5; expected an integer"),
        (True, "strips = True; expected an integer"),
        (4, "strips = 4 of 3 values; expected an integer from 1 to 3"),
    ],
)
def test_wrong_strips(cubic, strips, text):
    with pytest.raises(fs.ArgumentError, match=text):
        fs.bifurcation_sweep(cubic, a, [0.1, 0.2, 0.3], [1.0], period=1.0, strips=strips)
