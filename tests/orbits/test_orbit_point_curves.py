"""Curves of special points of orbits in two parameters."""

from dataclasses import replace

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.diagrams.curves.point_curves import Plane
from fastslow.orbits.flow.forcing import forcing_of
from fastslow.orbits.flow.variations import variations_of
from fastslow.orbits.points.contacts import locate_edge, locate_touch, near_touches
from fastslow.orbits.points.kinds import KINDS
from fastslow.orbits.points.location import locate_doubling, locate_fold, locate_torus
from fastslow.orbits.points.point_curves import Start, traced
from tests.orbits.shooting_cases import GEAR_PAIR, linear_response, multipliers, orbit_of, walk

pytestmark = pytest.mark.slow

COARSE = fs.Continuation(step=0.02, max_step=0.08)

x, v, y, t, a, b, c, k, w = sp.symbols("x v y t a b c k w")


def plane_of(**over):
    lower, upper = np.array(list(over.values()), dtype=float).T
    return Plane(tuple(over), lower, upper, COARSE, True, None, ())


def start_of(model, plane, shooting, scale, point, code, **given):
    variations = variations_of(model, plane.names)
    p = shooting.parameters_at(point.u)
    forcing = forcing_of(model, variations, None)
    both = replace(shooting, variations=variations, forcing=forcing, parameters=p)
    u = np.append(point.u[: shooting.size], p[variations.places])
    return Start(KINDS[code], both, u, scale[: variations.n], **given)


class TestGrazing:
    @pytest.mark.sample(1)
    @pytest.mark.parametrize("other", ["omega", "zeta"])
    def test_bilinear_oscillator(self, other):
        model = fs.systems.bilinear_oscillator(f=0.355, zeta=0.05)
        shooting, u, scale = orbit_of(model, "f", [0.97, 0.0], 300)
        touch = min(near_touches(shooting, u), key=lambda one: abs(one.clearance))
        segment, offset, function = touch.segment, touch.offset, touch.function
        contact = locate_touch(shooting, u, scale, segment, offset, function)
        plane = plane_of(
            **{other: (0.01, 0.3) if other == "zeta" else (0.5, 1.5), "f": (0.05, 0.9)}
        )
        own = segment, function, int(shooting.form.modes[segment])
        curve = traced(
            start_of(model, plane, contact.shooting, scale, contact, "GR", contact=own), plane
        )
        p = {name: curve[name] for name in plane.names}
        p = {**model.parameters, **p}
        exact = np.hypot(1 - p["omega"] ** 2, 2 * p["zeta"] * p["omega"])
        np.testing.assert_allclose(p["f"], exact, atol=3e-13)
        assert len(curve) > 10
        assert [outcome.code for outcome in curve.outcomes] == ["end of range"] * 2
        # at the touch x = 1 and v = 0
        np.testing.assert_allclose(curve.state, np.tile([1.0, 0.0], (len(curve), 1)), atol=1e-12)
        # the linear orbit: det M = exp(−2 ζ T)
        decay = -2 * p["zeta"] * 2 * np.pi / p["omega"]
        np.testing.assert_allclose(np.log(np.abs(curve.eigenvalues)).sum(axis=1), decay, rtol=1e-10)


