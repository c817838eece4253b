"""Equilibria and special points, proved in ball arithmetic of any precision."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import instance, validated, whole
from fastslow.certification.equations import ExactEquations, exact_equations
from fastslow.certification.points.balls import ball_function, flint
from fastslow.certification.points.crossings import branch_points, unfolded
from fastslow.certification.points.defining import ON_DISCONTINUITY, SYSTEMS, defined
from fastslow.certification.points.regular_zeros import ProvedZero, UnprovedError, proved_zero
from fastslow.errors import ArgumentError, MissingPackageError, ModelError
from fastslow.model.model import Model
from fastslow.results.branch.diagram import Diagram
from fastslow.results.enclosures import Enclosure
from fastslow.results.point_types import BRANCH_POINT
from fastslow.results.points import SpecialPoint, SpecialPoints

Array = NDArray[np.float64]

#: Codes of the points that can be proved.
PROVABLE = (*SYSTEMS, BRANCH_POINT)

#: Digits of states and parameters unless given.
ENCLOSURE_DIGITS = 15

#: Bits beyond the digits for rounding, tried in turn, and of one digit.
MORE, PER_DIGIT = (32, 160, 800), math.log2(10)


@validated(model=instance(Model), point=instance(SpecialPoint), digits=whole(1, 10_000))
def prove(model: Model, point: SpecialPoint, *, digits: int = ENCLOSURE_DIGITS) -> SpecialPoint:
    """Prove that a special point of equilibria exists, to any number of digits.

    The Krawczyk operator of the defining system in ball arithmetic (python-flint, extra
    ``certified``) maps a box around the point into its interior: the point exists, it is the only
    one in the box, and its defining system is regular. Folds solve F = 0, F_x v = 0, c·v = 1;
    Hopf points F = 0, F_x (a + ib) = iω (a + ib), c·a = 1, c·b = 0; boundary equilibria F = 0,
    h = 0 (Kuznetsov 2004, section 10.2); points of codimension two similar systems in two
    parameters. Branch points are proved where one branch is in an invariant subspace
    (Crandall and Rabinowitz 1971), or a rate has two factors, and not otherwise. Floating-point
    numbers are the shortest decimals that are read as them.

    Parameters
    ----------
    model : Model
        The frozen model of the point.
    point : SpecialPoint
        Of code LP, HB, NSD, BE or BP; CP, BT, GH, ZH, HH, BF or BH of a curve of points.
    digits : int
        Number of digits of states and parameters.

    Returns
    -------
    SpecialPoint
        The point with its ``enclosure``.

    Raises
    ------
    ArgumentError
        For a point of another code or another model, or one that is not regular.
    ModelError
        For functions without ball arithmetic.
    MissingPackageError
        If python-flint is not installed.

    See Also
    --------
    fastslow.certify

    Examples
    --------
    >>> import sympy as sp, fastslow as fs
    >>> x, p = sp.symbols("x p")
    >>> model = fs.Model({x: p + x - x**3}, parameters={p: 0})
    >>> fold = fs.continue_equilibria(model, "p", (-1, 1)).folds[0]
    >>> fs.prove(model, fold, digits=30).enclosure["p"]
    '0.384900179459750509672765853668'
    """
    if point.code not in PROVABLE:
        raise ArgumentError(
            f"{point.label or 'the point'} has the code {point.code}; expected a point of code "
            f"{', '.join(PROVABLE)}"
        )
    return _with_enclosure(model, point, _free_parameters(model, point), digits)


def _require_states(model: Model, point: SpecialPoint) -> None:
    """Raise ArgumentError for a point with other states or without finite coordinates."""
    numbers = np.array([*point.state, *point.parameters.values()])
    if not np.isfinite(numbers).all():
        raise ArgumentError(f"{point.label or 'the point'} has coordinates that are not finite")
    if point.states != model.states:
        raise ArgumentError(
            f"the point has the states {', '.join(point.states)} and the model "
            f"{', '.join(model.states)}; expected a point of this model"
        )


def require_same_equations(what: str, equations: str, model: Model) -> None:
    """Raise ArgumentError if a diagram or point has other equations than a model, as text.

    Empty text, as of a diagram that was read from a file of AUTO-07p, is not compared.
    """
    if equations and equations != model.equations:
        one, own = (text.splitlines() for text in (equations, model.equations))
        other = next((line for line in one if line not in own), f"{len(one)} lines")
        raise ArgumentError(
            f"the {what} is of a model with other equations: received {other}; expected the "
            f"{what} of this model, {'; '.join(own)}"
        )


def _free_parameters(model: Model, point: SpecialPoint) -> tuple[str, ...]:
    """The parameters of the diagram or the curve of a point."""
    source = getattr(point.source, "model", None)
    known = model.parameters if source is None else source.parameters
    free = tuple(n for n, value in point.parameters.items() if known.get(n) != value)
    expected = point.kind.codimension
    if len(free) == expected:
        return free
    label = point.label or "the point"
    if source is None and len(free) < expected:
        raise ArgumentError(
            f"{label} was read from a file, and has the same values as the model, so that it is "
            "not known which of its parameters are free; expected a model with another value of "
            "these, such as model.with_parameters(...)"
        )
    kind = "diagram over one parameter" if expected == 1 else "curve in two parameters"
    raise ArgumentError(
        f"{label} has values other than those of its model of the parameters "
        f"{', '.join(free)}; expected a point {point.code} of a {kind}"
    )


def _with_enclosure(
    model: Model, point: SpecialPoint, free: tuple[str, ...], digits: int
) -> SpecialPoint:
    """Return a point with its enclosure, in terms of the free parameters."""
    _require_states(model, point)
    for name, value in point.parameters.items():
        if name not in free and model.parameters.get(name) != value:
            raise ArgumentError(
                f"the point has {name} = {value!r} and the model {model.parameters.get(name)!r}; "
                "expected a point of this model"
            )
    module = flint()
    equations, u = _equations(model, point, free)
    source = getattr(point.source, "model", None)
    require_same_equations("point", "" if source is None else source.equations, model)
    names = (*point.states, *free)
    for more in MORE:
        with module.ctx.workprec(int(digits * PER_DIGIT) + more):
            try:
                zero, regular = _proved(equations, point, u)
            except UnprovedError as error:
                raise ArgumentError(f"{point.label} cannot be proved: {error}") from None
            balls = [*zero.position[: len(point.states)], *zero.position[-len(free) :]]
            enclosure = _enclosure(names, balls, digits, zero.unique, regular)
        if enclosure.digits == digits:
            break
    return replace(point, enclosure=enclosure)


def _equations(
    model: Model, point: SpecialPoint, free: tuple[str, ...]
) -> tuple[ExactEquations, Array]:
    """The exact equations of the region of a point, and its approximate unknowns."""
    ends = [point.parameters[n] for n in free]
    wanted = [region.partition(" (")[0] for region in point.regions]
    known = {one.region: one for one in exact_equations(model, *free)}
    found = sorted((known[n] for n in wanted if n in known), key=lambda one: one.slides)
    if not found or found[0].continuum:
        raise ArgumentError(
            f"{point.label} is a point of {' and '.join(point.regions)}; expected a point of a "
            f"region with isolated equilibria: {', '.join(known)}"
        )
    equations = found[0]
    if not equations.slides:
        return equations, np.array([*point.state, *ends])
    if point.code not in ON_DISCONTINUITY:
        raise ArgumentError(
            f"{point.label} is a point {point.code} of pseudo-equilibria, of {point.regions[0]}; "
            f"of these, {', '.join(ON_DISCONTINUITY)} can be proved"
        )
    return equations, np.array([*point.state, _weight(equations, point, ends), *ends])


def _weight(equations: ExactEquations, point: SpecialPoint, ends: Sequence[float]) -> float:
    """The weight of the two fields at a pseudo-equilibrium, with which their mean vanishes."""
    rows = ball_function(equations.rows, equations.unknowns)
    mean, one = (
        np.array([float(b.mid()) for b in rows([flint().arb(v) for v in (*point.state, s, *ends)])])
        for s in (0.0, 1.0)
    )
    half = one - mean
    return float(-(mean @ half) / (half @ half))


def _proved(equations: ExactEquations, point: SpecialPoint, u: Array) -> tuple[ProvedZero, str]:
    """Prove a point; return the zero of its defining system, and what its regularity means."""
    if not point.kind.branching:
        system = defined(equations, point, u)
        return proved_zero(system), system.regular
    reasons = []
    for system in branch_points(equations, point, u):
        try:
            return proved_zero(system), system.regular
        except UnprovedError as error:
            reasons.append(f"{system.regular} cannot be shown: {error}")
    if reasons:
        raise UnprovedError(reasons[0])
    beta = proved_zero(unfolded(equations, point, u)).unknowns[-1]
    words = "no invariant subspace of the equations and no factor of a rate contains it"
    if beta.contains(0):
        raise UnprovedError(
            f"{words}. Whether the branches intersect is unresolved within a change of the rates "
            f"by {float(beta.abs_upper()):.1g}"
        )
    raise UnprovedError(
        f"{words}. The branches do not intersect: they would if the rates changed by "
        f"{float(beta.mid()):.3g}"
    )


def with_enclosures(
    model: Model, diagram: Diagram
) -> tuple[Diagram, SpecialPoints, tuple[str, ...]]:
    """Return a diagram with proved special points, these, and what was not proved, with reasons."""
    wanted = [point for point in diagram.special() if point.code in PROVABLE]
    try:
        flint()
    except MissingPackageError as error:
        notes = (f"special points have no enclosures: {error}",) if wanted else ()
        return diagram, SpecialPoints(), notes
    branches, failed = [], []
    for branch in diagram.branches:
        points = []
        for point in branch.special:
            if point.code in PROVABLE:
                try:
                    point = _with_enclosure(model, point, (diagram.parameter,), ENCLOSURE_DIGITS)
                except (ArgumentError, ModelError) as error:
                    reason = str(error).removeprefix(f"{point.label} cannot be proved: ")
                    failed.append(f"{point.label} has no enclosure: {reason}")
            points.append(point)
        branches.append(replace(branch, special=SpecialPoints(points)))
    proved = replace(diagram, branches=tuple(branches))
    found = SpecialPoints(p for p in proved.special if p.enclosure is not None)
    return proved, found, tuple(failed)


def _enclosure(
    names: Sequence[str], balls: Sequence[Any], digits: int, unique: float, regular: str
) -> Enclosure:
    low, high, decimals, accurate = {}, {}, {}, []
    for name, ball in zip(names, balls, strict=True):
        low[name] = _outside(ball, float(ball.lower()), -math.inf)
        high[name] = _outside(ball, float(ball.upper()), math.inf)
        zero = ball.contains(0)
        decimals[name] = "0" if zero else ball.str(digits, radius=False)
        if not zero:
            accurate.append(int(ball.rel_accuracy_bits() / PER_DIGIT))
    return Enclosure(low, high, decimals, min([digits, *accurate]), unique, regular)


def _outside(ball: Any, value: float, towards: float) -> float:
    """The floating-point number nearest to a value that is not inside a ball."""
    arb = flint().arb
    while not (arb(value) <= ball if towards < 0 else arb(value) >= ball):
        value = math.nextafter(value, towards)
    return value
