"""Impacts and spikes by reset, beside events, crossings of the same number and SciPy's restarts."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import sympy as sp
from scipy.integrate import solve_ivp

import fastslow as fs
from tests.benchmarks.measuring import Line, medians

END, SHORT = 5000.0, 1000.0
VALUES = {"sigma": 0.2, "omega": 2.6, "c": 0.1}
ONE = fs.Execution(threads=1)


def models() -> dict[str, fs.Model]:
    """An oscillator with a stop, and with a stiff spring at the same place."""
    x, v, t, c, sigma, r, omega = sp.symbols("x v t c sigma r omega")
    force = sp.cos(omega * t) - x - c * v
    stop = fs.Model(
        {x: v, v: force}, parameters={**VALUES, r: 0.8}, resets={x >= sigma: {v: -r * v}}
    )
    spring = fs.Model({x: v, v: force - 10 * sp.Max(x - sigma, 0)}, parameters=VALUES)
    return {"impact": stop, "crossing": spring}


def pairs() -> dict[str, tuple[fs.Model, fs.Model, list[float]]]:
    """Models with a reset, the same with an event, and their initial states."""
    x, v, t, V, u = sp.symbols("x v t V u")
    neuron = {V: V**2 / 25 + 5 * V + 150 - u, u: (V / 5 - u) / 50}
    kinds = {
        "impacts": ({x: v, v: 9 * sp.cos(2 * t) / 2 - x - v / 5}, x >= 1, {v: -v / 2}, [0.0, 0.0]),
        "a spiking neuron": (neuron, V >= 30, {V: -65, u: u + 8}, [-65.0, -10.0]),
        "integrate and fire": ({V: sp.Rational(3, 2) - V}, V >= 1, {V: 0}, [0.0]),
    }
    return {
        name: (
            fs.Model(rates, resets={when: then}),
            fs.Model(rates, events={when: then}),
            start,
        )
        for name, (rates, when, then, start) in kinds.items()
    }


def restarted() -> int:
    """Number of impacts until `SHORT` by SciPy, restarted at each."""

    def wall(_: float, u: np.ndarray) -> float:
        return float(u[0] - 0.2)

    wall.terminal, wall.direction = True, 1  # type: ignore[attr-defined]

    def rates(t: float, u: np.ndarray) -> tuple[float, float]:
        return u[1], np.cos(2.6 * t) - u[0] - 0.1 * u[1]

    now, state, count = 0.0, [0.0, 0.0], 0
    while now < SHORT:
        run = solve_ivp(rates, (now, SHORT), state, "DOP853", events=wall, rtol=1e-10, atol=1e-10)
        now, count = float(run.t[-1]), count + (run.status == 1)
        # on the wall itself the next contact would not be seen
        state = [0.2 - 1e-13, -0.8 * run.y[1, -1]]
    return count


def lines() -> Iterator[Line]:
    """Microseconds per event of a run and of an ensemble, and SciPy."""
    ours = models()
    starts = np.random.default_rng(0).uniform(-1.0, 0.1, (2000, 2))
    runs = {
        name: (lambda model=model: fs.simulate(model, [0, 0], t=(0, END)))
        for name, model in ours.items()
    }
    counts = {name: max(len(run().resets), len(run().crossings)) for name, run in runs.items()}
    times = medians(runs)
    for name, count in counts.items():
        yield Line("a run", name, 1e3 * times[name] / count, "us each", note=f"{count} of them")
    for name, (*both, start) in pairs().items():
        times = medians(
            {
                kind: (
                    lambda model=model, start=start: fs.simulate(
                        model, start, t=(0, END), dense=False
                    )
                )
                for kind, model in zip(("reset", "event"), both, strict=True)
            }
        )
        for kind, value in times.items():
            ratio = None if kind == "reset" else value / times["reset"]
            yield Line(name, f"by {kind}", value, "ms", ratio)
    many = {
        name: (lambda model=model: fs.simulate_many(model, starts, t=(0, 100), execution=ONE))
        for name, model in ours.items()
    }
    sums = {name: int(run().resets.sum() or run().hits.sum()) for name, run in many.items()}
    times = medians(many, repeats=3)
    for name, count in sums.items():
        yield Line("an ensemble", name, 1e3 * times[name] / count, "us each", note=f"{count}")
    short = {
        "fastslow": lambda: fs.simulate(ours["impact"], [0, 0], t=(0, SHORT)),
        "SciPy, restarted at events": restarted,
    }
    times = medians(short, repeats=5)
    for name, value in times.items():
        ratio = None if name == "fastslow" else value / times["fastslow"]
        yield Line(f"a run until {SHORT:g}", name, value, "ms", ratio)
