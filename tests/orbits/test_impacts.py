"""Periodic orbits with impacts, spikes and clocks against closed forms."""

from dataclasses import dataclass

import numpy as np
import pytest
import sympy as sp
from scipy.linalg import expm
from scipy.optimize import brentq

import fastslow as fs
from fastslow.orbits.trace import bifurcation_rows

pytestmark = pytest.mark.slow

COARSE = fs.Continuation(max_step=0.2)

x, v, t, r = sp.symbols("x v t r")


@dataclass(frozen=True)
class OneImpact:
    """The orbits of x'' + 2 ζ x' + x = f cos ωt with one impact at x = σ in n periods.

    The flow between impacts is affine: with the forced response P and E = exp(A n T), the state
    (σ, v) before and (σ, −r v) after an impact satisfy (σ, v) − P = E ((σ, −r v) − P), so that
    P is affine in v, and P₁² + (P₂/ω)² = α² determines v. S has det r².
    """

    zeta: float
    f: float
    omega: float
    sigma: float
    r: float
    n: int = 1

    @property
    def period(self):
        return 2 * np.pi * self.n / self.omega

    @property
    def amplitude(self):
        return self.f / abs(1 - self.omega**2 + 2j * self.zeta * self.omega)

    @property
    def flow(self):
        return expm(np.array([[0.0, 1.0], [-1.0, -2 * self.zeta]]) * self.period)

    def _response(self, speed):
        E, e = self.flow, np.eye(2)
        return np.linalg.solve(e - E, [self.sigma, speed] - E @ [self.sigma, -self.r * speed])

    @property
    def speeds(self):
        """Approach speeds of both orbits, the larger one first."""
        fixed, unit = self._response(0.0), np.array([1.0, 1.0 / self.omega])
        slope = (self._response(1.0) - fixed) * unit
        fixed = fixed * unit
        return np.sort(
            np.roots([slope @ slope, 2 * slope @ fixed, fixed @ fixed - self.amplitude**2]).real
        )[::-1]

    def flight(self, speed):
        """Time of an impact, and times and states at a hundred points of the flight after it."""
        position, velocity = self._response(speed)
        gain = 1 - self.omega**2 + 2j * self.zeta * self.omega
        phase = np.angle((position - 1j * velocity / self.omega) * gain)
        begin, step = phase / self.omega, self.period / 100
        E = expm(np.array([[0.0, 1.0], [-1.0, -2 * self.zeta]]) * step)
        times = begin + step * np.arange(101)
        turning = self.f / gain * np.exp(1j * self.omega * times)
        forced = np.array([turning.real, (1j * self.omega * turning).real]).T
        free = [np.array([self.sigma, -self.r * speed]) - forced[0]]
        for _ in range(100):
            free.append(E @ free[-1])
        return times, forced + free

    def saltation(self, speed):
        position, velocity = self._response(speed)
        # the forcing in the phase of the response
        gain = 1 - self.omega**2 + 2j * self.zeta * self.omega
        forcing = (gain * (position - 1j * velocity / self.omega)).real
        before, after = (forcing - self.sigma - 2 * self.zeta * w for w in (speed, -self.r * speed))
        return np.array([[-self.r, 0.0], [(after + self.r * before) / speed, -self.r]])

    def multipliers(self, speed):
        return np.linalg.eigvals(self.saltation(speed) @ self.flow)


def impact_case(**values):
    return OneImpact(**values), fs.systems.impact_oscillator(
        **{k: w for k, w in values.items() if k != "n"}
    )


@pytest.fixture(scope="module")
def hit():
    """A stable orbit with one impact in each period, and its closed form."""
    exact, model = impact_case(zeta=0.05, f=1.0, omega=2.2, sigma=0.1, r=0.8)
    return exact, model, fs.find_orbit(model, [0, 0])


