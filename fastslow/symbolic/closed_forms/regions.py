"""Equilibria, stability and bifurcations of one region in closed form."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import sympy as sp
from sympy.logic.boolalg import Boolean

from fastslow.model.structure import real
from fastslow.model.work import Budget, PastWorkError
from fastslow.results.base.display import Displayed
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.results.point_types import kind_of, point_name
from fastslow.symbolic.algebra import expanded_form, irrational, longer, rational_form
from fastslow.symbolic.closed_forms.boundaries import BoundaryForm
from fastslow.symbolic.closed_forms.critical import (
    RegionContext,
    cusps,
    folds,
    hopf_points,
    state_at,
)
from fastslow.symbolic.closed_forms.forms import Continuum, CriticalPoint, EquilibriumForm
from fastslow.symbolic.closed_forms.stability import (
    EIGENVALUE,
    Stability,
    expressions_of_matrix,
    jacobian,
    stability_of_matrix,
    stability_of_tests,
)
from fastslow.symbolic.signs.inequalities import (
    above_zero,
    bounds,
    conjunction,
    implied,
    isolated,
    nonnegative,
    positive,
    sign_within,
)
from fastslow.symbolic.signs.signs import Signs
from fastslow.symbolic.solving.candidates import solve_conditions
from fastslow.symbolic.solving.location import short_form
from fastslow.symbolic.solving.solution_families import SolutionFamily, families
from fastslow.symbolic.solving.univariate import Root, roots
from fastslow.symbolic.solving.verification import OPEN, checked, weakest

#: Budget of work of the stability, of the folds, of the cusps and of the Hopf points of one family.
PART_WORK = 100_000

#: Routh-Hurwitz expressions with more nodes at an explicit state are recomputed there.
LONG_HURWITZ = 600

#: Largest number of symbols for which this is faster.
FEW_SYMBOLS = 3


@dataclass(frozen=True, repr=False)
class RegionForms(Displayed):
    """Equilibria, stability and bifurcations of one region in closed form.

    Parameters
    ----------
    name : str
    conditions : tuple of Boolean
        Inequalities that define the region, without those implied by the others
        under the assumptions.
    rates : NamedMapping of sympy.Expr
    equations : tuple of sympy.Expr
        Equations after elimination, family by family, = 0.
    equilibria : tuple of EquilibriumForm
    continua : tuple of Continuum
    jacobian : sympy.Matrix, shape (n, n)
    stability : Stability
        Stability of the Jacobian as a function of the states.
    folds, branch_points, cusps, hopf : tuple of CriticalPoint
    no_hopf : str
        Proof that there is no Hopf point; empty if there is none.
    boundary_equilibria : tuple of BoundaryForm
        Equilibria on the boundary of this region.
    notes : tuple of str
        Forms that remain implicit, with the reason.
    """

    name: str
    conditions: tuple[Boolean, ...]
    rates: NamedMapping[sp.Expr]
    equations: tuple[sp.Expr, ...]
    equilibria: tuple[EquilibriumForm, ...]
    continua: tuple[Continuum, ...]
    jacobian: sp.ImmutableDenseMatrix
    stability: Stability
    folds: tuple[CriticalPoint, ...]
    branch_points: tuple[CriticalPoint, ...]
    cusps: tuple[CriticalPoint, ...]
    hopf: tuple[CriticalPoint, ...]
    no_hopf: str
    boundary_equilibria: tuple[BoundaryForm, ...]
    notes: tuple[str, ...]

    @property
    def trace(self) -> sp.Expr:
        """Trace of the Jacobian."""
        return self.stability.trace

    @property
    def determinant(self) -> sp.Expr:
        """Determinant of the Jacobian."""
        return self.stability.determinant

    @property
    def characteristic_polynomial(self) -> sp.Expr:
        """Characteristic polynomial of the Jacobian, in λ."""
        return self.stability.characteristic_polynomial

    @property
    def routh_hurwitz(self) -> tuple[sp.Expr, ...]:
        """Expressions that are all positive iff an equilibrium is asymptotically stable."""
        return self.stability.routh_hurwitz

    @property
    def check(self) -> str:
        """Method by which all complete closed forms were verified, empty for none."""
        points = (*self.folds, *self.branch_points, *self.cusps, *self.hopf)
        checks = [e.check for e in self.equilibria]
        checks += [c.check for c in self.continua if not c.equations]
        return weakest([*checks, *(p.check for p in points if not p.equations)])

    @property
    def verified(self) -> bool:
        """True if every complete closed form is verified to satisfy its equations."""
        return bool(self.check)


def derive_region(context: RegionContext, boundary: tuple[BoundaryForm, ...]) -> RegionForms:
    """Derive the closed forms of one region.

    Parameters
    ----------
    context : RegionContext
    boundary : tuple of BoundaryForm
        Boundary equilibria on its interfaces.
    """
    signs = context.signs
    found = families(context.rates, context.states, signs, context.candidates)
    matrix = jacobian(context.rates, context.states)
    whole = stability_of_matrix(matrix, signs.sign, lambda e: isolated(e, signs, ()))
    isolated_ones = [f for f in found if not _continuous(f)]
    forms: list[EquilibriumForm] = []
    points: list[CriticalPoint] = []
    reasons: list[str] = []
    omitted: list[str] = []

    def within_part(what: str, compute: Callable[[], list[CriticalPoint]]) -> list[CriticalPoint]:
        try:
            with Budget(PART_WORK).spending():
                return compute()
        except PastWorkError:
            omitted.append(f"the {what} are past the budget of work and not derived")
            return []

    for family in isolated_ones:
        along = inner = whole
        try:
            with Budget(PART_WORK).spending():
                along = _blocks_along(family, whole, matrix)
                inner = _stability_along(family, along, context)
        except PastWorkError:
            omitted.append("the stability at equilibria is past the budget of work: not simplified")
        forms += _equilibria(family, inner, context)
        # another root of the same equation is the same family
        others = [f for f in isolated_ones if f.elimination is not family.elimination]
        points += within_part("folds", partial(folds, family, others, along, context))
        points += within_part("cusps", partial(cusps, family, context))
        reason = _no_hopf(inner)
        if reason:
            reasons.append(reason)
        else:
            points += within_part("Hopf points", partial(hopf_points, family, along, context))
    points = list(dict.fromkeys(points))
    no_hopf = reasons[0] if reasons and len(reasons) == len(isolated_ones) else ""
    if not isolated_ones:
        no_hopf = _no_hopf(whole)

    kinds = [(kind_of(p.code), p) for p in points]
    return RegionForms(
        name=context.region,
        conditions=region_conditions(context),
        rates=context.rates,
        equations=tuple(dict.fromkeys(e for f in found for e in (*f.equations, *f.condition))),
        equilibria=tuple(forms),
        continua=tuple(c for f in found if _continuous(f) for c in _continua(f, whole, context)),
        jacobian=matrix,
        stability=whole,
        folds=tuple(p for kind, p in kinds if kind.turning),
        branch_points=tuple(p for kind, p in kinds if kind.branching),
        cusps=tuple(p for kind, p in kinds if kind.codimension == 2),
        hopf=tuple(p for kind, p in kinds if kind.starts_cycles),
        no_hopf=no_hopf,
        boundary_equilibria=tuple(b for b in boundary if context.region in b.regions),
        notes=tuple(dict.fromkeys((*_notes(found, points, whole), *omitted))),
    )


def _notes(
    found: list[SolutionFamily], points: list[CriticalPoint], whole: Stability
) -> tuple[str, ...]:
    """Distinct notes on forms that remain implicit."""
    kept = [f.note for f in found if f.note]
    implicit = [point_name(p.code) for p in points if p.equations]
    sets = [f"the {name} set is given by its equations" for name in implicit]
    assumed = [f"{point_name(p.code)}: {p.note}" for p in points if p.note]
    return tuple(dict.fromkeys([*kept, *sets, *assumed, *whole.notes]))


def region_conditions(context: RegionContext) -> tuple[Boolean, ...]:
    """Return the region's inequalities without those implied by the others."""
    order = [*map(real, context.states), *context.candidates]
    found = []
    for expression, written in zip(context.inside, context.written, strict=True):
        condition = isolated(expression, context.signs, order)
        # an inequality that is not solved for a symbol is given as written
        as_it_is = condition.is_Relational and condition.rhs == 0
        shorter = written.count_ops() < expression.count_ops()
        found.append(above_zero(written) if as_it_is and shorter else condition)
    return tuple(found)


