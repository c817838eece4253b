"""Exact expressions in ball arithmetic of any precision, by python-flint."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import sympy as sp

from fastslow.errors import ModelError
from fastslow.model.known_functions import ELEMENTARY, formula_at
from fastslow.model.removable import ExpQuotient, with_removable, written_out
from fastslow.results.base.extras import extra

#: Moduli below which y/(e^y − 1) is evaluated by its series.
_SERIES = 0.5


def flint() -> Any:
    """Return the module python-flint.

    Raises
    ------
    MissingPackageError
        If it is not installed.
    """
    return extra("flint", "certified")


def ball_function(
    rows: Sequence[sp.Expr], unknowns: Sequence[sp.Symbol]
) -> Callable[[Sequence[Any]], list[Any]]:
    """Return a function that evaluates exact expressions at balls.

    Raises
    ------
    ModelError
        When it is called, for a function without ball arithmetic here.
    """
    shared, results = sp.cse([_readable(sp.sympify(r)) for r in rows], order="none")

    def function(values: Sequence[Any]) -> list[Any]:
        known: dict[sp.Basic, Any] = dict(zip(unknowns, values, strict=True))
        for symbol, expression in shared:
            known[symbol] = _ball(expression, known)
        return [_ball(expression, known) for expression in results]

    return function


def _readable(row: sp.Expr) -> sp.Expr:
    """Return a row with the only quotient that has ball arithmetic here."""
    return written_out(with_removable(row), ExpQuotient)


def _ball(e: sp.Expr, known: dict[sp.Basic, Any]) -> Any:
    if e in known:
        return known[e]
    module = flint()
    arb = module.arb
    if e.is_Rational:
        return arb(module.fmpq(int(e.p), int(e.q)))
    if e is sp.pi:
        return arb.pi()
    if e is sp.E:
        return arb.const_e()
    if isinstance(e, ExpQuotient):
        return _exp_quotient(_ball(e.args[0], known), int(e.args[1]))
    if isinstance(e, sp.Pow):
        base = _ball(e.base, known)
        if e.exp.is_Integer:
            n = int(e.exp)
            return _power(base, n) if n >= 0 else 1 / _power(base, -n)
        if e.exp == sp.Rational(1, 2):
            return base.sqrt()
        return base ** _ball(e.exp, known)
    if isinstance(e, sp.Add | sp.Mul):
        first, *others = (_ball(a, known) for a in e.args)
        for other in others:
            first = first + other if isinstance(e, sp.Add) else first * other
        return first
    if e.func in ELEMENTARY or e.func is sp.gamma:
        first, *others = (_ball(a, known) for a in e.args)
        method = getattr(first, e.func.__name__, None)
        if method is not None:
            return method(*others)
        if ELEMENTARY[e.func].written:
            return _ball(formula_at(ELEMENTARY[e.func].written, *e.args), known)
    what = f"'{e}'" if e.is_Symbol else str(e.func)
    raise ModelError(f"the rates contain {what}, which has no ball arithmetic here")


def _power(base: Any, n: int) -> Any:
    """A whole power, by products: powers of python-flint are NaN for balls that contain zero."""
    result = flint().arb(1)
    while n:
        if n % 2:
            result = result * base
        base, n = base * base, n // 2
    return result


def _exp_quotient(y: Any, order: int) -> Any:
    """A derivative of y/(e^y − 1)."""
    module = flint()
    arb = module.arb
    if float(y.abs_upper()) < _SERIES:
        return _series(y, order)
    # y g with g = 1/(e^y − 1), g' = −g (1 + g): derivatives of g are polynomials in g
    g = 1 / y.expm1()
    coefficients = [0, 1]
    values = [g]
    for _ in range(order):
        changed = [0] * (len(coefficients) + 1)
        for j, c in enumerate(coefficients):
            changed[j] -= j * c
            changed[j + 1] -= j * c
        coefficients = changed
        total = arb(0)
        for c in reversed(coefficients):
            total = total * g + c
        values.append(total)
    return y * values[order] + (order * values[order - 1] if order else 0)


def _series(y: Any, order: int) -> Any:
    """Σ Bₙ yⁿ/n!, with |Bₙ| ≤ 4 n!/(2π)ⁿ for the remainder."""
    module = flint()
    arb = module.arb
    terms = order + 8 + module.ctx.prec // 3
    total = arb(0)
    for n in range(terms - 1, order - 1, -1):
        total = total * y + arb.bernoulli(n) / arb.fac_ui(n - order)
    # |y|/2π < 0.08: the remainder is below twice its first term
    ratio = arb(y.abs_upper()) / (2 * arb.pi())
    rest = 8 * arb(terms) ** order * ratio ** (terms - order) / (2 * arb.pi()) ** order
    return total + arb(0, rest.abs_upper())
