"""Passages by compiled steps, against closed forms and SciPy."""

from types import SimpleNamespace

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

import fastslow as fs
from fastslow.diagrams.field import FrozenField
from fastslow.passage.delays import local_passages
from fastslow.passage.delays.drift_laws import drift_law
from fastslow.passage.delays.laws.fold_delays import airy_passage
from fastslow.passage.delays.local_field import TURN, LocalField
from fastslow.passage.delays.local_passages import EndOfPassage, PassagePlace, follow, reached_delay

x, y, p = sp.symbols("x y p")

EPS = 1e-3


def local(model, state):
    """The field of a model about a place, with p = 0 there."""
    field = FrozenField(model, "p")
    point = SimpleNamespace(source=SimpleNamespace(unit=np.ones(len(state))))
    return LocalField(point, field, np.array([*state, 0.0]))


def passed(rates, law, stop, start, direction=1.0):
    """w and t where a passage ends, by SciPy; `law` and `stop` take (t, z)."""

    def end(t, z):
        return stop(t, z)

    end.terminal, end.direction = True, direction
    run = solve_ivp(
        lambda t, z: [*rates(z), law(t, z)], (0, 1e4), start, "DOP853", events=end,
        rtol=1e-13, atol=1e-15,
    )  # fmt: skip
    return run.y[-1, -1], run.t[-1]


@pytest.mark.parametrize("stiffness", [None, 1e4, 1e9])
def test_a_fold_is_passed_by_the_airy_function(stiffness):
    """x' = p + x², p = εt, from the quasi-static state; one more state may be as stiff as it is."""
    rates = {x: p + x**2}
    if stiffness is not None:
        rates[y] = stiffness * (x - y)
    model = fs.Model(rates, parameters={p: 0})
    before = -9.65 * EPS ** (2 / 3)
    # −A'/A ends where it is looked for on a branch that is followed from as far before the fold
    start = -np.sqrt(-before) + 0.25 * EPS / before
    state = [start] if stiffness is None else [start, start]
    here = local(model, [0.0] * len(state))
    place = PassagePlace(0, np.array([*state, before]), 0.0)
    delay, time = reached_delay(here, fs.Drift(EPS), place, EndOfPassage((0, 10.0)), 1e5)
    exact = EPS ** (2 / 3) * airy_passage(10.0 / EPS ** (1 / 3))
    assert delay == pytest.approx(exact, rel=1e-10)
    assert time == pytest.approx(delay / EPS, rel=1e-12)


@pytest.mark.parametrize(
    ("text", "law"),
    [
        ("0.001*cos(0.03*t + 0.5)", lambda t, z: 1e-3 * np.cos(0.03 * t + 0.5)),
        ("0.001 + 2.0e-6*t*exp(-0.01*t)", lambda t, z: 1e-3 + 2e-6 * t * np.exp(-0.01 * t)),
        ("0.001*(1 + 0.3*x**2 - 0.5*p)", lambda t, z: 1e-3 * (1 + 0.3 * z[0] ** 2 - 0.5 * z[1])),
        (
            "0.001*(1 + 0.2*x**2)*cos(0.02*t)",
            lambda t, z: 1e-3 * (1 + 0.2 * z[0] ** 2) * np.cos(0.02 * t),
        ),
    ],
)
def test_a_law_in_time_or_in_the_states_is_followed(text, law):
    here = local(fs.Model({x: p + x**2}, parameters={p: 0}), [0.0])
    place = PassagePlace(0, np.array([-1e-2, 0.0]), 0.0)
    found, _ = follow(here, fs.Drift(EPS, law=text), place, EndOfPassage((0, 3.0)), span=1e4)
    slow, time = passed(
        lambda z: [z[1] + z[0] ** 2], law, lambda t, z: z[0] - 3.0, [-1e-2, 0.0]
    )  # fmt: skip
    assert (found.z[-1], found.time) == pytest.approx((slow, time), rel=1e-9)


