"""What the tolerance promises: against quadruple precision, matrix exponentials and mpmath."""

import json
import math
from pathlib import Path

import mpmath
import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

from fastslow.model.invariance import jointly_invariant_states
from fastslow.model.model import Model
from fastslow.simulation.many import simulate_many
from fastslow.simulation.one import simulate
from fastslow.simulation.settings import Integration

pytestmark = pytest.mark.slow

x, y, z, v, t = sp.symbols("x y z v t")
a, mu, k, c, D = sp.symbols("a mu k c D")
P1 = json.loads((Path(__file__).parent / "gear_p1.json").read_text())
TOLERANCES = [10.0**-n for n in range(6, 13)]

#: Largest error in units of the tolerance.
PROMISED = 10.0


@pytest.mark.parametrize("tol", TOLERANCES)
def test_the_whole_run_of_the_gear(gear, tol):
    times = [float(s["t"]) for s in P1["samples"]]
    exact = np.array([[float(s["x"]), float(s["v"])] for s in P1["samples"]]).T
    run = simulate(gear, [0, 0], periods=3, integration=Integration(rtol=tol))
    assert np.abs(run(times) - exact).max() < tol
    assert len(run.crossings) == 41


def together(model):
    return jointly_invariant_states(model.partition)


def test_rounding_limits_the_gear_at_1e_14(gear):
    times = [float(s["t"]) for s in P1["samples"]]
    exact = np.array([[float(s["x"]), float(s["v"])] for s in P1["samples"]]).T
    for tol in (1e-14, 1e-15):
        run = simulate(gear, [0, 0], periods=3, integration=Integration(rtol=tol))
        # 3e-14 measured, over 1600 steps: 1/4 unit of the last place of x each
        assert np.abs(run(times) - exact).max() < 1e-13


class PiecewiseLinear:
    """x'' + c x' + x + k dead(x) = a cos t in closed form between crossings, 30 digits."""

    def __init__(self, c, k, D, a):
        self.c, self.k, self.D, self.a = map(mpmath.mpf, (c, k, D, a))

    def motion(self, side, start, state):
        """The solution of one region through a state."""
        stiff = 1 + (self.k if side else 0)
        offset = self.k * self.D * side / stiff
        matrix = mpmath.matrix([[0, 1], [-stiff, -self.c]])
        # the particular solution is the real part of p exp(i t)
        p = self.a / (stiff - 1 + mpmath.j * self.c)

        def driven(s):
            e = p * mpmath.expj(s)
            return mpmath.matrix([e.real + offset, (mpmath.j * e).real])

        free = mpmath.matrix(state) - driven(start)
        return lambda s: mpmath.expm(matrix * (s - start)) * free + driven(s)

    def follow(self, state, times, guesses):
        """States at the times, and the crossings nearest to first guesses."""
        now, side, found, crossings = mpmath.mpf(0), 0, [], []
        for guess in [*guesses, None]:
            solution = self.motion(side, now, state)
            end = mpmath.inf
            if guess is not None:
                edge = side * self.D if side else mpmath.sign(solution(guess)[0]) * self.D
                end = mpmath.findroot(lambda s, u=solution, e=edge: u(s)[0] - e, guess)
                crossings.append(end)
            found += [solution(s) for s in times if now <= s < end]
            if guess is not None:
                now, state = end, solution(end)
                side = 0 if side else int(mpmath.sign(edge))
        return np.array([[float(u[0]), float(u[1])] for u in found]).T, crossings


def test_the_whole_run_on_contracting_linear_regions():
    dead = sp.Piecewise((x - D, x > D), (x + D, x < -D), (0, True))
    model = Model(
        {x: v, v: a * sp.cos(t) - c * v - x - k * dead},
        parameters={c: 1, k: 20, D: 0.25, a: 2},
    )
    best = simulate(model, [0, 0], t=(0, 25), integration=Integration(rtol=1e-14))
    times = np.linspace(0, 25, 101)[:-1]
    with mpmath.workdps(30):
        form = PiecewiseLinear(1, 20, 0.25, 2)
        guesses = [mpmath.mpf(c.time) for c in best.crossings]
        exact, crossings = form.follow([0, 0], list(map(mpmath.mpf, times)), guesses)
    assert len(crossings) > 10
    for tol in TOLERANCES:
        run = simulate(model, [0, 0], t=(0, 25), integration=Integration(rtol=tol))
        assert np.abs(run(times) - exact).max() < tol
        for crossing, time in zip(run.crossings, crossings, strict=True):
            assert abs(crossing.time - float(time)) < PROMISED * tol / abs(crossing.state[1])
    # rounding alone: 25 units of time, states of size 1
    assert np.abs(best(times) - exact).max() < 2e-14


