"""Taylor series of a model of which the motion is data: the signs of its interfaces and walls.

The compiled function computes the values of all pieces, and tables that follow the parameters
choose among their rows. A motion is one table, so that motions are added during a run without
compilation.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from fastslow.kernels.compiler.model_code import load_function
from fastslow.kernels.taylor.recurrences import FUNCTIONS, Recurrences
from fastslow.kernels.taylor.saturation import Saturation, saturations
from fastslow.kernels.taylor.series import (
    SERIES_KEPT,
    CompiledSeries,
    described,
    source_of_modes,
)
from fastslow.kernels.taylor.sliding_weights import FUNCTIONS as SLIDING
from fastslow.kernels.taylor.sliding_weights import SlidingWeights
from fastslow.results.stored.operations import WEIGHTS, SeriesOperations
from fastslow.results.stored.signed_operations import SignedOperations

#: Largest number of motions that runs of a model form.
MOST_FORMED = 2**20


@dataclass(frozen=True, eq=False)
class SignedSeries:
    """The compiled series of a model whose motions are formed by their signs.

    Parameters
    ----------
    compiled : CompiledSeries
        Without motions: of these, ``signs``, ``modes`` and the saturations are empty.
    operations : SignedOperations
    saturations : tuple of Saturation
        The same in all motions.
    """

    compiled: CompiledSeries
    operations: SignedOperations
    saturations: tuple[Saturation, ...]

    @property
    def rests(self) -> NDArray[np.bool_]:
        """Whether a motion may rest on each of the interfaces and walls."""
        found = np.zeros(self.compiled.n_interfaces, dtype=bool)
        found[[j for j in self.operations.sliding if j >= self.operations.first_wall]] = True
        return found

    @property
    def width(self) -> int:
        """Length of the table of a motion."""
        return len(self.operations.choices) + 1 + len(self.operations.sliding)

    def table(self, signs: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the table of a motion, which follows those of the motions before it."""
        columns, operations = self.compiled.order + 1, self.operations
        found = np.zeros(self.width)
        given = tuple(signs.tolist())
        chosen = operations.rows(given)
        found[: len(chosen)] = np.array(chosen, dtype=float) * columns
        slides = [k for k, j in enumerate(operations.sliding) if given[j] == 0]
        found[len(chosen)] = len(slides)
        found[len(chosen) + 1 : len(chosen) + 1 + len(slides)] = slides
        return found


@lru_cache(maxsize=SERIES_KEPT)
def compile_by_signs(operations: SignedOperations, order: int) -> SignedSeries:
    """Compile the series of all motions of a model."""
    common, nodes, columns = operations.common, operations.nodes, order + 1
    last = max((node[1] + 1 for node in nodes), default=operations.first_free)
    weights = SlidingWeights(
        nodes=tuple(node for node in nodes if node[0] == WEIGHTS),
        columns=columns,
        bounds=sum(common.sizes),
        space=0,
        slides=len(operations.choices),
        interfaces=sum(j < operations.first_wall for j in operations.sliding),
    )
    plain = Recurrences(nodes, order, "clock", called=True, weights=weights)
    weights = replace(weights, space=max(operations.first_free, plain.n_rows, last))
    work = Recurrences(nodes, order, "clock", called=True, weights=weights)
    motion = SeriesOperations(
        "", (), operations.scalars, nodes, operations.rates, operations.outputs
    )
    body = _body(operations, work, order)
    functions = [FUNCTIONS, SLIDING] if weights.nodes else [FUNCTIONS]
    before = "\n".join([*weights.tables(), *functions] if weights.nodes else functions)
    source = source_of_modes(
        common, [(f"(mode >= 0) and (mode < {MOST_FORMED})", body)], MOST_FORMED, order
    )
    address = load_function(f"{before}\n\n\n{source}", "series")
    return SignedSeries(
        compiled=described(common, address, order, weights.space + weights.n_rows),
        operations=operations,
        saturations=tuple(saturations(motion)),
    )


def _body(operations: SignedOperations, work: Recurrences, order: int) -> list[str]:
    """Source lines that fill the series of the motion ``mode``."""
    m, width = operations.common.sizes[0], len(operations.choices) + 1 + len(operations.sliding)
    copies = {row: held for row, held in enumerate(operations.outputs, start=m) if row != held}
    body = ["t = inputs[0]", f"table = {operations.common.n_values} + mode * {width}"]
    body += [f"{work.at(i, '0')} = inputs[{i + 1}]" for i in range(m)]
    body += [f"c{k} = {code}" for k, code in enumerate(operations.scalars)]
    body += work.values()
    first = [f"{work.at(i, '1')} = {work.at(r, '0')}" for i, r in enumerate(operations.rates)]
    body += ["if clock != 0.0:", *(f"    {s}" for s in first)]
    weights = [node[1] for node in operations.nodes if node[0] == WEIGHTS]
    always, below = work.general([*operations.outputs, *weights])
    below += ["r = 1.0 / (k + 1)"]
    below += [f"{work.at(i, 'k + 1')} = {work.at(r)} * r" for i, r in enumerate(operations.rates)]
    body += ["for k in range(1, n + 1):", "    q = 1.0 / k", *(f"    {line}" for line in always)]
    body += ["    if k < n:", *(f"        {line}" for line in below)]
    if copies:
        body += ["for k in range(n + 1):"]
        body += [f"    {work.at(row)} = {work.at(held)}" for row, held in copies.items()]
    return body
