"""Largest Lyapunov exponents against closed forms, published values and SciPy."""

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

import fastslow as fs

pytestmark = pytest.mark.slow

x, y, z, w, t, a, b, c, omega = sp.symbols("x y z w t a b c omega")


@pytest.fixture(scope="module")
def linear():
    """x' = a x + y, y' = −b y + c sin t: exponents a and −b."""
    return fs.Model({x: a * x + y, y: -b * y + c * sp.sin(t)}, parameters={a: -0.3, b: 2, c: 1})


@pytest.fixture(scope="module")
def fast_gear():
    """The gear at the width 0.5 and the loads of figure 3, under the consistent scaling."""
    return fs.systems.harmonic_gear_from_physical().with_parameters(D=0.5)


def test_linear_systems(linear):
    found = fs.lyapunov_exponent(linear, [1, 0], periods=30)
    assert found.value == pytest.approx(-0.3, abs=1e-8)
    assert found.per_period == pytest.approx(-0.6 * np.pi, abs=1e-7)
    assert found.uncertainty < 1e-8
    assert found.outcome.code == "not chaotic"
    assert len(found.blocks) == 10
    assert "-0.3 ± " in repr(found)
    assert "(-1.885 ± " in repr(found)


def test_growth_is_not_chaos(linear):
    # at rest at a saddle, and running away from it: exponents of 0.3, and no chaos
    rest = linear.with_parameters(a=0.3, c=0)
    found = fs.lyapunov_exponent(rest, [0, 0], t=(0, 100))
    assert found.value == pytest.approx(0.3, abs=1e-8)
    assert not found.chaotic
    assert "unstable" in found.outcome.message
    leaving = fs.lyapunov_exponent(rest, [1e-3, 0], t=(0, 40))
    assert leaving.value == pytest.approx(0.3, abs=1e-3)
    assert leaving.outcome.code == "not decided"
    assert "diverge" in leaving.outcome.message


def test_a_baker_s_map():
    """Stretched by 1.9, then shifted by the side it was on: ln 1.9 a period, by events alone."""
    model = fs.Model(
        {
            x: sp.Piecewise((a * x, w > 0), (-y, True)),
            y: sp.Piecewise((20 * (sp.sign(x) - y), w > 0), (0, True)),
        },
        forcing={w: sp.sin(omega * t)},
        parameters={a: np.log(1.9), omega: np.pi},
    )
    found = fs.lyapunov_exponent(model, [0.3, 0.1], periods=120)
    assert found.per_period == pytest.approx(np.log(1.9), abs=1e-9)
    assert found.chaotic
    assert found.uncertainty < 1e-9


def test_lorenz_and_roessler():
    # Sprott, Chaos and Time-Series Analysis (Oxford 2003), appendix A: 0.9056 and 0.0714
    lorenz = fs.Model({x: 10 * (y - x), y: x * (28 - z) - y, z: x * y - sp.Rational(8, 3) * z})
    found = fs.lyapunov_exponent(lorenz, [1, 1, 20], t=(0, 1500))
    assert found.value == pytest.approx(0.9056, abs=4 * found.uncertainty)
    assert found.uncertainty < 0.01
    assert found.chaotic
    half = sp.Rational(1, 5)
    roessler = fs.Model({x: -y - z, y: x + half * y, z: half + z * (x - sp.Rational(57, 10))})
    found = fs.lyapunov_exponent(roessler, [1, 1, 0], t=(0, 10_000))
    assert found.value == pytest.approx(0.0714, abs=4 * found.uncertainty)
    assert found.uncertainty < 0.003
    assert found.chaotic


def test_a_limit_cycle_has_the_exponent_zero():
    model = fs.systems.van_der_pol_relaxation(epsilon=0.1)
    found = fs.lyapunov_exponent(model, [1, 0], t=(0, 500))
    assert abs(found.value) < 0.01
    assert found.outcome.code == "not chaotic"
    assert "repeats after 1 return" in found.outcome.message


