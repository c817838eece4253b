"""Lyapunov exponents against closed forms, published values, multipliers and SciPy."""

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

import fastslow as fs

from .models import block_on_belt, gear_pair, van_der_pol

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
    found = fs.lyapunov(linear, [1, 0], periods=30)
    assert found.largest == pytest.approx(-0.3, abs=1e-8)
    assert found.per_period[0] == pytest.approx(-0.6 * np.pi, abs=1e-7)
    assert found.uncertainties[0] < 1e-8
    assert found.outcome.code == "not chaotic"
    assert len(found.blocks) == 10
    assert "-0.3 ± " in repr(found)
    assert "(-1.885 ± " in repr(found)


def test_growth_is_not_chaos(linear):
    # at rest at a saddle, and running away from it: exponents of 0.3, and no chaos
    rest = linear.with_parameters(a=0.3, c=0)
    found = fs.lyapunov(rest, [0, 0], t=(0, 100))
    assert found.largest == pytest.approx(0.3, abs=1e-8)
    assert not found.chaotic
    assert "unstable" in found.outcome.message
    leaving = fs.lyapunov(rest, [1e-3, 0], t=(0, 40))
    assert leaving.largest == pytest.approx(0.3, abs=1e-3)
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
    found = fs.lyapunov(model, [0.3, 0.1], periods=120)
    assert found.per_period[0] == pytest.approx(np.log(1.9), abs=1e-9)
    assert found.chaotic
    assert found.uncertainties[0] < 1e-9


def test_lorenz():
    # Sprott, Chaos and Time-Series Analysis (Oxford 2003), appendix A
    lorenz = fs.Model({x: 10 * (y - x), y: x * (28 - z) - y, z: x * y - sp.Rational(8, 3) * z})
    found = fs.lyapunov(lorenz, [1, 1, 20], t=(0, 1500))
    assert found.largest == pytest.approx(0.9056, abs=4 * found.uncertainties[0])
    assert found.uncertainties[0] < 0.01
    assert found.chaotic
    # all of them: 0.9056, 0, −14.5723, with the sum −(10 + 1 + 8/3), and the dimension 2.062
    assert found.values[1] == pytest.approx(0.0, abs=4 * found.uncertainties[1])
    assert found.values[2] == pytest.approx(-14.5723, abs=4 * found.uncertainties[2])
    assert found.values.sum() == pytest.approx(-41 / 3, rel=1e-12)
    assert found.defect < 1e-12
    assert found.dimension == pytest.approx(2.062, abs=2e-3)


@pytest.mark.sample(0)
def test_roessler():
    # the same source
    half = sp.Rational(1, 5)
    roessler = fs.Model({x: -y - z, y: x + half * y, z: half + z * (x - sp.Rational(57, 10))})
    found = fs.lyapunov(roessler, [1, 1, 0], t=(0, 10_000))
    assert found.largest == pytest.approx(0.0714, abs=4 * found.uncertainties[0])
    assert found.uncertainties[0] < 0.003
    assert found.chaotic


def test_a_limit_cycle_has_the_exponent_zero():
    model = fs.systems.van_der_pol_relaxation(epsilon=0.1)
    found = fs.lyapunov(model, [1, 0], t=(0, 500))
    assert abs(found.largest) < 0.01
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
                rates(side), (now, end), u, "DOP853", events=edges, rtol=1e-6, atol=1e-8
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
    p = dict(fast_gear.parameters)
    # attracted by an orbit with a complex pair of multipliers, their product exp(−2 π/3)
    found = fs.lyapunov(fast_gear.with_parameters(omega=3.0), [0, 0], periods=120)
    assert found.per_period[0] == pytest.approx(-np.pi / 3, rel=1e-2)
    # chaotic: the means of two samples
    p["omega"] = 1.3
    found = fs.lyapunov(fast_gear.with_parameters(omega=1.3), [0, 0], periods=500)
    logs = by_scipy(p, 120, 10)
    error = logs.std() / np.sqrt(len(logs)) + found.uncertainties[0] * found.period
    assert found.per_period[0] == pytest.approx(logs.mean(), abs=4 * error)
    assert logs.mean() > 5 * error


@pytest.mark.sample(0)
def test_the_gear_at_fast_loads(fast_gear):
    """The values of an independent computation over 200 periods."""
    published = {0.98: 0.91, 1.0: 0.85, 1.2: 0.18, 1.3: 0.90, 1.7: 0.69, 2.0: 0.90}
    for frequency, value in published.items():
        model = fast_gear.with_parameters(omega=frequency)
        found = fs.lyapunov(model, [0, 0], periods=500)
        assert found.chaotic
        assert found.per_period[0] == pytest.approx(value, abs=0.12)
        # unit damping
        assert found.values.sum() == pytest.approx(-1.0, abs=1e-12)
        assert found.divergence == pytest.approx(-1.0, abs=1e-12)


def test_what_it_refuses_and_a_run_that_ends(linear):
    with pytest.raises(fs.ArgumentError, match="settle = 30; expected a number from 0 below"):
        fs.lyapunov(linear, [0, 0], periods=30, settle=30)
    with pytest.raises(fs.ArgumentError, match="expected t="):
        fs.lyapunov(linear, [0, 0])
    blown = fs.lyapunov(linear.with_parameters(a=50, c=0), [1, 0], t=(0, 100))
    assert blown.outcome.code == "stopped early"
    assert np.isnan(blown.largest)


