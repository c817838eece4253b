"""Many gears over one slow period, extremes and hits of each, against SciPy in the same run.

Run with ``python tests/benchmarks/bench_ensembles.py``. The trajectories are a
grid over D and C; SciPy integrates a few of them on one thread, with the
crossings and the turning points as events.
"""

from __future__ import annotations

import time

import numpy as np
from scipy.integrate import solve_ivp

import fastslow as fs

A, B, OMEGA = 41.67, 2.372, 0.01
TOL = 1e-9
PERIOD = 2 * np.pi / OMEGA
GRID = [g.ravel() for g in np.meshgrid(np.linspace(0.05, 0.5, 100), np.linspace(1.0, 5.0, 100))]


def scipy_with_events(D: float, C: float) -> tuple[float, float, int]:
    """Extremes of x and the number of crossings, by DOP853."""

    def rates(t: float, u: np.ndarray) -> tuple[float, float]:
        x, v = u
        contact = x - D if x > D else x + D if x < -D else 0.0
        return v, B + C * np.sin(OMEGA * t) - v - (x**2 + A) * contact

    events = [lambda t, u: u[0] - D, lambda t, u: u[0] + D, lambda t, u: u[1]]
    run = solve_ivp(rates, (0, PERIOD), (0, 0), "DOP853", events=events, rtol=TOL, atol=TOL)
    turning = np.append(run.y_events[2][:, 0], run.y[0, [0, -1]])
    return turning.min(), turning.max(), sum(map(len, run.t_events[:2]))


def main() -> None:
    model = fs.systems.harmonic_gear(A=A, B=B, omega=OMEGA)
    D, C = GRID

    def ours(count: int, threads: int | None) -> fs.Ensemble:
        some = slice(None, None, len(D) // count)
        parameters = {"D": D[some], "C": C[some]}
        return fs.simulate_many(model, [0, 0], parameters=parameters, periods=1, threads=threads)

    few = 8
    ours(few, 1)
    begin = time.perf_counter()
    theirs = [scipy_with_events(*values) for values in np.stack([D, C], 1)[:: len(D) // few]]
    slow = few / (time.perf_counter() - begin)
    mine = ours(few, 1)
    apart = np.abs(mine.maximum[:, 0] - [high for _, high, _ in theirs]).max()
    print(f"SciPy, one thread: {slow:.1f} trajectories/s; largest maxima differ by {apart:.1e}")
    for threads in (1, None):
        begin = time.perf_counter()
        many = ours(len(D), threads)
        fast = len(many) / (time.perf_counter() - begin)
        name = "one thread" if threads else "all cores"
        print(f"fastslow, {name}: {fast:.0f} trajectories/s, {fast / slow:.0f} x")


if __name__ == "__main__":
    main()
