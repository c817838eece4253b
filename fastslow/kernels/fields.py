"""Compiled rates, Jacobian and switching functions of a frozen model."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from itertools import chain, zip_longest

import numpy as np
import sympy as sp
from numpy.typing import NDArray
from sympy.printing.codeprinter import PrintMethodNotImplementedError
from sympy.printing.pycode import PythonCodePrinter

from fastslow.errors import ModelError
from fastslow.kernels.compiler.machine_code import Address
from fastslow.kernels.field_code import LOOPED_ZEROS, CompiledField, load_field, load_shared_field
from fastslow.kernels.taylor.many_motions import are_many
from fastslow.model.differentiation import derivative
from fastslow.model.known_functions import refusal, register_functions
from fastslow.model.model import Model
from fastslow.model.structure import real
from fastslow.results.stored.fields import FieldOperations

#: Rates and switching functions of one smooth motion.
Equations = tuple[Sequence[sp.Expr], Sequence[sp.Expr]]

#: Number of addresses of fields that are kept, each with the linker of its code and what that keeps
#: of other libraries.
ADDRESSES_KEPT = 64


def compile_field(
    model: Model, *varying: str, modes: Sequence[Equations] | None = None
) -> CompiledField:
    """Compile the frozen rates of every region, with derivatives by states and parameters.

    Parameters
    ----------
    model : Model
        Without forcing: a frozen model.
    *varying : str
        The continuation parameters.
    modes : sequence of (rates, switching functions), optional
        Equations to compile instead of the rates of the regions and the interfaces.

    Raises
    ------
    ModelError
        If the rates depend on time.
    """
    if modes is None:
        heights = [i.function for i in model.interfaces.values()]
        modes = [([r.rates[n] for n in model.states], heights) for r in model.regions.values()]
    rows_of, renaming, others = named_rows(model, varying, modes)
    unknowns = len(model.states) + len(varying)
    address = field_address(rows_of, len(model.states), renaming, unknowns, len(others))
    n, m = len(model.states), max((len(f) for _, f in modes), default=0)
    return CompiledField(address, others, n, m, len(varying))


def named_rows(
    model: Model, varying: Sequence[str], modes: Sequence[Equations]
) -> tuple[
    tuple[tuple[sp.Expr, ...], ...], tuple[tuple[sp.Symbol, sp.Symbol], ...], tuple[str, ...]
]:
    """Rows of every mode, names of their symbols in code, and ordered parameters."""
    names = (*model.states, *varying)
    others = tuple(dict.fromkeys(n for n in (*model.parameters, *model.free) if n not in varying))
    rename = {real(n): sp.Symbol(f"u{k}") for k, n in enumerate(names)}
    rename |= {real(n): sp.Symbol(f"p{k}") for k, n in enumerate(others)}
    rows_of = tuple((*rates, *functions) for rates, functions in modes)
    return rows_of, tuple(rename.items()), others


def compile_function(
    expression: sp.Expr, unknowns: Sequence[sp.Symbol]
) -> tuple[Address, NDArray[np.float64]]:
    """Compile an expression with its gradient, with its numbers as parameters.

    Expressions that differ only in their numbers share their code.

    Returns
    -------
    address : Address
        Of ``void(int64, double* unknowns, double* parameters, double* out)``, which fills in the
        value and its derivatives.
    parameters : ndarray
    """
    numbers = sorted(expression.atoms(sp.Float))
    names = {number: sp.Symbol(f"(number {k})") for k, number in enumerate(numbers)}
    renaming = {s: sp.Symbol(f"u{k}") for k, s in enumerate(unknowns)}
    renaming |= {name: sp.Symbol(f"p{k}") for k, name in enumerate(names.values())}
    row = expression.xreplace(names)
    address = field_address(((row,),), 1, tuple(renaming.items()), len(unknowns), len(numbers))
    return address, np.array([float(n) for n in numbers])


@lru_cache(maxsize=ADDRESSES_KEPT)
def field_address(
    rows_of: tuple[tuple[sp.Expr, ...], ...],
    n: int,
    renaming: tuple[tuple[sp.Symbol, sp.Symbol], ...],
    unknowns: int,
    parameters: int,
) -> Address:
    """Address of the generated function of these rows."""
    if not are_many(len(rows_of), n):
        return load_field(operations_of(rows_of, n, renaming), unknowns, parameters)
    rows, numbers = [], []
    for place in zip_longest(*rows_of, fillvalue=sp.Integer(0)):
        different = {row: k for k, row in enumerate(dict.fromkeys(place))}
        rows.append(operations_of([(row,) for row in different], 1, renaming))
        numbers.append([different[row] for row in place])
    return load_shared_field(rows, [*zip(*numbers, strict=True)], n, unknowns, parameters)


def operations_of(
    rows_of: Sequence[tuple[sp.Expr, ...]],
    n: int,
    renaming: tuple[tuple[sp.Symbol, sp.Symbol], ...],
) -> list[FieldOperations]:
    """Operations that compute rows and their derivatives by the unknowns u0, u1 and so on."""
    rename = dict(renaming)
    bodies = []
    for rows in rows_of:
        unknown = set().union(*(r.free_symbols for r in rows)) - set(rename)
        if unknown:
            name = min(s.name for s in unknown)
            raise ModelError(
                f"the rates depend on '{name}', which has no frozen value; "
                "call frozen() on the model first"
            )
        bodies.append(_body(rows, n, rename))
    return bodies


def _body(rows: Sequence[sp.Expr], n: int, rename: dict[sp.Symbol, sp.Symbol]) -> FieldOperations:
    """Operations that fill the output array for one region."""
    unknowns = [s for s, new in rename.items() if new.name.startswith("u")]
    values = [r.xreplace(rename) for r in rows]
    slopes = [_slopes(r, unknowns, rename) for r in rows]
    first, second = (list(chain.from_iterable(rows)) for rows in (slopes[:n], slopes[n:]))
    ordered = [*values[:n], *first, *values[n:], *second]
    filled = len(ordered) >= LOOPED_ZEROS
    kept = [k for k, value in enumerate(ordered) if not (filled and value == 0)]
    shared, results = sp.cse([ordered[k] for k in kept], symbols=sp.numbered_symbols("s"))
    printer = _Printer({"fully_qualified_modules": True})
    try:
        parts = [str(printer.doprint(value)) for _, value in shared]
        codes = [_float(printer.doprint(v)) for v in results]
    except PrintMethodNotImplementedError:
        raise refusal(ordered) from None
    return FieldOperations(tuple(parts), tuple(zip(kept, codes, strict=True)), len(ordered))


def _slopes(
    row: sp.Expr, unknowns: Sequence[sp.Symbol], rename: dict[sp.Symbol, sp.Symbol]
) -> list[sp.Expr]:
    """Derivatives by the unknowns, renamed."""
    inside = row.free_symbols
    return [derivative(row, u).xreplace(rename) if u in inside else sp.Integer(0) for u in unknowns]


class _Printer(PythonCodePrinter):
    """Printer of Python code in which a pole gives infinity."""

    def _print_Pow(self, expr: sp.Pow, rational: bool = False) -> str:
        if expr.exp.is_Integer and expr.exp < -1:
            # numba raises for 0.0**(-2)
            return f"(1.0/{self._print(expr.base**-expr.exp)})"
        return super()._print_Pow(expr, rational=rational)

    def _print_Rational(self, expr: sp.Rational) -> str:
        if max(abs(expr.p), expr.q) >= 2**53:
            # numba has 64-bit integers only
            return f"({float(expr)!r})"
        return super()._print_Rational(expr)

    def _print_Integer(self, expr: sp.Integer) -> str:
        return self._print_Rational(expr) if abs(expr) >= 2**53 else str(expr.p)


register_functions(_Printer)


def _float(code: str) -> str:
    return f"{code}.0" if code.lstrip("-").isdigit() else code
