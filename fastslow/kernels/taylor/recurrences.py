"""Source of Taylor series operations: values of the rows, and coefficients of order k.

Every operation has a recurrence for its coefficient of order k from those of lower
order (Jorba and Zou 2005; Haro et al. 2016, table 2.1): linear for sums, one
convolution for products, quotients, powers, exp and log, and for any function
f with a derivative the row w = f(u) follows from w' = f'(u) u',

    w_k = (1/k) sum_{j=1}^{k} j u_j g_{k-j},    g = f'(u),

so that only w_0 needs the function itself.

The derivatives of a quotient with a removable singularity have no recurrence that is stable near
the singular point. Its derivatives of orders 0 to n are rows, of which one after the other needs
one coefficient fewer, and whose values are computed one by one.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from fastslow.kernels.taylor.sliding_weights import SlidingWeights
from fastslow.results.stored.operations import (
    CHOSEN,
    FUNCTION,
    LOGARITHM,
    MULTIPLE,
    POWER,
    PRODUCT,
    QUOTIENT,
    REMOVABLE,
    ROOT,
    SCALAR,
    SUM,
    TIME,
    WEIGHTS,
)

#: Lines that add a sum over lower orders to s, for rows whose coefficients begin at W[a] and W[b].
_SUMS = {
    "product": """\
for j in range(k + 1):
    s += W[{a} + j] * W[{b} + k - j]""",
    "square": """\
