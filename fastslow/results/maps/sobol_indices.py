"""Sobol indices: shares of the variance of outputs due to each parameter."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import Name, class_of, shown
from fastslow.errors import ArgumentError, unknown_name
from fastslow.results.base.display import Summarized
from fastslow.results.base.framed import Framed
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.results.base.outcome import Outcome
from fastslow.results.base.result import Result
from fastslow.results.maps.grid import Grid

Array = NDArray[np.float64]

#: Columns of the indices of one output and one parameter.
COLUMNS = ("first", "first_error", "total", "total_error")


@dataclass(frozen=True, eq=False, repr=False)
class SobolIndices(Framed, Summarized, Result):
    """Sobol indices of the outputs of a function, for independent uniform parameters.

    ``found["x", "k"]`` contains the indices of the output x for the parameter k:
    V(E(x | k)) / V(x), the share of the variance due to k alone (``"first"``), and
    E(V(x | all others)) / V(x), which includes its interactions (``"total"``).

    Parameters
    ----------
    outputs, parameters : tuple of str
        The m outputs; the d parameters.
    ranges : mapping
        Lowest and highest value of each parameter.
    n : int
        Number of base samples.
    first, total : ndarray, shape (m, d)
        Indices of first and total order; NaN if they cannot be computed, see ``outcome``.
    first_error, total_error : ndarray, shape (m, d)
        Half-widths of their confidence intervals, by bootstrap.
    second, second_error : ndarray, shape (m, d, d) or (m, 0, 0)
        Indices of the interaction of two parameters, symmetric with NaN on the diagonal; empty
        if not computed.
    confidence : float
        Probability of the confidence intervals.
    resamples, seed : int
        Number of bootstrap samples; seed of the samples and of the bootstrap.
    grid : Grid
        The samples with all outputs.
    outcome : Outcome
        ``"complete"``, ``"points failed"``, or ``"incomplete"`` if points are missing.

    Examples
    --------
    >>> import fastslow as fs
    >>> def rise(a, b):
    ...     return {"y": a + 2 * b}
    >>> found = fs.sobol(rise, {"a": (0, 1), "b": (0, 1)}, 1024)
    >>> round(found["y", "b"]["first"], 2), found.grid.shape
    (0.8, (4096,))
    """

    outputs: tuple[str, ...]
    parameters: tuple[str, ...]
    ranges: Mapping[str, tuple[float, float]]
    n: int
    first: Array
    total: Array
    first_error: Array
    total_error: Array
    second: Array
    second_error: Array
    confidence: float
    resamples: int
    seed: int
    grid: Grid
    outcome: Outcome

    def __getitem__(self, key: tuple[Name, Name]) -> NamedMapping[float]:
        if class_of(key) != "a tuple" or len(key) != 2:
            raise ArgumentError(
                f"received {shown(key)}; expected an output and a parameter: one of "
                f"{', '.join(self.outputs)} and one of {', '.join(self.parameters)}"
            )
        output, parameter = map(str, key)
        if output not in self.outputs:
            raise unknown_name("output", output, self.outputs)
        if parameter not in self.parameters:
            raise unknown_name("parameter", parameter, self.parameters)
        place = self.outputs.index(output), self.parameters.index(parameter)
        return NamedMapping("index", {name: float(getattr(self, name)[place]) for name in COLUMNS})

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Return one row for each output and parameter: names, indices, interactions.

        With indices of second order the column ``with k`` is that of the interaction with k.
        """
        m, d = len(self.outputs), len(self.parameters)
        columns: dict[str, NDArray[Any]] = {
            "output": np.repeat(np.array(self.outputs, dtype=str), d),
            "parameter": np.tile(np.array(self.parameters, dtype=str), m),
            **{name: getattr(self, name).reshape(-1) for name in COLUMNS},
        }
        if self.second.size:
            second = self.second.reshape(m * d, d)
            columns |= {f"with {name}": second[:, k] for k, name in enumerate(self.parameters)}
        return columns

    def _groups(self) -> list[list[str]]:
        names = ", ".join(self.outputs) or "no output"
        head = (
            f"SobolIndices of {names} from {len(self.grid)} points "
            f"(n = {self.n}, {self.confidence:.0%} intervals): {self.outcome}"
        )
        rows = [
            f"  {output}, {name}: first order {self._text(output, name, 'first')}, "
            f"total {self._text(output, name, 'total')}"
            for output in self.outputs
            for name in self.parameters
        ]
        pairs = [
            f"  {output}, {one} with {other}: {self.second[k, i, j]:.3f} ± "
            f"{self.second_error[k, i, j]:.3f}"
            for k, output in enumerate(self.outputs)
            for i, one in enumerate(self.parameters)
            for j, other in enumerate(self.parameters)
            if self.second.size and i < j
        ]
        return [[head], rows, pairs]

    def _text(self, output: str, name: str, kind: str) -> str:
        found = self[output, name]
        return f"{found[kind]:.3f} ± {found[kind + '_error']:.3f}"
