"""Lyapunov exponents with resets, kicks, clocks and tables, against closed forms."""

import numpy as np
import pytest
import sympy as sp
from scipy.linalg import expm

import fastslow as fs

x, v, t, w = sp.symbols("x v t w")
c, r, s, om = sp.symbols("c r s omega")
FINE = fs.Integration(rtol=1e-12)


@pytest.fixture(scope="module")
def impacting():
    return fs.Model(
        {x: v, v: sp.cos(om * t) - c * v - x},
        parameters={c: 0.1, r: 0.8, s: 0.2, om: 2.6},
        resets={x >= s: {v: -r * v}},
    )


@pytest.mark.parametrize(("omega", "sigma", "chaotic"), [(2.6, 0.2, True), (1.9, -0.3, False)])
def test_each_impact_contracts_by_the_square_of_restitution(impacting, omega, sigma, chaotic):
    """The sum is −c + 2 k ln(r) / T with k impacts within T."""
    model = impacting.with_parameters(omega=omega, s=sigma)
    found = fs.lyapunov(model, [-1, 0], periods=150)
    assert found.chaotic is chaotic
    length = found.span[1] - found.span[0]
    number = (found.values.sum() + 0.1) * length / (2 * np.log(0.8))
    assert number == pytest.approx(round(number), abs=1e-8)
    assert found.values.sum() == pytest.approx(found.divergence, abs=1e-10)
    if not chaotic:
        run = fs.simulate(model, [-1, 0], t=(0, found.span[1]))
        inside = [e for e in run.resets if e.time > found.span[0]]
        assert len(inside) == round(number) > 50
        orbit = fs.find_orbit(model, run.end[1:].tolist())
        expected = np.sort(np.log(np.abs(orbit.multipliers)) / orbit.period)[::-1]
        # a complex pair turns the vectors
        assert found.values == pytest.approx(expected, abs=2e-3)


def test_pieces_of_a_run_join(impacting, monkeypatch):
    """Runs are cut in the middle of a step, so that no reset is lost."""
    model = impacting.with_parameters(omega=1.9, s=-0.3)
    whole = fs.lyapunov(model, [-1, 0], periods=60)
    monkeypatch.setattr("fastslow.orbits.derivatives.exponents.PIECE", 37)
    parts = fs.lyapunov(model, [-1, 0], periods=60)
    # which units the states have depends on the first piece
    assert parts.values.sum() == pytest.approx(whole.values.sum(), abs=1e-10)
    assert parts.values == pytest.approx(whole.values, abs=1e-3)


def test_a_driven_integrate_and_fire_neuron():
    """v' = I(t) − γ v between spikes; each spike multiplies by I / (I − γ)."""
    drive = 1.3 + 0.2 * sp.cos(2 * t)
    model = fs.Model({v: drive - 0.9 * v}, resets={v >= 1: {v: 0}})
    found = fs.lyapunov(model, [0.1], periods=80, integration=FINE)
    run = fs.simulate(model, [0.1], t=(0, found.span[1]), integration=FINE)
    spikes = np.array([e.time for e in run.resets if e.time > found.span[0]])
    assert len(spikes) > 50
    strength = 1.3 + 0.2 * np.cos(2 * spikes)
    total = np.log(strength / (strength - 0.9)).sum()
    expected = -0.9 + total / (found.span[1] - found.span[0])
    assert found.values == pytest.approx([expected], abs=1e-8)
    # without forcing the phase is neutral
    alone = fs.Model({v: 1.3 - v}, resets={v >= 1: {v: 0}})
    period = np.log(1.3 / 0.3)
    neutral = fs.lyapunov(alone, [0.1], t=(0, 40 * period), period=period, integration=FINE)
    assert neutral.values == pytest.approx([0], abs=1e-10)


def test_a_linear_oscillator_with_kicks():
    """Per kick the exponents are those of exp(A) K, of real eigenvalues."""
    model = fs.Model(
        {x: v, v: -x - v}, resets={sp.Eq(sp.Mod(t, 1), 0): {v: v + sp.Rational(1, 2) - 4 * x}}
    )
    found = fs.lyapunov(model, [0.3, 0.0], t=(0, 200), settle=100)
    matrix = expm(np.array([[0.0, 1.0], [-1.0, -1.0]])) @ np.array([[1.0, 0.0], [-4.0, 1.0]])
    eigenvalues = np.linalg.eigvals(matrix)
    assert np.isreal(eigenvalues).all()
    expected = np.sort(np.log(np.abs(eigenvalues)))[::-1]
    assert found.values == pytest.approx(expected, abs=1e-9)
    assert found.divergence == pytest.approx(-1, abs=1e-12)


