"""Clocks: sawtooth and steps of time, pulse-width modulation, kicks; instants met exactly."""

import numpy as np
import pytest
import sympy as sp
from scipy.linalg import expm
from scipy.optimize import brentq

import fastslow as fs

pytestmark = pytest.mark.slow

x, v, t, T, d, k, w = sp.symbols("x v t T d k w")
FINE = fs.Integration(rtol=1e-13, atol=1e-13)


@pytest.fixture(scope="module")
def modulated():
    """x' = 1 − x during a fraction d of every period, else −x."""
    duty = sp.Piecewise((1, sp.Mod(t, T) < d * T), (0, True))
    return fs.Model({x: duty - x}, parameters={T: 0.7, d: 0.3})


@pytest.fixture(scope="module")
def kicked():
    """A damped oscillator with a kick once per period."""
    rates = {x: v, v: -x - v / 10}
    return fs.Model(rates, parameters={T: 2, k: 1}, resets={sp.Eq(sp.Mod(t, T), 0): {v: v + k}})


def test_sawtooth():
    model = fs.Model({x: sp.Mod(t, T) - x}, parameters={T: 0.7})
    run = fs.simulate(model, [0.2], t=(0, 5), integration=FINE)
    assert {k * 0.7 for k in range(8)} <= set(run.steps[:, 0])
    exact = 0.2
    for begin in np.arange(8) * 0.7:
        length = min(0.7, 5 - begin)
        exact = exact * np.exp(-length) + length - 1 + np.exp(-length)
    assert run.end[1] == pytest.approx(exact, abs=1e-14)
    assert model.period() == pytest.approx(0.7)


def test_starts_inside_a_period_and_at_an_instant():
    model = fs.Model({x: sp.Mod(t, T)}, parameters={T: 0.1})
    for begin in (0.25, 3 * 0.1, -1.23):
        run = fs.simulate(model, [0.0], t=(begin, begin + 0.05), integration=FINE)
        since = begin - 0.1 * np.floor(begin / 0.1 + 1e-9)
        first = min(0.05, 0.1 - since)
        exact = since * first + first**2 / 2 + (0.05 - first) ** 2 / 2
        assert run.end[1] == pytest.approx(exact, abs=1e-15)


def test_staircase():
    model = fs.Model({x: sp.floor(t / T) + sp.ceiling(t / T)}, parameters={T: 0.5})
    run = fs.simulate(model, [0.0], t=(0, 3), integration=FINE)
    assert run.end[1] == pytest.approx(0.5 * sum(2 * n + 1 for n in range(6)), abs=1e-13)
    assert model.period() is None


@pytest.mark.parametrize("span", [(-3.3, 4.7), (-12.0, -1.0)])
def test_phases_before_zero_and_falling_arguments(span):
    """Against sums over a fine grid; instants are multiples of 1/42 after 1/42."""
    third, seventh = sp.Rational(1, 3), sp.Rational(1, 7)
    functions = {
        sp.floor((t + third) / 2): lambda t: np.floor((t + 1 / 3) / 2),
        sp.ceiling(-t / 2 - 5): lambda t: np.ceil(-t / 2 - 5),
        sp.frac(-t / 3 + seventh): lambda t: np.mod(-t / 3 + 1 / 7, 1),
        sp.Mod(-t, T) + sp.Mod(t - 7, 2.5): lambda t: np.mod(-t, 0.7) + np.mod(t - 7, 2.5),
        sp.Mod(-t, -2): lambda t: np.mod(-t, -2),
    }
    states = sp.symbols("x:5")
    model = fs.Model(dict(zip(states, functions, strict=True)), parameters={T: 0.7})
    run = fs.simulate(model, [0.0] * 5, t=span, integration=FINE)
    # midpoints between multiples of 1/210 are never instants, and exact for lines between them
    edges = np.linspace(*span, round(210 * (span[1] - span[0])) + 1)
    middle = 0.5 * (edges[1:] + edges[:-1])
    sums = [function(middle).sum() / 210 for function in functions.values()]
    assert run.end[1:] == pytest.approx(sums, abs=1e-11)


