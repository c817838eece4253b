"""Solution of an equation for a symbol by successive inversion of operations."""

from __future__ import annotations

import sympy as sp

from fastslow.model.known_functions import ELEMENTARY, formula_at
from fastslow.model.rational import quotient
from fastslow.symbolic.algebra import (
    expanded_form,
    longer,
    numerator,
    rational_form,
    shortest,
)
from fastslow.symbolic.signs.signs import Signs
from fastslow.symbolic.solving.univariate import Root, roots

#: Equations with more nodes are not solved.
ISOLATED_NODES = 150


def isolate(equation: sp.Expr, symbol: sp.Symbol, signs: Signs) -> list[Root] | None:
    """Return all real solutions of equation = 0 for a symbol, None if there is no short form.

    Polynomials of degree one or two are solved; if the symbol occurs once, sums,
    products, powers and exponentials are inverted from the outside in.

    Parameters
    ----------
    equation : sympy.Expr
        Irreducible.
    symbol : Symbol
    signs : Signs
        Values that contradict the assumed sign of the symbol are omitted.

    Examples
    --------
    >>> from fastslow.model.structure import real
    >>> V, k, u = map(real, "Vku")
    >>> [r.value for r in isolate(k - V**2 * u, V, Signs({k: 1, u: 1, V: 1}))]
    [sqrt(k*u)/u]
    >>> [r.value for r in isolate(sp.exp(-k * V) - u, V, Signs({k: 1}))]
    [-log(u)/k]
    """
    if symbol not in equation.free_symbols or longer(equation, ISOLATED_NODES):
        return None
    found = _polynomial(equation, symbol, signs)
    if found is None:
        found = _undone(equation, symbol, signs)
    if found is None:
        return None
    side = signs.known.get(symbol)
    return [
        r
        for r in found
        if (side is None or signs.sign(side * r.value) not in (0, -1))
        and not any(signs.sign(e) == -1 for e in r.radicands)
    ]


def _polynomial(equation: sp.Expr, symbol: sp.Symbol, signs: Signs) -> list[Root] | None:
    slope = expanded_form(equation).diff(symbol)
    if symbol not in slope.free_symbols:
        return [Root(shortest(-equation.subs(symbol, 0) / slope))]
    if quotient(equation) is None or not equation.is_polynomial(symbol):
        return None
    poly = sp.Poly(equation, symbol)
    if poly.degree() > 2 and (len(poly.monoms()) > 2 or equation.free_symbols == {symbol}):
        return None
    return roots(equation, symbol, signs)


def _undone(equation: sp.Expr, symbol: sp.Symbol, signs: Signs) -> list[Root] | None:
    """Solve for a symbol that occurs once, or only within one repeated function."""
    kernels = _kernels(equation, symbol)
    if kernels is not None and len(kernels) == 1:
        (kernel,) = kernels
        level = sp.Dummy("level", real=True)
        bare = numerator(equation.xreplace({kernel: level}))
        inner = None if symbol in bare.free_symbols else _polynomial(bare, level, signs)
        if inner is None or level not in bare.free_symbols:
            return None
        waiting = [(kernel, root) for root in inner]
    elif sum(1 for node in sp.preorder_traversal(equation) if node == symbol) == 1:
        waiting = [(equation, Root(sp.S.Zero))]
    else:
        return None
    done: list[Root] = []
    while waiting:
        left, right = waiting.pop(0)
        if left == symbol:
            done.append(right)
            continue
        if sum(1 for node in sp.preorder_traversal(left) if node == symbol) != 1:
            return None
        further = _outermost(left, right, symbol, signs)
        if further is None:
            return None
        waiting += further
    return done


def _kernels(equation: sp.Expr, symbol: sp.Symbol) -> set[sp.Expr] | None:
    """Functions and fractional powers that contain a symbol; None if it also occurs outside."""
    found: set[sp.Expr] = set()
    waiting: list[sp.Expr] = [equation]
    while waiting:
        node = waiting.pop()
        if symbol not in node.free_symbols:
            continue
        if node == symbol:
            return None
        if node.is_Add or node.is_Mul or (node.is_Pow and node.exp.is_Integer):
            waiting += node.args
        else:
            found.add(node)
    return found


def _outermost(
    left: sp.Expr, right: Root, symbol: sp.Symbol, signs: Signs
) -> list[tuple[sp.Expr, Root]] | None:
    """Invert the outermost operation of left = right; None if no inverse is known."""

    def now(value: sp.Expr, *conditions: sp.Expr) -> Root:
        return Root(rational_form(value), further=(*right.radicands, *conditions))

    level = right.value
    if left.is_Add:
        rest, inner = left.as_independent(symbol, as_Add=True)
        return [(inner, now(level - rest))]
    if left.is_Mul:
        rest, inner = left.as_independent(symbol, as_Add=False)
        return [(inner, now(level / rest))]
    if left.is_Pow and left.exp.is_Rational:
        over, under = int(left.exp.p), int(left.exp.q)
        value = now(level ** (1 / left.exp)).value
        if over % 2 == 0 and under % 2:
            both = [(left.base, now(value, level)), (left.base, now(-value, level))]
            side = signs.sign(left.base)
            return both if side is None else both[:1] if side > 0 else both[1:]
        if over % 2 and under % 2:
            # SymPy returns a complex odd root of a negative number
            side = signs.sign(level)
            if side is None:
                value = sp.sign(level) * sp.Abs(level) ** (1 / left.exp)
            return [(left.base, now(side * (side * level) ** (1 / left.exp) if side else value))]
        return [(left.base, now(value, level))]
    if left.is_Pow and not left.exp.has(symbol) and left.exp.is_real:
        # a power with a symbol as exponent is real for a positive base
        return [(left.base, now(level ** (1 / left.exp), level))]
    known = ELEMENTARY.get(type(left))
    if known is not None and known.inverse:
        undo = getattr(sp, known.inverse)
        text = known.image or (ELEMENTARY[undo].domain if undo in ELEMENTARY else "")
        conditions = [formula_at(text, level)] if text else []
        return [(left.args[0], now(undo(level), *conditions))]
    return None