class TestMultipliers:
    def test_folds_of_an_autonomous_model(self):
        """r' = r (a + b r² − r⁴/4), θ' = 1: folds of cycles at a = −b²."""
        R = x**2 + y**2
        radial = a + b * R - R**2 / 4
        model = fs.Model({x: x * radial - y, y: y * radial + x}, parameters={a: -0.99, b: 1})
        start = orbit_of(model, "a", [1.5, 0], 20, period=2 * np.pi)
        shooting, u, scale = walk(*start, [-0.995, -0.999])
        point = locate_fold(shooting, u, scale)
        plane = plane_of(a=(-2, -0.3), b=(0.6, 1.5))
        curve = traced(start_of(model, plane, shooting, scale, point, "LPC"), plane)
        np.testing.assert_allclose(curve["a"], -(curve["b"] ** 2), atol=1e-11)
        assert [curve["b"].min(), curve["b"].max()] == pytest.approx([0.6, np.sqrt(2)], rel=1e-12)
        np.testing.assert_allclose(np.abs(curve.eigenvalues - 1).max(), 0, atol=1e-4)

    @pytest.mark.sample(0)
    def test_doublings_of_a_pendulum(self):
        model = fs.Model({x: v, v: -c * v - sp.sin(x) + a * sp.cos(sp.Rational(2, 3) * t)},
                         parameters={a: 1.05, c: 0.5})  # fmt: skip
        given = walk(*orbit_of(model, "a", [0.1, 0], 200), [1.055, 1.06, 1.063])
        point = locate_doubling(*given)
        plane = plane_of(a=(0.95, 1.2), c=(0.4, 0.65))
        curve = traced(start_of(model, plane, given[0], given[2], point, "PD"), plane)
        assert curve.code == "PD"
        np.testing.assert_allclose(np.abs(curve.eigenvalues + 1).min(axis=1), 0, atol=1e-11)
        # the product of both multipliers is exp(−c T)
        expected = np.exp(-curve["c"] * 3 * np.pi)
        np.testing.assert_allclose(np.prod(curve.eigenvalues, axis=1).real, expected, rtol=1e-10)
        assert [outcome.code for outcome in curve.outcomes] == ["end of range"] * 2

    @pytest.mark.sample(0)
    def test_tori_of_a_forced_van_der_pol_oscillator(self):
        model = fs.Model({x: v, v: c * (1 - x**2) * v - x + a * sp.cos(w * t)},
                         parameters={c: 0.3, a: 2, w: 1.5})  # fmt: skip
        start = orbit_of(model, "a", [1, 0], 150)
        shooting, u, scale = walk(*start, [1.9, 1.82])
        angle = abs(np.angle(multipliers(shooting, u).values[0]))
        point = locate_torus(shooting, u, scale, angle)
        plane = plane_of(w=(1.4, 1.6), a=(1, 3))
        angle = abs(np.angle(point.multiplier))
        curve = traced(start_of(model, plane, shooting, scale, point, "TR", angle=angle), plane)
        np.testing.assert_allclose(np.abs(curve.eigenvalues), 1, atol=1e-11)
        assert [curve["w"].min(), curve["w"].max()] == pytest.approx([1.4, 1.6], abs=1e-12)

    @pytest.mark.sample(0)
    def test_folds_of_the_gear_pair_end_where_the_orbit_grazes(self):
        given = orbit_of(GEAR_PAIR.with_parameters(w=0.827), "w", linear_response(0.827), 200)
        shooting, u, scale = walk(*given, [0.8275, 0.828, 0.8282])
        point = locate_fold(shooting, u, scale)
        plane = plane_of(w=(0.7, 0.95), a=(0.01, 0.1))
        curve = traced(start_of(GEAR_PAIR, plane, shooting, scale, point, "LPC"), plane)
        assert np.abs(curve["w"] - 0.8284639843882).min() < 1e-12
        np.testing.assert_allclose(np.abs(curve.eigenvalues - 1).min(axis=1), 0, atol=1e-6)
        # x → −x and scaling of lengths do not act here: another curve for every a
        assert np.ptp(curve["a"]) > 0.02
        assert all(outcome.success for outcome in curve.outcomes)


