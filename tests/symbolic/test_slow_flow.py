"""Slow flows, folded singularities and canard points against closed forms and SciPy."""

import math
from functools import partial

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import fastslow as fs

pytestmark = pytest.mark.slow

x, y, z, p, t = sp.symbols("x y z p t")
a, k, lam, eps, omega, D = sp.symbols("a k lambda epsilon omega D")


def koper(value, scale=1, lagging=False):
    """Koper's model (Desroches et al., SIAM Rev. 54, 211-288, 2012), in other units of time."""
    fast = {x: scale * (k * y - x**3 + 3 * x - lam) / eps}
    if lagging:
        fast = {p: scale * 7 * (x - p) / eps, **fast}
    slow = {y: scale * (x - 2 * y + z), z: scale * (y - z)}
    return fs.Model(fast, slow=slow, parameters={k: -10, lam: value, eps: 0.01})


@pytest.mark.parametrize(
    ("value", "codes"),
    [(3, {"FF"}), (4, {"FN", "FF"}), (7.9, {"FN", "FF"}), (9, {"FS", "FF"}), (-5, {"FN", "FF"})],
)
def test_types_of_kopers_points_change_where_they_should(value, codes):
    """At x = -1, σ² + 10σ + 6(8 − λ) = 0; at x = 1, with 6(8 + λ): complex for λ > -23/6."""
    points = fs.slow_flow(koper(value)).points
    assert {one.code for one in points} == codes
    for one in points:
        side = -1 if one.values["x"] < 0 else 1
        roots = np.sort_complex(np.roots([1, 10, 6 * (8 + side * value)])) * 100
        assert np.sort_complex(one.eigenvalues) == pytest.approx(roots, rel=1e-12)
        assert one.form.check == "exact"


def test_ratio_of_a_folded_node_does_not_depend_on_units_order_or_idle_states():
    mu = (5 - math.sqrt(19)) / (5 + math.sqrt(19))
    for model in (koper(7), koper(7, scale=1000), koper(7, lagging=True)):
        node = next(one for one in fs.slow_flow(model).points if one.code == "FN")
        assert node.ratio == pytest.approx(mu, rel=1e-12)
        assert (node.rotations, node.funnel) == (math.floor((mu + 1) / (2 * mu)), True)
    (saddle_node,) = (one for one in fs.slow_flow(koper(8)).points if one.values["x"] < 0)
    assert saddle_node.code == ""
    assert "saddle-node" in saddle_node.note


def test_backwards_in_slow_time_a_funnel_has_faux_canards_only():
    """The same manifold with reversed slow rates: both eigenvalues change their sign."""
    model = fs.Model(
        {x: (k * y - x**3 + 3 * x - lam) / eps},
        slow={y: -(x - 2 * y + z), z: -(y - z)},
        parameters={k: -10, lam: 7, eps: 0.01},
    )
    node = next(one for one in fs.slow_flow(model).points if one.code == "FN")
    assert not node.funnel
    assert "faux" in node.words


@pytest.mark.parametrize("values", [(2.0, 1.0), (1.2, 0.3), (5.0, 4.0)])
def test_forced_van_der_pol(values):
    """λ² + λ − 2ωa cos ωt = 0 in slow time, at x = 1, where a sin ωt = 1 (Guckenheimer 2003)."""
    amplitude, frequency = values
    model = fs.Model(
        {x: (y - x**3 / 3 + x) / eps},
        slow={y: a * sp.sin(omega * t) - x},
        parameters={a: amplitude, omega: frequency, eps: 0.01},
    )
    flow = fs.slow_flow(model)
    assert (flow.slow, flow.verified) == (("y", "t"), True)
    assert len(flow.points) == 4
    for one in flow.points:
        at = one.values
        assert at["x"] == pytest.approx(amplitude * math.sin(frequency * at["t"]), abs=1e-12)
        assert 0 <= at["t"] < 2 * math.pi / frequency
        last = -2 * frequency * amplitude * at["x"] * math.cos(frequency * at["t"])
        roots = np.sort_complex(np.roots([1, 1, last])) * 100
        assert np.sort_complex(one.eigenvalues) == pytest.approx(roots, rel=1e-11)
    # no folded points below a = 1
    below = fs.slow_flow(model.with_parameters(a=0.9)).points
    assert {(one.code, one.note) for one in below} == {
        ("", "not real at the parameter values of the model")
    }


