"""Rest on walls under a load that jumps or has corners, against closed forms."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
import sympy as sp
from scipy.optimize import brentq, nnls

import fastslow as fs

pytestmark = pytest.mark.slow

x, v, y, u, t, w = sp.symbols("x v y u t w")
FINE = fs.Integration(rtol=1e-13)

#: Speed after an impact from which the rest of a chatter is a geometric series, to its square.
SLOW = 1e-6

#: Contact force of the reference that has vanished.
ROUNDING = 1e-12


@dataclass(frozen=True)
class Stop:
    """x'' = w − d x' − x + F p(t) below x = D, with restitution r and p of half period T.

    p is the sign of sin(πt/T), or |sin(πt/T)| if ``corner``.
    """

    w: float
    d: float
    F: float
    D: float
    r: float
    T: float
    corner: bool = False

    def load(self, profile):
        return w - self.d * v - x + self.F * profile

    def model(self, profile, **more):
        rates = {"x": v, "v": self.load(profile)} | more
        return fs.Model(rates, parameters={w: self.w}, resets={x >= self.D: {v: -self.r * v}})

    @property
    def profile(self):
        one = sp.sin(sp.pi * t / self.T)
        return sp.Abs(one) if self.corner else sp.sign(one)

    def force(self, time, side):
        """Acceleration into the wall at rest, in the half period with this sign."""
        k = np.pi / self.T
        return self.w - self.D + self.F * side * (np.sin(k * time) if self.corner else 1.0)

    def particular(self, time, side):
        """A solution without impacts, and its rate."""
        if not self.corner:
            return np.array([self.w + self.F * side + 0 * time, 0 * time])
        k = np.pi / self.T
        wave = self.F * side * np.exp(1j * k * time) / (1 - k * k + 1j * k * self.d)
        return np.array([self.w + wave.imag, (1j * k * wave).imag])

    def flown(self, begin, state, times, side):
        """States in flight, shape (2, n)."""
        rate = -self.d / 2 + 1j * np.sqrt(1 - self.d**2 / 4)
        first, speed = state - self.particular(begin, side)
        # (a + i b) e^(λt), of which the real part is the free motion
        c = first - 1j * (speed - rate.real * first) / rate.imag
        free = c * np.exp(rate * (times - begin))
        return self.particular(times, side) + np.array([free.real, (rate * free).real])

    def reference(self, state, end):
        """Final state, and intervals of rest."""
        now, state, rests = 0.0, np.array(state, dtype=float), []
        half = 0
        while now < end:
            side = 1 if half % 2 == 0 else -1
            half += 1
            stop = min(half * self.T, end)
            begin = now
            while now < stop:
                push = self.force(now, side)
                on = state[0] >= self.D - 1e-14
                if on and abs(state[1]) <= SLOW and push > ROUNDING:
                    now += 2 * abs(state[1]) / ((1 - self.r) * push)
                    after = self._release(now, stop, side)
                    if rests and rests[-1][1] == now:
                        rests[-1][1] = after
                    else:
                        rests.append([now, after])
                    now, state = after, np.array([self.D, 0.0])
                    continue
                now, state = self._flight(now, state, stop, side, on)
            assert now > begin
        return state, rests

    def _release(self, now, stop, side):
        times = np.linspace(now, stop, 400)
        negative = np.flatnonzero(self.force(times, side) < 0)
        if len(negative) == 0:
            return stop
        last = negative[0]
        return brentq(self.force, times[last - 1], times[last], args=(side,), xtol=1e-15)

    def _flight(self, now, state, stop, side, on):
        push = self.force(now, side)
        shortest = 1e-3
        if on and push > 0 and state[1] < 0:
            shortest = min(shortest, -0.5 * state[1] / push)
        near = now + np.geomspace(shortest, 0.01, 40)
        times = np.append(near, np.linspace(near[-1], max(stop, near[-1]), 400))
        times = np.append(times[times < stop], stop)
        beyond = np.flatnonzero(self.flown(now, state, times, side)[0] > self.D)
        if len(beyond) == 0:
            return stop, self.flown(now, state, stop, side)
        k = beyond[0]
        low = times[k - 1] if k else now
        hit = brentq(
            lambda time: self.flown(now, state, time, side)[0] - self.D, low, times[k], xtol=1e-15
        )
        return hit, np.array([self.D, -self.r * self.flown(now, state, hit, side)[1]])


def drawn(seed, count, corner=False):
    """Stops that rest in one half period and leave the wall in the other."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        w, d, D, r = rng.uniform([-0.3, 0.05, -0.2, 0.05], [0.3, 0.5, 0.2, 0.6])
        T = rng.uniform(2, 6)
        F = rng.uniform(1.2, 3) * max(abs(w - D), 0.2)
        F *= -1 if corner and w > D else 1
        yield Stop(*map(float, (w, d, F, D, r, T)), corner)


@pytest.mark.sample(1)
@pytest.mark.parametrize("corner", [False, True])
def test_rest_ends_where_the_load_jumps_or_vanishes(corner):
    """States, and times at which the rest ends, of random stops."""
    left = 0
    for stop in drawn(1, 12, corner):
        end = 5.3 * stop.T
        state, rests = stop.reference([stop.D, 0.0], end)
        run = fs.simulate(stop.model(stop.profile), [stop.D, 0], t=(0, end), integration=FINE)
        assert run.end[1:] == pytest.approx(state, abs=1e-12)
        # instants divide one rest into parts
        parts = [one for one in run.segments if "at rest" in one.region]
        begins = [one.start for one in parts]
        ends = [one.end for one in parts if one.end not in begins]
        assert ends == pytest.approx([one[1] for one in rests], abs=1e-11)
        left += sum(one[1] < end for one in rests)
    assert left > 12


