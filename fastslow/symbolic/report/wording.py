"""A derivation as text, in lines that can be read."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import sympy as sp

from fastslow.model.structure import real
from fastslow.results.point_types import point_name
from fastslow.symbolic.closed_forms.equilibrium_sets import EDGE
from fastslow.symbolic.report.decimals import SHOWN, readable, rounds, without_scale
from fastslow.symbolic.report.naming import WIDTH, named, text
from fastslow.symbolic.solving.algebra import longer

if TYPE_CHECKING:
    from fastslow.symbolic.closed_forms.boundaries import BoundaryForm
    from fastslow.symbolic.closed_forms.equilibrium_sets import EquilibriumSetForm
    from fastslow.symbolic.closed_forms.forms import Continuum, CriticalPoint, EquilibriumForm
    from fastslow.symbolic.closed_forms.regions import RegionForms
    from fastslow.symbolic.derivation import Derivation

#: Longer expressions, in parts of their tree, are not printed; the objects hold them whole.
PARTS = 600

#: What is said where numbers are rounded.
ROUNDED = f"Long numbers are printed to {SHOWN} digits; the objects have them exactly."


@dataclass(frozen=True)
class Piece:
    """A stretch of text around at most one formula.

    Parameters
    ----------
    before : str
    formula : sympy.Basic or None
    after : str
    separator : str
        Between this piece and the one before it.
    """

    before: str
    formula: sp.Basic | None = None
    after: str = ""
    separator: str = ", "

    def shown(self, formula: sp.Basic | None) -> str:
        """The text with the formula given in place of its own."""
        if formula is None:
            return self.before
        if not folds(formula):
            printed = text(formula)
        else:
            kind = "condition" if isinstance(formula, sp.logic.boolalg.Boolean) else "expression"
            printed = f"(a long {kind})"
        return f"{self.before}{printed}{self.after}"


def summary(law: Derivation) -> str:
    """Give what was derived, region by region."""
    frozen = f" with {', '.join(law.free)} frozen" if law.free else ""
    assumed = ", ".join(map(str, law.assumptions)) or "nothing"
    taken = names_of(law)
    lines = _wrapped(
        f"Derivation of {', '.join(law.states)}{frozen}; assumed:", assumed.split(", "), "  "
    )
    if any(map(rounds, _formulas(law))):
        lines += _sentence("", ROUNDED, "  ")
    for free in (*law.free_directions, *law.conserved_quantities[:1]):
        lines += _sentence("", str(free), "  ")
    for region in law.regions.values():
        lines += _region(region, taken)
    for one in law.equilibrium_sets:
        lines += entry(_equilibrium_set(one), taken, "  ")
    for form in law.boundary_equilibria:
        lines += entry(_boundary(form), taken, "  ")
    return "\n".join(lines)


def _formulas(law: Derivation) -> Iterator[sp.Basic]:
    """What the entries of a derivation print."""
    for region in law.regions.values():
        yield from region.conditions
        points = (*region.folds, *region.branch_points, *region.cusps, *region.hopf)
        for form in region.equilibria:
            yield from (*form.state.values(), *form.equations, form.admissible)
            yield from (*form.parameter.values(), *form.conditions)
        for point in points:
            yield from (*point.state.values(), *point.equations, point.admissible)
            yield from point.parameters.values()
    for place in law.boundary_equilibria:
        yield from (*place.state.values(), *place.parameters.values(), *place.equations)


def names_of(law: Derivation) -> set[str]:
    """Names that the model uses, which no subexpression may get."""
    names = {*law.states, *law.free, *law.regions}
    for region in law.regions.values():
        for rate in region.rates.values():
            names |= {s.name for s in rate.free_symbols}
        for condition in region.conditions:
            names |= {s.name for s in condition.free_symbols}
    for form in law.boundary_equilibria:
        if form.clarke is not None:
            names.add(form.clarke.weight.name)
    return names


def entry(pieces: Sequence[Piece], taken: set[str], indent: str) -> list[str]:
    """Lines of one entry; what a long one repeats is given a name in a last line.

    Examples
    --------
    >>> a = sp.Symbol("a")
    >>> entry([Piece("fold: x = ", a + 1), Piece("y = ", a - 1)], {"a"}, "  ")
    ['  fold: x = a + 1, y = a - 1']
    """
    pieces = [_readable(p) for p in pieces]
    formulas = [p.formula for p in pieces]
    whole = _joined(pieces, [p.shown(f) for p, f in zip(pieces, formulas, strict=True)])
    folded = any(f is not None and folds(f) for f in formulas)
    if len(indent) + len(whole) <= WIDTH and not folded:
        return [indent + whole]
    inside = [f for f in formulas if f is not None]
    short, defined = named(inside, taken)
    replaced = iter(short)
    texts = [p.shown(None if p.formula is None else next(replaced)) for p in pieces]
    lines = _lines(pieces, texts, indent)
    used = set().union(set(), *(e.free_symbols for e in short if not folds(e)))
    meaning = []
    for symbol, value in reversed(defined):
        if symbol in used:
            used |= value.free_symbols
            meaning.append(Piece(f"{symbol} = ", value))
    meaning.reverse()
    if meaning:
        first = Piece(f"with {meaning[0].before}", meaning[0].formula)
        parts = [first, *meaning[1:]]
        lines += _lines(parts, [p.shown(p.formula) for p in parts], indent + "    ")
    return lines


def _readable(piece: Piece) -> Piece:
    if piece.formula is None:
        return piece
    zero = piece.after == " = 0" and isinstance(piece.formula, sp.Expr)
    return replace(piece, formula=(without_scale if zero else readable)(piece.formula))


def folds(formula: sp.Basic) -> bool:
    """Whether a formula is too long to be printed."""
    return longer(formula, PARTS) or len(text(formula)) > WIDTH


def _joined(pieces: Sequence[Piece], texts: Sequence[str]) -> str:
    result = texts[0]
    for piece, part in zip(pieces[1:], texts[1:], strict=True):
        result += piece.separator + part
    return result


def _lines(pieces: Sequence[Piece], texts: Sequence[str], indent: str) -> list[str]:
    """Pieces one after another, with a new line where one does not fit."""
    lines = [indent + texts[0]]
    for piece, part in zip(pieces[1:], texts[1:], strict=True):
        if len(lines[-1]) + len(piece.separator) + len(part) <= WIDTH:
            lines[-1] += piece.separator + part
        else:
            lines[-1] += piece.separator.rstrip()
            lines.append(f"{indent}    {part}")
    return lines


def _wrapped(head: str, words: Sequence[str], indent: str) -> list[str]:
    pieces = [Piece(f"{head} {words[0]}"), *(Piece(w) for w in words[1:])]
    lines = _lines(pieces, [p.before for p in pieces], "")
    return [lines[0], *(indent + line for line in lines[1:])]


def _region(region: RegionForms, taken: set[str]) -> list[str]:
    where = [Piece("", c).shown(readable(c)) for c in region.conditions] or ["everywhere"]
    lines = _wrapped(f"  {region.name}:", where, "  ")
    for form in region.equilibria:
        lines += entry(_equilibrium(form), taken, "    ")
    for continuum in region.continua:
        lines += entry(_continuum(continuum), taken, "    ")
    for point in (*region.folds, *region.branch_points, *region.cusps, *region.hopf):
        lines += entry(_point(point), taken, "    ")
    if region.no_hopf:
        lines += _sentence("no Hopf: ", region.no_hopf)
    for note in region.notes:
        lines += _sentence("note: ", note)
    return lines


def _sentence(head: str, sentence: str, indent: str = "    ") -> list[str]:
    words = sentence.split(" ")
    pieces = [Piece(head + words[0]), *(Piece(w, separator=" ") for w in words[1:])]
    return _lines(pieces, [p.before for p in pieces], indent)


def _values(head: str, values: Sequence[tuple[str, sp.Expr]]) -> list[Piece]:
    """Each value after its name, the first after the head."""
    pieces = [Piece(f"{n} = ", e) for n, e in values if e != real(n)]
    if not pieces:
        return [Piece(head.rstrip(": "))]
    return [Piece(head + pieces[0].before, pieces[0].formula), *pieces[1:]]


def _zeros(equations: Sequence[sp.Expr]) -> list[Piece]:
    return [Piece("", e, " = 0", ", " if k else "; where ") for k, e in enumerate(equations)]


def _equilibrium(form: EquilibriumForm) -> list[Piece]:
    given = () if form.kind == "implicit" else form.parameter.items()
    pieces = _values("equilibrium: ", [*given, *form.state.items()])
    if form.kind == "implicit":
        pieces += _zeros(form.equations)
    pieces += _zeros(form.conditions)
    verdict = form.stability.verdict
    if verdict == "depends":
        short = [c for c in map(readable, form.stability.conditions) if not folds(c)]
        long = len(form.stability.conditions) - len(short)
        pieces += [
            Piece("" if k else "depends on ", c, separator=", " if k else "; ")
            for k, c in enumerate(short)
        ]
        if long:
            one = "1 long condition" if long == 1 else f"{long} long conditions"
            pieces.append(
                Piece(f"and on {one}", separator=" ")
                if short
                else Piece(f"depends on {one}", separator="; ")
            )
    else:
        pieces.append(Piece(verdict, separator="; "))
    if form.note.startswith(EDGE):
        return [*pieces, Piece(form.note, separator="; ")]
    return [*pieces, *_when(form.exists, form.admissible)]


def _equilibrium_set(form: EquilibriumSetForm) -> list[Piece]:
    kinds = {True: " (sticking)", False: " (escaping)", None: ""}
    where = ", ".join(f"{name} = 0" for name in form.interfaces)
    first, *others = form.conditions
    head = f"equilibrium set{kinds[form.attracting]} {form.region} on {where}: "
    pieces = [Piece(head, first), *(Piece("", condition) for condition in others)]
    pieces += [Piece(f"{n} = ", e) for n, e in form.state.items() if e != real(n)]
    for k, edge in enumerate(form.edges):
        (free,) = form.free
        name = "edges " if k == 0 else ""
        separator = "; " if k == 0 else " and "
        pieces.append(Piece(f"{name}{free} = ", edge[free.name], separator=separator))
    return pieces


def _when(exists: sp.Basic, admissible: sp.Basic) -> list[Piece]:
    if admissible == sp.false:
        return [Piece("virtual" if exists != sp.false else "never real", separator="; ")]
    if admissible == sp.true:
        return []
    return [Piece("admissible iff ", admissible, separator="; ")]


def _continuum(continuum: Continuum) -> list[Piece]:
    at = _values("continuum at ", list(continuum.parameters.items()))
    if len(at) == 1 and at[0].formula is None:
        at = [Piece("continuum at all parameters")]
    bound = set().union(set(), *(e.free_symbols for e in continuum.equations))
    free = [str(s) for s in continuum.free if s not in bound]
    pieces = [*at]
    values = [(n, e) for n, e in continuum.state.items() if e != real(n)]
    first = [Piece(f"any {', '.join(free)}")] if free else []
    rest = [*first, *(Piece(f"{n} = ", e) for n, e in values)]
    if rest:
        rest[0] = Piece(rest[0].before, rest[0].formula, separator=": ")
    return [*pieces, *rest, *_zeros(continuum.equations)]


def _point(point: CriticalPoint) -> list[Piece]:
    name = point_name(point.code)
    pieces = _values(f"{name}: ", [*point.parameters.items(), *point.state.items()])
    return [*pieces, *_zeros(point.equations), *_when(point.exists, point.admissible)]


def _boundary(form: BoundaryForm) -> list[Piece]:
    head = f"boundary equilibrium on {form.interface} = 0 ({' | '.join(form.regions)}): "
    pieces = _values(head, [*form.parameters.items(), *form.state.items()])
    bound = set().union(set(), *(e.free_symbols for e in (*form.equations, *form.state.values())))
    free = [n for n, e in form.state.items() if e == real(n) and real(n) not in bound - {e}]
    left = set().union(set(), *(e.free_symbols for e in form.equations))
    free = [n for n in free if real(n) not in left]
    if free:
        pieces.append(Piece(f"any {', '.join(free)}"))
    pieces += _zeros(form.equations)
    if form.clarke is not None:
        pieces.append(Piece("Clarke determinant ", form.clarke.determinant, separator="; "))
    return [*pieces, Piece(form.type, separator="; "), *_when(sp.true, form.admissible)]
