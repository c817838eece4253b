"""The compiled loops of this package, and what they call when it is needed."""

from __future__ import annotations

from fastslow.kernels.lazy_callback import Late
from fastslow.kernels.loops import Loop
from fastslow.simulation.stepper.lanes import Pool, Runs
from fastslow.simulation.stepper.problems import Problem, Record, Run
from fastslow.simulation.stepper.workspace import Workspace

DRIVE = Loop(
    "fastslow.simulation.stepper.driver",
    "drive",
    {"problem": Problem, "run": Run, "record": Record, "workspace": Workspace, "handed": int},
    results=(int,),
    kept=("problem", "workspace"),
)

DRIVE_MANY = Loop(
    "fastslow.simulation.stepper.lanes",
    "drive_many",
    {
        "problem": Problem, "steps": int, "regions": int, "runs": Runs, "pool": Pool,
        "workspace": Workspace, "first": int, "last": int,
    },
    results=(int,),
)  # fmt: skip

COLLOCATION = Late("fastslow.simulation.stepper.collocation", "collocate", "CollocationStep")
RADAU = Late("fastslow.simulation.stepper.radau", "radau_step", "RadauStep")

LOOPS = (DRIVE, DRIVE_MANY, COLLOCATION, RADAU)
