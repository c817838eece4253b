"""Overlays of runs on their diagrams, beside the runs themselves and a law's passage by SciPy.

Run with ``python -m tests.benchmarks.bench_overlays``. Everything is compiled before. No other
program lays a trajectory over a diagram; what can be compared is the passage that the error of
a law of delay is told by, which SciPy integrates by LSODA with rates in Python. Processor time.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import statistics
import time
from collections.abc import Callable, Iterator

import numpy as np
from scipy.integrate import solve_ivp

import fastslow as fs
from fastslow.passage.local_passages import Event, Place, reached_delay
from fastslow.passage.sites import site_of


def median(function: Callable[[], object], repeats: int = 15) -> float:
    """Median processor time of a call, in ms; it is called once before."""
    function()
    taken = []
    for _ in range(repeats):
        begin = time.process_time()
        function()
        taken.append(time.process_time() - begin)
    return 1e3 * statistics.median(taken)


def cases() -> Iterator[tuple[str, fs.Model, str, tuple[float, float], list[float], float]]:
    """Name, model, slow quantity, its range, beginning and end of a run."""
    gear, stiff = (
        fs.systems.harmonic_gear(),
        fs.systems.harmonic_gear(A=12152.8, B=40.5, C=60.55),
    )
    year = 2 * np.pi / 0.01
    yield "gear, P1, one period", gear, "w", (-20, 20), [0, 0], year
    yield "gear, P1, three periods", gear, "w", (-20, 20), [0, 0], 3 * year
    yield "gear, 825 crossings", stiff, "w", (-120, 120), [0, 0], 3 * year
    cusp = fs.systems.cusp(omega=0.002)
    yield "cusp, two folds", cusp, "p", (-1.2, 1.2), [-1.0], 4 * np.pi / 0.002
    relaxing = fs.systems.van_der_pol_relaxation(epsilon=0.005)
    yield "van der Pol, relaxing", relaxing, "y", (-1.2, 1.2), [2.0, 0.0], 800.0
    neuron = fs.systems.hindmarsh_rose(r=0.006)
    yield "Hindmarsh-Rose", neuron, "z", (1.5, 2.6), [-1.5, -10, 1.9], 800.0


def passages() -> tuple[float, float, float]:
    """ms of a passage past the cusp's fold, and by SciPy, and how far apart they are."""
    fast = fs.systems.cusp().frozen()
    fold = fs.continue_equilibria(fast, "p", over=(-1, 1)).folds[0]
    site, rate = site_of(fold, None, None), 1e-3
    way = -1.0 if fold["x"] > 0 else 1.0
    state = [-1.3 * way, -way * 0.5]
    place = Place(0, np.array(state) - site.u, 0.0)
    stop = Event((0, 0.5 * way))

    def ours() -> float:
        return reached_delay(site, fs.Drift(way * rate), place, stop, 1e4)[0]

    def rates(t: float, z: np.ndarray) -> np.ndarray:
        values, _, _, _ = site.field.at(0, site.u + z)
        return np.append(values, way * rate)

    def level(t: float, z: np.ndarray) -> float:
        return float(z[0] - 0.5 * way)

    level.terminal = True  # type: ignore[attr-defined]

    def theirs() -> float:
        run = solve_ivp(rates, (0, 1e4), place.z, "LSODA", events=level, rtol=1e-11, atol=1e-14)
        return float(way * run.y[-1, -1])

    return median(ours), median(theirs, 3), abs(ours() / theirs() - 1.0)


def main() -> None:
    print(f"{'':28}{'samples':>9}{'transitions':>13}{'run, ms':>10}{'overlay, ms':>13}{'ratio':>8}")
    for name, model, slow, over, start, stop in cases():
        diagram = fs.continue_equilibria(model.frozen(), slow, over=over)

        def run(m: fs.Model = model, s: list[float] = start, e: float = stop) -> fs.Trajectory:
            return fs.simulate(m, s, t=(0, e))

        # a run keeps what was read off it: each overlay has its own
        fresh = iter([run() for _ in range(8)])
        lay = fs.overlay(diagram, run())
        alone = median(run, 7)
        laid = median(lambda d=diagram, f=fresh: fs.overlay(d, next(f)), 7)  # type: ignore[misc]
        print(
            f"{name:28}{len(lay.time):9d}{len(lay.transitions):13d}{alone:10.2f}{laid:13.2f}"
            f"{laid / alone:8.1f}"
        )
    ours, theirs, apart = passages()
    print(
        f"a passage of a fold: {ours:.2f} ms, SciPy {theirs:.0f} ms: {theirs / ours:.0f} x; "
        f"the delays differ by {apart:.0e}"
    )


if __name__ == "__main__":
    main()
