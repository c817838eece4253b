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

    def ours(count: int, threads: int) -> fs.Ensemble:
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
    print(f"SciPy, one thread: {slow:.2f} trajectories/s; largest maxima differ by {apart:.1e}")
    for threads in (1, 2):
        begin, used = time.perf_counter(), time.process_time()
        many = ours(len(D), threads)
        elapsed, used = time.perf_counter() - begin, time.process_time() - used
        fast = len(many) / elapsed
        # where other programs share the cores, the time of the processor says more
        print(
            f"fastslow, {threads} threads: {fast:.0f} trajectories/s, {fast / slow:.0f} x SciPy; "
            f"processor: {1e6 * used / len(many):.1f} us a trajectory, "
            f"{1e9 * used / many.n_steps.sum():.0f} ns a step"
        )


if __name__ == "__main__":
    main()
