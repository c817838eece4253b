"""Expressions read from text as polynomials along the steps of a run."""

from __future__ import annotations

import ast
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import ArgumentError, unknown_name

if TYPE_CHECKING:
    from fastslow.results.trajectories import Trajectory

Array = NDArray[np.float64]

#: Powers higher than this are taken for a slip of the pen.
HIGHEST_POWER = 8


@dataclass(frozen=True, eq=False)
class StepPolynomials:
    """A quantity along every step of a run, as polynomials in 0 ≤ s ≤ 1.

    Parameters
    ----------
    coefficients : ndarray, shape (n_steps, degree + 1)
        Of s**k, where s is the part of the step gone through.
    size : ndarray, shape (n_steps,)
        Sum of the moduli of all terms that were added: what rounding is relative to.
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
        """The quantity less a constant."""
        shifted = self.coefficients.copy()
        shifted[:, 0] -= level
        return StepPolynomials(shifted, self.size + abs(level))


def along_steps(run: Trajectory, expression: object) -> StepPolynomials:
    """A column, or a polynomial in columns, parameters and time, along every step.

    Parameters
    ----------
    run : Trajectory
        With dense output.
    expression : str or Expr
        Read from what it prints: names, numbers, ``+ - * /`` and whole powers.

    Raises
    ------
    UnknownNameError
        For a name that is no column and no parameter.
    ArgumentError
        For an expression that is no polynomial, or a run without dense output.
    """
    if run.series is None:
        raise ArgumentError(
            "this run kept no dense output, which this question needs; simulate with dense=True"
        )
    text = str(expression)
    if text in run.columns:
        return _column(run, text)
    try:
        tree = ast.parse(text, mode="eval")
    except SyntaxError:
        raise ArgumentError(f"{text!r} is no expression in {', '.join(run.columns)}") from None
    return _read(run, tree.body, text)


def _column(run: Trajectory, name: str) -> StepPolynomials:
    assert run.series is not None
    power = run.steps[:, 1:2] ** np.arange(run.series.shape[2])
    scaled = run.series[:, run.columns.index(name)] * power
    return StepPolynomials(scaled, np.abs(scaled).sum(axis=1))


def _constant(run: Trajectory, value: float) -> StepPolynomials:
    n = len(run.steps)
    return StepPolynomials(np.full((n, 1), value), np.full(n, abs(value)))


def _read(run: Trajectory, node: ast.expr, text: str) -> StepPolynomials:
    """Build the polynomial of a parsed expression; nothing in it is ever run."""
    if isinstance(node, ast.Name):
        return _named(run, node.id)
    if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        return _constant(run, float(node.value))
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd):
        inner = _read(run, node.operand, text)
        return -inner if isinstance(node.op, ast.USub) else inner
    if isinstance(node, ast.BinOp):
        left = _read(run, node.left, text)
        right = _read(run, node.right, text)
        if isinstance(node.op, ast.Add):
            return left + right
        if isinstance(node.op, ast.Sub):
            return left + -right
        if isinstance(node.op, ast.Mult):
            return left * right
        if right.coefficients.shape[1] == 1 and len(run.steps):
            number = float(right.coefficients[0, 0])
            if isinstance(node.op, ast.Div) and number != 0.0:
                return left * _constant(run, 1.0 / number)
            whole = number == int(number) and 0 <= number <= HIGHEST_POWER
            if isinstance(node.op, ast.Pow) and whole:
                result = _constant(run, 1.0)
                for _ in range(int(number)):
                    result = result * left
                return result
    raise ArgumentError(
        f"{text!r} is no polynomial in columns and parameters, at {ast.unparse(node)!r}; "
        "add it to the model as an interface, and ask for section(interface=...)"
    )


def _named(run: Trajectory, name: str) -> StepPolynomials:
    if name in run.columns:
        return _column(run, name)
    if name in run.parameters:
        return _constant(run, float(run.parameters[name]))
    if name == "t":
        line = run.steps[:, :2].copy()
        return StepPolynomials(line, np.abs(line).sum(axis=1))
    raise unknown_name("column or parameter", name, (*run.columns, *run.parameters, "t"))
