"""Regimes over many periods: settled, chaotic, coexisting, and not settled."""

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

import fastslow as fs
from fastslow.results.trajectory.long_time.regimes import labels_of, periods_at_the_end, repeats

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def fast_gear():
    """The gear at the width 0.5 and the loads of figure 3, under the consistent scaling."""
    return fs.systems.harmonic_gear_from_physical().with_parameters(D=0.5)


def met_by_scipy(p, periods, settle):
    """Whether each period of the gear meets both sides, region by region with events."""
    D, A, length = p["D"], p["A"], 2 * np.pi / p["omega"]

    def rates(side):
        def of(time, u):
            force = (u[0] ** 2 + A) * (u[0] - side * D) * (side != 0)
            return [u[1], p["B"] + p["C"] * np.sin(p["omega"] * time) - u[1] - force]

        return of

    edges = [lambda _, u: u[0] - D, lambda _, u: u[0] + D]
    for edge in edges:
        edge.terminal = True
    u, met = np.zeros(2), []
    for k in range(settle + periods):
        now, end, side, seen = k * length, (k + 1) * length, 0, set()
        if abs(u[0]) > D:
            side = int(np.sign(u[0]))
        while now < end:
            seen.add(side)
            done = solve_ivp(
                rates(side), (now, end), u, "DOP853", events=edges, rtol=1e-6, atol=1e-8
            )
            now, u = done.t[-1], done.y[:, -1]
            if done.status == 1:
                upper = len(done.t_events[0]) > 0
                side = (1 if upper else -1) if (u[1] > 0) == upper else 0
                u[0] = (D if upper else -D) + 1e-13 * np.sign(u[1])
        met.append({-1, 1} <= seen)
    return np.array(met[settle:])


@pytest.mark.sample(0)
@pytest.mark.parametrize(("omega", "share"), [(1.3, 0.28), (1.7, 0.64), (2.0, 0.27)])
def test_the_fraction_of_periods_that_meet_both_sides(fast_gear, omega, share):
    model = fast_gear.with_parameters(omega=omega)
    long = fs.simulate_many(model, [0, 0], periods=2000)
    assert long.regime[0] == "not settled"
    assert long.fractions["bilateral"][0] == pytest.approx(share, abs=0.05)
    assert sum(long.fractions.values())[0] == pytest.approx(1.0)
    met = met_by_scipy(dict(model.parameters), 150, 10)
    # successive periods of chaos are correlated: three standard errors of independent ones
    assert met.mean() == pytest.approx(share, abs=3 * 0.5 / np.sqrt(150))


def test_chaos_is_no_regime(fast_gear):
    """Fault H1: the last period alone named every one of these runs."""
    for omega in (0.98, 1.0, 1.2, 1.3, 1.7, 2.0):
        model = fast_gear.with_parameters(omega=omega)
        run = fs.simulate(model, [0, 0], periods=40)
        assert run.regime == "not settled"
        assert set(run.regimes().fractions) >= {"bilateral", "unilateral upper"}
        assert "regime not settled: " in repr(run)
        found = fs.classify_regime(model, [[0, 0], [0.5, 0]])
        assert found.label == "chaotic"
        (motion,) = found.motions
        assert motion.exponents.chaotic
        assert motion.outcome.code == "chaotic"
        assert "per period" in repr(found)


def test_coexisting_motions_are_named(fast_gear):
    model = fast_gear.with_parameters(omega=3.67)
    states = [[0, 0], [0.5, 0], [-1, 0], [0, 1], [0, -1], [1, 0]]
    found = fs.classify_regime(model, states, periods=32)
    assert found.label == "coexisting: bilateral + unilateral upper"
    assert len(found.motions) == 2
    assert {motion.outcome.code for motion in found.motions} == {"settled"}
    # each of them is what a run from there comes to
    for state, k in zip(states, found.index, strict=True):
        run = fs.simulate(model, state, periods=400)
        assert run.regime == found.motions[k].label
    over = {"omega": (3.6, 3.74), "D": (0.499, 0.501)}
    alone = fs.regime_map(
        model, over, [0, 0], refinement=fs.Refinement(cells=(2, 1), levels=0), periods=32
    )
    both = fs.regime_map(
        model,
        over,
        states,
        refinement=fs.Refinement(cells=(2, 1), levels=0),
        periods=32,
        max_periods=1024,
    )
    assert alone.at(3.67, 0.5) == "bilateral"
    assert both.at(3.67, 0.5) == "coexisting: bilateral + unilateral upper"


