"""What is assumed of the signs of parameters, and the signs that follow from it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import sympy as sp
from sympy.core.relational import Relational

from fastslow.errors import ArgumentError, unknown_name
from fastslow.model.structure import real
from fastslow.symbolic.algebra import factors, light, spread, tidy, undefined

#: Functions that an assumption given as text may use.
FUNCTIONS = ("sqrt", "exp", "log", "sin", "cos", "tanh")

WORDS = {"positive": 1, "negative": -1, "real": None}


@dataclass(frozen=True)
class Signs:
    """Signs of parameters, and other expressions known to be positive.

    Parameters
    ----------
    known : mapping
        Symbol to +1 or −1.
    facts : tuple of sympy.Expr
        Further expressions that are positive.
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
        """Give the same with some parameters left without a sign.

        Examples
        --------
        >>> A, D = real("A"), real("D")
        >>> Signs({A: 1, D: 1}).without(A).conditions
        (D > 0,)
        """
        kept = tuple(f for f in self.facts if not f.free_symbols & set(symbols))
        return replace(
            self, known={s: k for s, k in self.known.items() if s not in symbols}, facts=kept
        )

    def with_positive(self, *facts: sp.Expr) -> Signs:
        """Give the same with more expressions taken as positive."""
        return _read_facts(self, facts)

    def sign(self, expression: sp.Expr) -> int | None:
        """Sign of a real expression where the assumptions settle it, else None.

        Examples
        --------
        >>> A, D = real("A"), real("D")
        >>> signs = Signs({A: 1, D: 1})
        >>> signs.sign(A + D**2), signs.sign(-A * D), signs.sign(A - D)
        (1, -1, None)
        """
        expression = sp.sympify(expression)
        if expression not in self._memory:
            self._memory[expression] = self._sign(expression)
        return self._memory[expression]

    def nonzero(self, expression: sp.Expr) -> bool:
        """Whether the assumptions show that an expression does not vanish."""
        return bool(expression.is_nonzero) or self.sign(expression) in (1, -1)

    def _sign(self, expression: sp.Expr) -> int | None:
        if undefined(expression):
            return None
        at_once = _plain_sign(self._signed(expression))
        if at_once is not None or expression.is_number:
            return at_once
        sign = 1
        for part, power in parts(expression):
            one = self._part_sign(part)
            if one is None:
                return None
            sign *= one if power % 2 else abs(one)
        return sign

    def _part_sign(self, part: sp.Expr) -> int | None:
        found = _plain_sign(self._signed(part))
        if found is not None:
            return found
        for fact in self.facts:
            side = _plain_sign(self._signed(tidy(part / fact)))
            if side is not None:
                return side
            for multiple in _multiples(part, fact):
                rest = _plain_sign(self._signed(spread(part - multiple * fact)))
                if rest is not None and rest * multiple >= 0:
                    return 1 if multiple > 0 else -1
        return None

    def _signed(self, expression: sp.Expr) -> sp.Expr:
        """Give the expression in symbols that carry their signs."""
        place = {
            s: side * sp.Symbol(s.name, positive=True)
            for s, side in self.known.items()
            if s in expression.free_symbols
        }
        return sp.sympify(expression.xreplace(place))


def _multiples(part: sp.Expr, fact: sp.Expr) -> list[sp.Expr]:
    """Numbers k for which part − k fact is free of a symbol that both are affine in."""
    found = [sp.S.One, sp.S.NegativeOne]
    for symbol in sorted(part.free_symbols & fact.free_symbols, key=lambda s: s.name):
        one, two = part.diff(symbol), fact.diff(symbol)
        if one.is_number and two.is_number and one != 0:
            found.append(one / two)
    return list(dict.fromkeys(found))


def parts(expression: sp.Expr) -> list[tuple[sp.Expr, int]]:
    """Factors with their powers; those of a denominator count as well, for signs they are alike.

    Examples
    --------
    >>> x = real("x")
    >>> parts((x**2 - 1) / 3)
    [(x - 1, 1), (x + 1, 1), (3, 1)]
    """
    ready = sp.together(expression) if light(expression) else expression
    found: list[tuple[sp.Expr, int]] = []
    for part in ready.as_numer_denom() if light(expression) else (ready,):
        constant, pieces = factors(part)
        found += [(constant, 1), *pieces]
    return [(f, p) for f, p in found if f != 1]


