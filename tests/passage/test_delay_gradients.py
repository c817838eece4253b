"""Derivatives of predicted delays and of measured transitions: closed forms and differences."""

import numpy as np
import pytest
import sympy as sp
from scipy.optimize import brentq

import fastslow as fs
from fastslow.passage.delays.laws.fold_delays import OMEGA_0

pytestmark = pytest.mark.slow

x, y, v, z, p, q, w, t = sp.symbols("x y v z p q w t")
a, b, c, eps = sp.symbols("a b c eps")
FINE = fs.Integration(rtol=1e-13, atol=1e-30)


def differences(value, at, step):
    """Central differences of fourth order."""
    near, far = value(at + step) - value(at - step), value(at + 2 * step) - value(at - 2 * step)
    return (8 * near - far) / (12 * step)


def first(model, name, code, over=(-2, 2)):
    diagram = fs.continue_equilibria(model, name, over=over)
    return diagram, next(iter(diagram.special(code)))


def test_the_leading_term_of_a_fold_in_closed_form():
    model = fs.Model({x: b * p + q + a * x**2}, parameters={p: -1, a: 2, b: 3, q: 0.5})
    _, fold = first(model, "p", "LP")
    law = fs.predict_delay(fold, 1e-3)
    # Ω₀ (rate²/(a b))^(1/3) past p = −q/b
    delay = OMEGA_0 * 6 ** (-1 / 3) * 1e-2
    expected = {
        "a": (-delay / 6, -delay / 6),
        "b": (-delay / 9, 0.5 / 9 - delay / 9),
        "q": (0.0, -1 / 3),
        "rate": (2 / 3 * delay / 1e-3, 2 / 3 * delay / 1e-3),
    }
    for name, known in expected.items():
        found = law.gradient(name)
        np.testing.assert_allclose([found["delay"], found["value"]], known, rtol=1e-10, atol=1e-13)
    assert law.gradient("a")["delay_time"] == pytest.approx(-delay / 6e-3, rel=1e-10)
    # another parameter drifts: past q = −b p, at the fold's p = −1/6
    other = fs.predict_delay(fold, 1e-3, parameter="q")
    delay = OMEGA_0 * 2 ** (-1 / 3) * 1e-2
    for name, known in {"a": (-delay / 6, -delay / 6), "b": (0, 1 / 6), "p": (0, -3)}.items():
        found = other.gradient(name)
        np.testing.assert_allclose([found["delay"], found["value"]], known, rtol=1e-10, atol=1e-12)
    with pytest.raises(fs.ArgumentError, match="q is the parameter that drifts"):
        other.gradient("q")


@pytest.mark.sample(1)
@pytest.mark.parametrize("scale", [1.0, 1e-6, 1e6])
def test_a_corner_in_closed_form(scale):
    model = fs.Model({x: (p + a * sp.Abs(x) - q)}, parameters={p: -scale, a: 1, q: 0})
    _, corner = first(model, "p", "BE", (-2 * scale, 2 * scale))

    def delay(a, rate):
        rate = rate / a
        return brentq(
            lambda d: d - rate * (1 + np.log((a * scale + d + rate) / (2 * rate))), 0, scale,
            xtol=1e-300, rtol=1e-15,
        )  # fmt: skip

    law = fs.predict_delay(corner, 0.01 * scale, level={"x": scale})
    assert law.delay == pytest.approx(delay(1, 0.01 * scale), rel=1e-11)
    by_a = differences(lambda a: delay(a, 0.01 * scale), 1, 1e-3)
    assert law.gradient("a")["delay"] == pytest.approx(by_a, rel=1e-9)
    by_rate = differences(lambda r: delay(1, r), 0.01 * scale, 1e-5 * scale)
    assert law.gradient("rate")["delay"] == pytest.approx(by_rate, rel=1e-9)
    # a parameter that is zero moves the corner alone
    found = law.gradient("q")
    np.testing.assert_allclose([found["delay"], found["value"]], [0, 1], atol=1e-9)


