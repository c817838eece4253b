"""Assumed signs of parameters, and the signs of expressions that follow from them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import sympy as sp
from sympy.core.relational import Relational

from fastslow.formulas.elementary import ELEMENTARY
from fastslow.model.differentiation import derivative
from fastslow.model.rational import quotient
from fastslow.model.work import nodes, spend
from fastslow.symbolic.algebra import (
    expanded_form,
    factors,
    longer,
    rational_form,
    undefined,
    within_budget,
)

#: Largest number of nodes of an expression for which more than signs of terms is tried.
EXAMINED_NODES = 300

#: Least upper bound of the modulus of functions of a real argument.
MODULI = {getattr(sp, name): sp.sympify(one.bound) for name, one in ELEMENTARY.items() if one.bound}

#: Degree up to which the real roots of a polynomial in one parameter are counted.
COUNTED_DEGREE = 24


@dataclass(frozen=True)
class Signs:
    """Assumed signs of parameters and further expressions assumed positive.

    Parameters
    ----------
    known : mapping
        Symbol to +1 or −1.
    facts : tuple of sympy.Expr
        Further expressions assumed positive.
    """

    known: Mapping[sp.Symbol, int]
    facts: tuple[sp.Expr, ...] = ()
    _memory: dict[sp.Expr, int | None] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    @property
    def conditions(self) -> tuple[Relational, ...]:
        """The assumptions as inequalities, such as D > 0."""
        signs = tuple(s > 0 if side > 0 else s < 0 for s, side in self.known.items())
        return (*signs, *(sp.Gt(fact, 0) for fact in self.facts))

    def without(self, *symbols: sp.Symbol) -> Signs:
        """Return the assumptions without those on some parameters.

        Examples
        --------
        >>> from fastslow.model.structure import real
        >>> A, D = real("A"), real("D")
        >>> Signs({A: 1, D: 1}).without(A).conditions
        (D > 0,)
        """
        kept = tuple(f for f in self.facts if not f.free_symbols & set(symbols))
        return replace(
            self, known={s: k for s, k in self.known.items() if s not in symbols}, facts=kept
        )

    def with_positive(self, *facts: sp.Expr) -> Signs:
        """Return the assumptions with further expressions assumed positive."""
        return with_facts(self, facts)

    def sign(self, expression: sp.Expr) -> int | None:
        """Return the sign of a real expression under the assumptions, None if undecided.

        Examples
        --------
        >>> from fastslow.model.structure import real
        >>> A, D = real("A"), real("D")
        >>> signs = Signs({A: 1, D: 1})
        >>> signs.sign(A + D**2), signs.sign(-A * D), signs.sign(A - D)
        (1, -1, None)
        """
        expression = sp.sympify(expression)
        if expression not in self._memory:
            spend(nodes(expression, EXAMINED_NODES))
            self._memory[expression] = self._sign(expression)
        return self._memory[expression]

    def nonzero(self, expression: sp.Expr) -> bool:
        """Check whether an expression is nonzero under the assumptions."""
        if longer(expression, EXAMINED_NODES // 4):
            return abs(term_bound(expression, self.known) or 0) == 2
        return bool(expression.is_nonzero) or self.sign(expression) in (1, -1)

    def _sign(self, expression: sp.Expr) -> int | None:
        if undefined(expression):
            return None
        found = self._by_terms(expression)
        if found is not None or expression.is_number or longer(expression, EXAMINED_NODES):
            return found
        sign = 1
        for part, power in sign_factors(expression):
            one = self._part_sign(part)
            if one is None:
                return None
            sign *= one if power % 2 else abs(one)
        return sign

    def _by_terms(self, expression: sp.Expr) -> int | None:
        """Sign of a sum whose terms have one sign, as given, expanded, or by gating rates."""
        found = _definite(term_bound(expression, self.known))
        if found is not None or not expression.is_Add or longer(expression, EXAMINED_NODES):
            return found
        expanded = expanded_form(expression)
        if expanded != expression:
            found = _definite(term_bound(expanded, self.known))
        if found is None:
            found = self._by_ranges(expanded)
        return self._by_rates(expanded) if found is None else found

    def _by_ranges(self, expanded: sp.Expr) -> int | None:
        """Sign of a sum with terms in bounded functions, such as sines and tanh."""
        reach, rest, strict = sp.S.Zero, sp.S.Zero, True
        for term in sp.Add.make_args(expanded):
            number, product = term.as_coeff_Mul()
            pieces = [f.as_base_exp() for f in sp.Mul.make_args(product)]
            if all(b.func in MODULI and e.is_positive for b, e in pieces):
                reach += abs(number) * sp.Mul(*(MODULI[b.func] ** e for b, e in pieces))
                # no real argument attains the bound
                strict &= any(b.func not in (sp.sin, sp.cos) for b, _ in pieces)
            else:
                rest += term
        if reach == 0:
            return None
        sides = {self.sign(rest - reach), self.sign(rest + reach)} - ({0} if strict else set())
        return sides.pop() if len(sides) == 1 else None

    def _by_rates(self, expanded: sp.Expr) -> int | None:
        """Sign of a sum with expanded terms u/(1 − exp(u)), negative for every real u.

        The opening rate of a gate (Hodgkin and Huxley 1952, eq. 12) is such a quotient.
        """
        grouped: dict[sp.Expr, sp.Expr] = {}
        alone: list[sp.Expr] = []
        for term in sp.Add.make_args(expanded):
            rest, kind = term.as_independent(sp.exp, as_Add=False)
            constant, exponential = (1 / kind).as_independent(sp.exp, as_Add=True)
            over = exponential / -constant if constant.is_Rational and constant != 0 else None
            if isinstance(over, sp.exp):
                grouped[over] = grouped.get(over, sp.S.Zero) + rest / constant
            else:
                alone.append(term)
        if not grouped:
            return None
        sides = {self.sign(term) for term in alone}
        sides |= {self.sign(-sp.cancel(e / over.args[0])) for over, e in grouped.items()}
        return sides.pop() if len(sides) == 1 else None

    def _part_sign(self, part: sp.Expr) -> int | None:
        found = self._by_terms(part)
        if found is not None:
            return found
        for fact in self.facts:
            side = self._by_terms(rational_form(part / fact))
            if side is not None:
                return side
            for multiple in _multiples(part, fact):
                rest = self._by_terms(expanded_form(part - multiple * fact))
                if rest is not None and rest * multiple >= 0:
                    return 1 if multiple > 0 else -1
        return self._by_counting(part)

    def _by_counting(self, part: sp.Expr) -> int | None:
        """Sign of a polynomial in one parameter without roots in the parameter's interval."""
        if len(part.free_symbols) != 1:
            return None
        (symbol,) = part.free_symbols
        if not part.is_polynomial(symbol):
            return None
        polynomial = sp.Poly(part, symbol)
        if not polynomial.domain.is_QQ and not polynomial.domain.is_ZZ:
            return None
        if polynomial.degree() > COUNTED_DEGREE:
            return None
        low, high = self.interval(symbol)
        return definite_within(polynomial, low, high)

    def interval(self, symbol: sp.Symbol) -> tuple[sp.Expr, sp.Expr]:
        """Return the open interval of one parameter, from its sign and from facts about it.

        Examples
        --------
        >>> from fastslow.model.structure import real
        >>> a = real("a")
        >>> Signs({a: 1}, (3 - 2 * a,)).interval(a)
        (0, 3/2)
        """
        side = self.known.get(symbol)
        low = sp.S.Zero if side == 1 or symbol.is_positive else -sp.oo
        high = sp.S.Zero if side == -1 else sp.oo
        for fact in self.facts:
            slope = fact.diff(symbol)
            if fact.free_symbols == {symbol} and slope.is_Rational and slope != 0:
                end = -fact.subs(symbol, 0) / slope
                if end.is_Rational:
                    low, high = (max(low, end), high) if slope > 0 else (low, min(high, end))
        return low, high


