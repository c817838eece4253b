"""Source of the weights of sliding along interfaces and of rest on walls, as Taylor series.

With the rates f₀ + Σ bᵢ sᵢ the weights of m interfaces solve 0 = a + B s. From the inverse C of B
at the point their coefficients follow order by order,

    s_k = −C (a_k + Σ_{j ≥ 1} B_j s_{k−j}).

The bounds of interface i are the Lie derivatives of hᵢ for sᵢ = 1 and −1 while sliding along the
others, (1 − sᵢ)/C_ii and (−1 − sᵢ)/C_ii, with C at the point. At rest on a wall h is the speed into
it and s the acceleration without contact, which is the second bound; the first is −1.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from fastslow.results.stored.operations import WEIGHTS

#: Functions that fill the weights and bounds, from the rows of a and B in ``DRIFT_ROWS`` and
#: ``JUMP_ROWS``, of which those from ``walls`` on are of walls. The ones of a motion are at
#: ``slides`` of the parameters, their number first; ``space`` is the place of C, of size square,
#: and of B or a vector beyond it.
FUNCTIONS = """\
def slide(
    W, parameters, slides: int, size: int, walls: int, columns: int, first: int,
    bounds: int, space: int
):
    m = int(parameters[slides])
    other = space + size * size
    for i in range(size):
        W[first + i * columns] = 0.0
    for i in range(m):
        a = int(parameters[slides + 1 + i])
        for j in range(m):
            row = JUMP_ROWS[a * size + int(parameters[slides + 1 + j])]
            W[space + i * size + j] = 0.0
            W[other + i * size + j] = 0.0
            if row >= 0:
                W[other + i * size + j] = W[row]
        W[space + i * size + i] = 1.0
    for c in range(m):
        pivot = c
        best = abs(W[other + c * size + c])
        for i in range(c + 1, m):
            if abs(W[other + i * size + c]) > best:
                best = abs(W[other + i * size + c])
                pivot = i
        if pivot > c:
            for j in range(m):
                s = W[other + c * size + j]
                W[other + c * size + j] = W[other + pivot * size + j]
                W[other + pivot * size + j] = s
                s = W[space + c * size + j]
                W[space + c * size + j] = W[space + pivot * size + j]
                W[space + pivot * size + j] = s
        s = 1.0 / W[other + c * size + c]
        for j in range(m):
            W[other + c * size + j] = W[other + c * size + j] * s
            W[space + c * size + j] = W[space + c * size + j] * s
        for i in range(m):
            factor = W[other + i * size + c]
            if i != c and factor != 0.0:
                for j in range(m):
                    W[other + i * size + j] -= factor * W[other + c * size + j]
                    W[space + i * size + j] -= factor * W[space + c * size + j]
    for i in range(m):
        s = 0.0
        for j in range(m):
            s -= W[space + i * size + j] * W[DRIFT_ROWS[int(parameters[slides + 1 + j])]]
        place = int(parameters[slides + 1 + i])
        W[first + place * columns] = s
        own = W[space + i * size + i]
        if own == 0.0:
            own = 1.0
        if place < walls:
            W[bounds + 2 * i * columns] = (1.0 - s) / own
            W[bounds + (2 * i + 1) * columns] = (-1.0 - s) / own
        else:
            W[bounds + 2 * i * columns] = -1.0
            W[bounds + (2 * i + 1) * columns] = s
    return 0.0


def slide_on(
    W, parameters, k: int, slides: int, size: int, walls: int, columns: int, first: int,
    bounds: int, space: int
):
    m = int(parameters[slides])
    other = space + size * size
    for i in range(size):
        W[first + i * columns + k] = 0.0
    for i in range(m):
        a = int(parameters[slides + 1 + i])
        s = W[DRIFT_ROWS[a] + k]
        for j in range(m):
            b = int(parameters[slides + 1 + j])
            row = JUMP_ROWS[a * size + b]
            if row >= 0:
                for order in range(1, k + 1):
                    s += W[row + order] * W[first + b * columns + k - order]
        W[other + i] = s
    for i in range(m):
        s = 0.0
        for j in range(m):
            s -= W[space + i * size + j] * W[other + j]
        place = int(parameters[slides + 1 + i])
        W[first + place * columns + k] = s
        own = W[space + i * size + i]
        if own == 0.0:
            own = 1.0
        if place < walls:
            W[bounds + 2 * i * columns + k] = -s / own
            W[bounds + (2 * i + 1) * columns + k] = -s / own
        else:
            W[bounds + 2 * i * columns + k] = 0.0
            W[bounds + (2 * i + 1) * columns + k] = s
    return 0.0
"""


@dataclass(frozen=True)
class SlidingWeights:
    """Source of the weights of sliding.

    Parameters
    ----------
    nodes : tuple of tuple
        All nodes `WEIGHTS`, in rows that follow each other.
    columns : int
        Length of a row.
    bounds : int
        First row of the bounds.
    space : int
        First row of the work space.
    slides : int
        Place of the number of sliding interfaces, which precedes them, in the table of a motion.
    interfaces : int
        Number of nodes that are weights of interfaces; the others are those of walls.
    """

    nodes: tuple[tuple[Any, ...], ...]
    columns: int
    bounds: int
    space: int
    slides: int
    interfaces: int

    @property
    def size(self) -> int:
        """Largest number of sliding interfaces."""
        return len(self.nodes)

    @property
    def n_rows(self) -> int:
        """Number of rows of the work space."""
        return -(-2 * self.size**2 // self.columns)

    def tables(self) -> list[str]:
        """Source of the tables of rows."""
        _, _, _, drifts, entries = self.nodes[0]
        rows = {(i, j): row * self.columns for i, j, row in entries}
        jumps = [rows.get((i, j), -1) for i in range(self.size) for j in range(self.size)]
        return [
            f"DRIFT_ROWS = ({', '.join(str(row * self.columns) for row in drifts)},)",
            f"JUMP_ROWS = ({', '.join(map(str, jumps))},)",
        ]

    def lines(self, index: str) -> list[str]:
        """Source lines of all weights and bounds of order ``index``."""
        assert self.nodes[0][0] == WEIGHTS
        first = self.nodes[0][1] * self.columns
        places = (self.size, self.interfaces, self.columns, first, self.bounds * self.columns)
        given = ", ".join(map(str, (*places, self.space * self.columns)))
        name, order = ("slide", "") if index == "0" else ("slide_on", f"{index}, ")
        return [f"s = {name}(W, parameters, {order}table + {self.slides}, {given})"]
