"""Derivation of a frozen field from the equations of a model."""

from __future__ import annotations

import ast
import inspect
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import sympy as sp

from fastslow.diagrams.modes import Mode, modes_of, walls_of
from fastslow.diagrams.rate_derivatives import derivatives
from fastslow.kernels.field_code import CompiledField
from fastslow.kernels.fields import compile_field, named_rows, operations_of
from fastslow.model.derived import cached_by_partition
from fastslow.model.model import Model
from fastslow.model.structure import real
from fastslow.model.traits import text_of
from fastslow.model.units import unit_equations
from fastslow.results.stored.arithmetic import UnknownOperationError, check_number
from fastslow.results.stored.fields import Derivatives, FieldMode, FieldSides, StoredField
from fastslow.results.stored.unit_equations import UnitEquations


@dataclass(frozen=True, eq=False)
class DerivedField:
    """Compiled rates, derivatives and units of a model with equations, for `FrozenField`.

    Parameters
    ----------
    model : Model
    varying : tuple of str
        The varying parameters.
    """

    model: Model
    varying: tuple[str, ...]

    @cached_property
    def modes(self) -> tuple[Mode, ...]:
        return modes_of(self.model)

    @property
    def walls(self) -> tuple[str, ...]:
        """The walls of resets, as equations."""
        return tuple(reset.wall for reset in walls_of(self.model))

    @cached_property
    def _rows(self) -> list[tuple[Sequence[sp.Expr], Sequence[sp.Expr]]]:
        return [(mode.rates, mode.rows) for mode in self.modes]

    @cached_property
    def compiled(self) -> CompiledField:
        return compile_field(self.model, *self.varying, modes=self._rows)

    def unit_equations(self, values: Mapping[str, float]) -> UnitEquations:
        """Return the equations of natural units at parameter values."""
        names = (*self.model.states, *self.varying)
        functions = [i.function for i in self.model.interfaces.values()]
        functions += [wall.function for wall in walls_of(self.model)]
        known = {real(n): v for n, v in values.items()}
        return unit_equations(names, self.model.regions.values(), functions, known)

    def derivatives(self, region: int) -> tuple[Sequence[tuple[int, ...]], Callable[..., Any]]:
        """Return the indices of non-zero second and third derivatives, and their function.

        Its arguments are the states, the varying parameters and the other parameters.
        """
        names = [*self.varying, *(p for p in self.model.parameters if p not in self.varying)]
        rates = tuple(self.modes[region].rates)
        return derivatives(rates, tuple(map(real, self.model.states)), tuple(map(real, names)))

    def levels(self) -> dict[str, tuple[str, float] | tuple[str, float, int]]:
        """Return the interfaces at a constant value of one state; see `Diagram`."""
        sides = self._sides
        return {
            name: (*level, sides[name]) if sides.get(name) else level
            for name, level in self._levels_now().items()
        }

    @cached_property
    def _sides(self) -> dict[str, int]:
        """Walls, with the sign of the slope of h for those at a constant value of one state."""
        values, found = self.model.values, {}
        for wall in walls_of(self.model):
            slopes = [wall.function.diff(real(n)).subs(values) for n in self.model.states]
            signs = {int(sp.sign(slope)) for slope in slopes if slope.is_number and slope != 0}
            # the threshold of a switch has no side beyond it
            found[wall.wall] = signs.pop() if len(signs) == 1 and wall.jump else 0
        return found

    def _levels_now(self) -> dict[str, tuple[str, float]]:
        values = self.model.values
        found = {}
        zero = tuple(s for s, v in values.items() if v == 0)
        for name, state, parameters, level, _ in _levels(self.model, self.varying[0], zero):
            try:
                at = float(level(*(values[p] for p in parameters)))
            except (ArithmeticError, ValueError, TypeError):
                continue
            if math.isfinite(at):
                found[name] = (state, at)
        return found

    def path(self) -> dict[str, str]:
        """Return each slow quantity as text, for a model frozen along a path."""
        return {quantity: str(law) for quantity, law in self.model.path.items()}

    def stored(self) -> StoredField:
        """Return the field in the form stored in files, with one varying parameter.

        Raises
        ------
        ModelError
            For functions that cannot be compiled.
        """
        (parameter,) = self.varying
        rows_of, renaming, others = named_rows(self.model, self.varying, self._rows)
        codes = operations_of(rows_of, len(self.model.states), renaming)
        values = dict(self.model.parameters)
        modes = tuple(
            FieldMode(
                mode.name,
                mode.signs,
                _stored_sides(mode),
                code,
                _stored_derivatives(*self.derivatives(number)),
                mode.held,
            )
            for number, (mode, code) in enumerate(zip(self.modes, codes, strict=True))
        )
        units = (self.unit_equations(values), self.unit_equations({**values, parameter: 1.0}))
        zero = tuple(s for s, v in self.model.values.items() if v == 0)
        texts = {name: e for name, _, _, _, e in _levels(self.model, parameter, zero)}
        names = {real(n): f"p{k}" for k, n in enumerate(others)}
        levels = tuple(
            (name, state, text_of(texts[name], names) or "math.nan", value)
            for name, (state, value) in self._levels_now().items()
        )
        return StoredField(
            parameter, others, modes, units, levels, values, self.path(), self._sides
        )


