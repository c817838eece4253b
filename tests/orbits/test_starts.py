"""Orbits that emanate from special points, against simulations and closed forms."""

from dataclasses import replace

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.orbits.find import starts
from tests.orbits.models import t, v, x

pytestmark = pytest.mark.slow

COARSE = fs.Continuation(max_step=0.1)
GEAR = fs.systems.harmonic_gear(A=41.67, B=2.372, C=3.546, D=0.25)


@pytest.fixture(scope="module")
def doublings():
    orbit = fs.find_orbit(GEAR.with_parameters(omega=7.5), [0, 0])
    branch = fs.continue_orbits(orbit, "omega", over=(4.428, 7.5), continuation=COARSE)
    return {round(point["omega"], 5): point for point in branch.special("PD")}


class TestDoublings:
    @pytest.mark.parametrize("omega", [7.12701, 4.43024])
    def test_orbit_of_twice_the_period(self, doublings, omega):
        point = doublings[omega]
        orbit = fs.find_orbit(GEAR, point)
        assert orbit.outcome
        assert orbit.multiple == 2
        assert orbit.period == pytest.approx(4 * np.pi / orbit.parameters["omega"], rel=1e-14)
        assert 0 < abs(orbit.parameters["omega"] - point["omega"]) < 0.01
        # different from the simple one at half its period, and closed
        begin, half = orbit.t0, 0.5 * orbit.period
        assert np.abs(orbit(begin + half) - orbit(begin)).max() > 1e-6
        run = fs.simulate(orbit.model, orbit(begin), t=(begin, begin + 2 * half))
        assert np.abs(run.end[1:] - orbit(begin)).max() < 1e-7
        # the multiplier −1 of the point becomes 1
        assert np.abs(orbit.multipliers - 1).min() < 0.02

    def test_branch_against_a_settled_simulation(self, doublings):
        orbit = fs.find_orbit(GEAR, doublings[7.12701])
        assert orbit.parameters["omega"] < 7.12700759
        assert orbit.stability == "stable"
        branch = fs.continue_orbits(orbit, "omega", over=(6.98, 7.126), continuation=COARSE)
        (found,) = branch.at(omega=7.0, stable=True)[:1]
        period = 4 * np.pi / 7.0
        settled = fs.simulate(GEAR.with_parameters(omega=7.0), [0, 0], t=(0, 400 * period))
        end = settled.end[1:]
        beginnings = [found(0.0), found(period / 2)]
        assert min(np.abs(end - z).max() for z in beginnings) < 1e-8
        assert np.abs(beginnings[0] - beginnings[1]).max() > 1e-2

    def test_branch_ends_at_both_doublings(self, doublings):
        few = fs.Continuation(max_step=0.2)
        orbit = fs.find_orbit(GEAR, doublings[4.43024])
        branch = fs.continue_orbits(orbit, "omega", over=(4, 8), continuation=few)
        assert branch.outcome.code == "period doubling"
        assert [outcome.code for outcome in branch.outcomes] == ["period doubling"] * 2
        ends = branch.special[0], branch.special[-1]
        for end, omega in zip(
            sorted(ends, key=lambda p: p["omega"]), (4.43024, 7.12701), strict=True
        ):
            assert end.code == "PD"
            assert end.converged
            assert end.orbit.multiple == 1
            assert end["omega"] == pytest.approx(doublings[omega]["omega"], rel=1e-12)
            assert np.abs(end.multipliers + 1).min() < 1e-9
        # each orbit once: no start is the state half a period after another one
        stable = branch.stable
        starts = np.array([o(0.0) for o in branch])[stable]
        halves = np.array([o(0.5 * o.period) for o in branch])[stable]
        near = np.abs(branch.values[stable][:, None] - branch.values[stable]) < 1e-9
        apart = np.abs(starts[:, None] - halves).max(axis=2)
        assert apart[near].min() > 1e-9
        # the simple branch is found again from its end
        again = fs.find_orbit(GEAR, ends[0])
        assert again.multiple == 2

    def test_autonomous_model(self):
        a, b, c, y, z = sp.symbols("a b c y z")
        model = fs.Model(
            {x: -y - z, y: x + a * y, z: b + z * (x - c)}, parameters={a: 0.2, b: 0.2, c: 2.6}
        )
        simple = fs.find_orbit(model, [1, 1, 0])
        branch = fs.continue_orbits(simple, "c", over=(2.5, 3), continuation=COARSE)
        point = branch["PD1"]
        orbit = fs.find_orbit(model, point)
        assert orbit.outcome
        assert orbit.stability == "stable"
        assert orbit.parameters["c"] > point["c"]
        assert orbit.period == pytest.approx(2 * point.orbit.period, rel=1e-3)
        traced = fs.continue_orbits(orbit, "c", over=(2.8, 3), continuation=COARSE)
        assert {outcome.code for outcome in traced.outcomes} == {"period doubling", "end of range"}
        assert traced.range == pytest.approx((point["c"], 3), rel=1e-12)
        beyond = traced.at(c=3.0)[0]
        # two maxima of x, different from each other
        times = np.linspace(0, beyond.period, 4001)
        run = beyond(times)[0]
        top = np.flatnonzero((run[1:-1] > run[:-2]) & (run[1:-1] > run[2:])) + 1
        assert len(top) == 2
        assert abs(run[top[0]] - run[top[1]]) > 0.1

    def test_wrong_arguments(self, doublings):
        point = doublings[7.12701]
        with pytest.raises(fs.ArgumentError, match="cannot be given"):
            fs.find_orbit(GEAR, point, multiple=2)
        other = fs.Model({x: v, v: sp.sin(t) - x - v})
        with pytest.raises(fs.ArgumentError, match="a point of a model with the states"):
            fs.find_orbit(other, point)


