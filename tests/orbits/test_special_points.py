"""Special points of orbits against closed forms, published values and their own multipliers."""

from itertools import pairwise

import numpy as np
import pytest
import sympy as sp
from scipy.optimize import brentq, minimize_scalar

import fastslow as fs
from fastslow.orbits.points.contacts import locate_edge, locate_touch, near_touches
from fastslow.orbits.points.detection import (
    corrected,
    kinds_between,
    located_between,
    tangent_point,
)
from fastslow.orbits.points.kinds import DOUBLING, PAIR
from fastslow.orbits.points.location import (
    is_branch_point,
    locate_branch_point,
    locate_doubling,
    locate_fold,
    locate_torus,
)
from fastslow.orbits.points.multiplier_signs import MultiplierSigns
from tests.orbits.shooting_cases import (
    GEAR_PAIR,
    linear_response,
    multipliers,
    orbit_of,
    precise,
    walk,
)

pytestmark = pytest.mark.slow


def codes_of(one, two):
    return tuple(kind.code for kind in kinds_between(one, two))


x, v, y, t, a, b, c, k, w, z = sp.symbols("x v y t a b c k w z")


class TestFolds:
    def test_gear_pair_beyond_grazing(self):
        start = orbit_of(GEAR_PAIR.with_parameters(w=0.827), "w", linear_response(0.827), 200)
        shooting, u, scale = walk(*start, [0.8275, 0.828, 0.8282])
        point = locate_fold(shooting, u, scale)
        assert precise(point)
        assert point.u[-1] == pytest.approx(0.8284639844, abs=5e-11)
        found = multipliers(shooting, point.u)
        np.testing.assert_allclose(found.values[0], 1, atol=1e-9)
        assert not is_branch_point(shooting, point, scale)

    def test_gear_pair_with_impacts(self):
        start = orbit_of(GEAR_PAIR.with_parameters(w=0.72), "w", [-2, 1], 100)
        shooting, u, scale = walk(*start, np.arange(0.72, 0.7084, -0.0005))
        point = locate_fold(shooting, u, scale)
        assert precise(point)
        assert point.u[-1] == pytest.approx(0.7080316187, abs=5e-11)

    def test_from_both_sides_the_same(self):
        duffing = fs.Model(
            {x: v, v: -c * v + x - x**3 + a * sp.cos(t)}, parameters={c: 0.25, a: 0.24}
        )
        start = orbit_of(duffing, "a", [1, 0], 50)
        near = [walk(*start, np.linspace(0.24, last, 8)) for last in (0.262, 0.264)]
        points = [locate_fold(*one) for one in near]
        assert all(map(precise, points))
        assert points[0].u[-1] == pytest.approx(points[1].u[-1], rel=1e-13)
        for (shooting, _, _), point in zip(near, points, strict=True):
            assert multipliers(shooting, point.u).values[0] == pytest.approx(1, abs=1e-9)

    def test_of_a_van_der_pol_like_cycle(self):
        """r' = r (a + r² − r⁴/4), θ' = 1: cycles at r² = 2 ± 2 sqrt(1 + a), fold at a = −1."""
        R = x**2 + y**2
        radial = a + R - R**2 / 4
        model = fs.Model({x: x * radial - y, y: y * radial + x}, parameters={a: -0.9})
        start = orbit_of(model, "a", [1.7, 0], 20, period=2 * np.pi)
        shooting, u, scale = walk(*start, [-0.95, -0.98, -0.99, -0.995, -0.998, -0.999])
        point = locate_fold(shooting, u, scale)
        assert precise(point)
        assert point.u[-1] == pytest.approx(-1, abs=1e-13)
        form, period = shooting.unpack(point.u)
        assert np.hypot(*form.states[0]) == pytest.approx(np.sqrt(2), rel=1e-12)
        assert period == pytest.approx(2 * np.pi, rel=1e-12)


