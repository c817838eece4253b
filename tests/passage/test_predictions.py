"""The law of delay beside the transitions of an overlay."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.passage.delays.drifts import drift_at
from fastslow.passage.overlay import predictions
from tests.passage import slow_models

pytestmark = pytest.mark.slow

x, y, p, t = sp.symbols("x y p t")


def laid(model, name, over, start, **span):
    diagram = fs.continue_equilibria(model.frozen(), name, over=over)
    return fs.overlay(
        diagram, fs.simulate(model, start, integration=fs.Integration(rtol=1e-11), **span)
    )


@pytest.fixture(scope="module")
def gear():
    return fs.systems.harmonic_gear(A=41.67, B=2.372, C=3.546, D=0.25, omega=0.002)


def test_the_gap_is_crossed_as_its_law_says(gear):
    """To 1e-4: the law has the load's rate and its change over the gap."""
    overlay = laid(gear, "w", (-2, 6), [0, 0], periods=1)
    transits = [t_ for t_ in overlay.transitions if t_.type == "gap crossing"]
    assert len(transits) == 2
    for t_ in transits:
        assert t_.predicted == t_.law.width
        assert t_.width == pytest.approx(t_.predicted, rel=1e-6)
        assert t_.duration == pytest.approx(t_.law.duration, rel=1e-6)
        slow_limit = 2 * np.sqrt(0.25 * t_.slope) + t_.slope
        assert t_.law.asymptotic == pytest.approx(slow_limit, rel=1e-6)
        assert "(predicted " in t_.description


def test_jumps_are_as_late_as_the_law_of_the_fold_says(gear):
    """Within 3 % at the very state at which the measured delay is taken."""
    folded = gear.with_parameters(A=-0.6, B=0, C=0.4, omega=0.001)
    overlay = laid(folded, "w", (-1, 1), [0.9, 0], periods=2)
    jumps = [t_ for t_ in overlay.transitions if t_.type == "jump"]
    assert len(jumps) == 3
    for t_ in jumps:
        assert t_.delay == pytest.approx(t_.predicted, rel=0.03)
    # the second period repeats the first: one law, computed once
    assert jumps[0].law is jumps[2].law


@pytest.mark.parametrize(
    ("case", "state", "end"),
    [
        (slow_models.van_der_pol(), [2.0, 0.5], 500),
        (slow_models.van_der_pol_linear(), [2.5, 0.5], 500),
        (slow_models.harvest(), [0.8], 30),
    ],
    ids=lambda value: getattr(value, "name", ""),
)
def test_jumps_are_within_the_error_of_their_law(case, state, end):
    """With a slow state that is fed back, and a load that speeds up."""
    overlay = laid(case.model, case.slow, case.over, state, t=(0, end))
    jumps = [t_ for t_ in overlay.transitions if t_.type == "jump"]
    assert jumps
    for jump in jumps:
        assert abs(jump.delay - jump.law.delay) <= jump.law.error + 1e-9
        assert jump.law.error <= 0.06 * abs(jump.delay)
        assert not jump.law.drift.constant


def test_a_drift_is_put_into_words_once_for_every_law(monkeypatch):
    """The gap is crossed twice in every period, both ways at the same rates."""
    calls = []

    def counted(slow, point, time, *, with_law=True):
        calls.append(with_law)
        return drift_at(slow, point, time, with_law=with_law)

    monkeypatch.setattr(predictions, "drift_at", counted)
    overlay = laid(fs.systems.harmonic_gear(), "w", (-20, 20), [0.0, 0.0], periods=3)
    assert len([t for t in overlay.transitions if t.law]) == 6
    assert (calls.count(False), calls.count(True)) == (6, 2)


@pytest.mark.parametrize("start", [-0.95, -0.73, -0.6])
def test_what_has_not_settled_before_the_fold_is_in_the_error(start):
    """From 0.025 before a fold: the law cannot know the start, its error does."""
    model = fs.Model({x: p + x - x**3}, forcing={p: 0.36 + t / 100})
    overlay = laid(model, "p", (-1, 1), [start], t=(0, 30))
    (jump,) = [t_ for t_ in overlay.transitions if t_.type == "jump"]
    assert abs(jump.delay - jump.law.delay) <= jump.law.error
    told = "the branch was reached so shortly before" in jump.law.validity
    # the law itself is right to 2 % where the start is near the branch
    assert told == (abs(jump.delay / jump.law.delay - 1) > 0.02)


def test_a_burster_whose_drift_turns_within_the_slow_part():
    """Hindmarsh-Rose comes to its lower branch so near the fold that it never settles."""
    overlay = laid(fs.systems.hindmarsh_rose(), "z", (0, 5), [-1.5, -10, 2.0], t=(0, 400))
    starts = [
        t_ for t_ in overlay.transitions if t_.special is not None and t_.special.code == "LP"
    ]
    assert len(starts) >= 2
    for leave in starts:
        assert abs(leave.delay - leave.law.delay) <= leave.law.error
        assert "the branch was reached so shortly before" in leave.law.validity


def test_a_slow_hopf_point_is_left_where_growth_makes_up_for_decay():
    rates = {x: p * x - 8 * y - x * (x**2 + y**2), y: 8 * x + p * y - y * (x**2 + y**2)}
    model = fs.Model(rates, forcing={p: t / 20 - 1})
    overlay = laid(model, "p", (-2, 2), [0.3, 0], t=(0, 60))
    (leave,) = [t_ for t_ in overlay.transitions if t_.type == "Hopf"]
    # entry at p = -1, decay exp(-10): the same way beyond, less what the amplitude needs not grow
    assert leave.predicted == pytest.approx(1, abs=0.1)
    assert 0.6 < leave.delay < leave.predicted + 0.05


def test_without_a_model_there_is_no_law(gear, tmp_path):
    diagram = fs.continue_equilibria(gear.frozen(), "w", over=(-2, 6))
    diagram.save(tmp_path / "gear.npz")
    overlay = fs.overlay(fs.load(tmp_path / "gear.npz"), fs.simulate(gear, [0, 0], periods=1))
    assert [t_.type for t_ in overlay.transitions] == ["gap crossing", "gap crossing"]
    assert all(t_.law is None and np.isnan(t_.predicted) for t_ in overlay.transitions)
    assert "law" not in overlay.summary()


def test_a_crossing_before_its_point_has_the_rate_of_the_passage_that_follows():
    """A PI control with anti-windup: x = -x + 2 sat(u), u = 2 (r - x) + z, is saturated early.

    A rising r meets the limit 1/2 of a time unit before r = 2, a falling one 9/5 before.
    """
    x, z, r, t = sp.symbols("x z r t")
    u = 2 * (r - x) + z
    limited = sp.Max(-1, sp.Min(1, u))
    model = fs.Model(
        {x: -x + 2 * limited, z: r - x + 5 * (limited - u)},
        forcing={r: sp.Rational(5, 2) * sp.sin(t / 1000)},
    )
    diagram = fs.continue_equilibria(model.frozen(), "r", over=(-3, 3))
    overlay = fs.overlay(diagram, fs.simulate(model, [0, 0], periods=1))
    early = [(one.delay, one.law.delay) for one in overlay.transitions]
    for (delay, law), time in zip(early, (0.5, 1.8, 0.5, 1.8), strict=True):
        assert delay == pytest.approx(law, rel=2e-3)
        assert delay == pytest.approx(-time * 2.5e-3 * 0.6, rel=3e-3)
