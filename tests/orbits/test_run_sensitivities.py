"""Derivatives of a run by parameters and initial states, against closed forms and differences."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.orbits.derivatives.run_sensitivities import path_through

pytestmark = pytest.mark.slow

x, v, y, k, F, w, D, t, mu, a, b = sp.symbols("x v y k F w D t mu a b")
FINE = fs.Integration(rtol=1e-13)


def run_of(model, state, **span):
    return fs.simulate(model, state, integration=FINE, **span)


def differences(model, state, name, step, measure, **span):
    """Central differences of fourth order."""

    def value(shift):
        if name in model.states:
            moved = [s + shift * (n == name) for s, n in zip(state, model.states, strict=True)]
            return measure(run_of(model, moved, **span))
        changed = model.with_parameters({name: model.parameters[name] + shift})
        return measure(run_of(changed, state, **span))

    near, far = value(step) - value(-step), value(2 * step) - value(-2 * step)
    return (8 * near - far) / (12 * step)


def test_a_sum_of_exponentials_in_closed_form():
    model = fs.Model({x: -k * x + a}, parameters={k: 0.7, a: 2})
    run = run_of(model, [1.5], t=(0, 3))
    found = run.sensitivity(["k", a, "x"])
    decay, T = np.exp(-0.7 * found.t), found.t
    by_k = -T * decay * (1.5 - 2 / 0.7) - (1 - decay) * 2 / 0.49
    np.testing.assert_allclose(found["x", "k"], by_k, atol=1e-13)
    np.testing.assert_allclose(found["x", "a"], (1 - decay) / 0.7, atol=1e-13)
    np.testing.assert_allclose(found["x", x], decay, atol=1e-13)
    np.testing.assert_array_equal(found.final[0], found.values[0, :, -1])
    assert np.isnan(found.period).all()
    assert found.outcome.code == "complete"
    assert [*found.to_dict()] == ["t", "dx/dk", "dx/da", "dx/dx"]


def test_the_time_through_a_gap_in_closed_form():
    # from rest at −D under a constant load: 2 D = F t²/2
    spring = sp.Piecewise((x + D, x < -D), (0, x < D), (x - D, True))
    model = fs.Model({x: v, v: F - k * spring}, parameters={F: 0.3, k: 50, D: 0.4})
    run = run_of(model, [-0.4, 0.0], t=(0, 3.5))
    (crossing,) = run.crossings("x - D", direction=1)
    found = run.sensitivity(["D", "F", "k"])
    row = [c.time for c in run.crossings].index(crossing.time)
    time = np.sqrt(4 * 0.4 / 0.3)
    assert crossing.time == pytest.approx(time, rel=1e-13)
    # the start stays at −0.4, where a larger gap has no contact: (D + 0.4) = F t²/2
    expected = [1 / (0.3 * time), -time / 0.6, 0.0]
    np.testing.assert_allclose(found.crossing_times[row], expected, atol=1e-12)


def test_the_amplitude_of_a_bilinear_oscillator_in_closed_form():
    model = fs.Model(
        {x: v, v: -sp.Piecewise((a * x, x < 0), (b * x, True))}, parameters={a: 1, b: 4}
    )
    run = run_of(model, [0.0, 3.0], t=(0, 4))
    found = run.sensitivity(["a", "b", "v"])
    # max v₀/√b, min −v₀/√a
    expected = [[3 / 2, 0, -1], [0, -3 / 2 / 4**1.5, 1 / 2]]
    np.testing.assert_allclose(found.extremes["x"], expected, atol=1e-12)


MODELS = {
    "gear": (fs.systems.harmonic_gear(omega=1.3, D=0.3), [0.1, 0.2], ["A", "D", "omega", "x"]),
    "stick-slip": (
        fs.Model(
            {x: v, v: -k * x - mu * sp.sign(v) + F * sp.cos(w * t)},
            parameters={k: 1, mu: 0.6, F: 1, w: 1.3},
        ),
        [0.3, 0.1],
        ["mu", "k", "w", "v"],
    ),
    "relay with a moving threshold": (
        fs.Model({x: y, y: -x - y / 5 - sp.sign(x - a * sp.cos(w * t))}, parameters={a: 0.4, w: 2}),
        [1.0, 0.2],
        ["a", "w", "y"],
    ),
    "impacts on a moving wall": (
        fs.Model(
            {x: v, v: -x - a * v + F * sp.cos(w * t)},
            parameters={a: 0.1, F: 1, w: 1.3, D: 0.4, k: 0.8},
            resets={
                x >= D * (1 + sp.sin(w * t) / 4): {v: -k * v + (1 + k) * D * w * sp.cos(w * t) / 4}
            },
        ),
        [0.0, 0.1],
        ["D", "k", "w", "v"],
    ),
    "kicks": (
        fs.Model(
            {x: v, v: -x - a * v},
            parameters={a: 0.1, b: 1.7, k: 0.3, F: 0.5},
            resets={sp.Eq(sp.Mod(t - F, b), 0): {v: v + k * (1 - x**2)}},
        ),
        [0.5, 0.1],
        ["b", "k", "F", "x"],
    ),
    "relay with hysteresis": (
        fs.Model(
            {x: v, v: -x - k * v + 1 - 2 * F + sp.cos(w * t) / 4},
            parameters={k: 0.4, a: 0.3, b: 0.2, w: 1.7},
            switches={F: (x > a, x < -b)},
        ),
        [0.5, 0.9],
        ["a", "b", "w", "v"],
    ),
    "measured load": (
        fs.Model(
            {x: v, v: -k * x - v / 10 + 2 * w - sp.sign(x - b)},
            forcing={w: fs.Tabulated([0, 1, 2.5, 4, 12], [0, 1, -1, 2, 0], interpolation="cubic")},
            parameters={k: 2, b: 0.2},
        ),
        [0.1, 0.0],
        ["k", "b", "x"],
    ),
    "sawtooth": (
        fs.Model({x: v, v: -x - a * v + k * sp.Mod(t, b)}, parameters={a: 0.1, b: 1.7, k: 0.3}),
        [0.5, 0.1],
        ["b", "k", "x"],
    ),
}


@pytest.mark.sample(4)
@pytest.mark.parametrize("span", [{"periods": 3}, {"t": (0, 11)}], ids=["periods", "time"])
@pytest.mark.parametrize("name", MODELS)
def test_everything_against_differences(name, span):
    model, state, names = MODELS[name]
    if model.period() is None and "periods" in span:
        span = {"t": (0, 5)}
    run = run_of(model, state, **span)
    found = run.sensitivity(names)
    n = len(run.states)

    def measure(r):
        times = r.crossing_table[:, 0], *([e.time for e in es] for es in (r.resets, r.switches))
        strobes = [] if r.period is None else r.stroboscopic().table[:n].ravel()
        parts = [r.end[1:], *times, strobes]
        return np.concatenate([*parts, *(r.extremes(s) for s in r.states)])

    for j, by in enumerate(found.parameters):
        times = found.crossing_times[:, j], found.reset_times[:, j], found.switch_times[:, j]
        parts = [found.final[:, j], *times, found.stroboscopic[:, j].ravel()]
        expected = np.concatenate([*parts, *(found.extremes[s][:, j] for s in run.states)])
        numeric = differences(model, state, by, 1e-4, measure, **span)
        np.testing.assert_allclose(expected, numeric, rtol=1e-7, atol=1e-7, err_msg=by)


def test_a_run_that_begins_with_sliding():
    model, _, names = MODELS["stick-slip"]
    run = run_of(model, [0.5, 0.0], t=(0, 4))
    assert run.itinerary[0] == "S1|S2"
    found = run.sensitivity(names)
    # a velocity at the start is lost at once
    assert not found["x", "v"].any()
    numeric = differences(model, [0.5, 0.0], "mu", 1e-4, lambda r: r.end[1:], t=(0, 4))
    np.testing.assert_allclose(found.final[:, 0], numeric, atol=1e-7)


def test_a_grazing_impact_has_no_derivative():
    # x = 1 − cos t touches the wall at π with zero velocity
    model = fs.Model({x: v, v: 1 - x}, resets={x >= 2: {v: -v / 2}})
    found = run_of(model, [0.0, 0.0], t=(0, 5)).sensitivity(["x", "v"])
    assert found.outcome.code == "no derivative"
    assert np.isnan(found.final).all()


def test_a_tangential_contact_has_no_derivative_and_says_so():
    model = fs.Model({x: 2 * (t - 1), y: sp.sign(x) - y})
    found = run_of(model, [1.0, 0.0], t=(0, 2)).sensitivity(["x"])
    assert found.outcome.code == "no derivative"
    assert "from t = 1 on" in str(found.outcome)
    assert "x is touched tangentially" in repr(found)
    assert np.isnan(found.values[:, :, found.t > 1]).all()
    assert np.isfinite(found.values[:, :, found.t < 1]).all()
    assert np.isnan(found.final).all()


def test_ten_states_with_rates_over_six_decades():
    rates, states, T = np.logspace(-3, 3, 10), sp.symbols("x0:10"), 20.0
    model = fs.Model(
        {s: -a * r * s + k * r**2 + b * s for s, r in zip(states, rates.tolist(), strict=True)},
        parameters={k: 0.7, a: 1, b: 0},
    )
    run = fs.simulate(model, [1] * 10, t=(0, T), integration=fs.Integration(rtol=1e-12))
    found = run.sensitivity(["k", "a", "b"])
    # implicit steps too
    assert set(run.steps[:, 3]) == {0, 2}
    decay, forced = np.exp(-rates * T), 0.7 * rates
    by_rate = -forced / rates * (1 - decay) + (forced - 1) * T * decay
    np.testing.assert_allclose(found.final[:, 0], rates * (1 - decay), rtol=1e-11)
    np.testing.assert_allclose(found.final[:, 1], rates * by_rate, rtol=1e-10)
    # a parameter that is zero
    np.testing.assert_allclose(found.final[:, 2], -by_rate, rtol=1e-10)


def test_a_contact_within_the_error_of_the_run_is_named():
    model = fs.Model({x: v, v: -x - sp.Piecewise((k, x > 1), (0, True))}, parameters={k: 5})
    found = fs.simulate(model, [1, 0], t=(0, 10)).sensitivity(["k", "x"])
    start, again = found.outcome.notes
    assert start.startswith("The run begins at x - 1: derivatives are those on the side")
    assert again.startswith("x - 1 is met within the error of the run at t = 6.28319")
    assert start in repr(found)
    clear = fs.simulate(model, [0.999, 0], t=(0, 10)).sensitivity(["k", "x"])
    assert clear.outcome.notes == ()
    # of any function
    wave = fs.Model(
        {x: v, v: -x - sp.Piecewise((k, sp.exp(x) > sp.E), (0, True))}, parameters={k: 5}
    )
    _, again = fs.simulate(wave, [1, 0], t=(0, 10)).sensitivity(["x"]).outcome.notes
    assert again.startswith("exp(x) - E is met within the error of the run at t = 6.28319")
    ball = fs.Model({x: v, v: -1}, resets={x <= 0: {v: -k * v}}, parameters={k: 0.8})
    (note,) = fs.simulate(ball, [0, 1], t=(0, 5)).sensitivity(["k", "v"]).outcome.notes
    assert note.startswith("The run begins at x = 0")


def test_names_that_are_no_parameters():
    gear = fs.systems.harmonic_gear(omega=0.1, C=2.5)
    run = fs.simulate(gear, [0, 0], t=(0, 1))
    message = r"w is a slow quantity, given by its law B \+ C\*sin.*; expected .*: B, C, omega"
    with pytest.raises(fs.ArgumentError, match=message):
        run.sensitivity(["w"])
    with pytest.raises(fs.ArgumentError, match=message):
        fs.find_orbit(gear, [0.3, 0]).gradient("w")
    ramp = fs.Model({x: a - x}, parameters={a: 0}).with_ramp("a", 0.1)
    with pytest.raises(fs.ArgumentError, match=r"a is a slow quantity, .*: a_rate, a_start"):
        fs.simulate(ramp, [0], t=(0, 1)).sensitivity(["a"])
    with pytest.raises(fs.UnknownNameError, match=r"parameter or state 'k' \(known: x\)"):
        fs.simulate(fs.Model({x: -x}), [1], t=(0, 1)).sensitivity(["k"])


def test_a_run_without_dense_output():
    run = fs.simulate(fs.systems.harmonic_gear(), [0, 0], t=(0, 1), dense=False)
    with pytest.raises(fs.errors.ArgumentError, match="dense=True"):
        run.sensitivity(["A"])


def test_saved_and_loaded(tmp_path):
    run = fs.simulate(fs.systems.harmonic_gear(), [0, 0], t=(0, 1))
    found = run.sensitivity(["A"])
    found.save(tmp_path / "s.npz")
    assert fs.load(tmp_path / "s.npz") == found
    run.save(tmp_path / "run.npz")
    with pytest.raises(fs.errors.ModelError, match="equations of its model"):
        fs.load(tmp_path / "run.npz").sensitivity(["A"])


def test_a_run_backwards_is_refused():
    run = fs.simulate(fs.Model({x: -k * x}, parameters={k: 1}), [1], t=(0, -2))
    with pytest.raises(fs.errors.ArgumentError, match="backwards in time"):
        run.sensitivity(["k"])


def test_derivatives_at_given_times_are_those_of_the_closed_form():
    model = fs.Model({x: -k * x + a}, parameters={k: 0.7, a: 2})
    times = np.array([0.0, 0.4, 1.1, 3.0])
    found = path_through(run_of(model, [1.5], t=(0, 3)), ["k", "x"], times[1:])
    decay, far = np.exp(-0.7 * times), 2 / 0.7
    np.testing.assert_array_equal(found.times, times)
    np.testing.assert_allclose(found.states[:, 0], far + (1.5 - far) * decay, rtol=1e-12)
    by_k = -times * decay * (1.5 - far) - (1 - decay) * 2 / 0.49
    np.testing.assert_allclose(found.values[:, 0], np.column_stack([by_k, decay]), atol=1e-12)
    np.testing.assert_allclose(found.rates[:, 0], -0.7 * (1.5 - far) * decay, rtol=1e-11)
