"""Compiled plain steps of a model for several trajectories at once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from llvmlite import ir

from fastslow.kernels.compiler.machine_code import Address
from fastslow.kernels.compiler.model_code import load_built
from fastslow.kernels.simd.lane_steps import plain_steps
from fastslow.kernels.taylor.saturation import saturations
from fastslow.kernels.taylor.series import SERIES_KEPT, HasOperations, motion_source
from fastslow.results.stored.operations import Operations, SeriesOperations

#: Larger models are not compiled: rows of all regions times the square of the order. The
#: instructions are that many, and take half a minute per 100,000 to compile.
_LARGEST_MODEL = 50_000


@dataclass(frozen=True)
class CompiledSteps:
    """The compiled plain steps of a model.

    Parameters
    ----------
    address : Address
        Of ``void(int64 region, double* lanes, double* parameters, double* W)``. It
        takes steps until one of them is not `TAKEN` in every lane. The arrays
        hold `WIDTH` numbers for each row: ``lanes`` time, states, the rows
        that `lane_steps` names, the smallest and largest values of every
        state, and the sizes that the run has reached; ``parameters`` those of the
        series, the binary logarithm of the tolerance and the rules of sizes; ``W`` is
        filled with the coefficients of states and slow quantities where a step is
        `REPORTED`.
    regions : int
        Number of regions, the first modes of the series; 0 for a model that is too large.
    """

    address: Address
    regions: int


#: For models without steps in lanes: without a series, with special functions, or too large.
NO_STEPS = CompiledSteps(Address(0), 0)


def compile_steps(model: HasOperations, order: int) -> CompiledSteps:
    """Compile the plain steps of a model, or return the compiled ones.

    Parameters
    ----------
    model : Model
    order : int
        Order of the series.
    """
    return _compiled(model.operations, order)


@lru_cache(maxsize=SERIES_KEPT)
def _compiled(operations: Operations, order: int) -> CompiledSteps:
    if operations.values_only:
        return NO_STEPS
    n = operations.n_values
    plain = (m for m in operations.motions if isinstance(m, SeriesOperations))
    regions = [m for m in plain if 0 not in m.signs]
    sources = [motion_source(operations, region, order) for region in regions]
    if sum(rows for _, rows in sources) * order**2 > _LARGEST_MODEL:
        return NO_STEPS
    text = ""
    for number, (body, _) in enumerate(sources):
        text += f"def region_{number}(inputs, parameters, W, math):\n"
        lines = [f"n = {order}", *(f"p{i} = parameters[{i}]" for i in range(n)), *body]
        text += "".join(f"    {line}\n" for line in lines) + "\n\n"
    if "special." in text:
        return NO_STEPS
    signs = tuple(region.signs for region in regions)
    saturating = tuple(tuple(saturations(region)) for region in regions)
    sizes = (*operations.sizes[:2], n, order)

    def build(module: ir.Module) -> None:
        traced: dict[str, Any] = {}
        exec(text, traced)
        functions = [traced[f"region_{number}"] for number in range(len(sources))]
        plain_steps(module, functions, signs, saturating, sizes)

    # the trace has neither variables nor loops: LLVM's passes would take half of the time
    # without gain
    address = load_built(f"{signs} {saturating} {sizes}\n{text}", "steps", build, passes=False)
    return CompiledSteps(address, len(sources))
