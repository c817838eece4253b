"""Equilibria held against walls in closed form, against the numerical ones."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.model.structure import real

pytestmark = pytest.mark.slow

x, v, y, u, F, k, c, r, sigma, m, a, kappa = sp.symbols("x v y u F k c r sigma m a kappa")
HELD = "S1 at rest on x = sigma"


def test_a_mass_on_a_spring_at_a_stop():
    model = fs.Model(
        {x: v, v: (F - k * x - c * v) / m},
        parameters={F: 0, k: 2, c: 0.3, r: 0.6, sigma: 1, m: 1.5},
        resets={x >= sigma: {v: -r * v}},
    )
    found = fs.derive(model, parameter=F)
    (held,) = found[HELD].equilibria
    force, stiffness, at, mass = map(real, ("F", "k", "sigma", "m"))
    assert held.state == {"x": at, "v": 0}
    assert sp.simplify(held.contact_forces["x = sigma"] - (force - stiffness * at) / mass) == 0
    assert held.admissible == (force > stiffness * at)
    assert held.stability.verdict == "stable"
    assert found["S1"].equilibria[0].admissible == (force < stiffness * at)
    (lift_off,) = found.boundary_equilibria
    assert lift_off.parameters["F"] == stiffness * at
    assert (lift_off.type, lift_off.test) == ("persistence", mass / stiffness)
    assert found.verified
    text = found.summary()
    assert "x = sigma, v = 0; contact force on x = sigma (F - k*sigma)/m; stable" in text
    assert "boundary equilibrium on x = sigma (S1 | S1 at rest on x = sigma): F = k*sigma" in text
    assert r"\lambda = \frac{F - k \sigma}{m}" in found.to_latex()


def test_the_nature_at_a_spring_of_negative_stiffness():
    model = fs.Model(
        {x: v, v: a * x - x**3 - c * v - F},
        parameters={F: 0, c: 0.3, r: 0.6, sigma: 0.5, a: 1},
        resets={x >= sigma: {v: -r * v}},
    )
    found = fs.derive(model, parameter=F)
    (point,) = found.boundary_equilibria
    slope, at = real("a"), real("sigma")
    # CᵀJ⁻¹W = 1/(a - 3σ²)
    assert sp.simplify(point.test + 1 / (slope - 3 * at**2)) == 0
    assert point.type == "depends"
    assert fs.derive(model, {"a": "negative"}, parameter=F).boundary_equilibria[0].type == (
        "persistence"
    )
    assert fs.derive(model, "a > 3*sigma**2", parameter=F).boundary_equilibria[0].type == (
        "non-smooth fold"
    )


@pytest.mark.sample(1)
@pytest.mark.parametrize("load", [1.0, 3.0, 6.0])
def test_two_masses_at_two_stops_against_the_numerical_equilibria(load):
    model = fs.Model(
        {x: v, v: F - k * x - kappa * (x - y) - c * v, y: u, u: -k * y - kappa * (y - x) - c * u},
        parameters={F: load, k: 2, kappa: 3, c: 0.3, r: 0.6, sigma: 1},
        resets={x >= sigma: {v: -r * v}, 4 * y >= sigma: {u: -r * u}},
    )
    found = fs.derive(model)
    values = model.values
    (expected,) = fs.equilibria(model)
    admissible = [
        form
        for region in found.regions.values()
        for form in region.equilibria
        if form.admissible.subs(values) == sp.true
    ]
    (form,) = admissible
    assert form.region == expected.region
    state = [float(e.subs(values)) for e in form.state.values()]
    assert np.abs(np.array(state) - expected.state).max() < 1e-12
    forces = {wall: float(e.subs(values)) for wall, e in form.contact_forces.items()}
    assert forces == pytest.approx(dict(expected.contact_forces))
    # one boundary equilibrium for each contact that is made or lost
    assert len(found.boundary_equilibria) == 4


def test_kicks_are_refused():
    t = sp.Symbol("t")
    model = fs.Model({v: F - v}, parameters={F: 0}, resets={sp.Eq(sp.Mod(t, 2), 0): {v: v + 1}})
    with pytest.raises(fs.ModelError, match="derive would ignore the reset"):
        fs.derive(model)


def test_every_state_of_a_switch_is_derived():
    w, q = sp.symbols("w q")
    relay = fs.Model({x: w - x - k * q}, parameters={w: 0, k: 2}, switches={q: (x > 1, x < -1)})
    found = fs.derive(relay, parameter=w)
    load, pull = real("w"), real("k")
    off, on = (found[name].equilibria[0] for name in ("S1 (q = 0)", "S1 (q = 1)"))
    assert (off.state["x"], off.admissible) == (load, load < 1)
    assert (on.state["x"], on.admissible) == (load - pull, load > pull - 1)
    ends = found.boundary_equilibria
    assert [(e.interface, e.parameters["w"], e.type) for e in ends] == [
        ("x = 1 (q → 1)", 1, "switch"),
        ("x = -1 (q → 0)", pull - 1, "switch"),
    ]
    assert "Boundary equilibrium of S1 (q = 0)" in found.to_latex()
    # at the same values the branches of the diagram end
    diagram = fs.continue_equilibria(relay, "w", (-3, 3))
    assert [p["w"] for p in diagram.special("BE")] == pytest.approx([1, 1])


def test_a_threshold_that_resets_ends_the_equilibria():
    neuron = fs.Model({v: F - v}, parameters={F: 0}, resets={v >= 1: {v: 0}})
    found = fs.derive(neuron, parameter=F)
    assert found["S1"].equilibria[0].admissible == (real("F") < 1)
    (end,) = found.boundary_equilibria
    assert (end.type, end.regions, end.parameters["F"]) == ("reset", ("S1",), 1)