def test_a_motion_of_two_periods_has_the_regime_of_both():
    """x' = w in the gap, with w of two frequencies: every other period reaches the lower side."""
    x, w, t, D = sp.symbols("x w t D")
    f = sp.Piecewise((x - D, x > D), (x + D, x < -D), (0, True))
    load = sp.Rational(3, 10) + sp.sin(t) + sp.sin(t / 2) / 2
    model = fs.Model({x: w - 10 * f}, forcing={w: load}, parameters={D: 0.95})
    run = fs.simulate(model, [0], t=(0, 40 * np.pi), period=2 * np.pi)
    found = run.regimes()
    assert found.fractions == {"bilateral": 0.5, "unilateral upper": 0.5}
    assert found.multiple == 2
    assert run.regime == found.label == run.regimes(gap="S2").label == "bilateral"
    many = fs.simulate_many(model, [0], t=(0, 40 * np.pi), period=2 * np.pi)
    assert many.multiples[0] == 2
    assert many.regime[0] == "bilateral"


def test_the_map_of_a_chaotic_plane(fast_gear):
    over = {"omega": (1.0, 3.0), "D": (0.4, 0.5)}
    found = fs.regime_map(
        fast_gear, over, [0, 0], refinement=fs.Refinement(cells=(2, 1), levels=0), periods=4
    )
    assert found.at(1.0, 0.5) == found.at(2.0, 0.5) == "chaotic"
    assert found.at(3.0, 0.5) == "bilateral"


def test_a_run_that_is_not_long_enough(fast_gear):
    # contracted by e^(−0.02) a period at most
    model = fs.systems.harmonic_gear_from_physical().with_parameters(D=0.25, omega=4.8)
    found = fs.classify_regime(model, [[0.25, 0]], max_periods=256)
    assert found.label == "not settled"
    (motion,) = found.motions
    assert not motion.exponents.chaotic
    assert motion.fractions["bilateral"] == pytest.approx(0.41, abs=0.03)
    assert "Lyapunov exponent is -0.0" in motion.outcome.message


def test_repeats_of_random_sequences():
    random = np.random.default_rng(3)
    for multiple in (1, 2, 3, 7):
        cycle = random.normal(size=(multiple, 2))
        states = np.tile(cycle, (40 // multiple + 1, 1))[:41]
        (found,), (change,) = repeats(states[None], np.ones((1, 2)), np.zeros(2), 1e-9)
        assert found == multiple
        assert change == 0.0
    noise = random.normal(size=(1, 41, 2))
    assert repeats(noise, np.ones((1, 2)), np.zeros(2), 1e-9)[0] == 0
    # a period of the state itself counts for nothing
    turning = np.arange(41.0)[None, :, None] * 2 * np.pi
    assert repeats(turning, np.ones((1, 1)), np.array([2 * np.pi]), 1e-9)[0] == 1
    assert labels_of(np.array([[5, 7], [6, 5]]), np.array([0, 0])) == ["bilateral", "not settled"]
    assert periods_at_the_end(np.array([2.9]), np.array([1.0])) == 1


def test_regimes_refuse_what_they_cannot_say(fast_gear):
    run = fs.simulate(fs.systems.van_der_pol(), [1, 0], periods=1)
    assert run.regime is None
    with pytest.raises(fs.ArgumentError, match="no gap"):
        run.regimes()
    with pytest.raises(fs.ArgumentError, match="no gap"):
        fs.classify_regime(fs.systems.van_der_pol(), [1, 0])
    with pytest.raises(fs.ArgumentError, match="ended early"):
        fs.classify_regime(fast_gear, [0, 0], integration=fs.Integration(max_steps=10))
    light = fs.simulate(fast_gear, [0, 0], periods=4, dense=False)
    assert not light.regimes().settled
    assert "unknown" in repr(light.regimes())


def test_they_are_kept_in_files(fast_gear, tmp_path):
    found = fs.classify_regime(fast_gear.with_parameters(omega=1.3), [0, 0])
    found.save(tmp_path / "motions.npz")
    assert repr(fs.load(tmp_path / "motions.npz")) == repr(found)
    many = fs.simulate_many(fast_gear, [0, 0], periods=8)
    many.save(tmp_path / "many.npz")
    assert np.array_equal(fs.load(tmp_path / "many.npz").touched, many.touched)
