"""Peak memory of the works of the other tables, each in a process of its own.

It is above that of the process after a small work of the same kind, which has imported and
compiled everything. Arrays that a result returns are part of it. Linux alone tells the peak.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from tests.benchmarks.measuring import Line

#: How a process measures its work.
MEASURE = """
import sys
import numpy as np
import fastslow as fs
from pathlib import Path
from tests.benchmarks import memory
from tests.campaigns.gear_map import memory as status
small, whole, told = memory.WORKS[sys.argv[1]]
exec(small)
Path("/proc/self/clear_refs").write_text("5")
before = status("VmRSS")
exec(whole)
print((status("VmHWM") - before) * 1.048576, *eval(told))
"""

STIFF = "model = fs.systems.harmonic_gear(A=12152.8, B=40.5, C=60.55)\n"
GEAR = "model = fs.systems.harmonic_gear()\n"
MANY = (
    "many = lambda count, **span: fs.simulate_many(model, [0, 0], "
    "parameters={'D': np.linspace(0.1, 0.3, count)}, execution=fs.Execution(threads=2), **span)\n"
)
BRANCH = (
    "branch = lambda count: fs.continue_equilibria(model.frozen(), 'w', over=(-20, 20), "
    "continuation=fs.Continuation(step=1 / count, max_step=1 / count, max_points=3 * count))[0]\n"
)
#: Work to a small one, the work, and what is told of it beside its peak: numbers of bytes that
#: its arrays take, and by how many they are divided.
WORKS = {
    "gear, 825 crossings": (
        STIFF + "fs.simulate(model, [0, 0], t=(0, 9)).t",
        "run = fs.simulate(model, [0, 0], t=(0, 600 * np.pi)).t",
        "()",
    ),
    "overlay: gear, 825 crossings": (
        STIFF + "diagram = fs.continue_equilibria(model.frozen(), 'w', over=(-120, 120))\n"
        "run = fs.simulate(model, [0, 0], t=(0, 600 * np.pi))\n"
        "fs.overlay(diagram, fs.simulate(model, [0, 0], t=(0, 600)))",
        "laid = fs.overlay(diagram, run)",
        "()",
    ),
    "the gear's diagram": (
        GEAR + "fs.continue_equilibria(model.frozen(), 'w', over=(-2, 6))",
        "found = fs.continue_equilibria(model.frozen().with_parameters(D=0.3), 'w', over=(-2, 6))",
        "()",
    ),
    "a slider of explore moved": (
        GEAR + "explorer = fs.explore(model, over=(-2, 6), sliders={'D': (0.1, 0.5)})\n"
        "explorer.glance({'D': 0.24})",
        "explorer.glance({'D': 0.25})",
        "()",
    ),
    "200 points of the response of the gear pair": (
        "pair = fs.systems.gear_pair(Omega=0.6)\norbit = fs.find_orbit(pair, [1.1, 0])\n"
        "steps = fs.Continuation(step=0.02, max_step=0.032)\n"
        "fs.continue_orbits(orbit, 'Omega', (0.58, 0.62), continuation=steps)",
        "found = fs.continue_orbits(orbit, 'Omega', (0.5, 1.6), continuation=steps)",
        "()",
    ),
    "first diagram of a model of 60 states": (
        "from tests.diagrams.models import LENGTH, brusselator\n"
        "fs.continue_equilibria(brusselator(2)[0], LENGTH, (0.2, 2.0))",
        "found = fs.continue_equilibria(brusselator(30, 2.1)[0], LENGTH, (0.2, 2.0))",
        "()",
    ),
    "10,000 trajectories, extremes and hits": (
        GEAR + MANY + "many(100, periods=1)",
        "found = many(10_000, periods=1)",
        "(memory.taken(found), len(found))",
    ),
    "1,000,000 trajectories, extremes and hits": (
        GEAR + MANY + "many(100, t=(0, 20))",
        "found = many(1_000_000, t=(0, 20))",
        "(memory.taken(found), len(found))",
    ),
    "a branch of 1,000,000 rows": (
        GEAR + BRANCH + "branch(1000)",
        "found = branch(650_000)",
        "(memory.taken(found), len(found) * len(found.states))",
    ),
}


def taken(result: object) -> int:
    """Bytes of the arrays of a result; rows that are all equal take the memory of one."""
    arrays = [v for v in vars(result).values() if isinstance(v, np.ndarray)]
    arrays += [*getattr(result, "parameters", {}).values()]
    return sum(v.nbytes for v in arrays if isinstance(v, np.ndarray) and v.strides[0])


def lines() -> Iterator[Line]:
    """Peak of each work, and the bytes that the arrays of its result take."""
    if not Path("/proc/self/clear_refs").exists():
        print("the peak of a process is not known on this system, left out")
        return
    for work in WORKS:
        command = [sys.executable, "-c", MEASURE, work]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        peak, *told = map(float, done.stdout.split())
        note = ""
        if told:
            size, count = told
            above, each = peak - 1e-6 * size, 1e6 * peak / count
            what = "row and state" if "row" in work else "trajectory"
            note = f"{size / count:.0f} bytes of arrays a {what}, {above:.0f} MB above them"
            note += f", {each:.0f} bytes in all"
        yield Line(work, "peak above imports", peak, "MB", None, note)
