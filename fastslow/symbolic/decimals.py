"""Rounding of long rational numbers in printed formulas.

A derivation converts decimals to rational numbers; clearing denominators then yields
coefficients of thirty digits. They are rounded in print only.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TypeVar

import sympy as sp
from sympy.core.relational import Relational
from sympy.logic.boolalg import Boolean, BooleanFunction
from sympy.polys.rootoftools import ComplexRootOf

from fastslow.symbolic.algebra import longer

Formula = TypeVar("Formula", bound=sp.Basic)

#: Digits of a numerator or denominator up to which it is printed exactly.
EXACT_DIGITS = 9

#: Significant digits of longer numbers.
SHOWN_DIGITS = 6

#: Range of the largest coefficient of a sum that is not normalised.
SMALLEST_COEFFICIENT, LARGEST_COEFFICIENT = 1e-3, 1e6

#: Digits of intermediate results.
COMPUTED = 20

#: Formulas with more nodes are not printed, unless they are numbers.
PRINTED_NODES = 2000


@lru_cache(maxsize=2048)
def readable(formula: Formula) -> Formula:
    """Return a formula with long numbers rounded to six digits.

    A sum of terms with long coefficients is divided by the largest coefficient if it is
    a factor of a product or is compared with zero.

    Examples
    --------
    >>> L = sp.Symbol("L")
    >>> readable(sp.Rational(31498526151501, 800000000000000) * L + sp.Rational(31, 400))
    0.0393732*L + 31/400
    >>> readable(647878618765065435 * L**2 - 1110701029154228262 * L + 453637000000000000 > 0)
    0.583306*L**2 - L + 0.408424 > 0
    >>> readable(653 * L / 2000 + 1)
    653*L/2000 + 1
    """
    if not rounds(formula):
        return formula
    return _rounded(_converted(formula))


def rounds(formula: sp.Basic) -> bool:
    """Check whether numbers of a formula are rounded when it is printed.

    Examples
    --------
    >>> rounds(sp.Rational(1, 3)), rounds(sp.Integer(10) ** 12)
    (False, True)
    """
    if isinstance(formula, sp.Expr) and formula.is_number:
        return _long(formula)
    return not longer(formula, PRINTED_NODES) and _long(formula)


def without_scale(formula: sp.Expr) -> sp.Expr:
    """Return a formula with the same zeros, without long common factors.

    Examples
    --------
    >>> L = sp.Symbol("L")
    >>> without_scale(4 * 10**28 * L - 3 * 10**28)
    4*L - 3
    """
    if not rounds(formula) or formula.is_number:
        return formula
    return _rounded(_scaled(formula)[1])


def _long(formula: sp.Basic) -> bool:
    return any(_digits(r) > EXACT_DIGITS for r in formula.atoms(sp.Rational)) or bool(
        formula.atoms(ComplexRootOf)
    )


def _digits(number: sp.Rational) -> int:
    return len(str(max(abs(int(number.p)), int(number.q))))


def _converted(formula: sp.Basic) -> sp.Basic:
    """Replace long numbers by floats."""
    if isinstance(formula, sp.Expr) and formula.is_number:
        value = sp.N(formula, COMPUTED) if _long(formula) else formula
        return value if value.is_Float or value.is_Rational else formula
    if not formula.args:
        return formula
    if isinstance(formula, Relational):
        return _compared(formula)
    if isinstance(formula, (Boolean, BooleanFunction)) or not isinstance(formula, sp.Expr):
        return formula.func(*map(_converted, formula.args))
    if formula.is_Mul:
        return _product(formula)
    if formula.is_Pow:
        exponent = _converted(formula.exp)
        if not exponent.is_number or not formula.base.is_Add:
            return _converted(formula.base) ** exponent
        scale, rest = _scaled(formula.base)
        return _short_number(scale**exponent) * rest**exponent
    return formula.func(*map(_converted, formula.args))


def _product(formula: sp.Mul) -> sp.Expr:
    coefficient, others = sp.S.One, []
    for factor in formula.args:
        scale, rest = _scaled(factor)
        coefficient *= scale
        others.append(rest)
    return sp.Mul(_short_number(coefficient), *others)


def _short_number(number: sp.Expr) -> sp.Expr:
    return sp.N(number, COMPUTED) if number.has(sp.Float) or _long(number) else number


def _scaled(formula: sp.Expr) -> tuple[sp.Expr, sp.Expr]:
    """Split off a number, positive for a sum; the rest contains floats."""
    if formula.is_number:
        return _converted(formula), sp.S.One
    if not formula.is_Add or not _long(formula):
        number, rest = _converted(formula).as_coeff_Mul()
        return number, rest
    content, rest = formula.primitive()
    if not _long(rest):
        return content, rest
    terms = [_converted(t).as_coeff_Mul() for t in rest.args]
    # SymPy gives numbers such as √2 the coefficient one
    sizes = [abs(sp.N(n * (r if r.is_number else 1), COMPUTED)) for n, r in terms]
    largest = max(sizes)
    if SMALLEST_COEFFICIENT <= content * largest <= LARGEST_COEFFICIENT:
        return sp.S.One, sp.Add(*map(_converted, formula.args))
    total = sp.Add(*(_quotient(n, largest) * r for n, r in terms))
    return sp.N(content * largest, COMPUTED), total


def _quotient(number: sp.Expr, by: sp.Float) -> sp.Expr:
    ratio = sp.N(number, COMPUTED) / by
    return sp.Integer(round(ratio)) if abs(abs(ratio) - 1) < 1e-15 else ratio


def _compared(relation: Relational) -> Relational:
    left, right = relation.lhs, relation.rhs
    if right == 0 and not left.is_number:
        number, rest = _scaled(left)
        left = rest if number > 0 else -rest
    else:
        left, right = _converted(left), _converted(right)
    return relation.func(left, right, evaluate=False)


def _rounded(formula: sp.Basic) -> sp.Basic:
    """Round every float to six digits; integral values become integers."""
    place = {}
    for number in formula.atoms(sp.Float):
        shown = float(format(float(number), f".{SHOWN_DIGITS}g"))
        whole = shown == int(shown) and abs(shown) < 10**SHOWN_DIGITS
        place[number] = sp.Integer(int(shown)) if whole else sp.Float(shown, SHOWN_DIGITS)
    return formula.xreplace(place)
