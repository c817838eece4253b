"""Signatures of mixed-mode oscillations."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs

pytestmark = pytest.mark.slow

x, y, z, v, t = sp.symbols("x y z v t")
k, lam, eps = sp.symbols("k lambda epsilon")


def koper(value, ratio):
    return fs.Model(
        {x: (k * y - x**3 + 3 * x - lam) / eps},
        slow={y: x - 2 * y + z, z: y - z},
        parameters={k: -10, lam: value, eps: ratio},
    )


def of_function(law, until=60.0):
    """The run x(t) = law, by integrating its derivative."""
    model = fs.Model({x: sp.diff(law, t)})
    return fs.simulate(model, [float(law.subs(t, 0))], t=(0, until))


@pytest.mark.parametrize(
    ("ratio", "signature"), [(0.1, "1²1³"), (0.01, "1¹1²")], ids=["0.1", "0.01"]
)
def test_koper(ratio, signature):
    """s = 7 is an upper bound of the numbers, not the numbers (counted with SciPy's LSODA)."""
    fine = fs.Integration(rtol=1e-12)
    run = fs.simulate(koper(7, ratio), [-1, -0.9, -0.8], t=(0, 200), integration=fine)
    found = run.mixed_mode(since=100)
    assert found.signature == signature
    assert (found.outcome.code, bool(found.outcome)) == ("mixed modes", True)
    assert found.gap > 2
    assert signature in repr(found)


def test_relaxation_oscillations_have_one_amplitude():
    run = fs.simulate(fs.Model({x: v, v: (1 - x**2) * v - x}), [2, 0], t=(0, 100))
    found = run.mixed_mode()
    assert (found.signature, found.outcome.code) == ("1⁰", "one amplitude")
    # the amplitude of the oscillator with μ = 1 is 2.00862 (Zonneveld 1966)
    assert found.large[1] == pytest.approx(2 * 2.00862, abs=1e-4)


def test_pattern_in_closed_form():
    """Maxima of cos t + cos(3t)/2 + …: two large and one small by the values at its extrema."""
    law = sp.cos(t) + sp.cos(3 * t)
    found = of_function(law).mixed_mode("x", since=0)
    s = np.linspace(0, 2 * np.pi, 2_000_001)
    values = np.cos(s) + np.cos(3 * s)
    tops = np.flatnonzero((values[1:-1] > values[:-2]) & (values[1:-1] > values[2:])) + 1
    assert len(tops) + 1 == 3
    assert found.blocks == ((1, 2),)
    assert found.outcome.code == "mixed modes"


def test_oscillations_below_the_integration_error_are_undecided():
    law = sp.cos(t) + sp.Rational(1, 10**5) * sp.cos(400 * t)
    model = fs.Model({x: sp.diff(law, t)})
    rough = fs.Integration(rtol=1e-7)
    found = fs.simulate(model, [1], t=(0, 30), integration=rough).mixed_mode(since=0)
    assert found.outcome.code == "undecided"
    assert "integration error" in repr(found)


def test_patterns_that_do_not_repeat_and_short_runs():
    # twelve time units, of which the pattern takes 6.11: two whole blocks
    run = fs.simulate(koper(7, 0.1), [-1, -0.9, -0.8], t=(0, 112))
    found = run.mixed_mode(since=100)
    assert found.outcome.code == "not periodic"
    assert len(found.blocks) == 2
    short = of_function(sp.cos(t), 3.0).mixed_mode()
    assert (short.outcome.code, short.signature) == ("too short", "")
    with pytest.raises(fs.UnknownNameError, match="unknown state 'w'"):
        of_function(sp.cos(t), 3.0).mixed_mode("w")