def test_pulse_width_modulation(modulated):
    run = fs.simulate(modulated, [0.2], t=(0, 7), integration=FINE)
    ups = [c.time for c in run.crossings if c.to_region == "S1"]
    # the last one is at the end of the run
    assert ups == [n * 0.7 for n in range(1, 11)]
    downs = [c.time for c in run.crossings if c.to_region == "S2"]
    assert downs == pytest.approx(0.7 * (np.arange(10) + 0.3), abs=1e-13)
    exact = 0.2
    for _ in range(10):
        exact = 1 + (exact - 1) * np.exp(-0.21)
        exact *= np.exp(-0.49)
    assert run.end[1] == pytest.approx(exact, abs=1e-14)
    assert modulated.period() == pytest.approx(0.7)


def test_ensembles_have_periods_of_their_own(modulated):
    starts, periods = np.linspace(0, 1, 24)[:, None], np.linspace(0.3, 0.9, 24)
    one, two = (
        fs.simulate_many(
            modulated,
            starts,
            parameters={T: periods},
            t=(0, 5),
            integration=FINE,
            execution=fs.Execution(threads=n),
        )
        for n in (1, 2)
    )
    assert one.final.tobytes() == two.final.tobytes()
    for n in (0, 11):
        run = fs.simulate(
            modulated.with_parameters(T=periods[n]), starts[n], t=(0, 5), integration=FINE
        )
        assert one.final[n] == pytest.approx(run.end[1:], abs=1e-13)
        assert one.hits[n].sum() == len(run.crossings)


def test_kicks_are_those_of_the_exponential(kicked):
    run = fs.simulate(kicked, [0.0, 0.0], t=(0, 9), integration=FINE)
    assert [e.time for e in run.resets] == [2.0, 4.0, 6.0, 8.0]
    flow = expm(np.array([[0, 1], [-1, -0.1]]) * 2)
    state = np.zeros(2)
    for event in run.resets:
        state = flow @ state
        assert event.before == pytest.approx(state, abs=1e-13)
        state[1] += 1
        assert event.after == pytest.approx(state, abs=1e-13)
    assert {e.reset for e in run.resets} == {"Eq(Mod(t, T), 0)"}
    assert kicked.period() == 2


def test_kicks_by_the_fractional_part():
    every = sp.Eq(sp.frac(t / 2 - sp.Rational(1, 4)), 0)
    run = fs.simulate(fs.Model({x: 1}, resets={every: {x: 0}}), [0.0], t=(0, 5))
    assert [e.time for e in run.resets] == [0.5, 2.5, 4.5]


def test_kicks_and_forcing_without_a_common_period():
    """x'' + x = cos 2t with kicks every √2, by the exact rotation between them."""
    rates = {x: v, v: sp.cos(2 * t) - x}
    model = fs.Model(
        rates,
        parameters={T: np.sqrt(2), k: 0.3},
        resets={sp.Eq(sp.Mod(t, T), 0): {v: v + k}},
    )
    assert model.period() is None
    run = fs.simulate(model, [0.0, 0.0], t=(0, 30), integration=FINE)
    state, now = np.zeros(2), 0.0
    for event in run.resets:
        free = state - [-np.cos(2 * now) / 3, 2 * np.sin(2 * now) / 3]
        c, s = np.cos(event.time - now), np.sin(event.time - now)
        state = np.array([[c, s], [-s, c]]) @ free
        now = event.time
        state += [-np.cos(2 * now) / 3, 2 * np.sin(2 * now) / 3]
        assert event.before == pytest.approx(state, abs=1e-12)
        state[1] += 0.3
    assert len(run.resets) == 21
    with pytest.raises(fs.ArgumentError, match="nothing in this model has a common period"):
        fs.simulate(model, [0.0, 0.0], periods=1)


def test_a_kick_at_the_start_belongs_to_the_run_before(kicked):
    whole = fs.simulate(kicked, [1.0, 0.0], t=(0, 8), integration=FINE)
    first = fs.simulate(kicked, [1.0, 0.0], t=(0, 4), integration=FINE)
    second = fs.simulate(kicked, first.end[1:], t=(4, 8), integration=FINE)
    assert [len(one.resets) for one in (whole, first, second)] == [4, 2, 2]
    assert second.end == pytest.approx(whole.end, abs=1e-12)


