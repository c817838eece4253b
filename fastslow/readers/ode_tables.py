"""Tables of .ode files: values at equal distances, linear between and beyond them."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from fastslow.model.tabulated import Tabulated
from fastslow.readers.ode_statements import Named, Statements

Array = NDArray[np.float64]

#: Greatest number of values of a table.
MOST_VALUES = 1_000_000


@dataclass(frozen=True, eq=False)
class LookupTable:
    """The knots of a table and its values, shape (n,).

    Parameters
    ----------
    knots, values : ndarray, shape (n,)
    stepwise : bool
        Whether a value is kept until the next knot.
    """

    knots: Array
    values: Array
    stepwise: bool = False

    def in_time(self, first: float, last: float) -> Tabulated:
        """Return the table as a law of time, with its lines continued over a run."""
        if self.stepwise:
            return Tabulated(self.knots, self.values, interpolation="previous")
        before = [first] if first < self.knots[0] else []
        after = [last] if last > self.knots[-1] else []
        times = [*before, *self.knots, *after]
        return Tabulated(times, [*map(self.at, before), *self.values, *map(self.at, after)])

    def at(self, x: float) -> float:
        """Return the value at a number; lines are continued beyond the ends.

        Examples
        --------
        >>> LookupTable(np.array([0.0, 1.0, 2.0]), np.array([0.0, 2.0, 3.0])).at(3.0)
        4.0
        """
        k = int(np.clip(np.searchsorted(self.knots, x, side="right") - 1, 0, len(self.knots) - 2))
        if self.stepwise and self.knots[0] <= x < self.knots[-1]:
            return float(self.values[k])
        slope = (self.values[k + 1] - self.values[k]) / (self.knots[k + 1] - self.knots[k])
        return float(self.values[k] + slope * (x - self.knots[k]))

    def pieces(self, argument: sp.Expr) -> sp.Expr:
        """Return the table at an expression."""
        lines = []
        for k in range(len(self.knots) - 1):
            low, value = sp.Float(self.knots[k]), sp.Float(self.values[k])
            slope = (self.values[k + 1] - self.values[k]) / (self.knots[k + 1] - self.knots[k])
            inner = self.stepwise and 0 < k < len(self.knots) - 2
            line = value if inner else value + sp.Float(slope) * (argument - low)
            last = k == len(self.knots) - 2
            lines.append((line, True if last else argument < sp.Float(self.knots[k + 1])))
        return sp.Piecewise(*lines)


def read_table(
    statements: Statements, one: Named, values: Callable[[Named, Sequence[float]], Array]
) -> LookupTable:
    """Read the table of a directive: ``% points low high formula``, or a file.

    Parameters
    ----------
    statements : Statements
    one : Named
    values : callable
        Returns the values of a formula in t at some times.

    Raises
    ------
    ModelError
        With the line.
    """
    line = one.line
    found = re.match(r"%\s*(\d+)\s+(\S+)\s+(\S+)\s+", line.text)
    if found:
        count, low, high = found.groups()
        knots = _knots(one, count, low, high)
        formula = Named(one.name, line.part(found.end()))
        return LookupTable(knots, _finite(one, values(formula, knots.tolist())))
    name = line.text.strip().strip('"')
    if line.text.startswith("%"):
        raise line.refused("expected a table such as: table f % 101 0 10 sin(t)")
    if statements.folder is None:
        raise line.refused(f"table {one.name} is in the file {name!r}; read the text by fs.read")
    written = statements.text_beside(line, name)[0].split()
    if len(written) < 5:
        raise line.refused(f"the file {name} is no table: number of values, ends, values")
    first = written[0]
    if first.startswith("s") or first == "xyvals":
        raise line.refused(f"the table in {name} is no linear one; only these can be read")
    knots = _knots(one, first.removeprefix("i"), *written[1:3])
    if len(written) - 3 < len(knots):
        raise line.refused(
            f"the file {name} is cut short: {len(written) - 3} of {len(knots)} values"
        )
    numbers = np.array([_number(one, word) for word in written[3 : 3 + len(knots)]])
    return LookupTable(knots, _finite(one, numbers), first.startswith("i"))


def _knots(one: Named, count: str, low: str, high: str) -> Array:
    number, first, last = (_number(one, word) for word in (count, low, high))
    if not 2 <= number <= MOST_VALUES or not first < last:
        raise one.line.refused(
            f"table {one.name} has {number:g} values from {first:g} to {last:g}; expected 2 to "
            f"{MOST_VALUES}, the lower end first"
        )
    return np.linspace(first, last, int(number))


def _number(one: Named, word: str) -> float:
    try:
        return float(word)
    except ValueError:
        raise one.line.refused(f"table {one.name}: {word!r} is no number") from None


def _finite(one: Named, values: Array) -> Array:
    if not np.isfinite(values).all():
        raise one.line.refused(f"table {one.name} has values that are not finite numbers")
    return values