def test_hopf_and_branch_points_in_closed_form():
    growing = {x: (p - a) * x - b * y - x * (x**2 + y**2), y: b * x + (p - a) * y - y**3}
    model = fs.Model(growing, parameters={p: 0, a: 0.3, b: 1})
    diagram, hopf = first(model, "p", "HB")
    law = fs.predict_delay(hopf, 0.1, diagram=diagram, entry=-0.9, gain=3.0)
    # exit = a + √((entry − a)² + 2 rate ln gain)
    root = np.sqrt(1.2**2 + 0.2 * np.log(3))
    assert law.value == pytest.approx(0.3 + root, rel=1e-12)
    known = {"a": 1 + 1.2 / root, "b": 0, "rate": np.log(3) / root, "entry": -1.2 / root}
    for name, by in known.items():
        assert law.gradient(name)["value"] == pytest.approx(by, abs=1e-10), name
    assert law.gradient("a")["delay"] == pytest.approx(1.2 / root, rel=1e-10)
    logistic = fs.Model({x: (p - a) * x - x**2}, parameters={p: -1, a: 0.2})
    diagram, point = first(logistic, "p", "BP")
    law = fs.predict_delay(point, 0.1, diagram=diagram, entry=-0.8)
    assert law.gradient("a")["value"] == pytest.approx(2, rel=1e-10)
    assert law.gradient("entry")["delay"] == pytest.approx(-1, rel=1e-10)
    with pytest.raises(fs.UnknownNameError, match=r"unknown parameter 'k' \(known: a, rate"):
        law.gradient("k")
    with pytest.raises(fs.ArgumentError, match="p is the parameter of the diagram, which drifts"):
        law.gradient("p")


#: Equations, parameters, entry, range and rate; branches that move, and that change regions.
EXITS = {
    "FitzHugh-Nagumo": (
        {x: x - x**3 / 3 - y + p, y: b * (x + a - c * y)},
        {p: 0, a: 0.7, b: 0.08, c: 0.8},
        (0.2, (-0.5, 1.5), 0.002),
    ),
    "jump": (
        {
            x: sp.Piecewise((z - a, z < b), (z - a + c, True)) * x - y,
            y: x + sp.Piecewise((z - a, z < b), (z - a + c, True)) * y,
            z: p - z,
        },
        {p: 0, a: 0, b: -0.3, c: -0.4},
        (-1, (-2, 2), 0.05),
    ),
}


@pytest.mark.sample(1)
@pytest.mark.parametrize("name", EXITS)
def test_exits_against_differences(name):
    rates, values, (entry, over, rate) = EXITS[name]
    model = fs.Model(rates, parameters=values)

    def law(**changes):
        diagram, hopf = first(model.with_parameters(changes), "p", "HB", over)
        return fs.predict_delay(hopf, rate, diagram=diagram, entry=entry)

    # along one direction of all three parameters
    way = dict(zip("abc", (1.0, -0.5, 2.0), strict=True))

    def moved(step):
        return law(**{n: model.parameters[n] + step * by for n, by in way.items()}).value

    at, numeric = law(), differences(moved, 0.0, 5e-4)
    found = sum(by * at.gradient(n)["value"] for n, by in way.items())
    assert found == pytest.approx(numeric, rel=1e-7)


RAMP = fs.Model(
    {x: w + q * x - x**3}, forcing={w: a + eps * t}, parameters={q: 1, eps: 0.01, a: -1}
)


@pytest.fixture(scope="module")
def jump():
    diagram = fs.continue_equilibria(RAMP.frozen(), "w", over=(-1.2, 1.2))
    return fs.overlay(diagram, fs.simulate(RAMP, [-1.3], t=(0, 160), integration=FINE))


def test_a_measured_jump_against_differences(jump):
    level = float(jump.transitions[0].state[0])

    def measured(**changes):
        model = RAMP.with_parameters(changes)
        run = fs.simulate(model, [-1.3], t=(0, 160), integration=FINE)
        time, known = run.section("x", level=level, direction=1).t[0], model.parameters
        value = known["a"] + known["eps"] * time
        # the fold is at 2 (q/3)^(3/2)
        return np.array([time, value, value - 2 * (known["q"] / 3) ** 1.5])

    for name, step in (("q", 1e-3), ("eps", 1e-5), ("a", 1e-3)):
        numeric = differences(lambda k, n=name: measured(**{n: k}), RAMP.parameters[name], step)
        found = jump.gradient(0, name)
        assert [*found] == ["time", "value", "delay"]
        np.testing.assert_allclose([*found.values()], numeric, rtol=1e-7, atol=1e-9)
    # the initial state is forgotten
    assert abs(jump.gradient(jump.transitions[0], "x")["delay"]) < 1e-100