def test_an_orbit_with_one_impact_in_closed_form(hit):
    exact, _, orbit = hit
    assert orbit.outcome.success
    (impact,) = orbit.trajectory.resets
    speed = exact.speeds[0]
    assert impact.before == pytest.approx([0.1, speed], abs=1e-13)
    assert impact.after == pytest.approx([0.1, -0.8 * speed], abs=1e-13)
    found = np.sort_complex(exact.multipliers(speed))
    assert np.sort_complex(orbit.multipliers) == pytest.approx(found, abs=1e-13)
    assert orbit.log_multipliers.sum() == pytest.approx(
        2 * np.log(0.8) - 0.1 * orbit.period, abs=1e-13
    )
    assert orbit.stability == "stable"


def test_random_oscillators_with_one_impact():
    """Orbits of random oscillators, stable and unstable, from a state in the middle of a flight."""
    rng, model = np.random.default_rng(4), fs.systems.impact_oscillator()
    compared = 0
    while compared < 12:
        zeta, f, omega, sigma, r = rng.uniform([0, 0.2, 0.4, -0.5, 0.3], [0.1, 2, 4, 0.8, 0.95])
        exact = OneImpact(zeta, f, omega, sigma, r, n=int(rng.integers(1, 4)))
        for speed in exact.speeds[exact.speeds > 0.05]:
            times, states = exact.flight(speed)
            closed = np.abs(states[-1] - [sigma, speed]).max() < 1e-9
            if not closed or not (states[1:-1, 0] < sigma).all():
                # complex roots, or a flight beyond the wall
                continue
            one = model.with_parameters(zeta=zeta, f=f, omega=omega, sigma=sigma, r=r)
            run = fs.simulate(one, states[50], t=(times[50], times[51]))
            orbit = fs.find_orbit(one, run, multiple=exact.n)
            if len(orbit.trajectory.resets) != 1:
                # a grazing flight between two samples
                continue
            assert orbit.outcome.success
            (impact,) = orbit.trajectory.resets
            assert impact.before == pytest.approx([sigma, speed], abs=1e-10)
            expected = exact.multipliers(speed)
            largest = np.abs(expected).max()
            assert np.abs(orbit.multipliers).max() == pytest.approx(largest, rel=1e-9)
            logs = 2 * np.log(r) - 2 * zeta * orbit.period
            assert orbit.log_multipliers.sum() == pytest.approx(logs, abs=1e-11)
            compared += 1


@pytest.fixture(scope="module")
def response():
    """The response over the frequency from beyond the grazing contact."""
    model = fs.systems.impact_oscillator(zeta=0.05, f=1.0, omega=3.5, sigma=0.1, r=0.8)
    gain = 1 / (1 - 3.5**2 + 0.35j)
    orbit = fs.find_orbit(model, [gain.real, (3.5j * gain).real])
    return fs.continue_orbits(orbit, "omega", over=(2.3, 3.6), continuation=COARSE)


def case_at(omega):
    return OneImpact(zeta=0.05, f=1.0, omega=omega, sigma=0.1, r=0.8)


def test_grazing_at_zero_speed_from_the_side_without_impacts(response):
    (point,) = response.special("GR")
    grazes = brentq(lambda omega: case_at(omega).amplitude - 0.1, 3, 4, xtol=1e-15)
    assert point.parameters["omega"] == pytest.approx(grazes, abs=1e-13)
    assert point.converged
    assert point.exponent == 0.5
    assert point.interface == "x >= sigma"
    assert point.state == pytest.approx([0.1, 0], abs=1e-14)
    # the derivative of the return map is unbounded
    assert np.isnan(point.orbit.multipliers).all()
    impacts = np.array([len(orbit.trajectory.resets) for orbit in response.orbits])
    assert (impacts[response.values < grazes - 1e-9] == 1).all()
    assert (impacts[response.values > grazes + 1e-9] == 0).all()
    assert {str(outcome.code) for outcome in response.outcomes} == {"end of range"}


