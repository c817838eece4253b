"""Expressions as polynomials along the steps of a run."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.polynomial import Chebyshev, Polynomial
from numpy.typing import NDArray

from fastslow.errors import ArgumentError, quoted
from fastslow.formulas.columns import computed, read
from fastslow.formulas.grammar import (
    Name,
    Negative,
    Node,
    Power,
    Product,
    Sum,
    names_of,
    text_of,
)
from fastslow.formulas.limits import COLUMNS_DEGREE

Array = NDArray[np.float64]

#: Highest degree of interpolants.
_DEGREE = 24


@dataclass(frozen=True, eq=False)
class StepPolynomials:
    """A quantity along every step of a run, as polynomials in 0 ≤ s ≤ 1.

    Parameters
    ----------
    coefficients : ndarray, shape (n_steps, degree + 1)
        Coefficients of s**k, where s is the fraction of the step.
    size : ndarray, shape (n_steps,)
        Sum of the moduli of all terms, the scale of rounding errors.
    """

    coefficients: Array
    size: Array

    @classmethod
    def of(cls, coefficients: Array) -> StepPolynomials:
        """Return the polynomials of given coefficients, with the size of their terms."""
        return cls(coefficients, np.abs(coefficients).sum(axis=1))

    def __add__(self, other: StepPolynomials) -> StepPolynomials:
        one, two = self.coefficients, other.coefficients
        width = max(one.shape[1], two.shape[1])
        total = np.zeros((len(one), width))
        total[:, : one.shape[1]] += one
        total[:, : two.shape[1]] += two
        return StepPolynomials(total, self.size + other.size)

    def __neg__(self) -> StepPolynomials:
        return StepPolynomials(-self.coefficients, self.size)

    def __mul__(self, other: StepPolynomials) -> StepPolynomials:
        one, two = self.coefficients, other.coefficients
        product = np.zeros((len(one), one.shape[1] + two.shape[1] - 1))
        for k in range(two.shape[1]):
            product[:, k : k + one.shape[1]] += one * two[:, k : k + 1]
        return StepPolynomials(product, self.size * other.size)

    def minus(self, level: float) -> StepPolynomials:
        """Subtract a constant."""
        shifted = self.coefficients.copy()
        shifted[:, 0] -= level
        return StepPolynomials(shifted, self.size + abs(level))


class Expansion:
    """The expansion of a polynomial in columns, parameters and time along every step.

    Parameters
    ----------
    text : str
    columns : mapping
        Each column as a function that returns its polynomials.
    parameters : mapping
    line : ndarray, shape (n_steps, 2)
        Start and length of every step, the coefficients of t.
    """

    def __init__(
        self,
        text: str,
        columns: Mapping[str, Callable[[], StepPolynomials]],
        parameters: Mapping[str, float],
        line: Array,
    ) -> None:
        self.text, self.columns, self.line = text, columns, line
        names = (*columns, *parameters, "t")
        self.tree, self.known = read(text, names, "column or parameter")
        self.moving = {n for n, own in self.known.items() if own in columns or own == "t"}
        self.constants = {
            n: parameters[own] for n, own in self.known.items() if n not in self.moving
        }

    def polynomials(self) -> StepPolynomials:
        """Return the polynomials; UnknownNameError or ArgumentError if it is no polynomial."""
        # check everything before the first product is computed
        self.degree(self.tree)
        with np.errstate(over="ignore", invalid="ignore"):
            found = self.read(self.tree)
        if not (np.isfinite(found.coefficients).all() and np.isfinite(found.size).all()):
            raise ArgumentError(f"{quoted(self.text)} is not finite along the run")
        return found

    def refused(self, node: Node) -> ArgumentError:
        return ArgumentError(
            f"{quoted(self.text)} is not a polynomial in columns and parameters, at "
            f"{quoted(text_of(node))}; add it to the model as an interface, and write "
            "section(interface=...)"
        )

    def fixed(self, node: Node) -> bool:
        """Return True if a subexpression is constant along the run."""
        return self.moving.isdisjoint(names_of(node))

    def number(self, node: Node) -> float:
        """Return the value of a constant subexpression."""
        value = float(computed(node, self.constants))
        if not np.isfinite(value):
            raise self.refused(node)
        return value

    def degree(self, node: Node) -> int:
        """Return the total degree of a subexpression, after a check that it is a polynomial."""
        if isinstance(node, Name) and node.name in self.moving:
            return 1
        if self.fixed(node):
            self.number(node)
            return 0
        degree = 1
        match node:
            case Negative(operand):
                degree = self.degree(operand)
            case Sum(pairs):
                degree = max(self.degree(term) for _, term in pairs)
            case Product(pairs):
                for sign, factor in pairs:
                    if sign == "/" and not (self.fixed(factor) and self.number(factor)):
                        raise self.refused(node)
                degree = sum(self.degree(factor) for _, factor in pairs)
            case Power(base, exponent):
                power = self.number(exponent) if self.fixed(exponent) else -1.0
                if power < 0.0 or power != int(power):
                    raise self.refused(node)
                degree = self.degree(base) * int(power)
            case _:
                raise self.refused(node)
        if degree > COLUMNS_DEGREE:
            raise ArgumentError(
                f"{quoted(self.text)} has the degree {degree} at {quoted(text_of(node))}; "
                f"expected a polynomial of total degree up to {COLUMNS_DEGREE}"
            )
        return degree

    def read(self, node: Node) -> StepPolynomials:
        """Expand a checked subexpression."""
        if isinstance(node, Name) and node.name in self.moving:
            return self.column(self.known[node.name])
        if self.fixed(node):
            return self.constant(self.number(node))
        match node:
            case Negative(operand):
                return -self.read(operand)
            case Sum(((_, first), *rest)):
                total = self.read(first)
                for sign, term in rest:
                    total = total + (self.read(term) if sign == "+" else -self.read(term))
                return total
            case Product(pairs):
                total = self.constant(1.0)
                for sign, factor in pairs:
                    if sign == "/":
                        total = total * self.constant(1.0 / self.number(factor))
                    else:
                        total = total * self.read(factor)
                return total
            case Power(base, exponent):
                total, once = self.constant(1.0), self.read(base)
                for _ in range(int(self.number(exponent))):
                    total = total * once
                return total
        raise self.refused(node)

    def column(self, name: str) -> StepPolynomials:
        return self.columns[name]() if name in self.columns else StepPolynomials.of(self.line)

    def constant(self, value: float) -> StepPolynomials:
        return StepPolynomials.of(np.full((len(self.line), 1), value))


def values_at(series: Array, offsets: Array) -> Array:
    """Return the columns of steps at offsets into each, shape (n_columns, n_steps, …)."""
    value = np.zeros((series.shape[1], *offsets.shape))
    for k in range(series.shape[2] - 1, -1, -1):
        row = series[:, :, k].T
        value = value * offsets + row.reshape(*row.shape, *[1] * (offsets.ndim - 1))
    return value


@cache
def nodes_for(degree: int) -> Array:
    """Chebyshev points of the second kind on [0, 1], for a degree of at most 24."""
    degree = min(degree, _DEGREE)
    return np.asarray(np.sin(0.5 * np.pi * np.arange(degree + 1) / degree) ** 2)


def interpolated(values: Array) -> Array:
    """Return the coefficients in powers of interpolants from values on `nodes_for`, row by row."""
    to_chebyshev, to_powers = _matrices(values.shape[1] - 1)
    coefficients = values @ to_chebyshev.T
    # rounding errors would be large in powers
    largest = np.abs(values).max(axis=1, keepdims=True)
    coefficients[np.abs(coefficients) < 4.0 * np.finfo(float).eps * largest] = 0.0
    return np.asarray(coefficients @ to_powers.T)


@cache
def _matrices(degree: int) -> tuple[Array, Array]:
    """Matrices from values on `nodes_for` to Chebyshev coefficients, and from these to powers."""
    values = np.polynomial.chebyshev.chebvander(2.0 * nodes_for(degree) - 1.0, degree)
    powers = np.zeros((degree + 1, degree + 1))
    for k in range(degree + 1):
        one = Chebyshev.basis(k, domain=[0, 1]).convert(kind=Polynomial, domain=[-1, 1])
        powers[: k + 1, k] = one.coef
    return np.asarray(np.linalg.inv(values)), powers
