"""The slow flow on the critical manifold, with its folds and folded singularities."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import sympy as sp
from sympy.core.relational import Relational

from fastslow.arguments import Name, formula, instance, items, text, validated
from fastslow.errors import (
    ArgumentError,
    refuse_events,
    refuse_resets,
    refuse_switches,
    unknown_name,
)
from fastslow.model.interfaces import Region
from fastslow.model.model import Model
from fastslow.model.rational import exact
from fastslow.model.structure import TIME, real
from fastslow.model.typesetting import latex, latex_text
from fastslow.model.work import Budget, PastWorkError
from fastslow.results.base.display import Displayed
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.results.point_types import CANARD_POINT
from fastslow.symbolic.closed_forms.critical import RegionContext, critical_point
from fastslow.symbolic.closed_forms.regions import region_conditions
from fastslow.symbolic.corners import CornerPoint, corner_points
from fastslow.symbolic.decimals import readable
from fastslow.symbolic.deriving import Assumptions
from fastslow.symbolic.folded_points import FoldedFlow, FoldedPoint
from fastslow.symbolic.report import wording
from fastslow.symbolic.report.region_reports import RegionReport
from fastslow.symbolic.report.typesetting import Block
from fastslow.symbolic.report.wording import Fragment, entry, sentence
from fastslow.symbolic.signs.assumptions import read_signs
from fastslow.symbolic.signs.inequalities import irredundant
from fastslow.symbolic.signs.signs import Signs
from fastslow.symbolic.solving.candidates import Candidates
from fastslow.symbolic.solving.location import LocatedForm, both_notes, locate
from fastslow.symbolic.solving.solution_families import families
from fastslow.symbolic.solving.trigonometric import trigonometric_roots

#: Budget of work of the folded points of one region.
FOLDED = 150_000

#: Largest number of fast variables for which the determinant is formed.
FAST = 6


@dataclass(frozen=True, repr=False, kw_only=True)
class SlowFlowForms(Displayed):
    """The slow flow of one region.

    With n fast variables x and m slow variables y, x' = f(x, y) and y' = g(x, y).

    Parameters
    ----------
    region : str
    conditions : tuple of Boolean
        Inequalities that define the region.
    fast, slow : tuple of str
        The variables; ``"t"`` is the phase of a periodic forcing, with rate 1.
    manifold : NamedMapping of sympy.Expr
        f, which vanishes on the critical manifold, by fast variable.
    jacobian : sympy.Matrix, shape (n, n)
        f_x: the manifold is normally hyperbolic where no eigenvalue has zero real part.
    slow_rates : NamedMapping of sympy.Expr
        g, by slow variable.
    forcing : sympy.Matrix, shape (n, 1)
        −f_y g: the reduced flow is f_x x' = −f_y g, y' = g.
    fold : sympy.Expr
        det f_x, which vanishes on folds.
    orientation : sympy.Expr
        (−1)ⁿ det f_x. Time in the desingularised flow is divided by it: their directions agree
        where it is positive, as on all attracting sheets, but not only there.
    desingularised : NamedMapping of sympy.Expr
        x' = −(−1)ⁿ adj(f_x) f_y g and y' = (−1)ⁿ det(f_x) g, by variable.
    condition : tuple of sympy.Expr
        det f_x and adj(f_x) f_y g: they vanish with f at folded singularities.
    points : tuple of FoldedPoint
        Folded singularities with two slow variables, canard points with one.
    check : str
        ``"exact"`` if the desingularised flow was verified to be tangent to the manifold, by
        substitution, else empty.
    notes : tuple of str
    """

    region: str
    conditions: tuple[sp.Basic, ...]
    fast: tuple[str, ...]
    slow: tuple[str, ...]
    manifold: NamedMapping[sp.Expr]
    jacobian: sp.ImmutableDenseMatrix
    slow_rates: NamedMapping[sp.Expr]
    forcing: sp.ImmutableDenseMatrix
    fold: sp.Expr
    orientation: sp.Expr
    desingularised: NamedMapping[sp.Expr]
    condition: tuple[sp.Expr, ...]
    points: tuple[FoldedPoint, ...]
    check: str
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, repr=False, kw_only=True)
class SlowFlow(RegionReport[SlowFlowForms]):
    """The slow flow on the critical manifold of a model, region by region.

    Parameters
    ----------
    fast, slow : tuple of str
        Fast states; slow states, and ``"t"`` for the phase of a periodic forcing.
    assumptions : tuple of relations
        Assumed signs of parameters.
    regions : NamedMapping of SlowFlowForms
        Also ``flow["S1"]``.
    corners : tuple of CornerPoint
        With one slow state, where sheets of two regions meet on an interface across which the rates
        are continuous, and the passage there at the parameter values of the model.
    omitted : tuple of str
        Regions past the budget of work.
    """

    fast: tuple[str, ...]
    slow: tuple[str, ...]
    assumptions: tuple[Relational, ...]
    regions: NamedMapping[SlowFlowForms]
    corners: tuple[CornerPoint, ...] = ()
    omitted: tuple[str, ...] = ()

    @property
    def points(self) -> tuple[FoldedPoint, ...]:
        """Folded singularities and canard points of all regions."""
        return tuple(p for r in self.regions.values() for p in r.points)

    @property
    def verified(self) -> bool:
        """True if every desingularised flow is verified to be tangent to its manifold."""
        return all(r.check for r in self.regions.values())

    def _blocks(self) -> list[Block]:
        return [_block(one) for one in self.regions.values()]

    def _groups(self) -> list[list[str]]:
        assumed = ", ".join(map(str, self.assumptions)) or "nothing"
        head = f"Slow flow of {', '.join(self.slow)} on the manifold of {', '.join(self.fast)}"
        lines: list[str] = []
        for one in self.regions.values():
            lines += _lines(one)
        for corner in self.corners:
            lines += entry([Fragment(corner.words)], {*self.fast, *self.slow}, "  ")
        heading = wording.wrapped(f"{head}; assumed:", assumed.split(", "), "  ")
        for note in wording.left_out(self.omitted, []):
            heading += sentence("", note, "  ")
        return [heading, lines]


@validated(model=instance(Model), parameter=formula, regions=items(text))
def slow_flow(
    model: Model,
    assume: Assumptions | None = None,
    *,
    parameter: Name | None = None,
    regions: Sequence[str] | None = None,
) -> SlowFlow:
    """Derive the slow flow on the critical manifold, its folds and its folded singularities.

    The states are fast, the slow states and the phase of a periodic forcing are slow; time is that
    of the model, and no small parameter is named. The reduced flow f_x x' = −f_y g, y' = g has no
    solution on folds, det f_x = 0; the desingularised flow, in which time is multiplied by
    (−1)ⁿ det f_x, is smooth, and its zeros on folds are the folded singularities (Szmolyan and
    Wechselberger, J. Differ. Equ. 177, 419-453, 2001): folded nodes, saddles and foci with two
    slow variables, and, at one value of a parameter, canard points with one.

    Parameters
    ----------
    model : Model
        With slow states, a periodic forcing, or both. Not frozen.
    assume : mapping, relation, str or an iterable of these, optional
        As in `fastslow.derive`.
    parameter : str or Symbol, optional
        With one slow variable, the parameter at whose value there is a canard point. Default: one
        in which the slow rate on the fold is affine.
    regions : sequence of str, optional
        Regions to derive. Default: all.

    Returns
    -------
    SlowFlow

    Raises
    ------
    ArgumentError
        For a model without slow variables, or a forcing without a period.
    ModelError
        For a model with resets or switches.
    UnknownNameError
        For an unknown region.

    See Also
    --------
    fastslow.derive, fastslow.find_canard, fastslow.find_canards, fastslow.continue_points

    Examples
    --------
    >>> x, y, z, k, lam, eps = sp.symbols("x y z k lambda epsilon")
    >>> koper = Model({x: (k * y - x**3 + 3 * x - lam) / eps}, slow={y: x - 2 * y + z, z: y - z},
    ...     parameters={k: -10, lam: 7, eps: 0.01})
    >>> for point in slow_flow(koper).points:
    ...     print(point.words)
    folded node: eigenvalues -935.89, -64.1101, μ = 0.0685018, at most 7 rotations
    folded focus: eigenvalues -500 ± 806.226i
    """
    refuse_resets(list(model.resets), "slow_flow")
    refuse_switches(list(model.switches), "slow_flow")
    refuse_events(model.events, "slow_flow")
    timed = any(_with_laws(model, r)[1] for r in model.regions.values())
    if timed and model.period() is None:
        raise ArgumentError(
            "slow_flow: a forcing of this model has no period; expected periodic forcings, whose "
            "phase is a slow variable. Write a ramp as a slow state: slow={w: r}"
        )
    slow = (*model.slow_states, *((TIME.name,) if timed else ()))
    if not slow:
        raise ArgumentError(
            "slow_flow: this model has no slow variable; expected slow states, Model(..., slow=), "
            "or a periodic forcing, Model(..., forcing=)"
        )
    if len(model.states) > FAST:
        raise ArgumentError(
            f"slow_flow: this model has {len(model.states)} fast states; expected at most {FAST}"
        )
    for name in regions or ():
        if name not in model.regions:
            raise unknown_name("region", name, model.regions)
    if parameter is not None and str(parameter) not in model.parameters:
        raise unknown_name("parameter", parameter, model.parameters)
    varied = list(model.parameters) if parameter is None else [str(parameter)]
    signs = read_signs(model.parameters, assume)
    derived: dict[str, SlowFlowForms] = {}
    omitted = []
    for name, region in model.regions.items():
        if regions is None or name in regions:
            try:
                with Budget(FOLDED).spending():
                    derived[name] = _region(model, region, slow, varied, signs)
            except PastWorkError:
                omitted.append(name)
    return SlowFlow(
        fast=model.states,
        slow=slow,
        assumptions=signs.conditions,
        regions=NamedMapping("region", derived),
        corners=() if timed or regions is not None else corner_points(model, varied),
        omitted=tuple(omitted),
    )


def _with_laws(model: Model, region: Region) -> tuple[dict[str, sp.Expr], bool]:
    """Return the rates of a region with the laws of its forcings, and whether they contain time."""
    laws = {real(n): exact(law) for n, law in region.forcing.items()}
    names = (*model.states, *model.slow_states)
    rates = {n: sp.sympify(exact(region.rates[n]).xreplace(laws)) for n in names}
    return rates, any(TIME in e.free_symbols for e in rates.values())


def _region(
    model: Model, region: Region, slow: tuple[str, ...], varied: Sequence[str], signs: Signs
) -> SlowFlowForms:
    rates, _ = _with_laws(model, region)
    fast, n = model.states, len(model.states)
    f = sp.ImmutableDenseMatrix([rates[name] for name in fast])
    g = sp.ImmutableDenseMatrix([rates.get(name, sp.S.One) for name in slow])
    x, y = [real(name) for name in fast], [real(name) for name in slow]
    fx, fy = f.jacobian(x), f.jacobian(y)
    fold, pushed = sp.factor_terms(fx.det(method="berkowitz")), fx.adjugate() * fy * g
    side = (-1) ** n
    flow = sp.ImmutableDenseMatrix([*(-side * pushed), *(side * fold * g)])
    tangent = fx * sp.Matrix(flow[:n]) + fy * sp.Matrix(flow[n:])
    check = "exact" if all(sp.expand(e) == 0 for e in tangent) else ""
    context = _context(model, region, signs, slow, varied, rates, fold)
    period = model.period() if TIME.name in slow else None
    folded = FoldedFlow(
        fast=fast,
        slow=slow,
        f=f,
        g=g,
        desingularised=flow,
        parameters=model.parameters,
        period=period,
        region=region.name,
        inside=context.inside,
        equations=model.equations,
    )
    points, notes = _points(context, folded, list(pushed))
    return SlowFlowForms(
        region=region.name,
        conditions=region_conditions(context),
        fast=fast,
        slow=slow,
        manifold=NamedMapping("fast state", dict(zip(fast, f, strict=True))),
        jacobian=fx,
        slow_rates=NamedMapping("slow variable", dict(zip(slow, g, strict=True))),
        forcing=sp.ImmutableDenseMatrix(-fy * g),
        fold=fold,
        orientation=side * fold,
        desingularised=NamedMapping("variable", dict(zip((*fast, *slow), flow, strict=True))),
        condition=(fold, *pushed),
        points=points,
        check=check,
        notes=notes,
    )


def _context(
    model: Model,
    region: Region,
    signs: Signs,
    slow: tuple[str, ...],
    parameters: Sequence[str],
    rates: dict[str, sp.Expr],
    fold: sp.Expr,
) -> RegionContext:
    """Return the context of folds: f = 0 and det f_x = 0 for x and the slow variable in f."""
    inside_f = set().union(*(rates[name].free_symbols for name in model.states))
    varied = next((s for s in slow if real(s) in inside_f and real(s) != TIME), slow[0])
    laws = {real(n): exact(law) for n, law in region.forcing.items()}
    written = [
        sp.sympify((region.signs[i] * exact(one.function)).xreplace(laws))
        for i, one in model.interfaces.items()
    ]
    states = (*model.states, varied)
    moving = {real(n) for n in (*model.states, *slow)}
    used = set().union(set(), *(h.free_symbols for h in written))
    forms = dict(zip(map(sp.expand, written), written, strict=True))
    inside = tuple(irredundant(tuple(forms), signs))
    first = tuple(real(s) for s in slow if s != varied)
    return RegionContext(
        region.name,
        states,
        NamedMapping("state", {**{n: rates[n] for n in model.states}, varied: fold}),
        inside,
        signs,
        Candidates(first, () if first else tuple(map(real, parameters))),
        tuple(sorted(used - moving, key=lambda s: s.name)),
        tuple(forms[e] for e in inside),
    )


def _points(
    context: RegionContext, flow: FoldedFlow, pushed: Sequence[sp.Expr]
) -> tuple[tuple[FoldedPoint, ...], tuple[str, ...]]:
    """Return the folded points of a region with notes on what is not derived."""
    if context.rates[context.states[-1]] == 0:
        return (), ("det f_x vanishes everywhere: the manifold is not normally hyperbolic",)
    moving = {*map(real, (*flow.fast, *flow.slow))}
    if not moving & context.rates[context.states[-1]].free_symbols:
        return (), ("no folds: det f_x is the same at all states",)
    if len(flow.slow) > 2:
        return (), ("with three or more slow variables only the condition is derived",)
    found = families(context.rates, context.states, context.signs, context.candidates)
    isolated = [one for one in found if len(one.elimination.unknowns) <= len(one.equations)]
    notes = [one.note for one in found if one.note]
    notes += ["a continuum of folds is not examined"] * (len(found) > len(isolated))
    points = []
    for family in isolated:
        rows = [sp.sympify(e) for e in pushed if family.reduced(e) != 0]
        if not rows:
            inner = flow.f.jacobian(flow.x)
            corank = inner.rows > 1 and all(family.reduced(e) == 0 for e in inner.adjugate())
            why = "f_x has corank 2 on a fold, which is not examined"
            every = "adj(f_x) f_y g vanishes on a fold, all points of which are folded"
            notes.append(why if corank else every)
            continue
        # f_x has rank n - 1 at a fold: one row of the adjugate vanishes with all others
        for one in locate(family, rows[0], context.signs, context.candidates):
            for located in _phases(one, context):
                form = critical_point(CANARD_POINT, family, located, rows[0], context)
                points += flow.typed(form)
    return tuple(points), tuple(dict.fromkeys(notes))


def _phases(located: LocatedForm, context: RegionContext) -> list[LocatedForm]:
    """Solve a remaining trigonometric equation for the phase of the forcing."""
    if len(located.equations) != 1 or TIME not in context.candidates:
        return [located]
    (equation,) = located.equations
    taken = set().union(*(e.free_symbols for e in (equation, *located.place.values())))
    periodic = trigonometric_roots(equation, TIME, context.signs, taken)
    if periodic is None:
        return [located]
    roots, integer = periodic
    note = both_notes(located.note, f"{integer} is any integer")
    return [
        LocatedForm({**located.place, TIME: r.value}, (*located.radicands, *r.radicands), note=note)
        for r in roots
    ]


def _block(one: SlowFlowForms) -> Block:
    def tex(expression: sp.Basic) -> str:
        return latex(readable(expression))

    lines = [tex(c) for c in one.conditions]
    lines += [f"0 = {tex(e)}" for e in one.manifold.values()]
    lines += [rf"\det f_x = {tex(one.fold)}"]
    lines += [rf"\dot{{{tex(real(n))}}} = {tex(e)}" for n, e in one.desingularised.items()]
    for point in one.points:
        each = [f"{tex(real(n))} = {tex(e)}" for n, e in point.state.items()]
        zeros = [f"{tex(e)} = 0" for e in point.form.equations]
        name = latex_text(point.code or "folded")
        lines.append(rf"\text{{{name}: }} " + r",\quad ".join([*each, *zeros]))
    return f"Region {latex_text(one.region)}", lines


def _lines(one: SlowFlowForms) -> list[str]:
    taken = {*one.fast, *one.slow}
    where = [Fragment("", c).shown(readable(c)) for c in one.conditions] or ["everywhere"]
    lines = wording.wrapped(f"  {one.region}:", where, "  ")
    lines += entry([Fragment("folds: ", one.fold, " = 0")], taken, "    ")
    flow = [Fragment(f"{n}' = ", e) for n, e in one.desingularised.items()]
    head = replace(flow[0], before=f"desingularised: {flow[0].before}")
    lines += entry([head, *flow[1:]], taken, "    ")
    for point in one.points:
        values = [Fragment(f"{n} = ", e) for n, e in point.state.items() if e != real(n)]
        if values:
            values[0] = replace(values[0], separator="; at ")
        values += [Fragment("", e, " = 0", "; where ") for e in point.form.equations]
        lines += entry([Fragment(point.words), *values], taken, "    ")
        if point.note:
            lines += sentence("note: ", point.note, "      ")
    for note in one.notes:
        lines += sentence("note: ", note)
    return lines