def _continuous(family: SolutionFamily) -> bool:
    return len(family.elimination.unknowns) > len(family.equations)


def _blocks_along(
    family: SolutionFamily, whole: Stability, matrix: sp.ImmutableDenseMatrix
) -> Stability:
    """Return the stability along a family, by the irreducible blocks of the Jacobian there.

    The Jacobian may be reducible because entries vanish along the family.
    """
    if len(family.elimination.unknowns) == matrix.rows or matrix.rows == 1:
        return whole
    if not family.elimination.unknowns and _past(family, whole):
        # shorter if the state is substituted before the determinants are formed
        there = matrix.applyfunc(family.reduced)
    else:
        there = matrix.applyfunc(lambda e: sp.S.Zero if e == 0 or family.reduced(e) == 0 else e)
    if there == matrix:
        return whole
    blocks, tests = expressions_of_matrix(there)
    return Stability(blocks, tests, (None,) * len(tests))


def _past(family: SolutionFamily, whole: Stability) -> bool:
    """Check whether a test is too long to be simplified at an equilibrium in few parameters."""
    place = {real(n): e for n, e in family.elimination.solved.items()}
    tests = [e.xreplace(place) for e in whole.routh_hurwitz]
    used = set().union(*(e.free_symbols for e in tests))
    return len(used) <= FEW_SYMBOLS and any(longer(e, LONG_HURWITZ) for e in tests)