class TestDoublings:
    def test_roessler(self):
        model = fs.Model({x: -v - y, v: x + v / 5, y: sp.Rational(1, 5) + y * (x - c)},
                         parameters={c: 2.6})  # fmt: skip
        transient = fs.simulate(model, [1, 1, 0], t=(0, 500))
        given = orbit_of(model, "c", list(transient(500.0)), 50, period=5.755597)
        point = locate_doubling(*given)
        assert precise(point)
        # AUTO-07p and others: 2.832445
        assert point.u[-1] == pytest.approx(2.832445, abs=5e-7)
        assert np.abs(multipliers(given[0], point.u).values + 1).min() < 1e-11

    def test_pendulum(self):
        model = fs.Model({x: v, v: -v / 2 - sp.sin(x) + a * sp.cos(sp.Rational(2, 3) * t)},
                         parameters={a: 1.05})  # fmt: skip
        given = walk(*orbit_of(model, "a", [0.1, 0], 200), [1.055, 1.06, 1.063])
        point = locate_doubling(*given)
        assert precise(point)
        values = multipliers(given[0], point.u).values
        # det M = exp(−T/2) with T = 3π
        np.testing.assert_allclose(values, [-1, -np.exp(-1.5 * np.pi)], atol=1e-11)
        # the vector is an eigenvector
        n, last = 2, given[0].linearised(point.u)
        carried = last.flows.slopes[0, :, :n] @ point.vector[:n].real
        np.testing.assert_allclose(carried, -point.vector[:n].real, atol=1e-10)


class TestTorus:
    @pytest.mark.parametrize("amplitude", [2.0, 1.5])
    def test_forced_van_der_pol(self, amplitude):
        model = fs.Model({x: v, v: c * (1 - x**2) * v - x + a * sp.cos(w * t)},
                         parameters={c: 0.3, a: 2, w: 1.5})  # fmt: skip
        start = orbit_of(model, "a", [1, 0], 150)
        shooting, u, scale = walk(*start, np.linspace(2.0, amplitude, 6))
        angle = abs(np.angle(multipliers(shooting, u).values[0]))
        point = locate_torus(shooting, u, scale, angle)
        assert precise(point)
        assert point.u[-1] == pytest.approx(1.79970467466729, rel=1e-12)
        found = multipliers(shooting, point.u)
        np.testing.assert_allclose(np.abs(found.values), 1, atol=1e-12)
        assert point.multiplier == pytest.approx(found.values[0], abs=1e-12)


class TestBranchPoints:
    def test_symmetry_breaking_of_a_pendulum(self):
        model = fs.Model({x: v, v: -v / 2 - sp.sin(x) + a * sp.cos(sp.Rational(2, 3) * t)},
                         parameters={a: 0.8})  # fmt: skip
        start = orbit_of(model, "a", [0.1, 0], 100)
        shooting, u, scale = walk(*start, np.arange(0.8, 1.001, 0.01))
        point = locate_branch_point(shooting, u, scale)
        assert precise(point)
        assert is_branch_point(shooting, point, scale)
        values = multipliers(shooting, point.u).values
        np.testing.assert_allclose(values, [1, np.exp(-1.5 * np.pi)], atol=1e-11)
        # the orbit is still symmetric: x(t + T/2) = −x(t)
        form, period = shooting.unpack(point.u)
        at = model.with_parameters(a=point.u[-1])
        fine = fs.Integration(rtol=1e-13)
        half = (form.start, form.start + period / 2)
        run = fs.simulate(at, form.states[0], t=half, integration=fine)
        np.testing.assert_allclose(run(half[1]), -form.states[0], atol=1e-9)


