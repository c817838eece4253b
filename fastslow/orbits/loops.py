"""The compiled loop of this package, loaded when first used."""

from __future__ import annotations

from fastslow.kernels.loops import Loop
from fastslow.orbits.stepping import Factors, Problem, Segments, Space

FLOW = Loop(
    "fastslow.orbits.stepping",
    "flow_segments",
    {"problem": Problem, "segments": Segments, "factors": Factors, "space": Space},
    results=(int,),
    kept=("space",),
)

LOOPS = (FLOW,)