def test_clocks_and_tables():
    """A relay that a sawtooth switches, under a table of steps: det S = 1 at instants."""
    load = fs.Tabulated(np.arange(0.0, 202.0), np.sin(np.arange(202.0)), interpolation="previous")
    switched = sp.Piecewise((1, sp.Mod(t, 2) > 1 + x / 2), (0, True))
    model = fs.Model({x: -0.7 * x + switched + w / 10}, forcing={w: load})
    found = fs.lyapunov(model, [0.1], t=(0, 200), integration=FINE)
    run = fs.simulate(model, [0.1], t=(0, 200), integration=FINE)
    low, high = found.span
    turned = [e for e in run.crossings if low < e.time <= high and e.direction < 0]
    logs = []
    assert {e.time % 2 for e in run.crossings if e.direction > 0} == {0}
    for e in turned:
        rate = -0.7 * e.state[0] + np.sin(np.floor(e.time)) / 10
        # the sawtooth rises through 1 + x/2
        logs.append(np.log(abs((1 - (rate + 1) / 2) / (1 - rate / 2))))
    assert len(turned) > 50
    expected = -0.7 + sum(logs) / (found.span[1] - found.span[0])
    assert found.values == pytest.approx([expected], abs=1e-8)


def test_there_is_no_derivative_where_a_wall_is_touched():
    model = fs.Model({x: v, v: -1}, resets={x >= 0: {v: -v / 2}})
    found = fs.lyapunov(model, [-0.5, 1.0], t=(0, 3), settle=0.2)
    assert found.outcome.code == "stopped early"
    assert "at t = 1 the wall x = 0 is touched at zero speed" in str(found.outcome)
    assert np.isnan(found.values).all()


def test_rest_on_a_wall_loses_two_directions():
    table = sp.sin(2 * t) / 2
    speed = table.diff(t)
    model = fs.Model({x: v, v: -1}, resets={x <= table: {v: speed - (v - speed) / 2}})
    found = fs.lyapunov(model, [0.6, 0.0], periods=40)
    assert np.isneginf(found.values).all()
    assert np.isneginf(found.divergence)


def test_switches():
    """A thermostat: each change multiplies by the ratio of the rates; the free phase is neutral."""
    q = sp.Symbol("q")
    heater = {q: (x > 1.5, x < 0.5)}
    driven = fs.Model({x: -x + 2 * (1 - q) + sp.cos(3 * t) / 10}, switches=heater)
    found = fs.lyapunov(driven, [1.6], periods=100, integration=FINE)
    run = fs.simulate(driven, [1.6], t=(0, found.span[1]), integration=FINE)
    logs = []
    for change in run.switches:
        if change.time > found.span[0]:
            rate = -run(change.time)[0] + np.cos(3 * change.time) / 10
            logs.append(np.log(abs((rate + 2 * (1 - change.value)) / (rate + 2 * change.value))))
    assert len(logs) > 50
    expected = -1 + sum(logs) / (found.span[1] - found.span[0])
    assert found.values == pytest.approx([expected], abs=1e-8)
    alone, period = fs.Model({x: -x + 2 * (1 - q)}, switches=heater), 2 * np.log(3)
    neutral = fs.lyapunov(alone, {"x": 1, "q": 0}, t=(0, 40 * period), period=period)
    assert neutral.values == pytest.approx([0], abs=1e-8)


def test_a_kicked_rotor():
    """Between kicks x and v are known: the largest exponent is that of the map of one period."""
    damping, strength = 0.1, 8.0
    rotor = fs.Model(
        {x: v, v: -damping * v},
        periodic={x: 2 * sp.pi},
        resets={sp.Eq(sp.Mod(t, 1), 0): {v: v + strength * sp.sin(x)}},
    )
    found = fs.lyapunov(rotor, [0.3, 0.0], t=(0, 300), period=1)
    assert found.chaotic
    assert found.values.sum() == pytest.approx(-damping, abs=1e-12)
    decay = np.exp(-damping)
    flight = np.array([[1.0, (1 - decay) / damping], [0.0, decay]])
    place, vector, logs = np.array([0.3, 0.0]), np.array([1.0, 1.0]), []
    for _ in range(8_000):
        kick = np.array([[1.0, 0.0], [strength * np.cos(place[0]), 1.0]])
        place[1] += strength * np.sin(place[0])
        place, vector = flight @ place, flight @ kick @ vector
        logs.append(np.log(np.linalg.norm(vector)))
        vector /= np.linalg.norm(vector)
    assert found.largest == pytest.approx(np.mean(logs[100:]), abs=4 * found.uncertainties[0])