class TestSliding:
    def test_crossing_sliding_of_dry_friction(self):
        """Den Hartog (1931): motion without stops up to k = a V r² / √(1 + U² r⁴)."""

        def exact(r):
            U = np.sin(np.pi / r) / (r * (1 + np.cos(np.pi / r)))
            return r**2 / np.abs(1 - r**2) / np.hypot(1, U * r**2)

        model = fs.Model({x: v, v: -x - k * sp.sign(v) + a * sp.cos(w * t)},
                         parameters={k: 0.8 * exact(0.9), a: 1, w: 0.9})  # fmt: skip
        given = orbit_of(model, "k", [1.0, 0.0], 300)
        shooting, u, scale = walk(*given, exact(0.9) * np.linspace(0.82, 0.96, 8))
        contact = locate_edge(shooting, u, scale, 0, int(shooting.form.modes[1]))
        plane = plane_of(w=(0.7, 0.98), k=(0.1, 1))
        start = start_of(
            model, plane, contact.shooting, scale, contact, "CS", contact=contact.place
        )
        curve = traced(start, plane)
        assert np.ptp(curve["w"]) > 0.2
        np.testing.assert_allclose(curve["k"], exact(curve["w"]), rtol=1e-11)

    def test_adding_sliding(self):
        """x slides on x = y while |y'| < 2; an extremum of y' reaches 2."""
        model = fs.Model({x: -2 * sp.sign(x - y), y: -y + a * sp.cos(t) + b * sp.cos(2 * t)},
                         parameters={a: 2.9, b: 0.5})  # fmt: skip
        branch = fs.continue_orbits(
            fs.find_orbit(model, [0, 0]), "a", over=(2.8, 3), continuation=COARSE
        )
        over = {"a": (2.5, 3), "b": (0.2, 0.8)}
        curve = fs.continue_points(branch.special("AS")[0], ("a", "b"), over, continuation=COARSE)
        s = np.linspace(0, 2 * np.pi, 4001)
        for A, B in zip(curve["a"], curve["b"], strict=True):
            first = A / np.sqrt(2) * np.sin(s - np.pi / 4)
            rate = -first - 2 * B / np.sqrt(5) * np.sin(2 * s - np.arctan(2))
            assert min(abs(rate.max() - 2), abs(rate.min() + 2)) < 1e-5
        assert [outcome.code for outcome in curve.outcomes] == ["end of range"] * 2

    def test_switching_sliding_scales_with_the_velocity(self):
        slip = (v - b) / c
        friction = sp.sign(slip) * 0.3 * c / (1 + 3 * sp.Abs(slip))
        model = fs.Model({x: v, v: -x - v / 20 - friction}, parameters={b: 0.5, c: 1})
        branch = fs.continue_orbits(
            fs.find_orbit(model, [0.5, 0]), "b", over=(0.48, 0.54), continuation=COARSE
        )
        point = branch.special("SS")[0]
        curve = fs.continue_points(
            point, ("b", "c"), {"b": (0.3, 0.8), "c": (0.6, 1.4)}, continuation=COARSE
        )
        np.testing.assert_allclose(curve["b"] / curve["c"], point["b"], rtol=1e-12)


class TestBranchPoints:
    def test_of_a_symmetric_model(self):
        """x' = (a + k cos² t) x − x³: the orbit x = 0 has the multiplier 1 at a = −k/2."""
        rates = {x: (a + k * sp.cos(t) ** 2) * x - x**3, y: sp.cos(t) - y}
        model = fs.Model(rates, parameters={a: -0.5, k: 0.5})
        branch = fs.continue_orbits(
            fs.find_orbit(model, [0, 0.5]), "a", over=(-0.5, 0), continuation=COARSE
        )
        point, over = branch.special("BPC")[0], {"a": (-0.6, 0.1), "k": (-0.1, 1)}
        for plane in (("a", "k"), ("k", "a")):
            curve = fs.continue_points(point, plane, over, continuation=COARSE)
            np.testing.assert_allclose(curve["a"], -curve["k"] / 2, atol=1e-14)
            assert np.ptp(curve["a"]) == pytest.approx(0.55)

    def test_without_a_symmetry(self):
        model = fs.Model({x: x * (a - x) + k, y: sp.cos(t) - y}, parameters={a: -0.5, k: 0})
        branch = fs.continue_orbits(
            fs.find_orbit(model, [0, 0.5]), "a", over=(-0.5, 0.1), continuation=COARSE
        )
        point, over = branch.special("BPC")[0], {"a": (-1, 1), "k": (-1, 2)}
        curve = fs.continue_points(point, ("a", "k"), over, continuation=COARSE)
        assert {outcome.code for outcome in curve.outcomes} == {"no branch point"}
        with pytest.raises(fs.ArgumentError, match="not on a curve of BPC points over k and a"):
            fs.continue_points(point, ("k", "a"), over)


