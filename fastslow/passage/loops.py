"""The compiled loops of this package."""

from __future__ import annotations

from fastslow.kernels.compiler.records import Flags, Matrix, Vector
from fastslow.kernels.loops import Loop
from fastslow.passage.delays.radau_passages import Law, LocalMotion, PassageSpace, RadauEnd

PASS_THROUGH = Loop(
    "fastslow.passage.delays.radau_passages",
    "pass_through",
    {
        "motion": LocalMotion, "law": Law, "end": RadauEnd, "z": Vector, "times": Vector,
        "unit": Vector, "space": PassageSpace,
    },
    results=(int, int),
)  # fmt: skip

NEARNESS = Loop(
    "fastslow.passage.overlay.chain_distances",
    "nearness_to_chain",
    {"points": Matrix, "chain": Matrix, "radius": float, "near": Vector},
    read=("points", "chain"),
)

BESIDE = Loop(
    "fastslow.passage.overlay.chain_distances",
    "beside_chain",
    {"points": Matrix, "chain": Matrix, "radius": float, "beside": Flags},
    read=("points", "chain"),
)

LOOPS = (PASS_THROUGH, NEARNESS, BESIDE)
