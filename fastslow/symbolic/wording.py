"""A derivation as plain text, a few lines for each region."""

from __future__ import annotations

from typing import TYPE_CHECKING

import sympy as sp

from fastslow.model.structure import real
from fastslow.results.point_types import point_name
from fastslow.symbolic.algebra import longer

if TYPE_CHECKING:
    from fastslow.symbolic.boundaries import BoundaryForm
    from fastslow.symbolic.derivation import Derivation
    from fastslow.symbolic.forms import Continuum, CriticalPoint, EquilibriumForm
    from fastslow.symbolic.regions import RegionForms

#: Longer expressions are not printed; the objects hold them whole.
PARTS = 600


def summary(law: Derivation) -> str:
    """Give what was derived, region by region."""
    frozen = f" with {', '.join(law.free)} frozen" if law.free else ""
    assumed = ", ".join(map(str, law.assumptions)) or "nothing"
    lines = [f"Derivation of {', '.join(law.states)}{frozen}; assumed: {assumed}"]
    for region in law.regions.values():
        lines += _region(region)
    lines += [f"  {_boundary(b)}" for b in law.boundary_equilibria]
    return "\n".join(lines)


def shown(expression: object) -> str:
    """Give an expression as text, or a note where it is too long to read.

    Examples
    --------
    >>> shown(sp.Symbol("x") + 1)
    'x + 1'
    """
    if isinstance(expression, sp.Basic) and longer(expression, PARTS):
        return "(a long expression)"
    return str(expression)


def _region(region: RegionForms) -> list[str]:
    where = ", ".join(map(str, region.conditions)) or "everywhere"
    lines = [f"  {region.name}: {where}"]
    lines += [f"    {_equilibrium(e)}" for e in region.equilibria]
    lines += [f"    {_continuum(c)}" for c in region.continua]
    points = (*region.folds, *region.branch_points, *region.cusps, *region.hopf)
    lines += [f"    {_point(p)}" for p in points]
    if region.no_hopf:
        lines.append(f"    no Hopf: {region.no_hopf}")
    lines += [f"    note: {note}" for note in region.notes]
    return lines


def _equilibrium(form: EquilibriumForm) -> str:
    fixed = [f"{n} = {shown(e)}" for n, e in form.state.items() if e != real(n)]
    text = ", ".join([*(f"{n} = {shown(e)}" for n, e in form.parameter.items()), *fixed])
    if form.kind == "implicit":
        text = ", ".join([*(f"{shown(e)} = 0" for e in form.equations), *fixed])
    text = f"equilibrium: {text}; {form.stability.verdict}"
    if form.stability.verdict == "depends":
        text += " on " + ", ".join(map(shown, form.stability.conditions))
    return text + _when(form.exists, form.admissible)


def _when(exists: sp.Basic, admissible: sp.Basic) -> str:
    if admissible == sp.false:
        return "; virtual" if exists != sp.false else "; never real"
    return f"; admissible iff {shown(admissible)}" if admissible != sp.true else ""


def _continuum(continuum: Continuum) -> str:
    at = ", ".join(f"{n} = {shown(e)}" for n, e in continuum.parameters.items()) or "all parameters"
    fixed = ", ".join(f"{n} = {shown(e)}" for n, e in continuum.state.items() if e != real(n))
    free = ", ".join(map(str, continuum.free))
    return f"continuum at {at}: any {free}" + (f", {fixed}" if fixed else "")


def _point(point: CriticalPoint) -> str:
    values = {**point.parameters, **point.state}
    text = ", ".join(f"{n} = {shown(e)}" for n, e in values.items() if e != real(n))
    if point.equations:
        text = ", ".join([text, *(f"{shown(e)} = 0" for e in point.equations)]).strip(", ")
    return f"{point_name(point.code)}: {text}{_when(point.exists, point.admissible)}"


def _boundary(form: BoundaryForm) -> str:
    values = {**form.parameters, **form.state}
    text = ", ".join(f"{n} = {shown(e)}" for n, e in values.items() if e != real(n))
    text = f"boundary equilibrium on {form.interface} = 0 ({' | '.join(form.regions)}): {text}"
    if form.clarke is not None:
        text += f"; Clarke determinant {shown(form.clarke.determinant)}"
    return f"{text}; {form.type}" + _when(sp.true, form.admissible)
