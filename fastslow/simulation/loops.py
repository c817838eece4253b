"""The compiled loops of this package, and the callbacks that they load when needed."""

from __future__ import annotations

from fastslow.kernels.compiler.lazy_callback import LazyCallback
from fastslow.kernels.compiler.records import Integers, Matrix, Tensor, Vector
from fastslow.kernels.loops import Loop
from fastslow.simulation.stepper.lanes import Pool, RunTable
from fastslow.simulation.stepper.problems import Problem, Record, Run
from fastslow.simulation.stepper.workspace import StepWorkspace

INTEGRATE = Loop(
    "fastslow.simulation.stepper.driver",
    "integrate",
    {"problem": Problem, "run": Run, "record": Record, "workspace": StepWorkspace, "handed": int},
    results=(int,),
    kept=("problem", "workspace"),
)

INTEGRATE_MANY = Loop(
    "fastslow.simulation.stepper.lanes",
    "integrate_many",
    {
        "problem": Problem, "steps": int, "regions": int, "runs": RunTable, "pool": Pool,
        "workspace": StepWorkspace, "first": int, "last": int,
    },
    results=(int,),
)  # fmt: skip

COLLOCATION = LazyCallback(
    "fastslow.simulation.stepper.collocation", "collocate", "CollocationStep"
)
RADAU = LazyCallback("fastslow.simulation.stepper.radau", "radau_step", "RadauStep")

STEP_VALUES = Loop(
    "fastslow.simulation.step_values",
    "values_in_steps",
    {
        "series": Tensor, "starts": Vector, "begin": float, "end": float, "times": Vector,
        "values": Matrix,
    },
    results=(int,),
    read=("series", "starts", "times"),
)  # fmt: skip

VALUES_BY_STEPS = Loop(
    "fastslow.simulation.step_values",
    "values_by_steps",
    {"series": Tensor, "counts": Integers, "offsets": Vector, "values": Matrix},
    read=("series", "counts", "offsets"),
)

STEP_BENDS = Loop(
    "fastslow.simulation.step_values",
    "bends_of_steps",
    {"series": Tensor, "lengths": Vector, "bends": Matrix},
    read=("series", "lengths"),
)

LOOPS = (
    INTEGRATE, INTEGRATE_MANY, COLLOCATION, RADAU, STEP_VALUES, VALUES_BY_STEPS, STEP_BENDS,
)  # fmt: skip