VAN_DER_POL = Model({x: y, y: mu * (1 - x**2) * y - x}, parameters={mu: 5})
LORENZ = Model({x: 10 * (y - x), y: x * (28 - z) - y, z: x * y - sp.Rational(8, 3) * z})
RELAY = Model({x: v, v: -v - sp.sign(x + v / 5) + a * sp.sin(t)}, parameters={a: 0.5})


def van_der_pol(s, u):
    return [u[1], 5 * (1 - u[0] ** 2) * u[1] - u[0]]


def lorenz(s, u):
    p, q, r = u
    return [10 * (q - p), p * (28 - r) - q, p * q - mpmath.mpf(8) / 3 * r]


def relay(mode):
    """The motion on one side, or the sliding one on x + v/5 = 0: v' = -5 v."""
    if "|" in mode:
        return lambda s, u: [u[1], -5 * u[1]]
    side = 1 if mode == "S1" else -1
    return lambda s, u: [u[1], -u[1] - side + mpmath.sin(s) / 2]


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    ("model", "start", "end", "rates"),
    [
        (VAN_DER_POL, [2, 0], 12, lambda mode: van_der_pol),
        (LORENZ, [1, 1, 20], 6, lambda mode: lorenz),
        (RELAY, [1, 0], 8, relay),
    ],
    ids=["van der Pol", "Lorenz", "relay"],
)
@pytest.mark.parametrize("tol", [1e-6, 1e-9, 1e-12])
def test_every_step(model, start, end, rates, tol):
    run = simulate(model, start, t=(0, end), integration=Integration(rtol=tol))
    modes = {run.modes[int(step[2])] for step in run.steps}
    assert modes == ({"S1", "S2", "S1|S2"} if model is RELAY else {"S1"})
    # the first and last steps of every mode, and some between
    chosen = {0, len(run.steps) - 1, *range(0, len(run.steps), 1 + len(run.steps) // 8)}
    chosen |= {int(np.flatnonzero(run.steps[:, 2] == m)[0]) for m in np.unique(run.steps[:, 2])}
    for i in sorted(chosen):
        begin, length, mode = run.steps[i, :3]
        inside = begin + length * np.array([0.3, 0.7, 1.0])
        inside[-1] = np.nextafter(inside[-1], begin)
        with mpmath.workdps(20):
            u0 = [mpmath.mpf(float(u)) for u in run(begin)]
            exact = mpmath.odefun(rates(run.modes[int(mode)]), mpmath.mpf(begin), u0)
            reference = np.array([[float(q) for q in exact(mpmath.mpf(s))] for s in inside]).T
        error = np.abs(run(inside) - reference) / (1 + np.abs(reference))
        assert error.max() < PROMISED * tol


W = sp.Symbol("w")


def bernoulli(time, start="1e-3"):
    """x' = w x − x³, w = −1 + t/100: u = x⁻² obeys u' = −2 w u + 2."""
    with mpmath.workdps(50):
        end = mpmath.mpf(time)

        def exponent(s):
            return -s + s * s / 200

        grown = mpmath.quad(lambda s: mpmath.exp(2 * exponent(s)), mpmath.linspace(0, end, 21))
        u = mpmath.exp(-2 * exponent(end)) * (mpmath.mpf(start) ** -2 + 2 * grown)
        return float(1 / mpmath.sqrt(u))


@pytest.mark.sample(1)
@pytest.mark.parametrize("implicit", [True, False])
@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-12])
def test_a_passage_along_an_invariant_zero(rtol, implicit):
    model = Model({x: W * x - x**3}, forcing={W: -1 + t / 100})
    settings = Integration(rtol=rtol, implicit=implicit)
    run = simulate(model, [1e-3], t=(0, 200), integration=settings)
    times = [100, 166, 180, 200]
    expected = [bernoulli(s) for s in times]
    assert expected[2] == pytest.approx(1.5e-11, rel=0.02)
    assert expected[3] == pytest.approx(1.0e-3, rel=1e-3)
    assert run(times)[0] == pytest.approx(expected, rel=5 * rtol)
    many = simulate_many(model, [1e-3], t=(0, 200), samples=times, integration=settings)
    assert many["x"][0] == pytest.approx(expected, rel=5 * rtol)


