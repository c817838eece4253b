"""Attraction of intersections of discontinuities: steep networks of genes and of neurons."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.diagrams.solve.intersections import attracts

pytestmark = pytest.mark.slow

H = sp.Heaviside
x, y, z, s, tau = sp.symbols("x y z s tau")


def network(*inputs):
    return {state: 2 * H(given) - state for state, given in zip((x, y, z), inputs, strict=False)}


def test_a_toggle_switch_is_not_stable_between_its_states():
    found = fs.equilibria(fs.Model(network(1 - y, 1 - x)))
    assert {(e["x"], e["y"]): e.stability for e in found} == {
        (0.0, 2.0): "stable",
        (2.0, 0.0): "stable",
        (1.0, 1.0): "unstable",
    }
    (between,) = found.sets
    assert (between.attracting, between.stable) == (False, False)
    assert between.name == "S1|S4 (escaping)"
    assert found[2].type == "pseudo-equilibrium"


def test_rings_of_inhibition_leave_their_thresholds_in_cycles():
    # three genes: the return map expands; two: to first order it is the identity
    level = sp.Rational(4, 5)
    (ring,) = fs.equilibria(fs.Model(network(level - z, level - x, level - y))).sets
    assert ring.attracting is False
    (pair,) = fs.equilibria(fs.Model(network(y - level, level - x)))
    assert (pair.stability, pair.type) == ("undecided", "undecided")
    assert repr(pair).endswith("; undecided)")


def test_a_steep_wilson_cowan_model_loses_stability_where_its_return_map_is_one():
    # Harris and Ermentrout (2015): at (u, v) both gains switch, and motions turn around them
    p, q, b, d = 0.05, 0.3, 2.0, 0.25
    gains = H(x - b * y - p), H(x - d * y - q)
    model = fs.Model({x: -x + gains[0], y: (-y + gains[1]) / tau}, parameters={tau: 0.3})
    diagram = fs.continue_equilibria(model, "tau", over=(0.5, 0.55))
    inner, outer = diagram.bands
    assert (inner.attracting, outer.attracting) == (True, False)
    u, v = np.linalg.solve([[1, -b], [1, -d]], [p, q])

    def growth(tau):
        total = 0.0
        for i, j in ((1, 1), (0, 1), (0, 0), (1, 0)):
            rates = np.array([i - u, (j - v) / tau]) @ np.array([[1, 1], [-b, -d]])
            total += np.log(abs(rates[1] / rates[0])) * (1 if i == j else -1)
        return total

    assert growth(inner.range[1]) * growth(outer.range[0]) < 0
    assert inner.range[1] == pytest.approx(outer.range[0], abs=1e-9)
    run = fs.simulate(model, [u + 1e-3, v], t=(0, 30))
    assert np.abs(run.end[1:] - (u, v)).max() < 1e-12
    run = fs.simulate(model.with_parameters(tau=0.9), [u + 1e-3, v], t=(0, 30))
    assert np.abs(run.end[1:] - (u, v)).max() > 0.1


def test_dry_friction_on_coupled_masses_sticks():
    mass = np.array([[2.0, 1, 0], [1, 3, 1], [0, 1, 1]])
    sides = np.array(np.meshgrid(*[[1, -1]] * 3, indexing="ij")).reshape(3, -1).T
    forces = np.array([0.2, -0.5, 0.9])
    assert attracts((forces - sides * [1, 2, 3]) @ np.linalg.inv(mass)) is True


def test_curves_of_boundary_equilibria_end_where_two_interfaces_meet():
    p, q = sp.symbols("p q")
    gains = H(x - 2 * y - p), H(x - y / 4 - q)
    model = fs.Model({x: -x + gains[0], y: -y + gains[1]}, parameters={p: 0.05, q: 0.3})
    diagram = fs.continue_equilibria(model, "p", over=(-0.9, 1))
    curves = fs.continue_points(diagram, ("p", "q"), over={"p": (-1, 1), "q": (-1, 1)})
    ends = [point for curve in curves for point in curve.special("BB")]
    assert [(end["p"], end["q"]) for end in ends] == [(0.0, 0.0)] * 2
    # a bound of sliding vanishes along the second curve, and is no interface
    assert all("as well" in end.note for end in ends)


def test_a_band_over_a_range_that_begins_where_its_weight_is_infinite():
    # the gain of x has the weight (w - 1)/w at the intersection of both thresholds
    w, half = sp.symbols("w"), sp.Rational(1, 2)
    model = fs.Model({x: w * H(half - y) - x, y: H(x - half) - y}, parameters={w: 1})
    (band,) = fs.continue_equilibria(model, "w", over=(0, 3)).bands
    assert band.range == pytest.approx((0.5, 3.0), abs=1e-8)
    # a range as short as the error of the end is resolved where nothing changes
    (band,) = fs.continue_equilibria(model, "w", over=(2, 2 + 1e-9)).bands
    assert band.range == (2, 2 + 1e-9)


@pytest.mark.parametrize("interfaces", [1, 2, 3])
def test_rates_that_vanish_decide_nothing(interfaces):
    assert attracts(np.zeros((2**interfaces, interfaces))) is None


def test_motions_that_remain_beside_an_intersection_decide_nothing():
    # h1 is constant everywhere, h2 decreases in size
    assert attracts(np.array([[0.0, -1.0], [0.0, 1.0], [0.0, -1.0], [0.0, 1.0]])) is None


def test_a_rotation_may_be_parallel_to_a_half_axis():
    # in one region the motion goes along h1 into the intersection: the return map is zero
    rates = np.array([[-1.0, 0.0], [1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
    assert attracts(rates) is True
