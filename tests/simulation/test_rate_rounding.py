"""Runs whose rates are rounding errors say so, and no others."""

import pytest
import sympy as sp

import fastslow as fs

x, p, c, t = sp.symbols("x p c t")
SAID = "Rounding decides this run"


def outcome(rate, start=1.0, value=1e8):
    model = fs.Model({x: rate}, parameters={c: value, p: 0.3})
    return fs.simulate(model, [start], t=(0, 5)).outcome


@pytest.mark.parametrize(
    "rate",
    [
        # −x²/2 − p x, and −x²/(1 + x²) − p
        -c * (sp.sqrt(x**2 + c**2) - c) - p * x,
        (c**2 + 2 * c * x) / (1 + x**2) - (x + c) ** 2 / (1 + x**2) - p,
    ],
)
def test_terms_that_cancel_are_named(rate):
    found = outcome(rate)
    assert found.success
    (note,) = [one for one in found.notes if SAID in one]
    assert "larger than the rate of x, which is known to 0." in note
    # with c = 10 they do not cancel
    assert not outcome(rate, value=10.0).notes


@pytest.mark.parametrize(
    ("rate", "start"),
    [
        # stiff, beside a large state, large in itself, and multiplied out
        (-c * (x - p), 1.0),
        (-c * (x - p) ** 3, 1.0),
        (c - x - x**2 / c, 1.0),
        (p * x * (1 - x / c), 0.9e8),
        (-c * (x - c), 0.9e8),
        (c * sp.cos(c * t / 10**7) - x, 0.0),
        (p - x - ((x + c) ** 2 - x**2 - 2 * c * x - c**2), 1.0),
    ],
)
def test_large_numbers_alone_are_not(rate, start):
    assert not [one for one in outcome(rate, start).notes if SAID in one]


def test_a_run_that_overflows_is_examined_up_to_there():
    run = fs.simulate(fs.Model({x: x}), [1], t=(0, 720))
    assert run.outcome.code == "blow-up"
    assert run.t[-1] == pytest.approx(709.78, abs=0.5)
    assert not run.outcome.notes
