"""Curves of critical rates in the plane of the rate and another parameter."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import Name, finite, formula, validated
from fastslow.errors import ArgumentError, unknown_name
from fastslow.results.base.display import Summarized
from fastslow.results.base.outcome import Outcome
from fastslow.results.base.result import Result
from fastslow.results.base.table import Table

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class ThresholdCurve(Summarized, Table[Mapping[str, float]], Result):
    """A curve of critical rates over another parameter: the boundary between tracking and tipping.

    ``curve["r"]`` and ``curve["L"]`` are its columns.

    Parameters
    ----------
    parameter_names : tuple of str
        The two parameters, in the given order.
    values : ndarray, shape (N, 2)
        Points of the curve, each solved to rounding.
    tangent : ndarray, shape (N, 2)
        Unit tangents, in units of the ranges.
    parameters : mapping
        The values of all other parameters.
    outcomes : tuple of Outcome
        At the first and the last row.
    """

    parameter_names: tuple[str, str]
    values: Array
    tangent: Array
    parameters: Mapping[str, float]
    outcomes: tuple[Outcome, Outcome]

    _row = "point"
    _entry = "point"

    def __len__(self) -> int:
        return len(self.values)

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Return both parameters as columns."""
        return dict(zip(self.parameter_names, self.values.T, strict=True))

    @validated(name=formula)
    def folds(self, name: Name) -> NDArray[np.intp]:
        """Return the rows next to which a parameter turns along the curve.

        Parameters
        ----------
        name : str or Symbol
            One of the two parameters.
        """
        column = self.tangent[:, self._column(name)]
        return np.flatnonzero(column[1:] * column[:-1] < 0.0)

    def at(self, **value: float) -> Array:
        """Return the other parameter at a value of one of them, by cubic interpolation.

        Parameters
        ----------
        **value : float
            One of the two parameters by name.
        """
        if len(value) != 1:
            raise ArgumentError(
                f"expected the value of one of {', '.join(self.parameter_names)}, received "
                f"{', '.join(value) or 'none'}"
            )
        ((name, number),) = value.items()
        k = self._column(name)
        wanted, own, other = finite(name, number), self.values[:, k], self.values[:, 1 - k]
        found = [float(v) for v in other[own == wanted]]
        for row in np.flatnonzero((own[1:] - wanted) * (own[:-1] - wanted) < 0.0).tolist():
            found.append(self._between(row, k, wanted))
        return np.array(found)

    def _between(self, row: int, k: int, wanted: float) -> float:
        """Cubic with the slopes at both ends of a step, in the parameter that is given."""
        low, high = self.values[row : row + 2, k]
        first, last = self.values[row : row + 2, 1 - k]
        width = high - low
        slopes = self.tangent[row : row + 2, 1 - k] / self.tangent[row : row + 2, k] * width
        s = (wanted - low) / width
        chord = last - first
        bend, twist = 3 * chord - 2 * slopes[0] - slopes[1], slopes[0] + slopes[1] - 2 * chord
        return float(first + s * (slopes[0] + s * (bend + s * twist)))

    def _column(self, name: Name) -> int:
        if str(name) not in self.parameter_names:
            raise unknown_name("parameter of the curve", str(name), self.parameter_names)
        return self.parameter_names.index(str(name))

    def _groups(self) -> list[list[str]]:
        spans = [
            f"{n} from {v.min():.6g} to {v.max():.6g}"
            for n, v in zip(self.parameter_names, self.values.T, strict=True)
        ]
        ends = [f"  {'first' if k == 0 else 'last'} row: {o}" for k, o in enumerate(self.outcomes)]
        return [[f"ThresholdCurve({len(self)} points, {', '.join(spans)})"], ends]