for j in range((k + 1) // 2):
    s += W[{a} + j] * W[{a} + k - j]
s += s
if k % 2 == 0:
    s += W[{a} + k // 2] * W[{a} + k // 2]""",
    "remainder": """\
for j in range(k):
    s -= W[{a} + j] * W[{b} + k - j]""",
    "power": """\
for j in range(1, k + 1):
    s += (j * ({p} + 1.0) - k) * W[{b} + j] * W[{a} + k - j]""",
    "logarithm": """\
for j in range(1, k):
    s += j * W[{a} + j] * W[{b} + k - j]""",
    "chain": """\
for j in range(1, k + 1):
    s += j * W[{a} + j] * W[{b} + k - j]""",
}


def _function(name: str, body: str) -> str:
    """Source of a sum as a function."""
    starts = "".join(f", {row}: int" for row in "ab" if f"{{{row}}}" in body)
    numbers = ", p: float" if "{p}" in body else ""
    lines = body.format(a="a", b="b", p="p").splitlines()
    first = f"def {name}(W, s: float, k: int{starts}{numbers}):"
    return "\n".join((first, *(f"    {line}" for line in (*lines, "return s"))))


#: Source of the sums as functions. A call takes a few nanoseconds, in which a loop of few terms
#: is over, but the code of loops in place takes most of the compilation time of long recurrences.
FUNCTIONS = "\n\n\n".join(_function(name, body) for name, body in _SUMS.items())


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
    called : bool
        Whether sums over lower orders are those of `FUNCTIONS`, instead of loops in place.
    weights : SlidingWeights, optional
        Of nodes `WEIGHTS`.
    """

    nodes: tuple[tuple[Any, ...], ...]
    order: int
    clock: str = "1.0"
    called: bool = False
    weights: SlidingWeights | None = None

    def at(self, row: int, index: str = "k") -> str:
        """Source of one coefficient of a row."""
        start = row * (self.order + 1)
        return f"W[{start}]" if index == "0" else f"W[{start} + {index}]"

    def values(self, nodes: Sequence[tuple[Any, ...]] | None = None) -> list[str]:
        """Source lines of all coefficients of order 0, or of those of some nodes."""
        lines: list[str] = []
        for node in self.nodes if nodes is None else nodes:
            if node[0] == REMOVABLE:
                lines += self._derivatives(lines, *node[2:4])
            if node[0] == WEIGHTS:
                lines += self._weights(node[2], "0")
                continue
            lines.append(f"{self.at(node[1], '0')} = {self._value(*node)}")
        return lines

    @cached_property
    def _quotients(self) -> dict[tuple[str, int], tuple[int, int]]:
        """Of each quotient the place of its derivatives, and the number of those of order k.

        Coefficients of order k of all derivatives are next to each other.
        """
        highest: dict[tuple[str, int], int] = {}
        for node in self.nodes:
            if node[0] == REMOVABLE:
                _, _, name, argument, order = node
                highest[name, argument] = max(order, highest.get((name, argument), 0))
        found = {}
        place = max((node[1] + 1 for node in self.nodes), default=0) * (self.order + 1)
        for key, order in highest.items():
            found[key] = place, self.order + 1 + order
            place += (self.order + 1) * (self.order + 1 + order)
        return found

    @property
    def n_rows(self) -> int:
        """Number of rows of the nodes, with those for the derivatives of quotients."""
        rows = max((node[1] + 1 for node in self.nodes), default=0)
        return rows + sum(width for _, width in self._quotients.values())

    def _derivatives(self, done: Sequence[str], name: str, argument: int) -> list[str]:
        """Source lines of the values of all derivatives of a quotient, once."""
        first, width = self._quotients[name, argument]
        value = f"    W[{first} + i] = special.{name}({self.at(argument, '0')}, i)"
        return [] if value in done else [f"for i in range(n + {width - self.order}):", value]

    def general(
        self, rows: Collection[int], nodes: Sequence[tuple[Any, ...]] | None = None
    ) -> tuple[list[str], list[str]]:
        """Source lines of the coefficients of order k: of all that some rows need, and others.

        Of all nodes, or of some.
        """
        needed = self.needed_by(rows)
        lines: tuple[list[str], list[str]] = ([], [])
        computed: set[tuple[str, int]] = set()
        for last in (False, True):
            for node in self.nodes if nodes is None else nodes:
                if (node[1] not in needed) is not last:
                    continue
                if node[0] == REMOVABLE and (key := node[2:4]) not in computed:
                    computed.add(key)
                    lines[last].extend(self._descent(*key))
                lines[last].extend(self._lines(*node))
        return lines

    def _descent(self, name: str, argument: int) -> list[str]:
        """Source lines of the coefficients of order k of all derivatives of a quotient.

        The sums of all derivatives grow together, so that no addition waits for another.
        """
        first, width = self._quotients[name, argument]
        some = f"for i in range(n - k + {width - self.order}):"
        return [
            some,
            f"    W[{first} + {width} * k + i] = 0.0",
            "for j in range(1, k + 1):",
            f"    s = j * q * W[{argument * (self.order + 1)} + j]",
            f"    {some}",
            f"        W[{first} + {width} * k + i] += s * W[{first + 1} + {width} * (k - j) + i]",
        ]

    def needed_by(self, rows: Collection[int]) -> set[int]:
        """Return some rows with all of which theirs are computed."""
        by_row = {node[1]: node for node in self.nodes}
        found: set[int] = set()
        pending = list(rows)
        while pending:
            row = pending.pop()
            if row not in found:
                found.add(row)
                pending += _needs(*by_row[row]) if row in by_row else ()
        return found

    def _weights(self, place: int, index: str) -> list[str]:
        """Source lines of the weights of all sliding interfaces, with those of the first."""
        assert self.weights is not None
        return [] if place else self.weights.lines(index)

    def _value(self, kind: str, row: int, *operands: Any) -> str:
        if kind == CHOSEN:
            return f"W[int(parameters[table + {operands[0]}])]"
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
        if kind == REMOVABLE:
            return self._place("0", *operands)
        # a function, or a logarithm
        return re.sub(r"\br(\d+)\b", lambda r: self.at(int(r[1]), "0"), operands[0])

    def _lines(self, kind: str, row: int, *operands: Any) -> list[str]:
        target = self.at(row)
        if kind == CHOSEN:
            return [f"{target} = W[int(parameters[table + {operands[0]}]) + k]"]
        if kind == WEIGHTS:
            return self._weights(operands[0], "k")
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
            a, b = operands
            lines = self._sum("square", a) if a == b else self._sum("product", a, b)
            return ["s = 0.0", *lines, f"{target} = s"]
        if kind == QUOTIENT:
            a, b = operands
            first = f"s = {'0.0' if isinstance(a, str) else self.at(a)}"
            return [first, *self._sum("remainder", row, b), f"{target} = s / {self.at(b, '0')}"]
        if kind in (ROOT, POWER):
            p, u = operands
            lines = self._sum("power", row, u, p=p)
            return ["s = 0.0", *lines, f"{target} = s / (k * {self.at(u, '0')})"]
        if kind == LOGARITHM:
            u = operands[1]
            result = f"{target} = ({self.at(u)} - s / k) / {self.at(u, '0')}"
            return ["s = 0.0", *self._sum("logarithm", row, u), result]
        if kind == REMOVABLE:
            return [f"{target} = {self._place('k', *operands)}"]
        return self._chain(target, operands[1])

    def _place(self, index: str, name: str, argument: int, order: int) -> str:
        """Source of a coefficient of a derivative of a quotient."""
        first, width = self._quotients[name, argument]
        return f"W[{first + order} + {width} * {index}]"

    def _sum(self, name: str, *rows: int, **numbers: str) -> list[str]:
        """Source lines that add a sum over lower orders to s."""
        starts = [str(row * (self.order + 1)) for row in rows]
        if self.called:
            return [f"s = {name}({', '.join(('W', 's', 'k', *starts, *numbers.values()))})"]
        return _SUMS[name].format(**dict(zip("ab", starts, strict=False)), **numbers).splitlines()

    def _chain(self, target: str, slots: Sequence[tuple[int, int, str]]) -> list[str]:
        """Chain rule over the varying arguments."""
        lines = ["s = 0.0"]
        for argument, slope, steady in slots:
            if steady:
                clock = "" if self.clock == "1.0" else f"{self.clock} * "
                lines.append(f"s += {clock}{steady} * W[{slope * (self.order + 1)} + k - 1]")
            else:
                lines += self._sum("chain", argument, slope)
        return [*lines, f"{target} = s * q"]


def _sign(factor: str) -> str:
    return f" {factor} " if factor in ("+", "-") else f" + {factor} * "


def _needs(kind: str, row: int, *operands: Any) -> Sequence[int]:
    """Rows whose coefficients of order k enter that of this row."""
    if kind == SUM:
        return [r for _, r in operands[0]]
    if kind == FUNCTION:
        return [argument for argument, _, _ in operands[1]]
    if kind == REMOVABLE:
        return [operands[1]]
    if kind == CHOSEN:
        return list(operands[1])
    if kind == WEIGHTS:
        return [*operands[1], *(row for _, _, row in operands[2])]
    return [r for r in operands if type(r) is int]