class TestGrazing:
    @pytest.mark.parametrize("chosen", ["f", "omega", "zeta"])
    def test_bilinear_oscillator(self, chosen):
        """The linear orbit touches x = 1 at f = √((1 − ω²)² + (2ζω)²)."""
        start = {"f": 0.3605, "zeta": 0.015} if chosen == "zeta" else {"f": 0.355}
        model = fs.systems.bilinear_oscillator(**start)
        given = orbit_of(model, chosen, [0.97, 0.0], 1500)
        contact = self.touch(*given)
        p = {**model.parameters, chosen: contact.u[-1]}
        exact = np.hypot(1 - p["omega"] ** 2, 2 * p["zeta"] * p["omega"])
        assert precise(contact)
        assert p["f"] == pytest.approx(exact, rel=1e-13)
        assert (contact.code, contact.exponent) == ("GR", 1.5)
        # x'' = −ω² x at the maximum
        assert contact.curvature == pytest.approx(-(p["omega"] ** 2), rel=1e-12)
        np.testing.assert_allclose(contact.state, [1, 0], atol=1e-13)

    @pytest.mark.parametrize(
        ("start", "expected"), [(0.81, 0.8206310877120871), (1.45, 1.4070884660225909)]
    )
    def test_gear_pair_loses_contact(self, start, expected):
        model = GEAR_PAIR.with_parameters(w=start)
        given = orbit_of(model, "w", linear_response(start), 100)
        contact = self.touch(*given)
        W = contact.u[-1]
        assert precise(contact)
        assert pytest.approx(expected, rel=1e-13) == W
        assert pytest.approx(0.1 * np.hypot(1 - W**2, 0.1 * W), rel=1e-13) == 0.05 * W**2
        assert contact.exponent == 1.5
        assert contact.curvature > 0

    def test_a_stop_without_a_spring_gives_a_square_root(self):
        # the acceleration jumps at a position: n·f⁺ = n·f⁻
        model = fs.Model({x: v, v: -x - v / 10 - k * sp.Heaviside(x - 1) + a * sp.cos(w * t)},
                         parameters={k: 2, a: 0.3, w: 0.8})  # fmt: skip
        given = orbit_of(model, "a", [0.5, 0.0], 60)
        contact = self.touch(*given)
        assert precise(contact)
        assert contact.u[-1] == pytest.approx(np.hypot(1 - 0.64, 0.08), rel=1e-13)
        assert (contact.code, contact.exponent) == ("GR", 0.5)

    def test_a_belt_gives_grazing_sliding(self):
        """The mass slips behind the belt until its velocity reaches that of the belt."""
        friction = sp.Piecewise((-k, v > b), (k, True))
        model = fs.Model({x: v, v: -x - c * v + friction + a * sp.cos(w * t)},
                         parameters={k: 2, a: 0.2, w: 0.8, c: 0.1, b: 0.5})  # fmt: skip
        given = orbit_of(model, "a", [2.0, 0.0], 60)
        contact = self.touch(*given)
        assert precise(contact)
        assert contact.u[-1] == pytest.approx(0.5 * np.hypot(1 - 0.64, 0.08) / 0.8, rel=1e-13)
        assert (contact.code, contact.exponent) == ("GS", 1.0)

    @staticmethod
    def touch(shooting, u, scale):
        touch = min(near_touches(shooting, u), key=lambda one: abs(one.clearance))
        assert 0 < touch.clearance < 0.2
        return locate_touch(shooting, u, scale, touch.segment, touch.offset, touch.function)


class TestSliding:
    def test_a_sliding_phase_is_interrupted(self):
        """x slides on x = y while |y'| < 2; the second maximum of |y'| reaches 2."""
        model = fs.Model({x: -2 * sp.sign(x - y), y: -y + a * sp.cos(t) + b * sp.cos(2 * t)},
                         parameters={a: 2.5, b: 0.5})  # fmt: skip

        def rate(s, amplitude):
            first = -amplitude / np.sqrt(2) * np.sin(s - np.pi / 4)
            return first - 2 * 0.5 / np.sqrt(5) * np.sin(2 * s - np.arctan(2))

        def extreme(amplitude, sign):
            grid = np.linspace(0, 2 * np.pi, 2000)
            near = grid[np.argmin(sign * rate(grid, amplitude))]
            bounds = near - 0.01, near + 0.01
            best = minimize_scalar(lambda s: sign * rate(s, amplitude), bounds=bounds,
                                   method="bounded", options={"xatol": 1e-12})  # fmt: skip
            return -best.fun, best.x

        # the smaller of the two extremes
        sign = min((1, -1), key=lambda s: extreme(2.5, s)[0])
        exact = brentq(lambda amplitude: extreme(amplitude, sign)[0] - 2, 2.0, 5.0, xtol=1e-14)
        model = model.with_parameters(a=exact - 0.05)
        shooting, u, scale = orbit_of(model, "a", [0.0, 0.0], 20)
        count, (form, _) = len(shooting.variations.continuous), shooting.unpack(u)
        bounds = [found for found in near_touches(shooting, u) if found.function >= count]
        touch = min(bounds, key=lambda one: abs(one.clearance))
        assert (shooting.variations.signs[form.modes[touch.segment]] == 0).any()
        contact = locate_touch(shooting, u, scale, touch.segment, touch.offset, touch.function)
        assert precise(contact)
        assert contact.u[-1] == pytest.approx(exact, rel=1e-10)
        assert contact.code == "AS"

    def test_the_boundary_of_stops_with_dry_friction(self):
        """Den Hartog (1931): motion without stops up to k = a V r² / √(1 + U² r⁴)."""
        r, amplitude = 0.9, 1.0
        model = fs.Model({x: v, v: -x - k * sp.sign(v) + a * sp.cos(w * t)},
                         parameters={k: 0.4, a: amplitude, w: r})  # fmt: skip
        V, U = 1 / (1 - r**2), np.sin(np.pi / r) / (r * (1 + np.cos(np.pi / r)))
        exact = amplitude * V * r**2 / np.hypot(1, U * r**2)
        given = orbit_of(model.with_parameters(k=0.8 * exact), "k", [1.0, 0.0], 300)
        shooting, u, scale = walk(*given, exact * np.linspace(0.82, 0.96, 8))
        form, _ = shooting.unpack(u)
        assert len(form) == 3
        contact = locate_edge(shooting, u, scale, 0, int(form.modes[1]))
        assert precise(contact)
        assert contact.u[-1] == pytest.approx(exact, rel=1e-12)
        assert (contact.code, contact.exponent) == ("CS", 2.0)


