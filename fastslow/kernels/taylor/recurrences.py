"""Source of Taylor series operations: values of the rows, and coefficients of order k.

Every operation has a recurrence for its coefficient of order k from those of lower
order (Jorba and Zou 2005; Haro et al. 2016, table 2.1): linear for sums, one
convolution for products, quotients, powers, exp and log, and for any function
f with a derivative the row w = f(u) follows from w' = f'(u) u',

    w_k = (1/k) sum_{j=1}^{k} j u_j g_{k-j},    g = f'(u),

so that only w_0 needs the function itself.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from fastslow.results.stored.operations import (
    FUNCTION,
    LOGARITHM,
    MULTIPLE,
    POWER,
    PRODUCT,
    QUOTIENT,
    ROOT,
    SCALAR,
    SUM,
    TIME,
)


@dataclass(frozen=True)
class Recurrences:
    """Source of the operations of one motion.

    Parameters
    ----------
    nodes : tuple of tuple
        See `fastslow.results.stored.operations.SeriesOperations`.
    order : int
        Highest coefficient.
    clock : str
        Source of the rate of time: 1, or a name if it may be 0.
    """

    nodes: tuple[tuple[Any, ...], ...]
    order: int
    clock: str = "1.0"

    def at(self, row: int, index: str = "k") -> str:
        """Source of one coefficient of a row."""
        start = row * (self.order + 1)
        return f"W[{start}]" if index == "0" else f"W[{start} + {index}]"

    def values(self) -> list[str]:
        """Source lines of all coefficients of order 0."""
        return [f"{self.at(node[1], '0')} = {self._value(*node)}" for node in self.nodes]

    def general(self, rows: Sequence[int] | None = None) -> list[str]:
        """Source lines of the coefficients of order k, of all rows or of those that some need."""
        wanted = {node[1] for node in self.nodes} if rows is None else self._ancestors(rows)
        return [line for node in self.nodes if node[1] in wanted for line in self._lines(*node)]

    def _ancestors(self, rows: Sequence[int]) -> set[int]:
        by_row = {node[1]: node for node in self.nodes}
        found: set[int] = set()
        pending = list(rows)
        while pending:
            row = pending.pop()
            if row not in found:
                found.add(row)
                pending += _needs(*by_row[row]) if row in by_row else ()
        return found

    def _value(self, kind: str, row: int, *operands: Any) -> str:
        if kind == SCALAR:
            return str(operands[0])
        if kind == TIME:
            return "t"
        if kind == SUM:
            terms, constant = operands
            value = "".join(f"{_sign(f)}{self.at(r, '0')}" for f, r in terms)
            value += f" + {constant}" if constant else ""
            return value.removeprefix(" + ")
        if kind == MULTIPLE:
            return f"{operands[0]} * {self.at(operands[1], '0')}"
        if kind == PRODUCT:
            return " * ".join(self.at(r, "0") for r in operands)
        if kind == QUOTIENT:
            a, b = operands
            return f"{a if isinstance(a, str) else self.at(a, '0')} / {self.at(b, '0')}"
        if kind == ROOT:
            return f"math.sqrt({self.at(operands[1], '0')})"
        if kind == POWER:
            return f"math.pow({self.at(operands[1], '0')}, {operands[0]})"
        # a function, or a logarithm
        return re.sub(r"\br(\d+)\b", lambda r: self.at(int(r[1]), "0"), operands[0])

    def _lines(self, kind: str, row: int, *operands: Any) -> list[str]:
        target = self.at(row)
        if kind == SCALAR:
            return [f"{target} = 0.0"]
        if kind == TIME:
            return [f"{target} = {self.clock} if k == 1 else 0.0"]
        if kind == SUM:
            general = "".join(f"{_sign(f)}{self.at(r)}" for f, r in operands[0])
            return [f"{target} = {general.removeprefix(' + ')}"]
        if kind == MULTIPLE:
            return [f"{target} = {operands[0]} * {self.at(operands[1])}"]
        if kind == PRODUCT:
            return [*self._convolution(*operands), f"{target} = s"]
        if kind == QUOTIENT:
            a, b = operands
            R, B = (r * (self.order + 1) for r in (row, b))
            return [
                f"s = {'0.0' if isinstance(a, str) else self.at(a)}",
                "for j in range(k):",
                f"    s -= W[{R} + j] * W[{B} + k - j]",
                f"W[{R} + k] = s / W[{B}]",
            ]
        if kind in (ROOT, POWER):
            p, u = operands
            R, U = (r * (self.order + 1) for r in (row, u))
            return [
                "s = 0.0",
                "for j in range(1, k + 1):",
                f"    s += (j * ({p} + 1.0) - k) * W[{U} + j] * W[{R} + k - j]",
                f"W[{R} + k] = s / (k * W[{U}])",
            ]
        if kind == LOGARITHM:
            R, U = (r * (self.order + 1) for r in (row, operands[1]))
            return [
                "s = 0.0",
                "for j in range(1, k):",
                f"    s += j * W[{R} + j] * W[{U} + k - j]",
                f"W[{R} + k] = (W[{U} + k] - s / k) / W[{U}]",
            ]
        return self._chain(target, operands[1])

    def _convolution(self, a: int, b: int) -> list[str]:
        A, B = (r * (self.order + 1) for r in (a, b))
        if a == b:
            return [
                "s = 0.0",
                "for j in range((k + 1) // 2):",
                f"    s += W[{A} + j] * W[{A} + k - j]",
                "s += s",
                "if k % 2 == 0:",
                f"    s += W[{A} + k // 2] * W[{A} + k // 2]",
            ]
        return [
            "s = 0.0",
            "for j in range(k + 1):",
            f"    s += W[{A} + j] * W[{B} + k - j]",
        ]

    def _chain(self, target: str, slots: Sequence[tuple[int, int, str]]) -> list[str]:
        """Chain rule over the varying arguments."""
        lines = ["s = 0.0"]
        for argument, slope, steady in slots:
            U, G = (r * (self.order + 1) for r in (argument, slope))
            if steady:
                clock = "" if self.clock == "1.0" else f"{self.clock} * "
                lines.append(f"s += {clock}{steady} * W[{G} + k - 1]")
            else:
                lines.append("for j in range(1, k + 1):")
                lines.append(f"    s += j * W[{U} + j] * W[{G} + k - j]")
        return [*lines, f"{target} = s * q"]


def _sign(factor: str) -> str:
    return f" {factor} " if factor in ("+", "-") else f" + {factor} * "


def _needs(kind: str, row: int, *operands: Any) -> Sequence[int]:
    """Rows whose coefficients of order k enter that of this row."""
    if kind == SUM:
        return [r for _, r in operands[0]]
    if kind == FUNCTION:
        return [argument for argument, _, _ in operands[1]]
    return [r for r in operands if type(r) is int]
