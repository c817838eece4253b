"""What the tolerance promises: against quadruple precision, matrix exponentials and mpmath."""

import json
from pathlib import Path

import mpmath
import numpy as np
import pytest
import sympy as sp

from fastslow.model.model import Model
from fastslow.simulation.settings import Integration
from fastslow.simulation.trajectories import simulate

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
    assert np.abs(run(times) - exact).max() < PROMISED * tol
    assert len(run.crossings) == 41


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
        assert np.abs(run(times) - exact).max() < PROMISED * tol
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