def _stored_sides(mode: Mode) -> FieldSides | None:
    sides = mode.sides
    if sides is None:
        return None
    return FieldSides(sides.interface, sides.above, sides.below, sides.escaping)


@cached_by_partition
def _levels(
    model: Model, parameter: str, zero: tuple[sp.Symbol, ...]
) -> list[tuple[str, str, list[sp.Symbol], Callable[..., float], sp.Expr]]:
    """Return interfaces and walls h = a x + b in a state x without varying parameters, with −b/a.

    The symbols in ``zero`` are set to zero; −b/a is a function.
    """
    found = []
    surfaces = [(name, interface.function) for name, interface in model.interfaces.items()]
    surfaces += [(wall.wall, wall.function) for wall in walls_of(model)]
    for name, function_of in surfaces:
        h = sp.sympify(function_of).subs(dict.fromkeys(zero, 0))
        states = [n for n in model.states if h.has(real(n))]
        if len(states) != 1 or h.has(real(parameter)):
            continue
        slope = h.diff(real(states[0]))
        if not slope.has(real(states[0])):
            level = -h.subs(real(states[0]), 0) / slope
            symbols = sorted(level.free_symbols, key=str)
            function = sp.lambdify(symbols, level, "math")
            found.append((name, states[0], symbols, function, level))
    return found


#: NumPy names of functions whose canonical names differ.
_NAMES = {f"arc{n}": f"a{n}" for n in ("sin", "cos", "tan", "sinh", "cosh", "tanh")}
_NAMES |= {"arctan2": "atan2"}


class _CanonicalNames(ast.NodeTransformer):
    """Convert NumPy source printed by SymPy to arithmetic in canonical names."""

    def __init__(self, arguments: Sequence[str]) -> None:
        self.names = {name: f"u{k}" for k, name in enumerate(arguments)}

    def visit_Name(self, node: ast.Name) -> ast.expr:
        if node.id in ("pi", "e", "E"):
            return ast.Attribute(ast.Name("math"), node.id.lower())
        return ast.Name(self.names.get(node.id, f"_{node.id}"))

    def visit_Call(self, node: ast.Call) -> ast.expr:
        name = node.func.id if isinstance(node.func, ast.Name) else ""
        function: ast.expr = ast.Attribute(ast.Name("math"), _NAMES.get(name, name))
        if name == "abs":
            function = ast.Name("abs")
        return ast.Call(function, [self.visit(a) for a in node.args], [])


def _stored_derivatives(
    entries: Sequence[tuple[int, ...]], values: Callable[..., Any]
) -> Derivatives | None:
    """Return the SymPy source of derivatives, with identical operations."""
    (function,) = ast.parse(inspect.getsource(values)).body
    assert isinstance(function, ast.FunctionDef)
    naming = _CanonicalNames([a.arg for a in function.args.args])
    shared: list[tuple[str, str]] = []
    texts: tuple[str, ...] = ()
    for statement in function.body:
        match statement:
            case ast.Assign(targets=[ast.Name(id=name)], value=value):
                shared.append((f"_{name}", ast.unparse(naming.visit(value))))
            case ast.Return(value=ast.List(elts=elements)):
                texts = tuple(ast.unparse(naming.visit(e)) for e in elements)
            case _:
                return None
    known = {*naming.names.values(), *(name for name, _ in shared)}
    try:
        for text in (*texts, *(text for _, text in shared)):
            check_number(text, known)
            if "special." in text:
                return None
    except UnknownOperationError:
        return None
    return Derivatives(tuple(map(tuple, entries)), tuple(shared), texts)