def test_grazing_at_zero_speed_from_the_side_with_impacts(hit, response):
    branch = fs.continue_orbits(hit[2], "omega", over=(2.2, 3.4))
    (one,), (two,) = (some.special("GR") for some in (branch, response))
    assert one.parameters["omega"] == pytest.approx(two.parameters["omega"], abs=1e-13)
    assert one.type == "transition"
    assert np.isnan(branch.multipliers[branch.special_rows[-1]]).all()
    # beyond it the multipliers are those of the linear oscillator
    last = branch.orbits[-1]
    assert np.abs(last.multipliers) == pytest.approx(
        np.full(2, np.exp(-0.05 * last.period)), abs=1e-12
    )


def test_period_doubling_in_closed_form(response):
    (point,) = response.special("PD")

    def smallest(omega):
        exact = case_at(omega)
        return exact.multipliers(exact.speeds[0]).real.min()

    omega = brentq(lambda w: smallest(w) + 1, 2.4, 2.5, xtol=1e-15)
    assert point.parameters["omega"] == pytest.approx(omega, abs=1e-12)
    twice = fs.find_orbit(response.template.model, point)
    assert twice.outcome.success
    assert twice.multiple == 2
    assert len(twice.trajectory.resets) == 2


def test_a_point_that_is_not_confirmed_says_what_rounding_allows(response, monkeypatch):
    monkeypatch.setattr(bifurcation_rows, "CRITICAL_MULTIPLIER_ERROR", -1.0)
    first, orbit = response.special("PD")[0], response.orbits[0]
    branch = fs.continue_orbits(orbit, "omega", over=(2.3, 3.6), continuation=COARSE)
    (point,) = branch.special("PD")
    assert point["omega"] == pytest.approx(first["omega"], abs=1e-12)
    assert (point.type, point.converged) == ("candidate", False)
    exact = case_at(point["omega"])
    smallest = exact.multipliers(exact.speeds[0]).real.min()
    assert abs(np.log(-smallest)) <= point.rounding
    assert point.deviation <= point.rounding < 1e-9
    assert f"changed by {point.rounding:.2g} by rounding" in repr(point)
    drawn = fs.plot.response(branch)
    assert "PD1 (candidate)" in [label.get_text() for label in drawn.labels]


@pytest.mark.parametrize("speed", [0.2, 1e-4])
def test_the_size_of_an_impact_near_grazing_is_stated(speed):
    omega = brentq(lambda w: case_at(w).speeds[0] - speed, 2.3, 3.365, xtol=1e-15)
    exact = case_at(omega)
    model = fs.systems.impact_oscillator(zeta=0.05, f=1.0, omega=omega, sigma=0.1, r=0.8)
    times, states = exact.flight(exact.speeds[0])
    orbit = fs.find_orbit(model, fs.simulate(model, states[50], t=(times[50], times[51])))
    assert orbit.outcome.success
    stated = [note for note in orbit.outcome.notes if "amplifies" in note]
    assert len(stated) == (speed < 0.1)
    if stated:
        saltation = exact.saltation(exact.speeds[0])
        ranges = np.ptp([orbit["x"], orbit["v"]], axis=1)
        size = np.linalg.norm(saltation * ranges / ranges[:, None], 2)
        assert f"{size:.2g} times" in stated[0]
        assert stated[0] in repr(orbit)


def test_curves_of_grazing_and_period_doubling_in_closed_form(response):
    over = {"omega": (2.3, 4.0), "f": (0.6, 1.6)}
    settings = fs.Continuation(max_step=0.3)
    model = response.template.model
    curve = fs.continue_points(
        response.special("GR")[0], ("omega", "f"), over, continuation=settings
    )
    omega, f = curve["omega"], curve["f"]
    assert len(curve) > 8
    assert f == pytest.approx(0.1 * np.abs(1 - omega**2 + 0.1j * omega), abs=1e-12)
    assert np.isnan(curve.eigenvalues).all()
    assert model.parameters["r"] == 0.8
    curve = fs.continue_points(
        response.special("PD")[0], ("omega", "f"), over, continuation=settings
    )
    assert len(curve) > 4
    for omega, f in zip(curve["omega"], curve["f"], strict=True):
        exact = OneImpact(zeta=0.05, f=f, omega=omega, sigma=0.1, r=0.8)
        assert np.abs(exact.multipliers(exact.speeds[0]) + 1).min() < 1e-11