def test_a_prediction_approximates_the_measured_derivative(jump):
    found = jump.transitions[0].law.gradient("rate")["delay"]
    assert found == pytest.approx(jump.gradient(0, "eps")["delay"], rel=0.05)


def test_a_gap_crossing_measured_and_predicted():
    # the law is exact for linear contacts under a ramp
    contact = sp.Piecewise((x - a, x > a), (x + a, x < -a), (0, True))
    model = fs.Model(
        {x: v, v: w - v - b * contact}, forcing={w: 1 - eps * t}, parameters={a: 1, b: 9, eps: 0.01}
    )
    run = fs.simulate(model, [1 + 1 / 9, 0], t=(0, 150), integration=FINE)
    found = fs.overlay(fs.continue_equilibria(model.frozen(), "w", over=(-1, 1.5)), run)
    (crossing,) = found.transitions
    for name in ("a", "b"):
        measured, predicted = found.gradient(0, name), crossing.law.gradient(name)
        for quantity in ("duration", "width"):
            assert measured[quantity] == pytest.approx(predicted[quantity], rel=1e-8, abs=1e-10)
    measured, predicted = found.gradient(0, "eps"), crossing.law.gradient("rate")
    assert measured["duration"] == pytest.approx(-predicted["duration"], rel=1e-8)
    assert measured["width"] == pytest.approx(-predicted["width"], rel=1e-8)


def test_a_turning_slow_state_against_differences():
    model = fs.Model(
        {x: z - x**3 / 3 + q * x}, slow={z: -eps * (x - a)}, parameters={q: 1, eps: 0.05, a: 0.1}
    )

    def run_of(**changes):
        return fs.simulate(model.with_parameters(changes), [-1.8, 0.2], t=(0, 20), integration=FINE)

    found = fs.overlay(fs.continue_equilibria(model.frozen(), "z", over=(-2, 2)), run_of())
    turn = found.transitions[0]
    assert turn.turned

    def measured(**changes):
        run, known = run_of(**changes), model.with_parameters(changes).parameters
        # z turns where x = a
        time = run.section("x", level=known["a"], direction=1).t[0]
        value = run(time)[1]
        return np.array([time, value, value - 2 / 3 * known["q"] ** 1.5])

    for name in ("q", "eps", "a"):
        at = model.parameters[name]
        numeric = differences(lambda k, n=name: measured(**{n: k}), at, 1e-3 * at)
        np.testing.assert_allclose([*found.gradient(0, name).values()], numeric, rtol=1e-7)


def test_a_departure_past_a_hopf_point_against_differences():
    # about the equilibrium x = a w, y = 0
    u = x - a * w
    rates = {x: (w - a) * u - y - u * (u**2 + y**2), y: u + (w - a) * y - y * (u**2 + y**2)}
    model = fs.Model(rates, forcing={w: b + eps * t}, parameters={a: 0.1, b: -0.6, eps: 0.05})

    def run_of(**changes):
        return fs.simulate(model.with_parameters(changes), [-0.01, 0], t=(0, 40), integration=FINE)

    found = fs.overlay(fs.continue_equilibria(model.frozen(), "w", over=(-2, 2)), run_of())
    (exit_,) = found.transitions
    one, other = found.extent.tolist()
    size = float(np.sum(((exit_.state - [0.1 * exit_.value, 0]) / found.extent) ** 2))

    def measured(**changes):
        run, known = run_of(**changes), model.with_parameters(changes).parameters
        away = f"((x - a*w)/{one})**2 + (y/{other})**2"
        times = run.section(away, level=size, direction=1).t
        time = times[np.argmin(np.abs(times - exit_.time))]
        value = known["b"] + known["eps"] * time
        return np.array([time, value, value - known["a"]])

    for name, step in (("a", 1e-5), ("b", 1e-5), ("eps", 1e-6)):
        numeric = differences(lambda k, n=name: measured(**{n: k}), model.parameters[name], step)
        np.testing.assert_allclose([*found.gradient(0, name).values()], numeric, rtol=1e-7)
    with pytest.raises(fs.ArgumentError, match="predicted along a run"):
        exit_.law.gradient("a")


