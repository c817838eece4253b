"""Equilibria of the gear continued in its load, against other programs in the same run.

AUTO-07p, bice and
PyCont-Lite are measured where they are installed. They know no interfaces, so
they follow the one smooth curve of the engaged gear, as fastslow does beside
its diagrams of the whole gear. Every program looks for special points of each
kind it knows; compiling and writing down the equations is not counted. The
others are given the equilibrium to start from; a whole run of fastslow
includes the search for a start on every branch.
"""

from __future__ import annotations

import importlib.util
import os
import shutil
import statistics
import subprocess
import tempfile
import warnings
from collections.abc import Callable, Iterator
from contextlib import redirect_stdout
from dataclasses import dataclass
from io import StringIO
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import sympy as sp

import fastslow as fs
from tests.benchmarks.measuring import Line, used

A, D = 41.67, 0.25
OVER = (-2.0, 6.0)
SMOOTH = (0.0, 6.0)
SHORT, LONG = "a whole run at usual steps", "small steps, so that fixed costs vanish"


@dataclass(frozen=True)
class Row:
    """One line of the table, time in seconds."""

    task: str
    tool: str
    steps: int
    time: float

    @property
    def rate(self) -> float:
        return self.steps / self.time


def gear() -> fs.Model:
    """The frozen gear with its dead zone."""
    x, v, t, w = sp.symbols("x v t w")
    a, d, omega = sp.symbols("A D omega")
    dead_zone = sp.Piecewise((x - d, x > d), (x + d, x < -d), (0, True))
    model = fs.Model(
        {x: v, v: w - v - (x**2 + a) * dead_zone},
        forcing={w: sp.sin(omega * t)},
        parameters={a: A, d: D, omega: 0.01},
    )
    return model.frozen()


def engaged() -> fs.Model:
    """The gear inside the region x > D, without interfaces."""
    x, v, t, w = sp.symbols("x v t w")
    a, d = sp.symbols("A D")
    rates = {x: v, v: w - v - (x**2 + a) * (x - d)}
    return fs.Model(rates, forcing={w: sp.sin(t)}, parameters={a: A, d: D}).frozen()


def taken(function: Callable[[], Any], repeats: int) -> tuple[float, Any]:
    """Median processor time of a call in seconds, and what the first one returned."""
    result = function()
    times = []
    for _ in range(repeats):
        begin = used()
        function()
        times.append(used() - begin)
    return statistics.median(times), result


def rows(diagram: fs.Diagram) -> int:
    return sum(len(branch) for branch in diagram.branches)


def traced(model: fs.Model, over: tuple[float, float], step: float) -> Callable[[], fs.Diagram]:
    """A continuation with steps of one length, a part of the range."""
    settings = fs.Continuation(step=step, max_step=step, max_points=1_000_000)
    return lambda: fs.continue_equilibria(model, "w", over, continuation=settings)


def fastslow() -> Iterator[Row]:
    whole, smooth = gear(), engaged()
    taken_by, diagram = taken(lambda: fs.continue_equilibria(whole, "w", OVER), 20)
    yield Row(SHORT, "fastslow, gear, the same model again", rows(diagram), taken_by)
    numbers = count(1)

    def other() -> fs.Diagram:
        model = whole.with_parameters(A=A + 0.01 * next(numbers))
        return fs.continue_equilibria(model, "w", OVER)

    taken_by, diagram = taken(other, 20)
    yield Row(SHORT, "fastslow, gear, other parameters each time", rows(diagram), taken_by)
    taken_by, diagram = taken(lambda: fs.continue_equilibria(smooth, "w", SMOOTH), 20)
    yield Row(SHORT, "fastslow, engaged gear", rows(diagram), taken_by)
    for model, over, name in ((whole, OVER, "gear"), (smooth, SMOOTH, "engaged gear")):
        for step in (1e-4, 1e-5):
            taken_by, diagram = taken(traced(model, over, step), 3)
            yield Row(LONG, f"fastslow, {name}, steps of {step:g}", rows(diagram), taken_by)


def auto() -> Iterator[Row]:
    """AUTO-07p as fast as it goes: analytic Jacobian, no diagnostics, no stored solutions."""
    program = shutil.which("auto-07p") or shutil.which("auto")
    if program is None or shutil.which("gfortran") is None:
        print("AUTO-07p: not installed (it needs gfortran too), left out")
        return
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        fs.export(engaged(), "auto", folder, values={"w": 0.0}, state={"x": D})
        (equations,) = folder.glob("*.f90")
        stem = equations.stem
        (folder / f"c.{stem}").write_text(auto_constants(0.01, 0.1, 10))
        (folder / "compile.auto").write_text(f"run(e={stem!r}, c={stem!r})\n")
        quiet: dict[str, Any] = {
            # its threads wait actively, which counts as processor time
            "env": {**os.environ, "OMP_NUM_THREADS": "1"},
            "cwd": folder,
            "stdin": subprocess.DEVNULL,
            "stdout": subprocess.DEVNULL,
            "stderr": subprocess.DEVNULL,
        }
        subprocess.run([program, "compile.auto"], check=False, timeout=120, **quiet)
        executable = folder / f"{stem}.exe"
        if not executable.exists():
            print(f"AUTO-07p: {Path(program).name} did not compile the equations, left out")
            return
        for task, label, step, largest in (
            (SHORT, "its process and files", 0.01, 0.1),
            (LONG, "steps of 3e-5", 3e-5, 3e-5),
        ):
            (folder / "fort.2").write_text(auto_constants(step, largest, 200_000))
            taken_by, _ = taken(lambda: subprocess.run([executable], check=True, **quiet), 3)
            lines = (folder / "fort.7").read_text().splitlines()
            steps = sum(line.split()[0] == "1" for line in lines)
            yield Row(task, f"AUTO-07p, engaged gear, {label}", steps, taken_by)