class TestBranchPoints:
    def test_a_point_without_its_equations_is_named(self, monkeypatch):
        a = sp.Symbol("a")
        rate = -v / 2 - sp.sin(x) + a * sp.cos(sp.Rational(2, 3) * t)
        model = fs.Model({x: v, v: rate}, parameters={a: 0.98})
        symmetric = fs.continue_orbits(
            fs.find_orbit(model, [0.1, 0]), "a", over=(0.98, 1.03), continuation=COARSE
        )
        point = symmetric.special("BPC")[0]
        monkeypatch.setattr(starts, "_beside", lambda *_: None)
        assert "read from a file" not in fs.find_orbit(model, point).outcome.message
        loaded = replace(point, source=None)
        assert "has no tangent of its branch" in fs.find_orbit(model, loaded).outcome.message

    def test_symmetry_breaking_of_a_pendulum(self):
        a = sp.Symbol("a")
        rate = -v / 2 - sp.sin(x) + a * sp.cos(sp.Rational(2, 3) * t)
        model = fs.Model({x: v, v: rate}, parameters={a: 0.8})
        symmetric = fs.continue_orbits(
            fs.find_orbit(model, [0.1, 0]), "a", over=(0.8, 1.05), continuation=COARSE
        )
        point = symmetric.special("BPC")[0]
        orbit = fs.find_orbit(model, point)
        assert orbit.outcome
        assert orbit.stability == "stable"
        assert 0 < orbit.parameters["a"] - point.parameters["a"] < 1e-2
        # x(t + T/2) = −x(t) on the symmetric branch alone
        half = 0.5 * orbit.period
        assert np.abs(point.orbit(half) + point.orbit(0.0)).max() < 1e-8
        assert np.abs(orbit(half) + orbit(0.0)).max() > 1e-3
        branch = fs.continue_orbits(orbit, "a", over=(0.9, 1.05), continuation=COARSE)
        # a pitchfork: the branch does not exist below the point
        assert [p.code for p in branch.special] == ["BPC"]
        assert branch["a"].min() == pytest.approx(point.parameters["a"], abs=1e-9)
        at = branch.at(a=1.02, stable=True)
        # settled from the orbit beside the point
        run = fs.simulate(model.with_parameters(a=1.02), orbit(0.0), t=(0, 400 * half))
        settled = run.end[1:]
        images = [*(orbit(0.0) for orbit in at), *(-orbit(half) for orbit in at)]
        assert min(np.abs(settled - z).max() for z in images) < 1e-8


