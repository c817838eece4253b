"""The smooth motions of a frozen model: its regions, and sliding along discontinuities."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import sympy as sp

from fastslow.model.interfaces import Region, vanishes_on
from fastslow.model.model import Model
from fastslow.model.structure import real

#: Operations up to which a quotient is cancelled, so that exact zeros stay exact.
SHORT = 150


@dataclass(frozen=True, eq=False)
class Sides:
    """What sliding along an interface lies between.

    Parameters
    ----------
    interface : int
        Number of the interface, h = 0.
    above, below : int
        Numbers of the regions where h > 0 and where h < 0.
    escaping : bool
        Whether both fields point away from the interface.
    drifts : (sympy.Expr, sympy.Expr)
        a = ∇h·f₁ above and b = ∇h·f₂ below.
    """

    interface: int
    above: int
    below: int
    escaping: bool
    drifts: tuple[sp.Expr, sp.Expr]


@dataclass(frozen=True, eq=False)
class Mode:
    """One smooth motion: a region's, or sliding along an interface between two regions.

    Sliding between regions A (h > 0) and B has the name ``"A|B"``, and where both
    fields point away from the interface ``"A|B (escaping)"``. Its rates are
    F = f_s − h ∇h with the sliding field f_s = f₁ + α (f₂ − f₁), α = a/(a − b)
    (Filippov 1988). Because f_s does not change h, the zeros of F on h = 0 are the
    pseudo-equilibria, and the eigenvalues there those of f_s along the interface
    and −|∇h|² across it.

    Parameters
    ----------
    name : str
    rates : tuple of sympy.Expr
    rows : tuple of sympy.Expr
        Switching functions: those of the interfaces and, in a model with sliding, −a and b.
    signs : tuple of int
        Sign of each row within the mode; 0 where a row does not bound it.
    sides : Sides, optional
        For sliding.
    """

    name: str
    rates: tuple[sp.Expr, ...]
    rows: tuple[sp.Expr, ...]
    signs: tuple[int, ...]
    sides: Sides | None = None


def modes_of(model: Model) -> tuple[Mode, ...]:
    """Every region of a frozen model, then sliding and escaping for each discontinuity.

    Examples
    --------
    >>> x, p = sp.symbols("x p")
    >>> [m.name for m in modes_of(Model({x: p - sp.sign(x)}, parameters={p: 0}))]
    ['S1', 'S2', 'S1|S2', 'S1|S2 (escaping)']
    >>> [m.name for m in modes_of(Model({x: p - sp.Abs(x)}, parameters={p: 0}))]
    ['S1', 'S2']
    """
    functions = tuple(i.function for i in model.interfaces.values())
    regions = tuple(
        Mode(
            region.name,
            tuple(region.rates[n] for n in model.states),
            functions,
            tuple(region.signs[i] for i in model.interfaces),
        )
        for region in model.regions.values()
    )
    sliding = tuple(_sliding(model, functions))
    if not sliding:
        return regions
    # the rows of the drifts bound no region: a constant stands for them
    none = (sp.Integer(1), sp.Integer(1))
    longer = (replace(r, rows=(*r.rows, *none), signs=(*r.signs, 0, 0)) for r in regions)
    return (*longer, *sliding)


def drift(model: Model, function: sp.Expr, rates: Sequence[sp.Expr]) -> sp.Expr:
    """Lie derivative ∇h·f of an interface function along rates.

    Examples
    --------
    >>> x, y = real("x"), real("y")
    >>> model = Model({x: y, y: -x})
    >>> drift(model, x - y**2, [y, -x])
    2*x*y + y
    """
    terms = (function.diff(real(n)) * f for n, f in zip(model.states, rates, strict=True))
    return sp.expand(sp.Add(*terms))


def _sliding(model: Model, functions: Sequence[sp.Expr]) -> Iterator[Mode]:
    regions = list(model.regions.values())
    for number, (name, function) in enumerate(zip(model.interfaces, functions, strict=True)):
        for above, upper in enumerate(regions):
            below = _across(regions, upper, name)
            if upper.signs[name] < 0 or below is None:
                continue
            f = [upper.rates[n] for n in model.states]
            g = [regions[below].rates[n] for n in model.states]
            a, b = drift(model, function, f), drift(model, function, g)
            if _alike(a, b, function):
                # the flow crosses wherever it meets the interface transversally
                continue
            share = _short(a / (a - b))
            toward = [function.diff(real(n)) for n in model.states]
            rates = tuple(
                (r if r == s else _short(r + share * (s - r))) - function * normal
                for r, s, normal in zip(f, g, toward, strict=True)
            )
            signs = tuple(0 if i == name else upper.signs[i] for i in model.interfaces)
            for escaping in (False, True):
                away = -1 if escaping else 1
                yield Mode(
                    f"{upper.name}|{regions[below].name}" + " (escaping)" * escaping,
                    rates,
                    (*functions, -a, b),
                    (*signs, away, away),
                    Sides(number, above, below, escaping, (a, b)),
                )


def _across(regions: Sequence[Region], region: Region, name: str) -> int | None:
    """The region that differs in the sign of one interface only."""
    for number, other in enumerate(regions):
        if [i for i in region.signs if region.signs[i] != other.signs[i]] == [name]:
            return number
    return None


def _alike(a: sp.Expr, b: sp.Expr, function: sp.Expr) -> bool:
    """Whether the drifts on both sides are equal on the interface."""
    difference = sp.expand(a - b)
    return difference == 0 or vanishes_on(difference, function)


def _short(expression: sp.Expr) -> sp.Expr:
    """Cancel common terms of a short expression with exact numbers."""
    if expression.has(sp.Float) or sp.count_ops(expression) > SHORT:
        return expression
    return sp.cancel(expression)