def definite_within(polynomial: sp.Poly, low: sp.Expr, high: sp.Expr) -> int | None:
    """Return the sign of a rational polynomial on an open interval, None if it changes.

    Real roots are counted by Sturm's theorem.

    Examples
    --------
    >>> x = sp.Symbol("x")
    >>> definite_within(sp.Poly(x**5 - 3 * x + 3, x), sp.Integer(0), sp.oo)
    1
    >>> definite_within(sp.Poly(x**5 - 3 * x + 1, x), sp.Integer(0), sp.oo) is None
    True
    """
    if low >= high:
        return None
    symbol = polynomial.gen
    for end in (low, high):
        while end.is_finite and polynomial.degree() > 0 and polynomial.eval(end) == 0:
            polynomial = polynomial.quo(sp.Poly(symbol - end, symbol))
            # the factor divided out is negative on the interval below its end
            polynomial = -polynomial if end == high else polynomial
    if polynomial.degree() > 0 and polynomial.count_roots(low, high) > 0:
        return None
    if low.is_finite and high.is_finite:
        middle = (low + high) / 2
    else:
        middle = low + 1 if low.is_finite else high - 1 if high.is_finite else sp.S.Zero
    return int(sp.sign(polynomial.eval(middle)))


def term_bound(expression: sp.Expr, known: Mapping[sp.Symbol, int]) -> int | None:
    """Return a bound on an expression from the signs of symbols, without rewriting it.

    2 positive, 1 nonnegative, 0 zero, −1 nonpositive, −2 negative, None undecided.
    One pass over the expression tree.

    Examples
    --------
    >>> from fastslow.model.structure import real
    >>> A, x = real("A"), real("x")
    >>> term_bound(A + x**2, {A: 1}), term_bound(-(x**2), {}), term_bound(A - x**2, {A: 1})
    (2, -1, None)
    """
    if expression.is_Symbol:
        side = known.get(expression)
        return 2 * side if side is not None else 2 if expression.is_positive else None
    if expression.is_Rational:
        return 2 * int(sp.sign(expression))
    if expression.is_Mul:
        found: int | None = 2
        for factor in expression.args:
            one = term_bound(factor, known)
            if one == 0 or one is None:
                found = one
                break
            assert found is not None
            found = found * one // 2 if 2 in (abs(found), abs(one)) else (found * one)
    elif expression.is_Add:
        found = _sum_bound(expression.args, known)
    elif expression.is_Pow:
        found = _power_bound(expression.base, expression.exp, known)
    elif isinstance(expression, sp.exp):
        found = 2 if _real(expression.args[0]) else None
    else:
        place = {s: k * sp.Symbol(s.name, positive=True) for s, k in known.items()}
        found = _assumed(expression.xreplace(place))
    return _assumed(expression) if found is None and expression.is_number else found


