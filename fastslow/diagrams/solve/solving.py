"""Equilibria of a frozen model at one parameter value."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from fastslow.arguments import flag, instance, items, mapping, text, validated
from fastslow.diagrams.correcting import point_at
from fastslow.diagrams.field import IDLE, FrozenField, require_frozen
from fastslow.diagrams.joined_states import joined_equilibria
from fastslow.diagrams.on_interfaces import one_sided_points
from fastslow.diagrams.solve.equations import among
from fastslow.diagrams.solve.families import all_known, in_a_set, sets_of
from fastslow.diagrams.solve.many_regions import found_across, solved_one_by_one, unexamined
from fastslow.diagrams.solve.motion_equations import region_equations
from fastslow.diagrams.solve.region_continua import implicit_continua
from fastslow.diagrams.windows import limited, within
from fastslow.errors import ModelError
from fastslow.model.every_switch_state import switch_states
from fastslow.model.model import Model
from fastslow.model.restriction import restricted
from fastslow.results.branch.equilibrium_sets import Equilibria
from fastslow.results.branch.windows import state_window
from fastslow.results.points import Equilibrium
from fastslow.symbolic.closed_forms.conserved import conserved_quantities
from fastslow.symbolic.closed_forms.symmetries import free_directions

Array = NDArray[np.float64]


@validated(model=instance(Model), values=mapping, virtual=flag, window=mapping, regions=items(text))
def equilibria(
    model: Model,
    values: Mapping[Any, float] | None = None,
    /,
    *,
    virtual: bool = False,
    window: Mapping[Any, tuple[float | None, float | None]] | None = None,
    regions: Sequence[str] | None = None,
    **named: float,
) -> Equilibria:
    """Compute all equilibria of a frozen model at given values of its slow quantities.

    If the equations of a region reduce to one polynomial all roots are found, and
    ``completeness`` is ``"complete"``; otherwise Newton's method is applied from many starting
    points, within the window if there is one, until more than 500 equilibria are known, and it is
    ``"found"``. Points at which the rates are zero by rounding alone, as far along an asymptote,
    are omitted. A continuum (the gap of a backlash at zero load) is represented by its ends, with
    ``continuum=True``.

    For discontinuous rates the pseudo-equilibria of the sliding vector field are included, with
    the region ``"S1|S2"`` (Filippov 1988). Sets of pseudo-equilibria, such as the sticking states
    of a block under dry friction, are in the attribute ``sets``; the list contains their two ends
    or corners, with ``continuum=True``.

    In a model with resets equilibria held against walls are included, with contact forces. In a
    model with switches those in every state of the switches, in regions such as ``"S1 (q = 0)"``;
    an equilibrium beyond the threshold at which a switch leaves this state is virtual.

    Parameters
    ----------
    model : Model
        A frozen model.
    values : mapping, optional
        Slow quantity or parameter (symbol or name) to its value.
    virtual : bool
        Whether to include virtual equilibria, which are outside their region.
    window : mapping, optional
        State to its range (low, high), in its own units; None is no bound. Equilibria outside,
        such as negative concentrations, are omitted.
    regions : sequence of str, optional
        Of a model of more than 1024 regions those to consider, with sliding motions, such as those
        of a run, ``run.modes``.
    **named : float
        The same by keyword.

    Returns
    -------
    Equilibria
        A tuple of Equilibrium, region by region.

    Raises
    ------
    UnknownNameError
        For a name that is not a parameter, or in the window not a state.
    ModelError
        For a slow quantity without a value; if the rates are invariant under a shift of the
        states or conserve a combination of them, so that equilibria are not isolated.
    ArgumentError
        For an invalid range in the window, or ``regions`` of a model whose regions are all
        considered.

    See Also
    --------
    fastslow.continue_equilibria, fastslow.derive

    Examples
    --------
    >>> import sympy as sp
    >>> x, w, t = sp.symbols("x w t")
    >>> model = Model({x: w - sp.Abs(x)}, forcing={w: sp.sin(t)}).frozen()
    >>> [e.state.tolist() for e in equilibria(model, w=2)]
    [[2.0], [-2.0]]
    >>> equilibria(Model({x: w - x - sp.sign(x)}, parameters={w: 0.5}))
    1 equilibrium (complete)
      Equilibrium(x = 0; in S1|S2; stable pseudo-node)
    >>> v = sp.Symbol("v")
    >>> equilibria(Model({x: v, v: 1 - x - sp.sign(v) / 2})).sets
    (EquilibriumSet(0.5 ≤ x ≤ 1.5, v = 0; S1|S2 (sticking) on v = 0, dimension 1),)
    """
    require_frozen(model, "solve for the equilibria of")
    if regions is not None:
        model = restricted(model, regions)
    given = model.with_parameters(values, **named)
    if given.switches:
        states = switch_states(given)
        return joined_equilibria([equilibria(m, virtual=virtual, window=window) for m in states])
    if free := (*free_directions(model), *conserved_quantities(model)):
        raise ModelError(f"the equilibria are not isolated; {free[0]}")
    # rates have no derivative by an exponent where its base is zero
    rates = (e for region in given.regions.values() for e in region.rates.values())
    powers = [power for e in rates for power in e.atoms(sp.Pow)]
    exponents = {symbol.name for power in powers for symbol in power.exp.free_symbols}
    name = next((n for n in given.parameters if n not in exponents), IDLE)
    value = 0.0 if name == IDLE else given.parameters[name]
    asked = state_window(model.states, window, model.periodic)
    field = FrozenField(given, name)
    # sets may exist only at these values of all parameters
    still = FrozenField(given, IDLE)
    found = solve_at(field, value, virtual, still)
    if asked.moduli and found.completeness != "complete":
        found = solve_at(field, value, virtual, still, bounds=asked.moduli)
    inside = [one for one in found.sets if asked.intersects(one.lower, one.upper)]
    listed = within(field, asked, found)
    notes = (*one_sided_points(field, listed, value), *implicit_continua(field), *unexamined(field))
    return Equilibria(listed, found.completeness, inside, notes)


def solve_at(
    field: FrozenField,
    value: float,
    virtual: bool = False,
    still: FrozenField | None = None,
    *,
    with_sets: bool = True,
    bounds: Mapping[str, float] | None = None,
    search: bool = False,
) -> Equilibria:
    """Compute equilibria of every region and pseudo-equilibria at a value of the parameter.

    Virtual pseudo-equilibria, in crossing regions, are listed with the sliding motion. Equilibrium
    sets are those of the field over its parameter, or of ``still``, with all parameters fixed;
    without ``with_sets`` sets and their elements are omitted. With bounds on the modulus of states
    the list may lack equilibria beyond them. With ``search`` equilibria in several unknowns are
    searched for, and not isolated.
    """
    along = field if still is None else still
    complete = True
    solved: list[tuple[int, bool, list[Array]]] = []
    for number, equations in enumerate(region_equations(field)):
        whole = equations.continuum(value)
        if whole:
            states = equations.edges(value)
            complete &= bool(states)
        elif equations.implicit:
            # one of the continuum
            whole, complete = True, False
            states = equations.solutions(value, bounds)[0][:1]
        else:
            states, sure = equations.solutions(value, bounds, search=search)
            complete &= sure
        solved.append((number, whole, states))
    if not solved_one_by_one(field):
        solved = [(number, False, [s]) for number, s in found_across(field, value, bounds)]
    known = [(number, np.append(s, value)) for number, _, states in solved for s in states]
    # a single distant equilibrium near a pole would make any point admissible
    unit = np.append(limited(field, field.sizes(known), value), abs(value))
    found: list[Equilibrium] = []
    for number, whole, states in solved:
        sides = field.modes[number].sides
        for state in states:
            u = np.append(state, value)
            # whether it is admissible is open if a switching function is 0/0 or overflows
            complete &= not np.isnan(field.evaluate(number, u)[2]).any()
            admissible = field.admissible(number, u, unit)
            if admissible:
                wanted = not in_a_set(along, u, unit[:-1])
            elif sides is None:
                wanted = virtual
            else:
                wanted = virtual and not sides.escaping and field.virtual(number, u, unit)
            if wanted:
                found.append(point_at(field, number, u, admissible, continuum=whole))
    sets = sets_of(along, value) if with_sets else []
    corners = [corner for one in sets for corner in one.equilibria]
    found += [replace(corner, state=field.wrapped(corner.state)) for corner in corners]
    complete &= all(one.exact for one in sets) and all_known(along)
    distinct = _distinct(found, unit[:-1], field.periods)
    return Equilibria(distinct, "complete" if complete else "found", sets)


def _distinct(points: list[Equilibrium], unit: Array, periods: Array) -> list[Equilibrium]:
    """Return each admissible state once: two regions share those on an interface.

    A continuum takes precedence, except that ends of a continuum of pseudo-equilibria that is not
    an `EquilibriumSet` are listed in addition to the equilibria of the regions.
    """
    kept: list[Equilibrium] = []
    shared, count = np.empty((len(points), len(unit))), 0
    for point in sorted(points, key=lambda p: not p.continuum):
        if point.admissible:
            if among(point.state, shared[:count], unit, periods):
                continue
            if not (point.continuum and point.pseudo):
                shared[count] = point.state
                count += 1
        kept.append(point)
    order = {id(p): k for k, p in enumerate(points)}
    return sorted(kept, key=lambda p: order[id(p)])
