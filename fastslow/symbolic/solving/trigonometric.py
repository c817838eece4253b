"""Real roots of equations in sines and cosines of multiples of one angle."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import sympy as sp

from fastslow.model.differentiation import derivative
from fastslow.model.rational import quotient
from fastslow.symbolic.algebra import (
    expanded_form,
    factors,
    longer,
    shortest,
    undefined,
)
from fastslow.symbolic.signs.signs import Signs
from fastslow.symbolic.solving.univariate import SOLVED_NODES, Root, roots

#: Largest multiple of the angle.
MULTIPLE = 6

#: Names of the integer by which periods are counted, where they are free.
COUNTERS = ("k", "j", "n", "K", "J")

#: Other functions in terms of sine and cosine.
_QUOTIENTS = {
    sp.tan: lambda a: sp.sin(a) / sp.cos(a),
    sp.cot: lambda a: sp.cos(a) / sp.sin(a),
    sp.sec: lambda a: 1 / sp.cos(a),
    sp.csc: lambda a: 1 / sp.sin(a),
}

_SINE, _COSINE, _LEVEL = (sp.Dummy(n, real=True) for n in ("sine", "cosine", "level"))


@dataclass(frozen=True)
class _Angle:
    """The angle θ = rate x + phase, and the equation even + odd sin(θ), polynomials in cos(θ)."""

    rate: sp.Expr
    phase: sp.Expr
    even: sp.Expr
    odd: sp.Expr


def trigonometric_roots(
    factor: sp.Expr, unknown: sp.Symbol, signs: Signs, taken: set[sp.Symbol]
) -> tuple[list[Root], sp.Symbol] | None:
    """Return all real roots of a trigonometric equation, with the integer that counts periods.

    Parameters
    ----------
    factor : sympy.Expr
        In sines, cosines and tangents of rational multiples of one angle, affine in the unknown.
    unknown : Symbol
    signs : Signs
    taken : set of Symbol
        Symbols that are used elsewhere.

    Returns
    -------
    tuple or None
        None if the unknown occurs outside such functions, or without short closed form.

    Examples
    --------
    >>> from fastslow.model.structure import real
    >>> x, a = real("x"), real("a")
    >>> equation = a * sp.sin(x) ** 2 - a * sp.cos(x) ** 2
    >>> found, k = trigonometric_roots(equation, x, Signs({a: 1}), set())
    >>> [root.value for root in found]
    [pi*k - pi/4, pi*k + pi/4]
    """
    if longer(factor, SOLVED_NODES):
        return None
    angle = _angle(factor, unknown)
    if angle is None:
        return None
    solved = _solutions(angle, signs)
    if solved is None:
        return None
    names = {s.name for s in (*taken, *factor.free_symbols)}
    counter = sp.Symbol(next(n for n in COUNTERS if n not in names), integer=True)
    found = []
    for root, period in solved:
        if any(signs.sign(e) == -1 for e in root.radicands):
            continue
        value = shortest(expanded_form((root.value + period * counter - angle.phase) / angle.rate))
        # a root of the numerator may be a zero of a denominator
        if not undefined(factor.xreplace({unknown: value})):
            found.append(replace(root, value=value))
    return found, counter


def _angle(factor: sp.Expr, unknown: sp.Symbol) -> _Angle | None:
    for function, form in _QUOTIENTS.items():
        factor = factor.replace(function, form)
    inside = sorted(
        {f.args[0] for f in factor.atoms(sp.sin, sp.cos) if unknown in f.free_symbols}, key=str
    )
    rates = [derivative(a, unknown) for a in inside]
    if not inside or any(unknown in r.free_symbols for r in rates):
        return None
    ratios = [sp.cancel(r / rates[0]) for r in rates]
    if not all(r.is_Rational for r in ratios):
        return None
    unit = sp.Rational(math.gcd(*(int(r.p) for r in ratios)), math.lcm(*(int(r.q) for r in ratios)))
    multiples = [int(r / unit) for r in ratios]
    if max(map(abs, multiples)) > MULTIPLE:
        return None
    phases = [sp.expand(a.subs(unknown, 0)) for a in inside]
    phase = phases[0] / multiples[0]
    if any(sp.expand(p - m * phase) != 0 for p, m in zip(phases, multiples, strict=True)):
        phase = sp.S.Zero
    place: dict[sp.Expr, sp.Expr] = {}
    for argument, multiple, own in zip(inside, multiples, phases, strict=True):
        sine, cosine = _multiple(multiple)
        rest = sp.expand(own - multiple * phase)
        place[sp.sin(argument)] = sine * sp.cos(rest) + cosine * sp.sin(rest)
        place[sp.cos(argument)] = cosine * sp.cos(rest) - sine * sp.sin(rest)
    bare = factor.xreplace(place)
    if unknown in bare.free_symbols:
        return None
    kept = {f: sp.Dummy(real=True) for f in bare.atoms(sp.Function)}
    found = quotient(bare.xreplace(kept))
    if found is None:
        return None
    above = found.numerator.as_expr()
    rest = sp.rem(above, _SINE**2 + _COSINE**2 - 1, _SINE)
    back = {d: f for f, d in kept.items()}
    even, odd = (expanded_form(sp.expand(rest).coeff(_SINE, k)).xreplace(back) for k in (0, 1))
    return _Angle(unit * rates[0], phase, even, odd)


def _multiple(number: int) -> tuple[sp.Expr, sp.Expr]:
    """Return the sine and cosine of a multiple of the angle."""
    size = abs(number)
    sine = sp.expand(_SINE * sp.chebyshevu(size - 1, _COSINE)) if size else sp.S.Zero
    return (sine if number > 0 else -sine), sp.expand(sp.chebyshevt(size, _COSINE))


def _solutions(angle: _Angle, signs: Signs) -> list[tuple[Root, sp.Expr]] | None:
    """Return the angles in one period, with their period; None without short closed form."""
    whole = sp.Poly(angle.even + _SINE * angle.odd, _SINE, _COSINE)
    if whole.is_zero:
        return None
    degrees = {sum(m) for m in whole.monoms()}
    if len({d % 2 for d in degrees}) == 1:
        return _of_tangents(whole, max(degrees), signs)
    alone = _in_sine(angle)
    if angle.odd == 0 or alone is not None:
        inverse, poly, symbol = (
            (sp.acos, angle.even, _COSINE) if angle.odd == 0 else (sp.asin, alone, _SINE)
        )
        levels = _roots(poly, symbol, signs)
        if levels is None:
            return None
        found = []
        for root in levels:
            first = inverse(root.value)
            second = -first if inverse is sp.acos else sp.pi - first
            further = (*root.further, expanded_form(1 - root.value**2))
            for value in dict.fromkeys((first, second)):
                found.append((replace(root, value=value, further=further), 2 * sp.pi))
        return found
    return _of_half_angles(angle, signs)


def _in_sine(angle: _Angle) -> sp.Expr | None:
    """Return the equation as a polynomial in the sine alone, if it is one."""
    whole = sp.expand(angle.even + _SINE * angle.odd)
    rest = sp.expand(sp.rem(whole, _SINE**2 + _COSINE**2 - 1, _COSINE))
    return None if rest.has(_COSINE) else rest


def _of_tangents(whole: sp.Poly, degree: int, signs: Signs) -> list[tuple[Root, sp.Expr]] | None:
    """Solve an equation that is invariant under θ + π up to its sign, for tan(θ)."""
    level = sp.Integer(0)
    for (sine, cosine), coefficient in whole.terms():
        level += coefficient * _LEVEL**sine * (1 + _LEVEL**2) ** ((degree - sine - cosine) // 2)
    poly = sp.Poly(sp.expand(level), _LEVEL)
    values = _roots(poly.as_expr(), _LEVEL, signs)
    if values is None:
        return None
    found = [(replace(r, value=sp.atan(r.value)), sp.pi) for r in values]
    if poly.degree() < degree:
        found.append((Root(sp.pi / 2), sp.pi))
    return found


def _of_half_angles(angle: _Angle, signs: Signs) -> list[tuple[Root, sp.Expr]] | None:
    """Solve for tan(θ/2)."""
    degree = max(
        sp.degree(angle.even, _COSINE), sp.degree(angle.odd, _COSINE) + 1 if angle.odd != 0 else 0
    )
    square = 1 + _LEVEL**2
    place = {_COSINE: (1 - _LEVEL**2) / square, _SINE: 2 * _LEVEL / square}
    whole = (angle.even + _SINE * angle.odd).xreplace(place) * square**degree
    poly = sp.Poly(sp.expand(sp.cancel(whole)), _LEVEL)
    values = _roots(poly.as_expr(), _LEVEL, signs)
    if values is None:
        return None
    found = [(replace(r, value=2 * sp.atan(r.value)), 2 * sp.pi) for r in values]
    if poly.degree() < 2 * degree:
        found.append((Root(sp.pi), 2 * sp.pi))
    return found


def _roots(equation: sp.Expr, symbol: sp.Symbol, signs: Signs) -> list[Root] | None:
    """Return the real roots of all factors of a polynomial, None if one has no short form."""
    found: list[Root] = []
    for part in _parts(equation, symbol, signs):
        closed = roots(part, symbol, signs)
        if closed is None:
            return None
        found += [r for r in closed if not any(signs.sign(e) == -1 for e in r.radicands)]
    return found


def _parts(equation: sp.Expr, symbol: sp.Symbol, signs: Signs) -> Iterator[sp.Expr]:
    """Yield the factors that contain a symbol and may vanish."""
    for part, _ in factors(equation)[1]:
        if symbol in part.free_symbols and signs.sign(part) not in (1, -1):
            yield part
