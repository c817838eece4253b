"""Expansion, cancellation and factoring within a structural budget.

The budget counts terms, symbols and degrees, so that results do not depend on the
machine. Expressions past the budget are only expanded, and longer ones unchanged.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable
from typing import Any, Generic, TypeVar

import sympy as sp
from sympy.polys.domains import QQ
from sympy.polys.rings import PolyElement, PolyRing

from fastslow.model.polynomials import PastBudgetError
from fastslow.model.rational import quotient
from fastslow.model.work import cached, nodes, spend

Entry = TypeVar("Entry", bound=Any)

#: Longest sum, in terms, that is factored or cancelled.
FACTORED_TERMS = 200

#: Largest number of terms times symbols, for more than three symbols.
TERMS_MANY = 160

#: Longest sum with roots of symbols, which count as symbols in factoring.
TERMS_RADICAL = 16

#: Highest total degree that is factored or cancelled.
FACTORED_DEGREE = 24

#: Largest index of a root of which polynomials are formed.
ROOT_INDEX = 12

#: Largest number of nodes of an expression that is expanded.
EXPANDED_NODES = 600

#: Largest expected number of terms of an expansion.
EXPANDED_TERMS = 800

#: Work of factoring or cancelling, for each node.
FACTORING = 10

#: Number of cached factorisations and shortened expressions.
CACHED_FORMS = 2048


def expanded_form(expression: sp.Expr) -> sp.Expr:
    """Expand an expression without splitting exponentials; long expressions are unchanged.

    A quotient whose denominator is a sum remains one quotient.

    Examples
    --------
    >>> x, a = sp.symbols("x a")
    >>> expanded_form(x * (a + sp.exp(x + a))), expanded_form((x + a) * x / (x + 1))
    (a*x + x*exp(a + x), (a*x + x**2)/(x + 1))
    """
    spend(nodes(expression, EXPANDED_NODES))
    found = None if whole(expression) else quotient(expression)
    if found is not None:
        return found.expanded()
    if (
        expression.is_Atom
        or longer(expression, EXPANDED_NODES)
        or growth(expression) > EXPANDED_TERMS
    ):
        return expression
    kept = {
        p: sp.Dummy(real=True)
        for p in expression.atoms(sp.Pow)
        if p.exp.is_Rational and not p.exp.is_Integer and p.base.is_Add
    }
    # SymPy would extract integer powers from roots and expand them
    spend(nodes(expression) + int(growth(expression)))
    bare = expression.xreplace(kept)
    expanded = sp.expand(bare, power_exp=False, log=False)
    return expanded.xreplace({new: p for p, new in kept.items()})


def longer(expression: sp.Basic, nodes: int) -> bool:
    """Check whether the tree of an expression has more than a number of nodes.

    Examples
    --------
    >>> longer(sp.Symbol("x") + 1, 2)
    True
    """
    traversal = sp.preorder_traversal(expression)
    return any(k >= nodes for k, _ in enumerate(traversal))


def compressed(expression: sp.Expr) -> bool:
    """Check whether a numerator contains products or powers of sums.

    Examples
    --------
    >>> x, y = sp.symbols("x y")
    >>> compressed(x * (x + y) + 1), compressed(x**2 + x * y + 1 / (x + y))
    (True, False)
    >>> compressed((x**2 + x * y) / (x + y) ** 2)
    False
    """
    terms = sp.Add.make_args(expression)
    for term in terms:
        pieces = [p.as_base_exp() for p in sp.Mul.make_args(term)]
        sums = [(b, e) for b, e in pieces if b.is_Add and not e.is_negative]
        if len(sums) > 1 or any(e != 1 for _, e in sums) or (sums and len(terms) > 1):
            return True
    return False


def growth(expression: sp.Expr) -> float:
    """Return an upper bound on the number of terms after expansion.

    Examples
    --------
    >>> x, y = sp.symbols("x y")
    >>> growth((x + y) ** 3 * (x - 1))
    8.0
    """
    if expression.is_Add:
        return sum(growth(a) for a in expression.args)
    if expression.is_Mul:
        return math.prod(growth(a) for a in expression.args)
    if expression.is_Pow and expression.exp.is_Integer:
        base, power = growth(expression.base), abs(int(expression.exp))
        return float(math.comb(int(min(base, 1e6)) + power - 1, power)) if base > 1 else 1.0
    return 1.0


def generators(expression: sp.Expr) -> set[sp.Basic]:
    """Return the transcendental functions in an expression."""
    return {f for f in expression.atoms(sp.Function, sp.exp) if f.free_symbols}


def within_budget(expression: sp.Expr) -> bool:
    """Check whether an expression is within the budget of factoring and cancellation.

    At most one transcendental function is allowed, counted as a symbol.

    Examples
    --------
    >>> x = sp.Symbol("x")
    >>> within_budget(x**3 - sp.exp(x)), within_budget(sp.tanh(x) - sp.cosh(x / 2))
    (True, False)
    """
    if not generators(expression) and not irrational(expression):
        return quotient(expression) is not None
    if longer(expression, EXPANDED_NODES) or _high_roots(expression):
        return False
    kinds = generators(expression)
    if len(kinds) > 1:
        return False
    terms = growth(expression)
    symbols = len(expression.free_symbols) + len(kinds)
    if terms > FACTORED_TERMS:
        terms = len(sp.Add.make_args(expanded_form(expression)))
    most = TERMS_MANY / symbols if symbols > 3 else FACTORED_TERMS
    if irrational(expression):
        most = min(most, TERMS_RADICAL)
    return terms <= most and degree_bound(expression) <= FACTORED_DEGREE


def _high_roots(expression: sp.Expr) -> bool:
    """Check for roots of an index that makes polynomials in them long, such as x**1.7321."""
    powers = expression.atoms(sp.Pow)
    return any(p.exp.is_Rational and p.exp.q > ROOT_INDEX for p in powers)


def degree_bound(expression: sp.Expr) -> float:
    """Return an estimate of the total degree in all symbols; degrees in denominators add to it.

    Examples
    --------
    >>> x, y = sp.symbols("x y")
    >>> degree_bound(x * (1 + y**3) ** 2 - 1)
    7.0
    """
    if expression.is_Add:
        return max(degree_bound(a) for a in expression.args)
    if expression.is_Mul:
        return sum(degree_bound(a) for a in expression.args)
    if expression.is_Pow and expression.exp.is_Rational:
        return float(abs(expression.exp)) * degree_bound(expression.base)
    return 0.0 if expression.is_number else 1.0


def kernels(expression: sp.Expr) -> dict[sp.Expr, sp.Expr] | None:
    """Map functions, and powers with symbols as exponents, to symbols that stand for them.

    None if two of them are powers of each other, such as exp(x) and exp(2*x).

    Examples
    --------
    >>> x = sp.Symbol("x")
    >>> list(kernels(sp.sin(x) ** 2 - sp.cos(x)) or ())
    [cos(x), sin(x)]
    >>> kernels(sp.exp(x) + sp.exp(2 * x)) is None
    True
    """
    found: set[sp.Expr] = set()
    waiting = [expression]
    while waiting:
        node = waiting.pop()
        if isinstance(node, (sp.Function, sp.exp)) or (node.is_Pow and not node.exp.is_Rational):
            found.add(node)
        else:
            waiting += [a for a in node.args if isinstance(a, sp.Expr)]
    ordered = sorted(found, key=str)
    powers = [f.as_base_exp() for f in ordered if f.is_Pow or isinstance(f, sp.exp)]
    for (one, first), (other, second) in itertools.combinations(powers, 2):
        # sums in exponents may share a term
        if one == other and (first.is_Add or second.is_Add or (first / second).is_Rational):
            return None
    return {f: _stand_in(k) for k, f in enumerate(ordered)}


@functools.cache
def _stand_in(number: int) -> sp.Dummy:
    return sp.Dummy(f"f{number}", real=True)


def rational_form(expression: sp.Expr) -> sp.Expr:
    """Expand over one denominator and cancel, within the budget.

    Examples
    --------
    >>> x = sp.Symbol("x")
    >>> rational_form((x**2 - 1) / (x - 1))
    x + 1
    """
    found = quotient(sp.sympify(expression))
    if found is not None:
        return found.expanded()
    if longer(expression, EXPANDED_NODES):
        return expression
    expanded = expanded_form(sp.sympify(expression))
    if whole(expanded) or not within_budget(expression):
        return expanded
    return expanded_form(sp.cancel(sp.together(expanded)))


def whole(expression: sp.Expr) -> bool:
    """Check that no denominator is a sum."""
    return all(not p.exp.is_negative or p.base.is_Symbol for p in expression.atoms(sp.Pow))


def numerator(expression: sp.Expr) -> sp.Expr:
    """Return the numerator of an expression over its common denominator.

    Examples
    --------
    >>> x = sp.Symbol("x")
    >>> numerator(x + 1 / (x + 1))
    x**2 + x + 1
    """
    found = quotient(sp.sympify(expression))
    if found is not None:
        return found.numerator.as_expr()
    expanded = expanded_form(sp.sympify(expression))
    if all(not p.exp.is_negative for p in expanded.atoms(sp.Pow)) or not within_budget(expression):
        return expanded
    return expanded_form(sp.together(expanded).as_numer_denom()[0])


@cached(CACHED_FORMS)
def factors(expression: sp.Expr) -> tuple[sp.Expr, tuple[tuple[sp.Expr, int], ...]]:
    """Return the constant and the irreducible factors, with negative powers in denominators.

    Past the budget the expression itself is the only factor.

    Examples
    --------
    >>> x = sp.Symbol("x")
    >>> factors(2 * x**2 - 2)
    (2, ((x + 1, 1), (x - 1, 1)))
    """
    if expression.is_number:
        return expression, ()
    found = quotient(expression)
    if found is not None:
        try:
            return found.factors()
        except PastBudgetError:
            return sp.S.One, ((expression, 1),)
    inside = kernels(expression)
    if inside:
        constant, bare = factors(expression.xreplace(inside))
        back = {d: f for f, d in inside.items()}
        return constant, tuple((f.xreplace(back), e) for f, e in bare)
    if not within_budget(expression):
        pieces: list[tuple[sp.Expr, int]] = []
        constant = sp.S.One
        for part in sp.Mul.make_args(expression):
            base, power = part.as_base_exp()
            if part.is_number:
                constant *= part
            elif power.is_Integer and power > 0:
                pieces.append((base, int(power)))
            else:
                pieces.append((part, 1))
        return constant, tuple(pieces)
    spend(FACTORING * nodes(expression))
    try:
        constant, pieces = sp.factor_list(expression)
    except sp.PolynomialError:
        return sp.S.One, ((expression, 1),)
    # a power with a symbol as exponent is one factor
    return constant, tuple((f, e) if sp.sympify(e).is_Integer else (f**e, 1) for f, e in pieces)


def undefined(expression: sp.Expr) -> bool:
    """Check whether an expression contains a division by zero."""
    return bool(expression.has(sp.nan, sp.zoo, sp.oo, -sp.oo))


@cached(CACHED_FORMS)
def shortest(expression: sp.Expr) -> sp.Expr:
    """Return the factored or expanded form with the fewest operations, within the budget.

    Examples
    --------
    >>> x, a = sp.symbols("x a")
    >>> shortest(x**3 - a * x**2 + a * x - a**2).func is sp.Mul
    True
    """
    found = quotient(expression)
    if found is not None:
        forms = [expression, found.expanded(), found.factored()]
        return min(forms[::-1], key=lambda e: (sp.count_ops(e), len(str(e))))
    if not within_budget(expression):
        return expression
    spend(FACTORING * nodes(expression))
    if generators(expression) or irrational(expression):
        forms = [expression, expanded_form(expression), sp.factor_terms(expression)]
    else:
        forms = [
            sp.factor(expression),
            expanded_form(expression),
            expanded_form(sp.cancel(expression)),
        ]
    return min(forms, key=lambda e: (sp.count_ops(e), len(str(e))))


def irrational(expression: sp.Expr) -> bool:
    """Check whether an expression contains roots of symbols."""
    return any(not p.exp.is_integer for p in expression.atoms(sp.Pow) if p.base.free_symbols)


def determinant(matrix: sp.MatrixBase) -> sp.Expr:
    """Return the determinant of a small matrix, by expansion along rows, within the budget.

    Examples
    --------
    >>> determinant(sp.Matrix([[1, 2], [3, 4]]))
    -2
    """
    every = tuple(range(matrix.rows))
    rows = [list(matrix.row(k)) for k in every]
    return sp.sympify(_Minors(rows, sp.S.Zero, sp.S.One, expanded_form).minor(every, every))


class _Minors(Generic[Entry]):
    """Minors of a matrix, each computed once."""

    def __init__(
        self,
        entries: list[list[Entry]],
        zero: Entry,
        one: Entry,
        expanded: Callable[[Entry], Entry],
    ) -> None:
        self._entries, self._zero, self._expanded = entries, zero, expanded
        self._known: dict[tuple[tuple[int, ...], tuple[int, ...]], Entry] = {((), ()): one}

    def minor(self, rows: tuple[int, ...], columns: tuple[int, ...]) -> Entry:
        """Return a minor, by expansion along its first row."""
        if (rows, columns) not in self._known:
            total = self._zero
            for k, column in enumerate(columns):
                entry = self._entries[rows[0]][column]
                if entry != 0:
                    rest = self.minor(rows[1:], (*columns[:k], *columns[k + 1 :]))
                    total = total + entry * rest if k % 2 == 0 else total - entry * rest
            self._known[rows, columns] = self._expanded(total)
        return self._known[rows, columns]

    def characteristic(self, size: int) -> list[Entry]:
        """Return the coefficients 1, a1, …, an of the characteristic polynomial."""
        found = []
        for k in range(size + 1):
            total = self._zero
            for rows in itertools.combinations(range(size), k):
                total = total + self.minor(rows, rows)
            found.append(self._expanded(-total if k % 2 else total))
        return found


def adjugate(matrix: sp.MatrixBase) -> sp.MatrixBase:
    """Return the adjugate, with matrix * adjugate = determinant * identity.

    Examples
    --------
    >>> adjugate(sp.Matrix([[1, 2], [3, 4]])).tolist()
    [[4, -2], [-3, 1]]
    """
    size = matrix.rows
    return sp.Matrix(
        size,
        size,
        lambda i, j: (-1) ** (i + j) * determinant(matrix.minor_submatrix(j, i)),
    )


def characteristic_coefficients(matrix: sp.MatrixBase) -> tuple[sp.Expr, ...]:
    """Return the coefficients 1, a1, …, an of the characteristic polynomial.

    Examples
    --------
    >>> characteristic_coefficients(sp.Matrix([[1, 2], [3, 4]]))
    (1, -5, -2)
    """
    size = matrix.rows
    symbols = sorted(matrix.free_symbols, key=str)
    if symbols and all(e.is_polynomial(*symbols) and not e.atoms(sp.Float) for e in matrix):
        ring = PolyRing(symbols, QQ)
        entries = [[ring.from_expr(sp.expand(e)) for e in matrix.row(k)] for k in range(size)]
        in_ring: _Minors[PolyElement] = _Minors(entries, ring.zero, ring.one, lambda e: e)
        return tuple(e.as_expr() for e in in_ring.characteristic(size))
    entries = [list(matrix.row(k)) for k in range(size)]
    return tuple(_Minors(entries, sp.S.Zero, sp.S.One, expanded_form).characteristic(size))
