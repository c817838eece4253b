"""One gear trajectory, three slow periods and 20,000 samples, against peers.

SciPy integrates the kinked rates and locates the crossings as events, as its users do
it; heyoka, where it is installed, has an integrator for each region, which a terminal
event at its edge ends; `gear.c` is written for this model.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Iterator

import numpy as np
import sympy as sp
from scipy.integrate import solve_ivp

import fastslow as fs
from tests.benchmarks.measuring import Line, against, medians
from tests.benchmarks.references import gear_in_c

A, B, C, D, OMEGA = 41.67, 2.372, 3.546, 0.25, 0.01
END = 6 * np.pi / OMEGA
STIFF = (12152.8, 40.5, 60.55)
TOL = 1e-9
TIMES = np.linspace(0, END, 20_000)


def gear() -> fs.Model:
    x, v, t, w = sp.symbols("x v t w")
    a, b, c, d, omega = sp.symbols("A B C D omega")
    dead_zone = sp.Piecewise((x - d, x > d), (x + d, x < -d), (0, True))
    return fs.Model(
        {x: v, v: w - v - (x**2 + a) * dead_zone},
        forcing={w: b + c * sp.sin(omega * t)},
        parameters={a: A, b: B, c: C, d: D, omega: OMEGA},
    )


def scipy_with_events(tol: float) -> np.ndarray:
    """x at the sample times, by DOP853 over the kinked rates, crossings as events."""

    def rates(t: float, u: np.ndarray) -> tuple[float, float]:
        x, v = u
        contact = x - D if x > D else x + D if x < -D else 0.0
        return v, B + C * np.sin(OMEGA * t) - v - (x**2 + A) * contact

    events = [lambda t, u: u[0] - D, lambda t, u: u[0] + D]
    run = solve_ivp(rates, (0, END), (0, 0), "DOP853", TIMES, events=events, rtol=tol, atol=tol)
    return run.y[0]


def with_heyoka(A: float, B: float, C: float, tol: float) -> Callable[[], tuple[np.ndarray, int]]:
    """A run of the gear over its regions: x at the sample times, and the number of crossings."""
    import heyoka as hy

    x, v = hy.make_vars("x", "v")
    force = B + C * hy.sin(OMEGA * hy.time) - v
    rising, falling = hy.event_direction.positive, hy.event_direction.negative

    def region(contact: object, edges: list[tuple[float, object]]) -> object:
        events = [hy.t_event(x - at, direction=way) for at, way in edges]
        rates = [(x, v), (v, force - (x**2 + A) * contact)]
        return hy.taylor_adaptive(rates, [0.0, 0.0], tol=tol, t_events=events)

    regions = {
        1: region(x - D, [(D, falling)]),
        0: region(0.0 * x, [(-D, falling), (D, rising)]),
        -1: region(x + D, [(-D, rising)]),
    }

    def run() -> tuple[np.ndarray, int]:
        mode, now, state, count = 0, 0.0, np.zeros(2), 0
        out = [np.zeros(1)]
        while now < END:
            ta = regions[mode]
            ta.time, ta.state[:] = now, state
            ta.reset_cooldowns()
            outcome, *_, states = ta.propagate_grid(
                np.append(now, TIMES[np.searchsorted(TIMES, now, side="right") :])
            )
            out.append(states[1:, 0])
            now, state = ta.time, ta.state.copy()
            if outcome == hy.taylor_outcome.time_limit:
                break
            event = -int(outcome) - 1
            side, mode = (mode, 0) if mode else ((-1, 1)[event], (-1, 1)[event])
            # from the edge itself the next crossing would not be seen
            state[0] = side * (D + (1e-14 if mode else -1e-14))
            count += 1
        return np.concatenate(out), count

    return run


def in_c(A: float, B: float, C: float, tol: float) -> Callable[[], tuple[np.ndarray, int]] | None:
    """The same by C written for this model; None without a compiler."""
    library = gear_in_c()
    if library is None:
        return None

    def run() -> tuple[np.ndarray, int]:
        out = np.empty(len(TIMES))
        count = library.run(A, B, C, D, OMEGA, tol, END, TIMES, len(TIMES), out)
        return out, count

    return run


def lines() -> Iterator[Line]:
    """P1 with 20,000 samples, and a stiffer gear with 825 crossings."""
    model = gear()
    cases = {"P1, 20,000 samples": (A, B, C), "825 crossings, 20,000 samples": STIFF}
    for work, (a, b, c) in cases.items():
        here = model.with_parameters(A=a, B=b, C=c)
        fine = fs.Integration(rtol=1e-14)
        exact = fs.simulate(here, [0, 0], periods=3, samples=TIMES, integration=fine)["x"]
        runs: dict[str, Callable[[], tuple[np.ndarray, int]]] = {
            "fastslow": lambda here=here: _ours(here)  # type: ignore[misc]
        }
        if (peer := in_c(a, b, c, TOL)) is not None:
            runs["C for this model"] = peer
        if importlib.util.find_spec("heyoka") is not None:
            runs["heyoka, one integrator a region"] = with_heyoka(a, b, c, TOL)
        found = {name: run() for name, run in runs.items()}
        times = medians(runs)
        if (a, b, c) == (A, B, C):
            slow = "SciPy, DOP853 with events"
            found[slow] = scipy_with_events(TOL), 0
            times |= medians({slow: lambda: scipy_with_events(TOL)}, repeats=3)
        notes = {}
        for name, (x, count) in found.items():
            crossings = f", {count} crossings" if count else ""
            notes[name] = f"error {np.abs(x - exact).max():.1e}{crossings}"
        yield from against(work, "fastslow", times, notes)
    short = lambda: fs.simulate(model, [0.5, 0.0], t=(0, 1e-3))  # noqa: E731
    yield Line("a short run, all checks", "fastslow", medians({"": short})[""], "ms")


def _ours(model: fs.Model) -> tuple[np.ndarray, int]:
    run = fs.simulate(model, [0, 0], periods=3, samples=TIMES)
    return run["x"], len(run.crossings)
