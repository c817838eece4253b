"""Programs of interval arithmetic from SymPy expressions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

import numpy as np
import sympy as sp

from fastslow.errors import ModelError
from fastslow.kernels.intervals import elementary
from fastslow.kernels.intervals import program as operations
from fastslow.kernels.intervals.program import Program, Registers
from fastslow.model.differentiation import gradient
from fastslow.model.known_functions import ELEMENTARY, formula_at
from fastslow.model.rational import exact
from fastslow.model.removable import ExpQuotient, with_removable, written_out

#: Digits of the constants of SymPy, such as π, and the error of their last ones.
_CONSTANT_DIGITS, _LAST = 50, Fraction(1, 10**45)

_LARGEST = Fraction(float(np.finfo(float).max))

#: Register of an expression; the tables of operations count from the unknowns and constants.
Key = tuple[Any, ...]


def bounds(low: Fraction, high: Fraction) -> tuple[float, float]:
    """Return the smallest interval of floating-point numbers that contains [low, high].

    Examples
    --------
    >>> bounds(Fraction(1, 2), Fraction(1, 2))
    (0.5, 0.5)
    >>> bounds(Fraction(1, 10), Fraction(1, 10))
    (0.09999999999999999, 0.1)
    """
    if low < -_LARGEST or high > _LARGEST:
        return -np.inf, np.inf
    below, above = float(low), float(high)
    if Fraction(below) > low:
        below = float(np.nextafter(below, -np.inf))
    if Fraction(above) < high:
        above = float(np.nextafter(above, np.inf))
    return below, above


def enclosure(number: sp.Expr) -> tuple[float, float]:
    """Return bounds of an exact number of SymPy; a Float is the decimal that it is read from.

    Examples
    --------
    >>> enclosure(sp.Float(0.1)) == enclosure(sp.Rational(1, 10))
    True
    >>> low, high = enclosure(sp.pi)
    >>> low, high
    (3.141592653589793, 3.1415926535897936)
    """
    number = exact(number)
    if number.is_Rational:
        value = Fraction(int(number.p), int(number.q))
        return bounds(value, value)
    digits = sp.Rational(sp.N(number, _CONSTANT_DIGITS))
    value = Fraction(int(digits.p), int(digits.q))
    return bounds(value - abs(value) * _LAST, value + abs(value) * _LAST)


@dataclass(frozen=True, eq=False)
class _Writer:
    """Collects the operations of expressions; equal ones are computed once."""

    unknowns: tuple[sp.Symbol, ...]
    constants: dict[tuple[float, float], int] = field(default_factory=dict)
    rows: list[tuple[int, ...]] = field(default_factory=list)
    known: dict[Key, int] = field(default_factory=dict)
    places: dict[sp.Expr, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.places.update({s: k for k, s in enumerate(self.unknowns)})

    # constants have negative numbers until their registers are known

    def constant(self, ends: tuple[float, float]) -> int:
        return self.constants.setdefault(ends, -1 - len(self.constants))

    def operation(self, code: int, a: int, b: int = 0, c: int = 0) -> int:
        key = (code, a, b, c)
        if key not in self.known:
            self.known[key] = len(self.unknowns) + len(self.rows)
            self.rows.append((code, self.known[key], a, b, c))
        return self.known[key]

    def place(self, e: sp.Expr) -> int:
        """Return the register of an expression."""
        if e not in self.places:
            self.places[e] = self._written(e)
        return self.places[e]

    def _written(self, e: sp.Expr) -> int:
        if e.is_Rational or e.is_NumberSymbol:
            return self.constant(enclosure(e))
        if isinstance(e, sp.Add):
            return self._sum(e)
        if isinstance(e, sp.Mul):
            return self._product(e)
        if isinstance(e, sp.Pow):
            return self._power(e)
        if isinstance(e, ExpQuotient):
            order = int(e.args[1])
            if order > 2:
                raise self._refusal(e)
            return self.operation(operations.EXP_QUOTIENT, self.place(e.args[0]), order)
        name = type(e).__name__
        if name in elementary.FUNCTIONS:
            code, last = elementary.FUNCTIONS[name]
            return self.operation(code, self.place(e.args[0]), last)
        if _is_enclosed(e.func):
            return self.place(formula_at(ELEMENTARY[e.func].written, *e.args))
        raise self._refusal(e)

    def _refusal(self, e: sp.Expr) -> ModelError:
        what = f"'{e}'" if e.is_Symbol else str(getattr(e, "func", e))
        names = sorted([*(f.__name__ for f in ELEMENTARY if _is_enclosed(f)), "sqrt"])
        return ModelError(
            f"the rates contain {what}, which has no interval arithmetic; expected functions "
            f"among {', '.join(names)}"
        )

    def _sum(self, e: sp.Add) -> int:
        total: int | None = None
        # products are added to a sum in one operation
        for term in sorted(e.args, key=lambda t: isinstance(t, sp.Mul)):
            if total is None:
                total = self.place(term)
                continue
            first, second = self._factors(term)
            if second is None:
                total = self.operation(operations.ADD, total, first)
            else:
                total = self.operation(self._kind(first, True), first, second, total)
        assert total is not None
        return total

    def _kind(self, first: int, added: bool) -> int:
        """Return the operation of a product whose first factor may be a number."""
        number = first < 0 and len(set(self._ends(first))) == 1
        if added:
            return operations.ADD_SCALED if number else operations.ADD_PRODUCT
        return operations.SCALE if number else operations.MULTIPLY

    def _ends(self, constant: int) -> tuple[float, float]:
        return list(self.constants)[-1 - constant]

    def _factors(self, term: sp.Expr) -> tuple[int, int | None]:
        """Return the registers of two factors of a term, or of the whole term and None."""
        if not isinstance(term, sp.Mul) or term in self.places:
            return self.place(term), None
        coefficient, rest = term.as_coeff_Mul()
        if coefficient != 1:
            return self.constant(enclosure(coefficient)), self.place(rest)
        *head, last = term.args
        if isinstance(last, sp.Pow) and last.exp.is_number and last.exp.is_negative:
            return self.place(term), None
        return self.place(sp.Mul(*head)), self.place(last)

    def _product(self, e: sp.Mul) -> int:
        coefficient, rest = e.as_coeff_Mul()
        if coefficient != 1:
            inner = self.place(rest)
            if coefficient == -1:
                return self.operation(operations.NEGATE, inner)
            number = self.constant(enclosure(coefficient))
            return self.operation(self._kind(number, False), number, inner)
        above = [f for f in e.args if not _below(f)]
        below = [1 / f for f in e.args if _below(f)]
        if not below:
            *head, last = above
            first = self.place(sp.Mul(*head))
            return self.operation(operations.MULTIPLY, first, self.place(last))
        top = self.place(sp.Mul(*above))
        return self.operation(operations.DIVIDE, top, self.place(sp.Mul(*below)))

    def _power(self, e: sp.Pow) -> int:
        base, exponent = e.base, e.exp
        if base is sp.E:
            return self.operation(elementary.EXPONENTIAL, self.place(exponent))
        if exponent.is_Integer:
            n = int(exponent)
            if n == -1:
                return self.operation(
                    operations.DIVIDE, self.constant((1.0, 1.0)), self.place(base)
                )
            if n == 2:
                return self.operation(operations.SQUARE, self.place(base))
            return self.operation(operations.POWER, self.place(base), n)
        if exponent.is_Rational and exponent.q == 2:
            root = self.operation(operations.SQUARE_ROOT, self.place(base))
            n = int(exponent.p)
            if n == 1:
                return root
            return self.operation(operations.POWER, root, n)
        return self.operation(operations.REAL_POWER, self.place(base), self.place(exponent))


def _is_enclosed(function: type[sp.Basic]) -> bool:
    """Whether a function has an operation, or its record writes it by functions that have one."""
    known = ELEMENTARY.get(function)
    if known is None or known.name in elementary.FUNCTIONS:
        return known is not None
    return bool(known.written) and all(
        _is_enclosed(f.func) for f in formula_at(known.written).atoms(sp.Function)
    )


def _below(factor: sp.Expr) -> bool:
    """Return True for factors that belong to a denominator."""
    return isinstance(factor, sp.Pow) and factor.exp.is_number and bool(factor.exp.is_negative)


@dataclass(frozen=True, eq=False)
class IntervalProgram:
    """A program with the initial content of its registers.

    Parameters
    ----------
    program : Program
    low, high : ndarray
        Bounds of the constants in their registers.
    """

    program: Program
    low: np.ndarray
    high: np.ndarray

    def registers(self) -> Registers:
        """Return new registers."""
        return Registers(self.low.copy(), self.high.copy())


def interval_program(rows: Sequence[sp.Expr], unknowns: Sequence[sp.Symbol]) -> IntervalProgram:
    """Write functions and their derivatives by all unknowns as a program.

    Parameters
    ----------
    rows : sequence of Expr, length n
        A Float is the decimal that it is read from.
    unknowns : sequence of Symbol, length N

    Raises
    ------
    ModelError
        If a function has no interval arithmetic here, or a symbol has no value.
    """
    found = (with_removable(exact(sp.sympify(row))) for row in rows)
    functions = [written_out(row, ExpQuotient) for row in found]
    slopes = [slope for row in functions for slope in gradient(row, tuple(unknowns))]
    shared, results = sp.cse(
        [*functions, *slopes], symbols=sp.numbered_symbols("_shared_"), order="none"
    )
    writer = _Writer(tuple(unknowns))
    waiting = dict(shared)

    def write(e: sp.Expr) -> int:
        # what the values need comes first
        for symbol in _needed(e, waiting):
            writer.places[symbol] = writer.place(waiting.pop(symbol))
        return writer.place(e)

    values = [write(e) for e in results[: len(functions)]]
    count = len(writer.rows)
    derivatives = [write(e) for e in results[len(functions) :]]
    return _assembled(writer, values, count, derivatives)


def _needed(e: sp.Expr, waiting: dict[sp.Symbol, sp.Expr]) -> list[sp.Symbol]:
    """Return the shared symbols that an expression depends on, in the order of evaluation."""
    found: dict[sp.Symbol, None] = {}

    def visit(part: sp.Expr) -> None:
        for symbol in sorted(part.free_symbols, key=str):
            if symbol in waiting and symbol not in found:
                visit(waiting[symbol])
                found[symbol] = None

    visit(e)
    return list(found)


def _assembled(
    writer: _Writer, values: list[int], count: int, derivatives: list[int]
) -> IntervalProgram:
    """Number the registers: unknowns, constants, operations."""
    width, n_constants = len(writer.unknowns), len(writer.constants)

    def register(place: int) -> int:
        if place < 0:
            return width - 1 - place
        return place if place < width else place + n_constants

    whole = (operations.POWER, elementary.SINE, operations.EXP_QUOTIENT)
    code = [
        (op, register(target), register(a), b if op in whole else register(b), register(c))
        for op, target, a, b, c in writer.rows
    ]
    low = np.zeros(width + n_constants + len(code))
    high = low.copy()
    for ends, place in writer.constants.items():
        low[register(place)], high[register(place)] = ends
    slopes = np.array([register(place) for place in derivatives], dtype=np.int64)
    program = Program(
        np.array(code, dtype=np.int64).reshape(-1, 5),
        count,
        np.array([register(place) for place in values], dtype=np.int64),
        slopes.reshape(len(values), width),
    )
    return IntervalProgram(program, low, high)
