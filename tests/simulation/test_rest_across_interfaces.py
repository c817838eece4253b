"""Rest on walls where the load jumps or has a corner, against flights in closed form."""

from dataclasses import dataclass

import numpy as np
import pytest
import sympy as sp
from scipy.linalg import expm
from scipy.optimize import brentq

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
        rates = {x: v, v: self.load(profile)} | more
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
