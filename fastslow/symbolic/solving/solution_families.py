"""Families of equilibria: irreducible components of rate = 0, solved in closed form."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import sympy as sp

from fastslow.model.structure import real
from fastslow.model.work import spend_traversal
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.symbolic.algebra import (
    expanded_form,
    factors,
    generators,
    growth,
    irrational,
    longer,
    numerator,
    rational_form,
    shortest,
    undefined,
    within_budget,
)
from fastslow.symbolic.decimals import without_scale
from fastslow.symbolic.naming import LINE_WIDTH
from fastslow.symbolic.signs.signs import Signs
from fastslow.symbolic.solving.candidates import Candidates, choose_symbol
from fastslow.symbolic.solving.elimination import Elimination, Nonzero, eliminate
from fastslow.symbolic.solving.linear import cramer
from fastslow.symbolic.solving.lowering import lower_degrees
from fastslow.symbolic.solving.univariate import SOLVED_DEGREE, Root, factors_in, roots

#: Largest number of terms in all coefficients for which a discriminant is formed.
COEFFICIENTS = 12

#: Divisors with more nodes are not printed in a note.
DIVISOR_NODES = 100

#: Bound on the terms of rates that are expanded.
EXPANDED_RATES = 300

#: The bound for rates with roots of symbols.
EXPANDED_RADICAL = 60

#: The bound for several equations together, before elimination.
EXPANDED_SEVERAL = 120

#: Beginning of notes on remaining equations.
OPEN = "not solved in closed form:"

#: Note on rates past the budget.
PAST = f"{OPEN} rates past the budget of expansion"

#: Largest number of components into which equations are split.
BRANCHES = 32


@dataclass(frozen=True)
class SolutionFamily:
    """An irreducible component of the solutions of rate = 0, or of other equations.

    Parameters
    ----------
    elimination : Elimination
        Irreducible remaining equations, unknowns, and all other states.
    parameter : Symbol or None
        The parameter for which the equation was solved.
    curve : sympy.Expr or None
        Its value along the family, as a function of the unknown and other parameters.
    roots : tuple of Root or None
        The unknown in closed form; None if there is no short form.
    discriminant : sympy.Expr or None
        Discriminant of the remaining polynomial, for degree two or more.
    condition : tuple of sympy.Expr
        Equations without unknowns, necessary for the family to exist.
    note : str
        Reason why the family is implicit, and divisors assumed nonzero.
    bent : bool
        True if the parameter occurs nonlinearly, so that there are several curves.
    radicands : tuple of sympy.Expr
        Expressions that are nonnegative along the curve.
    """

    elimination: Elimination
    parameter: sp.Symbol | None = None
    curve: sp.Expr | None = None
    roots: tuple[Root, ...] | None = None
    discriminant: sp.Expr | None = None
    condition: tuple[sp.Expr, ...] = ()
    note: str = ""
    bent: bool = False
    radicands: tuple[sp.Expr, ...] = ()

    @property
    def unknown(self) -> sp.Symbol | None:
        """The unknown of a univariate family, else None."""
        return self.elimination.unknowns[0] if self.elimination.is_univariate else None

    @property
    def equations(self) -> tuple[sp.Expr, ...]:
        """Remaining equations, = 0."""
        return self.elimination.remaining

    def reduced(self, expression: sp.Expr) -> sp.Expr:
        """Restrict an expression in the states to the family, as a function of the unknowns."""
        spend_traversal(expression)
        solved = {real(n): e for n, e in self.elimination.solved.items()}
        inside = expression.xreplace(solved)
        if self.parameter is not None and self.curve is not None:
            inside = inside.xreplace({self.parameter: self.curve})
        return rational_form(inside)


def families(
    rates: Mapping[str, sp.Expr],
    states: Sequence[str],
    signs: Signs,
    candidates: Iterable[sp.Symbol],
    *,
    populations: bool = True,
) -> list[SolutionFamily]:
    """Return all families of solutions of rate = 0.

    Parameters
    ----------
    rates : mapping
        State to smooth rate with exact coefficients.
    states : sequence of str
    signs : Signs
        Assumptions that decide which coefficients are nonzero.
    candidates : Candidates or iterable of Symbol
        Parameters to solve for, best first.
    populations : bool
        Factor rates x g(x, …) first. With further equations, one of which may imply
        g = 0, this would list points of a continuum.

    Returns
    -------
    list of SolutionFamily

    Examples
    --------
    >>> x, w = real("x"), real("w")
    >>> [f.curve for f in families({"x": w - x**3}, ["x"], Signs({}), [w])]
    [x**3]
    """
    candidates = Candidates.of(candidates)
    unknowns = tuple(real(n) for n in states)
    if any(_past(rates[n]) for n in states):
        return _by_factors(rates, states, signs, candidates)
    growths = _growth_rates(rates, states) if populations else None
    if growths is not None:
        return _of_populations(growths, states, signs, candidates)
    direct = cramer(rates, states)
    if isinstance(direct, tuple):
        values, below = direct
        solved = Elimination((), (), NamedMapping("solved state", values), (below,))
        return _solved(solved, signs, candidates)
    if direct is not None:
        whole = Elimination(tuple(rates.values()), unknowns, NamedMapping("solved state", {}))
        return [SolutionFamily(whole, note=direct)]
    poles = _poles(rates, states)
    return [
        family
        for elimination in split(rates, states, signs)
        if not poles or _keeps(elimination, poles)
        for family in _solved(elimination, signs, candidates)
    ]


def _growth_rates(
    rates: Mapping[str, sp.Expr], states: Sequence[str]
) -> dict[str, list[sp.Expr]] | None:
    """Factor each rate into its own state and a growth rate, where it is such a product.

    None if no rate is such a product, or past the budget of components.
    """
    unknowns = tuple(real(n) for n in states)
    choices = {}
    for name in states:
        found = _factors_as_written(rates[name], unknowns)
        own = real(name)
        rest = [f for f in found if f != own]
        kolmogorov = own in found and len(rest) == 1 and rest[0] not in unknowns
        choices[name] = [own, rest[0]] if kolmogorov else [rates[name]]
    count = math.prod(map(len, choices.values()))
    return choices if 1 < count <= BRANCHES else None


def _of_populations(
    growths: Mapping[str, list[sp.Expr]],
    states: Sequence[str],
    signs: Signs,
    candidates: Candidates,
) -> list[SolutionFamily]:
    """Families of rates x g(x, …), one for each choice of vanishing states."""
    found: list[SolutionFamily] = []
    for picked in itertools.product(*growths.values()):
        absent = {real(n): sp.S.Zero for n, e in zip(states, picked, strict=True) if e == real(n)}
        left = {
            n: sp.sympify(e.xreplace(absent))
            for n, e in zip(states, picked, strict=True)
            if real(n) not in absent
        }
        open_ones = {real(n) for n in left}
        empty = [e for n, e in left.items() if len(growths[n]) > 1]
        if any(undefined(e) for e in left.values()) or not all(
            e.free_symbols & open_ones for e in empty
        ):
            continue
        known = {s.name: e for s, e in absent.items()}
        if not left:
            nothing = Elimination((), (), NamedMapping("solved state", known))
            found.append(SolutionFamily(_ordered(nothing, states)))
            continue
        for family in families(left, list(left), signs, candidates):
            solved = NamedMapping("solved state", {**known, **dict(family.elimination.solved)})
            whole = replace(family.elimination, solved=solved)
            found.append(replace(family, elimination=_ordered(whole, states)))
    return found


def _past(rate: sp.Expr) -> bool:
    """Check whether a rate is too long to be expanded."""
    if generators(rate):
        return False
    return growth(rate) > (EXPANDED_RADICAL if irrational(rate) else EXPANDED_RATES)


def _by_factors(
    rates: Mapping[str, sp.Expr], states: Sequence[str], signs: Signs, candidates: Candidates
) -> list[SolutionFamily]:
    """Families of rates past the budget, one for each choice of vanishing factors.

    A factor that is a single state shortens the other rates, possibly below the budget;
    otherwise they remain unsolved.
    """
    unknowns = tuple(real(n) for n in states)
    choices = [_factors_as_written(rates[n], unknowns) for n in states]
    if math.prod(map(len, choices)) > BRANCHES:
        choices = [[rates[n]] for n in states]
    found: list[SolutionFamily] = []
    for picked in itertools.product(*choices):
        zero = {e: sp.S.Zero for e in picked if e in unknowns}
        names = [n for n in states if real(n) not in zero]
        left = [sp.sympify(e.xreplace(zero)) for e in picked if e not in zero]
        if any(undefined(e) or (e.is_number and e != 0) for e in left):
            continue
        if len(left) != len(names):
            zero, names, left = {}, list(states), list(picked)
        several = len(left) > 1 and sum(map(growth, left)) > EXPANDED_SEVERAL
        short = not several and not any(_past(e) for e in left)
        if zero and names and short:
            inner = families(dict(zip(names, left, strict=True)), names, signs, candidates)
        else:
            open_ones = tuple(map(real, names))
            rest = Elimination(tuple(left), open_ones, NamedMapping("solved state", {}))
            inner = [SolutionFamily(rest, note=PAST if names else "")]
        known = {s.name: e for s, e in zero.items()}
        for family in inner:
            solved = NamedMapping("solved state", {**known, **dict(family.elimination.solved)})
            whole = replace(family.elimination, solved=solved)
            found.append(replace(family, elimination=_ordered(whole, states)))
    return found


def _factors_as_written(rate: sp.Expr, unknowns: Sequence[sp.Symbol]) -> list[sp.Expr]:
    """Factors of a product that contain an unknown, or the whole product."""
    bases = [f.as_base_exp() for f in sp.Mul.make_args(rate)]
    found = [b for b, e in bases if e.is_positive and b.free_symbols & set(unknowns)]
    poles = [b for b, e in bases if not e.is_positive and b.free_symbols & set(unknowns)]
    return [rate] if poles or not found else list(dict.fromkeys(found))


def _poles(rates: Mapping[str, sp.Expr], states: Sequence[str]) -> list[sp.Expr]:
    """Denominators that contain states; an equilibrium is not a zero of one."""
    moving = {real(n) for n in states}
    found = {
        p.base
        for rate in rates.values()
        for p in rate.atoms(sp.Pow)
        if p.exp.is_negative and p.base.free_symbols & moving
    }
    return sorted(found, key=str)


def split(rates: Mapping[str, sp.Expr], states: Sequence[str], signs: Signs) -> list[Elimination]:
    """Eliminate states and factor equations until every equation is irreducible.

    Examples
    --------
    >>> x, y, r = map(real, "xyr")
    >>> [e.solved for e in split({"x": y - x, "y": r * x - x * y}, ["x", "y"], Signs({}))]
    [{x: 0, y: 0}, {x: r, y: r}]
    """
    whole = eliminate(rates, states, nonzero=signs.nonzero)
    done: list[Elimination] = []
    waiting = [whole]
    while waiting:
        current = waiting.pop(0)
        pieces = _pieces(current)
        if pieces is None or len(done) + len(waiting) > BRANCHES:
            done.append(current)
            continue
        again = [_again(current, equations, signs) for equations in pieces]
        waiting = [e for e in again if not any(r.is_nonzero for r in e.remaining)] + waiting
    return [_ordered(e, states) for e in _generic(done, signs)]


def _ordered(elimination: Elimination, states: Sequence[str]) -> Elimination:
    solved = {n: elimination.solved[n] for n in states if n in elimination.solved}
    return replace(elimination, solved=NamedMapping("solved state", solved))


def _pieces(current: Elimination) -> list[tuple[sp.Expr, ...]] | None:
    for row, equation in enumerate(current.remaining):
        found = [f for f, _ in factors_in(equation, current.unknowns)]
        if not found:
            continue
        rest = (current.remaining[:row], current.remaining[row + 1 :])
        if len(found) > 1:
            return [(*rest[0], f, *rest[1]) for f in found]
        multiple = rational_form(numerator(equation) / found[0])
        if multiple.free_symbols & set(current.unknowns):
            return [(*rest[0], found[0], *rest[1])]
    if min(len(current.remaining), len(current.unknowns)) < 2:
        return None
    lowered = lower_degrees(current.remaining, current.unknowns, rounds=1)
    return None if lowered == [current.remaining] else lowered


def _again(current: Elimination, equations: tuple[sp.Expr, ...], signs: Signs) -> Elimination:
    return _joined(current, equations, signs.nonzero)


def _joined(current: Elimination, equations: Sequence[sp.Expr], nonzero: Nonzero) -> Elimination:
    """Eliminate further among equations in the unknowns of an elimination."""
    names = [u.name for u in current.unknowns]
    padded = [*equations, *[sp.Integer(0)] * (len(names) - len(equations))]
    extra = padded[len(names) :]
    further = eliminate(
        dict(zip(names, padded, strict=False)),
        names,
        nonzero=nonzero,
    )
    place = {real(n): e for n, e in further.solved.items()}
    solved = {n: expanded_form(e.xreplace(place)) for n, e in current.solved.items()}
    left = tuple(e for e in (rational_form(x.xreplace(place)) for x in extra) if e != 0)
    return Elimination(
        (*further.remaining, *left),
        further.unknowns,
        NamedMapping("solved state", {**solved, **dict(further.solved)}),
        (*current.divisors, *further.divisors),
    )


def _generic(found: list[Elimination], signs: Signs) -> list[Elimination]:
    """Divide by coefficients that contain states, if several polynomial equations remain."""
    result: list[Elimination] = []
    for current in found:
        several = len(current.remaining) > 1 and len(current.unknowns) > 1
        if not several:
            result.append(current)
            continue
        further = _joined(current, current.remaining, lambda e: e != 0)
        if len(further.unknowns) == len(current.unknowns):
            result.append(current)
            continue
        pieces = _pieces(further)
        again = [further] if pieces is None else [_again(further, p, signs) for p in pieces]
        result += [e for e in again if _keeps(e, e.divisors[len(current.divisors) :])]
    return result


def _keeps(elimination: Elimination, divided: Sequence[sp.Expr]) -> bool:
    """Check that no divisor vanishes identically on a family, which would be spurious."""
    place = {real(n): e for n, e in elimination.solved.items()}
    left = [rational_form(d.xreplace(place)) for d in divided]
    if elimination.is_univariate:
        (equation,), unknowns = elimination.remaining, elimination.unknowns
        both = [
            e for e in left if equation.is_polynomial(*unknowns) and within_budget(e) and e != 0
        ]
        above = [numerator(e) for e in both if within_budget(equation)]
        left += [sp.rem(e, equation, *unknowns) for e in above if e.is_polynomial(*unknowns)]
    return all(e != 0 and not undefined(e) for e in left)


def _solved(elimination: Elimination, signs: Signs, candidates: Candidates) -> list[SolutionFamily]:
    unknowns = elimination.unknowns
    free = [e for e in elimination.remaining if not e.free_symbols & set(unknowns)]
    bound = [e for e in elimination.remaining if e.free_symbols & set(unknowns)]
    slim = Elimination(tuple(bound), unknowns, elimination.solved, elimination.divisors)
    note = ""
    divided = list(dict.fromkeys(f for d in elimination.divisors for f in open_factors(d, signs)))
    if divided:
        note = "valid where " + ", ".join(f"{abridged(d)} ≠ 0" for d in divided)
    if not slim.is_univariate:
        if bound:
            many = f"{OPEN} {len(bound)} equations remain"
            note = _and(note, "1 equation remains" if len(bound) == 1 else many)
        return [SolutionFamily(slim, condition=tuple(free), note=note)]
    (equation,), (unknown,) = slim.remaining, unknowns
    closed = roots(equation, unknown, signs)
    if closed is not None and sp.degree(equation, unknown) == 1:
        return [_linear(slim, closed[0].value, free, note, signs)]
    choice = choose_symbol(equation, candidates.without(unknown), signs)
    bent = choice is not None and choice.slope is None
    if choice is not None and (not choice.values or (bent and closed is not None)):
        # the unknown has a closed form, shorter than a root of the parameter
        choice = None
    parameter = choice.symbol if choice is not None else None
    curve = choice.values[0].value if choice is not None else None
    slope = choice.slope if choice is not None else None
    if slope is not None and not signs.nonzero(slope) and slope.free_symbols & {unknown}:
        note = _and(note, f"the curve is valid where {abridged(slope)} ≠ 0")
    discriminant = None
    if equation.is_polynomial(unknown):
        poly = sp.Poly(equation, unknown)
        size = sum(growth(expanded_form(c)) for c in poly.all_coeffs())
        if poly.degree() == 2 or (2 < poly.degree() <= 5 and size <= COEFFICIENTS):
            discriminant = shortest(sp.discriminant(poly))
        if closed is None and curve is None:
            long = "past the budget" if poly.degree() > SOLVED_DEGREE else "no short radicals"
            note = _and(note, f"{OPEN} degree {poly.degree()} in {unknown}, {long}")
    elif curve is None:
        note = _and(note, f"{OPEN} not a polynomial in {unknown}")
    whole = SolutionFamily(
        slim,
        parameter,
        curve,
        tuple(closed) if closed is not None else None,
        discriminant,
        tuple(free),
        note,
    )
    if choice is None or choice.slope is not None:
        return [whole]
    return [
        replace(whole, curve=value.value, bent=True, radicands=value.radicands)
        for value in choice.values
    ]


def _linear(
    slim: Elimination, value: sp.Expr, free: list[sp.Expr], note: str, signs: Signs
) -> SolutionFamily:
    """Family whose last unknown has a unique value where its coefficient is nonzero."""
    (equation,), (unknown,) = slim.remaining, slim.unknowns
    slope = expanded_form(equation).diff(unknown)
    solved = {n: rational_form(e.subs(unknown, value)) for n, e in slim.solved.items()}
    whole = Elimination(
        (), (), NamedMapping("solved state", {**solved, unknown.name: value}), slim.divisors
    )
    for factor in open_factors(slope, signs):
        note = _and(note, f"valid where {abridged(factor)} ≠ 0")
    return SolutionFamily(whole, condition=tuple(free), note=note)


def open_factors(divisor: sp.Expr, signs: Signs) -> list[sp.Expr]:
    """Return the factors of a divisor that may vanish, without numerical factors."""
    if signs.nonzero(divisor):
        return []
    if longer(divisor, DIVISOR_NODES):
        return [divisor]
    return [f for f, power in factors(divisor)[1] if power > 0 and not signs.nonzero(f)]


def abridged(expression: sp.Expr) -> str:
    """Return an expression as text for a note, where it is short."""
    expression = without_scale(expression)
    long = longer(expression, DIVISOR_NODES) or len(str(expression)) > LINE_WIDTH // 2
    return "(a long expression)" if long else str(expression)


def _and(first: str, second: str) -> str:
    return f"{first}; {second}" if first else second