def _stability_along(family: SolutionFamily, whole: Stability, context: RegionContext) -> Stability:
    """Return the stability of a family, with signs valid along it inside the region."""
    if len(family.elimination.unknowns) == len(context.states) > 1:
        # no state is solved for
        return whole
    unknown = family.unknown
    inside = [family.reduced(e) for e in context.inside]

    def sign(expression: sp.Expr) -> int | None:
        if unknown is None:
            return context.signs.with_positive(*_open(inside, context.signs)).sign(expression)
        return sign_within(expression, unknown, inside, context.signs)

    def condition(expression: sp.Expr) -> Boolean:
        if family.elimination.unknowns:
            return above_zero(expression)
        return positive(expression, context.signs, context.candidates)

    tests = tuple(family.reduced(e) for e in whole.routh_hurwitz)
    blocks = tuple(tuple(map(family.reduced, b)) for b in whole.blocks)
    return stability_of_tests(blocks, tests, sign, condition)


def _open(inside: list[sp.Expr], signs: Signs) -> list[sp.Expr]:
    return [e for e in inside if signs.sign(e) is None]


def _no_hopf(stability: Stability) -> str:
    """Reason why no eigenvalues of a family are imaginary inside the region, else empty."""
    if stability.dimension == 1:
        return "the only eigenvalue is real"
    reasons = []
    for one in stability.hopf_tests:
        coefficients = stability.routh_hurwitz[one.position :]
        side = stability.signs[one.position]
        if side in (1, -1) and one.size == 2:
            reasons.append(f"the trace is {expanded_form(-one.test)}, never zero in the region")
        elif side in (1, -1):
            reasons.append(f"the Hurwitz determinant {one.test} is never zero in the region")
        elif one.size == 2 and stability.signs[one.position + 1] == -1:
            reasons.append(f"the determinant {coefficients[1]} is negative in the region")
        else:
            return ""
    return "; ".join(reasons) or "all eigenvalues are real"


def _equilibria(
    family: SolutionFamily, inner: Stability, context: RegionContext
) -> list[EquilibriumForm]:
    """One form for each root in closed form, else one for the family."""
    if family.unknown is None:
        return [_form(family, None, inner, context)]
    if family.roots is None or (family.curve is not None and not _short(family)):
        return [_form(family, None, inner, context)]
    return [_form(family, root, inner, context) for root in family.roots]


def _short(family: SolutionFamily) -> bool:
    """Check that the equation of a family is at most quadratic in its unknown."""
    unknown = family.unknown
    (equation,) = family.equations
    return unknown is not None and bool(sp.degree(equation, unknown) <= 2)


def _form(
    family: SolutionFamily, root: Root | None, inner: Stability, context: RegionContext
) -> EquilibriumForm:
    unknown, signs = family.unknown, context.signs
    place = {} if root is None or unknown is None else {unknown: root.value}
    state = state_at(family, context, place)
    curve = {} if family.parameter is None else {family.parameter: family.curve}
    explicit = root is not None or not family.elimination.unknowns
    values = {real(n): e for n, e in state.items()}
    if explicit:
        exists = context.all_nonnegative(root.radicands) if root is not None else sp.true
        inside = [rational_form(e.xreplace(values)) for e in context.inside]
        admissible = conjunction((exists, context.all_positive(inside)), signs)
        check = checked(context.rates.values(), values, signs)
        stability = _at(inner, place, context, inside) if place else inner
        possible = implied(admissible, signs)
    else:
        stability, possible = inner, None
        inside = [family.reduced(e) for e in context.inside]
        order = [*family.elimination.unknowns, *context.candidates]
        exists = sp.And(*(nonnegative(e, signs, order) for e in family.radicands))
        admissible = conjunction((exists, *(_inside(e, signs, order) for e in inside)), signs)
        curve_at = {s: e for s, e in curve.items() if e is not None}
        equations = () if curve_at else family.equations
        unknowns = family.elimination.unknowns
        # a state may depend on the slow parameter, which is a function on the curve
        place = {**{n: e.xreplace(curve_at) for n, e in values.items()}, **curve_at}
        check = checked(context.rates.values(), place, signs, equations, unknowns)
    kind = "explicit" if explicit else "curve" if family.curve is not None else "implicit"
    return EquilibriumForm(
        region=context.region,
        type=kind,
        state=state,
        unknowns=() if explicit else family.elimination.unknowns,
        equations=() if explicit else family.equations,
        parameters=NamedMapping(
            "parameter", {s.name: e for s, e in curve.items() if e is not None and not explicit}
        ),
        exists=exists,
        admissible=admissible,
        possible=possible,
        parameter_range=None if explicit else _range(family, inside, context),
        stability=stability,
        discriminant=family.discriminant,
        check=check,
        note=family.note,
        conditions=family.condition,
    )