def test_a_wall_that_moves_keeps_the_determinant(hit):
    """Relative to the wall s = a cos ωt the oscillator has a fixed stop: equal multipliers."""
    a = 0.3
    model = fs.systems.moving_wall_oscillator(zeta=0.05, a=a, sigma=0.1, r=0.8, omega=2.2)
    orbit = fs.find_orbit(model, [0, 0])
    count = len(orbit.trajectory.resets)
    assert count == 1
    assert orbit.log_multipliers.sum() == pytest.approx(
        2 * count * np.log(0.8) - 0.1 * orbit.period, abs=1e-13
    )
    # y = x - s: y'' + 2 zeta y' + y = -(s'' + 2 zeta s' + s), up to the phase
    size = a * abs(1 - 2.2**2 + 0.1j * 2.2)
    exact = OneImpact(0.05, size, 2.2, 0.1, 0.8)
    speed = exact.speeds[0]
    (impact,) = orbit.trajectory.resets
    wall = -a * 2.2 * np.sin(2.2 * impact.time)
    assert impact.before[1] - wall == pytest.approx(speed, abs=1e-13)
    assert np.sort_complex(orbit.multipliers) == pytest.approx(
        np.sort_complex(exact.multipliers(speed)), abs=1e-12
    )


def bounce(r, n=1, g=1.0, omega=1.0):
    """Orbits of the ball that bounces once in n periods of the table s = A sin φ.

    Between impacts it flies for T = 2πn/ω, leaving at πng/ω: with φ at the impact A ω cos φ =
    ρ πng/ω, ρ = (1 − r)/(1 + r); det M = r², and tr M = −2r + (1 + r)² (1 − A ω² sin φ/g). So
    A = ρ πng/ω² at the fold, and A ω² = g √((ρ πn)² + (1 + ρ²)²) where it doubles its period.
    """
    ratio = (1 - r) / (1 + r)
    fold = ratio * np.pi * n * g / omega**2
    return fold, np.hypot(fold, (1 + ratio**2) * g / omega**2)


def test_a_bouncing_ball_doubles_its_period_in_closed_form():
    A = 0.8
    fold, doubling = bounce(0.8)
    model = fs.systems.bouncing_ball(g=1.0, A=A, omega=1.0, r=0.8)
    phase = np.arccos(fold / A)
    top = [A * np.sin(phase) + 0.5 * np.pi**2, 0.0]
    start = phase + np.pi, phase + np.pi + 0.1
    orbit = fs.find_orbit(model, fs.simulate(model, top, t=start))
    (impact,) = orbit.trajectory.resets
    assert impact.time % (2 * np.pi) == pytest.approx(phase, abs=1e-13)
    assert impact.before[1] == pytest.approx(-np.pi, abs=1e-13)
    trace = -1.6 + 1.8**2 * (1 - A * np.sin(phase))
    assert orbit.multipliers.sum().real == pytest.approx(trace, abs=1e-12)
    assert np.prod(orbit.multipliers).real == pytest.approx(0.64, abs=1e-13)
    branch = fs.continue_orbits(
        orbit, "A", over=(0.3, 1.2), continuation=fs.Continuation(max_step=0.2)
    )
    assert branch.special("LPC")[0].parameters["A"] == pytest.approx(fold, abs=1e-13)
    assert branch.special("PD")[0].parameters["A"] == pytest.approx(doubling, abs=1e-13)
    # the fold in two parameters
    curve = fs.continue_points(
        branch.special("LPC")[0],
        ("r", "A"),
        {"r": (0.6, 0.9), "A": (0.1, 0.9)},
        continuation=fs.Continuation(max_step=0.3),
    )
    assert curve["A"] == pytest.approx([bounce(e)[0] for e in curve["r"]], abs=1e-11)


