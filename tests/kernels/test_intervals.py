"""Interval arithmetic: enclosures against 250 bits, exact constants, and what has no bounds."""

import math
from fractions import Fraction

import mpmath
import numpy as np
import pytest
import sympy as sp

from fastslow.errors import ModelError
from fastslow.kernels.intervals import arithmetic, program
from fastslow.kernels.intervals.printer import enclosure, interval_program
from fastslow.model.removable import ExpQuotient, with_removable
from tests.campaigns import enclosures
from tests.campaigns.enclosures import BITS, ELEMENTARY, Report, campaign, check, compiled
from tests.samples import WHOLE

x, y = sp.symbols("x y")


def interpreted(one, low, high):
    """Enclosures by the source of the compiled program."""
    out = np.empty((len(low), 3)), np.empty((len(low), 3))
    with np.errstate(all="ignore"):
        program.enclose(one.program, low, high, one.registers(), *out)
    return out


def bounds(expression, low, high=None):
    """Enclosure of a function of x over one interval."""
    box = np.array([[low, 1.0]]), np.array([[low if high is None else high, 1.0]])
    below, above = compiled(interval_program([expression], [x, y]), *box)
    return below[0, 0], above[0, 0]


def test_enclosures_contain_the_values_at_250_bits():
    # python -m tests.campaigns enclosures 1000000
    report = campaign(1000, 7, ELEMENTARY[:: 1 if WHOLE else 4])
    assert report.failures == []
    assert report.finite > 100


def test_without_the_widening_values_are_lost(monkeypatch):
    def report_of(expressions):
        report = Report(0)
        with mpmath.workprec(BITS):
            for expression in expressions:
                check(report, expression, np.random.default_rng(3), 10, interpreted)
        return report

    some = [x + y, x * y, x / y, x**3, sp.sqrt(x), enclosures.g * sp.pi]
    assert report_of(some).failures == []
    monkeypatch.setattr(arithmetic, "PHI", 0.0)
    for expression in some:
        assert report_of([expression]).failures != [], expression


def test_bounds_are_close():
    # widths of some tens of units in the last place, where nothing cancels
    points = np.random.default_rng(0).uniform(0.1, 0.9, (200, 2))
    for expression in ELEMENTARY:
        low, high = compiled(interval_program([expression], [x, y]), points, points)
        width = (high - low)[:, 0] / np.maximum(np.abs(low[:, 0]), 0.1)
        assert width.max() < 5e-14, expression


def test_source_and_machine_code_agree():
    rng = np.random.default_rng(5)
    low, high = enclosures.boxes(rng, 20)
    one = interval_program([sp.exp(x) * sp.tanh(y) / (1 + x**2) - sp.log(y**2 + 1)], [x, y])
    for first, second in zip(compiled(one, low, high), interpreted(one, low, high), strict=True):
        assert np.array_equal(first, second)


def test_constants_are_enclosed_from_exact_numbers():
    third, exact = enclosure(sp.Rational(1, 3)), Fraction(1, 3)
    assert Fraction(third[0]) < exact < Fraction(third[1])
    assert np.nextafter(third[0], 1) == third[1]
    assert enclosure(sp.Integer(2**60)) == (2.0**60, 2.0**60)
    # a float is the decimal number that it is read from, and not its binary value
    for number in (sp.Float(0.1), sp.Rational("0.1")):
        assert enclosure(number) == (np.nextafter(0.1, 0), 0.1)
    low, high = enclosure(sp.pi)
    assert Fraction(low) < Fraction(314159265358979323846, 10**20) < Fraction(high)
    assert high - low == np.spacing(low)
    assert enclosure(sp.Integer(10) ** 400) == (-math.inf, math.inf)


def test_what_is_not_finite_has_no_bounds():
    everything = (-math.inf, math.inf)
    assert bounds(1 / x, -1, 1) == everything
    assert bounds(sp.exp(x), 0, 1000) == everything
    assert bounds(sp.log(x), 0, 1) == everything
    assert bounds(sp.sqrt(x), -1e-300, 1) == everything
    assert bounds(x**5, -1e100, 1e100) == everything
    assert bounds(sp.tan(x), 1, 2) == everything
    assert bounds(x * 0 + 1 / (x - x * y), 1, 2) == everything


def test_even_powers_and_periodic_functions_know_their_extrema():
    low, high = bounds(x**4, -2, 3)
    assert low == 0
    assert 81 <= high < 81 + 1e-12
    low, high = bounds(sp.sin(x), 1, 2)
    assert (high, low) == (1.0, pytest.approx(math.sin(1), rel=1e-15))
    assert bounds(sp.cos(x), -1e7, 1e7) == (-1.0, 1.0)


def test_removable_quotients_are_single_functions():
    V = sp.Symbol("V")
    # alpha_m of Hodgkin and Huxley, written in three ways
    for quotient in (
        (25 - V) / 10 / (sp.exp((25 - V) / 10) - 1),
        sp.Rational(1, 10) * (V - 25) / (1 - sp.exp((25 - V) / 10)),
        (V - 25) / (10 - 10 * sp.exp((25 - V) / 10)),
        ((V - 25) / 10) / (1 - sp.exp((25 - V) / 10)),
    ):
        assert with_removable(quotient) == ExpQuotient((25 - V) / 10, 0)
    quotient = (V + 40) / (1 - sp.exp(-(V + 40) / 10)) / 10
    assert with_removable(quotient) == ExpQuotient(-(V + 40) / 10, 0)
    rate = (x / (sp.exp(x) - 1)) ** 2 * y
    assert not with_removable(rate).has(sp.exp)
    low, high = bounds(x / (sp.exp(x) - 1), -1e-3, 1e-3)
    assert low <= 1 <= high
    assert high - low < 1.1e-3
    # 0.1 (V + 40) and 0.1 V + 4 differ in binary: the quotient has a pole
    assert with_removable((V + 40) / (1 - sp.exp(-sp.Rational(0.1) * V - 4.001))).has(sp.exp)


def test_unknown_functions_are_refused():
    with pytest.raises(ModelError, match="airyai, which has no interval arithmetic"):
        interval_program([sp.airyai(x)], [x])
    with pytest.raises(ModelError, match="the rates contain 'a'"):
        interval_program([x - sp.Symbol("a")], [x])


def test_other_removable_quotients_are_divided():
    low, high = bounds(sp.sin(x) / x + sp.log(1 + x) / x, 0.5, 0.6)
    for value in (0.5, 0.55, 0.6):
        assert low <= math.sin(value) / value + math.log1p(value) / value <= high