def _inside(expression: sp.Expr, signs: Signs, order: Sequence[sp.Symbol]) -> Boolean:
    """Condition for an expression along a curve to be positive."""
    return (isolated if irrational(expression) else positive)(expression, signs, order)


def _at(
    inner: Stability, place: dict[sp.Symbol, sp.Expr], context: RegionContext, inside: list[sp.Expr]
) -> Stability:
    """Stability at a root in closed form, with the signs valid along the family."""
    known = context.signs.with_positive(*_open(inside, context.signs))
    tests = tuple(rational_form(e.subs(place)) for e in inner.routh_hurwitz)
    settled = {e: s for e, s in zip(tests, inner.signs, strict=True) if s is not None}
    return stability_of_tests(
        tuple(tuple(rational_form(a.subs(place)) for a in b) for b in inner.blocks),
        tests,
        lambda e: settled[e] if e in settled else known.sign(e),
        lambda e: positive(e, context.signs, context.candidates),
    )


def _range(family: SolutionFamily, inside: list[sp.Expr], context: RegionContext) -> Boolean | None:
    """Admissible parameter range of a curve that is monotone in its region."""
    unknown, curve, parameter = family.unknown, family.curve, family.parameter
    if unknown is None or curve is None or parameter is None or family.bent:
        return None
    rising = sign_within(rational_form(curve.diff(unknown)), unknown, inside, context.signs)
    if rising not in (1, -1):
        return None
    lower, upper = bounds(unknown, inside, context.signs)
    conditions = []
    for ends, above in ((lower, rising > 0), (upper, rising < 0)):
        for end in ends:
            level = short_form(curve.subs(unknown, end))
            conditions.append(parameter > level if above else parameter < level)
    return sp.And(*conditions) if conditions else None


def _continua(family: SolutionFamily, whole: Stability, context: RegionContext) -> list[Continuum]:
    """All continua of a family of non-isolated equilibria."""
    ways = solve_conditions(family.condition, context.candidates, context.signs)
    return [_continuum(family, whole, context, *way) for way in ways]


def _continuum(
    family: SolutionFamily,
    whole: Stability,
    context: RegionContext,
    place: dict[sp.Symbol, sp.Expr],
    radicands: tuple[sp.Expr, ...],
    left: tuple[sp.Expr, ...],
) -> Continuum:
    state = state_at(family, context, place)
    values = {**place, **{real(n): e for n, e in state.items()}}
    inside = tuple(rational_form(e.xreplace(values)) for e in context.inside)
    order = [*family.elimination.unknowns, *context.candidates]
    polynomial = rational_form(whole.characteristic_polynomial.xreplace(values))
    eigenvalues: list[sp.Expr] = []
    for factor, power in sp.factor_list(polynomial, EIGENVALUE)[1]:
        if factor.has(EIGENVALUE):
            closed = roots(factor, EIGENVALUE, context.signs)
            eigenvalues += [r.value for r in closed or () for _ in range(power)]
    equations = tuple(e.subs(place) for e in family.equations)
    conditions = [isolated(e, context.signs, order) for e in inside]
    check = OPEN
    if not left and not equations:
        check = checked(context.rates.values(), values, context.signs)
    return Continuum(
        context.region,
        family.elimination.unknowns,
        state,
        NamedMapping("parameter", {s.name: e for s, e in place.items()}),
        (*left, *equations),
        tuple(c for c in (*conditions, context.all_nonnegative(radicands)) if c != sp.true),
        tuple(eigenvalues),
        check,
    )