def test_canard_point_of_van_der_pol():
    """a_c = 1 − ε/8 − 3ε²/32 − … (Zvonkin and Shubin 1984); the Hopf bifurcation is at a = 1."""
    model = fs.Model({x: (y - x**3 / 3 + x) / eps}, slow={y: a - x}, parameters={a: 0.5, eps: 0.01})
    (one,) = fs.slow_flow(model).points
    canard = one.canard
    assert (one.code, canard.parameter, canard.value) == ("CN", "a", 1.0)
    assert canard.criticality == "supercritical"
    assert (canard.hopf, canard.canard) == pytest.approx((1.0, 1 - 0.01 / 8), abs=1e-15)
    # on the other fold under the other sign
    (other,) = fs.slow_flow(model, {"a": "negative"}).points
    assert other.canard.canard == pytest.approx(-1 + 0.01 / 8, abs=1e-15)


#: Coefficients a₂, …, a₅ of the canonical form, and their combinations.
A2, A3, A4, A5 = 0.3, 0.2, 0.4, 0.5
A = -A2 + 3 * A3 - 2 * A4 - 2 * A5


def canonical(delta, reduced):
    """The canonical form, with one fast state or with two on whose center manifold it is."""
    if reduced:
        fast = {x: -y * (1 + A2 * x) + x**2 * (1 + A3 * x)}
    else:
        fast = {p: A3 * x**2 - A2 * y - p, x: -y + x**2 + x * p}
    slow = {y: delta * (x * (1 + A4 * x) - a + A5 * y)}
    return fs.Model(fast, slow=slow, parameters={a: 0.1})


def at_origin(model):
    """The canard point at the origin, where there are folds elsewhere."""
    points = fs.slow_flow(model, {"a": "real"}).points
    (one,) = (one for one in points if one.values.get("x") == 0)
    return one


@pytest.mark.parametrize("reduced", [True, False])
def test_canard_value_has_all_its_terms(reduced):
    """Krupa and Szmolyan (2001), eqs. 3.12 and 3.16, with one fast state and with two."""
    delta = 1e-3
    canard = at_origin(canonical(delta, reduced)).canard
    assert canard.value == pytest.approx(0.0, abs=1e-15)
    assert canard.hopf == pytest.approx(-A5 / 2 * delta, rel=1e-10)
    assert canard.canard == pytest.approx(-(A5 / 2 + A / 8) * delta, rel=1e-10)
    assert canard.criticality == "supercritical"


def test_canard_value_against_the_manifolds_that_scipy_follows():
    """The two slow manifolds meet on x = 0; the error is below δ^1.5 at two values of δ."""

    def height(delta, value, side):
        # from the critical manifold at x = -0.6 forwards, at x = 0.6 backwards
        def rates(_, u):
            one, other = u
            fast = -other * (1 + A2 * one) + one**2 * (1 + A3 * one)
            return side * fast, side * delta * (one * (1 + A4 * one) - value + A5 * other)

        start = -0.6 * side
        begin = start, start**2 * (1 + A3 * start) / (1 + A2 * start)
        event = lambda _, u: u[0]  # noqa: E731
        event.terminal = True
        run = solve_ivp(rates, (0, 1e6), begin, "LSODA", rtol=1e-10, atol=1e-13, events=event)
        return run.y_events[0][0, 1]

    for delta in (0.01, 0.0025):
        gap = partial(lambda d, v: height(d, v, 1) - height(d, v, -1), delta)
        predicted = at_origin(canonical(delta, True)).canard.canard
        found = brentq(gap, predicted - delta / 4, predicted + delta / 4, xtol=1e-9)
        assert abs(found - predicted) < delta**1.5


def test_folds_of_repelling_sheets_and_points_outside_their_region_have_no_code():
    repelling = fs.Model(
        {x: (y - x**3 / 3 + x) / eps, p: p}, slow={y: a - x}, parameters={a: 1, eps: 0.01}
    )
    (one,) = fs.slow_flow(repelling).points
    assert (one.code, one.note) == ("", "no attracting sheet ends at this fold")
    split = fs.Model(
        {x: sp.Piecewise((y - (x + 1) ** 2, x > D), (y - x - 1, True))},
        slow={y: a - x},
        parameters={a: -1, D: 0.5},
    )
    flow = fs.slow_flow(split)
    assert [one.note for one in flow.points] == [
        "outside its region at the parameter values of the model"
    ]
    assert "S1" in repr(flow)