def test_a_completed_chatter_gives_two_multipliers_zero():
    """The ball leaves the table where its acceleration is −g, chatters and rests again."""
    model = fs.systems.bouncing_ball(g=1.0, A=0.3, omega=2.0, r=0.3)
    orbit = fs.find_orbit(model, [1.0, 0.0])
    assert orbit.outcome.success
    assert (orbit.multipliers == 0).all()
    assert np.isneginf(orbit.log_multipliers).all()
    rest = next(s for s in orbit.trajectory.segments if "at rest" in s.region)
    assert np.sin(2 * rest.end) == pytest.approx(1 / 1.2, abs=1e-12)
    first = orbit.trajectory.resets[0].time
    phase, speed = rest.end % np.pi, 0.6 * np.cos(2 * rest.end)

    def height(time):
        flight = time - phase
        return 0.25 + speed * flight - 0.5 * flight**2 - 0.3 * np.sin(2 * time)

    falls = brentq(height, phase + 0.5, phase + 2.0, xtol=1e-15)
    assert (first - falls) % np.pi == pytest.approx(0, abs=1e-12) or (
        first - falls
    ) % np.pi == pytest.approx(np.pi, abs=1e-12)
    assert len(orbit.trajectory.resets) > 10
    branch = fs.continue_orbits(
        orbit, "A", over=(0.299, 0.301), continuation=fs.Continuation(max_step=0.5)
    )
    assert {str(outcome.code) for outcome in branch.outcomes} == {"end of range"}
    assert (branch.multipliers == 0).all()


def test_a_rest_that_ends_in_sticking():
    """With friction the contact force vanishes while the velocity remains 0."""
    f, w, mu = sp.symbols("f w mu")
    block = fs.Model(
        {x: v, v: f * sp.cos(w * t) - x - mu * sp.sign(v)},
        parameters={f: 1.5, w: 0.3, mu: 0.2},
        resets={x >= sp.Rational(1, 2): {v: -v / 2}},
    )
    orbit = fs.find_orbit(block, fs.simulate(block, [0, 0], periods=10))
    assert orbit.outcome.success
    assert orbit.outcome.notes == ()
    assert (orbit.multipliers == 0).all()
    route = orbit.itinerary
    rest = route.index("S1 at rest on x = 1/2")
    assert route[rest + 1] == "S1|S2"


def test_leaky_integrate_and_fire_in_closed_form():
    """τ v' = I − v, reset from 1 to 0: the period log(I/(I − 1)), the multiplier 1 alone."""
    current, u, b = sp.symbols("I u b")
    model = fs.Model(
        {v: current - v, u: -b * u},
        parameters={current: 1.5, b: 0.3},
        resets={v >= 1: {v: 0, u: u + 0.2}},
    )
    orbit = fs.find_orbit(model, [0.2, 0.1])
    period = np.log(3)
    assert orbit.outcome.success
    assert orbit.period == pytest.approx(period, abs=1e-13)
    left = np.exp(-0.3 * period)
    (spike,) = orbit.trajectory.resets
    assert spike.after == pytest.approx([0, 0.2 / (1 - left)], abs=1e-13)
    assert orbit.trivial is not None
    assert np.sort(orbit.multipliers.real) == pytest.approx([left, 1], abs=1e-12)


def test_a_kick_in_each_period():
    """x' = −x + 1 at t = kT: x after a kick is 1/(1 − exp(−T)), and the multiplier exp(−T)."""
    T = sp.Symbol("T")
    model = fs.Model({x: -x}, parameters={T: 1.7}, resets={sp.Eq(sp.Mod(t, T), 0): {x: x + 1}})
    orbit = fs.find_orbit(model, [0.5])
    assert orbit.outcome.success
    assert orbit.period == pytest.approx(1.7, rel=1e-15)
    (kick,) = orbit.trajectory.resets
    assert kick.after[0] == pytest.approx(1 / (1 - np.exp(-1.7)), abs=1e-14)
    assert orbit.multipliers[0] == pytest.approx(np.exp(-1.7), abs=1e-14)


