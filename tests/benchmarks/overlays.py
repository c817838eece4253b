"""Overlays of runs on their diagrams, beside the runs themselves and a law's passage by SciPy.

Everything is compiled before. No other
program overlays a trajectory over a diagram; what can be compared is the passage that the error of
a law of delay is told by, which SciPy integrates by LSODA with rates in Python.
"""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterator

import numpy as np
from scipy.integrate import solve_ivp

import fastslow as fs
from fastslow.passage.delays.local_field import local_field_at
from fastslow.passage.delays.local_passages import EndOfPassage, PassagePlace, reached_delay
from tests.benchmarks.measuring import Line, used


def median(function: Callable[[], object], repeats: int = 7) -> float:
    """Median processor time of a call, in ms; it is called once before, and never repeated."""
    function()
    taken = []
    for _ in range(repeats):
        begin = used()
        function()
        taken.append(used() - begin)
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
    local, rate = local_field_at(fold, None, None), 1e-3
    way = -1.0 if fold["x"] > 0 else 1.0
    state = [-1.3 * way, -way * 0.5]
    place = PassagePlace(0, np.array(state) - local.u, 0.0)
    stop = EndOfPassage((0, 0.5 * way))

    def ours() -> float:
        return reached_delay(local, fs.Drift(way * rate), place, stop, 1e4)[0]

    def rates(t: float, z: np.ndarray) -> np.ndarray:
        values, _, _, _ = local.field.evaluate(0, local.u + z)
        return np.append(values, way * rate)

    def level(t: float, z: np.ndarray) -> float:
        return float(z[0] - 0.5 * way)

    level.terminal = True  # type: ignore[attr-defined]

    def theirs() -> float:
        run = solve_ivp(rates, (0, 1e4), place.z, "LSODA", events=level, rtol=1e-11, atol=1e-14)
        return float(way * run.y[-1, -1])

    return median(ours, 15), median(theirs, 3), abs(ours() / theirs() - 1.0)


def lines() -> Iterator[Line]:
    """Overlays beside their runs, and the passage of a fold beside SciPy."""
    for name, model, slow, over, start, stop in cases():
        diagram = fs.continue_equilibria(model.frozen(), slow, over=over)

        def run(m: fs.Model = model, s: list[float] = start, e: float = stop) -> fs.Trajectory:
            return fs.simulate(m, s, t=(0, e))

        # a run keeps what was read off it: each overlay has its own
        fresh = iter([run() for _ in range(20)])

        def overlay(d: fs.Diagram = diagram, runs: Iterator[fs.Trajectory] = fresh) -> fs.Overlay:
            return fs.overlay(d, next(runs))

        found = overlay()
        note = f"{len(found.t)} samples, {len(found.transitions)} transitions"
        alone, laid = median(run), median(overlay)
        yield Line(f"overlay: {name}", "fastslow", laid, "ms", None, note)
        yield Line(f"overlay: {name}", "fastslow, the run alone", alone, "ms")
    ours, theirs, apart = passages()
    yield Line("the passage of a fold", "fastslow", ours, "ms")
    note = f"the delays differ by {apart:.0e}"
    yield Line("the passage of a fold", "SciPy, LSODA", theirs, "ms", theirs / ours, note)
