"""The compiled loop of this package, loaded when first used."""

from __future__ import annotations

from fastslow.kernels.loops import Loop
from fastslow.orbits.flow.equations import Equations, Linear, Newton
from fastslow.orbits.flow.stepping import Factors, Problem, Segments, Space

SOLVE = Loop(
    "fastslow.orbits.flow.equations",
    "solve_orbit",
    {
        "problem": Problem, "equations": Equations, "segments": Segments, "factors": Factors,
        "space": Space, "linear": Linear, "newton": Newton,
    },
    results=(int,),
    kept=("problem", "equations", "segments", "factors", "space", "linear", "newton"),
)  # fmt: skip

LOOPS = (SOLVE,)
