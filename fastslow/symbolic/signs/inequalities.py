"""Conditions for expressions to be positive, from signs of factors and radicals.

SymPy's inequality solvers do not derive conditions such as "the fold is admissible
iff A < −D²", so they are not used.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import lru_cache

import sympy as sp
from sympy.logic.boolalg import Boolean

from fastslow.model.differentiation import derivative
from fastslow.symbolic.algebra import (
    expanded_form,
    longer,
    rational_form,
    undefined,
    within_budget,
)
from fastslow.symbolic.signs.conditions import simplified
from fastslow.symbolic.signs.signs import Signs, sign_factors

#: Largest number of terms of a radicand that is squared.
SQUARED_TERMS = 60

#: Inequalities with more nodes are not simplified.
SIMPLIFIED_NODES = 250


def positive(expression: sp.Expr, signs: Signs, order: Sequence[sp.Symbol] = ()) -> Boolean:
    """Return the condition for a real expression to be positive.

    Parameters
    ----------
    expression : sympy.Expr
        Expression in parameters; square roots in it are assumed real.
    signs : Signs
        Assumptions on the parameters.
    order : sequence of Symbol
        Symbols to solve a condition for, best first.

    Returns
    -------
    Boolean
        ``true``, ``false``, an inequality solved for a symbol in which it is
        affine, or a combination of inequalities.

    Examples
    --------
    >>> from fastslow.model.structure import real
    >>> A, D = real("A"), real("D")
    >>> positive((D + sp.sqrt(D**2 - 3 * A)) / 3 - D, Signs({D: 1}), [A])
    A < -D**2
    >>> positive((D - sp.sqrt(D**2 - 3 * A)) / 3 - D, Signs({D: 1}), [A])
    False
    """
    expression = sp.sympify(expression)
    if undefined(expression):
        return sp.false
    side = signs.sign(expression)
    if side is not None:
        return sp.true if side > 0 else sp.false
    if longer(expression, SIMPLIFIED_NODES):
        return above_zero(expression)
    flip, open_parts, avoided = 1, [], []
    for part, power in sign_factors(expression):
        side = signs.sign(part)
        if side == 0:
            return sp.false
        if side is not None:
            flip *= side if power % 2 else 1
        elif power % 2:
            open_parts.append(part)
        else:
            avoided.append(sp.Ne(part, 0))
    if not open_parts:
        return sp.And(*avoided) if flip > 0 else sp.false
    if len(open_parts) == 1:
        main = _one(expanded_form(flip * open_parts[0]), signs, order)
    elif len(open_parts) == 2:
        p, q = open_parts
        both = sp.And(_one(p, signs, order), _one(expanded_form(flip * q), signs, order))
        none = sp.And(_one(-p, signs, order), _one(expanded_form(-flip * q), signs, order))
        main = sp.Or(both, none)
    else:
        main = sp.Gt(sp.Mul(flip, *open_parts), 0)
    return as_intervals(sp.And(main, *avoided))


def as_intervals(condition: Boolean) -> Boolean:
    """Return a condition that compares one symbol with numbers as a union of intervals.

    Examples
    --------
    >>> from fastslow.model.structure import real
    >>> w = real("w")
    >>> as_intervals(((w > -1) & (w > 1)) | ((w < -1) & (w < 1)))
    (w > 1) | (w < -1)
    """
    if not isinstance(condition, (sp.And, sp.Or)) or len(condition.free_symbols) != 1:
        return condition
    (symbol,) = condition.free_symbols
    for relation in condition.atoms(sp.core.relational.Relational):
        if not (relation.lhs == symbol and relation.rhs.is_Rational):
            return condition
    intervals: Boolean = condition.as_set().as_relational(symbol)
    turned = [r for r in intervals.atoms(sp.core.relational.Relational) if r.lhs.is_number]
    return intervals.xreplace({r: r.reversed for r in turned})


def _one(part: sp.Expr, signs: Signs, order: Sequence[sp.Symbol]) -> Boolean:
    root = radical(part)
    if root is None:
        return isolated(part, signs, order)
    inside = root.base
    slope = expanded_form(part).coeff(root, 1)
    rest = expanded_form(expanded_form(part) - slope * root)
    if rest.has(root) or slope.has(root) or len(sp.Add.make_args(inside)) > SQUARED_TERMS:
        return above_zero(part)
    # P + Q√R > 0: by the signs of P and Q, and of Q²R − P² where they differ
    excess = expanded_form(slope**2 * inside - rest**2)
    p, q = signs.sign(rest), signs.sign(slope)
    if p == 0 or q == 0:
        return positive(slope if p == 0 else rest, signs, order)
    larger, smaller = positive(excess, signs, order), positive(-excess, signs, order)
    real_root = nonnegative(inside, signs, order)
    if p is not None and q is not None:
        if p > 0 and q > 0:
            return real_root
        if p < 0 and q < 0:
            return sp.false
        # Q²R > P² implies R > 0
        return larger if q > 0 else sp.And(real_root, smaller)
    p_up, q_up = positive(rest, signs, order), positive(slope, signs, order)
    both = sp.And(real_root, p_up, q_up)
    return sp.Or(both, sp.And(q_up, larger), sp.And(p_up, real_root, smaller))


def nonnegative(expression: sp.Expr, signs: Signs, order: Sequence[sp.Symbol] = ()) -> Boolean:
    """Return the condition for a real expression to be nonnegative.

    Examples
    --------
    >>> from fastslow.model.structure import real
    >>> a = real("a")
    >>> nonnegative(a - 1, Signs({}), [a])
    a >= 1
    """
    place = {sp.StrictGreaterThan: sp.Ge, sp.StrictLessThan: sp.Le}
    if signs.sign(expression) == 0:
        return sp.true
    strict = positive(expression, signs, order)
    return place[type(strict)](*strict.args) if type(strict) in place else strict


def isolated(part: sp.Expr, signs: Signs, order: Sequence[sp.Symbol]) -> Boolean:
    """Return part > 0, solved for the first symbol in which it is affine with known sign.

    Examples
    --------
    >>> from fastslow.model.structure import real
    >>> A, D = real("A"), real("D")
    >>> isolated(-3 * A - 3 * D**2, Signs({}), [A, D])
    A < -D**2
    """
    if longer(part, SIMPLIFIED_NODES):
        return above_zero(part)
    for symbol in [*order, *sorted(part.free_symbols - set(order), key=lambda s: s.name)]:
        if symbol not in part.free_symbols:
            continue
        slope = derivative(part, symbol)
        if symbol in slope.free_symbols:
            continue
        side = signs.sign(slope)
        if side:
            level = sp.factor_terms(rational_form(-part.subs(symbol, 0) / slope))
            if undefined(level):
                continue
            return sp.Gt(symbol, level) if side > 0 else sp.Lt(symbol, level)
    return above_zero(part)


def above_zero(expression: sp.Expr) -> Boolean:
    """Return expression > 0, which SymPy evaluates only if it is short.

    Examples
    --------
    >>> above_zero(sp.Symbol("a") - 1)
    a - 1 > 0
    """
    if undefined(expression):
        return sp.false
    return sp.Gt(expression, 0, evaluate=not longer(expression, SIMPLIFIED_NODES))


def radical(expression: sp.Expr) -> sp.Pow | None:
    """Return the square root with symbols in it, if an expression contains exactly one."""
    found = {
        p for p in expression.atoms(sp.Pow) if p.exp == sp.Rational(1, 2) and p.base.free_symbols
    }
    others = {
        p
        for p in expression.atoms(sp.Pow)
        if not p.exp.is_integer and p not in found and p.base.free_symbols
    }
    return found.pop() if len(found) == 1 and not others else None


def general_condition(
    expression: sp.Expr,
    signs: Signs,
    order: Sequence[sp.Symbol],
    kept: Sequence[sp.Symbol],
    decide: Callable[..., Boolean] = positive,
) -> Boolean:
    """Return the condition for a positive expression in general form.

    Where the assumed signs settle the question, a condition on one parameter
    says more: the sign of that parameter alone is set aside. Signs of the
    parameters in ``kept`` are never set aside. With ``decide=nonnegative``
    equality is allowed.

    Examples
    --------
    >>> from fastslow.model.structure import real
    >>> A, D = real("A"), real("D")
    >>> general_condition(-A - D**2, Signs({A: 1, D: 1}), [A], [D])
    A < -D**2
    """
    whole = decide(expression, signs, order)
    if whole not in (sp.true, sp.false) or expression.is_number:
        return whole
    for symbol in sorted(signs.known, key=lambda s: (order.index(s) if s in order else 99, s.name)):
        if symbol in kept or symbol not in expression.free_symbols:
            continue
        wider = decide(expression, signs.without(symbol), [symbol, *order])
        if wider.is_Relational and symbol in (wider.lhs, wider.rhs) and wider.rhs != 0:
            return wider
    return whole


def conjunction(conditions: Iterable[Boolean], signs: Signs) -> Boolean:
    """Return the conjunction of conditions, without bounds implied by tighter ones.

    Examples
    --------
    >>> from fastslow.model.structure import real
    >>> A, D = real("A"), real("D")
    >>> conjunction([A <= D**2 / 3, A < -D**2], Signs({D: 1}))
    A < -D**2
    """
    each = [c for c in sp.And.make_args(sp.And(*conditions)) if c is not sp.true]
    kept: list[Boolean] = []
    for j, one in enumerate(each):
        if not any(k != j and _tighter(other, one, signs) for k, other in enumerate(each)):
            kept.append(one)
    return simplified(sp.And(*kept))


def _tighter(one: Boolean, other: Boolean, signs: Signs) -> bool:
    """Check whether one bound on a symbol is stricter than the other."""
    if isinstance(other, sp.Ne) and isinstance(one, (sp.Gt, sp.Lt)):
        return (other.lhs, other.rhs) in ((one.lhs, one.rhs), (one.rhs, one.lhs))
    for upper in (True, False):
        kinds = (sp.Lt, sp.Le) if upper else (sp.Gt, sp.Ge)
        if isinstance(one, kinds) and isinstance(other, kinds) and one.lhs == other.lhs:
            inside = signs.without(one.lhs) if one.lhs.is_Symbol else signs
            gap = other.rhs - one.rhs
            side = inside.sign(gap if upper else -gap)
            strict = isinstance(one, kinds[0]) and not isinstance(other, kinds[0])
            return side == 1 or (side == 0 and strict)
    return False


def implied(condition: Boolean, signs: Signs) -> bool | None:
    """Return the truth value of a condition under the assumptions, None if undecided.

    Examples
    --------
    >>> from fastslow.model.structure import real
    >>> A, D = real("A"), real("D")
    >>> implied(A < -D**2, Signs({A: 1, D: 1}))
    False
    """
    if condition in (sp.true, sp.false):
        return bool(condition)
    if isinstance(condition, (sp.And, sp.Or)):
        each = [implied(c, signs) for c in condition.args]
        decisive = isinstance(condition, sp.Or)
        if decisive in each:
            return decisive
        return None if None in each else not decisive
    if isinstance(condition, (sp.Gt, sp.Lt, sp.Ge, sp.Le)):
        side = signs.sign(condition.gts - condition.lts)
        if side is None:
            return None
        return side > 0 or (side == 0 and isinstance(condition, (sp.Ge, sp.Le)))
    if isinstance(condition, sp.Ne):
        side = signs.sign(condition.lhs - condition.rhs)
        return None if side is None else side != 0
    return None


def sign_within(
    expression: sp.Expr, symbol: sp.Symbol, conditions: Sequence[sp.Expr], signs: Signs
) -> int | None:
    """Return the sign of an expression for a symbol between bounds, None if it changes.

    Parameters
    ----------
    expression : sympy.Expr
    symbol : Symbol
        The unknown of a curve of equilibria.
    conditions : sequence of sympy.Expr
        Positive in the region; those affine in the symbol alone give its bounds.
    signs : Signs

    Examples
    --------
    >>> from fastslow.model.structure import real
    >>> x, A, D = map(real, "xAD")
    >>> sign_within(3 * x**2 - 2 * D * x + A, x, [x - D], Signs({A: 1, D: 1}))
    1
    """
    if symbol not in expression.free_symbols:
        return signs.sign(expression)
    free = Signs({s: k for s, k in signs.known.items() if s != symbol}, signs.facts)
    direct = free.sign(expression)
    if direct is not None:
        return direct
    lower, upper = bounds(symbol, conditions, free)
    step = sp.Dummy("s", positive=True)
    places = [low + step for low in lower] + [high - step for high in upper]
    places += [
        (low + high * step) / (1 + step)
        for low in lower
        for high in upper
        if free.sign(high - low) == 1
    ]
    for place in places:
        moved = expression.subs(symbol, place)
        over, under = (
            sp.together(moved).as_numer_denom() if within_budget(moved) else (moved, sp.S.One)
        )
        one, two = free.sign(expanded_form(over)), free.sign(expanded_form(under))
        if one is not None and two is not None:
            return one * two
    return None


def bounds(
    symbol: sp.Symbol, conditions: Sequence[sp.Expr], signs: Signs
) -> tuple[list[sp.Expr], list[sp.Expr]]:
    """Return lower and upper bounds of a symbol from positive expressions.

    Examples
    --------
    >>> from fastslow.model.structure import real
    >>> x, D = real("x"), real("D")
    >>> bounds(x, [x + D, D - x], Signs({}))
    ([-D], [D])
    """
    lower: list[sp.Expr] = []
    upper: list[sp.Expr] = []
    for condition in conditions:
        slope = derivative(condition, symbol)
        side = None if symbol in slope.free_symbols else signs.sign(slope)
        if side:
            level = rational_form(-condition.subs(symbol, 0) / slope)
            (lower if side > 0 else upper).append(level)
    return lower, upper


def irredundant(inside: tuple[sp.Expr, ...], signs: Signs) -> list[sp.Expr]:
    """Return the expressions whose positivity is not implied by that of another one.

    Examples
    --------
    >>> from fastslow.model.structure import real
    >>> x, D = real("x"), real("D")
    >>> irredundant((x - D, x + D), Signs({D: 1}))
    [-D + x]
    """
    return [
        e
        for j, e in enumerate(inside)
        if signs.sign(e) != 1
        and not any(k != j and signs.sign(_difference(e, o)) == 1 for k, o in enumerate(inside))
    ]


@lru_cache(maxsize=4096)
def _difference(one: sp.Expr, other: sp.Expr) -> sp.Expr:
    """Return the difference of two expressions; regions share their pairs of conditions."""
    return expanded_form(one - other)