def test_a_turn_of_the_slow_quantity_ends_a_passage():
    here = local(fs.Model({x: p + x**2}, parameters={p: 0}), [0.0])
    drift = fs.Drift(EPS, by_state={"x": -EPS})
    place = PassagePlace(0, np.array([-1e-2, 0.0]), 0.0)
    found, reason = follow(here, drift, place, EndOfPassage(TURN), span=1e4)
    # x passes 1, where the rate ε (1 − x) vanishes
    assert (reason, found.z[0]) == ("", pytest.approx(1.0, rel=1e-12))


def test_interfaces_are_met_in_their_order_and_to_rounding():
    """x = sin t is beyond 0.995 for 0.2 of its time, and meets 1/2 before."""
    near, far = sp.Rational(1, 2), sp.Rational(995, 1000)
    terms = [sp.Piecewise((x - h, x > h), (0, True)) for h in (near, far)]
    model = fs.Model({x: y, y: -x + p * sum(terms)}, parameters={p: 0})
    here = local(model, [0.0, 0.0])
    heights = here.field.evaluate(0, np.zeros(3))[2]
    region = next(k for k, s in enumerate(here.field.signs) if (s * heights > 0).all())
    place = PassagePlace(region, np.array([0.0, 1.0, 0.0]), 0.0)
    for number in range(2):
        found, reason = follow(
            here, fs.Drift(1e-9), place, EndOfPassage(interface=number), span=10.0
        )
        assert not reason
        # its function may have any scale
        level = min((0.5, 0.995), key=lambda h: abs(h - found.z[0]))
        assert found.time == pytest.approx(np.arcsin(level), rel=1e-8)
        assert found.z[0] == pytest.approx(level, rel=1e-15)


def test_what_does_not_end_says_why():
    here = local(fs.Model({x: -x + p}, parameters={p: 0}), [0.0])
    place = PassagePlace(0, np.array([0.0, 0.0]), 0.0)
    _, reason = follow(here, fs.Drift(EPS), place, EndOfPassage((0, 10.0)), span=100.0)
    assert reason == local_passages.TOO_LONG
    # x' = 1 + x² is infinite before t = 2
    here = local(fs.Model({x: 1 + x**2 + p}, parameters={p: 0}), [0.0])
    _, reason = follow(here, fs.Drift(EPS), place, EndOfPassage((0, np.inf)), span=100.0)
    assert reason == local_passages.FAILED


def test_a_table_follows_a_law_with_a_kink():
    law = drift_law("Piecewise((1.0, t < 3), (cos(t - 3), True))", ("x", "p"))
    breaks, sums = law.table(0.0, 20.0)
    times = np.linspace(0.0, 20.0, 333)
    rows = np.clip(np.searchsorted(breaks, times, side="right") - 1, 0, len(sums) - 1)
    places = 2.0 * (times - breaks[rows]) / (breaks[rows + 1] - breaks[rows]) - 1.0
    found = [np.polynomial.chebyshev.chebval(s, sums[k]) for s, k in zip(places, rows, strict=True)]
    exact = np.where(times < 3, 1.0, np.cos(times - 3))
    assert np.abs(found - exact).max() < 1e-13
    assert len(sums) < 200


def test_a_level_is_reached_to_rounding_wherever_it_is():
    """x' = x: the level c is reached at t = ln(c/c₀)."""
    here = local(fs.Model({x: x + p}, parameters={p: 0}), [0.0])
    place = PassagePlace(0, np.array([0.01, 0.0]), 0.0)
    levels = np.linspace(0.05, 2.0, 40)
    found = [
        follow(here, fs.Drift(1e-12), place, EndOfPassage((0, c)), span=1e3)[0] for c in levels
    ]
    assert [q.z[0] for q in found] == pytest.approx(levels, rel=2e-15)
    assert [q.time for q in found] == pytest.approx(np.log(levels / 0.01), rel=1e-9)