class TestDetection:
    """Points between two orbits of a branch, far from both."""

    PENDULUM = fs.Model({x: v, v: -v / 2 - sp.sin(x) + a * sp.cos(sp.Rational(2, 3) * t)},
                        parameters={a: 0.9})  # fmt: skip

    @pytest.mark.parametrize(
        ("one", "two", "codes"),
        [
            ([2, 0.5, -0.9], [2, 0.5, -1.1], ("PD",)),
            ([0.9, -0.9, 0.1], [1.1, -1.1, 0.1], ("BPC", "PD")),
            ([2, 0.6j, -0.6j], [2, 1.2j, -1.2j], ("TR",)),
            # a pair that is outside the circle meets on the real axis
            ([0.1, 1.2 + 0.1j, 1.2 - 0.1j], [0.1, 1.1, 1.4], ()),
        ],
    )
    def test_codes_of_given_multipliers(self, one, two, codes):
        values = [np.array(given, dtype=complex) for given in (one, two)]
        signs = [MultiplierSigns(1.0, given, np.log(np.abs(given))) for given in values]
        assert codes_of(*signs) == codes
        turned = signs[1]._replace(slope=-1.0)
        assert ("LPC" in codes_of(signs[0], turned)) == ("BPC" in codes)

    @pytest.mark.parametrize(("slope", "turn", "fold"), [(0.1, "BPC", "BPC"), (2e-16, "", "LPC")])
    def test_in_a_canard_explosion_the_direction_of_the_parameter_is_rounding(
        self, slope, turn, fold
    ):
        below, above = ([np.array([m + 0j])] * 2 for m in (0.5, 2.0))
        one, same, crossed = (
            MultiplierSigns(sign * slope, given, np.log(np.abs(given)))
            for sign, (given, _) in ((1, below), (-1, below), (1, above))
        )
        assert codes_of(one, same) == ((turn,) if turn else ())
        assert codes_of(one, crossed) == (fold,)
        assert codes_of(one, crossed._replace(slope=-slope)) == ("LPC",)

    @staticmethod
    def along(shooting, u, scale, step, count):
        """Rows by arclength, each in the plane through its prediction."""
        rows = [tangent_point(shooting, u, scale)]
        while len(rows) <= count:
            last = rows[-1]
            guess = last.u + step * last.tangent * scale
            following = corrected(shooting, guess, last.tangent, scale)
            assert following is not None
            rows.append(tangent_point(shooting, following, scale, last.tangent))
        return rows

    def found(self, given, step, count):
        shooting, _, scale = given
        rows = self.along(*given, step, count)
        points = []
        for pair in pairwise(rows):
            for kind in kinds_between(*(row.signs for row in pair)):
                point = located_between(shooting, kind, *pair, scale)
                assert precise(point)
                points.append((kind.code, point.u[-1]))
        return points

    def test_symmetry_breaking_and_nothing_else(self):
        start = orbit_of(self.PENDULUM, "a", [0.1, 0], 100)
        found = self.found(start, 0.05, 12)
        assert [code for code, _ in found] == ["BPC"]
        assert found[0][1] == pytest.approx(1.0043194774264, rel=1e-12)

    def test_a_period_doubling(self):
        model = self.PENDULUM.with_parameters(a=1.03)
        found = self.found(orbit_of(model, "a", [0.1, 0], 200), 0.03, 6)
        assert [code for code, _ in found] == ["PD"]
        assert found[0][1] == pytest.approx(1.0663728624552, rel=1e-12)

    def test_folds_of_an_autonomous_model(self):
        R = x**2 + y**2
        radial = a + R - R**2 / 4
        model = fs.Model({x: x * radial - y, y: y * radial + x}, parameters={a: -0.99})
        shooting, u, scale = orbit_of(model, "a", [1.5, 0], 20, period=2 * np.pi)
        rows = [tangent_point(shooting, u, scale)]
        rows[0] = tangent_point(shooting, u, scale, -rows[0].tangent)
        found = []
        for _ in range(20):
            last = rows[-1]
            guess = last.u + 0.01 * last.tangent * scale
            following = corrected(shooting, guess, last.tangent, scale)
            rows.append(tangent_point(shooting, following, scale, last.tangent))
            for kind in kinds_between(last.signs, rows[-1].signs):
                point = located_between(shooting, kind, last, rows[-1], scale)
                assert precise(point)
                found.append((kind.code, point.u[-1]))
        assert [code for code, _ in found] == ["LPC"]
        assert found[0][1] == pytest.approx(-1, abs=1e-13)
        # beyond the fold the other multiplier is outside the unit circle
        assert [rows[0].signs.outside, rows[-1].signs.outside] == [0, 1]

    def test_a_torus_bifurcation(self):
        model = fs.Model({x: v, v: c * (1 - x**2) * v - x + a * sp.cos(w * t)},
                         parameters={c: 0.3, a: 2.3, w: 1.5})  # fmt: skip
        shooting, u, scale = orbit_of(model, "a", [1, 0], 150)
        rows = [tangent_point(shooting, u, scale)]
        rows[0] = tangent_point(shooting, u, scale, -rows[0].tangent)
        guess = rows[0].u + 0.35 * rows[0].tangent * scale
        following = corrected(shooting, guess, rows[0].tangent, scale)
        pair = rows[0], tangent_point(shooting, following, scale, rows[0].tangent)
        assert kinds_between(*(row.signs for row in pair)) == (PAIR,)
        point = located_between(shooting, PAIR, *pair, scale)
        assert precise(point)
        assert point.u[-1] == pytest.approx(1.79970467466729, rel=1e-12)

    def test_what_is_not_between_does_not_converge(self):
        start = orbit_of(self.PENDULUM, "a", [0.1, 0], 100)
        rows = self.along(*start, 0.02, 1)
        point = located_between(start[0], DOUBLING, *rows, start[2])
        assert not point.converged


def test_the_nearest_approach_to_an_interface_under_a_forcing_in_closed_form():
    """Without contact, x'' + x'/5 + x = cos(2t + 1) has the amplitude 1/|1 - 4 + 2i/5|."""
    stop = k * sp.Max(0, x - 5)
    model = fs.Model({x: v, v: sp.cos(2 * t + 1) - x - v / 5 - stop}, parameters={k: 1})
    shooting, u, _ = orbit_of(model, "k", [0, 0], 20)
    (touch,) = near_touches(shooting, u)
    response = 1 / (1 - 4 + 0.4j)
    assert touch.distance == pytest.approx(5 - abs(response), rel=1e-12)
    # cos(2t + 1 + arg) = 1
    time = (-1 - np.angle(response)) / 2
    passed = shooting.unpack(u)[0].times[0] + touch.offset - time
    assert np.sin(passed) == pytest.approx(0, abs=1e-5)
