"""Equilibrium equations of regions and sliding motions, and their solutions."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from fractions import Fraction
from functools import cached_property
from itertools import product
from typing import Any

import mpmath
import numpy as np
import sympy as sp
from numpy.typing import ArrayLike, NDArray
from sympy.polys.domains import ZZ
from sympy.polys.rings import ring

from fastslow.continuation.loops import blocks, loop
from fastslow.continuation.ordering import in_order
from fastslow.continuation.polynomial_systems import (
    FARTHEST,
    IntegerTerms,
    Terms,
    at_value,
    solve_polynomials,
)
from fastslow.continuation.spaces import CompiledCurve, newton_space
from fastslow.diagrams.correcting import POLE, Corrections
from fastslow.diagrams.solve.exact_polynomials import (
    IRRATIONAL_DIGITS,
    ParametricPolynomials,
    coefficient_function,
    exactly,
    multiple_root,
    numerator,
    polynomials_of,
    ratios,
    real_roots,
    terms_of,
    values_at,
)
from fastslow.diagrams.solve.parametric import (
    ELIMINATED_STATES,
    Decisions,
    ParametricElimination,
    eliminations_of,
)
from fastslow.model.expansion import vanishes
from fastslow.model.rational import decimal, exact
from fastslow.model.structure import exact_values, real
from fastslow.results.angles import apart
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.symbolic.solving.elimination import Elimination, eliminate, eliminate_linear
from fastslow.symbolic.solving.lowering import lower_degrees

Array = NDArray[np.float64]

#: Starting points of Newton's method for regions without a univariate polynomial.
NEWTON_STARTS = 200

#: Product of starting points and the cube of the number of states up to which all are used.
COST = 1.6e8

#: Smallest number of starting points.
FEWEST = 10

#: A condition on the parameter is satisfied below this fraction of its terms (rounding).
SATISFIED_CONDITION = 1e-14

#: Largest number of batches of starting points, as long as each finds more equilibria.
BATCHES = 100

#: Decades over which starting points of damped iterations are spaced, in units of each state.
DECADES = (-4.0, 2.0)

#: The search ends after one unsuccessful batch for every so many equilibria.
FEW = 10

#: The search ends beyond this number of equilibria.
MANY = 500

#: States closer than this fraction of their size are identical: accuracy of a double root.
SAME_STATE = 1e-8

#: Number of affine equations from which they are solved as one linear system.
MANY_LINEAR = 5

#: Degree up to which the computed roots of a univariate polynomial are considered complete.
COMPLETE_ROOTS_DEGREE = 60

#: Largest number of unknowns of a polynomial system whose roots are isolated.
UNKNOWNS = 3

#: Largest number of complex solutions, by the degrees, of a system whose roots are isolated.
SOLUTIONS = 8000

#: Largest imaginary part of a real state, in its natural unit: the root of a rounding error.
IMAGINARY_ROUNDING = 1e-6

#: Polynomials in the parameter.
_RING = ring("p", ZZ)[0]

#: Largest number of choices of a factor of every rate that are solved separately.
CHOICES = 32


@dataclass(frozen=True, eq=False)
class RegionEquations(Corrections):
    """Eliminated equilibrium equations of one region, with fixed other parameters.

    Parameters
    ----------
    field : FrozenField
    region : int
        Number of the region.
    decisions : Decisions, optional
        Decides which expressions vanish if the other parameters are symbols.
    """

    _: KW_ONLY
    decisions: Decisions | None = None

    @cached_property
    def numbers(self) -> dict[sp.Symbol, sp.Rational]:
        """Exact value of every parameter except the varying one."""
        return exact_values(self.field.model.parameters, (self.field.parameter,))

    @cached_property
    def equations(self) -> dict[str, sp.Expr]:
        """Equations by unknown, with numbers for the other parameters."""
        states = self.field.model.states
        rates = [self._number(rate) for rate in self.field.modes[self.region].rates]
        return dict(zip(states, rates, strict=True))

    def _number(self, expression: sp.Expr) -> sp.Expr:
        """Substitute exact numbers for the other parameters, or for those that are 0."""
        if self.decisions is None:
            return exact(expression).subs(self.numbers)
        zero = {s: v for s, v in self.numbers.items() if v == 0}
        return exact(expression).subs(zero)

    @cached_property
    def general(self) -> ParametricElimination | None:
        """Elimination with symbolic other parameters, if at most one unknown remains.

        It depends on the present values only, not on previous ones.
        """
        moving = {s: v for s, v in self.numbers.items() if v != 0}
        if not moving or self.field.n > ELIMINATED_STATES or self._linear is not None:
            return None
        zero = tuple(s.name for s, v in self.numbers.items() if v == 0)
        known = eliminations_of(self.field.model, self.field.parameter, self.region, zero)
        kind = type(self)
        return known.at(moving, lambda a: kind(self.field, self.region, decisions=a)._parametric())

    def _parametric(self) -> ParametricElimination | None:
        """Elimination with symbols for the non-zero parameters, if applicable."""
        assert self.decisions is not None
        left, parameters = self.elimination, tuple(self.decisions.values)
        symbols = [*left.unknowns, real(self.field.parameter)]
        if len(left.unknowns) > 1:
            return None

        inserted = {real(n): e for n, e in left.solved.items()}
        edges = [sp.expand(numerator(h.subs(inserted))) for h in self.bounds]
        remaining = polynomials_of([numerator(e) for e in left.remaining], symbols, parameters)
        bounds = polynomials_of(edges, symbols, parameters)
        solved: list[ParametricPolynomials] = []
        for state in left.state({}, self.field.model.states):
            quotient = sp.together(state).as_numer_denom()
            if (read := polynomials_of(quotient, symbols, parameters)) is None:
                return None
            solved.append(read)
        if remaining is None or bounds is None:
            return None
        return ParametricElimination(left, parameters, remaining, bounds, tuple(solved))

    @cached_property
    def _values(self) -> list[Fraction]:
        """Exact values of the parameters of `general`."""
        assert self.general is not None
        return exactly({s: self.numbers[s] for s in self.general.parameters})

    @cached_property
    def elimination(self) -> Elimination:
        """Elimination with numbers for all other parameters, whose signs are known."""
        if self.decisions is None and self.general is not None:
            return self.general.elimination.at(self.numbers)
        return self._linear or self._eliminated()

    @cached_property
    def _linear(self) -> Elimination | None:
        """Solution of many equations that are affine, with numbers as coefficients."""
        many = self.decisions is None and self.field.n >= MANY_LINEAR
        return eliminate_linear(self.equations) if many else None

    def _eliminated(self) -> Elimination:
        found = eliminate(self.equations, tuple(self.equations), nonzero=self.decisions)
        if self.decisions is not None or not 1 < len(found.unknowns) < len(self.equations):
            return found
        # few equations of high degree have more solutions, most of them far away, and complex ones
        symbols = tuple(map(real, self.equations))
        rates = [sp.expand(rate) for rate in self.equations.values()]
        before, after = (
            _solutions_at_most(rates, symbols),
            _solutions_at_most(found.remaining, found.unknowns),
        )
        if len(symbols) > UNKNOWNS or before is None or after is None or after <= before:
            return found
        return Elimination(tuple(rates), symbols, NamedMapping("solved state", {}))

    @cached_property
    def unknowns(self) -> tuple[sp.Symbol, ...]:
        """The states that were not eliminated."""
        return (self.general or self).elimination.unknowns

    @cached_property
    def polynomials(self) -> list[IntegerTerms] | None:
        """Remaining equations, if they are polynomials in unknowns and parameter."""
        if self.general is not None:
            return [terms for terms in self.general.remaining.at(self._values) if terms]
        return terms_of(self.elimination.remaining, self._symbols)

    @property
    def _symbols(self) -> list[sp.Symbol]:
        return [*self.unknowns, real(self.field.parameter)]

    @property
    def bounds(self) -> list[sp.Expr]:
        """Functions of which one vanishes when an equilibrium leaves the region."""
        rows = self.field.modes[self.region].rows
        return [self._number(row) for row in rows[: len(self.field.interfaces)]]

    @cached_property
    def edge_polynomials(self) -> list[IntegerTerms] | None:
        """The `bounds` at equilibria, if they are polynomials in unknowns and parameter."""
        if self.general is not None:
            return self.general.bounds.at(self._values)
        return self.along(self.bounds)

    def along(self, functions: Sequence[sp.Expr]) -> list[IntegerTerms] | None:
        """Return functions of the states at equilibria as polynomials in unknowns and parameter.

        None if one is not a polynomial. Denominators do not vanish, or are denominators of the
        rates.
        """
        solved = {real(n): e for n, e in self.elimination.solved.items()}
        found = []
        for function in functions:
            h = function.xreplace(solved)
            if not h.is_polynomial(*self._symbols):
                h = numerator(h)
            if not h.is_polynomial(*self._symbols):
                return None
            found.append(sp.expand(h))
        return terms_of(found, self._symbols)

    @cached_property
    def univariate(self) -> bool:
        """Whether one polynomial in one unknown remains, of sufficiently low degree."""
        if len(self.unknowns) != 1:
            return False
        if self.polynomials is not None:
            first = self.polynomials[:1]
            alone = len(self.polynomials) == 1
            return alone and all(e <= COMPLETE_ROOTS_DEGREE for terms in first for e, _ in terms)
        left = self.elimination
        whole = left.is_univariate and left.is_polynomial
        return bool(
            whole and sp.degree(left.remaining[0], left.unknowns[0]) <= COMPLETE_ROOTS_DEGREE
        )

    @cached_property
    def isolated(self) -> bool:
        """Whether as many polynomials as unknowns remain, so that all roots are found."""
        count = len(self.unknowns)
        if count == 1:
            return self.univariate
        left = self.elimination
        if len(left.remaining) != count or not 1 < count <= UNKNOWNS or not left.is_polynomial:
            return False
        most = _solutions_at_most(left.remaining, left.unknowns)
        return most is not None and most <= SOLUTIONS

    @cached_property
    def _left(self) -> int:
        """Number of equations left, without numbers in their closed forms if they are known."""
        known = self.polynomials if self.general is not None else None
        return len(self.elimination.remaining if known is None else known)

    @property
    def free(self) -> bool:
        """Whether no equation is left for the unknowns: a continuum at every value."""
        return bool(self.unknowns) and not self._left

    @property
    def implicit(self) -> bool:
        """Whether fewer equations than unknowns are left, on whose zero set equilibria are."""
        return 0 < self._left < len(self.unknowns) and not self.impossible

    @cached_property
    def factors(self) -> tuple[FactorEquations, ...]:
        """Equations for each choice of a factor of every rate, if states are factors.

        A rate x g(x, …) vanishes if x or g does. With several unknowns each choice is solved
        separately: it has lower degree and is regular where two equilibria collide at x = 0.
        Empty if there is only one choice, or one of them has neither finitely many solutions
        nor those of a continuum in closed form.
        """
        if len(self.unknowns) < 2 or self.impossible:
            return ()
        states = tuple(map(real, self.equations))
        choices = [state_factors(e, states) for e in self.equations.values()]
        if math.prod(map(len, choices)) > CHOICES:
            return ()
        found = tuple(
            FactorEquations(self.field, self.region, chosen, lowered)
            for chosen in product(*choices)
            for lowered in lower_degrees(chosen, states)
        )
        return found if len(found) > 1 and all(map(_finite, found)) else ()

    @cached_property
    def _coefficients(self) -> list[list[tuple[tuple[int, ...], Any]]]:
        """Exponents in every equation, with coefficients in the parameter."""
        p = real(self.field.parameter)
        system = [sp.Poly(e, *self.unknowns) for e in self.elimination.remaining]
        return [[(e, coefficient_function(c, p)) for e, c in q.terms()] for q in system]

    def _terms_at(self, value: float) -> list[Terms]:
        """Return the polynomials in the unknowns at a value of the parameter."""
        if self.polynomials is not None:
            count, at = len(self.unknowns), decimal(value)
            return [at_value(q, count, at) for q in self.polynomials]
        found = [{e: c(value) for e, c in q} for q in self._coefficients]
        return [{e: c for e, c in q.items() if c} for q in found]

    @cached_property
    def _formula(self) -> Callable[..., list[Any]]:
        """Every state in numbers of mpmath, whose powers do not overflow."""
        left = self.elimination
        p = real(self.field.parameter)
        states = left.state({}, self.field.model.states)
        return sp.lambdify(
            (p, *left.unknowns), [sp.N(s, IRRATIONAL_DIGITS) for s in states], "mpmath"
        )

    @cached_property
    def _exact(self) -> list[Callable[[float], Fraction]] | None:
        """Every state in the parameter, if they are polynomials in it alone."""
        left, p = self.elimination, real(self.field.parameter)
        states = left.state({}, self.field.model.states)
        if left.unknowns or not all(s.is_polynomial(p) and s.is_real for s in states):
            return None
        return [coefficient_function(state, p) for state in states]

    @cached_property
    def _rates(self) -> Callable[..., list[Any]]:
        """Every rate in numbers of mpmath."""
        rates = [self._number(rate) for rate in self.field.modes[self.region].rates]
        symbols = [real(self.field.parameter), *map(real, self.field.model.states)]
        return sp.lambdify(symbols, [sp.N(rate, IRRATIONAL_DIGITS) for rate in rates], "mpmath")

    @cached_property
    def _quotients(self) -> list[list[IntegerTerms]] | None:
        """Every state as a quotient of polynomials, if the denominators do not vanish."""
        if self.general is None:
            return None
        return [quotient.at(self._values) for quotient in self.general.solved]

    def _whole(self, value: float, *unknowns: float) -> list[Array]:
        """Return the full state at values of the unknowns; empty outside the domain.

        A state that cannot be computed, or not be represented, is NaN.
        """
        try:
            if self._quotients is not None:
                place = [*map(Fraction, unknowns), decimal(value)]
                values = (values_at(quotient, place) for quotient in self._quotients)
                found = np.array([above / below for above, below in values])
            elif self._exact is not None:
                found = np.array([float(state(value)) for state in self._exact])
            else:
                with mpmath.workdps(IRRATIONAL_DIGITS):
                    states = self._formula(value, *unknowns)
                beside = np.array([float(mpmath.im(s)) for s in states])
                if np.any(np.abs(beside) > IMAGINARY_ROUNDING * self.unit(value)):
                    return []
                found = np.array([float(mpmath.re(s)) for s in states])
        except ZeroDivisionError:
            # a pole
            return []
        except (ArithmeticError, ValueError, TypeError):
            found = np.full(self.field.n, np.nan)
        return [found if np.isfinite(found).all() else np.full(self.field.n, np.nan)]

    @property
    def impossible(self) -> bool:
        """Whether an equation without states has no solution, as for a constant rate."""
        if self.polynomials is not None:
            return any(len(q) == 1 and not any(next(iter(q))) for q in self.polynomials)
        return any(e.is_number and e.is_nonzero for e in self.elimination.remaining)

    @cached_property
    def _undetermined(self) -> bool:
        """Whether only equations without unknowns remain: a continuum or no equilibria."""
        if not self.unknowns:
            return False
        if self.polynomials is not None:
            return all(not any(e[:-1]) for q in self.polynomials for e in q)
        return all(not e.has(*self.unknowns) for e in self.elimination.remaining)

    def solutions(
        self, value: float, bounds: Mapping[str, float] | None = None, *, search: bool = False
    ) -> tuple[list[Array], bool]:
        """Return isolated equilibria of the rates at a value, and whether these are all.

        Admissible or not; only equilibria within the bounds on the modulus of states. With
        ``search`` several unknowns are searched for, and not isolated.
        """
        if not self.factors:
            found, complete = self._known(value, bounds or {}, search)
        else:
            found, complete = [], True
            for equations in self.factors:
                states, sure = equations._known(value, bounds or {}, search)
                found += [s for s in states if not any(self.same(s, o, value) for o in found)]
                complete &= sure
            found = [found[k] for k in in_order(found, self.unit(value))]
        return (found, True) if complete else (self._searched(value, found, bounds), False)

    def outside(self, value: float) -> bool:
        """Return whether the only equilibrium is outside its region, by more than rounding."""
        if self.unknowns or len(states := self._representable(value)) != 1:
            return False
        unit = np.append(self.unit(value), abs(value))
        return self.field.virtual(self.region, np.append(states[0], value), unit)

    def _known(
        self, value: float, bounds: Mapping[str, float], search: bool
    ) -> tuple[list[Array], bool]:
        """Return equilibria found without a search, and whether these are all."""
        if not self.unknowns:
            states = self._whole(value) if self._conditions_hold(value) else []
            found = self._polished(value, states)
            return found, bool(found) or self._excluded(value, states)
        if self._undetermined or self.impossible:
            return [], True
        if not self.isolated or (search and len(self.unknowns) > 1):
            return [], False
        return self._isolated(value, bounds)

    def _isolated(self, value: float, bounds: Mapping[str, float]) -> tuple[list[Array], bool]:
        """Return all solutions of the system, and whether none is missing or unresolved."""
        names = [str(x) for x in self.unknowns]
        try:
            terms = self._terms_at(value)
        except (ArithmeticError, ValueError, TypeError):
            return [], False
        solved = solve_polynomials(
            terms,
            bounds={m: bounds[name] for m, name in enumerate(names) if name in bounds},
        )
        found: list[Array] = []
        complete = solved.complete
        middles = solved.clusters.mean(axis=1)
        if len(terms) == 1:
            middles = np.array([[multiple_root(terms[0], *m)] for m in middles]).reshape(-1, 1)
        for sure, roots in ((True, solved.simple), (False, middles)):
            for root in roots:
                states = self._whole(value, *root)
                solutions = self._polished(value, states, proved=sure)
                # other solutions are zeros of a denominator, or two-folds
                complete &= bool(solutions) or (sure and self._excluded(value, states))
                for one in solutions:
                    near = [o for o in found if self.same(one, o, value)]
                    if not near:
                        found.append(one)
                    elif sure:
                        # two simple solutions, too close to each other for equilibria
                        complete = False
        return found, complete

    def _excluded(self, value: float, states: Sequence[Array]) -> bool:
        """Return whether states, solutions of the equations, are known to be no equilibria."""
        return all(
            np.isfinite(state).all()
            and (self._on_pole(state, value) or self._at_two_fold(state, value))
            for state in states
        )

    def _on_pole(self, state: Array, value: float) -> bool:
        """Return whether the rates have a pole at a state, up to rounding of the state.

        Zeros of the numerators on a pole are not equilibria of the rates.
        """
        natural = self._natural(value)
        _, slopes = self.field.residual_and_jacobian(self.region, np.append(state, value))
        with np.errstate(all="ignore"):
            terms = np.abs(slopes[:, :-1]) @ np.abs(state)
        if np.isfinite(terms).all():
            return bool(np.any(np.finfo(float).eps * terms > POLE * natural))
        # exactly on a pole, or the powers overflow
        try:
            with mpmath.workdps(IRRATIONAL_DIGITS):
                sizes = [abs(rate) for rate in self._rates(value, *state)]
        except ZeroDivisionError:
            return True
        except (ArithmeticError, ValueError, TypeError):
            return False
        return any(
            bool(mpmath.isinf(size)) or 0 < unit < POLE * size
            for size, unit in zip(sizes, natural, strict=True)
        )

    def continuum(self, value: float) -> bool:
        """Return whether the equilibria of the region at this value form a continuum."""
        return self._undetermined and not self.impossible and self._conditions_hold(value)

    def _conditions_hold(self, value: float) -> bool:
        """Return whether equations in the parameter alone are satisfied up to rounding.

        The terms are evaluated at the natural unit of the parameter if its value is smaller.
        """
        p = real(self.field.parameter)
        largest = max(abs(value), self._parameter_unit(0.0))
        if self.polynomials is not None:
            for q in self.polynomials:
                over: IntegerTerms = {e[-1:]: c for e, c in q.items()}
                moduli: IntegerTerms = {e: abs(c) for e, c in over.items()}
                (total,) = values_at([over], [at := decimal(value)])
                (size,) = values_at([moduli], [far := decimal(largest)])
                # both are integers, in units of a power of a denominator
                most = max((k for (k,) in over), default=0)
                left = Fraction(abs(total), at.denominator**most)
                if left > Fraction(SATISFIED_CONDITION) * Fraction(size, far.denominator**most):
                    return False
            return True
        for e in self.elimination.remaining:
            parts = sp.Add.make_args(sp.expand(e))
            terms = sum(abs(float(part.subs(p, largest))) for part in parts)
            if abs(float(e.subs(p, value))) > SATISFIED_CONDITION * terms:
                return False
        return True

    def continua(self) -> list[float]:
        """Return parameter values at which the equilibria of the region form a continuum."""
        if self.polynomials is None or not (self._undetermined or self.univariate):
            return []
        forms = list(self.polynomials)
        if not self._undetermined:
            (polynomial,) = forms
            degrees = {e[0] for e in polynomial}
            forms = [{(k,): c for (i, k), c in polynomial.items() if i == j} for j in degrees]
        if any(len(form) == 1 and not next(iter(form))[-1] for form in forms):
            # a non-zero number
            return []
        common = _RING.zero
        for form in forms:
            over = {(e[-1],): ZZ(c) for e, c in form.items()}
            common = common.gcd(_RING.from_dict(over))
        highest = common.degree() if common else -1
        return real_roots(ratios([int(common.get((k,), 0)) for k in range(highest, -1, -1)]))

    def edges(self, value: float) -> list[Array]:
        """Return the points of a one-parameter continuum on an interface, or its middle."""
        if len(self.unknowns) != 1:
            return self._representable(value, *([0.0] * len(self.unknowns)))
        ends = []
        for line in self._lines(value):
            degree = max((e for (e,) in line), default=0)
            if degree > 0:
                roots = real_roots(ratios([line.get((k,), 0) for k in range(degree, -1, -1)]))
                ends += [s for root in roots for s in self._representable(value, root)]
        return ends or self._representable(value, 0.0)

    def _representable(self, value: float, *unknowns: float) -> list[Array]:
        """Return the full state at values of the unknowns, if it is in the domain and a number."""
        return [s for s in self._whole(value, *unknowns) if np.isfinite(s).all()]

    def _lines(self, value: float) -> Iterator[Terms]:
        """Yield the `bounds` at equilibria at a value, if they are polynomials in the unknown."""
        if self.edge_polynomials is not None:
            yield from (at_value(q, 1, decimal(value)) for q in self.edge_polynomials)
            return
        p = real(self.field.parameter)
        solved = {real(n): e for n, e in self.elimination.solved.items()}
        for bound in self.bounds:
            line = numerator(bound.subs(solved).subs(p, exact(value)))
            yield from terms_of([line], list(self.unknowns)) or []

    def _polished(
        self, value: float, states: Sequence[Array], *, proved: bool = False
    ) -> list[Array]:
        """Refine states by Newton's method at a fixed parameter; discard those that diverge."""
        finite = (state for state in states if np.isfinite(state).all())
        solved = (self.corrected(state, value, proved=proved) for state in finite)
        return [self.field.wrapped(one) for one in solved if one is not None]

    def same(self, one: Array, other: Array, value: float) -> bool:
        """Return whether two states are equal up to the accuracy of a double root."""
        return same(one, other, self.unit(value), self.field.periods)

    def _searched(
        self, value: float, known: Sequence[Array], bounds: Mapping[str, float] | None
    ) -> list[Array]:
        """Search by Newton's method from many states, until it finds no more or takes too long.

        The starting points are a fixed sequence over several scales in natural units, then in
        units of the equilibria found. From a third of them the steps are damped, and half of these
        are positive, spaced logarithmically for each state: steep saturating rates, such as Hill
        functions of high order, make undamped iterations cycle between their two levels. While
        more are found, half of the next starting points combine components of different
        equilibria: many equilibria are often nearly a Cartesian product of few values. The scales
        and the equilibria are within the bounds.
        """
        field, n = self.field, self.field.n
        most = np.array([(bounds or {}).get(name, np.inf) for name in field.model.states])
        unit = np.minimum(self.unit(value), most)
        count = starts_tried(n)
        generator = np.random.default_rng(20231)
        distinct = np.reshape([np.asarray(k) for k in known], (-1, n))
        quiet = 0
        for batch in range(max(2, min(BATCHES, int(COST / n**3) // count))):
            before = len(distinct)
            spread = 10.0 ** generator.uniform(-2, 1.5, (count, 1))
            # also with the individual size of each state
            spread = np.where(
                np.arange(count)[:, None] % 2,
                spread,
                10.0 ** generator.uniform(-3, 3, (count, n)),
            )
            starts = np.vstack([np.zeros(n), unit * generator.standard_normal((count, n)) * spread])
            if batch > 1:
                rows = generator.integers(0, before, (count // 2, n))
                nearby = 1.0 + 0.1 * generator.standard_normal(rows.shape)
                starts[1::2] = nearby * distinct[rows, np.arange(n)]
            # with damped steps, half of them in the positive orthant
            signs = generator.choice([-1.0, 1.0], (count // 2, n))
            signs[::2] = 1.0
            sizes = 10.0 ** generator.uniform(*DECADES, signs.shape)
            starts = np.vstack([starts, unit * signs * sizes])
            damped = np.arange(len(starts)) > count
            converged = np.empty(len(starts), dtype=np.bool_)
            space = newton_space(n, field.compiled.size)
            for s in blocks(len(starts), 100 * (16 * field.compiled.size + n**3)):
                loop("newton_from")(
                    CompiledCurve(field.compiled.address, self.region, field.values), starts[s],
                    damped[s], converged[s], value, unit, 100, space,
                )  # fmt: skip
            found = field.wrapped(starts[converged])
            found = found[(np.abs(found) <= np.minimum(FARTHEST * unit, most)).all(axis=1)]
            old = _near(found[:, None], distinct, unit, 1e-5, field.periods).any(axis=1)
            for state in found[~old]:
                if not among(state, distinct[before:], unit, field.periods, 1e-5):
                    polished = self.corrected(state, value)
                    polished = None if polished is None else field.wrapped(polished)
                    if (
                        polished is not None
                        and not among(polished, distinct, self.unit(value), field.periods)
                        and not self.by_rounding(polished, value)
                    ):
                        distinct = np.vstack([distinct, polished])
            quiet = quiet + 1 if batch and len(distinct) == before else 0
            if quiet > len(distinct) / FEW or len(distinct) > MANY:
                break
            # again in units of the equilibria found
            sizes = np.abs(distinct).max(axis=0, initial=0.0)
            unit = np.where(sizes > 0, sizes, unit)
        return [distinct[k] for k in in_order(distinct, unit)]


def _solutions_at_most(equations: Sequence[sp.Expr], unknowns: Sequence[sp.Symbol]) -> int | None:
    """Return Bézout's bound, the product of the degrees; None without polynomials."""
    if not all(e.is_polynomial(*unknowns) for e in equations):
        return None
    return math.prod(sp.Poly(e, *unknowns).total_degree() for e in equations)


def starts_tried(states: int) -> int:
    """Return the number of starting points of Newton's method, smaller for many states.

    Examples
    --------
    >>> starts_tried(60), starts_tried(200), starts_tried(1000)
    (200, 20, 10)
    """
    return min(NEWTON_STARTS, max(FEWEST, int(COST / states**3)))


@dataclass(frozen=True, eq=False)
class FactorEquations(RegionEquations):
    """Equations of a region for one factor of each rate.

    Parameters
    ----------
    chosen : tuple of Expr
        Factor of the rate of each state.
    lowered : tuple of Expr
        Equivalent equations of lower degree.
    """

    chosen: tuple[sp.Expr, ...]
    lowered: tuple[sp.Expr, ...]

    @cached_property
    def equations(self) -> dict[str, sp.Expr]:
        return dict(zip(self.field.model.states, self.lowered, strict=True))

    @cached_property
    def general(self) -> None:
        return None

    @cached_property
    def factors(self) -> tuple[FactorEquations, ...]:
        return ()

    @cached_property
    def elimination(self) -> Elimination:
        """Elimination; a single equation is solved for a state wherever its slope is not zero."""
        found = self._linear or self._eliminated()
        if len(found.unknowns) < 2 or not found.remaining:
            return found
        equation = found.remaining[0]
        # rates may share the factor
        if not all(vanishes(e - equation) or vanishes(e + equation) for e in found.remaining):
            return found
        for state in found.unknowns:
            slope = equation.diff(state)
            if slope != 0 and not slope.has(*found.unknowns):
                value = sp.expand(-equation.subs(state, 0) / slope)
                solved = {n: e.subs(state, value) for n, e in found.solved.items()}
                left = tuple(u for u in found.unknowns if u != state)
                known = NamedMapping("solved state", solved | {state.name: value})
                return Elimination((), left, known, (*found.divisors, slope))
        return found


def _finite(equations: RegionEquations) -> bool:
    """Return whether the solutions can be isolated, or are a continuum in closed form."""
    known = equations.impossible or not equations.unknowns or equations.isolated
    return known or equations.free


def state_factors(rate: sp.Expr, states: Sequence[sp.Symbol]) -> list[sp.Expr]:
    """Return the states that are factors of a rate, and the remaining factor.

    Examples
    --------
    >>> x, y = sp.symbols("x y")
    >>> state_factors(x * (1 - x) - 2 * x * y, (x, y))
    [x, -x - 2*y + 1]
    """
    bases = [f.as_base_exp() for f in sp.Mul.make_args(sp.factor_terms(rate))]
    found = [b for b, e in bases if b in states and e.is_positive]
    rest = sp.Mul(*(b**e for b, e in bases if b not in found))
    return [*found, rest] if rest.has(*states) or not found else found


def _near(
    one: Array, others: Array, unit: Array, within: float, periods: ArrayLike
) -> NDArray[np.bool_]:
    """Return whether states, shape (..., n), agree with one modulo periods.

    Relative to each component of the one, or to its unit.
    """
    gap = np.abs(apart(one, others, periods))
    return np.asarray(np.all(gap <= within * np.maximum(unit, np.abs(one)), axis=-1))


def among(
    state: Array,
    known: Array,
    unit: ArrayLike = 1.0,
    periods: ArrayLike = 0.0,
    within: float = SAME_STATE,
) -> bool:
    """Return whether a state is among known ones, shape (m, n), relative to its size."""
    return bool(_near(state, known, np.asarray(unit), within, periods).any())


def same(one: Array, other: Array, unit: ArrayLike = 1.0, periods: ArrayLike = 0.0) -> bool:
    """Return whether two states agree modulo periods, to the accuracy of a double root."""
    return bool(_near(one, other, np.asarray(unit), SAME_STATE, periods))
