"""Extraction of interfaces from equations, and of smooth rates from a sign pattern."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import sympy as sp
from sympy.core.relational import Relational
from sympy.logic.boolalg import And, BooleanFunction, Not, Or

from fastslow.errors import ModelError
from fastslow.model.expansion import MULTIPLIED, expanded, n_terms, vanishes
from fastslow.model.expansion import factors as factors_of
from fastslow.model.interfaces import vanishes_on
from fastslow.model.polynomials import PastBudgetError
from fastslow.model.rational import exact, quotient
from fastslow.model.work import nodes

#: Number of cached factorisations.
FACTORISATIONS_KEPT = 4096

#: Largest number of nodes of a switching function with elementary functions that is factored.
FACTORED_NODES = 400

#: Length in characters up to which a switching function is replaced by its only factor.
LONG = 40

SWITCHING = (sp.Abs, sp.Max, sp.Min, sp.sign, sp.Heaviside)


def with_piecewise(expression: sp.Expr, constants: Collection[sp.Symbol] = ()) -> sp.Expr:
    """Rewrite Abs, Max, Min, sign and Heaviside as Piecewise, inside out.

    The values of sign and Heaviside on an interface itself are ignored, as regions
    are open sets; where their argument vanishes in a region, or everywhere because a parameter,
    one of the constants, is zero, they are kept.

    Examples
    --------
    >>> x = sp.Symbol("x", real=True)
    >>> with_piecewise(sp.sign(x))
    Piecewise((1, x > 0), (-1, True))
    >>> with_piecewise(sp.sign(sp.Max(x, 0))).args[-1]
    (0, True)
    """
    if not expression.has(*SWITCHING):
        return expression
    arguments = [
        with_piecewise(a, constants) if isinstance(a, sp.Basic) else a for a in expression.args
    ]
    if isinstance(expression, sp.Abs):
        (u,) = arguments
        return sp.Piecewise((u, u > 0), (-u, True))
    if isinstance(expression, (sp.sign, sp.Heaviside)):
        u, *at_zero = arguments
        below = sp.Integer(-1 if isinstance(expression, sp.sign) else 0)
        if not u.has(sp.Piecewise) and not _has_factor_in(constants, u):
            return sp.Piecewise((sp.Integer(1), u > 0), (below, True))
        # the argument may vanish in a region, as Max(x, 0) does, or for a parameter that is zero
        zero = at_zero[0] if at_zero else sp.Integer(0)
        return sp.Piecewise((sp.Integer(1), u > 0), (below, u < 0), (zero, True))
    if isinstance(expression, (sp.Max, sp.Min)):
        best = arguments[0]
        for other in arguments[1:]:
            gap = other - best if isinstance(expression, sp.Max) else best - other
            best = sp.Piecewise((other, gap > 0), (best, True))
        return best
    return expression.func(*arguments)


def _has_factor_in(symbols: Collection[sp.Symbol], expression: sp.Expr) -> bool:
    factors = (f.free_symbols for f in sp.Mul.make_args(sp.factor_terms(expression)))
    return any(used and used <= {*symbols} for used in factors)


@dataclass(frozen=True)
class Factorised:
    """A switching expression as sign × product of interface functions and parameter factors."""

    sign: int
    factors: tuple[tuple[sp.Expr, int], ...]
    scales: tuple[tuple[sp.Expr, int], ...]


def factorise(expression: sp.Expr, moving: Sequence[sp.Symbol]) -> Factorised:
    """Factor a smooth switching expression into irreducible interface functions.

    Factors of one sign are dropped, factors in parameters alone are returned as
    scales, and each remaining factor is oriented so that it increases with its
    first moving symbol.

    Parameters
    ----------
    expression : sympy.Expr
        Without Piecewise.
    moving : sequence of Symbol
        States, slow quantities and time, in order.
    """
    return _factorised(expression, tuple(moving))


@lru_cache(maxsize=FACTORISATIONS_KEPT)
def _factorised(expression: sp.Expr, moving: tuple[sp.Symbol, ...]) -> Factorised:
    sign, factors, scales = 1, [], []
    constant, pieces = _pieces(exact(expression))
    sign *= -1 if constant.is_negative else 1
    for factor, power in pieces:
        if factor.is_positive:
            continue
        if factor.is_negative:
            sign *= (-1) ** power
            continue
        if not factor.free_symbols & set(moving):
            scales.append((factor, power))
            continue
        flip = -1 if _decreases(factor, moving) else 1
        factors.append((expanded(flip * factor), power))
        sign *= flip**power
    if not factors and len(scales) == 1:
        (factor, power), scales = scales[0], []
        first = sorted(factor.free_symbols, key=lambda s: s.name)
        flip = -1 if _decreases(factor, first) else 1
        factors, sign = [(expanded(flip * factor), power)], sign * flip**power
    return Factorised(sign, tuple(factors), tuple(scales))


def _pieces(expression: sp.Expr) -> tuple[sp.Expr, list[tuple[sp.Expr, int]]]:
    """Constant and irreducible factors of numerator and denominator, all powers positive."""
    found = quotient(expression)
    if found is not None:
        try:
            constant, pieces = found.factors()
        except PastBudgetError:
            return sp.S.One, [(expression, 1)]
        return constant, [(f, abs(p)) for f, p in pieces]
    sign = sp.S.One
    factors: list[tuple[sp.Expr, int]] = []
    if n_terms(expression) > MULTIPLIED or nodes(expression, FACTORED_NODES + 1) > FACTORED_NODES:
        return sp.S.One, [(expression, 1)]
    for part in sp.together(expression).as_numer_denom():
        constant, more = factors_of(part)
        sign *= -1 if constant.is_negative else 1
        factors += more
    return sign, factors


def as_written(expression: sp.Expr, moving: Sequence[sp.Symbol]) -> sp.Expr | None:
    """Return a switching expression itself, oriented, if its only factor is longer.

    Examples
    --------
    >>> x, y, k = sp.symbols("x y k", real=True)
    >>> as_written(1 - k * (22 - (x + 2 * y) ** 2 / 295) ** 2, [x, y])
    k*(22 - (x + 2*y)**2/295)**2 - 1
    >>> as_written((3 - x) / 2, [x]) is None
    True
    """
    parts = factorise(expression, moving)
    if len(parts.factors) != 1 or parts.factors[0][1] % 2 == 0:
        return None
    ((factor, _),) = parts.factors
    if len(str(factor)) <= max(LONG, len(str(expression))):
        return None
    return expression if parts.sign > 0 else -expression


def _decreases(factor: sp.Expr, order: Sequence[sp.Symbol]) -> bool:
    """Check whether a factor decreases in its first symbol (by its leading coefficient)."""
    for symbol in order:
        if symbol not in factor.free_symbols:
            continue
        if nodes(factor, FACTORED_NODES + 1) <= FACTORED_NODES and factor.is_polynomial(symbol):
            leading = sp.LC(factor, symbol)
            if leading.is_number:
                return bool(leading < 0)
            return bool(leading.could_extract_minus_sign())
        return bool(factor.could_extract_minus_sign())
    return False


def switching_expressions(expression: sp.Expr) -> Iterable[sp.Expr]:
    """Yield every smooth expression whose sign selects a branch, in order of appearance."""
    for piecewise in _piecewise_in_order(expression):
        for _, condition in piecewise.args:
            for relation in _relations(condition):
                difference = relation.lhs - relation.rhs
                if difference.has(sp.Piecewise):
                    yield from switching_expressions(difference)
                    for value, _ in _folded(difference):
                        yield value
                else:
                    yield difference


def _folded(expression: sp.Expr) -> list[tuple[sp.Expr, sp.Basic]]:
    """All smooth branches of an expression with Piecewise, whether or not they are reachable."""
    inner = next((p for p in _piecewise_in_order(expression) if not _nested(p)), None)
    if inner is None:
        return [(expression, sp.true)]
    values = []
    for branch, condition in inner.args:
        for value, _ in _folded(expression.xreplace({inner: branch})):
            values.append((value, condition))
    return values


def _nested(piecewise: sp.Piecewise) -> bool:
    return any(isinstance(a, sp.Basic) and a.has(sp.Piecewise) for a in piecewise.args)


def _piecewise_in_order(expression: sp.Basic) -> list[sp.Piecewise]:
    return [node for node in sp.preorder_traversal(expression) if isinstance(node, sp.Piecewise)]


def _relations(condition: sp.Basic) -> Iterable[Relational]:
    if isinstance(condition, Relational):
        yield condition
    elif isinstance(condition, BooleanFunction):
        for argument in condition.args:
            yield from _relations(argument)


def smooth(
    expression: sp.Expr,
    signs: Mapping[sp.Expr, int],
    moving: Sequence[sp.Symbol],
    values: Mapping[sp.Symbol, float],
) -> sp.Expr:
    """Return the smooth expression on the set where interface functions have given signs.

    Parameters
    ----------
    expression : sympy.Expr
        May contain nested Piecewise.
    signs : mapping
        Interface function to +1 or −1.
    moving : sequence of Symbol
        As for `factorise`.
    values : mapping
        Parameter values, used only for the signs of factors in parameters alone.

    Raises
    ------
    ModelError
        If a Piecewise has no branch for the pattern.
    """
    if not expression.has(sp.Piecewise):
        return expression
    if isinstance(expression, sp.Piecewise):
        for value, condition in expression.args:
            if _holds(condition, signs, moving, values):
                return smooth(value, signs, moving, values)
        shown = {h: s for h, s in signs.items() if not h.could_extract_minus_sign()}
        pattern = ", ".join(f"{h} {'>' if s > 0 else '<'} 0" for h, s in shown.items())
        raise ModelError(f"{expression} has no branch where {pattern}; end it with (value, True)")
    return expression.func(*[smooth(a, signs, moving, values) for a in expression.args])


def _holds(
    condition: sp.Basic,
    signs: Mapping[sp.Expr, int],
    moving: Sequence[sp.Symbol],
    values: Mapping[sp.Symbol, float],
) -> bool:
    if condition in (True, sp.true):
        return True
    if condition in (False, sp.false):
        return False
    if isinstance(condition, And):
        return all(_holds(a, signs, moving, values) for a in condition.args)
    if isinstance(condition, Or):
        return any(_holds(a, signs, moving, values) for a in condition.args)
    if isinstance(condition, Not):
        return not _holds(condition.args[0], signs, moving, values)
    if isinstance(condition, BooleanFunction):
        return _holds(condition.to_nnf(simplify=False), signs, moving, values)
    if not isinstance(condition, Relational):
        raise ModelError(f"cannot read the condition {condition}; expected inequalities")
    difference = smooth(condition.lhs - condition.rhs, signs, moving, values)
    if difference.is_number or vanishes(difference):
        # both sides are equal, or differ by a constant, throughout the region
        return bool(condition.func(expanded(difference), 0))
    if isinstance(condition, (sp.Eq, sp.Ne)):
        factors = factorise(difference, moving).factors
        return any(signs.get(f) == 0 for f, _ in factors) == isinstance(condition, sp.Eq)
    side = sign_of(difference, signs, moving, values)
    if side == 0:
        return isinstance(condition, (sp.Ge, sp.Le))
    return side > 0 if isinstance(condition, (sp.Gt, sp.Ge)) else side < 0


def sign_of(
    expression: sp.Expr,
    signs: Mapping[sp.Expr, int],
    moving: Sequence[sp.Symbol],
    values: Mapping[sp.Symbol, float],
) -> int:
    """Return the sign of a switching expression where interface functions have given signs."""
    if expression in signs:
        return signs[expression]
    if -expression in signs:
        return -signs[-expression]
    parts = factorise(expression, moving)
    side = parts.sign
    for factor, power in parts.factors:
        if factor not in signs:
            raise ModelError(f"{factor} = 0 decides a branch but is not one of the interfaces")
        side *= signs[factor] ** power
    for scale, power in parts.scales:
        number = scale.subs(values)
        if not number.is_number:
            raise ModelError(
                f"{expression} decides a branch, but the sign of {scale} is unknown; "
                "expected a value of each parameter in it"
            )
        value = float(number)
        side *= int(np.sign(value)) ** power
    return side


def signs_of_factors(
    signs: Iterable[tuple[sp.Expr, int]],
    moving: Sequence[sp.Symbol],
    values: Mapping[sp.Symbol, float],
) -> dict[sp.Expr, int]:
    """Return the signs of interface functions, of their negatives and of their factors.

    Examples
    --------
    >>> x, y = sp.symbols("x y", real=True)
    >>> signs_of_factors([(x - (y + 1) ** 2, 1)], [x, y], {})[x - y**2 - 2 * y - 1]
    1
    """
    known: dict[sp.Expr, int] = {}
    for function, sign in signs:
        known[function] = sign
        known[expanded(-function)] = -sign
        parts = factorise(function, moving)
        if len(parts.factors) != 1:
            continue
        ((factor, _),) = parts.factors
        side = sign * parts.sign
        for scale, power in parts.scales:
            number = scale.subs(values)
            side = 0 if not number.is_number else side * int(sp.sign(number)) ** power
        if side:
            known.setdefault(factor, side)
            known.setdefault(expanded(-factor), -side)
    return known


def continuous(expression: sp.Expr) -> bool:
    """Check that an expression is continuous, from the way it is written.

    Max, Min and Abs are continuous; a Piecewise of two branches is where their difference
    vanishes on the boundary of its condition. For sign, Heaviside and any other Piecewise
    the result is False, which is inconclusive.

    Examples
    --------
    >>> x, y = sp.symbols("x y", real=True)
    >>> continuous(sp.Max(0, 1 - sp.Max(x, y) ** 2)), continuous(x * sp.sign(x))
    (True, False)
    """
    if expression.has(sp.sign, sp.Heaviside):
        return False
    return all(map(_continuous_piece, set(_piecewise_in_order(expression))))


def _continuous_piece(piece: sp.Piecewise) -> bool:
    if len(piece.args) != 2:
        return False
    (first, condition), (second, otherwise) = piece.args
    if otherwise is not sp.true or not isinstance(condition, (sp.Gt, sp.Ge, sp.Lt, sp.Le)):
        return False
    jump, level = first - second, condition.lhs - condition.rhs
    if vanishes(jump) or vanishes(jump - level) or vanishes(jump + level):
        return True
    if jump.has(sp.Piecewise, *SWITCHING) or level.has(sp.Piecewise, *SWITCHING):
        return False
    return vanishes_on(*map(exact, (jump, level)))
