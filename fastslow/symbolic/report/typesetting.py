"""Typesetting of derivations in LaTeX."""

from __future__ import annotations

from collections.abc import Iterable

import sympy as sp

from fastslow.model.structure import real
from fastslow.model.typesetting import latex, latex_text
from fastslow.results.point_types import point_name
from fastslow.symbolic.closed_forms.boundaries import BoundaryForm
from fastslow.symbolic.closed_forms.conserved import ConservedQuantity
from fastslow.symbolic.closed_forms.equilibrium_sets import EDGE, EquilibriumSetForm
from fastslow.symbolic.closed_forms.forms import Continuum, CriticalPoint, EquilibriumForm
from fastslow.symbolic.closed_forms.regions import RegionForms
from fastslow.symbolic.closed_forms.stability import Stability
from fastslow.symbolic.closed_forms.symmetries import FreeDirection
from fastslow.symbolic.decimals import readable
from fastslow.symbolic.naming import LINE_WIDTH, named, text
from fastslow.symbolic.report.wording import too_long

#: A heading and its formulas.
Block = tuple[str, list[str]]

#: Text before a formula, the formula, and text after it.
Item = tuple[str, sp.Basic, str]


def paragraphs(blocks: Iterable[Block]) -> str:
    """Return paragraphs with displayed formulas, for a LaTeX document with amsmath."""
    texts = []
    for heading, formulas in blocks:
        body = " \\\\\n".join(f"  & {f}" for f in formulas)
        texts.append(f"\\paragraph{{{heading}}}\n\\begin{{align*}}\n{body}\n\\end{{align*}}")
    return "\n\n".join(texts) + "\n"


def displayed(blocks: Iterable[Block]) -> str:
    """Return one displayed formula, for notebooks."""
    rows = []
    for heading, formulas in blocks:
        rows.append(f"\\textbf{{{heading}}}")
        rows += [f"\\quad {f}" for f in formulas]
    return "$\\displaystyle \\begin{array}{l}\n" + " \\\\\n".join(rows) + "\n\\end{array}$"


def assumptions(conditions: Iterable[sp.Basic]) -> Block:
    """Return the block of the assumptions."""
    return "Assumptions", [_comma(conditions)]


def free_direction(free: FreeDirection) -> Block:
    """Return the block of a translation under which the rates are invariant."""
    moved = [rf"{_tex(real(n))} + c \, {_tex(e)}" for n, e in free.shift.items()]
    kept = [rf"{_tex(real(n))} = {_tex(e)}" for n, e in free.combinations.items()]
    return "Free direction", [r",\quad ".join(moved), r",\quad ".join(kept)]


def conserved(quantities: Iterable[ConservedQuantity]) -> Block:
    """Return the block of the conserved quantities."""
    each = [rf"{_tex(real(q.total))} = {_tex(q.expression)}" for q in quantities]
    return "Conserved", [r",\quad ".join(each)]


def equilibrium_set(form: EquilibriumSetForm) -> Block:
    """Return the block of an equilibrium set."""
    lines = [_tex(condition) for condition in form.conditions]
    lines += [rf"{_tex(real(n))} = {_tex(e)}" for n, e in form.state.items() if e != real(n)]
    for edge in form.edges:
        values = (f"{_tex(real(n))} = {_tex(e)}" for n, e in edge.items())
        lines.append(r"\text{edge: } " + r",\quad ".join(values))
    return f"Equilibrium set {latex_text(form.region)}", lines


def region(one: RegionForms, taken: set[str]) -> Block:
    """Return the block of a region."""
    lines = [_comma(one.conditions)] if one.conditions else []
    lines += [rf"\dot{{{_tex(real(n))}}} = {_tex(e)}" for n, e in one.rates.items()]
    for form in one.equilibria:
        lines += _equilibrium(form, taken)
    for continuum in one.continua:
        lines += _continuum(continuum, taken)
    lines.append(rf"J = {_tex(one.jacobian)}")
    lines += _stability(one.stability)
    for point in (*one.folds, *one.branch_points, *one.cusps, *one.hopf):
        lines += _point(point, taken)
    if one.no_hopf:
        lines.append(r"\text{no Hopf bifurcation}")
    return f"Region {latex_text(one.name)}", lines


