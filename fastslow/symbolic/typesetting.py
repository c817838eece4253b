"""A derivation as LaTeX."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import sympy as sp

from fastslow.model.structure import real
from fastslow.results.point_types import point_name
from fastslow.symbolic.algebra import longer
from fastslow.symbolic.forms import Continuum, CriticalPoint, EquilibriumForm
from fastslow.symbolic.stability import Stability
from fastslow.symbolic.wording import PARTS

if TYPE_CHECKING:
    from fastslow.symbolic.boundaries import BoundaryForm
    from fastslow.symbolic.derivation import Derivation
    from fastslow.symbolic.regions import RegionForms

#: A heading and its formulas.
Block = tuple[str, list[str]]


def derivation_latex(law: Derivation) -> str:
    """Paragraphs with displayed formulas, for a LaTeX document with amsmath."""
    parts = []
    for heading, formulas in _blocks(law):
        body = " \\\\\n".join(f"  & {f}" for f in formulas)
        parts.append(f"\\paragraph{{{heading}}}\n\\begin{{align*}}\n{body}\n\\end{{align*}}")
    return "\n\n".join(parts) + "\n"


def derivation_display(law: Derivation) -> str:
    """One displayed formula, as notebooks show it."""
    rows = []
    for heading, formulas in _blocks(law):
        rows.append(f"\\textbf{{{heading}}}")
        rows += [f"\\quad {f}" for f in formulas]
    return "$\\displaystyle \\begin{array}{l}\n" + " \\\\\n".join(rows) + "\n\\end{array}$"


def _blocks(law: Derivation) -> list[Block]:
    blocks: list[Block] = []
    if law.assumptions:
        blocks.append(("Assumptions", [_comma(law.assumptions)]))
    for region in law.regions.values():
        blocks.append((f"Region {region.name}", _region(region)))
    for form in law.boundary_equilibria:
        joined = " and ".join(form.regions)
        blocks.append((f"Boundary equilibrium between {joined}", _boundary(form)))
    return blocks


def _region(region: RegionForms) -> list[str]:
    lines = [_comma(region.conditions)] if region.conditions else []
    lines += [rf"\dot{{{_tex(real(n))}}} = {_tex(e)}" for n, e in region.rates.items()]
    for form in region.equilibria:
        lines += _equilibrium(form)
    for continuum in region.continua:
        lines.append(_continuum(continuum))
    lines.append(rf"J = {_tex(region.jacobian)}")
    lines += _stability(region.stability)
    for point in (*region.folds, *region.branch_points, *region.cusps, *region.hopf):
        lines.append(_point(point))
    if region.no_hopf:
        lines.append(r"\text{no Hopf bifurcation}")
    return lines


def _equilibrium(form: EquilibriumForm) -> list[str]:
    values = [f"{_tex(real(n))} = {_tex(e)}" for n, e in form.parameter.items()]
    if form.kind == "implicit":
        values += [f"{_tex(e)} = 0" for e in form.equations]
    values += [f"{_tex(real(n))} = {_tex(e)}" for n, e in form.state.items() if e != real(n)]
    lines = [
        r"\text{equilibrium: } " + r",\quad ".join(values) + _when(form.exists, form.admissible)
    ]
    if form.parameter_range is not None:
        lines.append(r"\text{admissible range: } " + _tex(form.parameter_range))
    if form.discriminant is not None:
        lines.append(rf"\Delta = {_tex(form.discriminant)}")
    if form.stability.verdict != "depends":
        lines.append(rf"\text{{{form.stability.verdict} in the region}}")
    return lines


def _stability(stability: Stability) -> list[str]:
    conditions = [f"{_tex(e)} > 0" for e in stability.routh_hurwitz if not e.is_positive]
    if any(e.is_nonpositive for e in stability.routh_hurwitz):
        verdict = r"\text{never asymptotically stable}"
    else:
        verdict = r"\text{stable iff } " + r",\quad ".join(conditions)
    return [
        rf"\operatorname{{tr}} J = {_tex(stability.trace)},\quad "
        rf"\det J = {_tex(stability.determinant)}",
        rf"\chi(\lambda) = {_tex(stability.characteristic_polynomial)}",
        verdict if conditions else r"\text{asymptotically stable}",
    ]


def _continuum(continuum: Continuum) -> str:
    values = [f"{_tex(real(n))} = {_tex(e)}" for n, e in continuum.parameters.items()]
    values += [f"{_tex(real(n))} = {_tex(e)}" for n, e in continuum.state.items() if e != real(n)]
    values += [_tex(c) for c in continuum.conditions]
    numbers = ", ".join(_tex(e) for e in continuum.eigenvalues)
    text = r"\text{continuum of equilibria: } " + r",\quad ".join(values)
    return text + (rf",\quad \lambda \in \{{{numbers}\}}" if numbers else "")


def _point(point: CriticalPoint) -> str:
    values = {**point.parameters, **point.state}
    shown = [f"{_tex(real(n))} = {_tex(e)}" for n, e in values.items() if e != real(n)]
    shown += [f"{_tex(e)} = 0" for e in point.equations]
    if point.frequency_squared is not None:
        shown.append(rf"\omega^2 = {_tex(point.frequency_squared)}")
    name = point_name(point.code)
    return rf"\text{{{name}: }} " + r",\quad ".join(shown) + _when(point.exists, point.admissible)


def _boundary(form: BoundaryForm) -> list[str]:
    values = {**form.parameters, **form.state}
    shown = [f"{_tex(real(n))} = {_tex(e)}" for n, e in values.items() if e != real(n)]
    shown += [f"{_tex(e)} = 0" for e in form.equations]
    lines = [r",\quad ".join(shown) + _when(sp.true, form.admissible)]
    if form.clarke is not None:
        path = form.clarke
        q = _tex(path.weight)
        lines.append(
            rf"J({q}) = {_tex(path.matrix)},\quad \det J({q}) = {_tex(path.determinant)},\quad "
            rf"\operatorname{{tr}} J({q}) = {_tex(path.trace)}"
        )
        for mark, value in (("*", path.q_zero), (r"\mathrm{Hopf}", path.q_hopf)):
            if value is not None:
                lines.append(rf"{q}_{{{mark}}} = {_tex(value)}")
        lines += [rf"{q}_{{\mathbb{{C}}}} = {_tex(value)}" for value in path.q_complex]
    lines.append(rf"\text{{{form.type}}}")
    return lines


def _when(exists: sp.Basic, admissible: sp.Basic) -> str:
    if exists == sp.false:
        return r"\quad \text{(never real)}"
    if admissible == sp.false:
        return r"\quad \text{(virtual)}"
    return r"\quad \text{iff } " + _tex(admissible) if admissible != sp.true else ""


def _named(name: str) -> str:
    return rf"\text{{{name}}}"


def _comma(conditions: Iterable[sp.Basic]) -> str:
    return r",\quad ".join(_tex(c) for c in conditions)


def _tex(expression: sp.Basic) -> str:
    if longer(expression, PARTS):
        return r"\langle\text{a long expression}\rangle"
    return str(sp.latex(expression))
