"""The compiled loops of this package, loaded when first used."""

from __future__ import annotations

from fastslow.certification.boxes.krawczyk import KrawczykSpace, Rules
from fastslow.certification.boxes.pruning_kernel import BoxSearch
from fastslow.kernels.compiler.records import Integers, Matrix, Vector
from fastslow.kernels.intervals.program import Program, Registers
from fastslow.kernels.loops import Loop

PRUNE = Loop(
    "fastslow.certification.boxes.pruning_kernel",
    "prune",
    {
        "program": Program,
        "rules": Rules,
        "search": BoxSearch,
        "space": KrawczykSpace,
        "budget": int,
    },
    results=(int,),
    kept=("program", "rules", "search", "space"),
)

TIGHTEN = Loop(
    "fastslow.certification.boxes.following_kernel",
    "tighten",
    {
        "program": Program, "unit": Vector, "free": Integers, "low": Matrix, "high": Matrix,
        "tangent_low": Matrix, "tangent_high": Matrix, "space": KrawczykSpace,
    },
    kept=("program", "space"),
)  # fmt: skip

ENCLOSE = Loop(
    "fastslow.kernels.intervals.program",
    "enclose",
    {
        "program": Program, "boxes_low": Matrix, "boxes_high": Matrix, "registers": Registers,
        "low": Matrix, "high": Matrix,
    },
    kept=("program", "registers"),
)  # fmt: skip

LOOPS = (PRUNE, TIGHTEN, ENCLOSE)