def by_scipy(p, periods, settle):
    """Benettin's algorithm with the variational equation, region by region, per period."""
    D, A = p["D"], p["A"]
    length = 2 * np.pi / p["omega"]

    def rates(side):
        def of(time, u):
            X, V, dx, dv = u
            force = (X**2 + A) * (X - side * D) * (side != 0)
            slope = (2 * X * (X - side * D) + X**2 + A) * (side != 0)
            load = p["B"] + p["C"] * np.sin(p["omega"] * time)
            return [V, load - V - force, dv, -dv - slope * dx]

        return of

    edges = [lambda _, u: u[0] - D, lambda _, u: u[0] + D]
    for edge in edges:
        edge.terminal = True
    u, logs = np.array([0.0, 0.0, 1.0, 0.3]), []
    for k in range(settle + periods):
        now, end, side = k * length, (k + 1) * length, int(np.sign(u[0])) * (abs(u[0]) > D)
        while now < end:
            done = solve_ivp(
                rates(side), (now, end), u, "DOP853", events=edges, rtol=1e-9, atol=1e-11
            )
            now, u = done.t[-1], done.y[:, -1]
            if done.status == 1:
                upper = len(done.t_events[0]) > 0
                # out of contact towards the gap, or into it
                side = (1 if upper else -1) if (u[1] > 0) == upper else 0
                u[0] = D if upper else -D
                u[0] += 1e-13 * np.sign(u[1])
        size = np.linalg.norm(u[2:])
        logs.append(np.log(size))
        u[2:] /= size
    return np.array(logs[settle:])


def test_the_gear_against_scipy(fast_gear):
    # attracted by a periodic motion: six digits
    p = dict(fast_gear.with_parameters(omega=3.0).parameters)
    found = fs.lyapunov_exponent(fast_gear.with_parameters(omega=3.0), [0, 0], periods=120)
    logs = by_scipy(p, 20, 80)
    assert found.per_period == pytest.approx(logs.mean(), rel=1e-2)
    # chaotic: the means of two samples
    p["omega"] = 1.3
    found = fs.lyapunov_exponent(fast_gear.with_parameters(omega=1.3), [0, 0], periods=500)
    logs = by_scipy(p, 120, 10)
    error = logs.std() / np.sqrt(len(logs)) + found.uncertainty * found.period
    assert found.per_period == pytest.approx(logs.mean(), abs=4 * error)
    assert logs.mean() > 5 * error


def test_the_gear_at_fast_loads(fast_gear):
    """The values of an independent computation over 200 periods."""
    published = {0.98: 0.91, 1.0: 0.85, 1.2: 0.18, 1.3: 0.90, 1.7: 0.69, 2.0: 0.90}
    for frequency, value in published.items():
        model = fast_gear.with_parameters(omega=frequency)
        found = fs.lyapunov_exponent(model, [0, 0], periods=500)
        assert found.chaotic
        assert found.per_period == pytest.approx(value, abs=0.12)


def test_what_it_refuses_and_a_run_that_ends(linear):
    with pytest.raises(fs.ArgumentError, match="settle = 30; expected a number from 0 below"):
        fs.lyapunov_exponent(linear, [0, 0], periods=30, settle=30)
    with pytest.raises(fs.ArgumentError, match="expected t="):
        fs.lyapunov_exponent(linear, [0, 0])
    blown = fs.lyapunov_exponent(linear.with_parameters(a=50, c=0), [1, 0], t=(0, 100))
    assert blown.outcome.code == "stopped early"
    assert np.isnan(blown.value)


def test_it_is_kept_in_a_file(linear, tmp_path):
    found = fs.lyapunov_exponent(linear, [1, 0], periods=10)
    found.save(tmp_path / "exponent.npz")
    again = fs.load(tmp_path / "exponent.npz")
    assert again.value == found.value
    assert repr(again) == repr(found)