#: I at the fold of canard cycles of the FitzHugh-Nagumo neuron, with both branches of its symmetry.
FOLD_OF_CANARDS = 0.32417852250371


class TestTranscriticalPoints:
    """Cycles r² = 1 + ap and r² = 1 + bp exchange their stability at p = 0; so do x = s + ap, …"""

    #: Slopes over p of the known and of the other branch; the angle of the first pair is small.
    SLOPES = ((-0.83, -0.53), *np.random.default_rng(20).uniform(-1, 1, (2, 2)).round(2))

    @staticmethod
    def model(kind, known, other):
        p, y = sp.symbols("p y")
        if kind == "forced":
            away = x - sp.sin(t)
            rate = sp.cos(t) - (away - known * p) * (away - other * p)
            return fs.Model({x: rate}, parameters={p: -0.3})
        square = x**2 + y**2 - 1
        radial = -(square - known * p) * (square - other * p)
        speed = 1 + sp.Heaviside(x) / 2 if kind == "piecewise" else 1
        rates = {x: x * radial - y * speed, y: y * radial + x * speed}
        return fs.Model(rates, parameters={p: -0.3})

    @pytest.mark.sample(2)
    @pytest.mark.parametrize("kind", ["smooth", "piecewise", "forced"])
    @pytest.mark.parametrize("slopes", SLOPES)
    def test_other_branch(self, kind, slopes):
        known, other = slopes if slopes[0] < slopes[1] else slopes[::-1]
        model = self.model(kind, known, other)
        forced = kind == "forced"

        def slope(orbit):
            state, p = orbit(orbit.t0 if not forced else 0.0), orbit.parameters["p"]
            return (state[0] if forced else state @ state - 1) / p

        # at p = -0.3 the known one is stable
        start = [-0.3 * known] if forced else [np.sqrt(1 - 0.3 * known), 0]
        few = fs.Continuation(max_step=0.1)
        orbit = fs.find_orbit(model, start)
        branch = fs.continue_orbits(orbit, "p", over=(-0.3, 0.3), continuation=few)
        (point,) = branch.special
        assert point.code == "BPC"
        assert point["p"] == pytest.approx(0, abs=1e-12)
        assert slope(branch[-1]) == pytest.approx(known, abs=1e-9)
        switched = fs.find_orbit(model, point)
        assert switched.outcome
        assert 0 < abs(switched.parameters["p"]) < 0.05
        assert slope(switched) == pytest.approx(other, abs=1e-6)