def _plain_sign(expression: sp.Expr) -> int | None:
    if expression.is_zero:
        return 0
    if expression.is_positive:
        return 1
    if expression.is_negative:
        return -1
    if isinstance(expression, sp.Add):
        return None if expression.is_number else _plain_terms(expression)
    return None


def _plain_terms(expression: sp.Expr) -> int | None:
    """Sign of a sum whose expanded terms all have one sign."""
    expanded = spread(expression)
    if expanded.is_positive:
        return 1
    return -1 if expanded.is_negative else None


def read_signs(values: Mapping[str, float], assume: Any = None) -> Signs:
    """Signs as the parameter values have them, with the given ones in their place.

    Parameters
    ----------
    values : mapping
        Parameter name to value; one that is zero is left without a sign.
    assume : mapping, relation, str or an iterable of these, optional
        ``{"A": "negative"}``, ``A < 0``, ``"A < -D**2"``. A name with the
        word ``"real"`` (or None) is left without a sign. A relation other than
        a sign is kept as a fact, and the parameters in it lose the signs that
        their values gave them where the two contradict.

    Raises
    ------
    UnknownNameError
        For a name that is no parameter.
    ArgumentError
        For an assumption that is not a strict inequality or a known word.

    Examples
    --------
    >>> read_signs({"A": 41.67, "D": 0.25}, "A < 0").conditions
    (A < 0, D > 0)
    """
    signs: dict[sp.Symbol, int] = {
        real(n): (1 if v > 0 else -1) for n, v in values.items() if v != 0
    }
    facts: list[sp.Expr] = []
    for item in _items(assume):
        if isinstance(item, tuple):
            symbol, side = _named(values, *item)
        else:
            fact = _positive_part(item, values)
            if not isinstance(fact if fact.is_Symbol else -fact, sp.Symbol):
                facts.append(fact)
                continue
            symbol, side = (fact, 1) if fact.is_Symbol else (-fact, -1)
        signs.pop(symbol, None) if side is None else signs.update({symbol: side})
    return _read_facts(Signs(signs), facts)


def _read_facts(signs: Signs, facts: Iterable[sp.Expr]) -> Signs:
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
    """Signs of symbols that a fact forces: from −A − D² > 0 that A is negative."""
    found = {}
    for symbol in fact.free_symbols - set(signs.known):
        slope = fact.diff(symbol)
        if slope.is_number and signs.sign(fact - slope * symbol) in (0, -1):
            found[symbol] = 1 if slope > 0 else -1
    return found


def _items(assume: Any) -> list[Any]:
    if assume is None:
        return []
    if isinstance(assume, Mapping):
        return list(assume.items())
    if isinstance(assume, (str, sp.Basic)):
        return [assume]
    return [part for item in assume for part in _items(item)]


def _named(values: Mapping[str, float], name: Any, word: Any) -> tuple[sp.Symbol, int | None]:
    if str(name) not in values:
        raise unknown_name("parameter", name, values)
    if isinstance(word, str) and word in WORDS:
        return real(str(name)), WORDS[word]
    if word is None or word in (1, -1):
        return real(str(name)), word
    raise ArgumentError(
        f"assume: {name} is {word!r}; expected 'positive', 'negative', 'real', 1, -1 or None"
    )


def _positive_part(item: Any, values: Mapping[str, float]) -> sp.Expr:
    """Give the expression that an assumed strict inequality says is positive."""
    words = re.findall(r"[^\W\d]\w*", item) if isinstance(item, str) else []
    names = {n: real(n) for n in (*values, *words) if n not in FUNCTIONS}
    try:
        relation = sp.sympify(item, locals=names)
    except (sp.SympifyError, TypeError, SyntaxError, AttributeError) as trouble:
        raise ArgumentError(f"assume: cannot read {item!r} as an inequality") from trouble
    if not isinstance(relation, (sp.StrictGreaterThan, sp.StrictLessThan)):
        raise ArgumentError(f"assume: expected a strict inequality such as A > 0, received {item}")
    for symbol in sorted(relation.free_symbols, key=lambda s: s.name):
        if symbol.name not in values:
            raise unknown_name("parameter", symbol.name, values)
    gap = relation.gts - relation.lts
    return sp.expand(gap.xreplace({s: real(s.name) for s in gap.free_symbols}))