def test_it_is_kept_in_a_file(linear, tmp_path):
    found = fs.lyapunov(linear, [1, 0], periods=10)
    found.save(tmp_path / "exponent.npz")
    again = fs.load(tmp_path / "exponent.npz")
    assert again.largest == found.largest
    assert repr(again) == repr(found)


def test_on_an_orbit_they_are_the_multipliers():
    model = van_der_pol()
    orbit = fs.find_orbit(model, [2, 0])
    T = orbit.period
    found = fs.lyapunov(model, orbit(0.0), t=(0, 30 * T), period=T, settle=20 * T)
    assert found.values == pytest.approx(orbit.log_multipliers / T, abs=1e-10)
    # moduli of a complex pair: the mean of their logarithms converges as 1/t
    pair = gear_pair(W=0.78)
    orbit = fs.find_orbit(pair, [0, 0])
    found = fs.lyapunov(pair, orbit(0.0), periods=400, settle=0)
    assert found.values == pytest.approx(orbit.log_multipliers / orbit.period, abs=2e-3)
    assert found.values.sum() == pytest.approx(-0.1, rel=1e-12)


def test_sliding_collapses_a_direction():
    found = fs.lyapunov(block_on_belt(), [1, 0], t=(0, 200))
    assert found.values[0] == pytest.approx(0.0, abs=4 * found.uncertainties[0])
    assert np.isneginf(found.values[1])
    assert found.uncertainties[1] == 0.0
    assert np.isneginf(found.divergence)
    assert found.defect == 0.0
    assert found.dimension == 1.0
    assert "-inf" in repr(found)
    assert "repeats after 1 return" in found.outcome.message


def test_sticking_from_the_beginning():
    """A block that friction holds: its position is kept, differences of speed vanish."""
    held = fs.Model({x: y, y: -x - sp.sign(y) + sp.cos(t) / 10})
    found = fs.lyapunov(held, [0.5, 0.0], periods=20)
    assert found.values[0] == pytest.approx(0.0, abs=1e-12)
    assert np.isneginf(found.values[1])


def test_saltation_at_a_jump_of_the_rate():
    """Dry friction without sticking: det S is the ratio of the accelerations at each stop."""
    block = fs.Model({x: y, y: 2 * sp.cos(1.3 * t) - x - y / 10 - sp.sign(y) / 2})
    orbit = fs.find_orbit(block, [1, 1])
    assert orbit.itinerary == ("S1", "S2")
    found = fs.lyapunov(block, orbit(0.0), periods=100, settle=20)
    logs = orbit.log_multipliers / orbit.period
    assert found.values.sum() == pytest.approx(logs.sum(), rel=1e-9)
    assert found.values == pytest.approx(logs, abs=4 * found.uncertainties[0] + 1e-9)
    stops = [orbit.crossings[k] for k in range(2)]
    rates = [2 * np.cos(1.3 * c.time) - c.state[0] for c in stops]
    ratios = [(r + 0.5) / (r - 0.5) for r in rates]
    det = sum(abs(np.log(abs(ratio))) for ratio in ratios)
    assert found.divergence == pytest.approx(-0.1 - det / orbit.period, rel=1e-9)
    assert found.defect < 1e-12


@pytest.mark.parametrize("rate", [1e-6, 1e6])
@pytest.mark.parametrize("size", [1e-6, 1e6])
def test_units_of_states_and_time(size, rate):
    """A relaxation oscillator and a block on a belt, in units over twelve decades."""
    s, r = sp.symbols("s r")
    slip = y / s - sp.Rational(1, 5)
    friction = sp.sign(slip) * 0.3 / (1 + 3 * sp.Abs(slip))
    for model in (
        fs.Model({x: r * y, y: r * ((1 - x**2 / s**2) * y - x)}, parameters={s: 1, r: 1}),
        fs.Model({x: r * y, y: r * (-x - s * friction)}, parameters={s: 1, r: 1}),
    ):
        plain = fs.lyapunov(model, [1, 0.1], t=(0, 100))
        scaled = model.with_parameters(s=size, r=rate)
        found = fs.lyapunov(scaled, [size, 0.1 * size], t=(0, 100 / rate))
        assert found.values / rate == pytest.approx(plain.values, rel=1e-6, abs=1e-9)
        assert found.outcome.code == plain.outcome.code


def test_two_interfaces_at_once():
    model = fs.Model({x: 1 + sp.sign(x) / 2, y: 1 + sp.sign(y + 2 * x) / 2})
    found = fs.lyapunov(model, [-1, -1], t=(0, 10), settle=0)
    assert found.outcome.code == "stopped early"
    assert "two interfaces are crossed at once" in found.outcome.message


def test_the_steps_of_all_pieces_count(linear):
    """More than one piece of a run, each within the limit."""
    few = fs.Integration(rtol=1e-11, max_steps=300)
    found = fs.lyapunov(linear, [1, 0], periods=200, integration=few)
    assert found.outcome.code == "stopped early"
    assert "300 steps" in str(found.outcome)