def test_a_linear_growth_returns_from_1e_58():
    model = Model({x: W * x}, forcing={W: -sp.Rational(1, 2) + t / 1000})
    run = simulate(model, [1e-3], t=(0, 1000))
    assert run(500.0)[0] == pytest.approx(1e-3 * math.exp(-125), rel=1e-8)
    assert run.end[1] == pytest.approx(1e-3, rel=1e-8)
    assert str(run.outcome) == "reached t = 1000, the end of the time span."
    # 1e-3 exp(−800) is no number any more
    deep = simulate(model, [1e-3], t=(-1100, 2100))
    assert deep.end[1] == 0
    assert "x fell below 1e-300, the smallest number kept, at t = " in str(deep.outcome)
    assert "its logarithm" in str(deep.outcome)
    brief = simulate(model, [1e-3], t=(-1100, 2100), dense=False)
    assert "its logarithm" in str(brief.outcome)
    many = simulate_many(model, [1e-3], t=(-1100, 2100))
    assert "x fell below 1e-300, the smallest number kept, in 1 of 1" in repr(many)


def test_an_absolute_tolerance_that_decides_says_so():
    model = Model({x: W * x - x**3}, forcing={W: -1 + t / 100})
    run = simulate(model, [1e-3], t=(0, 230), integration=Integration(atol=1e-12))
    assert "x fell below its atol = 1e-12" in str(run.outcome)
    assert run.outcome
    summed = {"t": (0, 230), "integration": Integration(atol=1e-12)}
    brief = simulate(model, [1e-3], samples=100, dense=False, **summed)
    assert "x fell below its atol = 1e-12" in str(brief.outcome)
    many = simulate_many(model, [[1e-3], [1e-2]], **summed)
    assert "x fell below its atol = 1e-12 in 2 of 2" in repr(many)
    relative = simulate_many(model, [[1e-3], [1e-2]], t=(0, 230))
    assert relative.notes == ()


UNITS = [
    (VAN_DER_POL, [2.0, 0.0], 12.0),
    (LORENZ, [1.0, 1.0, 20.0], 3.0),
    (RELAY, [1.0, 0.0], 8.0),
    (Model({x: W * x - x**3 + y, y: -x}, forcing={W: sp.sin(t)}), [0.0, 0.5], 20.0),
    (Model({x: v, v: W - v - 40 * sp.Max(x - 1, 0)}, forcing={W: 1 + sp.cos(t)}), [0, 0], 20.0),
]


def in_units(model, factors, unit):
    """The same model with every state, and time, measured in other units."""
    symbols = [sp.Symbol(name) for name in model.states]
    powers = {s: s / f for s, f in zip(symbols, factors, strict=True)}
    powers[t] = t / unit
    plain = {sp.Symbol(s.name, real=True): s for s in (*symbols, t, W)}
    rates = {
        s: (f * model.rates[s].xreplace(plain)).xreplace(powers) / unit
        for s, f in zip(symbols, factors, strict=True)
    }
    forcing = {w: law.xreplace(plain).xreplace({t: t / unit}) for w, law in model.forcing.items()}
    return Model(rates, forcing=forcing, parameters=dict(model.parameters))


@pytest.mark.sample(3)
@pytest.mark.parametrize("case", range(len(UNITS)))
def test_a_run_is_the_same_in_other_units(case):
    model, start, end = UNITS[case]
    settings = Integration(implicit=False)
    run = simulate(model, start, t=(0, end), integration=settings)
    rng = np.random.default_rng(case)
    for _ in range(2):
        # powers of two: what differs is not rounding
        factors = [sp.Integer(2) ** int(k) for k in rng.integers(-20, 21, len(start))]
        unit = sp.Integer(2) ** int(rng.integers(-20, 21))
        numbers = np.array([float(f) for f in factors])
        other = simulate(
            in_units(model, factors, unit),
            numbers * start,
            t=(0, end * float(unit)),
            integration=settings,
        )
        assert len(other.steps) == len(run.steps)
        assert other.end[1:] / numbers == pytest.approx(run.end[1:], rel=1e-7)
        assert other.itinerary == run.itinerary


S, E, sick, beta, sigma, gamma = sp.symbols("S E sick beta sigma gamma")