def test_bad_input():
    frozen = fs.Model({x: y - x**2}, parameters={y: 1})
    with pytest.raises(fs.ArgumentError, match="no slow variable"):
        fs.slow_flow(frozen)
    ramp = fs.Model({x: y - x**2}, forcing={y: a * t}, parameters={a: 1})
    with pytest.raises(fs.ArgumentError, match="no period"):
        fs.slow_flow(ramp)
    with pytest.raises(fs.UnknownNameError, match="S1"):
        fs.slow_flow(koper(7), regions=["S2"])
    with pytest.raises(fs.UnknownNameError, match="lambda"):
        fs.slow_flow(koper(7), parameter="lamda")
    three = fs.Model({x: y - x**2}, slow={y: z, z: p - x, p: -p})
    assert fs.slow_flow(three)["S1"].notes == (
        "with three or more slow variables only the condition is derived",
    )
    double = fs.Model({x: y - x**2, p: y - p**2}, slow={y: a - x}, parameters={a: 0})
    assert fs.slow_flow(double)["S1"].notes == (
        "f_x has corank 2 on a fold, which is not examined",
    )
    cubic = fs.Model({x: -y - x**3}, slow={y: a - x}, parameters={a: 0})
    assert [one.note for one in fs.slow_flow(cubic).points] == [
        "degenerate: the fold is not quadratic"
    ]
    edge = fs.Model(
        {x: sp.Piecewise((y - x**2, x > D), (y - x, True))},
        slow={y: a - x},
        parameters={a: 0, D: 0},
    )
    assert "on an interface" in fs.slow_flow(edge, parameter="a").points[0].note
    flat = fs.Model({x: y}, slow={y: -x})
    assert "not normally hyperbolic" in fs.slow_flow(flat)["S1"].notes[0]


#: Of the demo fnc of AUTO-07p (M. Desroches, B. Krauskopf, H. M. Osinga, Chaos 18, 015107, 2008):
#: the folded node from which it starts, and the times that its canards ξ₃ to ξ₈ take from h = −6
#: on the attracting sheet to the section through the node, and from there to v = 0 on the other.
FOLDED_NODE = (-0.490, 0.61760, 0.27970)
ARRIVING = (56.312667620, 71.853132166, 85.797089436, 98.432124179, 110.04693491, 120.81663908)
LEAVING = (144.10077659, 160.62079695, 178.59845751, 197.98334090, 218.62796126, 240.27107973)


@pytest.fixture(scope="module")
def self_coupled():
    v, h, s, gamma, delta = sp.symbols("v h s gamma delta")
    return fs.Model(
        {v: h - (v**3 - v + 1) / 2 - gamma * s * v},
        slow={h: -eps * (2 * h + 2.6 * v), s: -eps * delta * s},
        parameters={eps: 0.015, gamma: 0.5, delta: 0.565},
    )


def test_self_coupled_fitzhugh_nagumo_against_auto(self_coupled):
    """No closed form: a cubic is left, whose real roots are points."""
    points = fs.slow_flow(self_coupled).points
    # -(2h + 2.6v) + γδ s v = 0 with s = 1 − 3v², h = 1/2 − v³
    cubic = np.roots([2 - 1.5 * 0.565, 0, -2.6 + 0.5 * 0.565, -1])
    assert [p.values["v"] for p in points] == pytest.approx(np.sort(cubic.real), rel=1e-12)
    assert [p.code for p in points] == ["FN", "FN", "FF"]
    node = points[1]
    assert node.note == "a root of the remaining equation"
    assert [node.values[n] for n in ("v", "h", "s")] == pytest.approx(FOLDED_NODE, abs=1e-4)
    curve = fs.continue_points(node, "delta", (0.3, 0.8))
    assert curve.at(delta=0.565)[0]["v"] == pytest.approx(node.values["v"], rel=1e-12)


@pytest.mark.sample(0)
def test_canards_of_self_coupled_fitzhugh_nagumo_against_auto(self_coupled):
    """Also by simulation from both sides at the printed times."""
    decay = 0.015 * 0.565
    found = fs.find_canards(self_coupled, fs.slow_flow(self_coupled).points[1])
    places = np.column_stack([found["v"], found["h"]])
    for k, (before, after) in enumerate(zip(ARRIVING, LEAVING, strict=True)):
        first, last = (0.27970 * math.exp(decay * t) for t in (before, -after))
        roots = np.roots([1, 0, first - 1, 13])
        start = roots[np.isreal(roots)].real[0], -6, first
        one = fs.simulate(self_coupled, start, t=(0, before)).final_state
        other = fs.simulate(self_coupled, (0, 0.5, last), t=(0, -after)).final_state
        assert [*one.values()] == pytest.approx([*other.values()], abs=5e-4)
        if k > 0:  # ξ₃ begins beyond the starts; deviations along ξ₄ decay by exp(-6)
            away = np.abs(places - [one["v"], one["h"]]).max(axis=1)
            assert away.argmin() == k - 1
            assert away.min() < (2.5e-3 if k == 1 else 4e-4)
    # neither the strong nor the weak canard is reached, which is said
    assert set(found["type"]) == {"secondary"}
    assert "miss the section" in found.outcome.message
