"""From when on, and how often at least, a run has to repeat: forced decay in closed form."""

import math

import pytest
import sympy as sp

import fastslow as fs

x, t = sp.symbols("x t")

#: x' = −x/10 + sin t: every period brings a state nearer by exp(−π/5) to one that repeats.
FORCED = fs.Model({x: -x / 10 + sp.sin(t)})
SHRINKS = math.exp(-0.2 * math.pi)

#: (sin t/10 − cos t)/(1/100 + 1) at t = 0, where it repeats, and its range.
START, RANGE = -1 / 1.01, 2 / math.sqrt(1.01)


def swung(offset, periods):
    return fs.simulate(
        FORCED,
        [START + offset],
        t=(0, 2 * math.pi * periods),
        integration=fs.Integration(rtol=1e-13),
    )


def test_one_repeat_is_not_enough():
    """Two states a period apart may agree by chance; three do not."""
    short = swung(0.0, 1).periodicity(period=2 * math.pi)
    assert short.multiple is None
    assert short.outcome.code == "too short"
    whole = swung(0.0, 2).periodicity(period=2 * math.pi)
    assert whole.multiple == 1
    assert whole.since == 0.0


@pytest.mark.parametrize("tol", [1e-2, 1e-3, 1e-5])
def test_from_the_first_repeat_on(tol):
    """The change from k to k + 1 is 0.4 exp(−πk/5) (1 − exp(−π/5)), parts of the range."""
    steady = swung(0.4, 40).periodicity(period=2 * math.pi, tol=tol)
    first = math.ceil(math.log(tol * RANGE / (0.4 * (1 - SHRINKS))) / math.log(SHRINKS))
    assert steady.since == pytest.approx(2 * math.pi * first, rel=1e-12)
    assert steady.multiple == 1
    assert steady.period == pytest.approx(2 * math.pi, rel=1e-12)
    assert steady.distance == pytest.approx(0.4 * SHRINKS**first * (1 - SHRINKS) / RANGE, rel=1e-2)
