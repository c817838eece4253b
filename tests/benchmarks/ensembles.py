"""Many gears over one slow period, extremes and hits of each, against SciPy and C.

The trajectories are a grid over D and C; SciPy integrates a few of them, with the crossings
and the turning points as events.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import numpy as np
from scipy.integrate import solve_ivp

import fastslow as fs
from tests.benchmarks.measuring import Line, medians
from tests.benchmarks.references import gear_in_c

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


def lines() -> Iterator[Line]:
    """Extremes and crossings of 10,000 gears over one slow period."""
    model = fs.systems.harmonic_gear(A=A, B=B, omega=OMEGA)
    D, C = GRID
    work = f"{len(D):,} trajectories, extremes and hits"

    def ours(count: int, threads: int) -> fs.Ensemble:
        some = slice(None, None, len(D) // count)
        parameters = {"D": D[some], "C": C[some]}
        return fs.simulate_many(
            model, [0, 0], parameters=parameters, periods=1, execution=fs.Execution(threads=threads)
        )

    few = 8
    mine = ours(few, 1)
    some = np.stack([D, C], 1)[:: len(D) // few]
    apart = np.abs(mine.maximum[:, 0] - [scipy_with_events(*v)[1] for v in some]).max()
    alone = medians({"": lambda: [scipy_with_events(*v) for v in some]}, repeats=1)[""] / few
    # processor time of one trajectory
    one = medians({"": lambda: ours(len(D), 1)}, repeats=5)[""] / len(D)
    steps = ours(len(D), 1).n_steps.mean()
    yield Line(
        work, "fastslow, one thread", 1e3 / one, "1/s", None, f"{1e6 * one / steps:.0f} ns/step"
    )
    for threads in (1, 2):
        fastest = min(_elapsed(lambda n=threads: ours(len(D), n)) for _ in range(5))  # type: ignore[misc]
        rate = len(D) / fastest
        yield Line(work, f"fastslow, {threads} threads, by the clock", rate, "1/s")
    yield Line(
        work,
        "SciPy, DOP853 with events",
        1e3 / alone,
        "1/s",
        alone / one,
        f"maxima differ by {apart:.0e}",
    )
    library = gear_in_c()
    if library is None:
        return
    extremes, hits = np.empty((len(D), 2)), np.empty(len(D), dtype=np.dtype("l"))

    def in_c(threads: int) -> None:
        library.many(A, B, C, D, OMEGA, TOL, PERIOD, len(D), threads, extremes, hits)

    peer = medians({"": lambda: in_c(1)}, repeats=5)[""] / len(D)
    apart = np.abs(extremes[:, 1] - ours(len(D), 2).maximum[:, 0]).max()
    yield Line(
        work, "C for this model", 1e3 / peer, "1/s", peer / one, f"maxima differ by {apart:.0e}"
    )
    fastest = min(_elapsed(lambda: in_c(2)) for _ in range(5))
    yield Line(work, "C, 2 threads, by the clock", len(D) / fastest, "1/s")


def _elapsed(function: Callable[[], object]) -> float:
    begin = time.perf_counter()
    function()
    return time.perf_counter() - begin
