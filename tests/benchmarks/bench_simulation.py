"""One gear trajectory, three slow periods and 20 000 samples, against peers in the same run.

Run with ``python tests/benchmarks/bench_simulation.py``. SciPy integrates the
kinked rates and locates the crossings as events, as its users do it; heyoka,
where it is installed, has an integrator for each region, which a terminal event
at its edge ends.
"""

from __future__ import annotations

import importlib.util
import statistics
import time
from collections.abc import Callable

import numpy as np
import sympy as sp
from scipy.integrate import solve_ivp

import fastslow as fs

A, B, C, D, OMEGA = 41.67, 2.372, 3.546, 0.25, 0.01
END = 6 * np.pi / OMEGA
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


def median(function: Callable[[], object], repeats: int) -> float:
    """Median time of a call, in ms."""
    taken = []
    for _ in range(repeats):
        begin = time.perf_counter()
        function()
        taken.append(time.perf_counter() - begin)
    return 1e3 * statistics.median(taken)


def main() -> None:
    model = gear()
    stiff = model.with_parameters(A=12152.8, B=40.5, C=60.55)

    def ours(dense: bool = True) -> fs.Trajectory:
        return fs.simulate(model, [0, 0], periods=3, samples=TIMES, dense=dense)

    exact = fs.simulate(
        model, [0, 0], periods=3, samples=TIMES, integration=fs.Integration(rtol=1e-14)
    )["x"]
    mine, theirs = ours()["x"], scipy_with_events(1e-9)
    print(f"largest error: fastslow {np.abs(mine - exact).max():.1e}, ", end="")
    print(f"SciPy {np.abs(theirs - exact).max():.1e}")
    fast = median(ours, 50)
    slow = median(lambda: scipy_with_events(1e-9), 3)
    print(f"P1, 20 000 samples: fastslow {fast:.2f} ms, SciPy {slow:.0f} ms: {slow / fast:.0f} x")
    many = median(lambda: fs.simulate(stiff, [0, 0], periods=3, samples=TIMES), 10)
    count = len(fs.simulate(stiff, [0, 0], periods=3).crossings)
    print(f"{count} crossings: fastslow {many:.1f} ms")
    if importlib.util.find_spec("heyoka") is None:
        return
    peer = with_heyoka(A, B, C, 1e-9)
    error = np.abs(peer()[0] - exact).max()
    print(f"heyoka, P1: {(taken := median(peer, 20)):.2f} ms, {taken / fast:.1f} x, ", end="")
    print(f"error {error:.1e}, {peer()[1]} crossings")
    peer = with_heyoka(12152.8, 40.5, 60.55, 1e-9)
    print(
        f"heyoka, 825 crossings: {(taken := median(peer, 5)):.1f} ms, {taken / many:.1f} x, ",
        end="",
    )
    print(f"{peer()[1]} crossings found")


if __name__ == "__main__":
    main()