def test_where_delays_have_no_derivative(jump, tmp_path):
    growing = {x: (p - a) * x - y - x**3, y: x + (p - a) * y}
    model = fs.Model(growing, parameters={p: 0, a: 0})
    diagram, hopf = first(model, "p", "HB")
    forgotten = fs.predict_delay(hopf, 0.001, diagram=diagram, entry=-1.0)
    with pytest.raises(fs.ArgumentError, match="below rounding or the tolerance of the run"):
        forgotten.gradient("a")
    ends = fs.predict_delay(hopf, 0.1, diagram=diagram, entry=-1.9, gain=1e30)
    with pytest.raises(fs.ArgumentError, match="no predicted delay, and no derivative: none: the"):
        ends.gradient("a")
    # z' = (p + i) z + a p: the buffer point is p = 1 (Neishtadt 1988)
    moving = fs.Model({x: p * x - y + a * p, y: x + p * y}, parameters={p: 0, a: 1})
    diagram, hopf = first(moving, "p", "HB", (-3, 3))
    buffered = fs.predict_delay(hopf, 0.05, diagram=diagram, entry=-2.0)
    assert buffered.value == pytest.approx(1)
    with pytest.raises(fs.ArgumentError, match="at the buffer point, which does not depend on"):
        buffered.gradient("a")
    law = jump.transitions[0].law
    with pytest.raises(fs.UnknownNameError, match=r"unknown parameter 'k' \(known: q, rate\)"):
        law.gradient("k")
    with pytest.raises(fs.ArgumentError, match="w is the parameter of the diagram"):
        law.gradient("w")
    drifting = fs.predict_delay(law.point, fs.Drift(0.01, change=1e-4), level={"x": 1})
    with pytest.raises(
        fs.ArgumentError, match="this drift is not constant, and has no single rate"
    ):
        drifting.gradient("rate")
    assert np.isfinite(drifting.gradient("q")["delay"])
    law.save(tmp_path / "law.npz")
    with pytest.raises(fs.ArgumentError, match="the point of this delay has no model"):
        fs.load(tmp_path / "law.npz").gradient("q")


def test_where_transitions_have_no_derivative(jump, tmp_path):
    with pytest.raises(fs.ArgumentError, match="w is a slow quantity, given by its law a"):
        jump.gradient(0, "w")
    with pytest.raises(fs.UnknownNameError, match="unknown parameter or state 'k'"):
        jump.gradient(0, "k")
    with pytest.raises(fs.OutOfRangeError, match="no transition 3; the last of 1 is 0"):
        jump.gradient(3, "q")
    with pytest.raises(fs.ArgumentError, match="the transition is not one of this overlay"):
        jump.gradient(fs.overlay(jump.diagram, jump.run).transitions[0], "q")
    sampled = fs.simulate(RAMP, [-1.3], t=(0, 160), samples=2000, dense=False)
    with pytest.raises(fs.ArgumentError, match="sensitivities need dense output"):
        fs.overlay(jump.diagram, sampled).gradient(0, "q")
    jump.save(tmp_path / "jump.npz")
    with pytest.raises(fs.ModelError, match="has no model"):
        fs.load(tmp_path / "jump.npz").gradient(0, "q")


def test_a_transition_after_a_tangential_contact_has_no_derivative():
    # y = t exp(−t) touches 1/e, where the rate of z jumps
    top = sp.Float(float(np.exp(-1.0)), 17)
    touching = {x: w - x**3 + x, y: v - y, v: -v, z: sp.sign(y - top) - z}
    model = fs.Model(touching, forcing={w: -1 + eps * t}, parameters={eps: 0.05})
    run = fs.simulate(model, [-1.3, 0.0, 1.0, -1.0], t=(0, 45), integration=FINE)
    found = fs.overlay(fs.continue_equilibria(model.frozen(), "w", over=(-1, 1)), run)
    with pytest.raises(fs.ArgumentError, match=r"no derivative from t = 1.* touched tangentially"):
        found.gradient(0, "eps")
