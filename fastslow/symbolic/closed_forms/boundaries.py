"""Boundary equilibria in closed form, with the Clarke path of their Jacobians."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import sympy as sp
from sympy.logic.boolalg import Boolean

from fastslow.model.structure import real
from fastslow.results.base.display import Displayed
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.results.point_types import NON_SMOOTH_FOLD
from fastslow.results.stored.switch_state_names import CHANGES
from fastslow.symbolic.algebra import (
    adjugate,
    determinant,
    expanded_form,
    longer,
    rational_form,
    undefined,
)
from fastslow.symbolic.closed_forms.critical import RegionContext
from fastslow.symbolic.closed_forms.stability import jacobian
from fastslow.symbolic.signs.inequalities import conjunction, implied
from fastslow.symbolic.signs.signs import Signs
from fastslow.symbolic.solving.candidates import Candidates, solve_conditions
from fastslow.symbolic.solving.location import short_form
from fastslow.symbolic.solving.solution_families import SolutionFamily, families
from fastslow.symbolic.solving.univariate import Root, roots, solved_for
from fastslow.symbolic.solving.verification import OPEN, checked

#: Equations with more nodes are solved for the first parameter only.
LONG_BOUNDARY = 120

#: Types of boundary equilibria by the sign of their test.
TYPES = {1: "persistence", -1: NON_SMOOTH_FOLD, 0: "degenerate"}


@dataclass(frozen=True)
class ClarkeForm(Displayed):
    """Clarke path q J₁ + (1 − q) J₂ between the Jacobians on both sides, in closed form.

    Leine and Nijmeijer (2004); di Bernardo, Budd, Champneys, Kowalczyk (2008).

    Parameters
    ----------
    regions : tuple of str
        The regions of q = 1 and q = 0. The interface function is positive in the first one; if
        one Jacobian is singular, the first region is the other one.
    weight : Symbol
        q.
    jacobians : tuple of sympy.Matrix, each of shape (n, n)
    determinant, trace : sympy.Expr
        Determinant and trace along the path.
    determinants : tuple of sympy.Expr
        Determinants of J₁ and J₂.
    q_zero : sympy.Expr or None
        Zero of the determinant on the line through J₁ and J₂; in (0, 1) if and only
        if the point is a non-smooth fold.
    q_hopf : sympy.Expr or None
        Planar systems: zero of the trace, unless both ends have traces of one sign.
    q_complex : tuple of sympy.Expr
        Planar systems: transitions between real and complex eigenvalues.
    """

    regions: tuple[str, str]
    weight: sp.Symbol
    jacobians: tuple[sp.ImmutableDenseMatrix, sp.ImmutableDenseMatrix]
    determinant: sp.Expr
    trace: sp.Expr
    determinants: tuple[sp.Expr, sp.Expr]
    q_zero: sp.Expr | None
    q_hopf: sp.Expr | None
    q_complex: tuple[sp.Expr, ...]

    @property
    def matrix(self) -> sp.ImmutableDenseMatrix:
        """The matrix q J₁ + (1 − q) J₂, shape (n, n)."""
        first, second = self.jacobians
        return sp.ImmutableDenseMatrix(
            (self.weight * first + (1 - self.weight) * second).applyfunc(sp.expand)
        )


@dataclass(frozen=True)
class BoundaryForm(Displayed):
    """An equilibrium on an interface or the wall of a reset, in closed form.

    Parameters
    ----------
    interface : str
    regions : tuple of str
        The adjacent regions; in a Filippov system the rates of the first vanish. At a wall the
        region and the motion held against the wall.
    state, parameters : NamedMapping of sympy.Expr
    equations : tuple of sympy.Expr
        Remaining equations, = 0; empty if the closed form is complete.
    type : str
        ``"persistence"``, ``"non-smooth fold"``, ``"degenerate"``, or ``"depends"``; where a branch
        ends, ``"switch"`` at the threshold of a switch, and ``"reset"`` at one that holds nothing.
    test : sympy.Expr
        Positive for persistence, negative for a non-smooth fold: det J₁ det J₂,
        or −CᵀN⁻¹E in a Filippov system, or −CᵀJ⁻¹W at a wall. The
        determinants are not evaluated if long equations remain.
    continuous : bool
        True if the rates are continuous across the interface; False at a wall.
    clarke : ClarkeForm or None
        For a continuous vector field, unless long equations remain.
    singular : NamedMapping
        Region to the condition on one parameter for a singular Jacobian, where a fold
        of that region is on the interface.
    admissible : Boolean
        Condition for the point to be on the common boundary of the regions.
    possible : bool or None
    check : str
        Method by which vanishing rates and switching function were verified; empty if
        equations remain.
    """

    interface: str
    regions: tuple[str, ...]
    state: NamedMapping[sp.Expr]
    parameters: NamedMapping[sp.Expr]
    equations: tuple[sp.Expr, ...]
    type: str
    test: sp.Expr
    continuous: bool
    clarke: ClarkeForm | None
    singular: NamedMapping[Boolean]
    admissible: Boolean
    possible: bool | None
    check: str

    @property
    def verified(self) -> bool:
        """True if the closed form is complete and verified to satisfy its equations."""
        return bool(self.check)


def boundary_forms(
    interface: str,
    function: sp.Expr,
    sides: tuple[RegionContext, RegionContext],
    continuous: bool,
) -> list[BoundaryForm]:
    """Return all boundary equilibria on an interface between two regions.

    Parameters
    ----------
    interface : str
    function : sympy.Expr
        h, with exact coefficients.
    sides : tuple of RegionContext
        The regions where h > 0 and where h < 0.
    continuous : bool
        If the vector field is continuous, one side suffices; else each side has its own.
    """
    found: list[BoundaryForm] = []
    for own, other in (sides,) if continuous else (sides, sides[::-1]):
        for place in _places(function, own):
            outward = function if own is sides[0] else -function
            jump = [other.rates[n] - own.rates[n] for n in own.states]
            found.append(_form(interface, outward, own, other, continuous, place, jump))
    return [f for f in found if f.admissible != sp.false]


def wall_forms(
    wall: str,
    function: sp.Expr,
    free: RegionContext,
    held: RegionContext,
    push: Sequence[sp.Expr],
) -> list[BoundaryForm]:
    """Return all boundary equilibria at a wall, where the contact force vanishes.

    With the Jacobian J of the free motion, C = ∇H and W pushing away from the wall, CᵀJ⁻¹W < 0
    is persistence and CᵀJ⁻¹W > 0 a non-smooth fold (cf. di Bernardo, Nordmark and Olivar 2008).

    Parameters
    ----------
    wall : str
    function : sympy.Expr
        H, positive on the admissible side.
    free, held : RegionContext
        Motions without and with contact.
    push : sequence of sympy.Expr
        W.
    """
    places = _places(function, free)
    found = [_form(wall, function, free, held, False, place, push) for place in places]
    return [f for f in found if f.admissible != sp.false]


def end_forms(surface: str, function: sp.Expr, own: RegionContext) -> list[BoundaryForm]:
    """Return all boundary equilibria at a threshold at which the branch of a region ends.

    Parameters
    ----------
    surface : str
    function : sympy.Expr
        Positive on the admissible side.
    own : RegionContext
    """
    still = [sp.S.Zero] * len(own.states)
    places = _places(function, own)
    found = [_form(surface, function, own, own, False, place, still) for place in places]
    type_ = "switch" if CHANGES in surface else "reset"
    return [
        replace(f, regions=(own.region,), type=type_) for f in found if f.admissible != sp.false
    ]


@dataclass(frozen=True)
class _Place:
    """Values of states and parameters, nonnegative radicands, and remaining equations."""

    values: dict[sp.Symbol, sp.Expr]
    radicands: tuple[sp.Expr, ...]
    left: tuple[sp.Expr, ...]


def _places(function: sp.Expr, own: RegionContext) -> list[_Place]:
    """Common zeros of the rates of a region and h, in states and parameters.

    One parameter is solved for, or more if the equations require it. Solutions that
    contradict the assumed signs are omitted.
    """
    used = set().union(function.free_symbols, *(r.free_symbols for r in own.rates.values()))
    best: list[_Place] = []
    tried = [c for c in own.candidates if c in used]
    if longer(function, LONG_BOUNDARY) or any(longer(r, LONG_BOUNDARY) for r in own.rates.values()):
        tried = tried[:1]
    for parameter in tried:
        names = (*own.states, parameter.name)
        signs = own.signs.without(parameter)
        others = own.candidates.without(parameter)
        result = []
        equations = {**own.rates, parameter.name: function}
        for family in families(equations, names, signs, others, populations=False):
            result += _solutions(family, names, own, others)
        result = [p for p in result if not _contradicts(p, own.signs)]
        if result and not any(p.left for p in result):
            return result
        best = best or result
    return best


def _contradicts(place: _Place, signs: Signs) -> bool:
    """Check whether the assumed signs of parameters exclude a solution."""
    for symbol, value in place.values.items():
        side = signs.known.get(symbol)
        if side is not None and symbol != value and signs.sign(side * value) in (0, -1):
            return True
    return any(signs.nonzero(e) for e in place.left) or any(
        signs.sign(e) == -1 for e in place.radicands
    )


def _solutions(
    family: SolutionFamily, names: tuple[str, ...], own: RegionContext, others: Candidates
) -> list[_Place]:
    unknown = family.unknown
    options: list[Root | None] = list(family.roots) if family.roots is not None else [None]
    found = []
    for root in options:
        inner = {unknown: root.value} if root is not None and unknown is not None else {}
        state = family.elimination.state(inner, names)
        left = () if root is not None else family.equations
        under = root.radicands if root is not None else ()
        for place, radicands, rest in solve_conditions(family.condition, others, own.signs):
            values = {
                real(n): short_form(e.subs(place)) for n, e in zip(names, state, strict=True)
            } | place
            if any(undefined(e) for e in values.values()):
                continue
            found.append(
                _Place(
                    values,
                    (*(e.subs(place) for e in under), *radicands),
                    (*(e.subs(place) for e in left), *rest),
                )
            )
    return found


def _form(
    interface: str,
    outward: sp.Expr,
    own: RegionContext,
    other: RegionContext,
    continuous: bool,
    found: _Place,
    jump: Sequence[sp.Expr],
) -> BoundaryForm:
    place, left = found.values, found.left
    if continuous and any(longer(e, LONG_BOUNDARY) for e in left):
        return _implicit(interface, own, other, found)
    states = [real(n) for n in own.states]
    names = (own.region, other.region)
    matrices = [_at(jacobian(s.rates, s.states), place) for s in (own, other)]
    determinants = [rational_form(determinant(m)) for m in matrices]
    if continuous and determinants[0] == 0 and determinants[1] != 0:
        # q = 1 is the nonsingular side
        names, matrices, determinants = names[::-1], matrices[::-1], determinants[::-1]
    if continuous:
        test = short_form(determinants[0] * determinants[1])
        clarke = _clarke(names, matrices, determinants, own)
    else:
        gradient = sp.Matrix([[rational_form(outward.diff(s).subs(place)) for s in states]])
        column = sp.Matrix([rational_form(e.xreplace(place)) for e in jump])
        inverse = adjugate(matrices[0])
        slope = (gradient * inverse * column)[0, 0]
        test = sp.S.Zero if determinants[0] == 0 else short_form(-slope / determinants[0])
        clarke = None
    sign = own.signs.sign(test)
    inside = [rational_form(e.xreplace(place)) for e in own.inside]
    inside = [e for e in inside if e != 0 and not _among(e, left)]
    admissible = conjunction(
        (own.all_nonnegative(found.radicands), own.all_positive(inside)), own.signs
    )
    zeros = [*own.rates.values(), outward]
    if continuous:
        zeros += other.rates.values()
    return BoundaryForm(
        interface=interface,
        regions=names,
        state=NamedMapping("state", {s.name: place[s] for s in states}),
        parameters=NamedMapping(
            "parameter", {s.name: e for s, e in place.items() if s not in states}
        ),
        equations=left,
        type="depends" if sign is None else TYPES[sign],
        test=test,
        continuous=continuous,
        clarke=clarke,
        singular=_singular(names, determinants, own),
        admissible=admissible,
        possible=implied(admissible, own.signs),
        check=OPEN if left else checked(zeros, place, own.signs),
    )


def _implicit(
    interface: str, own: RegionContext, other: RegionContext, found: _Place
) -> BoundaryForm:
    """Boundary equilibrium with long remaining equations, without expansion."""
    states = [real(n) for n in own.states]
    first, second = (
        sp.ImmutableDenseMatrix(
            [[s.rates[n].diff(x).xreplace(found.values) for x in states] for n in s.states]
        )
        for s in (own, other)
    )
    inside = [sp.sympify(e.xreplace(found.values)) for e in own.inside]
    left = [e for e in inside if e != 0 and not _among(e, found.left)]
    conditions = [sp.Gt(e, 0) for e in left] + [sp.Ge(e, 0) for e in found.radicands]
    return BoundaryForm(
        interface=interface,
        regions=(own.region, other.region),
        state=NamedMapping("state", {s.name: found.values[s] for s in states}),
        parameters=NamedMapping(
            "parameter", {s.name: e for s, e in found.values.items() if s not in states}
        ),
        equations=found.left,
        type="depends",
        test=sp.Determinant(first) * sp.Determinant(second),
        continuous=True,
        clarke=None,
        singular=NamedMapping("region", {}),
        admissible=sp.And(*conditions),
        possible=None,
        check=OPEN,
    )


def _among(expression: sp.Expr, equations: tuple[sp.Expr, ...]) -> bool:
    """Check whether an expression or its negative is one of the equations, up to expansion."""
    both = (expanded_form(expression), expanded_form(-expression))
    return any(expanded_form(e) in both for e in equations)


def _at(
    matrix: sp.ImmutableDenseMatrix, place: Mapping[sp.Symbol, sp.Expr]
) -> sp.ImmutableDenseMatrix:
    here = matrix.applyfunc(lambda e: rational_form(e.xreplace(place)))
    return sp.ImmutableDenseMatrix(here)


def _singular(
    names: tuple[str, str], determinants: list[sp.Expr], own: RegionContext
) -> NamedMapping[Boolean]:
    conditions: dict[str, Boolean] = {}
    order = sorted(own.candidates, key=lambda c: c in own.geometry)
    for name, value in zip(names, determinants, strict=True):
        if value == 0:
            conditions[name] = sp.true
        elif value.is_number:
            conditions[name] = sp.false
        else:
            solved = solved_for(value, order, own.signs)
            conditions[name] = sp.Eq(value, 0) if solved is None else sp.Eq(solved[0], solved[1])
    return NamedMapping("region", conditions)


def _weight(taken: Collection[str]) -> sp.Symbol:
    """Symbol of the Clarke weight, q unless the model uses that name.

    Examples
    --------
    >>> _weight({"x"}), _weight({"q", "q_c"})
    (q, q_1)
    """
    others = (f"q_{k}" for k in itertools.count(1))
    return real(next(n for n in itertools.chain(("q", "q_c"), others) if n not in taken))


def _clarke(
    names: tuple[str, str],
    matrices: list[sp.ImmutableDenseMatrix],
    determinants: list[sp.Expr],
    own: RegionContext,
) -> ClarkeForm:
    first, second = matrices
    weight = _weight({*own.states, *(c.name for c in own.candidates)})
    path = (weight * first + (1 - weight) * second).applyfunc(sp.expand)
    one, two = determinants
    # the jump of the Jacobian has rank one, so that the determinant is affine in q
    along = short_form(weight * one + (1 - weight) * two)
    trace = expanded_form(path.trace())
    difference = rational_form(two - one)
    q_zero = (
        None
        if difference == 0 or one == 0 or two == 0
        else short_form(rational_form(two / difference))
    )
    q_hopf, q_complex = None, ()
    if first.rows == 2:
        slope = trace.diff(weight)
        ends = [own.signs.sign(expanded_form(m.trace())) for m in matrices]
        if slope != 0 and (None in ends or ends[0] != ends[1]):
            q_hopf = short_form(rational_form(-trace.subs(weight, 0) / slope))
        turning = expanded_form(trace**2 - 4 * along)
        if weight in turning.free_symbols:
            closed = roots(turning, weight, own.signs) or []
            q_complex = tuple(short_form(r.value) for r in closed)
    return ClarkeForm(
        regions=names,
        weight=weight,
        jacobians=(first, second),
        determinant=along,
        trace=trace,
        determinants=(one, two),
        q_zero=q_zero,
        q_hopf=q_hopf,
        q_complex=q_complex,
    )
