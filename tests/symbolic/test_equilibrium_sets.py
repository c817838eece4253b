"""Sets of pseudo-equilibria on discontinuities in closed form."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs

pytestmark = pytest.mark.slow

x, v, y, u, w, k, mu = sp.symbols("x v y u w k mu", real=True)


def test_the_sticking_band_is_stated_with_its_edges():
    block = fs.Model(
        {x: v, v: -k * x - v / 10 - mu * sp.sign(v) + w}, parameters={w: 1, mu: 1, k: 2}
    )
    derivation = fs.derive(block)
    (band,) = derivation.equilibrium_sets
    assert (band.region, band.interfaces, band.free) == ("S1|S2", ("v",), (x,))
    assert band.attracting
    assert band.state["v"] == 0
    wanted = ((w - mu) / k, (w + mu) / k)
    assert all(sp.simplify(e["x"] - x0) == 0 for e, x0 in zip(band.edges, wanted, strict=True))
    (condition,) = band.conditions
    for place in np.linspace(-1, 2, 31):
        force = float(abs(1 - 2 * place))
        assert bool(condition.subs({x: place, w: 1, mu: 1, k: 2})) == (force <= 1)


def test_equilibria_of_the_regions_are_edges_and_no_boundary_equilibria():
    block = fs.Model({x: v, v: -x - v / 10 - sp.sign(v) / 2 + w}, parameters={w: 0.3})
    derivation = fs.derive(block)
    assert derivation.boundary_equilibria == ()
    text = derivation.summary()
    assert "equilibrium set (sticking) S1|S2 on v = 0: Abs(w - x) <= 1/2, v = 0" in text
    assert "edges x = w - 1/2 and x = w + 1/2" in text
    assert text.count("edge of the equilibrium set S1|S2") == 2
    assert "virtual" not in text
    assert r"\left|{w - x}\right| \leq \frac{1}{2}" in derivation.to_latex()


def test_a_band_with_a_hardening_spring_keeps_its_condition():
    block = fs.Model({x: v, v: -x - x**3 - mu * sp.sign(v) + w}, parameters={w: 0, mu: 1})
    (band,) = fs.derive(block).equilibrium_sets
    assert band.edges == ()
    assert band.conditions == (sp.Abs(w - x - x**3) <= mu,)


def test_two_contacts_have_two_conditions():
    rates = {x: v, v: -x - (x - y) - mu * sp.sign(v), y: u, u: -y + x - y - mu * sp.sign(u)}
    (band,) = fs.derive(fs.Model(rates, parameters={mu: 1})).equilibrium_sets
    assert band.free == (x, y)
    values = dict(zip((x, y, mu), (0.4, 0.3, 1.0), strict=True))
    assert all(bool(c.subs(values)) for c in band.conditions)
    assert not all(bool(c.subs({**values, y: 2.0})) for c in band.conditions)


def test_negative_friction_escapes_and_a_moving_belt_has_no_set():
    away = fs.derive(fs.Model({x: v, v: -x + sp.sign(v) / 2}))
    assert "equilibrium set (escaping)" in away.summary()
    belt = fs.Model({x: v, v: -x - sp.sign(v - w) / 2}, parameters={w: 0.1})
    assert fs.derive(belt).equilibrium_sets == ()


def test_a_boundary_equilibrium_at_one_value_is_kept_beside_a_set():
    # a block that sticks, and apart from it a tank whose outlet opens at y = 1
    outlet = sp.Piecewise((1, y > 1), (0, True))
    rates = {x: v, v: -x - sp.sign(v) / 2, y: w - y - outlet}
    derivation = fs.derive(fs.Model(rates, parameters={w: 0.5}))
    kept = derivation.boundary_equilibria
    assert {b.interface for b in kept} == {"y - 1"}
    assert {b.parameters["w"] for b in kept} == {1, 2}
    assert {one.interfaces for one in derivation.equilibrium_sets} == {("v",), ("v", "y - 1")}


def test_the_edges_of_a_set_of_another_field():
    # the prey is harvested above the very level at which the predator rests
    harvest = sp.Piecewise((x / 2, x > 1), (0, True))
    model = fs.Model({x: x * (w - x - y) - harvest, y: y * (x - 1)}, parameters={w: 2})
    derivation = fs.derive(model)
    (band,) = derivation.equilibrium_sets
    assert [edge["y"] for edge in band.edges] == [w - sp.Rational(3, 2), w - 1]
    assert derivation.boundary_equilibria == ()


@pytest.mark.parametrize("value", [0.3, -0.7])
def test_the_closed_form_agrees_with_the_numbers(value):
    block = fs.Model({x: v, v: -3 * x - mu * sp.sign(v) + w}, parameters={w: value, mu: 0.25})
    (form,) = fs.derive(block).equilibrium_sets
    (band,) = fs.equilibria(block).sets
    exact = sorted(float(e["x"].subs({w: value, mu: 0.25})) for e in form.edges)
    assert band["x"] == pytest.approx(exact, abs=1e-14)
