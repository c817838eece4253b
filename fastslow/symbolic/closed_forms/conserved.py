"""Linear conserved quantities (first integrals)."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import sympy as sp

from fastslow.model.model import Model
from fastslow.model.structure import real
from fastslow.results.base.display import Displayed
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.symbolic.algebra import rational_form
from fastslow.symbolic.closed_forms.symmetries import MOST_STATES, constant_null_space


@dataclass(frozen=True)
class ConservedQuantity(Displayed):
    """A linear combination of the states that is conserved in every region.

    If c·f = 0 for a constant vector c, each value of c·x has its own equilibria, so that none
    is isolated: the total population of an epidemic, an enzyme free and bound. With its
    value as a parameter one state can be eliminated.

    Parameters
    ----------
    expression : sympy.Expr
        c·x, in the states.
    total : str
        Name of its value, not used in the model.
    eliminated : tuple of str
        States eliminated by all conserved quantities together.
    combinations : NamedMapping of sympy.Expr
        Remaining states.
    totals : NamedMapping of sympy.Expr
        All conserved quantities of the model, by the names of their values.

    Examples
    --------
    >>> s, i, b, g = sp.symbols("S I beta gamma")
    >>> sis = Model({s: g * i - b * s * i, i: b * s * i - g * i}, parameters={b: 2, g: 1})
    >>> (one,) = conserved_quantities(sis)
    >>> one.expression, one.total, one.eliminated
    (I + S, 'N', ('I',))
    """

    expression: sp.Expr
    total: str
    eliminated: tuple[str, ...]
    combinations: NamedMapping[sp.Expr]
    totals: NamedMapping[sp.Expr]

    def __str__(self) -> str:
        kept = ", ".join(f'"{n}": {e}' for n, e in self.combinations.items())
        given = ", ".join(f'"{n}": {e}' for n, e in self.totals.items())
        several = len(self.totals) > 1
        listed = ", ".join(f"{n} = {e}" for n, e in self.totals.items())
        head = (
            f"conserved quantities: {listed} are constant"
            if several
            else (f"conserved quantity: {listed} is constant")
        )
        parameters = "parameters" if several else "a parameter"
        return (
            f"{head}, so no equilibrium is isolated; fs.reduce_states(model.rates, {{{kept}}}, "
            f"conserved={{{given}}}) eliminates {' and '.join(self.eliminated)}, with "
            f"{' and '.join(self.totals)} as {parameters}"
        )


@lru_cache(maxsize=64)
def conserved_quantities(model: Model) -> tuple[ConservedQuantity, ...]:
    """Return the linear conserved quantities of a frozen model with at most `MOST_STATES` states.

    Parameters
    ----------
    model : Model

    Examples
    --------
    >>> x, y = sp.symbols("x y")
    >>> conserved_quantities(Model({x: y - x, y: -y}))
    ()
    """
    states = [real(n) for n in model.states]
    if not 1 < len(states) <= MOST_STATES:
        return ()
    rows = [[r.rates[n] for n in model.states] for r in model.regions.values()]
    for reset in model.resets.values():
        rows.append([reset.jump.get(n, real(n)) - real(n) for n in model.states])
    values = {real(n): v for n, v in model.parameters.items()}
    found = constant_null_space(rows, states, values)
    if not found:
        return ()
    # the last states are eliminated: products are usually written after their sources
    reduced, pivots = sp.Matrix([row[::-1] for row in found]).rref(simplify=True)
    left_out = [states[len(states) - 1 - p] for p in pivots]
    weights = _not_negative(
        [[rational_form(e) for e in list(reduced.row(k))[::-1]] for k in range(len(found))], values
    )
    expressions = [sp.Add(*(c * s for c, s in zip(row, states, strict=True))) for row in weights]
    names = itertools.islice(_names(model, len(expressions)), len(expressions))
    totals = NamedMapping("total", dict(zip(names, expressions, strict=True)))
    kept = NamedMapping("state", {s.name: s for s in states if s not in left_out})
    out = tuple(s.name for s in left_out)
    return tuple(ConservedQuantity(e, n, out, kept, totals) for n, e in totals.items())


def _not_negative(
    rows: Sequence[Sequence[sp.Expr]], values: Mapping[sp.Symbol, float]
) -> list[list[sp.Expr]]:
    """Add another row to a row with negative weights if that makes all weights nonnegative."""
    found = []
    for k, row in enumerate(rows):
        others = [r for j, r in enumerate(rows) if j != k]
        forms = [list(row)]
        forms += [[rational_form(a + b) for a, b in zip(row, r, strict=True)] for r in others]
        found.append(next((f for f in forms if _positive(f, values)), list(row)))
    return found


def _positive(row: Sequence[sp.Expr], values: Mapping[sp.Symbol, float]) -> bool:
    numbers = [e.subs(values) for e in row]
    return all(e.is_number and e >= 0 for e in numbers)


def _names(model: Model, count: int) -> Iterator[str]:
    taken = {*model.states, *model.parameters, *model.free, *model.interfaces}
    several = (f"N_{k}" for k in itertools.count(1))
    names = several if count > 1 else itertools.chain(("N", "T", "M"), several)
    return (n for n in names if n not in taken)