def test_kicks_and_impacts_in_one_model(kicked):
    odd = sp.Eq(sp.Mod(t - 1, 2), 0)
    resets = {odd: {v: v + 1}, x >= 0.5: {v: -v / 2}}
    both = fs.Model({x: v, v: -x}, resets=resets)
    run = fs.simulate(both, [0.0, 0.0], t=(0, 20), integration=FINE)
    kicks = [e.time for e in run.resets(odd)]
    assert kicks == list(range(1, 20, 2))
    assert len(run.resets("x >= 0.5")) > 3
    assert all(e.before[0] == 0.5 for e in run.resets("x >= 0.5"))


VALUES = {"R": 22, "C": 47e-6, "L": 20e-3, "A": 8.4, "Vr": 11.3, "Vl": 3.8, "Vu": 8.2, "Tc": 4e-4}


@pytest.fixture(scope="module")
def buck():
    """Voltage-mode buck converter of Fossas and Olivar (1996)."""
    c, i = sp.symbols("c i")
    R, C, L, A, Vr, Vl, Vu, Tc, E = sp.symbols("R C L A Vr Vl Vu Tc E")
    ramp = Vl + (Vu - Vl) * sp.Mod(t, Tc) / Tc
    source = sp.Piecewise((E, A * (c - Vr) < ramp), (0, True))
    return fs.Model({c: (i - c / R) / C, i: (source - c) / L}, parameters={**VALUES, "E": 24})


def stroboscopic(state, source, periods):
    """States of the converter by matrix exponentials, the switching times by Brent's method."""
    R, C, L, A, Vr, Vl, Vu, Tc = VALUES.values()
    matrix = np.array([[-1 / (R * C), 1 / C], [-1 / L, 0]])
    fixed = np.linalg.solve(matrix, np.array([0, -1 / L]))

    def after(z, time, on):
        return expm(matrix * time) @ (z - on * source * fixed) + on * source * fixed

    for _ in range(periods):
        now, z, on = 0.0, np.array(state), A * (state[0] - Vr) < Vl
        while now < Tc:

            def gap(s, now=now, z=z, on=on):
                return A * (after(z, s, on)[0] - Vr) - Vl - (Vu - Vl) * (now + s) / Tc

            grid = np.linspace(1e-9, Tc - now, 200)
            change = np.flatnonzero([(gap(s) < 0) != on for s in grid])
            if not len(change):
                z, now = after(z, Tc - now, on), Tc
                break
            root = brentq(gap, grid[change[0] - 1], grid[change[0]], xtol=1e-18)
            z, now, on = after(z, root, on), now + root, not on
        state = z
    return state


def test_buck_converter_against_matrix_exponentials(buck):
    for source in (22.0, 26.0):
        model = buck.with_parameters(E=source)
        run = fs.simulate(model, [12.0, 0.5], t=(0, 20 * 4e-4), integration=FINE)
        assert run.end[1:] == pytest.approx(stroboscopic([12.0, 0.5], source, 20), rel=1e-9)


def test_buck_converter_doubles_its_period(buck):
    """The period doubling is at E = 24.5 (Fossas and Olivar 1996)."""
    changes = {}
    for source in (24.0, 25.0):
        model = buck.with_parameters(E=source)
        run = fs.simulate(model, [12.0, 0.5], periods=400)
        section = run(np.arange(395, 400) * 4e-4)[0]
        changes[source] = [abs(section[-1] - section[-1 - n]) for n in (1, 2)]
    assert changes[24.0][0] < 1e-6
    assert changes[25.0][0] > 5e-3
    assert changes[25.0][1] < 1e-6


def test_models_with_clocks_are_saved(modulated, tmp_path):
    run = fs.simulate(modulated, [0.2], t=(0, 5))
    run.save(tmp_path / "run.npz")
    loaded = fs.load(tmp_path / "run.npz")
    assert loaded == run
    assert fs.simulate(loaded.model, [0.2], t=(0, 5)) == run
    longer = fs.simulate(loaded.model.with_parameters(T=0.9, d=0.4), [0.2], t=(0, 5))
    again = fs.simulate(modulated.with_parameters(T=0.9, d=0.4), [0.2], t=(0, 5))
    assert longer.series.tobytes() == again.series.tobytes()


