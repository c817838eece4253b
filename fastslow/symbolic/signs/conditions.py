"""Simplification of combinations of inequalities."""

from __future__ import annotations

from collections.abc import Iterable

import sympy as sp
from sympy.core.relational import Relational
from sympy.logic.boolalg import Boolean

from fastslow.symbolic.algebra import expanded_form, irrational, longer, whole

#: Expressions with more nodes are compared without expansion.
COMPARED_NODES = 250

#: Largest number of relations of a combination that is simplified.
SIMPLIFIED_RELATIONS = 60

#: Largest number of passes over a combination.
SIMPLIFICATION_PASSES = 4

#: Possible values of expressions.
Known = dict[sp.Expr, sp.Set]


def simplified(condition: Boolean) -> Boolean:
    """Return a condition without relations decided by the others.

    Relations that compare the same expression with numbers are treated as sets of its
    values.

    Examples
    --------
    >>> a, b, c = sp.symbols("a b c", real=True)
    >>> simplified((a > b) & ((b > a) | (c > 0)))
    (a > b) & (c > 0)
    >>> simplified((a < 1) & ((a > 1) | (a < sp.Rational(7, 10))))
    a < 7/10
    >>> simplified((a > b) & (a < b)), simplified((a > 0) | (a <= 0))
    (False, True)
    """
    if (
        not isinstance(condition, (sp.And, sp.Or))
        or len(condition.atoms(Relational)) > SIMPLIFIED_RELATIONS
    ):
        return condition
    for _ in range(SIMPLIFICATION_PASSES):
        before = condition
        condition = _reduced(condition, {})
        if condition == before:
            break
    return condition


def _reduced(condition: Boolean, known: Known) -> Boolean:
    """Simplify a condition, given sets of possible values of some expressions."""
    if isinstance(condition, Relational):
        return _decided(condition, known)
    if not isinstance(condition, (sp.And, sp.Or)):
        return condition
    both = isinstance(condition, sp.And)
    args = list(condition.args)
    relations = [a for a in args if isinstance(a, Relational)]
    others = [a for a in args if not isinstance(a, Relational)]
    decided = [_decided(r, known) for r in relations]
    if (sp.false if both else sp.true) in decided:
        return sp.false if both else sp.true
    kept = _without_implied([r for r in decided if isinstance(r, Relational)], both)
    if kept is None:
        return sp.false if both else sp.true
    # a term of a disjunction matters only where the other terms are false
    assumed = dict(known)
    for relation in kept:
        found = _values(relation)
        if found is not None:
            expression, values = found
            values = values if both else sp.S.Reals - values
            assumed[expression] = sp.Intersection(assumed.get(expression, sp.S.Reals), values)
    inner = [_reduced(o, assumed) for o in others]
    return condition.func(*kept, *inner)


def _decided(relation: Boolean, known: Known) -> Boolean:
    found = _values(relation) if known else None
    if found is None or found[0] not in known:
        return relation
    there = known[found[0]]
    if there.is_subset(found[1]):
        return sp.true
    return sp.false if sp.Intersection(there, found[1]) == sp.S.EmptySet else relation


def _without_implied(relations: Iterable[Boolean], both: bool) -> list[Boolean] | None:
    """Relations not implied by others; None if they are contradictory or exhaustive."""
    listed = list(dict.fromkeys(relations))
    values = [_values(r) for r in listed]
    whole_of: Known = {}
    for found in values:
        if found is not None:
            expression, some = found
            before = whole_of.get(expression)
            joined = sp.Intersection if both else sp.Union
            whole_of[expression] = some if before is None else joined(before, some)
    nothing = sp.S.EmptySet if both else sp.S.Reals
    if any(s == nothing for s in whole_of.values()):
        return None
    kept = []
    for k, (relation, found) in enumerate(zip(listed, values, strict=True)):
        rivals = [
            (j, other[1])
            for j, other in enumerate(values)
            if found is not None and other is not None and j != k and other[0] == found[0]
        ]
        # of two with equal values the first is kept
        if not any(
            (r.is_subset(found[1]) if both else found[1].is_subset(r)) and (r != found[1] or j < k)
            for j, r in rivals
            if found is not None
        ):
            kept.append(relation)
    return kept


def _values(relation: Boolean) -> tuple[sp.Expr, sp.Set] | None:
    """An expression without its constant term, and its values by a relation."""
    if not isinstance(relation, Relational) or isinstance(relation, sp.Eq):
        return None
    if longer(relation, COMPARED_NODES):
        return None
    gap = expanded_form(relation.lhs - relation.rhs)
    # complements require expressions that are real everywhere
    if irrational(gap) or not whole(gap) or not gap.free_symbols:
        return None
    constant, rest = gap.as_coeff_Add()
    factor, base = rest.primitive() if rest.is_Add else rest.as_coeff_Mul()
    if base.could_extract_minus_sign():
        factor, base = -factor, -base
    if not (constant.is_Rational and factor.is_Rational):
        return None
    level, above = -constant / factor, factor > 0
    if isinstance(relation, sp.Ne):
        return base, sp.S.Reals - sp.FiniteSet(level)
    strict = isinstance(relation, (sp.Gt, sp.Lt))
    if isinstance(relation, (sp.Gt, sp.Ge)) == above:
        return base, sp.Interval(level, sp.oo, strict, True)
    return base, sp.Interval(-sp.oo, level, True, strict)