def test_rest_ends_where_another_state_crosses_an_interface():
    """The load is the sign of y = sin(πt/T), the motion of a second oscillator."""
    for stop in drawn(2, 8):
        end, k = 5.3 * stop.T, np.pi / stop.T
        model = stop.model(sp.sign(y), **{"y": u, "u": -(k**2) * y})
        run = fs.simulate(model, [stop.D, 0, 0, k], t=(0, end), integration=FINE)
        state, _ = stop.reference([stop.D, 0.0], end)
        assert run.end[1:3] == pytest.approx(state, abs=1e-11)


def test_two_rests_under_one_load_end_apart():
    """Two stops in one model: a load that ends the rest on one wall, on both or on neither."""
    both = 0
    pairs = list(drawn(3, 12))
    for one, other in zip(pairs[::2], pairs[1::2], strict=True):
        one, other = replace(one, d=other.d, T=other.T), replace(other, w=one.w)
        second = {x: y, v: u}
        rates = {x: v, v: one.load(one.profile)}
        rates |= {y: u, u: other.load(one.profile).xreplace(second)}
        resets = {x >= one.D: {v: -one.r * v}, y >= other.D: {u: -other.r * u}}
        model = fs.Model(rates, parameters={w: one.w}, resets=resets)
        end = 5.3 * one.T
        run = fs.simulate(model, [one.D, 0, other.D, 0], t=(0, end), integration=FINE)
        expected = [stop.reference([stop.D, 0.0], end)[0] for stop in (one, other)]
        assert run.end[1:] == pytest.approx(np.concatenate(expected), abs=1e-11)
        both += any(" and " in segment.region for segment in run.segments)
    assert both > 1


def test_members_of_an_ensemble_leave_where_they_would_alone():
    stop = next(drawn(4, 1))
    values, end = np.linspace(stop.D - stop.F - 0.1, stop.D + stop.F + 0.1, 24), 5.3 * stop.T
    many = fs.simulate_many(
        stop.model(stop.profile),
        [stop.D, 0],
        parameters={"w": values},
        t=(0, end),
        integration=FINE,
        execution=fs.Execution(threads=1),
    )
    expected = [replace(stop, w=float(one)).reference([stop.D, 0.0], end)[0] for one in values]
    assert many.final == pytest.approx(np.array(expected), abs=1e-11)


def test_orbits_with_rest_that_ends_at_a_jump():
    """The state one period after the end of the rest is that of the reference; none depends on it.

    At such an orbit both multipliers vanish.
    """
    found = 0
    for stop in drawn(5, 6):
        state, rests = stop.reference([stop.D, 0.0], 8 * stop.T)
        orbit = fs.find_orbit(stop.model(stop.profile), [stop.D, 0])
        if len(rests) == 4:
            assert orbit.outcome, orbit
            assert orbit.multipliers == pytest.approx([0, 0], abs=1e-12)
            assert orbit.trajectory(_phase(orbit, 2 * stop.T)) == pytest.approx(state, abs=1e-10)
            found += 1
    assert found > 1


def _phase(orbit, period):
    """The time of the orbit at which the forcing begins."""
    return period * np.ceil(orbit.trajectory.span[0] / period)


def in_a_corner(normals, before, after):
    """A mass that rests where several walls meet, under a load that jumps at t = 1."""
    n = len(before)
    places, speeds = sp.symbols(f"x:{n}"), sp.symbols(f"v:{n}")
    step = (1 + sp.sign(t - 1)) / 2
    rates = dict(zip(places, speeds, strict=True))
    for speed, one, other in zip(speeds, before, after, strict=True):
        rates[speed] = int(one) + (int(other) - int(one)) * step
    resets = {}
    for normal in normals.tolist():
        into = sum(a * speed for a, speed in zip(normal, speeds, strict=True))
        share = sp.Rational(3, 2 * sum(a * a for a in normal))
        height = sum(a * place for a, place in zip(normal, places, strict=True))
        resets[height >= 0] = {
            speed: sp.expand(speed - share * a * into)
            for a, speed in zip(normal, speeds, strict=True)
            if a
        }
    return fs.Model(rates, resets=resets)


@pytest.mark.sample(1)
@pytest.mark.parametrize(("n", "count"), [(2, 6), (3, 3)])
def test_no_wall_pulls_at_a_corner(n, count):
    """The acceleration is that nearest to the load among those away from all walls.

    The load presses onto all walls at first. Then it presses onto one that another keeps the mass
    from.
    """
    rng = np.random.default_rng(6)
    while count:
        normals = rng.integers(-3, 4, (n, n))
        if abs(np.linalg.det(normals)) < 0.5:
            continue
        before = rng.integers(1, 4, n) @ normals
        after = rng.choice([-3, -2, -1, 1, 2, 3], n) @ normals
        forces, _ = nnls(normals.T.astype(float), after.astype(float))
        if not ((normals @ after > 0) & (forces == 0)).any():
            continue
        count -= 1
        run = fs.simulate(in_a_corner(normals, before, after), np.zeros(2 * n), t=(0, 2))
        rate = after - forces @ normals
        assert run.outcome, run
        assert run.end[1:] == pytest.approx(np.concatenate([rate / 2, rate]), abs=1e-12)
