"""Plain text of what is derived."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import sympy as sp

from fastslow.model.structure import real
from fastslow.results.point_types import point_name
from fastslow.symbolic.algebra import longer
from fastslow.symbolic.closed_forms.boundaries import BoundaryForm
from fastslow.symbolic.closed_forms.equilibrium_sets import EDGE, EquilibriumSetForm
from fastslow.symbolic.closed_forms.forms import Continuum, CriticalPoint, EquilibriumForm
from fastslow.symbolic.closed_forms.regions import RegionForms
from fastslow.symbolic.decimals import SHOWN_DIGITS, readable, without_scale
from fastslow.symbolic.naming import LINE_WIDTH, named, text

#: Expressions with more nodes are not printed; the objects contain them in full.
REPORTED_NODES = 600

#: Largest number of names in a list.
LISTED_NAMES = 8

#: Remark printed if numbers are rounded.
ROUNDED = f"Long numbers are rounded to {SHOWN_DIGITS} digits in print and stored exactly."


@dataclass(frozen=True)
class Fragment:
    """A fragment of text with at most one formula.

    Parameters
    ----------
    before : str
    formula : sympy.Basic or None
    after : str
    separator : str
        Text between the previous fragment and this one.
    """

    before: str
    formula: sp.Basic | None = None
    after: str = ""
    separator: str = ", "

    def shown(self, formula: sp.Basic | None) -> str:
        """Return the text, with another formula in place of its own."""
        if formula is None:
            return self.before
        if not too_long(formula):
            printed = text(formula)
        else:
            kind = "condition" if isinstance(formula, sp.logic.boolalg.Boolean) else "expression"
            printed = f"(a long {kind})"
        return f"{self.before}{printed}{self.after}"


def left_out(
    regions: Sequence[str], pairs: Sequence[tuple[str, str]], sliding: Sequence[str] = ()
) -> list[str]:
    """Return sentences on regions, pairs of neighbours and sliding motions past the budget of work.

    Examples
    --------
    >>> left_out(["S1", "S2"], [])[0]
    'past the budget of work: regions S1, S2'
    """
    sentences = []
    if regions:
        sentences.append(f"past the budget of work: regions {_first(regions)}")
    if pairs:
        between = _first([" and ".join(pair) for pair in pairs])
        sentences.append(f"past the budget of work: boundary equilibria between {between}")
    if sliding:
        sentences.append(f"past the budget of work: sets of equilibria of {_first(sliding)}")
    if regions or pairs:
        sentences.append("derive(model, regions=[...]) derives some of the regions")
    return sentences


def _first(names: Sequence[str]) -> str:
    """The first names of a list, with the number of the others."""
    shown = ", ".join(names[:LISTED_NAMES])
    return shown if len(names) <= LISTED_NAMES else f"{shown} and {len(names) - LISTED_NAMES} more"


def entry(fragments: Sequence[Fragment], taken: set[str], indent: str) -> list[str]:
    """Return the lines of one entry, with repeated subexpressions defined in a last line.

    Examples
    --------
    >>> a = sp.Symbol("a")
    >>> entry([Fragment("fold: x = ", a + 1), Fragment("y = ", a - 1)], {"a"}, "  ")
    ['  fold: x = a + 1, y = a - 1']
    """
    fragments = [_readable(p) for p in fragments]
    formulas = [p.formula for p in fragments]
    whole = _joined(fragments, [p.shown(f) for p, f in zip(fragments, formulas, strict=True)])
    abridged = any(f is not None and too_long(f) for f in formulas)
    if len(indent) + len(whole) <= LINE_WIDTH and not abridged:
        return [indent + whole]
    inside = [f for f in formulas if f is not None]
    short, defined = named(inside, taken)
    replaced = iter(short)
    texts = [p.shown(None if p.formula is None else next(replaced)) for p in fragments]
    lines = _lines(fragments, texts, indent)
    used = set().union(set(), *(e.free_symbols for e in short if not too_long(e)))
    meaning = []
    for symbol, value in reversed(defined):
        if symbol in used:
            used |= value.free_symbols
            meaning.append(Fragment(f"{symbol} = ", value))
    meaning.reverse()
    if meaning:
        first = Fragment(f"with {meaning[0].before}", meaning[0].formula)
        fragments = [first, *meaning[1:]]
        lines += _lines(fragments, [p.shown(p.formula) for p in fragments], indent + "    ")
    return lines


def _readable(fragment: Fragment) -> Fragment:
    if fragment.formula is None:
        return fragment
    zero = fragment.after == " = 0" and isinstance(fragment.formula, sp.Expr)
    return replace(fragment, formula=(without_scale if zero else readable)(fragment.formula))


def too_long(formula: sp.Basic) -> bool:
    """Check whether a formula is too long to be printed."""
    return longer(formula, REPORTED_NODES) or len(text(formula)) > LINE_WIDTH


def _joined(fragments: Sequence[Fragment], texts: Sequence[str]) -> str:
    result = texts[0]
    for fragment, part in zip(fragments[1:], texts[1:], strict=True):
        result += fragment.separator + part
    return result


def _lines(fragments: Sequence[Fragment], texts: Sequence[str], indent: str) -> list[str]:
    """Join fragments, with line breaks between them."""
    lines = [indent + texts[0]]
    for fragment, part in zip(fragments[1:], texts[1:], strict=True):
        if len(lines[-1]) + len(fragment.separator) + len(part) <= LINE_WIDTH:
            lines[-1] += fragment.separator + part
        else:
            lines[-1] += fragment.separator.rstrip()
            lines.append(f"{indent}    {part}")
    return lines


def wrapped(head: str, words: Sequence[str], indent: str) -> list[str]:
    """Return the lines of a heading with a list of words, wrapped between these."""
    fragments = [Fragment(f"{head} {words[0]}"), *(Fragment(w) for w in words[1:])]
    lines = _lines(fragments, [p.before for p in fragments], "")
    return [lines[0], *(indent + line for line in lines[1:])]


def region(one: RegionForms, taken: set[str]) -> list[str]:
    """Return the lines of a one."""
    where = [Fragment("", c).shown(readable(c)) for c in one.conditions] or ["everywhere"]
    lines = wrapped(f"  {one.name}:", where, "  ")
    for form in one.equilibria:
        lines += entry(_equilibrium(form), taken, "    ")
    for continuum in one.continua:
        lines += entry(_continuum(continuum), taken, "    ")
    for point in (*one.folds, *one.branch_points, *one.cusps, *one.hopf):
        lines += entry(_point(point), taken, "    ")
    if one.no_hopf:
        lines += sentence("no Hopf: ", one.no_hopf)
    for note in one.notes:
        lines += sentence("note: ", note)
    return lines


def sentence(head: str, words: str, indent: str = "    ") -> list[str]:
    """Return the wrapped lines of a sentence.

    Examples
    --------
    >>> sentence("note: ", "exact")
    ['    note: exact']
    """
    first, *others = words.split(" ")
    fragments = [Fragment(head + first), *(Fragment(w, separator=" ") for w in others)]
    return _lines(fragments, [p.before for p in fragments], indent)


def _values(head: str, values: Sequence[tuple[str, sp.Expr]]) -> list[Fragment]:
    """Fragments ``name = value``, the first one after a heading."""
    fragments = [Fragment(f"{n} = ", e) for n, e in values if e != real(n)]
    if not fragments:
        return [Fragment(head.rstrip(": "))]
    return [Fragment(head + fragments[0].before, fragments[0].formula), *fragments[1:]]


def _zeros(equations: Sequence[sp.Expr]) -> list[Fragment]:
    return [Fragment("", e, " = 0", ", " if k else "; where ") for k, e in enumerate(equations)]


def _equilibrium(form: EquilibriumForm) -> list[Fragment]:
    given = () if form.type == "implicit" else form.parameters.items()
    fragments = _values("equilibrium: ", [*given, *form.state.items()])
    if form.type == "implicit":
        fragments += _zeros(form.equations)
    fragments += _zeros(form.conditions)
    forces = form.contact_forces.items()
    fragments += [Fragment(f"contact force on {n} ", e, separator="; ") for n, e in forces]
    verdict = form.stability.verdict
    if verdict == "depends":
        short = [c for c in map(readable, form.stability.conditions) if not too_long(c)]
        long = len(form.stability.conditions) - len(short)
        fragments += [
            Fragment("" if k else "depends on ", c, separator=", " if k else "; ")
            for k, c in enumerate(short)
        ]
        if long:
            one = "1 long condition" if long == 1 else f"{long} long conditions"
            fragments.append(
                Fragment(f"and on {one}", separator=" ")
                if short
                else Fragment(f"depends on {one}", separator="; ")
            )
    else:
        fragments.append(Fragment(verdict, separator="; "))
    if form.note.startswith(EDGE):
        return [*fragments, Fragment(form.note, separator="; ")]
    return [*fragments, *_when(form.exists, form.admissible)]


def equilibrium_set(form: EquilibriumSetForm, taken: set[str]) -> list[str]:
    """Return the lines of an equilibrium set."""
    kinds = {True: " (sticking)", False: " (escaping)", None: ""}
    where = ", ".join(f"{name} = 0" for name in form.interfaces)
    first, *others = form.conditions
    head = f"equilibrium set{kinds[form.attracting]} {form.region} on {where}: "
    fragments = [Fragment(head, first), *(Fragment("", condition) for condition in others)]
    fragments += [Fragment(f"{n} = ", e) for n, e in form.state.items() if e != real(n)]
    for k, edge in enumerate(form.edges):
        (free,) = form.free
        name = "edges " if k == 0 else ""
        separator = "; " if k == 0 else " and "
        fragments.append(Fragment(f"{name}{free} = ", edge[free.name], separator=separator))
    return entry(fragments, taken, "  ")


def _when(exists: sp.Basic, admissible: sp.Basic) -> list[Fragment]:
    if admissible == sp.false:
        return [Fragment("virtual" if exists != sp.false else "never real", separator="; ")]
    if admissible == sp.true:
        return []
    return [Fragment("admissible iff ", admissible, separator="; ")]


def _continuum(continuum: Continuum) -> list[Fragment]:
    at = _values("continuum at ", list(continuum.parameters.items()))
    if len(at) == 1 and at[0].formula is None:
        at = [Fragment("continuum at all parameter values")]
    bound = set().union(set(), *(e.free_symbols for e in continuum.equations))
    free = [str(s) for s in continuum.free if s not in bound]
    fragments = [*at]
    values = [(n, e) for n, e in continuum.state.items() if e != real(n)]
    first = [Fragment(f"{', '.join(free)} arbitrary")] if free else []
    rest = [*first, *(Fragment(f"{n} = ", e) for n, e in values)]
    if rest:
        rest[0] = Fragment(rest[0].before, rest[0].formula, separator=": ")
    return [*fragments, *rest, *_zeros(continuum.equations)]


def _point(point: CriticalPoint) -> list[Fragment]:
    name = point_name(point.code)
    fragments = _values(f"{name}: ", [*point.parameters.items(), *point.state.items()])
    return [*fragments, *_zeros(point.equations), *_when(point.exists, point.admissible)]


def boundary(form: BoundaryForm, taken: set[str]) -> list[str]:
    """Return the lines of a boundary equilibrium."""
    on = form.interface if "=" in form.interface else f"{form.interface} = 0"
    head = f"boundary equilibrium on {on} ({' | '.join(form.regions)}): "
    fragments = _values(head, [*form.parameters.items(), *form.state.items()])
    bound = set().union(set(), *(e.free_symbols for e in (*form.equations, *form.state.values())))
    free = [n for n, e in form.state.items() if e == real(n) and real(n) not in bound - {e}]
    left = set().union(set(), *(e.free_symbols for e in form.equations))
    free = [n for n in free if real(n) not in left]
    if free:
        fragments.append(Fragment(f"{', '.join(free)} arbitrary"))
    fragments += _zeros(form.equations)
    if form.clarke is not None:
        fragments.append(Fragment("Clarke determinant ", form.clarke.determinant, separator="; "))
    fragments.append(Fragment(form.type, separator="; "))
    if form.type == "depends" and "=" in form.interface:
        fragments.append(Fragment("on the sign of ", form.test, ", + for persistence", " "))
    return entry([*fragments, *_when(sp.true, form.admissible)], taken, "  ")
