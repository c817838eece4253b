"""The compiled loop of this package, loaded when first used."""

from __future__ import annotations

from fastslow.kernels.loops import Loop
from fastslow.orbits.flow.equations import Linear, Newton, ShootingEquations
from fastslow.orbits.flow.stepping import Factors, FlowProblem, FlowSegments, FlowWorkspace

SOLVE = Loop(
    "fastslow.orbits.flow.equations",
    "solve_orbit",
    {
        "problem": FlowProblem, "equations": ShootingEquations, "segments": FlowSegments,
        "factors": Factors, "space": FlowWorkspace, "linear": Linear, "newton": Newton,
    },
    results=(int,),
    kept=("problem", "equations", "segments", "factors", "space", "linear", "newton"),
)  # fmt: skip

LOOPS = (SOLVE,)