class TestHopfPoints:
    def test_normal_form(self):
        """r' = r (p - r²), θ' = 1: the cycle of radius sqrt(p) and period 2π."""
        p, y = sp.symbols("p y")
        R = x**2 + y**2
        model = fs.Model({x: p * x - y - x * R, y: x + p * y - y * R}, parameters={p: -0.5})
        point = fs.continue_equilibria(model, "p", over=(-1, 1)).special("HB")[0]
        orbit = fs.find_orbit(model, point)
        assert orbit.outcome
        assert 0 < orbit.parameters["p"] < 1e-3
        assert orbit["max(x)"] == pytest.approx(np.sqrt(orbit.parameters["p"]), rel=1e-10)
        assert orbit.period == pytest.approx(2 * np.pi, rel=1e-12)
        branch = fs.continue_orbits(orbit, "p", over=(-1, 1), continuation=COARSE)
        # p is a difference from the Hopf point at 0, known to the rounding of rates of order 1
        np.testing.assert_allclose(branch["max(x)**2"], branch["p"], rtol=2e-9, atol=2e-16)
        assert [outcome.code for outcome in branch.outcomes] == ["Hopf point", "end of range"]
        assert len(branch.special) == 0

    @pytest.mark.sample(0)
    def test_subcritical_canard_explosion(self):
        """FitzHugh-Nagumo with ε = 0.08: the period 2π/ω, and the side of the cycles by l₁."""
        model = fs.systems.fitzhugh_nagumo(epsilon=0.08).frozen()
        point = fs.continue_equilibria(model, "I", over=(-1, 2)).special("HB")[0]
        assert point.criticality == "subcritical"
        orbit = fs.find_orbit(model, point)
        assert orbit.outcome
        assert orbit.stability == "unstable"
        assert 0 < point.parameters["I"] - orbit.parameters["I"] < 1e-3
        assert orbit.period == pytest.approx(2 * np.pi / point.frequency, rel=2e-3)
        branch = fs.continue_orbits(orbit, "I", over=(0.31, 0.34))
        assert {outcome.code for outcome in branch.outcomes} == {"Hopf point", "end of range"}
        (fold,) = branch.special
        assert (fold.code, fold.converged) == ("LPC", True)
        assert fold["I"] == pytest.approx(FOLD_OF_CANARDS, abs=1e-14)
        # beyond the fold, the relaxation oscillation of a settled run
        (large,) = branch.at(I=0.335, stable=True)
        settled = fs.find_orbit(model.with_parameters(I=0.335), [1.0, 0.0])
        assert large.period == pytest.approx(settled.period, rel=1e-9)

    @pytest.mark.sample(1)
    @pytest.mark.parametrize("place", [1, 100])
    def test_cycles_shrink_far_from_the_origin(self, place):
        """The phase condition has the ranges of the states, not their sizes, as units."""
        p, y = sp.symbols("p y")
        X = x - place
        R = X**2 + y**2
        model = fs.Model({x: p * X - y - X * R, y: X + p * y - y * R}, parameters={p: 0.3})
        orbit = fs.find_orbit(model, [place + 0.5, 0.1])
        branch = fs.continue_orbits(orbit, "p", over=(-0.5, 0.5))
        assert [outcome.code for outcome in branch.outcomes] == ["Hopf point", "end of range"]
        assert not branch.special
        assert len(branch) < 60
        np.testing.assert_allclose(branch["max(y)**2"], branch["p"], rtol=1e-8, atol=1e-12)

    @pytest.mark.sample(0)
    def test_branch_ends_at_the_hopf_point(self):
        model = fs.systems.fitzhugh_nagumo(epsilon=0.08).frozen()
        point = fs.continue_equilibria(model, "I", over=(-1, 2)).special("HB")[1]
        orbit = fs.find_orbit(model, point)
        branch = fs.continue_orbits(orbit, "I", over=(1.41, 1.43))
        assert {outcome.code for outcome in branch.outcomes} == {"Hopf point", "end of range"}
        assert branch.at(I=1.419, stable=False)
        shrunk = (branch["max(v)"] - branch["min(v)"]) < 1e-2
        assert branch["I"][shrunk].min() == pytest.approx(point.parameters["I"], abs=1e-7)
        # the symmetry v → −v, r → 2 a/b − r, I → 2 a/b − I
        (fold,) = branch.special
        assert (fold.code, fold.converged) == ("LPC", True)
        assert fold["I"] == pytest.approx(1.75 - FOLD_OF_CANARDS, abs=1e-14)

    def test_wrong_points(self):
        p = sp.Symbol("p")
        model = fs.Model({x: p - x**2, v: -v}, parameters={p: 1})
        fold = fs.continue_equilibria(model, "p", over=(-1, 1)).special("LP")[0]
        with pytest.raises(fs.ArgumentError, match="expected a Hopf point"):
            fs.find_orbit(model, fold)