def test_closed_curve():
    """A Möbius band whose multiplier is −1 on a circle of parameters."""
    rate = a**2 + k**2 - sp.Rational(1, 4)
    half = (rate + 1) / 2
    rates = {
        x: (half - 1) * x + half * (x * sp.cos(t) + v * sp.sin(t)) - v / 2,
        v: (half - 1) * v + half * (x * sp.sin(t) - v * sp.cos(t)) + x / 2,
    }
    model = fs.Model(rates, parameters={a: 0.3, k: 0})
    branch = fs.continue_orbits(
        fs.find_orbit(model, [0, 0]), "a", over=(0.3, 0.6), continuation=COARSE
    )
    over = {"a": (-3, 3), "k": (-3, 3)}
    curve = fs.continue_points(branch.special("PD")[0], ("a", "k"), over, continuation=COARSE)
    np.testing.assert_allclose(np.hypot(curve["a"], curve["k"]), 0.5, rtol=1e-12)
    assert curve.closed
    # the map is linear: all coefficients are rounding errors
    assert len(curve.special) == 0
    assert {outcome.code for outcome in curve.outcomes} == {"closed loop"}
    turns = np.unwrap(np.arctan2(curve["k"], curve["a"]))
    assert abs(turns[-1] - turns[0]) == pytest.approx(2 * np.pi)


@pytest.fixture(scope="module")
def branch():
    orbit = fs.find_orbit(GEAR_PAIR, [1.1, 0.0])
    return fs.continue_orbits(orbit, "w", over=(0.78, 0.84), continuation=COARSE)


class TestContinuePoints:
    """`fs.continue_points` from the special points of a branch of orbits."""

    def test_grazing(self, branch):
        over = {"w": (0.6, 0.95), "a": (0.02, 0.1)}
        curve = fs.continue_points(branch.special("GR")[0], ("w", "a"), over, continuation=COARSE)
        W = curve["w"]
        exact = 0.1 * np.hypot(1 - W**2, 0.1 * W) / W**2
        np.testing.assert_allclose(curve["a"], exact, rtol=1e-12)
        assert (curve.code, curve.region) == ("GR", "S1")
        assert curve.parameters == {"z": 0.05, "k": 0.1}

    def test_folds(self, branch):
        over = {"w": (0.8, 0.85), "a": (0.04, 0.06)}
        curve = fs.continue_points(branch.special("LPC")[0], ("a", "w"), over, continuation=COARSE)
        assert curve.parameter_names == ("a", "w")
        assert np.abs(curve["w"] - 0.8284639843882).min() < 1e-12
        np.testing.assert_allclose(np.abs(curve.eigenvalues - 1).min(axis=1), 0, atol=1e-6)

    def test_wrong_arguments(self, branch):
        point = branch.special("GR")[0]
        over = {"w": (0.6, 0.95), "a": (0.02, 0.1)}
        with pytest.raises(fs.ArgumentError, match="outside over"):
            fs.continue_points(point, ("w", "a"), {"w": (0.9, 0.95), "a": (0.02, 0.1)})
        with pytest.raises(fs.ArgumentError, match="the branch's parameter w among them"):
            fs.continue_points(point, ("z", "a"), {"z": (0.01, 0.1), "a": (0.02, 0.1)})
        with pytest.raises(fs.UnknownNameError, match="unknown parameter 'b'"):
            fs.continue_points(point, ("w", "b"), {"w": (0.6, 0.95), "b": (0, 1)})
        with pytest.raises(fs.UnknownNameError, match="curve from GR"):
            fs.continue_points(point, ("w", "a"), over, code="LPC")
        with pytest.raises(fs.ArgumentError, match="outside the range"):
            fs.continue_points(point, ("w", "a"), over, marks={"w": [0.97]})
        with pytest.raises(fs.ArgumentError, match="window= is for equilibria"):
            fs.continue_points(point, ("w", "a"), over, window={"x": (-1, 1)})
        with pytest.raises(fs.ArgumentError, match="no model"):
            fs.continue_points(replace(point, source=None), ("w", "a"), over)
        with pytest.raises(fs.ArgumentError, match="cannot be continued"):
            fs.continue_points(replace(point, code="UZ"), ("w", "a"), over)
