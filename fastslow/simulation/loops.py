"""The compiled loops of this package, and what they call when it is needed."""

from __future__ import annotations

from fastslow.compiled.generic import Loop
from fastslow.compiled.late import Late
from fastslow.simulation.lanes import Pool, Runs
from fastslow.simulation.problems import Problem, Record, Run
from fastslow.simulation.workspace import Workspace

DRIVE = Loop(
    "fastslow.simulation.driver",
    "drive",
    {"problem": Problem, "run": Run, "record": Record, "workspace": Workspace, "handed": int},
    results=(int,),
    kept=("problem", "workspace"),
)

DRIVE_MANY = Loop(
    "fastslow.simulation.lanes",
    "drive_many",
    {
        "problem": Problem, "steps": int, "regions": int, "runs": Runs, "pool": Pool,
        "workspace": Workspace, "first": int, "last": int,
    },
    results=(int,),
)  # fmt: skip

COLLOCATION = Late("fastslow.simulation.collocation", "collocate", "CollocationStep")
RADAU = Late("fastslow.simulation.radau", "radau_step", "RadauStep")

LOOPS = (DRIVE, DRIVE_MANY, COLLOCATION, RADAU)
