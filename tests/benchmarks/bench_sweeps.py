"""Sweeps: what they cost beside `simulate_many`, per task, and in memory; strips beside one run.

The trajectories are gears over D × C/B and two slow periods, of which the first is a transient.
Costs beside `simulate_many` are ratios of processor time in one run, those of a task are wall
times of tasks without work. The memory of the parent is that of a process of its own.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

import fastslow as fs
from tests.benchmarks.measuring import Line, medians

B = 2.372
KEEP = ["regime", "maximum", "minimum"]
GEAR = fs.systems.harmonic_gear(B=B, omega=0.1)
PAIR = fs.systems.gear_pair()
STOP = fs.systems.bilinear_oscillator(zeta=0.05, f=0.5)


def motions(D: np.ndarray, ratio: np.ndarray) -> fs.Ensemble:
    """Gears over two slow periods."""
    return fs.simulate_many(GEAR, [0, 0], parameters={"D": D, "C": B * ratio}, periods=2, settle=1)


def over(count: int) -> dict[str, np.ndarray]:
    """Axes with about so many points."""
    n = round(count**0.5)
    return {"D": np.linspace(0.05, 0.5, n), "ratio": np.linspace(0.9, 1.5, n)}


def large(count: int, **given: Any) -> fs.Grid:
    """The sweep over so many gears."""
    execution = fs.Execution(keep=KEEP, **given)
    return fs.sweep(motions, over(count), vectorized=True, execution=execution)


def nothing(a: float) -> float:
    return a


def busy(a: float) -> float:
    """Half a second of processor time."""
    end = time.process_time() + 0.5
    while time.process_time() < end:
        pass
    return a


def taken(function: Callable[[], object]) -> float:
    """Wall time in seconds."""
    begin = time.perf_counter()
    function()
    return time.perf_counter() - begin


def empty(count: int, executor: Executor | None) -> float:
    """Wall time of a task without work, in ms."""
    execution = fs.Execution(executor=executor, chunk=1)
    axis = {"a": np.arange(count)}
    fs.sweep(nothing, {"a": np.arange(20)}, execution=execution)
    return 1e3 / count * taken(lambda: fs.sweep(nothing, axis, execution=execution))


MEMORY = """
import sys, time
from tests.benchmarks.bench_sweeps import large
from tests.campaigns.gear_map import memory
large(100)
import zarr
before, used = memory("VmRSS"), time.process_time()
grid = large(int(sys.argv[1]), store=sys.argv[2])
rate = len(grid) / (time.process_time() - used)
print(memory("VmHWM") - before, rate)
"""


def memory(count: int) -> tuple[float, float]:
    """Memory of a sweep with a store above that of imports, in MB, and its rate per second."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-c", MEMORY, str(count), str(Path(folder) / "map.zarr")]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
    size, rate = done.stdout.split()
    return float(size), float(rate)


def lines() -> Iterator[Line]:
    """Ratios to `simulate_many`, the cost of a task, two workers, memory."""
    count = 40_000
    D, ratio = (g.ravel() for g in np.meshgrid(*over(count).values(), indexing="ij"))
    with tempfile.TemporaryDirectory() as folder:
        paths = (Path(folder) / f"{k}.zarr" for k in range(100))
        found = medians(
            {
                "simulate_many": lambda: motions(D, ratio),
                "fs.sweep in memory": lambda: large(count),
                "fs.sweep with a store": lambda: large(count, store=next(paths)),
            },
            repeats=3,
        )
    work = f"{count:,} gears in one process"
    for tool, value in found.items():
        share = found["simulate_many"] / value
        yield Line(work, tool, value, "ms", share, f"{1 / share - 1:+.1%}")

    yield from strips()
    work = "a task without work"
    yield Line(work, "this process", empty(2000, None), "ms")
    with ThreadPoolExecutor(2) as threads:
        yield Line(work, "two threads", empty(2000, threads), "ms")
    with ProcessPoolExecutor(2) as processes:
        yield Line(work, "two processes", empty(2000, processes), "ms")
    yield from dask(work)

    work = "eight tasks of 0.5 s of processor time"
    axis, alone = {"a": np.arange(8)}, 0.0
    for workers in (1, 2):
        with ProcessPoolExecutor(workers) as pool:
            execution = fs.Execution(executor=pool, chunk=1)
            fs.sweep(nothing, axis, execution=execution)
            value = taken(lambda one=execution: fs.sweep(busy, axis, execution=one))
        alone = alone or value
        load = f"load {os.getloadavg()[0]:.1f}"
        yield Line(work, f"{workers} workers", 1e3 * value, "ms", alone / value, load)

    for many in (100_000, 1_000_000):
        size, rate = memory(many)
        yield Line(f"{many:,} gears with a store", "memory above imports", size, "MB")
        yield Line(f"{many:,} gears with a store", "rate", rate, "per s")


def strips() -> Iterator[Line]:
    """Bifurcation sweeps of 200 values, 24 periods each, in strips and in order.

    The values are new at every call, as no model of an earlier one is of use.
    """
    numbers = count(1)
    cases: dict[str, tuple[fs.Model, str, tuple[float, float], list[float]]] = {
        "gear pair, 5 steps a period": (PAIR, "Omega", (0.69, 0.85), [1.1, 0.0]),
        "bilinear oscillator, 6 steps a period": (STOP, "omega", (0.6, 2.4), [0.0, 0.0]),
        "harmonic gear, 60 to 170 steps a period": (GEAR, "C", (2.2, 3.5), [0.3, 0.0]),
    }
    for name, (model, parameter, ends, state) in cases.items():

        def swept(n: int, run: Any = (model, parameter, ends, state)) -> None:
            model, parameter, ends, state = run
            values = np.linspace(*ends, 200) * (1.0 + 1e-9 * next(numbers))
            fs.bifurcation_sweep(
                model, parameter, values, state, settle=20, keep=4, back=False, strips=n
            )

        found = medians(
            {"in order": lambda run=swept: run(1), "strips=8": lambda run=swept: run(8)}, repeats=5
        )
        for tool, value in found.items():
            ratio = found["in order"] / value
            yield Line(f"200 values of a {name}", tool, value, "ms", ratio)


def dask(work: str) -> Iterator[Line]:
    """The cost of a task on two workers of Dask on this machine."""
    try:
        from distributed import Client, LocalCluster
    except ImportError:
        return
    with (
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        Client(cluster) as client,
    ):
        yield Line(work, "two workers of Dask", empty(500, client.get_executor()), "ms")