@pytest.mark.parametrize("rtol", [1e-6, 1e-9])
def test_an_epidemic_passes_below_its_threshold_and_back(rtol):
    """E' = b S I − s E and I' = s E − g I vanish together, neither does alone.

    The logarithms of E and I, by SciPy, are the reference: both fall to 1e-20 and return.
    """
    season = 1 + sp.Rational(9, 10) * sp.cos(t / 40)
    model = Model(
        {
            S: -beta * W * S * sick,
            E: beta * W * S * sick - sigma * E,
            sick: sigma * E - gamma * sick,
        },
        forcing={W: season},
        parameters={beta: 1, sigma: 0.5, gamma: 1},
    )
    assert together(model) == (("E", "sick"),)

    def logarithms(s, u):
        force = (1 + 0.9 * np.cos(s / 40)) * u[0]
        return [
            -force * np.exp(u[2]),
            force * np.exp(u[2] - u[1]) - 0.5,
            0.5 * np.exp(u[1] - u[2]) - 1,
        ]

    start, end = 2.2 * 40, 9.0 * 40
    reference = solve_ivp(
        logarithms,
        (start, end),
        [1.0, math.log(1e-9), math.log(1e-9)],
        "DOP853",
        rtol=1e-12,
        atol=1e-14,
        dense_output=True,
    )
    times = np.linspace(start, end, 30)
    exact = np.exp(reference.sol(times)[1:])
    assert exact.min() < 1e-20
    run = simulate(model, [1, 1e-9, 1e-9], t=(start, end), integration=Integration(rtol=rtol))
    assert np.abs(run(times)[1:] / exact - 1).max() < 300 * rtol
    # zero is zero, and nothing else is kept from its end
    none = simulate(model, [1, 0, 0], t=(start, end), integration=Integration(rtol=rtol))
    assert none.outcome
    assert none.end[1:].tolist() == [1, 0, 0]
    half = simulate(model, [1, 0, 1e-9], t=(start, end), integration=Integration(rtol=rtol))
    assert half.outcome
    assert len(half.steps) < 2 * len(run.steps)


def test_states_that_vanish_together_are_told_from_an_oscillation():
    assert together(Model({x: v, v: -x, y: 1 - y})) == ()
    # a power that is not known may be less than one
    assert together(Model({x: v - x**a, v: x - v, y: 1 - y}, parameters={a: 2})) == ()
    assert together(Model({x: v - x, v: x - 2 * v})) == ()
    assert together(Model({x: v - x, v: x - 2 * v, y: 1 - y + x})) == (("x", "v"),)
    fractions = Model({S: 1 - S * sick / (S + E), E: S * sick / (S + E) - E, sick: E - 2 * sick})
    assert together(fractions) == (("E", "sick"),)
    assert together(Model({x: y, y: z, z: x, v: -v + 1 + x})) == (("x", "y", "z"),)


@pytest.mark.parametrize("moving", [False, True])
def test_crossings_keep_the_memory_of_a_state_that_is_a_factor_of_its_rate(moving):
    """y = exp(-20 t) until x + y = c, x = t + (1 - cos t)/3, then grows at 10: to 8 digits.

    The location of the crossing is a rounding error of x and t, not of y.
    """
    way = t + (1 - sp.cos(t)) / 3
    for threshold in (4.1, 4.7, 5.3):
        height = (way if moving else x) + y - threshold
        rate = sp.Piecewise((-20, height < 0), (10, True))
        run = simulate(Model({x: 1 + sp.sin(t) / 3, y: y * rate}), [0, 1], t=(0, 8))
        (crossing,) = run.crossings
        assert float(way.subs(t, crossing.time)) == pytest.approx(threshold, abs=1e-9)
        exponent = 10 * (8 - crossing.time) - 20 * crossing.time
        assert run.end[2] == pytest.approx(math.exp(exponent), rel=1e-8)


def test_a_state_is_moved_onto_an_interface_whatever_the_units_of_the_others():
    """Sliding on x + y = 1: scaling y by 1e6 changes y by rounding of y alone."""
    values = []
    for unit in (1.0, 1e6):
        height = x + y / unit - 1
        model = Model({x: sp.cos(t) - sp.sign(height) * 3, y: unit * sp.sin(2 * t)})
        values.append(simulate(model, [0.5, 0.3 * unit], t=(0, 5)).end[1:] / [1, unit])
    assert values[1] == pytest.approx(values[0], abs=1e-12)
    assert values[0].sum() == pytest.approx(1, abs=1e-15)
