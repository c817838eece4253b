"""The compiled loops of this package, loaded when first used."""

from __future__ import annotations

from fastslow.certification.krawczyk import Rules, Space
from fastslow.certification.pruning_kernel import Search
from fastslow.kernels.intervals.program import Program, Registers
from fastslow.kernels.loops import Loop
from fastslow.kernels.records import Matrix

PRUNE = Loop(
    "fastslow.certification.pruning_kernel",
    "prune",
    {"program": Program, "rules": Rules, "search": Search, "space": Space, "budget": int},
    results=(int,),
    kept=("program", "rules", "search", "space"),
)

ENCLOSE = Loop(
    "fastslow.kernels.intervals.program",
    "enclose",
    {
        "program": Program, "boxes_low": Matrix, "boxes_high": Matrix, "registers": Registers,
        "low": Matrix, "high": Matrix,
    },
    kept=("program", "registers"),
)  # fmt: skip

LOOPS = (PRUNE, ENCLOSE)