def test_a_branch_over_the_period_of_the_kicks():
    """x'' + 0.2 x' + x = 0 with v → v + r at t = kT: the state after a kick, for every T."""
    T = sp.Symbol("T")
    model = fs.Model(
        {x: v, v: -x - v / 5},
        parameters={T: 2, r: 0.5},
        resets={sp.Eq(sp.Mod(t, T), 0): {v: v + r}},
    )
    branch = fs.continue_orbits(
        fs.find_orbit(model, [0, 0]), "T", over=(1.8, 2.2), continuation=fs.Continuation(max_step=1)
    )
    A = np.array([[0.0, 1.0], [-1.0, -0.2]])
    for period, orbit in zip(branch.values, branch.orbits, strict=True):
        (kick,) = orbit.trajectory.resets
        exact = np.linalg.solve(np.eye(2) - expm(A * period), [0, 0.5])
        assert kick.after == pytest.approx(exact, abs=1e-13)


def test_a_threshold_that_is_grazed_ends_a_branch():
    """v' = I + a cos t − v below 1: the largest v is I + a/√2, and the reset to 0 is a jump."""
    current, a = sp.symbols("I a")
    model = fs.Model(
        {v: current + a * sp.cos(t) - v}, parameters={current: 0.8, a: 0.2}, resets={v >= 1: {v: 0}}
    )
    branch = fs.continue_orbits(
        fs.find_orbit(model, [0.8]), "a", over=(0.2, 0.4), continuation=fs.Continuation(max_step=1)
    )
    (point,) = branch.special("GR")
    assert point.parameters["a"] == pytest.approx(0.2 * np.sqrt(2), abs=1e-13)
    assert point.exponent == 0
    assert branch.outcomes[1].code == "end at a contact"
    assert "discontinuous" in branch.outcomes[1].message


def test_a_spiking_neuron_satisfies_liouvilles_formula():
    """det M = Π v'⁺/v'⁻ over the spikes times exp of the integral of the divergence."""
    neuron = fs.systems.izhikevich(c=-65, d=8)
    orbit = fs.find_orbit(neuron, [-65, -5], period=40)
    assert orbit.outcome.success
    (spike,) = orbit.trajectory.resets
    assert spike.after == pytest.approx([-65, spike.before[1] + 8], abs=1e-13)

    def rate(state):
        return 0.04 * state[0] ** 2 + 5 * state[0] + 140 - state[1] + 10

    run = orbit.trajectory
    points, weights = np.polynomial.legendre.leggauss(20)
    total = 0.0
    for begin, length, *_ in run.steps:
        voltage = run(begin + 0.5 * length * (points + 1))[0]
        total += 0.5 * length * weights @ (0.08 * voltage + 5 - 0.02)
    expected = total + np.log(abs(rate(spike.after) / rate(spike.before)))
    assert orbit.trivial is not None
    assert orbit.log_multipliers.sum() == pytest.approx(expected, abs=1e-10)


class Buck:
    """The T-periodic orbit of the converter: open for δ, then closed, with matrix exponentials.

    x' = A x + b u; the orbit solves x = Φ(T − δ) Φ(δ) x + (1 − Φ(T − δ)) x_on, and
    a (v(δ) − V_ref) is the sawtooth at δ.
    """

    def __init__(self, source):
        R, L, C, self.T = 22.0, 0.02, 47e-6, 4e-4
        self.A = np.array([[-1 / (R * C), 1 / C], [-1 / L, 0.0]])
        self.on = -np.linalg.solve(self.A, [0.0, source / L])
        self.delta = brentq(self._gap, 1e-6, 3.99e-4, xtol=1e-18)

    def _states(self, delta):
        one, two = expm(self.A * delta), expm(self.A * (self.T - delta))
        start = np.linalg.solve(np.eye(2) - two @ one, self.on - two @ self.on)
        return one, two, start, one @ start

    def _gap(self, delta):
        state = self._states(delta)[3]
        return 8.4 * (state[0] - 11.3) - (3.8 + 4.4 * delta / self.T)

    @property
    def multipliers(self):
        one, two, _, state = self._states(self.delta)
        jump = -self.A @ self.on
        slope = 8.4 * (self.A @ state)[0] - 4.4 / self.T
        return np.linalg.eigvals(two @ (np.eye(2) + np.outer(jump, [8.4, 0.0]) / slope) @ one)


