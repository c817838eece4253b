"""Natural units of the states and parameters of a model, from its equations."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
import sympy as sp

from fastslow.model.interfaces import Region
from fastslow.model.structure import real
from fastslow.results.stored.unit_equations import UnitEquations, negligible

#: Functions whose value has the magnitude of their argument.
_ALIKE = (sp.Abs, sp.Max, sp.Min)

_CONSTANT = ""


def natural_units(
    names: Sequence[str],
    regions: Iterable[Region],
    functions: Iterable[sp.Expr],
    values: Mapping[sp.Symbol, float],
) -> dict[str, float]:
    """Return units in which the terms of each sum in the equations have comparable size.

    The logarithms of the units solve a linear least-squares problem: every term of a
    sum has the magnitude of the sum, and the argument of a transcendental function
    has magnitude one. This extends the scaling of polynomial systems by Meintjes and
    Morgan (1987), which centres the logarithms of the coefficients, to other
    expressions. A state measured in another unit has its natural unit multiplied
    by the same factor, up to rounding to a power of two, so tolerances in
    these units do not depend on the units of the model. A quantity whose size is not
    determined by the equations, as in linear homogeneous rates, has unit 1.

    Parameters
    ----------
    names : sequence of str
        States and parameters; the unit of a parameter with a value is its magnitude.
    regions : iterable of Region
    functions : iterable of sympy.Expr
        Switching functions.
    values : mapping
        Value of every parameter that has one, by symbol.

    Returns
    -------
    dict
        Name to its unit, a power of two.

    References
    ----------
    K. Meintjes and A. P. Morgan, Applied Mathematics and Computation 22, 333-361, 1987.

    Examples
    --------
    >>> x, w = real("x"), real("w")
    >>> region = Region("S1", {}, (), {"x": w + 1e6 * x - 1e-6 * x**3}, {})
    >>> natural_units(["x", "w"], [region], [], {})
    {'x': 1048576.0, 'w': 1099511627776.0}
    """
    return unit_equations(names, regions, functions, values).units(
        names, {symbol.name: value for symbol, value in values.items()}
    )


def unit_equations(
    names: Sequence[str],
    regions: Iterable[Region],
    functions: Iterable[sp.Expr],
    values: Mapping[sp.Symbol, float],
) -> UnitEquations:
    """Return the equations that `natural_units` solves, valid for other parameter values too."""
    rates = (r for region in regions for r in (*region.rates.values(), *region.forcing.values()))
    expressions = (*rates, *functions)
    unknowns = tuple(n for n in names if real(n) not in values)
    gone = frozenset(s for s, v in values.items() if negligible(v))
    fixed = tuple((s, values[s]) for s in _in_exponents(expressions) if s in values)
    return _equations(expressions, unknowns, tuple(values), gone, fixed)


@lru_cache(maxsize=256)
def _in_exponents(expressions: tuple[sp.Expr, ...]) -> tuple[sp.Symbol, ...]:
    """Symbols in exponents, by name."""
    found = {s for e in expressions for p in e.atoms(sp.Pow) for s in p.exp.free_symbols}
    return tuple(sorted(found, key=str))


@lru_cache(maxsize=256)
def _equations(
    expressions: tuple[sp.Expr, ...],
    unknowns: tuple[str, ...],
    parameters: tuple[sp.Symbol, ...],
    gone: frozenset[sp.Symbol],
    fixed: tuple[tuple[sp.Symbol, float], ...],
) -> UnitEquations:
    """Equations for all values of the parameters except those in exponents.

    ``gone`` are the parameters of negligible or infinite size.
    """
    sums = _Sums(
        {real(n): n for n in unknowns},
        {s: None if s in gone else {str(k): 1.0} for k, s in enumerate(parameters)},
        dict(fixed),
    )
    for expression in expressions:
        sums.magnitude(expression)
    places = {str(k): 1 + k for k in range(len(parameters))} | {_CONSTANT: 0}
    columns = tuple(sorted({k for e in sums.equations for k in e} - set(places)))
    matrix = np.zeros((len(sums.equations), len(columns)))
    right = np.zeros((len(sums.equations), 1 + len(parameters)))
    for row, equation in enumerate(sums.equations):
        for name, coefficient in equation.items():
            if name in places:
                right[row, places[name]] += coefficient
            else:
                matrix[row, columns.index(name)] += coefficient
    return UnitEquations(
        columns,
        tuple(s.name for s in parameters),
        tuple(sorted(s.name for s in gone)),
        tuple(s.name for s, _ in fixed),
        matrix,
        right,
    )


#: A logarithm to base two as a linear form: unknown, parameter index or constant to its
#: coefficient.
_Form = dict[str, float]


@dataclass
class _Sums:
    """Equations for the magnitudes of the terms of every sum."""

    unknowns: dict[sp.Symbol, str]
    parameters: Mapping[sp.Symbol, _Form | None]
    exponents: Mapping[sp.Symbol, float]
    equations: list[_Form] = field(default_factory=list)
    known: dict[sp.Expr, _Form | None] = field(default_factory=dict)

    def magnitude(self, expression: sp.Expr) -> _Form | None:
        """Return the logarithm of the size of an expression; None if it is zero or unknown."""
        if expression not in self.known:
            self.known[expression] = self._form(expression)
        return self.known[expression]

    def _form(self, e: sp.Expr) -> _Form | None:
        if e.is_Symbol:
            if e in self.unknowns:
                return {self.unknowns[e]: 1.0}
            return self.parameters.get(e)
        if e.is_number:
            return _constant(e)
        if e.is_Mul:
            factors = [self.magnitude(a) for a in e.args]
            known = [f for f in factors if f is not None]
            return _total(known) if len(known) == len(factors) else None
        if e.is_Pow:
            base, exponent = self.magnitude(e.base), _number(e.exp, self.exponents)
            if exponent is None:
                self._dimensionless(e.exp)
                return {}
            return None if base is None else {k: exponent * c for k, c in base.items()}
        if e.is_Add:
            return self._sum(e)
        inner = [self.magnitude(a) for a in e.args if isinstance(a, sp.Expr)]
        if isinstance(e, _ALIKE):
            return next((f for f in inner if f is not None), None)
        for argument in e.args:
            if not isinstance(e, sp.sign | sp.Heaviside):
                self._dimensionless(argument)
        return {}

    def _sum(self, e: sp.Expr) -> _Form | None:
        forms = [f for f in map(self.magnitude, e.args) if f is not None]
        if len(forms) < 2:
            return forms[0] if forms else None
        name = f"{_CONSTANT}{len(self.known)}:{len(self.equations)}"
        for form in forms:
            self.equations.append(_total([form, {name: -1.0}]))
        return {name: 1.0}

    def _dimensionless(self, e: object) -> None:
        form = self.magnitude(e) if isinstance(e, sp.Expr) else None
        if form:
            self.equations.append(form)


def _total(forms: Iterable[_Form]) -> _Form:
    total: _Form = {}
    for form in forms:
        for name, coefficient in form.items():
            total[name] = total.get(name, 0.0) + coefficient
    return total


def _number(e: sp.Expr, values: Mapping[sp.Symbol, float]) -> float | None:
    try:
        number = complex(e.subs(values)) if e.free_symbols else complex(e)
    except (TypeError, ValueError, ArithmeticError):
        return None
    return number.real if math.isfinite(abs(number)) else None


def _constant(value: Any) -> _Form | None:
    try:
        size = abs(complex(value))
    except (TypeError, ValueError, ArithmeticError):
        return None
    return None if negligible(size) else {_CONSTANT: math.log2(size)}
