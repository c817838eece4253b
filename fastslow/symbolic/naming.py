"""Names for repeated subexpressions of printed formulas."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import sympy as sp
from sympy.polys.rootoftools import ComplexRootOf
from sympy.printing.str import StrPrinter

from fastslow.model.rational import quotient
from fastslow.symbolic.algebra import irrational, longer, shortest, whole

#: Longest line of text, and longest formula that is printed.
LINE_WIDTH = 180

#: Length in characters from which a subexpression is named.
WORTH = 24

#: Expressions with more nodes are not searched.
SEARCHED_NODES = 600

#: Largest number of names for one formula.
NAMES = 6

#: Sums with at most so many terms are not rewritten.
FEW_TERMS = 4

#: Largest number of terms of sums that are rewritten.
MANY_TERMS = 24

#: Letters for subexpressions, those not in use first.
LETTERS = "PQRSTUWXYZ"


class _Text(StrPrinter):
    def _print_Unequality(self, expr: sp.Ne) -> str:
        return f"({self._print(expr.lhs)} ≠ {self._print(expr.rhs)})"


def text(expression: object) -> str:
    """Return an expression as text.

    Examples
    --------
    >>> x = sp.Symbol("x")
    >>> text(sp.Ne(x, 0) & (x > -1))
    '(x > -1) & (x ≠ 0)'
    """
    printed = str(_Text().doprint(expression))
    return printed[1:-1] if isinstance(expression, sp.Ne) else printed


def free_names(taken: Iterable[str]) -> Iterator[sp.Symbol]:
    """Yield symbols for subexpressions that the model does not use.

    Examples
    --------
    >>> names = free_names({"P"})
    >>> next(names), next(names)
    (Q, R)
    """
    used = set(taken)
    for letter in LETTERS:
        if letter not in used:
            yield sp.Symbol(letter, real=True)
    number = 0
    while True:
        number += 1
        if f"P_{number}" not in used:
            yield sp.Symbol(f"P_{number}", real=True)


def named(
    expressions: Sequence[sp.Basic], taken: Iterable[str]
) -> tuple[list[sp.Basic], list[tuple[sp.Symbol, sp.Basic]]]:
    """Return expressions with named subexpressions, and the definitions of the names.

    Radicands are named first, then sums and other subexpressions that occur repeatedly.

    Examples
    --------
    >>> a, b = sp.symbols("a b")
    >>> root = sp.sqrt(a**2 - 4 * b * (a + 1) - 7 * a * b)
    >>> named([a - root, a + root], "ab")
    ([-sqrt(P) + a, sqrt(P) + a], [(P, a**2 - 11*a*b - 4*b)])
    """
    names = free_names(taken)
    current = [sp.sympify(e) for e in expressions]
    short = [not longer(e, SEARCHED_NODES) for e in current]
    defined: list[tuple[sp.Symbol, sp.Basic]] = []
    while len(defined) < NAMES:
        looked_at = [e for e, s in zip(current, short, strict=True) if s]
        best = _best([*looked_at, *(e for _, e in defined)])
        if best is None:
            break
        symbol = next(names)
        place = {best: symbol}
        current = [e.xreplace(place) for e in current]
        defined = [(s, e.xreplace(place)) for s, e in defined] + [(symbol, best)]
    again = [compact(e) if s else e for e, s in zip(current, short, strict=True)]
    return again, [(s, compact(shortest(e))) for s, e in reversed(defined)]


def _best(expressions: Sequence[sp.Basic]) -> sp.Expr | None:
    """The next subexpression to name."""
    counts: dict[sp.Expr, int] = {}
    for expression in expressions:
        walk = sp.preorder_traversal(expression)
        for node in walk:
            if isinstance(node, ComplexRootOf):
                # a number: its polynomial and index are not formulas
                walk.skip()
                continue
            if isinstance(node, sp.Expr) and (node.is_Add or node.is_Mul or node.is_Pow):
                counts[node] = counts.get(node, 0) + 1
    under = [n.base for n in counts if n.is_Pow and not n.exp.is_Integer]
    radicands = [n for n in under if n.is_Add and len(str(n)) >= WORTH]
    if radicands:
        return max(radicands, key=lambda n: (len(str(n)), str(n)))
    gain = {
        node: (count - 1) * (len(str(node)) - 1)
        for node, count in counts.items()
        if count > 1 and len(str(node)) >= WORTH
    }
    if not gain:
        return None
    return max(gain, key=lambda node: (gain[node], str(node)))


def compact(expression: sp.Basic) -> sp.Basic:
    """Factor long sums or complete squares, where that is shorter.

    Examples
    --------
    >>> a, b, c, d, k = sp.symbols("a b c d k")
    >>> compact(sp.expand(k * (a + b + c) ** 2 - 4 * d))
    -4*d + k*(a + b + c)**2
    """
    if not isinstance(expression, sp.Expr):
        sums = {n for n in expression.atoms(sp.Add) if FEW_TERMS < len(n.args) <= MANY_TERMS}
        return expression.xreplace({n: compact(n) for n in sums})
    if expression.is_Add:
        if (
            not FEW_TERMS < len(expression.args) <= MANY_TERMS
            or irrational(expression)
            or quotient(expression) is None
        ):
            return expression
        forms = [expression, shortest(expression)]
        forms += [f for s in expression.free_symbols if (f := _completed(expression, s))]
        return min(forms, key=lambda e: (len(str(e)), str(e)))
    if expression.is_Mul or expression.is_Pow:
        return expression.func(*(compact(a) if a.args else a for a in expression.args))
    return expression


def _completed(expression: sp.Expr, symbol: sp.Symbol) -> sp.Expr | None:
    """Complete the square of a s² + b s + c as a (s + b/2a)² or (√a s + b/2√a)²."""
    if not expression.is_polynomial(symbol):
        return None
    poly = sp.Poly(expression, symbol)
    if poly.degree() != 2:
        return None
    a, b = poly.nth(2), poly.nth(1)
    root = sp.powdenest(sp.sqrt(sp.factor_terms(shortest(a))), force=True)
    if root.is_polynomial():
        outer, middle = sp.S.One, root * symbol + shortest(b / (2 * root))
    else:
        outer, middle = a, symbol + shortest(b / (2 * a))
    rest = shortest(expression - outer * middle**2)
    if not whole(rest) or not whole(middle):
        return None
    return sp.Add(outer * middle**2, rest)
