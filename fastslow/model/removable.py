"""Quotients with a removable singularity as single functions, found by their form.

Written out, y/(exp(y) − 1) and its like are 0/0 at one point and lose their digits around it, and
so do all their derivatives. Read as one function each, they are smooth: derivatives are again
such functions, whose values `fastslow.quotients` computes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache
from typing import Any, ClassVar

import mpmath
import numpy as np
import sympy as sp
from sympy.codegen.cfunctions import expm1, log1p
from sympy.core.function import ArgumentIndexError
from sympy.logic.boolalg import Boolean, Not
from sympy.printing.precedence import PRECEDENCE

from fastslow.model.rational import exact
from fastslow.quotients import QUOTIENTS

#: Relative difference of numbers that are equal but for the rounding of what was written.
_ROUNDING = 1e-13

#: Largest width of the neighbourhood of a singular point that a Piecewise guards, in the argument
#: of the quotient, and largest relative difference of the two branches at its edge.
_WIDEST, _GUARDED = 0.5, 1e-3


class Removable(sp.Function):
    """Derivative of order k of a quotient with a removable singularity: ``Quotient(y, k)``."""

    nargs = 2

    #: Name of the function that computes its values.
    stored: ClassVar[str]

    #: The singular point, and the distance up to which a Taylor polynomial replaces the quotient
    #: in exported code, with its number of terms. Beyond it the terms of the derivative cancel.
    point: ClassVar[int] = 0
    near: ClassVar[tuple[sp.Rational, int]] = (sp.Integer(2), 26)

    @classmethod
    def formula(cls, y: sp.Expr) -> sp.Expr:
        """Return the quotient as it is written."""
        raise NotImplementedError

    @classmethod
    def formulas(cls, y: sp.Expr) -> tuple[sp.Expr, sp.Expr]:
        """Return forms of the quotient that do not overflow below and above the point."""
        return (cls.formula(y),) * 2

    @classmethod
    def at_point(cls, order: int) -> sp.Rational:
        """Return the derivative at the singular point."""
        raise NotImplementedError

    @classmethod
    def eval(cls, y: sp.Expr, order: sp.Expr) -> sp.Expr | None:
        if order.is_Float and order == int(order):
            return cls(y, sp.Integer(int(order)))
        if y == cls.point and order.is_Integer:
            return cls.at_point(int(order))
        if y.is_Float and order.is_Integer:
            return cls(y, order, evaluate=False).evalf(y._prec)
        return None

    def fdiff(self, argindex: int = 1) -> sp.Expr:
        if argindex != 1:
            raise ArgumentIndexError(self, argindex)
        return self.func(self.args[0], self.args[1] + 1)

    def _eval_is_extended_real(self) -> bool | None:
        return self.args[0].is_extended_real

    def _eval_is_finite(self) -> bool | None:
        return self.args[0].is_finite

    def _eval_evalf(self, prec: int) -> sp.Expr | None:
        y = self.args[0].evalf(prec + 10)
        real = y.is_Float or y.is_Rational
        if not real and not (y.is_number and y.is_finite and y.is_extended_real is False):
            return None
        with mpmath.workprec(prec):
            place = y._to_mpmath(prec + 10)
            value = _precise(self.func, place, int(self.args[1]))
            if real and isinstance(value, mpmath.mpc):
                # outside the domain
                return None
            return sp.sympify(value)

    def written(self) -> sp.Expr:
        """Return the derivative as it follows from the quotient as it is written."""
        return _formula(self.func, int(self.args[1])).xreplace({_Y: self.args[0]})

    # printed as it is written

    @property
    def precedence(self) -> int:
        """Precedence of the printed operation."""
        return PRECEDENCE["Add" if self.args[1] else "Mul"]

    def _sympystr(self, printer: Any) -> str:
        return str(printer._print(self.written()))

    def _latex(self, printer: Any, exp: str | None = None) -> str:
        text = printer._print(self.written())
        return text if exp is None else rf"\left({text}\right)^{{{exp}}}"


_Y = sp.Dummy("y", real=True)


def _formula(quotient: type[Removable], order: int) -> sp.Expr:
    return _formula_of(quotient.stored, order)


@lru_cache(maxsize=256)
def _formula_of(stored: str, order: int) -> sp.Expr:
    (quotient,) = (q for q in REMOVABLE if q.stored == stored)
    return sp.sympify(quotient.formula(_Y).diff(_Y, order))


class ExpQuotient(Removable):
    """Derivative of order k of y/(e^y − 1): ``ExpQuotient(y, k)``."""

    stored = "exp_quotient"
    near = (sp.Integer(1), 24)

    @classmethod
    def formula(cls, y: sp.Expr) -> sp.Expr:
        return y / (sp.exp(y) - 1)

    @classmethod
    def formulas(cls, y: sp.Expr) -> tuple[sp.Expr, sp.Expr]:
        return cls.formula(y), y * sp.exp(-y) / (1 - sp.exp(-y))

    def written(self) -> sp.Expr:
        y, order = self.args
        if order == 0 and y.could_extract_minus_sign():
            return -y / (1 - sp.exp(y))
        return super().written()

    @classmethod
    def at_point(cls, order: int) -> sp.Rational:
        return -sp.Rational(1, 2) if order == 1 else sp.bernoulli(order)

    def _eval_is_positive(self) -> bool | None:
        return True if self.args[1] == 0 and self.args[0].is_real else None


class SinhQuotient(Removable):
    """Derivative of order k of sinh(y)/y: ``SinhQuotient(y, k)``."""

    stored = "sinh_quotient"

    @classmethod
    def formula(cls, y: sp.Expr) -> sp.Expr:
        return sp.sinh(y) / y

    @classmethod
    def at_point(cls, order: int) -> sp.Rational:
        return sp.Rational((order + 1) % 2, order + 1)

    def _eval_is_positive(self) -> bool | None:
        return True if self.args[1] == 0 and self.args[0].is_real else None


class SinQuotient(Removable):
    """Derivative of order k of sin(y)/y: ``SinQuotient(y, k)``."""

    stored = "sin_quotient"

    @classmethod
    def formula(cls, y: sp.Expr) -> sp.Expr:
        return sp.sin(y) / y

    @classmethod
    def at_point(cls, order: int) -> sp.Rational:
        return sp.Rational((0, -1)[order % 4 == 2] + (order % 4 == 0), order + 1)


class LogQuotient(Removable):
    """Derivative of order k of log(y)/(y − 1): ``LogQuotient(y, k)``."""

    stored = "log_quotient"
    point = 1
    near = (sp.Rational(1, 5), 24)

    @classmethod
    def formula(cls, y: sp.Expr) -> sp.Expr:
        return sp.log(y) / (y - 1)

    @classmethod
    def at_point(cls, order: int) -> sp.Rational:
        return sp.Rational((-1) ** order * math.factorial(order), order + 1)

    def _eval_is_extended_real(self) -> bool | None:
        return True if self.args[0].is_positive else None

    def _eval_is_finite(self) -> bool | None:
        return True if self.args[0].is_positive else None

    def _eval_is_positive(self) -> bool | None:
        return True if self.args[1] == 0 and self.args[0].is_positive else None


REMOVABLE: tuple[type[Removable], ...] = (ExpQuotient, SinhQuotient, SinQuotient, LogQuotient)


def _numerical(quotient: type[Removable]) -> Callable[[Any, Any], Any]:
    function = QUOTIENTS[quotient.stored]
    several = np.vectorize(function, otypes=[float])

    def values(y: Any, order: Any) -> Any:
        if isinstance(y, mpmath.mpf | mpmath.mpc):
            return _precise(quotient, y, int(order))
        if np.iscomplexobj(y):
            if np.any(np.imag(y) != 0):
                return sp.lambdify(_Y, _formula(quotient, int(order)), "numpy")(y)
            y = np.real(y)
        return several(y, int(order)) if np.ndim(y) else function(float(y), int(order))

    return values


for _quotient in REMOVABLE:
    # where SymPy looks for the function that lambdified code calls
    setattr(_quotient, "_imp_", staticmethod(_numerical(_quotient)))  # noqa: B010


def _precise(quotient: type[Removable], y: Any, order: int) -> Any:
    """Return a derivative at a real or complex number to the current precision of mpmath."""
    shift = y - quotient.point
    if shift == 0:
        return mpmath.mpf(int((value := quotient.at_point(order)).p)) / int(value.q)
    size = abs(mpmath.log(abs(shift), 2))
    lost = int((order + 2) * (4 + size)) + 30
    if abs(shift) ** 2 < mpmath.mpf(2) ** (-mpmath.mp.prec - 10 * order - 20):
        # two terms; the second may be the first that does not vanish
        first, second, third = (quotient.at_point(order + k) for k in range(3))
        terms = [mpmath.mpf(int(c.p)) / int(c.q) for c in (first, second, third)]
        return terms[0] + shift * (terms[1] + shift * terms[2] / 2)
    with mpmath.workprec(mpmath.mp.prec + lost):
        return +sp.lambdify(_Y, _formula(quotient, order), "mpmath")(y)


def written_out(expression: Any, *kept: type[Removable]) -> Any:
    """Return an expression with all quotients but some kinds as they are written.

    Examples
    --------
    >>> V = sp.Symbol("V", real=True)
    >>> written_out(ExpQuotient(V, 0))
    V/(exp(V) - 1)
    """
    if not expression.has(Removable):
        return expression
    return expression.replace(
        lambda e: isinstance(e, Removable) and not isinstance(e, kept), lambda e: e.written()
    )


def in_pieces(quotient: Removable) -> sp.Piecewise:
    """Return a quotient of an argument as a Taylor polynomial near its singular point.

    For programs that do not have the quotient as a function. The value, and the first
    derivative, are accurate to a few units in the last place, that of the logarithm to about 15
    beside the polynomial, where its two terms are twelve times their difference.
    """
    y, order = quotient.args
    distance, terms = quotient.near
    shift = y - quotient.point
    near: sp.Expr = sp.Integer(0)
    for k in reversed(range(terms)):
        number = quotient.at_point(int(order) + k) / sp.factorial(k)
        near = near * shift + sp.Float(number, 18)
    below, above = (e.diff(y, int(order)) for e in quotient.formulas(y))
    inside = sp.Abs(shift) < distance
    if below == above:
        return sp.Piecewise((near, inside), (above, True))
    return sp.Piecewise((near, inside), (below, shift < 0), (above, True))


# recognition


def with_removable(expression: sp.Expr) -> sp.Expr:
    """Replace quotients with a removable singularity by single functions.

    The numerator, or the denominator, is a function with a zero: exp(g) − 1, sinh(g), sin(g),
    tanh(g), tan(g), log(1 + g), 1 − cos(g) or cosh(g) − 1, or the reciprocal of one; the other is
    the argument g, times anything. A Piecewise that only guards such a point is replaced by its
    other branch. Quotients whose numerator and denominator have no common zero have a pole, and
    are not changed.

    Examples
    --------
    >>> V = sp.Symbol("V", real=True)
    >>> rate = with_removable((V + 40) / (1 - sp.exp(-(V + 40) / 10)) / 10)
    >>> rate.func, rate.args
    (ExpQuotient, (-V/10 - 4, 0))
    >>> with_removable(sp.Piecewise((1 + V / 2, abs(V) < 1e-4), (V / (1 - sp.exp(-V)), True))).args
    (-V, 0)
    >>> with_removable((V + 39) / (1 - sp.exp(-V - 40))).has(Removable)
    False
    """
    if not expression.has(*_WRITTEN):
        return expression
    expression = expression.replace(expm1, lambda y: sp.exp(y) - 1)
    expression = expression.replace(log1p, lambda y: sp.log(1 + y))
    expression = expression.replace(sp.sinc, lambda y: SinQuotient(y, sp.Integer(0)))
    return _read(expression)


_WRITTEN = (
    sp.exp, sp.log, sp.sin, sp.cos, sp.tan, sp.cot, sp.csc, sp.sinh, sp.cosh, sp.tanh, sp.coth,
    sp.csch, sp.sinc, expm1, log1p,
)  # fmt: skip


def _read(e: Any) -> Any:
    """Replace quotients from the inside out."""
    if not isinstance(e, sp.Basic) or not e.args or not e.has(*_WRITTEN):
        return e
    args = [_read(a) for a in e.args]
    if any(new is not old for new, old in zip(args, e.args, strict=True)):
        e = e.func(*args)
    if isinstance(e, sp.Mul):
        return _product(e)
    if isinstance(e, sp.Add):
        return _sum(e)
    if isinstance(e, sp.Piecewise):
        return _unguarded(e)
    return e


#: A function with a zero: (size, g, n, R), where the function is size × g^n × R and R has neither
#: a zero nor a pole at g = 0.
_Zero = tuple[sp.Expr, sp.Expr, int, sp.Expr]

_ZERO = sp.Integer(0)


def _exp(g: sp.Expr) -> sp.Expr:
    return ExpQuotient(g, _ZERO)


_SIMPLE: dict[Any, Callable[[sp.Expr], sp.Expr]] = {
    sp.sinh: lambda g: SinhQuotient(g, _ZERO),
    sp.sin: lambda g: SinQuotient(g, _ZERO),
    sp.tan: lambda g: SinQuotient(g, _ZERO) / sp.cos(g),
    # g coth(g) = g + 2 g/(exp(2 g) − 1)
    sp.tanh: lambda g: 1 / (_exp(2 * g) + g),
}
_INVERSE: dict[Any, Any] = {
    sp.coth: sp.tanh, sp.csch: sp.sinh, sp.cot: sp.tan, sp.csc: sp.sin,
}  # fmt: skip


def _zero(base: sp.Expr) -> _Zero | None:
    """Return the zero, or the pole, of a function."""
    one, kind = sp.Integer(1), base.func
    if kind in _SIMPLE:
        return one, base.args[0], 1, _SIMPLE[kind](base.args[0])
    if kind in _INVERSE:
        g = base.args[0]
        return one, g, -1, 1 / _SIMPLE[_INVERSE[kind]](g)
    if kind is sp.log and not base.args[0].is_number:
        y = base.args[0]
        return one, y - 1, 1, LogQuotient(y, _ZERO)
    return _zero_of_sum(base) if isinstance(base, sp.Add) else None


def _zero_of_sum(base: sp.Add) -> _Zero | None:
    """Return the zero of exp(g) − 1, 1 − cos(g) or cosh(g) − 1, or the pole of coth(g) ± 1."""
    if len(base.args) != 2:
        return None
    found = [_split(term) for term in base.args]
    (size, function), (other, second) = found
    if function is None or (second is not None and not isinstance(second, sp.exp)):
        (size, function), (other, second) = (other, second), (size, function)
    if function is None:
        return None
    if isinstance(function, sp.exp):
        exponent = function.args[0]
        if second is not None:
            if not isinstance(second, sp.exp):
                return None
            exponent = exponent - second.args[0]
        if not exponent.free_symbols:
            return None
        outer = other if second is None else other * second
        if not _same(size, -other):
            # SymPy evaluates exp(0.1*V + 2.5) as a number times exp(0.1*V)
            number = sp.cancel(-size / other)
            if not (number.is_number and number.is_positive):
                return None
            exponent = exponent + sp.log(number)
        # −outer (exp(g) − 1), with the other term factored out
        return -outer, exponent, 1, 1 / _exp(exponent)
    if second is not None:
        return None
    g = function.args[0]
    if isinstance(function, sp.cos) and _same(size, -other):
        return other / 2, g, 2, SinQuotient(g / 2, _ZERO) ** 2
    if isinstance(function, sp.cosh) and _same(size, -other):
        return size / 2, g, 2, SinhQuotient(g / 2, _ZERO) ** 2
    if isinstance(function, sp.coth) and (_same(size, other) or _same(size, -other)):
        # coth(g) − 1 = 2/(exp(2 g) − 1), and coth(g) + 1 the same of −g with its sign changed
        sign = 1 if _same(size, -other) else -1
        return sign * size, sign * g, -1, _exp(2 * sign * g)
    return None


def _split(term: sp.Expr) -> tuple[sp.Expr, sp.Expr | None]:
    """Return the coefficient of a term and its only function that may have a zero."""
    factors = sp.Mul.make_args(term)
    kinds = sp.exp | sp.cos | sp.cosh | sp.coth
    functions = [f for f in factors if isinstance(f, kinds) and f.free_symbols]
    if len(functions) != 1:
        return term, None
    return sp.Mul(*(f for f in factors if f is not functions[0])), functions[0]


def _same(one: sp.Expr, other: sp.Expr) -> bool:
    """Return True for equal expressions, and for numbers that differ by rounding."""
    if one == other:
        return True
    difference = sp.expand(one - other)
    if difference == 0:
        return True
    if not (difference.has(sp.Float) or one.is_number):
        return False
    sizes = dict(sp.expand(one).as_coefficients_dict())
    return all(
        abs(number) <= _ROUNDING * abs(sizes.get(term, 0))
        for term, number in difference.as_coefficients_dict().items()
    )


def _product(product: sp.Expr) -> sp.Expr:
    """Replace such quotients in a product."""
    if not isinstance(product, sp.Mul):
        return product
    powers = [factor.as_base_exp() for factor in product.args]
    powers = [(sp.exp(n), sp.Integer(1)) if b is sp.E else (b, n) for b, n in powers]
    for number, (base, n) in enumerate(powers):
        found = _zero(base) if n.is_Integer else None
        if found is None:
            continue
        size, g, multiplicity, regular = found
        zeros = multiplicity * int(n)
        for place, (other, m) in enumerate(powers):
            if place == number or not m.is_Integer or zeros * int(m) >= 0:
                continue
            if abs(m) < abs(multiplicity):
                continue
            ratio = _ratio(other, g)
            if ratio is None:
                continue
            # whole factors of the function are replaced
            count = min(abs(int(n)), abs(int(m)) // abs(multiplicity))
            sign = 1 if n > 0 else -1
            used = sign * multiplicity * count
            rest = [b**e for k, (b, e) in enumerate(powers) if k not in (number, place)]
            rest += [base ** (n - sign * count), other ** (m + used)]
            new = (size * regular) ** (sign * count) * ratio ** (-used)
            return sp.Mul(_product(sp.Mul(*rest)), new)
    return product


def _sum(total: sp.Expr) -> sp.Expr:
    """Replace quotients whose numerator is expanded over several terms."""
    if not isinstance(total, sp.Add):
        return total
    shared: dict[tuple[sp.Expr, sp.Expr], list[sp.Expr]] = {}
    for term in total.args:
        for factor in sp.Mul.make_args(term):
            base, n = factor.as_base_exp()
            if n.is_Integer and (found := _zero(base)) is not None and found[2] * n < 0:
                shared.setdefault((base, n), []).append(term)
    for (base, n), terms in shared.items():
        if len(terms) < 2:
            continue
        numerator = sp.Add(*(term / base**n for term in terms))
        for part in _numerators(numerator):
            quotient = sp.Mul(part, base**n)
            new = _product(quotient)
            if new is not quotient and new != quotient:
                rest = sp.Add(*(t for t in total.args if t not in terms))
                return _sum(rest + new)
    return total


def _numerators(numerator: sp.Expr) -> Iterator[sp.Expr]:
    yield sp.factor_terms(numerator)
    yield sp.factor(exact(numerator))


def _ratio(numerator: sp.Expr, g: sp.Expr) -> sp.Expr | None:
    """Return the ratio of two expressions, None if it is singular where g vanishes."""
    shared = numerator.free_symbols & g.free_symbols
    if not shared:
        return None
    if numerator == g:
        return sp.Integer(1)
    if numerator.has(sp.Float) or g.has(sp.Float):
        ratio = _rounded_ratio(numerator, g)
        if ratio is not None:
            return ratio
        numerator, g = exact(numerator), exact(g)
    if not numerator.has(sp.Function) and not g.has(sp.Function):
        try:
            if not _vanishes_with(numerator, g):
                return None
        except (sp.PolynomialError, ArithmeticError, TypeError, ValueError):
            return None
    try:
        ratio = sp.cancel(numerator / g)
    except sp.PolynomialError:
        return None
    below = sp.denom(ratio)
    return ratio if shared - below.free_symbols else None


def _vanishes_with(numerator: sp.Expr, g: sp.Expr) -> bool:
    """Check at one point, much faster than `cancel`, that a numerator may have a factor of g."""
    symbol = min(numerator.free_symbols & g.free_symbols, key=str)
    others = sorted((numerator.free_symbols | g.free_symbols) - {symbol}, key=str)
    place = {s: sp.Rational(7 * k + 11, 5 * k + 3) for k, s in enumerate(others)}
    above, below = numerator.xreplace(place), sp.numer(sp.together(g.xreplace(place)))
    if not below.is_polynomial(symbol) or sp.degree(below, symbol) != 1:
        return True
    below = sp.expand(below)
    at = above.xreplace({symbol: -below.coeff(symbol, 0) / below.coeff(symbol)})
    return bool(sp.nsimplify(at) == 0) if at.is_number else True


def _rounded_ratio(numerator: sp.Expr, g: sp.Expr) -> sp.Expr | None:
    """Return the constant ratio of expressions with decimal numbers, up to their rounding."""
    first, second = (sp.expand(e).as_coefficients_dict() for e in (numerator, g))
    if set(first) != set(second):
        return None
    term = max((t for t in second if t.free_symbols), key=str)
    ratio = first[term] / second[term]
    same = all(abs(first[t] - ratio * second[t]) <= _ROUNDING * abs(first[t]) for t in second)
    return ratio if same else None


# guards


def _unguarded(e: sp.Expr) -> sp.Expr:
    """Return the other branch of a Piecewise that only guards a removable singularity."""
    if not isinstance(e, sp.Piecewise) or len(e.args) != 2:
        return e
    (first, condition), (second, otherwise) = e.args
    if otherwise is not sp.true:
        return e
    for near, far, inside in ((first, second, condition), (second, first, Not(condition))):
        for quotient in sorted(far.atoms(Removable), key=str):
            if _guards(inside, near, far, quotient):
                return far
    return e


def _guards(condition: Boolean, near: sp.Expr, far: sp.Expr, quotient: Removable) -> bool:
    """Check that a condition holds near the singular point only, where both branches agree."""
    argument = sp.expand(exact(quotient.args[0] - quotient.point))
    every = _free(condition, near, far, argument)
    symbols = argument.free_symbols & condition.free_symbols
    if not symbols or not condition.free_symbols <= _free(near, far, argument):
        return False
    symbol = min(symbols, key=str)
    if not argument.is_polynomial(symbol) or sp.degree(argument, symbol) != 1:
        return False
    others = sorted(every - {symbol}, key=str)
    lines = (_line(argument, symbol, others, attempt) for attempt in range(2))
    return all(_agree(condition, near, far, line) for line in lines)


#: An expression where the argument of a quotient has a value, the other symbols being numbers.
_Line = Callable[[Any, float], Any]


def _line(argument: sp.Expr, symbol: sp.Symbol, others: Sequence[sp.Symbol], attempt: int) -> _Line:
    numbers = {s: sp.Rational(7 * k + 13 + attempt, 6 * k + 5) for k, s in enumerate(others)}
    slope, root = (
        e if e.is_Rational else sp.Rational(str(sp.N(e, 30)))
        for e in (
            argument.coeff(symbol).xreplace(numbers),
            (-argument.coeff(symbol, 0) / argument.coeff(symbol)).xreplace(numbers),
        )
    )

    def at(expression: Any, y: float) -> Any:
        return exact(expression).xreplace({**numbers, symbol: root + sp.Rational(y) / slope})

    return at


def _agree(condition: Boolean, near: sp.Expr, far: sp.Expr, at: _Line) -> bool:
    """Check one line through the singular point."""

    def holds(y: float) -> bool:
        return bool(at(condition, y) == sp.true)

    if not holds(0.0) or any(holds(s * y) for s in (-1, 1) for y in (_WIDEST, 3.0, 50.0)):
        return False
    edge = 0.0
    for sign in (-1, 1):
        low, high = 0.0, _WIDEST
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if holds(sign * middle) else (low, middle)
        edge = max(edge, low)
    # a condition that holds at the point only
    edge = max(edge, 1e-9)
    for y in (-0.99 * edge, -edge / 3, edge / 3, 0.99 * edge):
        one, other = (sp.N(at(branch, y)) for branch in (near, far))
        if not (one.is_number and other.is_number and one.is_finite and other.is_finite):
            return False
        allowed = max(min(_GUARDED, edge), 1e-6) * max(abs(one), abs(other))
        if abs(one - other) > allowed:
            return False
    return True


def _free(*expressions: sp.Basic) -> set[sp.Basic]:
    return set().union(*(e.free_symbols for e in expressions))
