"""Expressions as polynomials along the steps of a run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import ArgumentError, quoted
from fastslow.formulas.columns import computed, read, written_formula
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
from fastslow.formulas.limits import DEGREE

if TYPE_CHECKING:
    from fastslow.results.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]


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


def along_steps(run: Trajectory, expression: object) -> StepPolynomials:
    """Expand a column, or a polynomial in columns, parameters and time, along every step.

    Parameters
    ----------
    run : Trajectory
        With dense output.
    expression : str or Expr
        A polynomial in columns and t of total degree up to `DEGREE`, whose coefficients
        are numbers, parameters and functions of these.

    Raises
    ------
    UnknownNameError
        For a name that is neither a column nor a parameter.
    ArgumentError
        For an expression that is not a polynomial, or a run without dense output.
    """
    text = written_formula(expression)
    if run.series is None:
        raise ArgumentError(
            "this run has no dense output, which this query requires; simulate with dense=True"
        )
    if text in run.columns:
        return _column(run, text)
    return _Expansion(run, text).polynomial()


def _column(run: Trajectory, name: str) -> StepPolynomials:
    assert run.series is not None
    power = run.steps[:, 1:2] ** np.arange(run.series.shape[2])
    scaled = run.series[:, run.columns.index(name)] * power
    return StepPolynomials(scaled, np.abs(scaled).sum(axis=1))


def _constant(run: Trajectory, value: float) -> StepPolynomials:
    n = len(run.steps)
    return StepPolynomials(np.full((n, 1), value), np.full(n, abs(value)))


class _Expansion:
    """The expansion of an expression along a run."""

    def __init__(self, run: Trajectory, text: str) -> None:
        self.run, self.text = run, text
        names = (*run.columns, *run.parameters, "t")
        self.tree, self.known = read(text, names, "column or parameter")
        self.moving = {n for n, own in self.known.items() if own in run.columns or own == "t"}
        self.constants = {
            n: run.parameters[own] for n, own in self.known.items() if n not in self.moving
        }

    def polynomial(self) -> StepPolynomials:
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
        if degree > DEGREE:
            raise ArgumentError(
                f"{quoted(self.text)} has the degree {degree} at {quoted(text_of(node))}; "
                f"expected a polynomial of total degree up to {DEGREE}"
            )
        return degree

    def read(self, node: Node) -> StepPolynomials:
        """Expand a checked subexpression."""
        if isinstance(node, Name) and node.name in self.moving:
            return self.column(self.known[node.name])
        if self.fixed(node):
            return _constant(self.run, self.number(node))
        match node:
            case Negative(operand):
                return -self.read(operand)
            case Sum(((_, first), *rest)):
                total = self.read(first)
                for sign, term in rest:
                    total = total + (self.read(term) if sign == "+" else -self.read(term))
                return total
            case Product(pairs):
                total = _constant(self.run, 1.0)
                for sign, factor in pairs:
                    if sign == "/":
                        total = total * _constant(self.run, 1.0 / self.number(factor))
                    else:
                        total = total * self.read(factor)
                return total
            case Power(base, exponent):
                total, once = _constant(self.run, 1.0), self.read(base)
                for _ in range(int(self.number(exponent))):
                    total = total * once
                return total
        raise self.refused(node)

    def column(self, name: str) -> StepPolynomials:
        if name in self.run.columns:
            return _column(self.run, name)
        line = self.run.steps[:, :2].copy()
        return StepPolynomials(line, np.abs(line).sum(axis=1))
