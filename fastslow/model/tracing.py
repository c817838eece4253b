"""Tracing of Python functions: rates called with symbols in place of numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NoReturn

import numpy as np
import sympy as sp

from fastslow.errors import FastSlowError, ModelError
from fastslow.formulas.elementary import ELEMENTARY
from fastslow.model.structure import TIME, real

#: Functions of NumPy by name, as functions of SymPy.
FUNCTIONS: Mapping[str, Callable[..., Any]] = {
    **{one.in_numpy: getattr(sp, name) for name, one in ELEMENTARY.items() if one.in_numpy},
    "absolute": sp.Abs,
    "fabs": sp.Abs,
    "sign": sp.sign,
    "sqrt": sp.sqrt,
    "square": lambda x: x**2,
    "heaviside": lambda x, there: sp.Heaviside(x, there),
    "maximum": sp.Max,
    "minimum": sp.Min,
    "floor": sp.floor,
    "add": lambda x, y: x + y,
    "subtract": lambda x, y: x - y,
    "multiply": lambda x, y: x * y,
    "divide": lambda x, y: x / y,
    "power": lambda x, y: x**y,
    "negative": lambda x: -x,
    "greater": sp.Gt,
    "greater_equal": sp.Ge,
    "less": sp.Lt,
    "less_equal": sp.Le,
    "logical_and": sp.And,
    "logical_or": sp.Or,
    "logical_not": sp.Not,
}

#: What to write in place of a decision of Python.
INSTEAD = (
    "a rate is traced with symbols, so that Python cannot decide it; write both values, as in "
    "np.where(x > 0, a, b) or sp.Piecewise((a, x > 0), (b, True)), and np.maximum for max"
)


class SymbolicNumber:
    """A symbol or an expression in place of a number, for operators and functions of NumPy."""

    __slots__ = ("expression",)
    __hash__ = None  # type: ignore[assignment]

    def __init__(self, expression: sp.Basic) -> None:
        self.expression = expression

    def _sympy_(self) -> sp.Basic:
        return self.expression

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **kwargs: Any) -> Any:
        if any(isinstance(one, np.ndarray) for one in inputs):
            arrays = [np.asarray(one, dtype=object) for one in inputs]
            shape = np.broadcast_shapes(*(one.shape for one in arrays))
            found = np.empty(shape, dtype=object)
            spread = [np.broadcast_to(one, shape) for one in arrays]
            for place in np.ndindex(shape):
                found[place] = traced(ufunc.__name__, *(one[place] for one in spread))
            return found
        if method != "__call__" or kwargs:
            raise ModelError(f"np.{ufunc.__name__}.{method} cannot be traced; write the sum out")
        return traced(ufunc.__name__, *inputs)

    def __array_function__(self, func: Any, types: Any, args: Any, kwargs: Any) -> Any:
        if func is np.where and len(args) == 3:
            condition, yes, no = map(sp.sympify, args)
            return SymbolicNumber(sp.Piecewise((yes, condition), (no, True)))
        raise ModelError(f"np.{func.__name__} cannot be traced with symbols")

    def __getattr__(self, name: str) -> Callable[..., Any]:
        # NumPy calls methods of the elements of an array of objects
        if name in FUNCTIONS:
            return lambda *others: traced(name, self, *others)
        raise AttributeError(f"a traced number has no attribute {name!r}")

    def __bool__(self) -> NoReturn:
        raise ModelError(f"the condition {self.expression} is decided by Python: {INSTEAD}")

    def __float__(self) -> NoReturn:
        raise ModelError(
            f"{self.expression} is used as a number, as functions of the module math do; write "
            "the functions of NumPy or SymPy, such as np.sin"
        )

    __int__ = __index__ = __complex__ = __float__

    def __neg__(self) -> Any:
        return traced("negative", self)

    def __pos__(self) -> SymbolicNumber:
        return self

    def __abs__(self) -> Any:
        return traced("absolute", self)

    def __and__(self, other: Any) -> Any:
        return traced("logical_and", self, other)

    def __or__(self, other: Any) -> Any:
        return traced("logical_or", self, other)

    def __invert__(self) -> Any:
        return traced("logical_not", self)


def _operator(name: str, *, swapped: bool = False) -> Callable[[SymbolicNumber, Any], Any]:
    def method(self: SymbolicNumber, other: Any) -> Any:
        if isinstance(other, np.ndarray):
            return NotImplemented
        return traced(name, *((other, self) if swapped else (self, other)))

    return method


for _sign, _name in {
    "add": "add",
    "sub": "subtract",
    "mul": "multiply",
    "truediv": "divide",
    "pow": "power",
}.items():
    setattr(SymbolicNumber, f"__{_sign}__", _operator(_name))
    setattr(SymbolicNumber, f"__r{_sign}__", _operator(_name, swapped=True))
for _sign, _name in {
    "gt": "greater",
    "ge": "greater_equal",
    "lt": "less",
    "le": "less_equal",
}.items():
    setattr(SymbolicNumber, f"__{_sign}__", _operator(_name))


def traced(name: str, *given: Any) -> SymbolicNumber:
    """Return a function of NumPy at traced numbers.

    Raises
    ------
    ModelError
        For a function that models do not have.
    """
    if name not in FUNCTIONS:
        raise ModelError(f"np.{name} cannot be traced; expected one of {', '.join(FUNCTIONS)}")
    values = [one.item() if isinstance(one, np.generic) else one for one in given]
    return SymbolicNumber(FUNCTIONS[name](*map(sp.sympify, values)))


def traced_rates(
    rhs: Callable[..., Any], states: Sequence[str], parameters: Sequence[str]
) -> dict[str, sp.Expr]:
    """Return the rates that a function returns for symbols.

    Parameters
    ----------
    rhs : callable
        ``rhs(t, y, *parameters)``, as for SciPy's ``solve_ivp``.
    states, parameters : sequence of str

    Raises
    ------
    ModelError
        If the function decides by the value of a state, uses it as a number, or does not return
        one rate for each state.
    """
    symbols = np.empty(len(states), dtype=object)
    symbols[:] = [SymbolicNumber(real(name)) for name in states]
    try:
        found = rhs(
            SymbolicNumber(TIME), symbols, *(SymbolicNumber(real(name)) for name in parameters)
        )
        rates = [sp.sympify(one) for one in np.asarray(found, dtype=object).ravel().tolist()]
    except FastSlowError:
        raise
    except (TypeError, ValueError, AttributeError, sp.SympifyError) as error:
        if "truth value" in str(error):
            raise ModelError(f"a condition is decided by Python: {INSTEAD}") from error
        raise ModelError(
            f"the function cannot be traced with symbols ({type(error).__name__}: {error}); it is "
            f"called as rhs(t, y{''.join(f', {name}' for name in parameters)})"
        ) from error
    if len(rates) != len(states):
        raise ModelError(f"the function returned {len(rates)} rates for {len(states)} states")
    return dict(zip(states, rates, strict=True))
