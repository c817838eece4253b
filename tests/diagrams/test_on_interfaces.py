"""Equilibria on an interface at every value: what one region's linearisation decides is named."""

import pytest
import sympy as sp

import fastslow as fs

x, y, p = sp.symbols("x y p")


def outcome(rates):
    model = fs.Model(rates, parameters={p: 0.3})
    return fs.continue_equilibria(model, "p", over=(-1, 1)).outcome.message


@pytest.mark.parametrize(
    "rates",
    [
        # attracts on one side, repels on the other for all |p| < 1
        {x: p * x + sp.Abs(x)},
        # an oscillator whose damping is p on one side and 1 on the other: the eigenvalues are
        # imaginary at p = 0, but the stability changes at p = -1 (equal and opposite damping)
        {x: sp.Piecewise((p * x, x > 0), (x, True)) - y, y: x},
        # a vector field that vanishes at the interface of a Filippov system
        {x: sp.Piecewise((-1, x > 0), (x, True)), y: p - y},
    ],
)
def test_the_region_that_decides_is_named(rates):
    (note,) = fs.equilibria(fs.Model(rates, parameters={p: 0.3})).notes
    assert "is on x = 0: its stability and type follow from the linearisation of S" in note
    message = outcome(rates)
    assert "For p from -1 to 1 equilibria are on x = 0 at every value" in message
    assert "linearisation of S" in message


@pytest.mark.parametrize(
    "rates",
    [
        # equal linearisations
        {x: p * x - sp.Max(x, 0) ** 2},
        # both sides attract, at different rates
        {x: (p - 3) * x + sp.Abs(x)},
        # the interface is passed
        {x: p - 2 * x + sp.Abs(x)},
    ],
)
def test_nothing_is_said_where_both_regions_agree(rates):
    assert "at every value" not in outcome(rates)
    assert fs.equilibria(fs.Model(rates, parameters={p: 0.3})).notes == ()