def test_the_converter_doubles_its_period_as_its_stroboscopic_map():
    exact, model = Buck(24.0), fs.systems.buck_converter(V_in=24.0)
    orbit = fs.find_orbit(model, [12.0, 0.5])
    assert orbit.outcome.success
    (closes,) = orbit.trajectory.crossings(direction=-1)
    assert closes.time % 4e-4 == pytest.approx(exact.delta, rel=1e-11)
    assert closes.state == pytest.approx(exact._states(exact.delta)[3], rel=1e-12)
    expected = np.sort_complex(exact.multipliers)
    assert np.sort_complex(orbit.multipliers) == pytest.approx(expected, abs=1e-11)
    branch = fs.continue_orbits(
        orbit, "V_in", over=(24, 25), continuation=fs.Continuation(max_step=0.5)
    )
    doubles = brentq(lambda source: Buck(source).multipliers.real.min() + 1, 24.4, 24.6)
    assert branch.special("PD")[0].parameters["V_in"] == pytest.approx(doubles, abs=1e-9)
    assert doubles == pytest.approx(24.516, abs=1e-3)
    # the period as the parameter: the instants move with it
    branch = fs.continue_orbits(
        orbit, "T", over=(3.95e-4, 4.05e-4), continuation=fs.Continuation(max_step=0.5)
    )
    assert branch.period == pytest.approx(branch.values, rel=1e-14)
    assert {str(outcome.code) for outcome in branch.outcomes} == {"end of range"}


def test_relay_feedback_satisfies_the_half_period_equation():
    """x' = A x + b u with u = ±1 and hysteresis: E (x₀ − x_u) + x_u = −x₀ after half a period."""
    y, z, q, e = sp.symbols("y z q e")
    plant = fs.Model(
        {x: y, y: z, z: -x - 3 * y - 2 * z + 1 - 2 * q},
        parameters={e: 0.1},
        switches={q: (x > e, x < -e)},
    )
    A = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, -3.0, -2.0]])
    pushed = np.array([-1.0, 0.0, 0.0])

    def start(half):
        E, unit = expm(A * half), np.eye(3)
        return np.linalg.solve(-unit - E, (unit - E) @ pushed)

    def half_period(width):
        return brentq(lambda half: start(half)[0] - width, 1.0, 5.0, xtol=1e-15)

    orbit = fs.find_orbit(plant, {"x": 0.3, "y": 0, "z": 0, "q": 0})
    assert orbit.outcome.success
    half = half_period(0.1)
    assert orbit.period == pytest.approx(2 * half, abs=1e-13)
    (on,) = orbit.trajectory.switches("q", value=1)
    state = start(half)
    assert on.state == pytest.approx(state, abs=1e-13)
    before, after = A @ state + [0, 0, 1], A @ state - [0, 0, 1]
    S = np.eye(3) + np.outer(after - before, [1, 0, 0]) / before[0]
    expected = np.linalg.eigvals(expm(A * half) @ S) ** 2
    assert np.sort(orbit.multipliers.real) == pytest.approx(np.sort(expected.real), abs=1e-12)
    branch = fs.continue_orbits(
        orbit, "e", over=(0.08, 0.12), continuation=fs.Continuation(max_step=0.5)
    )
    exact = [2 * half_period(width) for width in branch.values]
    assert branch.period == pytest.approx(exact, abs=1e-12)
    assert all(len(one.trajectory.switches) == 2 for one in branch.orbits)


def test_branches_with_resets_are_saved(response, tmp_path):
    path = tmp_path / "branch.npz"
    response.save(path)
    loaded = fs.load(path)
    for one, two in zip(response.orbits, loaded.orbits, strict=True):
        assert (one.trajectory.reset_table == two.trajectory.reset_table).all()
    value = 0.5 * (response.values[0] + response.values[1])
    (orbit,), (near,) = (some.at(omega=value) for some in (response, loaded))
    assert near["max(x)"] == pytest.approx(orbit["max(x)"], abs=1e-3)
    assert len(near.trajectory.resets) == 1