def auto_constants(step: float, largest: float, points: int) -> str:
    """An equilibrium run in PAR(1) with all special points looked for (ISP=2)."""
    return (
        "NDIM = 2, IPS = 1, ILP = 1, ISP = 2, ISW = 1, JAC = 1, ICP = [1]\n"
        "NTST = 15, NCOL = 4, IAD = 3, MXBF = 5, IID = 0, ITMX = 8, ITNW = 5, NWTN = 3\n"
        f"DS = {step}, DSMIN = 1e-06, DSMAX = {largest}, IADS = 1, NPR = 0, NMX = {points}\n"
        f"EPSL = 1e-08, EPSU = 1e-08, EPSS = 1e-06, RL0 = {SMOOTH[0]}, RL1 = {SMOOTH[1]}\n"
    )


def rates(u: np.ndarray, w: float) -> np.ndarray:
    x, v = u
    return np.array([v, w - v - (x * x + A) * (x - D)])


def bice() -> Iterator[Row]:
    if importlib.util.find_spec("bice") is None:
        print("bice: not installed, left out")
        return
    from bice import Equation, Problem

    class Engaged(Equation):  # type: ignore[misc]
        def __init__(self) -> None:
            super().__init__()
            self.u = np.array([D, 0.0])
            self.w = 0.0

        def rhs(self, u: np.ndarray) -> np.ndarray:
            return rates(u, self.w)

        def jacobian(self, u: np.ndarray) -> np.ndarray:
            x = u[0]
            return np.array([[0.0, 1.0], [-(x * x + A) - 2.0 * x * (x - D), -1.0]])

    def run(step: float, steps: int) -> int:
        problem, equation = Problem(), Engaged()
        problem.add_equation(equation)
        problem.continuation_parameter = (equation, "w")
        problem.settings.neigs = 2
        problem.continuation_stepper.ds = step
        problem.continuation_stepper.ds_max = 10 * step
        made = 0
        with redirect_stdout(StringIO()):
            while made < steps and equation.w < SMOOTH[1]:
                problem.continuation_step()
                made += 1
        return made

    for task, label, step, steps in (
        (SHORT, "steps up to 0.1", 0.01, 10_000),
        (LONG, "the first 500 steps up to 3e-3", 3e-4, 500),
    ):
        taken_by, made = taken(lambda: run(step, steps), 3)  # noqa: B023  called at once
        yield Row(task, f"bice, engaged gear, {label}", made, taken_by)


def pycont() -> Iterator[Row]:
    if importlib.util.find_spec("pycont") is None:
        print("PyCont-Lite: not installed, left out")
        return
    from pycont import arclengthContinuation

    wanted = {"param_max": SMOOTH[1], "initial_directions": "increase_p", "hopf_detection": True}

    def run(step: float, steps: int) -> int:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            result = arclengthContinuation(
                rates, np.array([D, 0.0]), 0.0, 1e-6, 10 * step, step, steps,
                solver_parameters=wanted, verbosity="off",
            )  # fmt: skip
        return sum(len(branch.p_path) - 1 for branch in result.branches)

    for task, label, step, steps in (
        (SHORT, "steps up to 0.1", 0.01, 10_000),
        (LONG, "the first 500 steps up to 3e-3", 3e-4, 500),
    ):
        taken_by, made = taken(lambda: run(step, steps), 1)  # noqa: B023  called at once
        yield Row(task, f"PyCont-Lite, engaged gear, {label}", made, taken_by)


def lines() -> Iterator[Line]:
    """Steps per second of every tool, beside the engaged gear of fastslow in the same block."""
    table = [row for tool in (fastslow, auto, bice, pycont) for row in tool()]
    for task in (SHORT, LONG):
        block = [row for row in table if row.task == task]
        ours = [row for row in block if row.tool.startswith("fastslow, engaged")][-1]
        for row in block:
            peer = not row.tool.startswith("fastslow")
            note = f"{row.steps} steps in {1e3 * row.time:.3g} ms"
            yield Line(
                task, row.tool, row.rate, "steps/s", ours.rate / row.rate if peer else None, note
            )