def _equilibrium(form: EquilibriumForm, taken: set[str]) -> list[str]:
    given = () if form.type == "implicit" else form.parameters.items()
    items = _values([*given, *form.state.items()])
    items += _zeros((*(form.equations if form.type == "implicit" else ()), *form.conditions))
    forces = enumerate(form.contact_forces.values(), start=1)
    several = len(form.contact_forces) > 1
    items += [(rf"\lambda_{{{k}}} = " if several else r"\lambda = ", e, "") for k, e in forces]
    edge = form.note.startswith(EDGE)
    when = (sp.true, sp.true) if edge else (form.exists, form.admissible)
    lines = _set(r"\text{equilibrium: } ", items, taken, *when)
    if edge:
        lines.append(rf"\text{{{form.note}}}".replace("|", r"\textbar "))
    if form.parameter_range is not None:
        lines.append(r"\text{admissible range: } " + _tex(form.parameter_range))
    if form.discriminant is not None:
        lines.append(rf"\Delta = {_tex(form.discriminant)}")
    if form.stability.verdict != "depends":
        lines.append(rf"\text{{{form.stability.verdict} in the region}}")
    return lines


def _values(values: Iterable[tuple[str, sp.Expr]]) -> list[Item]:
    return [(f"{_tex(real(n))} = ", e, "") for n, e in values if e != real(n)]


def _zeros(equations: Iterable[sp.Expr]) -> list[Item]:
    return [("", e, " = 0") for e in equations]


def _set(
    head: str,
    items: list[Item],
    taken: set[str],
    exists: sp.Basic = sp.true,
    admissible: sp.Basic = sp.true,
) -> list[str]:
    """One line, or several for a long entry, with names for repeated subexpressions."""
    plain = admissible not in (sp.true, sp.false)
    admissible = readable(admissible)
    formulas = [readable(e) for _, e, _ in items] + ([admissible] if plain else [])
    size = sum(len(text(e)) for e in formulas)
    defined: list[tuple[sp.Symbol, sp.Basic]] = []
    if size > LINE_WIDTH:
        formulas, defined = named(formulas, taken)
    when = formulas[-1] if plain else admissible
    shown = [a + _tex(e) + b for (a, _, b), e in zip(items, formulas, strict=False)]
    lines = [head + r",\quad ".join(shown)]
    if size > LINE_WIDTH:
        # each value has a line of its own
        lines = [head + shown[0], *(rf"\quad {s}" for s in shown[1:])] if shown else [head]
    lines[-1] += _when(exists, when)
    if defined:
        means = r",\quad ".join(f"{_tex(s)} = {_tex(e)}" for s, e in defined)
        lines.append(r"\quad \text{with } " + means)
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


def _continuum(continuum: Continuum, taken: set[str]) -> list[str]:
    items = _values([*continuum.parameters.items(), *continuum.state.items()])
    items += _zeros(continuum.equations) + [("", c, "") for c in continuum.conditions]
    lines = _set(r"\text{continuum of equilibria: } ", items, taken)
    numbers = ", ".join(_tex(e) for e in continuum.eigenvalues)
    if numbers:
        lines[-1] += rf",\quad \lambda \in \{{{numbers}\}}"
    return lines


def _point(point: CriticalPoint, taken: set[str]) -> list[str]:
    items = _values([*point.parameters.items(), *point.state.items()]) + _zeros(point.equations)
    if point.frequency_squared is not None:
        items.append((r"\omega^2 = ", point.frequency_squared, ""))
    head = rf"\text{{{point_name(point.code)}: }} "
    return _set(head, items, taken, point.exists, point.admissible)


def boundary(form: BoundaryForm, taken: set[str]) -> Block:
    """Return the block of a boundary equilibrium."""
    joined = " and ".join(map(latex_text, form.regions))
    where = "between" if len(form.regions) > 1 else "of"
    items = _values([*form.parameters.items(), *form.state.items()]) + _zeros(form.equations)
    lines = _set("", items, taken, sp.true, form.admissible)
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
    return f"Boundary equilibrium {where} {joined}", lines


def _when(exists: sp.Basic, admissible: sp.Basic) -> str:
    if exists == sp.false:
        return r"\quad \text{(never real)}"
    if admissible == sp.false:
        return r"\quad \text{(virtual)}"
    return r"\quad \text{iff } " + _tex(admissible) if admissible != sp.true else ""


def _named(name: str) -> str:
    return rf"\text{{{latex_text(name)}}}"


def _comma(conditions: Iterable[sp.Basic]) -> str:
    return r",\quad ".join(_tex(c) for c in conditions)


def _tex(expression: sp.Basic) -> str:
    matrix = isinstance(expression, sp.MatrixBase)
    expression = expression.applyfunc(readable) if matrix else readable(expression)
    if not matrix and too_long(expression):
        return r"\langle\text{a long expression}\rangle"
    return latex(expression)
