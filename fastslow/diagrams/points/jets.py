"""Taylor polynomials of expressions in several variables, without symbolic derivatives.

Expressions are evaluated with truncated power series (jets) instead of numbers: sums and
products of jets, and Taylor polynomials of functions of one argument.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from fastslow.model.known_functions import CLOSED, IN_MPMATH, OPEN

Jet = NDArray[np.complex128]


@dataclass(frozen=True)
class JetSpace:
    """Power series in some variables up to a total degree.

    A jet is the array of its coefficients, in the order of `powers`; the first is
    the value.

    Parameters
    ----------
    variables, degree : int

    Examples
    --------
    >>> space = JetSpace(2, 2)
    >>> space.powers
    ((0, 0), (0, 1), (1, 0), (0, 2), (1, 1), (2, 0))
    >>> one_plus = space.constant(1.0) + space.variable(0)
    >>> space.product(one_plus, one_plus).real.tolist()
    [1.0, 0.0, 2.0, 0.0, 0.0, 1.0]
    """

    variables: int
    degree: int

    @cached_property
    def powers(self) -> tuple[tuple[int, ...], ...]:
        """Exponents of every coefficient, ordered by total degree."""
        table = itertools.product(range(self.degree + 1), repeat=self.variables)
        return tuple(sorted((p for p in table if sum(p) <= self.degree), key=lambda p: (sum(p), p)))

    @cached_property
    def number(self) -> dict[tuple[int, ...], int]:
        """Index of every power."""
        return {power: k for k, power in enumerate(self.powers)}

    @cached_property
    def _pairs(self) -> NDArray[np.intp]:
        """Indices of two factors and of their product, shape (m, 3)."""
        found = []
        for (i, one), (j, other) in itertools.product(enumerate(self.powers), repeat=2):
            power = tuple(a + b for a, b in zip(one, other, strict=True))
            if power in self.number:
                found.append((i, j, self.number[power]))
        return np.array(found)

    def constant(self, value: complex) -> Jet:
        jet = np.zeros(len(self.powers), dtype=complex)
        jet[0] = value
        return jet

    def variable(self, k: int) -> Jet:
        jet = self.constant(0.0)
        jet[self.number[tuple(int(j == k) for j in range(self.variables))]] = 1.0
        return jet

    def product(self, one: Jet, other: Jet) -> Jet:
        first, second, target = self._pairs.T
        result = np.zeros(len(self.powers), dtype=complex)
        np.add.at(result, target, one[first] * other[second])
        return result

    def derivative(self, jet: Jet, k: int) -> Jet:
        """Differentiate by a variable; the coefficients of the highest degree are lost."""
        result = np.zeros_like(jet)
        for power, value in zip(self.powers, jet, strict=True):
            if power[k]:
                lower = tuple(p - (j == k) for j, p in enumerate(power))
                result[self.number[lower]] += power[k] * value
        return result

    def compose(self, derivatives: list[float], jet: Jet) -> Jet:
        """Compose a function, given by its derivatives at the value of a jet, with the jet."""
        inner = jet.copy()
        inner[0] = 0.0
        result = self.constant(0.0)
        for order in range(self.degree, -1, -1):
            result = self.product(result, inner)
            result[0] += derivatives[order] / math.factorial(order)
        return result

    def evaluate(self, expression: sp.Expr, values: Mapping[sp.Symbol, Jet]) -> Jet:
        """Evaluate an expression with jets for its symbols.

        Raises
        ------
        NotImplementedError
            For a function with several varying arguments.
        """
        known: dict[sp.Basic, Jet] = {}

        def jet(e: Any) -> Jet:
            if e not in known:
                known[e] = self._node(e, values, jet)
            return known[e]

        return jet(expression)

    def _node(self, e: Any, values: Mapping[sp.Symbol, Jet], jet: Any) -> Jet:
        if e.is_Symbol:
            return values[e]
        if e.is_number:
            return self.constant(complex(e))
        if e.is_Add:
            return np.asarray(sum((jet(a) for a in e.args), self.constant(0.0)))
        if e.is_Mul:
            result = self.constant(1.0)
            for a in e.args:
                result = self.product(result, jet(a))
            return result
        if e.is_Pow and e.exp.is_Integer and 0 < int(e.exp) <= 2 * self.degree:
            result = jet(e.base)
            for _ in range(int(e.exp) - 1):
                result = self.product(result, jet(e.base))
            return result
        moving = [a for a in e.args if np.any(jet(a)[1:] != 0)]
        if e.is_Pow and e.exp in moving:
            s = sp.Symbol("s")
            return self.evaluate(sp.exp(s), {s: self.product(jet(e.exp), jet(sp.log(e.base)))})
        if len(moving) > 1:
            raise NotImplementedError(f"{e.func.__name__} with several varying arguments")
        fixed = tuple(None if a in moving else complex(jet(a)[0]).real for a in e.args)
        place = fixed.index(None) if None in fixed else 0
        inner = jet(e.args[place])
        derivatives = _derivatives(e.func, fixed, place, self.degree)
        return self.compose([float(d) for d in derivatives(inner[0].real)], inner)


@lru_cache(maxsize=256)
def _derivatives(function: Any, fixed: tuple[float | None, ...], place: int, degree: int) -> Any:
    """Return a function that evaluates derivatives by one argument, the others fixed."""
    s = sp.Symbol("s", real=True)
    expression = function(*(s if k == place else sp.Float(f) for k, f in enumerate(fixed)))
    table = [expression]
    for _ in range(degree):
        table.append(table[-1].diff(s))
    special = any(e.has(*CLOSED, *OPEN) for e in table)
    modules = [IN_MPMATH, "mpmath"] if special else "numpy"
    return sp.lambdify(s, table, modules, cse=True)