def _real(expression: sp.Expr) -> bool:
    """Check that an expression is real wherever it is defined."""
    if expression.is_real:
        return True
    symbols = expression.free_symbols
    rational = expression.is_rational_function(*symbols) and not expression.has(sp.I)
    return bool(rational and all(s.is_real for s in symbols))


def _sum_bound(terms: Iterable[sp.Expr], known: Mapping[sp.Symbol, int]) -> int | None:
    """Bound of a sum, undecided if a term is or if two terms have opposite signs."""
    total = 0
    for term in terms:
        one = term_bound(term, known)
        if one is None or one * total < 0:
            return None
        total = one if abs(one) > abs(total) else total
    return total


def _power_bound(base: sp.Expr, power: sp.Expr, known: Mapping[sp.Symbol, int]) -> int | None:
    inside = term_bound(base, known)
    if power.is_Integer:
        if inside == 0:
            return 0 if power.is_positive else None
        if inside is None:
            even = power.is_even and base.is_extended_real
            return (1 if power.is_positive else 2) if even else None
        size = abs(inside) if power.is_positive else 2
        return size if power.is_even or inside > 0 else -size
    if power.is_Rational:
        return inside if inside in (1, 2) and power.is_positive else 2 if inside == 2 else None
    return 2 if inside == 2 and power.is_real else None


def _assumed(expression: sp.Expr) -> int | None:
    """Bound from SymPy's assumptions."""
    if expression.is_positive:
        return 2
    if expression.is_negative:
        return -2
    return 0 if expression.is_zero else None


def _definite(bound: int | None) -> int | None:
    return {2: 1, 0: 0, -2: -1}.get(bound) if bound is not None else None


def _multiples(part: sp.Expr, fact: sp.Expr) -> list[sp.Expr]:
    """Numbers k for which part − k fact is independent of a symbol in which both are affine."""
    found = [sp.S.One, sp.S.NegativeOne]
    for symbol in sorted(part.free_symbols & fact.free_symbols, key=lambda s: s.name):
        one, two = derivative(part, symbol), derivative(fact, symbol)
        if one.is_number and two.is_number and one != 0:
            found.append(one / two)
    return list(dict.fromkeys(found))


def sign_factors(expression: sp.Expr) -> list[tuple[sp.Expr, int]]:
    """Return the factors of numerator and denominator with positive powers, for signs.

    Examples
    --------
    >>> from fastslow.model.structure import real
    >>> x = real("x")
    >>> sign_factors((x**2 - 1) / 3)
    [(1/3, 1), (x + 1, 1), (x - 1, 1)]
    """
    if quotient(expression) is not None:
        constant, pieces = factors(expression)
        return [(f, abs(p)) for f, p in ((constant, 1), *pieces) if f != 1]
    ready = sp.together(expression) if within_budget(expression) else expression
    found: list[tuple[sp.Expr, int]] = []
    for part in ready.as_numer_denom() if within_budget(expression) else (ready,):
        constant, pieces = factors(part)
        found += [(constant, 1), *pieces]
    return [(f, p) for f, p in found if f != 1]


def with_facts(signs: Signs, facts: Iterable[sp.Expr]) -> Signs:
    """Add positive expressions to the assumptions; signs that contradict them are dropped.

    Examples
    --------
    >>> from fastslow.model.structure import real
    >>> A, D = real("A"), real("D")
    >>> with_facts(Signs({A: 1, D: 1}), [-A - D**2]).conditions
    (D > 0, A < 0, -A - D**2 > 0)
    """
    for fact in facts:
        side = signs.sign(fact)
        if side == 1:
            continue
        if side is not None:
            mine = [s for s in signs.known if s in fact.free_symbols and fact.diff(s).is_number]
            signs = signs.without(*(mine or [s for s in signs.known if s in fact.free_symbols]))
        signs = replace(signs, facts=(*signs.facts, fact))
        signs = replace(signs, known={**signs.known, **_deduced(signs, fact)})
    return signs


def _deduced(signs: Signs, fact: sp.Expr) -> dict[sp.Symbol, int]:
    """Signs of symbols implied by a fact, such as A < 0 by −A − D² > 0."""
    found = {}
    for symbol in fact.free_symbols - set(signs.known):
        slope = fact.diff(symbol)
        if slope.is_number and signs.sign(fact - slope * symbol) in (0, -1):
            found[symbol] = 1 if slope > 0 else -1
    return found
