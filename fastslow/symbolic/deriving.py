"""Symbolic derivation of the equilibria and bifurcations of a frozen model."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import sympy as sp

from fastslow.arguments import Condition, Name, formula, instance, items, text, validated
from fastslow.errors import ArgumentError, refuse_resets, unknown_name
from fastslow.model.every_switch_state import switch_states
from fastslow.model.interfaces import Region
from fastslow.model.model import Model
from fastslow.model.motions import regions_of
from fastslow.model.rational import exact
from fastslow.model.restriction import restricted
from fastslow.model.rests import Held, held_motions
from fastslow.model.structure import TIME, real
from fastslow.model.work import Budget, PastWorkError
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.symbolic.closed_forms.boundaries import (
    BoundaryForm,
    boundary_forms,
    end_forms,
    wall_forms,
)
from fastslow.symbolic.closed_forms.conserved import conserved_quantities
from fastslow.symbolic.closed_forms.critical import RegionContext
from fastslow.symbolic.closed_forms.equilibrium_sets import (
    EDGE,
    EquilibriumSetForm,
    equilibrium_set_forms,
)
from fastslow.symbolic.closed_forms.regions import RegionForms, derive_region
from fastslow.symbolic.closed_forms.symmetries import free_directions
from fastslow.symbolic.derivation import Derivation
from fastslow.symbolic.signs.assumptions import read_signs
from fastslow.symbolic.signs.inequalities import irredundant
from fastslow.symbolic.signs.signs import Signs
from fastslow.symbolic.solving.candidates import Candidates
from fastslow.symbolic.solving.location import short_form

#: Budgets of work of the boundary equilibria and of the regions of a model.
BOUNDARIES, REGION_WORK = 150_000, 300_000

#: Note on the rates of a motion held against walls.
HELD = "rates along which the wall attracts, h'' = -h - 2h', with eigenvalues -1 twice"

#: Assumptions about parameters: signs by name, or conditions.
Assumptions: TypeAlias = "Mapping[Any, str] | Condition | Iterable[Condition]"


@validated(model=instance(Model), parameter=formula, regions=items(text))
def derive(
    model: Model,
    assume: Assumptions | None = None,
    *,
    parameter: Name | None = None,
    regions: Sequence[str] | None = None,
) -> Derivation:
    """Derive equilibria, stability, folds and boundary equilibria in closed form.

    Parameters are assumed to have the signs of their values; the assumptions are
    listed in the result. Conditions that are true or false only because of such a
    sign are given in general form (``A < -D**2``), and ``possible`` states whether
    they are compatible with the assumptions. Signs of the parameters in interfaces
    are always assumed.

    Parameters
    ----------
    model : Model
        A frozen model, or one without forcing and slow states.
    assume : mapping, relation, str or an iterable of these, optional
        Assumptions that override the signs of the values: ``{"A": "negative"}``,
        ``"A < 0"``, ``"A < -D**2"``; ``"real"`` removes the sign of a parameter.
    parameter : str or Symbol, optional
        Parameter for which equilibria, folds, Hopf points and boundary equilibria are
        solved first, where this is possible in closed form. Default: the frozen slow
        quantities.
    regions : sequence of str, optional
        Regions to derive, with the boundary equilibria between them and their neighbours.
        Default: all.

    Returns
    -------
    Derivation
        Beyond a structural budget (degree, number of terms) a form remains implicit,
        with a note. Regions and pairs of neighbours past the budget of the whole derivation are
        ``omitted``, and can be derived by ``regions=``. The result does not depend on
        computing time.

    Raises
    ------
    ArgumentError
        If the model is not frozen, or an assumption cannot be read.
    UnknownNameError
        If an assumption or ``parameter`` names no parameter.

    See Also
    --------
    fastslow.slow_flow, fastslow.equilibria, fastslow.continue_equilibria

    Examples
    --------
    >>> x, w, k = sp.symbols("x w k")
    >>> found = derive(Model({x: w - k * x**3}, forcing={w: sp.sin(sp.Symbol("t"))},
    ...     parameters={k: 2}).frozen())
    >>> found["S1"].equilibria[0].parameters["w"], found.assumptions
    (k*x**3, (k > 0,))
    >>> cubic = Model({x: w - k * x**3}, forcing={w: sp.sin(sp.Symbol("t"))}, parameters={k: 2})
    >>> derive(cubic.frozen(), parameter="k")["S1"].equilibria[0].parameters
    {k: w/x**3}
    """
    refuse_resets([n for n, reset in model.resets.items() if reset.clock is not None], "derive")
    if regions is not None and model.partition.pieces is not None:
        model = restricted(model, regions)
    if model.switches:
        parts = [
            derive(one, assume, parameter=parameter, regions=regions)
            for one in switch_states(model)
        ]
        return _joined(parts)
    slow = (*model.forcing, *model.slow_states)
    if slow:
        raise ArgumentError(
            f"derive: {', '.join(slow)} still {'vary' if len(slow) > 1 else 'varies'} in time; "
            "expected a frozen model: derive(model.frozen())"
        )
    for name, rate in model.rates.items():
        if TIME in rate.free_symbols:
            raise ArgumentError(
                f"derive: the rate of {name} depends on time; expected an autonomous model"
            )
    signs = read_signs(model.parameters, assume)
    functions = {n: exact(i.function) for n, i in model.interfaces.items()}
    walls = [reset for reset in model.resets.values() if reset.clock is None]
    heights = {wall.wall: -exact(wall.function) for wall in walls}
    context = _Contexts(model, functions, heights, signs, _candidates(model, parameter))
    chosen = _chosen(model, regions)
    contexts = {name: context.free(region) for name, region in model.regions.items()}
    motions = tuple(regions_of(model.partition))
    held = tuple(held_motions(motions, list(functions.values()), walls, model.states))
    in_contact = {one.rest.motion.name: context.held(one) for one in held}
    boundary, omitted_pairs = _between_regions(model, functions, contexts, chosen)
    motions_in_contact = {**contexts, **in_contact}
    for one in held:
        for wall, region, push in _lifted(one, held, list(heights), list(contexts)):
            free, still = motions_in_contact[region], in_contact[one.rest.motion.name]
            boundary += wall_forms(wall, heights[wall], free, still, push)
    holding = {k for one in held for k in one.rest.walls}
    for k, (wall, height) in enumerate(heights.items()):
        if k not in holding:
            boundary += [f for one in contexts.values() for f in end_forms(wall, height, one)]
    sets, omitted_sets = equilibrium_set_forms(model, signs, exact)
    found = tuple(b for b in dict.fromkeys(boundary) if not _always(b, sets))
    derived: dict[str, RegionForms] = {}
    omitted: list[str] = []
    budget = Budget(REGION_WORK)
    for name in (n for n in contexts if n in chosen):
        try:
            with budget.spending():
                derived[name] = _with_edges(derive_region(contexts[name], found), sets)
        except PastWorkError:
            omitted.append(name)
    for one in held:
        name = one.rest.motion.name
        forces = {list(heights)[k]: f for k, f in zip(one.rest.walls, one.rest.forces, strict=True)}
        derived[name] = _with_forces(derive_region(in_contact[name], found), forces)
    return Derivation(
        states=model.states,
        free=model.free,
        assumptions=signs.conditions,
        regions=NamedMapping("region", derived),
        boundary_equilibria=found,
        equilibrium_sets=sets,
        free_directions=free_directions(model),
        conserved_quantities=conserved_quantities(model),
        omitted=tuple(omitted),
        omitted_pairs=tuple(omitted_pairs),
        omitted_sets=omitted_sets,
    )


def _between_regions(
    model: Model,
    functions: Mapping[str, sp.Expr],
    contexts: Mapping[str, RegionContext],
    chosen: Set[str],
) -> tuple[list[BoundaryForm], list[tuple[str, str]]]:
    """Return the boundary equilibria between neighbours, and the pairs past the budget of work."""
    found: list[BoundaryForm] = []
    omitted: list[tuple[str, str]] = []
    budget = Budget(BOUNDARIES)
    for name, function in functions.items():
        for pair in _pairs(model, name):
            if not chosen.isdisjoint(pair):
                sides = (contexts[pair[0]], contexts[pair[1]])
                try:
                    with budget.spending():
                        found += boundary_forms(name, function, sides, model.continuous[name])
                except PastWorkError:
                    omitted.append(pair)
    return found, omitted


def _chosen(model: Model, regions: Sequence[str] | None) -> set[str]:
    """Return the regions to derive."""
    for region in regions or ():
        if region not in model.regions:
            raise unknown_name("region", region, model.regions)
    return {*(model.regions if regions is None else regions)}


def _edge(
    sets: Sequence[EquilibriumSetForm],
    state: NamedMapping[sp.Expr],
    parameters: NamedMapping[sp.Expr],
) -> EquilibriumSetForm | None:
    """Return the equilibrium set on whose boundary a state is, if any."""
    return next((one for one in sets if one.on_edge(state, parameters)), None)


def _always(form: BoundaryForm, sets: Sequence[EquilibriumSetForm]) -> bool:
    """Check that a boundary equilibrium bounds an equilibrium set for all parameter values."""
    if form.equations or _edge(sets, form.state, form.parameters) is None:
        return False
    # a parameter equal to its own symbol is free
    fixed = [e for n, e in form.parameters.items() if e != real(n)]
    used = set().union(set(), *(e.free_symbols for e in fixed))
    return not fixed or bool(used & {real(n) for n in form.state})


def _with_edges(region: RegionForms, sets: Sequence[EquilibriumSetForm]) -> RegionForms:
    """Return a region whose equilibria are marked as edges of equilibrium sets."""
    forms = []
    for form in region.equilibria:
        closed = form.type != "implicit" and not form.conditions
        one = _edge(sets, form.state, form.parameters) if closed else None
        note = f"{EDGE} {one.region}" if one is not None else form.note
        forms.append(replace(form, note=note))
    return replace(region, equilibria=tuple(forms))


def _joined(parts: Sequence[Derivation]) -> Derivation:
    """Return the derivations in all states of the switches as one."""
    first = parts[0]
    named = {name: region for part in parts for name, region in part.regions.items()}
    return replace(
        first,
        regions=NamedMapping("region", named),
        boundary_equilibria=tuple(b for part in parts for b in part.boundary_equilibria),
        equilibrium_sets=tuple(s for part in parts for s in part.equilibrium_sets),
        free_directions=tuple(dict.fromkeys(f for part in parts for f in part.free_directions)),
        conserved_quantities=tuple(
            dict.fromkeys(q for part in parts for q in part.conserved_quantities)
        ),
        omitted=tuple(r for part in parts for r in part.omitted),
        omitted_pairs=tuple(p for part in parts for p in part.omitted_pairs),
        omitted_sets=tuple(s for part in parts for s in part.omitted_sets),
    )


def _with_forces(region: RegionForms, forces: Mapping[str, sp.Expr]) -> RegionForms:
    """Return a region whose equilibria have contact forces."""
    forms = []
    for form in region.equilibria:
        at = {real(n): e for n, e in (*form.state.items(), *form.parameters.items())}
        values = {wall: short_form(exact(force).xreplace(at)) for wall, force in forces.items()}
        forms.append(replace(form, contact_forces=NamedMapping("wall", values)))
    return replace(region, equilibria=tuple(forms), notes=(*region.notes, HELD))


def _lifted(
    one: Held, held: Sequence[Held], walls: Sequence[str], regions: Sequence[str]
) -> Iterator[tuple[str, str, list[sp.Expr]]]:
    """Yield each wall of a held motion with the motion after lift-off and the push W there."""
    for k, push in zip(one.rest.walls, one.rest.pushes, strict=True):
        left = {*one.rest.walls} - {k}
        names = [
            other.rest.motion.name
            for other in held
            if {*other.rest.walls} == left and other.region == one.region
        ]
        if not left:
            names = [regions[one.region]]
        for name in names:
            yield walls[k], name, [-exact(e) for e in push]


def _candidates(model: Model, parameter: Any) -> Candidates:
    """Parameters to solve for: the given one, the frozen slow quantities, all others."""
    valid = [*model.free, *(n for n in model.parameters if n not in model.free)]
    first = list(model.free)
    if parameter is not None:
        if str(parameter) not in valid:
            raise unknown_name("parameter", parameter, valid)
        first = [str(parameter), *(n for n in first if n != str(parameter))]
    others = [n for n in valid if n not in first]
    return Candidates(tuple(map(real, first)), tuple(map(real, others)))


@dataclass(frozen=True)
class _Contexts:
    """Contexts of the motions of a model, with its interfaces and walls H ≥ 0."""

    model: Model
    functions: Mapping[str, sp.Expr]
    heights: Mapping[str, sp.Expr]
    signs: Signs
    candidates: Candidates

    def free(self, region: Region) -> RegionContext:
        """Return the context of a region."""
        written = [region.signs[i] * h for i, h in self.functions.items()]
        rates = (region.rates[n] for n in self.model.states)
        return self._of(region.name, rates, [*written, *self.heights.values()])

    def held(self, one: Held) -> RegionContext:
        """Return the context of a motion held against walls, in which contact forces push."""
        written = [s * h for s, h in zip(one.signs, self.functions.values(), strict=True) if s]
        written += [h for k, h in enumerate(self.heights.values()) if k not in one.rest.walls]
        # on the walls, with zero relative velocity
        at = dict(zip(map(real, self.model.states), one.rest.entry, strict=True))
        written += [sp.cancel(exact(force.xreplace(at))) for force in one.rest.forces]
        return self._of(one.rest.motion.name, one.rates, written)

    def _of(self, name: str, rates: Iterable[sp.Expr], written: Sequence[sp.Expr]) -> RegionContext:
        model = self.model
        moving = {real(n) for n in (*model.states, *model.free)}
        surfaces = (*self.functions.values(), *self.heights.values())
        used = set().union(set(), *(h.free_symbols for h in surfaces))
        forms = dict(zip(map(sp.expand, written), written, strict=True))
        inside = tuple(irredundant(tuple(forms), self.signs))
        return RegionContext(
            name,
            model.states,
            NamedMapping("state", dict(zip(model.states, map(exact, rates), strict=True))),
            inside,
            self.signs,
            self.candidates,
            tuple(sorted(used - moving, key=lambda s: s.name)),
            tuple(forms[e] for e in inside),
        )


def _pairs(model: Model, interface: str) -> list[tuple[str, str]]:
    """Pairs of regions that differ in one interface, the one where it is positive first."""
    place = list(model.interfaces).index(interface)
    named = {tuple(region.signs.values()): name for name, region in model.regions.items()}
    found = []
    for pattern, above in named.items():
        below = named.get((*pattern[:place], -1, *pattern[place + 1 :]))
        if pattern[place] > 0 and below is not None:
            found.append((above, below))
    return found