def test_a_forcing_with_a_clock_is_frozen():
    model = fs.Model({x: w - x}, forcing={w: sp.Mod(t, 10) / 5 - 1})
    assert model.frozen().free == ("w",)
    assert model.period() == pytest.approx(10)
    run = fs.simulate(model, [0.0], t=(0, 25))
    assert run.dense_columns([9.0, 11.0])[1] == pytest.approx([0.8, -0.8])


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda m: fs.simulate(m.with_parameters(T=-1), [0], t=(0, 1)), "has the period -1"),
        (lambda m: fs.Model({x: sp.Mod(x, 1)}), "jumps at infinitely many values"),
        (lambda m: fs.Model({x: sp.floor(t**2)}), "jumps at infinitely many values"),
        (
            lambda m: fs.Model({x: 1}, resets={sp.Eq(sp.Mod(t, 2), 1): {x: 0}}),
            r"or Eq\(Mod\(t - phase, T\), 0\) for instants of time",
        ),
        (lambda m: fs.simulate(m.with_parameters(T=0), [0], t=(0, 1)), "has the period 0"),
        (lambda m: m.with_parameters(T=np.inf), "expected a finite number, received inf"),
        (lambda m: fs.export(m, "auto"), "would ignore the clock of this model"),
        (lambda m: fs.equilibria(m), "depend on time explicitly"),
        (lambda m: fs.derive(m), "depends on time"),
    ],
)
def test_bad_input(call, words, modulated):
    with pytest.raises(fs.FastSlowError, match=words):
        call(modulated)


def test_strobes_at_kicks_are_after_them():
    """x' = −x with x → x + 1 at kT repeats after T; the last strobe is the end of the run."""
    kicked = fs.Model({x: -x}, parameters={T: 0.7}, resets={sp.Eq(sp.Mod(t, T), 0): {x: x + 1}})
    run = fs.simulate(kicked, [0.0], periods=400)
    fixed = 1 / (1 - np.exp(-0.7))
    assert run.stroboscopic()["x"][60:] == pytest.approx(np.full(341, fixed), rel=1e-8)
    assert run.periodicity().multiple == 1


R = sp.Rational
NESTED = [
    sp.floor(2 * sp.Mod(t, 1)),
    sp.Mod(sp.floor(t), 2),
    sp.floor(R(5, 2) * sp.Mod(t, 1)),
    sp.ceiling(3 * sp.Mod(t, 2) + R(1, 3)),
    sp.Mod(3 * sp.floor(t / 2) + 1, 4),
    sp.floor(R(3, 4) * sp.floor(2 * t) + R(1, 5)),
    sp.Mod(sp.Mod(t, 2), R(3, 2)),
    sp.floor(R(1, 4) - 2 * sp.Mod(t, 1)),
    sp.floor(3 - R(7, 3) * sp.Mod(t + R(1, 5), R(3, 2))),
    sp.frac(sp.floor(t) / 3),
    sp.Mod(-sp.floor(t), 3),
    sp.floor(sp.Mod(2 * t, 3) / 2) - sp.floor(sp.floor(t) / 2 + sp.ceiling(t / 3)),
]


@pytest.mark.parametrize("rate", NESTED)
def test_nested_steps_of_time(rate):
    """x' = f(t) against the sum of f in the middle of intervals at whose ends all f may jump."""
    run = fs.simulate(fs.Model({x: rate}), [0.0], t=(-4, 4), integration=FINE)
    # 2520 is divisible by 8, 9, 35 and 60
    middles = (np.arange(-4 * 2520, 4 * 2520) + 0.5) / 2520
    known = sp.lambdify(t, rate, [{"frac": lambda u: u % 1.0}, "numpy"])
    exact = np.sum(known(middles)) / 2520
    assert run.end[1] == pytest.approx(exact, abs=1e-11)


def test_nested_steps_with_parameters():
    rate = sp.floor(4 * sp.Mod(t, T) / T) + sp.Mod(sp.floor(t / T), 2)
    run = fs.simulate(fs.Model({x: rate}, parameters={T: 0.1}), [0.0], t=(0, 2), integration=FINE)
    assert run.end[1] == pytest.approx(2 * 1.5 + 1, abs=1e-12)


@pytest.mark.parametrize(
    "rate",
    [
        sp.floor(x),
        sp.floor(x + sp.Mod(t, 1)),
        sp.Mod(t + sp.floor(t), 2),
        sp.floor(T * sp.Mod(t, 1)),
    ],
)
def test_steps_at_unknown_instants_are_refused(rate):
    with pytest.raises(fs.ModelError, match="jumps at infinitely many values"):
        fs.Model({x: rate}, parameters={T: 1.5})
