"""Assumptions on the signs of parameters, from values, words, relations and text."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import sympy as sp
from sympy.core.relational import Relational

from fastslow.errors import ArgumentError, ModelError, unknown_name
from fastslow.model.equations import read_condition
from fastslow.model.structure import real
from fastslow.symbolic.signs.signs import Signs, with_facts

WORDS = {"positive": 1, "negative": -1, "real": None}

EXPECTED = "a strict inequality such as A > 0, or a parameter with a word such as 'positive'"


def read_signs(values: Mapping[str, float], assume: Any = None) -> Signs:
    """Return the signs of the parameter values, overridden by given assumptions.

    Parameters
    ----------
    values : mapping
        Parameter name to value; a zero value gives no sign.
    assume : mapping, relation, str or an iterable of these, optional
        ``{"A": "negative"}``, ``A < 0``, ``"A < -D**2"``. A name with the
        word ``"real"`` (or None) has no sign. A relation other than a sign is
        assumed as a fact; signs of parameter values that contradict it are
        dropped.

    Raises
    ------
    UnknownNameError
        For a name that is not a parameter.
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
    return with_facts(Signs(signs), facts)


def _items(assume: Any) -> list[Any]:
    if assume is None:
        return []
    if isinstance(assume, Mapping):
        return list(assume.items())
    if isinstance(assume, (str, sp.Basic)):
        return [assume]
    if not isinstance(assume, Iterable):
        raise ArgumentError(f"assume: received {assume!r}; expected {EXPECTED}")
    return [part for item in assume for part in _items(item)]


def _named(values: Mapping[str, float], name: Any, word: Any) -> tuple[sp.Symbol, int | None]:
    if str(name) not in values:
        raise unknown_name("parameter", name, values)
    if isinstance(word, str) and word in WORDS:
        return real(str(name)), WORDS[word]
    if word is None or (type(word) is int and abs(word) == 1):
        return real(str(name)), word
    raise ArgumentError(
        f"assume: {name} is {word!r}; expected 'positive', 'negative', 'real', 1, -1 or None"
    )


def _positive_part(item: Any, values: Mapping[str, float]) -> sp.Expr:
    """The expression that is positive by an assumed strict inequality."""
    relation = item
    if isinstance(item, str):
        try:
            relation = read_condition("assume", item, values, exact=True)
        except ModelError as error:
            # the text is an argument of derive, not a part of the model
            raise ArgumentError(str(error)) from None
    if relation in (sp.true, sp.false):
        raise ArgumentError(f"assume: {item} is always {relation}; expected {EXPECTED}")
    if not isinstance(relation, Relational):
        raise ArgumentError(f"assume: received {item}; expected {EXPECTED}")
    for symbol in sorted(relation.free_symbols, key=lambda s: s.name):
        if symbol.name not in values:
            raise unknown_name("parameter", symbol.name, values)
    if not isinstance(relation, (sp.StrictGreaterThan, sp.StrictLessThan)):
        raise ArgumentError(f"assume: received {item}; expected {EXPECTED}")
    gap = relation.gts - relation.lts
    return sp.expand(gap.xreplace({s: real(s.name) for s in gap.free_symbols}))
